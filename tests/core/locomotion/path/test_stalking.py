# SPDX-License-Identifier: GPL-3.0-or-later
"""A body that stalks comes to a standstill, and nothing about it is sudden."""

from dataclasses import replace

import numpy as np
import pytest

from octo_motion.core.locomotion.path.along_route import ValuesAlong
from octo_motion.core.locomotion.path.route import Route
from octo_motion.core.locomotion.path.travel import (
    AlongRoute,
    TravelSettings,
    duration,
    paced_time,
    plan_travel,
)

ROUTE = Route.poly([[0.0, 0.0, 0.0], [0.0, -8.0, 0.0]])
STALKS = TravelSettings(stalk=1.0, ease_in=0.05, ease_out=0.05)
CHANGING = replace(STALKS, along=AlongRoute(pace=ValuesAlong.through([(0.1, 0.5), (0.8, 2.0)])))
"""Slow at first, and hasty in the end."""


def speeds(settings: TravelSettings, count: int) -> np.ndarray:
    """Metres a second at a cruising speed of one, from frame to frame."""
    seconds = duration(ROUTE, settings, 1.0)
    travel = plan_travel(ROUTE, settings, np.linspace(0.0, 1.0, count + 1))
    return np.diff(travel.distance) * count / seconds


@pytest.mark.parametrize("settings", [STALKS, CHANGING])
def test_it_stands_truly_still_at_each_stop(settings: TravelSettings) -> None:
    found = speeds(settings, 4000)[200:-200]
    still = found < 1e-9
    # 8 strides in legs of 1.6: five, and four stops between them.
    assert np.sum(np.diff(still.astype(int)) == 1) == 4
    assert found.min() > -1e-9


def test_it_is_as_long_as_it_stands_longer_on_its_way() -> None:
    even = duration(ROUTE, replace(STALKS, stalk=0.0), 1.0)
    travel = plan_travel(ROUTE, STALKS, np.linspace(0.0, 1.0, 20001))
    whole = duration(ROUTE, STALKS, 1.0)
    standing = whole * float(np.mean(np.diff(travel.distance) < 1e-12))
    # Half of the time in which it slows down and gets going is lost, too.
    assert whole > even + standing > even + 1.0
    assert travel.distance[0] == 0.0
    np.testing.assert_allclose(travel.distance[-1], ROUTE.length, rtol=1e-12)


@pytest.mark.parametrize("settings", [STALKS, CHANGING, replace(STALKS, stalk=0.5)])
def test_finer_frames_make_smaller_steps_of_its_speed(settings: TravelSettings) -> None:
    steps = [np.abs(np.diff(speeds(settings, count))).max() for count in (2000, 4000, 8000)]
    assert steps[0] > 1.9 * steps[1] > 3.6 * steps[2]


def test_half_a_stop_is_half_as_fast_and_no_stop_is_the_way_without() -> None:
    found = speeds(replace(STALKS, stalk=0.5), 4000)[400:-400]
    np.testing.assert_allclose(found.min() / found.max(), 0.5, rtol=1e-3)
    times = np.linspace(0.0, 1.0, 501)
    none = plan_travel(ROUTE, replace(STALKS, stalk=0.0), times).distance
    hardly = plan_travel(ROUTE, replace(STALKS, stalk=1e-9), times).distance
    np.testing.assert_allclose(hardly, none, atol=1e-6)


def test_stops_that_are_over_are_counted_without_a_jump() -> None:
    travel = plan_travel(ROUTE, STALKS, np.linspace(0.0, 1.0, 8001))
    stood = travel.stood
    assert stood[0] == 0.0
    assert stood[-1] == 4.0
    assert np.all(np.diff(stood) >= 0.0)
    assert np.diff(stood).max() < 0.01
    # It stands only while a stop goes on.
    still = np.diff(travel.distance)[400:-400] < 1e-12
    assert np.all(np.diff(stood)[400:-400][still] > 0.0)


def test_times_at_places_lead_back_to_them() -> None:
    paced = paced_time(ROUTE, CHANGING)
    assert paced is not None
    # Not where it stands: that is a stretch of time.
    wanted = np.array([0.01, 0.15, 0.5, 0.93])
    np.testing.assert_allclose(paced.parameter(paced.times(wanted)), wanted, atol=1e-3)


def test_a_way_of_one_leg_has_no_stop() -> None:
    short = Route.poly([[0.0, 0.0, 0.0], [0.0, -1.5, 0.0]])
    assert paced_time(short, STALKS) is None
