# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding devices as they come, and opening them.

Listing what is plugged in takes milliseconds, on Windows much longer; a device that does not answer
takes seconds, and so does a service that listens and says nothing. None of that may keep the loop
from the devices that are there, nor one device from another: HID devices and services are looked
for on threads of their own, one look at a time, each device is opened on one too, and nothing is
begun while a hand holds something. (hidapi keeps Python's lock while it opens a device.)
"""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Final

from ...core.errors import DeviceError
from ..driver import DeviceLostError, Driver
from ..hid import ForceDevice, Found, HidDriver, SpaceMouse, descriptor_fingerprint, list_devices
from .haply import PORT as HAPLY_PORT
from .haply import Haply
from .network import Port
from .packets import key_in
from .simulated_hand import SimulatedHand

log = logging.getLogger(__name__)

HID_DRIVERS: Final[tuple[type[HidDriver], ...]] = (ForceDevice, SpaceMouse)
"""Every kind of HID device that there is a driver for: a new kind is one more name here."""
_EVERY: Final = 0.5
"""s between two looks at what is plugged in, where looking is cheap."""
_EVERY_COSTLY: Final = 2.0
"""s, where it is not."""
_PATIENCE: Final = 0.2
"""s that a device may take to be opened, before others are looked at."""
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
    key_file: Path | None = None
    """Where the network's key is."""


class Discovery:
    """Looks for devices as long as it is asked to; never waits.

    Raises:
        DeviceError: the port for programs has no key.
        OSError: it cannot be opened.
    """

    def __init__(self, sources: Sources) -> None:
        self._port: Port | None = None
        if sources.network and sources.key_file:
            self._port = Port(*sources.network, key_in(sources.key_file))
        self._simulated = sources.simulated
        self._searches: list[_Search] = [_HidSearch()] if sources.hid else []
        if sources.haply:
            self._searches.append(_HaplySearch(sources.haply_port))
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
        for search in self._searches:
            search.ask()
            while search.problems:
                self.problems.append(search.problems.popleft())
            while search.drivers:
                yield search.drivers.popleft()

    def lost(self, identity: str) -> None:
        """A device that was opened is gone; it may come again."""
        for search in self._searches:
            search.gone.append(identity)

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
        for search in self._searches:
            search.close()


class _Search(ABC):
    """A thread that looks; knows which devices are in use, and which could not be opened.

    It and the loop talk through the queues alone.
    """

    def __init__(self) -> None:
        self.drivers: deque[Driver] = deque()
        """Opened, to be taken by the loop."""
        self.problems: deque[DeviceError] = deque()
        self.gone: deque[str] = deque()
        """Identities of devices that the loop has lost."""
        self._used: dict[str, bytes] = {}
        """By identity, the paths of devices that are open, or are being opened."""
        self._failed: deque[tuple[str, DeviceError | None]] = deque()
        """Those that could not be opened, and why; None: there is no device after all."""
        self._refused: dict[str, float] = {}
        """By identity, since when a device could not be opened."""
        self._reported: set[str] = set()
        self._looked = -_EVERY_COSTLY
        self._asked = threading.Event()
        self._closed = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def ask(self) -> None:
        """Ask for one more look; where one is under way, it must do."""
        if self._thread.ident is None:
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
                now = time.monotonic()
                self._take_back(now)
                self._look(now)
            except Exception:
                log.exception("Looking for devices failed")
                time.sleep(_EVERY_COSTLY)

    @abstractmethod
    def _look(self, now: float) -> None:
        """Look once, and open what is new."""

    def _take_back(self, now: float) -> bool:
        """Let devices be opened again that were lost or could not be; whether there are any."""
        changed = bool(self.gone or self._failed)
        while self.gone:
            self._used.pop(self.gone.popleft(), None)
        while self._failed:
            identity, error = self._failed.popleft()
            self._used.pop(identity, None)
            if error is not None:
                self._refuse(identity, error, now)
        return changed

    def _open(self, identity: str, path: bytes, opening: Callable[[], Driver | None]) -> None:
        """Open a device: on a thread of its own, for which nobody waits for long."""
        self._used[identity] = path
        opener = threading.Thread(target=self._opened, args=(identity, opening), daemon=True)
        opener.start()
        opener.join(_PATIENCE)

    def _opened(self, identity: str, opening: Callable[[], Driver | None]) -> None:
        try:
            driver = opening()
        except DeviceError as error:
            self._failed.append((identity, error))
            return
        except Exception:
            log.exception("Opening a device failed")
            driver = None
        if driver is None:
            self._failed.append((identity, None))
            return
        self._refused.pop(identity, None)
        self._reported.discard(identity)
        self.drivers.append(driver)
        if self._closed:  # meanwhile: whoever closed has not seen this one
            with suppress(IndexError, DeviceLostError):
                self.drivers.popleft().close()

    def _refuse(self, identity: str, error: DeviceError, now: float) -> None:
        since = self._refused.setdefault(identity, now)
        if identity not in self._reported and now - since >= self.settles:
            self._reported.add(identity)
            self.problems.append(error)
            log.warning("%s", error)

    settles: ClassVar[float] = 0.0
    """s that a device may need until it can be opened; then it is reported."""


class _HaplySearch(_Search):
    """Looks for Haply's service."""

    def __init__(self, port: int) -> None:
        super().__init__()
        self._port = port

    def _look(self, now: float) -> None:
        if "haply" not in self._used and now - self._looked >= _EVERY_COSTLY:
            self._looked = now
            self._open("haply", b"", lambda: Haply.open(self._port))
            self._take_back(now)


class _HidSearch(_Search):
    """Looks for HID devices."""

    settles = _SETTLES

    def __init__(self) -> None:
        super().__init__()
        self._seen: object = object()

    def _take_back(self, now: float) -> bool:
        changed = super()._take_back(now)
        if changed:
            self._seen = object()
        return changed

    def _look(self, now: float) -> None:
        cheap = descriptor_fingerprint()
        if now - self._looked < (_EVERY_COSTLY if cheap is None else _EVERY):
            return
        self._looked = now
        if cheap is not None and cheap == self._seen and not self._refused:
            return
        self._seen = cheap
        try:
            listed = list_devices()
        except DeviceError as error:
            if "hidapi" not in self._reported:
                self._reported.add("hidapi")
                self.problems.append(error)
                log.warning("%s", error)
            return
        except OSError as error:
            log.warning("Devices cannot be listed: %s", error)
            return
        self._open_new(listed)
        self._take_back(now)

    def _open_new(self, listed: list[Found]) -> None:
        twins = [replace(each, twin=True) for each in listed]
        # What was pulled out is reported anew when it is plugged in again.
        there = {each.identity for each in (*listed, *twins)}
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
                self._open(found.identity, found.path, partial(kind.open, found))
