# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms move evenly over time, and what holds the ground stays where it is."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.core.locomotion.gait.gait_poser import GaitSettings
from octo_motion.core.locomotion.gait.variation import variation
from octo_motion.core.locomotion.ground.walk import (
    GroundedPoses,
    Raise,
    SwingSmoothing,
    frames_around,
)
from octo_motion.core.rotations import Floats, continuous
from tests.core.grounds import FRAMES, GROUNDS, Walker, walker

STEADY = 0.08
"""Cycles: what the panel proposes."""


def over(cycles: float, frames: float) -> SwingSmoothing:
    steady = SwingSmoothing.over(cycles, frames)
    assert steady is not None
    return steady


def waving(frames: int, seed: int = 3) -> Floats:
    """Directions (4, 3, frames, 2) of arms that move at random."""
    ways = np.random.default_rng(seed).normal(size=(4, 3, frames, 2))
    ways[:, 0] += 2.0
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def bend(directions: Floats) -> Floats:
    """Second differences over frames."""
    return np.linalg.norm(np.diff(directions, 2, axis=2), axis=1)


# --- A gait's table ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["walk", "swim", "hurry"])
@pytest.mark.parametrize("steady", [0.01, STEADY, 0.25])
def test_the_table_is_evened_out_by_the_mean_over_a_window(name: str, steady: float) -> None:
    table = gait.gait_presets()[name]
    phases = np.linspace(-7.0, 14.0, 37)[:, None]
    found = gait.gait_angles(table, phases, (1,), smoothing_cycles=steady)
    # The middles of many slices of the window, each weighing the less, the further off it is.
    slices = (np.arange(4000) + 0.5) / 2000.0 - 1.0
    weights = 1.0 - np.abs(slices)
    every = phases + slices * steady * gait.CYCLE
    values = gait.gait_angles(table, every, (1,) * 4000)
    mean = np.einsum("w,fwla->fla", weights / weights.sum(), values)
    np.testing.assert_allclose(found[:, 0], mean, atol=1e-5)


def test_without_it_the_table_keeps_its_corners() -> None:
    table = gait.gait_presets()["walk"]
    phases = np.linspace(0.0, 9.0, 50)[:, None]
    exact = gait.gait_angles(table, phases, (1,))
    assert np.array_equal(gait.gait_angles(table, phases, (1,), smoothing_cycles=0.0), exact)


@given(seed=st.integers(0, 99), period=st.sampled_from([0, 3]))
def test_random_additions_have_no_corners_either(seed: int, period: int) -> None:
    table = gait.gait_presets()["walk"]
    phases = np.linspace(-9.0, 20.0, 3001)[:, None] + np.array([0.0, 2.0])

    def varied(steady: float) -> Floats:
        limits = (-0.3, 0.4)
        return variation(
            table, phases, (1, 2), limits, seed, cycle_period=period, smoothing_cycles=steady
        )

    corners, even = (np.abs(np.diff(varied(each), 2, axis=0)).max() for each in (0.0, STEADY))
    assert even < 0.1 * corners
    assert np.abs(varied(STEADY)).max() <= 0.4


@given(cycle=st.integers(-3, 3))
def test_evened_random_additions_come_again_with_their_period(cycle: int) -> None:
    table = gait.gait_presets()["walk"]
    phases = np.linspace(0.0, gait.CYCLE, 50)[:, None] + np.zeros(3)
    found = [
        variation(table, each, (1, 2, 3), (0.0, 0.2), 5, cycle_period=2, smoothing_cycles=STEADY)
        for each in (phases, phases + 2 * cycle * gait.CYCLE)
    ]
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)


@pytest.mark.parametrize("steady", [-0.01, 0.26, float("nan")])
def test_a_window_that_makes_no_sense_is_told(steady: float) -> None:
    with pytest.raises(SettingsError):
        GaitSettings(gait.gait_presets()["walk"], smoothing_cycles=steady)


# --- Over frames ---------------------------------------------------------------------------------


