# SPDX-License-Identifier: GPL-3.0-or-later
"""The body's way along a route: on time, on the route, the right way round, and without a pop."""

from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from octo_motion.core.errors import SettingsError
from octo_motion.core.locomotion.path import travel as module
from octo_motion.core.locomotion.path.route import Route
from octo_motion.core.locomotion.path.travel import (
    Travel,
    TravelSettings,
    duration,
    phase_at_distance,
    plan_travel,
    strides,
    stroke_distance,
    unhurried,
)
from octo_motion.core.rotations import Floats, angle_between, from_axis_angle, multiply, rotate

LEFT, FRONT, UP = np.array([1.0, 0, 0]), np.array([0, -1.0, 0]), np.array([0, 0, 1.0])
CYCLE = 2.0 * np.pi

WALK = TravelSettings(stride=0.8, ease_in=0.1, ease_out=0.2)
TILTED = replace(WALK, keep_upright=False)
SWIM = replace(WALK, manner="SWIM")
BANKED = replace(SWIM, bank=0.5)
MANNERS = {"walk": WALK, "tilted walk": TILTED, "swim": SWIM, "banked swim": BANKED}

_K = 0.5522847498
_RING = np.array(
    [
        [[1, 0], [1, _K], [_K, 1], [0, 1]],
        [[0, 1], [-_K, 1], [-1, _K], [-1, 0]],
        [[-1, 0], [-1, -_K], [-_K, -1], [0, -1]],
        [[0, -1], [_K, -1], [1, -_K], [1, 0]],
    ]
)


def ring(radius: float, *, standing: bool = False) -> Floats:
    """Four Bézier segments (4, 4, 3): a circle to 0.03 %, lying or standing."""
    flat = radius * np.concatenate([_RING, np.zeros((4, 4, 1))], axis=-1)
    return flat[..., [0, 2, 1]] if standing else flat


def looping() -> Floats:
    """A run-up, a standing loop and a run-out."""
    loop = ring(2.0, standing=True)[[3, 0, 1, 2]] + [0.0, 0.0, 2.0]
    run = np.array([[[-6.0, 0, 0], [-4, 0, 0], [-2, 0, 0], [0, 0, 0]]])
    return np.concatenate([run, loop, run + np.array([6.0, 0, 0])])


def rising_ring() -> Floats:
    points = ring(2.0)
    points[..., 2] = 0.4 * points[..., 0]
    return points


ROUTES = {
    "straight": Route.poly([[0, 0, 0], [0, -4, 0]]),
    "S": Route.bezier([[[0, 0, 0], [0, -3, 0], [3, -1, 0], [3, -5, 0]]]),
    "S in space": Route.bezier([[[0, 0, 0], [0, -3, 1], [3, -1, 2], [3, -5, 1]]]),
    "ring": Route.bezier(ring(2.0), cyclic=True),
    "rising ring": Route.bezier(rising_ring(), cyclic=True),
    "standing ring": Route.bezier(ring(2.0, standing=True), cyclic=True),
    "small standing ring": Route.bezier(ring(0.3, standing=True), cyclic=True),
    "loop": Route.bezier(looping()),
    "climb": Route.bezier([[[0, 0, 0], [0, 0, 2], [0, 0, 3], [1, 1, 4]]]),
    "step": Route.poly([[0, 0, 0], [2, 0, 0], [2, 0, 3], [4, 0, 3]]),
    "straight up": Route.poly([[0, 0, 0], [0, 0, 3]]),
    "straight down": Route.poly([[0, 0, 3], [0, 0, 0]]),
    "square": Route.poly([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], cyclic=True),
    "there and back": Route.poly([[0, 0, 0], [2, 0, 0], [0, 0, 0]]),
    "up and down": Route.poly([[0, 0, 0], [0, 0, 2]], cyclic=True),
    "cusp": Route.bezier([[[0, 0, 0], [2, 2, 0], [0, 2, 0], [2, 0, 1]]]),
    "collapsed handles": Route.bezier([[[0, 0, 0], [0, 0, 0], [3, 1, 1], [3, 1, 1]]]),
}
CYCLIC = [name for name, route in ROUTES.items() if route.cyclic]

