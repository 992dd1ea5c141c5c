# SPDX-License-Identifier: GPL-3.0-or-later
"""Moments between frames, where keys stand so close that frames alone do not say how to go.

A curve from one key to another a frame or two later has handles that no frame has much to say
about: it may be right at every frame and swing out in between. So the motion is looked at half way
between such frames, too: as it would go with a key on each of them and automatic handles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from .key_limbs import Booleans, Limb, Track
from .rotations import Floats

_CLOSE: Final = 7
"""Frames from one key to the next up to which moments in between are looked at."""
_HANDLE: Final = 1.0 / 2.5614
"""Length of an automatic handle, as a share of the time between two keys."""


@dataclass(frozen=True, eq=False)
class Fine:
    """A limb at frames and at some moments in between."""

    times: Floats
    """(moments,)"""
    limb: Limb
    keyed: Booleans
    """(columns, moments)"""
    corners: Booleans
    """(tracks, moments)"""
    allowed: Booleans
    """(moments,) which are frames."""


def with_halves(times: Floats, limb: Limb, keyed: Booleans, corners: Booleans) -> Fine:
    """A limb, and half way between two frames where keys stand close.

    Args:
        times: (frames,) at least two.
        limb: at the frames.
        keyed: (columns, frames) where there are keys, the first and the last frame among them.
        corners: (tracks, frames) where the motion has corners.
    """
    close = np.zeros(len(times) - 1, dtype=bool)
    for column in keyed:
        lengths = np.diff(np.flatnonzero(column))
        close |= np.repeat(lengths <= _CLOSE, lengths)
    (before,) = np.nonzero(close)
    at = np.arange(len(times)) + np.concatenate([[0], np.cumsum(close)])
    between = at[before] + 1
    allowed = np.zeros(len(times) + len(before), dtype=bool)
    allowed[at] = True

    def joined(frames: np.ndarray, halves: np.ndarray) -> np.ndarray:
        result = np.empty((len(allowed), *frames.shape[1:]), dtype=frames.dtype)
        result[at], result[between] = frames, halves
        return result

    def wider(bound: Floats) -> Floats:
        """What bounds a joint on both frames bounds it in between."""
        return joined(bound, np.maximum(bound[before], bound[before + 1]))

    def spread(marks: Booleans) -> Booleans:
        halves = np.zeros((len(before), len(marks)), dtype=bool)
        return np.ascontiguousarray(joined(marks.T, halves).T)

    tracks = [
        Track(joined(each.values, _halves(each.values)[before]), each.kind) for each in limb.tracks
    ]
    finer = replace(
        limb,
        tracks=tracks,
        distance=wider(np.broadcast_to(limb.distance, len(times))),
        room=None if limb.room is None else wider(limb.room),
    )
    moments = joined(times, 0.5 * (times[before] + times[before + 1]))
    return Fine(moments, finer, spread(keyed), spread(corners), allowed)


def _halves(values: Floats) -> Floats:
    """Half way from each frame's values (frames, components) to the next one's."""
    slopes = np.gradient(values, axis=0)
    slopes[[0, -1]] = 0.0
    return 0.5 * (values[:-1] + values[1:]) + 0.375 * _HANDLE * (slopes[:-1] - slopes[1:])
