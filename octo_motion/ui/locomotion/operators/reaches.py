# SPDX-License-Identifier: GPL-3.0-or-later
"""The lists of reaches and of places where the gait or a setting changes: added, removed, drawn."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final, cast

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ....blender.animation import writable_armature
from ....blender.files import gait_names, has_gait, load_gait
from ....blender.rig import active_armature, require_editable
from ....blender.scene import WITH_SURFACE
from ....core.errors import RigError, SettingsError
from ....core.phrases import phrase
from ...declared_settings import free_name
from ...operator_base import ArmatureOperator, ListKind, ListOperator, RemoveOperator
from ...panel_base import ArmaturePanel, ItemRows, draw_list
from ..reading import bones_of
from ..settings import MODES, SETTINGS_ALONG, locomotion_settings

_SECONDS_TO_REACH: Final = 1.25
_SECONDS_TO_COIL: Final = 1.5
"""Twice round: in less, the tip turns by more than 30° in a frame."""
_SECONDS_TO_BRING: Final = 1.7
_SECONDS_TO_HOLD: Final = 2.0
_SECONDS_WOUND: Final = 0.75
"""A body that walks on has soon gone too far."""
_SECONDS_BACK: Final = 1.7


_REACHES: Final = ListKind(
    settings=locomotion_settings,
    check=require_editable,
    items="reaches",
    active="active_reach",
    one="a reach",
    instead="Mute it instead.",
)


class OCTO_MOTION_UL_reaches(ItemRows, bpy.types.UIList):
    """A row for each reach: on or off, name, when it touches."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        row = layout.row(align=True)
        row.prop(item, "mute", text="", icon="HIDE_ON" if item.mute else "HIDE_OFF", emboss=False)
        name = row.row()
        name.active = not item.mute
        # Red: its object is gone.
        name.alert = item.target is None and item.mode != "CURL"
        name.prop(item, "name", text="", emboss=False)
        at = row.row()
        at.alignment = "RIGHT"
        at.active = not item.mute
        at.label(text=str(item.frame_contact))


