# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure's tree as equations: velocities that keep every joint closed, and their solution.

A joint is open to three turns, a root to three shifts as well; each such triple is a *slot* with a
velocity u in world axes. Spatial velocities (ω, v) and momenta (L, l) of bodies are taken at one
common origin, so that they add up along the tree without transformation:

    V_i = Σ S_k u_k over the slots k between body i and the world,
    S = [1; p×] for a joint at p,   S = [0; 1] for the shift of a root.

The source's equality rows for ball joints (eq. 5, 9, 14) ask for velocities of just this form, and
their impulses are those that lead to the nearest such velocities in the measure of the masses:

    (Sᵀ M S + K) u = Sᵀ (M v + h f) + k                                                    (1)

with K, k from springs and other rows. So (1) gives what the equality rows of eq. 31 give, exactly.
SᵀMS comes from inertias summed over everything beyond a slot (the composite rigid body method of
Walker and Orin 1982, Featherstone 2008): block (i, j) is S_iᵀ I_j S_j, I_j the inertia of all that
moves with j, where i lies between j and the world, and zero where neither lies between.

Branches that hang on a common trunk do not see each other in (1). They are eliminated all at once,
as one batch of small systems; what is left is a system of the trunk's size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats
from ...rotations.small_batches import skew, vecmat
from ..puppet import Figure, Flags, Integers


@dataclass(frozen=True, eq=False)
class Layout:
    """Which slots are the trunk, and which a branch: the plan for solving (1)."""

    trunk: int
    """Number of slots in the trunk, the first ones."""
    branches: int
    """Number of branches, each of ``width`` slots, filled up with empty ones at its end."""
    width: int
    bodies: Integers
    """(slots,) the body whose joint (or root shift) a slot is; −1 for an empty one."""
    shifts: Flags
    """(slots,) whether it is the shift of a root."""


