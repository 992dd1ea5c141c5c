# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips as arrays: poses over time, and how they are read and timed."""

from .bvh_check import check_bvh
from .clip import (
    MOTION_SUFFIXES,
    Clip,
    Posture,
    clip_at,
    orientations_of,
    posture_of,
    sample_clip,
    sample_scales,
    sample_world,
    seam_shifts,
    seam_turns,
    unposed,
    without_scale,
)
from .clip_clock import ClipClock, MarkerPair, RateCurve
from .rest_pose import (
    Reresting,
    average_pose,
    robust_direction,
    robust_rotations,
    usual_offsets,
    with_rest_pose,
)
from .splice_timing import (
    After,
    SpliceWindow,
    Timing,
    moments_within,
    splice_clock,
    splice_span,
    splice_window,
    window_middle,
)

__all__ = [
    "MOTION_SUFFIXES",
    "After",
    "Clip",
    "ClipClock",
    "MarkerPair",
    "Posture",
    "RateCurve",
    "Reresting",
    "SpliceWindow",
    "Timing",
    "average_pose",
    "check_bvh",
    "clip_at",
    "moments_within",
    "orientations_of",
    "posture_of",
    "robust_direction",
    "robust_rotations",
    "sample_clip",
    "sample_scales",
    "sample_world",
    "seam_shifts",
    "seam_turns",
    "splice_clock",
    "splice_span",
    "splice_window",
    "unposed",
    "usual_offsets",
    "window_middle",
    "with_rest_pose",
    "without_scale",
]
