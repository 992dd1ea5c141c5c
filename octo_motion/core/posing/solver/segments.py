# SPDX-License-Identifier: GPL-3.0-or-later
"""Long chains in time that grows with their length: the tree's equations, cut into segments.

Within a segment the velocities are the W (ω, v) of what it hangs on, and the turns u of its own
joints: V_i = W + Σ S_k u_k. Its energy is known from its own bodies alone,

    ½ WᵀMW + Wᵀ(Bu − m) + ½ uᵀHu − uᵀr,      B = Σ S_kᵀ I_k,

I_k of what lies beyond k in the segment, and it hangs on another one by W_c = W_s + G_c u_s, held
by an impulse λ_c (six numbers each). So

    u_s = H⁻¹ (r − BᵀW_s + Σ G_cᵀ λ_c)

for all segments at once, as one batch of small systems. What is left, in the W and λ of the cuts,
is a system of twelve for each: substructuring (Craig and Bampton 1968), exact but for rounding.
With segments of a dozen joints its share is small up to a few hundred of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ..puppet import Figure, Flags
from .tree import Layout, Tree, solving_cost

_FIXED_COST: Final = 80.0
"""Microseconds of a solution in segments, whatever they are."""
_MOST_BENEATH: Final = 3
"""Segments that may hang on one: each widens all systems of the batch."""
_BETTER: Final = 0.8
"""Of the cost without segments: what they must be below."""
_UNIT: Final = np.eye(6)


@dataclass(frozen=True, eq=False)
class Segments:
    """A figure's bodies in connected parts."""

    bodies: tuple[tuple[int, ...], ...]
    """Of each, the one first that it hangs on the others by."""
    parents: tuple[int, ...]
    """The segment that each hangs on, −1 where its first body is a root."""

    @property
    def width(self) -> int:
        """Most joints and shifts of one."""
        return max(
            len(each) + (parent < 0) for each, parent in zip(self.bodies, self.parents, strict=True)
        )

    @property
    def beneath(self) -> int:
        """Most segments that hang on one."""
        hangs = [parent for parent in self.parents if parent >= 0]
        return int(np.bincount(hangs).max()) if hangs else 0

    @property
    def cost(self) -> float:
        """Microseconds of a solution, about."""
        cuts = sum(parent >= 0 for parent in self.parents)
        columns = 6 * (1 + self.beneath) + 2
        width = self.width
        each = 1.5 + 0.35 * width + 2.0e-2 * (0.3 * width) ** 3
        each += 2.0e-3 * width * width * columns / 3.0
        return _FIXED_COST + len(self.bodies) * each + solving_cost(4 * cuts, [])


def tree_of(figure: Figure) -> Tree:
    """The quickest equations of a figure."""
    whole = Tree(figure)
    best: Segments | None = None
    least = _BETTER * whole.cost
    for size in range(5, 16):
        cut = cut_at(figure.parents, size)
        if cut.beneath <= _MOST_BENEATH and cut.cost < least:
            best, least = cut, cut.cost
    return whole if best is None else SegmentedTree(figure, best)


def cut_at(parents: tuple[int, ...], size: int) -> Segments:
    """Cut a figure into segments of about so many bodies, from its tips on."""
    beneath: list[list[int]] = [[] for _ in parents]
    for body, parent in enumerate(parents):
        if parent >= 0:
            beneath[parent].append(body)
    open_: list[list[int]] = [[] for _ in parents]
    closed: list[list[int]] = []
    for body in range(len(parents) - 1, -1, -1):
        own = [body]
        for each in sorted(beneath[body], key=lambda child: len(open_[child])):
            if len(own) + len(open_[each]) <= size:
                own += open_[each]
            else:
                closed.append(open_[each])
        if len(own) >= size and parents[body] >= 0:
            closed.append(own)
            own = []
        open_[body] = own
    closed += [open_[body] for body, parent in enumerate(parents) if parent < 0]
    bodies = sorted((tuple(sorted(each)) for each in closed if each), key=lambda each: each[0])
    of_body = {body: number for number, each in enumerate(bodies) for body in each}
    hangs = tuple(of_body.get(parents[each[0]], -1) for each in bodies)
    return Segments(tuple(bodies), hangs)


