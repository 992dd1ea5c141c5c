# SPDX-License-Identifier: GPL-3.0-or-later
"""The virtual coupling: a spring and a damper in six degrees of freedom between hand and body.

How stiff it may be follows from the device. A spring K and damper B, sampled every T and held in
between, act on a hand that the device itself damps with b. Colgate and Brown ("Factors affecting
the Z-width of a haptic display", 1994): the whole is passive, whoever holds it, if

    b > K T / 2 + |B|.

A further delay d between pose and force counts as more of T / 2. Abbott and Okamura ("Effects of
position quantization and sampling rate on virtual-wall passivity", 2005): where the device measures
in steps Δ and has dry friction c, also

    K <= min(2 b / T, 2 c / Δ).

The second bound is left out where a device does not know its friction or its steps. What neither
sees (a slow simulation, a scaled-up device) is the passivity controller's business.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ...core.rotations.scalars import Vector, add_scaled, scale
from ..driver import Dynamics

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
    """The largest passive stiffness: ``(b − |B|) / late``, after Colgate and Brown.

    Args:
        damping: b of the device.
        late: s from a pose to the force that answers it, on average: T / 2 + d.
        damper: B of the coupling.
    """
    return max(0.0, damping - abs(damper)) / late


def gains_for(device: Dynamics, period: float, share: float = SHARE) -> Gains:
    """The coupling for a device and a loop.

    Args:
        device: What the device says of its mechanics.
        period: s of the loop.
        share: Of the bound; above 1 the coupling may become active.
    """
    half = 0.5 * period + device.delay
    return Gains(
        *_gains(device.damping, device.friction, device.resolution, half, share),
        *_gains(
            *(device.angular_damping, device.angular_friction, device.angular_resolution),
            *(half, share),
        ),
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

    Args:
        gains: Of the coupling.
        apart: m from the hand to where the body is.
        turned: rad, rotation vector from the hand's orientation to the body's.
        drift: m/s of the body less the hand's.
        spin: rad/s of the body less the hand's.
    """
    return (
        add_scaled(scale(apart, gains.stiffness), drift, gains.damping),
        add_scaled(scale(turned, gains.angular_stiffness), spin, gains.angular_damping),
    )
