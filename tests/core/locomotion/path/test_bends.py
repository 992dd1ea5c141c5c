# SPDX-License-Identifier: GPL-3.0-or-later
"""Routes count as longer in bends too tight for arms, and elsewhere as long as they are."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.locomotion.path import (
    AlongRoute,
    Route,
    SlowedRoute,
    TravelSettings,
    ValuesAlong,
    bearings_of,
    plan_travel,
    raised_along,
    slowed_in_bends,
    strides,
)
from octo_motion.core.rotations import Floats, from_axis_angle, to_matrix

STRIDE = 0.5
"""Metres."""
CORNER = 0.2
"""Strides."""
HAIRPIN = [[[-0.6, 0.0, 0.0], [0.9, 0.0, 0.0], [0.9, 0.3, 0.0], [-0.6, 0.3, 0.0]]]
RIGHT_ANGLE = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0]]


def slowed(route: Route, amount: float = 1.0) -> Route:
    return slowed_in_bends(route, stride=STRIDE, corner=CORNER * STRIDE, amount=amount)


def circle(radius: float) -> Route:
    """Of 64 arcs, closed."""
    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    at = radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    along = radius * np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    handle = 4.0 / 3.0 * np.tan(np.pi / 128.0) * along
    pieces = [at[:-1], at[:-1] + handle[:-1], at[1:] - handle[1:], at[1:]]
    return Route.bezier(np.stack(pieces, axis=1), cyclic=True)


def turned_in_a_cycle(route: Route) -> Floats:
    """Degrees that a body turns by in each fiftieth of a cycle, times fifty."""
    settings = TravelSettings(stride=STRIDE, corner=CORNER)
    cycles = strides(route, settings)
    times = np.linspace(0.0, 1.0, round(50 * cycles) + 1)
    heading = np.unwrap(bearings_of(route, settings).compass_at(times * route.length))
    return np.degrees(np.abs(np.diff(heading))) * len(times) / cycles


def test_a_route_without_tight_bends_is_the_same_one() -> None:
    for route in (Route.poly([[0.0, 0.0, 0.0], [3.0, 1.0, 0.5]]), circle(2.5 * STRIDE)):
        assert slowed(route) is route


@pytest.mark.parametrize("route", [Route.bezier(HAIRPIN), Route.poly(RIGHT_ANGLE), circle(0.1)])
def test_a_body_turns_by_no_more_than_its_arms_can_follow(route: Route) -> None:
    assert turned_in_a_cycle(route).max() > 150.0
    assert turned_in_a_cycle(slowed(route)).max() < 75.0


def test_in_a_circle_it_counts_as_longer_everywhere_alike() -> None:
    route = circle(0.5 * STRIDE)
    found = slowed(route)
    # 114.6° in a stride, where 50° are as much as it takes.
    assert found.length / route.length == pytest.approx(114.59 / 50.0, rel=1e-3)
    assert isinstance(found, SlowedRoute)
    assert np.ptp(found.slower) < 2e-3


def test_a_corner_costs_as_many_steps_wherever_it_is() -> None:
    more = slowed(Route.poly(RIGHT_ANGLE)).length - 4.0
    # 90° at 50° in a stride, less what the body comes meanwhile.
    assert 0.5 * STRIDE < more < 90.0 / 50.0 * STRIDE
    longer = Route.poly([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.5, 0.0]])
    assert slowed(longer).length - 4.5 == pytest.approx(more, rel=0.02)


@given(st.integers(0, 10_000))
def test_a_distance_leads_to_the_place_that_lies_there(seed: int) -> None:
    chance = np.random.default_rng(seed)
    route = slowed(Route.bezier(chance.uniform(-1.0, 1.0, (1, 4, 3)) * [1.0, 1.0, 0.3]))
    s = np.sort(chance.uniform(0.0, 1.0, 40))
    distance = route.distance_at(s)
    assert np.all(np.diff(distance) > 0.0)
    assert distance.max() <= route.length + 1e-12
    np.testing.assert_allclose(route.parameter_at(distance), s, atol=2e-4)
    metres = route.bare.distance_at(s)
    np.testing.assert_allclose(route.metres_at(distance), metres, atol=1e-4)
    np.testing.assert_allclose(route.share_at(distance), metres / route.bare.length, atol=1e-4)
    for share in (0.0, 0.3, 1.0):
        assert route.share_at(route.distance_of(share)) == pytest.approx(share, abs=1e-4)


@given(st.integers(0, 10_000), st.sampled_from([0.01, 1.0, 40.0]), st.floats(0.0, 6.0))
def test_size_place_and_heading_of_a_route_change_nothing(
    seed: int, size: float, angle: float
) -> None:
    chance = np.random.default_rng(seed)
    points = chance.uniform(-1.0, 1.0, (4, 3)) * [1.0, 1.0, 0.2]
    corners = np.cumsum(chance.uniform(-1.0, 1.0, (6, 3)) * [1.0, 1.0, 0.1], axis=0)
    matrix = np.eye(4)
    matrix[:3, :3] = size * to_matrix(from_axis_angle(np.array([0.0, 0.0, 1.0]), angle))
    matrix[:3, 3] = size * chance.uniform(-5.0, 5.0, 3)
    for route in (Route.bezier(points[None]), Route.poly(corners)):
        moved = slowed_in_bends(
            route.transform(matrix),
            stride=size * STRIDE,
            corner=size * CORNER * STRIDE,
            amount=1.0,
        )
        assert moved.length / size == pytest.approx(slowed(route).length, rel=1e-6)


def test_the_way_back_takes_as_long() -> None:
    route = Route.bezier(HAIRPIN)
    assert slowed(route.reverse()).length == pytest.approx(slowed(route).length, rel=1e-9)


def test_half_of_it_is_half_as_much_and_none_is_none() -> None:
    route = Route.bezier(HAIRPIN)
    more = [slowed(route, amount).length - route.length for amount in (0.0, 0.5, 1.0)]
    assert more == pytest.approx([0.0, 0.5 * more[2], more[2]], abs=1e-12)
    assert more[2] > STRIDE


def test_the_pace_changes_smoothly() -> None:
    route, settings = slowed(Route.poly(RIGHT_ANGLE)), TravelSettings(stride=STRIDE, corner=CORNER)
    speeds: list[Any] = []
    for steps in (2000, 4000):
        travel = plan_travel(route, settings, np.linspace(0.0, 1.0, steps + 1))
        metres = route.metres_at(travel.distance)
        speeds.append(np.diff(metres) * steps / route.length)
    coarse, fine = (np.abs(np.diff(each)).max() for each in speeds)
    assert 0.3 < speeds[0].min() < 0.6
    assert speeds[0].max() == pytest.approx(1.0, abs=1e-3)
    # No jumps: half the step, half the change.
    assert fine < 0.55 * coarse


def test_places_that_an_artist_chose_stay_where_they_are() -> None:
    """Half way along the curve is half way, however long its first half takes."""
    route = Route.bezier([[[0.0, 0.0, 0.0], [0.4, 0.2, 0.0], [-0.4, 0.2, 0.0], [3.0, 0.0, 0.0]]])
    found = slowed(route)
    assert isinstance(found, SlowedRoute)
    assert abs(found.length / 2.0 - found.distance_of(0.5)) > 0.05
    height = ValuesAlong((0.4, 0.5, 0.6), (0.0, 1.0, 0.0))
    settings = TravelSettings(stride=STRIDE, along=AlongRoute(height=height))
    distance = np.linspace(0.0, found.length, 4001)
    highest = distance[np.argmax(raised_along(found, settings, distance))]
    middle = route.position(route.parameter_at(0.5 * route.length))
    assert np.linalg.norm(found.position(found.parameter_at(highest)) - middle) < 2e-3
