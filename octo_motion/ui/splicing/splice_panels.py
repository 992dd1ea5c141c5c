# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Splice: base and list, the active splice, its timing, landmarks."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ...core.phrases import phrase
from ..language import translated
from ..panel_base import ArmaturePanel, armature_in, draw_list, draw_live_error
from .landmark_table import draw_landmarks
from .properties import part_kind, splicing_settings
from .retarget_operators import OCTO_MOTION_OT_retarget, OCTO_MOTION_OT_retarget_files
from .splice_operators import (
    OCTO_MOTION_OT_splice_add,
    OCTO_MOTION_OT_splice_build,
    OCTO_MOTION_OT_splice_move,
    OCTO_MOTION_OT_splice_remove,
    OCTO_MOTION_OT_splice_suggest_timing,
    OCTO_MOTION_UL_splices,
    active_splice,
)
from .timing_drag import OCTO_MOTION_OT_splice_drag_timing
from .timing_settings import matched_markers


class _Panel(ArmaturePanel):
    """A panel of the armature's splicing."""

    bl_options = {"DEFAULT_CLOSED"}

    settings_of = staticmethod(splicing_settings)


class _SplicePanel(_Panel):
    """A panel of the active splice."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        armature = armature_in(context)
        return armature is not None and active_splice(splicing_settings(armature)) is not None


class OCTO_MOTION_PT_splicing(_Panel, bpy.types.Panel):
    bl_label = "Splice"
    bl_order = 1
    bl_options = set()
    tool = "SPLICE"

    def show(self, layout: Any, settings: Any) -> None:
        row = layout.row(align=True)
        row.scale_y = 1.5
        # Split, the name of the switch would take half of the button's room.
        row.use_property_split = False
        row.operator(OCTO_MOTION_OT_splice_build.bl_idname, icon="PLAY", text="Build")
        row.prop(settings, "live", toggle=True, icon="FILE_REFRESH")
        base = layout.column()
        # It is asked for as soon as there is something to put on it.
        base.alert = settings.base is None and len(settings.splices) > 0
        _draw_action(base, settings, "base", "base_slot")
        buttons = (
            OCTO_MOTION_OT_splice_add,
            OCTO_MOTION_OT_splice_remove,
            OCTO_MOTION_OT_splice_move,
        )
        names = "splices", "active_splice"
        draw_list(layout, OCTO_MOTION_UL_splices, settings, names, buttons, rows=4, maxrows=4)
        column = layout.column(align=True)
        column.operator_context = "INVOKE_DEFAULT"
        column.operator(OCTO_MOTION_OT_splice_drag_timing.bl_idname, icon="ARROW_LEFTRIGHT")
        column.operator(OCTO_MOTION_OT_splice_suggest_timing.bl_idname, icon="LIGHT")
        layout.row().prop(settings, "result_as", expand=True)
        layout.prop(settings, "visual")
        draw_live_error(layout, settings)
        if settings.result is not None:
            layout.label(text=settings.result.name, icon="ACTION", translate=False)


class OCTO_MOTION_PT_splice(_SplicePanel, bpy.types.Panel):
    bl_label = "The Splice"
    bl_parent_id = "OCTO_MOTION_PT_splicing"

    def show(self, layout: Any, settings: Any) -> None:
        item = active_splice(settings)
        layout.prop(item, "part")
        kind = part_kind(item)
        if kind is None:
            layout.prop_search(item, "bone", settings.id_data.data, "bones")
        source = layout.column()
        source.alert = item.source is None
        source.prop(item, "source")
        if kind is None and item.source is not None:
            layout.prop_search(item, "source_bone", item.source.data, "bones")
        action = layout.column()
        action.alert = item.action is None
        _draw_action(action, item, "action", "slot")
        if item.source is None or item.action is None:
            layout.label(text="Its source is gone: choose another", icon="ERROR")
        elif not item.source.users_scene:
            layout.label(text="Deleted, kept for this splice", icon="INFO")
        layout.prop(item, "visual")
        layout.prop(item, "mirror")
        layout.prop(item, "weight")
        layout.row().prop(item, "blending", expand=True)
        additive = item.blending == "ADD"
        if additive:
            layout.prop(item, "reference")
            if item.reference == "FRAME":
                layout.prop(item, "reference_frame")
        if kind is None:
            return
        layout.row().prop(item, "mode", expand=True)
        if kind.clavicle:
            layout.prop(item, "with_clavicle")
        if kind.travels:
            travel = layout.column()
            travel.active = not additive
            travel.prop(item, "with_travel")
            lock = layout.column()
            lock.active = item.with_travel and not additive
            lock.prop(item, "foot_lock")
            ground = lock.column()
            ground.active = item.foot_lock
            ground.prop(item, "ground")
        if len(kind.seen_from) > 1:
            seen = layout.row()
            seen.active = additive or not (kind.travels and item.with_travel)
            seen.prop(item, "seen_from")


class OCTO_MOTION_PT_splice_timing(_SplicePanel, bpy.types.Panel):
    bl_label = "Timing of the Splice"
    bl_parent_id = "OCTO_MOTION_PT_splicing"

    def show(self, layout: Any, settings: Any) -> None:
        item = active_splice(settings)
        column = layout.column(align=True)
        column.prop(item, "base_start")
        column.prop(item, "splice_start")
        row = layout.row()
        # What can have keys says so.
        row.use_property_decorate = True
        row.prop(item, "rate")
        layout.prop(item, "match_markers")
        if item.match_markers:
            matched = len(matched_markers(settings, item))
            icon = "PMARKER_ACT" if matched else "ERROR"
            layout.label(
                text=translated(phrase("Markers of the same name: {matched}", matched=matched)),
                icon=icon,
            )
        layout.prop(item, "length")
        layout.row().prop(item, "fade_unit", expand=True)
        ease_in, ease_out = "ease_in", "ease_out"
        if item.fade_unit == "SECONDS":
            ease_in, ease_out = "fade_in_seconds", "fade_out_seconds"
        column = layout.column(align=True)
        column.prop(item, ease_in)
        column.prop(item, ease_out, text="Out")
        layout.row().prop(item, "after", expand=True)


class OCTO_MOTION_PT_retarget(_Panel, bpy.types.Panel):
    bl_label = "Retarget"
    bl_parent_id = "OCTO_MOTION_PT_splicing"

    def show(self, layout: Any, settings: Any) -> None:
        retarget = settings.retarget
        layout.row().prop(retarget, "mode", expand=True)
        layout.prop(retarget, "travel")
        lock = layout.column()
        lock.active = retarget.travel
        lock.prop(retarget, "foot_lock")
        ground = lock.column()
        ground.active = retarget.foot_lock
        ground.prop(retarget, "ground")
        layout.prop(retarget, "standing")
        layout.prop(retarget, "visual")
        column = layout.column(align=True)
        column.operator_context = "INVOKE_DEFAULT"
        row = column.row(align=True)
        row.use_property_split = False
        row.operator(OCTO_MOTION_OT_retarget.bl_idname, icon="ARMATURE_DATA")
        last = row.row(align=True)
        # It follows the last clip: one has to be there.
        last.active = retarget.live or retarget.from_action is not None
        last.prop(retarget, "live", toggle=True, icon="FILE_REFRESH")
        every = column.operator(
            OCTO_MOTION_OT_retarget.bl_idname, icon="DUPLICATE", text="Retarget All Actions"
        )
        every.all_actions = True
        column.operator(
            OCTO_MOTION_OT_retarget_files.bl_idname, icon="FILE_FOLDER", text="Retarget Files…"
        )
        draw_live_error(layout, retarget)


class OCTO_MOTION_PT_landmarks(_Panel, bpy.types.Panel):
    bl_label = "Landmarks"
    bl_parent_id = "OCTO_MOTION_PT_splicing"

    def show(self, layout: Any, settings: Any) -> None:
        layout.use_property_split = False
        draw_landmarks(layout, bpy.context, settings)


def _draw_action(column: Any, group: Any, action: str, slot: str) -> None:
    column.prop(group, action)
    chosen = getattr(group, action)
    # Most actions have one slot, which need not be chosen.
    if chosen is not None and (len(chosen.slots) > 1 or getattr(group, slot) not in chosen.slots):
        column.prop_search(group, slot, chosen, "slots")


CLASSES: Final = (
    OCTO_MOTION_PT_splicing,
    OCTO_MOTION_PT_splice,
    OCTO_MOTION_PT_splice_timing,
    OCTO_MOTION_PT_retarget,
    OCTO_MOTION_PT_landmarks,
)
