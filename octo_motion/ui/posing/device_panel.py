# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Device: what is plugged in, how well it goes, and how strong it is."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ...device.ipc import ClientState
from .device_calibrate import draw_calibration
from .device_ndof import NAME, NdofHands
from .device_pose import Hands, OCTO_MOTION_OT_device_test, OCTO_MOTION_OT_pose_device, active_hands
from .device_settings import device_settings
from .panels import OCTO_MOTION_PT_posing, PosePanel

_LATE: Final = 0.002
"""s: a loop that is off its period by more, in one of a hundred ticks, is felt."""
_SLOW: Final = 0.9
"""Simulated against real time, below which the panel says so."""
_LAGS: Final = 0.05
"""s: a puppet that follows later is felt to lag."""


class OCTO_MOTION_PT_posing_device(PosePanel, bpy.types.Panel):
    bl_idname = "OCTO_MOTION_PT_posing_device"
    bl_label = "Device"
    bl_parent_id = OCTO_MOTION_PT_posing.bl_idname

    def show(self, layout: Any, settings: Any) -> None:  # noqa: ARG002
        assert bpy.context.window_manager is not None
        own = device_settings(bpy.context.window_manager)
        row = layout.row()
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_pose_device.bl_idname, icon="ORIENTATION_GIMBAL")
        hands = active_hands()
        if hands is not None:
            self._devices(layout, hands)
        layout.prop(own, "force")
        layout.prop(own, "toggle")
        layout.prop(own, "speed")
        layout.prop(own, "scale")
        layout.prop(own, "reach")
        row = layout.row()
        row.active = hands is None
        row.prop(own, "simulate")

    @staticmethod
    def _devices(layout: Any, hands: Hands) -> None:
        box = layout.box()
        client = hands.client
        if client.state is ClientState.LOST:
            box.alert = True
            box.label(text="The program has ended", icon="ERROR")
            box.label(text="B over the viewport starts it again")
            return
        if isinstance(hands, NdofHands):
            box.label(text=NAME, icon="ORIENTATION_GIMBAL")
            return
        if client.silent:
            box.alert = True
            box.label(text="The program does not answer", icon="ERROR")
            box.label(text="B over the viewport starts it again")
            return
        if not client.devices:
            box.label(text="No device is plugged in", icon="INFO")
        forces = {each.number: each for each in hands.shown()}
        for number, device in client.devices.items():
            column = box.column(align=True)
            row = column.split(factor=0.7)
            row.label(text=device.name, icon="ORIENTATION_GIMBAL")
            shown = forces.get(number)
            if device.force > 0.0:
                row.operator(OCTO_MOTION_OT_device_test.bl_idname, text="Test").number = number
                share = shown.force if shown else 0.0
                column.progress(factor=share, text=f"{share * device.force:.1f} N")
            else:
                column.label(text="Leads, without force")
            draw_calibration(column, hands, number, device)
        times = client.times
        if times is not None:
            column = box.column(align=True)
            row = column.row()
            row.alert = times.late[1] > _LATE
            row.label(text=f"{times.rate:.0f} Hz, {1e3 * times.late[1]:.2f} ms off at most")
            row = column.row()
            # Before its first step the simulation has no pace.
            row.alert = 0.0 < times.pace < _SLOW
            slow = f", {100.0 * times.pace:.0f} % of real time" if row.alert else ""
            row.label(text=f"A step takes {1e3 * times.step:.1f} ms{slow}")
            if times.lag > 0.0:
                row = column.row()
                row.alert = times.lag > _LAGS
                row.label(text=f"{1e3 * times.lag:.0f} ms from hand to pose")


CLASSES: Final[tuple[type, ...]] = (OCTO_MOTION_PT_posing_device,)
