# SPDX-License-Identifier: GPL-3.0-or-later
"""Set-ups: one click makes a creature move in another way, and one's own are kept."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.core.locomotion.gait import table as gait
from octo_motion.ui.declared_settings import plain
from octo_motion.ui.locomotion.operators import setups
from octo_motion.ui.locomotion.settings import locomotion_settings, read_gait
from tests.ui.rig import click, make_octopus

DOCS = Path(__file__).resolve().parents[3] / "docs"
SHIPPED = sorted(path.stem for path in (setups.PACKAGE / "presets" / setups.FOLDER).glob("*.py"))


@pytest.fixture(autouse=True)
def no_setups_of_the_user() -> Iterator[None]:
    yield
    folder = bpy.utils.user_resource("SCRIPTS", path=f"presets/{setups.FOLDER}")
    for path in Path(folder).glob("*.py"):
        path.unlink()


@pytest.fixture
def settings() -> Any:
    return locomotion_settings(make_octopus())


def state(settings: Any) -> dict[str, Any]:
    values = {path: settings.path_resolve(path) for path in setups.governed()}
    return {**values, "gait": gait.gait_to_json(read_gait(settings))}


def test_there_are_ways_to_walk_run_sneak_crawl_rest_swim_and_flee() -> None:
    assert set(SHIPPED) == set(setups.ORDER)
    assert list(setups.setup_paths())[: len(SHIPPED)] == list(setups.ORDER)


def test_every_setup_has_its_row_in_the_guide_with_its_name_and_its_picture() -> None:
    guide = (DOCS / "guide.md").read_text(encoding="utf-8")
    row = re.compile(r"^\| !\[(.+)\]\(\.\./(.+)\) \| (.+?) \| (.+) \|$", re.MULTILINE)
    rows = [found.groups() for found in row.finditer(guide) if "/setups/" in found[2]]
    expected = []
    for name in setups.ORDER:
        title = name.replace("_", " ").title()
        picture = setups.setup_paths()[name].with_suffix(".png")
        expected.append((title, picture.relative_to(DOCS.parent).as_posix(), title))
    assert [found[:3] for found in rows] == expected


def test_the_gallery_shows_the_setups_that_there_are() -> None:
    # Written by `make pictures ARGS=setups` together with the picture.
    shown = (DOCS / "images" / "setups.txt").read_text(encoding="utf-8").split()
    assert shown == list(setups.ORDER), "make pictures ARGS=setups"


@pytest.mark.parametrize("name", SHIPPED)
def test_button_of_a_setup_shows_a_picture_of_it(name: str) -> None:
    header = setups.setup_paths()[name].with_suffix(".png").read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert int.from_bytes(header[16:20]) == int.from_bytes(header[20:24]) >= 128


@pytest.mark.parametrize("name", SHIPPED)
def test_setup_of_the_add_on_generates_without_a_warning(name: str, settings: Any) -> None:
    bpy.ops.octo_motion.setup_load(name=name)
    bpy.ops.octo_motion.add_route()
    assert click("generate_locomotion") == {"FINISHED"}
    assert settings.result is not None


@pytest.mark.parametrize("name", SHIPPED)
def test_setup_says_everything_that_it_is_about(name: str, settings: Any) -> None:
    bpy.ops.octo_motion.setup_load(name=name)
    fresh = state(settings)
    settings.contraction, settings.sway, settings.cycle_time = 0.3, 1.0, 9.0
    settings.table.stride = 2.5
    bpy.ops.octo_motion.setup_load(name=name)
    assert state(settings) == fresh


def test_idle_and_curl_stay_and_the_next_setup_goes_again(settings: Any) -> None:
    for name in ("idle", "curl"):
        bpy.ops.octo_motion.setup_load(name=name)
        assert settings.travel_on == "NONE"
        assert settings.breathing > 0.0
    bpy.ops.octo_motion.setup_load(name="walk")
    assert (settings.travel_on, settings.breathing) == ("OBJECT", 0.0)
    # Who has chosen In Place for a walk keeps it.
    settings.travel_on = "NONE"
    bpy.ops.octo_motion.setup_load(name="hurry")
    assert settings.travel_on == "NONE"
    settings.travel_on = "BONE"
    bpy.ops.octo_motion.setup_load(name="swim")
    assert settings.travel_on == "BONE"


def test_setup_leaves_shot_rig_and_keys_alone(settings: Any) -> None:
    bpy.ops.octo_motion.add_route()
    settings.frame_start, settings.keys, settings.seed = 17, "REDUCED", 5
    route, arms = settings.route, len(settings.arms)
    bpy.ops.octo_motion.setup_load(name="swim")
    assert settings.table.manner == "SWIM"
    assert (settings.frame_start, settings.keys, settings.seed) == (17, "REDUCED", 5)
    assert (settings.route, len(settings.arms)) == (route, arms)


def test_own_setup_comes_back_with_every_angle_of_its_table(settings: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="swim")
    settings.contraction = 0.25
    settings.table.curves[0].knots[1].head[0] = 0.5
    kept = state(settings)
    bpy.ops.octo_motion.setup_add(name="My Drift")
    bpy.ops.octo_motion.setup_load(name="walk")
    assert state(settings) != kept
    bpy.ops.octo_motion.setup_load(name="My_Drift")
    assert state(settings) == kept
    assert list(setups.setup_paths())[-1] == "My_Drift"


def test_own_setup_is_removed_and_those_of_the_add_on_are_not(settings: Any) -> None:
    assert settings
    bpy.ops.octo_motion.setup_add(name="Mine")
    bpy.ops.octo_motion.setup_add(name="Mine", remove_name=True)
    assert "Mine" not in setups.setup_paths()


def test_loading_a_setup_is_one_undo_step(settings: Any) -> None:
    armature = settings.id_data.name
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.octo_motion.setup_load("EXEC_DEFAULT", True, name="swim")  # noqa: FBT003 - undo
    bpy.ops.ed.undo()
    assert locomotion_settings(bpy.data.objects[armature]).table.manner == "WALK"


def test_unknown_setup_is_refused_with_the_names_that_there_are(settings: Any) -> None:
    before = state(settings)
    with pytest.raises(RuntimeError, match=r"There is no set-up 'jog'\. Choose one of walk, "):
        bpy.ops.octo_motion.setup_load(name="jog")
    assert state(settings) == before


@pytest.mark.parametrize(
    "line", ["settings.no_such.value = 1", "1 +", "settings.table.as_text = 'x'"]
)
@pytest.mark.parametrize("gait", ["", "swim"])
def test_a_damaged_setup_is_refused_and_leaves_everything_as_it_was(
    line: str, gait: str, settings: Any
) -> None:
    bpy.ops.octo_motion.setup_add(name="Broken")
    path = setups.setup_paths()["Broken"]
    path.write_text(path.read_text(encoding="utf-8") + line + "\n", encoding="utf-8")
    if gait:
        bpy.ops.octo_motion.setup_load(name=gait)
        settings.table.curves[0].knots[0].head[0] = 0.3
    settings.sway, settings.travel_on = 0.4, "BONE"
    before = plain(settings, without=frozenset({"as_text"}))
    with pytest.raises(RuntimeError, match="The set-up 'Broken' is damaged: "):
        bpy.ops.octo_motion.setup_load(name="Broken")
    assert plain(settings, without=frozenset({"as_text"})) == before
