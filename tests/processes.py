# SPDX-License-Identifier: GPL-3.0-or-later
"""Other processes, on any system: which there are below one, whether they run, and their end.

``os.kill`` with 0 asks on Linux and macOS, and is Ctrl-C on Windows; SIGKILL is not there.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any


def alive(process: int) -> bool:
    """Whether a process runs; one that ended and waits to be asked why does not."""
    return process in _running()


def children_of(process: int) -> list[int]:
    """Processes that a process has started, and those that these have, the oldest first.

    On Windows the Python of an environment starts the one that it is made of: there are more of
    them than were asked for.
    """
    found = [process]
    parents = _running()
    for each in found:
        found += sorted(child for child, parent in parents.items() if parent == each)
    return found[1:]


def end(process: int) -> None:
    """End a process at once, without a chance to say anything."""
    os.kill(process, getattr(signal, "SIGKILL", signal.SIGTERM))


def has_console() -> bool:
    """Whether processes can be asked to stop: on Windows it is their console that does."""
    if sys.platform != "win32":
        return True
    windows: Any = ctypes
    return bool(windows.WinDLL("kernel32").GetConsoleProcessList((ctypes.c_uint32 * 1)(), 1))


def processor_seconds(process: int) -> float:
    """Time that processors have worked for a process, in s."""
    if sys.platform == "linux":
        fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2]
        ticks = sum(map(int, fields.split()[11:13]))
        return ticks / os.sysconf("SC_CLK_TCK")
    if sys.platform == "win32":
        windows: Any = ctypes
        kernel = windows.WinDLL("kernel32")
        kernel.OpenProcess.restype = ctypes.c_void_p
        handle = ctypes.c_void_p(kernel.OpenProcess(_QUERY, 0, process))
        times = [ctypes.c_uint64() for _ in range(4)]
        kernel.GetProcessTimes(handle, *map(ctypes.byref, times))
        kernel.CloseHandle(handle)
        return 1e-7 * (times[2].value + times[3].value)
    command = ["ps", "-o", "time=", "-p", str(process)]
    told = subprocess.run(command, capture_output=True, encoding="utf-8", check=True).stdout
    minutes, seconds = told.strip().split(":")[-2:]
    return 60.0 * int(minutes) + float(seconds)


_QUERY = 0x1000
"""PROCESS_QUERY_LIMITED_INFORMATION"""


def _running() -> dict[int, int]:
    """The parent of each process that runs."""
    if sys.platform == "linux":
        return _from_proc()
    if sys.platform == "win32":
        return _from_windows()
    command = ["ps", "-A", "-o", "pid=,ppid=,stat="]
    listed = subprocess.run(command, capture_output=True, encoding="utf-8", check=True).stdout
    rows = [line.split() for line in listed.splitlines()]
    return {int(row[0]): int(row[1]) for row in rows if not row[2].startswith("Z")}


def _from_proc() -> dict[int, int]:
    found: dict[int, int] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = path.read_text(encoding="utf-8").rpartition(")")[2].split()[:2]
        except OSError:
            continue  # it has ended meanwhile
        if state != "Z":
            found[int(path.parent.name)] = int(parent)
    return found


class _Entry(ctypes.Structure):
    """PROCESSENTRY32 of Windows' list of processes."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("usage", ctypes.c_uint32),
        ("process", ctypes.c_uint32),
        ("heap", ctypes.c_void_p),
        ("module", ctypes.c_uint32),
        ("threads", ctypes.c_uint32),
        ("parent", ctypes.c_uint32),
        ("priority", ctypes.c_long),
        ("flags", ctypes.c_uint32),
        ("file", ctypes.c_char * 260),
    )


_ALL_PROCESSES = 2
_WINDOWS_OWN = {b"conhost.exe"}
"""What Windows starts beside a program: its console."""


def _from_windows() -> dict[int, int]:
    windows: Any = ctypes
    kernel = windows.WinDLL("kernel32")
    kernel.CreateToolhelp32Snapshot.restype = ctypes.c_void_p
    snapshot = ctypes.c_void_p(kernel.CreateToolhelp32Snapshot(_ALL_PROCESSES, 0))
    entry = _Entry(size=ctypes.sizeof(_Entry))
    found: dict[int, int] = {}
    goes_on = kernel.Process32First(snapshot, ctypes.byref(entry))
    while goes_on:
        if entry.file.lower() not in _WINDOWS_OWN:
            found[int(entry.process)] = int(entry.parent)
        goes_on = kernel.Process32Next(snapshot, ctypes.byref(entry))
    kernel.CloseHandle(snapshot)
    return found
