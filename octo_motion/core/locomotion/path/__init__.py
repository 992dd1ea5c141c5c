# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the body is and which way it faces, over time."""

from .course import (
    Course,
    Line,
    SwumLine,
    WalkedLine,
    route_in_place,
    travel_in_place,
    whole_frames,
)
from .gait_changes import (
    GaitTransition,
    Windows,
    blend_motions,
    check_transitions,
    slowing,
    transition_windows,
    transitions_by_height,
    way_weights,
)
from .route import Route, s_bend
from .travel import (
    Bearings,
    Travel,
    TravelSettings,
    bearings_of,
    duration,
    plan_travel,
    strides,
    travel_at,
    unhurried,
    walked_at,
)

__all__ = [
    "Bearings",
    "Course",
    "GaitTransition",
    "Line",
    "Route",
    "SwumLine",
    "Travel",
    "TravelSettings",
    "WalkedLine",
    "Windows",
    "bearings_of",
    "blend_motions",
    "check_transitions",
    "duration",
    "plan_travel",
    "route_in_place",
    "s_bend",
    "slowing",
    "strides",
    "transition_windows",
    "transitions_by_height",
    "travel_at",
    "travel_in_place",
    "unhurried",
    "walked_at",
    "way_weights",
    "whole_frames",
]
