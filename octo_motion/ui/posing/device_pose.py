# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing with devices in the viewport."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, Final

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty

from ...blender.files import own_folder
from ...core.errors import DeviceError, OctoMotionError, SettingsError
from ...core.phrases import joined_phrases, phrase
from ...core.rotations import Floats
from ...device.driver import Kind
from ...device.ipc import ALONE, Client
from ...device.messages import Buzz, Notice, Order
from ..language import reported
from ..operator_base import OctoOperator
from .controls import Outcome, undone
from .device_hands import (
    NDOF_GRAB_BUTTONS,
    NDOF_KEY_BUTTONS,
    NDOF_NAME,
    DeviceHands,
    NdofHands,
    ViewRoom,
)
from .device_settings import bridge_arguments, device_settings, message
from .overlay import Overlay, device_lines, take_down_all
from .pose_operator import SessionOperator, handled, tell
from .puppet_session import PuppetSession, active_session

HELP: Final = (
    (phrase("First button or G"), phrase("grab")),
    (phrase("L Drag"), phrase("pull")),
    (phrase("Second button or K"), phrase("key touched")),
    (phrase("Shift K"), phrase("key all")),
    (phrase("P"), phrase("pin")),
    (phrase("O"), phrase("record")),
    (phrase("R"), phrase("restore")),
    (phrase("Ctrl Z"), phrase("back")),
    (phrase("Ctrl Shift Z"), phrase("forward")),
    (phrase("Home"), phrase("pointer to the middle")),
    (phrase("B"), phrase("start the device's program again")),
    (phrase("Enter"), phrase("keep")),
    (phrase("Esc"), phrase("as it was")),
)
_LEADS: Final = frozenset(
    {"LEFTMOUSE", "RIGHTMOUSE", "MOUSEMOVE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"}
)
"""What the mouse takes limbs with, beside the devices."""
_HOLDS: Final = frozenset({"R", "G"})
"""Its keys while it holds one."""
_COVERS: Final = 0.7
"""Of what a camera sees from left to right: as much as of a view that is none."""
_KEYS: Final = frozenset({"ESC", "RET", "NUMPAD_ENTER", "G", "K", "P", "O", "R", "HOME", "B", "Z"})

Hands = DeviceHands | NdofHands

_going_on: list[Hands] = []


def active_hands() -> Hands | None:
    """The devices that pose now, if any do."""
    return _going_on[0] if _going_on else None


def room_of(context: bpy.types.Context, scale: float, session: PuppetSession) -> ViewRoom | None:
    """What the largest 3D viewport of the window shows."""
    areas = (
        [each for each in context.screen.areas if each.type == "VIEW_3D"] if context.screen else []
    )
    area = max(areas, key=lambda each: each.width * each.height, default=None)
    space = area.spaces.active if area else None
    data = space.region_3d if isinstance(space, bpy.types.SpaceView3D) else None
    if data is None:
        return None
    if data.view_perspective == "CAMERA":
        return camera_room(data, scale, session.capsules()[0].reshape(-1, 3).mean(axis=0))
    middle = np.array(data.view_location, dtype=np.float64)
    return ViewRoom(middle, _axes(data), scale * max(float(data.view_distance), 1e-6))


def camera_room(data: Any, scale: float, figure: Floats) -> ViewRoom:
    """What ``RegionView3D`` shows through a camera, at the depth of a figure's middle (3,), world.

    Where the view turns and how far it is from there, as Blender tells it, is then that of another
    view: the one before.
    """
    axes = _axes(data)
    eye = np.array(data.view_matrix.inverted(), dtype=np.float64)[:3, 3]
    lens = np.array(data.window_matrix, dtype=np.float64)
    depth = float((eye - figure) @ axes[:, 2])
    if depth <= 0.0:  # behind the camera: nobody sees it anyway
        depth = float(data.view_distance)
    # In steps of a fifth: a figure that moves must not move the room, for that lets go.
    depth = float(np.exp2(np.round(4.0 * np.log2(max(depth, 1e-6))) / 4.0))
    # Of the view's own axes: a perspective one widens with the depth.
    reach = 1.0 if lens[3, 3] else depth
    beside = (-lens[:2, 3] if lens[3, 3] else depth * lens[:2, 2]) / (lens[0, 0], lens[1, 1])
    middle = eye + axes @ np.array([*beside, -depth])
    return ViewRoom(middle, axes, scale * _COVERS * 2.0 * reach / abs(float(lens[0, 0])))


def _axes(data: Any) -> Floats:
    """(3, 3) as columns: right, up, and towards the eye."""
    axes = np.array(data.view_matrix.inverted(), dtype=np.float64)[:3, :3]
    return axes / np.linalg.norm(axes, axis=0)


