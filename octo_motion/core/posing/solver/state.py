# SPDX-License-Identifier: GPL-3.0-or-later
"""What a simulation is told once, and what it remembers from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingsError
from ...rotations import Floats
from ..puppet import Figure


@dataclass(frozen=True)
class WorldSettings:
    """What holds for the whole simulation."""

    step: float = 1e-3
    """h, seconds."""
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """m/s²; off by default, a puppet is posed more easily without weight."""
    pinned: frozenset[int] = frozenset()
    """Bodies pinned from the start, see ``World.pin``."""
    self_collision: bool = False
    """Whether limbs that are no neighbours push each other away."""
    friction: float = 0.6
    """Coulomb's coefficient where an obstacle has none of its own."""
    drag: float = 0.0
    """1/s: how fast all motion dies away, as under water; calms a free puppet without weight."""
    tolerance: float = 1e-3
    """Error of an impulse, against the largest, with which the solver is content. Where contacts
    neither slip nor open, and in all joints that hold, its answer is exact whatever this says."""
    iterations: int = 12
    """Most linear systems solved in a step; after that the best answer so far is taken."""

    def check(self, figure: Figure) -> None:
        """See whether a figure can be simulated so.

        Raises:
            SettingsError: a setting that makes no sense, or a figure without bodies.
        """
        if not len(figure):
            raise SettingsError("The figure has no bodies.", "Choose an armature with bones.")
        if not (np.isfinite(self.step) and self.step > 0.0):
            raise SettingsError(
                "The step of the simulation is not positive.", "Take 0.001 seconds, for example."
            )
        if not all(0 <= body < len(figure) for body in self.pinned):
            raise SettingsError("A pinned body does not exist.", "Pin bodies of the figure alone.")


@dataclass(frozen=True, eq=False)
class BodiesState:
    """Where bodies are and how they move, as copies."""

    roots: Floats
    """(roots, 3) positions of the roots' joints, world."""
    orientations: Floats
    """(bodies, 4)"""
    rest: Floats
    """(bodies, 4) where each joint's spring has its rest, in the parent's frame."""
    linear: Floats
    """(bodies, 3) velocity of the centres of mass."""
    angular: Floats
    """(bodies, 3)"""
    spin: Floats
    """(bodies, 3) angular momentum about the centre of mass, world axes."""


@dataclass(frozen=True, eq=False)
class StartState:
    """Where the solver begins, as copies."""

    speeds: Floats
    """(slots, 3)"""
    trial: Floats
    """(bodies, 3) load that the elements would have borne without flow, N·m, in the problem's axes;
    empty where none flowed."""
    pressed: NDArray[np.int64]
    """Labels of the ends of joints' ranges that bore."""
    grips: Floats
    """(contacts, 3) friction of the last step, N·s."""
    wanted: Floats
    """(rows, 3) impulses that contacts and holds would have given without their bounds, N·s (or
    N·m·s)."""
    slips: Floats
    """(contacts,) how fast they slipped times friction, m/s; empty where none did."""
    labels: NDArray[np.int64]
    """(contacts,) to know them by."""


@dataclass(frozen=True, eq=False)
class WorldState:
    """All that a simulation remembers from step to step; holds are not part of it."""

    time: float
    bodies: BodiesState
    start: StartState
