# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that keep clear of each other, of the body and of the ground."""

from .arm_separation import MOST_CAPSULES, Bulk, joints_that_count, separate_arms
from .body_volume import DEEP, BodyVolume
from .capsule_overlap import Capsules, Separation, measure_overlap
from .overlap_contacts import Opened
from .subframe_clearance import ArmsOverGround, raise_between_frames
from .swim_clearance import afloat, keep_off_ground

__all__ = [
    "DEEP",
    "MOST_CAPSULES",
    "ArmsOverGround",
    "BodyVolume",
    "Bulk",
    "Capsules",
    "Opened",
    "Separation",
    "afloat",
    "joints_that_count",
    "keep_off_ground",
    "measure_overlap",
    "raise_between_frames",
    "separate_arms",
]
