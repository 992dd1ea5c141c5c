# SPDX-License-Identifier: GPL-3.0-or-later
"""HID devices of this machine through hidapi: which there are, and opening them.

hidapi has two modules. ``hidraw`` reads Linux's /dev/hidraw*: any HID device, USB or Bluetooth,
beside whatever else reads it. ``hid`` is the one for Windows and macOS; on Linux it would talk to
USB directly and take the device away from the rest of the system.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import os
import platform
import sys
import threading
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, ClassVar, Final, Protocol

from ...core.errors import DeviceError
from ...core.phrases import phrase
from ...core.rotations.scalars import Vector
from ..driver import Description, DeviceLostError, Driver, Dynamics, Kind

MULTI_AXIS: Final = (0x01, 0x08)
"""Usage page and usage of a space mouse, which Blender may have itself."""

UDEV_FILE: Final = "/etc/udev/rules.d/70-octo-motion.rules"
_MOST_REPORT_BYTES: Final = 256
_MOST_REPORTS: Final = 64
_WRITES_IN: Final = 0.0005
_CLOSES_IN: Final = 0.05
"""s for a device to take a report, and its last one."""


class Handle(Protocol):
    """The part of ``hid.device`` that is used here."""

    def read(self, max_length: int, /) -> list[int]:
        """One report, or nothing."""
        ...

    def write(self, buff: bytes, /) -> int:
        """Bytes written, or −1."""
        ...

    def get_feature_report(self, report_num: int, max_length: int, /) -> list[int]:
        """One feature report with its number."""
        ...

    def close(self) -> None:
        """Let the device go."""


@dataclass(frozen=True)
class Found:
    """A HID interface that the system lists."""

    path: bytes
    vendor: int
    product: int
    page: int
    usage: int
    name: str
    serial: str
    twin: bool = False
    """Whether another one that is there has the same serial number."""

    @property
    def identity(self) -> str:
        """The same when the device is plugged in again, as far as it has a serial number."""
        own = self.path.hex() if self.twin or not self.serial else self.serial
        return f"{self.vendor:04x}:{self.product:04x}:{own}"

    @property
    def lasting(self) -> str:
        """The same wherever it is plugged in; without serial numbers all of a model share it."""
        return f"{self.vendor:04x}:{self.product:04x}:{self.serial}"


def hidapi() -> Any:
    """The module that reads HID devices on this system.

    Raises:
        DeviceError: hidapi is not there, or the system refuses to load it.
    """
    names = ("hidraw", "hid") if sys.platform == "linux" else ("hid",)
    refused: ImportError | None = None
    for name in names:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError:
            continue
        except ImportError as error:  # there, but not loaded: a signature, a library that it needs
            refused = error
    if refused is not None:
        raise DeviceError(
            phrase(
                "Devices cannot be read: the system refuses hidapi ({refused}).", refused=refused
            ),
            "On a Mac, allow it in System Settings, Privacy & Security; else install the extension "
            "anew.",
        ) from refused
    if (sys.platform, platform.machine().lower()) in _WITHOUT_WHEELS:
        raise DeviceError(
            "Devices cannot be read: hidapi is not made for computers like this one.",
            "All else works: space mice that Blender has itself, and programs that are devices.",
        )
    raise DeviceError(
        "Devices cannot be read: this Python has no hidapi.",
        "Install the extension from its zip, which brings it, or run pip install hidapi.",
    )


_WITHOUT_WHEELS: Final = {
    ("win32", "arm64"),
    ("linux", "aarch64"),
    ("darwin", "x86_64"),
}
"""System and processor for which there is no hidapi to be brought, in each Python of Blender's."""


@cache
def why_not_read() -> DeviceError | None:
    """Why no HID device can be read here, and what to do; None where they can."""
    try:
        hidapi()
    except DeviceError as error:
        return error
    return None


