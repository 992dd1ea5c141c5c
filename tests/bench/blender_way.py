# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own ways to the same motion: constraints that move along, then a bake.

Inverse kinematics reaches for animated targets; spline IK lays each arm along an animated curve,
which somebody has to have made: it is given the one that ours comes to. Only the bones of the arms
are baked, and making constraints, targets and curves does not count as time.
"""

from __future__ import annotations

import time
from typing import Literal, get_args

import bpy
import numpy as np

from octo_motion.blender.versions import select
from octo_motion.core.rotations import Floats
from tests.bench.scene import Curve, Group

_Channel = Literal["LOCATION", "ROTATION", "SCALE", "BBONE", "PROPS"]
"""What a bake writes; by default all of it."""


def rig_with_targets(armature: bpy.types.Object, wanted: list[Group]) -> None:
    """An empty for each group, keyed at every frame, and a constraint that reaches for it."""
    assert armature.pose is not None
    for number, group in enumerate(wanted):
        empty = bpy.data.objects.new(f"Target {number}", None)
        # A child of the armature: targets travel along, as they do in ours.
        empty.parent = armature
        bpy.context.scene.collection.objects.link(empty)
        _key(empty, "OBJECT", {"location": group.targets})
        end = armature.pose.bones[group.bones[-1]]
        constraint = end.constraints.new("IK")
        assert isinstance(constraint, bpy.types.KinematicConstraint)
        constraint.target = empty
        constraint.chain_count = len(group.bones)
        constraint.use_stretch = False


def rig_with_curves(armature: bpy.types.Object, arms: list[Curve]) -> None:
    """A curve for each arm, all points keyed at every frame, and a constraint along it."""
    assert armature.pose is not None
    for number, arm in enumerate(arms):
        curve = bpy.data.curves.new(f"Arm {number}", "CURVE")
        curve.dimensions = "3D"
        spline = curve.splines.new("POLY")
        spline.points.add(len(arm.bones))
        spline.points.foreach_set("co", np.insert(arm.joints[0], 3, 1.0, axis=1).ravel())
        lying = bpy.data.objects.new(curve.name, curve)
        # A child of the armature: curves travel along, as arms do in ours.
        lying.parent = armature
        bpy.context.scene.collection.objects.link(lying)
        points = {
            f"splines[0].points[{joint}].co": arm.joints[:, joint]
            for joint in range(len(arm.bones) + 1)
        }
        _key(curve, "CURVE", points)
        constraint = armature.pose.bones[arm.bones[-1]].constraints.new("SPLINE_IK")
        assert isinstance(constraint, bpy.types.SplineIKConstraint)
        constraint.target = lying
        constraint.chain_count = len(arm.bones)
        constraint.y_scale_mode = constraint.xz_scale_mode = "NONE"


def _key(
    owner: bpy.types.Object | bpy.types.Curve,
    kind: Literal["OBJECT", "CURVE"],
    values: dict[str, Floats],
) -> None:
    """Give something keys at every frame, by data path: places (frames, 3)."""
    action = bpy.data.actions.new(owner.name)
    slot = action.slots.new(kind, owner.name)
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    assert isinstance(strip, bpy.types.ActionKeyframeStrip)
    channelbag = strip.channelbag(slot, ensure=True)
    assert channelbag is not None
    for path, places in values.items():
        frames = len(places)
        for axis in range(3):
            curve = channelbag.fcurves.new(path, index=axis)
            curve.keyframe_points.add(frames)
            keys = np.stack([np.arange(1, frames + 1), places[:, axis]], axis=1)
            curve.keyframe_points.foreach_set("co", keys.ravel())
            curve.update()
    data = owner.animation_data_create()
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
