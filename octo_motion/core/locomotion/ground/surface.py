# SPDX-License-Identifier: GPL-3.0-or-later
"""What a creature walks on: a plane, or heights over a regular grid in the world's XY plane.

However many faces a ground has, it is sampled once; after that every question is a look-up in a
table, for all frames, arms and joints at once. Heights between the samples are bilinear.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Protocol

import numpy as np

from ...content_cache import ContentCache, content_key, part_of
from ...errors import GroundError
from ...phrases import phrase
from ...rotations import Floats
from ...settings import check_settings, setting, share_setting
from ...steps import finished

_EDGE: Final = 1e-6
"""Share of a face by which it reaches beyond its edges, so that none falls between two."""
_AT_ONCE: Final = 2_000_000
"""Pairs of faces and samples that are looked at together, …"""
_FACES_AT_ONCE: Final = 32_768
"""… and faces: what comes in steps is not to take long."""
_SIDE: Final = 16
"""Samples along a side of a face that is small."""
_BLOCK: Final = 16
"""Samples: a ground's border lies at multiples of as many from the world's origin."""
_BESIDE: Final = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""Ways in which it is looked for how a ground rises."""
_MOST_SAMPLES: Final = 4_000_000
"""Samples of a ground; a longer route is sampled more coarsely."""
_KINK: Final = 1.2
"""By how much the rise per metre falls from one sample to the next where there is an edge. A step
of 0.036 arm lengths has one; bumps of 0.3 bend by a tenth of that."""
_DEEPEST: Final = 6.0
"""Radii below an edge down to which it is rounded: of a higher wall the foot is left as it is."""


_ONE: Final = 1e-4
"""Share of a sample's width within which faces are at one height."""

_HALF: Final = 0.5
"""Of the way from a sample to the next: beyond it that one is nearer."""

_single_known: Final[ContentCache[HeightField | None]] = ContentCache(3)
_extents: Final[ContentCache[tuple[Floats, Floats]]] = ContentCache(3)


@dataclass(frozen=True, eq=False)
class GroundMesh:
    """A mesh that is walked on, as it stands in the world."""

    content: bytes
    """A key of what its faces are in the world."""
    make: Callable[[], Floats]
    """What gives these, which takes a while."""
    shape: bytes = b""
    """A key of what the mesh is in its own space …"""
    world: Floats | None = None
    """… and that space (4, 4); none where that is not known."""

    @cached_property
    def triangles(self) -> Floats:
        """(triangles, 3, 3) world."""
        return self.make()

    def shift_from(self, other: GroundMesh) -> Floats | None:
        """Metres (3,) by which it stands elsewhere than another one; none if it is another one, or
        turned or scaled.
        """
        if self.content == other.content:
            return np.zeros(3)
        if self.world is None or other.world is None or self.shape != other.shape:
            return None
        apart = self.world - other.world
        return None if apart[:3, :3].any() else apart[:3, 3]


class Ground(Protocol):
    """A surface over the world's XY plane."""

    def height(self, points: Floats) -> Floats:
        """World Z (…,) of the ground at points (…, 2 or 3); Z of the points is not looked at."""
        ...

    def slope(self, points: Floats) -> Floats:
        """Rise per metre along X and Y (…, 2)."""
        ...

    def moved(self, shift: Floats) -> Ground:
        """The same elsewhere, by (3,) metres."""
        ...


def normals(ground: Ground, points: Floats) -> Floats:
    """Unit normals (…, 3) of the ground, upwards."""
    slope = ground.slope(points)
    upward = np.concatenate([-slope, np.ones((*slope.shape[:-1], 1))], axis=-1)
    return upward / np.sqrt(np.sum(upward * upward, axis=-1, keepdims=True))


