# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's curve as mathematics: position, derivatives and arc length.

After [Octopus] §3.5, "setting the route", and beyond it: one cubic Bézier segment as there, or
any chain of them, poly lines and NURBS, open or closed.

Two mistakes in print are put right here. Eq. 3.18 sums a Bézier curve from i = 1; the sum starts
at 0. Eq. 3.20 and 3.21 are called velocity and acceleration but lack the factors 3 and 6 of the
derivatives of eq. 3.19; :meth:`Route.velocity` and :meth:`Route.acceleration` have them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import comb
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import RouteError
from ...phrases import phrase
from ...rotations import Floats, normalized
from ...smoothing import evened


def bezier_spans(
    points: Floats, weights: Floats, order: int, knots: Floats
) -> tuple[Floats, Floats]:
    """Cut a NURBS curve at its knots.

    The control points of a span are the values of its polar form ("blossom") at the span's two
    ends, each taken so often that the two make up the degree; the polar form is de Boor's
    algorithm with a parameter of its own at each of its steps.

    Args:
        points: (n, 3) control points.
        weights: (n,) positive weights.
        order: degree + 1, at least 2 and at most n.
        knots: (n + order,) ascending; the curve runs from knots[order − 1] to knots[n].

    Returns:
        Homogeneous control points (spans, order, 4) of the spans that are not empty, and the
        knots between them (spans + 1,).
    """
    degree = order - 1
    inner = np.arange(degree, len(points))
    inner = inner[knots[inner + 1] > knots[inner]]
    start, end = knots[inner], knots[inner + 1]
    homogeneous = np.concatenate([points * weights[:, None], weights[:, None]], axis=-1)
    # The control points that each span feels, and the knots around it.
    felt = homogeneous[inner[:, None] + np.arange(-degree, 1)]
    around = knots[inner[:, None] + np.arange(1 - degree, degree + 1)]
    spans = np.empty_like(felt)
    for corner in range(order):
        values = felt
        for step in range(1, order):
            at = end if step <= corner else start
            left, right = around[:, step - 1 : degree], around[:, degree : 2 * degree + 1 - step]
            share = ((at[:, None] - left) / (right - left))[..., None]
            values = (1.0 - share) * values[:, :-1] + share * values[:, 1:]
        spans[:, corner] = values[:, 0]
    return spans, np.append(start, end[-1:])


SHORTEST: Final = 1e-6
"""Metres. A route below it is a point."""

