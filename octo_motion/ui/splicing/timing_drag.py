# SPDX-License-Identifier: GPL-3.0-or-later
"""Dragging a splice's timing in the viewport, with the result seen at once.

:class:`TimingDrag` and :class:`DragSession` need no window: numbers and a pose come of them, and
nothing else changes.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, Literal

import bpy
from bpy.props import FloatProperty

from ...blender.animation import pose_values, restore_pose, show_pose, writable_armature
from ...blender.rig import active_armature
from ...core.errors import ClipError, OctoMotionError, WriteError
from ...core.phrases import phrase
from ...core.splicing.clip import Timing
from .. import at_work
from ..language import reported, translated
from .live_splices import live_spliced
from .properties import splicing_settings
from .splice_operators import SpliceOperator, active_splice, build_retimed, report_built
from .stack import ListedSpliceError, Stack, local_object, prepare_splices
from .timing_strip import Strip, StripOverlay, strip_of

if TYPE_CHECKING:
    from bpy.stub_internal.rna_enums import OperatorReturnItems

PER_PIXEL: Final = 0.1
"""Frames that a pixel of the mouse's way is worth."""

FINE: Final = 0.1
"""Of that, with Shift."""

Handle = Literal["base", "splice"]


class TimingDrag:
    """The two starts of a splice, one of them moved by hand: the frame of the base at which it
    begins, or that of the clip which is shown then.
    """

    def __init__(self, base_start: float, splice_start: float) -> None:
        self.handle: Handle = "base"
        self.typed = ""
        """What the keyboard has given so far."""
        self._dragged: dict[Handle, float] = {"base": base_start, "splice": splice_start}
        self._starts = dict(self._dragged)

    @property
    def starts(self) -> tuple[float, float]:
        """Frames of the base and of the clip."""
        return self._starts["base"], self._starts["splice"]

    def tick(self, pixels: float, *, fine: bool = False) -> None:
        """The mouse has moved: by whole frames, or ``fine`` by a tenth as much and by hundredths.

        What was typed counts until it is taken back.
        """
        if self.typed or pixels == 0.0:
            return
        value = self._dragged[self.handle] + pixels * PER_PIXEL * (FINE if fine else 1.0)
        self._dragged[self.handle] = value
        self._starts[self.handle] = round(value, 2 if fine else 0)

    def type(self, character: str) -> None:
        """A key for the number: digit, point, minus, or "" to take the last back."""
        if character == "":
            self.typed = self.typed[:-1]
        elif character == "-":
            # As everywhere in Blender, it turns the sign.
            self.typed = self.typed[1:] if self.typed.startswith("-") else f"-{self.typed}"
        elif character in ".," and "." not in self.typed:
            self.typed += "."
        elif character in tuple("0123456789"):
            self.typed += character
        else:
            return
        try:
            value = float(self.typed)
        except ValueError:
            value = round(self._dragged[self.handle])
        self._starts[self.handle] = value

    def switch(self) -> None:
        """Move the other start from now on."""
        self._dragged = dict(self._starts)
        self.typed = ""
        self.handle = "splice" if self.handle == "base" else "base"

    def header(self) -> str:
        """The numbers, the one that moves marked."""
        shown = {name: f"{value:g}" for name, value in self._starts.items()}
        if self.typed:
            shown[self.handle] = f"[{self.typed}|]"
        marks = {name: "▸ " if name == self.handle else "" for name in shown}
        return phrase(
            "{mark}Base Start: {base}    {other_mark}Clip Start: {splice}",
            mark=marks["base"],
            other_mark=marks["splice"],
            **shown,
        )