@dataclass(frozen=True)
class LevelGround:
    """A level or sloping plane."""

    z: float
    """Height over the world's origin."""
    rise: tuple[float, float] = (0.0, 0.0)
    """Metres per metre along X and Y."""

    def height(self, points: Floats) -> Floats:
        """World Z (…,)."""
        if self.rise == (0.0, 0.0):
            return np.full(points.shape[:-1], self.z)
        return self.z + points[..., 0] * self.rise[0] + points[..., 1] * self.rise[1]

    def slope(self, points: Floats) -> Floats:
        """Rise (…, 2)."""
        return np.broadcast_to(np.array(self.rise), (*points.shape[:-1], 2))

    def moved(self, shift: Floats) -> LevelGround:
        """The same elsewhere, by (3,) metres."""
        return replace(self, z=self.z + float(shift[2] - np.dot(shift[:2], self.rise)))


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights over a regular grid; beyond its border the ground goes on level."""

    origin: tuple[float, float]
    """World X and Y of the first sample."""
    spacing: float
    """Metres between samples."""
    heights: Floats
    """(nx, ny) world Z, at least 2 × 2."""
    gaps: np.ndarray | None = None
    """(nx, ny) where there is nothing between what there is: no arm can lie there."""

    def is_gap(self, points: Floats) -> np.ndarray:
        """Whether points (…, 2 or 3) are over a gap."""
        if self.gaps is None:
            return np.zeros(points.shape[:-1], dtype=bool)
        (x, column), (y, row) = (self._place(points, axis) for axis in (0, 1))
        return self.gaps[column + (x > _HALF), row + (y > _HALF)]

    def height(self, points: Floats) -> Floats:
        """World Z (…,)."""
        ny = self.heights.shape[1]
        x, column = self._place(points, 0)
        y, row = self._place(points, 1)
        # The first of the four samples round each point.
        column *= ny
        column += row
        flat = self.heights.ravel()
        low, high = _along(flat, column, y), _along(flat[ny:], column, y)
        high -= low
        high *= x
        high += low
        return high

    def slope(self, points: Floats) -> Floats:
        """Rise (…, 2), taken over a sample's width to either side, so that it does not jump."""
        at = points[..., :2]
        around = self.height(at + self.spacing * _BESIDE.reshape(4, *[1] * (at.ndim - 1), 2))
        rise = around[:2] - around[2:]
        rise *= 0.5 / self.spacing
        return rise.transpose(*range(1, rise.ndim), 0)

    def moved(self, shift: Floats) -> HeightField:
        """The same elsewhere, by (3,) metres."""
        x, y, up = shift.tolist()
        place = self.origin[0] + x, self.origin[1] + y
        return replace(self, origin=place, heights=self.heights + up)

    def rounded(self, radius: float) -> HeightField:
        """The same with its edges rounded off outwards, for bones, which are straight.

        Below an edge, d metres from its wall, the ground is at most d² / 2r lower: what follows it
        cuts no edge, and comes up a step before it stands at it. Ground without edges is unchanged.
        """
        heights, around = self.heights, ((1, 0), (-1, 0), (1, 1), (-1, 1))
        beside = [_shifted(heights, *each, np.inf) for each in around]
        least = np.minimum(beside[0] + beside[1], beside[2] + beside[3])
        edges = np.where(2.0 * heights - least > _KINK * self.spacing, heights, -np.inf)
        if not np.isfinite(edges).any():
            return self
        # The wall may stand anywhere between two samples.
        result = np.max([edges, *(_shifted(edges, *each, -np.inf) for each in around)], axis=0)
        far = int(np.sqrt(2.0 * _DEEPEST) * radius / self.spacing) + 1
        # A parabola in both directions is one in each after the other.
        for axis in (0, 1):
            whole = np.full(result.shape, -np.inf)
            for step in range(-far, far + 1):
                fall = (step * self.spacing) ** 2 / (2.0 * radius)
                np.maximum(whole, _shifted(result, step, axis, -np.inf) - fall, out=whole)
            result = whole
        return HeightField(self.origin, self.spacing, np.maximum(heights, result), self.gaps)

    def _place(self, points: Floats, axis: int) -> tuple[Floats, np.ndarray]:
        """How far points are beyond the sample before them along an axis, and its number."""
        place = np.array(points[..., axis], dtype=np.float64)
        place -= self.origin[axis]
        place *= 1.0 / self.spacing
        np.maximum(place, 0.0, out=place)
        # There is a sample after it.
        np.minimum(place, math.nextafter(self.heights.shape[axis] - 1.0, 0.0), out=place)
        number = place.astype(np.intp)
        place -= number
        return place, number


