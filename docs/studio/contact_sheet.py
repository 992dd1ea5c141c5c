# SPDX-License-Identifier: GPL-3.0-or-later
"""One cycle of a gait in eight pictures, from the side and from above.

The camera goes along with the body and turns with its travel, so that travel is to the right in
every picture and all pictures have one scale: what differs between them is the gait.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np
import stage
from mathutils import Vector
from shots import Performance
from stage import Pixels, Points

from octo_motion.core.locomotion.rig.arm_chains import AXES

_UP: Final = np.array([0.0, 0.0, 1.0])
_PHASES: Final = 8
_COLUMNS: Final = 4
_GAP: Final = 4
"""Pixels between the pictures."""


@dataclass(frozen=True)
class View:
    """Where the camera looks from."""

    name: str
    elevation: float
    """Radians above the horizon; π/2 looks straight down."""


SIDE: Final = View("side", np.radians(8.0))
ABOVE: Final = View("above", 0.5 * np.pi)


def cycle_pixels(
    performance: Performance, view: View, size: tuple[int, int] = (320, 240)
) -> Pixels:
    """A sheet with eight phases of one cycle.

    Args:
        performance: who moves.
        view: from where.
        size: of one picture, in pixels.
    """
    pictures = cycle_pictures(performance, view, size, _PHASES)
    return joined([pictures[at : at + _COLUMNS] for at in range(0, _PHASES, _COLUMNS)])


def cycle_pictures(
    performance: Performance, view: View, size: tuple[int, int], phases: int, name: str = ""
) -> list[Pixels]:
    """Some phases of one cycle, a picture each.

    Args:
        performance: who moves.
        view: from where.
        size: of one picture, in pixels.
        phases: how many.
        name: what is written into the pictures, with the phase; none for all there is to say.
    """
    moments = np.arange(phases) / phases
    notes = []
    for moment, frame in zip(moments, performance.at(moments), strict=True):
        phase = f"{round(360 * moment)}°"
        whole = f"{performance.shot.gait}, {view.name}, {phase}, frame {frame:.0f}"
        notes.append(f"{name}, {phase}" if name else whole)
    return pictures_at(performance, view, size, moments, notes)


def pictures_at(
    performance: Performance,
    view: View,
    size: tuple[int, int],
    moments: Points,
    notes: Sequence[str],
) -> list[Pixels]:
    """Moments of one cycle, 0 to 1, a picture each with a note."""
    frames = performance.at(moments)
    points = stage.skin_points(performance.octopus, frames)
    bodies, axes = _travel(performance.octopus, frames, view)
    # Right, up and back from the body, as this view has them: (frames, points, 3).
    seen = np.einsum("fpi,fia->fpa", points - bodies[:, None], axes)
    low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    width, height, depth = 1.12 * (high - low)
    # Midway between the extremes, and behind all of them.
    middle = 0.5 * (low + high) + np.array([0.0, 0.0, 2.0 * depth])
    scene = stage.the_scene()
    usual = scene.camera
    camera = stage.add_camera(view.name)
    assert isinstance(camera.data, bpy.types.Camera)
    camera.data.ortho_scale = max(width, height * size[0] / size[1])
    pictures = []
    for number, frame in enumerate(frames):
        stage.go_to(frame)
        stage.look(camera, -axes[number][:, 2], axes[number][:, 1])
        camera.location = Vector(bodies[number] + axes[number] @ middle)
        pictures.append(stage.render_pixels(*size, note=notes[number]))
    bpy.data.objects.remove(camera)
    scene.camera = usual
    return pictures


def _travel(
    armature: bpy.types.Object, frames: Sequence[float], view: View
) -> tuple[Points, Points]:
    """Where the body is (frames, 3), and the camera's axes as columns (frames, 3, 3)."""
    bodies, axes = [], []
    for frame in frames:
        before, here, after = (_place(armature, frame + shift) for shift in (-1.0, 0.0, 1.0))
        right = (after - before) * [1.0, 1.0, 0.0]
        if not np.any(right):
            # In place the ground would go by.
            right = front(armature)
        right = right / np.linalg.norm(right)
        away = np.cross(_UP, right)
        up = np.cos(view.elevation) * _UP + np.sin(view.elevation) * away
        bodies.append(here)
        axes.append(np.stack([right, up, np.cross(right, up)], axis=1))
    return np.stack(bodies), np.stack(axes)


def front(armature: bpy.types.Object) -> Points:
    """Where a creature faces that nothing turns (3,), level."""
    axis = Vector(AXES[armature.octo_motion.locomotion.body_front])
    faced = np.array(armature.matrix_world.to_3x3() @ axis, dtype=np.float64) * [1.0, 1.0, 0.0]
    return faced / np.linalg.norm(faced)


def _place(armature: bpy.types.Object, frame: float) -> Points:
    stage.go_to(frame)
    return np.array(armature.matrix_world.translation, dtype=np.float64)


def joined(rows: Sequence[Sequence[Pixels]]) -> Pixels:
    """Pictures of one size beside and below each other, with a gap between them."""
    height, width = rows[0][0].shape[:2]
    across = max(len(row) for row in rows)
    sheet = np.ones(
        (len(rows) * (height + _GAP) - _GAP, across * (width + _GAP) - _GAP, 3), dtype=np.float32
    )
    for line, row in enumerate(rows):
        for place, picture in enumerate(row):
            top, left = line * (height + _GAP), place * (width + _GAP)
            sheet[top : top + height, left : left + width] = picture
    return sheet


def stacked(sheets: Sequence[Pixels]) -> Pixels:
    """Sheets of one width below each other."""
    gap = np.ones((3 * _GAP, sheets[0].shape[1], 3), dtype=np.float32)
    parts = [part for sheet in sheets for part in (gap, sheet)]
    return np.concatenate(parts[1:])
