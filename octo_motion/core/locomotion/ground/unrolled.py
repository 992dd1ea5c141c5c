# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground whose own up is not Z, rolled out along a route into a space in which it is.

A wall, a ceiling, a pipe or a rock is rolled out as a carpet is: at each place of the route the
space about it is turned, without slipping and without twisting about the ground's normal, so that
the normal is +Z. In that space a walk is planned as on any other ground; what is planned is rolled
up again. Where the normal is the same everywhere that is one turn, and where it is +Z, nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    continuous,
    dot,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    to_matrix,
)
from ..path import Route, SlowedRoute

_SPACING: Final = 0.15
"""Arm lengths between places at which the ground's normal is asked for."""
_SOFT: Final = 0.3
"""Arm lengths over which neighbouring places pass into each other (standard deviation) …"""
_EVEN: Final = 0.35
"""… and over which normals are evened out along the route: over an edge of 90° the ground turns on
a radius of some 0.6, more than a body is high."""
_WINDOW: Final = 2.4
"""Arm lengths of route before and after a body that its arms may be near to."""
_AROUND: Final = 2.2
"""Arm lengths to all sides of the route up to which ground is rolled out …"""
_HIGH: Final = 1.0
"""… and above and below it: what is farther is the other side."""
_FACE: Final = 0.07
"""Arm lengths of an edge of the ground at most, as it is rolled out: on a radius of 0.6 it is then
at most 0.001 off the arc."""
_PIECE: Final = 8
"""Places of the route around which faces are rolled out at a time."""
_ROUNDS: Final = 16
"""Steps to the inverse: each leaves a share of what is missing, that of a height over the radius on
which the ground bends."""
_EXACT: Final = 1e-5
"""Arm lengths at which that is good enough."""
_MISSED: Final = 2e-3
"""Arm lengths by which these may miss for a corner to count."""
_STEP: Final = 0.04
"""Arm lengths between the corners of a route that is rolled out."""
_AT_ONCE: Final = 8192
"""Points."""
_STEEP: Final = np.cos(np.radians(47.0))
"""Z of a normal from which on ground is too steep to be walked on upright: at 45° Walk holds as on
the level, at 50° arms slip by 11 % of their length, at 60° footholds are 0.12 out of reach …"""
_LONG: Final = 0.7
"""… and arm lengths of route for which it is, at least: what is less is a step. Upright, arms slip
by half their length up and down a cliff of one arm, and are a tenth of it in the ground."""
_ASIDE: Final = 3e-3
"""Arm lengths off the ground from which on a route tells on which side of it it is."""
_DOWN: Final = np.cos(np.radians(65.0))
"""Z of a sheet's normal down to which it may be a wall or an overhang, negative."""
_BOTH: Final = 2.0
"""How many times farther it is off on the side that faces do not show, at least, if it is there."""
_CLOSED: Final = 0.1
"""Share of a mesh's area that its area vectors sum up to at most, if it has an inside."""
_STRAIGHT: Final = 0.99
"""Cosine of an angle that a surface turns by where it goes on around an edge."""
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Unrolled:
    """The space about a route, and the one into which it is rolled out: the plan."""

    start: float
    """Metres along the route of the first place …"""
    spacing: float
    """… and from each to the next."""
    plan: Floats
    """(n, 3) places of the route in the plan …"""
    world: Floats
    """… and in the world (n, 3)."""
    turns: Floats
    """(n, 4) from the plan to the world, signs continuous."""
    reach: float
    """Metres that arms are long."""

    def to_world(self, points: Floats, along: Floats) -> Floats:
        """World positions (…, 3) of points of the plan (…, 3), about a body that has come so far
        along the route (…,).
        """
        found = np.empty(points.shape)
        flat, result = points.reshape(-1, 3), found.reshape(-1, 3)
        for part, turns, shifts, _ in self._blends(flat, np.broadcast_to(along, points.shape[:-1])):
            result[part] = np.einsum("nij,nj->ni", turns, flat[part]) + shifts
        return found

    def turns_at(self, points: Floats, along: Floats) -> Floats:
        """Turns (…, 4) from the plan to the world at points of the plan (…, 3)."""
        found = np.empty((*points.shape[:-1], 4))
        flat, result = points.reshape(-1, 3), found.reshape(-1, 4)
        for part, _, _, (near, weights) in self._blends(
            flat, np.broadcast_to(along, points.shape[:-1])
        ):
            result[part] = np.einsum("nk,nkc->nc", weights, self.turns[near])
        return normalized(found)

    def to_plan(self, points: Floats, along: Floats) -> tuple[Floats, Floats]:
        """Where in the plan points of the world (n, 3) are, about places so far along the route
        (n,), and by how many metres that is missed (n,).
        """
        found, missed = np.empty(points.shape), np.empty(len(points))
        for start in range(0, len(points), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            wanted, about = points[part], along[part]
            near = self._near(about)
            apart = np.sum((self.world[near] - wanted[:, None]) ** 2, axis=-1)
            first = near[np.arange(len(near)), apart.argmin(axis=1)]
            guess = rotate(conjugate(self.turns[first]), wanted - self.world[first])
            guess += self.plan[first]
            busy, off = np.arange(len(guess)), np.zeros_like(guess)
            for _ in range(_ROUNDS):
                ((_, turns, shifts, _),) = self._blends(guess[busy], about[busy])
                off[busy] = wanted[busy] - np.einsum("nij,nj->ni", turns, guess[busy]) - shifts
                guess[busy] += np.einsum("nji,nj->ni", turns, off[busy])
                busy = busy[np.linalg.norm(off[busy], axis=1) > _EXACT * self.reach]
                if not len(busy):
                    break
            found[part] = guess
            missed[part] = np.linalg.norm(off, axis=1)
        return found, missed

    def nearest(self, points: Floats, along: Floats) -> np.ndarray:
        """Numbers (n,) of the places nearest to points of the plan (n, 3), seen from above."""
        near = self._near(along)
        apart = np.sum((self.plan[near][..., :2] - points[:, None, :2]) ** 2, axis=-1)
        return near[np.arange(len(near)), apart.argmin(axis=1)]

    def _near(self, along: Floats) -> np.ndarray:
        """Numbers (n, k) of the places within the window about others."""
        half = int(_WINDOW * self.reach / self.spacing)
        middle = np.rint((along - self.start) / self.spacing).astype(np.int64)
        wide = min(2 * half + 1, len(self.plan))
        first = np.clip(middle - half, 0, len(self.plan) - wide)
        return first[:, None] + np.arange(wide)

    def _blends(
        self, points: Floats, along: Floats
    ) -> Iterator[tuple[slice, Floats, Floats, tuple[np.ndarray, Floats]]]:
        """For some of points of the plan (n, 3) at a time what leads to the world: matrices
        (some, 3, 3), to be followed by shifts (some, 3); and of which places it is made, with their
        weights (some, k) both.

        It is the same all the way up: weights fall off with the distance seen from above.
        """
        matrices = to_matrix(self.turns)
        shifts = self.world - np.einsum("nij,nj->ni", matrices, self.plan)
        both = np.concatenate([matrices.reshape(-1, 9), shifts], axis=1)
        along = along.reshape(-1)
        for start in range(0, len(points), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            near = self._near(along[part])
            away = self.plan[near][..., :2] - points[part, None, :2]
            apart = np.einsum("nkc,nkc->nk", away, away)
            apart -= apart.min(axis=1, keepdims=True)
            weights = np.exp(apart * (-0.5 / (_SOFT * self.reach) ** 2))
            weights /= weights.sum(axis=1, keepdims=True)
            mean = np.einsum("nk,nkc->nc", weights, both[near])
            yield part, mean[:, :9].reshape(-1, 3, 3), mean[:, 9:], (near, weights)

    def route(self, route: Route) -> Route:
        """The route in the plan: as long, and as fast where the curve's own parameter counts."""
        if isinstance(route, SlowedRoute):
            return route.of_curve(self.route(route.bare))
        count = int(np.clip(np.ceil(route.length / (_STEP * self.reach)), 16, 4096)) + 1
        parameter = np.linspace(0.0, 1.0, count)
        place = (route.distance_at(parameter) - self.start) / self.spacing
        first = np.clip(place.astype(np.int64), 0, len(self.plan) - 2)
        back = conjugate(normalized(self.turns[first] + self.turns[first + 1]))
        away = route.position(parameter) - self.world[first]
        corners = self.plan[first] + rotate(back, away)
        # Chords are a little shorter than what they span.
        made = Route.poly(corners)
        return Route.poly(corners[0] + route.length / made.length * (corners - corners[0]))

    def faces(self, triangles: Floats) -> tuple[Floats, np.ndarray]:
        """Faces (faces, 3, 3) of a ground in the world, cut small and rolled out into the plan, and
        which of them each comes from.

        What comes by twice, a rock that is walked around, is there twice.
        """
        found: list[Floats] = []
        sources: list[np.ndarray] = []
        cut, source = _cut(triangles, self.world, self.reach)
        corners, numbers = np.unique(cut.reshape(-1, 3), axis=0, return_inverse=True)
        numbers = numbers.reshape(-1, 3)
        for begin in range(0, len(self.plan), _PIECE):
            places = np.arange(begin, min(begin + _PIECE, len(self.plan)))
            some = self._about(corners, places)
            if not len(some):
                continue
            along = np.full(len(some), self.start + self.spacing * float(places.mean()))
            plan, missed = self.to_plan(corners[some], along)
            nearest = self.nearest(plan, along)
            good, own = np.zeros((2, len(corners)), dtype=bool)
            good[some] = missed < _MISSED * self.reach
            good[some] &= np.abs(plan[:, 2] - self.plan[nearest, 2]) < _HIGH * self.reach
            own[some] = (nearest >= places[0]) & (nearest <= places[-1])
            faces = good[numbers].all(axis=1) & own[numbers].any(axis=1)
            whole = np.zeros(corners.shape)
            whole[some] = plan
            found.append(whole[numbers[faces]])
            sources.append(source[faces])
        if not found:
            return np.empty((0, 3, 3)), np.empty(0, dtype=np.int64)
        return np.concatenate(found), np.concatenate(sources)

    def _about(self, points: Floats, places: np.ndarray) -> np.ndarray:
        """Which points of the world (n, 3) may be nearest to some of the places that follow one
        another, of those before and after them.
        """
        window = int(_WINDOW * self.reach / self.spacing)
        first = max(int(places[0]) - window, 0)
        off = np.abs(points - self.world[places].mean(axis=0))
        near = np.flatnonzero(np.all(off < 2.0 * _AROUND * self.reach, axis=1))
        if not len(near):
            return near
        apart = [
            np.sum((points[near] - each) ** 2, axis=1)
            for each in self.world[first : int(places[-1]) + window + 1]
        ]
        nearest, closest = np.argmin(apart, axis=0) + first, np.min(apart, axis=0)
        inside = (nearest >= places[0] - _PIECE) & (nearest <= places[-1] + _PIECE)
        return near[inside & (closest < (_AROUND * self.reach) ** 2)]


def roll_out(
    route: Route, triangles: Floats, *, reach: float, beyond: float, always: bool = False
) -> Unrolled | None:
    """The space about a route on a ground, rolled out; none where the ground can be walked on with
    +Z up.

    Args:
        route: on the ground.
        triangles: (faces, 3, 3) of the ground, world.
        reach: metres that arms are long.
        beyond: metres before and after the route that are walked on, too.
        always: whether the ground's normal is up, however steep it is.
    """
    route, spacing = route.bare, _SPACING * reach
    ahead = int(np.ceil((beyond + _WINDOW * reach) / spacing))
    count = int(route.length / spacing)
    distance = spacing * np.arange(-ahead, count + ahead + 1)
    low, high = (each(route.controls[..., :3], axis=(0, 1)) for each in (np.min, np.max))
    box = np.array([low, high]) + np.array([[-1.0], [1.0]]) * (beyond + 2.0 * _WINDOW * reach)
    faces = triangles[_in_box(triangles, *box)]
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    steep = normals[:, 2] < _STEEP * np.linalg.norm(normals, axis=1)
    if not len(faces) or not (always or steep.any()):
        return None
    inside = slice(ahead, ahead + count + 1)
    own = route.position(route.parameter_at(distance[inside]))
    places, up = np.empty((len(distance), 3)), np.empty((len(distance), 3))
    places[inside] = own
    found = [_normal_at(each, faces, spacing) for each in own]
    shown = np.array([each[1] for each in found])
    side = _side(own, found, triangles, reach, given=always)
    # A route that dips below a hill is still on it.
    for normal in (shown, side * shown):
        evened = _evened(normal, _EVEN / _SPACING)
        if not always and spacing * _longest(evened[:, 2] < _STEEP) < _LONG * reach:
            return None
    up[inside] = side * shown
    for steps in (range(ahead + count + 1, len(distance)), range(ahead - 1, -1, -1)):
        if route.cyclic:
            number = np.array(steps)
            lap = distance[number] % route.length
            places[number] = route.position(route.parameter_at(lap))
            up[number] = up[ahead + np.minimum(np.rint(lap / spacing).astype(int), count)]
        else:
            _go_on((places, up), steps, faces if side > 0.0 else faces[:, ::-1], spacing)
    up = _evened(up, _EVEN / _SPACING)
    turns = _carried(up, ahead)
    between = normalized(turns[:-1] + turns[1:])
    moved = np.cumsum(rotate(conjugate(between), np.diff(places, axis=0)), axis=0)
    plan = np.concatenate([np.zeros((1, 3)), moved])
    plan += places[ahead] - plan[ahead]
    return Unrolled(float(distance[0]), spacing, plan, places, turns, reach)


def _carried(up: Floats, first: int) -> Floats:
    """Turns (n, 4) that lead +Z to unit vectors (n, 3), each the least turn from the one before;
    the first of them is at the number given.
    """
    turns = np.empty((len(up), 4))
    turns[first] = multiply(shortest_arc(_UP, up[first]), IDENTITY)
    ahead, back = (shortest_arc(up[:-1], up[1:]), shortest_arc(up[1:], up[:-1]))
    for number in range(first + 1, len(up)):
        turns[number] = multiply(ahead[number - 1], turns[number - 1])
    for number in range(first - 1, -1, -1):
        turns[number] = multiply(back[number], turns[number + 1])
    return continuous(normalized(turns))


def _evened(vectors: Floats, deviation: float) -> Floats:
    """Unit vectors (n, 3) evened out over their neighbours; where nothing is left of them, as the
    one before.
    """
    half = int(np.ceil(3.0 * deviation))
    bell = np.exp(-0.5 * (np.arange(-half, half + 1) / deviation) ** 2)
    padded = np.pad(vectors, ((half, half), (0, 0)), mode="edge")
    means = np.stack([np.convolve(each, bell, mode="valid") for each in padded.T], axis=1)
    sizes = np.linalg.norm(means, axis=1)
    for number in np.flatnonzero(sizes < 0.05 * bell.sum()):
        means[number] = means[number - 1] if number else vectors[0]
    return normalized(means)


def _longest(where: np.ndarray) -> int:
    """How many in a row are true at most."""
    edges = np.flatnonzero(np.diff(np.pad(where.astype(np.int8), 1)))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _go_on(both: tuple[Floats, Floats], steps: range, faces: Floats, step: float) -> None:
    """Fill in places and normals (n, 3) beyond an end of a route, straight on over the ground."""
    places, up = both
    for number in steps:
        before = number - steps.step
        way = places[before] - places[before - steps.step]
        way = normalized(way - dot(way, up[before])[..., None] * up[before])
        straight = places[before] + step * way
        place, normal = _normal_at(straight, faces, step)
        turned = float(normal @ up[before]) < _STRAIGHT
        if float((place - places[before]) @ way) < 0.5 * step and not turned:
            # The mesh ends here.
            place, normal = straight, up[before]
        places[number], up[number] = place, normal


def _side(
    places: Floats,
    found: list[tuple[Floats, Floats]],
    triangles: Floats,
    reach: float,
    *,
    given: bool,
) -> float:
    """On which side of its faces a route is: 1 on the one that they show, −1 on the other; on
    neither, it is the first if they are given to be right.
    """
    nearest, normals = (np.array(each) for each in zip(*found, strict=True))
    off = dot(places - nearest, normals)
    if np.abs(off).max() > _ASIDE * reach:
        # What is on both cuts corners of the ground.
        return -1.0 if off.sum() < 0.0 and off.min() < -_BOTH * off.max() else 1.0
    areas = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    closed = np.linalg.norm(areas.sum(axis=0)) < _CLOSED * np.linalg.norm(areas, axis=1).sum()
    # A sheet that looks down was laid the wrong way round.
    return -1.0 if not given and not closed and normals[:, 2].mean() < -_DOWN else 1.0


def _normal_at(point: Floats, triangles: Floats, near: float) -> tuple[Floats, Floats]:
    """The point (3,) of some faces that is nearest to another, and the normal there (3,): of all
    faces that meet in it.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    away = np.maximum(np.maximum(low - point, point - high), 0.0)
    box = np.einsum("nc,nc->n", away, away)
    corner = np.sum((triangles - point) ** 2, axis=-1).min()
    some = np.flatnonzero(box <= corner * (1.0 + 1e-9))
    closest = _closest(point, triangles[some])
    apart = np.linalg.norm(closest - point, axis=1)
    best = int(apart.argmin())
    meet = some[np.linalg.norm(closest - closest[best], axis=1) < 1e-3 * near]
    one = triangles[meet]
    normals = normalized(np.cross(one[:, 1] - one[:, 0], one[:, 2] - one[:, 0]))
    mean = normals.sum(axis=0)
    size = float(np.linalg.norm(mean))
    return closest[best], mean / size if size > 0.1 else normals[0]


def _closest(point: Floats, triangles: Floats) -> Floats:
    """The points (n, 3) of triangles (n, 3, 3) that are nearest to a point (3,)."""
    first, second, third = np.moveaxis(triangles, 1, 0)
    u, v, w = second - first, third - first, point - first
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    area = np.maximum(uu * vv - uv * uv, 1e-30)
    s, t = (wu * vv - wv * uv) / area, (wv * uu - wu * uv) / area
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    best = first + s[:, None] * u + t[:, None] * v
    apart = np.where(inside, np.sum((best - point) ** 2, axis=1), np.inf)
    for start, end in ((first, second), (second, third), (third, first)):
        way = end - start
        share = np.clip(dot(point - start, way) / np.maximum(dot(way, way), 1e-30), 0.0, 1.0)
        place = start + share[:, None] * way
        off = np.sum((place - point) ** 2, axis=1)
        closer = off < apart
        best, apart = np.where(closer[:, None], place, best), np.where(closer, off, apart)
    return best


def _within(triangles: Floats, places: Floats, far: float) -> np.ndarray:
    """Which of some faces (n, 3, 3) may be that near to any of some places (m, 3)."""
    return _in_box(triangles, places.min(axis=0) - far, places.max(axis=0) + far)


def _in_box(triangles: Floats, low: Floats, high: Floats) -> np.ndarray:
    """Which of some faces (n, 3, 3) may reach into a box from low (3,) to high (3,)."""
    # Corner by corner, and axis by axis what is left: a tenth of the time of numpy's reductions.
    found = np.arange(len(triangles))
    for axis in range(3):
        first, second, third = triangles[found, :, axis].T
        most = np.maximum(np.maximum(first, second), third)
        least = np.minimum(np.minimum(first, second), third)
        found = found[(most >= low[axis]) & (least <= high[axis])]
    return found


def _cut(triangles: Floats, places: Floats, reach: float) -> tuple[Floats, np.ndarray]:
    """Faces near some places (m, 3), cut until no edge is long, and which each was a part of.

    An edge is cut in its middle as long as it is too long, whoever asks: faces that meet in it
    still meet. What is far from the route is dropped on the way.
    """
    source = _within(triangles, places, _AROUND * reach)
    faces, most = triangles[source], (_FACE * reach) ** 2
    done: list[Floats] = []
    sources: list[np.ndarray] = []
    while len(faces):
        near = np.zeros(len(faces), dtype=bool)
        for start in range(0, len(places), _PIECE):
            near[_within(faces, places[start : start + _PIECE], _AROUND * reach)] = True
        faces, source = faces[near], source[near]
        edges = np.sum((faces[:, [1, 2, 0]] - faces) ** 2, axis=-1)
        longest = edges.argmax(axis=1)
        small = edges.max(axis=1, initial=0.0) <= most
        done.append(faces[small])
        sources.append(source[small])
        row = np.flatnonzero(~small)
        one, two, three = (faces[row, (longest[row] + step) % 3] for step in range(3))
        middle = 0.5 * (one + two)
        halves = (np.stack([one, middle, three], axis=1), np.stack([middle, two, three], axis=1))
        faces, source = np.concatenate(halves), np.concatenate([source[row], source[row]])
    return np.concatenate(done), np.concatenate(sources)