def _shifted(values: Floats, step: int, axis: int, beyond: float) -> Floats:
    """Values (nx, ny) so many samples further along an axis, with others beyond the border."""
    result = np.full(values.shape, beyond)
    there, here = (slice(max(each, 0), min(each, 0) or None) for each in (step, -step))
    if axis == 0:
        result[there] = values[here]
    else:
        result[:, there] = values[:, here]
    return result


def _along(heights: Floats, first: np.ndarray, share: Floats) -> Floats:
    """Heights by a share of the way from a sample to the next."""
    low, rise = heights.take(first), heights[1:].take(first)
    rise -= low
    rise *= share
    rise += low
    return rise


def sampling_ground(
    triangles: Floats,
    path: Floats,
    needed: np.ndarray,
    *,
    reach: float,
    spacing: float,
    headroom: float,
    gap: float = 0.0,
    content: bytes | None = None,
    bare: float | None = None,
) -> Generator[None, None, HeightField]:
    """The ground that faces make along a path, in steps.

    Of several surfaces one above the other, the highest counts that is not further than the
    headroom above the path: what a creature walks on, not the roof above it. Where the samples lie
    does not depend on the path: another path over the same place finds the same ground.

    Args:
        triangles: (faces, 3, 3) corners, world.
        path: (n, 3) points along the route and beyond its ends, near each other.
        needed: (n,) under which of them there must be ground.
        reach: metres to all sides of the path that are sampled.
        spacing: metres between samples.
        headroom: metres.
        gap: metres without ground that are stepped over.
        content: a key of the faces' content, where it is known, so that they need not be looked at
            again for another path.
        bare: how high it is where there are no faces; without, as high as they are beside it.

    Raises:
        GroundError: there are no faces, or none under some point of the path.
    """
    if len(triangles) == 0:
        raise GroundError("The ground has no faces.", "Choose a mesh that has faces.")
    low, high = path[:, :2].min(axis=0) - reach, path[:, :2].max(axis=0) + reach
    spacing = max(spacing, float(np.sqrt(np.prod(high - low) / _MOST_SAMPLES)))
    block = _BLOCK * spacing
    low, high = block * np.floor(low / block), block * np.ceil(high / block)
    shape = tuple(int(each) + 1 for each in np.rint((high - low) / spacing))
    grid = HeightField((float(low[0]), float(low[1])), spacing, np.zeros((shape[0], shape[1])))
    content = content or content_key(triangles)
    key = content_key(content, grid.origin, spacing, shape)
    lowest, highest = yield from _finding_extent(triangles, grid, key)
    yield
    single = _single_known.get(key, lambda: _single(grid, lowest, highest))
    if single is not None:
        # There is nothing to choose between.
        heights = highest
    else:
        coarse = _near_path(grid, path, reach)
        heights = _beneath(triangles, grid, coarse(path[:, 2]) + headroom, lowest, highest)
    _check_below(path[needed], grid, heights, gap)
    if bare is not None:
        return HeightField(grid.origin, spacing, np.where(np.isfinite(heights), heights, bare))
    gaps = _gaps(np.isfinite(heights), math.ceil(0.5 * gap / spacing))
    if gaps is None:
        return single or HeightField(grid.origin, spacing, _filled(heights))
    filled = single.heights if single is not None else _filled(heights)
    return HeightField(grid.origin, grid.spacing, filled, gaps)


def sample_ground(
    triangles: Floats,
    path: Floats,
    needed: np.ndarray,
    *,
    reach: float,
    spacing: float,
    headroom: float,
    gap: float = 0.0,
    content: bytes | None = None,
    bare: float | None = None,
) -> HeightField:
    """The same at once."""
    sizes = {"reach": reach, "spacing": spacing, "headroom": headroom, "gap": gap}
    return finished(sampling_ground(triangles, path, needed, **sizes, content=content, bare=bare))


