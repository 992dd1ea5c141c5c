# SPDX-License-Identifier: GPL-3.0-or-later
"""An arm that curls up from its tip, and stretches again."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...rotations import Floats, lerp_rotation_vectors
from ...smoothing import least_jerk
from ..rig import ArmFrames
from .timeline import Timeline, folded

_FREE: Final = 0.3
"""Share of the arm, from its root, that hardly curls."""
_TIGHT: Final = 3.1
"""How much tighter than that of a reach the spiral is."""
_WAVE: Final = 0.5
"""How much of the time the curl needs to run along the arm."""


def curled(arm: ArmFrames, timeline: Timeline, times: Floats, otherwise: Floats) -> Floats:
    """Rotations (frames, bones, 4) of an arm that curls up until it "touches", in arm lengths.

    A spiral forms at the tip and runs towards the root; letting go, the root is first to stretch.

    Args:
        arm: which.
        timeline: of it ``start``, ``contact``, ``release`` and ``end`` count.
        times: (frames,)
        otherwise: (frames, bones, 4) what the arm does otherwise.
    """
    along = arm.reach[:-1] / arm.length
    up = (times[:, None] - timeline.start) / (timeline.contact - timeline.start)
    down = (times[:, None] - timeline.release) / (timeline.end - timeline.release)
    up = least_jerk((up - _WAVE * (1.0 - along)) / (1.0 - _WAVE))
    down = least_jerk((down - _WAVE * along) / (1.0 - _WAVE))
    share = up * (1.0 - down) * least_jerk(along / _FREE)
    usual = arm.shape(arm.from_bones(otherwise))
    # A front before the arm's root: all of it is behind.
    spiral = folded(arm.lengths, np.full(len(times), -arm.length), bend=0.0, curl=_TIGHT)
    spiral[:, 0] = usual[:, 0]
    shape = arm.shaped(lerp_rotation_vectors(usual, spiral, share))
    result = otherwise.copy()
    moves = np.any(share > 0.0, axis=-1)
    result[moves] = arm.to_bones(shape)[moves]
    return result
