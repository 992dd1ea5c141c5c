# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose as an asset is the pose that was there, and the armature's own action stays."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.ui.rig import make_octopus


@pytest.fixture
def posed() -> Any:
    armature: Any = make_octopus("Posed")
    bpy.context.view_layer.objects.active = armature
    for number, bone in enumerate(armature.pose.bones):
        bone.rotation_mode = "XYZ" if number % 2 else "QUATERNION"
        if number % 2:
            bone.rotation_euler = (0.1, 0.02 * number, -0.3)
        else:
            bone.rotation_quaternion = (0.8, 0.6, 0.0, 0.0)
    return armature


def basis(armature: Any) -> Any:
    return np.array([np.array(bone.matrix_basis) for bone in armature.pose.bones])


def test_a_pose_comes_back_from_its_asset(posed: Any) -> None:
    there = basis(posed)
    assert bpy.ops.octo_motion.pose_asset(name="Curled") == {"FINISHED"}
    assert posed.animation_data is None or posed.animation_data.action is None
    np.testing.assert_allclose(basis(posed), there)
    asset = bpy.data.actions["Curled"]
    assert asset.asset_data is not None
    for bone in posed.pose.bones:
        bone.matrix_basis.identity()
    # As the pose library does.
    posed.pose.apply_pose_from_action(asset)
    np.testing.assert_allclose(basis(posed), there, atol=1e-6)


def test_of_selected_bones_it_is_the_pose_of_these_alone(posed: Any) -> None:
    bpy.ops.object.mode_set(mode="POSE")
    bpy.ops.pose.select_all(action="DESELECT")
    name = posed.pose.bones[3].name
    bone = posed.pose.bones[3]
    (bone if hasattr(bone, "select") else bone.bone).select = True
    bpy.ops.octo_motion.pose_asset()
    bpy.ops.object.mode_set(mode="OBJECT")
    (asset,) = [each for each in bpy.data.actions if each.asset_data is not None]
    bags = [bag for layer in asset.layers for strip in layer.strips for bag in strip.channelbags]
    assert {curve.group.name for bag in bags for curve in bag.fcurves} == {name}


def test_each_arm_has_a_collection_with_its_bones(posed: Any) -> None:
    bpy.ops.octo_motion.detect_arms()
    assert bpy.ops.octo_motion.arm_collections() == {"FINISHED"}
    bpy.ops.octo_motion.arm_collections()
    for arm in posed.octo_motion.locomotion.arms:
        own = posed.data.collections_all[arm.name]
        assert {each.name for each in own.bones} == {each.name for each in arm.bones}
