# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the tools are found besides the sidebar: menus, which Blender's search goes through, and
files that are dropped onto the 3D view.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final, cast

import bpy

from ..core.phrases import phrase
from ..core.splicing.clip import MOTION_SUFFIXES

_ENTRIES: Final = (
    ("generate_locomotion", phrase("Generate Walk or Swim"), "CON_FOLLOWPATH"),
    ("detect_arms", phrase("Detect Arms"), "VIEWZOOM"),
    ("add_route", phrase("Add Route"), "CURVE_BEZCURVE"),
    (),
    ("import_clips", phrase("Import Motion Clips…"), "IMPORT"),
    ("splice_add", phrase("Add Splice"), "ADD"),
    ("splice_drag_timing", phrase("Drag Timing of Splice"), "ARROW_LEFTRIGHT"),
    ("splice_build", phrase("Build Splices"), "NLA"),
    ("retarget", phrase("Retarget Clip"), "ARMATURE_DATA"),
    (),
    ("pose_start", phrase("Pose by Hand"), "VIEW_PAN"),
    ("pose_device", phrase("Pose with Device"), "ORIENTATION_GIMBAL"),
    ("pose_script", phrase("Play Pose Script…"), "FILE_SCRIPT"),
    (),
    ("follow_through", phrase("Follow Through"), "FORCE_HARMONIC"),
)
"""Operators, what they are called here, and their icons; nothing for a line between."""


class OCTO_MOTION_MT_tools(bpy.types.Menu):
    bl_label = "Octo Motion"
    bl_description = "Walk, swim, splice clips, pose by hand, follow through"

    def draw(self, context: bpy.types.Context | None) -> None:
        layout = cast("Any", self).layout
        layout.operator_context = "INVOKE_DEFAULT"
        for entry in _ENTRIES:
            if entry:
                name, text, icon = entry
                layout.operator(f"octo_motion.{name}", text=text, icon=icon)
            else:
                layout.separator()
        item: Any = context.object if context is not None else None
        if item is not None and item.type == "ARMATURE":
            layout.separator()
            layout.prop(item.octo_motion.locomotion, "live", text="Live Motion")


def draw_in_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Entry for Object and Pose."""
    assert menu.layout is not None
    menu.layout.separator()
    menu.layout.menu(OCTO_MOTION_MT_tools.__name__, icon="OUTLINER_OB_ARMATURE")


class _Dropped:
    """What is dropped onto a 3D view."""

    needs_armature: ClassVar[bool] = False

    @classmethod
    def poll_drop(cls, context: bpy.types.Context | None) -> bool:
        """Blender's question whether it may be dropped here."""
        if context is None or context.area is None or context.area.type != "VIEW_3D":
            return False
        item = context.object
        return not cls.needs_armature or (item is not None and item.type == "ARMATURE")


class OCTO_MOTION_FH_clips(_Dropped, bpy.types.FileHandler):
    bl_idname = "OCTO_MOTION_FH_clips"
    bl_label = "Motion Clips (Octo Motion)"
    bl_import_operator = "octo_motion.import_clips"
    bl_file_extensions = ";".join(MOTION_SUFFIXES)


class OCTO_MOTION_FH_gait(_Dropped, bpy.types.FileHandler):
    bl_idname = "OCTO_MOTION_FH_gait"
    bl_label = "Gait (Octo Motion)"
    bl_import_operator = "octo_motion.gait_import"
    bl_file_extensions = ".json"
    needs_armature = True


class OCTO_MOTION_FH_pose_script(_Dropped, bpy.types.FileHandler):
    bl_idname = "OCTO_MOTION_FH_pose_script"
    bl_label = "Pose Script (Octo Motion)"
    bl_import_operator = "octo_motion.pose_script"
    bl_file_extensions = ".json"
    needs_armature = True


CLASSES: Final = (
    OCTO_MOTION_MT_tools,
    OCTO_MOTION_FH_clips,
    OCTO_MOTION_FH_gait,
    OCTO_MOTION_FH_pose_script,
)
MENUS: Final = (
    ("VIEW3D_MT_object", draw_in_menu),
    ("VIEW3D_MT_pose", draw_in_menu),
)
