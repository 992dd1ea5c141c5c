# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist decides: which bones are limbs, which objects are solid."""

from __future__ import annotations

from typing import Any, Final

import bpy
from bpy.props import EnumProperty

from ...blender.animation import writable_armature
from ...blender.rig import active_armature, mark_bones, selected_bones
from ...core.errors import RigError, WriteError
from ..operator_base import ArmatureOperator, OctoOperator
from .properties import OBSTACLES


class OCTO_MOTION_OT_pose_mark_bones(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_mark_bones"
    bl_label = "Mark Bones"
    bl_description = (
        "Decide for the selected bones whether they are limbs of the puppet or only follow the "
        "bone they hang on, where it was told wrongly by itself"
    )
    bl_options = {"REGISTER", "UNDO"}

    mark: EnumProperty(
        name="Mark",
        description="What the selected bones are",
        items=(
            ("BODY", "Limb", "They can be grabbed and bent", 0),
            ("FOLLOW", "Follows", "They keep their pose and follow their parent", 1),
            ("AUTO", "Automatic", "Names, skin and constraints decide", 2),
        ),
        default="BODY",
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        names = selected_bones(armature)
        if not names:
            raise RigError("No bones are selected.", "Select bones in pose mode.")
        data = armature.data
        if data is None or not data.is_editable:
            raise WriteError(
                f"The bones of '{armature.name}' are linked and read-only.",
                "Mark them in the linked file.",
            )
        mark_bones(armature, list(names), "" if self.mark == "AUTO" else self.mark)
        self.report({"INFO"}, f"Marked {len(names)} bones.")


class OCTO_MOTION_OT_pose_obstacle(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_obstacle"
    bl_label = "Mark Obstacle"
    bl_description = "Let the selected objects stop puppets, as a shape of your choice"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(
        name="Shape", description="What puppets take them for", items=OBSTACLES, default="BOX"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode not in {"OBJECT", "POSE"}:
            cls.poll_message_set("Go to object mode or pose mode first")
            return False
        return True

    def run(self, context: bpy.types.Context) -> None:
        chosen = [each for each in context.selected_objects if each.type != "ARMATURE"]
        if not chosen:
            raise RigError(
                "No object that could be an obstacle is selected.", "Select a mesh or an empty."
            )
        for each in chosen:
            if not each.is_editable:
                raise WriteError(
                    f"'{each.name}' is linked and read-only here.", "Make a library override."
                )
        for item in chosen:
            own: Any = item
            own.octo_motion.posing.obstacle = self.kind
        self.report({"INFO"}, f"Marked {len(chosen)} objects.")


CLASSES: Final[tuple[type, ...]] = (
    OCTO_MOTION_OT_pose_mark_bones,
    OCTO_MOTION_OT_pose_obstacle,
)
