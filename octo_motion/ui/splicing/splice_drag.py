# SPDX-License-Identifier: GPL-3.0-or-later
"""Dragging a splice's timing in the viewport, with the result seen at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, cast

import bpy
from bpy.props import FloatProperty

from ...blender.animation import writable_armature
from ...blender.rig import active_armature
from ...core.errors import ClipError, OctoMotionError
from .. import at_work
from .properties import splicing_settings
from .splice_build import build_retimed, tell
from .splice_list import SpliceOperator, active_splice
from .stack import local_object, prepare_splices
from .timing_drag import DragSession

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems

_HELP: Final = (
    "Drag: move    Shift: fine    Tab: base or clip    Numbers: type a frame    "
    "Arrow keys, Space: other frames    Enter, click: build    Esc, right click: as it was"
)
_PASSED: Final = frozenset(
    {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "SPACE"}
)
"""The view stays free, and playing."""

# Blender's own operator for this would keep the pose that is only shown in an undo step.
_FRAME_STEPS: Final = {"LEFT_ARROW": -1, "RIGHT_ARROW": 1}


class OCTO_MOTION_OT_splice_drag_timing(SpliceOperator, bpy.types.Operator):
    bl_idname = "octo_motion.splice_drag_timing"
    bl_label = "Drag Timing"
    bl_description = (
        "Drag sideways to move the start of the active splice and watch the body at the current "
        "frame. Tab changes between the start on the base and the start in the clip, Shift moves "
        "finely, numbers are typed. Enter or a click builds, Esc leaves all as it was"
    )
    bl_options = {"REGISTER", "UNDO", "GRAB_CURSOR_X", "BLOCKING"}

    base_start: FloatProperty(
        name="Base Start",
        description="Frame of the base at which the splice begins; for scripts, without a drag",
        step=100,
        precision=1,
        options={"SKIP_SAVE"},
    )
    splice_start: FloatProperty(
        name="Clip Start",
        description="Frame of the clip that is shown first; for scripts, without a drag",
        step=100,
        precision=1,
        options={"SKIP_SAVE"},
    )

    _session: DragSession | None = None
    _mouse: float = 0.0

    def edit(
        self,
        context: bpy.types.Context,  # noqa: ARG002
        armature: bpy.types.Object,
        settings: Any,
    ) -> None:
        """Without a drag: the starts that are given, else those that there are."""
        item = active_splice(settings)
        _check_shown(item)
        given = self.properties.is_property_set
        starts = (
            self.base_start if given("base_start") else item.base_start,
            self.splice_start if given("splice_start") else item.splice_start,
        )
        tell(self, build_retimed(armature, settings, settings.active_splice, starts))

    def invoke(
        self, context: bpy.types.Context, event: bpy.types.Event
    ) -> set[OperatorReturnItems]:
        """Read all that is needed, and follow the mouse."""
        window_manager, scene = context.window_manager, context.scene
        assert window_manager is not None
        assert scene is not None
        armature = active_armature(context)
        settings = cast("Any", splicing_settings(armature))
        try:
            writable_armature(armature)
            _check_shown(active_splice(settings))
            self._session = DragSession(prepare_splices(armature), settings.active_splice, scene)
            self._session.show()
        except OctoMotionError as error:
            return self._fail(context, error)
        self._mouse = event.mouse_x
        window_manager.modal_handler_add(self)
        at_work.begun(self, self._tear_down)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[OperatorReturnItems]:
        """One event."""
        session = self._session
        assert session is not None
        if event.value == "PRESS" and event.type in {"ESC", "RIGHTMOUSE"}:
            self._tear_down(context)
            return {"CANCELLED"}
        try:
            if event.value == "PRESS" and event.type in {"LEFTMOUSE", "RET", "NUMPAD_ENTER"}:
                return self._finish(context)
            free = event.type in _PASSED or event.type.startswith("TIMER")
            if not free:
                self._take(session, event)
                session.show()
        except OctoMotionError as error:
            return self._fail(context, error)
        except BaseException:
            self._tear_down(context)
            raise
        self._tell(context)
        return {"PASS_THROUGH"} if free else {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender's own end of it: another file is opened, or Blender quits."""
        self._tear_down(context)

    def _take(self, session: DragSession, event: bpy.types.Event) -> None:
        if event.type == "MOUSEMOVE":
            session.drag.tick(event.mouse_x - self._mouse, fine=event.shift)
            self._mouse = event.mouse_x
        elif event.value == "PRESS":
            if event.type in _FRAME_STEPS:
                session.step(_FRAME_STEPS[event.type])
            elif event.type == "TAB":
                session.drag.switch()
            elif event.type == "BACK_SPACE":
                session.drag.type("")
            elif event.unicode:
                session.drag.type(event.unicode)

    def _finish(self, context: bpy.types.Context) -> set[OperatorReturnItems]:
        session = self._session
        assert session is not None
        starts, stack, number = session.drag.starts, session.stack, session.number
        self._tear_down(context)
        armature = local_object(stack.armature)
        settings = cast("Any", splicing_settings(armature))
        # For the panel of the last operation.
        self.base_start, self.splice_start = starts
        tell(self, build_retimed(armature, settings, number, starts, stack))
        return {"FINISHED"}

    def _fail(self, context: bpy.types.Context, error: OctoMotionError) -> set[OperatorReturnItems]:
        self._tear_down(context)
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def _tell(self, context: bpy.types.Context) -> None:
        assert self._session is not None
        if context.area is not None:
            context.area.header_text_set(self._session.drag.told())
        if context.workspace is not None:
            context.workspace.status_text_set(_HELP)

    def _tear_down(self, context: bpy.types.Context) -> None:
        """Leave nothing on screen and armature; safe to call twice."""
        at_work.done(self)
        if self._session is None:
            return
        self._session.tear_down()
        self._session = None
        if context.area is not None:
            context.area.header_text_set(None)
        if context.workspace is not None:
            context.workspace.status_text_set(None)


def _check_shown(item: Any) -> None:
    if item.mute:
        raise ClipError(f"Splice '{item.name}' is muted.", "Unmute it, then drag its timing.")


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_OT_splice_drag_timing,)
