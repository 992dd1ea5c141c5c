# SPDX-License-Identifier: GPL-3.0-or-later
"""Long chains in time that grows with their length: the tree's equations, cut into segments.

Within a segment the velocities are the W (ω, v) of what it hangs on, and the turns u of its own
joints: V_i = W + Σ S_k u_k. Its energy is known from its own bodies alone,

    ½ WᵀMW + Wᵀ(Bu − m) + ½ uᵀHu − uᵀr,      B = Σ S_kᵀ I_k,

I_k of what lies beyond k in the segment, and it hangs on another one by W_c = W_s + G_c u_s, held
by an impulse λ_c (six numbers each). So

    u_s = H⁻¹ (r − BᵀW_s + Σ G_cᵀ λ_c)

for all segments at once, as one batch of small systems. What is left, in the W and λ of the cuts,
is a system of twelve for each (see ``cuts``): substructuring (Craig and Bampton 1968), exact but
for rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ..puppet import Figure, Flags, Integers
from .cuts import Cuts
from .tree import Layout, Tree, branch_cost

_FIXED_COST: Final = 50.0
"""Microseconds of a solution in segments, whatever they are."""
_MOST_BENEATH: Final = 3
"""Segments that may hang on one: each widens all systems of the batch."""
_BETTER: Final = 0.9
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
        cuts = cuts_of(self)
        each = branch_cost(self.width, 6 * (1 + self.beneath) + 2)
        return _FIXED_COST + len(self.bodies) * each + Cuts(len(cuts), _pairs(cuts)).cost


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
        self._width = segments.width
        super().__init__(figure, _layout(segments))

    def _prepare_blocks(self, filled: Flags) -> None:
        segments, width = self.segments, self._width
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
        # Empty slots: a one on the diagonal, so that their velocity is zero and harms nobody.
        self._empty = (~filled).reshape(count, width).nonzero()
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
        self._prepare_paths(most)

    def _prepare_paths(self, most: int) -> None:
        """Sums from the roots on: within each segment, and what they add to those that hang on."""
        segments = self.segments
        count = len(segments.bodies)
        # (segments, members, slots) and (segments, members, members).
        self._along = np.ascontiguousarray(self._sums[:, : self._width].transpose(0, 2, 1))
        self._among = np.zeros((count, most, most))
        self._rows = np.zeros(len(self.parents), dtype=np.int64)
        """(bodies,) where a body is among the members of all segments."""
        for number, bodies in enumerate(segments.bodies):
            members = list(bodies)
            self._among[number, : len(bodies), : len(bodies)] = self.above[np.ix_(members, members)]
            self._rows[members] = number * most + np.arange(len(bodies))
        cuts = cuts_of(segments)
        held_on = [self.parents[segments.bodies[cut.segment][0]] for cut in cuts]
        self._tip_rows = self._rows[np.array(held_on, dtype=np.int64)]
        self._carried = np.zeros((count, len(cuts)))
        """(segments, cuts) 1 where the cut is between the segment and the world."""
        for number, cut in enumerate(cuts):
            self._carried[cut.segment] = self._carried[cut.above]
            self._carried[cut.segment, number] = 1.0

    def _from_roots(self, inside: Floats) -> Floats:
        """(bodies, numbers) sums from the roots on, of those inside segments (segments, members,
        numbers).
        """
        flat = inside.reshape(-1, inside.shape[2])
        bases = self._carried @ flat.take(self._tip_rows, 0)
        inside += bases[:, None]
        return flat.take(self._rows, 0)

    def velocities(self, speeds: Floats) -> Floats:
        of_slots = (speeds[:, None, :] @ self.motion).reshape(len(self._along), self._width, 6)
        return self._from_roots(self._along @ of_slots)

    def from_roots(self, values: Floats) -> Floats:
        return self._from_roots(self._among @ values.take(self._members, 0))

    def _prepare_cuts(self, own: Floats) -> None:
        """What of a segment's answers (one base and its places, six by six) each block is of."""
        segments, width = self.segments, self._width
        count, places = len(segments.bodies), 1 + max(segments.beneath, 1)
        found = cuts_of(segments)
        self._cuts = Cuts(len(found), _pairs(found))
        self._paths = np.zeros((count, places - 1, width))
        for cut in found:
            on = self.parents[segments.bodies[cut.segment][0]]
            # Turned round, so that bases and tips come with the same sign.
            self._paths[cut.above, cut.place - 1] = -own[on, cut.above]
        self._paths = np.repeat(self._paths, 3, axis=2)[..., None]
        pairs = _pairs(found)
        self._blocks = np.zeros((len(pairs) + 1, 12, 12))
        self._blocks[: len(found), :6, 6:] = self._blocks[: len(found), 6:, :6] = _UNIT

        def number(cut: Cut, first: int, second: int) -> int:
            return (cut.above * places + first) * places + second

        def listed(numbers: list[int]) -> Integers:
            return np.array(numbers, dtype=np.int64)

        self._bases = listed([cut.segment * places * places for cut in found])
        self._tips = listed([number(cut, cut.place, cut.place) for cut in found])
        beside = [(found[a], found[b], at) for at, (a, b) in enumerate(pairs) if a != b]
        both = [(a, b, at) for a, b, at in beside if a.above == b.above]
        self._siblings = listed([at for _, _, at in both])
        self._of_siblings = listed([number(a, a.place, b.place) for a, b, _ in both])
        over = [(b, at) for a, b, at in beside if b.above == a.segment]
        self._over = listed([at for _, at in over])
        self._of_over = listed([number(b, 0, b.place) for b, _ in over])
        pairs_at = {pair: at for at, pair in enumerate(pairs)}
        self._under = listed([pairs_at[pairs[at][1], pairs[at][0]] for _, at in over])
        # Of each cut the base and the tip that it joins, and of each of these its half of a cut.
        ends = [(cut.segment * places, cut.above * places + cut.place) for cut in found]
        self._ends = listed([end for both in ends for end in both])
        self._shares = np.full(count * places, 2 * len(found))
        self._shares[self._ends] = np.arange(2 * len(found))

    @property
    def cost(self) -> float:
        return self.segments.cost

    def use_rows(self, onto: Floats) -> None:
        self._onto = self._sums @ onto[self._members]
        self.moved = self._by_unknown(self._onto)

    def _by_unknown(self, local: Floats) -> Floats:
        """(slots and segments, columns) of (segments, slots and one, columns)."""
        width = self._width
        slots = local[:, :width].reshape(len(local) * width, local.shape[-1])
        return np.concatenate([slots, local[:, width]])

    def summed(self, bodies: Floats) -> Floats:
        sums = self._sums @ bodies.reshape(len(bodies), -1).take(self._members, 0)
        return sums.reshape(len(sums), self._width + 1, 6, -1)

    def fill(self, summed: Floats, rows: Floats, joints: Floats) -> Floats:
        local = summed
        if len(rows):
            local = local + (self._onto @ rows.reshape(len(rows), -1)).reshape(local.shape)
        count, width, columns = len(local), self._width, local.shape[3]
        motion = self.motion.reshape(count, width, 3, 6)
        both = (motion @ local[:, :width]).reshape(count, 3 * width, columns)
        motion = motion.reshape(count, 3 * width, 6)
        carried = both[:, :, :6]
        products = motion @ carried.transpose(0, 2, 1)
        products *= self._halves
        np.add(products, products.transpose(0, 2, 1), out=self._inner)
        self._diagonal += joints.reshape(count, width, 3, 3)
        self._diagonal[self._empty] = _UNIT[:3, :3]
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
        count, size, columns = len(self._left), 3 * self._width, right.shape[1]
        slots = count * size
        own = right[:slots].reshape(count, size, columns)
        left = self._left
        cut = left.shape[2]
        answers = np.linalg.solve(self._inner, np.concatenate([left, own], axis=2))
        # Base and places of each segment as they answer each other, and what pulls at them.
        seen = left.transpose(0, 2, 1) @ answers
        np.negative(seen, out=seen)
        seen[:, :6, :6] += self._whole
        seen[:, :6, cut:] += right[slots:].reshape(count, 6, columns)
        places = cut // 6
        inner = seen[:, :, :cut].reshape(count, places, 6, places, 6).transpose(0, 1, 3, 2, 4)
        asked = seen[:, :, cut:].reshape(count * places, 6, columns).take(self._ends, 0)
        self._fill_cuts(inner.reshape(-1, 6, 6))
        found = self._cuts.solve(self._blocks, asked.reshape(-1, 12, columns))
        shares = found.reshape(-1, 6, columns).take(self._shares, 0)
        shares = shares.reshape(count, cut, columns)
        own = answers[:, :, cut:] - answers[:, :, :cut] @ shares
        return np.concatenate([own.reshape(slots, columns), shares[:, :6].reshape(-1, columns)])

    def _fill_cuts(self, inner: Floats) -> None:
        """Take over (segments × places × places, 6, 6) how bases and places answer each other."""
        blocks = self._blocks
        count = len(self._bases)
        blocks[:count, :6, :6] = inner.take(self._bases, 0)
        blocks[:count, 6:, 6:] = inner.take(self._tips, 0)
        if len(self._siblings):
            blocks[self._siblings, 6:, 6:] = inner.take(self._of_siblings, 0)
        between = inner.take(self._of_over, 0)
        between -= _UNIT
        blocks[self._over, :6, 6:] = between
        blocks[self._under, 6:, :6] = between.transpose(0, 2, 1)


@dataclass(frozen=True)
class Cut:
    """Where one segment hangs on another."""

    segment: int
    above: int
    """The segment that it hangs on."""
    place: int
    """Which of those that hang there it is, from 1 on."""


def cuts_of(segments: Segments) -> list[Cut]:
    """All cuts, in the order of the segments that hang by them."""
    taken = [0] * len(segments.bodies)
    found: list[Cut] = []
    for segment, above in enumerate(segments.parents):
        if above >= 0:
            taken[above] += 1
            found.append(Cut(segment, above, taken[above]))
    return found


def _pairs(cuts: list[Cut]) -> list[tuple[int, int]]:
    """Cuts of the same segment, each with itself first."""
    touching = [{cut.segment, cut.above} for cut in cuts]
    count = range(len(cuts))
    return [(n, n) for n in count] + [
        (a, b) for a in count for b in count if a != b and touching[a] & touching[b]
    ]


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