def list_devices() -> list[Found]:
    """Every HID interface that there is."""
    return [
        Found(
            path=each["path"],
            vendor=each["vendor_id"],
            product=each["product_id"],
            page=each["usage_page"],
            usage=each["usage"],
            name=_text(each.get("product_string")),
            serial=_text(each.get("serial_number")),
        )
        for each in hidapi().enumerate()
    ]


def _text(value: object) -> str:
    """What a device says of itself, fit to be shown."""
    return "".join(each for each in str(value or "") if each.isprintable())[:64].strip()


def descriptor_fingerprint() -> object:
    """Something cheap that changes whenever a device comes or goes; None where there is no such.

    Listing devices takes milliseconds, too long beside a loop of 1 kHz.
    """
    if sys.platform != "linux":
        return None
    try:
        return tuple(sorted(os.listdir("/sys/class/hidraw")))  # noqa: PTH208 - names, quickly
    except OSError:
        return ()


def open_device(found: Found) -> Handle:
    """Open a device without waiting for its reports.

    Raises:
        DeviceError: the system does not let us, with the rule to add on Linux; or it is gone.
    """
    device = hidapi().device()
    try:
        device.open_path(found.path)
    except OSError as error:
        raise _refusal(found) from error
    device.set_nonblocking(1)
    return device


