# SPDX-License-Identifier: GPL-3.0-or-later
"""Every kind of HID device that there is a driver for: a new kind is one more row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from ..driver import Driver
from .force_device import ForceDevice, is_force_device
from .space_mouse import SpaceMouse, is_space_mouse
from .system import Found


@dataclass(frozen=True)
class HidDriver:
    """A kind of device, and its driver."""

    name: str
    """As ``python -m octo_motion.device list`` calls the kind."""
    drives: Callable[[Found], bool]
    """Whether an interface that the system lists is such a device."""
    open: Callable[[Found], Driver]
    """Opens it; raises ``DeviceError`` where the system does not let us."""


HID_DRIVERS: Final = (
    HidDriver("force device", is_force_device, ForceDevice.open),
    HidDriver("space mouse", is_space_mouse, SpaceMouse.open),
)


def hid_driver_for(found: Found) -> HidDriver | None:
    """The first kind that an interface belongs to; None where we have no driver for it."""
    return next((each for each in HID_DRIVERS if each.drives(found)), None)
