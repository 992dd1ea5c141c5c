# SPDX-License-Identifier: GPL-3.0-or-later
"""Gentle ways from one value to another, and values spread over the frames about them."""

from __future__ import annotations

from typing import Final

import numpy as np

from .rotations import Floats

# --- Ways from 0 to 1 that begin and end gently, of shares (…); they are held beyond both ends ----


def smooth_step(share: Floats) -> Floats:
    """``3t² − 2t³``: level at both ends."""
    t = np.minimum(np.maximum(share, 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def least_jerk(share: Floats) -> Floats:
    """``10t³ − 15t⁴ + 6t⁵``: no acceleration at its ends either.

    Of all movements from rest to rest in a time it has the least jerk (Flash and Hogan, "The
    coordination of arm movements", Journal of Neuroscience 5, 1985). Next to a rest nothing moves
    at first.
    """
    t = np.minimum(np.maximum(share, 0.0), 1.0)
    return t * t * t * (10.0 + t * (6.0 * t - 15.0))


def even_pace(share: Floats, ease: float) -> Floats:
    """From 0 to 1 at a pace of 1 / (1 − ``ease``), but for a share of the time at either end in
    which it comes and goes evenly: 0 < ``ease`` ≤ 1/2. Where :func:`smooth_step` is quickest in the
    middle, by 3/2, it is nowhere quicker.
    """
    t = np.minimum(np.maximum(share, 0.0), 1.0)
    coming, going = np.minimum(t, ease), np.maximum(t - (1.0 - ease), 0.0)
    even = np.maximum(t - ease, 0.0)
    return (0.5 * coming * coming / ease + even - 0.5 * going * going / ease) / (1.0 - ease)


# --- What happens at some frames, spread over those before and after it ---------------------------
#
# A value at one frame hangs on the frames round it, the same number to either side, and on nothing
# else: it is the same in whatever portions a motion is made. A loop has no ends; elsewhere the
# first and the last frame go on.


_PASSES = 3
"""Means in a row: what comes of them has neither corner nor jump."""


def blur_reach(width: int) -> int:
    """Frames to either side that :func:`blurred` looks at."""
    return _PASSES * width


def blurred(
    values: Floats, width: int, *, cyclic: bool = False, fixed: np.ndarray | None = None
) -> Floats:
    """Means (frames, …) of values (frames, …) over so many neighbouring frames to either side,
    three in a row: nearly a bell. Cyclic, the last frame is the first again.

    Over half as many as the nearest frame that is ``fixed`` (frames,) is away, if that is less:
    what is fixed stays what it is, and next to it all is nearly as it was.
    """
    low, high, many = slice(len(values)), slice(2 * width + 1, None), np.array(2 * width + 1)
    if fixed is not None:
        near = np.minimum((_away(fixed, 2 * width, cyclic=cyclic) + 1) // 2, width)
        frames = np.arange(len(values)) + width
        low, high = frames - near, frames + near + 1
        many = (2 * near + 1).reshape(-1, *[1] * (values.ndim - 1))
    result = values
    for _ in range(_PASSES):
        around = _around(result, width, cyclic=cyclic)
        sums = np.concatenate([np.zeros_like(around[:1]), np.cumsum(around, axis=0)])
        result = (sums[high] - sums[low]) / many
    return result


def _away(fixed: np.ndarray, most: int, *, cyclic: bool) -> np.ndarray:
    """Frames (frames,) to the nearest that is fixed (frames,), or so many if none is as near."""
    numbers = np.flatnonzero(_around(fixed, most, cyclic=cyclic)) - most
    if not len(numbers):
        return np.full(len(fixed), most)
    frames = np.arange(len(fixed))
    after = np.searchsorted(numbers, frames)
    ahead = numbers[np.minimum(after, len(numbers) - 1)] - frames
    behind = frames - numbers[np.maximum(after - 1, 0)]
    return np.minimum(np.minimum(np.abs(ahead), np.abs(behind)), most)


def widened(values: Floats, frames: int, *, cyclic: bool = False) -> Floats:
    """The greatest value (frames, …) within so many frames to either side."""
    around = _around(values, frames, cyclic=cyclic)
    done, wanted = 1, 2 * frames + 1
    while done < wanted:
        step = min(done, wanted - done)
        around = np.maximum(around[:-step], around[step:])
        done += step
    return around


def covered(values: Floats, width: int, *, cyclic: bool = False) -> Floats:
    """A smooth course (frames, …) that is nowhere below the values."""
    return blurred(widened(values, blur_reach(width), cyclic=cyclic), width, cyclic=cyclic)


def spans(where: np.ndarray) -> list[tuple[int, int]]:
    """Starts and ends of those frames (frames,) in a row for which it is so."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]])))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


def _around(values: Floats, frames: int, *, cyclic: bool) -> Floats:
    """The same with so many frames more at either end."""
    count = len(values)
    numbers = np.arange(-frames, count + frames)
    if cyclic and count > 1:
        return values[numbers % (count - 1)]
    return values[np.clip(numbers, 0, count - 1)]


# --- Values evened out by a bell ------------------------------------------------------------------

_BELL: Final = 9.0
"""Standard deviations beyond which nothing of a bell is left in the last digit."""


def evened(values: Floats, width: float, *, cyclic: bool) -> Floats:
    """Values (n, …) evened out over so many places (standard deviation): a Gauss bell, by its
    transform. What has ends goes on beyond them mirrored; of a loop the last value is the first.
    """
    around = int(np.ceil(_BELL * width))
    again, start = values[:-1], 0
    if not cyclic and around < len(values):
        # No farther than the bell is seen, and to a length that is quick to transform.
        before, after = values[around:0:-1], values[-2 : -2 - around : -1]
        again, start = np.concatenate([before, values, after]), around
        spare = _quick_length(len(again)) - len(again)
        again = np.concatenate([again, np.zeros((spare, *values.shape[1:]))])
    elif not cyclic:
        again = np.concatenate([values, values[-2:0:-1]])
    turns = np.fft.rfftfreq(len(again)).reshape(-1, *[1] * (values.ndim - 1))
    bell = np.exp(-2.0 * (np.pi * width * turns) ** 2)
    result = np.fft.irfft(np.fft.rfft(again, axis=0) * bell, len(again), axis=0)
    return np.concatenate([result, result[:1]]) if cyclic else result[start : start + len(values)]


def _quick_length(count: int) -> int:
    """The least number from a count on that is a power of two, or three or five times one."""
    return min(part << max(-(-count // part) - 1, 0).bit_length() for part in (1, 3, 5))
