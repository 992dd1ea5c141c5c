# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding devices as they come, and opening them."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from ..core.errors import DeviceError
from .driver import Driver
from .haply import PORT as HAPLY_PORT
from .haply import Haply
from .hid import system
from .hid.force_device import ForceDevice, is_force_device
from .hid.response import Response
from .hid.space_mouse import SpaceMouse, is_space_mouse
from .network import Port
from .simulated_hand import SimulatedHand

log = logging.getLogger(__name__)

_EVERY: Final = 0.5
"""s between two looks at what is plugged in, where looking is cheap."""
_EVERY_COSTLY: Final = 2.0
"""s, where it is not."""


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
    """Looks for devices; knows which are in use, and which could not be opened."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._port = Port(*sources.network, sources.key) if sources.network else None
        self._used: set[str] = set()
        self._refused: set[str] = set()
        self._seen: object = object()
        self._looked = self._looked_for_haply = -_EVERY_COSTLY
        self.problems: list[DeviceError] = []
        """What the user should be told; each once."""

    def look(self) -> Iterator[Driver]:
        """Open what has come since the last look. May take milliseconds: not while a hand holds."""
        now = time.monotonic()
        if self._sources.simulated and "simulated" not in self._used:
            self._used.add("simulated")
            yield SimulatedHand()
        if self._port is not None:
            device = self._port.device()
            if device is not None:
                self._used.add(device.description.identity)
                yield device
        if self._sources.haply and "haply" not in self._used:
            yield from self._look_for_haply(now)
        if self._sources.hid:
            yield from self._look_for_hid(now)

    def lost(self, identity: str) -> None:
        """A device that was opened is gone; it may come again."""
        self._used.discard(identity)
        self._seen = object()

    def close(self) -> None:
        """Look no more."""
        if self._port is not None:
            self._port.close()

    def _look_for_haply(self, now: float) -> Iterator[Driver]:
        if now - self._looked_for_haply < _EVERY_COSTLY:
            return
        self._looked_for_haply = now
        try:
            device = Haply.open(self._sources.haply_port)
        except DeviceError as error:
            self._refuse("haply", error)
            return
        if device is not None:
            self._used.add("haply")
            yield device

    def _look_for_hid(self, now: float) -> Iterator[Driver]:
        cheap = system.fingerprint()
        if now - self._looked < (_EVERY_COSTLY if cheap is None else _EVERY):
            return
        self._looked = now
        if cheap is not None and cheap == self._seen and not self._refused:
            return
        self._seen = cheap
        try:
            found = system.list_devices()
        except DeviceError as error:
            self._refuse("hidapi", error)
            return
        except OSError as error:
            log.warning("Devices cannot be listed: %s", error)
            return
        self._refused &= {each.identity for each in found} | {"haply", "hidapi"}
        for each in found:
            if each.identity in self._used:
                continue
            driver = self._open(each)
            if driver is not None:
                self._used.add(each.identity)
                self._refused.discard(each.identity)
                yield driver

    def _open(self, found: system.Found) -> Driver | None:
        try:
            if is_force_device(found):
                return ForceDevice.open(found)
            if is_space_mouse(found):
                return SpaceMouse.open(found, Response())
        except DeviceError as error:
            self._refuse(found.identity, error)
        return None

    def _refuse(self, identity: str, error: DeviceError) -> None:
        if identity not in self._refused:
            self._refused.add(identity)
            self.problems.append(error)
            log.warning("%s", error)
