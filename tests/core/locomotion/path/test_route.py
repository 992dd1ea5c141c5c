# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's curve: what eq. 3.19–3.21 of [Octopus] say, and what holds on any curve."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from octo_motion.core.errors import RouteError
from octo_motion.core.locomotion.path.route import Route
from octo_motion.core.rotations import Floats

CONTROL_POINTS = [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [3.0, 2.0, 1.0], [4.0, 0.0, 1.0]]
S = np.linspace(0.0, 1.0, 11)

# Computed apart from this project.
POSITION = [
    [0.0, 0.0, 0.0],
    [0.328, 0.54, 0.028],
    [0.704, 0.96, 0.104],
    [1.116, 1.26, 0.216],
    [1.552, 1.44, 0.352],
    [2.0, 1.5, 0.5],
    [2.448, 1.44, 0.648],
    [2.884, 1.26, 0.784],
    [3.296, 0.96, 0.896],
    [3.672, 0.54, 0.972],
    [4.0, 0.0, 1.0],
]
VELOCITY = [
    [3.0, 6.0, 0.0],
    [3.54, 4.8, 0.54],
    [3.96, 3.6, 0.96],
    [4.26, 2.4, 1.26],
    [4.44, 1.2, 1.44],
    [4.5, 0.0, 1.5],
    [4.44, -1.2, 1.44],
    [4.26, -2.4, 1.26],
    [3.96, -3.6, 0.96],
    [3.54, -4.8, 0.54],
    [3.0, -6.0, 0.0],
]
ACCELERATION = [
    [6.0, -12.0, 6.0],
    [4.8, -12.0, 4.8],
    [3.6, -12.0, 3.6],
    [2.4, -12.0, 2.4],
    [1.2, -12.0, 1.2],
    [0.0, -12.0, 0.0],
    [-1.2, -12.0, -1.2],
    [-2.4, -12.0, -2.4],
    [-3.6, -12.0, -3.6],
    [-4.8, -12.0, -4.8],
    [-6.0, -12.0, -6.0],
]
LENGTH = 5.3906527562069115
EVEN_POSITION = [
    [0.0, 0.0, 0.0],
    [0.2732818171375253, 0.46353623660149224, 0.020156167301871964],
    [0.6146870792220771, 0.8748166175339508, 0.08307495280325423],
    [1.0251339245002993, 1.2057208807172064, 0.18952739144905695],
    [1.4949309741190278, 1.4235530320287584, 0.3335612325970062],
    [1.9999999999998535, 1.4999999999999996, 0.4999999999999512],
    [2.5050690258806907, 1.4235530320288445, 0.6664387674029031],
    [2.9748660754993796, 1.2057208807174096, 0.810472608550851],
    [3.3853129207778236, 0.8748166175340506, 0.9169250471967234],
    [3.7267181828625024, 0.4635362366014515, 0.9798438326981318],
    [4.0, 0.0, 1.0],
]

coordinates = st.floats(-4.0, 4.0, width=32)


@st.composite
def bezier_routes(draw: st.DrawFn) -> Route:
    """Chains of up to four cubic segments through points that lie apart, corners and all."""
    segments = draw(st.integers(1, 4))
    points = draw(hnp.arrays(np.float64, (3 * segments + 1, 3), elements=coordinates))
    points[::3, 0] += 20.0 * np.arange(segments + 1)
    return Route.bezier(np.stack([points[3 * k : 3 * k + 4] for k in range(segments)]))


@st.composite
def nurbs_routes(draw: st.DrawFn) -> Route:
    """Of any order and weights, over knots up to order − 1 of which may coincide."""
    order = draw(st.integers(2, 6))
    count = draw(st.integers(order, order + 5))
    points = draw(hnp.arrays(np.float64, (count, 3), elements=coordinates))
    points[:, 1] += 10.0 * np.arange(count)
    weights = draw(hnp.arrays(np.float64, count, elements=st.floats(0.25, 4.0)))
    steps = draw(hnp.arrays(np.float64, count + order - 1, elements=st.sampled_from([0.0, 1, 2])))
    steps[:: order - 1] = 1.0
    return Route.nurbs(points, weights, order, np.append(0.0, np.cumsum(steps)))


routes = st.one_of(bezier_routes(), nurbs_routes())


