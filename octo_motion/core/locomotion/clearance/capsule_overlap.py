# SPDX-License-Identifier: GPL-3.0-or-later
"""How far arms pass through each other and through the body, over all frames at once.

Arms are chains of capsules: a bone's length, with the skin's radius at its two ends. First spheres
round the capsules tell which can touch at all; only these are measured, by the nearest points of
two line segments (Ericson, Real-Time Collision Detection, 2005, 5.1.9). Capsules that overlap at
rest are built so: at the crown, where arms stand side by side, there is nothing to report. Nor is
there of those next to them that have less than their own thickness between them: where arms spring
from one place, no pose can keep these apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ...rotations.components_first import dot

_TINY: Final = 1e-30
"""Squares of lengths that are none, however small a rig's unit makes its bones."""
_PARALLEL: Final = 1e-10
"""Square of the sine of the angle between two segments that are as good as parallel."""
_AT_ONCE: Final = 250_000
"""Distances that are looked at in one go: what the processor keeps at hand."""
_ROUNDED: Final = 1e-4
"""Share of a distance in single precision by which it may be wrong."""
_BUILT_SO: Final = 0.02
"""Share of the smaller radius by which capsules may overlap at rest and still count."""
_CROWDED: Final = 1.0
"""The same by which capsules are apart at rest that are still crowded, next to such as overlap."""


@dataclass(frozen=True, eq=False)
class Capsules:
    """A chain of capsules over time: an arm, or a part of the body."""

    name: str
    joints: Floats
    """(frames, joints, 3), at least two joints."""
    radii: Floats
    """(joints,)"""
    at_rest: Floats
    """(joints, 3) the same joints at rest, all chains in one space."""


@dataclass(frozen=True)
class Overlap:
    """The deepest overlap of one pair of chains."""

    first: str
    second: str
    frame: int
    """Number of the frame in the arrays, not of the scene."""
    depth: float
    """Share of the smaller radius there."""


@dataclass(frozen=True, eq=False)
class Separation:
    """What :func:`measure_overlap` finds."""

    depths: Floats
    """(frames,) deepest overlap at each frame, as a share of the smaller radius; 0 for none."""
    overlaps: tuple[Overlap, ...]
    """Of each pair of chains that overlap anywhere, deepest first."""

    @property
    def worst(self) -> Overlap | None:
        """The deepest of all."""
        return self.overlaps[0] if self.overlaps else None


def measure_overlap(chains: Sequence[Capsules], still: Sequence[Capsules] = ()) -> Separation:
    """How far chains pass through each other and through parts of the body.

    Neighbouring capsules of one chain are joined; a chain is not measured against itself.

    Args:
        chains: the arms, all of as many frames.
        still: parts of the body; they are not measured against each other.
    """
    every = [*chains, *still]
    if not chains:
        return Separation(np.zeros(0), ())
    parts = parts_of(every)
    one, other = pairs_of(every, len(chains))
    depths = np.zeros(parts.starts.shape[1])
    number, pair, _ = near(parts, one, other)
    found = _depths(parts, (number, one[pair], other[pair]))
    touching = found > 0.0
    number, pair, found = number[touching], pair[touching], found[touching]
    np.maximum.at(depths, number, found)
    owner = parts.owner
    return Separation(depths, _pairs(every, owner[one[pair]], owner[other[pair]], number, found))


@dataclass(frozen=True, eq=False)
class Parts:
    """The capsules of all chains, one after the other."""

    starts: Floats
    """(3, frames, capsules)"""
    ends: Floats
    """(3, frames, capsules)"""
    radii: tuple[Floats, Floats]
    """(capsules,) at starts and at ends."""
    owner: np.ndarray
    """(capsules,) number of each one's chain."""


def parts_of(chains: Sequence[Capsules]) -> Parts:
    """The capsules of chains that all have as many frames."""
    owner = np.repeat(np.arange(len(chains)), [len(each.radii) - 1 for each in chains])
    ends = np.empty((2, 3, len(chains[0].joints), len(owner)))
    done = 0
    for each in chains:
        joints = np.moveaxis(each.joints, -1, 0)
        own = slice(done, done + joints.shape[2] - 1)
        ends[0, ..., own], ends[1, ..., own] = joints[..., :-1], joints[..., 1:]
        done = own.stop
    return Parts(
        ends[0],
        ends[1],
        (
            np.concatenate([each.radii[:-1] for each in chains]),
            np.concatenate([each.radii[1:] for each in chains]),
        ),
        owner,
    )


