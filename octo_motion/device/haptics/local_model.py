# SPDX-License-Identifier: GPL-3.0-or-later
"""The held body as the hand feels it between two steps of the simulation.

The loop asks a thousand times a second where the body is; the simulation answers as often as it
can. In between the loop goes on with a linear model of the body at the point where it is held: it
keeps its velocity, and a pull other than the one the simulation last used changes that by the
body's mobility, Δv = M⁻¹ ∫ Δf dt. After the local dynamics of Hasegawa's Springhead.

When the simulation answers, model and simulation differ a little. The difference fades within a
few milliseconds: a jump would be felt as a click.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp
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
from ..messages import HeldMessage, Pull

_FADE: Final = 0.004
"""s in which a difference falls to a third."""


@dataclass
class LocalModel:
    """A held body, a moment after the simulation last spoke."""

    position: Vector = ZERO
    orientation: Quaternion = IDENTITY
    velocity: Vector = ZERO
    angular_velocity: Vector = ZERO
    _pull: Pull = field(default_factory=Pull)
    _force: Vector = ZERO
    _torque: Vector = ZERO
    _off: Vector = ZERO
    _twisted: Vector = ZERO
    """Where the model still is beside the simulation, fading."""

    def begin(self, held: HeldMessage) -> None:
        """Start with what the simulation says, at a grab."""
        self._take(held)
        self._off = self._twisted = ZERO

    def correct(self, held: HeldMessage, age: float) -> None:
        """Take over what the simulation says; ``age`` s ago that was true."""
        before, turn_before = self.felt()
        self._take(held)
        self.position = add_scaled(self.position, self.velocity, age)
        self.orientation = integrate(self.orientation, self.angular_velocity, age)
        self._off = subtract(before, self.position)
        self._twisted = to_rotation_vector(multiply(turn_before, conjugate(self.orientation)))

    def _take(self, held: HeldMessage) -> None:
        self.position, self.orientation = held.position, held.orientation
        self.velocity, self.angular_velocity = held.velocity, held.angular_velocity
        self._pull, self._force, self._torque = Pull(*held.pull), held.force, held.torque

    def advance(
        self,
        period: float,
        position: Vector,
        orientation: Quaternion,
        velocity: Vector,
        angular_velocity: Vector,
    ) -> None:
        """Go on for one period (s), pulled to where the pointer is and as it moves, world."""
        pull = self._pull
        if pull.mobility > 0.0:
            tie = (pull.stiffness, pull.damping, pull.mobility)
            apart = subtract(position, self.position)
            drift = subtract(velocity, self.velocity)
            self.velocity = add(self.velocity, _change(tie, apart, drift, self._force, period))
        if pull.angular_mobility > 0.0:
            tie = (pull.angular_stiffness, pull.angular_damping, pull.angular_mobility)
            apart = to_rotation_vector(multiply(orientation, conjugate(self.orientation)))
            drift = subtract(angular_velocity, self.angular_velocity)
            change = _change(tie, apart, drift, self._torque, period)
            self.angular_velocity = add(self.angular_velocity, change)
        self.position = add_scaled(self.position, self.velocity, period)
        self.orientation = integrate(self.orientation, self.angular_velocity, period)
        left = exp(-period / _FADE)
        self._off = scale(self._off, left)
        self._twisted = scale(self._twisted, left)

    def felt(self) -> tuple[Vector, Quaternion]:
        """Where the hand feels the body."""
        return (
            add(self.position, self._off),
            multiply(from_rotation_vector(self._twisted), self.orientation),
        )


def _change(
    tie: tuple[float, float, float], apart: Vector, drift: Vector, used: Vector, period: float
) -> Vector:
    """Of the body's velocity in a period (s), by what the pull is other than what was last used.

    ``tie`` is stiffness and damping of the pull and mobility of the body; ``apart`` and ``drift``
    lead from the body to the pointer.
    """
    stiffness, damping, mobility = tie
    now = add_scaled(scale(apart, stiffness), drift, damping)
    # Backward Euler in one degree of freedom: stable whatever the simulation's stiffness.
    gives = mobility * period
    return scale(subtract(now, used), gives / (1.0 + gives * (damping + period * stiffness)))
