# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets and what the user's folder keeps."""

from .saved_mappings import (
    load_mapping,
    load_mappings,
    mapping_names,
    remove_mapping,
    save_mapping,
)
from .user_files import (
    SUFFIX,
    file_named,
    gait_names,
    has_gait,
    load_calibrations,
    load_gait,
    own_folder,
    read_gait_file,
    remove_gait,
    save_calibrations,
    save_gait,
    unwritable,
    user_gait_names,
    write_gait,
)
from .weight_curve import NODE, curve_node, ensure_weight_curve, sample_weight_curve

__all__ = [
    "NODE",
    "SUFFIX",
    "curve_node",
    "ensure_weight_curve",
    "file_named",
    "gait_names",
    "has_gait",
    "load_calibrations",
    "load_gait",
    "load_mapping",
    "load_mappings",
    "mapping_names",
    "own_folder",
    "read_gait_file",
    "remove_gait",
    "remove_mapping",
    "sample_weight_curve",
    "save_calibrations",
    "save_gait",
    "save_mapping",
    "unwritable",
    "user_gait_names",
    "write_gait",
]
