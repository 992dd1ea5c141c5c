# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a loop keeps time: periods and computing times, counted by size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

_STEP: Final = 1e-6
_BINS: Final = 50_000


class Percentiles(NamedTuple):
    """Seconds that 50, 99 and 99.9 % stay below, and the longest of all."""

    half: float
    most: float
    nearly_all: float
    longest: float


class Histogram:
    """Counts of durations by the microsecond, up to 50 ms; adding one allocates nothing."""

    def __init__(self) -> None:
        self._counts = [0] * (_BINS + 1)
        self.count = 0
        self.longest = 0.0

    def add(self, seconds: float) -> None:
        """Count one."""
        self._counts[min(_BINS, max(0, int(seconds / _STEP)))] += 1
        self.count += 1
        self.longest = max(self.longest, seconds)

    def percentiles(self) -> Percentiles:
        """The upper edge of the bin within which each share of all lies; zeros where none came."""
        wanted = [share * self.count for share in (0.5, 0.99, 0.999)]
        found: list[float] = []
        total = 0
        for index, count in enumerate(self._counts):
            total += count
            while len(found) < 3 and count and total >= wanted[len(found)]:
                found.append(min(self.longest, (index + 1) * _STEP))
            if len(found) == 3:
                break
        half, most, nearly_all = (*found, 0.0, 0.0, 0.0)[:3]
        return Percentiles(half, most, nearly_all, self.longest)


@dataclass(frozen=True)
class LoopTimes:
    """What a loop's clock says of it."""

    rate: float
    """Hz, on average."""
    late: Percentiles
    """By how much the time from one tick to the next differed from the period."""
    computing: Percentiles
    """From a tick's begin to its end."""
    missed: int
    """Ticks left out since the one before took too long."""