def pairs_of(chains: Sequence[Capsules], moving: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (pairs,) and (pairs,) of the capsules that must not overlap.

    They are of two chains, of which one at least moves, and are apart at rest, and no longer
    crowded there.

    Args:
        chains: those that move first.
        moving: how many these are.
    """
    rest = [Capsules(each.name, each.at_rest[None], each.radii, each.at_rest) for each in chains]
    parts = parts_of(rest)
    one, other = np.triu_indices(len(parts.owner), 1)
    asked = (parts.owner[one] != parts.owner[other]) & (parts.owner[one] < moving)
    one, other = one[asked], other[asked]
    depths = _depths(parts, (np.zeros_like(one), one, other))
    built = np.zeros((len(parts.owner), len(parts.owner)), dtype=bool)
    built[one, other] = depths > _BUILT_SO
    built |= built.T
    # The capsule before each in its chain; of a chain's first that is itself.
    before = np.maximum(np.arange(len(parts.owner)) - 1, 0)
    before = np.where(parts.owner[before] == parts.owner, before, np.arange(len(before)))
    joined = built[before[one], other] | built[one, before[other]]
    joined |= built[before[one], before[other]]
    apart = ~built[one, other] & ~(joined & (depths > -_CROWDED))
    return one[apart], other[apart]


def near(
    parts: Parts, one: np.ndarray, other: np.ndarray, margin: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of frames and of pairs whose bounding spheres touch.

    Args:
        parts: the capsules.
        one: (pairs,) capsules …
        other: (pairs,) … and others.
        margin: radii by which they may be further apart.

    Returns:
        Frames and pairs, and how far apart the middle lines of the two are at least.
    """
    if len(one) == 0:
        none = np.zeros(0, dtype=np.intp)
        return none, none, np.zeros(0)
    middles = np.empty((*parts.starts.shape[1:], 3), dtype=np.float32)
    whole = np.zeros(parts.starts.shape[1:])
    for axis, (start, end) in enumerate(zip(parts.starts, parts.ends, strict=True)):
        middle = 0.5 * (start + end)
        # Around its middle a scene's rounding in single precision is least.
        middles[..., axis] = middle - middle.mean()
        whole += (end - start) ** 2
    longest = 0.5 * np.sqrt(whole.max(axis=0))
    squares = np.einsum("fsi,fsi->fs", middles, middles)
    rounding = 1e-6 * squares.max()
    apart = longest[one] + longest[other]
    size = longest + (1.0 + margin) * np.maximum(*parts.radii)
    limit = np.full((len(longest), len(longest)), -np.inf, dtype=np.float32)
    limit[one, other] = ((size[one] + size[other]) * (1.0 + _ROUNDED)) ** 2 + rounding
    place = np.full(limit.shape, -1)
    place[one, other] = np.arange(len(one))
    place = place.ravel()
    # |a − b|² = |a|² + |b|² − 2 a · b, all of it in one product.
    one_more, own = np.ones_like(squares)[..., None], squares[..., None]
    first = np.concatenate([-2.0 * middles, own, one_more], axis=2)
    second = np.concatenate([middles, one_more, own], axis=2).transpose(0, 2, 1)
    step = max(1, _AT_ONCE // limit.size)
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for begin in range(0, len(middles), step):
        part = slice(begin, begin + step)
        # Squared distances of all from all.
        products = np.matmul(first[part], second[part])
        # Several times faster than where a row, a column and a frame are found at once.
        spots = np.flatnonzero(products <= limit)
        frame, spot = np.divmod(spots, limit.size)
        pair = place[spot]
        square = np.maximum(products.ravel()[spots] - rounding, 0.0)
        found.append((frame + begin, pair, (1.0 - _ROUNDED) * np.sqrt(square) - apart[pair]))
    frames, pairs, least = (np.concatenate(each) for each in zip(*found, strict=True))
    return frames, pairs, least


def _depths(parts: Parts, chosen: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Floats:
    """Overlap (pairs,) as a share of the smaller radius, negative for those that are apart.

    Args:
        parts: the capsules.
        chosen: frame, one capsule and the other of each pair.
    """
    frame, one, other = chosen
    capsules = len(parts.owner)
    starts, ends = parts.starts.reshape(3, -1), parts.ends.reshape(3, -1)
    radii, first, second = parts.radii, frame * capsules + one, frame * capsules + other
    p, q = starts.take(first, axis=1), starts.take(second, axis=1)
    u, v = ends.take(first, axis=1) - p, ends.take(second, axis=1) - q
    s, t, gap = nearest(p, u, q, v)
    here = (1.0 - s) * radii[0][one] + s * radii[1][one]
    there = (1.0 - t) * radii[0][other] + t * radii[1][other]
    return (here + there - np.sqrt(dot(gap, gap))) / np.maximum(np.minimum(here, there), _TINY)


def nearest(p: Floats, u: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Where two line segments are nearest to each other.

    Args:
        p: (3, pairs) start of the one.
        u: (3, pairs) from its start to its end.
        q: (3, pairs) start of the other.
        v: (3, pairs)

    Returns:
        Shares (pairs,) of the way from start to end on the one and on the other, and the way
        (3, pairs) from there on the other to there on the one.
    """
    w = p - q
    a, b, e = dot(u, u), dot(u, v), dot(v, v)
    c, f = dot(u, w), dot(v, w)
    room = a * e - b * b
    whole = 1.0 / np.maximum(a, _TINY)
    s = np.where(room > _PARALLEL * a * e, (b * f - c * e) / np.maximum(room, _TINY), 0.0)
    # A capsule that is a ball is nearest to one point of the other.
    s = np.where(e > _TINY, s, -c * whole)
    np.clip(s, 0.0, 1.0, out=s)
    t = (b * s + f) / np.maximum(e, _TINY)
    s = np.where(t < 0.0, np.clip(-c * whole, 0.0, 1.0), s)
    s = np.where(t > 1.0, np.clip((b - c) * whole, 0.0, 1.0), s)
    np.clip(t, 0.0, 1.0, out=t)
    w += s * u
    w -= t * v
    return s, t, w


def _pairs(
    every: Sequence[Capsules],
    first: np.ndarray,
    second: np.ndarray,
    number: np.ndarray,
    depth: Floats,
) -> tuple[Overlap, ...]:
    key = first * len(every) + second
    order = np.lexsort((-depth, key))
    _, at = np.unique(key[order], return_index=True)
    best = order[at]
    found = [
        Overlap(
            every[int(first[i])].name, every[int(second[i])].name, int(number[i]), float(depth[i])
        )
        for i in best
    ]
    return tuple(sorted(found, key=lambda each: -each.depth))
