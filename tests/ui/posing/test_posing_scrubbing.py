# SPDX-License-Identifier: GPL-3.0-or-later
"""Going through the frames while a session goes on, without undo steps of Blender's own."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from octo_motion.ui.posing.viewport import frame_under, go_to, strip_under


def area(kind: str, y: int, *, ui_type: str = "") -> Any:
    """An area of 400 by 200 pixels whose frames are two pixels wide, from frame 10 on."""
    view = SimpleNamespace(region_to_view=lambda x, _y: (10.0 + x / 2.0, 0.0))
    region = SimpleNamespace(type="WINDOW", x=100, y=y, width=400, height=200, view2d=view)
    header = SimpleNamespace(type="HEADER", x=100, y=y + 200, width=400, height=26)
    return SimpleNamespace(type=kind, ui_type=ui_type or kind, regions=[header, region])


@pytest.fixture
def window() -> Any:
    areas = [
        area("VIEW_3D", 500),
        area("DOPESHEET_EDITOR", 0, ui_type="TIMELINE"),
        area("GRAPH_EDITOR", 250, ui_type="DRIVERS"),
    ]
    return SimpleNamespace(screen=SimpleNamespace(areas=areas))


def test_strip_of_frame_numbers_is_found_and_nothing_beside_it(window: Any) -> None:
    assert strip_under(window, 200, 190) is not None
    for x, y in ((200, 150), (200, 210), (50, 190), (200, 690), (200, 440)):
        assert strip_under(window, x, y) is None


def test_frame_is_the_one_under_the_mouse_also_beside_the_strip(window: Any) -> None:
    strip = strip_under(window, 200, 190)
    assert strip is not None
    assert frame_under(window, strip, 200) == 60
    assert frame_under(window, strip, 80) == 0
    window.screen.areas = window.screen.areas[:1]
    assert frame_under(window, strip, 200) is None


def test_scrubbing_keeps_the_bounds_that_blender_keeps() -> None:
    scene: Any = bpy.context.scene
    go_to(scene, -20)
    assert scene.frame_current == 0
    preferences: Any = bpy.context.preferences
    preferences.edit.use_negative_frames = True
    go_to(scene, -20)
    assert scene.frame_current == -20
    preferences.edit.use_negative_frames = False
    scene.frame_start, scene.frame_end = 5, 30
    scene.lock_frame_selection_to_range = True
    go_to(scene, 90)
    assert scene.frame_current == 30
    scene.use_preview_range, scene.frame_preview_start, scene.frame_preview_end = True, 8, 20
    go_to(scene, 90)
    assert scene.frame_current == 20
