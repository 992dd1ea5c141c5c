# SPDX-License-Identifier: GPL-3.0-or-later
"""The walking octopus on grounds that are not level, made with the operators that artists have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import bpy
import contact_sheet
import numpy as np
import stage
from mathutils import Vector
from numpy.typing import NDArray
from shots import RATE
from stage import Pixels, Points

_CELL: Final = (264, 198)
_PICTURES: Final = 4
_CYCLE: Final = 2.0
"""Seconds of a cycle."""
_WAY: Final = ((0.0, 1.2, 0.0), (0.0, 0.4, 0.0), (0.0, -0.4, 0.0), (0.0, -1.2, 0.0))
"""Control points of the route, in metres."""
_SIZE: Final = 2.6
"""Half of the ground's side, in metres."""
_STEP: Final = 0.03
_TILES: Final = ((0.50, 0.43, 0.31), (0.40, 0.34, 0.24))
_TILE: Final = 5
"""Faces along a tile."""
_SEEN: Final = 1.6
"""Metres across a picture."""
_AWAY: Final = np.array([0.93, 0.25, -0.27])
"""Where the camera looks."""
_UP: Final = np.array([0.0, 0.0, 1.0])

Heights = Callable[[Points, Points], NDArray[np.float64]]


def _bumps(x: Points, y: Points) -> Points:
    """Hills of 0.3 arm lengths."""
    return 0.09 * np.sin(2.0 * np.pi * x / 0.84) * np.cos(2.0 * np.pi * y / 0.72)


def _slope(x: Points, y: Points) -> Points:
    """Twenty degrees uphill."""
    return -np.tan(np.radians(20.0)) * y + 0.0 * x


def sheet() -> Pixels:
    """A cycle on bumps, and one up a slope."""
    return contact_sheet.joined([_row(_bumps, "bumps"), _row(_slope, "slope of 20°")])


def _row(heights: Heights, name: str) -> list[Pixels]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = stage.the_scene()
    scene.render.fps = RATE
    bpy.ops.octo_motion.add_octopus()
    octopus = bpy.context.object
    assert octopus is not None
    b0, b1, b2, b3 = _WAY
    bpy.ops.octo_motion.add_route(b0=b0, b1=b1, b2=b2, b3=b3)
    settings = octopus.octo_motion.locomotion
    settings.ground.object = _ground(heights)
    settings.cycle_time = _CYCLE
    bpy.ops.octo_motion.generate_locomotion()
    octopus.show_in_front = False
    stage.set_light(scene)
    camera = stage.add_camera("Camera")
    assert isinstance(camera.data, bpy.types.Camera)
    camera.data.ortho_scale = _SEEN
    first = scene.frame_start + 1.5 * _CYCLE * RATE
    pictures = []
    for number in range(_PICTURES):
        frame = first + number * _CYCLE * RATE / _PICTURES
        stage.go_to(frame)
        middle = stage.skin_points(octopus, [frame]).reshape(-1, 3).mean(axis=0)
        stage.look(camera, _AWAY, _UP)
        camera.location = Vector((middle - 4.0 * _AWAY).tolist())
        pictures.append(stage.render_pixels(*_CELL, note=f"{name}, frame {frame:.0f}"))
    return pictures


def _ground(heights: Heights) -> bpy.types.Object:
    """A tiled mesh of such heights."""
    along = np.arange(-_SIZE, _SIZE, _STEP)
    x, y = np.meshgrid(along, along, indexing="ij")
    points = np.stack([x, y, heights(x, y)], axis=-1).reshape(-1, 3)
    number = np.arange(x.size).reshape(x.shape)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata(points.tolist(), [], np.stack(corners, axis=-1).reshape(-1, 4).tolist())
    for colour in _TILES:
        mesh.materials.append(stage.new_material("Ground", colour))
    tile = np.arange(len(along) - 1) // _TILE
    mesh.polygons.foreach_set("material_index", ((tile[:, None] + tile) % 2).ravel())
    mesh.shade_smooth()
    ground = bpy.data.objects.new("Ground", mesh)
    stage.the_scene().collection.objects.link(ground)
    return ground
