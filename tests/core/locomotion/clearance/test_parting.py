# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that would pass through each other make way: smoothly, and what lies on the ground stays."""

from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.locomotion.clearance import overlap_solver
from octo_motion.core.locomotion.clearance.capsule_overlap import (
    NEAR,
    Capsules,
    Crowd,
    Opened,
    Touches,
    Touching,
    aside,
    measure_overlap,
)
from octo_motion.core.locomotion.clearance.overlap_solver import joints_of, parting, turned_towards
from octo_motion.core.rotations import Floats
from octo_motion.core.smoothing import blur_reach, blurred, covered
from octo_motion.core.steps import finished

SEEDS = st.integers(0, 2**31)
UP = np.array([0.0, 0.0, 1.0])
FRAMES, JOINTS, RADIUS, WIDTH, MOST = 120, 9, 0.04, 2, np.radians(28.0)


# --- One pair -----------------------------------------------------------------------------------


def touches(gap: Floats, side: Floats, radius: float = 0.5) -> Touches:
    """Contacts of capsules of one radius, the one at a gap (n, 3) from the other."""
    count = len(gap)
    none, whole = np.zeros(count), np.zeros(count, dtype=int)
    return Touches(
        frame=whole,
        arms=(whole, whole + 1),
        segments=(whole, whole),
        shares=(none, none),
        gap=gap.T,
        distance=np.linalg.norm(gap, axis=1),
        wide=none + 2.0 * radius,
        thin=none + radius,
        side=np.broadcast_to(side, gap.shape).T,
        pair=whole,
    )


@given(SEEDS)
def test_two_that_overlap_are_asked_to_go_as_far_as_it_takes(seed: int) -> None:
    random = np.random.default_rng(seed)
    side = random.normal(size=3)
    side /= np.linalg.norm(side)
    gap = random.normal(size=(40, 3))
    gap *= (random.uniform(0.0, 0.98, 40) / np.linalg.norm(gap, axis=1))[:, None]
    way, far = aside(touches(gap, side))
    np.testing.assert_allclose(np.linalg.norm(way, axis=0), 1.0, atol=1e-9)
    after = np.linalg.norm(gap.T + far * way, axis=0)
    # Skin does not touch skin any more.
    assert np.all(after >= 1.0)


@given(SEEDS)
def test_two_that_are_apart_on_their_own_sides_are_not_asked(seed: int) -> None:
    random = np.random.default_rng(seed)
    side = random.normal(size=3)
    side /= np.linalg.norm(side)
    gap = random.normal(size=(40, 3))
    gap *= np.where(gap @ side < 0.0, -1.0, 1.0)[:, None]
    gap *= (random.uniform(1.1, 3.0, 40) / np.linalg.norm(gap, axis=1))[:, None]
    assert not np.any(aside(touches(gap, side))[1])


@given(SEEDS)
def test_an_arm_that_passes_through_another_is_pushed_to_one_side_all_the_while(seed: int) -> None:
    random = np.random.default_rng(seed)
    side = np.array([1.0, 0.0, 0.0])
    through = np.linspace(1.2, -0.4, 400)
    gap = np.stack([through, *random.uniform(-0.5, 0.5, (2, 1)) + 0.0 * through], axis=1)
    way, far = aside(touches(gap, side))
    push = (far * way).T
    assert np.all(push[far > 0.0] @ side > 0.0)
    # It changes by about as much as the arm has moved.
    steps = np.linalg.norm(np.diff(push, axis=0), axis=1)
    assert steps.max() <= 5.0 * (through[0] - through[1])


@given(SEEDS)
def test_the_nearest_way_out_is_straight_and_no_longer_than_to_its_own_side(seed: int) -> None:
    random = np.random.default_rng(seed)
    side = random.normal(size=3)
    side /= np.linalg.norm(side)
    gap = random.normal(size=(40, 3))
    gap *= (random.uniform(0.05, 3.0, 40) / np.linalg.norm(gap, axis=1))[:, None]
    pairs = touches(gap, side)
    (way, far), (_, farther) = (aside(pairs, nearest=each) for each in (True, False))
    inside = pairs.distance < pairs.wide
    assert np.all(np.linalg.norm(gap.T + far * way, axis=0)[inside] >= 1.0)
    assert np.all(far[inside] <= farther[inside] + 1e-12)
    # Skin has bulged no farther than this: who is on the wrong side there is let be.
    assert not np.any(far[pairs.distance > 1.2])


