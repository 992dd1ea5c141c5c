# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole motion, worked out on plain arrays: MotionJob → compute → MotionResult."""

from .job import (
    BodyJob,
    Breathing,
    ChangeAt,
    ChangesByHeight,
    Creature,
    Floor,
    GaitJob,
    GivenPose,
    GroundJob,
    MotionJob,
    ShownContact,
    Timing,
    Tolerances,
    Trailing,
)
from .pipeline import MISS, Glimpsed, MotionResult, compute, glimpse, pose, way_of
from .planning import (
    GaitTargets,
    MotionPlan,
    gait_targets,
    plan_motion,
    schedule,
    shown_contacts,
)

__all__ = [
    "MISS",
    "BodyJob",
    "Breathing",
    "ChangeAt",
    "ChangesByHeight",
    "Creature",
    "Floor",
    "GaitJob",
    "GaitTargets",
    "GivenPose",
    "Glimpsed",
    "GroundJob",
    "MotionJob",
    "MotionPlan",
    "MotionResult",
    "ShownContact",
    "Timing",
    "Tolerances",
    "Trailing",
    "compute",
    "gait_targets",
    "glimpse",
    "plan_motion",
    "pose",
    "schedule",
    "shown_contacts",
    "way_of",
]
