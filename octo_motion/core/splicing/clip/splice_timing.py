# SPDX-License-Identifier: GPL-3.0-or-later
"""When a splice acts, how much, and which moment of the splice clip it shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import ClipError
from ...phrases import phrase
from ...rotations import Floats
from ...smoothing import smooth_step
from .clip import Clip
from .clip_clock import (
    ClipClock,
    MarkerPair,
    RateCurve,
    matched_clock,
    rated_clock,
    steady_clock,
)

Integers = NDArray[np.intp]

After = Literal["hold", "loop", "stop"]
AFTER: Final = ("hold", "loop", "stop")

_TELLING: Final = 16
"""Frames at most that say what an easing is as a whole."""

_ON_THE_WAY: Final = 64
"""Frames at most on which one frame of an easing hangs."""


@dataclass(frozen=True)
class Timing:
    """``splice_time = splice_start + (t − base_start) · rate``, over a length; the rate may change,
    and markers may say what is shown when.
    """

    base_start: float
    """Frame of the base at which the splice begins."""
    splice_start: float
    """Frame of the splice clip that is shown then."""
    rate: float = 1.0
    """Speed of the splice clip, 1 as it was recorded, whatever the frame rates are."""
    length: float | None = None
    """Frames of the base; none: as long as there is motion, or base."""
    ease_in: float = 0.0
    """Frames of the base over which the splice comes in, within its length."""
    ease_out: float = 0.0
    """Frames of the base over which it goes again, within its length."""
    after: After = "hold"
    """What happens when the splice clip runs out: its last pose, again from its first frame, or
    back to the base. Easing holds there too: over ``ease_out`` the clip slows down to its last
    pose, or goes; a round of a loop goes over ``ease_out`` and the next comes over ``ease_in``."""
    rates: RateCurve | None = None
    """In place of the rate, one that changes over the base's frames."""
    markers: tuple[MarkerPair, ...] = ()
    """What is shown when: those behind both starts are met, whatever the rate is; it holds after
    the last of them."""


@dataclass(frozen=True, eq=False)
class SpliceWindow:
    """What a timing means for the frames of a base."""

    frames: slice
    """The base's frames that the splice changes; of a cycle perhaps with others between them."""
    looks: Floats
    """(window,) their numbers; on a cyclic base in the round that begins where the splice does."""
    weights: Floats
    """(window,) 0 is the base, 1 the splice."""
    entering: Floats
    """(window,) the same, without going out again."""
    splice_frames: Floats
    """(window,) moments of the splice clip, in its own frame numbers."""
    rounds: Integers
    """(window,) how often the clip has begun again by then."""
    seams: Floats
    """(window,) of the step from the clip's last pose to its first: how much of it a frame takes
    on, so that the round before a seam and the one behind it meet."""
    seam_speeds: Floats
    """(window,) frames of the clip: how much a frame takes on of the step in speed, so that the two
    rounds meet at one speed as well."""
    ends: tuple[int, int]
    """The first and the last of these frames that are the base's own, and no moments between: there
    a way through the world begins and ends."""
    blended: bool = False
    """Whether a weight of its own lets it act in part: it then comes and goes as one."""
    told: Floats | None = None
    """(window,) :attr:`telling`, of a window of which some frames were taken."""

    def easing(self, row: int) -> list[int]:
        """The base's frames from this one to the middle of the easing in which it lies, and those
        that tell what it is as a whole.
        """
        number = row - self.frames.start
        if not 0 <= number < len(self.weights):
            return []
        for same in self.easings:
            place = np.flatnonzero(same == number)
            if len(place):
                center = window_middle(self.weights[same])
                first, last = sorted((int(place[0]), center))
                # Of a long way there, as many as show which way round it goes.
                rows = np.linspace(first, last, min(last - first + 1, _ON_THE_WAY)).astype(np.intp)
                rows = np.union1d(rows, np.flatnonzero(self.telling[same]))
                return (same[rows] + self.frames.start).tolist()
        return []

    @cached_property
    def telling(self) -> Floats:
        """(window,) how much frames say of what an easing is as a whole: a few, spread over it, by
        the time that they stand for and as base and splice are equally strong there.
        """
        if self.told is not None:
            return self.told
        says = np.zeros(len(self.weights))
        for each in self.easings:
            some = np.linspace(0, len(each) - 1, min(len(each), _TELLING)).round()
            rows = each[some.astype(np.intp)]
            steps = np.gradient(self.looks[rows]) if len(rows) > 1 else np.ones(1)
            says[rows] = steps * self.weights[rows] * (1.0 - self.weights[rows])
        return says

    @cached_property
    def easings(self) -> list[Integers]:
        """The window's rows in which it comes, and those in which it goes, as it sees them."""
        easing = (self.weights > 0.0) & (self.weights < 1.0)
        leaving = (self.weights < self.entering) & (not self.blended)
        chosen = (np.flatnonzero(easing & side) for side in (~leaving, leaving))
        return [rows[np.argsort(self.looks[rows])] for rows in chosen if len(rows)]

    def taken(self, rows: Integers) -> SpliceWindow:
        """Of some of the base's frames, ascending, as if the base had no others."""
        start, stop = np.searchsorted(rows, (self.frames.start, self.frames.stop))
        chosen = rows[start:stop] - self.frames.start
        first, last = np.searchsorted(chosen, self.ends)
        return SpliceWindow(
            slice(int(start), int(stop)),
            self.looks[chosen],
            self.weights[chosen],
            self.entering[chosen],
            self.splice_frames[chosen],
            self.rounds[chosen],
            self.seams[chosen],
            self.seam_speeds[chosen],
            (int(first), min(int(last), len(chosen) - 1)),
            self.blended,
            self.telling[chosen],
        )

    def weighted(self, shares: Floats) -> SpliceWindow:
        """The same with a weight of its own (window,), 0…1."""
        return replace(
            self,
            weights=self.weights * shares,
            entering=self.entering * shares,
            blended=bool((shares < 1.0).any()),
        )


