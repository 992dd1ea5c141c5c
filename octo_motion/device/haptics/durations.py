# SPDX-License-Identifier: GPL-3.0-or-later
"""Durations counted by size: how well a loop keeps time."""

from __future__ import annotations

from typing import Final, NamedTuple

_RANGES: Final = ((0.0, 1e-3, 1e-6), (1e-3, 1e-2, 1e-5), (1e-2, 5e-2, 1e-4))
"""From, to and width of bins, in s: a hundredth of what they count, or finer. Few enough of them
that looking through all takes no tick's time."""
_FIRSTS: Final = (0, 1000, 1900)
_LAST: Final = 2300


class Percentiles(NamedTuple):
    """Seconds that 50, 99 and 99.9 % stay below, and the longest of all."""

    half: float
    most: float
    nearly_all: float
    longest: float


class Histogram:
    """Counts of durations by size, up to 50 ms; adding one allocates nothing."""

    def __init__(self) -> None:
        self._counts = [0] * (_LAST + 1)
        self.count = 0
        self.longest = 0.0

    def add(self, seconds: float) -> None:
        """Count one."""
        self._counts[_bin(seconds)] += 1
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
                found.append(min(self.longest, _upper_edge(index)))
            if len(found) == 3:
                break
        half, most, nearly_all = (*found, 0.0, 0.0, 0.0)[:3]
        return Percentiles(half, most, nearly_all, self.longest)


def _bin(seconds: float) -> int:
    for first, (start, end, width) in zip(_FIRSTS, _RANGES, strict=True):
        if seconds < end:
            return first + max(0, int((seconds - start) / width))
    return _LAST


def _upper_edge(index: int) -> float:
    place = 2 if index >= _FIRSTS[2] else 1 if index >= _FIRSTS[1] else 0
    start, _, width = _RANGES[place]
    return start + (index - _FIRSTS[place] + 1) * width
