# SPDX-License-Identifier: GPL-3.0-or-later
"""The open HID profile of force devices: three reports of fixed layout, and their driver.

Written so that a microcontroller without floating point can speak it: integers alone, little
endian, each report within one packet of full-speed USB. docs/device.md describes it to makers.

One table of fields makes descriptor, packer and parser, so that they cannot differ. What firmware
does, writing states and reading commands, is in tests/device/firmware.py.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from typing import Final

from ...core.errors import DeviceError
from ...core.phrases import phrase
from ...core.rotations.scalars import ZERO, Vector, normalized
from ..driver import (
    DeviceLostError,
    Dynamics,
    Kind,
    Sample,
    SentTimes,
    is_possible,
    numbered_buttons,
)
from .descriptor import item
from .system import Found, Handle, HidDriver, claim, open_device

VERSION: Final = 1
USAGE_PAGE: Final = 0xFF4F
"""Vendor-defined."""
USAGE: Final = 0x01
STATE, COMMAND, FEATURES = 1, 2, 3
"""Numbers of the input, output and feature report."""

WATCHDOG_MILLISECONDS: Final = 20

POSITION: Final = 1e-7
ORIENTATION: Final = 2.0**-30
VELOCITY: Final = 1e-4
ANGULAR_VELOCITY: Final = 1e-3
FORCE: Final = 1e-3
TORQUE: Final = 1e-4
"""m, 1, m/s, rad/s, N, N·m: one step of the numbers in states and commands."""
DYNAMICS: Final = (FORCE, TORQUE, 1e-3, 1e-6, 1e-3, 1e-6, POSITION, 1e-6, 1e-6)
"""One step of the numbers in the feature report, in the order of ``Dynamics``."""


@dataclass(frozen=True)
class Item:
    """One run of equal numbers in a report."""

    name: str
    code: str
    """As in ``struct``: B, H, I unsigned, h, i signed."""
    count: int
    unit: str
    """What one step of the number is, for the documentation."""


REPORTS: Final[dict[int, tuple[str, tuple[Item, ...]]]] = {
    STATE: (
        "input",
        (
            Item("sequence", "H", 1, "counts up by 1 with each report"),
            Item(
                "clock",
                "I",
                1,
                "µs of the device's own clock when the pose was measured, round at 2³¹",
            ),
            Item("answered", "H", 1, "sequence of the newest command that came"),
            Item("buttons", "H", 1, "bit i is button i"),
            Item("flags", "H", 1, "bit 0: a hand holds the device; bit 1: motors have power"),
            Item("position", "i", 3, "0.1 µm from the middle of the workspace"),
            Item("orientation", "i", 4, "2⁻³⁰, unit quaternion w, x, y, z"),
            Item("velocity", "h", 3, "0.1 mm/s"),
            Item("angular velocity", "h", 3, "0.001 rad/s, about the room's axes"),
        ),
    ),
    COMMAND: (
        "output",
        (
            Item("sequence", "H", 1, "counts up by 1 with each report"),
            Item("watchdog", "B", 1, "ms; without a newer command for so long: no force"),
            Item("flags", "B", 1, "bit 0: give force; 0 lets go at once"),
            Item("force", "h", 3, "mN on the hand, at the point whose position is reported"),
            Item("torque", "h", 3, "0.1 mN·m on the hand"),
        ),
    ),
    FEATURES: (
        "feature",
        (
            Item("version", "B", 1, "of this profile: 1"),
            Item("buttons", "B", 1, "how many, at most 16"),
            Item("force", "H", 1, "mN, the most in any direction, for a minute"),
            Item("torque", "H", 1, "0.1 mN·m, likewise; 0 without torque"),
            Item("damping", "H", 1, "mN·s/m of the mechanics alone"),
            Item("angular damping", "H", 1, "µN·m·s/rad of the mechanics alone"),
            Item("friction", "H", 1, "mN, dry friction; 0: unknown"),
            Item("angular friction", "H", 1, "µN·m, dry friction; 0: unknown"),
            Item("resolution", "H", 1, "0.1 µm, one step of the position; 0: unknown"),
            Item("angular resolution", "H", 1, "µrad, one step of the orientation; 0: unknown"),
            Item("delay", "H", 1, "µs from measuring a pose to feeling the force that answers it"),
        ),
    ),
}

_ROUND: Final = 2.0**31 * 1e-6
"""s after which the clock of states goes round."""
_LIMITS: Final = {
    "B": (0, 0xFF),
    "H": (0, 0xFFFF),
    "I": (0, 0x7FFFFFFF),
    "h": (-0x7FFF, 0x7FFF),
    "i": (-0x7FFFFFFF, 0x7FFFFFFF),
}
LAYOUTS: Final = {
    number: struct.Struct("<B" + "".join(f"{each.count}{each.code}" for each in items))
    for number, (_way, items) in REPORTS.items()
}
SIZES: Final = {number: each.size for number, each in LAYOUTS.items()}
"""Bytes of each report, its number included."""


class ReportError(ValueError):
    """The bytes are no report of the profile, or not a possible one."""


@dataclass(frozen=True)
class ForceFeatures:
    """Feature report: what the device can do."""

    buttons: int
    dynamics: Dynamics


def report_descriptor() -> bytes:
    """The report descriptor that a device of this profile has, to be burnt into it as it is."""
    parts = [item("usage_page", USAGE_PAGE), item("usage", USAGE), item("collection", 1)]
    usage = 1
    for number, (way, items) in REPORTS.items():
        parts.append(item("report_id", number))
        for each in items:
            usage += 1
            least, most = _LIMITS[each.code]
            parts += [
                item("usage", usage),
                item("logical_minimum", least),
                item("logical_maximum", most),
                item("report_size", 8 * struct.calcsize(each.code)),
                item("report_count", each.count),
                item(way, 2),  # data, variable, absolute
            ]
    parts.append(item("end_collection"))
    return b"".join(parts)


def unpack(number: int, report: bytes) -> tuple[int, ...]:
    """The numbers of a report, without its own.

    Raises:
        ReportError: another report, or too short.
    """
    layout = LAYOUTS[number]
    # Windows hands over every report with the length of the longest.
    if len(report) < layout.size or report[0] != number:
        raise ReportError(f"no report {number} of {layout.size} bytes")
    return layout.unpack_from(report)[1:]


def parse_state(report: bytes, time: float) -> Sample:
    """Read an input report, its number included, that came at a time.

    Raises:
        ReportError: another report, too short, or a pose that cannot be.
    """
    _sequence, clock, _answered, buttons, flags, *rest = unpack(STATE, report)
    w, x, y, z = rest[3:7]
    size = (w * w + x * x + y * y + z * z) * ORIENTATION**2
    orientation = normalized((float(w), float(x), float(y), float(z)))
    if orientation is None or not 0.9 < size < 1.1:
        raise ReportError("the orientation is no unit quaternion")
    sample = Sample(
        time=time,
        position=scaled(rest[0:3], POSITION),
        orientation=orientation,
        velocity=scaled(rest[7:10], VELOCITY),
        angular_velocity=scaled(rest[10:13], ANGULAR_VELOCITY),
        buttons=buttons,
        # Without power on its motors it gets no force, lest all come with the power.
        held=flags & 3 == 3,
        clock=1e-6 * clock,
    )
    if not is_possible(sample):
        raise ReportError("the hand is too far away")
    return sample


def pack_command(sequence: int, force: Vector, torque: Vector) -> bytes:
    """Write an output report, its numbers as ``in_steps`` has them."""
    enabled = force != ZERO or torque != ZERO
    return LAYOUTS[COMMAND].pack(
        *(COMMAND, sequence & 0xFFFF, WATCHDOG_MILLISECONDS, enabled),
        *in_steps(force, FORCE, "h"),
        *in_steps(torque, TORQUE, "h"),
    )


def parse_features(report: bytes) -> ForceFeatures:
    """Read the feature report.

    Raises:
        ReportError: another report, too short, another version of the profile, or no force at all.
    """
    version, buttons, force, torque, *rest = unpack(FEATURES, report)
    if version != VERSION:
        raise ReportError(f"version {version} of the profile, not {VERSION}")
    if buttons > 16:
        raise ReportError(f"{buttons} buttons")
    if force == 0:
        raise ReportError("a force device without force")
    # No command carries more; one cut along some axes would push another way than it was meant.
    force, torque = min(force, _LIMITS["h"][1]), min(torque, _LIMITS["h"][1])
    values = zip((force, torque, *rest), DYNAMICS, strict=True)
    return ForceFeatures(buttons, Dynamics(*(number * step for number, step in values)))


def scaled(steps: list[int], step: float) -> Vector:
    """The vector of a report's numbers of steps."""
    a, b, c = steps
    return (a * step, b * step, c * step)


