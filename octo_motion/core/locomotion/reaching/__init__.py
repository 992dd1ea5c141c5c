# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that reach, wind round something, carry it and let go."""

from .grasp import Carried, Mode, Places, Reach, Reached, Reaching, Target, Travelling, plan_grasp
from .timeline import Timeline, curled
from .winding import Profile, profile_of

__all__ = [
    "Carried",
    "Mode",
    "Places",
    "Profile",
    "Reach",
    "Reached",
    "Reaching",
    "Target",
    "Timeline",
    "Travelling",
    "curled",
    "plan_grasp",
    "profile_of",
]
