# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Follow-Through: chains, material, what is around, what is in the way, keys."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ..floor import draw_floor
from ..panel_base import ArmaturePanel, draw_list
from .operators import (
    OCTO_MOTION_OT_follow_add,
    OCTO_MOTION_OT_follow_find,
    OCTO_MOTION_OT_follow_remove,
    OCTO_MOTION_OT_follow_select,
    OCTO_MOTION_OT_follow_through,
    OCTO_MOTION_UL_follow_chains,
)
from .properties import follow_settings


class _Panel(ArmaturePanel):
    """A panel of the armature's follow-through."""

    bl_options = {"DEFAULT_CLOSED"}

    settings_of = staticmethod(follow_settings)


class OCTO_MOTION_PT_follow_through(_Panel, bpy.types.Panel):
    bl_label = "Follow-Through"
    # After whatever made the motion.
    bl_order = 9

    def show(self, layout: Any, settings: Any) -> None:
        row = layout.row()
        row.scale_y = 1.5
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_follow_through.bl_idname, icon="FORCE_HARMONIC")
        buttons = OCTO_MOTION_OT_follow_add, OCTO_MOTION_OT_follow_remove
        names = "chains", "active_chain"
        column = draw_list(
            layout, OCTO_MOTION_UL_follow_chains, settings, names, buttons, rows=3, maxrows=6
        )
        column.separator()
        column.operator(OCTO_MOTION_OT_follow_find.bl_idname, text="", icon="VIEWZOOM")
        column.operator(OCTO_MOTION_OT_follow_select.bl_idname, text="", icon="RESTRICT_SELECT_OFF")
        if settings.active_chain < len(settings.chains):
            item = settings.chains[settings.active_chain]
            chain = layout.column(align=True)
            # What can have keys says so.
            chain.use_property_decorate = True
            chain.prop(item, "strength", text="Chain Strength")
            chain.prop(item, "tip")
        else:
            layout.label(text="Without a list: the selected bones", icon="INFO")
        layout.prop(settings, "material")
        if settings.material == "OWN":
            own = layout.column(align=True)
            own.prop(settings, "springs")
            own.prop(settings, "bears")
        layout.prop(settings, "strength")
        layout.prop(settings, "damping")
        layout.prop(settings, "start")
        layout.prop(settings, "loop")


class OCTO_MOTION_PT_follow_world(_Panel, bpy.types.Panel):
    bl_label = "Around It"
    bl_parent_id = "OCTO_MOTION_PT_follow_through"

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "gravity")
        layout.row().prop(settings, "medium", expand=True)
        moving = layout.column()
        moving.active = settings.medium != "NONE"
        moving.prop(settings, "drag")
        moving.prop(settings, "wind")
        floats = moving.column()
        floats.active = settings.medium == "WATER" and settings.gravity != 0.0
        floats.prop(settings, "buoyancy")


class OCTO_MOTION_PT_follow_contacts(_Panel, bpy.types.Panel):
    bl_label = "In Its Way"
    bl_parent_id = "OCTO_MOTION_PT_follow_through"

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "body")
        layout.prop(settings, "self_collision")
        draw_floor(layout, settings)
        layout.prop(settings, "use_obstacles")
        layout.prop(settings, "friction")


class OCTO_MOTION_PT_follow_keys(_Panel, bpy.types.Panel):
    bl_label = "Result and Keys"
    bl_parent_id = "OCTO_MOTION_PT_follow_through"

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "result_as")
        layout.prop(settings, "visual")
        layout.row().prop(settings, "keys", expand=True)
        if settings.keys == "REDUCED":
            layout.prop(settings, "key_angle")
        if settings.base is not None:
            layout.prop(settings, "base")


CLASSES: Final = (
    OCTO_MOTION_PT_follow_through,
    OCTO_MOTION_PT_follow_world,
    OCTO_MOTION_PT_follow_contacts,
    OCTO_MOTION_PT_follow_keys,
)
