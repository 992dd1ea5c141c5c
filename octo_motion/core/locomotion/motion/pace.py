# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a gait has frames enough to be seen, and what to change if not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from ..path import Route, TravelSettings, duration, strides
from .job import Timing

_HURRIED: Final = 40.0
"""Frames of a cycle below which keys that lead on from frame to frame by themselves would let arms
slide and dip in between."""
_SWING: Final = 5.0
"""Frames that an arm needs at least to let go, swing and lie down: with fewer it jumps."""


@dataclass(frozen=True)
class Pace:
    """How many frames a cycle of the gait has."""

    mean: float
    """Over all of the motion."""
    fastest: float
    """Where the body goes at full speed."""

    @property
    def hurried(self) -> bool:
        """Whether what is between frames is to be looked at, too."""
        return self.mean < _HURRIED


def pace_of(route: Route, travel: TravelSettings, frames: float) -> Pace:
    """The pace of a journey that takes so many frames, which need not be whole."""
    mean = frames / max(strides(route, travel), 1e-9)
    # While it eases in and out, the body is slower than in between.
    return Pace(mean, mean * route.length / duration(route, travel, 1.0))


def too_few_frames(timing: Timing, pace: Pace) -> list[str]:
    """What there is to say of arms that have no frames to swing in, with what would do.

    Args:
        timing: how the motion's frames are found.
        pace: of the motion.
    """
    swing = (1.0 - timing.duty) * pace.fastest
    if swing >= _SWING:
        return []
    longer = _SWING / swing
    if timing.kind == "RANGE":
        length = (timing.end - timing.start) * longer
        end = timing.start + math.ceil(length - 1e-6)
        remedy = f"Let it end at frame {end:,} or later"
    elif timing.kind == "SPEED":
        slowest = math.floor(1e3 * timing.speed / longer) / 1e3
        remedy = f"Lower Speed to {slowest:g} m/s"
    else:
        cycle = math.ceil(1e2 * timing.cycle_time * longer) / 1e2
        remedy = f"Raise Cycle to {cycle:g} s"
    had = math.floor(10.0 * swing) / 10.0
    return [
        (
            f"At full speed an arm has {had:g} frames for a swing and jumps from pose to pose: "
            f"{pace.fastest / timing.rate:.2g} s a cycle are too short. {remedy}, or give the gait "
            "a longer stride."
        )
    ]
