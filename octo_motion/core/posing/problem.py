# SPDX-License-Identifier: GPL-3.0-or-later
"""One step of the simulation as a question: which velocities, given all that acts on the figure?

The fast solver (``newton``) and the source's own (``reference``) answer the same question.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats
from .plastic import PlasticLaw
from .rows import Rows

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
    inertias: Floats
    """(bodies, 3, 3) about the centre of mass, world axes."""
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


def spatial_inertias(masses: Floats, inertias: Floats, skewed: Floats) -> Floats:
    """(bodies, 6, 6) about the origin: from (ω, v) to (L, l).

    Args:
        masses: (bodies,)
        inertias: (bodies, 3, 3) about the centres of mass, world axes.
        skewed: (bodies, 3, 3) matrices of the cross product with the centres' places.
    """
    weighted = masses[:, None, None] * skewed
    result = np.empty((len(masses), 6, 6))
    result[:, :3, :3] = inertias - weighted @ skewed
    result[:, :3, 3:] = weighted
    result[:, 3:, :3] = -weighted
    result[:, 3:, 3:] = masses[:, None, None] * np.eye(3)
    return result