every_route = pytest.mark.parametrize("name", ROUTES)
every_manner = pytest.mark.parametrize("manner", MANNERS)

times = np.linspace(0.0, 1.0, 401)


@st.composite
def routes(draw: st.DrawFn) -> Route:
    """Chains of one to three Bézier segments with corners and steep parts, or poly lines."""
    segments = draw(st.integers(1, 3))
    numbers = st.floats(-3.0, 3.0, width=32)
    points = draw(hnp.arrays(np.float64, (3 * segments + 1, 3), elements=numbers))
    points[::3, 0] += 7.0 * np.arange(segments + 1)
    if draw(st.booleans()):
        return Route.poly(points, cyclic=draw(st.booleans()))
    return Route.bezier(np.stack([points[3 * k : 3 * k + 4] for k in range(segments)]))


@st.composite
def travel_settings(draw: st.DrawFn) -> TravelSettings:
    return TravelSettings(
        manner=draw(st.sampled_from(["WALK", "SWIM"])),
        speed=draw(st.sampled_from(["EVEN", "NATURAL"])),
        ease_in=draw(st.floats(0.0, 0.5)),
        ease_out=draw(st.floats(0.0, 0.5)),
        stride=draw(st.floats(0.5, 5.0)),
        heading=draw(st.sampled_from(["ALONG", "FIXED"])),
        heading_angle=draw(st.floats(-4.0, 4.0)),
        burst=draw(st.floats(0.0, 1.0)),
        stroke_phase=draw(st.floats(0.0, CYCLE)),
        look_ahead=draw(st.sampled_from([0.0, 0.5, 1.0, 2.7])),
        bank=draw(st.floats(0.0, 1.0)),
        keep_upright=draw(st.booleans()),
    )


def direction(route: Route, travel: Travel) -> Floats:
    return route.tangent(route.parameter_at(travel.distance))


def nearest_corner(name: str, distance: Floats) -> Floats:
    """Metres along the route to the next place where its direction jumps."""
    places = {
        "step": [2.0, 5.0],
        "square": [0.0, 2.0, 4.0, 6.0, 8.0],
        "there and back": [2.0],
        "up and down": [0.0, 2.0, 4.0],
        "cusp": [ROUTES["cusp"].length / 2.0],
    }
    corners = np.array(places.get(name, [-np.inf]))
    return np.abs(distance[:, None] - corners).min(axis=-1)


def largest_changes(route: Route, how: TravelSettings, frames: int) -> tuple[float, float]:
    """Largest change from frame to frame of the orientation and of the turn."""
    travel = plan_travel(route, how, np.linspace(0.0, 1.0, frames))
    turn = np.linalg.norm(np.diff(travel.turn, axis=0), axis=-1)
    rotations = travel.rotations
    return float(angle_between(rotations[1:], rotations[:-1]).max()), float(turn.max())


# --- time, distance, phase ---------------------------------------------------------------------


@every_route
@every_manner
@pytest.mark.parametrize("speed", ["EVEN", "NATURAL"])
def test_travel_starts_and_ends_exactly_at_the_ends_of_the_route(
    name: str, manner: str, speed: str
) -> None:
    route = ROUTES[name]
    travel = plan_travel(route, replace(MANNERS[manner], speed=speed), times)
    assert travel.distance[0] == 0.0
    assert travel.distance[-1] == route.length
    assert np.all(travel.positions[[0, -1]] == route.position([0.0, 1.0]))
    assert travel.phase[0] == 0.0
    assert travel.phase[-1] == pytest.approx(CYCLE * strides(route, MANNERS[manner]))
    assert np.all(np.diff(travel.distance) > 0.0)


