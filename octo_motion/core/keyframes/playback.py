# SPDX-License-Identifier: GPL-3.0-or-later
"""What keys play: values of Bézier curves."""

from __future__ import annotations

import numpy as np

from ..rotations import Floats
from .reduction import BezierKeys


def values_at(keys: BezierKeys, times: Floats) -> Floats:
    """Values (times, components) of curves; before the first key and after the last as there.

    Args:
        keys: with handles at thirds of the time between two keys, as :func:`keys.reduce_keys` has
            them: a curve is then a cubic in time itself.
        times: (times,) frames, which need not be whole.
    """
    frames, values = keys.frames.astype(np.float64), keys.values.astype(np.float64)
    if len(frames) == 1:
        return np.tile(values, (len(times), 1))
    span = np.clip(np.searchsorted(frames, times, side="right") - 1, 0, len(frames) - 2)
    start, end = frames[span], frames[span + 1]
    share = np.clip((times - start) / (end - start), 0.0, 1.0)[:, None]
    rest = 1.0 - share
    out, into = keys.right[span, :, 1], keys.left[span + 1, :, 1]
    return (
        rest**3 * values[span]
        + 3.0 * share * rest**2 * out
        + 3.0 * share**2 * rest * into
        + share**3 * values[span + 1]
    )
