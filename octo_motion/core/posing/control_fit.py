# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of a rig's controls for which its bones are where they are wanted.

What lies between controls and bones (inverse kinematics, constraints, drivers) is not known here,
only asked: damped least squares after Levenberg and Marquardt, with derivatives by differences that
Broyden's rule (1965) keeps up to date, so that most steps ask but once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats

_STEP: Final = 3e-3
"""Of values, for differences: well above what a solver of inverse kinematics leaves open."""
_FARTHEST: Final = 0.5
"""By which a value goes in one step."""
_DAMPING: Final = 1e-3
_LEAST_DAMPING: Final = 1e-8
_MOST_DAMPING: Final = 1e4
_SLOW: Final = 0.5
"""Share of the miss: a step that leaves more of it asks for new derivatives."""
_ENOUGH: Final = 0.995
"""Share of the miss: with new derivatives, a step that leaves more of it is not worth its while."""
_STAYS: Final = 3e-4
"""What a value of one counts against what is off: what hardly matters stays where it is."""
_NO_WAY: Final = 1e-16
"""Square of a step that is none."""


@dataclass(eq=False)
class ControlFit:
    """Controls on their way to a goal; values are radians, or shares of the figure's size."""

    shape: Callable[[Floats], Floats]
    """From values (values,) to numbers (numbers,) that are to be like the goal's."""
    values: Floats
    weights: Floats
    """(numbers,) how much each counts."""
    moves: NDArray[np.bool_]
    """(values, numbers) which numbers a value can change."""
    now: Floats = field(init=False)
    """(numbers,) of the values as they are."""
    _slopes: Floats | None = None
    _damping: float = _DAMPING
    _fresh: bool = False
    """Whether the derivatives are those of the values as they are."""

    def __post_init__(self) -> None:
        self.now = self.shape(self.values)
        # Values that move nothing in common are tried together.
        self._groups: list[list[int]] = []
        for number in range(len(self.values)):
            apart = (
                each for each in self._groups if not (self.moves[each] & self.moves[number]).any()
            )
            group = next(apart, None)
            if group is None:
                self._groups.append([number])
            else:
                group.append(number)

    def step(self, goal: Floats) -> bool:
        """One step towards a goal (numbers,); whether it came nearer."""
        if not len(self.values):
            return False
        if self._slopes is None:
            self.refresh()
        assert self._slopes is not None
        miss = self.weights * (self.now - goal)
        slopes = self.weights[:, None] * self._slopes
        square = slopes.T @ slopes
        damped = square + self._damping * np.diag(np.diag(square) + 1e-3 * square.trace())
        damped += _STAYS**2 * np.eye(len(square))
        way = -np.linalg.solve(damped, slopes.T @ miss + _STAYS**2 * self.values)
        way *= min(1.0, _FARTHEST / max(float(np.abs(way).max()), 1e-12))
        length = float(way @ way)
        if length < _NO_WAY:
            return False
        found = self.shape(self.values + way)
        nearer = self._cost(found, self.values + way, goal) < self._cost(
            self.now, self.values, goal
        )
        if nearer:
            told = self._slopes @ way
            self._slopes = self._slopes + np.outer(found - self.now - told, way) / length
            self.values, self.now, self._fresh = self.values + way, found, False
            self._damping = max(0.1 * self._damping, _LEAST_DAMPING)
        else:
            self.shape(self.values)
            self._damping = min(max(10.0 * self._damping, _DAMPING), _MOST_DAMPING)
        return nearer

    def _cost(self, found: Floats, values: Floats, goal: Floats) -> float:
        miss = self.weights * (found - goal)
        return float(miss @ miss + _STAYS**2 * (values @ values))

    def refresh(self) -> None:
        """Ask for the derivatives anew, about the values as they are."""
        slopes = np.zeros((len(self.now), len(self.values)))
        for together in self._groups:
            beside = self.values.copy()
            beside[together] += _STEP
            found = (self.shape(beside) - self.now) / _STEP
            for number in together:
                slopes[:, number] = np.where(self.moves[number], found, 0.0)
        self.now = self.shape(self.values)
        self._slopes = slopes
        self._fresh = True

    def settle(self, goal: Floats, hard: int, close: float, most: int = 24) -> float:
        """Go on until the first ``hard`` numbers, three to a point, are as close as that.

        Returns how far the farthest point is off in the end.
        """
        before = np.inf
        for _ in range(most):
            if self.off(goal, hard) <= close or self._damping >= _MOST_DAMPING:
                break
            if self._slopes is None:
                self.refresh()
            fresh, nearer = self._fresh, self.step(goal)
            after = float(np.linalg.norm(self.weights * (self.now - goal)))
            if fresh and nearer and after > _ENOUGH * before and self._damping <= _DAMPING:
                break
            slow, before = after > _SLOW * before, after
            if (slow or not nearer) and not self._fresh:
                self.refresh()
        return self.off(goal, hard)

    def off(self, goal: Floats, hard: int) -> float:
        """How far the farthest of the first points is off that count whole."""
        counts = self.weights[:hard] >= 1.0
        apart = np.where(counts, (self.now - goal)[:hard], 0.0).reshape(-1, 3)
        return float(np.linalg.norm(apart, axis=1).max(initial=0.0))
