# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles of keys on every frame, where the motion is known at moments in between, too.

All keys hold the motion's own values; what there is to find is one slope for each. Least squares of
what is off in between give a system that couples each slope with the two beside it, the same for
all tracks: it is solved for all of them at once. Where that does not keep to the bounds, the motion
has a corner, and the two handles of that span are what it needs.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from ..rotations import Floats
from .channels import BezierKeys, bezier_keys
from .curves import hermite, inner_product
from .residuals import LinearModel, Residuals
from .tracks import Integers, Limb

_PULL: Final = 0.01
"""Weight, against that of a moment, of the wish that slopes are those of the motion: with less, a
moment that stands out bends curves many keys away from it."""
_STEPS: Final = 40
"""Of conjugate gradients: what is coupled is so over a few keys only."""
_ENOUGH: Final = 1e-8
"""Share of the residual's square that is left when they end."""


def dense_keys(
    times: Floats, limb: Limb, every: int, *, loops: bool = False
) -> Generator[None, None, list[BezierKeys]]:
    """A key on each frame, of the motion's own values, where times (moments,), at least two, have a
    frame at ``every`` so many of them, from the first to the last.

    The limb is that of all moments. In a loop the motion goes on from its last frame to its first.
    In steps.
    """
    at = np.arange(0, len(times), every)
    targets = np.stack(
        [np.pad(track.values, ((0, 0), (0, 4 - track.values.shape[1]))).T for track in limb.tracks],
        axis=1,
    )
    spans = _Spans(times, targets, at)
    yield
    slopes = spans.evened(np.gradient(targets, times, axis=2).take(at, axis=2))
    if loops:
        met = ~LinearModel(limb).turns_at_the_seam(at)
        slopes[:, met, 0] = slopes[:, met, -1] = 0.5 * (slopes[:, met, 0] + slopes[:, met, -1])
    out, into = slopes[..., :-1].copy(), slopes[..., 1:].copy()
    smooth = np.ones(slopes.shape[1:], dtype=bool)
    yield
    own, joint = Residuals(limb).measure(
        [
            spans.played(out, into)[: track.values.shape[1], place].T
            for place, track in enumerate(limb.tracks)
        ]
    )
    yield
    broken = np.maximum.reduceat(np.maximum(own, joint), at[:-1], axis=1) > 1.0
    tracks, number = np.nonzero(broken)
    out[:, tracks, number], into[:, tracks, number] = spans.cornered(out, into, tracks, number)
    smooth[tracks, number] = smooth[tracks, number + 1] = False
    if loops:
        smooth[:, [0, -1]] = False
    yield
    third = np.diff(times[at]) / 3.0
    result = []
    for place, track in enumerate(limb.tracks):
        width = track.values.shape[1]
        values = targets[:width, place, at]
        after = values[:, :-1] + third * out[:width, place]
        before = values[:, 1:] - third * into[:width, place]
        result.append(bezier_keys(times[at], values.T, after.T, before.T, smooth[place]))
    return result


class _Spans:
    """From each frame to the next one, all tracks (4, tracks, …) alike."""

    def __init__(self, times: Floats, targets: Floats, at: Integers) -> None:
        self._at = at
        self._span = np.minimum(
            np.repeat(np.arange(len(at)), at[1] - at[0])[: len(times)], len(at) - 2
        )
        length = np.diff(times[at])[self._span]
        share = (times - times[at][self._span]) / length
        first, self._out, self._into, last = hermite(share, length)
        self._straight = first * targets.take(at[self._span], axis=2)
        self._straight += last * targets.take(at[self._span + 1], axis=2)
        self._left = targets - self._straight

    def played(self, out: Floats, into: Floats) -> Floats:
        """Values (4, tracks, moments) of slopes (4, tracks, spans) after keys and before."""
        result = self._straight + self._out * out.take(self._span, axis=2)
        result += self._into * into.take(self._span, axis=2)
        return result

    def _sums(self, values: Floats) -> Floats:
        return np.add.reduceat(values, self._at[:-1], axis=-1)

    def evened(self, wanted: Floats) -> Floats:
        """Slopes (4, tracks, frames) by least squares, near those that are wanted."""
        both = self._sums(self._out * self._into)
        own = np.zeros(wanted.shape[-1])
        own[:-1] += self._sums(self._out**2)
        own[1:] += self._sums(self._into**2)
        own += _PULL * own.mean()
        pulled = _PULL * own.mean() * wanted
        pulled[..., :-1] += self._sums(self._out * self._left)
        pulled[..., 1:] += self._sums(self._into * self._left)

        def coupled(slopes: Floats) -> Floats:
            result = own * slopes
            result[..., :-1] += both * slopes[..., 1:]
            result[..., 1:] += both * slopes[..., :-1]
            return result

        result = wanted.copy()
        rest = pulled - coupled(result)
        way, size = rest.copy(), inner_product(rest, rest)
        enough = _ENOUGH * size
        for _ in range(_STEPS):
            if size <= enough:
                break
            answer = coupled(way)
            share = size / inner_product(way, answer)
            result += share * way
            rest -= share * answer
            before, size = size, inner_product(rest, rest)
            way = rest + (size / before) * way
        return result

    def cornered(
        self, out: Floats, into: Floats, tracks: Integers, number: Integers
    ) -> tuple[Floats, Floats]:
        """Slopes (4, chosen) of single spans that follow the motion, near those that they have."""
        a, b, c = (
            self._sums(each)[number]
            for each in (self._out**2, self._out * self._into, self._into**2)
        )
        left = self._left - (self.played(out, into) - self._straight)
        ones = self._sums(self._out * left)[:, tracks, number]
        twos = self._sums(self._into * left)[:, tracks, number]
        least = 1e-6 * (a + c)
        a, c = a + least, c + least
        scale = a * c - b * b
        return (
            out[:, tracks, number] + (c * ones - b * twos) / scale,
            into[:, tracks, number] + (a * twos - b * ones) / scale,
        )