class DragSession:
    """A drag on an armature: its pose follows, also when the frame changes, until it is taken down.

    The splice is none that is muted.
    """

    def __init__(self, stack: Stack, number: int, scene: bpy.types.Scene) -> None:
        splice = stack.splices[number]
        assert splice is not None
        self.number = number
        self.stack = stack
        self.drag = TimingDrag(splice.timing.base_start, splice.timing.splice_start)
        self._timing = splice.timing
        self._live = stack.preview(number)
        self._pose = pose_values(local_object(stack.armature))
        self._scene = scene.name
        self._frame = scene.frame_current_final
        self._down = False
        # A change of frame poses the armature as its action says.
        bpy.app.handlers.frame_change_post.append(self._follow)

    @property
    def timing(self) -> Timing:
        """As it is dragged now."""
        base_start, splice_start = self.drag.starts
        return replace(self._timing, base_start=base_start, splice_start=splice_start)

    def strip(self) -> Strip | None:
        """Where on its base the splice acts now; none where the timing makes no sense."""
        splice = self.stack.splices[self.number]
        if self._down or splice is None:
            return None
        with suppress(OctoMotionError):
            return strip_of(self.timing, self.stack.base.clip, splice.clip)
        return None

    def header(self) -> str:
        """The numbers, and what there is to say of them."""
        strip = self.strip()
        warning = strip.warning if strip is not None else ""
        return self.drag.header() + (f"    {translated(warning)}" if warning else "")

    def show(self) -> None:
        """Pose the armature as the result is at the current frame.

        Raises:
            OctoMotionError: the armature is gone, or the timing makes no sense.
        """
        scene = bpy.data.scenes.get(self._scene)
        if self._down or scene is None:
            return
        armature = local_object(self.stack.armature)
        with self.stack.naming():
            clip = self._live.at(scene.frame_current_final, self.timing)
        scales = None if clip.scales is None else clip.scales[0]
        show_pose(armature, clip.skeleton.names, clip.rotations[0], clip.locations[0], scales)

    def step(self, frames: int) -> None:
        """Go so many frames on, or back."""
        scene = bpy.data.scenes.get(self._scene)
        if scene is not None:
            scene.frame_set(scene.frame_current + frames)

    def tear_down(self) -> None:
        """Give the armature its pose back; safe to call twice."""
        if self._down:
            return
        self._down = True
        followers = bpy.app.handlers.frame_change_post
        if self._follow in followers:
            followers.remove(self._follow)
        try:
            armature = local_object(self.stack.armature)
        except WriteError:
            return
        restore_pose(armature, self._pose)
        scene = bpy.data.scenes.get(self._scene)
        if scene is not None and scene.frame_current_final != self._frame:
            scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)

    def _follow(self, scene: bpy.types.Scene, *_: object) -> None:
        if scene.name != self._scene:
            return
        # The next event of the drag says what is wrong.
        with suppress(OctoMotionError):
            self.show()


# --- The operator ---------------------------------------------------------------------------------


_HELP: Final = phrase(
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
    _overlay: StripOverlay | None = None
    _mouse: float = 0.0

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, settings: Any) -> None:  # noqa: ARG002
        """Without a drag: the starts that are given, else those that there are."""
        item = active_splice(settings)
        _check_shown(item)
        given = self.properties.is_property_set
        starts = (
            self.base_start if given("base_start") else item.base_start,
            self.splice_start if given("splice_start") else item.splice_start,
        )
        report_built(self, build_retimed(armature, settings, settings.active_splice, starts))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[Any]:
        """Read all that is needed, and follow the mouse."""
        window_manager, scene = context.window_manager, context.scene
        assert window_manager is not None
        assert scene is not None
        armature = active_armature(context)
        settings = splicing_settings(armature)
        live_spliced.pause(armature)
        try:
            writable_armature(armature)
            _check_shown(active_splice(settings))
            stack = prepare_splices(armature, between=False)
            self._session = DragSession(stack, settings.active_splice, scene)
            self._session.show()
        except OctoMotionError as error:
            return self._fail(context, error)
        self._mouse = event.mouse_x
        self._overlay = StripOverlay(self._session.strip, stack.names[settings.active_splice])
        window_manager.modal_handler_add(self)
        at_work.begun(self, self._tear_down)
        _write(context, self._session.header(), _HELP)
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
        _write(context, session.header(), _HELP)
        if self._overlay is not None:
            self._overlay.redraw()
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
        strip = session.strip()
        self._tear_down(context)
        armature = local_object(stack.armature)
        settings = splicing_settings(armature)
        # For the panel of the last operation.
        self.base_start, self.splice_start = starts
        report_built(self, build_retimed(armature, settings, number, starts, stack))
        if strip is not None and strip.warning:
            self.report({"WARNING"}, reported(strip.warning))
        return {"FINISHED"}

    def _fail(self, context: bpy.types.Context, error: OctoMotionError) -> set[OperatorReturnItems]:
        self._tear_down(context)
        if isinstance(error, ListedSpliceError):
            error.select()
        self.report({"ERROR"}, reported(error))
        return {"CANCELLED"}

    def _tear_down(self, context: bpy.types.Context) -> None:
        """Leave nothing on screen and armature; safe to call twice."""
        at_work.done(self)
        if self._overlay is not None:
            self._overlay.take_down()
            self._overlay = None
        if self._session is None:
            return
        self._session.tear_down()
        self._session = None
        _write(context, None, None)


def _write(context: bpy.types.Context, header: str | None, status: str | None) -> None:
    """Write into the area's header and the status bar, or give them back."""
    if context.area is not None:
        context.area.header_text_set(None if header is None else translated(header))
    if context.workspace is not None:
        context.workspace.status_text_set(None if status is None else translated(status))


def _check_shown(item: Any) -> None:
    if item.mute:
        raise ClipError(
            phrase("Splice '{item}' is muted.", item=item.name), "Unmute it, then drag its timing."
        )
