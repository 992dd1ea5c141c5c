# SPDX-License-Identifier: GPL-3.0-or-later
"""From settings and scene to what core works on."""

from .arm_items import (
    active_arm,
    add_item,
    assign,
    body_axes,
    bones_of,
    list_owner,
    placed_arms,
    write_arms,
    write_body,
)
from .changes import (
    GaitSegment,
    GaitTransitionPlan,
    SegmentedMotion,
    gaits_of,
    plan_transitions,
    read_changes,
)
from .gait import (
    frames_of_arms,
    gait_settings,
    generator_of,
    height_of,
    timing,
    tolerances_of,
    travel_settings,
)
from .ground import Standing, read_standing, resting
from .pace import pace_of, too_few_frames
from .previous_action import playing_action, previous_action
from .reaches import Carried, Reaching, Travelling, read_reaches, write_carried
from .rig import (
    chosen_root_bone,
    keyed_anew,
    listed_arms,
    listed_body,
    posed_carriers,
    uniform_scale,
    warnings_for_constraints,
    warnings_for_display,
    warnings_for_driven,
    warnings_for_poses,
)
from .skin import Apart, read_apart

__all__ = [
    "Apart",
    "Carried",
    "GaitSegment",
    "GaitTransitionPlan",
    "Reaching",
    "SegmentedMotion",
    "Standing",
    "Travelling",
    "active_arm",
    "add_item",
    "assign",
    "body_axes",
    "bones_of",
    "chosen_root_bone",
    "frames_of_arms",
    "gait_settings",
    "gaits_of",
    "generator_of",
    "height_of",
    "keyed_anew",
    "list_owner",
    "listed_arms",
    "listed_body",
    "pace_of",
    "placed_arms",
    "plan_transitions",
    "playing_action",
    "posed_carriers",
    "previous_action",
    "read_apart",
    "read_changes",
    "read_reaches",
    "read_standing",
    "resting",
    "timing",
    "tolerances_of",
    "too_few_frames",
    "travel_settings",
    "uniform_scale",
    "warnings_for_constraints",
    "warnings_for_display",
    "warnings_for_driven",
    "warnings_for_poses",
    "write_arms",
    "write_body",
    "write_carried",
]
