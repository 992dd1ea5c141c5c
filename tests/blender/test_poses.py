# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that no action moves any more do not stay where the last key had put them."""

from typing import Any

import bpy

from octo_motion.blender.animation.poses import animated_bones, rest_properties


def make_armature() -> Any:
    armature: Any = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name in ("A", 'B"]x', "C"):
        armature.data.edit_bones.new(name).tail = (0.0, 1.0, 0.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def test_bones_with_keys_are_found_whatever_their_names() -> None:
    armature = make_armature()
    armature.keyframe_insert("location")
    armature.pose.bones['B"]x'].keyframe_insert("rotation_quaternion")
    armature.pose.bones["C"].keyframe_insert("scale")
    assert animated_bones(armature.animation_data.action) == {'B"]x'}


def test_properties_of_bones_go_to_rest_and_others_stay() -> None:
    armature = make_armature()
    for bone, mode in zip(armature.pose.bones, ("QUATERNION", "AXIS_ANGLE", "YZX"), strict=True):
        bone.rotation_mode = mode
        bone.location = (1.0, 2.0, 3.0)
    armature.pose.bones["A"].rotation_quaternion = (0.6, 0.8, 0.0, 0.0)
    armature.pose.bones['B"]x'].rotation_axis_angle = (1.0, 0.0, 0.0, 1.0)
    bones = [armature.pose.bones[name] for name in ("A", 'B"]x')]
    kinds = ("location", "rotation_quaternion", "rotation_axis_angle")
    paths = [bone.path_from_id(each) for bone in bones for each in kinds]
    rest_properties(
        armature, [*paths, 'pose.bones["No such bone"].scale', "location", "hide_render"]
    )
    assert armature.pose.bones["A"].matrix_basis.is_identity
    assert armature.pose.bones['B"]x'].matrix_basis.is_identity
    assert tuple(armature.pose.bones["C"].location) == (1.0, 2.0, 3.0)
