# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab, and in it the tool Move: what is pressed and changed often, then the rest."""

from __future__ import annotations

from typing import Any, Final, cast

import bpy

from ...blender.animation import key_counts
from ...blender.files import NODE, curve_node
from ...core.phrases import phrase
from ..language import translated
from ..panel_base import ArmaturePanel, TabPanel, armature_in, draw_live_error
from .operators import (
    OCTO_MOTION_MT_gait,
    OCTO_MOTION_MT_gaits,
    OCTO_MOTION_OT_add_octopus,
    OCTO_MOTION_OT_add_route,
    OCTO_MOTION_OT_generate_locomotion,
    OCTO_MOTION_PT_along,
    OCTO_MOTION_PT_arms,
    OCTO_MOTION_PT_change,
    OCTO_MOTION_PT_given_poses,
    OCTO_MOTION_PT_ground,
    OCTO_MOTION_PT_quality,
    OCTO_MOTION_PT_reaches,
    OCTO_MOTION_PT_setups,
    OCTO_MOTION_PT_table,
    draw_edits,
    draw_rest,
    draw_setups,
    shown_name,
)
from .settings import OCTO_MOTION_PG_locomotion, locomotion_settings, used


class _Panel(ArmaturePanel):
    """A panel of the armature's locomotion."""

    settings_of = staticmethod(locomotion_settings)


class OCTO_MOTION_PT_rig(TabPanel, bpy.types.Panel):
    bl_label = "Rig"
    bl_order = 0
    bl_options = {"HIDE_HEADER"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = cast("Any", self).layout
        armature = armature_in(context)
        if armature is None:
            column = layout.column(align=True)
            column.label(text="No armature is active.", icon="INFO")
            column.label(text="Select one, or add an octopus:", icon="BLANK1")
            layout.operator(
                OCTO_MOTION_OT_add_octopus.bl_idname,
                text="Add Octopus",
                icon="OUTLINER_OB_ARMATURE",
            )
            return
        if armature != context.object:
            layout.label(text=armature.name, icon="OUTLINER_OB_ARMATURE", translate=False)
        if not armature.is_editable:
            column = layout.column(align=True)
            column.label(text="Linked and read-only.", icon="LIBRARY_DATA_DIRECT")
            column.label(text="Make a library override.", icon="BLANK1")
            return
        settings = armature.octo_motion  # type: ignore[attr-defined]
        layout.row().prop(settings, "tool", expand=True)


class OCTO_MOTION_PT_route(_Panel, bpy.types.Panel):
    bl_label = "Route"
    bl_order = 3
    bl_options = {"DEFAULT_CLOSED"}
    tool = "MOVE"

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        if settings.route is None:
            layout.label(text="It has no route yet", icon="INFO")
            return
        # In place the ground goes by, evenly, and the route is kept for later.
        layout.active = settings.travel_on != "NONE"
        splines = getattr(settings.route.data, "splines", ())
        if len(splines) > 1 or settings.spline >= 0:
            layout.prop(settings, "spline")
        layout.row().prop(settings, "speed_mode", expand=True)
        column = layout.column(align=True)
        column.prop(settings, "ease_in")
        column.prop(settings, "ease_out", text="Out")
        if settings.table.manner != "SWIM":
            layout.prop(settings, "stalk")
        if settings.table.manner != "SWIM" and settings.ground.use:
            row = layout.row()
            row.active = settings.heading == "ALONG"
            row.prop(settings, "slow_in_bends")
            draw_rest(layout, settings)


class OCTO_MOTION_PT_heading(_Panel, bpy.types.Panel):
    bl_label = "Heading and Height"
    bl_parent_id = "OCTO_MOTION_PT_route"
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        if settings.table.manner != "SWIM":
            layout.row().prop(settings, "heading", expand=True)
            layout.prop(settings, "heading_angle")
            row = layout.row()
            row.active = not settings.ground.use
            row.prop(settings, "keep_upright")
            layout.prop(settings, "stand")
        else:
            layout.prop(settings, "streamline")
            layout.prop(settings, "bank_in_turns")
        column = layout.column(align=True)
        column.prop(settings, "look_ahead")
        column.prop(settings, "corner")
        column = layout.column()
        column.row().prop(settings, "height_mode", expand=True)
        if settings.height_mode == "MANUAL":
            column.prop(settings, "height", text=" ")


class OCTO_MOTION_PT_gait(_Panel, bpy.types.Panel):
    bl_label = "Gait"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}
    tool = "MOVE"

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = settings.table
        row = layout.row(align=True)
        row.alert = bool(used(table.curves)) and table.name != settings.gait
        row.menu(OCTO_MOTION_MT_gaits.__name__, text=shown_name(settings.gait))
        row.menu(OCTO_MOTION_MT_gait.__name__, text="", icon="DOWNARROW_HLT")
        layout.prop(table, "stride")
        layout.prop(settings, "contraction")
        layout.prop(settings, "turning")
        if table.manner == "SWIM":
            layout.prop(settings, "burst")


class OCTO_MOTION_PT_body(_Panel, bpy.types.Panel):
    bl_label = "Body"
    bl_parent_id = "OCTO_MOTION_PT_gait"
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        body = settings.body
        layout.prop(body, "surge")
        column = layout.column(align=True)
        column.prop(settings, "breathing")
        if settings.breathing > 0.0:
            column.prop(settings, "breath_time", text="Breath Time")
        column = layout.column(align=True)
        for name in ("mantle", "siphon", "eyes", "head"):
            column.prop(body, name)
        layout.prop(body, "trail")
        if settings.travel_on != "NONE":
            layout.prop(body, "settle")
        row = layout.row()
        row.active = body.eyes > 0.0
        row.prop(body, "look_at")


