# SPDX-License-Identifier: GPL-3.0-or-later
"""The route, and how it is travelled."""

from __future__ import annotations

from typing import Any

import bpy

from ....core.locomotion.path import TravelSettings
from ...declared_settings import declared
from ...overridable import EnumProperty, FloatProperty, IntProperty, PointerProperty


def _is_curve(_settings: Any, candidate: bpy.types.Object) -> bool:
    return candidate.type == "CURVE"


class RouteSettings:
    """What ``Object.octo_motion.locomotion`` has of the route."""

    route: PointerProperty(
        name="Route",
        description="Curve to travel along. For a walk it lies on the ground",
        type=bpy.types.Object,
        poll=_is_curve,
    )
    spline: IntProperty(
        name="Spline",
        description="Which of the curve's splines to follow, counted from 0; -1 takes the longest",
        default=-1,
        min=-1,
    )
    speed_mode: declared(TravelSettings, "speed")
    ease_in: declared(TravelSettings, "ease_in")
    ease_out: declared(TravelSettings, "ease_out")
    heading: declared(TravelSettings, "heading")
    heading_angle: declared(TravelSettings, "heading_angle")
    keep_upright: declared(TravelSettings, "keep_upright")
    look_ahead: declared(TravelSettings, "look_ahead")
    corner: declared(TravelSettings, "corner")
    burst: declared(TravelSettings, "burst")
    bank_in_turns: declared(TravelSettings, "bank")
    streamline: FloatProperty(
        name="Streamline",
        description="Swimming: how far head and mantle stretch out along the way. At 0 they lean "
        "back as they do at rest. A body whose mantle lies flat behind it swims as it lies instead",
        subtype="FACTOR",
        default=1.0,
        min=0.0,
        max=1.0,
    )
    height_mode: EnumProperty(
        name="Height",
        description="How high above the route the body's center travels",
        items=(
            (
                "AUTO",
                "Automatic",
                "Walking: as high as the arms need to stand on the route. Swimming: on it",
                0,
            ),
            ("MANUAL", "Manual", "As high as given", 1),
        ),
    )
    height: FloatProperty(
        name="Height",
        description="Distance of the body's center above the route",
        subtype="DISTANCE",
        soft_min=-10.0,
        soft_max=10.0,
    )
