# SPDX-License-Identifier: GPL-3.0-or-later
"""What every device looks like to the haptic loop, whatever it is made of.

A driver says what its device says, in Blender's axes. What is the same for all devices is none of
its business: the loop applies zero and range (``calibration``) and, for a rate device, the artist's
response curve (``response``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from ..core.rotations.scalars import IDENTITY, ZERO, Quaternion, Vector

Axes = tuple[float, float, float, float, float, float]
"""Along X, Y, Z, then about X, Y, Z; Blender's axes."""


def six(values: Iterable[float]) -> Axes:
    """So many numbers, as a type checker wants them."""
    a, b, c, d, e, f = map(float, values)
    return (a, b, c, d, e, f)


FRESH_SECONDS: Final = 0.02
"""Without fresh data for so long, in either direction, there is no force."""
FARTHEST: Final = 10.0
"""m: a hand is never farther from its device's middle."""
FASTEST: Final = 1000.0
"""m/s and rad/s: no hand is as fast."""


class DeviceLostError(Exception):
    """The device is gone: unplugged, out of battery, its program ended."""


class Kind(IntEnum):
    """What a device measures."""

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
    """m/s; of a rate device it follows from the push, see ``calibration.corrected``."""
    angular_velocity: Vector = ZERO
    """rad/s, seen from the world."""
    buttons: int = 0
    """Bit i is button i."""
    held: bool = True
    """False where a device with a sensor for it says that no hand holds it."""
    push: Axes | None = None
    """Of a rate device: −1…1 by the maker's range; None while it is silent, as it is at rest."""
    clock: float | None = None
    """s of the device's own clock when the pose was measured; None where it tells none."""
    delay: float = 0.0
    """s since the newest force that had reached the device then was sent; 0: it does not tell."""


class SentTimes:
    """When each of the last commands to a device was sent, by its sequence."""

    def __init__(self) -> None:
        self._times = [(0, 0.0)] * 1024

    def note(self, sequence: int, now: float) -> None:
        """A command was sent (s)."""
        self._times[sequence % len(self._times)] = (sequence, now)

    def since(self, sequence: int, now: float) -> float:
        """S since a command was sent; 0 for one that never was, or very long ago."""
        kept, sent = self._times[sequence % len(self._times)]
        return now - sent if sequence and kept == sequence else 0.0


def is_possible(sample: Sample) -> bool:
    """Whether a hand can be there and be as fast; no number that is not finite is possible."""
    return all(-FARTHEST <= each <= FARTHEST for each in sample.position) and all(
        -FASTEST <= each <= FASTEST for each in (*sample.velocity, *sample.angular_velocity)
    )


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


def numbered_buttons(count: int) -> tuple[str, ...]:
    """Names of buttons that have none of their own."""
    return tuple(f"Button {index + 1}" for index in range(count))


class Driver(ABC):
    """One opened device. Nothing here may block: the loop calls it a thousand times a second."""

    def __init__(self, description: Description) -> None:
        self.description = description
        """Who it is."""

    @abstractmethod
    def read(self) -> Sample | None:
        """The newest sample since the last call, older ones dropped; None where nothing came.

        Raises:
            DeviceLostError: it is gone.
        """

    @abstractmethod
    def send(self, force: Vector, torque: Vector) -> None:
        """Ask for a force on the hand until the next call; nothing where there are no motors.

        Raises:
            DeviceLostError: it is gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Take force away and let the device go; never raises, may be called twice."""
