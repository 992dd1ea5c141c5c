# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3Dconnexion family: USB ids, ranges, and names of the buttons.

A device is accepted because it says that it is a multi-axis controller (usage page 1, usage 8),
not because it stands here; how its reports are laid out is read from its own report descriptor.
The table gives names, and a layout for systems that do not hand the descriptor over.

Sources: ids from the tables of spacenavd (src/dev.c) and PySpaceMouse (devices.toml), where the
two agree or one alone knows the device; bits of the buttons from PySpaceMouse; the HID usage of a
button is its bit plus one (reports of users of jfedor2/hid-remapper, issue 347). Ranges: ±350 is
what the devices' descriptors state, the very first SpaceNavigators ±500.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

LOGITECH: Final = 0x046D
CONNEXION: Final = 0x256F
USAGE_PAGE: Final = 0x01
"""Generic desktop."""
USAGE: Final = 0x08
"""Multi-axis controller."""
RANGE: Final = 350


@dataclass(frozen=True)
class DeviceModel:
    """What one product is called, and what stands on its buttons."""

    vendor: int
    product: int
    name: str
    combined: bool = False
    """True where report 1 holds all six axes, False where report 2 holds the turning."""
    buttons: dict[int, str] = field(default_factory=dict[int, str])
    """By bit of report 3."""


def _bits(names: str) -> dict[int, str]:
    """Names in the order of their bits, commas between them; nothing where none is known."""
    return {bit: name for bit, name in enumerate(names.split(",")) if name}


_TWO: Final = _bits("Left,Right")
_PRO: Final = _bits(
    "Menu,Fit,Top,,Right,Front,,,Roll,,,,1,2,3,4,,,,,,,Esc,Alt,Shift,Ctrl,Lock rotation"
)
_ENTERPRISE: Final = _bits(
    "Menu,Fit,Top,,Right,Front,,,Roll,,Iso,,1,2,3,4,5,6,7,8,9,10,Esc,Alt,Shift,Ctrl,Lock rotation"
)
_PILOT_PRO: Final = _bits(
    "Menu,Fit,Top,,Right,Front,,,Roll,,Iso,,,,,,,,,,,,Esc,Alt,Shift,Ctrl,Lock rotation,"
    "Lock pan and zoom,Dominant,Plus,Minus"
)
_EXPLORER: Final = _bits("1,2,Top,Left,Right,Front,Esc,Alt,Shift,Ctrl,Fit,Panel,Plus,Minus,2D")
_PILOT: Final = _bits(
    "1,2,3,4,5,6,Top,Left,Right,Front,Esc,Alt,Shift,Ctrl,Fit,Panel,Minus,Plus,Dominant,"
    "Lock 3D,Config"
)

MODELS: Final = (
    DeviceModel(LOGITECH, 0xC603, "SpaceMouse Plus XT"),
    DeviceModel(LOGITECH, 0xC605, "CadMan"),
    DeviceModel(LOGITECH, 0xC606, "SpaceMouse Classic"),
    DeviceModel(LOGITECH, 0xC621, "SpaceBall 5000"),
    DeviceModel(LOGITECH, 0xC623, "SpaceTraveler"),
    DeviceModel(LOGITECH, 0xC625, "SpacePilot", buttons=_PILOT),
    DeviceModel(LOGITECH, 0xC626, "SpaceNavigator", buttons=_TWO),
    DeviceModel(LOGITECH, 0xC627, "SpaceExplorer", buttons=_EXPLORER),
    DeviceModel(LOGITECH, 0xC628, "SpaceNavigator for Notebooks", buttons=_TWO),
    DeviceModel(LOGITECH, 0xC629, "SpacePilot Pro", buttons=_PILOT_PRO),
    DeviceModel(LOGITECH, 0xC62B, "SpaceMouse Pro", buttons=_PRO),
    DeviceModel(CONNEXION, 0xC62E, "SpaceMouse Wireless", combined=True, buttons=_TWO),
    DeviceModel(CONNEXION, 0xC62F, "SpaceMouse Wireless Receiver", combined=True, buttons=_TWO),
    DeviceModel(CONNEXION, 0xC631, "SpaceMouse Pro Wireless", combined=True, buttons=_PRO),
    DeviceModel(CONNEXION, 0xC632, "SpaceMouse Pro Wireless Receiver", combined=True, buttons=_PRO),
    DeviceModel(CONNEXION, 0xC633, "SpaceMouse Enterprise", combined=True, buttons=_ENTERPRISE),
    DeviceModel(CONNEXION, 0xC635, "SpaceMouse Compact", buttons=_TWO),
    DeviceModel(CONNEXION, 0xC636, "SpaceMouse Module"),
    DeviceModel(
        CONNEXION, 0xC638, "SpaceMouse Pro Wireless Bluetooth", combined=True, buttons=_PRO
    ),
    DeviceModel(CONNEXION, 0xC63A, "SpaceMouse Wireless Bluetooth", combined=True, buttons=_TWO),
    DeviceModel(CONNEXION, 0xC641, "SpaceMouse USB"),
    DeviceModel(CONNEXION, 0xC652, "Universal Receiver", combined=True, buttons=_PRO),
)

_BY_ID: Final = {(model.vendor, model.product): model for model in MODELS}


def model_of(vendor: int, product: int) -> DeviceModel | None:
    """What is known of a product."""
    return _BY_ID.get((vendor, product))