class Tree:
    """Equations (1) of one figure: built once, filled and solved every step."""

    def __init__(self, figure: Figure, layout: Layout | None = None) -> None:
        """By the cheapest plan, if none is given."""
        self.parents = np.array(figure.parents, dtype=np.int64)
        count = len(self.parents)
        if np.any(self.parents >= np.arange(count)):
            raise ValueError("The parents of a figure's bodies come before them.")
        self.above = np.eye(count)
        """(bodies, bodies) 1 where the second is the first or lies between it and the world."""
        for body, parent in enumerate(figure.parents):
            if parent >= 0:
                self.above[body] += self.above[parent]
        self.roots = np.flatnonzero(self.parents < 0)
        self.use(layout or plan(self.parents, self.above))
        self.use_rows(np.zeros((count, 0)))

    def use(self, layout: Layout) -> None:
        """Solve by this plan; any plan that covers the figure gives the same solutions."""
        self.layout = layout
        self._placed: Floats | None = None
        count = len(self.parents)
        slots = len(layout.bodies)
        filled = layout.bodies >= 0
        joint_slot = np.zeros(count, dtype=np.int64)
        joints = np.flatnonzero(filled & ~layout.shifts)
        joint_slot[layout.bodies[joints]] = joints
        self.joint_slot = _slice_of(joint_slot)
        """(bodies,) slot of each body's joint."""
        self.shift_slot = np.flatnonzero(layout.shifts)
        """(roots,) slot of each root's shift."""
        self.shift_slot = self.shift_slot[np.argsort(layout.bodies[self.shift_slot])]
        self.carried_slots = np.concatenate([self.shift_slot, joint_slot[self.roots]])
        """(2 roots,) the roots' shifts, then their turns."""
        self.chain = np.where(filled, self.above[:, np.maximum(layout.bodies, 0)], 0.0)
        """(bodies, slots) 1 where the slot moves the body."""
        self.beyond = np.ascontiguousarray(self.chain.T)
        # [1 | −p×] for a joint, [0 | 1] for a shift: Sᵀ, of which −p× changes.
        self.motion = np.zeros((slots, 3, 6))
        self.motion[joints, :, :3] = np.eye(3)
        self.motion[self.shift_slot, :, 3:] = np.eye(3)
        self._prepare_blocks(filled)

    def _prepare_blocks(self, filled: Flags) -> None:
        layout = self.layout
        trunk, branches, width = layout.trunk, layout.branches, layout.width
        slots = len(layout.bodies)
        # Slot i lies above slot j where j's body moves with i; a shift lies above its own root.
        upper = np.zeros((slots, slots))
        for slot in np.flatnonzero(filled):
            upper[:, slot] = self.chain[layout.bodies[slot]]
            if layout.shifts[slot]:
                upper[:, slot] = 0.0
                upper[slot, slot] = 1.0
        wide = np.kron(upper, np.ones((3, 3)))
        cut = 3 * trunk
        # With half of the diagonal: a matrix is this part of the products, and its mirror image.
        halves = np.kron(upper - 0.5 * np.eye(slots), np.ones((3, 3)))
        self._trunk_upper = np.ascontiguousarray(halves[:cut, :cut])
        self.trunk_matrix = np.zeros((cut, cut))
        self._trunk_diagonal = _diagonal_blocks(self.trunk_matrix[None])[0]
        self._cross_upper = np.ascontiguousarray(wide[:cut, cut:])
        size = 3 * width
        inner = halves[cut:, cut:].reshape(branches, size, branches, size)
        self._branch_upper = inner[np.arange(branches), :, np.arange(branches), :]
        self.branch_matrix = np.zeros((branches, size, size))
        self._branch_diagonal = _diagonal_blocks(self.branch_matrix)
        # Empty slots: a one on the diagonal, so that their velocity is zero and harms nobody.
        empty = np.repeat(~filled, 3).astype(np.float64)
        self._branch_empty = np.zeros((branches, size, size))
        index = np.arange(size)
        self._branch_empty[:, index, index] = empty[cut:].reshape(branches, size)
        self._has_empty = bool(empty.any())

    def place(self, points: Floats) -> None:
        """Take over where the joints are: (bodies, 3) from the common origin."""
        if points is self._placed:
            return
        self._placed = points
        # The transpose of a cross product's matrix is its opposite.
        self.motion[self.joint_slot, :, 3:] = skew(points).transpose(0, 2, 1)

    def of_joints(self, speeds: Floats) -> Floats:
        """(bodies, 3) of the joints, of u (slots, 3); perhaps the same numbers in memory."""
        at = self.joint_slot
        return speeds[at] if isinstance(at, slice) else speeds.take(at, 0)

    @property
    def cost(self) -> float:
        """Microseconds of a solution, about."""
        layout = self.layout
        return solving_cost(layout.trunk, [layout.width] * layout.branches)

    def use_rows(self, onto: Floats) -> None:
        """From now on rows act on bodies as (bodies, rows) says, 1, −1 or 0."""
        self.moved: Floats = self.beyond @ onto
        """(slots, rows) by which a slot moves a row."""

    def summed(self, bodies: Floats) -> Floats:
        """What ``fill`` asks of the bodies: (bodies, 6, 6 + columns) inertias and beside them
        momenta, summed over all that moves with each slot. All systems of a step share them.
        """
        sums = self.beyond @ bodies.reshape(len(bodies), -1)
        return sums.reshape(len(sums), 6, -1)

    def fill(self, summed: Floats, rows: Floats, joints: Floats) -> Floats:
        """Fill the matrix of (1), and get its right side (unknowns, columns) but for the joints'.

        ``rows`` (rows, 6, 6 + columns) have what ``summed`` has; ``joints`` (slots, 3, 3) is K,
        which stands on each slot's own block.
        """
        if len(rows):
            summed = summed + (self.moved @ rows.reshape(len(rows), -1)).reshape(summed.shape)
        both = self.motion @ summed
        self.assemble(both[:, :, :6], joints)
        return both[:, :, 6:].reshape(-1, summed.shape[2] - 6)

    def spread(self, wide: Floats, signs: Floats) -> Floats:
        """(unknowns, columns) of impulses (6, columns), each with the sign by which a slot
        (slots, columns) moves it.
        """
        turned = self.motion @ wide
        turned *= signs[:, None, :]
        return turned.reshape(-1, wide.shape[1])

    def solve_all(self, right: Floats) -> Floats:
        """Solution of (1), all unknowns (unknowns, columns); the slots' come first."""
        columns = right.shape[1]
        return self.solve(right.reshape(-1, 3, columns)).reshape(-1, columns)

    def velocities(self, speeds: Floats) -> Floats:
        """V (bodies, 6) of u (slots, 3)."""
        return self.chain @ vecmat(speeds, self.motion)

    def from_roots(self, values: Floats) -> Floats:
        """(bodies, numbers) sums over each body and all between it and the world."""
        return self.above @ values

    def assemble(self, carried: Floats, joints: Floats) -> None:
        """Fill the matrix of (1).

        ``carried`` (slots, 3, 6) is ``motion`` times the inertia of all that moves with each slot,
        rows included; ``joints`` (slots, 3, 3) is K, which stands on each slot's own block.
        """
        trunk, branches, width = self.layout.trunk, self.layout.branches, self.layout.width
        motion = self.motion
        rows = motion[:trunk].reshape(3 * trunk, 6)
        products = rows @ carried[:trunk].reshape(3 * trunk, 6).T
        products *= self._trunk_upper
        np.add(products, products.T, out=self.trunk_matrix)
        self._trunk_diagonal += joints[:trunk]
        if not branches:
            return
        of_branches = carried[trunk:].reshape(branches, 3 * width, 6)
        inner = motion[trunk:].reshape(branches, 3 * width, 6)
        products = inner @ np.ascontiguousarray(of_branches.transpose(0, 2, 1))
        products *= self._branch_upper
        np.add(products, products.transpose(0, 2, 1), out=self.branch_matrix)
        self._branch_diagonal += joints[trunk:].reshape(branches, width, 3, 3)
        if self._has_empty:
            self.branch_matrix += self._branch_empty
        between = rows @ of_branches.reshape(-1, 6).T
        between *= self._cross_upper
        self._between = between.reshape(3 * trunk, branches, 3 * width).transpose(1, 0, 2)

    def solve(self, right: Floats) -> Floats:
        """Solution of (1), u (slots, 3, columns), for right-hand sides (slots, 3, columns)."""
        trunk, branches, width = self.layout.trunk, self.layout.branches, self.layout.width
        count = right.shape[-1]
        top = right[:trunk].reshape(3 * trunk, count)
        if not branches:
            return np.linalg.solve(self.trunk_matrix, top).reshape(trunk, 3, count)
        below = right[trunk:].reshape(branches, 3 * width, count)
        both = np.concatenate([self._between.transpose(0, 2, 1), below], axis=2)
        eliminated = np.linalg.solve(self.branch_matrix, both)
        folded = (self._between @ eliminated).sum(axis=0)
        cut = 3 * trunk
        head = np.linalg.solve(self.trunk_matrix - folded[:, :cut], top - folded[:, cut:])
        tail = eliminated[..., cut:] - eliminated[..., :cut] @ head
        return np.concatenate([head, tail.reshape(-1, count)]).reshape(-1, 3, count)