@settings(max_examples=40)
@given(routes())
def test_even_speed_takes_equal_steps_along_the_route(route: Route) -> None:
    travel = plan_travel(route, TravelSettings(), np.linspace(0.0, 1.0, 101))
    steps = np.diff(route.distance_at(route.parameter_at(travel.distance)))
    np.testing.assert_allclose(steps, route.length / 100, rtol=1e-9)
    dense = plan_travel(route, TravelSettings(), np.linspace(0.0, 1.0, 10001)).positions
    walked = np.linalg.norm(np.diff(dense, axis=0), axis=-1).reshape(100, 100).sum(axis=-1)
    np.testing.assert_allclose(walked, route.length / 100, atol=1e-3 * route.length)


def test_natural_speed_is_the_papers_parameter_linear_in_time() -> None:
    route = ROUTES["S in space"]
    travel = plan_travel(route, TravelSettings(speed="NATURAL"), times)
    np.testing.assert_allclose(travel.positions, route.position(times), atol=1e-12)


def test_easing_speeds_up_and_slows_down_smoothly_over_its_share_of_the_time() -> None:
    route = ROUTES["straight"]
    at = np.linspace(0.0, 1.0, 10001)
    travel = plan_travel(route, TravelSettings(ease_in=0.3, ease_out=0.2), at)
    speed = np.gradient(travel.distance, at)
    cruise = route.length / (1.0 - 0.5 * (0.3 + 0.2))
    inside = (at > 0.301) & (at < 0.799)
    np.testing.assert_allclose(speed[inside], cruise, rtol=1e-9)
    assert speed[0] < 1e-3 * cruise
    assert speed[-1] < 1e-3 * cruise
    # The acceleration has no jump either: it stays near zero at both ends of a ramp.
    acceleration = np.gradient(speed, at)
    corners = np.searchsorted(at, [0.001, 0.299, 0.301, 0.799, 0.801, 0.999])
    assert np.all(np.abs(acceleration[corners]) < 0.03 * np.abs(acceleration).max())


@pytest.mark.parametrize(("ease_in", "ease_out"), [(0, 0), (1, 0), (0, 1), (0.5, 0.5), (0.2, 0.3)])
def test_easing_fills_the_time_however_it_is_split(ease_in: float, ease_out: float) -> None:
    how = TravelSettings(ease_in=ease_in, ease_out=ease_out)
    travel = plan_travel(ROUTES["straight"], how, [0.0, 1e-9, 1.0 - 1e-9, 1.0])
    np.testing.assert_allclose(travel.distance, [0.0, 0.0, 4.0, 4.0], atol=1e-7)


@every_route
def test_a_walks_phase_turns_once_per_stride_at_any_speed(name: str) -> None:
    for speed in ("EVEN", "NATURAL"):
        travel = plan_travel(ROUTES[name], replace(WALK, speed=speed), times)
        np.testing.assert_allclose(travel.phase, CYCLE * travel.distance / 0.8, atol=1e-9)


@pytest.mark.parametrize("burst", [0.0, 0.3, 0.6, 1.0])
def test_each_whole_stroke_of_a_swim_covers_exactly_one_stride(burst: float) -> None:
    how = replace(SWIM, burst=burst)
    travel = plan_travel(ROUTES["loop"], how, np.linspace(0.0, 1.0, 20001))
    whole = np.arange(1, int(strides(ROUTES["loop"], how)))
    np.testing.assert_allclose(
        np.interp(CYCLE * whole, travel.phase, travel.distance), 0.8 * whole, atol=1e-5
    )


def stroke_speed(phase: Floats, burst: float, stroke_phase: float) -> Floats:
    """Derivative of a stroke's distance by the phase, mean 1."""
    return (1.0 - burst) + burst * module._speed(phase - stroke_phase)


