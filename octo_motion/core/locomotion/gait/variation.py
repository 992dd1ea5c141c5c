# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes no two arms and no two cycles alike: random additions to a gait's angles and phases.

All of it hangs on seed, cycle and arm alone, never on which frames are asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ...smoothing import least_jerk
from .table import ANGLES, CYCLE, LINKS, GaitCurve, GaitTable, columns_by_curve

_LATE: Final = 0.02 * CYCLE, 0.003 * CYCLE
"""By how much arms that are naturally uneven are ahead or late at most, radians of phase: always,
and in a single cycle. More of the latter would make strokes hasty …"""
_UNLIKE: Final = np.radians([[3.0, 3.0], [4.0, 4.0], [7.0, 7.0]])
"""(links, 2) … and by how much their head and pitch differ: how far they reach, and curl."""
_OWN_TIME: Final = 0.004
"""Cycles by which arms that rest on the ground in place are ahead or late at most: always …"""
_TIME: Final = 0.003
"""… and in a single cycle. At 0.015 and 0.01 arms of Idle cross each other for longer."""
_ASIDE: Final = np.radians(4.0)
"""How far to either side of where it would, such an arm takes hold at most …"""
_REACH: Final = 0.01
"""… and how many arm lengths nearer or farther. At 0.02 arms of Curl come off before they let go,
and drift by 1 % of their length instead of 0.65 %."""
_MORE_BENT: Final = np.radians(6.0)
"""By how much it lies there bent otherwise. At 20° Idle turns by 11.2° in a frame instead of 9.3°.
"""


def unevenness(
    phases: Floats, amount: float, seed: int, *, cycle_period: int | Sequence[int] = 0
) -> tuple[Floats, Floats]:
    """Phases (frames, arms), radians, of arms that begin each cycle a little early or late, and
    what is added to their angles (frames, arms, links, angles), radians.

    Numbers are drawn for each arm and cycle. From one cycle's to the next's it goes as gently as
    can be, so that no arm stops or jumps.

    Args:
        phases: (frames, arms) radians.
        amount: 1 for as much as is natural.
        seed: any whole number ≥ 0.
        cycle_period: as of :func:`variation`.
    """
    added = np.zeros((*phases.shape, LINKS, len(ANGLES)))
    if phases.size == 0 or amount == 0.0:
        return phases, added
    cycles, first, numbers = _cycles_of(phases, cycle_period)
    arms = range(phases.shape[1])

    def drawn(cycle: int) -> list[Floats]:
        streams = [_stream(seed, cycle, arm, 1) for arm in arms]
        return [each.uniform(-amount, amount, 1 + _UNLIKE.size) for each in streams]

    known = {each: drawn(each) for each in set(numbers.ravel().tolist())}
    values = np.array(
        [[known[each][arm] for arm, each in enumerate(row)] for row in numbers.tolist()]
    )
    start, end = (values[cycles - first + step, arms] for step in (0, 1))
    share = least_jerk(np.mod(phases, CYCLE) / CYCLE)[..., None]
    there = start + share * (end - start)
    added[..., :2] = there[..., 1:].reshape(*phases.shape, *_UNLIKE.shape) * _UNLIKE
    always = [_stream(seed, 0, arm, 2).uniform(-amount, amount) for arm in arms]
    return phases + _LATE[0] * np.array(always) + _LATE[1] * there[..., 0], added


@dataclass(frozen=True)
class UnevenHolds:
    """How arms that rest on the ground in place differ in what they do there: from each other, and
    from cycle to cycle.
    """

    amount: float
    """1 for as much as is natural."""
    seed: int
    periods: int | Sequence[int]
    """Cycles after which it comes again, of all arms or of each."""

    def of(self, arms: Sequence[int], cycles: np.ndarray) -> Floats:
        """Of some arms in cycles of some numbers (cycles,): by how many cycles they take hold late,
        radians anticlockwise and arm lengths by which they do so beside and beyond their usual
        place, and radians by which they lie more bent, (4, arms, cycles).
        """
        periods = np.broadcast_to(np.asarray(self.periods), (max(arms) + 1,))[list(arms)]
        numbers = np.where(periods > 0, cycles[:, None] % np.maximum(periods, 1), cycles[:, None])
        drawn = np.array(
            [
                [_stream(self.seed, cycle, arm, 3).uniform(-1.0, 1.0, 4) for cycle in own]
                for arm, own in zip(arms, numbers.T.tolist(), strict=True)
            ]
        )
        always = [_stream(self.seed, 0, arm, 4).uniform(-1.0, 1.0) for arm in arms]
        late, aside, beyond, bent = np.moveaxis(drawn, 2, 0)
        late = _TIME * late + _OWN_TIME * np.array(always)[:, None]
        return self.amount * np.stack([late, _ASIDE * aside, _REACH * beyond, _MORE_BENT * bent])