@given(frames=st.floats(4.0, 300.0), cycles=st.floats(0.01, 0.25))
def test_it_is_as_wide_as_asked_for_at_any_frame_rate(frames: float, cycles: float) -> None:
    steady = over(cycles, frames)
    count = 2 * steady.reach + 3
    # A little to one side at a single frame: how far to that side it comes is linear.
    ways = np.zeros((1, 3, count, 1))
    ways[:, 0], ways[:, 1, count // 2] = 1.0, 1e-4
    spread = steady.evened(ways, np.ones((count, 1)))[0, 1, :, 0] / 1e-4
    away = np.arange(count) - count // 2
    assert spread.sum() == pytest.approx(1.0, abs=1e-6)
    assert spread @ away**2 == pytest.approx((cycles * frames) ** 2 / 6.0, rel=1e-6, abs=1e-9)
    assert np.all(spread[np.abs(away) > steady.reach] == 0.0)


def test_nothing_to_even_out_over_is_no_window() -> None:
    assert SwingSmoothing.over(0.0, 48.0) is None
    assert SwingSmoothing.over(STEADY, 0.0) is None


@pytest.mark.parametrize("cyclic", [False, True])
def test_the_portions_in_which_a_motion_is_made_do_not_matter(
    cyclic: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    steady, ways = over(STEADY, 60.0), waving(101)
    if cyclic:
        ways[:, :, -1] = ways[:, :, 0]
    share = np.abs(np.sin(np.arange(101) / 9.0))[:, None] * [1.0, 0.5]
    share[-1] = share[0]
    parts = []
    for start in (0, 17, 50, 99):
        part = slice(start, {0: 17, 17: 50, 50: 99, 99: 101}[start])
        frames, own = frames_around(part, steady.reach, 101, cyclic=cyclic)
        parts.append(steady.evened(ways[:, :, frames], share[frames])[:, :, own])
    found = np.concatenate(parts, axis=2)
    if cyclic:
        np.testing.assert_allclose(found[:, :, 0], found[:, :, -1], atol=1e-12)
        thrice = np.concatenate([ways[:, :, :-1]] * 3, axis=2)
        whole = steady.evened(thrice, np.concatenate([share[:-1]] * 3))[:, :, 100:200]
        np.testing.assert_allclose(found[:, :, :-1], whole, atol=1e-12)
    else:
        np.testing.assert_allclose(found, steady.evened(ways, share), atol=1e-12)


def test_what_takes_no_part_stays_and_all_else_moves_more_evenly() -> None:
    ways, share = waving(80), np.ones((80, 2))
    share[30:50] = 0.0
    found = over(STEADY, 48.0).evened(ways, share)
    np.testing.assert_allclose(found[:, :, 30:50], ways[:, :, 30:50], atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    assert bend(found[:, :, :25]).mean() < 0.5 * bend(ways[:, :, :25]).mean()


def test_arms_that_turn_about_within_a_frame_stay_whole() -> None:
    ways = np.zeros((1, 3, 20, 1))
    ways[:, 0] = np.where(np.arange(20) % 2, 1.0, -1.0)[:, None]
    found = over(STEADY, 48.0).evened(ways, np.ones((20, 1)))
    assert np.isfinite(found).all()


# --- On the ground -------------------------------------------------------------------------------


def posed(walk: Walker, times: Floats, higher: Any = None, *, steady: bool) -> GroundedPoses:
    travel, centres, orientations = walk.places(times)
    how = over(STEADY, FRAMES) if steady else None
    return walk.walk.pose(travel.phase, travel.turn, centres, orientations, higher, smoothing=how)


@pytest.mark.parametrize("ground", ["plane", "bumps"])
def test_arms_swing_more_evenly_and_hold_on_as_they_did(ground: str) -> None:
    corners = walker(GROUNDS[ground], stretch=True)
    even = walker(GROUNDS[ground], stretch=True, smoothing_cycles=STEADY)
    before = posed(corners, corners.times, steady=False)
    alone = posed(even, even.times, steady=False)
    after = posed(even, even.times, steady=True)

    def jerk(poses: GroundedPoses) -> float:
        return float(np.sqrt((np.diff(continuous(poses.rotations), 2, axis=0) ** 2).mean()))

    # By a third, as it is asked for; and by half with what leaves the ground without a jerk.
    assert jerk(after) < jerk(alone) < jerk(before)
    assert jerk(after) < 0.67 * jerk(before)
    for ours, theirs, lies in zip(after.joints, alone.joints, alone.in_contact, strict=True):
        assert lies.any()
        np.testing.assert_allclose(ours[lies], theirs[lies], atol=1e-12)
    heights = after.joints[0][..., 2] - GROUNDS[ground].height(after.joints[0])
    assert heights[:, :, 1:].min() > 0.0
    assert after.misses.max() < 1e-3


def test_arms_that_are_raised_are_as_even_as_the_others() -> None:
    walk = walker(GROUNDS["bumps"], stretch=True, smoothing_cycles=STEADY)
    times = walk.times[:120]
    whole = posed(walk, times, steady=True)
    chosen = np.arange(40, 60)
    shapes, evened = (
        tuple(each[:, :, chosen] for each in of) for of in (whole.shapes, whole.evened)
    )
    # By hardly anything: so they are where they were, and not where each frame by itself is.
    higher = Raise(np.full((20, 8), 1e-9), shapes, evened)
    again = posed(walk, times[chosen], higher, steady=False)
    np.testing.assert_allclose(again.rotations, whole.rotations[chosen], atol=1e-5)
    alone = posed(walk, times[chosen], steady=False)
    assert np.abs(alone.rotations - whole.rotations[chosen]).max() > 1e-3