def test_an_arm_far_on_the_wrong_side_is_let_be() -> None:
    gap = np.array([[-(1.0 + NEAR) - 0.01, 0.0, 0.0]])
    assert not np.any(aside(touches(gap, np.array([1.0, 0.0, 0.0])))[1])


# --- One chain ----------------------------------------------------------------------------------


def chains(seed: int) -> tuple[Floats, Floats, Floats]:
    """Directions (5, 7, 3), lengths and freedom (5, 7) of some chains."""
    random = np.random.default_rng(seed)
    directions = np.cumsum(random.normal(size=(5, 7, 3)), axis=1) + np.array([4.0, 0.0, 0.0])
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return directions, random.uniform(0.5, 1.5, (5, 7)), random.uniform(0.2, 1.0, (5, 7))


@given(SEEDS)
@settings(max_examples=50)
def test_a_chain_turns_towards_where_its_joints_are_to_go(seed: int) -> None:
    random = np.random.default_rng(seed)
    directions, lengths, free = chains(seed)
    roots = np.zeros((5, 3))
    joint = int(random.integers(2, 7))
    goals, weights = np.zeros((5, 7, 3)), np.zeros((5, 7))
    # Across the chain: along it no small turn leads.
    before = joints_of(roots, directions, lengths)
    goals[:, joint] = 0.05 * np.cross(before[:, joint + 1], random.normal(size=(5, 3)))
    weights[:, joint] = 1.0
    result = turned_towards(directions, lengths, free=free, goals=goals, weights=weights)
    after = joints_of(roots, result, lengths)
    left = goals[:, joint] - (after - before)[:, joint + 1]
    asked = np.linalg.norm(goals[:, joint], axis=1)
    assert np.all(np.linalg.norm(left, axis=1) < asked)
    np.testing.assert_allclose(np.linalg.norm(result, axis=2), 1.0, atol=1e-12)


@given(SEEDS, st.sampled_from([1e-6, 1e-3, 1e6]))
@settings(max_examples=30)
def test_chains_turn_alike_whatever_the_unit_of_length(seed: int, size: float) -> None:
    directions, lengths, free = chains(seed)
    lengths[:, 5:] = 0.0  # of no length, as where an arm has fewer joints than others
    random = np.random.default_rng(seed)
    goals, weights = 0.1 * random.normal(size=(5, 7, 3)), random.uniform(0.0, 1.0, (5, 7))

    def turned(size: float) -> Floats:
        own, wanted = size * lengths, size * goals
        return turned_towards(directions, own, free=free, goals=wanted, weights=weights)

    np.testing.assert_allclose(turned(size)[:, :5], turned(1.0)[:, :5], atol=1e-9)


@given(SEEDS)
@settings(max_examples=30)
def test_segments_that_are_not_free_do_not_turn_at_all(seed: int) -> None:
    directions, lengths, free = chains(seed)
    free[:, 4:] = 0.0
    random = np.random.default_rng(seed)
    goals, weights = random.normal(size=(5, 7, 3)), np.ones((5, 7))
    result = turned_towards(directions, lengths, free=free, goals=goals, weights=weights)
    np.testing.assert_array_equal(result[:, 4:], directions[:, 4:])
    still = turned_towards(directions, lengths, free=free, goals=0.0 * goals, weights=weights)
    np.testing.assert_allclose(still, directions, atol=1e-12)


# --- Over time ----------------------------------------------------------------------------------


@given(SEEDS, st.integers(1, 4), st.booleans())
@settings(max_examples=50)
def test_what_covers_is_nowhere_below_and_has_no_jumps(seed: int, width: int, cyclic: bool) -> None:  # noqa: FBT001
    random = np.random.default_rng(seed)
    values = np.where(random.random(90) < 0.05, random.uniform(0.2, 1.0, 90), 0.0)
    values[-1] = values[0]
    result = covered(values, width, cyclic=cyclic)
    assert np.all(result >= values - 1e-12)
    assert result.max() <= values.max() + 1e-12
    assert np.abs(np.diff(result)).max(initial=0.0) <= 1.0 / (2 * width + 1) + 1e-12


