# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts with the ground: shown, shifted and cleared, and their part of the panel."""

from __future__ import annotations

from typing import Any, cast

import bpy
from bpy.props import FloatProperty

from ....blender.rig import active_armature, connected_bones, require_editable
from ....blender.scene import markers, remove_markers
from ....core.errors import OctoMotionError, SettingsError
from ....core.phrases import phrase
from ...language import reported, translated
from ...operator_base import ArmatureOperator, OctoOperator, show_in_local_view
from ...panel_base import ArmaturePanel, TabPanel, armature_in
from ..reading import bones_of, resting
from ..settings import (
    OCTO_MOTION_PG_locomotion,
    changed_by_hand,
    locomotion_settings,
    once_called,
    read_overrides,
    store,
)
from ..writing import prepare, show_contacts
from .arms import OCTO_MOTION_OT_arms_disconnect


class OCTO_MOTION_OT_contacts_show(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.contacts_show"
    bl_label = "Show Contacts"
    bl_description = (
        "Put a marker wherever an arm takes hold of the ground. Drag or turn a marker and the arm "
        "holds on there; delete it and the arm does not; then generate again"
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        shot = prepare(armature, context)
        plan = shot.plan()
        if not plan.can_show_contacts:
            raise SettingsError(
                "This motion has no contacts with the ground.",
                "Choose a walk along a route, and Hold the Ground.",
            )
        count = show_contacts(armature, plan, shot.edits)
        show_in_local_view(context, *markers(armature))
        self.report({"INFO"}, reported(phrase("{count} contacts.", count=count)))


class OCTO_MOTION_OT_contacts_hide(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.contacts_hide"
    bl_label = "Hide Contacts"
    bl_description = "Take the markers away. What was changed on them is kept"

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        require_editable(armature)
        settings = locomotion_settings(armature).ground
        store(settings, read_overrides(settings, armature))
        _take_away(context, armature)


class OCTO_MOTION_OT_contacts_clear(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.contacts_clear"
    bl_label = "Free Contacts"
    bl_description = (
        "Forget what was moved, locked, shifted or deleted: all contacts are again where the gait "
        "has them"
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        require_editable(armature)
        settings = locomotion_settings(armature).ground
        shown = bool(settings.shown)
        store(settings, {})
        _take_away(context, armature)
        if not shown:
            return
        try:
            shot = prepare(armature, context)
            plan = shot.plan()
        except OctoMotionError as error:
            # They are free all the same.
            self.report({"WARNING"}, reported(phrase("No markers are shown: {error}", error=error)))
            return
        if plan.can_show_contacts:
            show_contacts(armature, plan, shot.edits)


class OCTO_MOTION_OT_contacts_shift(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.contacts_shift"
    bl_label = "Shift Contacts in Time"
    bl_description = (
        "Let the arms of the selected markers take hold so many frames later, or earlier if it is "
        "negative; then generate again"
    )

    frames: FloatProperty(
        name="Frames",
        description="How much later the contact is",
        default=2.0,
        soft_min=-24.0,
        soft_max=24.0,
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if context.mode != "OBJECT":
            return "Go to object mode first"
        return "" if _selected(context) else "Select markers of contacts"

    def run(self, context: bpy.types.Context) -> None:
        for item in _selected(context):
            own: Any = item.octo_motion.contact  # type: ignore[attr-defined]
            own.shift += self.frames / max(own.cycle_frames, 1e-6)


def _selected(context: bpy.types.Context) -> list[bpy.types.Object]:
    chosen = context.selected_objects
    return [item for item in chosen if item.octo_motion.contact.armature]  # type: ignore[attr-defined]


def _take_away(context: bpy.types.Context, armature: bpy.types.Object) -> None:
    """Take all markers away; the armature is active if what was active is gone."""
    settings = locomotion_settings(armature).ground
    remove_markers(armature, once_called(settings))
    settings.shown = ""
    layer = context.view_layer
    if layer is not None and layer.objects.active is None and armature in layer.objects.values():
        layer.objects.active = armature


def draw_rest(layout: Any, settings: OCTO_MOTION_PG_locomotion) -> None:
    """Whether the creature stands at the ends of its way."""
    ground = settings.ground
    column = layout.column(heading=translated("Rest"))
    for name, text, ease in (
        ("start_at_rest", phrase("At Start"), settings.ease_in),
        ("come_to_rest", phrase("At End"), settings.ease_out),
    ):
        row = column.row()
        row.active = ease > 0.0
        row.prop(ground, name, text=text)
    column = layout.column()
    column.active = any(resting(settings))
    column.prop(ground, "rest_within")


def _draw_stretch(column: Any, settings: Any) -> None:
    """What other programs make of arms that get longer, or what keeps arms from it."""
    ground = settings.ground
    if not ground.stretch:
        return
    if ground.stretch_as == "SCALE":
        column.label(text="Scale: not for glTF, FBX, USD", icon="INFO")
    elif connected_bones(settings.id_data, [bones_of(item) for item in settings.arms]):
        column.operator(OCTO_MOTION_OT_arms_disconnect.bl_idname, icon="UNLINKED")


class OCTO_MOTION_PT_ground(ArmaturePanel, bpy.types.Panel):
    bl_label = "Hold the Ground"
    bl_parent_id = "OCTO_MOTION_PT_route"
    bl_options = {"DEFAULT_CLOSED"}
    settings_of = staticmethod(locomotion_settings)

    def draw_header(self, context: bpy.types.Context) -> None:
        armature = armature_in(context)
        if armature is not None:
            cast("Any", self).layout.prop(locomotion_settings(armature).ground, "use", text="")

    def show(self, layout: Any, settings: Any) -> None:
        ground = settings.ground
        layout.active = ground.use and settings.table.manner != "SWIM"
        for names in (
            ("duty", "planted"),
            ("stretch", "stretch_as"),
            ("lift",),
            ("lean", "smoothing"),
        ):
            column = layout.column(align=True)
            for name in names:
                column.prop(ground, name)
            if "stretch" in names:
                _draw_stretch(column, settings)
        column = layout.column()
        column.active = ground.object is not None
        column.prop(ground, "up")
        row = layout.row(align=True)
        if ground.shown:
            row.operator(OCTO_MOTION_OT_contacts_hide.bl_idname, icon="HIDE_ON")
        else:
            row.operator(OCTO_MOTION_OT_contacts_show.bl_idname, icon="EMPTY_SINGLE_ARROW")
        row.operator(OCTO_MOTION_OT_contacts_clear.bl_idname, text="", icon="LOOP_BACK")
        if count := changed_by_hand(ground):
            one = count == 1
            told = phrase(
                "{count} contact changed by hand" if one else "{count} contacts changed by hand",
                count=count,
            )
            layout.label(text=translated(told), icon="PINNED")


class OCTO_MOTION_PT_contact(TabPanel, bpy.types.Panel):
    bl_label = "Contact"
    bl_order = 0

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        item = context.object
        return item is not None and bool(item.octo_motion.contact.armature)  # type: ignore[attr-defined]

    def draw(self, context: bpy.types.Context) -> None:
        layout = cast("Any", self).layout
        own = cast("Any", context.object).octo_motion.contact
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.label(
            text=translated(phrase("{arm}, cycle {cycle}", arm=own.arm, cycle=own.cycle)),
            icon="PINNED",
        )
        layout.label(
            text=translated(
                phrase("Frames {on:.0f} to {off:.0f}", on=own.frame_on, off=own.frame_off)
            ),
            icon="TIME",
        )
        layout.prop(own, "locked")
        layout.prop(own, "shift")
        layout.operator(OCTO_MOTION_OT_contacts_shift.bl_idname)
