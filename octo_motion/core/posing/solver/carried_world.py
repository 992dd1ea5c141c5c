# SPDX-License-Identifier: GPL-3.0-or-later
"""A figure that something else moves: its roots are carried, and its springs' rests are led.

A root that is carried has the speeds it is given, whatever hangs on it. A rest that is led turns by
itself, with w_r; the element then answers the joint's turn against that,

    λ_e = −K_f q_f[t] − (K_f h + D_f)(w − w_r),    q_f[t+1] = q_f[t] + h (w − w_r − w_d),

so what moves as it is led to bears nothing. Without flow the rest is where it is led to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...rotations import Floats, small_batches
from ..puppet import Figure, Pose
from .contact_detection import CarriedCapsules, Contacts, Detector, joined_contacts
from .newton import InitialGuess, Solution
from .obstacle_shapes import Obstacle
from .problem import Problem
from .world import World, WorldSettings


@dataclass(frozen=True, eq=False)
class Leading:
    """What a step does to what is carried and led."""

    roots: Floats
    """(2 roots, 3) m/s of the roots' joints, then rad/s of the roots, world."""
    rests: Floats
    """(bodies, 3) rad/s with which springs' rests turn, in the parents' frames; …"""
    turns: Floats
    """… (bodies, 4) and by what within the step."""


@dataclass(frozen=True, eq=False)
class CarriedThings:
    """Obstacles that something else moves, whatever touches them."""

    shapes: Sequence[Obstacle]
    """Where they are now."""
    speeds: Floats
    """(things, 2, 3) m/s of their origins, and rad/s, world."""


class CarriedWorld(World):
    """A world whose roots are carried from step to step."""

    def __init__(
        self,
        figure: Figure,
        pose: Pose,
        settings: WorldSettings | None = None,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        """Start at rest in ``pose``, with the springs of all elements relaxed.

        Limbs that overlap in it do not collide.

        Raises:
            SettingsError: a setting that makes no sense, or a figure without bodies.
        """
        super().__init__(figure, pose, settings, obstacles)
        self._detector = Detector(figure, self_collision=self.settings.self_collision, stands=pose)
        self.capsules: CarriedCapsules | None = None
        """What else may be touched, and is moved; to be replaced before each step."""
        self.things: CarriedThings | None = None
        """Obstacles that something else moves; likewise."""
        self._leading: Leading | None = None
        self._driven: Floats | None = None

    def put(self, roots: Pose) -> None:
        """Have the roots' joints just there: what rounding has added goes."""
        bodies = self._bodies
        bodies.roots = roots.positions.copy()
        bodies.orientations[self._tree.roots] = roots.orientations
        bodies.refresh()

    def lead(self, leading: Leading) -> None:
        """Say where roots and rests go in the coming step, and in those after it."""
        self._leading = leading

    @property
    def matrices(self) -> Floats:
        """(bodies, 3, 3) orientations, world."""
        return self._bodies.matrices

    def problem(self) -> tuple[Problem, InitialGuess]:
        leading = self._leading
        if leading is None:
            return super().problem()
        seen = self._bodies.parent_matrices @ leading.rests[:, :, None]
        self._driven = seen[:, :, 0]
        speeds = self._warm.speeds.copy()
        speeds[self._tree.carried_slots] = leading.roots
        self._warm.speeds = speeds
        problem, start = super().problem()
        return replace(problem, driven=self._driven, carried=leading.roots), start

    def _find(self) -> Contacts:
        found = super()._find()
        for more in (self._met(), self._touched()):
            found = joined_contacts((found, more)) if more is not None and len(more) else found
        return found

    def _margin(self, speeds: Floats) -> float:
        fastest = float(np.abs(speeds).max()) + float(np.abs(self._bodies.linear).max())
        return 2e-3 * self._size + 2.0 * self.settings.step * fastest

    def _met(self) -> Contacts | None:
        """Contacts with capsules that are carried."""
        if self.capsules is None or not len(self.capsules.radii):
            return None
        bodies, margin = self._bodies, self._margin(self.capsules.speeds)
        return self._detector.find_carried(bodies.positions, bodies.matrices, self.capsules, margin)

    def _touched(self) -> Contacts | None:
        """Contacts with obstacles that are carried."""
        things, bodies = self.things, self._bodies
        if things is None:
            return None
        margin = self._margin(things.speeds)
        found = self._detector.find_solids(bodies.positions, bodies.matrices, things.shapes, margin)
        parts = list[Contacts]()
        for each, shape, (shift, turn) in zip(found, things.shapes, things.speeds, strict=True):
            if each is not None and len(each):
                speeds = shift + np.cross(turn, each.points - shape.position)
                parts.append(replace(each, speeds=speeds))
        return joined_contacts(parts) if parts else None

    def _move(self, problem: Problem, solution: Solution) -> None:
        if self._leading is not None:
            self._bodies.rest = small_batches.multiply(self._leading.turns, self._bodies.rest)
        super()._move(problem, solution)

    def _to_rest_after(self, problem: Problem, solution: Solution) -> Floats:
        to_rest = super()._to_rest_after(problem, solution)
        assert self._driven is not None
        led = self.settings.step * self._driven
        return to_rest + small_batches.vecmat(led, self._bodies.parent_matrices)