def _slice_of(places: Integers) -> Integers | slice:
    """The same places; a slice, which is read and written faster, if they follow each other."""
    first = int(places[0])
    if np.array_equal(places, np.arange(first, first + len(places))):
        return slice(first, first + len(places))
    return places


def plan(parents: Integers, above: Floats) -> Layout:
    """The cheapest choice of trunk and branches: branches are all subtrees up to some size."""
    count = len(parents)
    sizes = above.sum(axis=0)
    roots = np.flatnonzero(parents < 0)
    best: tuple[float, list[list[int]]] = (solving_cost(len(roots) + count, []), [])
    for limit in np.unique(sizes):
        small = sizes <= limit
        tops = [b for b in range(count) if small[b] and (parents[b] < 0 or not small[parents[b]])]
        groups = [np.flatnonzero(above[:, top]).tolist() for top in tops]
        cost = solving_cost(len(roots) + int((~small).sum()), [len(group) for group in groups])
        if cost < best[0]:
            best = (cost, groups)
    groups = best[1]
    gone = {body for group in groups for body in group}
    width = max((len(group) for group in groups), default=0)
    bodies = [*roots.tolist(), *(b for b in range(count) if b not in gone)]
    shifts = [True] * len(roots) + [False] * (len(bodies) - len(roots))
    trunk = len(bodies)
    for group in groups:
        bodies += group + [-1] * (width - len(group))
        shifts += [False] * width
    return Layout(trunk, len(groups), width, np.array(bodies), np.array(shifts))


def solving_cost(trunk: int, sizes: list[int]) -> float:
    """Microseconds of filling and solving, about; measured with numpy's OpenBLAS on one core."""
    whole = 6.0 + 0.3 * trunk + 0.0525 * trunk**2 + 2.2e-4 * trunk**3
    if not sizes:
        return whole
    return whole + 20.0 + len(sizes) * branch_cost(max(sizes), 3 * trunk + 2)


def branch_cost(width: int, columns: int) -> float:
    """Microseconds of one of a batch of small systems with so many right sides, about."""
    return 1.0 + 0.25 * width + (0.06 + 0.002 * columns) * width**2 + 2.2e-4 * width**3


def _diagonal_blocks(matrices: Floats) -> Floats:
    """The 3 × 3 blocks on the diagonals of (…, 3n, 3n), as a view (…, n, 3, 3)."""
    batch, size, _ = matrices.shape
    outer, row, column = matrices.strides
    return np.lib.stride_tricks.as_strided(
        matrices, (batch, size // 3, 3, 3), (outer, 3 * (row + column), row, column)
    )
