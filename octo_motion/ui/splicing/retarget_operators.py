# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole clips onto the active armature: one, all of a source, or those of files and folders."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, cast

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, StringProperty

from ...blender.animation import actions_for, played_action, writable_armature
from ...blender.rig import active_armature
from ...core.errors import ClipError, OctoMotionError
from ...core.phrases import phrase
from ...core.splicing.clip import MOTION_SUFFIXES
from ..language import reported
from ..modal_job import ModalJob
from ..operator_base import window_manager, without_armature
from .live_retarget import live_retargeted
from .retargeting import (
    RetargetJob,
    RetargetSession,
    check_source,
    file_clip,
    prepare_retarget,
)
from .splice_operators import no_action, other_armatures
from .stack import ClipReader


class _RetargetOperator(ModalJob):
    """Works clips out one by one, and writes them together."""

    _session: RetargetSession | None = None

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if context.mode not in {"OBJECT", "POSE"}:
            return "Go to object mode or pose mode first"
        return without_armature(context)

    def session(self, context: bpy.types.Context) -> RetargetSession:
        """What is to be done; ``OctoMotionError`` if it cannot be."""
        raise NotImplementedError

    def run(self, context: bpy.types.Context) -> None:
        session = self.session(context)
        manager = window_manager(context)
        manager.progress_begin(0.0, 1.0)
        try:
            for share in session.steps():
                manager.progress_update(share)
        finally:
            manager.progress_end()
        self._report(session.end())

    def start(self, context: bpy.types.Context) -> set[Any]:
        """In turns, with a progress bar and Esc."""
        try:
            self._session = self.session(context)
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        return self.begin(context, self._session.steps(), patience=0.3)

    def conclude(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        assert self._session is not None
        self._report(self._session.end())

    def status(self, progress: float) -> str:  # noqa: ARG002
        assert self._session is not None
        return phrase("Retargeting {current}    Esc: none of them", current=self._session.current)

    def _report(self, session: RetargetSession) -> None:
        live_retargeted.made(session.target)
        told = cast("bpy.types.Operator", self)
        told.report({"INFO"}, reported(session.message))
        for warning in dict.fromkeys(each for made in session.made for each in made.warnings):
            told.report({"WARNING"}, reported(warning))
        for name, error in session.refused:
            told.report(
                {"WARNING"},
                reported(phrase("'{name}' was not retargeted. {error}", name=name, error=error)),
            )


class OCTO_MOTION_OT_retarget(_RetargetOperator, bpy.types.Operator):
    bl_idname = "octo_motion.retarget"
    bl_label = "Retarget Clip"
    bl_description = (
        "Put a whole clip onto the active armature, as a new action: all parts of the body, the "
        "way through the world, the height of the hips, feet that stand. Select the armature with "
        "the clip, then Shift click the one that gets it"
    )

    source: StringProperty(
        name="Source",
        description="Armature with the clip; the other selected one if empty",
        options={"SKIP_SAVE"},
    )
    action: StringProperty(
        name="Action",
        description="The clip; the source's own action if empty",
        options={"SKIP_SAVE"},
    )
    all_actions: BoolProperty(
        name="All Actions",
        description="All actions of the file that fit the source, each as an action of its own",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """In turns, so that Esc can stop it."""
        return self.start(context)

    def session(self, context: bpy.types.Context) -> RetargetSession:
        armature = active_armature(context)
        # A pose that is only shown is none to be read.
        live_retargeted.pause(armature)
        writable_armature(armature)
        source = source_armature(context, armature, self.source)
        reader = ClipReader()
        # Names: references do not outlive a modal operator's tick.
        names = armature.name, source.name

        def prepare(action: str, slot: str) -> RetargetJob:
            first, second = (bpy.data.objects[name] for name in names)
            return prepare_retarget(first, second, bpy.data.actions[action], slot, reader=reader)

        chosen = self._actions(source)
        clips = [
            (f"{action.name} Retargeted", partial(prepare, action.name, slot))
            for action, slot in chosen
        ]
        return RetargetSession(armature, clips)

    def _actions(self, source: bpy.types.Object) -> list[tuple[bpy.types.Action, str]]:
        if self.all_actions:
            return [(each, "") for each in actions_for(source)]
        if self.action:
            action = bpy.data.actions.get(self.action)
            if action is None:
                raise ClipError(
                    phrase("There is no action '{action}'.", action=self.action),
                    "Choose the clip's action.",
                )
            return [(action, "")]
        own = played_action(source)
        if own is None:
            raise no_action(
                source, phrase("The source '{source}' has no action.", source=source.name)
            )
        return [own]


def source_armature(
    context: bpy.types.Context, armature: bpy.types.Object, name: str
) -> bpy.types.Object:
    """The armature of that name, or the selected one beside the active one.

    Raises:
        ClipError: there is none, or there are several.
    """
    if name:
        found = bpy.data.objects.get(name)
        if found is None or found.type != "ARMATURE":
            raise ClipError(
                phrase("There is no armature '{name}'.", name=name),
                "Choose the armature of the clip.",
            )
        check_source(armature, found)
        return found
    others = other_armatures(context)
    if len(others) == 1:
        return others[0]
    problem = (
        phrase("{count} other armatures are selected.", count=len(others))
        if others
        else "No source is selected."
    )
    raise ClipError(
        problem,
        phrase(
            "Select the armature with the clip, then Shift click '{armature}', which gets it.",
            armature=armature.name,
        ),
    )


class OCTO_MOTION_OT_retarget_files(_RetargetOperator, bpy.types.Operator):
    bl_idname = "octo_motion.retarget_files"
    bl_label = "Retarget Files"
    bl_description = (
        "Put the clips of BVH, FBX or glTF files onto the active armature, each as an action with "
        "the name of its file. Choose one or more files, or none for all of the folder. What is "
        "imported for it is taken away again"
    )

    filepath: StringProperty(
        name="File", description="One file", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    directory: StringProperty(
        name="Folder",
        description="Where the files are; all of its motion files if none is named",
        subtype="DIR_PATH",
        options={"SKIP_SAVE"},
    )
    files: CollectionProperty(
        name="Files",
        description="Their names in the folder",
        type=bpy.types.OperatorFileListElement,
        options={"SKIP_SAVE"},
    )
    frame_start: IntProperty(
        name="First Frame",
        description="Where the first frame of each clip goes",
        default=1,
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(
        default=";".join(f"*{suffix}" for suffix in MOTION_SUFFIXES), options={"HIDDEN"}
    )

    _browsing = False

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        return super().obstacle(context) or (
            "Go to object mode first" if context.mode != "OBJECT" else ""
        )

    in_turns: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        """Ask for files or a folder; with these, go on in turns, so that Esc can stop it."""
        if self.in_turns:
            return self.start(context)
        self._browsing = True
        window_manager(context).fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[Any]:
        """All at once, as scripts want it; what the file browser gives in turns."""
        if not self._browsing:
            return super().execute(context)
        # The file browser ends an operator that it has called: another one goes on.
        self._browsing = False
        with suppress(RuntimeError):  # which is reported already
            bpy.ops.octo_motion.retarget_files(  # type: ignore[attr-defined]
                "INVOKE_DEFAULT",
                filepath=self.filepath,
                directory=self.directory,
                files=[{"name": each.name} for each in self.files],
                frame_start=self.frame_start,
                in_turns=True,
            )
        return {"CANCELLED"}

    def session(self, context: bpy.types.Context) -> RetargetSession:
        armature = active_armature(context)
        writable_armature(armature)
        reader = ClipReader()
        clips: list[tuple[str, Callable[[], RetargetJob]]] = [
            (path.stem, file_clip(armature.name, path, self.frame_start, reader))
            for path in self._paths()
        ]
        return RetargetSession(armature, clips)

    def _paths(self) -> list[Path]:
        folder = Path(bpy.path.abspath(self.directory)) if self.directory else None
        if folder is not None:
            named = [folder / each.name for each in self.files if each.name]
            return named or motion_files(folder)
        if not self.filepath:
            raise ClipError("No file is given.", "Choose one or more, or a folder.")
        path = Path(bpy.path.abspath(self.filepath))
        return motion_files(path) if path.is_dir() else [path]


def motion_files(folder: Path) -> list[Path]:
    """All motion files of a folder, by name.

    Raises:
        ClipError: there is no such folder, or it has none.
    """
    if not folder.is_dir():
        raise ClipError(
            phrase("There is no folder '{folder}'.", folder=folder),
            "Choose a folder with motion files.",
        )
    found = sorted(
        each
        for each in folder.iterdir()
        if each.suffix.lower() in MOTION_SUFFIXES and each.is_file()
    )
    if not found:
        raise ClipError(
            phrase("The folder '{folder}' has no motion files.", folder=folder.name),
            "BVH, FBX and glTF files are.",
        )
    return found
