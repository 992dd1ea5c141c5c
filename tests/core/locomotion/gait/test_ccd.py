# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws of the solver of one group and of a whole arm."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from octo_motion.core.locomotion.gait import ccd
from octo_motion.core.rotations import Floats, from_axis_angle, normalized, rotate, shortest_arc

seeds = st.integers(0, 2**31)
counts = st.integers(2, 12)


def columns(rows: Floats) -> Floats:
    """From (…, batch, 3), which reads well, to the solver's (…, 3, batch); and back."""
    return np.swapaxes(rows, -2, -1)


def chord(directions: Floats, lengths: Floats) -> Floats:
    return columns(ccd.chord(columns(directions), lengths))


def aimed(directions: Floats, lengths: Floats, goal: Floats) -> Floats:
    return columns(ccd.aimed(columns(directions), lengths, columns(goal)))


def swept(directions: Floats, lengths: Floats, weights: Floats, goal: Floats) -> Floats:
    return columns(ccd.swept(columns(directions), lengths, weights, columns(goal)))


def closed(directions: Floats, lengths: Floats, goal: Floats) -> Floats:
    return columns(ccd.close_group(columns(directions), lengths, columns(goal)))


def a_group(seed: int, count: int, batch: int = 8) -> tuple[Floats, Floats, Floats]:
    """Directions of groups bent to one side, not quite evenly, lengths, and goals within reach."""
    random = np.random.default_rng(seed)
    lengths = random.uniform(0.9, 1.1, count)
    bend = random.uniform(0.2, 1.5, batch) * np.linspace(-0.5, 0.5, count)[:, None]
    arc = np.stack([np.cos(bend), np.sin(bend), np.zeros_like(bend)], axis=-1)
    bent = normalized(arc + random.normal(0.0, 0.03, arc.shape))
    directions = rotate(normalized(random.normal(size=(batch, 4))), bent)
    goal = normalized(random.normal(0.0, 1.0, (batch, 3)))
    return directions, lengths, goal * random.uniform(0.3, 0.95, (batch, 1)) * lengths.sum()


def distance(directions: Floats, lengths: Floats, goal: Floats) -> Floats:
    return np.linalg.norm(chord(directions, lengths) - goal, axis=-1)


def turned_one_joint_after_the_other(
    directions: Floats, lengths: Floats, shares: Floats, goal: Floats
) -> Floats:
    """CCD as the paper tells it, joint by joint on positions, for a single arm."""
    joints = np.concatenate([[np.zeros(3)], np.cumsum(lengths[:, None] * directions, axis=0)])
    for joint in range(len(lengths) - 1, -1, -1):
        end, wanted = joints[-1] - joints[joint], goal - joints[joint]
        normal = np.cross(end, wanted)
        angle = np.arctan2(np.linalg.norm(normal), end @ wanted)
        turn = from_axis_angle(normalized(normal), shares[joint] * angle)
        joints[joint + 1 :] = joints[joint] + rotate(turn, joints[joint + 1 :] - joints[joint])
    return np.diff(joints, axis=0) / lengths[:, None]


@given(seeds, st.integers(1, 4), st.floats(0.05, 1.0))
def test_a_sweep_is_the_papers_joint_by_joint(seed: int, count: int, weight: float) -> None:
    directions, lengths, goal = a_group(seed, count, 1)
    goal = chord(directions, lengths) + 0.2 * goal  # nothing near a half turn
    weights = np.full(count, weight)

    found = swept(directions, lengths, weights, goal)

    # Short levers take less than their full share; the same sweep with the shares so lowered.
    shares = np.empty(count)
    after = directions[:, 0].copy()
    for joint in range(count - 1, -1, -1):
        root = lengths[:joint] @ directions[:joint, 0]
        end = lengths[joint:] @ after[joint:]
        wanted = goal[0] - root
        size = np.linalg.norm(end) * np.linalg.norm(wanted)
        shares[joint] = weight * size / (size + ccd._SHORT_LEVER * lengths.sum() ** 2)
        turn = shortest_arc(normalized(end), normalized(wanted))
        axis, angle = normalized(turn[1:]), 2.0 * np.arccos(min(1.0, turn[0]))
        assume(angle < 0.7 * np.pi)
        after[joint:] = rotate(from_axis_angle(axis, shares[joint] * angle), after[joint:])
    expected = turned_one_joint_after_the_other(directions[:, 0], lengths, shares, goal[0])
    assert np.allclose(found[:, 0], expected, atol=1e-6)


@given(seeds, counts, st.floats(0.1, 1.0))
def test_sweeps_bring_the_end_nearer_to_a_goal_it_faces(
    seed: int, count: int, weight: float
) -> None:
    directions, lengths, goal = a_group(seed, count)
    directions = aimed(directions, lengths, goal)
    before = distance(directions, lengths, goal)

    for _ in range(4):
        directions = swept(directions, lengths, np.full(count, weight), goal)

    assert np.all(distance(directions, lengths, goal) <= before + 1e-9)
    assert np.allclose(np.linalg.norm(directions, axis=-1), 1.0, atol=1e-12)


@given(seeds, counts)
def test_closing_ends_at_every_goal_within_reach(seed: int, count: int) -> None:
    directions, lengths, goal = a_group(seed, count)

    found = closed(directions, lengths, goal)

    # What rounding off the full stretch costs: f² / 4 of the slack, slack 0.05 at least.
    allowed = 0.25 * ccd._ROUNDING**2 / 0.05 * lengths.sum()
    assert np.max(distance(found, lengths, goal)) <= allowed + 1e-7
    assert np.allclose(np.linalg.norm(found, axis=-1), 1.0, atol=1e-12)


