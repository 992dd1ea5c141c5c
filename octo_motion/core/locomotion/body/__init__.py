# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body does by itself while its arms carry it: it surges, breathes, trails, and looks."""

from .organ_motion import SelfMotion, self_motion
from .organ_poses import BodyMoments, OrganPoses, pose_organs
from .organs import Organs, find_organs
from .settings import BodySettings
from .surging import Holds, Surge, surge
from .track import BodyTrack, steps_of

__all__ = [
    "BodyMoments",
    "BodySettings",
    "BodyTrack",
    "Holds",
    "OrganPoses",
    "Organs",
    "SelfMotion",
    "Surge",
    "find_organs",
    "pose_organs",
    "self_motion",
    "steps_of",
    "surge",
]
