# SPDX-License-Identifier: GPL-3.0-or-later
"""HID devices of this machine through hidapi: which there are, and opening them.

hidapi has two modules. ``hidraw`` reads Linux's /dev/hidraw*: any HID device, USB or Bluetooth,
beside whatever else reads it. ``hid`` is the one for Windows and macOS; on Linux it would talk to
USB directly and take the device away from the rest of the system.
"""

from __future__ import annotations

import importlib
import os
import sys
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final, Protocol

from ...core.errors import DeviceError
from ...core.rotations.scalars import Vector
from ..driver import Description, DeviceLostError, Driver, Dynamics, Kind

MULTI_AXIS: Final = (0x01, 0x08)
"""Usage page and usage of a space mouse, which Blender may have itself."""

UDEV_FILE: Final = "/etc/udev/rules.d/70-octo-motion.rules"
_MOST_REPORT_BYTES: Final = 256
_MOST_REPORTS: Final = 64


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
        DeviceError: hidapi is not there.
    """
    names = ("hidraw", "hid") if sys.platform == "linux" else ("hid",)
    for name in names:
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    raise DeviceError(
        "Devices cannot be read: this Python has no hidapi.",
        "Install the extension from its zip, which brings it, or run pip install hidapi.",
    )


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

    On Linux alone; elsewhere nothing is kept from anyone. What comes back sets it free again; so
    does the end of this process.

    Raises:
        DeviceError: another Blender has it.
    """
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
        raise DeviceError(
            f"{found.name or 'The device'} is in use by another Blender.",
            "End Pose with Device there.",
        ) from error
    return partial(os.close, number)


def _refusal(found: Found) -> DeviceError:
    name = found.name or "The device"
    if sys.platform == "linux":
        path = Path(os.fsdecode(found.path))
        if path.exists() and not os.access(path, os.R_OK | os.W_OK):
            pushed = (found.page, found.usage) == MULTI_AXIS
            begin = (
                "If Blender has it itself, just push it. Else, as root," if pushed else "As root,"
            )
            return DeviceError(
                f"{name} is plugged in, but this user may not read {path}.",
                f"{begin} write this line into {UDEV_FILE}, then plug the device in again: "
                f"{udev_rule(found.vendor, found.product)}",
            )
    return DeviceError(
        f"{name} cannot be opened.",
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
        try:
            written = self._there().write(report)
        except (OSError, ValueError) as error:
            raise DeviceLostError(self.description.name) from error
        if written < 0:
            raise DeviceLostError(self.description.name)

    def send(self, force: Vector, torque: Vector) -> None:
        """Nothing, where a device has no motors."""

    def close(self) -> None:
        if self._handle is not None:
            self._handle.close()
            self._handle = None

    def _there(self) -> Handle:
        if self._handle is None:
            raise DeviceLostError(self.description.name)
        return self._handle