def _close(path: Floats, spacing: float) -> Floats:
    """Points (m, 3) of a path (n, 3), no farther apart than a spacing."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / spacing)) + 1)
    return np.stack([np.interp(at, along, each) for each in path.T], axis=1)


def _check_below(path: Floats, grid: HeightField, heights: Floats, gap: float) -> None:
    """Make sure that there is ground, of heights (nx, ny), below points (n, 3) of a path, but for
    gaps.

    Raises:
        GroundError: there is none.
    """
    if gap > 0.0:
        # How wide it is, is to be known as well as the ground is.
        path = _close(path, grid.spacing)
    missing = ~np.isfinite(heights[_nearest(grid, path)])
    left = _leaves(path, missing, gap) if np.any(missing) else None
    if left is not None:
        share = 100.0 * left / max(len(path) - 1, 1)
        raise GroundError(
            phrase("The route leaves the ground after {share:.0f} % of its length.", share=share),
            "Move the route, or make the ground larger.",
        )


def _leaves(path: Floats, missing: np.ndarray, gap: float) -> int | None:
    """The first of points (n, 3) from which on a path has no ground (n,) for longer than a gap, or
    up to its end; none if there is no such.
    """
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    edges = np.flatnonzero(np.diff(np.pad(missing.astype(np.int8), 1)))
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        ends = first == 0 or last == len(missing)
        if ends or along[last] - along[first - 1] > gap:
            return first
    return None


def _gaps(there: np.ndarray, width: int) -> np.ndarray | None:
    """Samples (nx, ny) that are not there, but between others that are, no further than so many to
    either side; none if there are none.
    """
    if width < 1 or there.all():
        return None
    padded = np.pad(there, 2 * width)
    near = _any_near(padded, width)
    closed = ~_any_near(~near, width)[2 * width : -2 * width, 2 * width : -2 * width]
    gaps = closed & ~there
    return gaps if gaps.any() else None


def _any_near(where: np.ndarray, width: int) -> np.ndarray:
    """Whether any of the samples (nx, ny) so many to all sides is one of some."""
    result = where
    for axis in (0, 1):
        sums = np.cumsum(result, axis=axis, dtype=np.int64)
        count = sums.shape[axis]
        ahead = np.take(sums, np.minimum(np.arange(count) + width, count - 1), axis=axis)
        behind = np.take(sums, np.maximum(np.arange(count) - width - 1, 0), axis=axis)
        first = np.arange(count) - width - 1 < 0
        behind = np.where(first[:, None] if axis == 0 else first, 0, behind)
        result = ahead > behind
    return result


def ground_along_path(path: Floats, *, reach: float, spacing: float, softness: float) -> Ground:
    """The ground that a route itself describes: as high as the route where that is nearest.

    Args:
        path: (n, 3) points along the route, near each other.
        reach: metres to all sides of the path that are needed.
        spacing: metres between samples.
        softness: metres over which the heights of neighbouring stretches pass into each other.
    """
    if np.ptp(path[:, 2]) <= 1e-6 * max(reach, 1e-9):
        return LevelGround(float(path[:, 2].mean()))
    low, high = path[:, :2].min(axis=0) - reach, path[:, :2].max(axis=0) + reach
    spacing = max(spacing, float(np.sqrt(np.prod(high - low) * len(path) / _MOST_SAMPLES / 4.0)))
    x, y = (
        np.arange(np.ceil((end - start) / spacing) + 2) * spacing + start
        for start, end in zip(low, high, strict=True)
    )
    heights = np.empty((len(x), len(y)))
    for column, place in enumerate(x):
        apart = (place - path[:, 0]) ** 2 + (y[:, None] - path[:, 1]) ** 2
        weight = np.exp((apart.min(axis=1, keepdims=True) - apart) * (0.5 / softness**2))
        heights[column] = weight @ path[:, 2] / weight.sum(axis=1)
    return HeightField((float(low[0]), float(low[1])), spacing, heights)


def passes_over_itself(path: Floats, apart: float, above: float) -> bool:
    """Whether some point of a path (n, 3) lies nearly over another, and well above it."""
    step = max(1, len(path) // 400)
    some = path[::step]
    level = np.linalg.norm(some[:, None, :2] - some[None, :, :2], axis=-1)
    rise = np.abs(some[:, None, 2] - some[None, :, 2])
    return bool(np.any((level < apart) & (rise > above)))


def _near_path(grid: HeightField, path: Floats, reach: float) -> Callable[[Floats], Floats]:
    """A function that spreads a value of each point of the path over the samples nearest to it."""
    factor = max(1, int(0.25 * reach / grid.spacing))
    nx, ny = (-(-each // factor) for each in grid.heights.shape)
    width = factor * grid.spacing
    x = grid.origin[0] + width * (np.arange(nx) + 0.5)
    y = grid.origin[1] + width * (np.arange(ny) + 0.5)
    nearest = np.empty((nx, ny), dtype=np.int64)
    for column, place in enumerate(x):
        apart = (place - path[:, 0]) ** 2 + (y[:, None] - path[:, 1]) ** 2
        nearest[column] = apart.argmin(axis=1)

    def spread(values: Floats) -> Floats:
        fine = np.repeat(np.repeat(values[nearest], factor, axis=0), factor, axis=1)
        return fine[: grid.heights.shape[0], : grid.heights.shape[1]]

    return spread


def _nearest(grid: HeightField, points: Floats) -> tuple[np.ndarray, np.ndarray]:
    place = np.rint((points[:, :2] - grid.origin) / grid.spacing).astype(np.int64)
    return place[:, 0], place[:, 1]


def _finding_extent(
    triangles: Floats, grid: HeightField, key: bytes
) -> Generator[None, None, tuple[Floats, Floats]]:
    """Lowest and highest of all faces at each sample (nx, ny); +∞ and −∞ where there is none. In
    steps, if they are not known by their key.
    """
    if (known := _extents.known(key)) is not None:
        return _extents.get(key, lambda: known)
    lowest, highest = np.full(grid.heights.size, np.inf), np.full(grid.heights.size, -np.inf)
    for place, z, _ in _hits(triangles, grid):
        np.minimum.at(lowest, place, z)
        np.maximum.at(highest, place, z)
        yield
    made = lowest.reshape(grid.heights.shape), highest.reshape(grid.heights.shape)
    return _extents.get(key, lambda: made)


def faces_of(triangles: Floats, ground: HeightField) -> np.ndarray:
    """Which of the faces (faces, 3, 3) that a ground is of is at each sample (nx, ny), -1 for none
    of them.
    """
    found, heights = np.full(ground.heights.size, -1), ground.heights.ravel()
    for place, z, face in _hits(triangles, ground):
        same = np.abs(z - heights[place]) <= _ONE * ground.spacing
        found[place[same]] = face[same]
    return found.reshape(ground.heights.shape)


def _single(grid: HeightField, lowest: Floats, highest: Floats) -> HeightField | None:
    """The ground, if no two faces are above each other; arguments are as found by
    :func:`_finding_extent`.
    """
    there = np.isfinite(highest)
    # Where two faces meet, both are there.
    if np.max(highest[there] - lowest[there], initial=0.0) > _ONE * grid.spacing:
        return None
    return HeightField(grid.origin, grid.spacing, _filled(np.where(there, highest, np.nan)))


def _beneath(
    triangles: Floats, grid: HeightField, ceiling: Floats, lowest: Floats, highest: Floats
) -> Floats:
    """Heights (nx, ny) of the faces at the samples; NaN where there is none.

    The highest below the ceiling; where there is none, the lowest above it.
    """
    heights = np.where(highest <= ceiling, highest, np.where(lowest > ceiling, lowest, np.nan))
    heights[~np.isfinite(heights)] = np.nan
    between = (lowest <= ceiling) & (highest > ceiling)
    if np.any(between):
        # Only where faces are on both sides does it matter which ones there are.
        below, limit = np.full(heights.size, -np.inf), ceiling.ravel()
        for place, z, _ in _hits(triangles, grid):
            low = z <= limit[place]
            np.maximum.at(below, place[low], z[low])
        heights[between] = below.reshape(heights.shape)[between]
    return heights


@dataclass(frozen=True, eq=False)
class _Faces:
    """Faces as they lie over a grid, each (faces,)."""

    number: np.ndarray
    """Which of all they are."""
    first: np.ndarray
    """Number of the first sample that may lie on it."""
    columns: np.ndarray
    """How many may, along X …"""
    rows: np.ndarray
    """… and along Y."""
    second: tuple[Floats, Floats, Floats]
    """How near the first sample is to the second corner, 1 at the corner and 0 on the side across,
    and how much nearer the next one along X and along Y is."""
    third: tuple[Floats, Floats, Floats]
    """The same of the third corner."""
    heights: tuple[Floats, Floats, Floats]
    """World Z of the first corner, and of the others above it."""


def _hits(triangles: Floats, grid: HeightField) -> Iterator[tuple[np.ndarray, Floats, np.ndarray]]:
    """Numbers of samples, heights there and numbers of faces that lie over or under them, in
    blocks.
    """
    for start in range(0, len(triangles), _FACES_AT_ONCE):
        some = triangles[start : start + _FACES_AT_ONCE]
        for samples, heights, numbers in _hits_of(some, grid):
            yield samples, heights, start + numbers


def _hits_of(
    triangles: Floats, grid: HeightField
) -> Iterator[tuple[np.ndarray, Floats, np.ndarray]]:
    """The same of some faces."""
    faces, width = _over(triangles, grid), grid.heights.shape[1]
    longest = np.maximum(faces.columns, faces.rows)
    size, done = 1, 0
    while done < _SIDE:
        # Faces of about one size together: sample after sample of all of them at once.
        size = min(2 * size, _SIDE)
        alike = np.flatnonzero((longest > done) & (longest <= size))
        many = _AT_ONCE // (size * size)
        for start in range(0, len(alike), many):
            part = part_of(faces, alike[start : start + many])
            for column, row in np.ndindex(size, size):
                over = (column < part.columns) & (row < part.rows)
                second, third = _nearness(part, slice(None), column, row)
                hit = np.flatnonzero(over & _inside(second, third))
                height = _height(part, hit, second[hit], third[hit])
                yield part.first[hit] + (column * width + row), height, part.number[hit]
        done = size
    large = np.flatnonzero(longest > _SIDE)
    counts = faces.columns[large] * faces.rows[large]
    # In blocks of about so many samples; one huge face is a block of its own.
    block = np.cumsum(counts) // _AT_ONCE
    for number in np.unique(block):
        chosen, many = large[block == number], counts[block == number]
        face = np.repeat(chosen, many)
        within = np.arange(len(face)) - np.repeat(np.cumsum(many) - many, many)
        column, row = np.divmod(within, faces.rows[face])
        second, third = _nearness(faces, face, column, row)
        hit = np.flatnonzero(_inside(second, third))
        face, place = face[hit], column[hit] * width + row[hit]
        height = _height(faces, face, second[hit], third[hit])
        yield faces.first[face] + place, height, faces.number[face]


def _over(triangles: Floats, grid: HeightField) -> _Faces:
    """The faces that may lie over some sample of a grid; none with a corner that is nowhere."""
    known = np.isfinite(triangles).all(axis=(1, 2))
    numbers = np.flatnonzero(known)
    if not known.all():
        triangles = triangles[known]
    (x0, x1, x2), (y0, y1, y2) = (
        [(triangles[:, corner, axis] - grid.origin[axis]) / grid.spacing for corner in range(3)]
        for axis in range(2)
    )
    area = (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)
    over, sides = np.abs(area) > 1e-12, []
    for one, two, three, count in zip(
        (x0, y0), (x1, y1), (x2, y2), grid.heights.shape, strict=True
    ):
        low = np.minimum(np.minimum(one, two), three)
        high = np.maximum(np.maximum(one, two), three)
        first = np.maximum(np.ceil(low - _EDGE), 0.0)
        sides.append((first, np.minimum(np.floor(high + _EDGE), count - 1.0) - first + 1.0))
        over &= sides[-1][1] > 0.0
    kept = np.flatnonzero(over)
    x0, x1, x2, y0, y1, y2, area = (each[kept] for each in (x0, x1, x2, y0, y1, y2, area))
    (column, columns), (row, rows) = ((first[kept], count[kept]) for first, count in sides)
    across = (y2 - y0) / area, (x0 - x2) / area, (y0 - y1) / area, (x1 - x0) / area
    x, y = column - x0, row - y0
    z0, z1, z2 = (triangles[kept, corner, 2] for corner in range(3))
    return _Faces(
        numbers[kept],
        (column * grid.heights.shape[1] + row).astype(np.int64),
        columns.astype(np.int64),
        rows.astype(np.int64),
        (x * across[0] + y * across[1], across[0], across[1]),
        (x * across[2] + y * across[3], across[2], across[3]),
        (z0, z1 - z0, z2 - z0),
    )


def _nearness(
    faces: _Faces,
    chosen: np.ndarray | slice,
    column: np.ndarray | int,
    row: np.ndarray | int,
) -> tuple[Floats, Floats]:
    """How near samples, so many after the first of chosen faces, are to their other corners."""
    (s, sx, sy), (t, tx, ty) = faces.second, faces.third
    return (
        s[chosen] + column * sx[chosen] + row * sy[chosen],
        t[chosen] + column * tx[chosen] + row * ty[chosen],
    )


def _inside(second: Floats, third: Floats) -> np.ndarray:
    """Whether samples lie on their faces."""
    return (np.minimum(second, third) >= -_EDGE) & (second + third <= 1.0 + _EDGE)


def _height(faces: _Faces, chosen: np.ndarray, second: Floats, third: Floats) -> Floats:
    """Heights of chosen faces at samples that are so near to their other corners."""
    first, rise, other = faces.heights
    return first[chosen] + (second * rise[chosen] + third * other[chosen])


def _filled(heights: Floats) -> Floats:
    """Heights whose gaps go on level from their borders, ring by ring."""
    padded = np.pad(heights, 1, constant_values=np.nan)
    width = padded.shape[1]
    flat = padded.ravel()
    gap = np.isnan(flat)
    border = np.ones(padded.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    gap &= ~border.ravel()
    steps = np.array([width, -width, 1, -1])
    known = np.flatnonzero(~np.isnan(flat))
    # Only what lies next to a ring that was filled can be filled next.
    while len(known):
        beside = (known[:, None] + steps).ravel()
        ring = np.unique(beside[gap[beside]])
        around = flat[ring[:, None] + steps]
        there = ~np.isnan(around)
        flat[ring] = np.where(there, around, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
        gap[ring] = False
        known = ring
    return padded[1:-1, 1:-1].copy()


# --- Arms in stance on the ground, in the world's measure, and how they are -----------------------


@dataclass(frozen=True)
class StanceSettings:
    """How arms hold on to the ground. Lengths in arm lengths, angles in radians."""

    duty: float = setting(
        "Hold",
        "Share of its cycle for which an arm holds on to the ground. More keeps more arms down at "
        "a time; less gives them longer swings",
        # At 0.55 arms of the default walk go through each other for a frame or two.
        default=0.5,
        low=0.1,
        high=0.85,
        subtype="FACTOR",
        digits=6,
    )
    planted: float = setting(
        "Planted",
        "Share of the arm, from its tip, that lies on the ground while it holds on",
        default=0.3,
        low=0.1,
        high=0.8,
        subtype="FACTOR",
    )
    stretch: float = setting(
        "Stretch",
        "How much longer an arm may get as it pushes, becoming thinner: 0.4 is 40 %. Only bones "
        "that hand their scale on aligned or not at all stretch; others bend instead",
        default=0.4,
        low=0.0,
        high=2.0,
        soft_high=1.0,
        step=5,
    )
    lift: float = setting(
        "Lift",
        "How high above the ground an arm is at least in the middle of its swing, in arm lengths",
        default=0.06,
        low=0.0,
        high=1.0,
        soft_high=0.3,
        step=1,
        precision=3,
    )
    lean: float = share_setting(
        "Lean",
        "How far the body leans with the ground: 0 stays upright, 1 follows its slope",
        default=0.7,
    )
    smoothing: float = setting(
        "Smoothing",
        "Over what length the body evens the ground out, in arm lengths. Less follows every bump",
        default=0.35,
        low=0.05,
        high=10.0,
        soft_high=2.0,
        step=5,
    )
    up: str = setting(
        "Up",
        "Which way is up for a walk on a mesh: walls, ceilings, pipes and rocks have their own",
        default="AUTO",
        items=(
            (
                "AUTO",
                "By Itself",
                "The ground's own on walls, under ceilings and around rocks, else Z, on hills too",
                0,
            ),
            ("WORLD", "World", "Z, however steep the ground is", 1),
            ("GROUND", "Ground", "The ground's own up, evened out, on hills and slopes too", 2),
        ),
    )

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True, eq=False)
class Limbs:
    """Arms that are built alike, in the world's measure."""

    arms: tuple[int, ...]
    """Their numbers among all arms of the body."""
    roots: Floats
    """(arms, 3) metres from the body's centre, in the body's frame."""
    outward: Floats
    """(arms, 4) from an arm's own frame, x outward and z up, to the body's."""
    offsets: Floats
    """(arms,) radians that each arm's phase is ahead of the body's."""
    lengths: Floats
    """(segments, arms) metres."""
    radii: Floats
    """(segments + 1, arms) metres from each joint to the skin below it."""
    aims: Floats
    """(arms, 2) radians about the arm's vertical: where the gait has the foothold, and which way
    the arm lies from there, from straight outward."""
    weights: Floats
    """(segments, 1) of the joint at each one's root: how readily it bends."""
    may_stretch: bool = False
    free: np.ndarray | None = None
    """(arms,) whether the gait keeps an arm off the ground, none if it keeps no arm off."""

    @property
    def reach(self) -> Floats:
        """(segments + 1, arms) metres along the arm to each joint."""
        return np.concatenate([0.0 * self.lengths[:1], np.cumsum(self.lengths, axis=0)])

    def touching(self, planted: float) -> int:
        """The joint that touches first, so that about a share of the arm lies beyond it."""
        return touching(self.reach[:, 0], planted)


