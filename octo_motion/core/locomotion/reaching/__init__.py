# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that reach, wind round something, carry it and let go."""

from .curl import curled
from .grasp import Mode, Places, Target, plan_grasp
from .plan import Carried, Reach, Reaching, Travelling
from .timeline import Timeline
from .winding import Profile, profile_of

__all__ = [
    "Carried",
    "Mode",
    "Places",
    "Profile",
    "Reach",
    "Reaching",
    "Target",
    "Timeline",
    "Travelling",
    "curled",
    "plan_grasp",
    "profile_of",
]
