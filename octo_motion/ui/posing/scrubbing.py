# SPDX-License-Identifier: GPL-3.0-or-later
"""Going through the frames by the strip at the top of a timeline, while a session goes on.

Blender's own operator for it makes an undo step of each drag, and a session is to be one. So the
session takes these drags itself and sets the frame, as it does for the arrow keys.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import bpy

_EDITORS: Final = frozenset({"DOPESHEET_EDITOR", "GRAPH_EDITOR", "NLA_EDITOR"})
_TIMELESS: Final = frozenset({"DRIVERS"})
_STRIP: Final = 23.0
"""Height of the strip with the frame numbers, in pixels of a screen without scaling."""


@dataclass(frozen=True)
class Strip:
    """Where a drag began: which area of the screen, by its number."""

    area: int


def strip_under(window: bpy.types.Window, x: int, y: int) -> Strip | None:
    """The strip of frame numbers under a pixel of the window; None beside one."""
    preferences = bpy.context.preferences
    scale = (preferences and preferences.system.ui_scale) or 1.0
    for number, area in enumerate(window.screen.areas):
        region = _time_region(area)
        if region is None:
            continue
        top = region.y + region.height
        if region.x <= x < region.x + region.width and top - _STRIP * scale <= y < top:
            return Strip(number)
    return None


def frame_under(window: bpy.types.Window, strip: Strip, x: int) -> int | None:
    """The frame at a pixel of the window, over the strip or not; None if the strip is gone."""
    areas = window.screen.areas
    region = _time_region(areas[strip.area]) if strip.area < len(areas) else None
    if region is None:
        return None
    place: Any = region.view2d.region_to_view(float(x - region.x), 0.0)
    return round(place[0])


def go_to(scene: bpy.types.Scene, frame: int) -> None:
    """Show a frame, within the bounds that Blender's own scrubbing keeps."""
    preferences = bpy.context.preferences
    if preferences is None or not preferences.edit.use_negative_frames:
        frame = max(frame, 0)
    if getattr(scene, "lock_frame_selection_to_range", False):
        playing: Any = scene
        start, end = playing.frame_start, playing.frame_end
        if playing.use_preview_range:
            start, end = playing.frame_preview_start, playing.frame_preview_end
        frame = min(max(frame, start), end)
    if frame != scene.frame_current or scene.frame_subframe:
        scene.frame_set(frame)


def _time_region(area: bpy.types.Area) -> bpy.types.Region | None:
    if area.type not in _EDITORS or area.ui_type in _TIMELESS:
        return None
    return next((region for region in area.regions if region.type == "WINDOW"), None)
