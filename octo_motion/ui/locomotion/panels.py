# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab, in the order of the work: rig, arms, route, gait, generate."""

from __future__ import annotations

from typing import Any, Final, cast

import bpy

from ...blender.animation import key_counts
from ...blender.files import NODE, curve_node
from ..panel_base import ArmaturePanel, ItemRows, TabPanel, armature_in, draw_sentence
from .operators import (
    OCTO_MOTION_MT_gait,
    OCTO_MOTION_MT_gait_offset,
    OCTO_MOTION_OT_add_octopus,
    OCTO_MOTION_OT_add_route,
    OCTO_MOTION_OT_gait_curve_add,
    OCTO_MOTION_OT_gait_curve_remove,
    OCTO_MOTION_OT_gait_knot_add,
    OCTO_MOTION_OT_gait_knot_remove,
    OCTO_MOTION_OT_gait_load,
    OCTO_MOTION_OT_gait_offset_remove,
    OCTO_MOTION_OT_generate_locomotion,
    OCTO_MOTION_PT_setups,
    draw_arms,
    draw_changes,
    draw_figures,
    draw_ground,
    draw_reaches,
    draw_rest,
)
from .settings import (
    OCTO_MOTION_PG_gait_curve,
    OCTO_MOTION_PG_gait_table,
    OCTO_MOTION_PG_locomotion,
    known_figures,
    locomotion_settings,
    used,
)

_SIDES: Final = {"LEFT": "L", "RIGHT": "R", "CENTER": ""}


class _Panel(ArmaturePanel):
    """A panel of the armature's locomotion."""

    @staticmethod
    def settings_of(armature: bpy.types.Object) -> OCTO_MOTION_PG_locomotion:
        return locomotion_settings(armature)


