# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of a rig's controls for which its bones are where they are wanted.

What lies between controls and bones (inverse kinematics, constraints, drivers) is not known here,
only asked: damped least squares after Levenberg and Marquardt, with derivatives by differences that
Broyden's rule (1965) keeps up to date, so that most steps ask but once. An artist moves few
controls, and so do we: one after the other those are taken that do most, by orthogonal matching
pursuit (Pati and others 1993), and the others stay. Where these do not reach, as in a chain whose
controls each bend along with the one before, the controls of what was bent are moved together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats

_STEP: Final = 3e-4
"""Of values, for differences: above what a solver of inverse kinematics leaves open, and small
beside what a limb that is nearly straight is short of its length."""
_FARTHEST: Final = 0.5
"""By which a value goes in one step."""
_DAMPING: Final = 1e-3
_LEAST_DAMPING: Final = 1e-8
_MOST_DAMPING: Final = 1e2
_SLOW: Final = 0.5
"""Share of the miss: a step that leaves more of it asks for new derivatives."""
_ENOUGH: Final = 0.9
"""Share of the miss: with new derivatives, what leaves more of it is not worth its while."""
_SAME: Final = 1e-4
"""Of the largest, what counts as no derivative: as near as differences tell."""
_STAYS: Final = 3e-4
"""What a value of one counts against what is off: what hardly matters stays where it is."""
_NO_WAY: Final = 1e-16
"""Square of a step that is none."""
_GAIN: Final = 0.05
"""Share of the square of what is off that a control is to take away, to be moved as well."""
_REST: Final = 0.1
"""Share of that which is left to another look: farther on nothing goes as the derivatives say."""
_ROUNDS: Final = 5
"""How often one looks for controls that are to move as well."""
_STEPS: Final = 8
"""Between two such looks."""


