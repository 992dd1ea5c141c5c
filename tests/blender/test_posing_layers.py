# SPDX-License-Identifier: GPL-3.0-or-later
"""A key over a motion with one on every frame comes in and goes out again: nothing pops."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Quaternion

from octo_motion.blender.animation.pose_keys import Keyed, PoseKeys
from octo_motion.blender.animation.poses import pose_values
from octo_motion.core.errors import WriteError
from octo_motion.core.rotations import Floats

ARM, BODY = "arm1.01.L", "body"
FRAMES = range(1, 61)
BLEND = 8
BENT = 0.6
"""Radians that the pose is off the motion, about X."""


@pytest.fixture
def armature() -> Any:
    """An octopus whose arm and body have keys on every frame."""
    bpy.ops.octo_motion.add_octopus(with_mesh=False, joints=4)
    found: Any = bpy.context.object
    arm, body = found.pose.bones[ARM], found.pose.bones[BODY]
    for frame in FRAMES:
        arm.rotation_quaternion = Quaternion((0.0, 0.0, 1.0), 0.3 * np.sin(0.2 * frame))
        body.location = (0.0, 0.0, 0.02 * frame)
        arm.keyframe_insert("rotation_quaternion", frame=frame)
        body.keyframe_insert("location", frame=frame)
        body.keyframe_insert("rotation_quaternion", frame=frame)
    return found


def shown(armature: Any) -> dict[str, Floats]:
    """Turns (frames, 4) of the arm and places (frames, 3) of the body."""
    turns, places = [], []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        turns.append(tuple(armature.pose.bones[ARM].matrix_basis.to_quaternion()))
        places.append(tuple(armature.pose.bones[BODY].location))
    return {"turns": np.array(turns), "places": np.array(places)}


def off(one: Floats, other: Floats) -> Floats:
    """(frames,) radians between turns."""
    dots = np.abs((one * other).sum(axis=1))
    return 2.0 * np.arccos(np.clip(dots, 0.0, 1.0))


def pose(armature: Any, keys: PoseKeys, frame: int, angle: float = BENT) -> Quaternion:
    """Bend the arm, lift the body, and key both at a frame; how the arm is turned."""
    bpy.context.scene.frame_set(frame)
    arm, body = armature.pose.bones[ARM], armature.pose.bones[BODY]
    wanted = Quaternion(arm.rotation_quaternion) @ Quaternion((1.0, 0.0, 0.0), angle)
    arm.rotation_quaternion = wanted
    body.location.x += 0.1
    assert keys.insert(armature, [Keyed(ARM), Keyed(BODY, placed=True)], float(frame))
    return wanted


@pytest.mark.parametrize("target", ["CURRENT", "COPY", "CHOSEN"])
def test_key_over_dense_keys_comes_in_and_goes_out_over_the_chosen_frames(
    armature: Any, target: Any
) -> None:
    walk = armature.animation_data.action
    before = shown(armature)
    keys = PoseKeys(armature, target, walk, blend=BLEND)
    wanted = pose(armature, keys, 30)
    after = shown(armature)
    apart = off(before["turns"], after["turns"])
    at = FRAMES.index(30)
    assert Quaternion(after["turns"][at]).rotation_difference(wanted).angle < 1e-3
    assert after["places"][at] == pytest.approx(before["places"][at] + [0.1, 0.0, 0.0], abs=1e-5)
    outside = np.abs(np.array(FRAMES) - 30) >= BLEND
    assert apart[outside].max() < 1e-3
    assert np.abs(after["places"] - before["places"])[outside].max() < 1e-5
    # No step is larger than that of an even way there by more than its ease: 1.5 times.
    assert np.abs(np.diff(apart)).max() < 1.6 * BENT / BLEND
    assert keys.layered == walk.name
    assert armature.animation_data.action != walk
    assert len(walk.layers[0].strips[0].channelbags[0].fcurves[0].keyframe_points) == len(FRAMES)


def test_second_pose_nearby_is_gone_to_from_the_first(armature: Any) -> None:
    before = shown(armature)
    keys = PoseKeys(armature, blend=BLEND)
    pose(armature, keys, 30)
    pose(armature, keys, 35, 0.0)
    pose(armature, keys, 50)
    apart = off(before["turns"], shown(armature)["turns"])
    assert apart[FRAMES.index(30)] == pytest.approx(BENT, abs=1e-3)
    # What was blended to at 35 is there still, and nothing falls back in between.
    between = [apart[FRAMES.index(each)] for each in range(30, 36)]
    assert min(between) > 0.15
    assert apart[FRAMES.index(21)] < 1e-3
    assert apart[FRAMES.index(59)] < 1e-3
    assert apart[FRAMES.index(50)] == pytest.approx(BENT, abs=1e-3)


def test_session_that_goes_on_another_day_blends_too(armature: Any) -> None:
    before = shown(armature)
    pose(armature, PoseKeys(armature, blend=BLEND), 20)
    pose(armature, PoseKeys(armature, blend=3.0), 45)
    apart = off(before["turns"], shown(armature)["turns"])
    assert apart[FRAMES.index(32)] < 1e-3
    assert apart[FRAMES.index(45)] == pytest.approx(BENT, abs=1e-3)
    assert apart[FRAMES.index(54)] < 1e-3
    assert len(armature.animation_data.nla_tracks) == 1


def test_taking_back_leaves_the_dense_action_as_it_was(armature: Any) -> None:
    walk, values = armature.animation_data.action, pose_values(armature)
    before = shown(armature)
    keys = PoseKeys(armature, blend=BLEND)
    pose(armature, keys, 30)
    keys.take_back(armature)
    assert armature.animation_data.action == walk
    assert len(armature.animation_data.nla_tracks) == 0
    assert [each.name for each in bpy.data.actions] == [walk.name]
    after = shown(armature)
    assert all(np.array_equal(before[each], after[each]) for each in before)
    assert set(values) == set(pose_values(armature))


def test_keys_far_apart_get_another_key_among_them(armature: Any) -> None:
    bpy.context.scene.frame_set(1)
    animation = armature.animation_data
    for layer in animation.action.layers:
        for curve in layer.strips[0].channelbags[0].fcurves:
            for number in reversed(range(len(curve.keyframe_points))):
                if number % 6:
                    curve.keyframe_points.remove(curve.keyframe_points[number])
    action = animation.action
    keys = PoseKeys(armature, blend=BLEND)
    pose(armature, keys, 30)
    assert animation.action == action
    assert keys.layered == ""
    assert len(animation.nla_tracks) == 0


def test_dense_keys_without_nla_are_told(armature: Any) -> None:
    armature.animation_data.use_nla = False
    with pytest.raises(WriteError, match="is switched off"):
        pose(armature, PoseKeys(armature, blend=BLEND), 30)
    assert len(armature.animation_data.nla_tracks) == 0
