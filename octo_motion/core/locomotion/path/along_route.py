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
class Stalking:
    """A pace that nearly comes to a stop at places evenly apart, not at the ends."""

    pace: ValuesAlong | None
    """In between; none for 1."""
    legs: int
    """From stop to stop, on all of the route."""
    within: float
    """Share of the route before and after each stop within which it slows down and gets going."""
    amount: float
    """1 for stops of which hardly a pace is left, 0 for none."""

    def at(self, share: ArrayLike) -> Floats:
        """The pace at shares (…,) of the route."""
        wanted = np.asarray(share, dtype=np.float64)
        nearest = np.clip(np.rint(wanted * self.legs), 1, max(self.legs - 1, 1)) / self.legs
        away = np.abs(wanted - nearest) / self.within if self.legs > 1 else np.ones(wanted.shape)
        slow = self.amount * _STOPPED * (1.0 - least_jerk(away))
        return (1.0 - slow) * (1.0 if self.pace is None else self.pace.at(wanted))


_STOPPED: Final = 0.94
"""Share of the pace that a stop takes."""


@dataclass(frozen=True, eq=False)
class PacedTime:
    """How a route is come through whose pace differs along it.

    A body that would come evenly through a parameter ``s`` from 0 to 1 does so at ``ds/du = m p``
    of a time ``u``, p being its pace there and m the mean of 1/p: what it is slower by.
    """

    pace: ValuesAlong | Stalking
    distances: Floats
    """(n,) shares of the route's length at even steps of the parameter, from 0 to 1."""

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Times (n,) at these steps, and the parameter's slopes (n,) over them."""
        slower = 1.0 / self.pace.at(self.distances)
        # Simpson's rule would not be worth its while: 1/p is smooth, and the steps are small.
        times = np.concatenate([[0.0], np.cumsum(0.5 * (slower[1:] + slower[:-1]))])
        times /= len(slower) - 1
        return times / times[-1], times[-1] / slower

    @property
    def slower(self) -> float:
        """How many times as long it takes."""
        return float(self._table[1][0] / self.pace.at(self.distances[:1])[0])

    @property
    def fastest(self) -> float:
        """The highest pace on the route."""
        return float(self.pace.at(self.distances).max())

    def parameter(self, times: Floats) -> Floats:
        """Parameters (…,) at times (…,) from 0 to 1."""
        known, slopes = self._table
        index = np.clip(np.searchsorted(known, times, "right") - 1, 0, len(known) - 2)
        width, step = known[index + 1] - known[index], 1.0 / (len(known) - 1)
        t = (times - known[index]) / width
        first, last = width * slopes[index], width * slopes[index + 1]
        bend = first + last - 2.0 * step
        return index * step + t * (first + t * (step - first - bend + t * bend))

    def times(self, parameters: Floats) -> Floats:
        """Times (…,) at parameters (…,)."""
        known = self._table[0]
        return np.interp(parameters, np.linspace(0.0, 1.0, len(known)), known)
