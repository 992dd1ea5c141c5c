# SPDX-License-Identifier: GPL-3.0-or-later
"""Where arms of a body that swims as it lies open to."""

import numpy as np
import pytest

from octo_motion.core.locomotion.gait.swim_spread import swim_azimuths
from octo_motion.core.locomotion.rig.arm_chains import BodyFrame, arm_azimuths, body_frame
from octo_motion.core.rotations import Floats
from octo_motion.core.skeleton import Skeleton
from tests.core.rigs import UP, bone_matrix, skeleton_of

LYING = 0.5 * np.pi


def arms_along(
    directions: Floats, roots: Floats
) -> tuple[Skeleton, list[tuple[str, ...]], BodyFrame]:
    """Straight arms of three bones along directions (arms, 3) from roots (arms, 3)."""
    names, parents, matrices = ["root"], [-1], [bone_matrix(np.zeros(3), UP, 0.0)]
    arms = []
    for number, (along, root) in enumerate(zip(directions, roots, strict=True)):
        bones = tuple(f"arm{number}.{joint}" for joint in range(3))
        for joint, bone in enumerate(bones):
            parents.append(len(names) - 1 if joint else 0)
            names.append(bone)
            matrices.append(bone_matrix(root + joint / 3.0 * along, along, 0.0))
        arms.append(bones)
    skeleton = skeleton_of(names, parents, matrices, [0.2] + [1.0 / 3.0] * (len(names) - 1))
    return skeleton, arms, body_frame(skeleton, arms, "Z", "-Y")


def fan(azimuths: Floats) -> tuple[Skeleton, list[tuple[str, ...]], BodyFrame]:
    """Level arms, radians from the front to the left, that spring from one point."""
    directions = np.stack([np.sin(azimuths), -np.cos(azimuths), 0.0 * azimuths], axis=1)
    return arms_along(directions, np.zeros_like(directions))


def squid(count: int) -> tuple[Skeleton, list[tuple[str, ...]], BodyFrame]:
    """Arms that all point to the front, in a ring round the mouth."""
    around = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    ring = 0.1 * np.stack([np.sin(around), 0.0 * around, np.cos(around)], axis=1)
    return arms_along(np.tile([0.0, -1.0, 0.0], (count, 1)), ring)


def test_a_fan_opens_all_round_in_its_order() -> None:
    at_rest = np.radians([8.0, -4.0, 22.0, -19.0, 82.0, -83.0, 95.0, -95.0])
    found = swim_azimuths(*fan(at_rest), LYING)
    np.testing.assert_array_equal(np.argsort(found), np.argsort(at_rest))
    # Evenly, with a gap below, where the fan was open.
    np.testing.assert_allclose(np.diff(np.sort(found)), 2.0 * np.pi / 9.0)
    assert np.all(np.sign(found) == np.sign(at_rest))


def test_arms_round_the_mouth_stay_where_they_are() -> None:
    found = swim_azimuths(*squid(8), LYING)
    around = 2.0 * np.pi * (np.arange(8) + 0.5) / 8
    # Up is where the front is for a body that is reared up.
    np.testing.assert_allclose(np.cos(found - around), 1.0, atol=1e-9)


@pytest.mark.parametrize("lean", [0.0, 1e-6])
def test_a_body_that_does_not_lie_keeps_its_arms(lean: float) -> None:
    rig = fan(np.radians([10.0, -10.0, 60.0, -60.0, 100.0, -100.0]))
    found, kept = swim_azimuths(*rig, lean), arm_azimuths(*rig)
    np.testing.assert_allclose(found, kept, atol=1e-9)


def test_the_further_it_lies_the_further_its_arms_have_opened() -> None:
    rig = fan(np.radians([5.0, -5.0, 20.0, -20.0]))
    widest = [
        float(np.ptp(swim_azimuths(*rig, lean))) for lean in np.radians([0.0, 10.0, 20.0, 40.0])
    ]
    assert np.all(np.diff(widest) > 0.0)