def variation(
    table: GaitTable,
    phases: Floats,
    pairs: tuple[int, ...],
    limits: tuple[float, float],
    seed: int,
    *,
    cycle_period: int | Sequence[int] = 0,
    smoothing_cycles: float = 0.0,
) -> Floats:
    """Random additions to the angles: R(j, k) of [Octopus, §3.4].

    One number is drawn for each arm, link, cycle and knot (and for head and pitch apart), uniform
    in [j, k), and interpolated as the table itself is; the last knot of a cycle is the first of
    the next, so that the motion stays continuous. Numbers depend on seed, cycle and arm alone,
    never on which frames are asked for. Bank stays as it is.

    Args:
        table: the gait, for its knots.
        phases: (frames, arms) radians.
        pairs: pair of each arm.
        limits: j and k, radians.
        seed: any whole number ≥ 0.
        cycle_period: cycles after which the numbers come again, 0 for never; or each arm's own.
        smoothing_cycles: as of :func:`gait_angles`.

    Returns:
        (frames, arms, links, angles) radians.
    """
    low, high = limits
    result = np.zeros((*phases.shape, LINKS, len(ANGLES)))
    if phases.size == 0 or (low == 0.0 and high == 0.0):
        return result
    cycles, first, numbers = _cycles_of(phases, cycle_period)
    for pair, columns in columns_by_curve(table, pairs).items():
        curve, own = table.curve(pair), phases[:, columns]
        knots = len(curve.phases) - 1
        values = low + (high - low) * _draws(seed, numbers[:, columns], columns, knots)
        knot, share = curve.locate(own)
        place = (cycles[:, columns] - first) * knots + knot
        arms, share = np.arange(len(columns)), share[..., None, None]
        result[:, columns, :, :2] = (1.0 - share) * values[place, arms]
        result[:, columns, :, :2] += share * values[place + 1, arms]
        if smoothing_cycles > 0.0:
            result[:, columns, :, :2] += _rounded_off(curve, values, own, first, smoothing_cycles)
    return result


def _cycles_of(
    phases: Floats, cycle_period: int | Sequence[int]
) -> tuple[np.ndarray, int, np.ndarray]:
    """The cycle of each phase (frames, arms), the first one whose draws may count, and the numbers
    (cycles, arms) that are drawn for those from there on.
    """
    cycles = np.floor_divide(phases, CYCLE).astype(np.int64)
    periods = np.broadcast_to(np.asarray(cycle_period, dtype=np.int64), phases.shape[1:])
    first = int(cycles.min()) - 1
    every = np.arange(first, int(cycles.max()) + 3)[:, None]
    return cycles, first, np.where(periods > 0, every % np.maximum(periods, 1), every)


def _draws(seed: int, numbers: np.ndarray, arms: np.ndarray, knots: int) -> Floats:
    """Uniform in [0, 1), one cycle after the other (cycles × knots, arms, links, 2).

    Of arms, by their numbers in the body, the draws of cycles of some numbers (cycles, arms) count.
    """
    cycles = set(numbers.ravel().tolist())
    drawn = {each: _draw_cycle(seed, each, arms, knots) for each in cycles}
    values = np.array(
        [[drawn[each][arm] for arm, each in enumerate(row)] for row in numbers.tolist()]
    )
    return np.moveaxis(values, 2, 1).reshape(-1, len(arms), LINKS, 2)


def _rounded_off(
    curve: GaitCurve, values: Floats, phases: Floats, first: int, smoothing_cycles: float
) -> Floats:
    """What rounds the corners of random additions off (frames, arms, links, 2).

    Values (cycles × knots, arms, links, 2) are at the curve's knots from the first cycle on, phases
    (frames, arms) in radians.
    """
    knots, arms = len(curve.phases) - 1, np.arange(phases.shape[1])
    apart = np.tile(np.diff(curve.phases), len(values) // knots)[:-1, None, None, None]
    corners = np.zeros_like(values)
    corners[1:-1] = np.diff(np.diff(values, axis=0) / apart, axis=0)
    rounding = curve.rounding(phases, smoothing_cycles)
    result = np.zeros((*phases.shape, LINKS, 2))
    for number in range(knots):
        nearest = np.rint((phases - curve.phases[number]) / CYCLE).astype(np.int64) - first
        result += rounding[..., number, None, None] * corners[nearest * knots + number, arms]
    return result


def _draw_cycle(seed: int, cycle: int, arms: np.ndarray, knots: int) -> Floats:
    """(arms, knots, links, 2) uniform in [0, 1). Each arm has a stream of its own."""
    streams = [_stream(seed, cycle, arm) for arm in arms.tolist()]
    return np.stack([stream.random((knots, LINKS, 2)) for stream in streams])


def _stream(seed: int, cycle: int, *words: int) -> np.random.Generator:
    # SeedSequence takes no negative numbers; a phase offset can reach back before cycle 0.
    return np.random.default_rng([seed, abs(cycle), int(cycle < 0), *words])