@pytest.mark.parametrize("stroke_phase", [0.0, 0.75 * np.pi, 5.0])
@pytest.mark.parametrize("burst", [0.25, 1.0])
def test_a_stroke_bursts_and_glides(burst: float, stroke_phase: float) -> None:
    phase = np.linspace(0.0, CYCLE, 20001)
    distance = stroke_distance(phase, burst, stroke_phase)
    speed = stroke_speed(phase, burst, stroke_phase)
    np.testing.assert_allclose(np.gradient(distance, phase)[1:-1], speed[1:-1], atol=1e-6)
    assert np.all(speed > 0.0)
    np.testing.assert_allclose(distance[[0, -1]], [0.0, CYCLE], atol=1e-12)
    # Smooth: neither speed nor its slope jumps.
    assert np.abs(np.diff(speed)).max() < 20.0 * phase[1]
    assert np.abs(np.diff(speed, n=2)).max() < 100.0 * phase[1] ** 2
    # The burst falls into the power stroke, a quarter of the cycle around its middle.
    peak = (phase[np.argmax(speed)] - stroke_phase + np.pi) % CYCLE - np.pi
    assert 0.0 < peak < 0.25 * np.pi
    # The glide fades like a body in water, each quarter cycle by the same factor.
    after = stroke_phase + 0.25 * np.pi + np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.25]) * np.pi
    fading = stroke_speed(after, burst, stroke_phase) - (1.0 - burst)
    np.testing.assert_allclose(fading[1:] / fading[:-1], np.exp(-0.25 * np.pi), rtol=1e-9)
    assert speed.min() < 1.0 - 0.95 * burst


def test_no_burst_is_a_steady_swim() -> None:
    travel = plan_travel(ROUTES["S"], TravelSettings(manner="SWIM", burst=0.0), times)
    np.testing.assert_allclose(travel.distance, times * ROUTES["S"].length, atol=1e-12)


@given(st.floats(0.0, 200.0), st.floats(0.0, 1.0), st.floats(0.0, CYCLE))
def test_the_phase_of_a_distance_is_the_inverse_of_the_stroke(
    distance: float, burst: float, stroke_phase: float
) -> None:
    phase = phase_at_distance(distance, burst, stroke_phase)
    assert stroke_distance(phase, burst, stroke_phase) == pytest.approx(distance, abs=1e-10)


def test_duration_counts_the_slower_ends() -> None:
    route = ROUTES["straight"]
    assert duration(route, TravelSettings(), 2.0) == pytest.approx(2.0)
    eased = TravelSettings(ease_in=0.25, ease_out=0.25)
    seconds = duration(route, eased, 2.0)
    assert seconds == pytest.approx(2.0 / 0.75)
    middle = plan_travel(route, eased, [0.5, 0.5 + 0.01 / seconds])
    assert np.diff(middle.distance)[0] == pytest.approx(2.0 * 0.01)
    with pytest.raises(SettingsError, match="speed"):
        duration(route, eased, 0.0)
    with pytest.raises(SettingsError, match="speed"):
        duration(route, eased, float("nan"))


def test_strides_count_the_gait_cycles() -> None:
    assert strides(ROUTES["straight"], TravelSettings(stride=0.5)) == pytest.approx(8.0)
    swim = TravelSettings(manner="SWIM", stride=0.5, burst=1.0)
    assert strides(ROUTES["straight"], swim) == pytest.approx(8.0)
    odd = strides(ROUTES["straight"], replace(swim, stride=0.7))
    assert abs(odd - 4.0 / 0.7) < 1.0


# --- a frame is its time and nothing else ------------------------------------------------------


@settings(max_examples=15)
@given(routes(), travel_settings(), st.randoms(use_true_random=False))
def test_a_frame_depends_on_nothing_but_its_time(
    route: Route, how: TravelSettings, random: Random
) -> None:
    order = list(range(23))
    random.shuffle(order)
    at = np.linspace(0.0, 1.0, 23)
    together, shuffled = plan_travel(route, how, at), plan_travel(route, how, at[order])
    for field in ("distance", "phase", "positions", "rotations", "turn"):
        expected = getattr(together, field)
        assert np.all(getattr(shuffled, field) == expected[order]), field
        for frame in (0, 5, 22):
            alone = getattr(plan_travel(route, how, at[frame : frame + 1]), field)
            assert np.all(alone[0] == expected[frame]), field


def test_no_frames_give_no_frames() -> None:
    travel = plan_travel(ROUTES["S"], SWIM, [])
    assert travel.positions.shape == (0, 3)
    assert travel.rotations.shape == (0, 4)
    assert travel.turn.shape == (0, 2)


