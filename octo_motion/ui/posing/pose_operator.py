# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing in the viewport until Enter or Esc: what its operators share, and the one by hand."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any, Final, cast

import bpy

from ...blender.files import own_folder
from ...blender.rig import active_armature, leading_objects
from ...core.errors import OctoMotionError, SettingsError
from ...core.phrases import Phrase, joined_phrases, phrase
from ...device.ipc import ALONE, Client
from .. import at_work
from ..language import reported, translated
from ..operator_base import ArmatureOperator
from .controls import Outcome, PoseControls
from .overlay import Overlay
from .passing import left_to_blender
from .puppet_session import PuppetSession, active_session
from .viewport import frame_under, go_to, strip_under, view_under

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems

_RATE: Final = 1.0 / 60.0
"""Seconds between two ticks."""


class SessionOperator(ArmatureOperator):
    """Mix-in: write ``take_up``, ``turn`` and ``put_down``. One session is one undo step."""

    _session = cast("PuppetSession | None", None)
    _overlay = cast("Overlay | None", None)
    _timer = cast("Any", None)

    def take_up(self, context: bpy.types.Context, session: PuppetSession) -> Overlay:
        """Make ready what poses; may raise ``OctoMotionError``."""
        raise NotImplementedError

    def turn(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        """One event, the timer's among them; may raise ``OctoMotionError``."""
        raise NotImplementedError

    def put_down(self) -> None:
        """Let go of what poses, if it was taken up: before the session ends, and only once."""
        raise NotImplementedError

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        going_on = active_session()
        if going_on is not None:
            return phrase("{puppet} is being posed already", puppet=going_on.puppet.name)
        return super().obstacle(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:  # noqa: ARG002
        window_manager, scene, window = context.window_manager, context.scene, context.window
        if window is None or bpy.app.background:
            return self.execute(context)
        assert window_manager is not None
        assert scene is not None
        try:
            armature = active_armature(context)
            self._session = PuppetSession(armature, scene, partners=partners(context, armature))
            self._overlay = self.take_up(context, self._session)
            self._timer = window_manager.event_timer_add(_RATE, window=window)
            window_manager.modal_handler_add(cast("bpy.types.Operator", self))
            at_work.begun(self, partial(self._end, keep=True))
            for text in moved_otherwise(self._session):
                self.report({"WARNING"}, reported(text))  # type: ignore[attr-defined]
        except OctoMotionError as error:
            return self._fail(context, error)
        except BaseException:
            self._end(context, keep=False)
            raise
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[OperatorReturnItems]:
        if self._session is None or self._session.ended:
            # Another file was opened.
            self._end(context, keep=True)
            return {"CANCELLED"}
        try:
            if self._session.is_edited():
                # Another workspace may bring its mode along: no error, and no popup.
                name = self._session.puppet.name
                self._end(context, keep=True)
                told = phrase("Posing has ended: {name} is in edit mode", name=name)
                self.report({"INFO"}, reported(told))  # type: ignore[attr-defined]
                return {"FINISHED", "PASS_THROUGH"}
            outcome = self.turn(context, event)
            if outcome is Outcome.PASSED:
                outcome = left_to_blender(context.window, event, context.mode)
        except OctoMotionError as error:
            return self._fail(context, error)
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

    def _fail(self, context: bpy.types.Context, error: OctoMotionError) -> set[OperatorReturnItems]:
        self._end(context, keep=False)
        self.report({"ERROR"}, reported(error))  # type: ignore[attr-defined]
        return {"CANCELLED"}

    def _end(self, context: bpy.types.Context, *, keep: bool) -> None:
        """Leave nothing on screen; safe to call twice."""
        at_work.done(self)
        session, self._session = self._session, None
        overlay, self._overlay = self._overlay, None
        timer, self._timer = self._timer, None
        try:
            try:
                self.put_down()
            finally:
                if session is not None:
                    session.finish() if keep else session.cancel()
        except OctoMotionError as error:
            self.report({"ERROR"}, reported(error))  # type: ignore[attr-defined]
        finally:
            if overlay is not None:
                overlay.take_down()
            if timer is not None and context.window_manager is not None:
                context.window_manager.event_timer_remove(timer)
            tell(context, None)


def moved_otherwise(session: PuppetSession) -> Iterator[Phrase]:
    """What is to be said of bones that neither a hand nor a key of theirs moves."""
    driven = len(session.puppet.rig.roles.driven)
    if driven:
        yield phrase("Constraints or drivers move {driven} of its bones", driven=driven)
    for name, bones in leading_objects(session.puppet.armature()).items():
        yield phrase(
            "'{object}' leads {count} of its bones ('{example}'), and is no empty that is shown "
            "and free to be moved: no pull reaches it. Move it, or mute the constraint.",
            object=name,
            count=len(bones),
            example=bones[0],
        )


def handled(
    window: bpy.types.Window | None, controls: PoseControls, event: bpy.types.Event
) -> Outcome:
    """What becomes of an event of a window in the hands of mouse and keys."""
    found = None if window is None else view_under(window, event.mouse_x, event.mouse_y)
    return controls.handle(event, None) if found is None else controls.handle(event, *found)


def partners(context: bpy.types.Context, armature: bpy.types.Object) -> list[bpy.types.Object]:
    """Other armatures that are posed along: those selected, or in pose mode too."""
    chosen = context.objects_in_mode if context.mode == "POSE" else context.selected_objects
    return [each for each in chosen if each.type == "ARMATURE" and each != armature]


def tell(
    context: bpy.types.Context, line: str | None, keys: Iterable[tuple[str, str]] = ()
) -> None:
    """Show a line in the headers of 3D viewports, and what keys do in the status bar.

    Without a line, Blender's own are shown again.
    """
    screens, workspaces = [context.screen], [context.workspace]
    if line is None:
        # Another workspace may have been chosen meanwhile.
        screens, workspaces = [*bpy.data.screens], [*bpy.data.workspaces]
    for screen in screens:
        for area in screen.areas if screen is not None else ():
            if area.type == "VIEW_3D":
                area.header_text_set(None if line is None else translated(line))
                area.tag_redraw()
    shown = joined_phrases(
        "    ", (phrase("{key}: {what}", key=key, what=what) for key, what in keys)
    )
    for workspace in workspaces:
        if workspace is not None:
            workspace.status_text_set(None if line is None else translated(shown))


# --- Posing by hand in the viewport ---------------------------------------------------------------


class OCTO_MOTION_OT_pose_start(SessionOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_start"
    bl_label = "Pose by Hand"
    bl_description = (
        "Take hold of the figure like a puppet: drag a limb and it resists, gives way and stays "
        "where you leave it. K keys the bones that you have moved, P pins a limb, the wheel pulls "
        "nearer, R turns while dragging. Enter keeps the pose, Esc leaves all as it was"
    )

    _controls: PoseControls | None = None
    _client: Client | None = None
    _strip: int | None = None
    """The area in whose frame numbers a drag began."""
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
        # It takes a moment: until it answers, and a drag that has begun is over, Blender simulates.
        self._client = Client(log_file=own_folder() / "simulation.log")
        self._client.start_soon((ALONE,))
        session.core.share(self._client)
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
        client, self._client = self._client, None
        if client is not None:
            client.stop()

    def _handle(
        self, context: bpy.types.Context, controls: PoseControls, event: bpy.types.Event
    ) -> Outcome:
        window = context.window
        if window is not None and self._scrub(window, controls, event):
            return Outcome.TAKEN
        return handled(window, controls, event)

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
