# SPDX-License-Identifier: GPL-3.0-or-later
"""The button that makes the armature walk: from the settings to keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import bpy

from ...blender.armature import active_armature
from ...core.errors import OctoMotionError
from ..armature_operator import ArmatureOperator
from ..job import Job
from . import live
from .workflow import Shot, Summary, generate, prepare

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems

PATIENCE: Final = 1.5
"""Seconds that the window may stand still; a longer job shows its progress and can be stopped."""

_TURN: Final = 0.1
"""Seconds of work between two looks at the keyboard."""


class OCTO_MOTION_OT_generate_locomotion(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.generate_locomotion"
    bl_label = "Generate Locomotion"
    bl_description = (
        "Let the armature walk or swim along its route. What was generated before is made anew "
        "in place; an action that you have edited is kept, and a new one is made"
    )
    bl_options = {"REGISTER", "UNDO"}

    _shot: Shot | None = None
    _job: Job | None = None
    _timer: bpy.types.Timer | None = None

    def run(self, context: bpy.types.Context) -> None:
        armature = active_armature(context)
        self._tell(generate(armature, context))
        live.made(armature)

    def invoke(
        self,
        context: bpy.types.Context,
        event: bpy.types.Event,  # noqa: ARG002
    ) -> set[OperatorReturnItems]:
        """Run at once if that is quick, else go on with progress and Esc."""
        try:
            self._shot = prepare(active_armature(context), context)
            self._job = Job(self._shot.compute())
            if self._job.work(PATIENCE):
                return self._finish(context)
        except OctoMotionError as error:
            return self._fail(context, error)
        window_manager = context.window_manager
        assert window_manager is not None
        self._timer = window_manager.event_timer_add(0.01, window=context.window)
        window_manager.progress_begin(0.0, 1.0)
        window_manager.modal_handler_add(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[OperatorReturnItems]:
        """One turn of the work. Everything but Esc has to wait."""
        if event.type == "ESC":
            self._tear_down(context)
            self.report({"INFO"}, "Cancelled: nothing has changed.")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        assert self._job is not None
        try:
            if self._job.work(_TURN):
                return self._finish(context)
        except OctoMotionError as error:
            return self._fail(context, error)
        except BaseException:
            self._tear_down(context)
            raise
        self._show(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender's own end of it: another file is opened, or Blender quits."""
        self._tear_down(context)

    def _finish(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        shot = self._shot
        assert shot is not None
        self._tear_down(context)
        self._tell(shot.write())
        live.made(bpy.data.objects[shot.armature, None])  # type: ignore[index]
        return {"FINISHED"}

    def _fail(self, context: bpy.types.Context, error: OctoMotionError) -> set[OperatorReturnItems]:
        self._tear_down(context)
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def _show(self, context: bpy.types.Context) -> None:
        assert self._job is not None
        assert context.window_manager is not None
        context.window_manager.progress_update(self._job.progress)
        if context.workspace is not None:
            share = f"{100.0 * self._job.progress:.0f} %"
            context.workspace.status_text_set(f"Generating locomotion: {share}    Esc: stop")

    def _tear_down(self, context: bpy.types.Context) -> None:
        """Leave nothing on the screen; safe to call twice."""
        self._shot = self._job = None
        if self._timer is None:
            return
        assert context.window_manager is not None
        context.window_manager.event_timer_remove(self._timer)
        self._timer = None
        context.window_manager.progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)

    def _tell(self, summary: Summary) -> None:
        for warning in summary.warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, summary.message)