def test_times_beyond_the_ends_hold_them() -> None:
    travel = plan_travel(ROUTES["S"], WALK, [-1.0, 0.0, 1.0, 2.0])
    assert np.all(travel.rotations[0] == travel.rotations[1])
    assert np.all(travel.positions[2] == travel.positions[3])


# --- which way the body faces ------------------------------------------------------------------


@pytest.mark.parametrize("name", ["straight", "S", "S in space", "ring", "rising ring", "step"])
def test_a_walking_body_stays_upright_and_faces_along_the_route(name: str) -> None:
    route = ROUTES[name]
    travel = plan_travel(route, WALK, times)
    np.testing.assert_allclose(rotate(travel.rotations, UP), np.tile(UP, (401, 1)), atol=1e-12)
    front, along = rotate(travel.rotations, FRONT), direction(route, travel)
    level = np.hypot(along[:, 0], along[:, 1])
    faces = np.sum(front[:, :2] * along[:, :2], axis=-1)
    assert np.all(faces > np.cos(np.radians(3.0)) * level - 1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.5, -2.0])
def test_a_walking_body_can_crawl_sideways_along_the_route(angle: float) -> None:
    ahead = plan_travel(ROUTES["S"], WALK, times)
    sideways = plan_travel(ROUTES["S"], replace(WALK, heading_angle=angle), times)
    turned = multiply(from_axis_angle(UP, angle), ahead.rotations)
    np.testing.assert_allclose(angle_between(sideways.rotations, turned), 0.0, atol=1e-7)
    np.testing.assert_allclose(sideways.positions, ahead.positions)


@every_route
def test_a_fixed_heading_is_kept_all_the_way(name: str) -> None:
    how = replace(WALK, heading="FIXED", heading_angle=0.7)
    travel = plan_travel(ROUTES[name], how, times)
    expected = np.tile([np.sin(0.7), -np.cos(0.7), 0.0], (401, 1))
    np.testing.assert_allclose(rotate(travel.rotations, FRONT), expected, atol=1e-9)
    np.testing.assert_allclose(rotate(travel.rotations, UP), np.tile(UP, (401, 1)), atol=1e-9)


def test_a_tilted_walk_lies_on_the_slope_and_keeps_its_heading() -> None:
    route = ROUTES["rising ring"]
    travel = plan_travel(route, TILTED, times)
    along = direction(route, travel)
    np.testing.assert_allclose(rotate(travel.rotations, FRONT), along, atol=0.03)
    # The left side stays level, the back on top.
    assert np.abs(rotate(travel.rotations, LEFT)[:, 2]).max() < 1e-3
    assert rotate(travel.rotations, UP)[:, 2].min() > 0.9
    fixed = plan_travel(ROUTES["S"], replace(TILTED, heading="FIXED", heading_angle=0.7), times)
    expected = np.tile([np.sin(0.7), -np.cos(0.7), 0.0], (401, 1))
    np.testing.assert_allclose(rotate(fixed.rotations, FRONT), expected, atol=1e-6)


def test_a_tilted_walk_climbs_a_wall_with_its_back_to_the_room() -> None:
    travel = plan_travel(ROUTES["step"], replace(TILTED, ease_in=0, ease_out=0), [0.5])
    np.testing.assert_allclose(rotate(travel.rotations[0], FRONT), UP, atol=1e-3)
    np.testing.assert_allclose(rotate(travel.rotations[0], UP), [-1.0, 0, 0], atol=1e-3)


@every_route
def test_a_swimming_body_goes_mantle_first(name: str) -> None:
    route = ROUTES[name]
    travel = plan_travel(route, SWIM, times)
    mantle, along = rotate(travel.rotations, UP), direction(route, travel)
    off = np.degrees(np.arccos(np.clip(np.sum(mantle * along, axis=-1), -1.0, 1.0)))
    assert off[nearest_corner(name, travel.distance) > 5.0 * 0.2 * 0.8].max() < 4.0


