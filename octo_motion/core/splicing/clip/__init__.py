# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips as arrays: poses over time, and how they are read and timed."""

from .bvh_check import check_bvh
from .clip import Clip
from .posture import Posture, posture_of, sample_clip, sample_scales, sample_world
from .scaled_pose import without_scale
from .splice_timing import After, SpliceWindow, Timing, splice_window, window_middle
from .unpose import orientations_of, unposed

__all__ = [
    "After",
    "Clip",
    "Posture",
    "SpliceWindow",
    "Timing",
    "check_bvh",
    "orientations_of",
    "posture_of",
    "sample_clip",
    "sample_scales",
    "sample_world",
    "splice_window",
    "unposed",
    "window_middle",
    "without_scale",
]