class OCTO_MOTION_OT_pose_device(SessionOperator, bpy.types.Operator):
    bl_idname = "octo_motion.pose_device"
    bl_label = "Pose with Device"
    bl_description = (
        "Take hold of the figure with a space mouse or a force device: the first button grabs the "
        "nearest limb, the second one sets keys. Enter keeps the pose, Esc leaves all as it was"
    )

    _hands: Hands | None = None
    _size: float = 1.0
    """Of the figure, puppet metres."""

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        """Without a window nobody sees the pointer."""
        raise SettingsError(
            "Posing with a device needs a 3D viewport.",
            "Click it in the panel Device; scripts have octo_motion.pose_script.",
        )

    def take_up(self, context: bpy.types.Context, session: PuppetSession) -> Overlay:
        """Start the bridge, and take the armature into its hands."""
        settings = device_settings(context.window_manager)
        client = Client(log_file=own_folder() / "device.log")
        client.start(bridge_arguments(settings))
        self._size = session.size * session.unit
        try:
            self._hands = DeviceHands(session, client, self._device_settings(settings))
        except BaseException:
            client.stop()
            raise
        _going_on.append(self._hands)
        return Overlay(self._hands, device_lines)

    def turn(self, context: bpy.types.Context, event: bpy.types.Event) -> Outcome:
        hands = self._hands
        assert hands is not None
        if event.type == "TIMER":
            self._tick(context, hands)
            return Outcome.PASSED
        if event.type.startswith("NDOF_"):
            return self._push(context, hands, event)
        leads = event.type in _LEADS or (event.type in _HOLDS and hands.mouse.holding)
        if leads:
            return handled(context.window, hands.mouse, event)
        return self._handle(hands, event)

    def put_down(self) -> None:
        hands, self._hands = self._hands, None
        if hands is not None:
            _going_on.remove(hands)
            hands.stop()

    def _device_settings(self, settings: Any) -> Any:
        assert self._session is not None
        return message(settings, self._size)

    def _tick(self, context: bpy.types.Context, hands: Hands) -> None:
        settings = device_settings(context.window_manager)
        was_holding = hands.holding
        now = self._device_settings(settings)
        for button in hands.tick(now, room_of(context, settings.scale, hands.session)):
            if button.pressed and button.button == now.key_button:
                self._key(hands, all_bones=False)
        if was_holding and not hands.holding:
            self._let_go(context, hands)
        for notice in hands.notices():
            self.report({"WARNING"}, reported(joined_phrases(" ", (notice.problem, notice.remedy))))
        tell(context, line(hands), HELP)

    def _let_go(self, context: bpy.types.Context, hands: Hands) -> None:
        tools = context.scene.tool_settings if context.scene else None
        if tools is not None and tools.use_keyframe_insert_auto and not hands.session.recording:
            self._key(hands, all_bones=False)

    @staticmethod
    def _key(hands: Hands, *, all_bones: bool) -> None:
        session = hands.session
        hands.message = session.words_for(session.key(all_bones=all_bones))

    def _push(self, context: bpy.types.Context, hands: Hands, event: Any) -> Outcome:
        """Blender has a space mouse itself: without a force device, that one poses."""
        if isinstance(hands, DeviceHands):
            devices = hands.client.devices.values()
            if any(each.force > 0.0 for each in devices) or hands.holding:
                # Beside a force device it turns the view, unless the bridge has it for a pointer.
                points = any(each.kind == Kind.RATE for each in devices)
                return Outcome.TAKEN if points else Outcome.PASSED
            hands.stop()
            assert self._session is not None
            hands = self.replace(hands, NdofHands(self._session, mouse=hands.mouse))
            hands.client.start_soon((ALONE,))
            self._session.core.share(hands.client)
        settings = device_settings(context.window_manager)
        now = self._device_settings(settings)
        if event.type == "NDOF_MOTION":
            room = room_of(context, settings.scale, hands.session)
            motion = event.ndof_motion
            if room is not None and motion is not None:
                hands.move(*(motion.translation, motion.rotation, motion.time_delta, room, now))
        elif event.type in NDOF_GRAB_BUTTONS:
            if event.value == "PRESS" or (not now.toggle and hands.holding):
                hands.grab()
                if not hands.holding:
                    self._let_go(context, hands)
        elif event.type in NDOF_KEY_BUTTONS and event.value == "PRESS":
            self._key(hands, all_bones=False)
        return Outcome.TAKEN

    def replace(self, old: Hands, new: NdofHands) -> NdofHands:
        assert self._overlay is not None
        self._hands = new
        _going_on[:] = [new if each is old else each for each in _going_on]
        self._overlay.take_down()
        self._overlay = Overlay(new, device_lines)
        return new

    def _handle(self, hands: Hands, event: Any) -> Outcome:
        if event.type not in _KEYS or (event.type == "Z" and not _is_undo(event)):
            return Outcome.PASSED
        if event.value != "PRESS":
            return Outcome.TAKEN
        match event.type:
            case "ESC":
                return Outcome.CANCEL
            case "RET" | "NUMPAD_ENTER":
                return Outcome.FINISH
            case "G":
                hands.grab()
            case "K":
                self._key(hands, all_bones=event.shift)
            case "P":
                hands.pin()
            case "O":
                hands.message = hands.session.toggle_record()
            case "R":
                hands.restore()
                hands.message = "As at the start"
            case "Z":
                hands.message = undone(hands, forward=event.shift)
            case "HOME":
                hands.recentre()
            case _ if isinstance(hands, DeviceHands):
                self._start_again(hands)
            case _:
                return Outcome.PASSED
        return Outcome.TAKEN

    @staticmethod
    def _start_again(hands: DeviceHands) -> None:
        try:
            hands.restart()
        except DeviceError as error:
            # The session goes on without: what was posed and keyed must not be lost for that.
            hands.client.notices.append(Notice(error.problem, error.remedy))
            return
        hands.message = "Started again"


