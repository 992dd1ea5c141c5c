# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibrating a device: a button to begin, what to do meanwhile, and buttons to end."""

from __future__ import annotations

from typing import Any, Final

import bpy
from bpy.props import EnumProperty, IntProperty

from ...core.errors import SettingsError
from ...device.calibration import Phase, reached
from ...device.driver import Kind
from ...device.messages import DeviceMessage
from ..operator_base import OctoOperator
from .device_hands import DeviceHands
from .device_ndof import NdofHands
from .device_pose import active_hands


class OCTO_MOTION_OT_device_calibrate(OctoOperator, bpy.types.Operator):
    bl_idname = "octo_motion.device_calibrate"
    bl_label = "Calibrate Device"
    bl_description = (
        "Learn where the device is at rest and how far it goes: leave it alone for a second, then "
        "move it as far as it goes, each way. It is kept for this device on this computer"
    )
    bl_options = {"INTERNAL"}  # nothing in the file changes

    number: IntProperty(
        name="Device", description="Which one, counted from 0", default=0, min=0, max=7
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
    def poll(cls, context: bpy.types.Context) -> bool:  # noqa: ARG003
        hands = active_hands()
        if hands is None:
            cls.poll_message_set("Start Pose with Device first")
            return False
        if isinstance(hands, NdofHands):
            cls.poll_message_set("Blender has the space mouse: calibrate it with its own driver")
            return False
        return True

    def run(self, context: bpy.types.Context) -> None:  # noqa: ARG002
        hands = active_hands()
        assert isinstance(hands, DeviceHands)
        number = self.number
        if number not in hands.client.devices:
            raise SettingsError(
                f"No device has the number {number}.", "Plug it in, or choose another one."
            )
        match self.step:
            case "BEGIN":
                hands.begin_calibration(number)
            case "RESET":
                hands.reset_calibration(number)
            case _:
                if number not in hands.client.calibrating:
                    raise SettingsError(
                        "This device is not being calibrated.", "Click Calibrate first."
                    )
                hands.end_calibration(number, keep=self.step == "FINISH")


def draw_calibration(layout: Any, hands: DeviceHands, number: int, device: DeviceMessage) -> None:
    """The part of a device's box that calibrates it."""
    name = OCTO_MOTION_OT_device_calibrate.bl_idname

    def button(row: Any, step: str, **shown: Any) -> None:
        operator = row.operator(name, **shown)
        operator.number, operator.step = number, step

    learning = hands.client.calibrating.get(number)
    if learning is None:
        row = layout.row(align=True)
        button(row, "BEGIN", text="Calibrate")
        if device.identity in hands.calibrations.learned:
            button(row, "RESET", text="", icon="LOOP_BACK")
        return
    column = layout.column(align=True)
    if learning.phase == Phase.REST:
        column.label(text="Take your hand off it …", icon="TIME")
    else:
        there, ends = reached(learning.calibration(), Kind(device.kind))
        way = "Push and turn" if device.kind == Kind.RATE else "Move"
        column.label(text=f"{way} it as far as it goes, each way", icon="ORIENTATION_GIMBAL")
        column.progress(factor=there / ends, text=f"{there} of {ends}")
    row = column.row(align=True)
    done = row.row(align=True)
    done.enabled = learning.phase == Phase.REACH
    button(done, "FINISH", text="Done")
    button(row, "CANCEL", text="Cancel")


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_OT_device_calibrate,)
