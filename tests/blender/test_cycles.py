# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk of one cycle goes on as long as it is wanted; what it was made from stays as it is."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.clips import read_clip
from octo_motion.blender.animation.fcurves import lasting
from octo_motion.core.errors import ClipError
from octo_motion.core.rotations import angle_between

PERIOD = 20
STEP = 0.8


@pytest.fixture
def walker() -> Any:
    """A bone that sways once in 20 frames and travels 0.8 m meanwhile."""
    bpy.ops.object.armature_add()
    armature: Any = bpy.context.object
    bone = armature.pose.bones[0]
    bone.rotation_mode = "XYZ"
    for frame in range(1, PERIOD + 2):
        share = (frame - 1) / PERIOD
        bone.location = (0.1 * np.sin(2.0 * np.pi * share), 0.0, STEP * share)
        bone.rotation_euler = (0.5 * np.sin(2.0 * np.pi * share), 0.0, 0.0)
        bone.keyframe_insert("location", frame=frame)
        bone.keyframe_insert("rotation_euler", frame=frame)
    return armature


def keys(action: Any) -> list[tuple[float, ...]]:
    (layer,) = action.layers
    (strip,) = layer.strips
    return [
        tuple(value for key in curve.keyframe_points for value in key.co)
        for bag in strip.channelbags
        for curve in bag.fcurves
    ]


def modifiers(action: Any) -> int:
    (layer,) = action.layers
    (strip,) = layer.strips
    return sum(len(curve.modifiers) for bag in strip.channelbags for curve in bag.fcurves)


def test_each_cycle_goes_on_from_where_the_one_before_has_led(walker: Any) -> None:
    action = walker.animation_data.action
    before = keys(action)
    longer = lasting(action, 70)
    clip = read_clip(walker, longer)
    assert (clip.frames[0], clip.frames[-1], len(clip)) == (1.0, 70.0, 70)
    first, later = slice(0, PERIOD), slice(2 * PERIOD, 3 * PERIOD)
    assert angle_between(clip.rotations[later], clip.rotations[first]).max() < 1e-5
    travelled = clip.locations[later, 0] - clip.locations[first, 0]
    assert travelled == pytest.approx(np.tile([0.0, 0.0, 2.0 * STEP], (PERIOD, 1)), abs=1e-5)
    # No step is larger than those within a cycle.
    steps = np.linalg.norm(np.diff(clip.locations[:, 0], axis=0), axis=-1)
    assert steps.max() < steps[:PERIOD].max() + 1e-5
    # Only the copy has changed, and its keys have not.
    assert keys(action) == keys(longer) == before
    assert modifiers(action) == 0
    assert walker.animation_data.action == action
    # Asked for once more, it is not repeated twice over.
    assert modifiers(lasting(longer, 90)) == modifiers(longer)


@pytest.mark.parametrize("cut", [False, True])
def test_all_curves_repeat_together(walker: Any, *, cut: bool) -> None:
    """Also one whose keys end earlier, and where the artist has set a shorter range."""
    action = walker.animation_data.action
    curve = (
        action.layers[0]
        .strips[0]
        .channelbags[0]
        .fcurves.find('pose.bones["Bone"].rotation_euler', index=0)
    )
    while len(curve.keyframe_points) > 12:
        curve.keyframe_points.remove(curve.keyframe_points[-1])
    period = PERIOD
    if cut:
        action.use_frame_range, action.frame_start, action.frame_end = True, 3, 15
        period = 12
    before = keys(action)
    once = read_clip(walker, action)
    longer = lasting(action, 3 * period + 1)
    clip = read_clip(walker, longer)
    assert (len(once), len(clip)) == (period + 1, 3 * period + 1)
    for start in (0, period, 2 * period):
        # Where one cycle ends the next begins: here, with another pose.
        rows = slice(start + 1, start + period)
        assert angle_between(clip.rotations[rows], once.rotations[1:-1]).max() < 1e-5
    assert keys(action) == before


def test_a_longer_motion_is_cut(walker: Any) -> None:
    action = walker.animation_data.action
    shorter = lasting(action, 8)
    assert len(read_clip(walker, shorter)) == 8
    assert modifiers(shorter) == 0
    assert tuple(action.frame_range) == (1.0, PERIOD + 1.0)


def test_a_pose_cannot_be_repeated() -> None:
    bpy.ops.object.armature_add()
    armature: Any = bpy.context.object
    armature.pose.bones[0].keyframe_insert("location", frame=3)
    count = len(bpy.data.actions)
    with pytest.raises(ClipError, match="has only one frame"):
        lasting(armature.animation_data.action, 50)
    assert len(bpy.data.actions) == count
