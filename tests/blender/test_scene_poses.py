# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking at a scene at other frames, or with another action, leaves it as it was."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.scene_playback import assigned, shown_poses


def test_pose_that_is_not_keyed_survives_a_look_at_another_action() -> None:
    bpy.ops.octo_motion.add_octopus(with_mesh=False, arms=4, joints=4)
    armature: Any = bpy.context.object
    bone = armature.pose.bones["arm1.02.L"]
    bone.keyframe_insert("rotation_quaternion", frame=1)
    data = armature.animation_data
    other = data.action.copy()
    bone.rotation_quaternion = turned = (0.8, 0.6, 0.0, 0.0)
    with assigned(armature, other, other.slots[0]):
        shown_poses(armature, np.array([1.0, 5.0]))
    bpy.context.view_layer.update()
    assert tuple(bone.rotation_quaternion) == pytest.approx(turned)
