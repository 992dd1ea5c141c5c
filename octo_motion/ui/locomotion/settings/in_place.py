# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of motion in place, and of breath."""

from __future__ import annotations

from typing import Final

from ...overridable import BoolProperty, FloatProperty, IntProperty

_IN_PLACE: Final = (
    "Nothing travels: whole cycles on the spot, whose last frame meets the first, for games and "
    "for a creature that stays. No route is needed; a root bone lifts the body to its height over "
    "the armature's origin"
)
TRAVEL_IN_PLACE: Final = ("NONE", "In Place", _IN_PLACE, 2)


class InPlace:
    """What ``Object.octo_motion.locomotion`` has of motion in place, and of breath."""

    cycles: IntProperty(
        name="Cycles",
        description="In place: how many cycles of the gait the loop has. Random additions repeat "
        "with the loop, so more cycles look less even",
        default=1,
        min=1,
        soft_max=12,
        max=10_000,
    )
    repeat: BoolProperty(
        name="Repeat",
        description="In place: curves repeat before and after the loop, by Cycles modifiers. "
        "Exporters take the loop alone",
        default=True,
    )
    breathing: FloatProperty(
        name="Breathing",
        description="How much wider the mantle gets with each breath; 0 gives it no keys",
        subtype="FACTOR",
        default=0.0,
        min=0.0,
        soft_max=0.3,
        max=1.0,
        step=1,
    )
    breath_time: FloatProperty(
        name="Breath",
        description="Time that one breath takes. A loop takes a whole number of breaths",
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
        default=3.0,
        min=0.05,
        soft_max=20.0,
        step=10,
    )
