# SPDX-License-Identifier: GPL-3.0-or-later
"""What joint weights do: one moment of the walk and of the swim with five profiles."""

from __future__ import annotations

from typing import Final

import bpy
import contact_sheet
import numpy as np
import shots
import stage
from stage import Pixels

from octo_motion.blender.files import NODE

_PROFILES: Final = (
    ("alike", (0.4, 0.4, 0.4)),
    ("root", (1.0, 0.5, 0.05)),
    ("tip", (0.05, 0.5, 1.0)),
    ("middle", (0.05, 1.0, 0.05)),
    ("both ends", (1.0, 0.05, 1.0)),
)
"""Weights at the root, half way and at the tip."""
_MOMENTS: Final = ((shots.WALK, 1), (shots.SWIM, 6))
"""Eighth of a cycle that is shown."""
_VIEWED: Final = np.array([-0.25, 0.9, -0.3])
_CELL: Final = (260, 195)


def strip() -> Pixels:
    """A row for each gait, a picture for each profile, all of one scale."""
    return contact_sheet.joined([_row(shot, eighth) for shot, eighth in _MOMENTS])


def _row(shot: shots.Shot, eighth: int) -> list[Pixels]:
    performance = shots.perform(shot, _CELL)
    octopus = performance.octopus
    frame = performance.cycle(8)[eighth]
    settings = octopus.octo_motion.locomotion
    settings.use_weight_curve = True
    points = []
    for _, weights in _PROFILES:
        _weigh(octopus, weights)
        points.append(stage.skin_points(octopus, [frame]))
    camera = stage.add_camera("Weights", lens=70.0)
    stage.look(camera, _VIEWED, np.array([0.0, 0.0, 1.0]))
    stage.set_resolution(*_CELL)
    stage.frame_points(camera, np.concatenate(points), margin=0.06)
    pictures = []
    for name, weights in _PROFILES:
        _weigh(octopus, weights)
        stage.go_to(frame)
        pictures.append(stage.render_pixels(*_CELL, note=f"{shot.gait}, {name}"))
    return pictures


def _weigh(octopus: bpy.types.Object, weights: tuple[float, ...]) -> None:
    """Draw the weights as a curve, and make the motion anew."""
    settings = octopus.octo_motion.locomotion
    mapping = settings.weight_curve.nodes[NODE].mapping
    points = mapping.curves[0].points
    while len(points) < len(weights):
        points.new(0.5, 0.5)
    for place, (point, weight) in enumerate(zip(points, weights, strict=True)):
        point.location = (place / (len(weights) - 1), weight)
        point.handle_type = "VECTOR"
    mapping.update()
    assert bpy.context.view_layer is not None
    bpy.context.view_layer.objects.active = octopus
    bpy.ops.octo_motion.generate_locomotion()
