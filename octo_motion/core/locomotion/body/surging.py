# SPDX-License-Identifier: GPL-3.0-or-later
"""Surge and bob: what a body's speed and height owe to the arms that push it.

An octopus crawls by making arms shorter that take hold, and longer as they push ("Arm
coordination in octopus crawling involves unique motor control strategies", Levy, Flash and
Hochner, Current Biology 25, 2015). A body that is pushed speeds up and rises, and slows down and
sinks until the next arm pushes; it does so the more the fewer arms hold on. All of it hangs on
where the body is on its way and on nothing else: at any frame rate it is the same motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, normalized
from ...smoothing import least_jerk
from .evening import evened

_PER_STRIDE: Final = 96
"""Places of the table in a stride."""
_FEWEST: Final = 64
_MOST: Final = 200_000
"""Places of the table in all."""
_BEHIND: Final = 0.65
"""Share of its push that an arm has for standing behind the body: one before it only supports."""
_FASTER: Final = 0.3
"""By how much more than on average a body goes at the height of a push, as a share of its speed …
"""
_MOST_FASTER: Final = 0.4
"""… and at most."""
_FARTHEST: Final = 0.025
"""Arm lengths that it is ahead of its place or behind it at most."""
_HIGHER: Final = 0.008
"""Arm lengths that it rises with a push …"""
_HIGHEST: Final = 0.012
"""… and at most, up or down."""
_STEP: Final = 0.3
"""Arm lengths of a stride below which it rises less: who goes nowhere, does not bob."""
_PUSHES: Final = 8.0
"""Makes the push of one arm of eight that hold on count 1."""
_AVERAGE: Final = 0.7
"""Strides over which (standard deviation) what is usual is found."""
_SHIFTED: Final = 0.012
"""Arm lengths to either side by which a body that rests in place shifts its weight …"""
_SHIFTS: Final = 0.5
"""… and how often in a cycle of its gait."""
_UPWARD: Final = np.array([0.0, 0.0, 1.0])
_ENDS: Final = 0.5
"""Strides from where the body starts and stops within which all of it comes and goes."""


@dataclass(frozen=True, eq=False)
class Holds:
    """Arms that hold on to the ground, as the body goes by."""

    start: Floats
    """(holds,) metres of the way at which an arm takes hold …"""
    end: Floats
    """(holds,) … and lets go."""
    behind: Floats
    """(holds,) how far it stands behind the body half way, −1 … 1: −1 right ahead."""


@dataclass(frozen=True, eq=False)
class Surge:
    """How far a body is from its place, all along its way."""

    spacing: float
    """Metres from one place of the table to the next."""
    table: Floats
    """(n, 3) metres, world, from the start of the way on."""
    cyclic: bool
    """Whether the last place is the first again."""

    def at(self, distance: Floats) -> Floats:
        """Metres (moments, 3), world, at distances (moments,)."""
        last = len(self.table) - 1
        place = distance / self.spacing
        place = np.mod(place, last) if self.cyclic else np.clip(place, 0.0, last)
        index = np.minimum(place.astype(np.int64), last - 1)
        t = (place - index)[:, None]
        before, here, then, after = (self._row(index + step) for step in (-1, 0, 1, 2))
        slope, rise = 0.5 * (then - before), then - here
        bend = slope + 0.5 * (after - here) - 2.0 * rise
        return here + t * (slope + t * (rise - slope - bend + t * bend))

    def _row(self, index: np.ndarray) -> Floats:
        last = len(self.table) - 1
        return self.table[index % last if self.cyclic else np.clip(index, 0, last)]


def surge(
    holds: Holds,
    centres: Callable[[Floats], Floats],
    length: float,
    *,
    stride: float,
    reach: float,
    amount: float,
    calm: Floats | None = None,
    cyclic: bool = False,
) -> Surge | None:
    """What the arms that hold on make of a body's speed and height; none if that is nothing.

    Args:
        holds: all of them.
        centres: places (n, 3) of the body, world, at distances (n,).
        length: metres of the way.
        stride: metres of one cycle.
        reach: metres that arms are long.
        amount: 1 for as much as is natural.
        calm: stretches of the way (n, 2), metres, in which the body keeps to its place.
        cyclic: whether it is a loop, whose end is its start.
    """
    if amount <= 0.0 or not len(holds.start):
        return None
    count = int(np.clip(np.ceil(_PER_STRIDE * length / stride), _FEWEST, _MOST))
    spacing = length / count
    distance = np.linspace(0.0, length, count + 1)
    pushed, down = _pushes(holds, distance, length if cyclic else None)
    width = min(_AVERAGE * stride, 0.5 * length) / spacing
    usual = evened(pushed, width, cyclic=cyclic)
    more = (pushed - usual) / np.maximum(evened(down, width, cyclic=cyclic), 0.5)
    faster = _MOST_FASTER * np.tanh(amount * _FASTER / _MOST_FASTER * _PUSHES * more)
    ahead = spacing * np.concatenate([[0.0], np.cumsum(0.5 * (faster[1:] + faster[:-1]))])
    if cyclic:
        ahead -= ahead[-1] * distance / length
    ahead -= evened(ahead, width, cyclic=cyclic)
    up = amount * _HIGHER * _PUSHES * more * min(stride / (_STEP * reach), 1.0)
    share = _share(distance, length, stride, calm, cyclic=cyclic)
    along = normalized(np.gradient(centres(distance), axis=0))
    table = (share * _held(ahead, _FARTHEST * reach))[:, None] * along
    table[:, 2] += share * _held(reach * up, _HIGHEST * reach)
    if cyclic:
        resting = amount * max(1.0 - stride / (_STEP * reach), 0.0)
        table += resting * reach * _shifting(distance / length, length / stride, along)
    if cyclic:
        table[-1] = table[0]
    return Surge(spacing, table, cyclic)


def _shifting(share: Floats, cycles: float, along: Floats) -> Floats:
    """Arm lengths (n, 3) by which a body that stays shifts its weight, at shares (n,) of a loop:
    from arms on the one side to those on the other, and a little forth and back.
    """
    turn = 2.0 * np.pi * max(round(_SHIFTS * cycles), 1) * share
    aside = np.cross(_UPWARD, along)
    lower = 0.5 * _SHIFTED * (np.cos(2.0 * turn) - 1.0)
    forth = 0.5 * _SHIFTED * np.sin(2.0 * turn + 0.7)
    return (
        _SHIFTED * np.sin(turn)[:, None] * aside
        + forth[:, None] * along
        + (0.3 * lower[:, None] * _UPWARD)
    )


def _held(values: Floats, most: float) -> Floats:
    """Values that come near to a bound, and not beyond it."""
    return most * np.tanh(values / most)


def _pushes(holds: Holds, distance: Floats, loop: float | None) -> tuple[Floats, Floats]:
    """How strongly arms push at distances (n,), and how many hold on there.

    An arm's push rises from nothing and falls to nothing, without a corner.
    """
    weights = 1.0 - _BEHIND * 0.5 * (1.0 - holds.behind)
    every = np.stack([holds.start, holds.end, weights], axis=1)
    if loop is not None:
        # Those of one round, and the same before it and after it.
        middle = 0.5 * (holds.start + holds.end) + 1e-9 * loop
        once = every[(middle >= 0.0) & (middle < loop)]
        round_it = np.array([loop, loop, 0.0])
        every = np.concatenate([once - round_it, once, once + round_it])
    # All places of all holds, one hold after the other.
    first, last = np.searchsorted(distance, every[:, 0]), np.searchsorted(distance, every[:, 1])
    many = np.maximum(last - first, 0)
    place = np.arange(many.sum()) + np.repeat(first - np.cumsum(many) + many, many)
    start, end, weight = np.repeat(every, many, axis=0).T
    share = (distance[place] - start) / np.maximum(end - start, 1e-9)
    pushing = weight * (4.0 * share * (1.0 - share)) ** 3
    holding = least_jerk(8.0 * share) * least_jerk(8.0 * (1.0 - share))
    pushed, down = (
        np.bincount(place, weights=each, minlength=len(distance)) for each in (pushing, holding)
    )
    return pushed, down


def _share(
    distance: Floats, length: float, stride: float, calm: Floats | None, *, cyclic: bool
) -> Floats:
    """How much of it all there is at distances (n,): nothing where the body starts, stops, or is to
    be calm.
    """
    ramp = min(_ENDS * stride, 0.5 * length)
    share = np.ones(len(distance))
    if not cyclic:
        share = least_jerk(distance / ramp) * least_jerk((length - distance) / ramp)
    for start, end in calm if calm is not None else ():
        away = np.maximum(start - distance, distance - end)
        share = share * least_jerk(away / ramp)
    return share
