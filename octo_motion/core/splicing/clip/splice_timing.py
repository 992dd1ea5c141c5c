# SPDX-License-Identifier: GPL-3.0-or-later
"""When a splice acts, how much, and which moment of the splice clip it shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import ClipError
from ...rotations import Floats
from ...smoothing import smooth_step
from .clip import Clip

Integers = NDArray[np.intp]

After = Literal["hold", "loop", "stop"]
AFTER: Final = ("hold", "loop", "stop")


@dataclass(frozen=True)
class Timing:
    """``splice_time = splice_start + (t − base_start) · rate``, over a length."""

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


@dataclass(frozen=True, eq=False)
class SpliceWindow:
    """What a timing means for the frames of a base."""

    frames: slice
    """The base's frames that the splice changes."""
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

    def easing(self, row: int) -> range:
        """The base's frames from this one to the middle of the easing in which it lies."""
        number = row - self.frames.start
        if not 0 <= number < len(self.weights) or self.weights[number] >= 1.0:
            return range(row, row)
        leaving = self.weights < self.entering
        same = np.flatnonzero((self.weights < 1.0) & (leaving == leaving[number]))
        center = int(same[window_middle(self.weights[same])]) + self.frames.start
        return range(min(row, center), max(row, center) + 1)

    def taken(self, rows: Integers) -> SpliceWindow:
        """Of some of the base's frames, ascending, as if the base had no others."""
        start, stop = np.searchsorted(rows, (self.frames.start, self.frames.stop))
        chosen = rows[start:stop] - self.frames.start
        return SpliceWindow(
            slice(int(start), int(stop)),
            self.weights[chosen],
            self.entering[chosen],
            self.splice_frames[chosen],
            self.rounds[chosen],
            self.seams[chosen],
        )


def splice_window(timing: Timing, base: Clip, splice: Clip) -> SpliceWindow:
    """Frames, weights and moments of a splice.

    Raises:
        ClipError: rate, length or easing make no sense.
    """
    _check(timing)
    # Frames of the splice clip per frame of the base.
    step = timing.rate * splice.rate / base.rate
    times = splice.frames[0], splice.frames[-1]
    start, end = timing.base_start, np.inf
    if timing.length is not None:
        end = start + timing.length
    if timing.after == "stop":
        end = min(end, start + max(times[1] - timing.splice_start, 0.0) / step)
    inside = (base.frames >= start - 1e-6) & (base.frames <= end + 1e-6)
    chosen = np.flatnonzero(inside)
    frames = slice(int(chosen[0]), int(chosen[-1]) + 1) if len(chosen) else slice(0, 0)
    passed = base.frames[frames] - start
    weights = entering = np.ones(len(passed))
    if timing.ease_in > 0.0:
        weights = entering = smooth_step(passed / timing.ease_in)
    if timing.ease_out > 0.0 and np.isfinite(end):
        weights = np.minimum(weights, smooth_step((end - base.frames[frames]) / timing.ease_out))
    moments = timing.splice_start + passed * step
    rounds, seams = np.zeros(len(passed), dtype=np.intp), np.zeros(len(passed))
    eases = timing.ease_in * step, timing.ease_out * step
    if timing.after == "loop":
        moments, rounds, seams = _looped(moments, times, eases)
    elif timing.after == "hold":
        moments = _slowed(moments, times, eases[1])
    return SpliceWindow(frames, weights, entering, moments, rounds, seams)


def _looped(
    moments: Floats, times: tuple[float, float], eases: tuple[float, float]
) -> tuple[Floats, Integers, Floats]:
    """Moments within the clip, rounds, and shares of the step at the seams."""
    (first, last), (ease_in, ease_out) = times, eases
    period = last - first
    # The last frame itself is shown once, before the clip begins anew.
    over = moments > last + 1e-6
    rounds = np.where(over, np.floor((moments - first) / period + 1e-9), 0.0)
    wrapped = moments - rounds * period
    ease_in, ease_out = min(ease_in, 0.5 * period), min(ease_out, 0.5 * period)
    seams = np.zeros(len(moments))
    if ease_in + ease_out > 0.0 and len(rounds):
        before = ease_out / (ease_in + ease_out)
        goes_on = rounds < rounds[-1]
        if ease_out > 0.0:
            going = before * smooth_step(1.0 - (last - wrapped) / ease_out)
            seams += np.where(goes_on, going, 0.0)
        if ease_in > 0.0:
            coming = (1.0 - before) * smooth_step(1.0 - (wrapped - first) / ease_in)
            seams -= np.where(rounds > 0, coming, 0.0)
    return wrapped, rounds.astype(np.intp), seams


def _slowed(moments: Floats, times: tuple[float, float], ease: float) -> Floats:
    """Moments that slow down to the clip's last one where they would run past it."""
    last = times[1]
    if not len(moments) or moments[-1] <= last + 1e-6:
        return moments
    ease = min(ease, max(last - moments[0], 0.0))
    if ease <= 0.0:
        return moments
    left = np.clip(ease - (moments - last), 0.0, 2.0 * ease)
    return np.where(left < 2.0 * ease, last - left**2 / (4.0 * ease), moments)


def _check(timing: Timing) -> None:
    numbers = (timing.base_start, timing.splice_start, timing.rate, timing.length or 0.0)
    if not np.isfinite((*numbers, timing.ease_in, timing.ease_out)).all():
        raise ClipError("The timing has values that are no numbers.", "Enter them again.")
    if timing.rate <= 0.0:
        raise ClipError("The rate of a splice must be above zero.", "Enter 1 for normal speed.")
    if timing.length is not None and timing.length <= 0.0:
        raise ClipError("The length of a splice must be above zero.", "Enter a number of frames.")
    if timing.ease_in < 0.0 or timing.ease_out < 0.0:
        raise ClipError("Easing cannot be below zero.", "Enter 0 for a hard cut.")
    if timing.after not in AFTER:
        raise ClipError(f"'{timing.after}' is no ending.", "Choose hold, loop or stop.")


def window_middle(weights: Floats) -> int:
    """Where base and splice are about equally strong."""
    return int(np.argmin(np.abs(weights - 0.5)))
