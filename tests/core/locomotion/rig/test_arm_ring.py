# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms roll towards their neighbours near the body, and nothing else of them moves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.rig import ArmFrames, ArmRing, arm_azimuths, frames_of_arm
from octo_motion.core.rotations import Floats, from_axis_angle, multiply, rotate
from tests.core.rigs import body_with_arms

MOMENTS = 4
SLOW = 3.0
"""Seconds of a cycle in which there is time to roll."""


def ring_of(count: int, joints: int = 12) -> tuple[list[ArmFrames], Floats]:
    skeleton, arms, body = body_with_arms(count, joints)
    bones = [arm.bones for arm in arms]
    return [frames_of_arm(skeleton, each, body) for each in bones], arm_azimuths(
        skeleton, bones, body
    )


def of_unlike_arms() -> tuple[list[ArmFrames], Floats]:
    """Eight arms, every other of fewer bones."""
    (long, azimuths), (short, _) = ring_of(8, 12), ring_of(8, 5)
    return [pair[number % 2] for number, pair in enumerate(zip(long, short, strict=True))], azimuths


def at_rest(arms: list[ArmFrames]) -> tuple[Floats, Floats]:
    bones = sum(len(arm.bones) for arm in arms)
    rotations = np.zeros((MOMENTS, bones, 4))
    rotations[..., 0] = 1.0
    return rotations, np.zeros((MOMENTS, bones))


def swung(arms: list[ArmFrames], seed: int, size: float) -> tuple[Floats, Floats]:
    """Arms whose bones are turned at random, by so much at most, and stretched."""
    random = np.random.default_rng(seed)
    rotations, strains = at_rest(arms)
    axes = random.normal(size=(*rotations.shape[:2], 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    turns = from_axis_angle(axes, random.uniform(-size, size, rotations.shape[:2]))
    return multiply(rotations, turns), random.uniform(-0.1, 0.2, strains.shape)


def standing(arms: list[ArmFrames], rotations: Floats, strains: Floats) -> tuple[Floats, Floats]:
    """Frames (moments, bones, 4) and joints (moments, joints, 3) of all arms."""
    frames, joints, start = [], [], 0
    for arm in arms:
        own = slice(start, start + len(arm.bones))
        frames.append(arm.from_bones(rotations[:, own]))
        joints.append(arm.joints(frames[-1], strains[:, own]))
        start = own.stop
    return np.concatenate(frames, axis=1), np.concatenate(joints, axis=1)


@pytest.mark.parametrize("unlike", [False, True], ids=["alike", "unlike"])
def test_nothing_rolls_at_rest(unlike: bool) -> None:  # noqa: FBT001
    arms, azimuths = of_unlike_arms() if unlike else ring_of(8)
    ring = ArmRing.of(arms, azimuths)
    assert ring is not None
    rotations, strains = at_rest(arms)
    np.testing.assert_allclose(ring.rolled(rotations, strains, SLOW), rotations, atol=1e-12)


@given(st.integers(0, 10_000), st.floats(0.1, 1.5), st.booleans())
def test_joints_stay_and_so_does_all_beyond_half_of_an_arm(
    seed: int,
    size: float,
    unlike: bool,  # noqa: FBT001
) -> None:
    arms, azimuths = of_unlike_arms() if unlike else ring_of(8)
    ring = ArmRing.of(arms, azimuths)
    assert ring is not None
    rotations, strains = swung(arms, seed, size)
    before, joints = standing(arms, rotations, strains)
    after, moved = standing(arms, ring.rolled(rotations, strains, SLOW), strains)
    np.testing.assert_allclose(moved, joints, atol=1e-9)
    far = np.concatenate([arm.along >= 0.5 for arm in arms])
    same = np.abs(np.sum(before * after, axis=-1))
    np.testing.assert_allclose(same[:, far], 1.0, atol=1e-12)
    # About themselves alone: their segments point where they did.
    along, rolled = (rotate(each, np.array([1.0, 0.0, 0.0])) for each in (before, after))
    np.testing.assert_allclose(rolled, along, atol=1e-9)


def between(arms: list[ArmFrames], number: int, rotations: Floats) -> float:
    """Degrees by which the fourth bone of an arm is askew between its neighbours, whose arms come
    before and after it, one above the other.
    """
    frames, joints = standing(arms, rotations, np.zeros(rotations.shape[:2]))
    bones = len(arms[0].bones)
    before, after = (joints[0, (number + side) % len(arms) * (bones + 1) + 4] for side in (-1, 1))
    along, across = (rotate(frames[0, number * bones + 3], each) for each in np.eye(3)[[0, 2]])
    line = after - before
    line -= (line @ along) * along
    return float(np.degrees(np.arccos(abs(across @ line) / np.linalg.norm(line))))


def test_an_arm_between_one_above_and_one_below_turns_its_side_to_them() -> None:
    arms, azimuths = ring_of(8)
    ring = ArmRing.of(arms, azimuths)
    assert ring is not None
    rotations, strains = at_rest(arms)
    for number, sign in ((2, 1.0), (4, -1.0)):
        # About its underside towards the arm between, and up or down, all of it.
        towards, up = (
            from_axis_angle(axis, np.asarray(sign * np.radians(angle)))
            for axis, angle in ((np.array([0.0, 1.0, 0.0]), -38.0), (np.eye(3)[2], -30.0))
        )
        straight = multiply(arms[number].at_rest, multiply(towards, up))
        rotations[:, 12 * number : 12 * (number + 1)] = arms[number].to_bones(straight)
    assert between(arms, 3, rotations) > 60.0
    rolled = ring.rolled(rotations, strains, SLOW)
    assert between(arms, 3, rolled) < 0.75 * between(arms, 3, rotations)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_arms_stand_beside_none(count: int) -> None:
    arms, azimuths = ring_of(count)
    assert ArmRing.of(arms, azimuths) is None


def test_arms_without_time_for_it_do_not_roll() -> None:
    arms, azimuths = ring_of(8)
    ring = ArmRing.of(arms, azimuths)
    assert ring is not None
    rotations, strains = swung(arms, 1, 0.8)
    assert ring.rolled(rotations, strains, 0.8) is rotations
    slow = ring.rolled(rotations, strains, SLOW)
    some = ring.rolled(rotations, strains, 0.9)
    lost = [np.abs(np.sum(each * rotations, axis=-1)).min() for each in (slow, some)]
    assert lost[0] < lost[1] < 1.0


@given(st.integers(0, 10_000))
def test_it_does_not_matter_how_a_rig_s_bones_are_rolled(seed: int) -> None:
    plain, azimuths = ring_of(8)
    rotations, strains = swung(plain, seed, 0.6)
    wanted = standing(plain, rotations, strains)[0].reshape(MOMENTS, 8, 12, 4)
    found = [wanted.reshape(MOMENTS, 96, 4)]
    skeleton, listed, body = body_with_arms(8, 12, rolls=np.random.default_rng(seed))
    for arms in (plain, [frames_of_arm(skeleton, arm.bones, body) for arm in listed]):
        ring = ArmRing.of(arms, azimuths)
        assert ring is not None
        bones = [arm.to_bones(wanted[:, number]) for number, arm in enumerate(arms)]
        rolled = ring.rolled(np.concatenate(bones, axis=1), strains, SLOW)
        found.append(standing(arms, rolled, strains)[0])
    same = np.abs(np.sum(found[1] * found[2], axis=-1))
    np.testing.assert_allclose(same, 1.0, atol=1e-9)
    assert np.abs(np.sum(found[0] * found[1], axis=-1)).min() < 1.0 - 1e-4