def in_steps(values: tuple[float, ...], step: float, code: str) -> list[int]:
    """Numbers of steps, cut to what the report's numbers hold.

    Raises:
        ReportError: a value is not finite.
    """
    least, most = _LIMITS[code]
    if not all(map(isfinite, values)):
        raise ReportError("a number is not finite")
    return [max(least, min(most, round(value / step))) for value in values]


# --- The driver ----------------------------------------------------------------------------------


class ForceDevice(HidDriver):
    """One force device."""

    name = "force device"

    def __init__(
        self,
        found: Found,
        handle: Handle,
        features: ForceFeatures,
        set_free: Callable[[], None] = lambda: None,
    ) -> None:
        buttons = numbered_buttons(features.buttons)
        super().__init__(found, handle, Kind.POSE, buttons, dynamics=features.dynamics)
        self._sequence = 0
        self._sent = SentTimes()
        self._clock = 0.0
        self._rounds = 0
        self._set_free = set_free

    @classmethod
    def drives(cls, found: Found) -> bool:
        """Whether an interface says that it follows the profile."""
        return (found.page, found.usage) == (USAGE_PAGE, USAGE)

    @classmethod
    def open(cls, found: Found) -> ForceDevice:
        """Open a device that was found, and ask what it can do.

        Raises:
            DeviceError: the system does not let us, another Blender has it, or the device follows
                another version.
        """
        handle = open_device(found)
        try:
            set_free = claim(found)
        except DeviceError:
            handle.close()
            raise
        try:
            report = bytes(handle.get_feature_report(FEATURES, SIZES[FEATURES]))
            return cls(found, handle, parse_features(report), set_free)
        except (OSError, ValueError) as error:
            handle.close()
            set_free()
            raise DeviceError(
                phrase(
                    "{name} does not follow the profile: {error}.",
                    name=found.name or phrase("The force device"),
                    error=error,
                ),
                phrase(
                    "Its firmware must follow version {version} of the profile.", version=VERSION
                ),
            ) from error

    def read(self) -> Sample | None:
        """The newest pose; None where none came, or only damaged ones."""
        for report in reversed(self.reports()):
            with suppress(ReportError):
                sample = parse_state(report, time.perf_counter())
                answered = unpack(STATE, report)[2]
                late = self._sent.since(answered, sample.time)
                return sample._replace(clock=self._unrolled(sample.clock or 0.0), delay=late)
        return None

    def _unrolled(self, clock: float) -> float:
        """The device's clock (s) as if it did not go round."""
        if clock < self._clock - 0.5 * _ROUND:  # back by less is a device that began anew
            self._rounds += 1
        self._clock = clock
        return clock + self._rounds * _ROUND

    def send(self, force: Vector, torque: Vector) -> None:
        """Ask for a force; the device's own watchdog ends it where no other follows."""
        self._sequence += 1
        self._sent.note(self._sequence & 0xFFFF, time.perf_counter())
        self.write(pack_command(self._sequence, force, torque))

    def close(self) -> None:
        with suppress(DeviceLostError, ReportError):
            self.send(ZERO, ZERO)
        super().close()
        set_free, self._set_free = self._set_free, lambda: None
        set_free()
