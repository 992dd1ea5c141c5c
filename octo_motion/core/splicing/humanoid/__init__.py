# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bone of a skeleton is which landmark of a body."""

from .body_height import stature
from .correspondence import (
    Correspondence,
    chain_length,
    find_correspondence,
    matched_bones,
    matched_chains,
    rest_alike,
    same_build,
)
from .counterparts import mirror_images, opposite
from .fingers import palm_directions, palm_roots
from .landmarks import (
    LANDMARKS,
    MIDDLE,
    OPTIONAL,
    SIDED,
    Landmarks,
    ReferenceMoment,
    mirrored,
)
from .mapping import SkeletonMapping, map_skeleton
from .saved_mapping import (
    SavedMapping,
    damaged_mapping,
    mapping_from_json,
    new_mapping,
    recognised,
)

__all__ = [
    "LANDMARKS",
    "MIDDLE",
    "OPTIONAL",
    "SIDED",
    "Correspondence",
    "Landmarks",
    "ReferenceMoment",
    "SavedMapping",
    "SkeletonMapping",
    "chain_length",
    "damaged_mapping",
    "find_correspondence",
    "map_skeleton",
    "mapping_from_json",
    "matched_bones",
    "matched_chains",
    "mirror_images",
    "mirrored",
    "new_mapping",
    "opposite",
    "palm_directions",
    "palm_roots",
    "recognised",
    "rest_alike",
    "same_build",
    "stature",
]
