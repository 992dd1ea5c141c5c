# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips as arrays: poses over time, and how they are read and timed."""

from .bvh_check import check_bvh
from .clip import (
    MOTION_SUFFIXES,
    Clip,
    Posture,
    orientations_of,
    posture_of,
    sample_clip,
    sample_scales,
    sample_world,
    unposed,
    without_scale,
)
from .splice_timing import After, SpliceWindow, Timing, splice_window, window_middle

__all__ = [
    "MOTION_SUFFIXES",
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
