# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that differ along the route: values at places, eased from each place to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...errors import SettingsError
from ...rotations import Floats
from ...smoothing import least_jerk

_CLOSEST: Final = 1e-6
"""Share of the route by which two places of one setting are apart at least."""


@dataclass(frozen=True)
class ValuesAlong:
    """Values of one setting at places of a route."""

    places: tuple[float, ...]
    """Shares of the route's length, ascending."""
    values: tuple[float, ...]

    @classmethod
    def through(cls, pairs: Sequence[tuple[float, float]]) -> ValuesAlong | None:
        """Values at places, in any order; none where there are no places.

        Raises:
            SettingsError: two are at one place.
        """
        if not pairs:
            return None
        places, values = zip(*sorted(pairs), strict=True)
        if np.any(np.diff(places) < _CLOSEST):
            raise SettingsError(
                "Two values of one setting are at one place of the route.",
                "Move them apart, or remove one.",
            )
        return cls(places, values)

    def at(self, share: ArrayLike) -> Floats:
        """The values at shares (…,) of the route: the first one before the first place, the last
        one after the last.

        Next to each place it changes neither its value nor its slope at once, see ``least_jerk``.
        """
        places, values = np.array(self.places), np.array(self.values)
        wanted = np.asarray(share, dtype=np.float64)
        if len(places) == 1:
            return np.full(wanted.shape, values[0])
        before = np.clip(np.searchsorted(places, wanted, "right") - 1, 0, len(places) - 2)
        part = (wanted - places[before]) / (places[before + 1] - places[before])
        return values[before] + least_jerk(part) * (values[before + 1] - values[before])


@dataclass(frozen=True)
class Stops:
    """Moments at which a body stops that stalks: it slows down, stands, and goes on.

    Time is that in which it would come through all of its way without a stop, from 0 to 1; the
    stops make it longer. While it slows down and gets going, its speed follows ``least_jerk``.
    """

    legs: int
    """From stop to stop, all as long: there is one stop less."""
    slowing: float
    """Time within which it comes to a standstill, and within which it is up to its pace again."""
    standing: float
    """Time that it stands."""
    amount: float
    """1 for a true standstill, 0 for none; in between it creeps on."""

    @property
    def slower(self) -> float:
        """How many times as long all takes."""
        return 1.0 + (self.legs - 1) * self._lost

    @property
    def _lost(self) -> float:
        """Time that one stop takes."""
        return self.amount * (self.slowing + self.standing)

    @property
    def _lasts(self) -> float:
        """Time from where it slows down to where it is up to its pace."""
        return 2.0 * self.slowing + self.standing

    def _last_stop(self, times: Floats) -> tuple[np.ndarray, Floats]:
        """Numbers (…,) of the stops that began last at times (…,) with stops, −1 before the first,
        and how long ago each began.
        """
        stops = np.arange(self.legs - 1)
        come = 0.5 * (self._lasts - self._lost)
        begin = (stops + 1.0) / self.legs - come + stops * self._lost
        number = np.searchsorted(begin, times, "right") - 1
        return number, times - np.append(begin, -np.inf)[number]

    def without(self, times: Floats) -> Floats:
        """Times (…,) without stops at shares (…,) of the whole time."""
        wanted = times * self.slower
        number, since = self._last_stop(wanted)
        since = np.clip(since, 0.0, self._lasts)
        ramp, held = self.slowing, self.slowing + self.standing
        stood = ramp * _risen(since / ramp) + np.clip(since - ramp, 0.0, self.standing)
        stood += 0.5 * ramp - ramp * _risen(1.0 - np.maximum(since - held, 0.0) / ramp)
        lost = np.maximum(number, 0) * self._lost + np.where(number < 0, 0.0, self.amount * stood)
        return wanted - lost

    def stood(self, times: Floats) -> Floats:
        """How many stops (…,) are over at shares (…,) of the whole time, with the part of the one
        that goes on: from where it slows down to where it is up to its pace again.
        """
        number, since = self._last_stop(times * self.slower)
        return np.where(number < 0, 0.0, number + np.clip(since / self._lasts, 0.0, 1.0))


def _risen(share: Floats) -> Floats:
    """The integral of ``least_jerk`` from 0 on."""
    t = np.clip(share, 0.0, 1.0)
    return t**4 * (2.5 + t * (t - 3.0))


@dataclass(frozen=True, eq=False)
class PacedTime:
    """How a route is come through whose pace differs along it, or on which the body stops.

    A body that would come evenly through a parameter ``s`` from 0 to 1 does so at ``ds/du = m p``
    of a time ``u``, p being its pace there and m the mean of 1/p: what it is slower by.
    """

    pace: ValuesAlong | None
    """None for the same all the way."""
    stops: Stops | None
    distances: Floats
    """(n,) shares of the route's length at even steps of the parameter, from 0 to 1."""

    @cached_property
    def _paces(self) -> Floats:
        """(n,) at these steps."""
        return np.ones(len(self.distances)) if self.pace is None else self.pace.at(self.distances)

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Times (n,) without stops at these steps, and the parameter's slopes (n,) over them."""
        slower = 1.0 / self._paces
        # Simpson's rule would not be worth its while: 1/p is smooth, and the steps are small.
        times = np.concatenate([[0.0], np.cumsum(0.5 * (slower[1:] + slower[:-1]))])
        times /= len(slower) - 1
        return times / times[-1], times[-1] / slower

    @property
    def slower(self) -> float:
        """How many times as long it takes."""
        stopping = 1.0 if self.stops is None else self.stops.slower
        return stopping * float(self._table[1][0] / self._paces[0])

    @property
    def fastest(self) -> float:
        """The highest pace on the route."""
        return float(self._paces.max())

    def parameter(self, times: Floats) -> Floats:
        """Parameters (…,) at times (…,) from 0 to 1."""
        if self.stops is not None:
            times = self.stops.without(times)
        known, slopes = self._table
        index = np.clip(np.searchsorted(known, times, "right") - 1, 0, len(known) - 2)
        width, step = known[index + 1] - known[index], 1.0 / (len(known) - 1)
        t = (times - known[index]) / width
        first, last = width * slopes[index], width * slopes[index + 1]
        bend = first + last - 2.0 * step
        return index * step + t * (first + t * (step - first - bend + t * bend))

    def times(self, parameters: Floats) -> Floats:
        """Times (…,) at parameters (…,); where the body stands, one of those."""
        even = np.linspace(0.0, 1.0, len(self.distances))
        if self.stops is None:
            return np.interp(parameters, even, self._table[0])
        return np.interp(parameters, self.parameter(even), even)
