# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by hand, as an artist sees it."""

from ..steps import Step, nothing, own_classes
from . import (
    device_pose,
    device_settings,
    operators,
    panels,
    pose_operator,
    properties,
    script_player,
)
from .properties import OCTO_MOTION_PG_posing, marked_obstacles
from .script_player import play_file

CLASSES = (
    *own_classes(properties, device_settings, pose_operator, script_player, operators, device_pose),
    *panels.CLASSES,
)
STEPS = (
    Step(device_settings.register, device_settings.unregister),
    Step(nothing, device_pose.unregister),
)

__all__ = ["CLASSES", "STEPS", "OCTO_MOTION_PG_posing", "marked_obstacles", "play_file"]
