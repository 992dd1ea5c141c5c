# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that a motion begins and ends in: taken, drawn."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty

from ....blender.animation import make_pose_action, writable_armature
from ....blender.rig import active_armature
from ....core.phrases import phrase
from ...language import reported
from ...operator_base import ArmatureOperator
from ...panel_base import ArmaturePanel
from ..settings import locomotion_settings


class OCTO_MOTION_OT_pose_take(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_take"
    bl_label = "Take Pose"
    bl_description = (
        "Let the motion begin or end in the pose that the armature has now, where it stands now: "
        "an action keeps it"
    )

    at: EnumProperty(
        name="At",
        description="Which end of the motion",
        items=(
            ("BEGIN", "Begin", "The motion begins in the pose", 0),
            ("END", "End", "The motion ends in the pose", 1),
        ),
    )

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        writable_armature(armature)
        settings: Any = locomotion_settings(armature)
        given = settings.begin_pose if self.at == "BEGIN" else settings.end_pose
        assert armature.pose is not None
        assert context.scene is not None
        given.frame = context.scene.frame_current
        given.action = make_pose_action(
            armature,
            [bone.name for bone in armature.pose.bones],
            f"{armature.name} {self.at.capitalize()}",
            frame=given.frame,
            with_object=True,
        )
        told = phrase("The pose is kept in '{action}'.", action=given.action.name)
        self.report({"INFO"}, reported(told))


class OCTO_MOTION_PT_given_poses(ArmaturePanel, bpy.types.Panel):
    bl_label = "Begin and End"
    bl_parent_id = "OCTO_MOTION_PT_generate"
    bl_options = {"DEFAULT_CLOSED"}
    settings_of = staticmethod(locomotion_settings)

    def show(self, layout: Any, settings: Any) -> None:
        for at, given in (("BEGIN", settings.begin_pose), ("END", settings.end_pose)):
            column = layout.column(align=True)
            row = column.row(align=True)
            row.prop(given, "action", text="Begin in Pose" if at == "BEGIN" else "End in Pose")
            row.operator(OCTO_MOTION_OT_pose_take.bl_idname, text="", icon="ARMATURE_DATA").at = at
            if given.action is not None:
                for name in ("frame", "frames", "with_place"):
                    column.prop(given, name)
