# SPDX-License-Identifier: GPL-3.0-or-later
"""Locomotion, as an artist sees it."""

from ..steps import Step
from . import operators, panels, settings, target_overlay
from .operators import MENUS, disconnect_arms
from .settings import (
    AlongItem,
    ChangeItem,
    ContactItem,
    OCTO_MOTION_PG_contact,
    OCTO_MOTION_PG_locomotion,
    ReachItem,
    keep_look,
    locomotion_settings,
    once_called,
    set_gait,
    stamp,
    store,
)
from .writing import Summary, generate_locomotion

STEPS = (*operators.STEPS, Step(target_overlay.listen, target_overlay.listen_no_more))
CLASSES = (*settings.CLASSES, *operators.CLASSES, *panels.CLASSES)

__all__ = [
    "CLASSES",
    "MENUS",
    "STEPS",
    "AlongItem",
    "ChangeItem",
    "ContactItem",
    "OCTO_MOTION_PG_contact",
    "OCTO_MOTION_PG_locomotion",
    "ReachItem",
    "Summary",
    "disconnect_arms",
    "generate_locomotion",
    "keep_look",
    "locomotion_settings",
    "once_called",
    "set_gait",
    "stamp",
    "store",
]
