# SPDX-License-Identifier: GPL-3.0-or-later
"""Which moment of a splice clip each frame of the base shows, at constant speed or warped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from ...errors import ClipError
from ...phrases import phrase
from ...rotations import Floats

_STEEPEST: Final = 3.0
"""Of the mean speed between two markers: up to there a clip never runs backwards."""

_SLOWEST: Final = 0.25
"""Of the same: with which a clip begins at least."""

_HALVINGS: Final = 50
"""By which a moment is found: as near as floating point tells."""


@dataclass(frozen=True)
class MarkerPair:
    """A marker of the base, and that of the clip which belongs to it."""

    name: str
    base: float
    """Frame of the base."""
    clip: float
    """Frame of the clip that is shown then."""


@dataclass(frozen=True, eq=False)
class RateCurve:
    """A rate that changes; constant before and after."""

    frames: Floats
    """(samples,) of the base, ascending."""
    rates: Floats
    """(samples,) above zero."""

    def at(self, frames: Floats) -> Floats:
        """Rates (frames,) at frames of the base."""
        return np.interp(frames, self.frames, self.rates)


@dataclass(frozen=True, eq=False)
class ClipClock:
    """Moments of a clip over frames of a base: cubic from knot to knot with given speeds, so that
    the speed is continuous, and straight on beyond the first and the last. It never stands still.
    """

    frames: Floats
    """(knots,) of the base, ascending."""
    moments: Floats
    """(knots,) of the clip, ascending."""
    speeds: Floats
    """(knots,) moments per frame."""

    def at(self, frames: Floats) -> Floats:
        """Moments (…) that frames (…) of the base show."""
        before, share, step = self._within(frames)
        if step is None:
            return self.moments[before] + (frames - self.frames[before]) * self.speeds[before]
        return self._cubic(before, share, step)

    def speed(self, frames: Floats) -> Floats:
        """Moments per frame (…) at frames (…) of the base."""
        before, share, step = self._within(frames)
        if step is None:
            return np.broadcast_to(self.speeds[before], frames.shape)
        rise = (self.moments[before + 1] - self.moments[before]) / step
        first, last = self.speeds[before], self.speeds[before + 1]
        inside = 6.0 * share * (1.0 - share) * rise
        inside += (1.0 - share) * (1.0 - 3.0 * share) * first + share * (3.0 * share - 2.0) * last
        outside = np.where(share < 0.0, first, last)
        return np.where((share < 0.0) | (share > 1.0), outside, inside)

    def when(self, moments: Floats) -> Floats:
        """Frames (…) of the base that show these moments (…)."""
        first, last = self.frames[0], self.frames[-1]
        early = first + (moments - self.moments[0]) / self.speeds[0]
        late = last + (moments - self.moments[-1]) / self.speeds[-1]
        low, high = np.full(np.shape(moments), first), np.full(np.shape(moments), last)
        if len(self.frames) > 1:
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                beyond = self.at(middle) > moments
                low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        inside = np.where(moments < self.moments[0], early, low)
        return np.where(moments >= self.moments[-1], late, inside)

    def fitted(self, frames: float, period: float) -> ClipClock:
        """The same a little faster or slower: in so many frames from its first knot on whole
        periods of the clip go by.
        """
        start = self.moments[0]
        gone = float(self.at(self.frames[0] + frames) - start)
        factor = max(round(gone / period), 1) * period / gone
        moments = start + factor * (self.moments - start)
        return ClipClock(self.frames, moments, factor * self.speeds)

    def _within(self, frames: Floats) -> tuple[np.ndarray, Floats, Floats | None]:
        """The knot before each frame, how far it is to the next, and how many frames that is; none
        where there is only one.
        """
        last = len(self.frames) - 2
        if last < 0:
            return np.zeros(np.shape(frames), dtype=np.intp), np.zeros(np.shape(frames)), None
        before = np.clip(np.searchsorted(self.frames, frames, side="right") - 1, 0, last)
        step = self.frames[before + 1] - self.frames[before]
        return before, (frames - self.frames[before]) / step, step

    def _cubic(self, before: np.ndarray, share: Floats, step: Floats) -> Floats:
        first, last = self.moments[before], self.moments[before + 1]
        leaves, arrives = step * self.speeds[before], step * self.speeds[before + 1]
        t = np.clip(share, 0.0, 1.0)
        rise = t * t * (3.0 - 2.0 * t)
        value = first + rise * (last - first) + t * (1.0 - t) * ((1.0 - t) * leaves - t * arrives)
        return value + np.minimum(share, 0.0) * leaves + np.maximum(share - 1.0, 0.0) * arrives


def steady_clock(start: tuple[float, float], speed: float) -> ClipClock:
    """Constant speed from a start, a frame of the base and a moment of the clip."""
    return ClipClock(np.array([start[0]]), np.array([start[1]]), np.array([speed]))


def rated_clock(start: tuple[float, float], curve: RateCurve, unit: float) -> ClipClock:
    """A speed that changes: ``unit`` moments per frame where the rate is 1."""
    frames = np.concatenate([[start[0]], curve.frames[curve.frames > start[0] + 1e-6]])
    speeds = unit * curve.at(frames)
    # Between samples the speed is linear, so that the cubic has just these means.
    steps = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(frames)
    return ClipClock(frames, start[1] + np.concatenate([[0.0], np.cumsum(steps)]), speeds)


def matched_clock(
    start: tuple[float, float], pairs: Sequence[MarkerPair], speed: float
) -> ClipClock:
    """From a start through all pairs of markers behind it, at the given speed after the last.

    The way between is a monotone piecewise cubic (Fritsch and Carlson, "Monotone Piecewise Cubic
    Interpolation", 1980; its speeds after Fritsch and Butland, 1984). After the last pair the clip
    goes on with the given speed, or with three times the one before, whichever is less.

    Raises:
        ClipError: markers follow each other otherwise in the clip than in the base.
    """
    behind = [each for each in pairs if each.base > start[0] + 1e-6 and each.clip > start[1] + 1e-6]
    behind.sort(key=lambda each: each.base)
    for one, other in pairwise(behind):
        if other.clip <= one.clip or other.base <= one.base:
            raise ClipError(
                phrase(
                    "The markers '{one}' and '{other}' do not follow each other in the clip as "
                    "they do in the base.",
                    one=one.name,
                    other=other.name,
                ),
                "Move them, or give one of them a name that the other motion does not have.",
            )
    if not behind:
        return steady_clock(start, speed)
    frames = np.array([start[0], *(each.base for each in behind)])
    moments = np.array([start[1], *(each.clip for each in behind)])
    steps = np.diff(frames)
    means = np.diff(moments) / steps
    speeds = np.empty(len(frames))
    speeds[0] = means[0]
    if len(steps) > 1:
        weights = np.stack([2.0 * steps[1:] + steps[:-1], steps[1:] + 2.0 * steps[:-1]])
        slowness = weights[0] / means[:-1] + weights[1] / means[1:]
        speeds[1:-1] = weights.sum(axis=0) / slowness
        ahead = (2.0 * steps[0] + steps[1]) * means[0] - steps[0] * means[1]
        ahead /= steps[0] + steps[1]
        speeds[0] = np.clip(ahead, _SLOWEST * means[0], _STEEPEST * means[0])
    speeds[-1] = min(speed, _STEEPEST * means[-1])
    return ClipClock(frames, moments, speeds)
