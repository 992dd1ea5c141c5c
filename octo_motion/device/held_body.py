# SPDX-License-Identifier: GPL-3.0-or-later
"""What the simulation tells of a body that is held, and of how it holds it."""

from __future__ import annotations

from typing import NamedTuple

from ..core.rotations.scalars import ZERO, Quaternion, Vector


class Pull(NamedTuple):
    """How the simulation ties the held body to the pointer, and how the body gives way."""

    stiffness: float = 0.0
    """N/m of the simulation's own coupling."""
    damping: float = 0.0
    """N·s/m"""
    angular_stiffness: float = 0.0
    """N·m/rad"""
    angular_damping: float = 0.0
    """N·m·s/rad"""
    mobility: float = 0.0
    """1/kg of the body at the point held; 0: it keeps its velocity whatever pulls."""
    angular_mobility: float = 0.0
    """1/(kg·m²)"""


class Held(NamedTuple):
    """What the simulation knows of a held body, at the point where it is held."""

    position: Vector
    orientation: Quaternion
    velocity: Vector
    angular_velocity: Vector
    pull: Pull = Pull()
    force: Vector = ZERO
    """N, that its own coupling used in its last step."""
    torque: Vector = ZERO
    """N·m, likewise."""
