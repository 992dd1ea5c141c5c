# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist sets, kept with the armature object."""

from ...steps import own_classes
from . import body, gait, lists, properties
from .body import keep_look, stamp
from .gait import (
    DEFAULT_GAIT,
    SIDES,
    OCTO_MOTION_PG_gait_curve,
    OCTO_MOTION_PG_gait_table,
    fill_curve,
    fill_offsets,
    fill_table,
    matched,
    used,
)
from .lists import (
    AXES,
    MODES,
    ChangeItem,
    ContactEdit,
    ContactItem,
    OCTO_MOTION_PG_change,
    OCTO_MOTION_PG_contact,
    Place,
    ReachItem,
    changed_by_hand,
    note_shown,
    once_called,
    overrides_for_core,
    read_overrides,
    store,
)
from .properties import (
    KIND_NAMES,
    KINDS,
    SWITCHED,
    OCTO_MOTION_PG_locomotion,
    fill_gait_table,
    known_figures,
    locomotion_settings,
    read_gait,
    set_gait,
    write_figures,
)

CLASSES = own_classes(body, gait, lists, properties)

__all__ = [
    "AXES",
    "CLASSES",
    "DEFAULT_GAIT",
    "KINDS",
    "KIND_NAMES",
    "MODES",
    "SIDES",
    "SWITCHED",
    "ChangeItem",
    "ContactEdit",
    "ContactItem",
    "OCTO_MOTION_PG_change",
    "OCTO_MOTION_PG_contact",
    "OCTO_MOTION_PG_gait_curve",
    "OCTO_MOTION_PG_gait_table",
    "OCTO_MOTION_PG_locomotion",
    "Place",
    "ReachItem",
    "changed_by_hand",
    "fill_curve",
    "fill_gait_table",
    "fill_offsets",
    "fill_table",
    "keep_look",
    "known_figures",
    "locomotion_settings",
    "matched",
    "note_shown",
    "once_called",
    "overrides_for_core",
    "read_gait",
    "read_overrides",
    "set_gait",
    "stamp",
    "store",
    "used",
    "write_figures",
]
