# SPDX-License-Identifier: GPL-3.0-or-later
"""The open HID profile of force devices: three reports of fixed layout, and their descriptor.

Written so that a microcontroller without floating point can speak it: integers alone, little
endian, each report within one packet of full-speed USB. docs/device.md tells it to makers.

One table of fields makes descriptor, packer and parser, so that they cannot differ.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from math import isfinite
from typing import Final

from ..driver import Dynamics
from ..spatial import Quaternion, Vector, unit
from .descriptor import item

VERSION: Final = 1
USAGE_PAGE: Final = 0xFF4F
"""Vendor-defined."""
USAGE: Final = 0x01
STATE, COMMAND, FEATURES = 1, 2, 3
"""Numbers of the input, output and feature report."""

WATCHDOG_MILLISECONDS: Final = 20

_POSITION: Final = 1e-7
_ORIENTATION: Final = 2.0**-30
_VELOCITY: Final = 1e-4
_ANGULAR_VELOCITY: Final = 1e-3
_FORCE: Final = 1e-3
_TORQUE: Final = 1e-4
_FARTHEST: Final = 10.0
"""m: a hand is never farther from its device's middle."""


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

_LIMITS: Final = {
    "B": (0, 0xFF),
    "H": (0, 0xFFFF),
    "I": (0, 0x7FFFFFFF),
    "h": (-0x7FFF, 0x7FFF),
    "i": (-0x7FFFFFFF, 0x7FFFFFFF),
}
_STRUCTS: Final = {
    number: struct.Struct("<B" + "".join(f"{each.count}{each.code}" for each in items))
    for number, (_way, items) in REPORTS.items()
}
SIZES: Final = {number: each.size for number, each in _STRUCTS.items()}
"""Bytes of each report, its number included."""


class ReportError(ValueError):
    """The bytes are no report of the profile, or not a possible one."""


@dataclass(frozen=True)
class ForceState:
    """Input report: what the hand does."""

    sequence: int
    clock: int
    """µs of the device's own clock, going round at 2³¹."""
    answered: int
    """Sequence of the newest command that reached the device."""
    buttons: int
    held: bool
    powered: bool
    position: Vector
    orientation: Quaternion
    velocity: Vector
    angular_velocity: Vector


@dataclass(frozen=True)
class Command:
    """Output report: what the hand shall feel."""

    sequence: int
    watchdog: int
    """ms"""
    enabled: bool
    force: Vector
    torque: Vector


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


def _unpack(number: int, report: bytes) -> tuple[int, ...]:
    layout = _STRUCTS[number]
    # Windows hands over every report with the length of the longest.
    if len(report) < layout.size or report[0] != number:
        raise ReportError(f"no report {number} of {layout.size} bytes")
    return layout.unpack_from(report)[1:]


def parse_state(report: bytes) -> ForceState:
    """Read an input report, its number included.

    Raises:
        ReportError: another report, too short, or a pose that cannot be.
    """
    sequence, clock, answered, buttons, flags, *rest = _unpack(STATE, report)
    position = _scaled(rest[0:3], _POSITION)
    if max(map(abs, position)) > _FARTHEST:
        raise ReportError("the hand is too far away")
    w, x, y, z = rest[3:7]
    size = (w * w + x * x + y * y + z * z) * _ORIENTATION**2
    orientation = unit((float(w), float(x), float(y), float(z)))
    if orientation is None or not 0.9 < size < 1.1:
        raise ReportError("the orientation is no unit quaternion")
    return ForceState(
        *(sequence, clock, answered, buttons, bool(flags & 1), bool(flags & 2)),
        *(position, orientation),
        _scaled(rest[7:10], _VELOCITY),
        _scaled(rest[10:13], _ANGULAR_VELOCITY),
    )


def pack_state(state: ForceState) -> bytes:
    """Write an input report: what firmware does; here for tests and stand-ins."""
    return _STRUCTS[STATE].pack(
        STATE,
        *(state.sequence & 0xFFFF, state.clock & 0x7FFFFFFF, state.answered & 0xFFFF),
        *(state.buttons & 0xFFFF, state.held | state.powered << 1),
        *_steps(state.position, _POSITION, "i"),
        *_steps(state.orientation, _ORIENTATION, "i"),
        *_steps(state.velocity, _VELOCITY, "h"),
        *_steps(state.angular_velocity, _ANGULAR_VELOCITY, "h"),
    )


def parse_command(report: bytes) -> Command:
    """Read an output report: what firmware does; here for tests and stand-ins.

    Raises:
        ReportError: another report, or too short.
    """
    sequence, watchdog, flags, *rest = _unpack(COMMAND, report)
    return Command(
        *(sequence, watchdog, bool(flags & 1)),
        *(_scaled(rest[0:3], _FORCE), _scaled(rest[3:6], _TORQUE)),
    )


def pack_command(command: Command) -> bytes:
    """Write an output report; what is beyond the numbers' range is cut to it.

    Raises:
        ReportError: force or torque is not finite.
    """
    return _STRUCTS[COMMAND].pack(
        COMMAND,
        *(command.sequence & 0xFFFF, max(0, min(0xFF, command.watchdog)), command.enabled),
        *_steps(command.force, _FORCE, "h"),
        *_steps(command.torque, _TORQUE, "h"),
    )


def parse_features(report: bytes) -> ForceFeatures:
    """Read the feature report.

    Raises:
        ReportError: another report, too short, another version of the profile, or no force at all.
    """
    version, buttons, force, torque, *rest = _unpack(FEATURES, report)
    if version != VERSION:
        raise ReportError(f"version {version} of the profile, not {VERSION}")
    if buttons > 16:
        raise ReportError(f"{buttons} buttons")
    if force == 0:
        raise ReportError("a force device without force")
    # No command carries more; one cut along some axes would push another way than it was meant.
    force, torque = min(force, _LIMITS["h"][1]), min(torque, _LIMITS["h"][1])
    b, angular_b, friction, angular_friction, step, angular_step, delay = rest
    return ForceFeatures(
        buttons,
        Dynamics(
            *(force * _FORCE, torque * _TORQUE, b * 1e-3, angular_b * 1e-6),
            *(friction * 1e-3, angular_friction * 1e-6, step * _POSITION, angular_step * 1e-6),
            delay * 1e-6,
        ),
    )


def pack_features(features: ForceFeatures) -> bytes:
    """Write the feature report: what firmware does; here for tests and stand-ins."""
    it = features.dynamics
    values = [
        *(it.force / _FORCE, it.torque / _TORQUE, it.damping / 1e-3, it.angular_damping / 1e-6),
        *(it.friction / 1e-3, it.angular_friction / 1e-6),
        *(it.resolution / _POSITION, it.angular_resolution / 1e-6, it.delay / 1e-6),
    ]
    return _STRUCTS[FEATURES].pack(
        FEATURES, VERSION, features.buttons, *(max(0, min(0xFFFF, round(each))) for each in values)
    )


def _scaled(steps: list[int], step: float) -> Vector:
    a, b, c = steps
    return (a * step, b * step, c * step)


def _steps(values: tuple[float, ...], step: float, code: str) -> list[int]:
    least, most = _LIMITS[code]
    if not all(map(isfinite, values)):
        raise ReportError("a number is not finite")
    return [max(least, min(most, round(value / step))) for value in values]
