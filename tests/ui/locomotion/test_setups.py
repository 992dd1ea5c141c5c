# SPDX-License-Identifier: GPL-3.0-or-later
"""Set-ups: one click makes a creature move in another way, and one's own are kept."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.scene.curves import read_route
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.ui.declared_settings import plain
from octo_motion.ui.locomotion.operators import setups
from octo_motion.ui.locomotion.reading.motion import gait_settings
from octo_motion.ui.locomotion.settings import locomotion_settings, read_gait
from tests.ui.rig import click, joints_in_world, make_octopus

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
        assert settings.breathing > 0.055
    bpy.ops.octo_motion.setup_load(name="walk")
    assert settings.travel_on == "OBJECT"
    assert settings.breathing == pytest.approx(0.05)
    # Who has chosen In Place for a walk keeps it.
    settings.travel_on = "NONE"
    bpy.ops.octo_motion.setup_load(name="hurry")
    assert settings.travel_on == "NONE"
    settings.travel_on = "BONE"
    bpy.ops.octo_motion.setup_load(name="swim")
    assert settings.travel_on == "BONE"


@pytest.mark.parametrize("name", ["walk", "swim"])
def test_as_published_arms_take_the_shape_that_sweeps_alone_give_them(
    name: str, settings: Any
) -> None:
    bpy.ops.octo_motion.setup_load(name=f"{name}_as_published")
    table = gait_settings(settings, read_gait(settings))
    assert (table.softness, table.stretch_slack, table.smoothing_cycles) == (0.0, 0.0, 0.0)
    assert (table.lateral_bend, table.raise_to_floor) == (0.0, False)
    # Eq. 3.8-3.10 turn pitch and 3.15-3.17 head; links shorten in the walk alone.
    knots = table.gait.curve(1).angles
    turned, still = (1, 0) if name == "walk" else (0, 1)
    assert abs(knots[..., turned]).max() > 1.0
    assert not knots[..., [still, 2]].any()
    assert table.contraction == (1.0 if name == "walk" else 0.0)
    # Nothing but the curve's own parameter says how fast it goes (eq. 3.19), and nothing is held.
    bpy.ops.octo_motion.add_route()
    settings.timing, settings.frame_end = "RANGE", 9
    click("generate_locomotion")
    armature = settings.id_data
    route = read_route(settings.route)
    for frame in (1, 3, 6, 9):
        place = joints_in_world(armature, frame)[0, 0]
        # Where a cubic Bézier's parameter is at even times.
        expected = bezier(settings.route, (frame - 1) / 8)
        assert np.linalg.norm((place - expected)[:2]) < 1e-3 * route.length
    assert {item.kind for item in settings.figures} <= {"MISS", "TURN", "OVERLAP"}


def bezier(curve: Any, at: float) -> np.ndarray:
    first, last = curve.data.splines[0].bezier_points
    points = np.array([first.co, first.handle_right, last.handle_left, last.co])
    shares = [(1 - at) ** 3, 3 * at * (1 - at) ** 2, 3 * at**2 * (1 - at), at**3]
    return np.array(curve.matrix_world)[:3, :3] @ (shares @ points) + np.array(
        curve.matrix_world.translation
    )


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


def test_a_click_on_a_picture_loads_the_set_up_and_marks_it(settings: Any) -> None:
    manager: Any = bpy.context.window_manager
    assert manager.octo_motion_setup == "walk"
    manager.octo_motion_setup = "tiptoe"
    assert settings.gait == "tiptoe"
    assert manager.octo_motion_setup == "tiptoe"
    # Another armature has its own.
    make_octopus("Other")
    assert manager.octo_motion_setup == "walk"


def test_names_below_the_pictures_outlive_what_blender_was_told() -> None:
    # Blender keeps pointers to the texts of an enumeration, not the texts.
    told = list(setups._offered(None, None))
    again = setups._offered(None, None)
    assert [item[0] for item in told] == list(setups.setup_paths())
    assert all(
        one is other
        for first, second in zip(told, again, strict=True)
        for one, other in zip(first[:3], second[:3], strict=True)
    )


def test_names_below_the_pictures_follow_the_language(monkeypatch: pytest.MonkeyPatch) -> None:
    # Blender as a Python module speaks English alone: tests/window sees it in Japanese.
    said = {"Hurry": "急ぎ足"}
    before = setups._offered(None, None)
    monkeypatch.setattr(setups, "translated", lambda text: said.get(str(text), str(text)))
    after = setups._offered(None, None)
    assert [item[0] for item in after] == [item[0] for item in before]
    assert {item[1] for item in after} - {item[1] for item in before} == {"急ぎ足"}


def test_a_click_on_the_picture_of_a_damaged_set_up_leaves_all_as_it_was(
    settings: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "walk.py").write_text("1 / 0", encoding="utf-8")
    paths = {**setups.setup_paths(), "walk": tmp_path / "walk.py"}
    monkeypatch.setattr(setups, "setup_paths", lambda: paths)
    bpy.ops.octo_motion.setup_load(name="swim")
    before = state(settings)
    manager: Any = bpy.context.window_manager
    manager.octo_motion_setup = "walk"
    assert state(settings) == before
    assert manager.octo_motion_setup == "swim"


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
