# SPDX-License-Identifier: GPL-3.0-or-later
"""The other half of the two profiles for force devices: what firmware and programs do.

Firmware writes states and features of the HID profile and reads commands; a program writes states
and features as packets and reads forces.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

from octo_motion.core.rotations.scalars import Quaternion, Vector
from octo_motion.device.driver import Dynamics
from octo_motion.device.hid import force_profile as profile
from octo_motion.device.sources import network
from octo_motion.device.sources.network import NetworkFeatures, NetworkState

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


def pack_packet(packet: NetworkFeatures | NetworkState, key: bytes) -> bytes:
    """Write what a program sends."""
    if isinstance(packet, NetworkFeatures):
        name = packet.name.encode()[:64].decode(errors="ignore").encode()
        return network.pack(network.FEATURES, key, packet.buttons, *astuple(packet.dynamics), name)
    sample = packet.sample
    return network.pack(
        *(network.STATE, key, packet.sequence, sample.buttons, sample.held),
        *(*sample.position, *sample.orientation, *sample.velocity, *sample.angular_velocity),
    )


def parse_force(data: bytes, key: bytes) -> Force:
    """Read what a program is sent.

    Raises:
        PacketError: it is no force, or not whole.
    """
    size = network.SIZES[network.FORCE]
    if len(data) != size or network.size_of(data, key) != size:
        raise network.PacketError("no force")
    body = network.BODIES[network.FORCE]
    sequence, answered, watchdog, x, y, z, a, b, c = body.unpack_from(data, network.HEAD.size)
    return Force(sequence, answered, watchdog, (x, y, z), (a, b, c))