class OCTO_MOTION_PT_rig(TabPanel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_rig"
    bl_label = "Rig"
    bl_order = 0

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        assert layout is not None
        armature = armature_in(context)
        if armature is None:
            column = layout.column(align=True)
            column.label(text="No armature is active.", icon="INFO")
            column.label(text="Select one, or add an octopus:", icon="BLANK1")
        else:
            layout.label(text=armature.name, icon="OUTLINER_OB_ARMATURE")
            if not armature.is_editable:
                column = layout.column(align=True)
                column.label(text="Linked and read-only.", icon="LIBRARY_DATA_DIRECT")
                column.label(text="Make a library override.", icon="BLANK1")
        layout.operator(
            OCTO_MOTION_OT_add_octopus.bl_idname, text="Add Octopus", icon="OUTLINER_OB_ARMATURE"
        )


class OCTO_MOTION_PT_arms(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_arms"
    bl_label = "Arms"
    bl_order = 1

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.use_property_split = False
        draw_arms(layout, bpy.context, settings)


class OCTO_MOTION_PT_route(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_route"
    bl_label = "Route"
    bl_order = 2

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.prop(settings, "route", text="Curve")
        if settings.route is None:
            layout.operator(
                OCTO_MOTION_OT_add_route.bl_idname, text="Add Route", icon="CURVE_BEZCURVE"
            )
            return
        # In place the ground goes by, evenly, and the route is kept for later.
        layout.active = settings.travel_on != "NONE"
        splines = getattr(settings.route.data, "splines", ())
        if len(splines) > 1 or settings.spline >= 0:
            layout.prop(settings, "spline")
        if settings.table.manner != "SWIM" and settings.ground.use:
            layout.prop(settings.ground, "object", text="Ground")
        layout.row().prop(settings, "speed_mode", expand=True)
        column = layout.column(align=True)
        column.prop(settings, "ease_in")
        column.prop(settings, "ease_out", text="Out")
        if settings.table.manner != "SWIM" and settings.ground.use:
            draw_rest(layout, settings)


class OCTO_MOTION_PT_ground(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_ground"
    bl_label = "Hold the Ground"
    bl_parent_id = OCTO_MOTION_PT_route.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        armature = armature_in(context)
        layout = cast("Any", self).layout
        if armature is not None and layout is not None:
            layout.prop(locomotion_settings(armature).ground, "use", text="")

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        draw_ground(layout, settings)


class OCTO_MOTION_PT_heading(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_heading"
    bl_label = "Heading and Height"
    bl_parent_id = OCTO_MOTION_PT_route.bl_idname
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
    bl_idname = "OCTO_MOTION_PT_gait"
    bl_label = "Gait"
    bl_order = 3

    def draw_header_preset(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        OCTO_MOTION_PT_setups.draw_panel_header(cast("Any", self).layout)

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = settings.table
        row = layout.row(align=True)
        row.alert = bool(used(table.curves)) and table.name != settings.gait
        row.prop(settings, "gait")
        row.menu(OCTO_MOTION_MT_gait.bl_idname, text="", icon="DOWNARROW_HLT")
        layout.prop(table, "stride")
        layout.prop(settings, "contraction")
        layout.prop(settings, "turning")
        if table.manner == "SWIM":
            layout.prop(settings, "burst")
        column = layout.column(align=True)
        column.prop(settings, "breathing")
        if settings.breathing > 0.0:
            column.prop(settings, "breath_time", text="Breath Time")


class OCTO_MOTION_PT_table(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_table"
    bl_label = "Table"
    bl_parent_id = OCTO_MOTION_PT_gait.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        table = settings.table
        layout.row().prop(table, "manner", expand=True)
        if table.manner == "SWIM":
            layout.prop(table, "power_phase")
        column = layout.column(align=True)
        column.prop(table, "spread_pairs", text="Spread Pairs")
        column.prop(table, "spread_sides")
        _draw_offsets(layout, table)
        curves = used(table.curves)
        if not curves:
            layout.operator(
                OCTO_MOTION_OT_gait_load.bl_idname, text="Edit Angles", icon="GREASEPENCIL"
            )
            return
        row = layout.row()
        row.template_list(
            OCTO_MOTION_UL_gait_curves.__name__, "", table, "curves", table, "active_curve", rows=2
        )
        column = row.column(align=True)
        column.operator(OCTO_MOTION_OT_gait_curve_add.bl_idname, text="", icon="ADD")
        column.operator(OCTO_MOTION_OT_gait_curve_remove.bl_idname, text="", icon="REMOVE")
        if 0 <= table.active_curve < len(curves):
            _draw_knots(layout, table, curves[table.active_curve])


def _draw_offsets(layout: Any, table: OCTO_MOTION_PG_gait_table) -> None:
    column = layout.column(align=True)
    for number, offset in enumerate(used(table.offsets)):
        row = column.row(align=True)
        row.prop(offset, "phase", text=f"Arm {offset.pair} {_SIDES[offset.side]}")
        remove = row.operator(
            OCTO_MOTION_OT_gait_offset_remove.bl_idname, text="", icon="X", emboss=False
        )
        remove.offset = number
    layout.menu(OCTO_MOTION_MT_gait_offset.bl_idname, icon="ADD")


def _draw_knots(
    layout: Any, table: OCTO_MOTION_PG_gait_table, curve: OCTO_MOTION_PG_gait_curve
) -> None:
    layout.use_property_split = False
    layout.row().prop(table, "shown_angle", expand=True)
    angle = table.shown_angle.lower()
    column = layout.column(align=True)
    row = column.row(align=True)
    for title in ("Phase", "Root", "Middle", "Tip"):
        row.label(text=title)
    row.label(text="", icon="BLANK1")
    for number, knot in enumerate(used(curve.knots)):
        row = column.row(align=True)
        row.prop(knot, "phase", text="")
        for link in range(3):
            row.prop(knot, angle, index=link, text="")
        remove = row.operator(
            OCTO_MOTION_OT_gait_knot_remove.bl_idname, text="", icon="X", emboss=False
        )
        remove.knot = number
    layout.operator(OCTO_MOTION_OT_gait_knot_add.bl_idname, icon="ADD")
    if table.manner != "SWIM":
        layout.prop(curve, "free")


class OCTO_MOTION_UL_gait_curves(ItemRows, bpy.types.UIList):
    """A row for the angles of all arms, and one for each pair that has its own."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        if item.unused:
            layout.active = False
            layout.label(text="Unused, of the linked file")
        elif item.pair == 0:
            layout.label(text="All Arms", icon="FCURVE")
        else:
            row = layout.row()
            row.label(text="Only Pair", icon="FCURVE")
            row.prop(item, "pair", text="", emboss=False)


class OCTO_MOTION_PT_change(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_change"
    bl_label = "Change of Gait"
    bl_parent_id = OCTO_MOTION_PT_gait.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        draw_changes(layout, settings)


class OCTO_MOTION_PT_variation(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_variation"
    bl_label = "Variation"
    bl_parent_id = OCTO_MOTION_PT_gait.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.prop(settings, "phase_spread")
        column = layout.column(align=True)
        column.prop(settings, "variation_min", text="Random Min")
        column.prop(settings, "variation_max", text="Max")
        column = layout.column()
        column.active = settings.variation_min != 0.0 or settings.variation_max != 0.0
        column.prop(settings, "seed")


class OCTO_MOTION_PT_weights(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_weights"
    bl_label = "Joint Weights"
    bl_parent_id = OCTO_MOTION_PT_gait.bl_idname
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
        layout.prop(settings, "softness")
        layout.prop(settings, "give")
        layout.prop(settings, "steady")
        layout.prop(settings, "sway")


class OCTO_MOTION_PT_reaches(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_reaches"
    bl_label = "Reaches"
    bl_options = {"DEFAULT_CLOSED"}
    bl_order = 3

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        draw_reaches(layout, settings)


class OCTO_MOTION_PT_generate(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_generate"
    bl_label = "Generate"
    bl_order = 4

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        layout.row().prop(settings, "timing", expand=True)
        column = layout.column(align=True)
        if settings.timing == "CADENCE":
            column.prop(settings, "cycle_time", text="Cycle Time")
        elif settings.timing == "SPEED":
            column.prop(settings, "speed", text="Speed")
        column = layout.column(align=True)
        column.prop(settings, "frame_start", text="Frame Start")
        if settings.timing == "RANGE":
            column.prop(settings, "frame_end")
        layout.prop(settings, "extend_scene_range")
        layout.prop(settings, "travel_on")
        if settings.travel_on == "NONE":
            layout.prop(settings, "cycles")
            layout.prop(settings, "repeat")
        layout.row().prop(settings, "keys", expand=True)
        if settings.keys == "REDUCED":
            column = layout.column(align=True)
            column.prop(settings, "key_angle", text="Tolerance Angle")
            column.prop(settings, "key_distance")
            layout.row().prop(settings, "key_columns", expand=True)
        layout.prop(settings, "keep_apart")
        layout.prop(settings, "tell_overlaps")
        row = layout.row(align=True)
        row.scale_y = 1.5
        # Split, the name of the switch would take half of the button's room.
        row.use_property_split = False
        row.operator(OCTO_MOTION_OT_generate_locomotion.bl_idname, icon="PLAY", text="Generate")
        row.prop(settings, "live", toggle=True, icon="FILE_REFRESH")
        if settings.live_error:
            row = layout.row()
            row.alert = True
            draw_sentence(row, bpy.context, settings.live_error, "ERROR")
        _draw_result(layout, bpy.context, settings)


class OCTO_MOTION_PT_quality(_Panel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_quality"
    bl_label = "Quality"
    bl_parent_id = OCTO_MOTION_PT_generate.bl_idname
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        armature = armature_in(context)
        return armature is not None and bool(known_figures(locomotion_settings(armature)))

    def show(self, layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
        draw_figures(layout, settings)


def _draw_result(
    layout: Any, context: bpy.types.Context, settings: OCTO_MOTION_PG_locomotion
) -> None:
    action = settings.result
    if action is None:
        return
    scene = cast("bpy.types.Scene", context.scene)
    length = (action.frame_end - action.frame_start) / scene.render.fps * scene.render.fps_base
    column = layout.column(align=True)
    column.label(text=action.name, icon="ACTION")
    frames = action.frame_end - action.frame_start + 1.0
    column.label(text=f"{frames:.0f} frames, {length:.1f} s", icon="BLANK1")
    keys, dense = key_counts(action)
    if keys < dense:
        column.label(text=f"{keys:,} keys instead of {dense:,}", icon="BLANK1")


CLASSES: Final = (
    OCTO_MOTION_UL_gait_curves,
    OCTO_MOTION_PT_rig,
    OCTO_MOTION_PT_arms,
    OCTO_MOTION_PT_route,
    OCTO_MOTION_PT_ground,
    OCTO_MOTION_PT_heading,
    OCTO_MOTION_PT_gait,
    OCTO_MOTION_PT_table,
    OCTO_MOTION_PT_change,
    OCTO_MOTION_PT_variation,
    OCTO_MOTION_PT_weights,
    OCTO_MOTION_PT_reaches,
    OCTO_MOTION_PT_generate,
    OCTO_MOTION_PT_quality,
)