def de_boor_cox(points: Floats, weights: Floats, order: int, knots: Floats, u: float) -> Floats:
    """The textbook recurrence for one parameter, as an independent witness."""
    basis = [float(knots[i] <= u < knots[i + 1]) for i in range(len(knots) - 1)]
    for k in range(2, order + 1):
        for i in range(len(knots) - k):
            left, right = knots[i + k - 1] - knots[i], knots[i + k] - knots[i + 1]
            value = (u - knots[i]) / left * basis[i] if left else 0.0
            value += (knots[i + k] - u) / right * basis[i + 1] if right else 0.0
            basis[i] = value
    share = np.array(basis[: len(points)]) * weights
    return share @ points / share.sum()


def test_one_bezier_segment_is_the_papers_curve_with_true_derivatives() -> None:
    route = Route.bezier([CONTROL_POINTS])
    np.testing.assert_allclose(route.position(S), POSITION, atol=1e-9)
    np.testing.assert_allclose(route.velocity(S), VELOCITY, atol=1e-9)
    np.testing.assert_allclose(route.acceleration(S), ACCELERATION, atol=1e-9)


def test_equal_distances_along_the_papers_curve() -> None:
    route = Route.bezier([CONTROL_POINTS])
    assert route.length == pytest.approx(LENGTH, abs=1e-9)
    even = route.position(route.parameter_at(route.length * S))
    np.testing.assert_allclose(even, EVEN_POSITION, atol=1e-9)


def test_segments_take_equal_shares_of_the_parameter() -> None:
    second = [[4.0, 0.0, 1.0], [5.0, -2.0, 1.0], [9.0, 0.0, 0.0], [9.0, 9.0, 0.0]]
    route = Route.bezier([CONTROL_POINTS, second])
    np.testing.assert_allclose(route.position(0.5 * S), POSITION, atol=1e-9)
    np.testing.assert_allclose(route.velocity(0.5 * S[:-1]), 2 * np.array(VELOCITY)[:-1])
    np.testing.assert_allclose(route.acceleration(0.5 * S[:-1]), 4 * np.array(ACCELERATION)[:-1])
    np.testing.assert_allclose(route.position([0.5, 1.0]), [second[0], second[3]])


def test_a_poly_line_is_straight_between_its_points_and_closes_when_cyclic() -> None:
    corners = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 4.0, 0.0]]
    line = Route.poly(corners)
    assert line.length == pytest.approx(7.0)
    np.testing.assert_allclose(
        line.position(line.parameter_at([1.5, 5.0])), [[1.5, 0, 0], [3, 2, 0]]
    )
    triangle = Route.poly(corners, cyclic=True)
    assert triangle.length == pytest.approx(12.0)
    np.testing.assert_allclose(triangle.position(1.0), corners[0])
    assert Route.poly([*corners, corners[0]], cyclic=True).length == pytest.approx(12.0)


def test_a_rational_quadratic_is_an_exact_circle() -> None:
    corners = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]
    points = np.column_stack([corners, np.zeros(9)])
    weights = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    circle = Route.nurbs(points, weights, 3, knots, cyclic=True)
    s = np.linspace(0, 1, 101)
    np.testing.assert_allclose(np.linalg.norm(circle.position(s), axis=-1), 1.0)
    assert circle.length == pytest.approx(2 * np.pi, abs=1e-12)
    quarter = circle.position(circle.parameter_at(circle.length * np.array([0.125, 0.25])))
    np.testing.assert_allclose(quarter, [[np.sqrt(0.5), np.sqrt(0.5), 0], [0, 1, 0]], atol=1e-12)


@pytest.mark.parametrize("order", [2, 3, 4, 5, 6])
def test_a_nurbs_route_agrees_with_the_textbook_recurrence(order: int) -> None:
    random = np.random.default_rng(order)
    points, weights = random.normal(size=(9, 3)), random.uniform(0.3, 3.0, 9)
    steps = random.integers(0, 3, 9 + order).astype(float)
    steps[:: order - 1] = 1.0
    knots = np.cumsum(steps)
    route = Route.nurbs(points, weights, order, knots)
    start, end = knots[order - 1], knots[9]
    for s in np.linspace(0.0, 0.999, 23):
        expected = de_boor_cox(points, weights, order, knots, start + s * (end - start))
        np.testing.assert_allclose(route.position(s), expected, atol=1e-9)


@settings(max_examples=40)
@given(routes)
def test_distance_grows_along_the_route_and_has_an_inverse(route: Route) -> None:
    s = np.linspace(0.0, 1.0, 65)
    distance = route.distance_at(s)
    assert np.all(np.diff(distance) > 0.0)
    assert distance[0] == 0.0
    assert distance[-1] == pytest.approx(route.length, rel=1e-12)
    # Where a curve all but stands still, many parameters have the same distance.
    slowest = np.linalg.norm(route.velocity(s), axis=-1).min()
    np.testing.assert_allclose(
        route.parameter_at(distance), s, atol=1e-12 * (1.0 + route.length / max(slowest, 1e-9))
    )
    even = np.linspace(0.0, route.length, 65)
    np.testing.assert_allclose(
        route.distance_at(route.parameter_at(even)), even, atol=1e-12 * route.length
    )


