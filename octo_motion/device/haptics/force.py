# SPDX-License-Identifier: GPL-3.0-or-later
"""From hand and body to the force on the hand: what the coupling asks for, and how it is shaped.

*The virtual coupling* is a spring and a damper in six degrees of freedom between hand and body. How
stiff it may be follows from the device. A spring K and damper B, sampled every T and held in
between, act on a hand that the device itself damps with b. Colgate and Brown ("Factors affecting
the Z-width of a haptic display", 1994): the whole is passive, whoever holds it, if

    b > K T / 2 + |B|.

A further delay d between pose and force counts as more of T / 2. Abbott and Okamura ("Effects of
position quantization and sampling rate on virtual-wall passivity", 2005): where the device measures
in steps Δ and has dry friction c, also

    K <= min(2 b / T, 2 c / Δ).

The second bound is left out where a device does not know its friction or its steps. What neither
sees (a slow simulation, a scaled-up device) is the passivity controller's business.

What the hand gets of it is in ``passivity``.

*The shaper* is last: how much force, how fast it may change, and when it ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Final

from ...core.rotations.scalars import (
    ZERO,
    Vector,
    add,
    add_scaled,
    clamp_length,
    dot,
    scale,
    subtract,
)
from ..driver import FRESH_SECONDS, Dynamics

SHARE: Final = 0.8
"""Of the largest stiffness that is passive on paper, this is used: no device is what it says."""
DAMPER_SHARE: Final = 0.2
"""Of the device's own damping, this is left for the coupling's damper."""


@dataclass(frozen=True)
class Gains:
    """Stiffness and damping, of pushing and of turning, at the hand."""

    stiffness: float
    """N/m"""
    damping: float
    """N·s/m"""
    angular_stiffness: float
    """N·m/rad"""
    angular_damping: float
    """N·m·s/rad"""


def stiffest(damping: float, late: float, damper: float = 0.0) -> float:
    """The largest passive stiffness, after Colgate and Brown: ``(b − |B|) / late``.

    b damps the device and B is the coupling's damper; T / 2 + d is how late (s) a force answers.
    """
    return max(0.0, damping - abs(damper)) / late


def gains_for(device: Dynamics, period: float, share: float = SHARE) -> Gains:
    """The coupling for a device and a loop (s); by a share above 1 it may become active."""
    late = 0.5 * period + device.delay
    angular = (device.angular_damping, device.angular_friction, device.angular_resolution)
    return Gains(
        *_gains(device.damping, device.friction, device.resolution, late, share),
        *_gains(*angular, late, share),
    )


def _gains(
    damping: float, friction: float, resolution: float, late: float, share: float
) -> tuple[float, float]:
    damper = DAMPER_SHARE * damping
    most = stiffest(damping, late, damper)
    if friction > 0.0 and resolution > 0.0:
        most = min(most, 2.0 * friction / resolution)
    return share * most, min(share, 1.0) * damper


def wrench(
    gains: Gains, apart: Vector, turned: Vector, drift: Vector, spin: Vector
) -> tuple[Vector, Vector]:
    """Force and torque on the hand.

    ``apart`` (m) and ``turned`` (rad, rotation vector) lead from the hand to the body; ``drift``
    (m/s) and ``spin`` (rad/s) are the body's less the hand's.
    """
    return (
        add_scaled(scale(apart, gains.stiffness), drift, gains.damping),
        add_scaled(scale(turned, gains.angular_stiffness), spin, gains.angular_damping),
    )


# --- Limits --------------------------------------------------------------------------------------

RISE: Final = 0.2
"""s from nothing to all of the force after a grab."""
FALL: Final = 0.03
"""s from all of the force to nothing after letting go."""
FULL_IN: Final = 0.01
"""s: from no force to the most, or from the most to none, takes at least so long. As fast as force
fades when data grows old."""
_FULL: Final = 0.5
"""Of the time that data counts as fresh, this much is without any loss of force."""


def freshness(age: float) -> float:
    """Share of the force for data of an age: 1 while fresh, fading, 0 from 20 ms on."""
    if not age < FRESH_SECONDS:  # an age that is no number is not fresh
        return 0.0
    return min(1.0, (FRESH_SECONDS - age) / (FRESH_SECONDS * (1.0 - _FULL)))


@dataclass
class Shaper:
    """Turns what the coupling asks for into what the hand gets."""

    most: float
    """N, the most that a hand is ever given."""
    most_torque: float
    """N·m, likewise."""
    share: float = 0.0
    """Of the asked force: rises after a grab, falls after letting go."""
    force: Vector = ZERO
    """What the hand gets now."""
    torque: Vector = ZERO

    def shape(
        self, force: Vector, torque: Vector, period: float, *, holding: bool, age: float
    ) -> None:
        """Set ``force`` (N) and ``torque`` (N·m) for the coming period (s), from those asked for.

        They fade where nothing is held. ``age`` (s) is that of the older of the two, the device's
        sample and the simulation's state.
        """
        fresh = freshness(age)
        if fresh <= 0.0 or not isfinite(dot(force, force) + dot(torque, torque)):
            # Not a fade but the end of one: it began when half of the time was over. And what is
            # no number, or beyond all of them, must not reach a motor.
            self.drop()
            return
        step = period / RISE if holding else -period / FALL
        self.share = max(0.0, min(1.0, self.share + step))
        part = self.share * fresh
        change = period / FULL_IN
        self.force = _toward(self.force, force, part, self.most, change)
        self.torque = _toward(self.torque, torque, part, self.most_torque, change)

    def drop(self) -> None:
        """No force from now on: the device is gone, or the loop ends."""
        self.share, self.force, self.torque = 0.0, ZERO, ZERO


def _toward(now: Vector, asked: Vector, part: float, most: float, change: float) -> Vector:
    wanted = scale(clamp_length(asked, most), part)
    return add(now, clamp_length(subtract(wanted, now), most * change))
