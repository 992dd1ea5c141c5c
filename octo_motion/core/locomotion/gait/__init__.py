# SPDX-License-Identifier: GPL-3.0-or-later
"""The free arm: gait table → pseudo-targets → weighted CCD."""

from .ccd import close_group, diameters, shares_before
from .gait_poser import (
    Arm,
    Build,
    GaitPoser,
    GaitSettings,
    RoughGaitPoser,
    bone_twists,
    roughly,
    target_places,
)
from .table import (
    ANGLES,
    CYCLE,
    LINKS,
    GaitCurve,
    GaitError,
    GaitTable,
    check_gait,
    gait_from_json,
    gait_presets,
    gait_to_json,
    renamed_gait,
)
from .variation import UnevenHolds

__all__ = [
    "ANGLES",
    "CYCLE",
    "LINKS",
    "Arm",
    "Build",
    "GaitCurve",
    "GaitError",
    "GaitPoser",
    "GaitSettings",
    "GaitTable",
    "RoughGaitPoser",
    "UnevenHolds",
    "bone_twists",
    "check_gait",
    "close_group",
    "diameters",
    "gait_from_json",
    "gait_presets",
    "gait_to_json",
    "renamed_gait",
    "roughly",
    "shares_before",
    "target_places",
]
