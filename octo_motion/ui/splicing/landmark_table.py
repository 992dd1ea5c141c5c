# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of landmarks: found, then put right by hand, kept as a preset.

Presets are Blender's own kind (a menu with + and −), for a table of names is what they are made
for: artists know them, and they need no files of ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, cast

import bpy
from bpy.props import BoolProperty, EnumProperty

from ...blender.rig import armature_data, read_skeleton
from ...core.errors import RigError
from ...core.phrases import as_phrase, joined_phrases, phrase
from ...core.splicing.humanoid import LANDMARKS, MIDDLE, OPTIONAL, SIDED, map_skeleton, mirrored
from ..language import hinted, reported
from ..operator_base import ARMATURE, ArmaturePresetAdd
from ..panel_base import armature_in
from .bodies import SavedLandmarks, clip_doubts, in_motion, is_complete, saved_landmarks
from .mapping_operators import draw_mapping
from .properties import PROPERTIES, read_landmarks, title, write_landmarks, write_reference
from .reference_figure import OCTO_MOTION_OT_reference_show, is_shown
from .splice_operators import StackOperator

_CHOICES: Final = tuple(
    (name, each, "Part of the body", number)
    for number, (each, name) in enumerate(PROPERTIES.items())
)


class OCTO_MOTION_OT_map_skeleton(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.map_skeleton"
    bl_label = "Find Landmarks"
    bl_description = (
        "Find out which bone is which part of the body, from the names of the bones, from the rest "
        "pose and from the action. What cannot be told is left empty for you to choose"
    )

    keep: BoolProperty(
        name="Keep What Is Set",
        description="Fill empty rows only",
        options={"SKIP_SAVE"},
    )

    saved: BoolProperty(
        name="Use Saved Mappings",
        description="Take the mapping that you have saved for this kind of skeleton, if there is "
        "one, before anything is found anew",
        default=True,
        options={"SKIP_SAVE"},
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        saved = saved_landmarks(armature) if self.saved else SavedLandmarks()
        found = map_skeleton(read_skeleton(armature), in_motion(armature))
        if found.problem and not saved.bones:
            raise RigError(
                phrase(
                    "'{armature}' has no landmarks. {problem}",
                    armature=armature.name,
                    problem=as_phrase(found.problem),
                ),
                "Choose an armature with two arms, two legs and a head, or fill the table by hand.",
            )
        bones = dict(saved.bones) if is_complete(saved.bones) else {}
        bones = bones or dict(found.landmarks.bones) | saved.bones
        if self.keep:
            bones |= read_landmarks(settings.landmarks).bones
        write_landmarks(settings.landmarks, bones)
        if saved.reference != "":
            write_reference(settings.landmarks, saved.reference)
        whose = (
            phrase(" Mapping: {mapping} (saved).", mapping=saved.mapping) if saved.mapping else ""
        )
        self.report(
            {"INFO"},
            reported(
                phrase(
                    "{count} of {total} landmarks are set.{whose}",
                    count=len(bones),
                    total=len(LANDMARKS),
                    whose=whose,
                )
            ),
        )
        asked = [each for each in found.asked if each not in bones]
        if asked:
            names = joined_phrases(", ", map(title, asked))
            self.report(
                {"WARNING"},
                reported(
                    phrase(
                        "Choose the bones of: {names}. {missing}",
                        names=names,
                        missing=as_phrase(found.missing[asked[0]]),
                    )
                ),
            )
        doubts = clip_doubts(armature, read_landmarks(settings.landmarks))
        for note in (*(() if saved.mapping else found.notes), *doubts, *saved.damaged):
            self.report({"WARNING"}, reported(note))


class OCTO_MOTION_OT_landmark_pick(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.landmark_pick"
    bl_label = "Pick Landmark"
    bl_description = "Take the active bone of pose mode for this part of the body"

    landmark: EnumProperty(
        name="Landmark",
        description="Which part of the body",
        items=_CHOICES,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if found := super().obstacle(context):
            return found
        return (
            "Click the bone in pose mode first"
            if context.mode != "POSE" or context.active_pose_bone is None
            else ""
        )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:
        bone = context.active_pose_bone
        if bone is None or bone.id_data != armature:
            raise RigError(
                phrase("The active bone is not of '{armature}'.", armature=armature.name),
                "Click a bone of that armature.",
            )
        setattr(settings.landmarks, self.landmark, bone.name)


class OCTO_MOTION_OT_landmarks_mirror(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.landmarks_mirror"
    bl_label = "Mirror Landmarks"
    bl_description = (
        "Fill one side of the table with the bones that are called like those of the other side"
    )

    direction: EnumProperty(
        name="Direction",
        items=(
            ("LEFT_TO_RIGHT", "Left to Right", "The left side is as it should be"),
            ("RIGHT_TO_LEFT", "Right to Left", "The right side is as it should be"),
        ),
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:  # noqa: ARG003
        """The tooltip of either button."""
        other = phrase("right") if properties.direction == "LEFT_TO_RIGHT" else phrase("left")
        return hinted(
            phrase(
                "Fill the {other} side with the bones that are called like those of this side",
                other=other,
            )
        )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        bones = dict(read_landmarks(settings.landmarks).bones)
        source, target = ("L", "R") if self.direction == "LEFT_TO_RIGHT" else ("R", "L")
        given = {part: bones[f"{part}.{source}"] for part in SIDED if f"{part}.{source}" in bones}
        word = {"L": phrase("left"), "R": phrase("right")}
        if not given:
            raise RigError(
                phrase("The {word} side of the table is empty.", word=word[source]),
                "Fill it first.",
            )
        names = [bone.name for bone in armature_data(armature).bones]
        for part, name in given.items():
            other = mirrored(names, name)
            if other is None:
                raise RigError(
                    phrase(
                        "There is no bone called like '{name}' on the {word} side.",
                        name=name,
                        word=word[target],
                    ),
                    "Choose that side's bones by hand.",
                )
            bones[f"{part}.{target}"] = other
        write_landmarks(settings.landmarks, bones)


class OCTO_MOTION_OT_landmarks_clear(StackOperator, bpy.types.Operator):
    bl_idname = "octo_motion.landmarks_clear"
    bl_label = "Clear Landmarks"
    bl_description = "Empty the table. Bones and their keys stay as they are"

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        write_landmarks(settings.landmarks, {})


class OCTO_MOTION_MT_landmark_presets(bpy.types.Menu):
    bl_label = "Landmark Presets"
    bl_description = "Tables that were kept, for all rigs whose bones are called the same"
    preset_subdir = "octo_motion/landmarks"
    preset_operator = "script.execute_preset"

    def draw(self, context: bpy.types.Context | None) -> None:
        """All presets, as in Blender's own menus."""
        context = cast("bpy.types.Context", context)
        # The files are about the active object, which may as well be the armature's mesh or route.
        armature = armature_in(context)
        if armature is not None:
            cast("Any", self).layout.context_pointer_set("object", armature)
        self.draw_preset(context)


class OCTO_MOTION_OT_landmark_preset_add(  # pyright: ignore[reportIncompatibleMethodOverride]
    ArmaturePresetAdd, bpy.types.Operator
):
    bl_idname = "octo_motion.landmark_preset_add"
    bl_label = "Keep Landmarks as Preset"
    bl_description = "Keep the table, for all rigs whose bones are called the same"
    preset_menu = "OCTO_MOTION_MT_landmark_presets"
    preset_subdir = "octo_motion/landmarks"
    preset_defines = [
        *ARMATURE,
        "landmarks = armature.octo_motion.splicing.landmarks",
    ]
    preset_values = [
        *(f"landmarks.{name}" for name in PROPERTIES.values()),
        # A frame that is asked for is the current one, until it is set.
        *("landmarks.reference_pose", "landmarks.reference_frame"),
    ]


def draw_landmarks(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    settings: Any,
) -> None:
    """The table with its buttons; missing and unknown bones are marked."""
    row = layout.row(align=True)
    row.operator(OCTO_MOTION_OT_map_skeleton.bl_idname, icon="ARMATURE_DATA")
    row.operator(OCTO_MOTION_OT_landmarks_clear.bl_idname, text="", icon="X")
    draw_mapping(layout, settings)
    row = layout.row(align=True)
    menu = OCTO_MOTION_MT_landmark_presets
    preset = OCTO_MOTION_OT_landmark_preset_add.bl_idname
    row.menu(menu.__name__, text=menu.bl_label)
    row.operator(preset, text="", icon="ADD")
    cast("Any", row.operator(preset, text="", icon="REMOVE")).remove_active = True
    table, armature = settings.landmarks, settings.id_data
    row = layout.row(align=True)
    row.prop(table, "reference_pose")
    if table.reference_pose == "FRAME":
        row.prop(table, "reference_frame", text="")
    row.operator(
        OCTO_MOTION_OT_reference_show.bl_idname,
        text="",
        icon="HIDE_OFF",
        depress=is_shown(armature),
    )
    # Picking is for pose mode: elsewhere the buttons would only take room.
    can_pick = context.mode == "POSE"
    _draw_rows(layout, table, armature, MIDDLE, can_pick=can_pick)
    for side, heading, direction in (
        ("L", "Left", "LEFT_TO_RIGHT"),
        ("R", "Right", "RIGHT_TO_LEFT"),
    ):
        row = layout.row(align=True)
        row.label(text=heading)
        mirror = row.operator(OCTO_MOTION_OT_landmarks_mirror.bl_idname, text="", icon="MOD_MIRROR")
        cast("Any", mirror).direction = direction
        parts = tuple(f"{part}.{side}" for part in SIDED)
        _draw_rows(layout, table, armature, parts, can_pick=can_pick)


def _draw_rows(
    layout: bpy.types.UILayout,
    table: Any,
    armature: bpy.types.Object,
    landmarks: Sequence[str],
    *,
    can_pick: bool,
) -> None:
    # One column: side by side, names would be cut to two letters in a sidebar of usual width.
    column = layout.column(align=True)
    bones = armature_data(armature).bones
    for landmark in landmarks:
        name = PROPERTIES[landmark]
        bone = getattr(table, name)
        wrong = bone not in bones and (bool(bone) or landmark not in OPTIONAL)
        split = column.split(factor=0.4, align=True)
        words = title(landmark).removeprefix("left ").removeprefix("right ")
        label = split.row(align=True)
        label.alert = wrong
        label.label(text=words.capitalize(), icon="ERROR" if wrong else "NONE")
        row = split.row(align=True)
        row.prop_search(table, name, armature.data, "bones", text="")
        if can_pick:
            pick = row.operator(OCTO_MOTION_OT_landmark_pick.bl_idname, text="", icon="EYEDROPPER")
            cast("Any", pick).landmark = name