def claim(found: Found) -> Callable[[], None]:
    """Keep others of us from a device that is open: two forces in turn would shake the hand.

    On Linux and Windows; on a Mac the system does it. What comes back sets it free again; so does
    the end of this process.

    Raises:
        DeviceError: another Blender has it.
    """
    if sys.platform == "win32":
        return _claim_on_windows(found)
    if sys.platform != "linux":
        return lambda: None
    import fcntl  # noqa: PLC0415 - Linux's

    try:
        number = os.open(found.path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return lambda: None  # pulled out meanwhile: whoever reads it will see
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(number)
        raise _in_use(found) from error
    return partial(os.close, number)


_EXISTS: Final = 183
"""ERROR_ALREADY_EXISTS"""


def _claim_on_windows(found: Found) -> Callable[[], None]:
    """A mutex with the device's name: Windows keeps it as long as a process has it."""
    # What other systems lack of it.
    windows: Any = ctypes
    kernel = windows.WinDLL("kernel32", use_last_error=True)
    kernel.CreateMutexW.restype = ctypes.c_void_p
    name = hashlib.sha256(found.path.lower()).hexdigest()[:32]
    mutex = kernel.CreateMutexW(None, False, f"octo-motion-device-{name}")  # noqa: FBT003 - its order
    taken = windows.get_last_error() == _EXISTS
    set_free = partial(kernel.CloseHandle, ctypes.c_void_p(mutex))
    if taken:
        set_free()
        raise _in_use(found)
    return set_free


def _in_use(found: Found) -> DeviceError:
    return DeviceError(
        phrase("{name} is in use by another Blender.", name=found.name or phrase("The device")),
        "End Pose with Device there.",
    )


def _refusal(found: Found) -> DeviceError:
    name = found.name or phrase("The device")
    if sys.platform == "linux":
        path = Path(os.fsdecode(found.path))
        if path.exists() and not os.access(path, os.R_OK | os.W_OK):
            pushed = (found.page, found.usage) == MULTI_AXIS
            begin = (
                phrase("If Blender has it itself, just push it. Else, as root,")
                if pushed
                else phrase("As root,")
            )
            return DeviceError(
                phrase(
                    "{name} is plugged in, but this user may not read {path}.", name=name, path=path
                ),
                phrase(
                    "{begin} write this line into {file}, then plug the device in again: {rule}",
                    begin=begin,
                    file=UDEV_FILE,
                    rule=udev_rule(found.vendor, found.product),
                ),
            )
    elif (found.page, found.usage) == MULTI_AXIS:
        # 3Dconnexion's driver has it alone; two that read it would both move something.
        return DeviceError(
            phrase("{name} belongs to its own driver.", name=name),
            "Blender has it itself then: just push it.",
        )
    return DeviceError(
        phrase("{name} cannot be opened.", name=name),
        "Plug it in again, and close other programs that use it alone.",
    )


def udev_rule(vendor: int, product: int) -> str:
    """The line that lets whoever sits at this Linux machine read a device, on USB and Bluetooth."""
    return f'SUBSYSTEM=="hidraw", KERNELS=="*:{vendor:04X}:{product:04X}.*", TAG+="uaccess"'


def descriptor_of(device: Any) -> bytes | None:
    """A device's report descriptor, where system and version of hidapi hand it over."""
    try:
        return bytes(device.get_report_descriptor())
    except (OSError, AttributeError, ValueError):
        return None


class HidDriver(Driver):
    """A device that is an interface of the system's list.

    Raises:
        DeviceLostError: it was unplugged or closed, and is read or written.
    """

    name: ClassVar[str]
    """Of the kind, as ``python -m octo_motion.device list`` calls it."""

    def __init__(
        self,
        found: Found,
        handle: Handle,
        kind: Kind,
        buttons: tuple[str, ...],
        *,
        name: str = "",
        dynamics: Dynamics | None = None,
    ) -> None:
        super().__init__(
            Description(
                name=name or found.name or self.name.capitalize(),
                identity=found.identity,
                lasting=found.lasting,
                kind=kind,
                buttons=buttons,
                dynamics=dynamics,
            )
        )
        self._handle: Handle | None = handle
        self._writer: _Writer | None = None

    @classmethod
    @abstractmethod
    def drives(cls, found: Found) -> bool:
        """Whether an interface that the system lists is such a device."""

    @classmethod
    @abstractmethod
    def open(cls, found: Found) -> HidDriver:
        """Open a device that was found.

        Raises:
            DeviceError: the system does not let us, or the device is none that can be used.
        """

    def reports(self) -> list[bytes]:
        """All reports that wait, oldest first. More than 64 are the next call's."""
        reports: list[bytes] = []
        for _ in range(_MOST_REPORTS):
            try:
                data = self._there().read(_MOST_REPORT_BYTES)
            except (OSError, ValueError) as error:
                raise DeviceLostError(self.description.name) from error
            if not data:
                break
            reports.append(bytes(data))
        return reports

    def write(self, report: bytes) -> None:
        """Hand a report over; one that has not been sent when the next comes is left out."""
        handle = self._there()
        if self._writer is None:
            self._writer = _Writer(handle)
        if not self._writer.write(report):
            raise DeviceLostError(self.description.name)

    def send(self, force: Vector, torque: Vector) -> None:
        """Nothing, where a device has no motors."""

    def close(self) -> None:
        handle, self._handle = self._handle, None
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
        elif handle is not None:
            handle.close()

    def _there(self) -> Handle:
        if self._handle is None:
            raise DeviceLostError(self.description.name)
        return self._handle


class _Writer:
    """A thread that writes the newest report to a device, and in the end closes it.

    The system takes up to a second for a report to a device that does not listen, and a millisecond
    for one that does. The loop waits for half of that, and then not until it has been taken.
    """

    def __init__(self, handle: Handle) -> None:
        self._failed = False
        """Whether the device is gone."""
        self._handle = handle
        self._report = b""
        self._closing = False
        self._wanted, self._done = threading.Event(), threading.Event()
        self._done.set()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def write(self, report: bytes) -> bool:
        """Hand a report over; False where the device is known to be gone."""
        idle = self._done.is_set()
        self._report = report
        self._done.clear()
        self._wanted.set()
        if idle:
            self._done.wait(_WRITES_IN)
        return not self._failed

    def close(self) -> None:
        """Write what was handed over last, and close; whoever waits, waits for a moment alone."""
        self._closing = True
        self._wanted.set()
        self._thread.join(_CLOSES_IN)

    def _run(self) -> None:
        while self._wanted.wait():
            self._wanted.clear()
            closing, report = self._closing, self._report
            self._report = b""
            try:
                if report and not self._failed:
                    self._failed = self._handle.write(report) < 0
            except (OSError, ValueError):
                self._failed = True
            if not self._report:
                self._done.set()
            if closing:
                self._handle.close()
                return
