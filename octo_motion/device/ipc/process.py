# SPDX-License-Identifier: GPL-3.0-or-later
"""A process of ours, and the line to it: loopback, one peer, and only one that knows the secret.

The secret is drawn anew at each start and handed to the started process through its standard
input, which nobody else can read (a command line or environment could be). Both sides prove that
they know it without saying it: each answers the other's random number with an HMAC. A connection
that does not is closed, and said in the log; nothing that it sends is looked at any further.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import logging
import os
import secrets
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final, NoReturn

from ...core.errors import DeviceError
from ...core.phrases import phrase
from ...core.processes import python_path, start_program
from ..messages import (
    HEADER,
    MAGIC,
    MOST_BYTES,
    VERSION,
    Message,
    MessageError,
    pack,
    read_body,
    read_header,
)
from ..stream import LOOPBACK, Stream

log = logging.getLogger(__name__)

_NONCE: Final = 32
_CHALLENGE: Final = struct.Struct(f"<4sH{_NONCE}s")
_ANSWER: Final = struct.Struct(f"<4sH{_NONCE}s32s")
_PATIENCE: Final = 3.0
"""s that a connection may take to prove itself, on a machine that has much else to do."""
_MOST_WAITING: Final = 8_000_000
_AT_ONCE: Final = 1000
"""Messages that are taken in one call."""
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

    def send(self, message: Message, *, droppable: bool = False) -> bool:
        """Send a message, or keep it until the peer reads; whether it is on its way.

        One that may be dropped, since a newer one will replace it, is left out if the peer is slow.

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
        """Messages that have come whole; of very many the rest next time.

        Raises:
            ChannelClosedError: the peer is gone, or sent something that is no message.
        """
        self.flush()
        goes_on = len(self._stream.received) > MOST_BYTES or self._stream.receive()
        messages: list[Message] = []
        try:
            while len(messages) < _AT_ONCE and (message := self._next()) is not None:
                messages.append(message)
        except MessageError as error:
            log.warning("Connection closed: %s", error)
            self.close()
            raise ChannelClosedError(str(error)) from error
        if not goes_on and not messages:
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
        self._socket.bind((LOOPBACK, 0))
        self._socket.listen(4)
        self.port: int = self._socket.getsockname()[1]

    def accept(self, seconds: float) -> MessageChannel | None:
        """Take the right peer and stop listening; None when nobody right came in time."""
        deadline = time.monotonic() + seconds
        with self._socket:
            while (left := deadline - time.monotonic()) > 0.0:
                self._socket.settimeout(left)
                try:
                    connection, address = self._socket.accept()
                except OSError:
                    return None
                try:
                    self._examine(connection)
                    return MessageChannel(connection)
                except (OSError, ChannelClosedError) as error:
                    log.warning("Connection from port %d refused: %s", address[1], error)
                    connection.close()
            return None

    def _examine(self, connection: socket.socket) -> None:
        ours = secrets.token_bytes(_NONCE)
        connection.sendall(_CHALLENGE.pack(MAGIC, VERSION, ours))
        magic, version, theirs, proof = _ANSWER.unpack(_receive(connection, _ANSWER.size))
        if magic != MAGIC:
            raise ChannelClosedError("it speaks another language")
        if version != VERSION:
            raise ChannelClosedError(f"it speaks version {version}, not {VERSION}")
        if not hmac.compare_digest(proof, _proof(self._secret, b"client", ours, theirs)):
            raise ChannelClosedError("it does not know the secret")
        connection.sendall(_proof(self._secret, b"server", ours, theirs))


def connect(port: int, secret: bytes) -> MessageChannel:
    """The line to a listener that knows the same secret.

    Raises:
        ChannelClosedError: nobody listens, or whoever does speaks another version or lacks the
            secret.
    """
    try:
        connection = socket.create_connection((LOOPBACK, port), timeout=_PATIENCE)
    except OSError as error:
        raise ChannelClosedError("nobody listens") from error
    try:
        _introduce(connection, secret)
    except (OSError, ChannelClosedError) as error:
        connection.close()
        raise ChannelClosedError(str(error)) from error
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
        connection.settimeout(max(1e-3, deadline - time.monotonic()))  # 0 would not wait at all
        got = connection.recv(count - len(data))
        if not got:
            raise ChannelClosedError("the other side did not prove itself")
        data += got
    return data


# --- Starting, and ending with whoever started us -------------------------------------------------

_START_SECONDS: Final = 20.0
PROGRAM: Final = "octo_motion.device.__main__"
"""As the launcher calls it, whatever Blender calls the package."""
PORT_LINE: Final = "port "


def python_executable() -> Path:
    """The Python to run the bridge with.

    Raises:
        DeviceError: none was found.
    """
    path = python_path()
    if path is None:
        raise DeviceError(
            "Blender's own Python was not found, so devices cannot be used.",
            phrase(
                "Use a Blender from blender.org, which has its Python below {prefix}.",
                prefix=sys.prefix,
            ),
        )
    return path


