# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own way to the same motion: inverse kinematics on animated targets, then a bake.

Only the bones of the arms are baked, and making the constraints and keying the targets does not
count as time.
"""

from __future__ import annotations

import time
from typing import Literal, get_args

import bpy
import numpy as np

from octo_motion.blender.versions import select
from tests.bench.scene import Group

_Channel = Literal["LOCATION", "ROTATION", "SCALE", "BBONE", "PROPS"]
"""What a bake writes; by default all of it."""


def rig_with_targets(armature: bpy.types.Object, wanted: list[Group], frames: int) -> None:
    """An empty for each group, keyed at every frame, and a constraint that reaches for it."""
    assert armature.pose is not None
    for number, group in enumerate(wanted):
        empty = bpy.data.objects.new(f"Target {number}", None)
        # A child of the armature: targets travel along, as they do in ours.
        empty.parent = armature
        bpy.context.scene.collection.objects.link(empty)
        _key(empty, group, frames)
        end = armature.pose.bones[group.bones[-1]]
        constraint = end.constraints.new("IK")
        assert isinstance(constraint, bpy.types.KinematicConstraint)
        constraint.target = empty
        constraint.chain_count = len(group.bones)
        constraint.use_stretch = False


def _key(empty: bpy.types.Object, group: Group, frames: int) -> None:
    action = bpy.data.actions.new(empty.name)
    slot = action.slots.new("OBJECT", empty.name)
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    assert isinstance(strip, bpy.types.ActionKeyframeStrip)
    channelbag = strip.channelbag(slot, ensure=True)
    assert channelbag is not None
    for axis in range(3):
        curve = channelbag.fcurves.new("location", index=axis)
        curve.keyframe_points.add(frames)
        keys = np.stack([np.arange(1, frames + 1), group.targets[:, axis]], axis=1)
        curve.keyframe_points.foreach_set("co", keys.ravel())
        curve.update()
    data = empty.animation_data_create()
    assert data is not None
    data.action, data.action_slot = action, slot


def bake(
    armature: bpy.types.Object, wanted: list[Group], frames: int, *, rotations_only: bool
) -> float:
    """Bake what the constraints do into keys; the seconds it takes.

    Args:
        armature: with its constraints.
        wanted: the groups to bake.
        frames: from 1 to this.
        rotations_only: whether to leave out keys of location and scale, which the bake writes
            unless told otherwise.
    """
    assert armature.pose is not None
    baked = {bone for group in wanted for bone in group.bones}
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="POSE")
    for bone in armature.pose.bones:
        select(bone, state=bone.name in baked)
    channels: set[_Channel] = {"ROTATION"} if rotations_only else set(get_args(_Channel))
    start = time.perf_counter()
    bpy.ops.nla.bake(
        frame_start=1,
        frame_end=frames,
        only_selected=True,
        visual_keying=True,
        clear_constraints=False,
        bake_types={"POSE"},
        channel_types=channels,
    )
    seconds = time.perf_counter() - start
    bpy.ops.object.mode_set(mode="OBJECT")
    # From here on only the keys speak.
    for group in wanted:
        for constraint in armature.pose.bones[group.bones[-1]].constraints:
            constraint.mute = True
    return seconds
