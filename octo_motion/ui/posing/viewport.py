# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies under the mouse in a window: a 3D view with its rays, or the strip of a timeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np
from bpy_extras import view3d_utils
from mathutils import Vector

from ...core.rotations import Floats

_BESIDE: Final = frozenset({"UI", "TOOLS", "HEADER", "TOOL_HEADER", "ASSET_SHELF", "HUD"})
"""Regions that may lie over the view itself."""


@dataclass(frozen=True, eq=False)
class View:
    """One region of a 3D viewport, for as long as an event lasts."""

    region: bpy.types.Region
    data: bpy.types.RegionView3D

    def ray(self, x: float, y: float) -> tuple[Floats, Floats]:
        """Origin and direction (3,) of the ray under a pixel of the region."""
        pixel = x, y
        origin = view3d_utils.region_2d_to_origin_3d(self.region, self.data, pixel)
        way = view3d_utils.region_2d_to_vector_3d(self.region, self.data, pixel)
        return np.array(origin, dtype=np.float64), np.array(way, dtype=np.float64)

    def at_depth(self, x: float, y: float, point: Floats) -> Floats:
        """The place (3,) under a pixel, as far away as a point."""
        found = view3d_utils.region_2d_to_location_3d(
            self.region, self.data, (x, y), Vector(point.tolist())
        )
        return np.array(found, dtype=np.float64)

    def axes(self) -> Floats:
        """(3, 3) as columns: right, up, and towards the eye."""
        return np.array(self.data.view_matrix.inverted(), dtype=np.float64)[:3, :3]


def view_under(window: bpy.types.Window, x: int, y: int) -> tuple[View, float, float] | None:
    """The 3D viewport under a pixel of the window, and the pixel in it.

    None over panels and headers, and over other editors.
    """
    for area in window.screen.areas:
        if area.type != "VIEW_3D":
            continue
        main = None
        for region in area.regions:
            inside = (
                region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
            )
            if inside and region.type in _BESIDE and min(region.width, region.height) > 1:
                main = None
                break
            if inside and region.type == "WINDOW":
                main = region
        if main is not None:
            # Of four views in an area, each has its own.
            data: Any = main.data
            if data is not None:
                return View(main, data), x - main.x, y - main.y
    return None


# --- Going through the frames by the strip at the top of a timeline, while a session goes on ------
#
# Blender's own operator for it makes an undo step of each drag, and a session is to be one. So the
# session takes these drags itself and sets the frame, as it does for the arrow keys.


_EDITORS: Final = frozenset({"DOPESHEET_EDITOR", "GRAPH_EDITOR", "NLA_EDITOR"})
_TIMELESS: Final = frozenset({"DRIVERS"})
_STRIP: Final = 23.0
"""Height of the strip with the frame numbers, in pixels of a screen without scaling."""


def strip_under(window: bpy.types.Window, x: int, y: int) -> int | None:
    """The area with a strip of frame numbers under a pixel of the window; None beside one."""
    preferences = bpy.context.preferences
    scale = (preferences and preferences.system.ui_scale) or 1.0
    for number, area in enumerate(window.screen.areas):
        region = _time_region(area)
        if region is None:
            continue
        top = region.y + region.height
        if region.x <= x < region.x + region.width and top - _STRIP * scale <= y < top:
            return number
    return None


def frame_under(window: bpy.types.Window, area: int, x: int) -> int | None:
    """The frame at a pixel of the window, over the strip or not; None if the strip is gone."""
    areas = window.screen.areas
    region = _time_region(areas[area]) if area < len(areas) else None
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
