# SPDX-License-Identifier: GPL-3.0-or-later
"""Values evened out along a way or over time."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...rotations import Floats

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
