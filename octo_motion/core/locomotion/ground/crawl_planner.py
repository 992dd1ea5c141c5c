# SPDX-License-Identifier: GPL-3.0-or-later
"""Which arms hold the ground while an octopus crawls, where, and for how long.

After Levy, Flash & Hochner, "Arm Coordination in Octopus Crawling Involves Unique Motor Control
Strategies", Current Biology 25 (2015): an arm takes hold close to the body and pushes it away by
getting longer, each arm along its own direction, which is fixed to the body. The way to go is
chosen by choosing which arms push; the way to face is free of it; and the arms keep no rhythm.

So there is no gait here that the arms are slaves of. Arms whose push points along the way take
hold again as soon as they can. The others hold on only now and then, to support, and else are left
to search. How long each stance and each pause lasts is drawn from a seeded stream of the arm's own.

Where a constant says what was seen when it was other, that is eight arms on 24 ways, straight on or
round a corner, facing ahead, aside or back: three arms are in stance at any time, 3.6 in the mean,
one of them pushes nearly always, and no two come nearer to each other than 0.10 arm lengths.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import Floats, normalized, rotate_in_plane

_FREE: Final = np.linspace(0.4, 1.0, 6)
"""Places that are looked at between body and ground: near the body all arms are close …"""
_OUTLINE_SHARES: Final = np.linspace(0.2, 1.0, 5)
"""… and those on the ground."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Arms from above, metres; shapes that go together."""

    roots: Floats
    """(…, 2) where they begin."""
    places: Floats
    """(…, 2) where they meet the ground."""
    tips: Floats
    """(…, 2) where they end."""

    def points(self) -> Floats:
        """(…, points, 2) along them, but for where they are close to the body."""
        roots, places, tips = (each[..., None, :] for each in (self.roots, self.places, self.tips))
        free, lying = _FREE[:, None], _OUTLINE_SHARES[:, None]
        before, after = roots + free * (places - roots), places + lying * (tips - places)
        shape = np.broadcast_shapes(before.shape[:-2], after.shape[:-2])
        return np.concatenate(
            [np.broadcast_to(each, (*shape, *each.shape[-2:])) for each in (before, after)], axis=-2
        )


def clearance(one: Outline, other: Outline) -> Floats:
    """How far (…,) each of some arms is from one of others."""
    apart = one.points()[..., :, None, :] - other.points()[..., None, :, :]
    return np.sqrt(np.min(np.sum(apart * apart, axis=-1), axis=(-2, -1)))


_PUSHING: Final = np.radians(70.0)
"""Largest angle between an arm's push and the way to go of an arm that pushes. At 50° none does for
1.4 % of the way, instead of 0.03 %."""
_ASTRAY: Final = np.radians(25.0)
"""Angle by which a foothold may come to lie beside the arm's own direction before it lifts off. At
12° stances are 0.24 arm lengths long instead of 0.26; at 60° arms come nearer to each other, 0.152
in the mean of all ways instead of 0.166."""
_MOST_ASIDE: Final = np.radians(20.0)
"""Largest angle by which an arm takes hold beside its own direction to keep clear of others.
Without, arms come as near as 0.005 arm lengths: they lie on each other."""
_CLEAR: Final = 0.13
"""Arm lengths that arms in stance should be apart, from the middle of one to the other's. At 0.03
they come as near as 0.037, less than an arm is thick."""
_SHORTEST: Final = 0.16
"""Arm lengths that a stance lasts at least: in less an arm would hardly have lain down."""
_PAUSE: Final = (0.2, 0.45)
"""Shortest and longest way, in arm lengths, between two stances of an arm that pushes: time to
swing. At 0.08 to 0.2 swings are hasty: on bumps arms slip by 0.0017 arm lengths instead of 0.0005
and turn by 11° instead of 9° from frame to frame."""
_SEARCH: Final = (0.3, 0.8)
"""The same of an arm that does not push, which is left to search: as long as that of one that does,
it would be in stance as often, and 3.8 arms in the mean."""
_SHARE: Final = (0.7, 1.0)
"""Shares of the longest possible stance after which an arm lifts off: always the whole of it,
stances are 0.31 long instead of 0.26."""
_LEAST: Final = 3
"""Arms in stance at any time, if the body has as many: three carry it. With 2 there are fewer than
three for a quarter of the way."""
_BEFORE: Final = 1.5
"""Arm lengths before the start at which the crawl begins, so that arms hold when it is seen. At 0.3
there are but two at times."""
_TRIED: Final = 16
"""Lengths of a stance from which the longest is taken that the arm can keep: with 6 they are so
coarse that arms come as near as 0.08 …"""
_LOOKED_AT: Final = (0.0, 0.25, 0.75, 1.0)
"""… which is looked at when such a share of it is over."""
_SLACK: Final = 0.02
"""Arm lengths by which a stance may be nearer or farther than it should."""
_OVERLAP: Final = 0.03
"""Arm lengths before the last arms let go at which another takes hold in their place: without, arms
in stance are 3.3 in the mean instead of 3.6."""
_LYING: Final = (0.4, 0.65)
"""Shares of a stance that are over where an arm of a body that stands may be: it lies unrolled, and
is hardly peeled off yet. The first is where it is before the body gets going, the other where it
is once it has come to rest."""
_LET_GO: Final = (0.04, 0.30)
"""Arm lengths from the start within which arms that lay there let go, one after the other."""
_LAST: Final = (0.14, 0.10)
"""Arm lengths that an arm takes at least, before the body comes to rest, to swing and to lie down:
the body is slow there."""
_LONGER: Final = 0.06
"""Arm lengths by which a stance may be too long where the body comes to rest in it."""
_TURNS: Final = np.array([0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0])
"""Shares of the most that an arm turns aside, which it tries."""
_WORTH: Final = 0.15
"""How much clearance, as a share of what is wanted, turning aside all the way must be worth. At 0.5
arms come as near as 0.06."""


