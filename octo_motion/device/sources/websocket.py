# SPDX-License-Identifier: GPL-3.0-or-later
"""As much of a WebSocket client (RFC 6455) as a service on this computer asks for."""

from __future__ import annotations

import base64
import hashlib
import os
import socket
import struct
import time
from typing import Final

from ..driver import DeviceLostError
from ..stream import Stream

_GUID: Final = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
_MOST_BYTES: Final = 65_536
"""Of a message, and of what waits to be sent."""
_MOST_FRAMES: Final = 64
"""That came since the last look: one message for each of ours, and a few pings."""
_TEXT, _CLOSE, _PING, _PONG = 0x1, 0x8, 0x9, 0xA


class WebSocketError(DeviceLostError):
    """The other side is no WebSocket server, broke the rules, or is gone."""


def accept_key(key: bytes) -> bytes:
    """What a server answers to a client's key."""
    return base64.b64encode(hashlib.sha1(key + _GUID, usedforsecurity=False).digest())


def frame(opcode: int, payload: bytes, mask: bytes = b"") -> bytes:
    """One whole frame; a client's are masked, a server's are not."""
    marked = 0x80 if mask else 0
    size = len(payload)
    if size < 126:
        head = struct.pack("!BB", 0x80 | opcode, marked | size)
    elif size < 65536:
        head = struct.pack("!BBH", 0x80 | opcode, marked | 126, size)
    else:
        head = struct.pack("!BBQ", 0x80 | opcode, marked | 127, size)
    return head + mask + (masked(payload, mask) if mask else payload)


def masked(payload: bytes, mask: bytes) -> bytes:
    """A payload with its mask put on, or taken off."""
    size = len(payload)
    pattern = (mask * (size // 4 + 1))[:size]
    mixed = int.from_bytes(payload, "little") ^ int.from_bytes(pattern, "little")
    return mixed.to_bytes(size, "little")


class FrameReader:
    """Frames from a server, put together to messages; raises WebSocketError where they are none."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._message = bytearray()
        self._opcode = 0

    def feed(self, data: bytes | bytearray) -> list[tuple[int, bytes]]:
        """Opcode and payload of the messages and control frames that are whole now."""
        self._data += data
        done: list[tuple[int, bytes]] = []
        frames = 0
        while (taken := self._frame()) is not None:
            frames += 1
            if frames > _MOST_FRAMES:
                raise WebSocketError("it sends without end")
            last, opcode, payload = taken
            if opcode >= 0x8:
                if not last or len(payload) > 125:
                    raise WebSocketError("a broken control frame")
                done.append((opcode, payload))
                continue
            if (opcode == 0) != bool(self._opcode):
                raise WebSocketError("frames in a wrong order")
            self._opcode = self._opcode or opcode
            self._message += payload
            if len(self._message) > _MOST_BYTES:
                raise WebSocketError("a message is too long")
            if last:
                done.append((self._opcode, bytes(self._message)))
                self._message.clear()
                self._opcode = 0
        return done

    def _frame(self) -> tuple[bool, int, bytes] | None:
        if len(self._data) < 2:
            return None
        first, second = self._data[0], self._data[1]
        if first & 0x70 or second & 0x80 or first & 0xF not in {0, 1, 2, 8, 9, 10}:
            raise WebSocketError("a frame that no server sends")
        size, at = second & 0x7F, 2
        if size >= 126:
            width = 2 if size == 126 else 8
            if len(self._data) < at + width:
                return None
            size, at = int.from_bytes(self._data[at : at + width], "big"), at + width
        if size > _MOST_BYTES:
            raise WebSocketError("a frame is too long")
        if len(self._data) < at + size:
            return None
        payload = bytes(self._data[at : at + size])
        del self._data[: at + size]
        return bool(first & 0x80), first & 0xF, payload


class WebSocket:
    """A connection that sends and receives text, never waiting once it is open.

    Raises:
        WebSocketError: nobody is there, it is no server, broke the rules or is gone.
    """

    def __init__(self, connection: socket.socket, rest: bytes) -> None:
        self._stream = Stream(connection)
        self._reader = FrameReader()
        self._messages = self._reader.feed(rest)

    @classmethod
    def connect(cls, host: str, port: int, seconds: float = 0.3) -> WebSocket:
        """Open a connection within so many seconds, however slowly the server answers."""
        end = time.monotonic() + seconds
        key = base64.b64encode(os.urandom(16))
        request = (
            f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key.decode()}\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n"
        )
        try:
            connection = socket.create_connection((host, port), timeout=seconds)
        except OSError as error:
            raise WebSocketError("nobody is there") from error
        try:
            connection.sendall(request.encode())
            return cls(connection, _read_upgrade(connection, key, end))
        except (OSError, WebSocketError) as error:
            connection.close()
            raise WebSocketError(str(error)) from error

    def send(self, text: str) -> None:
        self._stream.unsent += frame(_TEXT, text.encode(), os.urandom(4))
        self._flush()
        if len(self._stream.unsent) > _MOST_BYTES:
            raise WebSocketError("it does not read")

    def receive(self) -> list[str]:
        self._flush()
        if not self._stream.receive(_MOST_BYTES):
            raise WebSocketError("the connection ended")
        messages = self._messages + self._reader.feed(self._stream.received)
        self._messages = []
        self._stream.received.clear()
        texts: list[str] = []
        for opcode, payload in messages:
            if opcode == _TEXT:
                texts.append(payload.decode(errors="replace"))
            elif opcode == _PING:
                self._stream.unsent += frame(_PONG, payload, os.urandom(4))
            elif opcode == _CLOSE:
                raise WebSocketError("the connection was closed")
        return texts

    def _flush(self) -> None:
        if not self._stream.flush():
            raise WebSocketError("the connection ended")

    def close(self) -> None:
        """Close the connection, politely if that does not wait."""
        self._stream.unsent += frame(_CLOSE, b"\x03\xe8", os.urandom(4))
        self._stream.close()


def received_until(connection: socket.socket, mark: bytes, end: float) -> bytes:
    """What comes until a mark is among it, all of it where there is none, or the time is over.

    Raises:
        OSError: the connection ends with an error.
        WebSocketError: it is more than anybody has to say.
    """
    data = b""
    while (not mark or mark not in data) and (left := end - time.monotonic()) > 0.0:
        connection.settimeout(left)
        try:
            more = connection.recv(4096)
        except TimeoutError:
            break
        if not more:
            break
        data += more
        if len(data) > _MOST_BYTES:
            raise WebSocketError("it sends without end")
    return data


def _read_upgrade(connection: socket.socket, key: bytes, end: float) -> bytes:
    """Check a server's answer; what came after it."""
    head, mark, rest = received_until(connection, b"\r\n\r\n", end).partition(b"\r\n\r\n")
    if not mark:
        raise WebSocketError("no answer")
    status, *lines = head.split(b"\r\n")
    values = {
        name.strip().lower(): value.strip()
        for name, _, value in (line.partition(b":") for line in lines)
    }
    if b" 101" not in status or values.get(b"sec-websocket-accept") != accept_key(key):
        raise WebSocketError("no WebSocket server")
    return rest
