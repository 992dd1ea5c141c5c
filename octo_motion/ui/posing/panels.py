# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Pose: the material, the world, the keys."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ...core.phrases import phrase
from ...device.calibration import Phase, reached
from ...device.driver import Kind
from ...device.hid import why_not_read
from ...device.messages import DeviceMessage
from ..floor import draw_floor
from ..language import translated
from ..operator_base import window_manager
from ..panel_base import ArmaturePanel, draw_sentence
from .device_hands import NDOF_NAME, DeviceHands, NdofHands
from .device_pose import (
    Hands,
    OCTO_MOTION_OT_device_calibrate,
    OCTO_MOTION_OT_device_test,
    OCTO_MOTION_OT_pose_device,
    active_hands,
)
from .device_settings import device_settings, key_file
from .operators import (
    OCTO_MOTION_OT_pose_asset,
    OCTO_MOTION_OT_pose_coefficients,
    OCTO_MOTION_OT_pose_forget_measured,
    OCTO_MOTION_OT_pose_loose,
    OCTO_MOTION_OT_pose_mark_bones,
    OCTO_MOTION_OT_pose_measure,
    OCTO_MOTION_OT_pose_obstacle,
)
from .pose_operator import OCTO_MOTION_OT_pose_start
from .properties import STANDS, posing_settings
from .puppet_session import active_session
from .script_player import OCTO_MOTION_OT_pose_script
from .session_settings import CUSTOM


class PosePanel(ArmaturePanel):
    """A panel of the armature's posing."""

    bl_options = {"DEFAULT_CLOSED"}

    settings_of = staticmethod(posing_settings)


class OCTO_MOTION_PT_posing(PosePanel, bpy.types.Panel):
    bl_label = "Pose"
    bl_order = 1
    bl_options = set()
    tool = "POSE"

    def show(self, layout: Any, settings: Any) -> None:
        row = layout.row()
        row.scale_y = 1.5
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_pose_start.bl_idname, icon="VIEW_PAN")
        layout.prop(settings, "material")
        if settings.material == CUSTOM:
            column = layout.column(align=True)
            column.prop(settings, "custom_yields")
            giving = column.column(align=True)
            giving.active = settings.custom_yields
            giving.prop(settings, "custom_bears")
            giving.prop(settings, "custom_gives")
            column.prop(settings, "custom_springs")
            column.prop(settings, "custom_settles")
        layout.prop(settings, "strength")
        layout.prop(settings, "root")
        if active_session() is not None:
            layout.label(text="Enter keeps, Esc takes back", icon="INFO")


class OCTO_MOTION_PT_posing_world(PosePanel, bpy.types.Panel):
    bl_label = "World"
    bl_parent_id = "OCTO_MOTION_PT_posing"

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "gravity")
        draw_floor(layout, settings)
        layout.prop(settings, "use_obstacles")
        layout.prop(settings, "self_collision")
        layout.prop(settings, "friction")
        item: Any = bpy.context.object
        if item is not None and item.type != "ARMATURE":
            own = item.octo_motion.posing
            layout.prop(own, "obstacle")
            if own.obstacle != "NONE":
                layout.prop(own, "moves")
                if own.moves != STANDS:
                    layout.prop(own, "mass")
        layout.operator_menu_enum(
            OCTO_MOTION_OT_pose_obstacle.bl_idname, "kind", text="Mark Selected As"
        )
        layout.operator_menu_enum(OCTO_MOTION_OT_pose_loose.bl_idname, "moves", text="Selected")


class OCTO_MOTION_PT_posing_aids(PosePanel, bpy.types.Panel):
    bl_label = "Aids"
    bl_parent_id = "OCTO_MOTION_PT_posing"

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "mirror")
        layout.prop(settings, "balance")
        if settings.balance == "KEPT" and settings.root != "FREE":
            layout.label(text="Root is not Free", icon="INFO")
        layout.prop(settings, "trails")
        layout.prop(settings, "onion")
        step = layout.row()
        step.active = settings.onion > 0
        step.prop(settings, "onion_step")


class OCTO_MOTION_PT_posing_bones(PosePanel, bpy.types.Panel):
    bl_label = "Limbs"
    bl_parent_id = "OCTO_MOTION_PT_posing"

    def show(self, layout: Any, settings: Any) -> None:
        row = layout.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_pose_measure.bl_idname, icon="DRIVER_ROTATIONAL_DIFFERENCE")
        row.operator(OCTO_MOTION_OT_pose_forget_measured.bl_idname, text="", icon="X")
        column = layout.column()
        column.operator_context = "INVOKE_DEFAULT"
        column.operator(OCTO_MOTION_OT_pose_coefficients.bl_idname, icon="PREFERENCES")
        layout.prop(settings, "smallest")
        layout.prop(settings, "show_loads")
        layout.operator_menu_enum(
            OCTO_MOTION_OT_pose_mark_bones.bl_idname, "mark", text="Mark Selected Bones"
        )