class SegmentedTree(Tree):
    """Equations (1) of one figure, in segments; ``solve`` gives what ``Tree`` gives."""

    def __init__(self, figure: Figure, segments: Segments) -> None:
        self.segments = segments
        super().__init__(figure, _layout(segments))

    def _prepare_blocks(self, filled: Flags) -> None:
        segments, width = self.segments, self.segments.width
        count = len(segments.bodies)
        layout = self.layout
        inside = np.zeros((len(self.parents), count))
        for number, bodies in enumerate(segments.bodies):
            inside[list(bodies), number] = 1.0
        # (bodies, slots) 1 where the slot moves the body and is of the same segment.
        own = self.chain.reshape(-1, count, width) * inside[:, :, None]
        upper = np.zeros((count, width, width))
        for slot in np.flatnonzero(filled):
            number, at = divmod(int(slot), width)
            if layout.shifts[slot]:
                upper[number, at, at] = 1.0
            else:
                upper[number, :, at] = own[layout.bodies[slot], number]
        # A shift lies above its own root, which is the slot after it.
        halves = upper - 0.5 * np.eye(width)
        self._halves = np.kron(halves, np.ones((3, 3)))
        self._inner = np.zeros((count, 3 * width, 3 * width))
        self._diagonal = _diagonal(self._inner)
        index = np.arange(3 * width)
        self._empty = np.zeros_like(self._inner)
        self._empty[:, index, index] = np.repeat(~filled, 3).reshape(count, -1)
        # Sums over the bodies beyond each slot, and over all, of each segment by itself.
        most = max(map(len, segments.bodies))
        self._members = np.zeros((count, most), dtype=np.int64)
        sums = np.zeros((count, width + 1, most))
        for number, bodies in enumerate(segments.bodies):
            self._members[number, : len(bodies)] = bodies
            sums[number, :width, : len(bodies)] = own[list(bodies), number].T
            sums[number, width, : len(bodies)] = 1.0
        self._sums = sums
        self._prepare_cuts(own)

    def _prepare_cuts(self, own: Floats) -> None:
        segments, width = self.segments, self.segments.width
        count, beneath = len(segments.bodies), max(segments.beneath, 1)
        self._hanging = np.array([n for n, each in enumerate(segments.parents) if each >= 0])
        self._above = np.array([segments.parents[each] for each in self._hanging], dtype=np.int64)
        place = {int(each): n for n, each in enumerate(self._hanging)}
        taken = [0] * count
        numbers: list[int] = []
        self._paths = np.zeros((count, beneath, width))
        for each, above in zip(self._hanging, self._above, strict=True):
            number = taken[above]
            taken[above] += 1
            numbers.append(1 + number)
            on = self.parents[segments.bodies[each][0]]
            self._paths[above, number] = own[on, above]
        self._number = np.array(numbers, dtype=np.int64)
        """(cuts,) which of those that hang on a segment each is, from 1 on."""
        self._paths = np.repeat(self._paths, 3, axis=2)[..., None]
        cuts = len(self._hanging)
        self._cut = np.zeros((cuts, 12, cuts, 12))
        each = np.arange(cuts)
        self._cut[each, :6, each, 6:] = self._cut[each, 6:, each, :6] = _UNIT
        self._each = each
        self._on_hanging = np.array([n for n in each if self._above[n] in place], dtype=np.int64)
        self._place_above = np.array(
            [place[int(self._above[n])] for n in self._on_hanging], dtype=np.int64
        )
        same = self._above[:, None] == self._above
        self._first, self._second = same.nonzero()

    @property
    def cost(self) -> float:
        return self.segments.cost

    def use_rows(self, onto: Floats) -> None:
        self._onto = onto
        local = self._sums @ onto[self._members]
        self.moved = self._by_unknown(local)

    def _by_unknown(self, local: Floats) -> Floats:
        """(slots and segments, columns) of (segments, slots and one, columns)."""
        width = self.segments.width
        slots = local[:, :width].reshape(len(local) * width, local.shape[-1])
        return np.concatenate([slots, local[:, width]])

    def fill(self, stack: Floats, joints: Floats) -> Floats:
        bodies, columns = len(self.parents), stack.shape[2]
        flat = stack.reshape(len(stack), -1)
        total = flat[:bodies]
        if self._onto.shape[1]:
            total = total + self._onto @ flat[bodies:]
        local = self._sums @ total.take(self._members, 0)
        count, width = len(local), self.segments.width
        local = local.reshape(count, width + 1, 6, columns)
        motion = self.motion.reshape(count, width, 3, 6)
        both = (motion @ local[:, :width]).reshape(count, 3 * width, columns)
        motion = motion.reshape(count, 3 * width, 6)
        carried = both[:, :, :6]
        products = motion @ carried.transpose(0, 2, 1)
        products *= self._halves
        np.add(products, products.transpose(0, 2, 1), out=self._inner)
        self._inner += self._empty
        self._diagonal += joints.reshape(count, width, 3, 3)
        ways = motion[:, None] * self._paths
        ways = ways.transpose(0, 2, 1, 3).reshape(count, 3 * width, -1)
        self._left = np.concatenate([carried, ways], axis=2)
        self._whole = local[:, width, :, :6]
        return np.concatenate(
            [
                both[:, :, 6:].reshape(3 * count * width, -1),
                local[:, width, :, 6:].reshape(6 * count, -1),
            ]
        )

    def spread(self, wide: Floats, signs: Floats) -> Floats:
        slots = len(self.layout.bodies)
        turned = self.motion @ wide
        turned *= signs[:slots, None, :]
        bases = wide[None] * signs[slots:, None, :]
        return np.concatenate([turned.reshape(3 * slots, -1), bases.reshape(-1, wide.shape[1])])

    def solve_all(self, right: Floats) -> Floats:
        count, width, columns = len(self._left), self.segments.width, right.shape[1]
        slots = 3 * count * width
        own = right[:slots].reshape(count, 3 * width, columns)
        left = self._left
        cut = left.shape[2]
        answers = np.linalg.solve(self._inner, np.concatenate([left, own], axis=2))
        seen = left.transpose(0, 2, 1) @ answers
        blocks = seen[:, :, :cut].reshape(count, cut // 6, 6, cut // 6, 6)
        asked = seen[:, :, cut:].reshape(count, cut // 6, 6, columns)
        hanging, above, number = self._hanging, self._above, self._number
        matrix, each = self._cut, self._each
        matrix[each, :6, each, :6] = self._whole[hanging] - blocks[hanging, 0, :, 0]
        first, second = self._first, self._second
        matrix[first, 6:, second, 6:] = -blocks[above[first], number[first], :, number[second]]
        on, over = self._on_hanging, self._place_above
        between = blocks[above[on], 0, :, number[on]] - _UNIT
        matrix[over, :6, on, 6:] = between
        matrix[on, 6:, over, :6] = between.transpose(0, 2, 1)
        wanted = np.empty((len(each), 12, columns))
        bases = right[slots:].reshape(count, 6, columns)
        wanted[:, :6] = bases[hanging] - asked[hanging, 0]
        wanted[:, 6:] = asked[above, number]
        size = 12 * len(each)
        found = np.linalg.solve(matrix.reshape(size, size), wanted.reshape(size, columns))
        found = found.reshape(len(each), 12, columns)
        shares = np.zeros((count, cut // 6, 6, columns))
        shares[hanging, 0] = -found[:, :6]
        shares[above, number] = found[:, 6:]
        own = answers[:, :, cut:] + answers[:, :, :cut] @ shares.reshape(count, cut, columns)
        return np.concatenate([own.reshape(slots, columns), -shares[:, 0].reshape(-1, columns)])


def _layout(segments: Segments) -> Layout:
    """Slots segment by segment, each filled up with empty ones."""
    width = segments.width
    bodies: list[int] = []
    shifts: list[bool] = []
    for own, parent in zip(segments.bodies, segments.parents, strict=True):
        root = [own[0]] if parent < 0 else []
        slots = [*root, *own]
        bodies += slots + [-1] * (width - len(slots))
        shifts += [True] * len(root) + [False] * (width - len(root))
    return Layout(len(bodies), 0, 0, np.array(bodies), np.array(shifts))


def _diagonal(matrices: Floats) -> Floats:
    """The 3 × 3 blocks on the diagonals of (batch, 3n, 3n), as a view (batch, n, 3, 3)."""
    batch, size, _ = matrices.shape
    outer, row, column = matrices.strides
    return np.lib.stride_tricks.as_strided(
        matrices, (batch, size // 3, 3, 3), (outer, 3 * (row + column), row, column)
    )