class OCTO_MOTION_OT_reach_add(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.reach_add"
    bl_label = "Add Reach"
    bl_description = (
        "Let an arm reach for an object: select the object, then Shift click the creature. The "
        "arm touches it at the current frame, and is in place when you generate. Without an "
        "object the arm curls up. In pose mode it is the arm of the active bone, else the one "
        "nearest to the object"
    )

    mode: EnumProperty(name="Mode", description="What the arm does", items=MODES, default="COIL")
    target: StringProperty(
        name="Object",
        description="What it reaches for; the other selected object if empty",
        options={"SKIP_SAVE"},
    )
    arm: StringProperty(
        name="Arm",
        description="Name of the arm in the list; if empty, that of the active bone in pose mode, "
        "else the nearest",
        options={"SKIP_SAVE"},
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        require_editable(armature)
        settings: Any = locomotion_settings(armature)
        target = self._target(context, armature)
        mode = "CURL" if target is None else self.mode
        arm = self._arm(context, armature, settings)
        if not arm and mode == "CURL":
            raise SettingsError(
                "It is not said which arm curls, or what to reach for.",
                "Select an object and Shift click the creature; or click a bone of the arm in "
                "pose mode.",
            )
        scene = context.scene
        assert scene is not None
        rate = scene.render.fps / scene.render.fps_base
        name = free_name(settings.reaches, "Curl" if target is None else target.name)
        item = settings.reaches.add()
        item.name, item.arm, item.target, item.mode = name, arm, target, mode
        item.frame_contact = scene.frame_current
        item.frame_start = item.frame_contact - round(_SECONDS_TO_REACH * rate)
        item.coil_frames = round(_SECONDS_TO_COIL * rate)
        item.bring_frames = round(_SECONDS_TO_BRING * rate)
        item.back_frames = round(_SECONDS_BACK * rate)
        lasts = _SECONDS_TO_HOLD
        if mode == "COIL":
            lasts = _SECONDS_TO_COIL + _SECONDS_WOUND
        item.frame_release = item.frame_contact + round(lasts * rate)
        if mode == "MOUTH":
            # It stays at the mouth as long as the arm would hold it, and it is a long way back.
            item.frame_release += item.coil_frames + item.bring_frames
            item.back_frames *= 2
        settings.active_reach = len(settings.reaches) - 1

    def _target(
        self, context: bpy.types.Context, armature: bpy.types.Object
    ) -> bpy.types.Object | None:
        if self.mode == "CURL":
            return None
        if self.target:
            found = bpy.data.objects.get(self.target)
            if found is None or found.type not in WITH_SURFACE:
                raise SettingsError(
                    phrase("There is no object '{target}' with a surface.", target=self.target),
                    "Choose an object with faces.",
                )
            return found
        others = [
            each
            for each in context.selected_objects
            if each not in (armature, context.object)
            and each.type in WITH_SURFACE
            and each.find_armature() != armature
        ]
        if len(others) > 1:
            raise SettingsError(
                phrase("{count} other objects are selected.", count=len(others)),
                "Select one object, then Shift click the creature.",
            )
        return others[0] if others else None

    def _arm(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> str:
        if self.arm:
            if self.arm not in settings.arms:
                raise RigError(
                    phrase("There is no arm '{arm}' in the list.", arm=self.arm),
                    "Choose one of the list's arms.",
                )
            return self.arm
        bone = context.active_pose_bone
        if context.mode == "POSE" and bone is not None and bone.id_data == armature:
            for item in settings.arms:
                if bone.name in bones_of(item):
                    return str(item.name)
        return ""


class OCTO_MOTION_OT_reach_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.reach_remove"
    bl_label = "Remove Reach"
    bl_description = "Take the active reach off the list. Generate to see the motion without it"
    KIND = _REACHES


class OCTO_MOTION_PT_reaches(ArmaturePanel, bpy.types.Panel):
    bl_label = "Reaches"
    bl_order = 5
    bl_options = {"DEFAULT_CLOSED"}
    tool = "MOVE"
    settings_of = staticmethod(locomotion_settings)

    def show(self, layout: Any, settings: Any) -> None:
        buttons = OCTO_MOTION_OT_reach_add, OCTO_MOTION_OT_reach_remove
        draw_list(
            layout, OCTO_MOTION_UL_reaches, settings, ("reaches", "active_reach"), buttons, rows=2
        )
        item = _REACHES.active_item(settings)
        if item is None:
            return
        layout = layout.column()
        layout.active = not item.mute
        layout.prop(item, "mode")
        if item.mode != "CURL":
            layout.prop(item, "target")
        layout.prop_search(item, "arm", settings, "arms")
        winds = item.mode in {"COIL", "MOUTH"}
        if winds:
            layout.prop(item, "turns")
        if item.mode in {"COIL", "TOUCH"}:
            layout.prop(item, "carry")
        if item.mode != "CURL":
            layout.prop(item, "axis")
        column = layout.column(align=True)
        column.prop(item, "frame_start", text="Frame Start")
        column.prop(item, "frame_contact", text="Closed" if item.mode == "CURL" else "Contact")
        column.prop(item, "frame_release", text="Release")
        column = layout.column(align=True)
        if winds:
            column.prop(item, "coil_frames", text="Frames to Coil")
            if item.mode == "MOUTH":
                column.prop(item, "bring_frames", text="Bring")
            column.prop(item, "back_frames", text="Back")
        else:
            column.prop(item, "back_frames", text="Frames Back")


# --- Places where the gait changes ----------------------------------------------------------------


def _change_settings(armature: bpy.types.Object) -> Any:
    return cast("Any", locomotion_settings(armature)).change


_PLACES: Final = ListKind(
    settings=_change_settings,
    check=writable_armature,
    items="places",
    active="active_place",
    one="a place",
    instead="Set its gait to that of the place before.",
)


class OCTO_MOTION_UL_changes(ItemRows, bpy.types.UIList):
    """A row for each place: where, and which gait from there on."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        row = layout.row(align=True)
        row.alert = not has_gait(item.gait)
        row.label(text=item.gait, icon="ANIM")
        row.prop(item, "position", text="", emboss=False)


def position_on_route() -> Any:
    """The property of operators that says at which place of a route."""
    return FloatProperty(
        name="Position",
        description="Where along the route: 0 at its start, 1 at its end",
        subtype="FACTOR",
        default=0.5,
        min=0.0,
        max=1.0,
    )


class OCTO_MOTION_OT_change_add(ListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.change_add"
    bl_label = "Add Change of Gait"
    bl_description = "Let another gait go from a place of the route on"

    KIND = _PLACES

    gait: StringProperty(
        name="Gait",
        description="The gait from there on",
        default="swim",
        search=lambda _operator, _context, _text: gait_names(),
    )
    position: position_on_route()

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        load_gait(self.gait)
        item = settings.places.add()
        # Library overrides tell items apart by name.
        taken = {each.name for each in settings.places}
        number = len(settings.places)
        while f"Place {number}" in taken:
            number += 1
        item.name = f"Place {number}"
        item.gait, item.position = self.gait, self.position
        settings.active_place = len(settings.places) - 1
        settings.by = "MARKERS"


class OCTO_MOTION_OT_change_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.change_remove"
    bl_label = "Remove Change of Gait"
    bl_description = "Let the gait before go on here"

    KIND = _PLACES


class OCTO_MOTION_PT_change(ArmaturePanel, bpy.types.Panel):
    bl_label = "Change of Gait"
    bl_parent_id = "OCTO_MOTION_PT_gait"
    bl_options = {"DEFAULT_CLOSED"}
    settings_of = staticmethod(_change_settings)

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "by")
        if settings.by == "HEIGHT":
            column = layout.column(align=True)
            for name in ("gait", "height", "length"):
                column.prop(settings, name)
        elif settings.by == "MARKERS":
            buttons = OCTO_MOTION_OT_change_add, OCTO_MOTION_OT_change_remove
            names = "places", "active_place"
            draw_list(layout, OCTO_MOTION_UL_changes, settings, names, buttons, rows=3)
            item = _PLACES.active_item(settings)
            if item is not None:
                column = layout.column(align=True)
                for name in ("gait", "position", "length"):
                    column.prop(item, name)


# --- Settings along the route ---------------------------------------------------------------------


_ALONG: Final = ListKind(
    settings=locomotion_settings,
    check=writable_armature,
    items="along",
    active="active_along",
    one="a value",
    instead="Give it the value of the place before.",
)

_ALONG_APART: Final = 1e-3
"""Share of the route by which a new value is off those of its setting at least."""


class OCTO_MOTION_UL_along(ItemRows, bpy.types.UIList):
    """A row for each value: of what, how much, where."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        row = layout.row(align=True)
        row.prop(item, "setting", text="", emboss=False)
        row.prop(item, item.setting.lower(), text="", emboss=False)
        row.prop(item, "position", text="", emboss=False)


class OCTO_MOTION_OT_along_add(ListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.along_add"
    bl_label = "Add Value"
    bl_description = "Let a setting have a value of its own at a place of the route"

    KIND = _ALONG

    setting: EnumProperty(
        name="Setting",
        description="What has a value there",
        items=SETTINGS_ALONG,
    )
    position: position_on_route()

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        same = [each for each in settings.along if each.setting == self.setting]
        ground = settings.ground
        values = {"lift": ground.lift, "hold": ground.duty, "lean": ground.lean}
        position, taken = self.position, [each.position for each in same]
        if same:
            nearest = min(same, key=lambda each: abs(each.position - position))
            values = {self.setting.lower(): nearest.value}
        if any(abs(each - position) < _ALONG_APART for each in taken):
            ends = sorted([0.0, *taken, 1.0])
            before, after = max(pairwise(ends), key=lambda each: each[1] - each[0])
            position = 0.5 * (before + after)
        name = free_name(settings.along, "Value")
        item = settings.along.add()
        item.name, item.setting, item.position = name, self.setting, position
        for each, value in values.items():
            setattr(item, each, value)
        settings.active_along = len(settings.along) - 1


class OCTO_MOTION_OT_along_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.along_remove"
    bl_label = "Remove Value"
    bl_description = "Let the places before and after decide here"

    KIND = _ALONG


class OCTO_MOTION_PT_along(ArmaturePanel, bpy.types.Panel):
    bl_label = "Settings Along the Route"
    bl_parent_id = "OCTO_MOTION_PT_gait"
    bl_options = {"DEFAULT_CLOSED"}
    settings_of = staticmethod(locomotion_settings)

    def show(self, layout: Any, settings: Any) -> None:
        layout.active = settings.travel_on != "NONE"
        buttons = OCTO_MOTION_OT_along_add, OCTO_MOTION_OT_along_remove
        draw_list(
            layout, OCTO_MOTION_UL_along, settings, ("along", "active_along"), buttons, rows=2
        )
        item = _ALONG.active_item(settings)
        if item is not None:
            column = layout.column(align=True)
            for name in ("setting", item.setting.lower(), "position"):
                column.prop(item, name)