@pytest.mark.parametrize("name", ["straight", "S", "S in space", "ring", "rising ring"])
def test_a_swimming_body_leans_back_with_its_front_up(name: str) -> None:
    travel = plan_travel(ROUTES[name], SWIM, times)
    mantle, front = rotate(travel.rotations, UP), rotate(travel.rotations, FRONT)
    np.testing.assert_allclose(rotate(travel.rotations, LEFT)[:, 2], 0.0, atol=1e-3)
    np.testing.assert_allclose(front[:, 2], np.sqrt(1.0 - mantle[:, 2] ** 2), atol=1e-5)


@pytest.mark.parametrize("lean", [60.0, 90.0])
def test_a_body_whose_mantle_lies_flat_swims_as_it_lies(lean: float) -> None:
    """Its mantle along the way, its back to the sky: it is not reared up."""
    route, angle = ROUTES["S"], np.radians(lean)
    travel = plan_travel(route, replace(SWIM, lean=angle), times)
    mantle = rotate(travel.rotations, np.array([0.0, np.sin(angle), np.cos(angle)]))
    wanted = direction(route, travel)
    assert np.all(np.sum(mantle * wanted, axis=-1) > np.cos(np.radians(1.0)))
    assert np.all(rotate(travel.rotations, UP)[:, 2] > np.sin(angle) - 0.02)
    # The arms trail behind the same way, and steer as they did.
    np.testing.assert_array_equal(travel.turn, plan_travel(route, SWIM, times).turn)


def test_a_vertical_start_already_faces_the_way_it_will_lean() -> None:
    # Up, then off towards (1, 1): it leans back over its own back, so it faces (−1, −1).
    travel = plan_travel(ROUTES["climb"], SWIM, times)
    np.testing.assert_allclose(rotate(travel.rotations[0], UP), UP, atol=1e-3)
    away = [-np.sqrt(0.5), -np.sqrt(0.5), 0.0]
    np.testing.assert_allclose(rotate(travel.rotations[0], FRONT), away, atol=0.02)
    walk = plan_travel(ROUTES["climb"], WALK, times)
    np.testing.assert_allclose(rotate(walk.rotations[0], FRONT), np.negative(away), atol=0.02)


def test_swimming_straight_up_is_the_rest_pose() -> None:
    travel = plan_travel(ROUTES["straight up"], SWIM, times)
    np.testing.assert_allclose(travel.rotations, np.tile([1.0, 0, 0, 0], (401, 1)), atol=1e-12)


def test_a_body_comes_upright_after_a_loop() -> None:
    route = ROUTES["loop"]
    swim, tilted = plan_travel(route, SWIM, times), plan_travel(route, TILTED, times)
    after = swim.distance > route.length - 1.6
    assert rotate(swim.rotations, FRONT)[after, 2].min() > 0.98
    assert rotate(tilted.rotations, UP)[tilted.distance > route.length - 1.6, 2].min() > 0.98


def test_a_small_loop_is_flown_through_without_a_roll() -> None:
    # A ring much smaller than a stride: upside down at its top, as a diver would be.
    travel = plan_travel(ROUTES["small standing ring"], replace(SWIM, stride=6.0), times)
    assert np.abs(rotate(travel.rotations, LEFT)[:, 2]).max() < 0.5


def test_banking_rolls_into_the_turn() -> None:
    # Round to the left: the front, which faces up, leans towards the middle.
    route = ROUTES["ring"]
    level, banked = plan_travel(route, SWIM, times), plan_travel(route, BANKED, times)
    inwards = -level.positions / 2.0
    lean = np.sum(rotate(banked.rotations, FRONT) * inwards, axis=-1)
    np.testing.assert_allclose(lean, np.sin(0.5 * np.arctan(0.8 / 2.0)), atol=5e-3)
    straight = plan_travel(ROUTES["straight"], BANKED, times)
    np.testing.assert_allclose(rotate(straight.rotations, FRONT), np.tile(UP, (401, 1)), atol=1e-9)


# --- turning -------------------------------------------------------------------------------------


