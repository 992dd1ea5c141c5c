# SPDX-License-Identifier: GPL-3.0-or-later
"""One reach of the list, as it is saved with the armature object."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ....blender.scene import WITH_SURFACE
from ...declared_settings import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

MODES: Final = (
    ("COIL", "Coil", "Wind about the object, hold it, and let go", 0),
    ("TOUCH", "Touch", "Lay the arm on the object", 1),
    ("CURL", "Curl", "Curl the arm up and stretch it again; needs no object", 2),
)
AXES: Final = (
    ("AUTO", "Automatic", "The longest way through the object; of a ball or a cube its Z", 0),
    ("X", "X", "The object's own X", 1),
    ("Y", "Y", "The object's own Y", 2),
    ("Z", "Z", "The object's own Z", 3),
)


def _has_surface(_item: Any, candidate: bpy.types.Object) -> bool:
    return candidate.type in WITH_SURFACE


class ReachItem(bpy.types.PropertyGroup):
    """An arm reaches for an object while it moves, and goes back to its gait."""

    name: bpy.props.StringProperty(name="Name", description="What this reach is called in the list")
    mute: BoolProperty(name="Mute", description="Leave this reach out")
    arm: StringProperty(
        name="Arm",
        description="The arm of the list that reaches; empty takes the one nearest to the object",
    )
    target: PointerProperty(
        name="Object",
        description="What is reached for. It may move; only if it is carried is it changed",
        type=bpy.types.Object,
        poll=_has_surface,
    )
    mode: EnumProperty(name="Mode", description="What the arm does", items=MODES)
    turns: FloatProperty(
        name="Turns",
        description="Winds about the object at most so often, as far as the arm is long enough",
        default=2.0,
        min=0.1,
        max=20.0,
        step=10,
        precision=2,
    )
    carry: BoolProperty(
        name="Carry",
        description="Take the object along, from when the arm is wound until it lets go. The "
        "object gets keys for that; it must have none of its own",
    )
    axis: EnumProperty(name="Axis", description="What of the object is wound about", items=AXES)
    frame_start: IntProperty(name="Start", description="Frame at which the arm sets out", default=1)
    frame_contact: IntProperty(
        name="Contact",
        description="Frame at which the arm touches the object; a curl is closed then",
        default=30,
    )
    coil_frames: IntProperty(
        name="Coil",
        description="Frames from the touch until the arm is wound all the way",
        default=20,
        min=1,
        soft_max=100,
    )
    frame_release: IntProperty(
        name="Release",
        description="Frame at which the arm begins to let go; after the end of the motion, it "
        "holds on",
        default=80,
    )
    back_frames: IntProperty(
        name="Back",
        description="Frames from letting go until the arm does what its gait says",
        default=40,
        min=1,
        soft_max=100,
    )


class Reaches:
    """What ``Object.octo_motion.locomotion`` has of reaches."""

    reaches: CollectionProperty(
        name="Reaches",
        description="What single arms reach for while the body moves",
        type=ReachItem,
    )
    active_reach: IntProperty(name="Active Reach", options={"HIDDEN"})


CLASSES: Final[tuple[type, ...]] = (ReachItem,)
