# SPDX-License-Identifier: GPL-3.0-or-later
"""When arms are where in their cycles: in step, or each by its own holds."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.crawl import CrawlSettings, Holds, plan_crawl
from octo_motion.core.locomotion.rhythm import Even, Free
from tests.core.test_crawl import journey

MIDDLE, DUTY = np.radians(225.0), 0.55


def crawl(seed: int = 0) -> tuple[Free, Holds]:
    holds = plan_crawl(journey(facing=0.7), CrawlSettings(seed=seed))
    return Free(holds, 8, middle=MIDDLE, duty=DUTY), holds


def test_an_even_rhythm_is_one_cycle_per_stride() -> None:
    rhythm = Even(0.8, np.array([0.0, 1.0]))
    np.testing.assert_allclose(
        rhythm.phases(np.array([0.0, 0.8])), [[0, 1], [2 * np.pi, 1 + 2 * np.pi]]
    )


@given(st.lists(st.floats(-5.0, 9.0), min_size=1, max_size=20), st.integers(0, 5))
def test_distance_and_phase_are_each_others_inverse(at: list[float], seed: int) -> None:
    distance = np.array(at)
    for rhythm in (Even(0.8, np.linspace(0.0, 5.0, 8)), crawl(seed)[0]):
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


def test_an_arm_without_a_hold_has_a_phase_all_the_same() -> None:
    _, holds = crawl()
    rhythm = Free(holds, 9, middle=MIDDLE, duty=DUTY)
    assert np.all(np.isfinite(rhythm.phases(np.linspace(-1.0, 7.0, 50))))
