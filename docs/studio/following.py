# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that follow an action, in pictures: the action as it is, and what becomes of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import bpy
import contact_sheet
import numpy as np
import shots
import stage
from puppets import Limb, make_doll
from stage import Pixels, Points

_UP: Final = np.array([0.0, 0.0, 1.0])
_CELL: Final = (200, 220)
_WIDE_CELL: Final = (220, 180)
_BRAID: Final[tuple[Limb, ...]] = tuple(
    (
        f"braid.{number + 1}",
        f"braid.{number}" if number else "head",
        (0.0, 0.09 + 0.01 * number, 1.68 - 0.09 * number),
        (0.0, 0.10 + 0.01 * number, 1.59 - 0.09 * number),
        0.034 - 0.003 * number,
    )
    for number in range(7)
)
_LOWEST: Final = 1.0
"""Metres: what is above it is seen."""
_TURNS: Final = ((1, 0.0), (6, 0.0), (14, 1.9), (40, 1.9))
"""Frames at which the doll is turned so far, radians."""
_BOWS: Final = ((1, 0.0), (24, 0.0), (30, 0.5), (40, 0.0))
"""The same of its spine, forward."""


def braid() -> Pixels:
    """A doll looks round and nods; its braid as stiff as the action has it, and following."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    doll: Any = make_doll(_BRAID)
    doll.show_in_front = False
    scene = stage.the_scene()
    scene.render.fps = shots.RATE
    _key(doll, "hips", 1, _TURNS)
    _key(doll, "spine", 0, _BOWS)
    settings = doll.octo_motion.follow_through
    settings.strength, settings.gravity = 0.25, 0.3

    def follow() -> None:
        assert bpy.ops.octo_motion.follow_find() == {"FINISHED"}
        assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}

    return _rows(doll, (7, 10, 13, 15, 18, 23, 30, 34), follow, np.array([0.85, 0.25, -0.15]))


def swim() -> Pixels:
    """A stroke of a swimming octopus, and the same with outer thirds that trail in the water."""
    performance = shots.perform(shots.SWIM, _WIDE_CELL)
    frames = performance.cycle(8)
    view = contact_sheet.SIDE
    before = contact_sheet.cycle_pictures(performance, view, _WIDE_CELL, 8, "action")
    octopus: Any = performance.octopus
    settings = octopus.octo_motion.follow_through
    settings.medium, settings.strength = "WATER", 0.4
    bpy.context.view_layer.objects.active = octopus
    assert bpy.ops.octo_motion.follow_find() == {"FINISHED"}
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    assert len(frames) == 8
    after = contact_sheet.cycle_pictures(performance, view, _WIDE_CELL, 8, "follow-through")
    return contact_sheet.joined([before[::2], after[::2]])


def _key(doll: Any, name: str, axis: int, moments: Sequence[tuple[int, float]]) -> None:
    """Turn a bone about one of its own axes."""
    bone = doll.pose.bones[name]
    bone.rotation_mode = "XYZ"
    for frame, turned in moments:
        bone.rotation_euler[axis] = turned
        bone.keyframe_insert("rotation_euler", frame=frame)


def _rows(doll: Any, frames: Sequence[int], follow: Callable[[], None], forward: Points) -> Pixels:
    """Frames of the action in a row, and below it the same that follow."""
    stage.set_light(stage.the_scene())
    points = stage.skin_points(doll, frames)
    stage.add_ground(points, 0.0)
    camera = stage.add_camera("Camera", lens=70.0)
    stage.set_resolution(*_CELL)
    stage.look(camera, forward, _UP)
    upper = points[..., 2] > _LOWEST
    stage.frame_points(camera, points[upper], margin=0.02)

    def row() -> list[Pixels]:
        pictures = []
        for frame in frames:
            stage.go_to(frame)
            pictures.append(stage.render_pixels(*_CELL, note=str(frame)))
        return pictures

    before = row()
    follow()
    return contact_sheet.joined([before, row()])