@dataclass(frozen=True)
class CrawlSettings:
    """How a crawl is made. Lengths in arm lengths, angles in radians."""

    near: float = 0.47
    """From an arm's root to where it takes hold to push."""
    far: float = 0.78
    """From there to where it lets go."""
    planted: float = 0.3
    """Share of an arm that lies on the ground beyond that place."""
    seed: int = 0

    def __post_init__(self) -> None:
        numbers = (self.near, self.far, self.planted)
        if not np.all(np.isfinite(numbers)) or min(numbers) <= 0.0:
            raise SettingsError("A setting of the crawl is not a number above 0.", "Set it anew.")
        if self.near >= self.far:
            raise SettingsError(
                phrase(
                    "Arms take hold {near:g} arm lengths away and let go at {far:g}.",
                    near=self.near,
                    far=self.far,
                ),
                "Let them take hold nearer than they let go.",
            )


@dataclass(frozen=True, eq=False)
class CrawlPath:
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
    stands: tuple[bool, bool] = (False, False)
    """Whether the body stands at the start, and at the end, with all its arms on the ground."""


@dataclass(frozen=True, eq=False)
class CrawlStances:
    """Stances of all arms, sorted by arm and start."""

    arm: NDArray[np.intp]
    """(stances,)"""
    start: Floats
    """(stances,) distance at which the arm has taken hold."""
    end: Floats
    """(stances,) and at which it lets go."""
    place: Floats
    """(stances, 2) world XY."""
    turn: Floats
    """(stances,) radians anticlockwise from the arm's own direction, half way through, to there
    …"""
    away: Floats
    """(stances,) … and metres from its root."""
    pushes: NDArray[np.bool_]
    """(stances,) whether the arm pushes, or only supports."""

    def __len__(self) -> int:
        """Number of stances."""
        return len(self.arm)


def plan_crawl(journey: CrawlPath, settings: CrawlSettings) -> CrawlStances:
    """Where the arms hold on along a journey.

    An arm's next stance depends on the stances before it, but all of them on the journey alone: any
    frame can be computed from the result without those before it.

    Raises:
        SettingsError: the journey has no length to sample.
    """
    if len(journey.distance) < 2:
        raise SettingsError("The crawl has nowhere to go.", "Make the route longer.")
    return _Crawl(journey, settings).run()


@dataclass(frozen=True, eq=False)
class _Stance:
    """One stance, metres."""

    arm: int
    start: float
    end: float
    place: Floats
    """(2,) where the arm meets the ground …"""
    tip: Floats
    """(2,) … and where it ends there."""
    turn: float
    away: float
    pushes: bool


