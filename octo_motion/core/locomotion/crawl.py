# SPDX-License-Identifier: GPL-3.0-or-later
"""Which arms hold the ground while an octopus crawls, where, and for how long.

After Levy, Flash & Hochner, "Arm Coordination in Octopus Crawling Involves Unique Motor Control
Strategies", Current Biology 25 (2015): an arm takes hold close to the body and pushes it away by
getting longer, each arm along its own direction, which is fixed to the body. The way to go is
chosen by choosing which arms push; the way to face is free of it; and the arms keep no rhythm.

So there is no gait here that the arms are slaves of. Arms whose push points along the way take
hold again as soon as they can. The others hold on only now and then, to support, and else are left
to search. How long each hold and each pause lasts is drawn from a seeded stream of the arm's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..errors import SettingsError
from ..rotations import Floats

_BEFORE: Final = 1.5
"""Arm lengths before the start at which the crawl begins, so that arms hold when it is seen."""


@dataclass(frozen=True)
class CrawlSettings:
    """How a crawl is made. Lengths in arm lengths, angles in radians."""

    near: float = 0.25
    """From an arm's root to where it takes hold to push."""
    far: float = 0.45
    """From there to where it lets go."""
    pushing: float = np.radians(70.0)
    """Largest angle between an arm's push and the way to go of an arm that pushes."""
    astray: float = np.radians(25.0)
    """Angle by which a hold may come to lie beside the arm's own direction before it lets go."""
    pause: tuple[float, float] = (0.12, 0.25)
    """Shortest and longest way between two holds of an arm that pushes."""
    search: tuple[float, float] = (0.2, 0.5)
    """Shortest and longest way between two holds of an arm that does not."""
    hold: tuple[float, float] = (0.5, 1.0)
    """Shares of the longest possible hold after which an arm lets go."""
    least: int = 3
    """Arms that hold on at any time, if the body has as many."""
    seed: int = 0

    def __post_init__(self) -> None:
        pairs = (self.pause, self.search, self.hold)
        numbers = (self.near, self.far, self.pushing, self.astray, *(x for p in pairs for x in p))
        if not np.all(np.isfinite(numbers)) or min(numbers) <= 0.0:
            raise SettingsError("A setting of the crawl is not a number above 0.", "Set it anew.")
        if self.near >= self.far:
            raise SettingsError(
                f"Arms take hold {self.near:g} arm lengths away and let go at {self.far:g}.",
                "Let them take hold nearer than they let go.",
            )
        if any(low > high for low, high in pairs):
            raise SettingsError(
                "A least value of the crawl is greater than the greatest.", "Exchange the two."
            )


@dataclass(frozen=True, eq=False)
class Journey:
    """The body at samples along its way, as crawling needs it. World, metres, seen from above."""

    distance: Floats
    """(samples,) ascending."""
    roots: Floats
    """(samples, arms, 2) where the arms begin."""
    outward: Floats
    """(samples, arms, 2) unit: where the arms point at rest."""
    ahead: Floats
    """(samples, 2) unit: where the body goes."""
    length: float
    """Of an arm."""


@dataclass(frozen=True, eq=False)
class Holds:
    """Holds of all arms, sorted by arm and start."""

    arm: NDArray[np.intp]
    """(holds,)"""
    start: Floats
    """(holds,) distance at which the arm has taken hold."""
    end: Floats
    """(holds,) and at which it lets go."""
    place: Floats
    """(holds, 2) world XY."""
    pushes: NDArray[np.bool_]
    """(holds,) whether the arm pushes, or only supports."""

    def __len__(self) -> int:
        """Number of holds."""
        return len(self.arm)


def plan_crawl(journey: Journey, settings: CrawlSettings) -> Holds:
    """Where the arms hold on along a journey.

    An arm's next hold depends on the holds before it, but all of them on the journey alone: any
    frame can be computed from the result without those before it.

    Raises:
        SettingsError: the journey has no length to sample.
    """
    if len(journey.distance) < 2:
        raise SettingsError("The crawl has nowhere to go.", "Make the route longer.")
    return _Crawl(journey, settings).run()


