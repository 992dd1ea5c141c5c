# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow-through, as an artist sees it."""

from ..steps import own_classes
from . import operators, panels, properties
from .following import follow_action
from .operators import find_chains
from .properties import FollowChain, OCTO_MOTION_PG_follow_through, follow_settings

CLASSES = (*own_classes(properties, operators), *panels.CLASSES)

__all__ = [
    "CLASSES",
    "FollowChain",
    "OCTO_MOTION_PG_follow_through",
    "find_chains",
    "follow_action",
    "follow_settings",
]