def splice_clock(timing: Timing, base_rate: float, splice_rate: float) -> ClipClock:
    """Which moment of the splice clip each frame of the base shows, both with their frame rates.

    Raises:
        ClipError: rate, length or easing make no sense, or markers cross.
    """
    _check(timing)
    start, unit = (timing.base_start, timing.splice_start), splice_rate / base_rate
    if timing.markers:
        rate = timing.rate
        if timing.rates is not None:
            rate = float(timing.rates.at(np.array(max(each.base for each in timing.markers))))
        return matched_clock(start, timing.markers, rate * unit)
    if timing.rates is not None:
        return rated_clock(start, timing.rates, unit)
    return steady_clock(start, timing.rate * unit)


def splice_span(timing: Timing, base: Clip, splice: Clip) -> tuple[float, float]:
    """First and last moment of a splice, in the base's frames; the last may be infinite.

    Raises:
        ClipError: rate, length or easing make no sense, or markers cross.
    """
    clock = splice_clock(timing, base.rate, splice.rate)
    start, end = timing.base_start, np.inf
    if timing.length is not None:
        end = start + timing.length
    if timing.after == "stop":
        end = min(end, max(float(clock.when(splice.frames[-1])), start))
    # No longer than a cycle of the base: there the splice begins again.
    return start, float(min(end, start + base.cycle))