@given(SEEDS, st.integers(1, 4), st.integers(1, 60))
@settings(max_examples=50)
def test_a_loop_may_begin_anywhere(seed: int, width: int, start: int) -> None:
    once = np.random.default_rng(seed).random((61, 2))

    def loop(values: Floats) -> Floats:
        return np.concatenate([values, values[:1]])

    rolled = covered(loop(np.roll(once, start, axis=0)), width, cyclic=True)
    expected = np.roll(covered(loop(once), width, cyclic=True)[:-1], start, axis=0)
    np.testing.assert_allclose(rolled[:-1], expected, atol=1e-12)
    np.testing.assert_allclose(rolled[-1], rolled[0], atol=1e-12)


def test_means_of_what_stays_the_same_are_the_same() -> None:
    np.testing.assert_allclose(blurred(np.full((20, 2), 0.7), 3), 0.7, atol=1e-12)


# --- A crowd ------------------------------------------------------------------------------------


class Level:
    """A floor at height 0."""

    def clearance(self, frames: np.ndarray, points: Floats) -> Floats:
        assert len(frames) == len(points)
        return points[..., 2]


def straight(angles: Floats, height: float, *, at: float = 0.0) -> Floats:
    """Arms (frames, joints, 3) of length 1, straight out at such angles (frames,) from +X."""
    out = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=-1)
    along = np.linspace(0.0, 1.0, JOINTS)[:, None]
    return np.array([0.0, at, height]) + along * out[:, None]


def crowd(*arms: Floats, lying: np.ndarray | None = None) -> Crowd:
    """Arms at rest as they are in the first frame of their own."""
    joints = np.stack(arms, axis=1)
    rest = np.stack([straight(np.zeros(1), 0.0, at=0.3 - 0.6 * k)[0] for k in range(len(arms))])
    shape = joints.shape[:3]
    return Crowd(
        joints=joints,
        radii=np.full(shape[1:], RADIUS),
        at_rest=rest,
        in_contact=np.zeros(shape, dtype=bool) if lying is None else lying,
        kept=np.zeros(shape[:2], dtype=bool),
        upward=UP,
        up=np.tile(UP, (shape[0], 1)),
    )


def depth(group: Crowd, joints: Floats) -> Floats:
    """Deepest overlap of the arms at each frame."""
    own = [
        Capsules(str(k), joints[:, k], group.radii[k], group.at_rest[k])
        for k in range(joints.shape[1])
    ]
    return measure_overlap(own).depths


def parted(*given: Any, **named: Any) -> Floats | None:
    """Joints of arms that have made way, without a break."""
    return finished(parting(*given, **named))


def swinging(height: float = 0.1) -> Floats:
    """An arm that swings across, and back, in the middle of the time."""
    phase = np.clip((np.arange(FRAMES) - 40) / 40.0, 0.0, 1.0)
    return straight(0.3 - 0.62 * np.sin(np.pi * phase) ** 2, height, at=0.3)


def beside() -> Crowd:
    """An arm that comes into its neighbour, which is in the air too."""
    return crowd(swinging(), straight(np.full(FRAMES, 0.0), 0.1, at=-0.02))


def over_lying() -> Crowd:
    """An arm low in the air that comes into one that lies on the ground from its fifth joint on."""
    group = crowd(swinging(0.05), straight(np.full(FRAMES, 0.0), RADIUS, at=-0.02))
    lying = np.zeros(group.in_contact.shape, dtype=bool)
    lying[:, 1, 5:] = True
    return replace(group, in_contact=lying)


@pytest.mark.parametrize("group", [beside(), over_lying()], ids=["in the air", "lying"])
def test_arms_that_meet_make_way(group: Crowd) -> None:
    assert depth(group, group.joints).max() > 0.8
    moved = parted(group, (), floor=Level(), width=WIDTH, most=MOST)
    assert moved is not None
    assert depth(group, moved).max() <= 0.1


@pytest.mark.parametrize("group", [beside(), over_lying()], ids=["in the air", "lying"])
def test_nothing_stretches_no_root_moves_and_nobody_is_pushed_into_the_ground(group: Crowd) -> None:
    moved = parted(group, (), floor=Level(), width=WIDTH, most=MOST)
    assert moved is not None
    lengths = np.linalg.norm(np.diff(moved, axis=2), axis=-1)
    np.testing.assert_allclose(lengths, 1.0 / (JOINTS - 1), rtol=1e-9)
    np.testing.assert_array_equal(moved[:, :, 0], group.joints[:, :, 0])
    # Skin of 0.04: the joints were 0.04 above it, and stay above.
    assert moved[..., 2].min() > 0.5 * RADIUS


