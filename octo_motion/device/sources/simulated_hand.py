# SPDX-License-Identifier: GPL-3.0-or-later
"""A hand on a force device that exists in numbers alone: for tests, and for trying out.

The device is a mass with viscous friction; the hand is a spring and a damper towards where it wants
to be, and trembles. Between two samples the force is held, and the
mass moves on in many small steps, as a real one would: what a sampled loop does to it shows here.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from ...core.rotations.scalars import (
    IDENTITY,
    ZERO,
    Quaternion,
    Vector,
    add,
    add_scaled,
    conjugate,
    from_rotation_vector,
    integrate,
    multiply,
    scale,
    subtract,
    to_rotation_vector,
)
from ..driver import Description, Driver, Dynamics, Kind, Sample

_STEPS: Final = 8
"""Small ones to a millisecond."""

Wish = Callable[[float], tuple[Vector, Quaternion]]
"""Where the hand wants to be at a time (s)."""


def rest(_seconds: float) -> tuple[Vector, Quaternion]:
    """A hand that stays in the middle."""
    return ZERO, IDENTITY


def circling(seconds: float) -> tuple[Vector, Quaternion]:
    """A hand that draws a circle of 5 cm and turns to and fro, every 4 s."""
    angle = 0.5 * math.pi * seconds
    turn = from_rotation_vector((0.0, 0.6 * math.sin(angle), 0.0))
    return (0.05 * math.cos(angle) - 0.05, 0.0, 0.05 * math.sin(angle)), turn


@dataclass
class Hand:
    """Body and mechanics. Defaults: a light grip on a desktop device."""

    device: Dynamics = field(
        default_factory=lambda: Dynamics(force=8.0, torque=0.4, damping=0.5, angular_damping=0.0012)
    )
    mass: float = 0.15
    """kg, of device and fingers."""
    inertia: float = 2e-4
    """kg·m²"""
    stiffness: float = 60.0
    """N/m between where the hand is and where it wants to be; 0: nobody holds the device."""
    damping: float = 2.0
    """N·s/m, likewise."""
    angular_stiffness: float = 0.3
    """N·m/rad"""
    angular_damping: float = 0.004
    """N·m·s/rad"""
    tremor: float = 1e-4
    """m, of a hand that trembles at 8 to 12 Hz."""
    wish: Wish = rest
    position: Vector = ZERO
    orientation: Quaternion = IDENTITY
    velocity: Vector = ZERO
    angular_velocity: Vector = ZERO
    seconds: float = 0.0
    _force: Vector = ZERO
    _torque: Vector = ZERO

    def __post_init__(self) -> None:
        dice = random.Random(1)  # noqa: S311 - a tremor, not a secret
        self._waves = [
            [(dice.uniform(50.0, 75.0), dice.uniform(0.0, 6.3)) for _ in range(3)]
            for _axis in range(3)
        ]

    def feel(self, force: Vector, torque: Vector) -> None:
        self._force, self._torque = force, torque

    def move(self, period: float) -> None:
        count = max(1, round(period * 1000.0 * _STEPS))
        for _ in range(count):
            self._step(period / count)

    def _step(self, step: float) -> None:
        place, turn = self.wish(self.seconds)
        device, held = self.device, 1.0 if self.stiffness else 0.0
        apart = subtract(add(place, self._tremble()), self.position)
        pull = add_scaled(scale(apart, self.stiffness), self.velocity, -held * self.damping)
        pull = subtract(pull, scale(self.velocity, device.damping))
        self.velocity = add_scaled(self.velocity, add(pull, self._force), step / self.mass)
        self.position = add_scaled(self.position, self.velocity, step)
        spin = self.angular_velocity
        turned = to_rotation_vector(multiply(turn, conjugate(self.orientation)))
        twist = add_scaled(
            scale(turned, self.angular_stiffness), spin, -held * self.angular_damping
        )
        twist = subtract(twist, scale(spin, device.angular_damping))
        self.angular_velocity = add_scaled(spin, add(twist, self._torque), step / self.inertia)
        self.orientation = integrate(self.orientation, self.angular_velocity, step)
        self.seconds += step

    def _tremble(self) -> Vector:
        if not self.tremor or not self.stiffness:
            return ZERO
        x, y, z = (
            self.tremor / 3.0 * sum(math.sin(rate * self.seconds + at) for rate, at in waves)
            for waves in self._waves
        )
        return (x, y, z)


class SimulatedHand(Driver):
    """The hand as a device, moving in real time."""

    def __init__(
        self, hand: Hand | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.hand = hand or Hand(wish=circling)
        self.buttons = 0
        self._clock = clock
        self._last = self._sent = clock()
        super().__init__(
            Description(
                name="Simulated hand",
                identity="simulated",
                kind=Kind.POSE,
                buttons=("Grab", "Key"),
                dynamics=self.hand.device,
            )
        )

    def read(self) -> Sample | None:
        now = self._clock()
        # After a pause (a stopped process) the hand does not race through all that time.
        self.hand.move(min(now - self._last, 0.01))
        self._last = now
        hand = self.hand
        return Sample(
            *(now, hand.position, hand.orientation, hand.velocity, hand.angular_velocity),
            self.buttons,
            # It feels a force at once.
            delay=now - self._sent,
        )

    def send(self, force: Vector, torque: Vector) -> None:
        self.hand.feel(force, torque)
        self._sent = self._clock()

    def close(self) -> None:
        """Nothing to let go."""