@every_manner
@pytest.mark.parametrize("name", ["straight", "straight up", "straight down"])
def test_a_straight_route_asks_for_no_turn(name: str, manner: str) -> None:
    turn = plan_travel(ROUTES[name], MANNERS[manner], times).turn
    np.testing.assert_allclose(turn, 0.0, atol=1e-12)


@every_manner
def test_a_ring_asks_for_the_same_turn_inwards_all_round(manner: str) -> None:
    how = replace(MANNERS[manner], look_ahead=1.5)
    travel = plan_travel(ROUTES["ring"], how, times)
    flat = np.column_stack([travel.turn, np.zeros(401)])
    towards = rotate(travel.rotations, flat)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=-1), 1.5 * 0.8 / 2.0, rtol=0.01)
    inwards = -travel.positions / 2.0
    aligned = np.sum(towards * inwards, axis=-1) / np.linalg.norm(towards, axis=-1)
    assert aligned.min() > 0.999


def test_the_turn_points_to_the_goal_whatever_way_a_walker_faces() -> None:
    ahead = plan_travel(ROUTES["S"], WALK, times)
    for how in (replace(WALK, heading_angle=2.0), replace(WALK, heading="FIXED")):
        other = plan_travel(ROUTES["S"], how, times)
        world = [
            rotate(each.rotations, np.column_stack([each.turn, np.zeros(401)]))
            for each in (ahead, other)
        ]
        np.testing.assert_allclose(world[1], world[0], atol=1e-9)


def test_a_swimmer_turns_up_where_the_route_climbs() -> None:
    # Its front faces up, so a climb ahead lies towards its front, −Y.
    route = Route.bezier([[[0, 0, 0], [2, 0, 0], [4, 0, 0], [6, 0, 3]]])
    turn = plan_travel(route, SWIM, times).turn
    np.testing.assert_allclose(turn[:, 0], 0.0, atol=1e-9)
    assert turn[:, 1].max() < 1e-9
    assert turn[:, 1].min() < -0.05


def test_the_turn_is_the_angle_to_the_travel_a_look_ahead_from_here() -> None:
    route = ROUTES["S in space"]
    travel = plan_travel(route, replace(SWIM, look_ahead=2.0), times)
    now = direction(route, travel)
    goal = route.tangent(route.parameter_at(travel.distance + 1.6))
    angle = np.arccos(np.clip(np.sum(now * goal, axis=-1), -1.0, 1.0))
    np.testing.assert_allclose(np.linalg.norm(travel.turn, axis=-1), angle, atol=0.05)
    assert np.linalg.norm(travel.turn[-1]) < 1e-9


# --- no pop --------------------------------------------------------------------------------------


@every_route
@every_manner
def test_halving_the_time_step_halves_the_largest_change_per_frame(name: str, manner: str) -> None:
    coarse = largest_changes(ROUTES[name], MANNERS[manner], 2001)
    fine = largest_changes(ROUTES[name], MANNERS[manner], 4001)
    for before, after in zip(coarse, fine, strict=True):
        assert after <= 0.55 * before + 1e-7


@settings(max_examples=30)
@given(routes(), travel_settings())
def test_no_route_makes_the_body_pop(route: Route, how: TravelSettings) -> None:
    # Frames fine enough to resolve the sharpest bend of these routes.
    coarse = largest_changes(route, how, 8001)
    fine = largest_changes(route, how, 16001)
    for before, after in zip(coarse, fine, strict=True):
        assert after <= 0.6 * before + 1e-6
    rotations = plan_travel(route, how, np.linspace(0.0, 1.0, 16001)).rotations
    np.testing.assert_allclose(np.linalg.norm(rotations, axis=-1), 1.0)
    assert np.sum(rotations[1:] * rotations[:-1], axis=-1).min() > 0.5


@every_manner
@pytest.mark.parametrize("name", CYCLIC)
def test_a_closed_route_ends_as_it_starts(name: str, manner: str) -> None:
    travel = plan_travel(ROUTES[name], MANNERS[manner], times)
    np.testing.assert_allclose(travel.positions[-1], travel.positions[0], atol=1e-9)
    assert angle_between(travel.rotations[0], travel.rotations[-1]) < 1e-3
    np.testing.assert_allclose(travel.turn[-1], travel.turn[0], atol=2e-3)


