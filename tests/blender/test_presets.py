# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's own gaits: files that any name can have, written whole or not at all."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.blender.files import user_files as presets
from octo_motion.core.errors import GaitError, WriteError
from octo_motion.core.locomotion.gait import table as gait


@pytest.fixture(autouse=True)
def no_gaits_of_the_user() -> Iterator[None]:
    yield
    for path in presets.user_folder().glob("*"):
        path.unlink()


def my_gait(name: str = "my walk") -> gait.GaitTable:
    return gait.renamed_gait(gait.gait_presets()["walk"], name)


def test_a_gait_comes_back_as_it_was_saved() -> None:
    presets.save_gait(my_gait())
    assert "my walk" in presets.gait_names()
    assert gait.gait_to_json(presets.load_gait("my walk")) == gait.gait_to_json(my_gait())


def test_gaits_of_the_extension_come_first() -> None:
    presets.save_gait(my_gait("a walk"))
    assert presets.gait_names() == [*gait.gait_presets(), "a walk"]


def test_it_is_known_which_gaits_there_are() -> None:
    presets.save_gait(my_gait())
    assert all(map(presets.has_gait, presets.gait_names()))
    assert not any(map(presets.has_gait, ("", "hop", "my")))


@given(name=st.text(min_size=1, max_size=presets.LONGEST_NAME).filter(str.strip))
def test_any_name_has_a_file_of_its_own(name: str) -> None:
    path = presets._path_of(name)
    assert path.parent == presets.user_folder()
    assert not set('<>:"/\\|?*') & set(path.name)
    assert path.stem not in {"", ".", ".."}
    assert presets.name_of(path) == name


@pytest.mark.parametrize("name", ["con", "NUL.x", "a/b", "..", "Größe ½", "100%", "%2f", " x ."])
def test_odd_names_are_saved_listed_and_loaded(name: str) -> None:
    presets.save_gait(my_gait(name))
    assert presets.user_gait_names() == [name]
    assert presets.load_gait(name).name == name
    presets.remove_gait(name)
    assert presets.user_gait_names() == []


def test_a_gait_is_overwritten_only_on_demand() -> None:
    presets.save_gait(my_gait())
    with pytest.raises(GaitError, match="already"):
        presets.save_gait(my_gait())
    other = gait.renamed_gait(gait.gait_presets()["swim"], "my walk")
    presets.save_gait(other, overwrite=True)
    assert presets.load_gait("my walk").manner == "SWIM"


@pytest.mark.parametrize(
    ("name", "told"),
    [("", "no name"), ("  ", "no name"), ("x" * 61, "61 letters"), ("walk", "comes with")],
)
def test_names_that_cannot_be_are_refused(name: str, told: str) -> None:
    with pytest.raises(GaitError, match=told):
        presets.save_gait(my_gait(name))
    assert presets.user_gait_names() == []


def test_loading_says_what_there_is() -> None:
    told = r"no gait 'hop'\. Choose one of crawl, .*swim, .*walk, walk_literal"
    with pytest.raises(GaitError, match=told):
        presets.load_gait("hop")
    with pytest.raises(GaitError, match="No gait is chosen"):
        presets.load_gait("")


def test_removing_says_what_cannot_be_removed() -> None:
    with pytest.raises(GaitError, match="no saved gait 'hop'"):
        presets.remove_gait("hop")
    with pytest.raises(GaitError, match="comes with Octo Motion"):
        presets.remove_gait("walk")


def test_a_damaged_file_is_listed_and_says_so_when_loaded() -> None:
    path = presets.save_gait(my_gait())
    path.write_text("{", encoding="utf-8")
    assert presets.user_gait_names() == ["my walk"]
    with pytest.raises(GaitError, match=r"'my walk.json' is not JSON"):
        presets.load_gait("my walk")
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(GaitError, match=r"'my walk.json' cannot be read"):
        presets.load_gait("my walk")


def test_a_file_that_cannot_be_written_is_told_and_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match="cannot write"):
        presets.write_gait(my_gait(), tmp_path / "missing" / "x.json")
    # The name is taken by a folder, so the finished file cannot get its name.
    (tmp_path / "x.json").mkdir()
    with pytest.raises(WriteError, match="cannot write"):
        presets.write_gait(my_gait(), tmp_path / "x.json")
    assert [path.name for path in tmp_path.iterdir()] == ["x.json"]


def test_offsets_of_single_arms_are_kept() -> None:
    from dataclasses import replace

    table = replace(my_gait(), offsets={(1, "LEFT"): np.pi / 3})
    presets.save_gait(table)
    assert presets.load_gait("my walk").offsets == pytest.approx(table.offsets)
