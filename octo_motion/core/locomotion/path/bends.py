# SPDX-License-Identifier: GPL-3.0-or-later
"""Bends that are tighter than arms can follow: there a body slows down, and takes more steps.

An arm that holds on stays where it is while the body turns about it. Within half a cycle it is left
behind by half of what the body turns in one; where that is more than its neighbour is away, the two
go through each other. An animal that turns in a small space takes short steps. So here the route
counts as longer in a tight bend than it is, by as much as it takes to turn no faster: all that goes
by metres of the route, the rhythm of the arms and the pace of the body alike, follows from that one
table.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...rotations import Floats
from ...smoothing import evened
from .route import Route, looked_up, past_joints

_TURNED: Final = np.radians(50.0)
"""What a body turns by in a cycle of its gait at most, about. Eight arms are 45° apart, and hold on
for half a cycle. Of 18 walks and hurries along hairpins, loops and ways of random turns, arms go
through each other in none; at 60° in four, and in eleven without a limit."""
_FROM, _WHOLLY = 0.5, 1.5
"""Shares of that from which on a route begins to count as longer, and from which on it does so by
all that it turns too fast. Where it turns by less than the first, nothing changes."""
_PER_STRIDE: Final = 32
"""Places of the table in a stride: twice as many change no place of the body by a thousandth of
one."""
_FEWEST: Final = 64
_MOST: Final = 16384
_EVEN: Final = 0.1
"""Strides by which what a route turns is evened out besides its corners: the pace changes as
smoothly as that."""


@dataclass(frozen=True, eq=False)
class SlowedRoute(Route):
    """A route that counts as longer in tight bends than it is; all distances are so."""

    curve: Route
    """As it is."""
    metres: Floats
    """(n,) along that, evenly from its start to its end …"""
    counted: Floats
    """(n,) … what these count as, …"""
    slower: Floats
    """(n,) … and how many times as long the route is there."""

    @property
    def bare(self) -> Route:
        """The curve as it is."""
        return self.curve

    @cached_property
    def length(self) -> float:
        """Metres that it counts as."""
        return float(self.counted[-1])

    def distance_at(self, s: ArrayLike) -> Floats:
        """Metres ``(…,)`` that the way from its start to parameters ``(…,)`` counts as."""
        metres = self.curve.distance_at(s)
        found = looked_up((self.metres, self.counted, self.slower), metres.reshape(-1))
        return found.reshape(metres.shape)

    def parameter_at(self, distance: ArrayLike) -> Floats:
        """Parameters ``(…,)`` where it counts as so many metres ``(…,)``."""
        return self.curve.parameter_at(self.metres_at(distance))

    def parameter_near(self, distance: ArrayLike) -> Floats:
        """The same to about a thousandth of a segment."""
        return self.curve.parameter_near(self.metres_at(distance))

    def metres_at(self, distance: ArrayLike) -> Floats:
        """Metres ``(…,)`` along the curve as it is."""
        wanted = np.asarray(distance, dtype=np.float64)
        inside = np.clip(wanted, 0.0, self.length).reshape(-1)
        found = looked_up((self.counted, self.metres, 1.0 / self.slower), inside)
        # Before and after it, metres count as what they are.
        return found.reshape(wanted.shape) + (wanted - np.clip(wanted, 0.0, self.length))

    def of_curve(self, curve: Route) -> SlowedRoute:
        """Another curve that is as long, and counts as longer in the same places."""
        return SlowedRoute(
            *(curve.controls, curve.breaks, curve.cyclic),
            *(curve, self.metres, self.counted, self.slower),
        )


def slowed_in_bends(route: Route, *, stride: float, corner: float, amount: float) -> Route:
    """The same route, on which a body that faces along it slows down in tight bends.

    It is the same one if it has none.

    Args:
        route: where to, seen from above.
        stride: metres that the body comes in a cycle of its gait.
        corner: metres before and after a sharp corner within which it turns.
        amount: 1 for as much as it takes, 0 for not at all.
    """
    route = route.bare
    count = int(np.clip(np.ceil(_PER_STRIDE * route.length / stride), _FEWEST, _MOST))
    metres = np.linspace(0.0, route.length, count + 1)
    spacing = route.length / count
    ways = route.tangent(past_joints(route.parameter_near(metres), route.breaks))
    # Seen from above: a route that rises or falls turns as much less.
    x, y = ways[:, 0], ways[:, 1]
    across, onto = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    level = np.hypot(across, onto)
    turned = np.abs(np.arctan2(across, onto)) * level
    first, last = (turned[-1], turned[0]) if route.cyclic else (turned[0], turned[-1])
    around = np.concatenate([[first], turned, [last]])
    rate = 0.5 * (around[1:] + around[:-1]) / spacing * stride / _TURNED
    # A body turns before and after a corner, fastest in the middle.
    width = np.hypot(corner, _EVEN * stride) / spacing
    rate = np.maximum(evened(rate, width, cyclic=route.cyclic), 0.0)
    if rate.max() <= _FROM:
        return route
    slower = 1.0 + amount * _beyond(rate)
    steps = 0.5 * spacing * (slower[1:] + slower[:-1])
    counted = np.concatenate([[0.0], np.cumsum(steps)])
    return SlowedRoute(
        *(route.controls, route.breaks, route.cyclic), *(route, metres, counted, slower)
    )


def _beyond(rate: Floats) -> Floats:
    """By how much rates (…,) are beyond 1, which they come to be smoothly."""
    width = _WHOLLY - _FROM
    share = np.clip((rate - _FROM) / width, 0.0, 1.0)
    # Its slope rises from 0 to 1; beyond that it goes straight on.
    return 0.5 * width * share**2 + np.maximum(rate - _WHOLLY, 0.0)
