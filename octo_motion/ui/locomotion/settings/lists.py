# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists that are saved with the armature object: arms, reaches, and where the gait changes.

Names of arms and bones are what Blender tells the items of a linked list apart by: a library
override that renames one gets the whole list once more when the file is opened again. So they
alone cannot be overridden.
"""

from __future__ import annotations

import math
from typing import Any, Final

import bpy

from ....blender.scene import WITH_SURFACE
from ... import declared_settings as props
from .gait import SIDES, GaitName
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
    bones: props.CollectionProperty(
        name="Bones",
        description="The arm's bones, from its root to its tip",
        type=ArmBoneItem,
    )
    side: props.EnumProperty(
        name="Side",
        description="Side of the body. Gaits mirror forward and backward between left and right",
        items=SIDES,
    )
    pair: props.IntProperty(
        name="Pair",
        description="Which pair it belongs to, counted from 1 in front. Gaits can give each pair "
        "its own motion, and shift the pairs against one another",
        default=1,
        min=1,
    )
    phase: props.AngleProperty(
        name="Phase",
        description="How far this arm is ahead of its place in the gait: 360° is a whole cycle",
        soft_min=-math.tau,
        soft_max=math.tau,
    )
    flip: props.BoolProperty(
        name="Flip",
        description="Mirror this arm's motion: forward and twist turn the other way, for an arm "
        "that moves backward where others move forward",
    )
    enabled: props.BoolProperty(
        name="Enabled",
        description="Move this arm. Switched off, it gets no keys and keeps its pose",
        default=True,
    )


class ArmList:
    """What ``Object.octo_motion.locomotion`` has of the rig."""

    arms: props.CollectionProperty(
        name="Arms",
        description="The arms that are moved; without any, they are detected when generating",
        type=ArmItem,
    )
    active_arm: props.IntProperty(name="Active Arm", options={"HIDDEN"})
    body_front: props.EnumProperty(
        name="Front",
        description="Which way the body faces, as an axis of the armature",
        items=AXES,
        default="-Y",
    )
    body_up: props.EnumProperty(
        name="Up",
        description="Where the body's top is, as an axis of the armature",
        items=AXES,
        default="Z",
    )
    root_bone: props.StringProperty(
        name="Root Bone",
        description="Bone that carries the whole body; it can take the travel along the route",
    )


# --- Reaches --------------------------------------------------------------------------------------


MODES: Final = (
    ("COIL", "Coil", "Wind about the object, hold it, and let go", 0),
    ("TOUCH", "Touch", "Lay the arm on the object", 1),
    ("CURL", "Curl", "Curl the arm up and stretch it again; needs no object", 2),
)


class ReachItem(bpy.types.PropertyGroup):
    """An arm reaches for an object while it moves, and goes back to its gait."""

    name: bpy.props.StringProperty(name="Name", description="What this reach is called in the list")
    mute: props.BoolProperty(name="Mute", description="Leave this reach out")
    arm: props.StringProperty(
        name="Arm",
        description="The arm of the list that reaches; empty takes the one nearest to the object",
    )
    target: props.PointerProperty(
        name="Object",
        description="What is reached for. It may move; only if it is carried is it changed",
        type=bpy.types.Object,
        poll=props.is_of(WITH_SURFACE),
    )
    mode: props.EnumProperty(name="Mode", description="What the arm does", items=MODES)
    turns: props.FloatProperty(
        name="Turns",
        description="Winds about the object at most so often, as far as the arm is long enough",
        default=2.0,
        min=0.1,
        max=20.0,
        step=10,
        precision=2,
    )
    carry: props.BoolProperty(
        name="Carry",
        description="Take the object along, from when the arm is wound until it lets go. The "
        "object gets keys for that; it must have none of its own",
    )
    axis: props.EnumProperty(
        name="Axis",
        description="What of the object is wound about",
        items=(
            (
                "AUTO",
                "Automatic",
                "The longest way through the object; of a ball or a cube its Z",
                0,
            ),
            ("X", "X", "The object's own X", 1),
            ("Y", "Y", "The object's own Y", 2),
            ("Z", "Z", "The object's own Z", 3),
        ),
    )
    frame_start: props.IntProperty(
        name="Start", description="Frame at which the arm sets out", default=1
    )
    frame_contact: props.IntProperty(
        name="Contact",
        description="Frame at which the arm touches the object; a curl is closed then",
        default=30,
    )
    coil_frames: props.IntProperty(
        name="Coil",
        description="Frames from the touch until the arm is wound all the way",
        default=20,
        min=1,
        soft_max=100,
    )
    frame_release: props.IntProperty(
        name="Release",
        description="Frame at which the arm begins to let go; after the end of the motion, it "
        "holds on",
        default=80,
    )
    back_frames: props.IntProperty(
        name="Back",
        description="Frames from letting go until the arm does what its gait says",
        default=40,
        min=1,
        soft_max=100,
    )


class Reaches:
    """What ``Object.octo_motion.locomotion`` has of reaches."""

    reaches: props.CollectionProperty(
        name="Reaches",
        description="What single arms reach for while the body moves",
        type=ReachItem,
    )
    active_reach: props.IntProperty(name="Active Reach", options={"HIDDEN"})


# --- Where along the route the gait changes: ``octo_motion.locomotion.change`` --------------------


def _length() -> Any:
    return props.FloatProperty(
        name="Length",
        description="How long the change takes along the route, in arm lengths. The body goes over "
        "all the while; each arm as soon as it holds on to nothing",
        default=1.5,
        min=0.1,
        soft_max=5.0,
        step=10,
    )


class ChangeItem(bpy.types.PropertyGroup):
    """A place of the route from which on another gait goes."""

    name: bpy.props.StringProperty(
        name="Name", description="What this change is called in the list"
    )
    gait: GaitName(
        name="Gait",
        description="The gait from here on. Its own strides, the other settings of this armature",
        default="swim",
    )
    position: props.FactorProperty(
        name="Position",
        description="Where along the route the change is half done: 0 at its start, 1 at its end",
        default=0.5,
        precision=3,
    )
    length: _length()


class OCTO_MOTION_PG_change(bpy.types.PropertyGroup):
    """Changes of gait along the route."""

    by: props.EnumProperty(
        name="Change Gait",
        description="Whether the gait changes along the route, and what decides where",
        items=(
            ("NONE", "Never", "One gait all the way", 0),
            (
                "HEIGHT",
                "By Height",
                "Where the route is high over the ground, or its lowest point, another gait goes",
                1,
            ),
            ("MARKERS", "At Places", "At the places of a list, each with its own gait", 2),
        ),
    )
    gait: GaitName(
        name="Above",
        description="The gait that goes where the route is high over the ground",
        default="swim",
    )
    height: props.FloatProperty(
        name="Height",
        description="Height of the route over the ground at which the change is half done, in arm "
        "lengths",
        default=0.5,
        min=0.0,
        soft_max=3.0,
        step=5,
    )
    length: _length()
    places: props.CollectionProperty(
        name="Places",
        description="Places of the route where the gait changes, in any order",
        type=ChangeItem,
    )
    active_place: props.IntProperty(name="Active Place", options={"HIDDEN"})