@dataclass(eq=False)
class ControlFit:
    """Controls on their way to a goal; values are radians, or shares of the figure's size."""

    shape: Callable[[Floats], Floats]
    """From values (values,) to numbers (numbers,) that are to be like the goal's."""
    counts: Sequence[int]
    """How many values each control has."""
    moves: NDArray[np.bool_]
    """(values, numbers) which numbers a value can change."""
    now: Floats = field(init=False)
    """(numbers,) of the values as they are."""
    values: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.values = np.zeros(sum(self.counts))
        self.now = self.shape(self.values)
        self._slopes: Floats | None = None
        self._damping = _DAMPING
        ends = np.cumsum(self.counts)
        self._blocks = [
            list(range(end - count, end)) for end, count in zip(ends, self.counts, strict=True)
        ]
        self._chosen: list[int] = []
        """Values that are moved."""

    def step(self, goal: Floats) -> bool:
        """One step towards a goal (numbers,); whether it came nearer."""
        if not len(self.values):
            return False
        if self._slopes is None:
            self._ask(range(len(self.values)))
            self._choose(goal)
        return self._step(goal)

    def settle(
        self, goal: Floats, hard: int, close: float, enough: float, own: Sequence[int] = ()
    ) -> float:
        """Go on until the first ``hard`` numbers, three to a point, are close, or come no closer.

        Where they are close enough, no other controls are moved for it. Where few controls do not
        reach, these ``own`` ones of what was bent are moved as well, if that does it. Returns how
        far the farthest point is off in the end.
        """
        for _ in range(_ROUNDS if len(self.values) else 0):
            if self.off(goal, hard) <= close:
                break
            before = self._missed(goal)
            if self.off(goal, hard) > enough:
                self._ask(range(len(self.values)))
                self._choose(goal)
            else:
                self._ask(self._chosen)
            self._damping = min(self._damping, _DAMPING)
            fresh = True
            for _ in range(_STEPS):
                start = self._missed(goal)
                nearer = self._step(goal)
                if self.off(goal, hard) <= close or (fresh and self._damping >= _MOST_DAMPING):
                    break
                fresh = not nearer and fresh
                if self._missed(goal) > _SLOW * start and not fresh:
                    self._ask(self._chosen)
                    fresh = True
            if self._missed(goal) > _ENOUGH * before and (
                self.off(goal, hard) <= enough or not self._reach(goal, own)
            ):
                break
        return self.off(goal, hard)

    def off(self, goal: Floats, hard: int) -> float:
        """How far the farthest of the first points is off."""
        apart = (self.now - goal)[:hard].reshape(-1, 3)
        return float(np.linalg.norm(apart, axis=1).max(initial=0.0))

    def _missed(self, goal: Floats) -> float:
        return float(np.linalg.norm(self.now - goal))

    def _step(self, goal: Floats) -> bool:
        assert self._slopes is not None
        chosen = self._chosen
        miss, slopes = self.now - goal, self._slopes[:, chosen]
        square = slopes.T @ slopes
        damped = square + self._damping * np.diag(np.diag(square) + 1e-3 * square.trace())
        damped += _STAYS**2 * np.eye(len(square))
        way = np.zeros_like(self.values)
        way[chosen] = -np.linalg.solve(damped, slopes.T @ miss + _STAYS**2 * self.values[chosen])
        way *= min(1.0, _FARTHEST / max(float(np.abs(way).max(initial=0.0)), 1e-12))
        length = float(way @ way)
        if length < _NO_WAY:
            return False
        found = self.shape(self.values + way)
        nearer = self._cost(found, self.values + way, goal) < self._cost(
            self.now, self.values, goal
        )
        if nearer:
            told = self._slopes @ way
            self._slopes += np.outer(found - self.now - told, way) / length
            self.values, self.now = self.values + way, found
            self._damping = max(0.1 * self._damping, _LEAST_DAMPING)
        else:
            self.shape(self.values)
            self._damping = min(max(10.0 * self._damping, _DAMPING), _MOST_DAMPING)
        return nearer

    def _cost(self, found: Floats, values: Floats, goal: Floats) -> float:
        return _square(found - goal) + _STAYS**2 * _square(values)

    def _choose(self, goal: Floats) -> None:
        """Take controls beside those that are moved, as long as one takes away enough."""
        self._take(goal, self._blocks, _GAIN)

    def _reach(self, goal: Floats, own: Sequence[int]) -> bool:
        """Take more of some controls, each of which does little, where together they do most."""
        assert self._slopes is not None
        more = [self._blocks[each] for each in own if self._blocks[each][0] not in self._chosen]
        slopes, miss = self._slopes[:, sum(more, self._chosen)], self.now - goal
        # Undamped: of controls that do nearly alike, it is the differences that bend a chain.
        way = np.linalg.lstsq(slopes, miss, rcond=_SAME)[0]
        if not more or _square(miss - slopes @ way) > _REST * _square(miss):
            return False
        self._take(goal, more, 0.0)
        return True

    def _take(self, goal: Floats, blocks: Sequence[list[int]], gain: float) -> None:
        assert self._slopes is not None
        slopes, miss = self._slopes, self.now - goal
        left = _left(slopes[:, self._chosen], miss)
        waiting = [each for each in blocks if not set(each) & set(self._chosen)]
        start = _square(left)
        while waiting and _square(left) > _REST * start:
            gains = [_square(left) - _square(_left(slopes[:, each], left)) for each in waiting]
            best = int(np.argmax(gains))
            if gains[best] <= gain * start:
                break
            self._chosen = self._chosen + waiting.pop(best)
            left = _left(slopes[:, self._chosen], miss)

    def _ask(self, values: Sequence[int]) -> None:
        """Ask for the derivatives of some values anew, about what they are."""
        slopes = np.zeros((len(self.now), len(self.values)))
        if self._slopes is not None:
            slopes[:] = self._slopes
        for together in self._apart(values):
            beside = self.values.copy()
            beside[together] += _STEP
            found = (self.shape(beside) - self.now) / _STEP
            slopes[:, together] = np.where(self.moves[together].T, found[:, None], 0.0)
        self.now = self.shape(self.values)
        self._slopes = slopes

    def _apart(self, values: Sequence[int]) -> list[list[int]]:
        """Values in groups that move nothing in common: these are tried together."""
        groups: list[tuple[list[int], NDArray[np.bool_]]] = []
        for number in values:
            apart = (each for each in groups if not (each[1] & self.moves[number]).any())
            group, moved = next(apart, ([], np.zeros_like(self.moves[number])))
            if not group:
                groups.append((group, moved))
            group.append(number)
            np.logical_or(moved, self.moves[number], out=moved)
        return [group for group, _ in groups]


def _left(slopes: Floats, miss: Floats) -> Floats:
    """What is left of a miss (numbers,) when values with these slopes take away what they can."""
    if not slopes.shape[1]:
        return miss
    square = slopes.T @ slopes
    damped = square + (_DAMPING * square.trace() / len(square) + 1e-12) * np.eye(len(square))
    return miss - slopes @ np.linalg.solve(damped, slopes.T @ miss)


def _square(numbers: Floats) -> float:
    return float(numbers @ numbers)
