# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint of a limb turns so that elbow and hand come to lie where they were seen."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.rotations import (
    Floats,
    angle_between,
    from_axis_angle,
    normalized,
    rotate,
    shortest_arc,
)
from octo_motion.core.splicing.transfer.limb_rotation import (
    SOFT,
    LimbTriangle,
    bend_to_reach,
    joint_turn,
)

seeds = st.integers(0, 2**31)


def bent_limb(random: np.random.Generator, bend: Floats) -> LimbTriangle:
    """Limbs of lengths 0.3 and 0.25, bent by these angles, anywhere."""
    count = len(bend)
    along = normalized(random.normal(size=(count, 3)))
    axis = normalized(np.cross(along, random.normal(size=(count, 3))))
    joint = random.normal(size=(count, 3))
    elbow = joint + 0.3 * along
    return LimbTriangle(joint, elbow, elbow + 0.25 * rotate(from_axis_angle(axis, bend), along))


@given(seed=seeds)
def test_a_limb_of_the_same_shape_is_laid_exactly_onto_the_wanted_one(seed: int):
    random = np.random.default_rng(seed)
    # The triangle of a limb that is flatter is believed in part only.
    limb = bent_limb(random, random.uniform(1.05, 2.25, 20))
    # Further than 45° about the hand's direction the normals are not trusted.
    axes = normalized(random.normal(size=(20, 3)))
    wanted = limb.turned(from_axis_angle(axes, np.full(20, 0.6)))
    result = limb.turned(joint_turn(limb, wanted))
    assert np.allclose(result.elbow, wanted.elbow, atol=1e-9)
    assert np.allclose(result.hand, wanted.hand, atol=1e-9)


@given(seed=seeds)
def test_the_hand_always_points_where_it_should(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, random.uniform(0.0, 3.0, 20))
    wanted = replace(bent_limb(random, random.uniform(0.0, 3.0, 20)), joint=limb.joint)
    result = limb.turned(joint_turn(limb, wanted))
    assert np.allclose(
        normalized(result.hand - limb.joint), normalized(wanted.hand - limb.joint), atol=1e-9
    )


@given(seed=seeds)
def test_a_straight_limb_keeps_its_turn_about_itself(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, np.zeros(20))
    wanted = replace(bent_limb(random, random.uniform(0.5, 2.5, 20)), joint=limb.joint)
    smallest = shortest_arc(
        normalized(limb.hand - limb.joint), normalized(wanted.hand - limb.joint)
    )
    assert angle_between(joint_turn(limb, wanted), smallest).max() < 1e-9


@given(seed=seeds)
def test_nothing_pops_while_an_elbow_goes_through_straight(seed: int):
    bends = [np.linspace(-0.6, 0.6, count) for count in (400, 800)]
    steps = []
    for bend in bends:
        fixed = np.random.default_rng(seed)
        along, across = np.eye(3)[0], np.eye(3)[2]
        zeros = np.zeros((len(bend), 3))
        elbow = zeros + 0.3 * along
        limb = LimbTriangle(
            zeros, elbow, elbow + 0.25 * rotate(from_axis_angle(across, bend), elbow / 0.3)
        )
        wanted = limb.turned(from_axis_angle(normalized(fixed.normal(size=3)), 0.7))
        shifted = replace(wanted, hand=wanted.hand + 0.03 * fixed.normal(size=3))
        turns = joint_turn(limb, shifted)
        steps.append(angle_between(turns[1:], turns[:-1]).max())
    assert steps[1] < 0.6 * steps[0]


@given(seed=seeds)
def test_exact_reach_lands_on_every_point_within_reach(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, random.uniform(0.0, 2.6, 20))
    direction = normalized(limb.hand - limb.joint)
    # But for the last stretch, and for folding it together.
    distance = random.uniform(0.16, (1.0 - SOFT) * 0.55, (20, 1))
    # A limb that is almost stretched, and almost there, may stay as it is.
    now = np.linalg.norm(limb.hand - limb.joint, axis=-1, keepdims=True)
    distance = np.where((now > 0.53) & (distance > 0.51), 0.4, distance)
    target = limb.joint + distance * direction
    hinge = normalized(random.normal(size=(20, 3)))
    upper, lower = bend_to_reach(limb, target, hinge)
    elbow = limb.joint + rotate(upper, limb.elbow - limb.joint)
    hand = elbow + rotate(lower, limb.hand - limb.elbow)
    assert np.linalg.norm(hand - target, axis=-1).max() < 1e-9


