# SPDX-License-Identifier: GPL-3.0-or-later
"""Values evened out along a way or over time."""

from __future__ import annotations

import numpy as np

from ...rotations import Floats


def evened(values: Floats, width: float, *, cyclic: bool) -> Floats:
    """Values (n,) evened out over so many places (standard deviation): a Gauss bell, by its
    transform. What has ends goes on beyond them mirrored; of a loop the last value is the first.
    """
    again = values[:-1] if cyclic else np.concatenate([values, values[-2:0:-1]])
    turns = np.fft.rfftfreq(len(again))
    bell = np.exp(-2.0 * (np.pi * width * turns) ** 2)
    evened = np.fft.irfft(np.fft.rfft(again) * bell, len(again))
    return np.append(evened, evened[0]) if cyclic else evened[: len(values)]