@given(seeds, counts)
def test_closing_what_is_closed_changes_nothing_to_speak_of(seed: int, count: int) -> None:
    directions, lengths, goal = a_group(seed, count)
    once = closed(directions, lengths, goal)

    twice = closed(once, lengths, goal)

    assert np.max(np.abs(twice - once)) <= 1e-3


@given(seeds, counts)
def test_a_group_is_solved_alike_alone_and_among_others(seed: int, count: int) -> None:
    directions, lengths, goal = a_group(seed, count)
    weights = np.full(count, 0.4)

    among = closed(swept(directions, lengths, weights, goal), lengths, goal)

    for number in range(len(goal)):
        one = slice(number, number + 1)
        moved = swept(directions[:, one], lengths, weights, goal[one])
        alone = closed(moved, lengths, goal[one])
        np.testing.assert_allclose(alone, among[:, one], atol=1e-12)


@given(seeds, counts)
def test_a_goal_out_of_reach_is_pointed_at_with_a_stretched_group(seed: int, count: int) -> None:
    directions, lengths, goal = a_group(seed, count)
    goal = normalized(goal) * 1.5 * lengths.sum()

    found = closed(directions, lengths, goal)

    reached = chord(found, lengths)
    assert np.allclose(normalized(reached), normalized(goal), atol=1e-9)
    assert np.all(np.linalg.norm(reached, axis=-1) >= (1.0 - ccd._ROUNDING) * lengths.sum())


@given(seeds, st.floats(0.0, 1.0))
def test_the_solver_does_not_know_left_from_right(seed: int, softness: float) -> None:
    random = np.random.default_rng(seed)
    chain = ccd.JointChain(np.full(12, 1 / 12), (4, 4, 4), np.full(12, 0.4))
    angles = random.uniform(-1.2, 1.2, (20, 3, 2))
    sway = np.broadcast_to([0.02, 0.17], (20, 2))
    mirrored = np.array([1.0, -1.0])

    def solved(angles: Floats, sway: Floats) -> Floats:
        from octo_motion.core.locomotion.gait.ccd import contraction, link_rotations, pseudo_targets

        with_bank = np.concatenate([angles, np.zeros((20, 3, 1))], axis=-1)
        links = link_rotations(with_bank)
        targets = pseudo_targets(links, (1.0 + contraction(with_bank)) / 3)
        shape = ccd.asked_shape(chain, np.moveaxis(angles, 0, -1), sway.T)
        *_, solution = ccd.solving_ccd(
            chain, shape, np.moveaxis(links, 0, -1), np.moveaxis(targets, 0, -1), softness=softness
        )
        return columns(solution)

    one, other = solved(angles, sway), solved(angles * mirrored, sway * mirrored)

    assert np.max(np.abs(one * [1.0, -1.0, 1.0] - other)) <= 1e-6


def test_the_asked_shape_joins_smoothly_from_link_to_link() -> None:
    chain = ccd.JointChain(np.full(300, 1 / 300), (100, 100, 100), np.full(300, 0.4))
    angles = np.radians(np.array([[[20.0, 0.0], [-50.0, 10.0], [30.0, -20.0]]]))
    from octo_motion.core.locomotion.gait.ccd import link_rotations

    shape = columns(ccd.asked_shape(chain, np.moveaxis(angles, 0, -1), np.zeros((2, 1))))
    links = link_rotations(np.concatenate([angles, np.zeros((1, 3, 1))], axis=-1))
    directions = np.concatenate(
        [rotate(links[:, group], shape[segments]) for group, segments in enumerate(chain.groups)]
    )

    steps = np.degrees(np.linalg.norm(np.diff(directions, axis=0), axis=-1))[:, 0]
    # 300 segments: no step is larger than the fastest that the parabola makes, 4 × 30° × 3/300.
    assert np.max(steps) <= 4.0
    # It leaves the body outward, the way that the arm points.
    assert np.degrees(np.arccos(directions[0, 0, 0])) <= 1.0


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_goal_at_the_root_leaves_finite_numbers(count: int) -> None:
    directions = np.broadcast_to([1.0, 0.0, 0.0], (count, 3, 3)).copy()
    goal = np.array([[0.0, 0.0, 0.0], [1e-14, 0.0, 0.0], [-1.0, 0.0, 0.0]])

    bent = closed(directions, np.ones(count), goal)
    turned = swept(directions, np.ones(count), np.full(count, 0.4), goal)

    assert np.all(np.isfinite(bent))
    assert np.all(np.isfinite(turned))


@pytest.mark.parametrize("give", [0.0, 0.1])
@pytest.mark.parametrize("far", [1e2, 1e5, 1e9])
def test_a_goal_however_far_away_is_pointed_at(far: float, give: float) -> None:
    directions, lengths, goal = a_group(3, 4)
    goal = far * normalized(goal)
    found = columns(
        ccd.close_group(columns(directions), lengths, columns(goal), stretch_slack=give)
    )
    assert normalized(chord(found, lengths)) == pytest.approx(normalized(goal), abs=1e-6)
    away = np.linalg.norm(goal, axis=-1)
    assert np.all(ccd.overreach(away, np.full(away.shape, lengths.sum()), give) <= 1e-9)