@settings(max_examples=40)
@given(routes)
def test_distance_is_the_length_of_a_fine_polygon(route: Route) -> None:
    # With the breaks among its corners, where a curve may turn back.
    points = route.position(np.union1d(np.linspace(0.0, 1.0, 4001), route.breaks))
    polygon = np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()
    assert route.length == pytest.approx(polygon, rel=1e-4)


@settings(max_examples=40)
@given(routes)
def test_derivatives_are_those_of_the_position(route: Route) -> None:
    # Within spans: at a knot or a joint the derivatives may jump.
    inside = 0.5 * (route.breaks[1:] + route.breaks[:-1])
    h = 1e-5 * np.min(np.diff(route.breaks))
    before, after = route.position(inside - h), route.position(inside + h)
    velocity, acceleration = route.velocity(inside), route.acceleration(inside)
    scale = np.max(np.abs(route.controls[..., :3])) / (1e5 * h) ** 2
    np.testing.assert_allclose((after - before) / (2 * h), velocity, atol=1e-6 * scale)
    second = (route.velocity(inside + h) - route.velocity(inside - h)) / (2 * h)
    np.testing.assert_allclose(second, acceleration, atol=1e-5 * scale)


@settings(max_examples=40)
@given(routes)
def test_the_reverse_is_the_same_curve_from_its_other_end(route: Route) -> None:
    s = np.linspace(0.0, 1.0, 33)
    back = route.reverse()
    np.testing.assert_allclose(back.position(s), route.position(1.0 - s), atol=1e-9)
    assert back.length == pytest.approx(route.length, rel=1e-12)


@settings(max_examples=40)
@given(routes, hnp.arrays(np.float64, (3, 4), elements=coordinates))
def test_an_affine_transform_moves_the_whole_curve(route: Route, rows: Floats) -> None:
    rows = rows + 9.0 * np.eye(3, 4)
    moved = route.transform(np.vstack([rows, [0.0, 0.0, 0.0, 1.0]]))
    s = np.linspace(0.0, 1.0, 33)
    expected = route.position(s) @ rows[:, :3].T + rows[:, 3]
    np.testing.assert_allclose(moved.position(s), expected, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=40)
@given(routes)
def test_a_value_does_not_depend_on_what_else_is_asked(route: Route) -> None:
    distance = np.linspace(0.0, route.length, 31)
    together = route.parameter_at(distance)
    for index in (0, 7, 18, 30):
        assert route.parameter_at(distance[index]) == together[index]
        assert np.all(route.position(together[index]) == route.position(together)[index])
        assert np.all(route.tangent(together[index]) == route.tangent(together)[index])


@settings(max_examples=40)
@given(routes)
def test_the_tangent_is_a_unit_vector_everywhere(route: Route) -> None:
    tangent = route.tangent(np.linspace(0.0, 1.0, 65))
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=-1), 1.0)


def test_handles_collapsed_on_their_points_leave_a_direction() -> None:
    route = Route.bezier([[[0, 0, 0], [0, 0, 0], [1, 0, 1], [1, 0, 1]]])
    along = np.sqrt([0.5, 0.0, 0.5])
    assert np.all(route.velocity([0.0, 1.0]) == 0.0)
    s = [0.0, 1e-12, 1e-9, 1e-6, 0.5, 1.0]
    np.testing.assert_allclose(route.tangent(s), [along] * 6, atol=1e-9)
    even = route.position(route.parameter_at(route.length * S))
    np.testing.assert_allclose(even, S[:, None] * [1, 0, 1], atol=1e-12)


def test_the_tangent_at_a_collapsed_end_is_the_limit_of_those_nearby() -> None:
    route = Route.bezier([[[0, 0, 0], [0, 0, 0], [1, 2, 0], [3, 0, 1]]])
    near = route.tangent([1e-12, 1e-9, 1e-7, 1e-5])
    np.testing.assert_allclose(near, np.broadcast_to(route.tangent(0.0), (4, 3)), atol=1e-4)
    np.testing.assert_allclose(route.tangent(0.0), np.sqrt([0.2, 0.8, 0.0]), atol=1e-4)


