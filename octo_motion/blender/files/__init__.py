# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets and what the user's folder keeps."""

from .user_files import (
    SUFFIX,
    gait_names,
    has_gait,
    load_calibrations,
    load_gait,
    read_gait_file,
    remove_gait,
    save_calibrations,
    save_gait,
    user_gait_names,
    write_gait,
)
from .weight_curve import NODE, curve_node, ensure_weight_curve, sample_weight_curve

__all__ = [
    "NODE",
    "SUFFIX",
    "curve_node",
    "ensure_weight_curve",
    "gait_names",
    "has_gait",
    "load_calibrations",
    "load_gait",
    "read_gait_file",
    "remove_gait",
    "sample_weight_curve",
    "save_calibrations",
    "save_gait",
    "user_gait_names",
    "write_gait",
]
