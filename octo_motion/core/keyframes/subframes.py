# SPDX-License-Identifier: GPL-3.0-or-later
"""Moments between frames, as frames alone do not say how curves have to go.

A curve from one key to another a few frames later has handles that no frame has much to say about:
it may be right at every frame and swing out in between, where a foot would slide. So the motion is
looked at half way between frames, too: as it would go with a key on each of them and automatic
handles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from .tracks import Booleans, Limb, Track

_HANDLE: Final = 1.0 / 2.5614
"""Length of an automatic handle, as a share of the time between two keys."""


@dataclass(frozen=True, eq=False)
class Fine:
    """A limb at all moments at which it is looked at."""

    times: Floats
    """(moments,)"""
    limb: Limb
    allowed: Booleans
    """(moments,) where there may be a key."""

    def marked(self, marks: Booleans) -> Booleans:
        """Marks (rows, moments) that are given at frames (rows, frames), or at all moments."""
        if marks.shape[1] == len(self.times):
            return marks
        result = np.zeros((len(marks), len(self.times)), dtype=bool)
        result[:, self.allowed] = marks
        return result


def with_halves(times: Floats, limb: Limb) -> Fine:
    """A limb on frames and half way between them.

    Args:
        times: (frames,) at least two.
        limb: at the frames.
    """

    def closer(bound: Floats) -> Floats:
        """Bounds half way, which are those of both frames."""
        looser = np.isinf(bound[:-1]) | np.isinf(bound[1:])
        return joined(bound, np.where(looser, np.inf, np.minimum(bound[:-1], bound[1:])))

    tracks = [Track(joined(each.values, _halves(each.values)), each.kind) for each in limb.tracks]
    finer = replace(
        limb,
        tracks=tracks,
        distance=closer(np.broadcast_to(limb.distance, len(times))),
        room=None if limb.room is None else closer(limb.room),
    )
    moments = joined(times, 0.5 * (times[:-1] + times[1:]))
    return Fine(moments, finer, np.arange(len(moments)) % 2 == 0)


def looked_at(times: Floats, limb: Limb, every: int) -> Fine:
    """A limb at all moments that matter: between frames, too, where something hangs on it.

    Args:
        times: (moments,) at least two.
        limb: at those moments.
        every: at every how many of them there is a frame, from the first to the last.
    """
    if every == 1 and (limb.chain is not None or limb.lever > 0.0):
        return with_halves(times, limb)
    return Fine(times, limb, np.arange(len(times)) % every == 0)


def joined(frames: NDArray[Any], halves: NDArray[Any]) -> NDArray[Any]:
    """What is on frames (frames, …) and half way between them (frames − 1, …), in turn."""
    result = np.empty((len(frames) + len(halves), *frames.shape[1:]), dtype=frames.dtype)
    result[::2], result[1::2] = frames, halves
    return result


def halfway_values(values: Floats, slopes: Floats) -> Floats:
    """What is played half way from each frame to the next (frames − 1, …).

    Args:
        values: (frames, …) of keys with automatic handles.
        slopes: (frames, …) of these, per frame.
    """
    return 0.5 * (values[:-1] + values[1:]) + 0.375 * _HANDLE * (slopes[:-1] - slopes[1:])


def _halves(values: Floats) -> Floats:
    """Half way from each frame's values (frames, components) to the next one's."""
    slopes = np.gradient(values, axis=0)
    slopes[[0, -1]] = 0.0
    return halfway_values(values, slopes)
