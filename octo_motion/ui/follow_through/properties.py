# SPDX-License-Identifier: GPL-3.0-or-later
"""``Object.octo_motion.follow_through``: which bones follow an action, how, and where it goes."""

from __future__ import annotations

from typing import Any, Final, cast

import bpy
import numpy as np

from ...blender.rig import armature_data
from ...core.follow_through import FollowSettings
from .. import declared_settings as props
from ..declared_settings import declared, make_overridable
from ..floor import Floor

RESULTS: Final = (
    ("LAYER", "New Layer", "A layer of the NLA over the action, which itself stays as it is", 0),
    ("ACTION", "New Action", "A copy of the action in which the chosen bones follow", 1),
    ("SAME", "Same Action", "Into the action itself, in place of the bones' own keys", 2),
)

KEYS: Final = (
    ("DENSE", "All", "A key on every frame: the motion exactly as computed", 0),
    ("REDUCED", "Few", "As few keys as the tolerance allows, with handles", 1),
)


class FollowChain(bpy.types.PropertyGroup):
    """A chain of bones that follows."""

    name: bpy.props.StringProperty(name="First Bone", description="Where the chain begins")
    last: props.StringProperty(name="Last Bone", description="Where the chain ends")
    use: props.BoolProperty(
        name="Follows", description="Whether this chain is simulated", default=True
    )
    strength: props.FloatProperty(
        name="Strength",
        description="How firmly this chain is held to the action, times the strength of all. Key "
        "it to let go and take hold again",
        default=1.0,
        min=0.001,
        max=1000.0,
        soft_min=0.1,
        soft_max=10.0,
        step=10,
    )
    tip: props.FloatProperty(
        name="At Tip",
        description="How firm its last bone is against its first: less lets the tip whip",
        default=1.0,
        min=0.001,
        max=1000.0,
        soft_min=0.1,
        soft_max=10.0,
        step=10,
    )


_DECLARED: Final = (
    *("material", "strength", "damping", "springs", "bears", "gravity", "medium", "drag"),
    *("buoyancy", "friction", "self_collision", "start"),
)


class FollowPhysics:
    """What core declares."""

    __annotations__ = {each: declared(FollowSettings, each) for each in _DECLARED}


class OCTO_MOTION_PG_follow_through(Floor, FollowPhysics, bpy.types.PropertyGroup):
    """Settings of follow-through."""

    chains: props.CollectionProperty(
        name="Chains", description="The bones that follow, chain by chain", type=FollowChain
    )
    active_chain: props.IntProperty(
        name="Active Chain", description="The chain that is selected in the list", min=0
    )
    wind: props.FloatVectorProperty(
        name="Wind",
        description="How fast air or water itself moves, along the world's axes",
        subtype="VELOCITY",
        size=3,
        soft_min=-30.0,
        soft_max=30.0,
    )
    use_obstacles: props.BoolProperty(
        name="Obstacles",
        description="Objects that are marked as solid for posing stop the bones and push them, as "
        "they move",
        default=True,
    )
    body: props.BoolProperty(
        name="Body",
        description="The rest of the body stops the bones, as thick as its skin",
        default=True,
    )
    loop: props.BoolProperty(
        name="Loop",
        description="An action that ends as it begins, or is marked as cyclic, is run until the "
        "bones repeat themselves too, so that its end meets its beginning",
        default=True,
    )
    visual: props.BoolProperty(
        name="As Shown",
        description="Follow the action as the scene shows it, with constraints and drivers. Plays "
        "the scene, so takes longer",
    )
    result_as: props.EnumProperty(name="Result", description="Where the motion goes", items=RESULTS)
    keys: props.EnumProperty(name="Keys", description="How many keys the bones get", items=KEYS)
    key_angle: props.AngleProperty(
        name="Angle",
        description="How far any bone may be turned away, at any frame, where there are few keys",
        default=float(np.radians(0.5)),
        min=float(np.radians(0.001)),
        max=float(np.radians(45.0)),
        step=10,
        precision=2,
    )
    base: props.PointerProperty(
        name="Action",
        description="The action that was followed last. It is never changed, unless it is to be "
        "the result itself",
        type=bpy.types.Action,
    )
    result: props.PointerProperty(
        name="Result Action",
        description="What was made of it, and is made anew in place",
        type=bpy.types.Action,
    )


def follow_settings(armature: bpy.types.Object) -> OCTO_MOTION_PG_follow_through:
    """The settings of an armature object.

    Raises:
        RigError: the object is no armature.
    """
    armature_data(armature)
    make_overridable(armature)
    own: Any = armature
    return cast("OCTO_MOTION_PG_follow_through", own.octo_motion.follow_through)
