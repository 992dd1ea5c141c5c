# SPDX-License-Identifier: GPL-3.0-or-later
"""How a push on a space mouse becomes speed: dead zone, curve and gain, for each axis."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import copysign, isfinite
from typing import Final

from ..core.errors import DeviceError
from .driver import Axes

_ONES: Final[Axes] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Response:
    """Speed at a push p of −1…1: ``gain · full speed · sign(p) · ((|p| − d) / (1 − d)) ^ curve``.

    Raises:
        DeviceError: a value is out of its range.
    """

    speed: float = 0.4
    """m/s at full push with gain 1."""
    angular_speed: float = 2.0
    """rad/s at full push with gain 1."""
    gain: Axes = _ONES
    """Any number; negative turns an axis round."""
    dead_zone: Axes = (0.05, 0.05, 0.05, 0.05, 0.05, 0.05)
    """0 to 0.9 of the full push, which does nothing."""
    curve: Axes = (1.5, 1.5, 1.5, 1.5, 1.5, 1.5)
    """0.2 to 5; 1 is proportional, above 1 is finer in the middle."""

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        for each in fields(self):
            value = getattr(self, each.name)
            if not all(map(isfinite, value if isinstance(value, tuple) else (value,))):
                raise DeviceError(
                    f"The device's {each.name.replace('_', ' ')} is not a number.",
                    "Set it to a finite number.",
                )
        if not all(0.0 <= zone <= 0.9 for zone in self.dead_zone):
            raise DeviceError(
                "The device's dead zone is out of range.", "Choose a share from 0 to 0.9."
            )
        if not all(0.2 <= power <= 5.0 for power in self.curve):
            raise DeviceError(
                "The device's curve is out of range.", "Choose an exponent from 0.2 to 5."
            )

    def speeds(self, push: Axes) -> Axes:
        """m/s along and rad/s about the axes, for a push of −1…1 on each."""
        return (
            self._one(push, 0, self.speed),
            self._one(push, 1, self.speed),
            self._one(push, 2, self.speed),
            self._one(push, 3, self.angular_speed),
            self._one(push, 4, self.angular_speed),
            self._one(push, 5, self.angular_speed),
        )

    def _one(self, push: Axes, axis: int, full: float) -> float:
        zone = self.dead_zone[axis]
        beyond = min(1.0, abs(push[axis])) - zone
        if beyond <= 0.0:
            return 0.0
        size = (beyond / (1.0 - zone)) ** self.curve[axis]
        return copysign(size, push[axis]) * self.gain[axis] * full