def test_what_lies_on_the_ground_stays_where_it_lies() -> None:
    group = over_lying()
    moved = parted(group, (), floor=Level(), width=WIDTH, most=MOST)
    assert moved is not None
    assert np.abs(moved - group.joints)[group.in_contact].max() < 1e-9


def test_arms_make_way_in_time_and_not_in_a_jump() -> None:
    group = beside()
    moved = parted(group, (), floor=None, width=WIDTH, most=MOST)
    assert moved is not None
    aside_by = moved - group.joints
    assert np.abs(aside_by).max() > RADIUS
    # The tip that comes swinging goes 1.2 radii a frame; from one to the next it overlaps by one.
    assert np.linalg.norm(np.diff(aside_by, axis=0), axis=-1).max() < 0.5 * RADIUS


def test_arms_make_way_as_early_as_they_can_and_then_are_where_they_were() -> None:
    group = beside()
    moved = parted(group, (), floor=None, width=WIDTH, most=MOST)
    assert moved is not None
    met = np.flatnonzero(depth(group, group.joints) > 0.0)
    early, late = met[0] - 5 * blur_reach(WIDTH), met[-1] + 5 * blur_reach(WIDTH)
    np.testing.assert_array_equal(moved[:early], group.joints[:early])
    np.testing.assert_array_equal(moved[late:], group.joints[late:])


def test_a_part_of_the_motion_is_made_like_the_whole() -> None:
    group = beside()
    whole = parted(group, (), floor=None, width=WIDTH, most=MOST)
    some = slice(10, 110)
    part = parted(
        replace(
            group,
            joints=group.joints[some],
            in_contact=group.in_contact[some],
            kept=group.kept[some],
            up=group.up[some],
        ),
        (),
        floor=None,
        width=WIDTH,
        most=MOST,
    )
    assert whole is not None
    assert part is not None
    np.testing.assert_allclose(part, whole[some], atol=1e-9)


def test_arms_that_open_otherwise_than_they_lie_belong_there_while_they_do() -> None:
    """A swimmer that lies: what is beside another arm at rest is above it in the water."""
    one, other = straight(np.zeros(FRAMES), 0.1), straight(np.zeros(FRAMES), 0.1, at=0.05)
    group = crowd(one, other)
    share = np.linspace(0.0, 1.0, FRAMES)
    swum = replace(group, opened=Opened(np.array([-UP, UP]), share))
    walked, opened = (finished(Touching(each, []).seeing()) for each in (group, swum))
    first, last = (opened.side[:, opened.frame == frame] for frame in (0, FRAMES - 1))
    np.testing.assert_allclose(first, walked.side[:, walked.frame == 0], atol=1e-9)
    up_or_down = np.where(opened.arms[0] == 1, 1.0, -1.0)[opened.frame == FRAMES - 1]
    np.testing.assert_allclose(last, up_or_down * UP[:, None], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(opened.side, axis=0), 1.0, atol=1e-9)


def test_arms_that_keep_apart_are_not_touched() -> None:
    still = np.zeros(FRAMES)
    group = crowd(straight(still, 0.1, at=0.3), straight(still, 0.1, at=-0.3))
    assert parted(group, (), floor=Level(), width=WIDTH, most=MOST) is None


