# SPDX-License-Identifier: GPL-3.0-or-later
"""One step of the simulation as a question: which velocities, given all that acts on the figure?

``newton`` answers it; tests hold its answer against that of the source's own solver.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats
from ..puppet import PlasticLaw
from .constraint_rows import Rows

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Stops:
    """Ends of joints' ranges that are near: one row each, ``axis · w ≥ −rate``.

    The impulse about the axis is max(0, −a (axis·w + rate)).
    """

    joints: Integers
    """(stops,) bodies."""
    axes: Floats
    """(stops, 3) world, unit: the turn that leads back."""
    rates: Floats
    """(stops,) rad/s, gap/h: how fast the joint may turn towards the end; a little below zero
    where it is beyond."""
    gains: Floats
    """(stops,) a, N·m·s per rad/s."""
    spread: Floats
    """(bodies, stops) 1 where the stop is the joint's: sums what a joint's stops do."""
    labels: Integers
    """(stops,) the same number for the same end of the same joint in every step."""


@dataclass(frozen=True, eq=False)
class Problem:
    """The velocity LCP of one step; places are seen from the common origin."""

    step: float
    joints: Floats
    """(bodies, 3) where the joints are."""
    centres: Floats
    """(bodies, 3) centres of mass."""
    skewed: Floats
    """(bodies, 3, 3) matrices of the cross product with ``centres``."""
    masses: Floats
    """(bodies,)"""
    moments: Floats
    """(bodies, 16) Σ m [r; 1] [r; 1]ᵀ over each body's mass, row by row, r from the origin."""
    momenta: Floats
    """(bodies, 6) M v + h f about the origin: angular, linear."""
    law: PlasticLaw
    springs: Floats
    """(bodies, 3) q_f in the elements' axes."""
    frames: Floats | None
    """(bodies, 3, 3) the elements' axes, as columns; None where all axes of an element are alike:
    then ``springs`` and loads are in world axes."""
    stops: tuple[Stops, ...]
    """Ends of joints' ranges; empty or one set."""
    rows: Rows
    blow: float
    """Change of speed, m/s, that is great enough to solve again for the slip after it."""

    @property
    def spatial(self) -> Floats:
        """(bodies, 6, 6) inertias about the origin: from (ω, v) to (L, l)."""
        return (self.moments @ SPATIAL).reshape(-1, 6, 6)


def moments(masses: Floats, centres: Floats, inertias: Floats) -> Floats:
    """(bodies, 4, 4) Σ m [r; 1] [r; 1]ᵀ, the whole of a body's mass in one matrix.

    A body that is put elsewhere by the homogeneous matrix T has T J Tᵀ: two products instead of
    a dozen for inertia, first moment and mass by themselves.

    Args:
        masses: (bodies,)
        centres: (bodies, 3) of mass.
        inertias: (bodies, 3, 3) about them.
    """
    result = np.empty((len(masses), 4, 4))
    halves = 0.5 * np.trace(inertias, axis1=1, axis2=2)
    result[:, :3, :3] = halves[:, None, None] * np.eye(3) - inertias
    first = masses[:, None] * centres
    result[:, :3, :3] += first[:, :, None] * centres[:, None, :]
    result[:, :3, 3] = result[:, 3, :3] = first
    result[:, 3, 3] = masses
    return result


def _spatial_map() -> Floats:
    result = np.zeros((4, 4, 6, 6))
    for a in range(3):
        for b in range(3):
            # Inertia: tr(S) 1 − S.
            result[a, a, b, b] += 1.0
            result[a, b, a, b] -= 1.0
        # m c×, and its transpose; (a, b, c) and (a, c, b) are the even and the odd order.
        b, c = (a + 1) % 3, (a + 2) % 3
        result[a, 3, c, 3 + b] = result[a, 3, 3 + b, c] = 1.0
        result[a, 3, b, 3 + c] = result[a, 3, 3 + c, b] = -1.0
        result[3, 3, 3 + a, 3 + a] = 1.0
    return result.reshape(16, 36)


SPATIAL: Final = _spatial_map()
"""(16, 36) from ``moments`` to spatial inertias, entry by entry."""
