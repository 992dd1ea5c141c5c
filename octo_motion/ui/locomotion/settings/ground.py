# SPDX-License-Identifier: GPL-3.0-or-later
"""What a walk stands on, as it is set: ``octo_motion.locomotion.ground``."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ....core.locomotion.ground import StanceSettings
from ...declared_settings import declared
from ...overridable import (
    BoolProperty,
    CollectionProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


def may_be_ground(settings: Any, candidate: bpy.types.Object) -> bool:
    """Whether an object is offered as ground: a mesh, but nobody's own skin."""
    return candidate.type == "MESH" and candidate.find_armature() != settings.id_data


class ContactItem(bpy.types.PropertyGroup):
    """What an artist wants of one contact: it stays when the motion is generated again."""

    arm: StringProperty(name="Arm", description="Name of the arm in the list")
    cycle: IntProperty(name="Cycle", description="Number of the arm's cycle along the route")
    removed: BoolProperty(name="Removed", description="The arm does not touch the ground here")
    shift: FloatProperty(
        name="Shift",
        description="Share of a cycle by which the contact is later, negative if it is earlier",
        default=0.0,
        min=-0.3,
        max=0.3,
        step=1,
        precision=3,
    )
    locked: BoolProperty(
        name="Locked",
        description="The contact stays where it is in the world, however the route or the gait "
        "are changed",
    )
    position: FloatVectorProperty(
        name="Position",
        description="Where the arm touches the ground, if the contact is locked",
        subtype="TRANSLATION",
        size=3,
    )
    heading: FloatProperty(
        name="Heading",
        description="Which way the arm lies from there, about the world's Z axis, if the contact "
        "is locked",
        subtype="ANGLE",
    )


class OCTO_MOTION_PG_ground(bpy.types.PropertyGroup):
    """How a walking creature stands on the ground."""

    use: BoolProperty(
        name="Hold the Ground",
        description="Walking, each arm takes hold of the ground and does not slide over it, while "
        "the body moves on. Off, the arms move as the gait alone has them",
        default=True,
    )
    object: PointerProperty(
        name="Ground",
        description="Mesh to walk on, as it is seen: with its modifiers, moved and scaled. Without "
        "one, the ground is where the route is",
        type=bpy.types.Object,
        poll=may_be_ground,
    )
    duty: declared(StanceSettings, "duty")
    planted: declared(StanceSettings, "planted")
    stretch: declared(StanceSettings, "stretch")
    lift: declared(StanceSettings, "lift")
    lean: declared(StanceSettings, "lean")
    smoothing: declared(StanceSettings, "smoothing")
    start_at_rest: BoolProperty(
        name="Start at Rest",
        description="All arms lie on the ground at the start, and leave it as the body gets going. "
        "Only with an Ease In: without one the creature comes walking",
        default=True,
    )
    come_to_rest: BoolProperty(
        name="Come to Rest",
        description="All arms lie on the ground at the end: each takes its last step in time. Only "
        "with an Ease Out: without one the creature walks on",
        default=True,
    )
    rest_within: FloatProperty(
        name="Within",
        description="Cycles of the gait that the body takes at least to get going from its rest, "
        "and to come to it, if that is more than Ease In and Out give it",
        default=1.0,
        min=0.0,
        soft_max=4.0,
        max=100.0,
        step=10,
    )
    shown: StringProperty(
        name="Shown",
        description="Which contacts have markers",
        options={"HIDDEN"},
    )
    contacts: CollectionProperty(
        name="Contacts",
        description="Contacts that were moved, locked, shifted or removed by hand",
        type=ContactItem,
    )


class OCTO_MOTION_PG_contact(bpy.types.PropertyGroup):
    """What a marker stands for: ``Object.octo_motion.contact``."""

    armature: StringProperty(
        name="Armature",
        description="Object whose arm touches here",
        options={"HIDDEN"},
    )
    arm: StringProperty(name="Arm", description="Name of the arm", options={"HIDDEN"})
    cycle: IntProperty(
        name="Cycle",
        description="Number of the arm's cycle along the route",
        options={"HIDDEN"},
    )
    locked: BoolProperty(
        name="Locked",
        description="The contact stays here, however the route or the gait are changed. One that "
        "was dragged or turned is locked; free it to have it where the gait wants it",
    )
    shift: FloatProperty(
        name="Shift",
        description="Share of a cycle by which the contact is later, negative if it is earlier",
        min=-0.3,
        max=0.3,
        step=1,
        precision=3,
    )
    position: FloatVectorProperty(
        name="Position",
        description="Where the marker was put",
        size=3,
        options={"HIDDEN"},
    )
    heading: FloatProperty(
        name="Heading",
        description="How the marker was turned",
        options={"HIDDEN"},
    )
    frame_on: FloatProperty(
        name="From",
        description="Frame at which the arm takes hold",
        options={"HIDDEN"},
    )
    frame_off: FloatProperty(
        name="To",
        description="Frame at which the arm lets go",
        options={"HIDDEN"},
    )
    cycle_frames: FloatProperty(
        name="Cycle Frames",
        description="Frames that a cycle takes there",
        default=1.0,
        options={"HIDDEN"},
    )


CLASSES: Final = (OCTO_MOTION_PG_contact, ContactItem, OCTO_MOTION_PG_ground)