def splice_window(
    timing: Timing,
    base: Clip,
    splice: Clip,
    *,
    wraps: bool = True,
    moments: Floats | None = None,
) -> SpliceWindow:
    """Frames, weights and moments of a splice.

    On a cyclic base it acts in every round alike: what lies beyond the end of one comes at the
    start of the next. A loop as long as a round never comes nor goes, and is fitted to it by whole
    rounds of its own.

    Args:
        timing: when it is.
        base: the base.
        splice: the splice clip.
        wraps: whether a splice may begin at the end of a cyclic base and end at its start.
        moments: (moments,) of the base at which to look, if not on its frames: for all that is said
            of them afterwards they are the frames. Those of the base in the splice are among them.

    Raises:
        ClipError: rate, length or easing make no sense, or markers cross.
    """
    start, end = splice_span(timing, base, splice)
    clock = splice_clock(timing, base.rate, splice.rate)
    times = splice.frames[0], splice.frames[-1]
    looks = given = base.frames if moments is None else moments
    endless = base.cyclic and timing.after == "loop" and end - start >= base.cycle - 1e-6
    if endless:
        clock = clock.fitted(base.cycle, times[1] - times[0])
    if base.cyclic and wraps:
        looks = start + np.mod(looks - start + 1e-6, base.cycle) - 1e-6
    elif base.cyclic and not endless:
        end = min(end, float(base.frames[-1]))
    inside = (looks >= start - 1e-5) & (looks <= end + 1e-6)
    chosen = np.flatnonzero(inside)
    frames = slice(int(chosen[0]), int(chosen[-1]) + 1) if len(chosen) else slice(0, 0)
    inside, looks = inside[frames], looks[frames]
    weights = entering = np.ones(len(looks))
    if not endless:
        weights, entering = _eased(looks, (start, end), (timing.ease_in, timing.ease_out))
        # Between an end and a start the base is as it was.
        weights, entering = np.where(inside, weights, 0.0), np.where(inside, entering, 1.0)
    rounds, seams = np.zeros(len(looks), dtype=np.intp), np.zeros((2, len(looks)))
    shown = clock.at(looks)
    if timing.after == "loop":
        eases = timing.ease_in, timing.ease_out
        shown, rounds, seams = _looped(looks, clock, times, eases, endless=endless)
    elif timing.after == "hold":
        shown = clock.at(_slowed(looks, float(clock.when(times[1])), timing.ease_out))
    own = np.flatnonzero(np.isin(given[frames], base.frames))
    ends = (int(own[0]), int(own[-1])) if len(own) else (0, len(looks) - 1)
    return SpliceWindow(frames, looks, weights, entering, shown, rounds, seams[0], seams[1], ends)


