# SPDX-License-Identifier: GPL-3.0-or-later
"""Splicing: a body part of one clip put onto another."""

from __future__ import annotations

from typing import Final

from ..steps import Step, nothing, own_classes
from . import (
    import_clips,
    landmark_table,
    mapping_operators,
    properties,
    reference_figure,
    retarget_operators,
    splice_operators,
    splice_panels,
    timing_drag,
)
from .import_clips import draw_in_import_menu
from .live_retarget import live_retargeted
from .live_splices import live_spliced
from .properties import (
    PARTS,
    OCTO_MOTION_PG_landmarks,
    OCTO_MOTION_PG_retarget,
    OCTO_MOTION_PG_splicing,
    SpliceItem,
    splicing_settings,
)
from .retargeting import RetargetSession, file_clip
from .splice_operators import add_splice, name_splice
from .stack import ClipReader, prepare_splices, write_splices

SETTINGS: Final = own_classes(properties)
"""What ``Object.octo_motion`` holds of splicing."""

CLASSES: Final = (
    *own_classes(
        landmark_table,
        mapping_operators,
        reference_figure,
        import_clips,
        splice_operators,
        timing_drag,
        retarget_operators,
    ),
    *splice_panels.CLASSES,
)
"""Operators and panels."""

STEPS: Final = (
    Step(nothing, reference_figure.take_down_all),
    Step(live_spliced.listen, live_spliced.listen_no_more),
    Step(live_retargeted.listen, live_retargeted.listen_no_more),
)
"""What is done when the add-on is switched on, and undone when it is switched off."""

__all__ = [
    "CLASSES",
    "PARTS",
    "SETTINGS",
    "STEPS",
    "ClipReader",
    "OCTO_MOTION_PG_landmarks",
    "OCTO_MOTION_PG_retarget",
    "OCTO_MOTION_PG_splicing",
    "RetargetSession",
    "SpliceItem",
    "add_splice",
    "draw_in_import_menu",
    "file_clip",
    "name_splice",
    "prepare_splices",
    "splicing_settings",
    "write_splices",
]
