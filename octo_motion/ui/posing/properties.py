# SPDX-License-Identifier: GPL-3.0-or-later
"""``Object.octo_motion.posing``: how an armature behaves in the hand, and what is solid."""

from __future__ import annotations

from typing import Any, Final, cast

import bpy
import numpy as np

from ...blender.rig import armature_data
from ...core.posing.puppet import SMALLEST
from .. import declared_settings as props
from ..declared_settings import make_overridable
from ..floor import Floor

MATERIALS: Final = (
    ("CLAY", "Clay", "Gives way slowly and stays: as soft as it is pulled", 0),
    ("WIRE", "Wire", "Springs back a little, then keeps its bend", 1),
    ("DOLL", "Doll", "Ball joints that hold by friction and stay where they are put", 2),
    ("RUBBER", "Rubber", "Springs back nearly all the way when it is let go", 3),
    ("LIMP", "Limp", "Hardly resists at all, like a rag doll", 4),
    ("CUSTOM", "Custom", "What was measured, or what is set below", 5),
)

OBSTACLES: Final = (
    ("NONE", "None", "Puppets pass through this object", 0),
    ("PLANE", "Plane", "Solid below the object's origin, as far as the eye reaches", 1),
    ("BOX", "Box", "A solid box as large as the object", 2),
    ("SPHERE", "Sphere", "A solid ball about the object", 3),
    ("CAPSULE", "Capsule", "A solid rod with round ends, along the object's longest side", 4),
    ("HULL", "Convex Hull", "The object's shape without its hollows", 5),
    ("MESH", "Mesh", "The object's own surface; slow with many faces", 6),
)

STANDS: Final = "STANDS"
MOVES: Final = (
    (STANDS, "Stands Still", "It stops a puppet, and nothing moves it", 0),
    ("MOVES", "Can Be Pushed", "Puppets push, lift and topple it; it has weight always", 1),
    ("FLOATS", "Floats", "As Can Be Pushed, and without weight where the puppet has none", 2),
)

BALANCE: Final = (
    ("OFF", "Off", "Nothing is looked at", 0),
    (
        "SHOWN",
        "Shown",
        "Draw the centre of mass over what the figure stands on: limbs pinned or touching a floor",
        1,
    ),
    (
        "KEPT",
        "Kept",
        "Lead the root so that the centre of mass stays over the pinned feet; Root has to be Free",
        2,
    ),
)

TARGETS: Final = (
    (
        "CURRENT",
        "Current Action",
        "Keys go into the action that the armature has; without any, into a new one",
        0,
    ),
    (
        "COPY",
        "Copy",
        "Keys go into a copy of the armature's action, which itself stays as it is",
        1,
    ),
    (
        "LAYER",
        "New Layer",
        "The armature's action becomes an NLA strip, and the keys go into a new action above it",
        2,
    ),
    ("CHOSEN", "Chosen Action", "Keys go into the action below, which the armature gets", 3),
)