def _eased(
    looks: Floats, span: tuple[float, float], eases: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Weights, and those of coming in alone."""
    weights = entering = np.ones(len(looks))
    if eases[0] > 0.0:
        weights = entering = smooth_step((looks - span[0]) / eases[0])
    if eases[1] > 0.0 and np.isfinite(span[1]):
        weights = np.minimum(weights, smooth_step((span[1] - looks) / eases[1]))
    return weights, entering


def _looped(
    looks: Floats,
    clock: ClipClock,
    times: tuple[float, float],
    eases: tuple[float, float],
    *,
    endless: bool,
) -> tuple[Floats, Integers, Floats]:
    """Moments within the clip, rounds, and shares (2, window) of the steps in pose and speed.

    ``endless``: whether a round comes before the first and after the last one.
    """
    (first, last), seams = times, np.zeros((2, len(looks)))
    period, moments = last - first, clock.at(looks)
    # The last frame itself is shown once, before the clip begins anew.
    over = moments > last + 1e-6
    rounds = np.where(over, np.floor((moments - first) / period + 1e-9), 0.0)
    wrapped = moments - rounds * period
    if sum(eases) <= 0.0 or not len(rounds):
        return wrapped, rounds.astype(np.intp), seams
    before = eases[1] / sum(eases)
    # Of the frames at which a round begins and ends, the speeds with which the clip goes by.
    numbers, own = np.unique(rounds, return_inverse=True)
    begins, ends = (clock.when(first + (numbers + behind) * period) for behind in (0.0, 1.0))
    ease_in, ease_out = (np.minimum(ease, 0.5 * (ends - begins))[own] for ease in eases)
    leaves, arrives = clock.speed(begins)[own], clock.speed(ends)[own]
    if eases[1] > 0.0:
        share = np.clip(1.0 - (ends[own] - looks) / ease_out, 0.0, 1.0)
        goes = before * np.stack([smooth_step(share), arrives * ease_out * _swing(share)])
        seams += np.where(endless | (rounds < rounds.max()), goes, 0.0)
    if eases[0] > 0.0:
        share = np.clip(1.0 - (looks - begins[own]) / ease_in, 0.0, 1.0)
        comes = np.stack([-smooth_step(share), leaves * ease_in * _swing(share)])
        seams += np.where(endless | (rounds > 0), (1.0 - before) * comes, 0.0)
    return wrapped, rounds.astype(np.intp), seams


def _swing(share: Floats) -> Floats:
    """``t³ − t²``: nothing at either end, level at the first, and with slope one at the other."""
    return share * share * (share - 1.0)


def _slowed(looks: Floats, end: float, ease: float) -> Floats:
    """Frames that slow down to the one at which the clip ends where they would run past it."""
    if not len(looks) or looks.max() <= end + 1e-6:
        return looks
    ease = min(ease, max(end - float(looks.min()), 0.0))
    if ease <= 0.0:
        return looks
    left = np.clip(ease - (looks - end), 0.0, 2.0 * ease)
    return np.where(left < 2.0 * ease, end - left**2 / (4.0 * ease), looks)


def _check(timing: Timing) -> None:
    numbers = (timing.base_start, timing.splice_start, timing.rate, timing.length or 0.0)
    if not np.isfinite((*numbers, timing.ease_in, timing.ease_out)).all():
        raise ClipError("The timing has values that are no numbers.", "Enter them again.")
    if timing.rate <= 0.0 or (timing.rates is not None and not (timing.rates.rates > 0.0).all()):
        raise ClipError("The rate of a splice must be above zero.", "Enter 1 for normal speed.")
    if timing.length is not None and timing.length <= 0.0:
        raise ClipError("The length of a splice must be above zero.", "Enter a number of frames.")
    if timing.ease_in < 0.0 or timing.ease_out < 0.0:
        raise ClipError("Easing cannot be below zero.", "Enter 0 for a hard cut.")
    if timing.after not in AFTER:
        raise ClipError(
            phrase("'{after}' is no ending.", after=timing.after), "Choose hold, loop or stop."
        )


def moments_within(
    base: Clip, spans: Iterable[tuple[float, float]], finer: int, step: float
) -> Floats:
    """Moments at which to look at what is spliced: between frames too, and where it begins and
    ends. Of a cyclic base they are all over it.

    Args:
        base: what is spliced onto.
        spans: first and last moment of each splice.
        finer: moments per frame.
        step: frames from the moment before a splice to its first, and from its last to the one
            behind it.

    Returns:
        (moments,) of the base ascending, all of its frames in these spans among them.
    """
    frames = base.frames
    count = finer * (len(frames) - 1) + 1
    grid = np.interp(np.arange(count) / finer, np.arange(len(frames)), frames)
    chosen = np.full(count, base.cyclic)
    borders: list[float] = []
    for start, end in spans:
        # One further moment on either side, at which nothing is spliced.
        chosen |= (grid >= start - 1.0) & (grid <= end + 1.0)
        borders += [start - step, start, end, end + step]
    found = np.array(borders)[np.isfinite(borders)]
    if base.cyclic:
        found = grid[0] + np.mod(found - grid[0], base.cycle)
    found = np.unique(found[(found > grid[0]) & (found < grid[-1])])
    extra = found[_from_nearest(found, frames) > 0.5 * step]
    # What of the finer moments all but falls on one of these says nothing of its own.
    crowded = ~np.isin(grid, frames) & (_from_nearest(grid, extra) < 2.0 * step)
    return np.union1d(grid[chosen & ~crowded], extra)


def _from_nearest(looks: Floats, frames: Floats) -> Floats:
    """How far each moment is from the nearest of some frames."""
    if not len(frames):
        return np.full(len(looks), np.inf)
    after = np.clip(np.searchsorted(frames, looks), 1, max(len(frames) - 1, 1))
    sides = (frames[np.minimum(after - side, len(frames) - 1)] for side in (0, 1))
    return np.minimum(*(np.abs(looks - each) for each in sides))


def window_middle(weights: Floats) -> int:
    """Where base and splice are about equally strong."""
    return int(np.argmin(np.abs(weights - 0.5)))
