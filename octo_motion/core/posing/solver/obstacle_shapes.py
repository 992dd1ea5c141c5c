# SPDX-License-Identifier: GPL-3.0-or-later
"""What a puppet can touch: plane, box, sphere, capsule, convex hull and triangle mesh.

Every obstacle answers one question, in its own frame and for many points at once: how far is the
surface, and which way is out. Frames are the world's where an obstacle has no position of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import IDENTITY, Floats, cross, normalized
from ..puppet import Flags, Integers

_UP: Final = np.array([0.0, 0.0, 1.0])
_TINY: Final = 1e-12
_MOST_CELLS: Final = 100_000
_MOST_EACH: Final = 64
"""In so many cells, and so many for each triangle, the triangles of a mesh may lie."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle:
    """A rigid thing that stands still, or is put elsewhere; nothing pushes it back. Or the shape of
    a body that can be pushed about.

    ``closest`` is what the kinds differ in; they have no other behaviour.
    """

    position: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) of its origin, world, metres."""
    orientation: Floats = field(default_factory=IDENTITY.copy)
    """(4,)"""
    body: int = -1
    """The body whose shape it is, in place of its capsule: a box or a hull, which then goes where
    the body goes, and its own place and turn count for nothing. −1 stands in the world."""

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:
        """Signed distances ``(…)`` of points ``(…, 3)``, less than 0 inside, and the ways out.

        Distances above ``reach`` need not be right, only above it.
        """
        raise NotImplementedError

    @property
    def bounds(self) -> Floats | None:
        """(2, 3) lower and upper corner in its own frame; None for one without end."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, kw_only=True)
class Plane(Obstacle):
    """All below z = 0 of its own frame is solid."""

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:  # noqa: ARG002
        return points[..., 2], np.broadcast_to(_UP, points.shape)

    @property
    def bounds(self) -> None:
        return None


@dataclass(frozen=True, eq=False, kw_only=True)
class Sphere(Obstacle):
    """A ball about its own origin."""

    radius: float

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:  # noqa: ARG002
        return _from_core(points, self.radius)

    @property
    def bounds(self) -> Floats:
        return np.array([[-1.0] * 3, [1.0] * 3]) * self.radius


@dataclass(frozen=True, eq=False, kw_only=True)
class Capsule(Obstacle):
    """All within ``radius`` of the segment between two ends."""

    ends: Floats
    """(2, 3) in its own frame."""
    radius: float

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:  # noqa: ARG002
        start, along = self.ends[0], self.ends[1] - self.ends[0]
        length = max(float(along @ along), _TINY)
        share = np.clip((points - start) @ along / length, 0.0, 1.0)
        return _from_core(points - start - share[..., None] * along, self.radius)

    @property
    def bounds(self) -> Floats:
        return np.stack([self.ends.min(axis=0) - self.radius, self.ends.max(axis=0) + self.radius])


@dataclass(frozen=True, eq=False, kw_only=True)
class Box(Obstacle):
    """A box about its own origin."""

    half: Floats
    """(3,) half of its sizes."""

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:  # noqa: ARG002
        beyond = np.abs(points) - self.half
        outside = np.maximum(beyond, 0.0)
        distance = np.sqrt((outside * outside).sum(axis=-1))
        side = np.where(points < 0.0, -1.0, 1.0)
        # Inside, out through the nearest face; outside, away from the nearest point.
        nearest = np.arange(3) == np.argmax(beyond, axis=-1)[..., None]
        is_out = distance > 0.0
        out = np.where(is_out[..., None], outside / (distance + _TINY)[..., None], nearest)
        return np.where(is_out, distance, beyond.max(axis=-1)), out * side

    def entered(self, before: Floats, after: Floats) -> tuple[Flags, Integers]:
        """Whether straight ways (…, 3) to (…, 3) from outside lead into the box, and across which
        axis' face; none leads in from where it is not known (NaN).
        """
        way = after - before
        way = np.where(np.abs(way) < _TINY, _TINY, way)
        first, second = (-self.half - before) / way, (self.half - before) / way
        into = np.minimum(first, second)
        begins, ends = into.max(axis=-1), np.maximum(first, second).min(axis=-1)
        return (begins >= 0.0) & (begins <= 1.0) & (begins <= ends), np.argmax(into, axis=-1)

    @property
    def bounds(self) -> Floats:
        return np.stack([-self.half, self.half])


