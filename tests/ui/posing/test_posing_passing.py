# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets of the events of a session, by its own keymaps, and what it does not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from octo_motion.ui.posing.controls import Outcome
from octo_motion.ui.posing.passing import left_to_blender
from octo_motion.ui.posing.puppet_session import PuppetSession

from .test_posing import VIEW, Event, PoseControls, drag, tip

SIDEBAR, VIEWPORT, HEADER = (780, 500), (400, 500), (400, 790)
TIMELINE, PLAYBACK, OUTLINER, BETWEEN = (400, 50), (400, 110), (1100, 500), (5000, 5000)


def region(kind: str, x: int, y: int, width: int, height: int, **more: Any) -> Any:
    return SimpleNamespace(type=kind, x=x, y=y, width=width, height=height, **more)


def area(kind: str, x: int, y: int, width: int, height: int, *regions: Any, ui: str = "") -> Any:
    space = SimpleNamespace(show_gizmo=True, show_gizmo_navigate=True)
    place = {"x": x, "y": y, "width": width, "height": height}
    spaces = SimpleNamespace(active=space)
    return SimpleNamespace(type=kind, ui_type=ui or kind, regions=regions, spaces=spaces, **place)


def window(category: str = "Octo Motion") -> Any:
    """A viewport with its sidebar over a timeline, and an outliner beside it."""
    side = region("UI", 600, 200, 200, 580, alignment="RIGHT", active_panel_category=category)
    view = (region("WINDOW", 0, 200, 800, 600), region("HEADER", 0, 780, 800, 20), side)
    time = (region("WINDOW", 0, 0, 800, 100), region("HEADER", 0, 100, 800, 26))
    areas = [
        area("VIEW_3D", 0, 200, 800, 600, *view),
        area("DOPESHEET_EDITOR", 0, 0, 800, 126, *time, ui="TIMELINE"),
        area("OUTLINER", 1000, 200, 200, 600, region("WINDOW", 1000, 200, 200, 600)),
    ]
    return SimpleNamespace(screen=SimpleNamespace(areas=areas))


@pytest.fixture(autouse=True)
def keymaps() -> None:
    """Blender's own, which it loads for a window."""
    bpy.utils.keyconfig_init()


def fate(
    key: str, place: tuple[int, int], *, value: str = "PRESS", mode: str = "POSE", **at: Any
) -> Outcome:
    """What becomes of an event at a place, with the keys held down that come after a plus."""
    kind, *held = key.split("+")
    keys = {each: each in held for each in ("shift", "ctrl", "alt", "oskey")}
    event = SimpleNamespace(type=kind, value=value, mouse_x=place[0], mouse_y=place[1], **keys)
    return left_to_blender(window(**at), event, mode)


EDITING = (
    *("X", "DEL", "H", "S", "A", "B", "C", "I", "E", "F2", "F3", "F9", "F12", "SLASH+alt"),
    *("D+shift", "H+alt", "R+shift", "A+shift", "V+ctrl", "P+ctrl", "G+alt", "Z+ctrl"),
    *("NUMPAD_0+ctrl", "NUMPAD_0+ctrl+alt", "NUMPAD_PLUS+ctrl", "RIGHTMOUSE", "F5+shift"),
)
VIEWING = (
    *("MIDDLEMOUSE", "MIDDLEMOUSE+shift", "MIDDLEMOUSE+ctrl", "MIDDLEMOUSE+alt"),
    *("WHEELUPMOUSE", "WHEELDOWNMOUSE", "WHEELUPMOUSE+alt", "NUMPAD_1", "NUMPAD_0"),
    *("NUMPAD_5", "NUMPAD_PERIOD", "HOME", "ACCENT_GRAVE", "Z", "SPACE", "SPACE+ctrl"),
    *("UP_ARROW", "RIGHT_ARROW+shift", "N", "T", "S+ctrl", "Q+ctrl", "O+ctrl"),
)


@pytest.mark.parametrize("mode", ["POSE", "OBJECT"])
@pytest.mark.parametrize(
    "place", [VIEWPORT, HEADER, SIDEBAR, TIMELINE, PLAYBACK, OUTLINER, BETWEEN]
)
def test_keys_that_edit_do_nothing_wherever_the_mouse_is(place: tuple[int, int], mode: str) -> None:
    passed = [key for key in EDITING if fate(key, place, mode=mode) is not Outcome.TAKEN]
    assert passed == []


@pytest.mark.parametrize("place", [VIEWPORT, HEADER, TIMELINE, OUTLINER])
def test_clicks_beside_limbs_select_nothing(place: tuple[int, int]) -> None:
    for value in ("PRESS", "CLICK", "DOUBLE_CLICK", "CLICK_DRAG"):
        for key in ("LEFTMOUSE", "LEFTMOUSE+shift", "LEFTMOUSE+ctrl", "LEFTMOUSE+alt"):
            assert fate(key, place, value=value) is Outcome.TAKEN


