# SPDX-License-Identifier: GPL-3.0-or-later
"""The other half of the two profiles for force devices: what firmware and programs do.

Firmware writes states and features of the HID profile and reads commands; a program writes states
and features as packets and reads forces.
"""

from __future__ import annotations

import os
from dataclasses import astuple, dataclass

from octo_motion.core.rotations.scalars import Quaternion, Vector
from octo_motion.device.driver import Dynamics, Sample
from octo_motion.device.hid import force_profile as profile
from octo_motion.device.sources import packets
from octo_motion.device.sources.packets import NetworkFeatures

# --- The HID profile -----------------------------------------------------------------------------


@dataclass(frozen=True)
class FirmwareState:
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


def pack_state(state: FirmwareState) -> bytes:
    """Write an input report."""
    return profile.LAYOUTS[profile.STATE].pack(
        profile.STATE,
        *(state.sequence & 0xFFFF, state.clock & 0x7FFFFFFF, state.answered & 0xFFFF),
        *(state.buttons & 0xFFFF, state.held | state.powered << 1),
        *profile.in_steps(state.position, profile.POSITION, "i"),
        *profile.in_steps(state.orientation, profile.ORIENTATION, "i"),
        *profile.in_steps(state.velocity, profile.VELOCITY, "h"),
        *profile.in_steps(state.angular_velocity, profile.ANGULAR_VELOCITY, "h"),
    )


def parse_command(report: bytes) -> Command:
    """Read an output report.

    Raises:
        ReportError: another report, or too short.
    """
    sequence, watchdog, flags, *rest = profile.unpack(profile.COMMAND, report)
    return Command(
        *(sequence, watchdog, bool(flags & 1)),
        profile.scaled(rest[0:3], profile.FORCE),
        profile.scaled(rest[3:6], profile.TORQUE),
    )


def pack_features(buttons: int, dynamics: Dynamics) -> bytes:
    """Write the feature report."""
    numbers = (
        max(0, min(0xFFFF, round(value / step)))
        for value, step in zip(astuple(dynamics), profile.DYNAMICS, strict=True)
    )
    return profile.LAYOUTS[profile.FEATURES].pack(
        profile.FEATURES, profile.VERSION, buttons, *numbers
    )


# --- Packets of a program ------------------------------------------------------------------------


@dataclass(frozen=True)
class Force:
    """What the hand of a program's device shall feel."""

    sequence: int
    answered: int
    """Sequence of the newest state that came."""
    watchdog: int
    """ms"""
    force: Vector
    torque: Vector


class Program:
    """The program's half of a meeting: it greets, answers the question, says what its hand does."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._theirs = os.urandom(packets.NONCE_BYTES)
        self._ours = b""
        self._meeting = b""
        self.sequence = 0

    def greeting(self) -> bytes:
        return packets.pack(packets.GREETING, 0, self._theirs)

    def asked(self, data: bytes) -> None:
        """Take the question; one that knows the key asked it."""
        packet = packets.read(data)
        assert packet.kind == packets.QUESTION
        (self._ours,) = packet.values
        self._meeting = packets.meeting_key(self._key, self._theirs, self._ours)
        if not packets.is_tagged(data, self._meeting):
            raise packets.PacketError("the port does not know the key")

    def features(self, said: NetworkFeatures) -> bytes:
        name = said.name.encode()[:64].decode(errors="ignore").encode()
        numbers = (said.buttons, *astuple(said.dynamics))
        return self._packed(packets.FEATURES, self._theirs, self._ours, *numbers, name)

    def state(self, said: Sample, answered: int = 0) -> bytes:
        return self._packed(
            *(packets.STATE, answered, said.buttons, said.held, said.clock or 0.0),
            *(*said.position, *said.orientation, *said.velocity, *said.angular_velocity),
        )

    def _packed(self, kind: int, *values: float | bytes) -> bytes:
        self.sequence += 1
        return packets.pack(kind, self.sequence, *values, key=self._meeting)

    def force(self, data: bytes) -> Force:
        """Read what the program is sent.

        Raises:
            PacketError: it is no force, not whole, or not from the port that was met.
        """
        packet = packets.read(data)
        if packet.kind != packets.FORCE or not packets.is_tagged(data, self._meeting):
            raise packets.PacketError("no force")
        answered, watchdog, x, y, z, a, b, c = packet.values
        return Force(packet.sequence, answered, watchdog, (x, y, z), (a, b, c))
