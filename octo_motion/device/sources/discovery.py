# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding devices as they come, and opening them.

Listing what is plugged in takes milliseconds, on Windows much longer; a device that does not answer
takes seconds, and so does a service that listens and says nothing. None of that may keep the loop
from the devices that are there: it is done on a thread of its own, one look at a time, and not
begun while a hand holds something.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from ...core.errors import DeviceError
from ..driver import DeviceLostError, Driver
from ..hid import ForceDevice, Found, HidDriver, SpaceMouse, descriptor_fingerprint, list_devices
from .haply import PORT as HAPLY_PORT
from .haply import Haply
from .network import Port
from .simulated_hand import SimulatedHand

log = logging.getLogger(__name__)

HID_DRIVERS: Final[tuple[type[HidDriver], ...]] = (ForceDevice, SpaceMouse)
"""Every kind of HID device that there is a driver for: a new kind is one more name here."""
_EVERY: Final = 0.5
"""s between two looks at what is plugged in, where looking is cheap."""
_EVERY_COSTLY: Final = 2.0
"""s, where it is not."""
_SETTLES: Final = 1.5
"""s that the system may take to let us read what was just plugged in; then it is reported."""


def hid_driver_for(found: Found) -> type[HidDriver] | None:
    """The first kind that an interface belongs to; None where we have no driver for it."""
    return next((each for each in HID_DRIVERS if each.drives(found)), None)


@dataclass(frozen=True)
class Sources:
    """Where to look for devices."""

    hid: bool = True
    haply: bool = True
    haply_port: int = HAPLY_PORT
    simulated: bool = False
    network: tuple[str, int] | None = None
    """udp or tcp, and the port's number."""
    key: bytes = b""
    """Of the network's packets."""


class Discovery:
    """Looks for devices as long as it is asked to; never waits."""

    def __init__(self, sources: Sources) -> None:
        self._port = Port(*sources.network, sources.key) if sources.network else None
        self._simulated = sources.simulated
        self._search = _Search(sources)
        self.problems: list[DeviceError] = []
        """What the user should know; each once."""

    def look(self) -> Iterator[Driver]:
        """The devices that have come since the last look, opened."""
        if self._simulated:
            self._simulated = False
            yield SimulatedHand()
        if self._port is not None:
            device = self._port.device()
            if device is not None:
                yield device
        self._search.ask()
        while self._search.problems:
            self.problems.append(self._search.problems.popleft())
        while self._search.drivers:
            yield self._search.drivers.popleft()

    def lost(self, identity: str) -> None:
        """A device that was opened is gone; it may come again."""
        self._search.gone.append(identity)

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
        self._search.close()


class _Search:
    """The thread that looks; knows which devices are in use, and which could not be opened.

    It and the loop talk through the queues alone.
    """

    def __init__(self, sources: Sources) -> None:
        self.drivers: deque[Driver] = deque()
        """Opened, to be taken by the loop."""
        self.problems: deque[DeviceError] = deque()
        self.gone: deque[str] = deque()
        """Identities of devices that the loop has lost."""
        self._sources = sources
        self._used: dict[str, bytes] = {}
        """By identity, the paths of devices that are open."""
        self._refused: dict[str, float] = {}
        """By identity, since when a device could not be opened."""
        self._reported: set[str] = set()
        self._seen: object = object()
        self._looked = self._looked_for_haply = -_EVERY_COSTLY
        self._asked = threading.Event()
        self._closed = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def ask(self) -> None:
        """Ask for one more look; where one is under way, it must do."""
        if self._thread.ident is None and (self._sources.hid or self._sources.haply):
            self._thread.start()
        self._asked.set()

    def close(self) -> None:
        """Look no more; what was found and not taken is closed."""
        self._closed = True
        self._asked.set()
        while self.drivers:
            self.drivers.popleft().close()

    def _run(self) -> None:
        # One thread for all looks: on a Mac hidapi hears of new devices on the first one's alone.
        while self._asked.wait() and not self._closed:
            self._asked.clear()
            try:
                self._look()
            except Exception:
                log.exception("Looking for devices failed")
                time.sleep(_EVERY_COSTLY)

    def _look(self) -> None:
        now = time.monotonic()
        while self.gone:
            self._used.pop(self.gone.popleft(), None)
            self._seen = object()
        costly = now - self._looked_for_haply >= _EVERY_COSTLY
        if self._sources.haply and "haply" not in self._used and costly:
            self._looked_for_haply = now
            self._open("haply", b"", lambda: Haply.open(self._sources.haply_port), now, settles=0.0)
        if self._sources.hid:
            self._look_for_hid(now)

    def _look_for_hid(self, now: float) -> None:
        cheap = descriptor_fingerprint()
        if now - self._looked < (_EVERY_COSTLY if cheap is None else _EVERY):
            return
        self._looked = now
        if cheap is not None and cheap == self._seen and not self._refused.keys() - {"haply"}:
            return
        self._seen = cheap
        try:
            listed = list_devices()
        except DeviceError as error:
            self._refuse("hidapi", error, now, settles=0.0)
            return
        except OSError as error:
            log.warning("Devices cannot be listed: %s", error)
            return
        twins = [replace(each, twin=True) for each in listed]
        # What was pulled out is reported anew when it is plugged in again.
        there = {each.identity for each in (*listed, *twins)} | {"haply"}
        for identity in self._refused.keys() - there:
            del self._refused[identity]
            self._reported.discard(identity)
        paths = {each.path for each in listed}
        for each in listed:
            if each.path in self._used.values():
                continue
            found = each
            in_use = self._used.get(each.identity)
            if in_use is not None:
                if in_use not in paths:
                    continue  # the same device, plugged in again before its loss was noticed
                found = replace(each, twin=True)
            kind = hid_driver_for(found)
            if kind is not None:
                self._open(found.identity, found.path, partial(kind.open, found), now)

    def _open(
        self,
        identity: str,
        path: bytes,
        opening: Callable[[], Driver | None],
        now: float,
        settles: float = _SETTLES,
    ) -> None:
        try:
            driver = opening()
        except DeviceError as error:
            self._refuse(identity, error, now, settles)
            return
        if driver is None:
            return
        self._used[identity] = path
        self._refused.pop(identity, None)
        self._reported.discard(identity)
        self.drivers.append(driver)
        if self._closed:  # meanwhile: whoever closed has not seen this one
            with suppress(IndexError, DeviceLostError):
                self.drivers.popleft().close()

    def _refuse(self, identity: str, error: DeviceError, now: float, settles: float) -> None:
        since = self._refused.setdefault(identity, now)
        if identity not in self._reported and now - since >= settles:
            self._reported.add(identity)
            self.problems.append(error)
            log.warning("%s", error)
