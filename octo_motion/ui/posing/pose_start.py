# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by hand in the viewport."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final

import bpy

from ...blender.armature import active_armature
from ...core.errors import OctoMotionError, SettingsError
from ..armature_operator import ArmatureOperator
from .controls import Outcome, PoseControls
from .overlay import Overlay
from .puppet_session import PuppetSession, active_session
from .scrubbing import Strip, frame_under, go_to, strip_under
from .view import view_under

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems

_RATE: Final = 1.0 / 60.0
"""Seconds between two ticks."""


class OCTO_MOTION_OT_pose_start(ArmatureOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_start"
    bl_label = "Pose by Hand"
    bl_description = (
        "Take hold of the figure like a puppet: drag a limb and it resists, gives way and stays "
        "where you leave it. K keys the bones that you have moved, P pins a limb, the wheel pulls "
        "nearer, R turns while dragging. Enter keeps the pose, Esc leaves all as it was"
    )
    bl_options = {"REGISTER", "UNDO"}

    _session: PuppetSession | None = None
    _controls: PoseControls | None = None
    _overlay: Overlay | None = None
    _strip: Strip | None = None
    _timer: Any = None
    _last: float = 0.0
    _shown: tuple[str, int | None] = ("", None)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        going_on = active_session()
        if going_on is not None:
            cls.poll_message_set(f"{going_on.puppet.name} is being posed already")
            return False
        return super().poll(context)

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        """Without a mouse there is no hand."""
        raise SettingsError(
            "Posing by hand needs a mouse and a 3D viewport.",
            "Click it in the panel Pose; scripts have octo_motion.pose_script.",
        )

    def invoke(
        self,
        context: bpy.types.Context,
        event: bpy.types.Event,  # noqa: ARG002
    ) -> set[OperatorReturnItems]:
        """Take the armature into the hand."""
        window_manager, scene, window = context.window_manager, context.scene, context.window
        if window is None or bpy.app.background:
            return self.execute(context)
        assert window_manager is not None
        assert scene is not None
        try:
            self._session = PuppetSession(active_armature(context), scene)
        except OctoMotionError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        try:
            self._controls = PoseControls(self._session)
            self._overlay = Overlay(self._controls)
            self._timer = window_manager.event_timer_add(_RATE, window=window)
            window_manager.modal_handler_add(self)
        except BaseException:
            self._end(context, keep=False)
            raise
        driven = len(self._session.puppet.rig.roles.driven)
        if driven:
            self.report({"WARNING"}, f"Constraints or drivers move {driven} of its bones")
        self._last = time.perf_counter()
        self._tell(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[OperatorReturnItems]:
        """One event."""
        controls = self._controls
        if controls is None or self._session is None or self._session.ended:
            # Another file was opened, or the extension switched off.
            self._end(context, keep=True)
            return {"CANCELLED"}
        try:
            if event.type == "TIMER":
                now = time.perf_counter()
                controls.tick(now - self._last)
                self._last = now
                told = self._session.told
                shown = controls.told(), controls.hover and controls.hover.body
                # A puppet at rest lets Blender rest.
                if shown != self._shown or told is None or not told.resting:
                    self._shown = shown
                    self._tell(context)
                return {"PASS_THROUGH"}
            outcome = self._handle(context, controls, event)
        except OctoMotionError as error:
            self._end(context, keep=False)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except BaseException:
            self._end(context, keep=False)
            raise
        if outcome is Outcome.FINISH:
            self._end(context, keep=True)
            return {"FINISHED"}
        if outcome is Outcome.CANCEL:
            self._end(context, keep=False)
            return {"CANCELLED"}
        return {"RUNNING_MODAL"} if outcome is Outcome.TAKEN else {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender's own end of it: another file is opened, or Blender quits."""
        self._end(context, keep=False)

    def _handle(
        self, context: bpy.types.Context, controls: PoseControls, event: bpy.types.Event
    ) -> Outcome:
        window = context.window
        if window is not None and self._scrub(window, controls, event):
            return Outcome.TAKEN
        found = None if window is None else view_under(window, event.mouse_x, event.mouse_y)
        if found is None:
            return controls.handle(event, None)
        return controls.handle(event, *found)

    def _scrub(
        self, window: bpy.types.Window, controls: PoseControls, event: bpy.types.Event
    ) -> bool:
        """Take drags in the frame numbers of a timeline; whether this event is one of them."""
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and not controls.holding:
            self._strip = strip_under(window, event.mouse_x, event.mouse_y)
        elif self._strip is None:
            return False
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self._strip = None
            return True
        elif event.type not in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            return False
        if self._strip is None:
            return False
        frame = frame_under(window, self._strip, event.mouse_x)
        if frame is None:
            self._strip = None
            return False
        go_to(controls.session.scene(), frame)
        return True

    def _tell(self, context: bpy.types.Context) -> None:
        assert self._controls is not None
        text = self._controls.told()
        for area in context.screen.areas if context.screen else ():
            if area.type == "VIEW_3D":
                area.header_text_set(text)
                area.tag_redraw()
        if context.workspace is not None:
            context.workspace.status_text_set(
                "    ".join(f"{keys}: {what}" for keys, what in self._controls.help)
            )

    def _end(self, context: bpy.types.Context, *, keep: bool) -> None:
        """Leave nothing on screen; safe to call twice."""
        session, self._session = self._session, None
        overlay, self._overlay = self._overlay, None
        timer, self._timer = self._timer, None
        self._controls = None
        try:
            if session is not None:
                if keep:
                    session.finish()
                else:
                    session.cancel()
        finally:
            if overlay is not None:
                overlay.take_down()
            if timer is not None and context.window_manager is not None:
                context.window_manager.event_timer_remove(timer)
            for area in context.screen.areas if context.screen else ():
                if area.type == "VIEW_3D":
                    area.header_text_set(None)
                    area.tag_redraw()
            if context.workspace is not None:
                context.workspace.status_text_set(None)


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_OT_pose_start,)
