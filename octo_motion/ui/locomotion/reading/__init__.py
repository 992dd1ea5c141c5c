# SPDX-License-Identifier: GPL-3.0-or-later
"""From settings and scene to what core works on."""

from .motion import (
    read_body,
    read_changes,
    read_floor,
    read_gaits,
    read_given_poses,
    read_ground,
    read_look,
    read_reaches,
    read_timing,
    resting,
    tolerances_of,
)
from .rig import (
    add_item,
    body_axes,
    bones_of,
    placed_arms,
    playing_action,
    previous_action,
    read_creature,
    read_volume,
    warnings_for_display,
    write_arms,
    write_body,
)

__all__ = [
    "add_item",
    "body_axes",
    "bones_of",
    "placed_arms",
    "playing_action",
    "previous_action",
    "read_body",
    "read_changes",
    "read_creature",
    "read_floor",
    "read_gaits",
    "read_given_poses",
    "read_ground",
    "read_look",
    "read_reaches",
    "read_timing",
    "read_volume",
    "resting",
    "tolerances_of",
    "warnings_for_display",
    "write_arms",
    "write_body",
]