@dataclass(frozen=True, eq=False, kw_only=True)
class _Triangles(Obstacle):
    """What is bounded by triangles; those without an area are left out."""

    corners: Floats
    """(triangles, 3 corners, 3) in its own frame."""
    _normals: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        given = np.asarray(self.corners, dtype=np.float64).reshape(-1, 3, 3)
        normals = cross(given[:, 1] - given[:, 0], given[:, 2] - given[:, 0])
        flat = (normals * normals).sum(axis=-1) <= _TINY**2
        if flat.all():
            raise SettingsError(
                "An obstacle has no faces.", "Mark objects whose mesh has faces, or none of them."
            )
        object.__setattr__(self, "corners", given[~flat])
        object.__setattr__(self, "_normals", normalized(normals[~flat]))

    @property
    def normals(self) -> Floats:
        """(triangles, 3) unit."""
        return self._normals

    @property
    def bounds(self) -> Floats:
        flat = self.corners.reshape(-1, 3)
        return np.stack([flat.min(axis=0), flat.max(axis=0)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Hull(_Triangles):
    """A convex body within triangles that are turned outwards (Blender makes them)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        # Whichever way they were given: outwards is away from the middle.
        middle = self.corners.reshape(-1, 3).mean(axis=0)
        inward = ((self.corners[:, 0] - middle) * self._normals).sum(axis=-1) < 0.0
        self._normals[inward] *= -1.0

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:  # noqa: ARG002
        shape = points.shape[:-1]
        flat = points.reshape(-1, 3)
        height = ((flat[:, None] - self.corners[:, 0]) * self._normals).sum(axis=-1)
        face = np.argmax(height, axis=-1)
        depth = height[np.arange(len(flat)), face]
        normal = self._normals[face]
        out = depth > 0.0
        if out.any():
            away = flat[out][:, None] - nearest_on_triangles(flat[out][:, None], self.corners[None])
            squares = (away * away).sum(axis=-1)
            best = np.argmin(squares, axis=-1)
            away = away[np.arange(len(away)), best]
            distance = np.sqrt(squares[np.arange(len(away)), best])
            depth, normal = depth.copy(), normal.copy()
            depth[out] = distance
            touching = distance > _TINY
            normal[out] = np.where(
                touching[:, None], away / (distance + _TINY)[:, None], normal[out]
            )
        return depth.reshape(shape), normal.reshape(points.shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh(_Triangles):
    """A surface of triangles: solid behind their faces, down to ``thickness``."""

    thickness: float = 0.0
    """How deep a point may sink and still be pushed back out of the front; 0 takes the size of
    the triangles."""
    _grid: TriangleGrid = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        grid = TriangleGrid(self.corners)
        object.__setattr__(self, "_grid", grid)
        if self.thickness <= 0.0:
            object.__setattr__(self, "thickness", grid.usual)

    def _grid_within(self, reach: float) -> TriangleGrid:
        if reach > self._grid.cell:
            object.__setattr__(self, "_grid", TriangleGrid(self.corners, reach))
        return self._grid

    def closest(self, points: Floats, reach: float) -> tuple[Floats, Floats]:
        """As for all obstacles, except that a point with no triangle in reach is at +inf."""
        shape = points.shape[:-1]
        flat = points.reshape(-1, 3)
        distances = np.full(len(flat), np.inf)
        normals = np.broadcast_to(_UP, flat.shape).copy()
        which, faces = self._grid_within(reach).pairs(flat)
        if len(which):
            away = flat[which] - nearest_on_triangles(flat[which], self.corners[faces])
            distance = np.sqrt((away * away).sum(axis=-1))
            height = (away * self._normals[faces]).sum(axis=-1)
            # Nearest first; of several as near (an edge), the one that the point faces most.
            order = np.lexsort((-np.abs(height), np.round(distance, 9), which))
            first = np.ones(len(order), dtype=bool)
            first[1:] = which[order][1:] != which[order][:-1]
            best = order[first]
            far, tall, face = distance[best], height[best], faces[best]
            in_front = tall >= 0.0
            direct = in_front & (far > _TINY)
            distances[which[best]] = np.where(in_front, far, -far)
            way = np.where(in_front, 1.0, -1.0)[:, None] * away[best] / (far + _TINY)[:, None]
            normals[which[best]] = np.where(
                (direct | (~in_front & (far > _TINY)))[:, None], way, self._normals[face]
            )
            # Further behind than the thickness: it is on the other side, or inside, and left be.
            distances[distances < -self.thickness] = np.inf
        return distances.reshape(shape), normals.reshape(points.shape)


class TriangleGrid:
    """Triangles sorted into the cubes of an even grid, to find those near many points at once."""

    def __init__(self, corners: Floats, least: float = 0.0) -> None:
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._low = low.min(axis=0)
        # No more than 2²⁰ cells along an axis, so that a cell's number fits.
        finest = float((high.max(axis=0) - self._low).max()) / 2**20
        self.usual = float(max(np.median((high - low).max(axis=1)), _TINY, finest))
        """Size of the triangles."""
        self.cell = max(self.usual, least)
        first, counts = self._span(low, high)
        while counts.prod(axis=1, dtype=np.float64).sum() > _MOST_CELLS + _MOST_EACH * len(corners):
            # A few triangles are much larger than most: a floor about a detailed statue.
            self.cell *= 2.0
            first, counts = self._span(low, high)
        totals = counts.prod(axis=1)
        triangles = np.repeat(np.arange(len(corners)), totals)
        within = np.arange(totals.sum()) - np.repeat(np.cumsum(totals) - totals, totals)
        wide = counts[triangles]
        z = within % wide[:, 2]
        y = within // wide[:, 2] % wide[:, 1]
        x = within // (wide[:, 2] * wide[:, 1])
        keys = self._keys(first[triangles] + np.stack([x, y, z], axis=1))
        order = np.argsort(keys, kind="stable")
        self._triangles = triangles[order]
        self._cells, self._starts, self._counts = np.unique(
            keys[order], return_index=True, return_counts=True
        )

    def _span(self, low: Floats, high: Floats) -> tuple[Integers, Integers]:
        """(triangles, 3) the first cell of each triangle along each axis, and how many."""
        first = np.floor((low - self._low) / self.cell).astype(np.int64)
        last = np.floor((high - self._low) / self.cell).astype(np.int64)
        return first, last - first + 1

    @staticmethod
    def _keys(cells: Integers) -> Integers:
        shifted = np.clip(cells + 1, 0, 2**21 - 1)
        return (shifted[..., 0] << 42) | (shifted[..., 1] << 21) | shifted[..., 2]

    def pairs(self, points: Floats) -> tuple[Integers, Integers]:
        """(point, triangle) indices of all that may lie within a cell's width of each other."""
        base = np.floor((points - self._low) / self.cell).astype(np.int64)
        steps = np.arange(-1, 2)
        around = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        cells = base[:, None] + around
        keys = self._keys(cells)
        keys[(cells < -1).any(axis=-1)] = -1
        slot = np.searchsorted(self._cells, keys)
        slot = np.minimum(slot, len(self._cells) - 1)
        found = self._cells[slot] == keys
        which = np.broadcast_to(np.arange(len(points))[:, None], keys.shape)[found]
        starts, counts = self._starts[slot[found]], self._counts[slot[found]]
        total = int(counts.sum())
        offsets = np.arange(total) - np.repeat(np.cumsum(counts) - counts, counts)
        triangles = self._triangles[np.repeat(starts, counts) + offsets]
        which = np.repeat(which, counts)
        both = np.unique(which * (self._triangles.max() + 1) + triangles)
        return both // (self._triangles.max() + 1), both % (self._triangles.max() + 1)


def nearest_on_triangles(points: Floats, corners: Floats) -> Floats:
    """Nearest points ``(…, 3)`` of triangles ``(…, 3 corners, 3)``, broadcast.

    The foot of the perpendicular where it lies within, else the nearest of the three edges.
    """
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    normal = cross(b - a, c - a)
    square = (normal * normal).sum(axis=-1, keepdims=True)
    height = ((points - a) * normal).sum(axis=-1, keepdims=True) / (square + _TINY**2)
    foot = points - height * normal
    inside = np.ones(foot.shape[:-1], dtype=bool)
    best = np.full(foot.shape[:-1], np.inf)
    edge = foot
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        inside &= (cross(np.broadcast_to(along, foot.shape), foot - start) * normal).sum(-1) >= 0.0
        length = (along * along).sum(axis=-1) + _TINY**2
        share = np.clip(((points - start) * along).sum(axis=-1) / length, 0.0, 1.0)
        candidate = start + share[..., None] * along
        squared = ((points - candidate) ** 2).sum(axis=-1)
        nearer = squared < best
        best = np.where(nearer, squared, best)
        edge = np.where(nearer[..., None], candidate, edge)
    return np.where(inside[..., None], foot, edge)


def nearest_on_segments(first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Nearest points of segments ``(…, 2 ends, 3)``, on each; clamping after Ericson (2005)."""
    p, d = first[..., 0, :], first[..., 1, :] - first[..., 0, :]
    q, e = second[..., 0, :], second[..., 1, :] - second[..., 0, :]
    r = p - q
    dd, ee, de = (d * d).sum(-1), (e * e).sum(-1), (d * e).sum(-1)
    dr, er = (d * r).sum(-1), (e * r).sum(-1)
    determinant = dd * ee - de * de
    # Parallel: any point will do, take the middle of the first.
    skew = determinant > 1e-9 * dd * ee + _TINY**2
    s = np.where(skew, (de * er - dr * ee) / np.where(skew, determinant, 1.0), 0.5)
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((de * s + er) / np.maximum(ee, _TINY), 0.0, 1.0)
    s = np.clip((de * t - dr) / np.maximum(dd, _TINY), 0.0, 1.0)
    return p + s[..., None] * d, q + t[..., None] * e


def _from_core(away: Floats, radius: float) -> tuple[Floats, Floats]:
    """Distance and way out, from the vectors that lead away from a ball's or capsule's core."""
    length = np.sqrt((away * away).sum(axis=-1))
    out = np.where((length > _TINY)[..., None], away / (length + _TINY)[..., None], _UP)
    return length - radius, out
