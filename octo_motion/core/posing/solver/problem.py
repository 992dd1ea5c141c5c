# SPDX-License-Identifier: GPL-3.0-or-later
"""One step of the simulation as a question: which velocities, given all that acts on the figure?

``newton`` answers it; tests hold its answer against that of the source's own solver.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats
from ...rotations.scalars import Vector
from ...rotations.small_batches import matvec, skew
from ..puppet import Figure, PlasticLaw, part_of
from .bodies import Bodies
from .constraint_rows import Rows
from .joint_stops import JointStops, Stops
from .tree import Tree


@dataclass(eq=False)
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
    """(bodies, 3) q_f, world axes."""
    stops: tuple[Stops, ...]
    """Ends of joints' ranges; empty or one set."""
    rows: Rows
    blow: float
    """Change of speed, m/s, that is great enough to solve again for the slip after it."""
    driven: Floats | None = None
    """(bodies, 3) with what the springs' rests turn themselves, rad/s, world; None: they do not."""
    carried: Floats | None = None
    """(2 roots, 3) speeds u at which something else carries the roots: of all their shifts, then
    of all their turns; None where they are free."""

    @cached_property
    def spatial(self) -> Floats:
        """(bodies, 6, 6) inertias about the origin: from (ω, v) to (L, l)."""
        return (self.moments @ SPATIAL).reshape(-1, 6, 6)


def moments(masses: Floats, centres: Floats, inertias: Floats) -> Floats:
    """(bodies, 4, 4) Σ m [r; 1] [r; 1]ᵀ, the whole of a body's mass in one matrix.

    A body that is put elsewhere by the homogeneous matrix T has T J Tᵀ: two products instead of a
    dozen for inertia, first moment and mass by themselves. Inertias (bodies, 3, 3) are about the
    centres of mass (bodies, 3).
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


# --- How it is put together -----------------------------------------------------------------------


_STOP_GAIN = 1e3
GRAVITY: Final = 9.81
_BLOW = 50.0
"""m/s²: a change of speed in a step that only a blow makes."""


class ProblemBuilder:
    """Puts together the problems of one figure; what hangs on it alone is worked out once."""

    def __init__(
        self, figure: Figure, tree: Tree, step: float, gravity: Vector, drag: float
    ) -> None:
        count = len(figure)
        self._figure = figure
        self._tree = tree
        self._step = step
        heavy = np.array(figure.heavy or (False,) * count)
        kept = 1.0 / (1.0 + step * drag)
        # What has weight by itself falls through no water.
        self._kept = np.where(heavy, 1.0, kept)[:, None] if drag else None
        self._masses = np.tile(figure.masses[:, None], 3)
        self._lightness = 1.0 / self._masses
        self._moments = moments(figure.masses, figure.centres, figure.inertias)
        # (bodies, 6) h m g.
        self._weight = np.zeros((count, 6))
        self._weight[:, 3:] = step * self._masses * np.array(gravity, dtype=np.float64)
        if not any(gravity):
            self._weight[heavy, 5] = -step * GRAVITY * figure.masses[heavy]
        self._stops = JointStops(figure, _STOP_GAIN * carried_inertias(figure))

    def problem(
        self, bodies: Bodies, law: PlasticLaw, forces: Floats, rows: Rows, speeds: Floats
    ) -> Problem:
        """The question of the coming step; the bodies' matrices get their places from the origin.

        Forces (bodies, 6) from outside are N and N·m. Contacts and holds are seen from the same
        origin, the first root's joint. Joints turn with speeds (slots, 3) now.
        """
        h = self._step
        joints = bodies.positions - bodies.roots[0]
        bodies.transforms[:, :3, 3] = joints
        bodies.transposed[:, 3, :3] = joints
        spread = bodies.transforms @ self._moments @ bodies.transposed
        centres = spread[:, :3, 3] * self._lightness
        skewed = skew(centres)
        # M v + h f, with the angular momentum that each body kept.
        momenta = self._weight.copy()
        linear = momenta[:, 3:]
        linear += self._masses * bodies.linear
        turning = bodies.kept_spin()
        if np.count_nonzero(forces):
            linear += h * forces[:, :3]
            turning += h * forces[:, 3:]
        np.add(turning, matvec(skewed, linear), out=momenta[:, :3])
        if self._kept is not None:
            momenta *= self._kept
        stops = ()
        if len(self._stops.joints):
            now = self._tree.of_joints(speeds)
            stops = self._stops.near(bodies.turns, bodies.parent_matrices, now, h)
        return Problem(
            h,
            joints,
            centres,
            skewed,
            self._figure.masses,
            spread.reshape(-1, 16),
            momenta,
            law.seen_in(bodies.matrices),
            bodies.springs(),
            stops,
            rows,
            _BLOW * h,
        )


def carried_inertias(figure: Figure) -> Floats:
    """(bodies,) kg·m²: about each joint, of all that hangs on it when stretched out."""
    count = len(figure)
    result = np.zeros(count)
    masses = figure.masses.copy()
    for body in range(count - 1, -1, -1):
        own = np.trace(figure.inertias[body]) + figure.masses[body] * float(
            figure.centres[body] @ figure.centres[body]
        )
        result[body] += own
        parent = figure.parents[body]
        if parent >= 0:
            arm = float(np.linalg.norm(figure.anchors[body]))
            masses[parent] += masses[body]
            result[parent] += result[body] + masses[body] * arm * arm
    return result


def typical_size(figure: Figure) -> float:
    """Of a bone, metres; of several figures and things, as the first has it."""
    if figure.owners:
        figure = part_of(figure, 0)
    lengths = figure.lengths[figure.lengths > 0.0]
    return float(np.median(lengths)) if len(lengths) else float(np.max(figure.radii, initial=1e-3))
