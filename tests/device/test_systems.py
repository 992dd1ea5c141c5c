# SPDX-License-Identifier: GPL-3.0-or-later
"""What Windows and macOS do otherwise: libraries, locks, drivers that keep a device, consoles."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from octo_motion.core.errors import DeviceError
from octo_motion.core.processes import python as own_python
from octo_motion.core.processes.python import LAUNCHER
from octo_motion.device.haptics import schedule
from octo_motion.device.hid import system
from octo_motion.device.ipc import process
from octo_motion.device.ipc.client import Client
from octo_motion.device.ipc.process import Child
from tests.device.bridges import OPTIONS
from tests.device.parts import found, wait_for

OTHERS = ["win32", "darwin"]
REPOSITORY = Path(__file__).resolve().parents[2]


# --- Starting ------------------------------------------------------------------------------------


class Started(Exception):  # noqa: N818 - no error
    """What a process would have been started with."""

    def __init__(self, command: list[str], options: dict[str, Any]) -> None:
        super().__init__()
        self.command, self.options = command, options


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(command: list[str], **options: Any) -> None:
        raise Started(command, options)

    monkeypatch.setattr(own_python.subprocess, "Popen", start)


@pytest.mark.usefixtures("started")
def test_blenders_python_finds_the_c_runtime_that_blender_brings(tmp_path: Path) -> None:
    """It lies beside blender.exe, which alone looks there."""
    python = tmp_path / "4.5" / "python" / "bin" / "python.exe"
    with pytest.raises(Started) as without:
        Child.start(["bridge"], python)
    assert "--dlls" not in without.value.command
    assert without.value.options["env"] is None
    runtime = tmp_path / "blender.crt"
    runtime.mkdir()
    with pytest.raises(Started) as given:
        Child.start(["bridge"], python)
    command = given.value.command
    assert command[command.index("--dlls") + 1] == str(runtime)
    assert given.value.options["env"]["PATH"].startswith(str(runtime))


def test_launcher_takes_the_folder_of_libraries_and_no_program_sees_it(tmp_path: Path) -> None:
    command = [sys.executable, "-I", LAUNCHER, process.PROGRAM, "descriptor", "--dlls", tmp_path]
    run = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("0x06")


@pytest.mark.parametrize("status", [0xC0000135, 0xC0000135 - (1 << 32)])
def test_library_that_windows_lacks_is_told_by_its_name(status: int) -> None:
    error = process._silent(status, None)
    assert "VCRUNTIME140.dll" in error.problem
    assert "Redistributable" in error.remedy
    assert "VCRUNTIME" not in process._silent(1, None).problem


def test_messages_of_the_bridge_are_in_a_file_that_is_named(tmp_path: Path) -> None:
    log = tmp_path / "Ünder" / "device.log"
    client = Client(log_file=log)
    try:
        client.start(OPTIONS)
        wait_for(lambda: (client.poll(), client.devices)[1])
    finally:
        client.stop()
    assert "Found: Simulated hand" in log.read_text(encoding="utf-8")
    silent = process._silent(1, log)
    assert str(log) in silent.remedy


@pytest.mark.usefixtures("started")
def test_blender_without_a_console_hands_none_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows refuses to start a process with a console that is not there: WinError 6."""
    monkeypatch.setattr(process.sys, "stderr", None)
    with pytest.raises(Started) as given:
        Child.start(["bridge"], Path(sys.executable))
    assert given.value.options["stderr"] == subprocess.DEVNULL


