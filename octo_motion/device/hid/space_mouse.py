# SPDX-License-Identifier: GPL-3.0-or-later
"""Space mice: the 3Dconnexion family, and whatever else says that it is a multi-axis controller.

A device is accepted because it says so (usage page 1, usage 8), not because it stands here; how its
reports are laid out is read from its own report descriptor. The table gives names, and a layout for
systems that do not hand the descriptor over.

Sources: ids from the tables of spacenavd (src/dev.c) and PySpaceMouse (devices.toml), where the
two agree or one alone knows the device; bits of the buttons from PySpaceMouse; the HID usage of a
button is its bit plus one (reports of users of jfedor2/hid-remapper, issue 347). Ranges: ±350 is
what the devices' descriptors state, the very first SpaceNavigators ±500.

The devices' own axes are X right, Y towards the user, Z down, turning by the right-hand rule.
Blender's are X right, Y away from the user, Z up: half a turn about X, so Y and Z change sign, of
pushing and of turning alike. At rest an axis says 0 where its range is signed, and the middle of
its range where it is not, as pads and home-made devices have it: 128 of 0…255.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from ..driver import Axes, Kind, Sample, numbered_buttons, six
from .descriptor import DescriptorError, Field, ReportField, ReportLayout, parse_descriptor
from .system import MULTI_AXIS, Found, Handle, HidDriver, descriptor_of, open_device

LOGITECH: Final = 0x046D
CONNEXION: Final = 0x256F
RANGE: Final = 350
_DESKTOP: Final = 0x01
_BUTTONS: Final = 0x09
_FIRST_AXIS: Final = 0x30
_TO_BLENDER: Final = (1.0, -1.0, -1.0, 1.0, -1.0, -1.0)
_MOST_BUTTONS: Final = 64
_REST: Final[Axes] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_SILENCE: Final = 0.5
"""s: a pushed cap reports every 8 to 16 ms; after so long it is out of reach, not held still."""


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


# --- Their reports, whatever the layout ----------------------------------------------------------


def classic_layout(*, combined: bool) -> ReportLayout:
    """Layout of the 3Dconnexion family, for systems that hand over no descriptor.

    Report 1 pushes and report 2 turns, or report 1 does both; 16 bits an axis. Report 3: buttons.
    """
    axes = [
        Field(
            *(ReportField.INPUT, 1 if combined or axis < 3 else 2, _DESKTOP, _FIRST_AXIS + axis),
            *(16 * (axis if combined else axis % 3), 16, -RANGE, RANGE),
        )
        for axis in range(6)
    ]
    buttons = [Field(ReportField.INPUT, 3, _BUTTONS, bit + 1, bit, 1, 0, 1) for bit in range(32)]
    return ReportLayout((*axes, *buttons), numbered=True)


class MultiAxis:
    """Six axes and buttons, kept up to date by the reports as they come."""

    def __init__(self, layout: ReportLayout) -> None:
        self._numbered = layout.numbered
        self._axes: dict[int, list[tuple[int, Field, int, float]]] = {}
        self._buttons: dict[int, list[tuple[int, Field]]] = {}
        for each in layout.fields:
            if each.way != ReportField.INPUT:
                continue
            if each.page == _DESKTOP and 0 <= each.usage - _FIRST_AXIS < 6:
                axis = each.usage - _FIRST_AXIS
                rest = _rest(each)
                full = max(abs(each.least - rest), abs(each.most - rest))
                if full:
                    scale = _TO_BLENDER[axis] / full
                    self._axes.setdefault(each.report, []).append((axis, each, rest, scale))
            elif each.page == _BUTTONS and 0 < each.usage <= _MOST_BUTTONS:
                self._buttons.setdefault(each.report, []).append((each.usage - 1, each))
        self._push = list(_REST)
        self.buttons = 0
        """Bit i is the button of HID usage i + 1."""

    @property
    def useful(self) -> bool:
        """Whether the layout has any axis at all."""
        return bool(self._axes)

    @property
    def push(self) -> Axes:
        """−1…1 along X, Y, Z and about X, Y, Z, Blender's axes."""
        return six(self._push)

    def feed(self, report: bytes) -> bool:
        """Take one report as the system gives it; whether it was one of ours."""
        if not report:
            return False
        number, payload = (report[0], report[1:]) if self._numbered else (0, report)
        known = False
        for axis, place, rest, scale in self._axes.get(number, ()):
            value = place.value(payload)
            if value is not None:
                self._push[axis] = max(-1.0, min(1.0, (value - rest) * scale))
                known = True
        for bit, place in self._buttons.get(number, ()):
            value = place.value(payload)
            if value is not None:
                self.buttons = self.buttons & ~(1 << bit) | (bool(value) << bit)
                known = True
        return known


def _rest(axis: Field) -> int:
    """What an axis says at rest; of the two middles of an even range the upper one."""
    return 0 if axis.least < 0 else (axis.least + axis.most + 1) // 2


# --- The driver ----------------------------------------------------------------------------------


class SpaceMouse(HidDriver):
    """One space mouse: push the cap, and the pointer moves."""

    name = "space mouse"

    def __init__(self, found: Found, handle: Handle, layout: ReportLayout) -> None:
        model = model_of(found.vendor, found.product)
        names = model.buttons if model else {}
        numbered = numbered_buttons(max(names, default=1) + 1)
        buttons = tuple(names.get(bit, name) for bit, name in enumerate(numbered))
        super().__init__(found, handle, Kind.RATE, buttons, name=model.name if model else "")
        self._axes = MultiAxis(layout)
        self._last_report = 0.0

    @classmethod
    def drives(cls, found: Found) -> bool:
        """Whether an interface says that it is a multi-axis controller.

        Where the system gives no usage (usage page 0), the table of products decides.
        """
        if found.page == 0:
            return model_of(found.vendor, found.product) is not None
        return (found.page, found.usage) == MULTI_AXIS

    @classmethod
    def open(cls, found: Found) -> SpaceMouse:
        """Open a device that was found.

        Raises:
            DeviceError: the system does not let us.
        """
        handle = open_device(found)
        layout = None
        descriptor = descriptor_of(handle)
        if descriptor:
            with suppress(DescriptorError):  # as if the system had given none
                layout = parse_descriptor(descriptor)
        if layout is None or not MultiAxis(layout).useful:
            model = model_of(found.vendor, found.product)
            layout = classic_layout(combined=bool(model and model.combined))
        return cls(found, handle, layout)

    def read(self) -> Sample | None:
        """The newest state, all waiting reports taken in."""
        reports = self.reports()
        now = time.perf_counter()
        known = [self._axes.feed(report) for report in reports]
        if any(known):
            self._last_report = now
        # At rest a device is silent; a push that nobody repeats is one that got lost.
        silent = now - self._last_report > _SILENCE
        push = None if silent else self._axes.push
        return Sample(now, buttons=self._axes.buttons, push=push)
