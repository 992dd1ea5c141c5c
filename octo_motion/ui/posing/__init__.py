# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by hand, as an artist sees it."""

from ..steps import Step, nothing
from . import (
    device_calibrate,
    device_panel,
    device_pose,
    device_settings,
    marks,
    measure,
    panels,
    pose_start,
    properties,
    script_player,
)
from .properties import OCTO_MOTION_PG_posing
from .registration import unregister
from .script_player import play_file

CLASSES = (
    *properties.CLASSES,
    *device_settings.CLASSES,
    *pose_start.CLASSES,
    *script_player.CLASSES,
    *marks.CLASSES,
    *measure.CLASSES,
    *panels.CLASSES,
    *device_pose.CLASSES,
    *device_calibrate.CLASSES,
    *device_panel.CLASSES,
)
STEPS = (
    Step(device_settings.register, device_settings.unregister),
    Step(nothing, unregister),
)

__all__ = ["CLASSES", "STEPS", "OCTO_MOTION_PG_posing", "play_file"]
