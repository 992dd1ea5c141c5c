# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons, and what of the panel belongs to each."""

from ...steps import Step, own_classes
from . import (
    adding,
    arms,
    contacts,
    edits,
    gait_table,
    generate,
    given_poses,
    quality,
    reaches,
    setups,
)
from .adding import (
    OCTO_MOTION_OT_add_octopus,
    OCTO_MOTION_OT_add_route,
    draw_octopus_entry,
    draw_route_entry,
)
from .arms import OCTO_MOTION_PT_arms, disconnect_arms
from .contacts import OCTO_MOTION_PT_contact, OCTO_MOTION_PT_ground, draw_rest
from .edits import draw_edits
from .gait_table import OCTO_MOTION_MT_gait, OCTO_MOTION_MT_gaits, OCTO_MOTION_PT_table
from .generate import OCTO_MOTION_OT_generate_locomotion
from .given_poses import OCTO_MOTION_PT_given_poses
from .quality import OCTO_MOTION_PT_quality
from .reaches import OCTO_MOTION_PT_along, OCTO_MOTION_PT_change, OCTO_MOTION_PT_reaches
from .setups import OCTO_MOTION_PT_setups, draw_setups, shown_name

CLASSES = (
    *own_classes(
        *(arms, adding, gait_table, generate, edits, contacts, setups, quality, reaches),
        given_poses,
    ),
    OCTO_MOTION_PT_contact,
    OCTO_MOTION_PT_setups,
)
STEPS = (
    Step(generate.listen, generate.listen_no_more),
    Step(setups.register, setups.unregister),
)
MENUS = (
    ("VIEW3D_MT_armature_add", draw_octopus_entry),
    ("VIEW3D_MT_curve_add", draw_route_entry),
)

__all__ = [
    "CLASSES",
    "MENUS",
    "STEPS",
    "OCTO_MOTION_MT_gait",
    "OCTO_MOTION_MT_gaits",
    "OCTO_MOTION_OT_add_octopus",
    "OCTO_MOTION_OT_add_route",
    "OCTO_MOTION_OT_generate_locomotion",
    "OCTO_MOTION_PT_along",
    "OCTO_MOTION_PT_arms",
    "OCTO_MOTION_PT_change",
    "OCTO_MOTION_PT_given_poses",
    "OCTO_MOTION_PT_ground",
    "OCTO_MOTION_PT_quality",
    "OCTO_MOTION_PT_reaches",
    "OCTO_MOTION_PT_setups",
    "OCTO_MOTION_PT_table",
    "disconnect_arms",
    "draw_edits",
    "draw_rest",
    "draw_setups",
    "shown_name",
]
