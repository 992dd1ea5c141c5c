# SPDX-License-Identifier: GPL-3.0-or-later
"""Many arms at once are where each of them is by itself."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.locomotion.rig.bone_rotations import (
    ArmFrames,
    batches_by_bones,
    frames_of_arm,
)
from octo_motion.core.rotations import Floats, normalized
from tests.core.rigs import body_with_arms

MOMENTS = 5


@pytest.fixture(params=[True, False], ids=["all follow", "some follow nothing"])
def arms(request: pytest.FixtureRequest) -> list[ArmFrames]:
    """Arms of 7 and of 4 bones, by turns, rolled at random."""
    found: list[ArmFrames] = []
    for joints in (7, 4):
        rolls = np.random.default_rng(joints)
        skeleton, listed, body = body_with_arms(3, joints, rolls=rolls)
        if not request.param:
            inherits = list(skeleton.inherits_rotation)
            inherits[skeleton.index["arm1.2"]] = False
            skeleton = replace(skeleton, inherits_rotation=tuple(inherits))
        found += [frames_of_arm(skeleton, arm.bones, body) for arm in listed]
    return found[::2] + found[1::2]


def posed(arm: ArmFrames, seed: int) -> tuple[Floats, Floats]:
    """Rotations (moments, bones, 4) and strains (moments, bones)."""
    random = np.random.default_rng(seed)
    shape = MOMENTS, len(arm.bones)
    return normalized(random.normal(size=(*shape, 4))), random.uniform(-0.2, 0.4, shape)


def test_their_joints_are_where_each_arm_s_own_are(arms: list[ArmFrames]) -> None:
    for numbers, together in batches_by_bones(arms):
        poses = [posed(arms[number], number) for number in numbers]
        rotations = np.concatenate([np.moveaxis(each, 0, 2) for each, _ in poses], axis=2)
        strains = np.concatenate([each.T for _, each in poses], axis=1)
        arm = np.repeat(np.arange(len(numbers)), MOMENTS)
        joints = together.joints(together.orientations(rotations, arm), arm, strains)
        expected = [
            arms[number].joints(arms[number].from_bones(turns), longer)
            for number, (turns, longer) in zip(numbers, poses, strict=True)
        ]
        found = np.moveaxis(joints, 2, 0)
        np.testing.assert_allclose(found, np.concatenate(expected), atol=1e-12)


def test_bones_come_back_from_their_orientations(arms: list[ArmFrames]) -> None:
    for numbers, together in batches_by_bones(arms):
        rotations = np.moveaxis(posed(arms[numbers[0]], 1)[0], 0, 2)
        for place in range(len(numbers)):
            arm = np.full(MOMENTS, place)
            back = together.rotations(together.orientations(rotations, arm), arm)
            np.testing.assert_allclose(back, rotations, atol=1e-12)


def test_arms_of_as_many_bones_are_together(arms: list[ArmFrames]) -> None:
    found = batches_by_bones(arms)
    assert sorted(number for numbers, _ in found for number in numbers) == list(range(len(arms)))
    assert len(found) == 2
    for numbers, together in found:
        assert {len(arms[number].bones) for number in numbers} == {len(together.lengths)}
