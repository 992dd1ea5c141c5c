# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body does by itself while its arms carry it: it surges, breathes, trails, and looks."""

from .by_itself import (
    BodySettings,
    BodyTrack,
    Holds,
    SelfMotion,
    Stalking,
    Surge,
    self_motion,
    steps_of,
    surge,
)
from .organs import BodyMoments, OrganPoses, Organs, carriages, find_organs, pose_organs

__all__ = [
    "BodyMoments",
    "BodySettings",
    "BodyTrack",
    "Holds",
    "OrganPoses",
    "Organs",
    "SelfMotion",
    "Stalking",
    "Surge",
    "carriages",
    "find_organs",
    "pose_organs",
    "self_motion",
    "steps_of",
    "surge",
]
