# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of an armature's arms: found, then edited by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import bpy
from bpy.props import BoolProperty, EnumProperty

from ....blender.rig import (
    active_armature,
    armature_data,
    connected_bones,
    disconnect_bones,
    hidden_bones,
    read_skeleton,
    require_editable,
    select_pose_bones,
    selected_bones,
    world_directions,
)
from ....core.errors import RigError, WriteError
from ....core.locomotion.rig import (
    ArmChain,
    Detection,
    body_frame,
    chain_of,
    detect_arms,
    place_added,
)
from ....core.phrases import joined_phrases, phrase
from ...declared_settings import assign
from ...language import reported, translated
from ...operator_base import (
    ArmatureOperator,
    ItemOperator,
    ListKind,
    ListOperator,
    MoveOperator,
    RemoveOperator,
)
from ...panel_base import ArmaturePanel, ItemRows, draw_list
from ..reading import (
    add_item,
    body_axes,
    bones_of,
    listed_arms,
    placed_arms,
    write_arms,
    write_body,
)
from ..settings import AXES, locomotion_settings

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


def _axis(name: str, description: str) -> Any:
    return EnumProperty(
        name=name,
        description=description,
        items=_AXIS_CHOICES,
        default="AUTO",
        options={"SKIP_SAVE"},
    )


def list_arms(
    armature: bpy.types.Object, settings: Any, *, up: Any = None, front: Any = None
) -> tuple[Detection, int]:
    """Find an armature's arms and list them; what was found, and how many arms of a linked file
    had to be switched off.
    """
    skeleton = read_skeleton(armature)
    found = detect_arms(skeleton, *world_directions(armature), up=up, front=front)
    left_over = write_arms(settings, found.arms)
    write_body(settings, found)
    return found, left_over


