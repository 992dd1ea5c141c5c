# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole motion, worked out on plain arrays: MotionJob → compute → MotionResult."""

from .few_keys import Tolerances
from .job import (
    Breathing,
    ChangeAt,
    ChangesByHeight,
    Creature,
    GaitJob,
    GroundJob,
    MotionJob,
    ShownContact,
    Timing,
)
from .pipeline import MISS, compute
from .planning import MotionPlan, plan_motion, schedule, shown_contacts
from .result import MotionResult

__all__ = [
    "MISS",
    "Breathing",
    "ChangeAt",
    "ChangesByHeight",
    "Creature",
    "GaitJob",
    "GroundJob",
    "MotionJob",
    "MotionPlan",
    "MotionResult",
    "ShownContact",
    "Timing",
    "Tolerances",
    "compute",
    "plan_motion",
    "schedule",
    "shown_contacts",
]
