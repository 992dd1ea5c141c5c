# SPDX-License-Identifier: GPL-3.0-or-later
"""Any other program as a device, over UDP or TCP, loopback only.

The program proves that it knows the key, says what its device can do, then sends poses; each is
answered with a force. Packets are in ``packets``. Whoever has proved nothing holds no place: our
question to a greeting follows from who asks, so that nothing is kept, and of connections that wait
the oldest makes room.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import secrets
import socket
import time
from collections import deque
from typing import Final

from ...core.rotations.scalars import ZERO, Vector
from ..driver import Description, DeviceLostError, Driver, Kind, Sample, SentTimes, numbered_buttons
from ..stream import LOOPBACK, Stream
from . import packets
from .packets import KEY_BYTES, NetworkFeatures, Packet, PacketError

log = logging.getLogger(__name__)

_SILENCE: Final = 1.0
"""s without a packet after which the program counts as gone."""
_AT_ONCE: Final = 64
"""Packets that are taken in one call: whoever sends without end keeps no loop from going on."""
_WAITING: Final = 32
"""Connections that have proved nothing yet."""
_ACCEPTED: Final = 16
"""Of them, new ones in one call."""

Address = tuple[str, int]


class NetworkDevice(Driver):
    """A program that has said what its device can do."""

    def __init__(self, port: Port, features: NetworkFeatures) -> None:
        self._port = port
        self._sequence = 0
        self._sent = SentTimes()
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
        state = self._port.newest()
        if state is None:
            if self._port.silent:
                raise DeviceLostError(self.description.name)
            return None
        late = self._sent.since(state.answered, state.sample.time)
        return state.sample._replace(delay=late)

    def send(self, force: Vector, torque: Vector) -> None:
        self._sequence += 1
        self._sent.note(self._sequence, time.perf_counter())
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
        self.number = number
        self._waiting: deque[tuple[Stream, Address]] = deque()
        self._complained = ""
        self._peer: Stream | None = None
        self._address: Address | None = None
        """Over UDP, of the program that has proved itself."""
        self._open()
        self._forget()

    def _open(self) -> None:
        kind = socket.SOCK_STREAM if self._stream else socket.SOCK_DGRAM
        self._socket = socket.socket(socket.AF_INET, kind)
        self._socket.settimeout(0.0)
        self._socket.bind((LOOPBACK, self.number))
        if self._stream:
            self._socket.listen(_WAITING)
        self.number = self._socket.getsockname()[1]

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

    def newest(self) -> packets.NetworkState | None:
        """The newest pose since the last call."""
        self._fill()
        state, self._state = self._state, None
        return state

    def answer(self, sequence: int, force: Vector, torque: Vector) -> None:
        """Send a force to the program; lost ones are the watchdog's business."""
        data = packets.pack_force(sequence, self._sequence, force, torque, self._meeting)
        if self._peer is not None:
            # A program that does not read misses whole packets, never a part of one.
            if len(self._peer.unsent) < len(data):
                self._peer.unsent += data
            self._peer.flush()
        elif self._address is not None:
            with contextlib.suppress(OSError):
                self._socket.send(data)

    def forget(self) -> None:
        """Be ready for another program."""
        if self._peer is not None:
            self._peer.close()
        if self._address is not None:  # a socket that is tied to one program stays so
            self._socket.close()
            with contextlib.suppress(OSError):  # taken in that moment: it stays closed
                self._open()
        self._forget()

    def _forget(self) -> None:
        self._peer = self._address = None
        self._meeting = b""
        self._question = secrets.token_bytes(KEY_BYTES)
        """Drawn anew for each program: what was said to the one before is out of date."""
        self._features: NetworkFeatures | None = None
        self._known: NetworkFeatures | None = None
        self._state: packets.NetworkState | None = None
        self._sequence = 0
        self._last_packet = 0.0

    def close(self) -> None:
        while self._waiting:
            self._waiting.pop()[0].close()
        if self._peer is not None:
            self._peer.close()
        self._socket.close()
        self._forget()

    # --- Whoever has proved nothing --------------------------------------------------------------

    def _ours(self, theirs: bytes, address: Address) -> bytes:
        """Our random number for a program and its own: worked out, so that none is kept."""
        return hmac.digest(self._question, theirs + repr(address).encode(), "sha256")[
            : packets.NONCE_BYTES
        ]

    def _greeted(self, data: bytes, address: Address) -> bytes:
        """Our answer to a stranger; nothing is left to say once he has proved that he is none."""
        packet = packets.read(data)
        if packet.kind == packets.GREETING:
            (theirs,) = packet.values
            ours = self._ours(theirs, address)
            meeting = packets.meeting_key(self._key, theirs, ours)
            return packets.pack(packets.QUESTION, 0, ours, key=meeting)
        if packet.kind != packets.FEATURES:
            raise PacketError("nobody has proved to know the key")
        theirs, ours = packet.values[:2]
        meeting = packets.meeting_key(self._key, theirs, ours)
        if not hmac.compare_digest(ours, self._ours(theirs, address)):
            raise PacketError("an answer to another question")
        if not packets.is_tagged(data, meeting):
            raise PacketError("the key is wrong")
        self._features = packets.features_of(packet.values)
        self._meeting, self._sequence = meeting, packet.sequence
        self._last_packet = time.perf_counter()
        return b""

    def _hear_strangers(self) -> None:
        """Over TCP: answer those who wait, then let others in, of whom the oldest make room."""
        for _ in range(len(self._waiting)):
            self._hear(*self._waiting.popleft())
        for _ in range(_ACCEPTED):
            if self._meeting:
                break
            try:
                connection, address = self._socket.accept()
                stranger = Stream(connection)
            except OSError:
                break
            self._hear(stranger, address)
        while len(self._waiting) > (0 if self._meeting else _WAITING):
            self._waiting.popleft()[0].close()

    def _hear(self, stranger: Stream, address: Address) -> None:
        """Hear what one has to say who waits, and let him wait on if he is neither in nor out."""
        stays = not self._meeting and stranger.receive(_AT_ONCE * packets.HEAD.size)
        try:
            while stays and (data := self._packet_in(stranger)):
                stranger.unsent += self._greeted(data, address)
                if self._meeting:
                    self._peer = stranger
                    return
            stays = stays and stranger.flush()
        except PacketError as error:
            self._complain(error)
            stays = False
        if stays:
            self._waiting.append((stranger, address))
        else:
            stranger.close()

    # --- What comes ------------------------------------------------------------------------------

    def _fill(self) -> None:
        if not self._stream:
            self._fill_from_datagrams()
        elif self._peer is None:
            self._hear_strangers()
        else:
            self._fill_from_stream(self._peer)

    def _complain(self, error: PacketError) -> None:
        if str(error) != self._complained:
            self._complained = str(error)
            log.warning("Port %d: %s", self.number, error)

    def _fill_from_datagrams(self) -> None:
        came: list[bytes] = []
        for _ in range(_AT_ONCE):
            try:
                data, address = self._socket.recvfrom(2048)
            except OSError:
                break
            if address == self._address:
                came.append(data)
            elif self._address is None:
                try:
                    reply = self._greeted(data, address)
                    if self._meeting:
                        # From here on the system hands over what this program sends alone.
                        self._socket.connect(address)
                        self._address = address
                    else:
                        self._socket.sendto(reply, address)
                except PacketError as error:
                    self._complain(error)
                except OSError:
                    self._forget()
        self._take(came)

    def _fill_from_stream(self, peer: Stream) -> None:
        goes_on = peer.receive(_AT_ONCE * packets.SIZES[packets.STATE])
        came: list[bytes] = []
        try:
            while data := self._packet_in(peer):
                came.append(data)
        except PacketError as error:
            self._complain(error)
            goes_on = False
        self._take(came)
        if not goes_on:
            self._last_packet = 0.0

    @staticmethod
    def _packet_in(stream: Stream) -> bytes:
        """The next packet that has come whole; empty where none has."""
        got = stream.received
        if len(got) < packets.HEAD.size or len(got) < (size := packets.size_of(got)):
            return b""
        data = bytes(got[:size])
        del got[:size]
        return data

    def _take(self, came: list[bytes]) -> None:
        """Take over the newest state, and features that are not known yet."""
        newest = self._sequence
        for data in reversed(came):
            try:
                packet = packets.read(data)
                if packet.kind == packets.STATE and newest > self._sequence:
                    continue  # an older one
                self._check(data, packet)
                if packet.kind == packets.STATE:
                    self._state = packets.state_of(packet.values)
                else:
                    features = packets.features_of(packet.values)
                    if features != self._known:  # some say it again, for it may get lost
                        self._features = features
                newest = max(newest, packet.sequence)
            except PacketError as error:
                self._complain(error)
        if newest > self._sequence:
            self._sequence = newest
            self._last_packet = time.perf_counter()

    def _check(self, data: bytes, packet: Packet) -> None:
        if packet.kind not in {packets.STATE, packets.FEATURES}:
            raise PacketError("nothing that a program says after its features")
        if packet.sequence <= self._sequence:
            raise PacketError("it came before")
        if not packets.is_tagged(data, self._meeting):
            raise PacketError("the key is wrong")
