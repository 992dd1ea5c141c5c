# SPDX-License-Identifier: GPL-3.0-or-later
"""From settings and scene to what core works on."""

from .arm_items import (
    active_arm,
    add_item,
    body_axes,
    bones_of,
    list_owner,
    placed_arms,
    write_arms,
    write_body,
)
from .changes import read_changes
from .gait import gait_settings, read_gaits, tolerances_of, travel_settings
from .ground import read_ground, resting
from .previous_action import playing_action, previous_action
from .reaches import read_reaches
from .rig import RigRead, keyed_anew, read_creature, warnings_for_display
from .route import breathing, read_route_of, read_timing
from .skin import read_volume

__all__ = [
    "RigRead",
    "active_arm",
    "add_item",
    "body_axes",
    "bones_of",
    "breathing",
    "gait_settings",
    "keyed_anew",
    "list_owner",
    "placed_arms",
    "playing_action",
    "previous_action",
    "read_changes",
    "read_creature",
    "read_gaits",
    "read_ground",
    "read_reaches",
    "read_route_of",
    "read_timing",
    "read_volume",
    "resting",
    "tolerances_of",
    "travel_settings",
    "warnings_for_display",
    "write_arms",
    "write_body",
]
