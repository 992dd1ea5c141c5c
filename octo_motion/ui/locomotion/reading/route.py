# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a motion goes, and when: the settings' route and timing."""

from __future__ import annotations

import bpy

from ....blender.scene import read_route
from ....core.locomotion.motion import Breathing, Timing
from ....core.locomotion.path import Route
from ..settings import OCTO_MOTION_PG_locomotion


def read_route_of(settings: OCTO_MOTION_PG_locomotion, depsgraph: bpy.types.Depsgraph) -> Route:
    """The route that is set; the caller sees to it that there is one.

    Raises:
        RouteError: the curve has no such spline, or it cannot be travelled.
    """
    return read_route(settings.route, depsgraph, settings.spline)


def read_timing(settings: OCTO_MOTION_PG_locomotion, render: bpy.types.RenderSettings) -> Timing:
    """When it moves, and how fast."""
    return Timing(
        kind=settings.timing,
        start=settings.frame_start,
        end=settings.frame_end,
        speed=settings.speed,
        cycle_time=settings.cycle_time,
        rate=render.fps / render.fps_base,
        duty=settings.ground.duty,
    )


def breathing(settings: OCTO_MOTION_PG_locomotion) -> Breathing:
    """How its mantle breathes."""
    return Breathing(settings.breathing, settings.breath_time)