def test_view_time_playback_and_the_file_are_blenders() -> None:
    assert [key for key in VIEWING if fate(key, VIEWPORT) is not Outcome.PASSED] == []


def test_pads_and_timers_are_blenders() -> None:
    for kind in ("TRACKPADPAN", "TRACKPADZOOM", "NDOF_MOTION", "MOUSEMOVE", "TIMER1"):
        assert fate(kind, VIEWPORT, value="NOTHING") is Outcome.PASSED


def test_our_panel_and_the_buttons_of_playback_can_be_clicked() -> None:
    assert fate("LEFTMOUSE", SIDEBAR) is Outcome.PASSED
    assert fate("LEFTMOUSE", PLAYBACK) is Outcome.PASSED
    assert fate("LEFTMOUSE", BETWEEN) is Outcome.PASSED
    # Of another tab of the sidebar only the tabs, which lead back to ours.
    beside = (SIDEBAR[0] - 100, SIDEBAR[1])
    assert fate("LEFTMOUSE", beside, category="Item") is Outcome.TAKEN
    assert fate("LEFTMOUSE", (795, 500), category="Item") is Outcome.PASSED
    # The gizmo of navigation is beside the sidebar.
    assert fate("LEFTMOUSE", (560, 740)) is Outcome.PASSED
    assert fate("LEFTMOUSE", (460, 740)) is Outcome.TAKEN


def test_wheel_and_middle_button_move_other_editors_too() -> None:
    for place in (TIMELINE, OUTLINER):
        assert fate("MIDDLEMOUSE", place) is Outcome.PASSED
        assert fate("WHEELUPMOUSE+ctrl", place) is Outcome.PASSED
    assert fate("HOME", TIMELINE) is Outcome.PASSED


@pytest.mark.parametrize("mode", ["POSE", "OBJECT"])
def test_tab_ends_the_session(mode: str) -> None:
    assert fate("TAB", VIEWPORT, mode=mode) is Outcome.FINISH
    assert fate("TAB", VIEWPORT, mode=mode, value="RELEASE") is Outcome.TAKEN
    assert fate("TAB", TIMELINE, mode=mode) is Outcome.TAKEN
    assert fate("TAB+ctrl", VIEWPORT, mode=mode) is Outcome.TAKEN


@pytest.fixture
def other_key() -> Iterator[Any]:
    """The artist has another key for looking at all, and another one for deleting."""
    keymap = bpy.context.window_manager.keyconfigs.user.keymaps["3D View"]
    items = [keymap.keymap_items.new("view3d.view_all", "J", "PRESS")]
    items.append(keymap.keymap_items.new("object.delete", "HOME", "PRESS", alt=True))
    yield
    for each in items:
        keymap.keymap_items.remove(each)


def test_keys_that_the_artist_has_changed_count(other_key: None) -> None:  # noqa: ARG001
    assert fate("J", VIEWPORT) is Outcome.PASSED
    assert fate("HOME+alt", VIEWPORT) is Outcome.TAKEN


# --- Steps forward, and the note that the file has changed ----------------------------------------


def test_ctrl_shift_z_brings_back_what_ctrl_z_took_back(
    octopus: Any, controls: PoseControls
) -> None:
    start = tip(octopus)
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    first = tip(octopus)
    drag(controls, "arm1.04.L", (40.0, 40.0))
    second = tip(octopus)
    for kind, shown in (("", first), ("", start), ("s", first), ("s", second), ("s", second)):
        event = Event("Z", ctrl=True, shift=bool(kind))
        assert controls.handle(event, VIEW) is Outcome.TAKEN
        assert tip(octopus) == pytest.approx(shown, abs=1e-5)
    assert "Nothing to bring back" in controls.status()
    # Another drag is another future.
    controls.handle(Event("Z", ctrl=True), VIEW)
    drag(controls, "arm1.04.L", (10.0, 0.0), ticks=5)
    controls.handle(Event("Z", ctrl=True, shift=True), VIEW)
    assert "Nothing to bring back" in controls.status()


@pytest.mark.parametrize("how", ["K", "let go"])
def test_blender_asks_before_it_drops_what_a_session_has_changed(
    how: str,
    octopus: Any,  # noqa: ARG001
    tmp_path: Path,
) -> None:
    preferences: Any = bpy.context.preferences
    steps = preferences.edit.undo_steps
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    armature = bpy.data.objects["Octopus"]
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    if bpy.data.is_dirty:
        session.cancel()
        pytest.skip("Blender 4.5 without a window takes every file for changed")
    if how == "K":
        assert session.key(all_bones=True)
    else:
        session.grab_bone("arm1.04.L", 1.0)
        session.release()
    assert bpy.data.is_dirty
    assert preferences.edit.undo_steps == steps
    session.cancel()
