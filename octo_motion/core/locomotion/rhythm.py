# SPDX-License-Identifier: GPL-3.0-or-later
"""When each arm is where in its cycle, as a function of how far the body has come.

A gait with a rhythm has the same cycle for all arms, a stride long, each arm ahead by its own
offset. A crawl has none: each arm's cycle begins and ends with its own holds. Both are functions
of the distance travelled alone, so that any frame can be computed without those before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from ..rotations import Floats, multiply, normalized, rotate
from .body_line import BodyLine
from .crawl import CrawlSettings, Holds, Journey, plan_crawl

_CYCLE: Final = 2.0 * np.pi
_PER_REACH: Final = 32
"""Samples of a journey to the length of an arm."""
_FINE: Final = 8
"""Steps of the table of distances between two knots of an arm's cycle."""


class Rhythm(Protocol):
    """Phases of the arms along the way."""

    def phases(self, distance: Floats) -> Floats:
        """Each arm's own phase (frames, arms) at distances (frames,), unwrapped, radians."""
        ...

    def distances(self, arms: Sequence[int], cycles: Floats) -> Floats:
        """Distances (arms, …) at which some arms have come through so many cycles (arms, …)."""
        ...


@dataclass(frozen=True, eq=False)
class Even:
    """One cycle per stride."""

    stride: float
    """Metres."""
    offsets: Floats
    """(arms,) radians that each arm is ahead of the body."""

    def phases(self, distance: Floats) -> Floats:
        """(frames, arms)."""
        return _CYCLE * distance[:, None] / self.stride + self.offsets

    def distances(self, arms: Sequence[int], cycles: Floats) -> Floats:
        """(arms, …)."""
        ahead = self.offsets[list(arms)] / _CYCLE
        return self.stride * (cycles - ahead.reshape(-1, *[1] * (cycles.ndim - 1)))


class Free:
    """Cycles that follow each arm's own holds.

    Hold k of an arm is where its phase goes from ``middle − π·duty`` to ``middle + π·duty`` of
    cycle k; in between the arm swings. The phase is a cubic between these moments, with a slope
    that neither jumps nor turns back (Fritsch & Carlson 1980).
    """

    def __init__(self, holds: Holds, arms: int, *, middle: float, duty: float) -> None:
        self._middle = middle
        self._tables = [_table(holds, arm, duty) for arm in range(arms)]

    def phases(self, distance: Floats) -> Floats:
        """(frames, arms)."""
        columns = [_CYCLE * table.cycles(distance) for table in self._tables]
        return np.stack(columns, axis=1) + self._middle

    def distances(self, arms: Sequence[int], cycles: Floats) -> Floats:
        """(arms, …)."""
        since = cycles - self._middle / _CYCLE
        return np.stack(
            [self._tables[arm].distances(each) for arm, each in zip(arms, since, strict=True)]
        )


def crawling(
    line: BodyLine,
    roots: Floats,
    outward: Floats,
    settings: CrawlSettings,
    *,
    reach: float,
    middle: float,
    duty: float,
) -> Free:
    """The rhythm of a body that crawls.

    Args:
        line: its way.
        roots: (arms, 3) metres from the body's centre to where the arms begin, in its own frame.
        outward: (arms, 4) from each arm's own frame, x outward, to the body's.
        settings: how it crawls.
        reach: metres that its arms are long.
        middle: phase of the gait half way through a hold, radians.
        duty: share of a cycle that a hold takes in the gait.
    """
    length = line.route.length
    count = max(2, int(np.ceil(length / reach * _PER_REACH)) + 1)
    distance = np.linspace(0.0, length, count)
    centres, rotations = line.at(distance)
    directions = rotate(multiply(rotations[:, None], outward), np.array([1.0, 0.0, 0.0]))[..., :2]
    places = centres[:, None] + rotate(rotations[:, None], roots)
    ahead = np.gradient(centres[:, :2], axis=0)
    journey = Journey(
        distance=distance,
        roots=places[..., :2],
        outward=normalized(directions),
        ahead=normalized(ahead),
        length=reach,
    )
    return Free(plan_crawl(journey, settings), len(roots), middle=middle, duty=duty)


@dataclass(frozen=True, eq=False)
class _Table:
    """A rising curve through knots, straight on beyond them."""

    at: Floats
    """(knots,) distances"""
    values: Floats
    """(knots,) cycles from the middle of hold 0"""
    slopes: Floats
    """(knots,)"""

    def cycles(self, distance: Floats) -> Floats:
        knot = np.clip(np.searchsorted(self.at, distance, "right") - 1, 0, len(self.at) - 2)
        start, width = self.at[knot], self.at[knot + 1] - self.at[knot]
        t = (distance - start) / width
        rise = self.values[knot + 1] - self.values[knot]
        first, last = width * self.slopes[knot], width * self.slopes[knot + 1]
        bend = first + last - 2.0 * rise
        inside = self.values[knot] + t * (first + t * (rise - first - bend + t * bend))
        before = self.values[0] + (distance - self.at[0]) * self.slopes[0]
        after = self.values[-1] + (distance - self.at[-1]) * self.slopes[-1]
        return np.where(t < 0.0, before, np.where(t > 1.0, after, inside))

    def distances(self, cycles: Floats) -> Floats:
        fine = np.interp(
            np.arange((len(self.at) - 1) * _FINE + 1) / _FINE, np.arange(len(self.at)), self.at
        )
        values = self.cycles(fine)
        inside = np.interp(cycles, values, fine)
        before = self.at[0] + (cycles - self.values[0]) / self.slopes[0]
        after = self.at[-1] + (cycles - self.values[-1]) / self.slopes[-1]
        low, high = cycles < self.values[0], cycles > self.values[-1]
        return np.where(low, before, np.where(high, after, inside))


def _table(holds: Holds, arm: int, duty: float) -> _Table:
    own: NDArray[np.bool_] = holds.arm == arm
    start, end = holds.start[own], holds.end[own]
    number = np.arange(len(start), dtype=np.float64)
    at = np.stack([start, end], axis=1).ravel()
    values: Floats = np.stack([number - 0.5 * duty, number + 0.5 * duty], axis=1).ravel()
    if not len(start):
        at, values = np.array([0.0, 1.0]), np.array([-0.5, -0.4])
    # A cycle more at either end, as long as those that are there are in the mean.
    whole = (at[-1] - at[0]) / max(values[-1] - values[0], 0.5)
    swing = 1.0 - duty
    at = np.concatenate(
        [at[0] - whole * np.array([1.0, swing]), at, at[-1] + whole * np.array([swing, 1.0])]
    )
    values = np.concatenate(
        [values[0] - np.array([1.0, swing]), values, values[-1] + np.array([swing, 1.0])]
    )
    return _Table(at, values, _monotone(at, values))


def _monotone(at: Floats, values: Floats) -> Floats:
    """Slopes at the knots with which a piecewise cubic neither jumps nor turns back."""
    width, rise = np.diff(at), np.diff(values)
    secant = rise / width
    slopes = np.empty_like(at)
    slopes[0], slopes[-1] = secant[0], secant[-1]
    first, last = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    slopes[1:-1] = (first + last) / (first / secant[:-1] + last / secant[1:])
    return slopes