class OCTO_MOTION_OT_detect_arms(ListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.detect_arms"
    bl_label = "Detect Arms"
    bl_description = (
        "Find the chains of bones that are arms, and list them with side and pair. Done again, it "
        "keeps names, phases and flips of arms whose bones are the same"
    )
    KIND = _ARMS

    front: _axis("Front", "Which way the body faces, as an axis of the armature")
    up: _axis("Up", "Where the body's top is, as an axis of the armature")

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:
        # Transforms that a script has just set count as well.
        context.view_layer.update()
        set_before = (settings.body_up, settings.body_front) if settings.arms else (None, None)
        up, front = (
            before if chosen == "AUTO" else chosen
            for chosen, before in zip((self.up, self.front), set_before, strict=True)
        )
        found, left_over = list_arms(armature, settings, up=up, front=front)
        self.report({"INFO"}, reported(_summary(found.arms)))
        for note in found.notes:
            self.report({"WARNING"}, reported(note))
        if left_over:
            self.report(
                {"WARNING"},
                reported(
                    phrase(
                        "Arms of the linked file cannot be removed here: {left_over} switched off.",
                        left_over=left_over,
                    )
                ),
            )


class OCTO_MOTION_OT_arm_add(ListOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_add"
    bl_label = "Add Arm"
    bl_description = (
        "Add an arm made of the selected bones: three or more of one chain, in any order. Side "
        "and pair follow from where it lies. In edit mode it goes to pose mode"
    )
    KIND = _ARMS

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if context.mode in {"POSE", "EDIT_ARMATURE"}:
            return ""
        return "Select the arm's bones in pose mode or edit mode first"

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:
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
                reported(
                    phrase(
                        "Constraints or drivers move bones of '{added}': keys have no effect while "
                        "those are on.",
                        added=added.name,
                    )
                ),
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


class OCTO_MOTION_OT_arm_flip(ItemOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_flip"
    bl_label = "Flip Arm"
    bl_description = (
        "Mirror the active arm's motion: forward and twist turn the other way. For an arm that "
        "moves backward where its neighbors move forward. Done again, it takes that back"
    )
    KIND = _ARMS

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        arm = settings.arms[settings.active_arm]
        arm.flip = not arm.flip


class OCTO_MOTION_OT_arm_select(ItemOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_select"
    bl_label = "Select Arm's Bones"
    bl_description = (
        "Show which bones the active arm is made of: select them in pose mode. Hold Shift to add "
        "them to what is selected"
    )
    KIND = _ARMS

    extend: BoolProperty(
        name="Extend",
        description="Keep what is selected",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if found := super().obstacle(context):
            return found
        itself = context.object == active_armature(context)
        return "" if itself else "Make the armature itself the active object first"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:
        self.extend = event.shift
        return self.execute(context)

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:
        arm = settings.arms[settings.active_arm]
        bones = bones_of(arm)
        hidden = hidden_bones(armature, bones)
        if len(hidden) == len(bones):
            raise RigError(
                phrase("All bones of '{arm}' are hidden.", arm=arm.name),
                "Reveal them (Alt H in pose mode), or switch on their bone collection.",
            )
        if context.mode != "POSE":
            bpy.ops.object.mode_set(mode="POSE")
        select_pose_bones(armature, bones, extend=self.extend)
        if hidden:
            self.report(
                {"WARNING"},
                reported(
                    phrase(
                        "{count} of {total} bones are hidden and were left out ('{example}' …).",
                        count=len(hidden),
                        total=len(bones),
                        example=hidden[0],
                    )
                ),
            )


def collect_arms(armature: bpy.types.Object, settings: Any) -> int:
    """Give each arm of the list a bone collection, by which its bones are selected, shown and
    hidden; how many there are. Bones stay in those where they are.

    Raises:
        WriteError: the bones are linked.
    """
    data = armature_data(armature)
    if not data.is_editable:
        raise WriteError(
            phrase("The bones of '{armature}' are linked and read-only.", armature=armature.name),
            "Open the file that they are from.",
        )
    for arm in settings.arms:
        own = data.collections_all.get(arm.name) or data.collections.new(arm.name)
        for name in bones_of(arm):
            if name in data.bones:
                own.assign(data.bones[name])
    return len(settings.arms)


class OCTO_MOTION_OT_arm_collections(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arm_collections"
    bl_label = "Bone Collections"
    bl_description = (
        "Give each arm of the list a bone collection of its name: Object Data Properties, Bone "
        "Collections selects, shows and hides the arm from there"
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        settings = locomotion_settings(armature)
        if not len(settings.arms):
            raise RigError("The list has no arms.", "Detect them first.")
        made = phrase("{count} bone collections.", count=collect_arms(armature, settings))
        self.report({"INFO"}, reported(made))


class OCTO_MOTION_OT_arms_disconnect(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.arms_disconnect"
    bl_label = "Disconnect Bones"
    bl_description = (
        "Let bones of the listed arms be moved: switch off Connected in their Relations. They stay "
        "where they are, and nothing else of the armature changes. Stretch as Location needs it"
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        told = phrase("{count} bones disconnected.", count=disconnect_arms(armature))
        self.report({"INFO"}, reported(told))


def disconnect_arms(armature: bpy.types.Object) -> int:
    """Let bones of an armature's arms, the listed ones or those that are found, be moved; how many
    could not.

    Raises:
        RigError: it has no arms.
        WriteError: the bones are linked, or the armature is hidden.
    """
    settings = locomotion_settings(armature)
    arms, _, _ = listed_arms(settings, armature, read_skeleton(armature))
    found = connected_bones(armature, [arm.bones for arm in arms])
    if found:
        disconnect_bones(armature, found)
    return len(found)


class OCTO_MOTION_PT_arms(ArmaturePanel, bpy.types.Panel):
    bl_label = "Arms"
    bl_order = 2
    bl_options = {"DEFAULT_CLOSED"}
    tool = "MOVE"
    settings_of = staticmethod(locomotion_settings)

    def show(self, layout: Any, settings: Any) -> None:
        """The list with its buttons, the active arm's details, and which way the body faces."""
        layout.use_property_split = False
        layout.operator(OCTO_MOTION_OT_detect_arms.bl_idname, icon="VIEWZOOM")
        buttons = draw_list(
            *(layout, OCTO_MOTION_UL_arms, settings, ("arms", "active_arm")),
            (OCTO_MOTION_OT_arm_add, OCTO_MOTION_OT_arm_remove, OCTO_MOTION_OT_arm_move),
            # As high as the buttons beside it, or as an octopus needs.
            rows=7,
            maxrows=8,
        )
        buttons.separator()
        buttons.operator(OCTO_MOTION_OT_arm_select.bl_idname, text="", icon="RESTRICT_SELECT_OFF")
        buttons.operator(OCTO_MOTION_OT_arm_flip.bl_idname, text="", icon="ARROW_LEFTRIGHT")
        buttons.operator(OCTO_MOTION_OT_arm_collections.bl_idname, text="", icon="GROUP_BONE")
        arm = _ARMS.active_item(settings)
        if arm is not None:
            _draw_details(_split_column(layout), arm)
        column = _split_column(layout)
        column.prop(settings, "body_front")
        column.prop(settings, "body_up")
        column.prop_search(settings, "root_bone", settings.id_data.data, "bones")
        column.prop(settings, "keep_pose")


def _split_column(layout: Any) -> Any:
    column = layout.column()
    column.use_property_split, column.use_property_decorate = True, False
    return column


def _draw_details(column: Any, arm: Any) -> None:
    if arm.bones:
        told = phrase(
            "{count} bones, {first} … {last}",
            count=len(arm.bones),
            first=arm.bones[0].name,
            last=arm.bones[-1].name,
        )
        column.label(text=translated(told), icon="BONE_DATA")
    missing = [bone.name for bone in arm.bones if bone.name not in arm.id_data.data.bones]
    if missing:
        column.label(
            text=translated(phrase("No bone '{missing}': detect again", missing=missing[0])),
            icon="ERROR",
        )
    for name in ("side", "pair", "phase", "flip", "use_weights"):
        column.prop(arm, name)
    if arm.use_weights:
        weights = column.column(align=True)
        weights.prop(arm, "weight_root", text="Weight Root")
        weights.prop(arm, "weight_tip")


def _summary(arms: Sequence[ArmChain]) -> str:
    counts = {
        told: sum(arm.side == side for arm in arms)
        for side, told in (
            ("LEFT", phrase("{count} left")),
            ("RIGHT", phrase("{count} right")),
            ("CENTER", phrase("{count} in the middle")),
        )
    }
    told = joined_phrases(
        ", ", (phrase(told, count=count) for told, count in counts.items() if count)
    )
    if len(arms) == 1:
        return phrase("1 arm found: {told}.", told=told)
    return phrase("{count} arms found: {told}.", count=len(arms), told=told)
