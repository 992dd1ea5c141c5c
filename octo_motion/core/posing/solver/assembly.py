# SPDX-License-Identifier: GPL-3.0-or-later
"""All that acts on a figure in a step, gathered into one question for velocities."""

from __future__ import annotations

import numpy as np

from ...rotations import Floats
from ...rotations.small_batches import skew
from ..puppet import Figure, PlasticLaw
from .bodies import Bodies
from .constraint_rows import Rows
from .joint_stops import JointStops
from .problem import Problem, moments
from .state import WorldSettings
from .tree import Tree

_STOP_GAIN = 1e3
_BLOW = 50.0
"""m/s²: a change of speed in a step that only a blow makes."""


class Gathering:
    """Puts together the problems of one figure; what hangs on it alone is worked out once."""

    def __init__(self, figure: Figure, tree: Tree, settings: WorldSettings) -> None:
        count = len(figure)
        h = settings.step
        self._figure = figure
        self._tree = tree
        self._step = h
        self._kept = 1.0 / (1.0 + h * settings.drag)
        self._masses = np.tile(figure.masses[:, None], 3)
        self._lightness = 1.0 / self._masses
        self._moments = moments(figure.masses, figure.centres, figure.inertias)
        # (bodies, 6) h m g.
        self._weight = np.zeros((count, 6))
        self._weight[:, 3:] = h * self._masses * np.array(settings.gravity, dtype=np.float64)
        self._stops = JointStops(figure, _STOP_GAIN * carried_inertias(figure))

    def problem(
        self, bodies: Bodies, law: PlasticLaw, forces: Floats, rows: Rows, speeds: Floats
    ) -> Problem:
        """The question of the coming step.

        Args:
            bodies: as they are now; their matrices get their places from the origin.
            law: of the elements.
            forces: (bodies, 6) N and N·m from outside.
            rows: contacts and holds, from the same origin: the first root's joint.
            speeds: (slots, 3) with which joints turn now.
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
        if forces.any():
            linear += h * forces[:, :3]
            momenta[:, :3] = h * forces[:, 3:]
        momenta[:, :3] += (skewed @ linear[:, :, None])[:, :, 0]
        momenta[:, :3] += bodies.kept_spin()
        if self._kept < 1.0:
            momenta *= self._kept
        if law.alike:
            springs, axes = bodies.springs_in_world(), None
        else:
            springs, axes = bodies.springs(), bodies.parent_matrices
        stops = ()
        if len(self._stops.joints):
            turning = speeds[self._tree.joint_slot]
            stops = self._stops.near(bodies.turns(), bodies.parent_matrices, turning, h)
        return Problem(
            h,
            joints,
            centres,
            skewed,
            self._figure.masses,
            spread.reshape(-1, 16),
            momenta,
            law,
            springs,
            axes,
            stops,
            rows,
            _BLOW * h,
        )


def carried_inertias(figure: Figure) -> Floats:
    """(bodies,) kg·m²: about each joint, of all that hangs on it when stretched out."""
    count = len(figure)
    result = np.zeros(count)
    reach = np.zeros(count)
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
            reach[parent] = max(reach[parent], arm + reach[body])
            result[parent] += result[body] + masses[body] * arm * arm
    return result


def typical_size(figure: Figure) -> float:
    """Of a bone, metres."""
    lengths = figure.lengths[figure.lengths > 0.0]
    return float(np.median(lengths)) if len(lengths) else float(np.max(figure.radii, initial=1e-3))
