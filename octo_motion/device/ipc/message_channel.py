# SPDX-License-Identifier: GPL-3.0-or-later
"""A line between two of our processes: loopback, one peer, and only one that knows the secret.

The secret is drawn anew at each start and handed to the started process through its standard
input, which nobody else can read (a command line or environment could be). Both sides prove that
they know it without saying it: each answers the other's random number with an HMAC. A connection
that does not is closed, and said in the log; nothing that it sends is looked at any further.
"""

from __future__ import annotations

import hashlib
import hmac
import logging
import secrets
import socket
import struct
import time
from typing import Final

from ..messages import HEADER, MAGIC, VERSION, Message, MessageError, pack, read_body, read_header
from ..stream import Stream

log = logging.getLogger(__name__)

HOST: Final = "127.0.0.1"
_NONCE: Final = 32
_CHALLENGE: Final = struct.Struct(f"<4sH{_NONCE}s")
_ANSWER: Final = struct.Struct(f"<4sH{_NONCE}s32s")
_PATIENCE: Final = 3.0
"""s that a connection may take to prove itself, on a machine that has much else to do."""
_MOST_WAITING: Final = 8_000_000
_DROPPABLE_BEYOND: Final = 65_536
"""Bytes waiting from which on poses and the like are left out: the newest comes later anyway."""


class ChannelClosedError(Exception):
    """The other side is gone, or was shut out."""


def new_secret() -> bytes:
    """For one start."""
    return secrets.token_bytes(32)


def _proof(secret: bytes, side: bytes, first: bytes, second: bytes) -> bytes:
    return hmac.new(
        secret, side + struct.pack("<H", VERSION) + first + second, hashlib.sha256
    ).digest()


class MessageChannel:
    """Messages to and from one peer, never waiting."""

    def __init__(self, connection: socket.socket) -> None:
        self._stream = Stream(connection)
        self.most_waiting = _MOST_WAITING
        """Bytes that may wait for a peer which does not read; then it counts as gone."""
        self.closed = False

    def fileno(self) -> int:
        """For ``select``."""
        return self._stream.fileno()

    def send(self, message: Message, *, droppable: bool = False) -> bool:
        """Send a message, or keep it until the peer reads.

        Args:
            message: What to say.
            droppable: A newer one will replace it: leave it out if the peer is slow.

        Returns:
            Whether it is on its way; else it was left out.

        Raises:
            ChannelClosedError: the peer is gone, or has not read for very long.
        """
        if droppable and len(self._stream.unsent) > _DROPPABLE_BEYOND:
            self.flush()
            return False
        self._stream.unsent += pack(message)
        self.flush()
        if len(self._stream.unsent) > self.most_waiting:
            self.close()
            raise ChannelClosedError("the other side does not read")
        return True

    def flush(self) -> None:
        """Send what waits, as far as the peer takes it."""
        if self.closed:
            raise ChannelClosedError
        if not self._stream.flush():
            self.close()
            raise ChannelClosedError

    def receive(self) -> list[Message]:
        """All messages that have come whole.

        Raises:
            ChannelClosedError: the peer is gone, or sent something that is no message.
        """
        self.flush()
        goes_on = self._stream.receive()
        messages: list[Message] = []
        try:
            while (message := self._next()) is not None:
                messages.append(message)
        except MessageError as error:
            log.warning("Connection closed: %s", error)
            self.close()
            raise ChannelClosedError(str(error)) from error
        if not goes_on:
            if self._stream.received:
                log.warning("Connection ended in the middle of a message")
            self.close()
            raise ChannelClosedError
        return messages

    def _next(self) -> Message | None:
        got = self._stream.received
        if len(got) < HEADER.size:
            return None
        kind, length = read_header(bytes(got[: HEADER.size]))
        end = HEADER.size + length
        if len(got) < end:
            return None
        body = bytes(got[HEADER.size : end])
        del got[:end]
        return read_body(kind, body)

    def close(self) -> None:
        """End the line; what the peer has not got yet is tried once more."""
        if not self.closed:
            self.closed = True
            self._stream.close()


class Listener:
    """Waits on loopback for the one peer that knows the secret."""

    def __init__(self, secret: bytes) -> None:
        self._secret = secret
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.bind((HOST, 0))
        self._socket.listen(4)
        self.port: int = self._socket.getsockname()[1]

    def accept(self, seconds: float) -> MessageChannel | None:
        """Take the right peer and stop listening; None when nobody right came in time."""
        deadline = time.monotonic() + seconds
        try:
            while (left := deadline - time.monotonic()) > 0.0:
                self._socket.settimeout(left)
                try:
                    connection, address = self._socket.accept()
                except OSError:
                    return None
                if self._proves_itself(connection):
                    return MessageChannel(connection)
                log.warning("Connection from port %d refused", address[1])
                connection.close()
            return None
        finally:
            self._socket.close()

    def _proves_itself(self, connection: socket.socket) -> bool:
        ours = secrets.token_bytes(_NONCE)
        try:
            connection.sendall(_CHALLENGE.pack(MAGIC, VERSION, ours))
            answer = _receive(connection, _ANSWER.size)
            magic, version, theirs, proof = _ANSWER.unpack(answer)
            if magic != MAGIC:
                log.warning("A connection speaks another language")
                return False
            if version != VERSION:
                log.warning("A connection speaks version %d, not %d", version, VERSION)
                return False
            if not hmac.compare_digest(proof, _proof(self._secret, b"client", ours, theirs)):
                log.warning("A connection does not know the secret")
                return False
            connection.sendall(_proof(self._secret, b"server", ours, theirs))
        except (OSError, EOFError):
            log.warning("A connection did not prove itself in time")
            return False
        return True


def connect(port: int, secret: bytes) -> MessageChannel:
    """The line to a listener that knows the same secret.

    Raises:
        ChannelClosedError: nobody listens, or whoever does speaks another version or lacks the
            secret.
    """
    try:
        connection = socket.create_connection((HOST, port), timeout=_PATIENCE)
    except OSError as error:
        raise ChannelClosedError("nobody listens") from error
    try:
        _introduce(connection, secret)
    except (OSError, EOFError) as error:
        connection.close()
        raise ChannelClosedError("the secret was refused") from error
    except ChannelClosedError:
        connection.close()
        raise
    return MessageChannel(connection)


def _introduce(connection: socket.socket, secret: bytes) -> None:
    magic, version, theirs = _CHALLENGE.unpack(_receive(connection, _CHALLENGE.size))
    if magic != MAGIC or version != VERSION:
        raise ChannelClosedError(f"version {version} listens, not {VERSION}")
    ours = secrets.token_bytes(_NONCE)
    connection.sendall(_ANSWER.pack(MAGIC, VERSION, ours, _proof(secret, b"client", theirs, ours)))
    expected = _proof(secret, b"server", theirs, ours)
    if not hmac.compare_digest(_receive(connection, len(expected)), expected):
        raise ChannelClosedError("who listens does not know the secret")


def _receive(connection: socket.socket, count: int) -> bytes:
    """So many bytes within the time a connection has to prove itself."""
    deadline = time.monotonic() + _PATIENCE
    data = b""
    while len(data) < count:
        left = deadline - time.monotonic()
        if left <= 0.0:
            raise EOFError
        connection.settimeout(left)
        got = connection.recv(count - len(data))
        if not got:
            raise EOFError
        data += got
    return data
