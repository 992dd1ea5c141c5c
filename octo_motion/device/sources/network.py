# SPDX-License-Identifier: GPL-3.0-or-later
"""Any other program as a device: three packets of fixed layout over UDP or TCP, loopback only.

docs/device.md publishes the layout. The program sends what its device can do, then poses; each pose
is answered with a force. A key of 16 bytes in each packet keeps other programs out. What the
program does, writing features and states and reading forces, is in tests/device/firmware.py.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import socket
import struct
import time
from dataclasses import astuple, dataclass
from typing import Any, Final, NamedTuple

from ...core.rotations.scalars import ZERO, Vector, normalized
from ..driver import (
    Description,
    DeviceLostError,
    Driver,
    Dynamics,
    Kind,
    Sample,
    is_possible,
    numbered_buttons,
)
from ..stream import Stream

log = logging.getLogger(__name__)

MAGIC: Final = b"OMDF"
VERSION: Final = 1
KEY_BYTES: Final = 16
FEATURES, STATE, FORCE = 1, 2, 3
HEAD: Final = struct.Struct(f"<4sHH{KEY_BYTES}s")
BODIES: Final = {
    FEATURES: struct.Struct("<B7x9d64s"),
    STATE: struct.Struct("<IIB7x13d"),
    FORCE: struct.Struct("<III4x6d"),
}
SIZES: Final = {kind: HEAD.size + body.size for kind, body in BODIES.items()}
_WATCHDOG: Final = 20
"""ms after which a force ends if no other follows."""
_MOST: Final = 1000.0
"""Newtons, and all else that a device says of itself."""
_SILENCE: Final = 1.0
"""s without a packet after which the program counts as gone."""


class PacketError(ValueError):
    """The bytes are no packet of ours."""


@dataclass(frozen=True)
class NetworkFeatures:
    """What the program's device can do."""

    name: str
    buttons: int
    dynamics: Dynamics


class NetworkState(NamedTuple):
    """What its hand does."""

    sequence: int
    sample: Sample


def pack(kind: int, key: bytes, *values: float | bytes) -> bytes:
    """A packet of a kind, with the fields of its body."""
    return HEAD.pack(MAGIC, VERSION, kind, key) + BODIES[kind].pack(*values)


def pack_force(sequence: int, answered: int, force: Vector, torque: Vector, key: bytes) -> bytes:
    """What the program's hand shall feel; ``answered`` is the sequence of the newest state."""
    numbers = (sequence & 0xFFFFFFFF, answered & 0xFFFFFFFF, _WATCHDOG)
    return pack(FORCE, key, *numbers, *force, *torque)


def size_of(data: bytes | bytearray, key: bytes) -> int:
    """Bytes of the packet that begins here, by its head; ``PacketError`` where it is no packet."""
    if len(data) < HEAD.size:
        raise PacketError("cut off")
    magic, version, kind, theirs = HEAD.unpack_from(data)
    if magic != MAGIC or kind not in SIZES:
        raise PacketError("not one of our packets")
    if version != VERSION:
        raise PacketError(f"version {version} of the packets, not {VERSION}")
    if not hmac.compare_digest(theirs, key):
        raise PacketError("the key is wrong")
    return SIZES[kind]


def parse_datagram(data: bytes, key: bytes) -> NetworkFeatures | NetworkState:
    """The packet of a program that these bytes are.

    Raises:
        PacketError: they are none, or say what cannot be.
    """
    if len(data) != size_of(data, key):
        raise PacketError("of another length")
    kind = HEAD.unpack_from(data)[2]
    values = BODIES[kind].unpack_from(data, HEAD.size)
    if kind == FORCE:
        raise PacketError("a force, which is ours to send")
    return _features(values) if kind == FEATURES else _state(values)


def _state(values: tuple[Any, ...]) -> NetworkState:
    sequence, buttons, held, x, y, z, *turn, vx, vy, vz, wx, wy, wz = values
    orientation = normalized((turn[0], turn[1], turn[2], turn[3]))
    if orientation is None:
        raise PacketError("a pose that cannot be")
    sample = Sample(
        time=time.perf_counter(),
        position=(x, y, z),
        orientation=orientation,
        velocity=(vx, vy, vz),
        angular_velocity=(wx, wy, wz),
        buttons=buttons,
        held=bool(held),
    )
    if not is_possible(sample):
        raise PacketError("a pose that cannot be")
    return NetworkState(sequence, sample)


def _features(values: tuple[Any, ...]) -> NetworkFeatures:
    buttons, *numbers, name = values
    dynamics = Dynamics(*numbers)
    possible = all(0.0 <= each <= _MOST for each in astuple(dynamics))
    if buttons > 32 or dynamics.force == 0.0 or not possible:
        raise PacketError("a device that cannot be")
    text = name.rstrip(b"\0").decode(errors="replace")
    return NetworkFeatures("".join(each for each in text if each.isprintable()), buttons, dynamics)


