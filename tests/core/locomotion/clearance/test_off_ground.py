# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms whose gait knows no ground are kept off it, gently, and no others."""

import numpy as np
import pytest

from octo_motion.core.locomotion.clearance.corrections import (
    ArmsOverGround,
    afloat,
    keeping_off_ground,
)
from octo_motion.core.locomotion.ground.surface import LevelGround
from octo_motion.core.locomotion.rig.bone_rotations import frames_of_arm
from octo_motion.core.locomotion.rig.poses import Poses
from octo_motion.core.rotations import Floats, from_axis_angle
from octo_motion.core.smoothing import least_jerk
from octo_motion.core.steps import finished
from tests.core.grounds import GROUNDS, largest_turn, walker


def hanging(frames: int) -> tuple[ArmsOverGround, Poses, list[Floats]]:
    """A body that comes down until half of each arm hangs into the ground, and radii."""
    walk = walker(GROUNDS["plane"])
    arms = [frames_of_arm(walk.skeleton, arm.bones, walk.body) for arm in walk.generator.arms]
    course = ArmsOverGround(arms, LevelGround(0.0), 1.0)
    bones = sum(len(arm.bones) for arm in arms)
    rotations = np.zeros((frames, bones, 4))
    rotations[..., 0] = 1.0
    for arm, own in zip(arms, course.bones, strict=True):
        # Each bone is bent a little further down than the one before.
        down = from_axis_angle(np.array([0.0, 0.0, 1.0]), np.full(len(arm.bones), 0.15))
        rotations[:, own] = arm.to_bones(arm.shaped(down))
    locations = np.zeros((frames, 3))
    locations[:, 2] = np.linspace(1.5, 0.3, frames)
    orientations = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))
    radii = [np.full(len(arm.bones) + 1, 0.01) for arm in arms]
    poses = Poses(rotations, np.zeros((frames, bones)), locations, orientations)
    return course, poses, radii


def test_arms_that_would_hang_into_the_ground_stay_above_it() -> None:
    course, poses, radii = hanging(49)
    before = course.clear(course.joints(poses))
    assert before[0].min() > 0.1
    assert before[-1].max() < -0.2
    loose = np.ones((49, len(course.arms)))
    rotations = finished(keeping_off_ground(course, poses, radii, loose))
    after = Poses(rotations, poses.strains, poses.locations, poses.orientations)
    assert course.clear(course.joints(after)).min() > 0.0
    # High above nothing happens, and nothing happens at once.
    np.testing.assert_array_equal(rotations[0], poses.rotations[0])
    assert largest_turn(rotations) < np.radians(12.0)


def test_arms_that_are_not_loose_stay_as_they_are() -> None:
    course, poses, radii = hanging(5)
    loose = np.zeros((5, len(course.arms)))
    loose[:, 1] = 1.0
    rotations = finished(keeping_off_ground(course, poses, radii, loose))
    for number, own in enumerate(course.bones):
        same = np.array_equal(rotations[:, own], poses.rotations[:, own])
        assert same == (number != 1)


def test_arms_that_walk_see_to_it_themselves() -> None:
    share = least_jerk(np.linspace(0.0, 1.0, 101))[:, None]
    off, on = afloat([False, True], [share]), afloat([True, False], [share])
    assert (off[0], off[-1], on[0], on[-1]) == (0.0, 1.0, 1.0, 0.0)
    np.testing.assert_allclose(off, on[::-1], atol=1e-12)
    # From one walk to another it is so in between alone.
    both = afloat([False, False], [share])
    assert both[0] == both[-1] == 0.0
    assert both[50] == pytest.approx(1.0)
    for course in (off, on, both):
        assert np.abs(np.diff(course, axis=0)).max() < 0.12


def test_an_arm_that_has_let_go_is_raised_as_far_as_its_body_crouches() -> None:
    share = np.array([0.0, 1e-6, 1e-6, 1e-6, 1.0])[:, None]
    crouched = np.array([1.0, 0.0, 0.6, 1.0, 0.6])[:, None]
    leaving = afloat([False, True], [share], crouched)
    assert leaving[0] == 0.0
    assert leaving[1] < 0.01
    np.testing.assert_allclose(leaving[2:, 0], [0.6, 1.0, 1.0])
    # What holds on already, or still, sees to it itself.
    coming = afloat([True, False], [1.0 - share], crouched)
    assert coming[0] == 0.0
    np.testing.assert_allclose(coming[2:, 0], [0.6, 1.0, 1.0])
