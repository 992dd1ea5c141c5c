# SPDX-License-Identifier: GPL-3.0-or-later
"""Several motion files at once, each clip at its own speed, in one collection."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import bpy
from bpy.props import CollectionProperty, EnumProperty, IntProperty, StringProperty

from ...blender.scene import SUFFIXES
from ...core.errors import OctoMotionError
from ..modal_job import ModalJob
from .import_session import ImportSession

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems


class OCTO_MOTION_OT_import_clips(ModalJob, bpy.types.Operator):
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
    up: EnumProperty(
        name="Up",
        description="Which axis of BVH files points up. Other formats say it themselves",
        items=(
            ("AUTO", "Automatic", "Y; Z if the body would lie on its back", 0),
            ("Y", "Y", "As most programs write it", 1),
            ("Z", "Z", "As Blender and MakeHuman may write it", 2),
        ),
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(
        default=";".join(f"*{suffix}" for suffix in SUFFIXES), options={"HIDDEN"}
    )

    _session: ImportSession | None = None
    _browsing = False
    _turn = 0.0
    _stopped = "Cancelled: nothing was imported."

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
            return self._import(context)
        self._browsing = True
        assert context.window_manager is not None
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        """All at once, as scripts want it; what the file browser gives file by file."""
        if self._browsing and len(self.files) > 1:
            # The file browser ends an operator that it has called: another one goes on.
            self._browsing = False
            with suppress(RuntimeError):  # which is reported already
                bpy.ops.octo_motion.import_clips(  # type: ignore[attr-defined]
                    "INVOKE_DEFAULT",
                    directory=self.directory,
                    files=[{"name": each.name} for each in self.files],
                    frame_start=self.frame_start,
                    up=self.up,
                )
            return {"CANCELLED"}
        return super().execute(context)

    def run(self, context: bpy.types.Context) -> None:
        session = self._new_session(context)
        window_manager = context.window_manager
        assert window_manager is not None
        window_manager.progress_begin(0.0, 1.0)
        try:
            for _ in session.steps(window_manager.progress_update):
                pass
        finally:
            window_manager.progress_end()
        self._tell(session.end())

    def _new_session(self, context: bpy.types.Context) -> ImportSession:
        folder = Path(bpy.path.abspath(self.directory))
        named = [folder / each.name for each in self.files if each.name]
        if not named and self.filepath:
            named = [Path(bpy.path.abspath(self.filepath))]
        return ImportSession(named, self.frame_start, context, up=self.up)

    def _import(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        window_manager = context.window_manager
        assert window_manager is not None
        try:
            self._session = self._new_session(context)
        except OctoMotionError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self.begin(context, self._session.steps(window_manager.progress_update))

    def conclude(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        assert self._session is not None
        self._tell(self._session.end())

    def status(self, progress: float) -> str:  # noqa: ARG002
        assert self._session is not None
        return f"Importing {self._session.told}    Esc: none of them"

    def take_back(self) -> None:
        if self._session is not None:
            self._session.undo()

    def _tell(self, session: ImportSession) -> None:
        count = len(session.clips)
        told = f"{count} {'clip' if count == 1 else 'clips'} imported"
        if session.refused:
            told += f", {len(session.refused)} refused"
        self.report({"INFO"}, f"{told}.")
        # Blender's status bar keeps the last, which is to be the one that says most.
        for clip in session.clips:
            for note in clip.notes:
                self.report({"WARNING"}, f"'{clip.file}': {note}")
        for path, error in session.refused:
            self.report({"WARNING"}, f"'{path.name}' was not imported. {error}")


def draw_in_import_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:  # noqa: ARG001
    """File ▸ Import."""
    assert menu.layout is not None
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(
        OCTO_MOTION_OT_import_clips.bl_idname, text="Motion Clips (BVH, FBX, glTF)"
    )


CLASSES: Final[tuple[type[Any], ...]] = (OCTO_MOTION_OT_import_clips,)
