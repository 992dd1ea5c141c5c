# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms of any rig are kept apart by their bones, whatever number of these each of them has."""

from collections.abc import Sequence

import numpy as np
import pytest

from octo_motion.core.locomotion.clearance.capsule_overlap import Capsules, measure_overlap
from octo_motion.core.locomotion.clearance.corrections import BodyVolume, separating_arms
from octo_motion.core.locomotion.rig.arm_chains import body_frame
from octo_motion.core.locomotion.rig.bone_rotations import ArmFrames, frames_of_arm
from octo_motion.core.rotations import IDENTITY, Floats, from_axis_angle, multiply
from octo_motion.core.steps import finished
from tests.core.rigs import UP, bone_matrix, skeleton_of

FRAMES = 90
PLACES = np.array([[0.1, 0.0, 0.0], [0.1, 0.3, 0.0], [-0.1, 0.0, 0.0], [-0.1, 0.3, 0.0]])
"""Two arms side by side to the right, and two to the left."""


def side_by_side(bones: Sequence[int]) -> BodyVolume:
    """Straight arms of unit length, of so many bones each."""
    names, parents = ["root"], [-1]
    matrices, lengths = [bone_matrix(np.zeros(3), UP, 0.0)], [0.1]
    arms = []
    for place, count in zip(PLACES, bones, strict=True):
        along = np.array([np.sign(place[0]), 0.0, 0.0])
        arm = [f"{len(arms)}.{bone}" for bone in range(count)]
        parents += [0, *range(len(names), len(names) + count - 1)]
        matrices += [bone_matrix(place + bone / count * along, along, 0.4) for bone in range(count)]
        lengths += [1.0 / count] * count
        names += arm
        arms.append(arm)
    skeleton = skeleton_of(names, parents, matrices, lengths)
    body = body_frame(skeleton, arms, "Z", "-Y")
    frames = [frames_of_arm(skeleton, arm, body) for arm in arms]
    names = tuple(str(number) for number in range(len(bones)))
    radii = tuple(np.full(count + 1, 0.05) for count in bones)
    return BodyVolume(tuple(frames), names, radii, (), UP)


def swung(arms: Sequence[ArmFrames]) -> Floats:
    """Rotations (frames, bones, 4): the first arm swings over to the second and back."""
    result = np.tile(IDENTITY, (FRAMES, sum(len(arm.bones) for arm in arms), 1))
    angle = np.radians(25.0) * np.sin(np.linspace(0.0, np.pi, FRAMES)) ** 4
    turn = from_axis_angle(UP, angle)[:, None]
    result[:, : len(arms[0].bones)] = arms[0].to_bones(multiply(turn, arms[0].at_rest))
    return result


def own(arms: Sequence[ArmFrames], values: Floats) -> list[Floats]:
    """What rotations (frames, bones, 4) of all arms are of each."""
    return np.split(values, np.cumsum([len(arm.bones) for arm in arms])[:-1], axis=1)


def deepest(bulk: BodyVolume, rotations: Floats) -> float:
    chains = [
        Capsules(str(number), arm.joints(arm.from_bones(turns)), radii, arm.joints(arm.at_rest))
        for number, (arm, radii, turns) in enumerate(
            zip(bulk.arms, bulk.radii, own(bulk.arms, rotations), strict=True)
        )
    ]
    return float(measure_overlap(chains).depths.max())


def apart(bulk: BodyVolume, rotations: Floats) -> Floats | None:
    travel = np.zeros((FRAMES, 3)), np.tile(IDENTITY, (FRAMES, 1))
    steps = separating_arms(
        bulk,
        rotations,
        np.zeros(rotations.shape[:2]),
        in_contact=[np.zeros((FRAMES, len(arm.bones) + 1), dtype=bool) for arm in bulk.arms],
        busy=np.zeros((FRAMES, len(bulk.arms)), dtype=bool),
        travel=travel,
        ground=None,
        scale=1.0,
        frames_per_cycle=48.0,
        most=0.49,
    )
    return finished(steps)


@pytest.mark.parametrize(
    "bones",
    [(8, 8, 8, 8), (8, 8, 5, 5), (5, 12, 8, 3), (40, 8, 8, 40), (12, 10, 30, 3), (3, 3, 30, 3)],
)
def test_arms_make_way_whatever_number_of_bones_each_of_them_has(bones: tuple[int, ...]) -> None:
    bulk = side_by_side(bones)
    before = swung(bulk.arms)
    assert deepest(bulk, before) > 0.8
    after = apart(bulk, before)
    assert after is not None
    assert deepest(bulk, after) <= 0.1
    np.testing.assert_allclose(np.linalg.norm(after, axis=-1), 1.0, atol=1e-9)
    # Those on the other side of the body have nothing to do with it.
    for there, was in zip(own(bulk.arms, after)[2:], own(bulk.arms, before)[2:], strict=True):
        np.testing.assert_array_equal(there, was)


@pytest.mark.parametrize("bones", [(8, 8, 8, 8), (3, 30, 12, 5)])
def test_where_nobody_meets_nobody_is_moved(bones: tuple[int, ...]) -> None:
    bulk = side_by_side(bones)
    still = np.tile(IDENTITY, (FRAMES, sum(bones), 1))
    assert apart(bulk, still) is None
