# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves through keys at given frames: each a cubic in time from one key to the next.

What there is to choose of a key is its value and the slopes before and after it, which are one
where its handles stand in line. All of that, of all tracks, stands in one row of *choices*: value,
slope before, slope after, next key… Values of the curves depend on them linearly [cubic Hermite
splines, e.g. de Boor, *A Practical Guide to Splines*, 1978, ch. IV].
"""

from __future__ import annotations

from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from .channels import Booleans

Singles = NDArray[np.float32]
_Array = TypeVar("_Array", Floats, Singles)

_COARSE: Final = 1e-4
"""Share of a span by which rounded handles are off before their time is solved for with care."""


class Curves:
    """Curves with keys at given frames, ``times`` (frames,), at least two.

    There are keys where ``keyed`` (tracks, frames) says so, the first and last frame among them.
    Those that are ``smooth`` (tracks, frames) keep their handles in one line, those that are
    ``pinned`` (tracks, frames) their values. In a loop the handles at both ends stay in one line,
    too, where both are smooth; slopes ``held`` (tracks, 2) at both ends stay as they are.
    """

    def __init__(
        self,
        times: Floats,
        keyed: Booleans,
        smooth: Booleans,
        pinned: Booleans,
        *,
        loops: bool,
        held: Booleans | None = None,
    ) -> None:
        self._times, count = times, keyed.shape[1]
        self.shape = keyed.shape
        self.keys = np.flatnonzero(keyed)
        """Element (track · frames + frame) of each key."""
        self.tracks, self.frames = np.divmod(self.keys, count)
        self.smooth = smooth.ravel()[self.keys]
        """(keys,)"""
        first, last = self.frames == 0, self.frames == count - 1
        # Nothing comes before the first key and after the last one: they have one slope each.
        both = ~(self.smooth | first | last)
        self.values = np.cumsum(2 + both) - 2 - both
        """Choice that is each key's value."""
        self.size = int(self.values[-1]) + 2 + int(both[-1])
        before, after = self.values + 1, self.values + 1 + both
        if loops:
            met = self.smooth[first] & self.smooth[last]
            before[np.flatnonzero(last)[met]] = after[np.flatnonzero(first)[met]]
        self.begun = np.flatnonzero(~last)
        """Key with which each span begins; the next one ends it."""
        self.heads, self.tails = self.keys[self.begun], self.keys[self.begun + 1]
        """Elements of both."""
        self.lengths = times[self.frames[self.begun + 1]] - times[self.frames[self.begun]]
        self.choices = np.stack(
            [
                self.values[self.begun],
                after[self.begun],
                before[self.begun + 1],
                self.values[self.begun + 1],
            ]
        )
        """(4, spans) on which each span depends: value and slope, slope and value."""
        self._counts = np.diff(np.append(self.heads, keyed.size))
        self.span = np.repeat(np.arange(len(self.begun)), self._counts)
        """Span in which each element is; keys are in the one that they begin."""
        ahead = np.tile(times, len(keyed)) - times[self.frames[self.begun]][self.span]
        length = self.lengths[self.span]
        self._basis = hermite(ahead / length, length)
        self._singles = self._basis.astype(np.float32)
        self._givers = self._contributing()
        pins = pinned.ravel()[self.keys]
        self.pins, self.pinned = self.values[pins], self.keys[pins]
        """Choices that stay as they are, and their elements."""
        self.free = np.ones(self.size, dtype=bool)
        """(size,) the others."""
        self.free[self.pins] = False
        if held is not None:
            self.free[after[first][held[:, 0]]] = False
            self.free[before[last][held[:, 1]]] = False

    def started(self, values: Floats, slopes: Floats) -> Floats:
        """Choices (4, size) by the motion's own values and slopes (4, elements)."""
        first, last = self.heads, self.tails
        return self._chosen(values[:, first], slopes[:, first], slopes[:, last], values[:, last])

    def carried_over(self, other: Curves, chosen: Floats) -> Floats:
        """Choices (4, size) for the same curves, of which the other has some of the keys.

        Where handles come into one line, their slope is one between both.
        """
        times, count = self._times, self.shape[1]
        old = other.span[self.heads]
        length, start = other.lengths[old], times[other.heads[old] % count]
        own = chosen[:, other.choices[:, old]]
        ends = []
        for at in (self.heads, self.tails):
            share = (times[at % count] - start) / length
            ends.append(np.einsum("kn,ckn->cn", hermite(share, length), own))
            ends.append(np.einsum("kn,ckn->cn", _slopes(share, length), own))
        return self._chosen(ends[0], ends[1], ends[3], ends[2])

    def _chosen(self, first: Floats, after: Floats, before: Floats, last: Floats) -> Floats:
        result, weight = np.zeros((4, self.size)), np.zeros(self.size)
        v0, s0, s1, v1 = self.choices
        # A slope that is off moves the curve by as much as the span is long, at as many frames.
        cubes = self.lengths**3
        for slope, wanted in ((s0, after), (s1, before)):
            result[:, slope] += cubes * wanted
            weight[slope] += cubes
        result /= np.where(weight > 0.0, weight, 1.0)
        result[:, v0], result[:, v1] = first, last
        return result

    def turned(self, other: Curves, before: Floats, after: Floats) -> Floats:
        """How far handles of each key (keys,) have moved from the choices ``before`` (4,
        other.size) of other curves with the same keys to these, ``after`` (4, size).
        """
        result = np.zeros(len(self.keys))
        for place, ends in ((1, self.begun), (2, self.begun + 1)):
            moved = after[:, self.choices[place]] - before[:, other.choices[place]]
            moved = np.abs(moved).max(axis=0) * self.lengths
            result[ends] = np.maximum(result[ends], moved)
        return result

    def at_frames(self, chosen: Floats) -> Floats:
        """Values (4, tracks, frames) of choices (4, size)."""
        return self._summed(self._basis, chosen)

    def _summed(self, basis: _Array, chosen: _Array) -> _Array:
        result = np.repeat(chosen.take(self.choices[0], axis=1), self._counts, axis=1)
        result *= basis[0]
        for place in range(1, 4):
            part = np.repeat(chosen.take(self.choices[place], axis=1), self._counts, axis=1)
            part *= basis[place]
            result += part
        return result.reshape(4, *self.shape)

    # --- For least squares, in single precision --------------------------------------------------

    def spread(self, chosen: Singles) -> Singles:
        """Values (4, tracks, frames) of choices (4, size)."""
        return self._summed(self._singles, chosen)

    def gathered(self, pulls: Singles) -> Singles:
        """Transpose of :meth:`spread`, but for choices that stay as they are."""
        flat, spans = pulls.reshape(4, -1), len(self.heads)
        given = np.zeros((4, 4 * spans + 1), dtype=np.float32)
        for place, basis in enumerate(self._singles):
            part = given[:, place * spans : (place + 1) * spans]
            np.add.reduceat(basis * flat, self.heads, axis=1, out=part)
        first, second = self._givers
        return (given.take(first, axis=1) + given.take(second, axis=1)) * self.free

    def coupled(self, one: int, two: int, weight: Singles) -> Singles:
        """How much two of the choices of each span, by number, have to do with each other (spans,),
        where frames weigh so much (tracks, frames).
        """
        products = self._singles[one] * self._singles[two]
        return np.add.reduceat(products * weight.ravel(), self.heads)

    def _contributing(self) -> NDArray[np.intp]:
        """Who gives to each choice: the one or two spans that it is of, (2, size).

        Numbers of what spans give: all to the first of their choices, then all to the second…;
        after the last one comes what is nothing.
        """
        flat = self.choices.ravel()
        order = np.argsort(flat, kind="stable")
        ordered = flat[order]
        fresh = np.append(True, ordered[1:] != ordered[:-1])
        result = np.full((2, self.size), flat.size)
        result[0, ordered[fresh]] = order[fresh]
        result[1, ordered[~fresh]] = order[~fresh]
        return result

    # --- As they are kept ------------------------------------------------------------------------

    def handles(self, chosen: Floats) -> tuple[Floats, Floats]:
        """Values (4, spans) of the handles after the first key of each span and before its last."""
        v0, s0, s1, v1 = (chosen[:, each] for each in self.choices)
        return v0 + self.lengths / 3.0 * s0, v1 - self.lengths / 3.0 * s1

    def played(self, chosen: Floats, times: Floats) -> Floats:
        """Values (4, tracks, times) of keys and handles ``chosen`` (4, size) that are kept in
        single precision.

        Times (times,) ascend from the first frame to the last; they need not be frames.
        """
        own, count = self._times, self.shape[1]
        place = np.searchsorted(own, times, side="right") - 1
        # The last key begins no span.
        span = self.span.reshape(self.shape)[:, np.minimum(place, count - 2)]
        starts = own[self.heads % count]
        ends = starts + self.lengths
        outs, intos = (_single(starts + self.lengths / 3.0), _single(ends - self.lengths / 3.0))
        # How far rounding moves the handles, as shares of the span.
        out, into = (outs - starts) / self.lengths, (intos - starts) / self.lengths
        coarse = max(np.abs(out - 1.0 / 3.0).max(), np.abs(into - 2.0 / 3.0).max()) > _COARSE
        share = wanted = (times - starts[span]) / self.lengths[span]
        out, into = out[span], into[span]
        for _ in range(4 if coarse else 1):
            rest = 1.0 - share
            reached = 3.0 * share * rest * (rest * out + share * into) + share**3
            speed = 3.0 * (rest**2 * out + 2.0 * share * rest * (into - out))
            speed += 3.0 * share**2 * (1.0 - into)
            share = np.clip(share + (wanted - reached) / np.maximum(speed, 1e-3), 0.0, 1.0)
        rest = 1.0 - share
        values, handles = _single(chosen), [_single(each) for each in self.handles(chosen)]
        result = rest**3 * values.take(self.choices[0][span], axis=1)
        result += 3.0 * share * rest**2 * handles[0].take(span, axis=1)
        result += 3.0 * share**2 * rest * handles[1].take(span, axis=1)
        result += share**3 * values.take(self.choices[3][span], axis=1)
        return result


def _single(values: Floats) -> Floats:
    return values.astype(np.float32).astype(np.float64)


def inner_product(first: np.ndarray, second: np.ndarray) -> float:
    """Sum of the products of two arrays of one shape, by this thread alone.

    The threads of numpy's BLAS, which ``vdot`` would wake, spin while they wait for each other:
    beside other programs that takes many times as long as the product.
    """
    return float(np.einsum("i,i->", first.ravel(), second.ravel()))


def hermite(share: Floats, length: Floats) -> Floats:
    """What value and slope, slope and value at the ends of a span are to a share of it: (4, …)."""
    rest = 1.0 - share
    return np.stack(
        [
            rest**2 * (1.0 + 2.0 * share),
            length * share * rest**2,
            -length * share**2 * rest,
            share**2 * (1.0 + 2.0 * rest),
        ]
    )


def _slopes(share: Floats, length: Floats) -> Floats:
    """The same for the slope there."""
    rest = 1.0 - share
    turn = 6.0 * share * rest / length
    return np.stack([-turn, rest * (1.0 - 3.0 * share), share * (3.0 * share - 2.0), turn])
