# SPDX-License-Identifier: GPL-3.0-or-later
"""Bézier curves through keys at given frames, and the best values and handles of all of them.

All curves of all tracks stand in one row of control points: key, handle after it, handle before
the next, next key… Handles stand at thirds of the time between two keys, so that values of the
curves depend on the control points linearly. What is minimal is the sum of weighted squares of all
errors, those of the tracks and those of the tip that they move together; by conjugate gradients
[Shewchuk, *An introduction to the conjugate gradient method without the agonizing pain*, 1994,
§B3], as each track may have its own key frames. With weights that grow with the errors themselves,
a few rounds lead from least squares to an even spread [Burrus, Barreto, Selesnick, *Iterative
reweighted least-squares design of FIR filters*, 1994: the step 1 / (p − 1)].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from .key_limbs import Booleans, Integers
from .rotations import Floats

Singles = NDArray[np.float32]
_Array = TypeVar("_Array", Floats, Singles)

_CEILING: Final = 30.0
"""Squared share above which it weighs no more."""
_RIDGE: Final = 0.07
"""Weight, against what is seen of them, of changes that are not seen: of a quaternion's length."""
_PULL: Final = 0.01
"""Weight, against that of a frame, of the wish that handles follow the motion's slope."""
_COARSE: Final = 1e-4
"""Share of a span by which rounded handles are off before their time is solved for with care."""
_FLOOR: Final = 0.05
"""Squared share of the bounds below which an error weighs no less."""


@dataclass(frozen=True, eq=False)
class Aims:
    """What curves are to follow, and what it matters where they do not. All in one row: tracks,
    one after the other, each with all its frames.
    """

    targets: Floats
    """(4, rows) values; components that a track does not have are 0."""
    own: Singles
    """(3, 4, rows) error of each track, per change of its values."""
    ends: Sequence[Singles]
    """Each (3, 4, rows) error of an end of the limb's bones, likewise: of its tip, first of all."""
    ridge: Singles
    """(rows,) size of ``own``, which tells how much changes matter that are not seen."""
    tracks: int

    def seen(self, off: Floats | Singles) -> list[Singles]:
        """Errors of the tracks (3, tracks, frames) and of ends of the limb's bones (3, frames)."""
        off = off.astype(np.float32, copy=False)
        own, *ends = (
            _applied(each, off).reshape(3, self.tracks, -1) for each in (self.own, *self.ends)
        )
        return [own, *(each.sum(axis=1) for each in ends)]


def _applied(slopes: Singles, off: Singles) -> Singles:
    result = slopes[:, 0] * off[0]
    for component in range(1, 4):
        result += slopes[:, component] * off[component]
    return result


def _weights(errors: Singles, power: float) -> Singles:
    squares = np.minimum((errors**2).sum(axis=0), _CEILING)
    return ((_FLOOR + squares) ** power).astype(np.float32, copy=False)


def _transposed(slopes: Singles, errors: Singles) -> Singles:
    result = slopes[0] * errors[0]
    for direction in range(1, 3):
        result += slopes[direction] * errors[direction]
    return result


