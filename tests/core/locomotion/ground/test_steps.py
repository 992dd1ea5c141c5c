# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps, up and down: ground that is steeper than any bone can lie on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.locomotion.ground.arm_curves import laid
from octo_motion.core.locomotion.ground.surface import HeightField, Limbs
from octo_motion.core.rotations import Floats
from tests.core.grounds import largest_turn, walker

SKIN = 0.01
LENGTH = 0.08
BONES = 6


def steps(height: float, tread: float = 1.0) -> HeightField:
    """Treads across the way, low and high by turns."""
    spacing = 0.025
    x, y = np.arange(-3.0, 5.5, spacing), np.arange(-7.5, 3.0, spacing)
    high = np.floor(y / tread) % 2.0
    return HeightField((float(x[0]), float(y[0])), spacing, height * high * np.ones((len(x), 1)))


def lying(ground: HeightField, start: float, heading: float, *, curl: float = 0.0) -> Floats:
    """Joints (bones + 1, 3) of an arm that lies on it from (0, start) on."""
    limbs = Limbs(
        arms=(0,),
        roots=np.zeros((1, 3)),
        outward=np.array([[1.0, 0.0, 0.0, 0.0]]),
        offsets=np.zeros(1),
        lengths=np.full((BONES, 1), LENGTH),
        radii=np.full((BONES + 1, 1), SKIN),
        aims=np.zeros((1, 2)),
        weights=np.ones((BONES, 1)),
    )
    return laid(
        limbs,
        ground,
        0,
        skins=np.full((1, 1, BONES + 1), SKIN),
        spot=np.array([[[0.0, start, 0.0]]]),
        heading=np.array([[heading]]),
        curl=np.array([[curl]]),
    )[0, 0]


@settings(deadline=None)
@given(
    st.floats(0.05, 0.6),
    st.floats(-0.3, 0.3),
    st.sampled_from([-0.5 * np.pi, 0.5 * np.pi]),
    st.floats(-0.9, 0.9),
    st.floats(-0.8, 0.8),
)
def test_an_arm_lies_up_and_down_a_step_and_not_through_it(
    height: float, start: float, across: float, askew: float, curl: float
) -> None:
    ground = steps(height)
    joints = lying(ground, start, across + askew, curl=curl)
    assert np.linalg.norm(np.diff(joints, axis=0), axis=1) == pytest.approx(LENGTH)
    # A joint that leans against a step is as near to it as halving finds, on its lower side.
    assert np.all(joints[:, 2] >= ground.height(joints) - 0.01)


def test_an_arm_climbs_a_step_that_is_higher_than_its_bones_are_long_and_lies_on_top() -> None:
    # The edge between the treads is at 0: from −1 to 0 it is high.
    down = lying(steps(0.2), -0.1, 0.5 * np.pi)
    assert down[0, 2] == pytest.approx(0.2 + SKIN)
    assert down[-1, 2] == pytest.approx(SKIN, abs=1e-6)
    up = lying(steps(0.2), 0.1, -0.5 * np.pi)
    assert up[0, 2] == pytest.approx(SKIN)
    assert up[-1, 2] == pytest.approx(0.2 + SKIN, abs=1e-6)
    assert np.all(np.diff(up[:, 2]) >= -0.02)


@pytest.mark.parametrize("height", [0.1, 0.2])
def test_what_rests_on_steps_is_not_in_them_and_no_bone_turns_over(height: float) -> None:
    walk = walker(steps(height))
    poses = walk.pose(walk.times)
    (joints,), (rests,) = poses.joints, poses.in_contact
    below = walk.ground.height(joints) - joints[..., 2]
    assert np.any(rests)
    assert below[rests].max() < 0.005
    assert np.degrees(largest_turn(poses.rotations)) < 45.0


@given(st.floats(0.05, 1.0), st.floats(0.05, 0.3), st.integers(0, 2**31))
def test_an_edge_is_rounded_so_that_no_bone_is_cut_by_it(
    height: float, radius: float, seed: int
) -> None:
    ground = steps(height)
    rounded = ground.rounded(radius)
    random = np.random.default_rng(seed)
    points = random.uniform((-2.0, -6.0), (4.0, 2.0), (400, 2))
    assert np.all(rounded.height(points) >= ground.height(points) - 1e-12)
    # A bone whose ends are on it sinks in by no more than such a curve bends along it.
    ahead = LENGTH * np.array([0.0, 1.0])
    chord = 0.5 * (rounded.height(points) + rounded.height(points + ahead))
    cut = ground.height(points + 0.5 * ahead) - chord
    assert cut.max() <= LENGTH**2 / (8.0 * radius) + 0.005
    # It is the ground itself where no edge is near.
    far = radius * np.sqrt(2.0 * height / radius) + 3.0 * ground.spacing
    away = np.abs(points[:, 1] - np.round(points[:, 1])) > far
    np.testing.assert_array_equal(rounded.height(points[away]), ground.height(points[away]))


@given(st.floats(0.0, 1.7), st.floats(0.0, 6.3))
def test_ground_without_edges_stays_as_it_is_however_steep(rise: float, way: float) -> None:
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0), indexing="ij")
    heights = 0.1 * rise * (np.cos(way) * x + np.sin(way) * y)
    ground = HeightField((0.0, 0.0), 0.1, heights)
    assert ground.rounded(0.2) is ground