def test_what_an_arm_comes_near_to_as_it_makes_way_is_seen() -> None:
    """It was far from that before anybody moved, and comes into it bit by bit."""
    still = np.zeros(FRAMES)
    group = crowd(straight(still, 0.1, at=0.0), straight(still, 0.1, at=0.5))
    along = np.linspace(0.0, 1.0, JOINTS)
    touching = Touching(group, [])
    finished(touching.looking_at(np.ones(FRAMES, dtype=bool), np.zeros(0, dtype=int)))
    moved, seen = group.joints.copy(), touching.at(group.joints)
    for _ in range(25):
        moved[: FRAMES // 2, 1, :, 1] -= 0.04 * along
        seen = touching.at(moved)
    deep = np.zeros(FRAMES)
    np.maximum.at(deep, seen.frame, seen.depth)
    expected = depth(group, moved)
    assert expected[0] > 1.0
    np.testing.assert_allclose(deep, expected, atol=1e-9)


def test_arms_that_are_busy_stay_and_the_other_makes_way() -> None:
    group = beside()
    group.kept[:, 1] = True
    moved = parted(group, (), floor=None, width=WIDTH, most=MOST)
    assert moved is not None
    np.testing.assert_array_equal(moved[:, 1], group.joints[:, 1])
    assert depth(group, moved).max() <= 0.1


def crossing(frames: slice) -> Crowd:
    """Two arms that lie across each other at some frames, and else beside each other."""
    turned = np.full(FRAMES, -0.3)
    turned[frames] = 0.3
    group = crowd(straight(-turned, RADIUS, at=0.1), straight(turned, RADIUS, at=-0.1))
    lying = np.zeros(group.in_contact.shape, dtype=bool)
    lying[:, :, 2:] = True
    return replace(group, in_contact=lying)


def test_arms_that_cannot_be_parted_move_as_before() -> None:
    group = crossing(slice(40, 80))
    assert depth(group, group.joints).max() > 1.0
    moved = parted(group, (), floor=Level(), width=WIDTH, most=MOST)
    assert moved is not None
    np.testing.assert_allclose(moved, group.joints, atol=1e-9)


@pytest.mark.parametrize("group", [beside(), over_lying()], ids=["in the air", "lying"])
def test_arms_part_the_same_whatever_cannot_be_parted_at_another_time(group: Crowd) -> None:
    alone = parted(group, (), floor=Level(), width=WIDTH, most=MOST)
    later = crossing(slice(40, 80))
    both = replace(
        group,
        **{
            name: np.concatenate([getattr(each, name) for each in (group, later)])
            for name in ("joints", "in_contact", "kept", "up")
        },
    )
    moved = parted(both, (), floor=Level(), width=WIDTH, most=MOST)
    assert alone is not None
    assert moved is not None
    # The ends of a motion are means of what goes on there.
    np.testing.assert_allclose(moved[:100], alone[:100], atol=1e-9)


def tangled(seed: int) -> Crowd:
    """Three arms of which each swings through the others."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, 2.0 * np.pi, FRAMES)
    arms = [
        straight(
            random.uniform(0.3, 0.8) * np.sin(random.uniform(1.0, 2.5) * time + place),
            random.uniform(0.05, 0.15),
            at=0.3 - 0.3 * place,
        )
        for place in range(3)
    ]
    return crowd(*arms)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_more_rounds_are_never_worse(seed: int) -> None:
    group, left = tangled(seed), []
    for rounds in (3, 8, 28):
        with patch.object(overlap_solver, "_ROUNDS", rounds):
            moved = parted(group, (), floor=Level(), width=WIDTH, most=MOST)
        depths = depth(group, group.joints if moved is None else moved)
        left.append(float((np.maximum(depths - 0.05, 0.0) ** 2).sum()))
    assert left[2] <= left[0] + 1e-6 + 0.02 * left[0]
    assert left[2] <= left[1] + 1e-6 + 0.02 * left[1]


def test_what_overlaps_nearly_all_the_while_is_the_creature_s_own_form() -> None:
    group = crossing(slice(5, FRAMES))
    assert parted(group, (), floor=Level(), width=WIDTH, most=MOST) is None


def test_an_arm_stays_out_of_the_body() -> None:
    height = 0.3 + 0.25 * np.sin(np.linspace(0.0, 2.0 * np.pi, FRAMES))
    arm = straight(np.zeros(FRAMES), 0.0, at=0.0)
    arm[..., 2] += np.linspace(0.0, 1.0, JOINTS) * height[:, None]
    group = crowd(arm)
    ends = np.array([[0.6, 0.0, 0.75], [0.9, 0.0, 0.75]])
    body = Capsules("body", ends[None], np.full(2, 0.3), ends)
    before = Capsules("arm", arm, group.radii[0], group.at_rest[0])

    def deep(joints: Floats) -> float:
        own = Capsules("arm", joints, group.radii[0], group.at_rest[0])
        tiled = Capsules("body", np.tile(ends, (FRAMES, 1, 1)), body.radii, ends)
        return float(measure_overlap([own], [tiled]).depths.max())

    assert deep(before.joints) > 1.0
    moved = parted(group, (body,), floor=None, width=WIDTH, most=MOST)
    assert moved is not None
    assert deep(moved[:, 0]) <= 0.1
