# SPDX-License-Identifier: GPL-3.0-or-later
"""When arms are where in their cycles: in step, or each by its own holds."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.ground.contact_timing import (
    CrawlingBody,
    EvenTiming,
    TabledTiming,
    crawl_timing,
    crawling_in_place,
    finding_line,
    timing_at_rest,
)
from octo_motion.core.locomotion.ground.crawl_planner import CrawlSettings, CrawlStances, plan_crawl
from octo_motion.core.locomotion.ground.footholds import span
from octo_motion.core.locomotion.ground.surface import LevelGround, StanceSettings
from octo_motion.core.locomotion.path.course import route_in_place
from octo_motion.core.locomotion.path.travel import TravelSettings, bearings_of
from octo_motion.core.rotations import from_axis_angle
from octo_motion.core.steps import finished
from tests.core.locomotion.ground.test_crawl import journey

MIDDLE, DUTY = np.radians(225.0), 0.55


@functools.cache
def crawl(seed: int = 0) -> tuple[TabledTiming, CrawlStances]:
    holds = plan_crawl(journey(facing=0.7), CrawlSettings(seed=seed))
    return crawl_timing(holds, 8, middle=MIDDLE, duty=DUTY), holds


def test_an_even_rhythm_is_one_cycle_per_stride() -> None:
    rhythm = EvenTiming(0.8, np.array([0.0, 1.0]))
    np.testing.assert_allclose(
        rhythm.phases(np.array([0.0, 0.8])), [[0, 1], [2 * np.pi, 1 + 2 * np.pi]]
    )


@given(st.lists(st.floats(-5.0, 9.0), min_size=1, max_size=20), st.integers(0, 5))
def test_distance_and_phase_are_each_others_inverse(at: list[float], seed: int) -> None:
    distance = np.array(at)
    for rhythm in (EvenTiming(0.8, np.linspace(0.0, 5.0, 8)), crawl(seed)[0]):
        phases = rhythm.phases(distance)
        back = rhythm.distances(range(8), phases.T / (2.0 * np.pi))
        # A table of eight steps between knots: good to where an arm is laid down.
        np.testing.assert_allclose(back, np.tile(distance, (8, 1)), atol=0.02)


def test_arms_of_a_crawl_hold_when_their_cycle_says_so() -> None:
    rhythm, holds = crawl()
    for number, arm in enumerate(holds.arm):
        cycle = number - np.flatnonzero(holds.arm == arm)[0]
        ends = np.array([holds.start[number], holds.end[number]])
        asked = MIDDLE + 2.0 * np.pi * (cycle + 0.5 * DUTY * np.array([-1.0, 1.0]))
        np.testing.assert_allclose(rhythm.phases(ends)[:, arm], asked, atol=1e-9)


def test_phases_of_a_crawl_rise_without_a_jump_in_speed() -> None:
    rhythm, _ = crawl()
    coarse, fine = (np.arange(-2.0, 8.0, step) for step in (0.01, 0.005))
    speeds = []
    for at in (coarse, fine):
        phases = rhythm.phases(at)
        assert np.all(np.diff(phases, axis=0) > 0.0)
        speeds.append(np.abs(np.diff(phases, 2, axis=0) / (at[1] - at[0])).max())
    assert speeds[1] < 0.7 * speeds[0]


LENGTH = 6.0


def standing(cycles: np.ndarray) -> np.ndarray:
    """How far from the middle of its hold an arm is, in holds."""
    return np.abs(cycles - np.round(cycles)) / DUTY


@given(
    st.floats(0.02, LENGTH),
    st.floats(0.3, 1.5),
    st.integers(0, 3),
    st.tuples(st.booleans(), st.booleans()),
)
def test_where_the_body_stands_all_arms_lie_down_and_none_goes_back(
    length: float, stride: float, seed: int, ends: tuple[bool, bool]
) -> None:
    start, end = ends
    even = EvenTiming(stride, np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 8))
    for rhythm in (even, crawl(seed)[0]):
        own = timing_at_rest(rhythm, length, start=start, end=end, middle=MIDDLE, duty=DUTY)
        distance = np.linspace(0.0, length, 400)
        cycles = (own.phases(distance) - MIDDLE) / (2.0 * np.pi)
        assert np.all(np.diff(cycles, axis=0) >= -1e-12)
        # Within a third of a hold: the arm lies unrolled, and is hardly peeled off.
        if start:
            assert standing(cycles[0]).max() < 0.31
            np.testing.assert_allclose(own.phases(np.array([-1.0])), own.phases(distance[:1]))
        if end:
            assert standing(cycles[-1]).max() < 0.31
            np.testing.assert_allclose(own.phases(distance[-1:] + 1.0), own.phases(distance[-1:]))
        if not start and not end:
            np.testing.assert_allclose(own.phases(distance), rhythm.phases(distance), atol=1e-9)


def test_in_between_arms_that_start_and_end_at_rest_keep_their_rhythm() -> None:
    even = EvenTiming(0.8, np.linspace(0.0, 5.5, 8))
    own = timing_at_rest(even, LENGTH, start=True, end=True, middle=MIDDLE, duty=DUTY)
    distance = np.linspace(0.8, LENGTH - 0.8, 200)
    np.testing.assert_allclose(own.phases(distance), even.phases(distance), atol=0.03)
    steps = np.diff(own.phases(np.linspace(0.0, LENGTH, 2000)), axis=0) * 2000.0 / LENGTH
    # Four times its pace at most, and that only while the body is slow.
    assert steps.max() < 4.0 * 2.0 * np.pi / 0.8


@given(st.floats(0.1, 0.85), st.floats(6.0, 40.0), st.integers(0, 2**31))
def test_however_short_its_holds_a_walk_from_rest_to_rest_keeps_its_rhythm(
    duty: float, strides: float, seed: int
) -> None:
    even = EvenTiming(0.8, np.random.default_rng(seed).uniform(-7.0, 7.0, 8))
    length = 0.8 * strides
    own = timing_at_rest(even, length, start=True, end=True, middle=MIDDLE, duty=duty)
    # An arm is as it would be a cycle and a half from where the body stands, and all the way on.
    distance = np.linspace(2.5 * 0.8, length - 2.5 * 0.8, 300)
    np.testing.assert_allclose(own.phases(distance), even.phases(distance), atol=1e-9)
    back = own.distances(range(8), own.phases(distance).T / (2.0 * np.pi))
    np.testing.assert_allclose(back, np.tile(distance, (8, 1)), atol=1e-6)


def test_each_cycle_of_a_crawl_knows_where_its_hold_is() -> None:
    rhythm, holds = crawl()
    turns, away = rhythm.aims(range(8), np.arange(-1, 40))
    for arm in range(8):
        own = holds.arm == arm
        np.testing.assert_array_equal(turns[arm, 1 : 1 + own.sum()], holds.turn[own])
        np.testing.assert_array_equal(away[arm, 1 : 1 + own.sum()], holds.away[own])
        assert np.isnan(away[arm, [0, -1]]).all()
    # A walk leaves it to each arm, straight ahead.
    turns, away = EvenTiming(0.8, np.zeros(8)).aims([1, 3], np.arange(4))
    assert not turns.any()
    assert np.isnan(away).all()


def test_a_crawl_that_is_planned_from_rest_to_rest_is_left_as_it_was_planned() -> None:
    for seed in range(4):
        way = replace(journey(), stands=(True, True))
        length = float(way.distance[-1])
        holds = plan_crawl(way, CrawlSettings(seed=seed))
        planned = crawl_timing(holds, 8, middle=MIDDLE, duty=DUTY)
        own = timing_at_rest(planned, length, start=True, end=True, middle=MIDDLE, duty=DUTY)
        distance = np.linspace(0.0, length, 500)
        # But for how the phase rises through the first and the last hold: no arm is hurried.
        late = np.abs(own.phases(distance) - planned.phases(distance)) / (2.0 * np.pi)
        assert late.max() < 0.03


@pytest.mark.parametrize("stretch", [0.0, 2.0])
@pytest.mark.parametrize("arms", [1, 8])
def test_a_crawl_in_place_has_its_loop_however_long_its_stances(arms: int, stretch: float) -> None:
    travel, route = TravelSettings(stride=0.8), route_in_place(0.8, 2)
    line = finished(
        finding_line(
            route,
            travel,
            bearings_of(route, travel),
            LevelGround(0.0),
            clearance=0.2,
            reach=1.0,
            lean=0.0,
            smoothing=0.3,
        )
    )
    outward = from_axis_angle(np.array([0.0, 0.0, 1.0]), 0.5 + 0.7 * np.arange(arms))
    roots = np.zeros((arms, 3))
    stance = StanceSettings(planted=0.1, stretch=stretch)
    settings = CrawlSettings(*span(stance, may_stretch=True))
    body = CrawlingBody(line, roots, outward, reach=1.0, middle=MIDDLE, duty=DUTY)
    own = crawling_in_place(body, settings)
    phases = own.phases(np.array([0.0, route.length]))
    assert own.cycle_period is not None
    np.testing.assert_allclose(np.diff(phases, axis=0)[0], 2.0 * np.pi * np.array(own.cycle_period))
    assert min(own.cycle_period) >= 1


def test_an_arm_without_a_hold_has_a_phase_all_the_same() -> None:
    _, holds = crawl()
    rhythm = crawl_timing(holds, 9, middle=MIDDLE, duty=DUTY)
    assert np.all(np.isfinite(rhythm.phases(np.linspace(-1.0, 7.0, 50))))