class NetworkDevice(Driver):
    """A program that has said what its device can do."""

    def __init__(self, port: Port, features: NetworkFeatures) -> None:
        self._port = port
        self._sequence = 0
        super().__init__(
            Description(
                name=features.name or "Program",
                identity=f"network:{port.number}",
                kind=Kind.POSE,
                buttons=numbered_buttons(features.buttons),
                dynamics=features.dynamics,
            )
        )

    def read(self) -> Sample | None:
        """The newest pose that came; a program that is gone or silent is lost."""
        sample = self._port.newest()
        if sample is None and self._port.silent:
            raise DeviceLostError(self.description.name)
        return sample

    def send(self, force: Vector, torque: Vector) -> None:
        self._sequence += 1
        self._port.answer(self._sequence, force, torque)

    def close(self) -> None:
        """Take force away; the port waits for the next program."""
        self.send(ZERO, ZERO)
        self._port.forget()


class Port:
    """A loopback port at which one program at a time may be a device."""

    def __init__(self, kind: str, number: int, key: bytes) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"the key has {len(key)} bytes, not {KEY_BYTES}")
        self._stream = kind == "tcp"
        self._key = key
        self._socket = socket.socket(
            socket.AF_INET, socket.SOCK_STREAM if self._stream else socket.SOCK_DGRAM
        )
        self._socket.bind(("127.0.0.1", number))
        self._socket.settimeout(0.0)
        if self._stream:
            self._socket.listen(1)
        self.number: int = self._socket.getsockname()[1]
        self._peer: Stream | None = None
        self._address: tuple[str, int] | None = None
        self._known: NetworkFeatures | None = None
        self._features: NetworkFeatures | None = None
        self._sample: Sample | None = None
        self._answered = 0
        self._last_packet = 0.0
        self._complained = ""

    def device(self) -> NetworkDevice | None:
        """The program that came, once it has said what its device can do."""
        self._fill()
        features, self._features = self._features, None
        if features is None:
            return None
        self._known = features
        return NetworkDevice(self, features)

    @property
    def silent(self) -> bool:
        """Whether nothing has come for long."""
        return time.perf_counter() - self._last_packet > _SILENCE

    def newest(self) -> Sample | None:
        """The newest pose since the last call."""
        self._fill()
        sample, self._sample = self._sample, None
        return sample

    def answer(self, sequence: int, force: Vector, torque: Vector) -> None:
        """Send a force to whoever sent the last pose; lost ones are the watchdog's business."""
        data = pack_force(sequence, self._answered, force, torque, self._key)
        if self._peer is not None:
            # A program that does not read misses whole packets, never a part of one.
            if len(self._peer.unsent) < len(data):
                self._peer.unsent += data
            self._peer.flush()
        elif self._address is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, self._address)

    def forget(self) -> None:
        """Be ready for another program."""
        if self._peer is not None:
            self._peer.close()
        self._peer = self._address = None
        self._features = self._sample = self._known = None

    def close(self) -> None:
        self.forget()
        self._socket.close()

    def _fill(self) -> None:
        if not self._stream:
            self._fill_from_datagrams()
            return
        # Who says nothing of a device keeps the port only until somebody else comes.
        if self._peer is None or (self._known is None and self.silent):
            self._accept()
        try:
            self._fill_from_stream()
        except PacketError as error:
            self._complain(error)
            self.forget()

    def _complain(self, error: PacketError) -> None:
        if str(error) != self._complained:
            self._complained = str(error)
            log.warning("Port %d: %s", self.number, error)

    def _fill_from_datagrams(self) -> None:
        for _ in range(64):
            try:
                data, address = self._socket.recvfrom(2048)
            except OSError:
                return
            try:
                self._take(parse_datagram(data, self._key))
                self._address = address
            except PacketError as error:
                self._complain(error)

    def _fill_from_stream(self) -> None:
        if self._peer is None:
            return
        if not self._peer.receive():
            self.forget()
            self._last_packet = 0.0
            return
        got = self._peer.received
        while len(got) >= HEAD.size:
            size = size_of(got, self._key)
            if len(got) < size:
                return
            self._take(parse_datagram(bytes(got[:size]), self._key))
            del got[:size]

    def _accept(self) -> None:
        try:
            peer, _ = self._socket.accept()
        except OSError:
            return
        self.forget()
        self._peer, self._last_packet = Stream(peer), time.perf_counter()

    def _take(self, packet: NetworkFeatures | NetworkState) -> None:
        self._last_packet = time.perf_counter()
        if isinstance(packet, NetworkState):
            self._answered, self._sample = packet
        elif packet != self._known:  # some say it again and again, for it may get lost
            self._features = packet
