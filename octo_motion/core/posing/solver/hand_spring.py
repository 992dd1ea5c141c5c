# SPDX-License-Identifier: GPL-3.0-or-later
"""The hand and the puppet: a spring and a damper in six degrees of freedom, limited in force.

A virtual coupling in the sense of [Plastic, §5] and Colgate et al. (1995): the device (or mouse)
moves a target, the grabbed bone is drawn after it, and the hand feels what draws. Over a step h

    F = K e − (h K + B) (w − w_t),    |F| ≤ F_max

with e the way from the bone to the target at the step's start, w the bone's velocity at its end
(so the coupling is implicit, and stable however stiff) and w_t the target's; the same for turns.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ...rotations import Floats, normalized
from ..puppet import Figure

_GRAVITY: Final = 9.81
_FREQUENCY: Final = 8.0
"""Hz at which the whole figure would swing on the coupling: firm, and slow enough for a hand."""


@dataclass(frozen=True)
class Coupling:
    """How a hand holds a bone."""

    stiffness: float
    """N/m"""
    damping: float
    """N·s/m"""
    turning_stiffness: float
    """N·m/rad"""
    turning_damping: float
    """N·m·s/rad"""
    force_limit: float
    """N"""
    torque_limit: float
    """N·m"""

    @classmethod
    def for_figure(cls, figure: Figure, strength: float = 1.0) -> Coupling:
        """One that moves the figure as a hand would: firm against its weight and size.

        Args:
            figure: the puppet.
            strength: factor on stiffness and limits.
        """
        mass = float(figure.masses.sum())
        arm = 0.25 * float(np.max(figure.lengths, initial=0.0) + _extent(figure))
        stiffness = strength * mass * (2.0 * np.pi * _FREQUENCY) ** 2
        damping = 2.0 * float(np.sqrt(stiffness * mass))
        force = strength * 30.0 * mass * _GRAVITY
        return cls(
            stiffness,
            damping,
            stiffness * arm * arm,
            damping * arm * arm,
            force,
            force * arm,
        )


@dataclass(eq=False)
class HandSpring:
    """A bone in a hand, from ``World.grab`` until ``World.release``."""

    body: int
    coupling: Coupling
    point: Floats
    """(3,) where it is held, in the body's frame."""
    grip: Floats
    """(4,) the body's orientation seen from the hand's when it was taken hold of."""
    target_position: Floats
    """(3,) world."""
    target_orientation: Floats | None
    """(4,) of the hand, world; None lets the bone turn freely about the point."""
    target_velocity: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) linear, angular."""
    wrench: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) force N and torque N·m on the bone in the last step, about the point held, world axes.
    The hand feels the opposite."""

    def pull(
        self, position: Floats, orientation: Floats | None = None, velocity: Floats | None = None
    ) -> None:
        """Draw the bone towards where the hand is now.

        Args:
            position: (3,) where the held point is drawn to, world.
            orientation: (4,) of the hand; None leaves the bone free to turn.
            velocity: (6,) linear and angular, of the hand; at rest by default.
        """
        self.target_position = np.array(position, dtype=np.float64)
        self.target_orientation = None if orientation is None else normalized(orientation)
        self.target_velocity = (
            np.zeros(6) if velocity is None else np.array(velocity, dtype=np.float64)
        )


def _extent(figure: Figure) -> float:
    """Greatest distance of a joint from its root along the bones, metres."""
    reach = np.zeros(len(figure))
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            reach[body] = reach[parent] + float(np.linalg.norm(figure.anchors[body]))
    return float(reach.max(initial=0.0))
