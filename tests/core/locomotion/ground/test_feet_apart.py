# SPDX-License-Identifier: GPL-3.0-or-later
"""Footholds of neighbouring arms keep the order in which the arms grow."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.ground.footholds import Neighbours
from octo_motion.core.locomotion.ground.surface import Limbs
from octo_motion.core.rotations import Floats

RADIUS, REACH, SEGMENTS, JOINT = 0.02, 0.6, 12, 7


class Still:
    """A body that stays where it is."""

    def at(self, distance: Floats) -> tuple[Floats, Floats]:
        return np.zeros((*distance.shape, 3)), np.zeros((*distance.shape, 4))


def limbs(angles: Floats, free: np.ndarray | None = None) -> Limbs:
    """Arms that grow at some angles (arms,) about the body."""
    count = len(angles)
    return Limbs(
        arms=tuple(range(count)),
        roots=0.1 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1),
        outward=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        offsets=np.zeros(count),
        lengths=np.full((SEGMENTS, count), REACH / SEGMENTS),
        radii=np.full((SEGMENTS + 1, count), RADIUS),
        aims=np.zeros((count, 2)),
        weights=np.ones((SEGMENTS, 1)),
        free=free,
    )


def turned(
    arms: Limbs, begins: Floats, ends: Floats, feet: Floats, curls: Floats | float = 0.0
) -> Floats:
    """By what places at angles (arms, cycles) about the body, a fixed way from it, are turned, of
    arms that lie straight from there, or are bent to one side.
    """
    lie = np.stack([np.cos(feet), np.sin(feet)], axis=-1)
    found = Neighbours.of(arms, begins, ends, Still())  # pyright: ignore[reportArgumentType]
    lies = 0.35 * lie, lie, np.broadcast_to(curls, feet.shape)
    away, resting = np.full(feet.shape, 0.25), np.ones(feet.shape)
    return found.aside(arms, JOINT, lies, away, resting)


ALL_ROUND = np.radians(np.arange(8) * 45.0)
BEGINS, ENDS = np.tile([0.0, 1.0, 2.0], (8, 1)), np.tile([0.5, 1.5, 2.5], (8, 1))


@given(st.integers(0, 2**31))
def test_feet_that_stand_where_arms_grow_are_left_where_they_are(seed: int) -> None:
    chance = np.random.default_rng(seed)
    feet = ALL_ROUND[:, None] + np.radians(chance.uniform(-14.0, 14.0, (8, 3)))
    assert not turned(limbs(ALL_ROUND), BEGINS, ENDS, feet).any()


@given(st.floats(-40.0, 12.0))
def test_feet_that_are_too_near_or_beyond_each_other_part_both_alike(apart: float) -> None:
    feet = np.tile(ALL_ROUND[:, None], (1, 3))
    feet[2, 1], feet[3, 1] = np.radians([112.0 - 0.5 * apart, 112.0 + 0.5 * apart])
    # The others hold on at another time.
    begins, ends = BEGINS.copy(), ENDS.copy()
    begins[[0, 1, 4, 5, 6, 7]] += 100.0
    ends[[0, 1, 4, 5, 6, 7]] += 100.0
    result = turned(limbs(ALL_ROUND), begins, ends, feet)
    assert result[2, 1] < 0.0 < result[3, 1]
    np.testing.assert_allclose(result[2, 1], -result[3, 1], rtol=1e-9)
    result[[2, 3], 1] = 0.0
    assert not result.any()


def test_arms_whose_tips_are_bent_across_each_other_part() -> None:
    feet = np.tile(ALL_ROUND[:, None], (1, 3))
    curls = np.zeros(feet.shape)
    # Seen from above, anticlockwise and clockwise: towards each other, and then away from it.
    curls[2, 1], curls[3, 1] = np.radians([80.0, -80.0])
    result = turned(limbs(ALL_ROUND), BEGINS, ENDS, feet, curls)
    assert result[2, 1] < 0.0 < result[3, 1]
    curls[2, 1], curls[3, 1] = np.radians([-20.0, 20.0])
    assert not turned(limbs(ALL_ROUND), BEGINS, ENDS, feet, curls).any()


def test_feet_that_never_hold_on_together_may_be_in_one_place() -> None:
    feet = np.tile(ALL_ROUND[:, None], (1, 3))
    feet[3] = feet[2]
    begins, ends = BEGINS.copy(), ENDS.copy()
    begins[3], ends[3] = ends[3] + 100.0, ends[3] + 100.5
    assert not turned(limbs(ALL_ROUND), begins, ends, feet)[2].any()
    begins[3], ends[3] = BEGINS[3], ENDS[3]
    assert turned(limbs(ALL_ROUND), begins, ends, feet)[2].all()


def test_an_arm_that_is_kept_off_the_ground_is_in_nobodys_way() -> None:
    feet = np.tile(ALL_ROUND[:, None], (1, 3))
    feet[3] = feet[2]
    free = np.arange(8) == 3
    assert not turned(limbs(ALL_ROUND, free), BEGINS, ENDS, feet).any()


def test_arms_that_stand_on_one_side_have_no_neighbours_across_the_other() -> None:
    two = np.radians([70.0, 110.0])
    begins, ends = np.zeros((2, 1)), np.ones((2, 1))
    assert not turned(limbs(two), begins, ends, two[:, None]).any()
    assert not turned(limbs(two[:1]), begins[:1], ends[:1], two[:1, None]).any()
    assert turned(limbs(two), begins, ends, two[::-1, None]).any()
