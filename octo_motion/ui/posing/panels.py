# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Pose: the material, the world, the keys."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ..panel_base import ArmaturePanel
from .custom_material import CUSTOM
from .marks import OCTO_MOTION_OT_pose_mark_bones, OCTO_MOTION_OT_pose_obstacle
from .measure import OCTO_MOTION_OT_pose_forget_measured, OCTO_MOTION_OT_pose_measure
from .pose_start import OCTO_MOTION_OT_pose_start
from .properties import posing_settings
from .puppet_session import active_session
from .script_player import OCTO_MOTION_OT_pose_script


class PosePanel(ArmaturePanel):
    """A panel of the armature's posing."""

    bl_options = {"DEFAULT_CLOSED"}

    @staticmethod
    def settings_of(armature: bpy.types.Object) -> Any:
        return posing_settings(armature)


class OCTO_MOTION_PT_posing(PosePanel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_posing"
    bl_label = "Pose"
    bl_order = 7

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "material")
        if settings.material == CUSTOM:
            column = layout.column(align=True)
            column.prop(settings, "custom_yields")
            giving = column.column(align=True)
            giving.active = settings.custom_yields
            giving.prop(settings, "custom_bears")
            giving.prop(settings, "custom_gives")
            column.prop(settings, "custom_springs")
            column.prop(settings, "custom_settles")
        layout.prop(settings, "strength")
        layout.prop(settings, "root")
        row = layout.row()
        row.scale_y = 1.5
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_pose_start.bl_idname, icon="VIEW_PAN")
        session = active_session()
        if session is not None:
            layout.label(text="Enter keeps, Esc takes back", icon="INFO")


class OCTO_MOTION_PT_posing_world(PosePanel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_posing_world"
    bl_label = "World"
    bl_parent_id = OCTO_MOTION_PT_posing.bl_idname

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "gravity")
        row = layout.row(heading="Floor")
        row.prop(settings, "floor", text="")
        height = row.row()
        height.active = settings.floor
        height.prop(settings, "floor_height", text="")
        layout.prop(settings, "use_obstacles")
        layout.prop(settings, "self_collision")
        layout.prop(settings, "friction")
        item: Any = bpy.context.object
        if item is not None and item.type != "ARMATURE":
            layout.prop(item.octo_motion.posing, "obstacle")
        layout.operator_menu_enum(
            OCTO_MOTION_OT_pose_obstacle.bl_idname, "kind", text="Mark Selected As"
        )


class OCTO_MOTION_PT_posing_bones(PosePanel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_posing_bones"
    bl_label = "Limbs"
    bl_parent_id = OCTO_MOTION_PT_posing.bl_idname

    def show(self, layout: Any, settings: Any) -> None:
        row = layout.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_pose_measure.bl_idname, icon="DRIVER_ROTATIONAL_DIFFERENCE")
        row.operator(OCTO_MOTION_OT_pose_forget_measured.bl_idname, text="", icon="X")
        layout.prop(settings, "smallest")
        layout.prop(settings, "show_loads")
        layout.operator_menu_enum(
            OCTO_MOTION_OT_pose_mark_bones.bl_idname, "mark", text="Mark Selected Bones"
        )


class OCTO_MOTION_PT_posing_keys(PosePanel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_posing_keys"
    bl_label = "Keys"
    bl_parent_id = OCTO_MOTION_PT_posing.bl_idname

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "keys_to")
        if settings.keys_to == "CHOSEN":
            row = layout.row()
            row.alert = settings.action is None
            row.prop(settings, "action")
        layout.prop(settings, "record_angle")
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(OCTO_MOTION_OT_pose_script.bl_idname, icon="FILE_SCRIPT")


CLASSES: Final[tuple[type, ...]] = (
    OCTO_MOTION_PT_posing,
    OCTO_MOTION_PT_posing_world,
    OCTO_MOTION_PT_posing_bones,
    OCTO_MOTION_PT_posing_keys,
)