def _is_undo(event: Any) -> bool:
    """Whether Ctrl Z or Ctrl Shift Z, or Cmd Z on a Mac, is pressed; Z alone is Blender's."""
    return event.ctrl or event.oskey


def line(hands: Hands) -> str:
    """One line about devices, for the header."""
    parts: list[str] = [phrase("Posing {puppet}", puppet=hands.session.puppet.name)]
    shown = hands.shown()
    if trouble := hands.trouble():
        parts.append(phrase("The device's program {trouble}: B starts it again", trouble=trouble))
    elif not shown:
        is_blenders = isinstance(hands, NdofHands)
        parts.append(NDOF_NAME if is_blenders else phrase("No device yet: plug one in"))
    for each in shown:
        what = hands.session.bone(each.body) if each.body >= 0 else phrase("free")
        if each.number in hands.client.calibrating:
            what = phrase("is being calibrated")
        parts.append(phrase("{device}: {what}", device=each.name, what=what))
    if hands.session.recording:
        parts.append(phrase("● Recording"))
    parts += [each for each in (hands.message, hands.mouse.message) if each]
    return joined_phrases("    ", parts)


class DeviceOperator(OctoOperator):
    """An operator on one of the devices that pose now."""

    bl_options = {"INTERNAL"}  # nothing in the file changes

    number: IntProperty(
        name="Device", description="Which one, counted from 0", default=0, min=0, max=7
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:  # noqa: ARG003
        return "Start Pose with Device first" if active_hands() is None else ""


class OCTO_MOTION_OT_device_test(DeviceOperator, bpy.types.Operator):
    bl_idname = "octo_motion.device_test"
    bl_label = "Test Device"
    bl_description = "Let the device push gently to the right, then to the left"

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        hands = active_hands()
        assert hands is not None
        device = hands.client.devices.get(self.number)
        if device is None or device.force <= 0.0:
            raise SettingsError("This device has no force.", "Choose a force device.")
        hands.client.send(Buzz(self.number))


class OCTO_MOTION_OT_device_calibrate(DeviceOperator, bpy.types.Operator):
    bl_idname = "octo_motion.device_calibrate"
    bl_label = "Calibrate Device"
    bl_description = (
        "Learn where the device is at rest and how far it goes: leave it alone for a second, then "
        "move it as far as it goes, each way. It is kept for this device on this computer"
    )

    step: EnumProperty(
        name="Step",
        description="What to do about the device's zero and range",
        items=(
            ("BEGIN", "Begin", "Begin to learn what the device says"),
            ("FINISH", "Done", "Use and keep what was learned"),
            ("CANCEL", "Cancel", "Stop, and go on as before"),
            ("RESET", "Reset", "Forget what was learned: go on as the maker says"),
        ),
        default="BEGIN",
    )

    @classmethod
    def obstacle(cls, context: bpy.types.Context) -> str:
        if isinstance(active_hands(), NdofHands):
            return "Blender has the space mouse: calibrate it with its own driver"
        return super().obstacle(context)

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        hands = active_hands()
        assert isinstance(hands, DeviceHands)
        number = self.number
        if number not in hands.client.devices:
            raise SettingsError(
                phrase("No device has the number {number}.", number=number),
                "Plug it in, or choose another one.",
            )
        if self.step == "RESET":
            hands.reset_calibration(number)
            return
        if self.step != "BEGIN" and number not in hands.client.calibrating:
            raise SettingsError("This device is not being calibrated.", "Click Calibrate first.")
        hands.calibrate(number, Order[self.step])


def unregister() -> None:
    """End the session that is going on, if one is, and draw no more."""
    hands = active_hands()
    if hands is not None:
        hands.stop()
    session = active_session()
    if session is not None:
        with suppress(OctoMotionError):
            session.finish()
    take_down_all()
