# SPDX-License-Identifier: GPL-3.0-or-later
"""Holds of two arms that lie across each other, the one soon after the other.

Between the two there is not time enough for the one to get out of the way of the other: they would
have to go through each other. So the first lets go sooner, and the second comes later, as far as
that leaves of each hold what it needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...rotations import Floats
from ...smoothing import smooth_step
from ..path import Line
from .contact_timing import ContactTiming
from .footholds import Footholds, retimed
from .surface import Limbs

_BETWEEN: Final = 0.3
"""Strides that the body goes on from where the first of two arms lets go to where the other lands
…"""
_SHORTER: Final = 0.16
"""… and by how much of one either hold gets shorter for that at most, …"""
_OF_IT: Final = 0.25
"""… and of itself."""
_BESIDE: Final = 1.7
"""How many times their thickness arms are beside each other, and are not in each other's way."""
_POINTS: Final = 4
"""Places of each segment at which that is looked at."""
_WITHIN: Final = 0.03
"""Cycles in which it is seen how fast the body goes as a hold begins or ends …"""
_STANDS: Final = 0.2
"""… and share of its usual pace below which it stands there: that hold begins or ends at rest."""


def taking_turns(
    parts: Sequence[tuple[Limbs, Footholds]],
    line: Line,
    timing: ContactTiming,
    *,
    middle: float,
    cyclic: bool,
) -> list[Footholds]:
    """The footholds of all arms of a body, by how they are built, with time between those that lie
    across each other.

    Args:
        parts: arms that are built alike, and their footholds.
        line: the body's way.
        timing: when arms hold on.
        middle: cycles by which the middle of a stance is later, as the gait has it.
        cyclic: whether each cycle is like the one before.
    """
    holds = _Holds(parts, timing, middle)
    sooner, later = holds.shorter(line.settings.stride)
    result, start = [], 0
    for limbs, footholds in parts:
        shape = footholds.touch_down.shape
        own = slice(start, start + footholds.touch_down.size)
        start = own.stop
        less = [each[own].reshape(shape) for each in (later, sooner)]
        if cyclic:
            less = [np.broadcast_to(each.max(axis=1, keepdims=True), shape) for each in less]
        if not (less[0].any() or less[1].any()):
            result.append(footholds)
            continue
        times = footholds.touch_down + less[0], footholds.lift_off - less[1]
        result.append(retimed(footholds, limbs, line, timing, times, middle=middle))
    return result


class _Holds:
    """All holds of a body (holds,), part by part, arm by arm, cycle by cycle."""

    def __init__(
        self, parts: Sequence[tuple[Limbs, Footholds]], timing: ContactTiming, middle: float
    ) -> None:
        arms, ends, paces, there, thick = [], [], [], [], []
        seen: list[list[Floats]] = []
        for limbs, footholds in parts:
            shape = footholds.touch_down.shape
            cycles = footholds.first + np.arange(shape[1])
            on, off = footholds.touch_down, footholds.lift_off
            since = np.stack([on, on + _WITHIN, off - _WITHIN, off], axis=-1)
            found = timing.distances(limbs.arms, middle + cycles[:, None] + since)
            ends.append(found[..., [0, 3]].reshape(-1, 2))
            paces.append((np.diff(found, axis=-1)[..., [0, 2]] / _WITHIN).reshape(-1, 2))
            arms.append(np.repeat(limbs.arms, shape[1]))
            there.append(footholds.present.reshape(-1))
            thick.append(footholds.skins.max(axis=-1).reshape(-1))
            roots = footholds.roots_at_touch_down, footholds.roots_at_lift_off
            joints = [
                np.concatenate([each[:, :, None], footholds.joints], axis=2) for each in roots
            ]
            seen.append([_seen(each) for each in joints])
        self._arms, self._ends = np.concatenate(arms), np.concatenate(ends)
        self._paces, self._thick = np.concatenate(paces), np.concatenate(thick)
        self._there = np.concatenate(there)
        self._seen = [[each for part in seen for each in part[end]] for end in (0, 1)]
        """As a hold begins, and as it ends."""

    def shorter(self, stride: float) -> tuple[Floats, Floats]:
        """By how many cycles each hold (holds,) ends sooner, and begins later."""
        sooner, later = np.zeros(len(self._arms)), np.zeros(len(self._arms))
        between = _BETWEEN * stride
        # From where a first arm lets go to where a second one comes.
        apart = self._ends[None, :, 0] - self._ends[:, None, 1]
        goes = (self._paces > _STANDS * stride) & self._there[:, None]
        soon = (np.abs(apart) < between) & (self._arms[:, None] != self._arms)
        soon &= goes[:, None, 1] & goes[:, 0] & self._may_cross()
        first, second = np.nonzero(soon)
        most = np.minimum(_SHORTER * stride, _OF_IT * (self._ends[:, 1] - self._ends[:, 0]))
        for one, other in zip(first.tolist(), second.tolist(), strict=True):
            lacking = 0.5 * self._crossed(one, other) * (between - apart[one, other])
            sooner[one] = max(sooner[one], min(lacking, most[one]) / self._paces[one, 1])
            later[other] = max(later[other], min(lacking, most[other]) / self._paces[other, 0])
        return sooner, later

    def _may_cross(self) -> np.ndarray:
        """(holds, holds) whether arms are not beside each other altogether, as most are: the first
        as its hold ends, the second as its begins.
        """
        room = _BESIDE * self._thick[:, None]
        (low, high), (begin, end) = (
            [
                np.array([each.min(axis=0) for each in seen]) - room,
                np.array([each.max(axis=0) for each in seen]) + room,
            ]
            for seen in (self._seen[1], self._seen[0])
        )
        return np.all((begin <= high[:, None]) & (end >= low[:, None]), axis=-1)

    def _crossed(self, one: int, other: int) -> float:
        """How far a hold as it ends and another as it begins are in each other's way, 0…1."""
        steps = self._seen[1][one][:, None] - self._seen[0][other]
        wide = float(self._thick[one] + self._thick[other])
        near = float(np.sqrt(np.einsum("ijc,ijc->ij", steps, steps).min())) / wide
        return float(smooth_step(np.array((_BESIDE - near) / (_BESIDE - 1.0))))


def _seen(joints: Floats) -> Floats:
    """Points (arms · cycles, points, 2) of arms (arms, cycles, joints, 3), seen from above."""
    steps = np.arange(_POINTS)[:, None] / _POINTS
    first, second = joints[:, :, :-1, None, :2], joints[:, :, 1:, None, :2]
    points = first + steps * (second - first)
    # From its root an arm goes to where it lies as it does from joint to joint there.
    return points.reshape(points.shape[0] * points.shape[1], -1, 2)