@pytest.mark.parametrize("theirs", [None, "4"])
def test_small_arrays_wait_for_no_threads_whatever_library_numpy_has(theirs: str | None) -> None:
    """OpenBLAS, OpenMP, Intel's, and Accelerate of macOS; what somebody has set is left alone."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    environment = {name: value for name, value in os.environ.items() if name not in names}
    if theirs:
        environment |= dict.fromkeys(names, theirs)
    script = (
        "import sys, octo_motion.device.__main__, os; assert 'numpy' not in sys.modules; "
        f"print(*(os.environ.get(name) for name in {names}))"
    )
    run = subprocess.run(
        [sys.executable, "-c", script],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    assert run.stdout.split() == [theirs or "1"] * 4


# --- HID -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("platform", OTHERS)
def test_space_mouse_that_its_own_driver_has_is_pushed_not_plugged_in_again(
    monkeypatch: pytest.MonkeyPatch, platform: str
) -> None:
    monkeypatch.setattr(system.sys, "platform", platform)
    mouse = system._refusal(found())
    assert "own driver" in mouse.problem
    assert "just push it" in mouse.remedy
    other = system._refusal(replace(found(), page=0xFF4F, usage=1))
    assert "Plug it in again" in other.remedy


def missing(monkeypatch: pytest.MonkeyPatch, error: ImportError) -> DeviceError:
    def load(_name: str) -> None:
        raise error

    monkeypatch.setattr(system.importlib, "import_module", load)
    with pytest.raises(DeviceError) as told:
        system.hidapi()
    return told.value


def test_library_that_the_system_refuses_is_told_with_the_systems_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(system.sys, "platform", "darwin")
    told = missing(monkeypatch, ImportError("code signature not valid for use in process"))
    assert "code signature not valid" in told.problem
    assert "Privacy & Security" in told.remedy


@pytest.mark.parametrize(
    ("platform", "machine", "made"),
    [
        ("win32", "ARM64", False),
        ("linux", "aarch64", False),
        ("darwin", "x86_64", False),
        ("win32", "AMD64", True),
        ("linux", "x86_64", True),
        ("darwin", "arm64", True),
    ],
)
def test_computer_for_which_no_hidapi_is_made_is_told_so(
    monkeypatch: pytest.MonkeyPatch, platform: str, machine: str, *, made: bool
) -> None:
    monkeypatch.setattr(system.sys, "platform", platform)
    monkeypatch.setattr(system.platform, "machine", lambda: machine)
    told = missing(monkeypatch, ModuleNotFoundError("hid"))
    assert ("this Python has no hidapi" in told.problem) == made
    assert ("All else works" in told.remedy) == (not made)


class Kernel:
    """As much of kernel32 as is asked: mutexes by name, and what was asked for."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.names: dict[int, str] = {}
        self.error = 0

    def __getattr__(self, name: str) -> Any:
        def call(*given: Any) -> int:
            self.asked.append(name)
            if name == "CreateMutexW":
                self.error = 183 if given[2] in self.names.values() else 0
                self.names[len(self.asked)] = given[2]
                return len(self.asked)
            if name == "CloseHandle":
                del self.names[given[0].value]
            return 1

        function = SimpleNamespace(restype=None)
        return type("Function", (), {"__call__": staticmethod(call), **vars(function)})()


def test_two_blenders_do_not_push_one_device_on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    if sys.platform != "win32":
        kernel = Kernel()
        monkeypatch.setattr(system.sys, "platform", "win32")
        monkeypatch.setattr(ctypes, "WinDLL", lambda *_, **__: kernel, raising=False)
        monkeypatch.setattr(ctypes, "get_last_error", lambda: kernel.error, raising=False)
    device = replace(found(), path=b"\\\\?\\HID#VID_1209")
    set_free = system.claim(device)
    with pytest.raises(DeviceError, match="in use by another Blender"):
        system.claim(replace(device, path=device.path.lower()))
    system.claim(replace(device, path=b"another"))()
    set_free()
    system.claim(device)()


# --- Keeping time --------------------------------------------------------------------------------


def test_windows_raises_the_loop_and_leaves_its_timers_exact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kernel = Kernel()
    if sys.platform != "win32":
        monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=kernel), raising=False)
        assert schedule._raised_on_windows()
        wanted = {"SetProcessInformation", "SetPriorityClass", "SetThreadPriority"}
        assert wanted <= set(kernel.asked)
    else:
        assert schedule._raised_on_windows()


def test_mac_is_told_that_somebody_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[int, int]] = []

    def pthread(kind: int, rest: int) -> int:
        told.append((kind, rest))
        return 0

    library = SimpleNamespace(pthread_set_qos_class_self_np=pthread)
    monkeypatch.setattr(ctypes, "CDLL", lambda _name: library)
    assert schedule._raised_on_a_mac()
    assert told == [(0x21, 0)]


def test_loop_on_windows_is_not_awake_all_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that waits awake for 2 ms before each of a thousand ticks burns a processor."""
    assert schedule._AWAKE < 0.001
    source = Path(schedule.__file__).read_text(encoding="utf-8")
    monkeypatch.setattr(sys, "platform", "win32")
    names: dict[str, Any] = {"__name__": schedule.__name__, "__package__": schedule.__package__}
    exec(compile(source, schedule.__file__, "exec"), names)  # noqa: S102 - our own module
    assert names["_AWAKE"] < 0.001
