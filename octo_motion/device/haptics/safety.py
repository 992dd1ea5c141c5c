# SPDX-License-Identifier: GPL-3.0-or-later
"""Between the coupling and the hand: how much force, how fast it may change, and when it ends."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Final

from ...core.rotations.scalars import ZERO, Vector, add, clamp_length, dot, scale, subtract
from ..driver import FRESH_SECONDS

RISE: Final = 0.2
"""s from nothing to all of the force after a grab."""
FALL: Final = 0.03
"""s from all of the force to nothing after letting go."""
_FULL: Final = 0.5
"""Of the time that data counts as fresh, this much is without any loss of force."""


@dataclass(frozen=True)
class ForceLimits:
    """The most that a hand is ever given."""

    force: float
    """N"""
    torque: float
    """N·m"""
    full_in: float = 0.01
    """s: from no force to the most, or from the most to none, takes at least so long. As fast as
    force fades when data grows old."""


def freshness(age: float) -> float:
    """Share of the force for data of an age: 1 while fresh, fading, 0 from 20 ms on."""
    if not age < FRESH_SECONDS:  # an age that is no number is not fresh
        return 0.0
    return min(1.0, (FRESH_SECONDS - age) / (FRESH_SECONDS * (1.0 - _FULL)))


@dataclass
class Shaper:
    """Turns what the coupling asks for into what the hand gets."""

    limits: ForceLimits
    share: float = 0.0
    """Of the asked force: rises after a grab, falls after letting go."""
    force: Vector = ZERO
    """What the hand gets now."""
    torque: Vector = ZERO

    def shape(
        self, force: Vector, torque: Vector, period: float, *, holding: bool, age: float
    ) -> None:
        """Set ``force`` and ``torque`` for the coming period.

        Args:
            force: What is asked for, N.
            torque: What is asked for, N·m.
            period: s since the last call.
            holding: Whether something is held; else the force fades.
            age: s of the older of the two, the device's sample and the simulation's state.
        """
        fresh = freshness(age)
        if fresh <= 0.0 or not isfinite(dot(force, force) + dot(torque, torque)):
            # Not a fade but the end of one: it began when half of the time was over. And what is
            # no number, or beyond all of them, must not reach a motor.
            self.share, self.force, self.torque = 0.0, ZERO, ZERO
            return
        step = period / RISE if holding else -period / FALL
        self.share = max(0.0, min(1.0, self.share + step))
        part = self.share * fresh
        most, most_torque = self.limits.force, self.limits.torque
        change = period / self.limits.full_in
        self.force = _toward(self.force, force, part, most, most * change)
        self.torque = _toward(self.torque, torque, part, most_torque, most_torque * change)

    def drop(self) -> None:
        """No force from now on: the device is gone, or the loop ends."""
        self.share, self.force, self.torque = 0.0, ZERO, ZERO


def _toward(now: Vector, asked: Vector, part: float, most: float, step: float) -> Vector:
    wanted = scale(clamp_length(asked, most), part)
    return add(now, clamp_length(subtract(wanted, now), step))