class OCTO_MOTION_PT_posing_keys(PosePanel, bpy.types.Panel):
    bl_label = "Keys"
    bl_parent_id = "OCTO_MOTION_PT_posing"

    def show(self, layout: Any, settings: Any) -> None:
        layout.prop(settings, "keys_to")
        if settings.keys_to == "CHOSEN":
            row = layout.row()
            row.alert = settings.action is None
            row.prop(settings, "action")
        layout.prop(settings, "key_blend")
        layout.prop(settings, "record_angle")
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator(OCTO_MOTION_OT_pose_asset.bl_idname, icon="ASSET_MANAGER")
        layout.operator(OCTO_MOTION_OT_pose_script.bl_idname, icon="FILE_SCRIPT")


# --- The panel Device: what is plugged in, how well it goes, and how strong it is -----------------


_LATE: Final = 0.002
"""s: a loop that is off its period by more, in one of a hundred ticks, is felt."""
_SLOW: Final = 0.9
"""Simulated against real time, below which the panel says so."""
_LAGS: Final = 0.05
"""s: a puppet that follows later is felt to lag."""


class OCTO_MOTION_PT_posing_device(PosePanel, bpy.types.Panel):
    bl_label = "Device"
    bl_parent_id = "OCTO_MOTION_PT_posing"

    def show(self, layout: Any, settings: Any) -> None:  # noqa: ARG002
        own = device_settings(window_manager(bpy.context))
        row = layout.row()
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(OCTO_MOTION_OT_pose_device.bl_idname, icon="ORIENTATION_GIMBAL")
        hands = active_hands()
        if hands is not None:
            self._devices(layout, hands)
        if why := why_not_read():
            draw_sentence(layout, bpy.context, translated(why), "INFO")
        for name in ("force", "toggle", "speed", "scale", "reach"):
            layout.prop(own, name)
        column = layout.column()
        column.active = hands is None
        column.prop(own, "simulate")
        column.prop(own, "port")
        if own.port:
            column.label(text=str(key_file()), icon="LOCKED", translate=False)

    @staticmethod
    def _devices(layout: Any, hands: Hands) -> None:
        box = layout.box()
        client = hands.client
        if isinstance(hands, NdofHands):
            box.label(text=NDOF_NAME, icon="ORIENTATION_GIMBAL")
            return
        if trouble := hands.trouble():
            box.alert = True
            box.label(
                text=translated(phrase("The program {trouble}", trouble=trouble)), icon="ERROR"
            )
            box.label(text="B over the viewport starts it again")
            return
        if not client.devices:
            box.label(text="No device is plugged in", icon="INFO")
        forces = {each.number: each for each in hands.shown()}
        for number, device in client.devices.items():
            column = box.column(align=True)
            row = column.split(factor=0.7)
            row.label(text=device.name, icon="ORIENTATION_GIMBAL", translate=False)
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
            row.label(
                text=translated(
                    phrase(
                        "{rate:.0f} Hz, {late:.2f} ms off at most",
                        rate=times.rate,
                        late=1e3 * times.late[1],
                    )
                )
            )
            row = column.row()
            # Before its first step the simulation has no pace.
            row.alert = 0.0 < times.pace < _SLOW
            slow = (
                phrase(", {pace:.0f} % of real time", pace=100.0 * times.pace) if row.alert else ""
            )
            row.label(
                text=translated(
                    phrase("A step takes {step:.1f} ms{slow}", step=1e3 * times.step, slow=slow)
                )
            )
            if times.lag > 0.0:
                row = column.row()
                row.alert = times.lag > _LAGS
                row.label(
                    text=translated(phrase("{lag:.0f} ms from hand to pose", lag=1e3 * times.lag))
                )


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
        way = phrase("Push and turn") if device.kind == Kind.RATE else phrase("Move")
        column.label(
            text=translated(phrase("{way} it as far as it goes, each way", way=way)),
            icon="ORIENTATION_GIMBAL",
        )
        column.progress(
            factor=there / ends,
            text=translated(phrase("{there} of {ends}", there=there, ends=ends)),
        )
    row = column.row(align=True)
    done = row.row(align=True)
    done.enabled = learning.phase == Phase.REACH
    button(done, "FINISH", text="Done")
    button(row, "CANCEL", text="Cancel")


CLASSES: Final[tuple[type, ...]] = (
    OCTO_MOTION_PT_posing,
    OCTO_MOTION_PT_posing_world,
    OCTO_MOTION_PT_posing_aids,
    OCTO_MOTION_PT_posing_bones,
    OCTO_MOTION_PT_posing_keys,
    OCTO_MOTION_PT_posing_device,
)
