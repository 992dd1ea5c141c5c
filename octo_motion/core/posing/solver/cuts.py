# SPDX-License-Identifier: GPL-3.0-or-later
"""The system of a segmented tree's cuts: twelve unknowns each, that see their neighbours alone.

A cut's equations, of the velocity W that its segment hangs by and the impulse λ that holds it, have
blocks of twelve with the cuts of the same two segments and with no others. Every second cut of a
chain is eliminated by itself, all at once as one batch, and so again until few are left: cyclic
reduction (Hockney 1965). What is left is solved as it is. A cut's own block

    [A  1]
    [1 −C]

with the inertia A and the mobility C is never singular, whatever hangs on it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ..puppet import Integers

SIZE: Final = 12
"""Unknowns of a cut."""
_FEW: Final = 9
"""Cuts that are solved at once: another round would take longer."""
_MOST_NEIGHBOURS: Final = 2
_ROUND_COST: Final = 45.0
"""Microseconds of a round, however few it eliminates."""

Pairs = dict[tuple[int, int], int]
"""Number of the block of two cuts that see each other, and of each with itself."""


@dataclass(frozen=True, eq=False)
class _Round:
    """How some cuts are eliminated; numbers of blocks, one past their last for an empty one."""

    gone: Integers
    """(gone,)"""
    kept: Integers
    """(kept,)"""
    own: Integers
    """(gone,) blocks of those that go with themselves."""
    beside: Integers
    """(2 gone,) blocks of the two neighbours of each with it."""
    neighbours: Integers
    """(2 gone,) which of the kept they are, one past the last for none."""
    blocks: Integers
    """(pairs + 1,) of the kept, as they were; the last is empty."""
    taken: tuple[Integers, ...]
    """Each (pairs + 1,): which of the (4 gone + 1) products is to be taken from each of them."""
    rights: tuple[Integers, ...]
    """Each (kept,): the same for their right sides, of (2 gone + 1)."""


class Cuts:
    """The plan for some cuts, by which of them see each other."""

    def __init__(self, count: int, pairs: Collection[tuple[int, int]]) -> None:
        """For so many cuts. Blocks are numbered as the pairs are in order, in which all (n, n)
        come first.
        """
        numbers: Pairs = {pair: number for number, pair in enumerate(pairs)}
        self._rounds: list[_Round] = []
        while count > _FEW:
            gone = _independent(count, numbers)
            if 4 * len(gone) < count:
                break
            each, numbers = _round(count, numbers, gone)
            self._rounds.append(each)
            count = len(each.kept)
        self._matrix = np.zeros((count, SIZE, count, SIZE))
        rows, columns = np.array(list(numbers), dtype=np.int64).reshape(-1, 2).T
        self._rows, self._columns = rows, columns

    @property
    def at_once(self) -> int:
        """How many are left for one system."""
        return len(self._matrix)

    @property
    def cost(self) -> float:
        """Microseconds of a solution, about."""
        gone = sum(len(each.gone) for each in self._rounds)
        size = SIZE * self.at_once
        return (
            _ROUND_COST * len(self._rounds) + 4.0 * gone + 6.0 + 0.0045 * size**2 + 8e-6 * size**3
        )

    def solve(self, blocks: Floats, right: Floats) -> Floats:
        """(cuts + 1, 12, columns), the last zero, for blocks (pairs + 1, 12, 12), of which the last
        is zero, and right sides (cuts, 12, columns).
        """
        columns = right.shape[2]
        backward: list[tuple[_Round, Floats]] = []
        for each in self._rounds:
            count = len(each.gone)
            beside = blocks.take(each.beside, 0).reshape(count, 2 * SIZE, SIZE)
            known = np.concatenate([beside.transpose(0, 2, 1), right.take(each.gone, 0)], axis=2)
            answers = np.linalg.solve(blocks.take(each.own, 0), known)
            folded = beside @ answers
            products = np.zeros((4 * count + 1, SIZE, SIZE))
            inner = folded[:, :, : 2 * SIZE].reshape(count, 2, SIZE, 2, SIZE)
            products[:-1].reshape(count, 2, 2, SIZE, SIZE)[...] = inner.transpose(0, 1, 3, 2, 4)
            blocks = blocks.take(each.blocks, 0)
            for which in each.taken:
                blocks -= products.take(which, 0)
            pulls = np.zeros((2 * count + 1, SIZE, columns))
            pulls[:-1].reshape(count, 2 * SIZE, columns)[...] = folded[:, :, 2 * SIZE :]
            right = right.take(each.kept, 0)
            for which in each.rights:
                right -= pulls.take(which, 0)
            backward.append((each, answers))
        matrix, count = self._matrix, len(right)
        matrix[self._rows, :, self._columns] = blocks[:-1]
        size = SIZE * count
        found = np.zeros((count + 1, SIZE, columns))
        flat = np.linalg.solve(matrix.reshape(size, size), right.reshape(size, columns))
        found[:-1] = flat.reshape(count, SIZE, columns)
        for each, answers in reversed(backward):
            count = len(each.gone)
            beside = found.take(each.neighbours, 0).reshape(count, 2 * SIZE, columns)
            whole = np.zeros((count + len(each.kept) + 1, SIZE, columns))
            whole[each.kept] = found[:-1]
            own = answers[:, :, 2 * SIZE :] - answers[:, :, : 2 * SIZE] @ beside
            whole[each.gone] = own
            found = whole
        return found


def _independent(count: int, pairs: Pairs) -> list[int]:
    """Cuts of which none sees another, and each few of those that are left."""
    beside = _beside(count, pairs)
    gone: dict[int, None] = {}
    for cut in range(count):
        if len(beside[cut]) <= _MOST_NEIGHBOURS and gone.keys().isdisjoint(beside[cut]):
            gone[cut] = None
    return list(gone)


def _beside(count: int, pairs: Pairs) -> list[set[int]]:
    """Of each cut, those that it sees."""
    result: list[set[int]] = [set() for _ in range(count)]
    for a, b in pairs:
        if a != b:
            result[a].add(b)
    return result


def _round(count: int, pairs: Pairs, gone: list[int]) -> tuple[_Round, Pairs]:
    """The plan for eliminating some cuts, and the pairs that are left."""
    beside = _beside(count, pairs)
    kept = sorted(set(range(count)).difference(gone))
    place = {cut: number for number, cut in enumerate(kept)}
    empty, none = len(pairs), len(kept)
    blocks: list[int] = []
    neighbours: list[int] = []
    taken: dict[tuple[int, int], list[int]] = {(n, n): [] for n in range(none)}
    rights: dict[int, list[int]] = {n: [] for n in range(none)}
    for number, cut in enumerate(gone):
        sees = sorted(place[other] for other in beside[cut])
        blocks += [pairs[kept[n], cut] for n in sees] + [empty] * (2 - len(sees))
        neighbours += sees + [none] * (2 - len(sees))
        for first, one in enumerate(sees):
            rights[one].append(2 * number + first)
            for second, other in enumerate(sees):
                taken.setdefault((one, other), []).append(4 * number + 2 * first + second)
    for a, b in pairs:
        if a in place and b in place:
            taken.setdefault((place[a], place[b]), [])
    old = [pairs.get((kept[a], kept[b]), empty) for a, b in taken]
    plan = _Round(
        np.array(gone),
        np.array(kept, dtype=np.int64),
        np.array([pairs[cut, cut] for cut in gone]),
        np.array(blocks),
        np.array(neighbours),
        np.array([*old, empty]),
        _layers([*taken.values(), []], 4 * len(gone)),
        _layers([*rights.values()], 2 * len(gone)),
    )
    return plan, {pair: number for number, pair in enumerate(taken)}


def _layers(lists: list[list[int]], empty: int) -> tuple[Integers, ...]:
    """The first of each list, the second of each, and so on; ``empty`` where there is none."""
    most = max(map(len, lists), default=0)
    filled = [each + [empty] * (most - len(each)) for each in lists]
    return tuple(np.array(filled, dtype=np.int64).reshape(len(lists), most).T.copy())
