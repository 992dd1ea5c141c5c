# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of one clip carried over to another."""

from .parts import (
    CHAIN,
    PART_TABLE,
    Part,
    PartKind,
    SeenFrom,
    bones_beneath,
    chain_part,
    opposite_part,
    part_bones,
    part_named,
)
from .pose_doubts import reference_doubts
from .reference_pose import ReferencePose, find_reference_pose
from .rehung import whole_limbs
from .retarget import MappedClip
from .splice import (
    LimbGoal,
    Matches,
    Reference,
    Splice,
    SpliceError,
    SplicePreview,
    building_splices,
    numbered,
)
from .timing_suggestions import Suggestion, suggest_timings
from .whole_body import (
    RetargetPreview,
    WholeBody,
    retarget_clip,
    retargeting_clip,
)

__all__ = [
    "CHAIN",
    "PART_TABLE",
    "LimbGoal",
    "MappedClip",
    "Matches",
    "Part",
    "PartKind",
    "Reference",
    "ReferencePose",
    "RetargetPreview",
    "SeenFrom",
    "Splice",
    "SpliceError",
    "SplicePreview",
    "Suggestion",
    "WholeBody",
    "bones_beneath",
    "building_splices",
    "chain_part",
    "find_reference_pose",
    "numbered",
    "opposite_part",
    "part_bones",
    "part_named",
    "reference_doubts",
    "retarget_clip",
    "retargeting_clip",
    "suggest_timings",
    "whole_limbs",
]
