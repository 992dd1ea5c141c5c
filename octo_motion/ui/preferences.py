# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: what creatures and splices begin with, and devices at this computer."""

from __future__ import annotations

from typing import Any, Final, cast

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from .manual import OCTO_MOTION_OT_manual

_PACKAGE: Final = __name__.rpartition(".ui.")[0]


class OCTO_MOTION_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = _PACKAGE

    size: FloatProperty(
        name="Octopus Size",
        description="Arm length of an octopus that is added by a click",
        subtype="DISTANCE",
        default=1.0,
        min=0.01,
        soft_max=10.0,
    )
    keys: EnumProperty(
        name="Keys",
        description="How many keys the motion of a new creature gets",
        items=(
            ("DENSE", "All", "A key on every frame"),
            ("REDUCED", "Few", "As few keys as the tolerance allows"),
        ),
    )
    layer: EnumProperty(
        name="Splices",
        description="What the first splice of an armature is built into",
        items=(
            ("ACTION", "New Action", "One action with all of the motion"),
            ("LAYER", "NLA Layer", "What is spliced alone, on an NLA track over the base"),
        ),
    )
    fade_unit: EnumProperty(
        name="Fades",
        description="What the fades of a new splice are given in",
        items=(
            ("FRAMES", "Frames", "Frames of the base"),
            ("SECONDS", "Seconds", "Seconds, whatever the frame rate is"),
        ),
    )
    port: IntProperty(
        name="Device Port",
        description="UDP port of this computer at which a program may be the device, from the "
        "start of Blender on; 0 for none",
        default=0,
        min=0,
        max=0xFFFF,
        update=lambda self, _context: _hand_on(self),
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = cast("Any", self).layout
        layout.use_property_split = True
        column = layout.column(heading="New")
        column.prop(self, "size")
        for name in ("keys", "layer", "fade_unit"):
            column.row().prop(self, name, expand=True)
        layout.prop(self, "port")
        if context.preferences is not None:
            # Blender's own switch: what it says of reports is true of ours.
            view = context.preferences.view
            column = layout.column(heading="Messages")
            column.prop(view, "use_translate_reports", text="In Blender's Language")
        layout.operator(OCTO_MOTION_OT_manual.bl_idname, icon="HELP", text="Open the Manual")


def preferences() -> Any:
    """The preferences, none where the add-on was not switched on as one, or nobody sees them.

    What runs without a window is the same at every computer.
    """
    if bpy.app.background or bpy.context.preferences is None:
        return None
    addon = bpy.context.preferences.addons.get(_PACKAGE)
    return addon.preferences if addon is not None else None


def preferred_size() -> float:
    """Metres of an arm of an octopus that is added by a click."""
    own = preferences()
    return own.size if own is not None else 1.0


def begin_as_preferred(settings: Any, names: dict[str, str]) -> None:
    """Let settings that nobody has set be as the preferences say.

    Args:
        settings: a group of properties.
        names: of its properties, and those of the preferences.
    """
    own = preferences()
    for name, preferred in names.items() if own is not None else ():
        if not settings.is_property_set(name):
            setattr(settings, name, getattr(own, preferred))


def _hand_on(own: Any) -> None:
    """Let devices of this session be as the preferences say."""
    manager: Any = bpy.context.window_manager
    if manager is not None and hasattr(manager, "octo_motion_device"):
        manager.octo_motion_device.port = own.port


def hand_on_devices() -> None:
    """Let devices begin as the preferences say."""
    own = preferences()
    if own is not None and own.port:
        _hand_on(own)
