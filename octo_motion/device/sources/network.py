# SPDX-License-Identifier: GPL-3.0-or-later
"""Any other program as a device: three packets of fixed layout over UDP or TCP, loopback only.

docs/device.md publishes the layout. The program sends what its device can do, then poses; each pose
is answered with a force. A key of 16 bytes in each packet keeps other programs out.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import socket
import struct
import time
from dataclasses import astuple, dataclass
from math import isfinite
from typing import Final

from ..driver import Description, DeviceLostError, Dynamics, Kind, Sample
from ..spatial import Quaternion, Vector, unit

log = logging.getLogger(__name__)

MAGIC: Final = b"OMDF"
VERSION: Final = 1
KEY_BYTES: Final = 16
FEATURES, STATE, FORCE = 1, 2, 3
_HEAD: Final = struct.Struct(f"<4sHH{KEY_BYTES}s")
_BODIES: Final = {
    FEATURES: struct.Struct("<B7x9d64s"),
    STATE: struct.Struct("<IIB7x13d"),
    FORCE: struct.Struct("<III4x6d"),
}
SIZES: Final = {kind: _HEAD.size + body.size for kind, body in _BODIES.items()}
_WATCHDOG: Final = 20
_FARTHEST: Final = 10.0
_FASTEST: Final = 1000.0
"""m/s and rad/s: no hand is."""
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


@dataclass(frozen=True)
class NetworkState:
    """What its hand does."""

    sequence: int
    buttons: int
    held: bool
    position: Vector
    orientation: Quaternion
    velocity: Vector
    angular_velocity: Vector


@dataclass(frozen=True)
class Force:
    """What its hand shall feel."""

    sequence: int
    answered: int
    """Sequence of the newest state that came."""
    watchdog: int
    """ms after which the force ends if no other follows."""
    force: Vector
    torque: Vector


Packet = NetworkFeatures | NetworkState | Force


def pack(packet: Packet, key: bytes) -> bytes:
    """Bytes of a packet."""
    match packet:
        case NetworkFeatures():
            name = packet.name.encode()[:64].decode(errors="ignore").encode()
            kind, values = FEATURES, (packet.buttons, *astuple(packet.dynamics), name)
        case NetworkState():
            kind, values = (
                STATE,
                (
                    *(packet.sequence & 0xFFFFFFFF, packet.buttons & 0xFFFFFFFF, packet.held),
                    *(*packet.position, *packet.orientation),
                    *(*packet.velocity, *packet.angular_velocity),
                ),
            )
        case Force():
            kind, values = (
                FORCE,
                (
                    *(packet.sequence & 0xFFFFFFFF, packet.answered & 0xFFFFFFFF),
                    *(packet.watchdog, *packet.force, *packet.torque),
                ),
            )
    return _HEAD.pack(MAGIC, VERSION, kind, key) + _BODIES[kind].pack(*values)


def size_of(data: bytes, key: bytes) -> int:
    """Bytes of the packet that begins here, by its head of 24 bytes.

    Raises:
        PacketError: no head of ours, another version, or another key.
    """
    if len(data) < _HEAD.size:
        raise PacketError("cut off")
    magic, version, kind, theirs = _HEAD.unpack_from(data)
    if magic != MAGIC or kind not in SIZES:
        raise PacketError("not one of our packets")
    if version != VERSION:
        raise PacketError(f"version {version} of the packets, not {VERSION}")
    if not hmac.compare_digest(theirs, key):
        raise PacketError("the key is wrong")
    return SIZES[kind]


def parse_datagram(data: bytes, key: bytes) -> Packet:
    """The packet that these bytes are.

    Raises:
        PacketError: they are none, or say what cannot be.
    """
    if len(data) != size_of(data, key):
        raise PacketError("of another length")
    kind = _HEAD.unpack_from(data)[2]
    values = _BODIES[kind].unpack_from(data, _HEAD.size)
    if not all(isfinite(value) for value in values if isinstance(value, float)):
        raise PacketError("a number is not finite")
    if kind == FEATURES:
        return _features(values)
    if kind == FORCE:
        sequence, answered, watchdog, *rest = values
        return Force(sequence, answered, watchdog, _vector(rest[0:3]), _vector(rest[3:6]))
    sequence, buttons, held, *rest = values
    position, orientation = _vector(rest[0:3]), unit((rest[3], rest[4], rest[5], rest[6]))
    fastest = max(map(abs, rest[7:13]))
    if max(map(abs, position)) > _FARTHEST or orientation is None or fastest > _FASTEST:
        raise PacketError("a pose that cannot be")
    return NetworkState(
        *(sequence, buttons, bool(held), position, orientation),
        *(_vector(rest[7:10]), _vector(rest[10:13])),
    )


def _features(values: tuple[object, ...]) -> NetworkFeatures:
    buttons, *numbers, name = values
    assert isinstance(buttons, int)
    assert isinstance(name, bytes)
    dynamics = Dynamics(*(float(each) for each in numbers if isinstance(each, float)))
    said = astuple(dynamics)
    if buttons > 32 or dynamics.force <= 0.0 or min(said) < 0.0 or max(said) > _MOST:
        raise PacketError("a device that cannot be")
    text = name.rstrip(b"\0").decode(errors="replace")
    return NetworkFeatures("".join(each for each in text if each.isprintable()), buttons, dynamics)


def _vector(numbers: list[float]) -> Vector:
    a, b, c = numbers
    return (a, b, c)


class NetworkDevice:
    """A program that has said what its device can do."""

    def __init__(self, port: Port, features: NetworkFeatures) -> None:
        self._port = port
        self._sequence = 0
        self._description = Description(
            name=features.name or "Program",
            identity=f"network:{port.number}",
            kind=Kind.POSE,
            buttons=tuple(f"Button {index + 1}" for index in range(features.buttons)),
            dynamics=features.dynamics,
        )

    @property
    def description(self) -> Description:
        """Who it is."""
        return self._description

    def read(self) -> Sample | None:
        """The newest pose that came.

        Raises:
            DeviceLostError: the program is gone or silent.
        """
        state = self._port.newest()
        if state is None:
            if self._port.silent:
                raise DeviceLostError(self._description.name)
            return None
        return Sample(
            *(time.perf_counter(), state.position, state.orientation, state.velocity),
            *(state.angular_velocity, state.buttons, state.held),
        )

    def send(self, force: Vector, torque: Vector) -> None:
        """Answer with a force."""
        self._sequence += 1
        self._port.answer(self._sequence, force, torque)

    def close(self) -> None:
        """Take force away; the port waits for the next program."""
        self.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
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
        self._peer: socket.socket | None = None
        self._address: tuple[str, int] | None = None
        self._got = self._unsent = b""
        self._known: NetworkFeatures | None = None
        self._features: NetworkFeatures | None = None
        self._state: NetworkState | None = None
        self._answered = 0
        self._heard = 0.0
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
        return time.perf_counter() - self._heard > _SILENCE

    def newest(self) -> NetworkState | None:
        """The newest pose since the last call."""
        self._fill()
        state, self._state = self._state, None
        return state

    def answer(self, sequence: int, force: Vector, torque: Vector) -> None:
        """Send a force to whoever sent the last pose; lost ones are the watchdog's business."""
        data = pack(Force(sequence, self._answered, _WATCHDOG, force, torque), self._key)
        with contextlib.suppress(OSError):
            if self._stream:
                if self._peer is not None:
                    # A program that does not read misses whole packets, never a part of one.
                    if len(self._unsent) < len(data):
                        self._unsent += data
                    self._unsent = self._unsent[self._peer.send(self._unsent) :]
            elif self._address is not None:
                self._socket.sendto(data, self._address)

    def forget(self) -> None:
        """Be ready for another program."""
        if self._peer is not None:
            self._peer.close()
        self._peer, self._address, self._got, self._unsent = None, None, b"", b""
        self._features, self._state, self._known = None, None, None

    def close(self) -> None:
        """Close the port."""
        self.forget()
        self._socket.close()

    def _fill(self) -> None:
        if not self._stream:
            self._fill_from_datagrams()
            return
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
                packet = parse_datagram(data, self._key)
                self._take(packet)
            except PacketError as error:
                self._complain(error)
                continue
            self._address = address

    def _fill_from_stream(self) -> None:
        # Who says nothing of a device keeps the port only until somebody else comes.
        if self._peer is None or (self._known is None and self.silent):
            self._accept()
        if self._peer is None:
            return
        try:
            data = self._peer.recv(65536)
        except (BlockingIOError, InterruptedError):
            data = None
        except OSError:
            data = b""
        if data == b"":
            self.forget()
            self._heard = 0.0
            return
        self._got += data or b""
        while len(self._got) >= _HEAD.size:
            size = size_of(self._got, self._key)
            if len(self._got) < size:
                return
            packet, self._got = parse_datagram(self._got[:size], self._key), self._got[size:]
            self._take(packet)

    def _accept(self) -> None:
        try:
            peer, _ = self._socket.accept()
        except OSError:
            return
        self.forget()
        self._peer, self._heard = peer, time.perf_counter()
        peer.settimeout(0.0)
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _take(self, packet: Packet) -> None:
        self._heard = time.perf_counter()
        if isinstance(packet, NetworkFeatures):
            if packet != self._known:  # some say it again and again, for it may get lost
                self._features = packet
        elif isinstance(packet, NetworkState):
            self._state, self._answered = packet, packet.sequence
        else:
            raise PacketError("a force, which is ours to send")
