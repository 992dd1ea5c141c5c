# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces, edges and corners of two convex bodies that look at each other, cut with each other.

Seen along the axis between the bodies, what of each is nearest to the other is a convex polygon, an
edge or a point. They touch at corners of one that lie within the other, and where edges cross.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ..puppet import Integers

_NEAR: Final = 0.05
"""Of a body's size along an axis: corners that are so much further back still look along it."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Facing:
    """Corners of two bodies, (…, 3) world, and the unit axis from the second to the first."""

    first: Floats
    second: Floats
    axis: Floats


@dataclass(frozen=True, eq=False)
class _Feature:
    """The corners of a body that look at the other one, in order about their middle."""

    numbers: Integers
    points: Floats
    """(corners, 3)"""
    flat: Floats
    """(corners, 2) across the axis."""
    heights: Floats
    """(corners,) along the axis."""

    def height_at(self, flat: Floats) -> Floats:
        """(…,) of its plane at places (…, 2)."""
        middle, level = self.flat.mean(axis=0), self.heights.mean()
        slope, *_ = np.linalg.lstsq(self.flat - middle, self.heights - level, rcond=1e-6)
        return level + (flat - middle) @ slope

    def holds(self, flat: Floats, slack: float) -> np.ndarray:
        """(…,) whether places (…, 2) lie within the polygon; in an edge or a point none does."""
        if len(self.flat) < 3:
            return np.zeros(len(flat), dtype=bool)
        along = np.roll(self.flat, -1, axis=0) - self.flat
        along /= np.maximum(np.linalg.norm(along, axis=1), _TINY)[:, None]
        away = flat[:, None] - self.flat
        return (along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0] >= -slack).all(axis=1)

    def edges(self) -> tuple[Integers, Integers]:
        """Which corners follow on which."""
        count = len(self.flat)
        ends = np.arange(count) if count > 2 else np.arange(count - 1)
        return ends, (ends + 1) % max(count, 1)


def features_facing(facing: Facing, margin: float) -> tuple[Floats, Floats, Integers] | None:
    """Points (contacts, 3) on the first body, gaps (contacts,) and labels that say which corners
    and edges they are; None where nothing is nearer than ``margin``.
    """
    across = _across(facing.axis)
    one = _feature(facing.first, facing.axis, across, lowest=True)
    two = _feature(facing.second, facing.axis, across, lowest=False)
    slack = 1e-6 * float(np.ptp(one.flat) + np.ptp(two.flat)) + _TINY
    here, there = two.holds(one.flat, slack), one.holds(two.flat, -slack)
    count, others = len(facing.first), len(facing.second)
    points, gaps, labels = [one.points[here]], [], [one.numbers[here]]
    gaps.append(one.heights[here] - (two.height_at(one.flat[here]) if here.any() else 0.0))
    if there.any():
        own = one.height_at(two.flat[there])
        gaps.append(own - two.heights[there])
        points.append(two.points[there] + gaps[-1][:, None] * facing.axis)
        labels.append(count + two.numbers[there])
    crossing = _crossings(one, two)
    if crossing is not None:
        (first, second), (share, part), (i, j) = crossing
        mine = one.points[i[0]] + share[:, None] * (one.points[i[1]] - one.points[i[0]])
        its = two.points[j[0]] + part[:, None] * (two.points[j[1]] - two.points[j[0]])
        points.append(mine)
        gaps.append((mine - its) @ facing.axis)
        labels.append(count + others + first * (others * others) + second)
    apart = np.concatenate(gaps)
    near = apart < margin
    if not near.any():
        return None
    return np.concatenate(points)[near], apart[near], np.concatenate(labels)[near]


_Pair = tuple[Integers, Integers]
_Crossing = tuple[_Pair, tuple[Floats, Floats], tuple[_Pair, _Pair]]


def _crossings(one: _Feature, two: _Feature) -> _Crossing | None:
    """Edges that cross: numbers of both that never change, where along each, and their ends."""
    (a, b), (c, d) = one.edges(), two.edges()
    if not len(a) or not len(c):
        return None
    way = (one.flat[b] - one.flat[a])[:, None]
    other = (two.flat[d] - two.flat[c])[None]
    off = two.flat[c][None] - one.flat[a][:, None]
    turn = way[..., 0] * other[..., 1] - way[..., 1] * other[..., 0]
    size = np.linalg.norm(way, axis=-1) * np.linalg.norm(other, axis=-1)
    clear = np.abs(turn) > 1e-6 * size + _TINY**2
    safe = np.where(clear, turn, 1.0)
    share = (off[..., 0] * other[..., 1] - off[..., 1] * other[..., 0]) / safe
    part = (off[..., 0] * way[..., 1] - off[..., 1] * way[..., 0]) / safe
    found = clear & (share > 0.0) & (share < 1.0) & (part > 0.0) & (part < 1.0)
    first, second = found.nonzero()
    if not len(first):
        return None
    ends = (a[first], b[first]), (c[second], d[second])
    numbers = _edge_number(one, ends[0]), _edge_number(two, ends[1])
    return numbers, (share[found], part[found]), ends


def _edge_number(feature: _Feature, ends: _Pair) -> Integers:
    """The same for the same two corners, whichever comes first."""
    begin, end = feature.numbers[ends[0]], feature.numbers[ends[1]]
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    return high * (high - 1) // 2 + low


def _feature(points: Floats, axis: Floats, across: Floats, *, lowest: bool) -> _Feature:
    heights = points @ axis
    seen = heights if lowest else -heights
    low, high = float(seen.min()), float(seen.max())
    numbers = np.flatnonzero(seen <= low + _NEAR * (high - low))
    flat = points[numbers] @ across.T
    if len(numbers) > 2:
        kept = _outline(flat)
        numbers, flat = numbers[kept], flat[kept]
    return _Feature(numbers, points[numbers], flat, heights[numbers])


def _outline(flat: Floats) -> list[int]:
    """The corners of the polygon about points (points, 2), in order (Andrew 1979)."""
    kept: list[int] = []
    order = np.lexsort((flat[:, 1], flat[:, 0])).tolist()
    places = flat.tolist()
    for way in (order, order[::-1]):
        chain: list[int] = []
        for each in way:
            while len(chain) > 1 and _left(places, chain[-2], chain[-1], each) <= _TINY:
                chain.pop()
            chain.append(each)
        kept += chain[:-1]
    return kept


def _left(places: list[list[float]], a: int, b: int, c: int) -> float:
    (ax, ay), (bx, by), (cx, cy) = places[a], places[b], places[c]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _across(axis: Floats) -> Floats:
    """(2, 3) unit vectors across an axis, turned so that their cross product is it."""
    least = np.zeros(3)
    least[int(np.argmin(np.abs(axis)))] = 1.0
    first = np.cross(least, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])
