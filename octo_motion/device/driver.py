# SPDX-License-Identifier: GPL-3.0-or-later
"""What every device looks like to the haptic loop, whatever it is made of."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from .spatial import IDENTITY, ZERO, Quaternion, Vector


class DeviceLostError(Exception):
    """The device is gone: unplugged, out of battery, its program ended."""


class Kind(IntEnum):
    """What a device tells of the hand."""

    RATE = 0
    """How far a cap is pushed: the pointer moves with that speed (space mice)."""
    POSE = 1
    """Where the hand is: the pointer is there (force devices)."""


class Sample(NamedTuple):
    """The newest state of a device, in Blender's axes seen by the user before the screen."""

    time: float
    """When it was read, by ``time.perf_counter``."""
    position: Vector = ZERO
    """Metres from the middle of the workspace; zeros for a rate device."""
    orientation: Quaternion = IDENTITY
    velocity: Vector = ZERO
    """m/s; of a rate device: wanted speed after its response curve."""
    angular_velocity: Vector = ZERO
    """rad/s, seen from the world."""
    buttons: int = 0
    """Bit i is button i."""
    held: bool = True
    """False where a device with a sensor for it says that no hand holds it."""


@dataclass(frozen=True)
class Dynamics:
    """The mechanics of a force device, which bound how stiff a coupling stays passive."""

    force: float
    """N, the most it can give."""
    torque: float = 0.0
    """N·m, the most it can give; 0 where it gives force alone."""
    damping: float = 0.3
    """N·s/m of the device itself."""
    angular_damping: float = 0.001
    """N·m·s/rad of the device itself."""
    friction: float = 0.0
    """N, Coulomb; 0 where unknown."""
    angular_friction: float = 0.0
    """N·m, Coulomb; 0 where unknown."""
    resolution: float = 0.0
    """m of one step of its position; 0 where unknown."""
    angular_resolution: float = 0.0
    """rad of one step of its orientation; 0 where unknown."""
    delay: float = 0.0
    """s from a pose being measured to the answering force being felt, beside the loop's period."""


@dataclass(frozen=True)
class Description:
    """Who a device is."""

    name: str
    """As the artist reads it."""
    identity: str
    """The same for the same device plugged in again; different for two devices."""
    kind: Kind
    buttons: tuple[str, ...]
    dynamics: Dynamics | None = None
    """None for a device without force."""
    lasting: str = ""
    """What it is known by next time, wherever it is plugged in; its identity where empty. Two
    devices of one model without serial numbers share it."""


class Driver(Protocol):
    """One opened device. Nothing here may block: the loop calls it a thousand times a second."""

    @property
    def description(self) -> Description:
        """Who it is."""
        ...

    def read(self) -> Sample | None:
        """The newest sample since the last call, older ones dropped; None where nothing came.

        Raises:
            DeviceLostError: it is gone.
        """
        ...

    def send(self, force: Vector, torque: Vector) -> None:
        """Ask for a force on the hand until the next call.

        Raises:
            DeviceLostError: it is gone.
        """
        ...

    def close(self) -> None:
        """Take force away and let the device go; never raises, may be called twice."""
        ...


FRESH_SECONDS: Final = 0.02
"""Without fresh data for so long, in either direction, there is no force."""
