# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames get keys.

Key frames are found from left to right, each as far on as the bounds allow, for keys that hold the
motion's own values and handles at thirds: no choice has fewer such keys, as long as what can be
spanned in one piece can be spanned in parts. Many rows of channels and many stretches of the shot
are worked on at once.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from ..rotations import Floats, from_mode_values, normalized
from ..steps import evenly
from .channels import Booleans
from .tracks import LOCATION, Integers, Limb

_STRETCH: Final = 1024
"""Frames that are worked on at once; stretches meet where a key is needed anyway."""
_ROWS: Final = 8192
"""Frames times rows measured at a time: what stays within a processor's cache."""
_PULL: Final = 0.01
"""Weight, against that of a frame, of the wish that handles follow the motion's slope."""
_GENTLE_PULL: Final = 1e-3
"""The same where there is but a moment between two keys."""
_KINK: Final = 0.1
"""Bounds by which the motion must turn aside within a frame to be let have a corner there."""


@dataclass(eq=False)
class _Spans:
    """Stretches from one key to the next, and their handles."""

    limbs: Integers
    starts: Integers
    ends: Integers
    out: Floats = field(default_factory=lambda: np.empty(0))
    """(spans, components) values of the handles after the first keys."""
    into: Floats = field(default_factory=lambda: np.empty(0))
    """(spans, components) values of the handles before the last keys."""

    def __len__(self) -> int:
        return len(self.starts)

    def part(self, chosen: slice) -> _Spans:
        return _Spans(
            self.limbs[chosen],
            self.starts[chosen],
            self.ends[chosen],
            self.out[chosen],
            self.into[chosen],
        )


