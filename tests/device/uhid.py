# SPDX-License-Identifier: GPL-3.0-or-later
"""HID devices that the Linux kernel takes for real ones, made through /dev/uhid.

Source of the layouts: the kernel's include/uapi/linux/uhid.h.
"""

from __future__ import annotations

import os
import select
import struct
import threading
from collections.abc import Callable
from pathlib import Path

DEVICE = Path("/dev/uhid")
WHY_NOT = (
    "no HID device can be made here: /dev/uhid is missing or may not be written "
    "(Linux, as root, after modprobe uhid)"
)

_DESTROY, _OUTPUT, _GET_REPORT, _GET_REPORT_REPLY, _CREATE2, _INPUT2 = 1, 6, 9, 10, 11, 12
_SET_REPORT, _SET_REPORT_REPLY = 13, 14
_MOST = 4096
_EVENT_BYTES = 4380
BUS_USB = 3


def available() -> bool:
    return os.access(DEVICE, os.R_OK | os.W_OK)


class VirtualDevice:
    """A device that is plugged in as long as it is open."""

    def __init__(
        self,
        name: str,
        vendor: int,
        product: int,
        descriptor: bytes,
        *,
        serial: str = "octo-test",
        features: Callable[[int], bytes] = lambda _number: b"",
    ) -> None:
        self.outputs: list[bytes] = []
        self.asked = False
        """Whether it was asked for a feature report."""
        self._hangs = False
        self._features = features
        self._file = os.open(DEVICE, os.O_RDWR)
        self._write(
            _CREATE2,
            struct.pack(
                "<128s64s64sHHIIII",
                *(name.encode(), b"octo/test", serial.encode(), len(descriptor), BUS_USB),
                *(vendor, product, 1, 0),
            )
            + descriptor,
        )
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._open = True
        self._thread.start()

    def hang(self) -> None:
        """Answer no question any more, as firmware that is stuck."""
        self._hangs = True

    @property
    def plugged_in(self) -> bool:
        return self._open

    def report(self, data: bytes) -> None:
        """Send an input report."""
        self._write(_INPUT2, struct.pack("<H", len(data)) + data)

    def unplug(self) -> None:
        if self._open:
            self._open = False
            self._thread.join()
            self._write(_DESTROY, b"")
            os.close(self._file)

    def _write(self, kind: int, body: bytes) -> None:
        os.write(self._file, struct.pack("<I", kind) + body)

    def _serve(self) -> None:
        while self._open:
            if not select.select([self._file], [], [], 0.05)[0]:
                continue
            data = os.read(self._file, _EVENT_BYTES)
            (kind,) = struct.unpack_from("<I", data)
            if kind == _OUTPUT:
                (size,) = struct.unpack_from("<H", data, 4 + _MOST)
                self.outputs.append(data[4 : 4 + size])
            elif kind == _GET_REPORT:
                self.asked = True
                if self._hangs:
                    continue
                number, report = struct.unpack_from("<IB", data, 4)
                answer = self._features(report)
                error = 0 if answer else 5
                self._write(
                    _GET_REPORT_REPLY, struct.pack("<IHH", number, error, len(answer)) + answer
                )
            elif kind == _SET_REPORT:
                (number,) = struct.unpack_from("<I", data, 4)
                self._write(_SET_REPORT_REPLY, struct.pack("<IH", number, 5))
