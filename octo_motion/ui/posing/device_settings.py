# SPDX-License-Identifier: GPL-3.0-or-later
"""``WindowManager.octo_motion_device``: how devices behave at this computer, for this session."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, Final, cast

import bpy
from bpy.app.handlers import persistent
from bpy.props import BoolProperty, FloatProperty, IntProperty, PointerProperty

from ...blender.files import own_folder
from ...device.messages import Settings

_Factor: Final = partial(FloatProperty, subtype="FACTOR", options={"SKIP_SAVE"})
_Flag: Final = partial(BoolProperty, options={"SKIP_SAVE"})


class OCTO_MOTION_PG_device(bpy.types.PropertyGroup):
    """Settings of devices: they belong to the hand and the desk, not to a file."""

    force: _Factor(
        name="Force",
        description="How much of its force a device may give. 0 for a device that only leads",
        default=1.0,
        min=0.0,
        max=1.0,
    )
    toggle: _Flag(
        name="Press to Grab",
        description="One press of the first button grabs and another lets go; else hold the button",
    )
    reach: _Factor(
        name="Reach",
        description="How near to a limb the pointer must be to grab it, of the figure's size",
        default=0.1,
        min=0.01,
        max=1.0,
    )
    speed: _Factor(
        name="Speed",
        description="How fast a space mouse moves its pointer",
        default=1.0,
        min=0.05,
        max=10.0,
        soft_max=3.0,
    )
    scale: _Factor(
        name="Scale",
        description="How far the pointer of a force device goes in the view for the way of the "
        "hand. Zooming in makes it finer as well",
        default=1.0,
        min=0.05,
        max=20.0,
        soft_max=4.0,
    )
    simulate: _Flag(
        name="Simulated Hand",
        description="Add a hand that moves by itself, to see what a force device would do",
    )
    port: IntProperty(
        name="Program's Port",
        description="UDP port of this computer at which a program may be the device, such as one "
        "that reads a force device with its maker's library. 0 for none. It must know the key in "
        "the file that the panel names",
        default=0,
        min=0,
        max=0xFFFF,
        options={"SKIP_SAVE"},
    )


def device_settings(window_manager: bpy.types.WindowManager) -> Any:
    """The settings."""
    return cast("Any", window_manager).octo_motion_device


def key_file(*, create: bool = False) -> Path:
    """The file with the key of programs that are devices; made by the process that needs it.

    Raises:
        WriteError: its folder is to be made and cannot be.
    """
    return own_folder(create=create) / "device_key"


def bridge_arguments(settings: Any) -> list[str]:
    """What the bridge is started with."""
    simulated = ["--simulate"] * settings.simulate
    if not settings.port:
        return simulated
    return [
        *(*simulated, "--udp", str(settings.port)),
        *("--key-file", str(key_file(create=True))),
    ]


def message(settings: Any, size: float) -> Settings:
    """What the bridge hears of them, for a figure of a size in puppet metres."""
    defaults = Settings()
    return Settings(
        force=settings.force,
        toggle=settings.toggle,
        reach=settings.reach * size,
        speed=defaults.speed * settings.speed,
        angular_speed=defaults.angular_speed * settings.speed,
    )


_kept: Final[dict[str, Any]] = {}
"""What holds while another file is opened: Blender then begins with settings as made."""


def _current() -> Any:
    """The settings of now, and none where there is no window manager."""
    manager = bpy.context.window_manager
    return None if manager is None else device_settings(manager)


@persistent
def _before_loading(*_: object) -> None:
    settings = _current()
    for name in OCTO_MOTION_PG_device.__annotations__ if settings else ():
        _kept[name] = getattr(settings, name)


@persistent
def _after_loading(*_: object) -> None:
    settings = _current()
    for name, value in _kept.items() if settings else ():
        setattr(settings, name, value)


def _handlers() -> tuple[tuple[list[Any], Any], ...]:
    known: Any = bpy.app.handlers
    return ((known.load_pre, _before_loading), (known.load_post, _after_loading))


def register() -> None:
    """Give the window manager its settings."""
    bpy.types.WindowManager.octo_motion_device = PointerProperty(  # type: ignore[attr-defined]
        name="Octo Motion Device",
        description="How devices behave at this computer",
        type=OCTO_MOTION_PG_device,
    )
    for known, handler in _handlers():
        known.append(handler)


def unregister() -> None:
    """Take them away."""
    for known, handler in _handlers():
        if handler in known:
            known.remove(handler)
    _kept.clear()
    del bpy.types.WindowManager.octo_motion_device  # type: ignore[attr-defined]
