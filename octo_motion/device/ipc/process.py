# SPDX-License-Identifier: GPL-3.0-or-later
"""Starting one of our processes, and ending with whoever started us."""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Final, NoReturn

from ...core.errors import DeviceError
from .message_channel import ChannelClosedError, MessageChannel, connect, new_secret

log = logging.getLogger(__name__)

_START_SECONDS: Final = 20.0
LAUNCHER: Final = Path(__file__).with_name("launch.py")
PORT_LINE: Final = "port "


def python_executable() -> Path:
    """The Python to run the bridge with: Blender's own, of the same version as this one.

    Within Blender ``sys.executable`` is the Python that Blender brings; in some builds it is
    Blender itself, or empty. Then Python lies below ``sys.prefix``.

    Raises:
        DeviceError: none was found.
    """
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    names = [f"python{version}", "python3", "python"]
    if os.name == "nt":
        names = ["python.exe"]
    prefixes = dict.fromkeys((sys.prefix, sys.base_prefix, sys.exec_prefix))
    candidates = [
        Path(sys.executable or "."),
        *(
            Path(prefix) / place / name
            for prefix in prefixes
            for place in ("bin", ".")
            for name in names
        ),
    ]
    for path in candidates:
        if path.name.lower().startswith("python") and path.is_file() and os.access(path, os.X_OK):
            return path
    raise DeviceError(
        "Blender's own Python was not found, so devices cannot be used.",
        f"Use a Blender from blender.org, which has its Python below {sys.prefix}.",
    )


def library_folders() -> list[str]:
    """Where this Python has numpy and hidapi; the extension's wheels have a folder of their own."""
    folders: dict[str, None] = {}
    for name in ("numpy", "hid", "hidraw"):
        with contextlib.suppress(ImportError, ValueError):
            specification = importlib.util.find_spec(name)
            if specification is not None and specification.origin:
                origin = Path(specification.origin).parent
                folders[str(origin.parent if name == "numpy" else origin)] = None
    return list(folders)


class Child:
    """A process of ours that was started, and the line to it."""

    def __init__(self, process: subprocess.Popen[bytes], channel: MessageChannel) -> None:
        self._process = process
        self.channel = channel

    @classmethod
    def start(
        cls, arguments: Sequence[str], python: Path | None = None, log_to: IO[bytes] | None = None
    ) -> Child:
        """Start ``python -m octo_motion.device`` with arguments, and connect to it.

        Args:
            arguments: Subcommand and options.
            python: Executable; None finds it.
            log_to: Open file for what the process says; None: where this one says it.

        Raises:
            DeviceError: it does not start, or does not answer.
        """
        secret = new_secret()
        command = [
            str(python or python_executable()),
            "-I",
            "-X",
            "utf8",
            str(LAUNCHER),
            *arguments,
        ]
        for folder in library_folders():
            command += ["--library", folder]
        try:
            process = subprocess.Popen(  # noqa: S603 - our own program
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log_to,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            raise DeviceError(
                f"The device's program does not start: {error.strerror}.",
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
            raise DeviceError(
                "The device's program does not answer.",
                "Start it again; its messages are in Blender's console.",
            ) from error
        return cls(process, channel)

    @property
    def running(self) -> bool:
        """Whether the process is there and the line holds."""
        return self._process.poll() is None and not self.channel.closed

    @property
    def process_id(self) -> int:
        """Of the process."""
        return self._process.pid

    def stop(self, seconds: float = 1.0) -> None:
        """End it: by closing its line and standard input and, if that does not help, by force."""
        self.channel.close()
        _end(self._process, seconds)


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
    """Whoever started this process; when it is gone, so are we."""

    def __init__(self) -> None:
        # Not through sys.stdin: Python cannot end while a thread waits within its buffer.
        self._input = sys.stdin.fileno()
        line = b""
        while not line.endswith(b"\n") and len(line) < 100:
            byte = os.read(self._input, 1)
            if not byte:
                break
            line += byte
        try:
            self.secret = bytes.fromhex(line.decode("ascii", "replace").strip())
        except ValueError:
            self.secret = b""
        if len(self.secret) != 32:
            # Whoever started us is gone already, or is a person who tries it out.
            sys.exit("This is started by Blender. Try: list, watch or descriptor." if line else 2)
        self.gone = False

    def end_with(self, seconds: float = 0.0) -> None:
        """From now on, end this process when whoever started it is gone, whatever it is doing then.

        Nobody has to ask for it: the end of standard input wakes a thread that waits for nothing
        else. No step of a simulation, no system call that never returns and nothing that Python
        would tidy up keeps the process.

        Args:
            seconds: That the process may take for what must be done before, once ``gone`` is set.
        """
        # Waiting for the end of standard input holds no lock; on Windows nothing else can.
        threading.Thread(target=self._watch, args=(seconds,), daemon=True).start()

    def _watch(self, seconds: float) -> None:
        with contextlib.suppress(OSError):
            while os.read(self._input, 4096):
                pass
        self.gone = True
        if seconds > 0.0:
            time.sleep(seconds)
        os._exit(0)

    @staticmethod
    def announce(port: int) -> None:
        """Say where we listen."""
        with contextlib.suppress(OSError):  # gone meanwhile: that is seen elsewhere
            os.write(sys.stdout.fileno(), f"{PORT_LINE}{port}\n".encode())


def end_now(status: int) -> NoReturn:
    """End this process without what Python does at its end: on a busy machine that takes long."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)