# --- symmetry ------------------------------------------------------------------------------------


@settings(max_examples=40)
@given(
    st.sampled_from(sorted(set(ROUTES) - {"straight up", "straight down", "up and down"})),
    travel_settings(),
    st.floats(-4.0, 4.0),
    hnp.arrays(np.float64, 3, elements=st.floats(-9.0, 9.0)),
)
def test_turning_and_shifting_the_route_turns_and_shifts_the_travel(
    name: str, how: TravelSettings, angle: float, shift: Floats
) -> None:
    route = ROUTES[name]
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    matrix[:3, 3] = shift
    if how.heading == "FIXED":
        moved = plan_travel(
            route.transform(matrix), replace(how, heading_angle=how.heading_angle + angle), times
        )
    else:
        moved = plan_travel(route.transform(matrix), how, times)
    travel = plan_travel(route, how, times)
    expected = travel.positions @ matrix[:3, :3].T + shift
    np.testing.assert_allclose(moved.positions, expected, atol=1e-8)
    turned = multiply(from_axis_angle(UP, angle), travel.rotations)
    np.testing.assert_allclose(angle_between(moved.rotations, turned), 0.0, atol=1e-5)
    np.testing.assert_allclose(moved.turn, travel.turn, atol=1e-5)


@pytest.mark.parametrize("name", ["straight", "S", "S in space"])
def test_the_reversed_route_is_walked_the_other_way_round(name: str) -> None:
    how = replace(WALK, ease_in=0.15, ease_out=0.15)
    there, back = (
        plan_travel(ROUTES[name], how, times),
        plan_travel(ROUTES[name].reverse(), how, times),
    )
    np.testing.assert_allclose(back.positions[::-1], there.positions, atol=1e-9)
    about = multiply(there.rotations, from_axis_angle(UP, np.pi))
    assert angle_between(back.rotations[::-1], about).max() < 1e-3


# --- settings ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"stride": 0.0}, "stride"),
        ({"stride": -1.0}, "stride"),
        ({"stride": float("nan")}, "Stride is not a number"),
        ({"ease_in": 0.6, "ease_out": 0.6}, "do not fit"),
        ({"ease_in": -0.1}, "Ease In is -0.1"),
        ({"burst": 1.5}, "Burst is 1.5"),
        ({"look_ahead": -1.0}, "Look Ahead is -1"),
        ({"corner": 0.0}, "Corner is 0"),
        ({"heading_angle": float("inf")}, "Angle is not a number"),
    ],
)
def test_settings_that_make_no_sense_are_refused_with_the_reason(
    wrong: dict[str, float], says: str
) -> None:
    with pytest.raises(SettingsError, match=says):
        replace(TravelSettings(), **wrong)


def test_a_body_gets_more_time_to_stop_if_it_has_too_little() -> None:
    route = Route.poly([[0.0, 0.0, 0.0], [0.0, -4.0, 0.0]])
    hasty = TravelSettings(stride=0.8, ease_in=0.5, ease_out=0.05)
    slow = unhurried(hasty, route.length, start=0.4, end=0.8)
    assert slow.ease_in == 0.5
    assert unhurried(hasty, route.length, end=0.01) == hasty
    even = unhurried(TravelSettings(stride=0.8), route.length, start=0.4, end=0.8)
    times = np.linspace(0.0, 1.0, 4001)
    distance = plan_travel(route, even, times).distance
    speed = np.diff(distance)
    easing = speed < speed.max() * (1.0 - 1e-6)
    # As far as was asked, from the way's start and from its end.
    assert distance[np.argmin(easing)] == pytest.approx(0.4, abs=0.01)
    assert route.length - distance[-1 - np.argmin(easing[::-1])] == pytest.approx(0.8, abs=0.01)
    assert distance[-1] == route.length
    for length in (0.1, 0.5, 1.0):
        both = unhurried(TravelSettings(), length, start=1.0, end=2.0)
        assert both.ease_in + both.ease_out == pytest.approx(1.0)
