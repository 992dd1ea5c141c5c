# SPDX-License-Identifier: GPL-3.0-or-later
"""A viewport as the hand needs it: rays under the mouse, and the plane that the mouse moves in."""

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