class _Crawl:
    """One journey, hold by hold in the order in which they begin."""

    def __init__(self, journey: Journey, settings: CrawlSettings) -> None:
        self._journey = journey
        self._settings = settings
        self._unit = journey.length
        self._arms = journey.roots.shape[1]
        self._streams = [
            np.random.default_rng([settings.seed, 7919, arm]) for arm in range(self._arms)
        ]
        self._holds: list[tuple[int, float, float, float, float, bool]] = []
        self._ends = np.full(self._arms, -np.inf)
        """Where each arm's latest hold ends."""
        self._pushed = np.zeros(self._arms, dtype=np.bool_)
        """Whether each arm pushes in its latest hold."""

    def run(self) -> Holds:
        distance, unit = self._journey.distance, self._unit
        first, last = float(distance[0]) - _BEFORE * unit, float(distance[-1])
        # Arms begin at different places: else they would all let go together for a while.
        waiting = [
            (first + unit * float(stream.uniform(0.0, 0.6)), arm)
            for arm, stream in enumerate(self._streams)
        ]
        heapify(waiting)
        while waiting and waiting[0][0] <= last:
            at, arm = heappop(waiting)
            end = self._take_hold(arm, self._not_too_few(arm, at), waiting)
            heappush(waiting, (end + self._rest(arm, end), arm))
        return self._sorted()

    def _not_too_few(self, arm: int, planned: float) -> float:
        """When an arm takes hold: earlier than planned if else too few would hold on before."""
        others = np.sort(np.delete(self._ends, arm))
        least = min(self._settings.least, self._arms - 1)
        # From when on fewer than enough arms would hold, or none would push.
        alone = float(others[-least]) if least > 0 else np.inf
        if self._pushes(arm, planned):
            pushers = [other for other in range(self._arms) if other != arm and self._pushed[other]]
            alone = min(alone, max((float(self._ends[other]) for other in pushers), default=alone))
        overlap = 0.5 * self._settings.pause[0] * self._unit
        if not np.isfinite(alone):
            return planned
        shortest = self._settings.pause[0] * self._unit
        return max(float(self._ends[arm]) + shortest, min(planned, alone - overlap))

    def _pushes(self, arm: int, at: float) -> bool:
        """Whether an arm's push points along the way."""
        _, outward, ahead = self._at(arm, at)
        return -float(outward @ ahead) >= np.cos(self._settings.pushing)

    def _take_hold(self, arm: int, at: float, waiting: list[tuple[float, int]]) -> float:
        settings, unit = self._settings, self._unit
        root, outward, ahead = self._at(arm, at)
        middle = 0.5 * (settings.near + settings.far) * unit
        half = 0.5 * (settings.far - settings.near) * unit
        # A rear arm takes hold near and lets go far, a front arm the other way round, one at the
        # side first ahead and then behind.
        place = root + middle * outward + half * ahead
        pushes = self._pushes(arm, at)
        longest = self._lasts(arm, at, place)
        share = self._streams[arm].uniform(*settings.hold)
        end = at + share * longest
        # Nobody else to take over yet: hold on for as long as it goes.
        others = np.delete(self._ends, arm) > end
        coming = np.array([start <= end for start, other in waiting if other != arm])
        if np.count_nonzero(others) + np.count_nonzero(coming) < settings.least:
            end = at + longest
        end = max(end, at + 1e-3 * unit)
        self._holds.append((arm, at, end, float(place[0]), float(place[1]), pushes))
        self._ends[arm], self._pushed[arm] = end, pushes
        return end

    def _lasts(self, arm: int, at: float, place: Floats) -> float:
        """How far the body can go until the arm has to let go of a place."""
        settings, distance, unit = self._settings, self._journey.distance, self._unit
        later = np.searchsorted(distance, at, "right")
        root = self._journey.roots[later:, arm]
        outward = self._journey.outward[later:, arm]
        if at < distance[0]:
            # Before the start the body comes straight on.
            lead = np.arange(at, distance[0], 0.05 * unit)
            before = (
                self._journey.roots[0, arm]
                + (lead - distance[0])[:, None] * (self._journey.ahead[0])
            )
            root = np.concatenate([before, root])
            outward = np.concatenate(
                [np.tile(self._journey.outward[0, arm], (len(lead), 1)), outward]
            )
            along = np.concatenate([lead, distance[later:]])
        else:
            along = distance[later:]
        reach = place - root
        away = np.hypot(reach[:, 0], reach[:, 1])
        inwards = np.sum(reach * outward, axis=1)
        slack = 1e-6 * unit
        kept = (away <= settings.far * unit * 1.05 + slack) & (
            inwards >= np.cos(settings.astray) * away - slack
        )
        kept &= away >= 0.9 * settings.near * unit - slack
        lost = np.flatnonzero(~kept)
        stop = along[lost[0]] if len(lost) else (along[-1] if len(along) else at) + unit
        return float(stop - at)

    def _rest(self, arm: int, at: float) -> float:
        """How far the body goes before an arm takes hold again."""
        limits = self._settings.pause if self._pushes(arm, at) else self._settings.search
        return self._unit * float(self._streams[arm].uniform(*limits))

    def _at(self, arm: int, at: float) -> tuple[Floats, Floats, Floats]:
        """Root and direction of an arm, and the way to go, at a distance, also before the start."""
        journey = self._journey
        distance = journey.distance
        right = int(np.clip(np.searchsorted(distance, at), 1, len(distance) - 1))
        left = right - 1
        share = np.clip((at - distance[left]) / (distance[right] - distance[left]), 0.0, 1.0)

        def between(values: Floats) -> Floats:
            return (1.0 - share) * values[left] + share * values[right]

        ahead = _unit(between(journey.ahead))
        beyond = min(at - float(distance[0]), 0.0) + max(at - float(distance[-1]), 0.0)
        root = between(journey.roots[:, arm]) + beyond * ahead
        return root, _unit(between(journey.outward[:, arm])), ahead

    def _sorted(self) -> Holds:
        holds = sorted(self._holds)
        columns = np.array(holds, dtype=np.float64).reshape(len(holds), 6)
        return Holds(
            arm=columns[:, 0].astype(np.intp),
            start=columns[:, 1],
            end=columns[:, 2],
            place=columns[:, 3:5],
            pushes=columns[:, 5] > 0.5,
        )


def _unit(vector: Floats) -> Floats:
    return vector / max(float(np.hypot(*vector)), 1e-12)
