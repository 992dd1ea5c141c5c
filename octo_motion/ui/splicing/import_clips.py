# SPDX-License-Identifier: GPL-3.0-or-later
"""Several motion files at once, each clip at its own speed: all of them or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...blender.scene import ImportedClip, Up, import_clip, remove_clips, show_selected
from ...core.errors import ClipError, OctoMotionError
from ...core.phrases import as_phrase, joined_phrases, phrase
from ...core.splicing.clip import MOTION_SUFFIXES
from ..language import reported
from ..modal_job import ModalJob
from ..operator_base import window_manager
from .bodies import saved_landmarks
from .clip_places import Placing, place_clips, target_height
from .properties import splicing_settings, write_landmarks

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems


class ImportSession:
    """An import that can be stopped between files, and taken back. A file that is named twice is
    imported once.

    Raises:
        ClipError: there are no files.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        frame_start: int,
        context: bpy.types.Context,
        *,
        up: Up = "AUTO",
        placing: Placing | None = None,
    ) -> None:
        self._paths = list(dict.fromkeys(paths))
        if not self._paths:
            raise ClipError("No file is given.", "Choose one or more.")
        self.clips: list[ImportedClip] = []
        self.refused: list[tuple[Path, ClipError]] = []
        self._frame_start = frame_start
        self._up: Up = up
        self._placing = placing or Placing()
        self._target = target_height(context)
        self.placed = ""
        """How tall the clips are, if not as in their files, and which saved mappings they have:
        sentences, or "".
        """
        self.damaged: tuple[str, ...] = ()
        """What is wrong with saved mappings that were looked at: sentences."""
        layer = context.view_layer
        assert layer is not None
        self._selected = [
            each.name_full for each in layer.objects if each.select_get(view_layer=layer)
        ]
        self._active = layer.objects.active.name_full if layer.objects.active else ""

    @property
    def current(self) -> str:
        """The file whose turn it is, for people."""
        number = len(self.clips) + len(self.refused)
        path = self._paths[min(number, len(self._paths) - 1)]
        return phrase(
            "'{path}' ({number} of {count})",
            path=path.name,
            number=min(number + 1, len(self._paths)),
            count=len(self._paths),
        )

    def steps(self, progress: Callable[[float], None] = lambda _: None) -> Iterator[float]:
        """Import them file by file; yields the share of the work that is done, and calls
        ``progress`` with it more often.
        """
        for number, path in enumerate(self._paths):

            def follow(share: float, number: int = number) -> None:
                progress((number + share) / len(self._paths))

            try:
                clip = import_clip(
                    path, bpy.context, self._frame_start, up=self._up, progress=follow
                )
                self.clips.append(clip)
            except ClipError as error:
                self.refused.append((path, error))
            yield (number + 1) / len(self._paths)

    def end(self) -> ImportSession:
        """Give the clips their places, and leave the new armatures selected, the first one active,
        as importers do.

        Raises:
            ClipError: not one of the files was imported.
        """
        if not self.clips:
            path, error = self.refused[0]
            more = (
                phrase(" {count} more were refused.", count=len(self.refused) - 1)
                if len(self.refused) > 1
                else ""
            )
            raise ClipError(
                phrase(
                    "'{path}' was not imported. {problem}", path=path.name, problem=error.problem
                ),
                joined_phrases("", (error.remedy, more)),
            )
        context = bpy.context
        self.clips, self.placed = place_clips(self.clips, context, self._placing, self._target)
        names = [name for clip in self.clips for name in clip.armatures]
        mappings = dict[str, None]()
        for armature in (bpy.data.objects[name] for name in names):
            saved = saved_landmarks(armature)
            if saved.mapping:
                write_landmarks(splicing_settings(armature).landmarks, saved.bones)
                mappings[saved.mapping] = None
            self.damaged = saved.damaged
        if mappings:
            self.placed = phrase(
                "{placed} Mapping: {mappings} (saved).",
                placed=self.placed,
                mappings=", ".join(mappings),
            ).strip()
        _select(names)
        return self

    def undo(self) -> None:
        """Take back what was imported so far."""
        remove_clips(self.clips)
        self.clips.clear()
        _select(self._selected, self._active)


def _select(names: Sequence[str], active: str | None = None) -> None:
    """Select objects, and make one of them active, the first that is there if none is named."""
    layer = bpy.context.view_layer
    assert layer is not None
    # What was just removed is in the layer's list until the next update.
    layer.update()
    # A collection that is switched off in this view layer hides its objects.
    shown = {each.name_full: each for each in layer.objects}
    for name, each in shown.items():
        each.select_set(state=name in names, view_layer=layer)
    if active is None:
        active = next((name for name in names if name in shown), "")
    layer.objects.active = shown.get(active)


# --- The operator ---------------------------------------------------------------------------------


