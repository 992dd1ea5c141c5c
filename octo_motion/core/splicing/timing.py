# SPDX-License-Identifier: GPL-3.0-or-later
"""When a splice acts, how much, and which moment of the splice clip it shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from ..errors import ClipError
from ..rotations import Floats
from .clip import Clip

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
    back to the base."""


@dataclass(frozen=True, eq=False)
class Window:
    """What a timing means for the frames of a base."""

    frames: slice
    """The base's frames that the splice changes."""
    weights: Floats
    """(window,) 0 is the base, 1 the splice."""
    entering: Floats
    """(window,) the same, without going out again."""
    splice_frames: Floats
    """(window,) moments of the splice clip, in its own frame numbers."""


def window(timing: Timing, base: Clip, splice: Clip) -> Window:
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
        weights = entering = _smooth(passed / timing.ease_in)
    if timing.ease_out > 0.0 and np.isfinite(end):
        weights = np.minimum(weights, _smooth((end - base.frames[frames]) / timing.ease_out))
    moments = timing.splice_start + passed * step
    if timing.after == "loop":
        period = times[1] - times[0]
        # The last frame itself is shown once, before the clip begins anew.
        over = moments > times[1] + 1e-6
        moments[over] = times[0] + np.mod(moments[over] - times[0], period)
    return Window(frames, weights, entering, moments)


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


def _smooth(share: Floats) -> Floats:
    bounded = np.clip(share, 0.0, 1.0)
    return bounded * bounded * (3.0 - 2.0 * bounded)
