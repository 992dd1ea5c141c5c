# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of an armature's arms: found, then edited by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, cast

import bpy
from bpy.props import BoolProperty, EnumProperty

from ....blender.rig import (
    active_armature,
    armature_data,
    hidden_bones,
    read_skeleton,
    require_editable,
    select_pose_bones,
    selected_bones,
    world_directions,
)
from ....core.errors import RigError
from ....core.locomotion.rig import ArmChain, body_frame, chain_of, detect_arms, place_added
from ...declared_settings import assign
from ...operator_base import ItemOperator, ListKind, ListOperator, MoveOperator, RemoveOperator
from ...panel_base import ItemRows
from ..reading import (
    active_arm,
    add_item,
    body_axes,
    bones_of,
    list_owner,
    placed_arms,
    write_arms,
    write_body,
)
from ..settings import AXES, OCTO_MOTION_PG_locomotion, locomotion_settings

_SIDE_LETTERS: Final = {"LEFT": "L", "RIGHT": "R", "CENTER": "-"}
_AXIS_CHOICES: Final = (
    (
        "AUTO",
        "Automatic",
        "As the panel says if there is a list already, else as names and symmetry of the arms tell",
        6,
    ),
    *AXES,
)


class OCTO_MOTION_UL_arms(ItemRows, bpy.types.UIList):
    """A row for each arm: on or off, name, bones, side, pair, phase."""

    def draw_row(self, layout: bpy.types.UILayout, item: Any) -> None:
        columns = layout.split(factor=0.5)
        row = columns.row(align=True)
        row.prop(item, "enabled", text="")
        # Red: bones were renamed or removed since.
        row.alert = any(bone.name not in item.id_data.data.bones for bone in item.bones)
        row.prop(item, "name", text="", emboss=False)
        row = columns.row()
        row.active = item.enabled
        row.label(text=str(len(item.bones)))
        row.label(text=_SIDE_LETTERS[item.side] + str(item.pair))
        row.label(text=f"{math.degrees(item.phase):.0f}°")


_ARMS: Final = ListKind(
    settings=locomotion_settings,
    check=require_editable,
    items="arms",
    active="active_arm",
    one="an arm",
    instead="Switch it off with its checkbox instead.",
)


class _ArmListOperator(ListOperator):
    """An operator on the list of arms."""

    KIND = _ARMS


class _ActiveArmOperator(ItemOperator):
    """An operator on the list's active arm."""

    KIND = _ARMS


