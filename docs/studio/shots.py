# SPDX-License-Identifier: GPL-3.0-or-later
"""The walk and the swim of demo and pictures, made with the operators that artists have."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np
import stage
from stage import Points

RATE: Final = 24
"""Frames per second."""
_SURROUNDINGS: Final = 4
"""Every so many frames the octopus is looked at to place camera and ground."""


@dataclass(frozen=True)
class Shot:
    """A gait and a route in space."""

    gait: str
    route: tuple[tuple[float, float, float], ...]
    """Control points B₀…B₃ of the curve, in metres."""
    forward: tuple[float, float, float]
    """Where the film's camera looks."""
    floor: float | None
    """Height of the ground; none: below the lowest point that the octopus reaches."""


WALK: Final = Shot(
    gait="walk",
    route=((-0.55, 0.3, 0.0), (-0.2, -0.3, 0.0), (0.15, 0.25, 0.0), (0.6, 0.05, 0.0)),
    forward=(-0.35, 0.9, -0.45),
    floor=0.0,
)
"""Along a curve on the ground."""

SWIM: Final = Shot(
    gait="swim",
    route=((-0.85, -0.2, 0.9), (-0.35, -0.65, 0.8), (0.15, 0.7, 1.25), (0.95, 0.1, 1.5)),
    forward=(-0.15, 0.95, -0.28),
    floor=None,
)
"""Along a curve that rises through the water."""

BY_NAME: Final = {shot.gait: shot for shot in (WALK, SWIM)}


@dataclass(frozen=True)
class Performance:
    """An animated octopus in the scene, with ground, light and a camera that sees all of it."""

    shot: Shot
    octopus: bpy.types.Object
    route: bpy.types.Object
    points: Points
    """(frames, points, 3) of its skin, every few frames."""

    def cycle(self, pictures: int) -> list[float]:
        """Frames, and fractions of frames, at even phases of one gait cycle at full speed.

        They start at phase 0: easing in, the gait has come half as far as at full speed.
        """
        return self.at(np.arange(pictures) / pictures)

    def at(self, phases: Points) -> list[float]:
        """The same at phases of the cycle, 0 to 1."""
        settings = self.octopus.octo_motion.locomotion
        scene = stage.the_scene()
        if settings.travel_on == "NONE":
            loop = (scene.frame_end - scene.frame_start) / settings.cycles
            return (scene.frame_start + loop * phases).tolist()
        seconds = (scene.frame_end - scene.frame_start) / RATE
        behind = 0.5 * settings.ease_in * seconds
        first = math.ceil(behind / settings.cycle_time)
        starts = behind + first * settings.cycle_time
        return (scene.frame_start + RATE * (starts + settings.cycle_time * phases)).tolist()


def perform(
    shot: Shot, resolution: tuple[int, int], change: Callable[[Any], None] = lambda _: None
) -> Performance:
    """Start from an empty file: an octopus, a route, a gait, the motion, and the stage.

    Args:
        shot: what to do.
        resolution: of the pictures that the camera is framed for.
        change: is handed the octopus' settings before the motion is made.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = stage.the_scene()
    scene.render.fps = RATE

    bpy.ops.octo_motion.add_octopus()
    octopus = bpy.context.object
    assert octopus is not None
    bpy.ops.octo_motion.detect_arms()
    b0, b1, b2, b3 = shot.route
    bpy.ops.octo_motion.add_route(b0=b0, b1=b1, b2=b2, b3=b3)
    octopus.octo_motion.locomotion.gait = shot.gait
    change(octopus.octo_motion.locomotion)
    # The scene shall end with the motion, which may be shorter than its 250 frames.
    scene.frame_end = 1
    bpy.ops.octo_motion.generate_locomotion()

    octopus.show_in_front = False
    points = stage.skin_points(
        octopus, range(scene.frame_start, scene.frame_end + 1, _SURROUNDINGS)
    )
    stage.set_light(scene)
    floor = float(points[..., 2].min()) - 0.25 if shot.floor is None else shot.floor
    stage.add_ground(points, floor)
    route = octopus.octo_motion.locomotion.route
    stage.show_route(route, thickness=0.012)
    camera = stage.add_camera("Camera", lens=50.0)
    stage.look(camera, np.array(shot.forward), np.array([0.0, 0.0, 1.0]))
    stage.set_resolution(*resolution)
    stage.frame_points(camera, points)
    scene.frame_set(scene.frame_start)
    return Performance(shot, octopus, route, points)