class Curves:
    """Curves with keys at given frames.

    Args:
        times: (frames,) at least two.
        keyed: (tracks, frames) where there are keys; among them the first and last frame.
        smooth: (tracks, frames) keys whose handles stay in one line.
        pinned: (tracks, frames) keys that keep their values.
        loops: whether the handles at both ends stay in one line, too.
    """

    def __init__(
        self, times: Floats, keyed: Booleans, smooth: Booleans, pinned: Booleans, *, loops: bool
    ) -> None:
        count = keyed.shape[1]
        self.keys = np.flatnonzero(keyed)
        """Element (track · frames + frame) of each key."""
        self.tracks, self.frames = np.divmod(self.keys, count)
        self.rows = 3 * np.arange(len(self.keys)) - 2 * self.tracks
        """Control point of each key."""
        self.size = int(self.rows[-1]) + 1
        (first,) = np.nonzero(self.frames < count - 1)
        self.heads = self.keys[first]
        """Element of the key with which each span begins."""
        self.tails = self.keys[first + 1]
        self.points = self.rows[first]
        """First of each span's four control points."""
        self.lengths = times[self.frames[first + 1]] - times[self.frames[first]]
        elements = np.diff(np.append(self.heads, keyed.size))
        self.span = np.repeat(np.arange(len(first)), elements)
        """Span in which each element is; keys are in the one that they begin."""
        self._at = self.points[self.span]
        ahead = np.tile(times, len(keyed)) - times[self.frames[first]][self.span]
        self._share = ahead / self.lengths[self.span]
        self._basis = _bernstein(self._share)
        self._quick = self._basis.astype(np.float32)
        self._pins = self.keys[pinned.ravel()[self.keys]]
        self._pinned = self.rows[pinned.ravel()[self.keys]]
        self._join(smooth, first, loops=loops, count=count)

    def _join(self, smooth: Booleans, first: Integers, *, loops: bool, count: int) -> None:
        inner = (self.frames > 0) & (self.frames < count - 1)
        (joined,) = np.nonzero(smooth.ravel()[self.keys] & inner)
        span_of = np.full(len(self.keys), -1)
        span_of[first] = np.arange(len(first))
        before, after = self.rows[joined] - 1, self.rows[joined] + 1
        spans_before, spans_after = span_of[joined - 1], span_of[joined]
        if loops:
            (starts,), (ends,) = np.nonzero(self.frames == 0), np.nonzero(self.frames == count - 1)
            met = smooth[:, 0] & smooth[:, -1]
            before = np.concatenate([before, self.rows[ends[met]] - 1])
            after = np.concatenate([after, self.rows[starts[met]] + 1])
            spans_before = np.concatenate([spans_before, span_of[ends[met] - 1]])
            spans_after = np.concatenate([spans_after, span_of[starts[met]]])
        self._before, self._after = before, after
        hung = np.zeros(self.size, dtype=bool)
        hung[before] = hung[after] = True
        # Handles in line move with their keys; others are better left alone.
        self._right = self.points[hung[self.points + 1]]
        self._left = self.points[hung[self.points + 2]]
        self._longs = self.lengths[spans_before], self.lengths[spans_after]

    def started(self, values: Floats, slopes: Floats) -> Floats:
        """Control points (4, size) through values (4, rows), each span fitted by itself.

        Slopes (4, rows) say how handles stand where nothing else does.
        """
        result = np.empty((4, self.size))
        third = self.lengths / 3.0
        first, last = values[:, self.heads], values[:, self.tails]
        result[:, self.rows] = values[:, self.keys]
        basis = self._basis
        left = values - basis[0] * first[:, self.span] - basis[3] * last[:, self.span]
        ones, twos = (
            np.add.reduceat(each * left, self.heads, axis=1) + _PULL * handle
            for each, handle in (
                (basis[1], first + third * slopes[:, self.heads]),
                (basis[2], last - third * slopes[:, self.tails]),
            )
        )
        a, b, c = (
            np.add.reduceat(one * two, self.heads)
            for one, two in ((basis[1], basis[1]), (basis[1], basis[2]), (basis[2], basis[2]))
        )
        a, c = a + _PULL, c + _PULL
        result[:, self.points + 1] = (c * ones - b * twos) / (a * c - b * b)
        result[:, self.points + 2] = (a * twos - b * ones) / (a * c - b * b)
        return result

    def carried_over(self, other: Curves, points: Floats, times: Floats) -> Floats:
        """Control points (4, size) of the same curves, of which the other has some of the keys."""
        result = np.empty((4, self.size))
        old = other.span[self.heads]
        begun = times[self.heads % len(times)] - times[other.heads[old] % len(times)]
        corners = points[:, other.points[old][:, None] + np.arange(4)]
        start = begun / other.lengths[old]
        end = (begun + self.lengths) / other.lengths[old]
        # Blossoms: the polar form of the cubic at its ends, once, twice, three times.
        for place in range(4):
            at = [start] * (3 - place) + [end] * place
            level = [corners[..., corner] for corner in range(4)]
            for share in at:
                level = [
                    (1.0 - share) * level[each] + share * level[each + 1]
                    for each in range(len(level) - 1)
                ]
            result[:, self.points + place] = level[0]
        return result

    def values(self, points: Floats) -> Floats:
        """Values (4, rows) at all frames."""
        result = self._basis[0] * points[:, self._at]
        for place in range(1, 4):
            result += self._basis[place] * points[:, self._at + place]
        return result

    def played(self, points: Floats, times: Floats) -> Floats:
        """Values (4, rows) at all frames of keys and handles that are kept in single precision."""
        starts, ends = (times[each % len(times)] for each in (self.heads, self.tails))
        outs, intos = (_single(starts + self.lengths / 3.0), _single(ends - self.lengths / 3.0))
        # How far rounding moves the handles, as shares of the span.
        out, into = (outs - starts) / self.lengths, (intos - starts) / self.lengths
        coarse = max(np.abs(out - 1.0 / 3.0).max(), np.abs(into - 2.0 / 3.0).max()) > _COARSE
        share = wanted = self._share
        out, into = out[self.span], into[self.span]
        for _ in range(4 if coarse else 1):
            rest = 1.0 - share
            reached = 3.0 * share * rest * (rest * out + share * into) + share**3
            speed = 3.0 * (rest**2 * out + 2.0 * share * rest * (into - out))
            speed += 3.0 * share**2 * (1.0 - into)
            share = np.clip(share + (wanted - reached) / np.maximum(speed, 1e-3), 0.0, 1.0)
        basis, rounded = _bernstein(share), _single(points)
        result = basis[0] * rounded[:, self._at]
        for place in range(1, 4):
            result += basis[place] * rounded[:, self._at + place]
        return result

    def aligned(self, points: Floats) -> Floats:
        """The same control points with handles in one line at keys that are to be smooth."""
        offsets = self._offsets(points)
        before, after = self._longs
        # A slope that is off moves the curve by as much as the span is long, at as many frames.
        slope = after**2 * offsets[:, self._after] - before**2 * offsets[:, self._before]
        slope /= before**3 + after**3
        offsets[:, self._before], offsets[:, self._after] = -before * slope, after * slope
        return self._absolute(offsets)

    def pinned(self, points: Floats, values: Floats) -> Floats:
        """The same control points with values (4, rows) at the keys that keep theirs."""
        offsets = self._offsets(points)
        offsets[:, self._pinned] = values[:, self._pins]
        return self._absolute(offsets)

    def turned(self, before: Floats, after: Floats) -> Floats:
        """How far the handles of each key have moved: (rows,), 0 where there is no key."""
        moved = np.abs(after - before).max(axis=0)
        result = np.zeros(len(self.span))
        result[self.heads] = moved[self.points + 1]
        result[self.tails] = np.maximum(result[self.tails], moved[self.points + 2])
        return result

    # --- Least squares ------------------------------------------------------------------------

    def improved(self, points: Floats, aims: Aims, power: float, steps: int) -> Floats:
        """Control points with smaller errors.

        Args:
            points: (4, size), in line where they have to be.
            aims: what the curves are to follow.
            power: 0 for least squares; the higher, the more only the largest errors count.
            steps: of conjugate gradients.
        """
        off = self.values(points) - aims.targets
        weights = [_weights(each, power) for each in aims.seen(off)]

        def pulls(change: Singles) -> Singles:
            return self._projected(self._gathered(self._pull(change, aims, weights)))

        eased = self._eased(aims, weights)
        rest = -pulls(off.astype(np.float32))
        total = np.zeros_like(rest)
        turned = self._projected(eased(rest))
        way = turned.copy()
        size = float(np.vdot(rest, turned))
        for _ in range(steps):
            if size <= 1e-12:
                break
            answer = pulls(self._spread(way))
            share = size / max(float(np.vdot(way, answer)), 1e-30)
            total += share * way
            rest -= share * answer
            turned = self._projected(eased(rest))
            before, size = size, float(np.vdot(rest, turned))
            way *= np.float32(size / before)
            way += turned
        offsets = self._offsets(points) + total.astype(np.float64) / (1.0 + 2.0 * power)
        return self._absolute(offsets)

    def _pull(self, change: Singles, aims: Aims, weights: Sequence[Singles]) -> Singles:
        """Gradient of the weighted squares at each frame: (4, rows)."""
        own, *ends = aims.seen(change)
        pull = _transposed(aims.own, (weights[0] * own).reshape(3, -1))
        for slopes, end, weight in zip(aims.ends, ends, weights[1:], strict=True):
            pull += _transposed(slopes, np.tile(weight * end, aims.tracks))
        pull += (weights[0].ravel() * (_RIDGE * aims.ridge) ** 2) * change
        return pull

    def _spread(self, offsets: Singles) -> Singles:
        """Values at all frames of control points that are given by offsets."""
        points = self._absolute(offsets)
        result = self._quick[0] * points[:, self._at]
        for place in range(1, 4):
            result += self._quick[place] * points[:, self._at + place]
        return result

    def _gathered(self, pulls: Singles) -> Singles:
        """Transpose of :meth:`_spread`."""
        result = np.zeros((4, self.size), dtype=np.float32)
        for place in range(4):
            pulled = np.add.reduceat(self._quick[place] * pulls, self.heads, axis=1)
            result[:, self.points + place] += pulled
        result[:, self._right] += result[:, self._right + 1]
        result[:, self._left + 3] += result[:, self._left + 2]
        return result

    def _eased(self, aims: Aims, weights: Sequence[Singles]) -> Callable[[Singles], Singles]:
        """What nearly solves the system: key by key, and the two handles of a span together."""
        weight = (aims.own**2).sum(axis=0) + (_RIDGE * aims.ridge) ** 2
        weight *= weights[0].ravel()
        for slopes, each in zip(aims.ends, weights[1:], strict=True):
            weight += (slopes**2).sum(axis=0) * np.tile(each, aims.tracks)
        q = self._quick
        hung = np.zeros(self.size, dtype=np.float32)
        hung[self._right + 1] = hung[self._left + 2] = 1.0
        ends = (
            q[0] + hung[self.points + 1][self.span] * q[1],
            q[3] + hung[self.points + 2][self.span] * q[2],
        )
        keys = np.zeros((4, self.size), dtype=np.float32)
        keys[:, self.points] += np.add.reduceat(ends[0] ** 2 * weight, self.heads, axis=1)
        keys[:, self.points + 3] += np.add.reduceat(ends[1] ** 2 * weight, self.heads, axis=1)
        a, b, c = (
            np.add.reduceat(product * weight, self.heads, axis=1).astype(np.float64)
            for product in (q[1] ** 2, q[1] * q[2], q[2] ** 2)
        )
        least = _PULL * (weight[:, self.heads] + weight[:, self.tails])
        a, c = a + least, c + least
        a, b, c = (each.astype(np.float32) for each in np.stack([a, b, c]) / (a * c - b * b))
        rows = self.rows
        inverse = 1.0 / (keys[:, rows] + 1e-6 * keys[:, rows].mean())

        def solved(pulls: Singles) -> Singles:
            result = np.empty_like(pulls)
            result[:, rows] = inverse * pulls[:, rows]
            one, two = pulls[:, self.points + 1], pulls[:, self.points + 2]
            result[:, self.points + 1] = c * one - b * two
            result[:, self.points + 2] = a * two - b * one
            return result

        return solved

    def _projected(self, offsets: Singles) -> Singles:
        """Offsets without what smooth and pinned keys do not allow; changed in place."""
        before, after = (each.astype(np.float32) for each in self._longs)
        slope = after * offsets[:, self._after] - before * offsets[:, self._before]
        slope /= before**2 + after**2
        offsets[:, self._before], offsets[:, self._after] = -before * slope, after * slope
        offsets[:, self._pinned] = 0.0
        return offsets

    def _offsets(self, points: _Array) -> _Array:
        result = points.copy()
        result[:, self._right + 1] -= points[:, self._right]
        result[:, self._left + 2] -= points[:, self._left + 3]
        return result

    def _absolute(self, offsets: _Array) -> _Array:
        result = offsets.copy()
        result[:, self._right + 1] += offsets[:, self._right]
        result[:, self._left + 2] += offsets[:, self._left + 3]
        return result


def _single(values: Floats) -> Floats:
    return values.astype(np.float32).astype(np.float64)


def _bernstein(share: Floats) -> Floats:
    rest = 1.0 - share
    return np.stack([rest**3, 3.0 * share * rest**2, 3.0 * share**2 * rest, share**3])
