# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that keep clear of each other, of the body and of the ground."""

from .arm_separation import DEEP, BodyVolume, lead_past, separating_arms
from .capsule_overlap import Capsules, Opened, Separation, measure_overlap
from .over_ground import ArmsOverGround, afloat, keep_off_ground, raise_between_frames
from .turn_easing import eased_turns, fastest_turn, where_it_helps

__all__ = [
    "DEEP",
    "ArmsOverGround",
    "BodyVolume",
    "Capsules",
    "Opened",
    "Separation",
    "afloat",
    "eased_turns",
    "fastest_turn",
    "keep_off_ground",
    "lead_past",
    "measure_overlap",
    "raise_between_frames",
    "separating_arms",
    "where_it_helps",
]
