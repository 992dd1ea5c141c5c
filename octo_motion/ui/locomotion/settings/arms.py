# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of arms, as it is saved with the armature object.

Names of arms and bones are what Blender tells the items of a linked list apart by: a library
override that renames one gets the whole list once more when the file is opened again. So they
alone cannot be overridden.
"""

from __future__ import annotations

import math
from typing import Final

import bpy

from ...declared_settings import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)
from .gait import SIDES
from .ground import rename_arm

AXES: Final = (
    ("X", "X", "The armature's own +X", 0),
    ("Y", "Y", "The armature's own +Y", 1),
    ("Z", "Z", "The armature's own +Z", 2),
    ("-X", "-X", "The armature's own −X", 3),
    ("-Y", "-Y", "The armature's own −Y", 4),
    ("-Z", "-Z", "The armature's own −Z", 5),
)


def _renamed(arm: ArmItem, _context: bpy.types.Context) -> None:
    """Let what speaks of an arm by its name follow: reaches, and contacts that were changed."""
    before, arm.known_as = arm.known_as, arm.name
    if before not in ("", arm.name):
        rename_arm(arm.id_data, before, arm.name)


class ArmBoneItem(bpy.types.PropertyGroup):
    """A bone of an arm."""

    name: bpy.props.StringProperty(name="Bone", description="Name of the bone")


class ArmItem(bpy.types.PropertyGroup):
    """An arm: its bones from root to tip, and its place in the gait."""

    name: bpy.props.StringProperty(
        name="Name", description="What this arm is called in the list", update=_renamed
    )
    known_as: bpy.props.StringProperty(
        name="Known As",
        description="What it was called until its name was changed",
        options={"HIDDEN"},
    )
    bones: CollectionProperty(
        name="Bones",
        description="The arm's bones, from its root to its tip",
        type=ArmBoneItem,
    )
    side: EnumProperty(
        name="Side",
        description="Side of the body. Gaits mirror forward and backward between left and right",
        items=SIDES,
    )
    pair: IntProperty(
        name="Pair",
        description="Which pair it belongs to, counted from 1 in front. Gaits can give each pair "
        "its own motion, and shift the pairs against one another",
        default=1,
        min=1,
    )
    phase: FloatProperty(
        name="Phase",
        description="How far this arm is ahead of its place in the gait: 360° is a whole cycle",
        subtype="ANGLE",
        soft_min=-math.tau,
        soft_max=math.tau,
        step=500,
        precision=1,
    )
    flip: BoolProperty(
        name="Flip",
        description="Mirror this arm's motion: forward and twist turn the other way, for an arm "
        "that moves backward where others move forward",
    )
    enabled: BoolProperty(
        name="Enabled",
        description="Move this arm. Switched off, it gets no keys and keeps its pose",
        default=True,
    )


class ArmList:
    """What ``Object.octo_motion.locomotion`` has of the rig."""

    arms: CollectionProperty(
        name="Arms",
        description="The arms that are moved; without any, they are detected when generating",
        type=ArmItem,
    )
    active_arm: IntProperty(name="Active Arm", options={"HIDDEN"})
    body_front: EnumProperty(
        name="Front",
        description="Which way the body faces, as an axis of the armature",
        items=AXES,
        default="-Y",
    )
    body_up: EnumProperty(
        name="Up",
        description="Where the body's top is, as an axis of the armature",
        items=AXES,
        default="Z",
    )
    root_bone: StringProperty(
        name="Root Bone",
        description="Bone that carries the whole body; it can take the travel along the route",
    )


CLASSES: Final[tuple[type, ...]] = (ArmBoneItem, ArmItem)
