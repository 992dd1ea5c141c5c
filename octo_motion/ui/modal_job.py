# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in short turns: Blender's window stays alive, and Esc stops it cleanly."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, cast

from ..core.errors import OctoMotionError
from . import at_work
from .language import reported, translated
from .operator_base import OctoOperator, window_manager

if TYPE_CHECKING:
    import bpy
    from bpy.stub_internal.rna_enums import OperatorReturnItems


class Job:
    """Work that yields the share of it that is done, 0…1; its clock tells seconds."""

    def __init__(self, steps: Iterator[float], clock: Callable[[], float] = time.monotonic) -> None:
        self.progress = 0.0
        self.finished = False
        self._steps = steps
        self._clock = clock

    def work(self, seconds: float) -> bool:
        """Go on for about so long, at least one step; whether all is done."""
        until = self._clock() + seconds
        while not self.finished:
            done = next(self._steps, None)
            if done is None:
                self.finished = True
                self.progress = 1.0
                break
            self.progress = done
            if self._clock() >= until:
                break
        return self.finished


class ModalJob(OctoOperator):
    """Mix-in: ``invoke`` calls ``begin``; write ``conclude`` and ``status``."""

    _job = cast("Job | None", None)
    _timer = cast("Any", None)
    _turn = 0.1
    """Seconds of work between two looks at the keyboard."""
    _stopped = "Cancelled: nothing has changed."

    def conclude(self, context: bpy.types.Context) -> None:
        """Use what the work has come to; may raise ``OctoMotionError``."""
        raise NotImplementedError

    def status(self, progress: float) -> str:
        """What is being done, for people, the share of it that is done being 0…1."""
        raise NotImplementedError

    def give_up(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        """What Esc does."""
        self._stop(context)
        self.report({"INFO"}, reported(self._stopped))  # type: ignore[attr-defined]
        return {"CANCELLED"}

    def take_back(self) -> None:
        """Undo what the work has done so far."""

    def begin(
        self, context: bpy.types.Context, steps: Iterator[float], patience: float | None = None
    ) -> set[OperatorReturnItems]:
        """Work for a while at once, if there is patience, s, and in turns from then on."""
        self._job = Job(steps)
        try:
            if patience is not None and self._job.work(patience):
                return self._finish(context)
        except OctoMotionError as error:
            return self._fail(context, error)
        manager = window_manager(context)
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.progress_begin(0.0, 1.0)
        manager.modal_handler_add(cast("bpy.types.Operator", self))
        at_work.begun(self, self._stop)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[OperatorReturnItems]:
        """One turn of the work. Everything but Esc has to wait."""
        if event.type == "ESC":
            return self.give_up(context)
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        assert self._job is not None
        try:
            if self._job.work(self._turn):
                return self._finish(context)
        except OctoMotionError as error:
            return self._fail(context, error)
        except BaseException:
            self._stop(context)
            raise
        self._show(context)
        return {"RUNNING_MODAL"}

    def _stop(self, context: bpy.types.Context) -> None:
        self.take_back()
        self._tear_down(context)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender's own end of it: another file is opened, or Blender quits."""
        self._tear_down(context)

    def _finish(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        self._tear_down(context)
        self.conclude(context)
        return {"FINISHED"}

    def _fail(self, context: bpy.types.Context, error: OctoMotionError) -> set[OperatorReturnItems]:
        self._stop(context)
        self.report({"ERROR"}, reported(error))  # type: ignore[attr-defined]
        return {"CANCELLED"}

    def _show(self, context: bpy.types.Context) -> None:
        assert self._job is not None
        if self._job.progress > 0.0:
            window_manager(context).progress_update(self._job.progress)
        if context.workspace is not None:
            context.workspace.status_text_set(translated(self.status(self._job.progress)))

    def _tear_down(self, context: bpy.types.Context) -> None:
        """Leave nothing on the screen; safe to call twice."""
        self._job = None
        at_work.done(self)
        if self._timer is None:
            return
        window_manager(context).event_timer_remove(self._timer)
        self._timer = None
        window_manager(context).progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)
