# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that keep clear of each other, of the body and of the ground."""

from .capsule_overlap import Capsules, Opened, Separation, measure_overlap
from .corrections import (
    DEEP,
    ArmsOverGround,
    BodyVolume,
    afloat,
    keeping_off_ground,
    lead_past,
    raising_between_frames,
    separating_arms,
)
from .way_past import Haste

__all__ = [
    "DEEP",
    "ArmsOverGround",
    "BodyVolume",
    "Capsules",
    "Haste",
    "Opened",
    "Separation",
    "afloat",
    "keeping_off_ground",
    "lead_past",
    "measure_overlap",
    "raising_between_frames",
    "separating_arms",
]