def touching(reach: Floats, planted: float) -> int:
    """The joint of an arm, of all along it (segments + 1,), that touches first."""
    segments = len(reach) - 1
    free = int(np.argmin(np.abs(reach / reach[-1] - (1.0 - planted))))
    return int(np.clip(free, min(2, segments - 1), segments - 1))


# --- What a walk on the ground is asked for, and what it says: poses and footholds ----------------


@dataclass(frozen=True, eq=False)
class GroundedPoses:
    """Arms on the ground at some frames; joints of arms of different builds are apart."""

    rotations: Floats
    """(frames, bones, 4) unit quaternions in each bone's rest frame."""
    strains: Floats
    """(frames, bones) by how much each bone is longer than at rest, as a share."""
    misses: Floats
    """(frames, arms) distance of an arm that holds on from its foothold, in arm lengths."""
    joints: tuple[Floats, ...]
    """For each build (frames, arms, segments + 1, 3), world."""
    in_contact: tuple[np.ndarray, ...]
    """For each build (frames, arms, segments + 1): which joints rest on the ground."""
    cycles: np.ndarray
    """(frames, arms) number of the cycle that each arm is in."""
    shapes: tuple[Floats, ...]
    """For each build (segments, 3, frames, arms): the gait's own, in the arms' frames."""
    evened: tuple[Floats, ...]
    """For each build (segments, 3, frames, arms): what evening out over time has added to the arms'
    directions, world; empty where nothing was evened out."""

    def part(self, frames: slice) -> GroundedPoses:
        """Some of the frames."""
        return GroundedPoses(
            self.rotations[frames],
            self.strains[frames],
            self.misses[frames],
            tuple(each[frames] for each in self.joints),
            tuple(each[frames] for each in self.in_contact),
            self.cycles[frames],
            tuple(each[:, :, frames] for each in self.shapes),
            tuple(each[:, :, frames] for each in self.evened),
        )


@dataclass(frozen=True, eq=False)
class Raise:
    """What is asked of arms that are to be higher than they need be."""

    lift: Floats
    """(frames, arms) arm lengths, where they do not lie."""
    shapes: tuple[Floats, ...] | None = None
    """``GroundedPoses.shapes`` of the same frames, none where nobody has kept them."""
    evened: tuple[Floats, ...] = ()
    """``GroundedPoses.evened`` of the same frames."""

    @property
    def arms(self) -> list[int]:
        """Those that are raised at any frame."""
        return np.flatnonzero(np.any(self.lift > 0.0, axis=0)).tolist()


@dataclass(frozen=True, eq=False)
class Foothold:
    """One foothold, as it is shown to the artist."""

    arm: int
    cycle: int
    position: Floats
    """(3,) the joint that touches first, world."""
    heading: float
    """Radians about world Z from +X."""
    touch_down: float
    """Phase of the body, radians, at which the arm touches …"""
    lift_off: float
    """… and at which it lets go."""
    lasts: float
    """Cycles of the arm in between, which a body at rest is slow to come through."""