class OCTO_MOTION_PT_body_bones(_Panel, bpy.types.Panel):
    bl_label = "Bones"
    bl_parent_id = "OCTO_MOTION_PT_body"
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        armature = cast("bpy.types.Object", armature_in(bpy.context))
        for name in ("mantle_bone", "siphon_bone", "eye_left", "eye_right"):
            layout.prop_search(settings.body, name, armature.data, "bones")


class OCTO_MOTION_PT_variation(_Panel, bpy.types.Panel):
    bl_label = "Variation"
    bl_parent_id = "OCTO_MOTION_PT_gait"
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.prop(settings, "phase_spread")
        layout.prop(settings, "uneven")
        column = layout.column(align=True)
        column.prop(settings, "variation_min", text="Random Min")
        column.prop(settings, "variation_max", text="Max")
        layout.prop(settings, "seed")


class OCTO_MOTION_PT_weights(_Panel, bpy.types.Panel):
    bl_label = "Joint Weights"
    bl_parent_id = "OCTO_MOTION_PT_gait"
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.prop(settings, "use_weight_curve")
        group = settings.weight_curve
        if not settings.use_weight_curve:
            column = layout.column(align=True)
            column.prop(settings, "weight_root", text="Root")
            column.prop(settings, "weight_tip", text="Tip")
        elif group is not None and curve_node(group) is not None:
            if group.users > 1:
                # A copy of the armature shares the curve; a click on the number parts them.
                layout.template_ID(settings, "weight_curve")
            layout.template_curve_mapping(group.nodes[NODE], "mapping")
        else:
            layout.label(text="The curve is gone: switch it off and on.", icon="ERROR")
        for name in ("softness", "give", "steady", "sway"):
            layout.prop(settings, name)


class OCTO_MOTION_PT_generate(_Panel, bpy.types.Panel):
    bl_label = "Move"
    bl_order = 1
    tool = "MOVE"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        OCTO_MOTION_PT_setups.draw_panel_header(cast("Any", self).layout)
        super().draw_header_preset(context)

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        draw_setups(layout)
        row = layout.row(align=True)
        row.scale_y = 1.5
        # Split, the name of the switch would take half of the button's room.
        row.use_property_split = False
        row.operator(OCTO_MOTION_OT_generate_locomotion.bl_idname, icon="PLAY", text="Generate")
        row.prop(settings, "live", toggle=True, icon="FILE_REFRESH")
        column = layout.column()
        travels = column.column()
        travels.active = settings.travel_on != "NONE"
        travels.prop(settings, "route")
        if settings.route is None:
            travels.operator(
                OCTO_MOTION_OT_add_route.bl_idname, text="Add Route", icon="CURVE_BEZCURVE"
            )
        if settings.ground.use:
            travels.prop(settings.ground, "object", text="Ground")
        column.row().prop(settings, "timing", expand=True)
        values = {"CADENCE": "cycle_time", "SPEED": "speed", "RANGE": "frame_end"}
        column.prop(settings, values[settings.timing])
        column.row().prop(settings, "keys", expand=True)
        # What comes and goes stands last: nothing jumps under the mouse.
        draw_live_error(layout, settings)
        if settings.result is not None:
            _draw_result(layout, settings.result)
            draw_edits(layout, cast("bpy.types.Object", settings.id_data), settings.result)


class OCTO_MOTION_PT_frames(_Panel, bpy.types.Panel):
    bl_label = "Frames and Keys"
    bl_parent_id = "OCTO_MOTION_PT_generate"
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.prop(settings, "frame_start")
        layout.prop(settings, "extend_scene_range")
        layout.prop(settings, "travel_on")
        if settings.travel_on == "NONE":
            layout.prop(settings, "cycles")
            layout.prop(settings, "repeat")
        if settings.keys == "REDUCED":
            column = layout.column(align=True)
            column.prop(settings, "key_angle", text="Tolerance Angle")
            column.prop(settings, "key_distance")
            layout.row().prop(settings, "key_columns", expand=True)
        layout.prop(settings, "keep_apart")
        layout.prop(settings, "tell_overlaps")


def _draw_result(layout: Any, action: bpy.types.Action) -> None:
    render = cast("bpy.types.Scene", bpy.context.scene).render
    length = (action.frame_end - action.frame_start) / render.fps * render.fps_base
    column = layout.column(align=True)
    column.label(text=action.name, icon="ACTION", translate=False)
    frames = action.frame_end - action.frame_start + 1.0
    column.label(
        text=translated(
            phrase("{frames:.0f} frames, {length:.1f} s", frames=frames, length=length)
        ),
        icon="BLANK1",
    )
    keys, dense = key_counts(action)
    if keys < dense:
        column.label(
            text=translated(phrase("{keys:,} keys instead of {dense:,}", keys=keys, dense=dense)),
            icon="BLANK1",
        )


CLASSES: Final = (
    OCTO_MOTION_PT_rig,
    OCTO_MOTION_PT_generate,
    OCTO_MOTION_PT_frames,
    OCTO_MOTION_PT_given_poses,
    OCTO_MOTION_PT_quality,
    OCTO_MOTION_PT_arms,
    OCTO_MOTION_PT_route,
    OCTO_MOTION_PT_ground,
    OCTO_MOTION_PT_heading,
    OCTO_MOTION_PT_gait,
    OCTO_MOTION_PT_body,
    OCTO_MOTION_PT_body_bones,
    OCTO_MOTION_PT_table,
    OCTO_MOTION_PT_change,
    OCTO_MOTION_PT_along,
    OCTO_MOTION_PT_variation,
    OCTO_MOTION_PT_weights,
    OCTO_MOTION_PT_reaches,
)
