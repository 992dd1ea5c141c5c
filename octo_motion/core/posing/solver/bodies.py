# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a figure's bodies are and how they move, from one step to the next.

Orientations and the roots' places are the coordinates; everything else follows from them, so no
joint ever opens. Between steps each body keeps the angular momentum it had, but for what turning it
would add to its energy.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...rotations import Floats, normalized, small_batches
from ...rotations.small_batches import matvec, vecdot, vecmat
from ..puppet import Figure, Flags, Pose, pose_of
from .tree import Tree


class Bodies:
    """Poses, velocities and the springs' rest of all bodies."""

    def __init__(self, figure: Figure, tree: Tree, pose: Pose) -> None:
        """At rest, with relaxed springs."""
        count = len(figure)
        self._figure = figure
        self._tree = tree
        self.is_root: Flags = tree.parents < 0
        """(bodies,)"""
        self.parent_or_self = np.where(self.is_root, np.arange(count), tree.parents)
        """(bodies,) the parent, of a root itself."""
        # A slice, where it can be, is written to in a quarter of the time.
        first = np.array_equal(tree.roots, np.arange(len(tree.roots)))
        self._roots = slice(len(tree.roots)) if first else tree.roots
        self._anchors = figure.anchors[:, :, None].copy()
        self._inverse_inertias = np.linalg.inv(figure.inertias)
        self.linear = np.zeros((count, 3))
        """(bodies, 3) velocities of the centres of mass, world."""
        self.angular = np.zeros((count, 3))
        """(bodies, 3)"""
        self.spin = np.zeros((count, 3))
        """(bodies, 3) angular momenta about the centres of mass, world axes."""
        self.place(pose)
        self.rest = self.turns.copy()
        """(bodies, 4) where the joints' springs have their rest, in the parents' frames."""

    # Where they are

    def place(self, pose: Pose) -> None:
        """Take over orientations and the roots' places."""
        self.orientations = normalized(pose.orientations)
        """(bodies, 4)"""
        self.roots = np.array(pose.positions, dtype=np.float64)[self._tree.roots]
        """(roots, 3)"""
        self.refresh()

    def refresh(self) -> None:
        """Matrices and places, from orientations and roots."""
        tree = self._tree
        left = small_batches.left_factor(self.orientations)
        self._factor = small_batches.right_factor(self.orientations)
        # (bodies, 4, 4) homogeneous, without the places yet; and the same, transposed.
        self.transforms, self.transposed = small_batches.to_transforms(left, self._factor)
        self.matrices = self.transforms[:, :3, :3]
        """(bodies, 3, 3)"""
        roots = self._roots
        parents = self.matrices.take(self.parent_or_self, 0)
        arms = (parents @ self._anchors)[:, :, 0]
        parents[roots] = _UNIT
        self.parent_matrices = parents
        """(bodies, 3, 3) the parents', of roots the world's."""
        before = left.take(self.parent_or_self, 0)
        before[roots] = _UNTURNED
        self.turns = small_batches.inverse_product(before, self._factor)
        """(bodies, 4) orientation of each body in its parent's frame (a root's in the world's)."""
        arms[roots] = self.roots
        self.positions = tree.from_roots(arms)
        """(bodies, 3) of the joints."""

    # Springs

    def springs(self) -> Floats:
        """(bodies, 3) q_f of the elements: rotation vectors in world axes."""
        bent = small_batches.multiply_conjugate(self.turns, self.rest)
        return matvec(self.parent_matrices, small_batches.to_rotation_vector(bent))

    # How they move

    def state(self) -> dict[str, Floats]:
        """All that changes from step to step, as copies."""
        return {name: getattr(self, name).copy() for name in _CHANGING}

    def restore(self, state: Mapping[str, Floats]) -> None:
        for name in _CHANGING:
            setattr(self, name, state[name].copy())
        self.refresh()

    def stop(self) -> None:
        """Take all velocities away, and let the springs have their rest where the joints are."""
        self.rest = self.turns.copy()
        for array in (self.linear, self.angular, self.spin):
            array[:] = 0.0

    def turn_back(self, joints: Flags, pose: Pose) -> None:
        """Turn joints of a mask (bodies,) as a pose has them, with relaxed springs; the others stay
        as they are, and so do velocities.
        """
        positions, turns = self.positions, self.turns.copy()
        self.place(pose)
        turns[joints] = self.rest[joints] = self.turns[joints]
        self.place(pose_of(self._figure, turns, positions))

    def kept_spin(self) -> Floats:
        """Angular momenta, shortened where the body's turn would have made energy of them."""
        local = vecmat(self.spin, self.matrices)
        now = vecdot(vecmat(local, self._inverse_inertias), local)
        before = vecdot(self.spin, self.angular)
        share = np.maximum(before, 0.0) / (now + 1e-300)
        share = np.sqrt(np.minimum(share, 1.0))
        return self.spin * share[:, None]

    def velocities(self, skewed: Floats) -> Floats:
        """(bodies, 6) spatial velocities; ``skewed`` as in ``take_velocities``."""
        now = np.empty((len(self.linear), 6))
        now[:, :3] = self.angular
        around = matvec(skewed, self.angular)
        np.add(self.linear, around, out=now[:, 3:])
        return now

    def take_velocities(self, velocities: Floats, skewed: Floats) -> None:
        """Take over spatial velocities (bodies, 6) about a common origin.

        ``skewed`` are the matrices (bodies, 3, 3) of the cross product with the centres, from
        there.
        """
        self.angular = velocities[:, :3].copy()
        self.linear = velocities[:, 3:] - matvec(skewed, self.angular)
        local = vecmat(self.angular, self.matrices)
        self.spin = matvec(self.matrices, vecmat(local, self._figure.inertias))

    def move(
        self,
        turns: Floats,
        shifts: Floats,
        to_rest: Floats | None = None,
        flows: Flags | None = None,
    ) -> None:
        """Turn by rotation vectors (bodies, 3) and shift the roots by (roots, 3), world axes.

        The rest of joints that flow (bodies,) moves to where rotation vectors (bodies, 3), in the
        parents' frames, then lead from where they are.
        """
        count = len(turns)
        vectors = turns if to_rest is None else np.concatenate([turns, to_rest])
        turned = small_batches.left_factor(small_batches.from_rotation_vector(vectors))
        orientations = small_batches.product(turned[:count], self._factor)
        size = np.sqrt(vecdot(orientations, orientations))
        orientations /= size[:, None]
        self.orientations = orientations
        self.roots = self.roots + shifts
        self.refresh()
        if flows is not None:
            rest = small_batches.product(turned[count:], small_batches.right_factor(self.turns))
            np.copyto(self.rest, rest, where=flows[:, None])


_CHANGING = ("roots", "orientations", "rest", "linear", "angular", "spin")
_UNIT = np.eye(3)
_UNTURNED = small_batches.left_factor(np.array([1.0, 0.0, 0.0, 0.0]))
