# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports of a multi-axis controller, whatever their layout: six axes and buttons.

The devices' own axes are X right, Y towards the user, Z down, turning by the right-hand rule.
Blender's are X right, Y away from the user, Z up: half a turn about X, so Y and Z change sign, of
pushing and of turning alike.

At rest an axis says 0 where its range is signed, and the middle of its range where it is not, as
pads and home-made devices have it: 128 of 0…255.
"""

from __future__ import annotations

from typing import Final

from ..driver import Axes
from .descriptor import Field, ReportField, ReportLayout
from .models import RANGE

_DESKTOP: Final = 0x01
_BUTTONS: Final = 0x09
_FIRST_AXIS: Final = 0x30
_TO_BLENDER: Final = (1.0, -1.0, -1.0, 1.0, -1.0, -1.0)
_MOST_BUTTONS: Final = 64
_REST: Final[Axes] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def classic_layout(*, combined: bool) -> ReportLayout:
    """Layout of the 3Dconnexion family, for systems that do not tell a device's descriptor.

    Report 1 pushes and report 2 turns, or report 1 does both; 16 bits an axis. Report 3: buttons.
    """
    axes = [
        Field(
            *(ReportField.INPUT, 1 if combined or axis < 3 else 2, _DESKTOP, _FIRST_AXIS + axis),
            *(16 * (axis if combined else axis % 3), 16, -RANGE, RANGE, True),
        )
        for axis in range(6)
    ]
    buttons = [
        Field(ReportField.INPUT, 3, _BUTTONS, bit + 1, bit, 1, 0, 1, relative=False)
        for bit in range(32)
    ]
    return ReportLayout(((1, 8),), (*axes, *buttons), numbered=True)


class MultiAxis:
    """Six axes and buttons, kept up to date by the reports as they come."""

    def __init__(self, layout: ReportLayout) -> None:
        self._numbered = layout.numbered
        self._axes: dict[int, list[tuple[int, Field, int, float]]] = {}
        self._buttons: dict[int, list[tuple[int, Field]]] = {}
        for each in layout.of(ReportField.INPUT):
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
        a, b, c, d, e, f = self._push
        return (a, b, c, d, e, f)

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
