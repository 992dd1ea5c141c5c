# SPDX-License-Identifier: GPL-3.0-or-later
"""When the motion is, what it moves, and which keys it gets."""

from __future__ import annotations

import bpy
import numpy as np

from ...overridable import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty
from .in_place import TRAVEL_IN_PLACE


class Timing:
    """What ``Object.octo_motion.locomotion`` has of the time and of what carries the body."""

    timing: EnumProperty(
        name="Timing",
        description="What decides how long the journey takes",
        items=(
            ("CADENCE", "Cycle", "The time that one cycle of the gait takes", 0),
            ("SPEED", "Speed", "The speed of the body", 1),
            ("RANGE", "Frames", "The first and the last frame", 2),
        ),
    )
    cycle_time: FloatProperty(
        name="Cycle",
        description="Time that one cycle of the gait takes at full speed",
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
        default=2.0,
        min=0.01,
        soft_min=0.2,
        soft_max=20.0,
        step=10,
    )
    speed: FloatProperty(
        name="Speed",
        description="Full speed of the body along the route",
        unit="VELOCITY",
        default=0.5,
        min=1e-5,
        soft_max=10.0,
        step=10,
    )
    frame_start: IntProperty(name="Start", description="First frame of the motion", default=1)
    frame_end: IntProperty(name="End", description="Last frame of the motion", default=250)
    travel_on: EnumProperty(
        name="Travel on",
        description="What carries the body along the route",
        items=(
            ("OBJECT", "Object", "The armature object moves", 0),
            ("BONE", "Root Bone", "The object stays; its root bone moves, as game engines like", 1),
            TRAVEL_IN_PLACE,
        ),
    )
    extend_scene_range: BoolProperty(
        name="Extend Scene Range",
        description="Move the scene's end frame if the motion lasts longer, so that playback and "
        "rendering show all of it. The range is never shortened, and the message says so when it "
        "is extended. Switch it off where a shot has its length",
        default=True,
    )


class Keys:
    """What ``Object.octo_motion.locomotion`` has of the keys."""

    keys: EnumProperty(
        name="Keys",
        description="How many keys the motion gets",
        items=(
            ("DENSE", "All", "A key on every frame: the motion exactly as computed", 0),
            (
                "REDUCED",
                "Few",
                "As few keys as the tolerance allows, with handles; each arm in one group",
                1,
            ),
        ),
    )
    key_angle: FloatProperty(
        name="Angle",
        description="How far any bone may be turned away, at any frame, where there are few keys",
        subtype="ANGLE",
        default=np.radians(0.5),
        min=0.0,
        max=np.pi,
        soft_max=np.radians(10.0),
        step=10,
        precision=2,
    )
    key_distance: FloatProperty(
        name="Distance",
        description="How far any arm's tip may be away, at any frame, where there are few keys. "
        "In arm lengths",
        default=0.005,
        min=0.0,
        soft_max=0.1,
        step=0.1,
        precision=4,
    )
    key_columns: EnumProperty(
        name="Columns",
        description="Which channels have their keys at the same frames, where there are few keys",
        items=(
            (
                "ARM",
                "Each Arm",
                "An arm's pose is one column, easy to retime. Some two thirds more keys",
                0,
            ),
            (
                "BONE",
                "Each Bone",
                "Each bone has keys where it needs them: the fewest. Arms stay channel groups",
                1,
            ),
        ),
        default="BONE",
    )
    result: PointerProperty(
        name="Result",
        description="The action that was generated last. It is made anew in place until you edit "
        "it; then it is yours, and the next one is a new action",
        type=bpy.types.Action,
    )
