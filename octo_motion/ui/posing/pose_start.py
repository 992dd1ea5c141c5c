# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by hand in the viewport."""

from __future__ import annotations

import time
from typing import Final

import bpy

from ...core.errors import SettingsError
from .controls import Outcome, PoseControls
from .overlay import Overlay
from .puppet_session import PuppetSession
from .scrubbing import Strip, frame_under, go_to, strip_under
from .session_operator import SessionOperator, tell
from .view import view_under


class OCTO_MOTION_OT_pose_start(SessionOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_start"
    bl_label = "Pose by Hand"
    bl_description = (
        "Take hold of the figure like a puppet: drag a limb and it resists, gives way and stays "
        "where you leave it. K keys the bones that you have moved, P pins a limb, the wheel pulls "
        "nearer, R turns while dragging. Enter keeps the pose, Esc leaves all as it was"
    )

    _controls: PoseControls | None = None
    _strip: Strip | None = None
    _last: float = 0.0
    _shown: tuple[str, int | None] = ("", None)

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        """Without a mouse there is no hand."""
        raise SettingsError(
            "Posing by hand needs a mouse and a 3D viewport.",
            "Click it in the panel Pose; scripts have octo_motion.pose_script.",
        )

    def take_up(self, context: bpy.types.Context, session: PuppetSession) -> Overlay:
        self._controls = PoseControls(session)
        driven = len(session.puppet.rig.roles.driven)
        if driven:
            self.report({"WARNING"}, f"Constraints or drivers move {driven} of its bones")
        self._last = time.perf_counter()
        tell(context, self._controls.status(), self._controls.help)
        return Overlay(self._controls)

    def turn(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        controls = self._controls
        assert controls is not None
        if event.type != "TIMER":
            return self._handle(context, controls, event)
        now = time.perf_counter()
        controls.tick(now - self._last)
        self._last = now
        report = controls.session.report
        shown = controls.status(), controls.hover
        # A puppet at rest lets Blender rest.
        if shown != self._shown or report is None or not report.resting:
            self._shown = shown
            tell(context, controls.status(), controls.help)
        return Outcome.PASSED

    def put_down(self) -> None:
        self._controls = None

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


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_OT_pose_start,)