class Child:
    """A process of ours that was started, and the line to it."""

    def __init__(self, process: subprocess.Popen[bytes], channel: MessageChannel) -> None:
        self._process = process
        self.channel = channel

    @classmethod
    def start(
        cls, arguments: Sequence[str], python: Path | None = None, log_file: Path | None = None
    ) -> Child:
        """Start ``python -m octo_motion.device`` with subcommand and options, and connect to it.

        What it has to say besides, and whatever it starts, goes to the file, or to our own console.

        Raises:
            DeviceError: it does not start, or does not answer.
        """
        secret = new_secret()
        python = python or python_executable()
        try:
            with _messages_to(log_file) as messages:
                process = start_program(python, PROGRAM, arguments, messages=messages)
        except OSError as error:
            raise DeviceError(
                phrase("The device's program does not start: {strerror}.", strerror=error.strerror),
                "Look whether a virus scanner or a full disk keeps Blender's Python from running.",
            ) from error
        assert process.stdin is not None
        try:
            process.stdin.write(secret.hex().encode() + b"\n")
            process.stdin.flush()
            port = _announced_port(process)
            channel = connect(port, secret)
        except (OSError, ValueError, ChannelClosedError) as error:
            _end(process)
            raise _silent(process.returncode, log_file) from error
        return cls(process, channel)

    @property
    def running(self) -> bool:
        """Whether the process is there and the line holds."""
        return self._process.poll() is None and not self.channel.closed

    def stop(self, seconds: float = 1.0) -> None:
        """End it: by closing its line and standard input and, if that does not help, by force."""
        self.channel.close()
        _end(self._process, seconds)


class Starting:
    """A process of ours that is being started by a thread: nobody waits for it."""

    def __init__(
        self, arguments: Sequence[str], python: Path | None, log_file: Path | None
    ) -> None:
        """As ``Child.start``."""
        self.child: Child | None = None
        """Once it answers."""
        self.trouble: DeviceError | None = None
        self._lock = threading.Lock()
        self._dropped = False
        self._thread = threading.Thread(
            target=self._start, args=(arguments, python, log_file), daemon=True
        )
        self._thread.start()

    def _start(self, arguments: Sequence[str], python: Path | None, log_file: Path | None) -> None:
        try:
            child = Child.start(arguments, python, log_file)
        except DeviceError as error:
            self.trouble = error
            return
        with self._lock:
            if not self._dropped:
                self.child = child
                return
        child.stop()

    def drop(self) -> None:
        """Nobody wants it any more: end it, now or as soon as it answers."""
        with self._lock:
            self._dropped = True
        if self.child is not None:
            self.child.stop()


@contextlib.contextmanager
def _messages_to(log_file: Path | None) -> Iterator[BinaryIO | int | None]:
    """Where what a process says besides goes: a file, or our console if we have one.

    Blender for Windows has none, and a process cannot be given what is not there.
    """
    if log_file is not None:
        with contextlib.suppress(OSError):
            log_file.parent.mkdir(parents=True, exist_ok=True)
            with log_file.open("wb") as file:
                yield file
                return
    yield None if sys.stderr is not None else subprocess.DEVNULL


_DLL_NOT_FOUND: Final = 0xC0000135
"""Exit code of a Windows program that lacks a library."""


def _silent(status: int | None, log_file: Path | None) -> DeviceError:
    """Why a program that was started does not answer."""
    if status is not None and status & 0xFFFFFFFF == _DLL_NOT_FOUND:
        return DeviceError(
            "The device's program does not start: Windows lacks VCRUNTIME140.dll.",
            "Install Microsoft's Visual C++ Redistributable, or use a Blender from blender.org.",
        )
    where = log_file or "Blender's console"
    return DeviceError(
        "The device's program does not answer.",
        phrase("Start it again; its messages are in {where}.", where=where),
    )


def _announced_port(process: subprocess.Popen[bytes]) -> int:
    """The port that the process says on its first line."""
    found: list[bytes] = []
    stdout = process.stdout
    assert stdout is not None
    reader = threading.Thread(target=lambda: found.append(stdout.readline()), daemon=True)
    reader.start()
    reader.join(_START_SECONDS)
    line = found[0].decode("ascii", "replace").strip() if found else ""
    if not line.startswith(PORT_LINE):
        raise ValueError("no port was said")
    return int(line.removeprefix(PORT_LINE))


def _end(process: subprocess.Popen[bytes], seconds: float = 0.0) -> None:
    with contextlib.suppress(OSError):
        if process.stdin is not None:
            process.stdin.close()
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()


class Parent:
    """Whoever started this process; when it is gone, so are we.

    Nobody has to ask for it: the end of standard input wakes a thread that waits for nothing else.
    No step of a simulation, no system call that never returns and nothing that Python would tidy up
    keeps the process, but for the seconds given for what must be done once ``gone`` is set.
    """

    def __init__(self, seconds: float = 0.0) -> None:
        # Not through sys.stdin: Python cannot end while a thread waits within its buffer.
        self._input = sys.stdin.fileno()
        line = b""
        while not line.endswith(b"\n") and len(line) < 100:
            byte = os.read(self._input, 1)
            if not byte:
                break
            line += byte
        try:
            self._secret = bytes.fromhex(line.decode("ascii", "replace").strip())
        except ValueError:
            self._secret = b""
        if len(self._secret) != 32:
            # Whoever started us is gone already, or is a person who tries it out.
            sys.exit("This is started by Blender. Try: list, watch or descriptor." if line else 2)
        self.gone = False
        self._seconds = seconds
        # Waiting for the end of standard input holds no lock; on Windows nothing else can.
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        with contextlib.suppress(OSError):
            while os.read(self._input, 4096):
                pass
        self.gone = True
        time.sleep(self._seconds)
        os._exit(0)

    def line(self) -> MessageChannel | None:
        """Say where we listen, and take the line; None where nobody connects."""
        listener = Listener(self._secret)
        with contextlib.suppress(OSError):  # gone meanwhile: that is seen elsewhere
            os.write(sys.stdout.fileno(), f"{PORT_LINE}{listener.port}\n".encode())
        channel = listener.accept(_START_SECONDS)
        if channel is None:
            log.error("Nobody connected")
        return channel


def end_now(status: int) -> NoReturn:
    """End this process without what Python does at its end: on a busy machine that takes long."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)
