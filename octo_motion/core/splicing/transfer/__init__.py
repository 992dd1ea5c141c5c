# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of one clip carried over to another."""

from .body_frames import AnatomicalFrame, chest_frame, laid_over, pelvis_frame
from .carry import Side, carriers
from .parts import PARTS, Part, bones_beneath, chain_part, landmark_bone, part_bones
from .preview import SplicePreview
from .splice import Reach, SeenFrom, Splice, build_splices
from .timing_suggestions import Suggestion, suggest_timings

__all__ = [
    "PARTS",
    "AnatomicalFrame",
    "Part",
    "Reach",
    "SeenFrom",
    "Side",
    "Splice",
    "SplicePreview",
    "Suggestion",
    "bones_beneath",
    "build_splices",
    "carriers",
    "chain_part",
    "chest_frame",
    "laid_over",
    "landmark_bone",
    "part_bones",
    "pelvis_frame",
    "suggest_timings",
]