class OCTO_MOTION_OT_import_clips(ModalJob, bpy.types.Operator):
    bl_idname = "octo_motion.import_clips"
    bl_label = "Import Motion Clips"
    bl_description = (
        "Import several BVH, FBX or glTF files at once, each as an armature with its action, into "
        "the collection Clips. Every clip plays at its own speed: its keys lie where the scene's "
        "frame rate puts their seconds, and the scene stays as it is. Bodies get the height of the "
        "one that is there, and stand side by side. A file that is damaged is left out, and the "
        "message says why"
    )

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
    fit: EnumProperty(
        name="Fit to Height",
        description="Which clips are scaled to one height. The armature is scaled, its keys stay "
        "as the file has them",
        items=(
            ("NONE", "None", "As large as their files have them", 0),
            ("HUMANOIDS", "Humanoids", "Bodies with arms, legs and a head", 1),
            ("ALL", "All", "Others too, by their longest side", 2),
        ),
        default="HUMANOIDS",
        options={"SKIP_SAVE"},
    )
    height: FloatProperty(
        name="Height",
        description="How tall they get; 0 is as tall as the active armature, else as another "
        "humanoid of the scene, else 1.7 m",
        min=0.0,
        soft_max=10.0,
        unit="LENGTH",
        options={"SKIP_SAVE"},
    )
    side_by_side: BoolProperty(
        name="Side by Side",
        description="Let several clips stand in a row on the ground, not one in the other",
        default=True,
        options={"SKIP_SAVE"},
    )
    frame_view: BoolProperty(
        name="Show",
        description="Let the 3D views show the clips as large as they can",
        default=True,
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(
        default=";".join(f"*{suffix}" for suffix in MOTION_SUFFIXES), options={"HIDDEN"}
    )

    _session: ImportSession | None = None
    _browsing = False
    _turn = 0.0
    _stopped = "Cancelled: nothing was imported."

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        return "Go to object mode first" if context.mode != "OBJECT" else ""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Open the file browser; files that were dropped need none."""
        if self.files or self.filepath:
            return self._import(context)
        self._browsing = True
        window_manager(context).fileselect_add(self)
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
                    fit=self.fit,
                    height=self.height,
                    side_by_side=self.side_by_side,
                    frame_view=self.frame_view,
                )
            return {"CANCELLED"}
        return super().execute(context)

    def run(self, context: bpy.types.Context) -> None:
        session = self._new_session(context)
        manager = window_manager(context)
        manager.progress_begin(0.0, 1.0)
        try:
            for _ in session.steps(manager.progress_update):
                pass
        finally:
            manager.progress_end()
        self._finished(context, session)

    def _finished(self, context: bpy.types.Context, session: ImportSession) -> None:
        session.end()
        if self.frame_view:
            show_selected(context)
        self._report(session)

    def _new_session(self, context: bpy.types.Context) -> ImportSession:
        folder = Path(bpy.path.abspath(self.directory))
        named = [folder / each.name for each in self.files if each.name]
        if not named and self.filepath:
            named = [Path(bpy.path.abspath(self.filepath))]
        placing = Placing(self.fit, self.height, self.side_by_side)
        return ImportSession(named, self.frame_start, context, up=self.up, placing=placing)

    def _import(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        manager = window_manager(context)
        try:
            self._session = self._new_session(context)
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))
            return {"CANCELLED"}
        return self.begin(context, self._session.steps(manager.progress_update))

    def conclude(self, context: bpy.types.Context) -> None:
        assert self._session is not None
        self._finished(context, self._session)

    def status(self, progress: float) -> str:  # noqa: ARG002
        assert self._session is not None
        return phrase("Importing {current}    Esc: none of them", current=self._session.current)

    def take_back(self) -> None:
        if self._session is not None:
            self._session.undo()

    def _report(self, session: ImportSession) -> None:
        count = len(session.clips)
        told = (
            phrase("1 clip imported")
            if count == 1
            else phrase("{count} clips imported", count=count)
        )
        refused = phrase(", {count} refused", count=len(session.refused)) if session.refused else ""
        told = phrase("{told}{refused}.", told=told, refused=refused)
        self.report({"INFO"}, reported(joined_phrases(" ", (told, session.placed.strip()))))
        # Blender's status bar keeps the last, which is to be the one that says most.
        for each in session.damaged:
            self.report({"WARNING"}, reported(each))
        for clip in session.clips:
            for note in clip.notes:
                self.report(
                    {"WARNING"},
                    reported(phrase("'{clip}': {note}", clip=clip.file, note=as_phrase(note))),
                )
        for path, error in session.refused:
            self.report(
                {"WARNING"},
                reported(phrase("'{path}' was not imported. {error}", path=path.name, error=error)),
            )


def draw_in_import_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:  # noqa: ARG001
    """File ▸ Import."""
    assert menu.layout is not None
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(
        OCTO_MOTION_OT_import_clips.bl_idname, text="Motion Clips (BVH, FBX, glTF)"
    )