class _Crawl:
    """One journey, stance by stance in the order in which they begin."""

    def __init__(self, journey: CrawlPath, settings: CrawlSettings) -> None:
        self._journey = journey
        self._settings = settings
        self._unit = journey.length
        self._arms = journey.roots.shape[1]
        self._streams = [
            np.random.default_rng([settings.seed, 7919, arm]) for arm in range(self._arms)
        ]
        self._stances: list[_Stance] = []
        self._latest: dict[int, _Stance] = {}
        """Of each arm."""
        self._distances: list[float] = journey.distance.tolist()
        along = np.sum(journey.outward * journey.ahead[:, None], axis=-1)
        self._pushing = -along >= np.cos(_PUSHING)
        """(samples, arms)"""
        first, last = self._distances[0], self._distances[-1]
        starts, stops = journey.stands
        self._first = first if starts else -np.inf
        self._last = last if stops else np.inf
        """Where the body stands."""

    def run(self) -> CrawlStances:
        distance, unit = self._journey.distance, self._unit
        first, last = float(distance[0]), float(distance[-1])
        if np.isfinite(self._first):
            planned = [end + self._rest(arm, end) for arm, end in enumerate(self._get_going())]
        else:
            # Arms begin at different places: else they would all let go together for a while.
            planned = [
                first + unit * (float(stream.uniform(0.0, 0.6)) - _BEFORE)
                for stream in self._streams
            ]
        while True:
            starts = self._not_too_few(planned)
            arm = min(range(self._arms), key=lambda each: (starts[each], planned[each]))
            if starts[arm] > last:
                return self._sorted()
            end = self._take_hold(arm, starts[arm])
            planned[arm] = end + self._rest(arm, end)

    def _get_going(self) -> Floats:
        """Let all arms lie where the body stands, and let go one after the other (arms,)."""
        order = np.random.default_rng([self._settings.seed, 7920]).permutation(self._arms)
        low, high = _LET_GO
        ends = self._first + self._unit * (low + (high - low) * (order + 0.5) / self._arms)
        for arm, end in enumerate(ends.tolist()):
            way = min(end, self._last) - self._first
            self._add(arm, end - way / (1.0 - _LYING[0]), end)
        return ends

    def _not_too_few(self, planned: list[float]) -> list[float]:
        """When each arm would take hold next: earlier than planned if else too few hold on."""
        ends = sorted(each.end for each in self._latest.values())
        least, overlap = min(_LEAST, self._arms - 1), _OVERLAP * self._unit
        pause = _PAUSE[0] * self._unit
        # From when on fewer than enough arms would hold, and none would push.
        few = ends[-least] - overlap if 0 < least <= len(ends) else np.inf
        none = max((each.end for each in self._latest.values() if each.pushes), default=np.inf)
        starts = []
        for arm, start in enumerate(planned):
            wanted = min(start, few)
            if none - overlap < wanted and self._pushes(arm, wanted):
                wanted = none - overlap
            if arm in self._latest:
                wanted = max(wanted, self._latest[arm].end + pause)
            starts.append(min(wanted, start))
        return starts

    def _pushes(self, arm: int, at: float) -> bool:
        """Whether an arm's push points along the way."""
        sample = bisect_right(self._distances, at) - 1
        return bool(self._pushing[max(sample, 0), arm])

    def _take_hold(self, arm: int, at: float) -> float:
        """Let an arm take hold at a distance; where it lets go."""
        unit = self._unit
        longest = self._longest(arm, at)
        share = self._streams[arm].uniform(*_SHARE)
        lasts = max(share * longest, min(_SHORTEST * unit, longest))
        # Nobody else to take over yet: hold on for as long as it goes.
        others = [each for each in self._latest.values() if each.arm != arm]
        pause = _PAUSE[0] * unit
        there = sum(each.end > at + lasts or each.end + pause < at + lasts for each in others)
        if there + self._arms - 1 - len(others) < _LEAST:
            lasts = longest
        return self._add(arm, *self._in_time(at, lasts, longest))

    def _in_time(self, at: float, lasts: float, longest: float) -> tuple[float, float]:
        """Where a stance begins and ends that leaves time for another one before the body stands,
        or lasts beyond that.
        """
        in_time = self._last - sum(_LAST) * self._unit
        if at + lasts <= in_time:
            return at, at + lasts
        if at + longest + _LONGER * self._unit < self._last:
            if in_time - at >= min(_SHORTEST * self._unit, longest):
                return at, in_time
            # Too late for two stances, and too early for one: it waits.
            at = self._last - longest
        return at, at + max(self._last - at, 1e-3 * self._unit) / _LYING[1]

    def _add(self, arm: int, start: float, end: float) -> float:
        """Note a stance, at a place that is clear of the other arms' where there is one."""
        seen = max(start, self._first), min(end, self._last)
        turn, places = 0.0, self._places(arm, sum(seen) / 2.0, np.zeros(1))
        others = [each for each in self._latest.values() if each.arm != arm and each.end > seen[0]]
        if others:
            wanted = _CLEAR * self._unit
            clear = self._clearance(arm, seen, places, others)[0]
            if clear < wanted:
                turns = np.append(0.0, _MOST_ASIDE * _TURNS)
                tried = self._places(arm, sum(seen) / 2.0, turns)
                clears = self._clearance(arm, seen, tried, others) / wanted
                good = np.minimum(clears, 1.0) - _WORTH * np.abs(turns) / _MOST_ASIDE
                best = int(np.argmax(good))
                turn, places = turns[best], (tried[0][best : best + 1], tried[1][best : best + 1])
        place, tip = places[0][0], places[1][0]
        root, outward = (each[0] for each in self._at(arm, np.array([0.5 * (start + end)])))
        reach = place - root
        across = outward[0] * reach[1] - outward[1] * reach[0]
        turn = float(np.arctan2(across, outward @ reach))
        away = float(np.hypot(*reach))
        stance = _Stance(arm, start, end, place, tip, turn, away, self._pushes(arm, seen[0]))
        self._stances.append(stance)
        self._latest[arm] = stance
        return end

    def _clearance(
        self,
        arm: int,
        seen: tuple[float, float],
        places: tuple[Floats, Floats],
        others: list[_Stance],
    ) -> Floats:
        """Metres (places,) that an arm is clear of others, in the time that both hold on."""
        times = np.array([[seen[0], min(seen[1], each.end)] for each in others])
        own, _ = self._at(arm, times.reshape(-1))
        numbers = np.repeat([each.arm for each in others], 2)
        theirs, _ = self._at(numbers, times.reshape(-1))
        mine = Outline(
            own.reshape(*times.shape, 2), places[0][:, None, None], places[1][:, None, None]
        )
        yours = Outline(
            theirs.reshape(*times.shape, 2),
            np.stack([each.place for each in others])[:, None],
            np.stack([each.tip for each in others])[:, None],
        )
        return clearance(mine, yours).min(axis=(-2, -1))

    def _places(self, arm: int, middle: float, turns: Floats) -> tuple[Floats, Floats]:
        """Where an arm meets the ground and where it ends (turns, 2), as the body passes.

        A rear arm takes hold near and lets go far, a front arm the other way round, one at the
        side first ahead and then behind.
        """
        settings, unit = self._settings, self._unit
        root, outward = self._at(arm, np.array([middle]))
        way = rotate_in_plane(outward[0], turns)
        place = root + 0.5 * (settings.near + settings.far) * unit * way
        return place, place + settings.planted * unit * way

    def _longest(self, arm: int, at: float) -> float:
        """How far the body can go while an arm keeps a stance that begins at a distance."""
        settings, unit = self._settings, self._unit
        most = settings.far - settings.near
        lasts = unit * np.linspace(min(_SHORTEST, most), most, _TRIED)
        root, outward = self._at(arm, at + 0.5 * lasts)
        place = root + 0.5 * (settings.near + settings.far) * unit * outward
        kept = np.ones(_TRIED, dtype=np.bool_)
        for share in _LOOKED_AT:
            root, outward = self._at(arm, at + share * lasts)
            reach = place - root
            away = np.hypot(reach[:, 0], reach[:, 1])
            kept &= away >= (settings.near - _SLACK) * unit
            kept &= away <= (settings.far + _SLACK) * unit
            kept &= np.sum(reach * outward, axis=1) >= np.cos(_ASTRAY) * away
        # The longest of those that are kept from the shortest on.
        return float(lasts[max(int(np.argmin(np.append(kept, False))) - 1, 0)])

    def _rest(self, arm: int, at: float) -> float:
        """How far the body goes before an arm takes hold again."""
        limits = _PAUSE if self._pushes(arm, at) else _SEARCH
        planned = float(self._streams[arm].uniform(*limits))
        swing, lie = _LAST
        left = (self._last - at) / self._unit
        return self._unit * max(min(planned, left - lie), swing)

    def _at(self, arm: int | NDArray[np.intp], at: Floats) -> tuple[Floats, Floats]:
        """Roots and directions (n, 2) of an arm, or of one each (n,), at distances (n,).

        Before the start and after the end the body goes straight on, if it does not stand there.
        """
        journey = self._journey
        distance = journey.distance
        at = np.minimum(np.maximum(at, self._first), self._last)
        right = np.minimum(np.searchsorted(distance, at), len(distance) - 1)
        left = np.maximum(right - 1, 0)
        right = left + 1
        inside = np.minimum(np.maximum(at, distance[0]), distance[-1])
        share = ((inside - distance[left]) / (distance[right] - distance[left]))[:, None]
        root, outward = (
            (1.0 - share) * each[left, arm] + share * each[right, arm]
            for each in (journey.roots, journey.outward)
        )
        beyond = at - inside
        if beyond.any():
            root += beyond[:, None] * journey.ahead[np.where(beyond < 0.0, 0, -1)]
        return root, normalized(outward)

    def _sorted(self) -> CrawlStances:
        stances = sorted(self._stances, key=lambda each: (each.arm, each.start))
        return CrawlStances(
            arm=np.array([each.arm for each in stances], dtype=np.intp),
            start=np.array([each.start for each in stances]),
            end=np.array([each.end for each in stances]),
            place=np.array([each.place for each in stances]).reshape(-1, 2),
            turn=np.array([each.turn for each in stances]),
            away=np.array([each.away for each in stances]),
            pushes=np.array([each.pushes for each in stances], dtype=np.bool_),
        )
