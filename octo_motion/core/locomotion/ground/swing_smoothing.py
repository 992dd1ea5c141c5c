# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms in the air that move evenly over time.

Each frame of an arm is solved by itself, and so is what it is raised by, or drawn to. All that is
continuous, but an arm turns now more and now less from frame to frame, and an eye sees that. So the
directions of its segments are evened out over the frames before and after, wherever it holds on to
nothing. What it makes of a frame hangs on the frames round it and on nothing else: it is the same
in whatever portions a motion is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats

_PASSES: Final = 4
"""Means in a row: what comes of them falls off like a bell."""
_TINY: Final = 1e-12


@dataclass(frozen=True)
class SwingSmoothing:
    """Means over time: of so many frames, in part of one frame more to either side."""

    frames: int
    """To either side of each mean."""
    more: float
    """Share of the mean of one frame more, 0…1."""

    @classmethod
    def over(cls, cycles: float, frames_per_cycle: float) -> SwingSmoothing | None:
        """Means over so many cycles before and after each frame; none where that is nothing.

        Weights that fall off evenly to nothing within h have a variance of h² / 6, as has the
        rounding of a gait's table (``GaitCurve.rounding``). That of a mean over k frames to either
        side is k (k + 1) / 3, and variances of means in a row add up.

        Args:
            cycles: h, in cycles of the gait.
            frames_per_cycle: of the gait.
        """
        variance = (cycles * frames_per_cycle) ** 2 / 6.0 / _PASSES
        if not variance > 0.0:
            return None
        frames = int(0.5 * (np.sqrt(1.0 + 12.0 * variance) - 1.0))
        less = frames * (frames + 1) / 3.0
        return cls(frames, float((variance - less) / (2.0 * (frames + 1) / 3.0)))

    @property
    def reach(self) -> int:
        """Frames to either side that what is made of a frame hangs on."""
        return _PASSES * (self.frames + 1)

    def evened(self, directions: Floats, share: Floats) -> Floats:
        """Directions (segments, 3, frames, arms), evened out over frames that follow one another.

        Before the first and after the last frame it goes on as it is there: those within
        :attr:`reach` of an end that is none of the motion's own are of no use.

        Args:
            directions: unit vectors.
            share: (frames, arms) how far an arm is to be evened out, 0…1.
        """
        result = directions
        for _ in range(_PASSES):
            mean = self._mean(result)
            mean -= result
            mean *= share
            mean += result
            # Half a turn within a few frames has no middle: it stays of some length.
            size = np.sqrt(np.einsum("scfa,scfa->sfa", mean, mean))
            mean /= np.maximum(size, _TINY)[:, None]
            result = mean
        return result

    def _mean(self, values: Floats) -> Floats:
        """Means (segments, 3, frames, arms) over the frames round each."""
        most, count = self.frames + 1, values.shape[2]
        frames_around = values[:, :, np.clip(np.arange(-most, count + most), 0, count - 1)]
        weights = np.full(2 * most + 1, (1.0 - self.more) / (2 * most - 1))
        weights[[0, -1]] = 0.0
        weights += self.more / (2 * most + 1)
        result = weights[0] * frames_around[:, :, :count]
        for step, weight in enumerate(weights[1:].tolist(), start=1):
            result += weight * frames_around[:, :, step : step + count]
        return result


def frames_around(part: slice, reach: int, count: int, *, cyclic: bool) -> tuple[np.ndarray, slice]:
    """Numbers of some frames and of those round them, and where among these the frames are.

    Args:
        part: frames that follow one another.
        reach: how many more to either side.
        count: frames of the whole motion.
        cyclic: whether the last frame is the first again.
    """
    if not cyclic or count < 2:
        first = max(part.start - reach, 0)
        own = slice(part.start - first, part.stop - first)
        return np.arange(first, min(part.stop + reach, count)), own
    # The first and the last are left as they are: only what is beyond them goes round.
    numbers = np.arange(part.start - reach, part.stop + reach)
    outside = (numbers < 0) | (numbers >= count)
    numbers = np.where(outside, numbers % (count - 1), numbers)
    return numbers, slice(reach, reach + part.stop - part.start)