def test_a_cusp_has_an_exact_length_and_a_finite_tangent() -> None:
    # Velocity 3(1 − 2s)(1 − 2s, 1): it stops and turns back half way.
    route = Route.bezier([[[0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 0]]])
    assert np.all(route.velocity(0.5) == 0.0)
    assert np.linalg.norm(route.tangent(0.5)) == pytest.approx(1.0)
    assert route.length == pytest.approx(2 * np.sqrt(2.0) - 1.0, abs=1e-12)
    even = np.linspace(0.0, route.length, 101)
    np.testing.assert_allclose(route.distance_at(route.parameter_at(even)), even, atol=1e-12)


def test_doubled_points_neither_break_nor_lengthen_a_poly_line() -> None:
    route = Route.poly([[0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]])
    assert route.length == pytest.approx(2.0)
    even = route.position(route.parameter_at([0.0, 0.5, 1.0, 1.5, 2.0]))
    expected = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1, 0.5, 0], [1, 1, 0]]
    np.testing.assert_allclose(even, expected, atol=1e-12)
    tangent = route.tangent(np.linspace(0, 1, 41))
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=-1), 1.0)


def test_parameters_and_distances_beyond_the_ends_hold_them() -> None:
    route = Route.bezier([CONTROL_POINTS])
    np.testing.assert_allclose(route.position([-1.0, 2.0]), [CONTROL_POINTS[0], CONTROL_POINTS[3]])
    assert route.parameter_at([-1.0, 99.0]).tolist() == [0.0, 1.0]


def test_shapes_follow_the_parameter() -> None:
    route = Route.bezier([CONTROL_POINTS])
    assert route.position(0.5).shape == (3,)
    assert route.tangent(np.zeros((2, 5))).shape == (2, 5, 3)
    assert route.parameter_at(np.zeros((2, 5))).shape == (2, 5)
    assert route.distance_at(np.zeros((0,))).shape == (0,)


NAN, INFINITE = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (np.zeros((0, 3)), "no points"),
        ([[1.0, 2.0, 3.0]], "1 point."),
        ([[1.0, 2.0, 3.0]] * 5, "no length"),
        ([[1.0, 0.0, 0.0], [1.0 + 1e-9, 0.0, 0.0]], "no length"),
        ([[0.0, 0.0, 0.0], [NAN, 0.0, 0.0]], "not a number"),
        ([[0.0, 0.0, 0.0], [INFINITE, 0.0, 0.0]], "not a number"),
    ],
)
def test_a_route_that_leads_nowhere_is_refused_with_the_reason(points: Floats, says: str) -> None:
    with pytest.raises(RouteError, match=says):
        Route.poly(points)
    with pytest.raises(RouteError, match=says):
        Route.poly(points, cyclic=True)


def test_bezier_routes_that_cannot_be_followed_are_refused_with_the_reason() -> None:
    with pytest.raises(RouteError, match="no Bézier segment"):
        Route.bezier(np.zeros((0, 4, 3)))
    with pytest.raises(RouteError, match="no length"):
        Route.bezier(np.ones((2, 4, 3)))
    for number in (NAN, INFINITE):
        with pytest.raises(RouteError, match="not a number"):
            Route.bezier([[[0, 0, 0], [1, 0, 0], [number, 0, 0], [3, 0, 0]]] * 2)
    with pytest.raises(RouteError, match="gap"):
        Route.bezier([CONTROL_POINTS, CONTROL_POINTS])
    with pytest.raises(RouteError, match="does not end where it starts"):
        Route.bezier([CONTROL_POINTS], cyclic=True)


def test_nurbs_routes_that_cannot_be_followed_are_refused_with_the_reason() -> None:
    points, weights = np.arange(12.0).reshape(4, 3), np.ones(4)
    with pytest.raises(RouteError, match="order 5 has 4 points"):
        Route.nurbs(points, weights, 5, np.arange(9))
    with pytest.raises(RouteError, match="not a number"):
        Route.nurbs(np.full((4, 3), INFINITE), weights, 3, np.arange(7))
    with pytest.raises(RouteError, match="weight"):
        Route.nurbs(points, [1, 0, 1, 1], 3, np.arange(7))
    with pytest.raises(RouteError, match="weight"):
        Route.nurbs(points, [1, NAN, 1, 1], 3, np.arange(7))
    for knots in (np.arange(6), -np.arange(7), np.zeros(7), [0, 0, 0, 0, 0, 1, 2]):
        with pytest.raises(RouteError, match="knots"):
            Route.nurbs(points, weights, 3, knots)
    with pytest.raises(RouteError, match="gap"):
        Route.nurbs(points, weights, 2, [0, 0, 1, 1, 2, 2])
    with pytest.raises(RouteError, match="does not end where it starts"):
        Route.nurbs(points, weights, 3, np.arange(7), cyclic=True)
