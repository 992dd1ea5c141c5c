# SPDX-License-Identifier: GPL-3.0-or-later
"""Several motion files at once, each clip at its own speed, in one collection."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import bpy
from bpy.props import CollectionProperty, IntProperty, StringProperty

from ...blender.imports import SUFFIXES, ImportedClip, import_clip
from ...core.errors import ClipError
from ..operator_base import OctoOperator

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems


class OCTO_MOTION_OT_import_clips(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.import_clips"
    bl_label = "Import Motion Clips"
    bl_description = (
        "Import several BVH, FBX or glTF files at once, each as an armature with its action, into "
        "the collection Clips. Every clip plays at its own speed: its keys lie where the scene's "
        "frame rate puts their seconds, and the scene stays as it is. A file that is damaged is "
        "left out, and the message says why"
    )
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(
        name="File", description="One file", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    directory: StringProperty(
        name="Folder", description="Where the files are", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )
    files: CollectionProperty(
        name="Files",
        description="Their names in the folder",
        type=bpy.types.OperatorFileListElement,
        options={"SKIP_SAVE"},
    )
    frame_start: IntProperty(
        name="First Frame",
        description="Where the first key of each clip goes",
        default=1,
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(
        default=";".join(f"*{suffix}" for suffix in SUFFIXES), options={"HIDDEN"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Go to object mode first")
            return False
        return True

    def invoke(
        self,
        context: bpy.types.Context,
        event: bpy.types.Event,  # noqa: ARG002
    ) -> set[OperatorReturnItems]:
        """Open the file browser; files that were dropped need none."""
        if self.files:
            return self.execute(context)
        assert context.window_manager is not None
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context: bpy.types.Context) -> None:
        paths = self._paths()
        clips: list[ImportedClip] = []
        refused: list[tuple[Path, ClipError]] = []
        window_manager = context.window_manager
        assert window_manager is not None
        window_manager.progress_begin(0.0, len(paths))
        try:
            for number, path in enumerate(paths):
                window_manager.progress_update(number)
                try:
                    clips.append(import_clip(path, context, self.frame_start))
                except ClipError as error:
                    refused.append((path, error))
        finally:
            window_manager.progress_end()
        if not clips:
            path, error = refused[0]
            more = f" {len(refused) - 1} more were refused." if len(refused) > 1 else ""
            raise ClipError(f"'{path.name}' was not imported. {error.problem}", error.remedy + more)
        self._tell(clips, refused)
        _select(context, clips)

    def _paths(self) -> list[Path]:
        folder = Path(bpy.path.abspath(self.directory))
        named = [folder / each.name for each in self.files if each.name]
        if not named and self.filepath:
            named = [Path(bpy.path.abspath(self.filepath))]
        if not named:
            raise ClipError("No file is given.", "Choose one or more.")
        return list(dict.fromkeys(named))

    def _tell(self, clips: list[ImportedClip], refused: list[tuple[Path, ClipError]]) -> None:
        for clip in clips:
            for note in clip.notes:
                self.report({"WARNING"}, f"'{clip.file}': {note}")
        for path, error in refused:
            self.report({"WARNING"}, f"'{path.name}' was not imported. {error}")
        told = f"{len(clips)} {'clip' if len(clips) == 1 else 'clips'} imported"
        if refused:
            told += f", {len(refused)} refused"
        self.report({"INFO"}, f"{told}.")


def _select(context: bpy.types.Context, clips: list[ImportedClip]) -> None:
    """Leave the new armatures selected, the first one active, as importers do."""
    layer = context.view_layer
    assert layer is not None
    for each in layer.objects:
        each.select_set(state=False, view_layer=layer)
    for name in reversed([name for clip in clips for name in clip.armatures]):
        armature = layer.objects.get(name)
        # A collection that is switched off in this view layer hides them.
        if armature is not None:
            armature.select_set(state=True, view_layer=layer)
            layer.objects.active = armature


def draw_in_import_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:  # noqa: ARG001
    """File ▸ Import."""
    assert menu.layout is not None
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(
        OCTO_MOTION_OT_import_clips.bl_idname, text="Motion Clips (BVH, FBX, glTF)"
    )


CLASSES: Final[tuple[type[Any], ...]] = (OCTO_MOTION_OT_import_clips,)