class Choice:
    """Key frames of limbs that are alike: as many tracks of the same kinds. Chains do not count.

    Of times (frames,), at least two, there may be a key at ``every`` so many. The limbs' bounds are
    those that keys of the motion's own values are to keep to.
    """

    def __init__(self, times: Floats, limbs: Sequence[Limb], every: int = 1) -> None:
        self._times, self._every = times, every
        self._kinds = [track.kind for track in limbs[0].tracks]
        self._widths = [track.values.shape[1] for track in limbs[0].tracks]
        ends = np.cumsum([0, *self._widths])
        self._columns = [slice(*pair) for pair in pairwise(ends)]
        self._values = np.stack(
            [np.concatenate([track.values for track in limb.tracks], axis=1) for limb in limbs]
        )
        self._angle = np.array([limb.angle for limb in limbs])
        self._distance = np.array([np.min(limb.distance) for limb in limbs])
        self._lever = np.array([limb.lever for limb in limbs])
        self._rotations, self._locations = self._decoded(self._values)
        self._loose = self._kinks()
        self._loose[:, (0, -1)] = True
        self.keyed: Booleans = np.zeros(self._values.shape[:2], dtype=bool)
        """(limbs, frames)"""
        self.keyed[:, (0, -1)] = True

    @property
    def corners(self) -> Booleans:
        """Where the motion itself has a corner: (limbs, frames, tracks)."""
        return self._loose

    def fewest(self) -> Iterator[float]:
        """Mark as few frames as will do; the share that is done."""
        if self._every > 1:
            yield from evenly(self._let_go(), 0.0)
        limbs, starts, ends = self._stretches()
        done = 0.0
        whole = int((ends - starts).sum())
        self.keyed[limbs, starts] = True
        # Of each stretch: the last key, the furthest frame that it can span, the nearest that it
        # cannot, and how far to look next.
        every = self._every
        starts, ends = starts // every, ends // every
        at, good, bad = starts.copy(), starts + 1, ends + 1
        guess = np.minimum(starts + 8, ends)
        while len(at):
            probed = guess > good
            spans = _Spans(limbs[probed], every * at[probed], every * guess[probed])
            fits = np.ones(len(at), dtype=bool)
            fits[probed] = (yield from evenly(self._fitting(spans), done)) <= 1.0
            length = guess - at
            good = np.where(fits, np.maximum(guess, good), good)
            bad = np.where(fits, bad, guess)
            found = good + 1 >= bad
            self.keyed[limbs[found], every * good[found]] = True
            step = good - at
            at = np.where(found, good, at)
            # The next span is looked for at the length of this one, a longer one by doubling.
            unknown = bad > ends
            guess = np.where(unknown, good + length, (good + bad) // 2)
            guess = np.where(found, good + step, guess)
            good = np.where(found, at + 1, good)
            bad = np.where(found, ends + 1, bad)
            guess = np.clip(guess, good, np.minimum(ends, bad))
            guess = np.where((guess == good) & ~found & (good + 1 < bad), good + 1, guess)
            going = at < ends
            limbs, ends = limbs[going], ends[going]
            at, good, bad, guess = at[going], good[going], bad[going], guess[going]
            done = 1.0 - int((ends - at).sum()) / whole
            yield done

    def _stretches(self) -> tuple[Integers, Integers, Integers]:
        """Limb, first and last frame of the stretches, cut where the motion bends most."""
        count = len(self._times)
        bend = np.zeros(self._values.shape[:2])
        bend[:, 1:-1] = np.abs(np.diff(self._values, 2, axis=1)).max(axis=2)
        nominal = np.arange(_STRETCH, count - _STRETCH // 2, _STRETCH)
        around = np.arange(-_STRETCH // 4, _STRETCH // 4)
        windows = nominal[:, None] + around
        cuts = windows[:, 0] + bend[:, windows].argmax(axis=2)
        cuts -= cuts % self._every
        rows = len(self._values)
        edges = np.column_stack(
            [np.zeros(rows, dtype=np.intp), cuts, np.full(rows, count - 1, dtype=np.intp)]
        )
        limbs = np.repeat(np.arange(rows), edges.shape[1] - 1)
        return limbs, edges[:, :-1].ravel(), edges[:, 1:].ravel()

    # --- Handles -------------------------------------------------------------------------------

    def _kinks(self) -> Booleans:
        """Where the motion itself has a corner: (limbs, frames, tracks)."""
        bend = np.zeros(self._values.shape)
        bend[:, 1:-1] = np.diff(self._values, 2, axis=1)
        # What sets a corner apart from a tight bend is that the frames beside it bend less.
        bend[:, 1:-1] -= 0.5 * (bend[:, :-2] + bend[:, 2:])
        kinks = np.empty((*self._values.shape[:2], len(self._kinds)), dtype=bool)
        for track, (kind, columns) in enumerate(zip(self._kinds, self._columns, strict=True)):
            bound = self._distance if kind == LOCATION else self._angle
            # A quaternion changes by half the angle.
            size = np.linalg.norm(bend[..., columns], axis=2) * (1.0 + (kind == "QUATERNION"))
            kinks[..., track] = size > _KINK * bound[:, None]
        return kinks

    def _let_go(self) -> Generator[None, None, None]:
        """Let the motion have a corner wherever it does not keep to its slope for a frame.

        From one key to the next there are moments in between then, and none to put a key at.
        """
        rows, count = self._values.shape[:2]
        starts = np.arange(0, count - 1, self._every)
        limbs, starts = np.repeat(np.arange(rows), len(starts)), np.tile(starts, rows)
        spans = _Spans(limbs, starts, starts + self._every)
        off = (yield from self._fitting(spans)) > 1.0
        self._loose[limbs[off], starts[off]] = True
        self._loose[limbs[off], starts[off] + self._every] = True

    def _fitting(self, spans: _Spans) -> Generator[None, None, Floats]:
        """Give spans the handles that fit best, in steps; the errors that remain, as shares of the
        bounds.
        """
        components = self._values.shape[2]
        spans.out, spans.into = np.empty((2, len(spans), components))
        errors = np.zeros(len(spans))
        for part in _blocks(spans.ends - spans.starts):
            self._fit(spans, part)
            errors[part] = self._errors(spans.part(part))
            yield
        return errors

    def _fit(self, spans: _Spans, part: slice) -> None:
        limbs, starts, ends = spans.limbs[part], spans.starts[part], spans.ends[part]
        third = (self._times[ends] - self._times[starts])[:, None] / 3.0
        first, last = self._values[limbs, starts], self._values[limbs, ends]
        wanted_out = first + third * self._slopes(limbs, starts)
        wanted_into = last - third * self._slopes(limbs, ends)
        owner, frames, heads = _rows(starts, ends)
        share = (self._times[frames] - self._times[starts][owner]) / (3.0 * third[owner, 0])
        weights = _bernstein(share)
        rest = self._values[limbs[owner], frames]
        rest -= weights[0][:, None] * first[owner] + weights[3][:, None] * last[owner]
        one, two = weights[1], weights[2]
        sums = np.add.reduceat(np.column_stack([one * one, one * two, two * two]), heads)
        # A single moment in between has little to say against it.
        single = (ends - starts == self._every) & (self._every > 1)
        pull = np.where(single, _GENTLE_PULL, _PULL)[:, None]
        ones = np.add.reduceat(one[:, None] * rest, heads) + pull * wanted_out
        twos = np.add.reduceat(two[:, None] * rest, heads) + pull * wanted_into
        sums += pull * (1.0, 0.0, 1.0)
        a, b, c = sums.T[:, :, None]
        scale = a * c - b * b
        out, into = (c * ones - b * twos) / scale, (a * twos - b * ones) / scale
        loose_out = np.repeat(self._loose[limbs, starts], self._widths, axis=1)
        loose_into = np.repeat(self._loose[limbs, ends], self._widths, axis=1)
        # Where the motion is smooth, so are the keys: their handles follow its own slope.
        alone = (ones - b * wanted_into) / a
        spans.out[part] = np.where(loose_out, np.where(loose_into, out, alone), wanted_out)
        alone = (twos - b * wanted_out) / c
        spans.into[part] = np.where(loose_into, np.where(loose_out, into, alone), wanted_into)

    def _slopes(self, limbs: Integers, frames: Integers) -> Floats:
        """How fast the dense values change, (…, components) per frame."""
        before = np.maximum(frames - 1, 0)
        after = np.minimum(frames + 1, len(self._times) - 1)
        change = self._values[limbs, after] - self._values[limbs, before]
        return change / (self._times[after] - self._times[before])[:, None]

    def _errors(self, spans: _Spans) -> Floats:
        """Largest error of each span at its frames, as a share of the bounds."""
        owner, frames, heads = _rows(spans.starts, spans.ends)
        starts, ends = self._times[spans.starts], self._times[spans.ends]
        share = (self._times[frames] - starts[owner]) / (ends - starts)[owner]
        weights = _bernstein(share)
        limbs = spans.limbs[owner]
        values = weights[0][:, None] * self._values[spans.limbs, spans.starts][owner]
        values += weights[1][:, None] * spans.out[owner]
        values += weights[2][:, None] * spans.into[owner]
        values += weights[3][:, None] * self._values[spans.limbs, spans.ends][owner]
        return np.maximum.reduceat(self._deviation(limbs, frames, values), heads)

    def _deviation(self, limbs: Integers, frames: Integers, values: Floats) -> Floats:
        """How far values (rows, components) are off, as a share of the bounds: (rows,)."""
        rotations, locations = self._decoded(values)
        cosine = np.einsum("rbi,rbi->rb", rotations, self._rotations[limbs, frames])
        half = np.arccos(np.minimum(np.abs(cosine), 1.0)).max(axis=1, initial=0.0)
        away = np.linalg.norm(locations - self._locations[limbs, frames], axis=2)
        distance = away.max(axis=1, initial=0.0) + self._lever[limbs] * 2.0 * np.sin(half)
        return np.maximum(2.0 * half / self._angle[limbs], distance / self._distance[limbs])

    def _decoded(self, values: Floats) -> tuple[Floats, Floats]:
        """Rotations (…, rotated tracks, 4) and locations (…, located tracks, 3)."""
        ahead = values.shape[:-1]
        if all(kind == "QUATERNION" for kind in self._kinds):
            return normalized(values.reshape(*ahead, -1, 4)), np.zeros((*ahead, 0, 3))
        rotations, locations = [], []
        for kind, columns in zip(self._kinds, self._columns, strict=True):
            own = values[..., columns]
            if kind == LOCATION:
                locations.append(own)
            else:
                rotations.append(from_mode_values(own, kind))
        return (
            np.stack(rotations, axis=-2) if rotations else np.zeros((*ahead, 0, 4)),
            np.stack(locations, axis=-2) if locations else np.zeros((*ahead, 0, 3)),
        )


def _blocks(lengths: Integers) -> Iterator[slice]:
    """Spans one after the other, so many at a time that their frames stay within limits."""
    filled = np.cumsum(lengths + 1) // _ROWS
    edges = [0, *(np.flatnonzero(np.diff(filled)) + 1), len(lengths)]
    for start, stop in pairwise(edges):
        if stop > start:
            yield slice(int(start), int(stop))


def _rows(starts: Integers, ends: Integers) -> tuple[Integers, Integers, Integers]:
    """All frames of all spans, both ends included: span, frame, and where each span begins."""
    counts = ends - starts + 1
    heads = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(starts)), counts)
    frames = np.arange(len(owner)) - heads[owner] + starts[owner]
    return owner, frames, heads


def _bernstein(share: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    rest = 1.0 - share
    return rest**3, 3.0 * share * rest**2, 3.0 * share**2 * rest, share**3