class OCTO_MOTION_PG_posing(Floor, bpy.types.PropertyGroup):
    """Settings of posing by hand."""

    # --- The puppet ----------------------------------------------------------------------------

    material: props.EnumProperty(
        name="Material",
        description="What the joints are made of",
        items=MATERIALS,
    )
    strength: props.FloatProperty(
        name="Strength",
        description="How hard it is to bend: 1 lets each joint just bear what hangs on it",
        default=1.0,
        min=0.01,
        max=100.0,
        soft_min=0.1,
        soft_max=10.0,
        step=10,
    )
    custom_yields: props.BoolProperty(
        name="Gives Way",
        description="Keep a bend, instead of springing back always",
        default=True,
    )
    custom_bears: props.FloatProperty(
        name="Bears",
        description="What a joint bears before it gives way, in the weight of what hangs on it",
        default=1.25,
        min=0.01,
        max=1000.0,
        soft_max=10.0,
        step=10,
    )
    custom_springs: props.AngleProperty(
        name="Springs Back",
        description="How far a joint springs back that was pulled as hard as it bears",
        default=float(np.radians(2.0)),
        min=float(np.radians(0.01)),
        max=float(np.radians(720.0)),
        soft_max=float(np.radians(90.0)),
        step=50,
        precision=2,
    )
    custom_settles: props.FloatProperty(
        name="Settles",
        description="How long springing back takes",
        subtype="TIME_ABSOLUTE",
        default=0.05,
        min=0.001,
        max=60.0,
        soft_max=1.0,
        step=1,
        precision=3,
    )
    custom_gives: props.AngleProperty(
        name="Gives",
        description="How far a joint gives way in a second, pulled twice as hard as it bears",
        default=float(np.radians(90.0)),
        min=0.0,
        max=float(np.radians(36000.0)),
        soft_max=float(np.radians(1000.0)),
    )
    root: props.EnumProperty(
        name="Root",
        description="Whether the body stays in its place while its limbs are pulled",
        items=(
            ("HELD", "Held", "The root bone neither moves nor turns", 0),
            ("PINNED", "Pinned", "The root bone stays in its place and turns as a joint", 1),
            ("FREE", "Free", "The whole figure can be carried about", 2),
        ),
    )
    smallest: props.FactorProperty(
        name="Smallest Bone",
        description="Bones shorter than this share of the figure are no limbs of their own and "
        "follow the bone they hang on. Raise it to pose a hand without its fingers",
        default=SMALLEST,
        soft_max=0.1,
        step=1,
        precision=3,
    )

    # --- The world -----------------------------------------------------------------------------

    gravity: props.BoolProperty(name="Gravity", description="Let the figure have weight")
    use_obstacles: props.BoolProperty(
        name="Obstacles",
        description="Objects that are marked as solid stop the figure",
        default=True,
    )
    self_collision: props.BoolProperty(
        name="Self Collision",
        description="Limbs stop each other. Takes longer to compute",
    )
    friction: props.FloatProperty(
        name="Friction",
        description="How hard the figure slides on what it touches",
        default=0.6,
        min=0.0,
        max=10.0,
        soft_max=2.0,
        step=10,
    )

    # --- Keys ------------------------------------------------------------------------------------

    keys_to: props.EnumProperty(
        name="Keys",
        description="Which action gets the keys",
        items=TARGETS,
    )
    action: props.PointerProperty(
        name="Action",
        description="The action that gets the keys",
        type=bpy.types.Action,
    )
    key_blend: props.IntProperty(
        name="Blend",
        description="Over how many frames a pose that is keyed over a motion with keys on every "
        "frame comes in, and goes out again: such keys go to a layer of their own",
        default=8,
        min=1,
        soft_max=48,
    )
    record_angle: props.AngleProperty(
        name="Tolerance Angle",
        description="How far a recorded motion's keys may be off the motion of the hand, per bone",
        default=float(np.radians(1.0)),
        min=float(np.radians(0.01)),
        max=float(np.radians(45.0)),
        step=50,
        precision=2,
    )

    # --- What helps ------------------------------------------------------------------------------

    mirror: props.BoolProperty(
        name="Mirror",
        description="What is pulled on one side happens on the other too; sides are told by the "
        "bones' names, as Blender's X mirror does",
    )
    balance: props.EnumProperty(
        name="Balance",
        description="Whether the figure would stand",
        items=BALANCE,
    )
    trails: props.BoolProperty(
        name="Arcs",
        description="Draw the ways of the hand and of what it holds during a drag",
    )
    onion: props.IntProperty(
        name="Onion Skins",
        description="How many poses before and after are drawn, of frames that were shown or keyed "
        "in this session",
        default=0,
        min=0,
        soft_max=8,
    )
    onion_step: props.IntProperty(
        name="Every",
        description="Frames from one onion skin to the next",
        default=4,
        min=1,
        soft_max=48,
    )

    # --- What is shown ------------------------------------------------------------------------

    show_loads: props.BoolProperty(
        name="Loads",
        description="Show the limbs as capsules, redder where a joint bears more",
        default=True,
    )

    # --- For other objects ---------------------------------------------------------------------

    obstacle: props.EnumProperty(
        name="Obstacle",
        description="What puppets take this object for",
        items=OBSTACLES,
    )
    moves: props.EnumProperty(
        name="Movement",
        description="Whether puppets can push this object about while they are posed",
        items=MOVES,
    )
    mass: props.FloatProperty(
        name="Mass",
        description="How heavy it is to push, kg; 0 takes its volume for wood",
        default=0.0,
        min=0.0,
        soft_max=1000.0,
        precision=2,
    )


def posing_settings(armature: bpy.types.Object) -> OCTO_MOTION_PG_posing:
    """The settings of an armature object.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    return cast("OCTO_MOTION_PG_posing", armature.octo_motion.posing)  # type: ignore[attr-defined]


def marked_obstacles(scene: bpy.types.Scene) -> list[tuple[bpy.types.Object, str]]:
    """Objects of a scene that are marked as solid, with what they are taken for."""
    found: list[tuple[bpy.types.Object, str]] = []
    for item in scene.objects:
        own: Any = item
        # Settings come into being when they are looked at: what has none is left without.
        if not own.is_property_set("octo_motion"):
            continue
        kind = own.octo_motion.posing.obstacle
        if kind != "NONE" and item.visible_get():
            found.append((item, kind))
    return found