class OCTO_MOTION_OT_detect_arms(_ArmListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.detect_arms"
    bl_label = "Detect Arms"
    bl_description = (
        "Find the chains of bones that are arms, and list them with side and pair. Done again, it "
        "keeps names, phases and flips of arms whose bones are the same"
    )
    bl_options = {"REGISTER", "UNDO"}

    front: EnumProperty(
        name="Front",
        description="Which way the body faces, as an axis of the armature",
        items=_AXIS_CHOICES,
        default="AUTO",
        options={"SKIP_SAVE"},
    )
    up: EnumProperty(
        name="Up",
        description="Where the body's top is, as an axis of the armature",
        items=_AXIS_CHOICES,
        default="AUTO",
        options={"SKIP_SAVE"},
    )

    def edit(
        self,
        context: bpy.types.Context,
        armature: bpy.types.Object,
        settings: OCTO_MOTION_PG_locomotion,
    ) -> None:
        # Transforms that a script has just set count as well.
        context.view_layer.update()
        listed = len(settings.arms) > 0
        found = detect_arms(
            read_skeleton(armature),
            *world_directions(armature),
            up=_axis(self.up, settings.body_up if listed else None),
            front=_axis(self.front, settings.body_front if listed else None),
        )
        left_over = write_arms(settings, found.arms)
        write_body(settings, found)
        self.report({"INFO"}, _summary(found.arms))
        for note in found.notes:
            self.report({"WARNING"}, note)
        if left_over:
            self.report(
                {"WARNING"},
                f"Arms of the linked file cannot be removed here: {left_over} switched off.",
            )


class OCTO_MOTION_OT_arm_add(_ArmListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_add"
    bl_label = "Add Arm"
    bl_description = (
        "Add an arm made of the selected bones: three or more of one chain, in any order. Side "
        "and pair follow from where it lies. In edit mode it goes to pose mode"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode not in {"POSE", "EDIT_ARMATURE"}:
            cls.poll_message_set("Select the arm's bones in pose mode or edit mode first")
            return False
        return True

    def edit(
        self,
        context: bpy.types.Context,
        armature: bpy.types.Object,
        settings: OCTO_MOTION_PG_locomotion,
    ) -> None:
        skeleton = read_skeleton(armature)
        bones = chain_of(skeleton, selected_bones(armature))
        others = placed_arms(settings, skeleton)
        up, front = body_axes(settings, armature)
        body = body_frame(skeleton, [bones, *(each[0] for each in others)], up, front)
        added = place_added(skeleton, bones, others, body)
        if context.mode == "EDIT_ARMATURE":
            # Undo in edit mode takes back changes of bones alone, so the list is edited outside.
            bpy.ops.object.mode_set(mode="POSE")
            select_pose_bones(armature, bones)
        assign(settings, "body_up", up)
        assign(settings, "body_front", front)
        add_item(settings, added)
        settings.active_arm = len(settings.arms) - 1
        if added.driven:
            self.report(
                {"WARNING"},
                f"Constraints or drivers move bones of '{added.name}': keys have no effect while "
                "those are on.",
            )


class OCTO_MOTION_OT_arm_remove(RemoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_remove"
    bl_label = "Remove Arm"
    bl_description = "Take the active arm off the list. Its bones and their keys stay as they are"
    KIND = _ARMS


class OCTO_MOTION_OT_arm_move(MoveOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_move"
    bl_label = "Move Arm"
    bl_description = (
        "Move the active arm in the list. The order is for you; gaits go by side and pair"
    )
    KIND = _ARMS


class OCTO_MOTION_OT_arm_flip(_ActiveArmOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_flip"
    bl_label = "Flip Arm"
    bl_description = (
        "Mirror the active arm's motion: forward and twist turn the other way. For an arm that "
        "moves backward where its neighbors move forward. Done again, it takes that back"
    )
    bl_options = {"REGISTER", "UNDO"}

    def edit(
        self,
        context: bpy.types.Context,  # noqa: ARG002
        armature: bpy.types.Object,  # noqa: ARG002
        settings: OCTO_MOTION_PG_locomotion,
    ) -> None:
        arm = settings.arms[settings.active_arm]
        arm.flip = not arm.flip


class OCTO_MOTION_OT_arm_select(_ActiveArmOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_select"
    bl_label = "Select Arm's Bones"
    bl_description = (
        "Show which bones the active arm is made of: select them in pose mode. Hold Shift to add "
        "them to what is selected"
    )
    bl_options = {"REGISTER", "UNDO"}

    extend: BoolProperty(
        name="Extend",
        description="Keep what is selected",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not super().poll(context):
            return False
        if context.object != active_armature(context):
            cls.poll_message_set("Make the armature itself the active object first")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:
        self.extend = event.shift
        return self.execute(context)

    def edit(
        self,
        context: bpy.types.Context,
        armature: bpy.types.Object,
        settings: OCTO_MOTION_PG_locomotion,
    ) -> None:
        arm = settings.arms[settings.active_arm]
        bones = bones_of(arm)
        hidden = hidden_bones(armature, bones)
        if len(hidden) == len(bones):
            raise RigError(
                f"All bones of '{arm.name}' are hidden.",
                "Reveal them (Alt H in pose mode), or switch on their bone collection.",
            )
        if context.mode != "POSE":
            bpy.ops.object.mode_set(mode="POSE")
        select_pose_bones(armature, bones, extend=self.extend)
        if hidden:
            self.report(
                {"WARNING"},
                f"{len(hidden)} of {len(bones)} bones are hidden and were left out "
                f"('{hidden[0]}' …).",
            )


def draw_arms(
    layout: bpy.types.UILayout,
    _context: bpy.types.Context,
    settings: OCTO_MOTION_PG_locomotion,
) -> None:
    """The list with its buttons, the active arm's details, and which way the body faces."""
    layout.operator(OCTO_MOTION_OT_detect_arms.bl_idname, icon="VIEWZOOM")
    row = layout.row()
    row.template_list(
        OCTO_MOTION_UL_arms.__name__,
        "",
        settings,
        "arms",
        settings,
        "active_arm",
        # As high as the buttons beside it, or as an octopus needs.
        rows=7,
        maxrows=8,
    )
    _draw_buttons(row.column(align=True))
    arm = active_arm(settings)
    if arm is not None:
        _draw_details(layout, arm, list_owner(settings))
    column = layout.column()
    column.use_property_split, column.use_property_decorate = True, False
    column.prop(settings, "body_front")
    column.prop(settings, "body_up")
    column.prop_search(settings, "root_bone", list_owner(settings).data, "bones")


def _draw_buttons(column: bpy.types.UILayout) -> None:
    column.operator(OCTO_MOTION_OT_arm_add.bl_idname, text="", icon="ADD")
    column.operator(OCTO_MOTION_OT_arm_remove.bl_idname, text="", icon="REMOVE")
    column.separator()
    up = column.operator(OCTO_MOTION_OT_arm_move.bl_idname, text="", icon="TRIA_UP")
    cast("Any", up).direction = "UP"
    down = column.operator(OCTO_MOTION_OT_arm_move.bl_idname, text="", icon="TRIA_DOWN")
    cast("Any", down).direction = "DOWN"
    column.separator()
    column.operator(OCTO_MOTION_OT_arm_select.bl_idname, text="", icon="RESTRICT_SELECT_OFF")
    column.operator(OCTO_MOTION_OT_arm_flip.bl_idname, text="", icon="ARROW_LEFTRIGHT")


def _draw_details(layout: bpy.types.UILayout, arm: Any, armature: bpy.types.Object) -> None:
    column = layout.column()
    column.use_property_split, column.use_property_decorate = True, False
    if arm.bones:
        told = f"{len(arm.bones)} bones, {arm.bones[0].name} … {arm.bones[-1].name}"
        column.label(text=told, icon="BONE_DATA")
    missing = [bone.name for bone in arm.bones if bone.name not in armature_data(armature).bones]
    if missing:
        column.label(text=f"No bone '{missing[0]}': detect again", icon="ERROR")
    for name in ("side", "pair", "phase", "flip"):
        column.prop(arm, name)


def _axis(chosen: str, otherwise: str | None) -> str | None:
    return otherwise if chosen == "AUTO" else chosen


def _summary(arms: Sequence[ArmChain]) -> str:
    counts = {
        word: sum(arm.side == side for arm in arms)
        for side, word in (("LEFT", "left"), ("RIGHT", "right"), ("CENTER", "in the middle"))
    }
    told = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return f"{len(arms)} {'arm' if len(arms) == 1 else 'arms'} found: {told}."


CLASSES: Final[tuple[type, ...]] = (
    OCTO_MOTION_UL_arms,
    OCTO_MOTION_OT_detect_arms,
    OCTO_MOTION_OT_arm_add,
    OCTO_MOTION_OT_arm_remove,
    OCTO_MOTION_OT_arm_move,
    OCTO_MOTION_OT_arm_flip,
    OCTO_MOTION_OT_arm_select,
)