@given(seed=seeds)
def test_close_to_the_end_of_its_reach_a_limb_misses_by_little(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, random.uniform(0.0, 2.8, 20))
    direction = normalized(limb.hand - limb.joint)
    distance = random.uniform(0.55 * (1.0 - SOFT), 0.55, (20, 1))
    upper, lower = bend_to_reach(
        limb, limb.joint + distance * direction, normalized(random.normal(size=(20, 3)))
    )
    hand = rotate(upper, limb.elbow - limb.joint) + rotate(lower, limb.hand - limb.elbow)
    assert np.linalg.norm(hand - distance * direction, axis=-1).max() < 0.6 * SOFT * 0.55


@given(bend=st.floats(0.0, 2.4), start=st.floats(0.2, 0.5))
def test_elbows_open_and_close_at_a_bounded_speed_wherever_the_point_goes(
    bend: float, start: float
):
    # Out of reach and back, and close to the joint: for a way of the limb's own length the elbow
    # opens by less than 25 rad at any moment. To follow exactly it would have no bound.
    speeds = []
    for count in (2000, 8000):
        distance = start + 0.45 * np.sin(np.linspace(0.0, 2.0 * np.pi, count))
        one = bent_limb(np.random.default_rng(1), np.array([bend]))
        limb = LimbTriangle(
            *(np.tile(each, (count, 1)) for each in (one.joint, one.elbow, one.hand))
        )
        target = limb.joint + np.abs(distance[:, None]) * normalized(limb.hand - limb.joint)
        hinge = normalized(np.cross(limb.elbow - limb.joint, np.ones(3)))
        upper, lower = bend_to_reach(limb, target, hinge)
        first = rotate(upper, limb.elbow - limb.joint)
        second = rotate(lower, limb.hand - limb.elbow)
        sine = np.linalg.norm(np.cross(first, second), axis=-1)
        opened = np.abs(np.diff(np.arctan2(sine, np.sum(first * second, axis=-1))))
        way = np.abs(np.diff(distance)) / 0.55
        # Not where the point turns back.
        speeds.append((opened / way)[way > 0.1 * way.max()].max())
    assert max(speeds) < 25.0


@given(seed=seeds)
def test_a_hand_that_is_there_already_does_not_move(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, np.concatenate([random.uniform(0.0, 3.0, 18), [0.0, 1e-5]]))
    hinge = normalized(random.normal(size=(20, 3)))
    for turn in bend_to_reach(limb, limb.hand, hinge):
        assert angle_between(turn, (1.0, 0.0, 0.0, 0.0)).max() < 1e-6


@given(seed=seeds)
def test_a_limb_stretches_towards_what_is_out_of_reach(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, random.uniform(0.3, 2.8, 20))
    direction = normalized(limb.hand - limb.joint)
    upper, lower = bend_to_reach(limb, limb.joint + 2.0 * direction, np.eye(3)[[0] * 20])
    hand = rotate(upper, limb.elbow - limb.joint) + rotate(lower, limb.hand - limb.elbow)
    assert np.allclose(hand, 0.55 * direction, atol=1e-3)


@given(seed=seeds)
def test_on_another_body_a_straight_limb_stays_straight(seed: int):
    random = np.random.default_rng(seed)
    limb = bent_limb(random, np.concatenate([np.zeros(10), random.uniform(0.7, 2.2, 10)]))
    target = limb.joint + 0.4 * normalized(limb.hand - limb.joint)
    hinge = normalized(random.normal(size=(20, 3)))
    upper, lower = bend_to_reach(limb, target, hinge, alike=False)
    # Arc cosines lose half the digits at one.
    assert angle_between(upper, lower)[:10].max() < 1e-6
    hand = rotate(upper, limb.elbow - limb.joint) + rotate(lower, limb.hand - limb.elbow)
    # A bent one reaches the point.
    assert np.linalg.norm(hand - (target - limb.joint), axis=-1)[10:].max() < 1e-9