_AT_JOINT: Final = 1e-12
"""Share of the route's parameter within which a sample lies at a joint: far above rounding, some
1e-15, and far below the table's intervals, 3e-5 and more."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_AT_ONCE: Final = 2048
"""Places times nodes that are looked at together."""
_FIRST_PIECES: Final = 4
_DEEPEST: Final = 24
_MOST_STEPS: Final = 100
_GUESSES: Final = 32
"""Places of each piece that a search for a distance begins between: two steps of it settle the last
digit then."""

_NOWHERE: Final = "Give the curve at least two points that lie apart."


@dataclass(frozen=True, eq=False)
class Route:
    """A curve in world space, over the parameter s from 0 to 1.

    Make one with :meth:`bezier`, :meth:`poly` or :meth:`nurbs`. Every function takes s (or a
    distance) of any shape ``(…,)``, clips it to the route and works element by element: what
    comes out for one s depends on nothing else that is asked at the same time.
    """

    controls: Floats
    """(segments, degree + 1, 4) homogeneous control points (w·x, w·y, w·z, w)."""
    breaks: Floats
    """(segments + 1,) the parameters at which segments meet, from 0 to 1."""
    cyclic: bool
    """Whether the route ends where it starts, and travel goes round."""

    def __post_init__(self) -> None:
        _check_numbers(self.controls)
        _check_joints(self.controls[..., :3] / self.controls[..., 3:], self.cyclic)
        if self.length < SHORTEST:
            raise RouteError("The route has no length.", _NOWHERE)

    @classmethod
    def bezier(cls, control_points: ArrayLike, *, cyclic: bool = False) -> Route:
        """Cubic Bézier segments; each takes an equal share of the parameter.

        One segment is exactly eq. 3.19 of [Octopus].

        Args:
            control_points: (segments, 4, 3); a segment starts where the one before ends. A cyclic
                route includes the segment that leads back.
            cyclic: whether the route is closed.

        Raises:
            RouteError: fewer than one segment, a gap, a closed route that is open, no length, or
                numbers that are none.
        """
        points = np.asarray(control_points, dtype=np.float64)
        if points.ndim != 3 or points.shape[1:] != (4, 3) or len(points) == 0:
            raise RouteError("The route has no Bézier segment.", _NOWHERE)
        return cls(_homogeneous(points), _equal_breaks(len(points)), cyclic)

    @classmethod
    def poly(cls, points: ArrayLike, *, cyclic: bool = False) -> Route:
        """Straight lines through ``points`` (n, 3), and back to the first one if cyclic.

        Each line takes an equal share of the parameter.

        Raises:
            RouteError: fewer than two points, no length, or numbers that are none.
        """
        corners = _points(points)
        if cyclic and np.any(corners[0] != corners[-1]):
            corners = np.concatenate([corners, corners[:1]])
        segments = np.stack([corners[:-1], corners[1:]], axis=1)
        return cls(_homogeneous(segments), _equal_breaks(len(segments)), cyclic)

    @classmethod
    def nurbs(
        cls,
        points: ArrayLike,
        weights: ArrayLike,
        order: int,
        knots: ArrayLike,
        *,
        cyclic: bool = False,
    ) -> Route:
        """A non-uniform rational B-spline from ``knots[order − 1]`` to ``knots[n]``.

        The parameter runs evenly over the knots, so spans of equal length have equal shares.

        Args:
            points: (n, 3); a cyclic route repeats its first points at the end.
            weights: (n,) positive.
            order: degree + 1.
            knots: (n + order,) ascending.
            cyclic: whether the route is closed; its ends must meet.

        Raises:
            RouteError: too few points for the order, knots that do not ascend or are of another
                number, weights that are not positive, a gap (as many equal knots as the order),
                a closed route that is open, no length, or numbers that are none.
        """
        places = _points(points)
        sizes = np.asarray(weights, dtype=np.float64)
        values = np.asarray(knots, dtype=np.float64)
        if not 2 <= order <= len(places):
            raise RouteError(
                phrase(
                    "The NURBS route of order {order} has {count} points.",
                    order=order,
                    count=len(places),
                ),
                "Lower the order, or add points.",
            )
        if sizes.shape != (len(places),) or not np.all(sizes > 0.0):
            raise RouteError(
                "The NURBS route has a point without a positive weight.", "Set W of its points."
            )
        ascending = values.shape == (len(places) + order,) and bool(np.all(np.diff(values) >= 0.0))
        if not ascending or not values[len(places)] > values[order - 1]:
            raise RouteError("The knots of the NURBS route do not fit its points.", "Rebuild it.")
        spans, between = bezier_spans(places, sizes, order, values)
        breaks = (between - between[0]) / (between[-1] - between[0])
        return cls(spans, breaks, cyclic)

    def position(self, s: ArrayLike) -> Floats:
        """Points of the route ``(…, 3)`` at parameters ``(…,)``: eq. 3.19 for one segment."""
        return _derivatives(self.controls, self.breaks, s, 0)[0]

    def velocity(self, s: ArrayLike) -> Floats:
        """First derivative by s ``(…, 3)``: the true derivative, 3 × the printed eq. 3.20."""
        return _derivatives(self.controls, self.breaks, s, 1)[1]

    def acceleration(self, s: ArrayLike) -> Floats:
        """Second derivative by s ``(…, 3)``: the true derivative, 6 × the printed eq. 3.21."""
        return _derivatives(self.controls, self.breaks, s, 2)[2]

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit vectors along the route ``(…, 3)``.

        Where the velocity is zero (a handle that lies on its point, doubled points, a cusp) the
        direction between two points close by, just so far apart that they differ.
        """
        wanted = np.clip(np.asarray(s, dtype=np.float64), 0.0, 1.0)
        at = wanted.reshape(-1)
        along = self.velocity(at)
        still = _norm(along) <= 1e-9 * self.length
        for reach in np.geomspace(1e-6, 1.0, 13):
            if not np.any(still):
                break
            before, after = np.maximum(at[still] - reach, 0.0), np.minimum(at[still] + reach, 1.0)
            along[still] = self.position(after) - self.position(before)
            still &= _norm(along) <= 1e-10 * self.length
        return normalized(along / self.length).reshape(*wanted.shape, 3)

    @cached_property
    def length(self) -> float:
        """Metres along the route."""
        return float(self._distances[-1])

    def distance_at(self, s: ArrayLike) -> Floats:
        """Metres along the route ``(…,)`` from its start to parameters ``(…,)``."""
        at = np.clip(np.asarray(s, dtype=np.float64), 0.0, 1.0)
        piece = np.clip(np.searchsorted(self._pieces, at, "right") - 1, 0, len(self._pieces) - 2)
        return self._distances[piece] + self._arc(self._pieces[piece], at)

    def parameter_at(self, distance: ArrayLike) -> Floats:
        """The inverse of :meth:`distance_at`, to the last digits: Newton kept in by bisection."""
        wanted = np.clip(np.asarray(distance, dtype=np.float64), 0.0, self.length)
        flat = wanted.reshape(-1)
        last = len(self._distances) - 2
        piece = np.clip(np.searchsorted(self._distances, flat, "right") - 1, 0, last)
        start, low, high = self._pieces[piece], self._pieces[piece], self._pieces[piece + 1]
        missing = flat - self._distances[piece]
        s = np.clip(_looked_up(self._places, flat), low, high)
        # Each element stops on its own account, so that its last digit depends on no other.
        busy = np.arange(len(flat))
        for _ in range(_MOST_STEPS):
            arc, speed = self._measured(start[busy], s[busy])
            error = arc - missing[busy]
            low[busy] = np.where(error <= 0.0, s[busy], low[busy])
            high[busy] = np.where(error >= 0.0, s[busy], high[busy])
            step = np.divide(error, speed, out=np.full_like(error, np.inf), where=speed > 0.0)
            trial = s[busy] - step
            inside = (trial > low[busy]) & (trial < high[busy])
            trial = np.where(inside, trial, 0.5 * (low[busy] + high[busy]))
            done = (np.abs(error) <= 1e-15 * self.length) | (trial == s[busy])
            s[busy] = np.where(done, s[busy], trial)
            busy = busy[~done]
            if len(busy) == 0:
                break
        s = np.where(flat <= 0.0, 0.0, np.where(flat >= self.length, 1.0, s))
        return s.reshape(wanted.shape)

    def parameter_near(self, distance: ArrayLike) -> Floats:
        """The same to about a thousandth of a segment, which is soon found."""
        wanted = np.clip(np.asarray(distance, dtype=np.float64), 0.0, self.length)
        return np.clip(_looked_up(self._places, wanted), 0.0, 1.0)

    @cached_property
    def _places(self) -> tuple[Floats, Floats, Floats]:
        """Distances (n,), parameters there, and how much these grow with a metre."""
        steps = np.linspace(0.0, 1.0, _GUESSES, endpoint=False)
        start, width = self._pieces[:-1, None], np.diff(self._pieces)[:, None]
        at = start + width * steps
        arcs = self._arc(np.repeat(start, _GUESSES), at.ravel()).reshape(at.shape)
        parameters = np.append(at, 1.0)
        speed = _norm(self.velocity(parameters))
        slopes = np.divide(1.0, speed, out=np.zeros_like(speed), where=speed > 1e-9 * self.length)
        distances = np.append(self._distances[:-1, None] + arcs, self.length)
        return np.maximum.accumulate(distances), parameters, slopes

    @property
    def bare(self) -> Route:
        """The curve as it is, where distances count as more than they are."""
        return self

    def metres_at(self, distance: ArrayLike) -> Floats:
        """Metres ``(…,)`` along the curve as it is."""
        return np.asarray(distance, dtype=np.float64)

    def share_at(self, distance: ArrayLike) -> Floats:
        """Share ``(…,)`` of the curve that lies before a distance ``(…,)``."""
        return self.metres_at(distance) / self.bare.length

    def distance_of(self, share: float) -> float:
        """Distance at a share of the curve."""
        curve = self.bare
        return float(self.distance_at(curve.parameter_at(share * curve.length)))

    def reverse(self) -> Route:
        """The same curve travelled from its end to its start."""
        return Route(self.controls[::-1, ::-1].copy(), 1.0 - self.breaks[::-1], self.cyclic)

    def transform(self, matrix: ArrayLike) -> Route:
        """The route moved by an affine matrix (4, 4): turned, scaled, sheared, shifted."""
        affine = np.asarray(matrix, dtype=np.float64)
        moved = self.controls @ affine.T
        return Route(moved, self.breaks, self.cyclic)

    def _arc(self, start: Floats, end: Floats) -> Floats:
        return self._measured(start, end)[0]

    def _measured(self, start: Floats, end: Floats) -> tuple[Floats, Floats]:
        """Metres from parameters ``start`` to ``end``, both within one piece, by Gauss–Legendre;
        with them comes the speed at the end, by which they grow with the parameter.
        """
        shape, start, end = end.shape, start.reshape(-1), end.reshape(-1)
        half, middle = 0.5 * (end - start), 0.5 * (end + start)
        speed = self._speed_within(middle)
        # Summed node by node: a matrix product rounds differently for each number of rows.
        total, many = np.zeros_like(half), max(_AT_ONCE // max(len(half), 1), 1)
        for first in range(0, len(_NODES), many):
            nodes = _NODES[first : first + many, None]
            for weight, each in zip(_WEIGHTS[first:], speed(middle + nodes * half), strict=False):
                total += weight * each
        return (total * half).reshape(shape), speed(end).reshape(shape)

    def _speed_within(self, middle: Floats) -> Callable[[Floats], Floats]:
        """Speeds at parameters (…, n) within the segments of parameters ``middle`` (n,)."""
        if np.any(self.controls[..., 3] != 1.0):
            return lambda s: _norm(self.velocity(s))
        # Quadrature asks for little else: without weights, the derivative is a polynomial, whose
        # coefficients are gathered once for all nodes, components first: long rows are quick.
        segment, share = _segment(self.breaks, middle)
        start, hodograph = self.breaks[segment], np.diff(self.controls[..., :3], axis=1)
        degree = hodograph.shape[1] - 1
        powers = [
            (comb(degree, power) * np.diff(hodograph, power, axis=1)[segment, 0]).T
            for power in range(degree, -1, -1)
        ]
        powers = [np.ascontiguousarray(each) for each in powers]

        def speed(s: Floats) -> Floats:
            t = ((s - start) / share)[..., None, :]
            value = powers[0]
            for power in powers[1:]:
                value = t * value + power
            x, y, z = np.moveaxis(np.broadcast_to(value, (*s.shape[:-1], *value.shape[-2:])), -2, 0)
            return (degree + 1) / share * np.sqrt(x * x + y * y + z * z)

        return speed

    @cached_property
    def _pieces(self) -> Floats:
        """Parameters between which Gauss–Legendre quadrature of the speed is exact.

        Each segment is cut up until quadrature of the halves agrees with that of the whole: that
        finds cusps, where the speed has a kink.
        """
        cuts = np.linspace(0.0, 1.0, _FIRST_PIECES + 1)
        steps = np.diff(self.breaks)[:, None]
        edges = np.append((self.breaks[:-1, None] + steps * cuts[:-1]).reshape(-1), 1.0)
        start, end = edges[:-1], edges[1:]
        found, whole = [edges], self._arc(start, end)
        scale = float(np.sum(whole))
        for _ in range(_DEEPEST):
            middle, count = 0.5 * (start + end), len(start)
            start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
            halves = self._arc(start, end)
            rough = np.abs(whole - (halves[:count] + halves[count:])) > 1e-14 * scale
            if not np.any(rough):
                break
            found.append(middle[rough])
            start, end, whole = (each[np.tile(rough, 2)] for each in (start, end, halves))
        # Not by numpy.unique, which has numpy.ma imported first: 9 ms of the first motion.
        cuts = np.sort(np.concatenate(found))
        return cuts[np.append(True, cuts[1:] > cuts[:-1])]

    @cached_property
    def _distances(self) -> Floats:
        """Metres from the start of the route to each of :attr:`_pieces`."""
        arcs = self._arc(self._pieces[:-1], self._pieces[1:])
        return np.concatenate([[0.0], np.cumsum(arcs)])


def s_bend(start: ArrayLike, front: ArrayLike, reach: float) -> Floats:
    """Control points (4, 3) of a level S that suits a creature which has none yet.

    It leaves straight ahead (3,), bends to the left and back, and ends facing as it began, so that
    a walk shows a turn to either side. The reach is metres from the creature's middle to its arms'
    tips.
    """
    origin = np.asarray(start, dtype=np.float64)
    ahead = normalized(front)
    left = np.cross([0.0, 0.0, 1.0], ahead)
    return np.stack(
        [
            origin,
            origin + 5.0 * reach * ahead,
            origin + 3.0 * reach * ahead + 4.0 * reach * left,
            origin + 8.0 * reach * ahead + 4.0 * reach * left,
        ]
    )


def _derivatives(controls: Floats, breaks: Floats, s: ArrayLike, highest: int) -> list[Floats]:
    """Position and its derivatives by s up to the ``highest`` (0, 1 or 2), each ``(…, 3)``."""
    at = np.clip(np.asarray(s, dtype=np.float64), 0.0, 1.0)
    segment, share = _segment(breaks, at)
    t = ((at - breaks[segment]) / share)[..., None]
    homogeneous = _bernstein(controls, segment, t, highest)
    weight = homogeneous[0][..., 3:]
    result = [homogeneous[0][..., :3] / weight]
    if highest >= 1:
        first = homogeneous[1]
        result.append((first[..., :3] - first[..., 3:] * result[0]) / weight)
    if highest >= 2:
        first, second = homogeneous[1], homogeneous[2]
        bend = second[..., :3] - 2.0 * first[..., 3:] * result[1] - second[..., 3:] * result[0]
        result.append(bend / weight)
    # From the parameter of the segment to that of the whole route.
    return [each / share[..., None] ** power for power, each in enumerate(result)]


def _segment(breaks: Floats, s: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Which segment parameters ``(…,)`` lie in, and its share of the route's parameter."""
    last = len(breaks) - 2
    segment = np.clip(np.searchsorted(breaks, s, "right") - 1, 0, last)
    return segment, breaks[segment + 1] - breaks[segment]


def _bernstein(controls: Floats, segment: np.ndarray, t: Floats, highest: int) -> list[Floats]:
    """Bézier segments (segments, degree + 1, 4) and their derivatives, up to the highest wanted, by
    their own parameter t (…, 1), by de Casteljau.
    """
    values = [controls[segment, corner] for corner in range(controls.shape[1])]
    degree = len(values) - 1
    result: list[Floats] = []
    for level in range(degree, -1, -1):
        # With `level` + 1 points left, their differences of that order are the derivative.
        if level == 2 and highest >= 2:
            second = values[2] - 2.0 * values[1] + values[0]
            result.insert(0, degree * (degree - 1) * second)
        if level == 1 and highest >= 1:
            result.insert(0, degree * (values[1] - values[0]))
        if level == 0:
            result.insert(0, values[0])
        values = [(1.0 - t) * a + t * b for a, b in pairwise(values)]
    if degree == 1 and highest >= 2:
        result.append(np.zeros_like(result[0]))
    return result


def past_joints(samples: Floats, breaks: Floats) -> Floats:
    """Parameters ``(n,)`` of which those at a joint of the route's segments are exactly there.

    Directions jump at a corner, and a sample there has the one that follows. Rounding alone would
    choose between the two, and the same route elsewhere would turn one sample earlier or later.
    """
    joint = breaks[np.searchsorted(breaks, samples - _AT_JOINT)]
    return np.where(np.abs(samples - joint) <= _AT_JOINT, joint, samples)


def _looked_up(table: tuple[Floats, Floats, Floats], at: Floats) -> Floats:
    """Values at places (n,), by the cubics between those of a table: places (m,) that ascend,
    values there, and slopes.
    """
    places, values, slopes = table
    number = np.clip(np.searchsorted(places, at, "right") - 1, 0, len(places) - 2)
    whole = places[number + 1] - places[number]
    # A stretch without length has nothing to share out; any point of it is right.
    t = np.zeros_like(whole)
    np.divide(at - places[number], whole, out=t, where=whole > 0.0)
    rise = values[number + 1] - values[number]
    first, last = whole * slopes[number], whole * slopes[number + 1]
    bend = first + last - 2.0 * rise
    return values[number] + t * (first + t * (rise - first - bend + t * bend))


def _norm(vectors: Floats) -> Floats:
    """Lengths of 3-vectors, summed in a fixed order."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.sqrt(x * x + y * y + z * z)


def _homogeneous(points: Floats) -> Floats:
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)


def _equal_breaks(segments: int) -> Floats:
    return np.linspace(0.0, 1.0, segments + 1)


def _points(points: ArrayLike) -> Floats:
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) < 2:
        count = len(array) if array.ndim == 2 else 0
        if count == 0:
            raise RouteError("The route has no points.", _NOWHERE)
        raise RouteError(phrase("The route has {count} point.", count=count), _NOWHERE)
    _check_numbers(array)
    return array


def _check_numbers(points: Floats) -> None:
    if not np.all(np.isfinite(points)):
        raise RouteError(
            "The route has a control point whose position is not a number.",
            "Look for the point in the curve's edit mode, and at the scale of its object.",
        )


def _check_joints(segments: Floats, cyclic: bool) -> None:  # noqa: FBT001
    """Raise unless each of the segments ``(n, k, 3)`` starts where the one before ends."""
    # Control points come from single-precision data.
    near = 1e-5 * (float(np.max(np.abs(segments))) + SHORTEST)
    if np.any(np.linalg.norm(segments[1:, 0] - segments[:-1, -1], axis=-1) > near):
        raise RouteError("The route has a gap between two spans.", "Rebuild the curve.")
    if cyclic and np.linalg.norm(segments[-1, -1] - segments[0, 0]) > near:
        raise RouteError("The closed route does not end where it starts.", "Rebuild the curve.")


# --- Bends that are tighter than arms can follow --------------------------------------------------
#
# An arm that holds on stays where it is while the body turns about it. Within half a cycle it is
# left behind by half of what the body turns in one; where that is more than its neighbour is away,
# the two go through each other. An animal that turns in a small space takes short steps. So a route
# counts as longer in a tight bend than it is, by as much as it takes to turn no faster: all that
# goes by metres of the route, the rhythm of the arms and the pace of the body alike, follows from
# that one table.


_TURNED: Final = np.radians(50.0)
"""What a body turns by in a cycle of its gait at most, about. Eight arms are 45° apart, and hold on
for half a cycle. Of 18 walks and hurries along hairpins, loops and ways of random turns, arms go
through each other in none; at 60° in four, and in thirteen without a limit."""
_FROM, _WHOLLY = 0.8, 1.2
"""Shares of that from which on a route begins to count as longer, and from which on it does so by
all that it turns too fast. Where it turns by less than the first, nothing changes: at 0.5 ordinary
bends were walked more slowly, for nothing."""
_PER_STRIDE: Final = 32
"""Places of the table in a stride: twice as many change no place of the body by a thousandth of
one."""
_FEWEST: Final = 64
_MOST: Final = 16384
_EVEN: Final = 0.1
"""Strides by which what a route turns is evened out besides its corners: the pace changes as
smoothly as that."""


@dataclass(frozen=True, eq=False)
class SlowedRoute(Route):
    """A route that counts as longer in tight bends than it is; all distances are so."""

    curve: Route
    """As it is."""
    metres: Floats
    """(n,) along that, evenly from its start to its end …"""
    counted: Floats
    """(n,) … what these count as, …"""
    slower: Floats
    """(n,) … and how many times as long the route is there."""

    @property
    def bare(self) -> Route:
        """The curve as it is."""
        return self.curve

    @cached_property
    def length(self) -> float:
        """Metres that it counts as."""
        return float(self.counted[-1])

    def distance_at(self, s: ArrayLike) -> Floats:
        """Metres ``(…,)`` that the way from its start to parameters ``(…,)`` counts as."""
        metres = self.curve.distance_at(s)
        found = _looked_up((self.metres, self.counted, self.slower), metres.reshape(-1))
        return found.reshape(metres.shape)

    def parameter_at(self, distance: ArrayLike) -> Floats:
        """Parameters ``(…,)`` where it counts as so many metres ``(…,)``."""
        return self.curve.parameter_at(self.metres_at(distance))

    def parameter_near(self, distance: ArrayLike) -> Floats:
        """The same to about a thousandth of a segment."""
        return self.curve.parameter_near(self.metres_at(distance))

    def metres_at(self, distance: ArrayLike) -> Floats:
        """Metres ``(…,)`` along the curve as it is."""
        wanted = np.asarray(distance, dtype=np.float64)
        inside = np.clip(wanted, 0.0, self.length).reshape(-1)
        found = _looked_up((self.counted, self.metres, 1.0 / self.slower), inside)
        # Before and after it, metres count as what they are.
        return found.reshape(wanted.shape) + (wanted - np.clip(wanted, 0.0, self.length))

    def of_curve(self, curve: Route) -> SlowedRoute:
        """Another curve that is as long, and counts as longer in the same places."""
        return SlowedRoute(
            *(curve.controls, curve.breaks, curve.cyclic),
            *(curve, self.metres, self.counted, self.slower),
        )


def slowed_in_bends(route: Route, *, stride: float, corner: float, amount: float) -> Route:
    """The same route, on which a body that faces along it slows down in tight bends.

    It is the same one if it has none.

    Args:
        route: where to, seen from above.
        stride: metres that the body comes in a cycle of its gait.
        corner: metres before and after a sharp corner within which it turns.
        amount: 1 for as much as it takes, 0 for not at all.
    """
    route = route.bare
    count = int(np.clip(np.ceil(_PER_STRIDE * route.length / stride), _FEWEST, _MOST))
    metres = np.linspace(0.0, route.length, count + 1)
    spacing = route.length / count
    ways = route.tangent(past_joints(route.parameter_near(metres), route.breaks))
    # Seen from above: a route that rises or falls turns as much less.
    x, y = ways[:, 0], ways[:, 1]
    across, onto = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    level = np.hypot(across, onto)
    turned = np.abs(np.arctan2(across, onto)) * level
    first, last = (turned[-1], turned[0]) if route.cyclic else (turned[0], turned[-1])
    around = np.concatenate([[first], turned, [last]])
    rate = 0.5 * (around[1:] + around[:-1]) / spacing * stride / _TURNED
    # A body turns before and after a corner, fastest in the middle.
    width = np.hypot(corner, _EVEN * stride) / spacing
    rate = np.maximum(evened(rate, width, cyclic=route.cyclic), 0.0)
    if rate.max() <= _FROM:
        return route
    slower = 1.0 + amount * _beyond(rate)
    steps = 0.5 * spacing * (slower[1:] + slower[:-1])
    counted = np.concatenate([[0.0], np.cumsum(steps)])
    return SlowedRoute(
        *(route.controls, route.breaks, route.cyclic), *(route, metres, counted, slower)
    )


def _beyond(rate: Floats) -> Floats:
    """By how much rates (…,) are beyond 1, which they come to be smoothly."""
    width = _WHOLLY - _FROM
    share = np.clip((rate - _FROM) / width, 0.0, 1.0)
    # Its slope rises from 0 to 1; beyond that it goes straight on.
    return 0.5 * width * share**2 + np.maximum(rate - _WHOLLY, 0.0)
