# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that earlier versions saved open with all their settings.

saved_0_1_0.blend was made by Octo Motion 0.1.0 in Blender 4.5: an octopus whose every setting of
locomotion, splicing and posing differs from its default, with two items in every list, and a
marker of a contact. saved_0_1_0.json is what those settings were then. How both were made is in
make_saved_0_1_0.py beside them.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.ui.declared_settings import plain

DATA = Path(__file__).resolve().parents[1] / "data"


def values(told: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every single value of nested dictionaries and lists, with where it stands."""
    if isinstance(told, dict | list) and told:
        for key, each in told.items() if isinstance(told, dict) else enumerate(told):
            yield from values(each, f"{path}/{key}")
    else:
        yield path, told


@pytest.fixture
def saved() -> dict[str, Any]:
    """Opens the file; what its settings were when it was saved, by object."""
    bpy.ops.wm.open_mainfile(filepath=str(DATA / "saved_0_1_0.blend"))
    return json.loads((DATA / "saved_0_1_0.json").read_text(encoding="utf-8"))


def test_a_file_of_0_1_0_opens_with_all_its_settings(saved: dict[str, Any]) -> None:
    for name, told in saved.items():
        item: Any = bpy.data.objects[name]
        now = dict(values(plain(item.octo_motion, without=frozenset({"as_text"}))))
        before = {path: value for path, value in values(told) if not path.endswith("/as_text")}
        if item.type != "ARMATURE":
            # What never walks has the defaults of now.
            for path in ("/locomotion/breathing", "/locomotion/ground/duty"):
                before.pop(path, None)
        assert len(before) > 150
        assert {path: now.get(path, "gone") for path in before} == before


def test_every_setting_of_that_file_differs_from_its_default(saved: dict[str, Any]) -> None:
    """So that one which is lost is seen to be."""
    fresh: Any = bpy.data.objects.new("Fresh", None)
    default = dict(values(plain(fresh.octo_motion)))
    told = {kind: saved["Octopus"][kind] for kind in ("locomotion", "splicing", "posing")}
    told["contact"] = saved["Marker"]["contact"]
    same = {path for path, value in values(told) if default.get(path, "in a list") == value}
    assert same <= {"/locomotion/table/as_text"}
