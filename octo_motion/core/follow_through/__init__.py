# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow-through: bones that lag, swing and settle about what an action says."""

from .chains import Chain, between, chains_of, find_loose
from .limbs import Followed, Limbs, limbs_of, own_rotations
from .sampling import BoneMotion, Displacement, displacement, repeats
from .settings import MATERIALS, FollowSettings
from .simulation import STEPS, BodyCapsules, FollowJob, MovingObstacles, Simulation, follow

__all__ = [
    "MATERIALS",
    "STEPS",
    "BodyCapsules",
    "BoneMotion",
    "Chain",
    "Displacement",
    "FollowJob",
    "FollowSettings",
    "Followed",
    "Limbs",
    "MovingObstacles",
    "Simulation",
    "between",
    "chains_of",
    "displacement",
    "find_loose",
    "follow",
    "limbs_of",
    "own_rotations",
    "repeats",
]
