# SPDX-License-Identifier: GPL-3.0-or-later
"""How high a body travels over its ground, and when each of its arms is in contact with it.

Where a constant says what was seen when it was other, that is the default octopus with the ten
set-ups on bumps of 0.3 arm lengths.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...rotations import Floats, continuous, multiply, normalized, rotate, shortest_arc
from ..gait import CYCLE
from ..path import Bearings, Route, TravelSettings, values_along, walked_at
from .crawl_planner import CrawlPath, CrawlSettings, CrawlStances, plan_crawl
from .surface import Ground

_HEIGHTS_PER_REACH: Final = 24
"""Places of the table within the arms' reach. Half or twice as many change no figure by a
fiftieth."""
_ACROSS: Final = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
"""Where the ground is felt across the way, in reaches. Half as far to either side Tiptoe slips by
0.0084 arm lengths instead of 0.0023."""
_SHARES: Final = np.array([1.0, 2.0, 2.0, 2.0, 1.0]) / 8.0
_HEADROOM: Final = 0.55
"""Share of its height over the ground that a body keeps over a bump right under it. Less makes no
difference to the default octopus, whose skin needs more; at 1.1 Tiptoe turns by 1.0 radian from
frame to frame instead of 0.53."""
_MOST_HEADROOM: Final = 0.9
"""The same at most, where that is not enough for its skin. At 0.45 arms of Crawl overlap by 0.059
radii instead of 0.019."""
_PARTS: Final = 3
"""Steps in which a body's line is asked for where the route goes."""
_LIFTS: Final = 3
"""How often what a body lacks of it is added, evened out: that alone takes some of it away. Twice
or six times change no figure by a fiftieth."""
_UNDER: Final = 0.25
"""Reaches before, behind and beside the body's centre that count as right under it. At 0.125 Crawl
turns by 0.20 radians from frame to frame instead of 0.16."""
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class BodyLine:
    """A walking body's places along its route, also before and after it."""

    route: Route
    settings: TravelSettings
    bearings: Bearings
    start: float
    """Metres along the route of the table's first place."""
    spacing: float
    heights: Floats
    """(n,) world Z of the ground as the body feels it."""
    clearances: Floats
    """(n,) metres from there to the body's centre."""
    uprights: Floats
    """(n, 3) unit vectors: which way up the body is."""
    ways: Floats
    """(n, 3) points of the route, world."""
    turns: Floats
    """(n, 4) orientations of the body as it would be upright, signs continuous."""

    def ride(self, positions: Floats, distance: Floats) -> tuple[Floats, Floats]:
        """The body's centre (…, 3) above points (…, 3) of its way, and its upright (…, 3).

        Seen from above the body stays on its route; a slope is as far below as level ground is.
        """
        return _above(positions, self._at(self._table[:, :5], distance))

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4) of the body at distances (…,)."""
        there = self._at(self._table, np.asarray(distance, dtype=np.float64))
        # As near to the route as footholds need: it costs a tenth of asking the route itself.
        centre, upright = _above(there[..., 5:8], there[..., :5])
        return centre, leaning(upright, normalized(there[..., 8:]))

    @cached_property
    def _table(self) -> Floats:
        """(n, 12) heights, clearances, uprights, ways and turns: all is asked for at once."""
        return np.column_stack(
            [self.heights, self.clearances, self.uprights, self.ways, self.turns]
        )

    def _at(self, table: Floats, distance: Floats) -> Floats:
        """Rows of the table at distances (…,), by the cubic through its neighbours' slopes."""
        place = (distance - self.start) / self.spacing
        place = np.minimum(np.maximum(place, 1.0), len(table) - 2.001)
        index = place.astype(np.int64)
        t = (place - index)[..., None]
        before, here, then, after = (table[index + step] for step in (-1, 0, 1, 2))
        slope, last = 0.5 * (then - before), 0.5 * (after - here)
        rise = then - here
        bend = slope + last - 2.0 * rise
        return here + t * (slope + t * (rise - slope - bend + t * bend))


def _above(positions: Floats, there: Floats) -> tuple[Floats, Floats]:
    """Centres (…, 3) above points of the way, and uprights (…, 3), by height, clearance and upright
    (…, 5).
    """
    upright = normalized(there[..., 2:5])
    centre = positions.copy()
    centre[..., 2] = there[..., 0] + there[..., 1] / upright[..., 2]
    return centre, upright


def leaning(upright: Floats, rotations: Floats) -> Floats:
    """Orientations (…, 4) of upright bodies, tilted the shortest way."""
    return multiply(shortest_arc(np.broadcast_to(_UP, upright.shape), upright), rotations)


def finding_line(
    route: Route,
    settings: TravelSettings,
    bearings: Bearings,
    ground: Ground,
    *,
    clearance: float,
    reach: float,
    lean: float,
    smoothing: float,
    under: float = 0.0,
    around: tuple[float, float] | None = None,
) -> Generator[float, None, BodyLine]:
    """The line of a body on a ground, in steps that yield what share of both is found.

    Args:
        route: where to.
        settings: how it travels, and what of the following differs along the route.
        bearings: the route's directions.
        ground: what it walks on.
        clearance: metres from the ground to the body's centre.
        reach: metres that its arms are long.
        lean: 0 stays upright, 1 leans as the ground does, unless the settings have it.
        smoothing: reaches over which the ground is evened out along the way (standard deviation).
        under: metres from the body's centre to its lowest skin.
        around: metres along the route from where to where it is roughly wanted, none for all.
    """
    spacing, width = reach / _HEIGHTS_PER_REACH, smoothing * reach
    margin = 2.0 * settings.stride + 4.0 * width + reach
    start, end = around or (0.0, route.length)
    count = int(np.ceil((end - start + 2.0 * margin) / spacing)) + 1
    distance = start - margin + spacing * np.arange(count)
    walked, parts = list[tuple[Floats, Floats]](), _PARTS if around is None else 1
    for part in np.array_split(distance, parts):
        walked.append(walked_at(route, settings, bearings, part, coarse=around is not None))
        yield 0.6 + 0.2 * len(walked) / parts
    positions, turns = (np.concatenate(each) for each in zip(*walked, strict=True))
    along, left = _ways(positions)
    felt = ground.height(positions[:, None, :2] + reach * _ACROSS[:, None] * left[:, None])
    kernel, share = _bell(width / spacing), route.share_at(distance)
    clearances = clearance + values_along(settings.along.height, share, 0.0)
    headroom = np.maximum(_HEADROOM * clearances, np.minimum(under, _MOST_HEADROOM * clearances))
    level = _over_bumps(
        _evened(felt @ _SHARES, kernel), felt, (clearances, headroom), _bell(0.5 * width / spacing)
    )
    leaned = _upright_on(felt, (along, left), np.gradient(level, spacing), reach, kernel)
    leans = values_along(settings.along.lean, share, lean)[:, None]
    uprights = normalized((1.0 - leans) * _UP + leans * leaned)
    return BodyLine(
        route=route,
        settings=settings,
        bearings=bearings,
        start=float(distance[0]),
        spacing=spacing,
        heights=level,
        clearances=clearances,
        uprights=uprights,
        ways=positions,
        turns=continuous(turns),
    )


def _upright_on(
    felt: Floats, ways: tuple[Floats, Floats], ahead: Floats, reach: float, kernel: Floats
) -> Floats:
    """Unit vectors (n, 3) up from a ground (n, places across the way) that climbs so much (n,)."""
    # Least squares through the heights across the way.
    sideways = _evened(felt @ _ACROSS / (_ACROSS @ _ACROSS * reach), kernel)
    along, left = ways
    tilt = -ahead[:, None] * along - sideways[:, None] * left
    return normalized(np.concatenate([tilt, np.ones((len(tilt), 1))], axis=1))


def _ways(positions: Floats) -> tuple[Floats, Floats]:
    """Which way a body goes through positions (n, 3) and what is left of it, seen from above: unit
    vectors (n, 2) both.
    """
    along = np.gradient(positions[:, :2], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    return along, np.stack([-along[:, 1], along[:, 0]], axis=1)


def _over_bumps(
    level: Floats, felt: Floats, heights: tuple[Floats, Floats], kernel: Floats
) -> Floats:
    """Heights (n,) raised where a bump right under the body would come too near to it.

    The ground is (n,) metres as it is evened out, and (n, places across the way) as it is. Heights
    are of the body's centre above the level, and at least above the bump; a kernel evens out what
    is lacking.
    """
    clearance, headroom = heights
    near = np.abs(_ACROSS) <= _UNDER
    top = _highest(felt[:, near].max(axis=1), int(np.ceil(_UNDER * _HEIGHTS_PER_REACH)))
    for _ in range(_LIFTS):
        level = level + _evened(np.maximum(top + headroom - (level + clearance), 0.0), kernel)
    return level


def _bell(deviation: float) -> Floats:
    """A Gauss bell that sums to 1, of whole steps."""
    half = max(1, int(np.ceil(4.0 * deviation)))
    steps = np.arange(-half, half + 1) / max(deviation, 1e-6)
    bell = np.exp(-0.5 * steps * steps)
    return bell / bell.sum()


def _evened(values: Floats, kernel: Floats) -> Floats:
    """Values (n,) averaged over their neighbours; beyond the ends they go on as they end."""
    half = len(kernel) // 2
    padded = (
        np.pad(values, half, mode="reflect", reflect_type="odd")
        if len(values) > half
        else (np.pad(values, half, mode="edge"))
    )
    return np.convolve(padded, kernel, mode="valid")


def _highest(values: Floats, reach: int) -> Floats:
    """The largest value (n,) within so many steps to either side."""
    padded = np.pad(values, reach, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=-1)


# --- When each arm is where in its cycle, as a function of how far the body has come --------------
#
# A gait with a rhythm has the same cycle for all arms, a stride long, each arm ahead by its own
# offset. A crawl has none: each arm's cycle begins and ends with its own stances. Both depend on
# the distance travelled alone, so that any frame can be computed without those before it.


_PER_REACH: Final = 32
"""Samples of a journey to the length of an arm. Half or twice as many change no figure by a
fiftieth."""
_SPARE: Final = 6.0
"""Reaches of crawl besides the loop that is cut from it: more than four of the longest stances and
pauses, whatever the settings, so that there is one more to cut at."""
_CUTS: Final = 24
"""Places where it might be cut."""
_LOOPS: Final = 3
"""How often a loop comes again, in its table, before its start and after its end."""
_FINE: Final = 16
"""Steps of the table of distances between two knots of an arm's cycle. Half or twice as many change
no figure by a fiftieth."""
_STARTS: Final = (-0.1, 0.3)
"""Where in its stance an arm may be as the body gets going, from the stance's middle, in stances:
all of it lies down, and little of it is peeled off yet. With half of that range arms of Walk
overlap by 0.065 radii instead of 0.057 …"""
_STOPS: Final = (-0.15, 0.15)
"""… and as the body comes to rest: with half of it Walk has a jerk of 0.094 instead of 0.088."""
_AT_ONCE: Final = 0.4
"""Cycles since the middle of its last stance up to which an arm swings as the body gets going; one
that would be further lies on the ground already. As the body comes to rest it is the other way. At
0.2 arms of Walk pass through each other as it gets going."""
_HASTE: Final = 2.0
"""How much worse it is on a short way that an arm hurries than that it is late. It matters where
the body takes hardly a step, in none of the ten."""


class ContactTiming(Protocol):
    """Phases of the arms along the way."""

    @property
    def cycle_period(self) -> Sequence[int] | None:
        """Each arm's cycles in a loop, where these are not the same for all."""
        ...

    def phases(self, distance: Floats) -> Floats:
        """Each arm's own phase (frames, arms) at distances (frames,), unwrapped, radians."""
        ...

    def distances(self, arms: Sequence[int], cycles: Floats) -> Floats:
        """Distances (arms, …) at which some arms have come through so many cycles (arms, …)."""
        ...

    def aims(self, arms: Sequence[int], cycles: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Where arms are to take hold in cycles whose numbers are (cycles,), seen from above.

        Radians (arms, cycles) are anticlockwise from an arm's own direction, metres (arms, cycles)
        from its root half way through the stance, nan for where it holds on with ease.
        """
        ...


@dataclass(frozen=True, eq=False)
class EvenTiming:
    """One cycle per stride."""

    stride: float
    """Metres."""
    offsets: Floats
    """(arms,) radians that each arm is ahead of the body."""
    cycle_period: Sequence[int] | None = None

    def phases(self, distance: Floats) -> Floats:
        """(frames, arms)."""
        return CYCLE * distance[:, None] / self.stride + self.offsets

    def distances(self, arms: Sequence[int], cycles: Floats) -> Floats:
        """(arms, …)."""
        ahead = self.offsets[list(arms)] / CYCLE
        return self.stride * (cycles - ahead.reshape(-1, *[1] * (cycles.ndim - 1)))

    def aims(self, arms: Sequence[int], cycles: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """(arms, cycles) both: none."""
        shape = len(arms), len(cycles)
        return np.zeros(shape), np.full(shape, np.nan)


@dataclass(frozen=True, eq=False)
class TabledTiming:
    """Each arm by a table of its own."""

    tables: Sequence[ContactTable]
    middle: float
    """Phase of the gait, radians, half way through a stance."""
    cycle_period: Sequence[int] | None = None
    """Each arm's cycles in a loop, if it is one."""

    def phases(self, distance: Floats) -> Floats:
        """(frames, arms)."""
        columns = [CYCLE * table.cycles(distance) for table in self.tables]
        return np.stack(columns, axis=1) + self.middle

    def distances(self, arms: Sequence[int], cycles: Floats) -> Floats:
        """(arms, …)."""
        rows = np.asarray(arms).reshape(-1, *[1] * (cycles.ndim - 1))
        return self._inverse.at(rows, cycles - self.middle / CYCLE)

    @cached_property
    def _inverse(self) -> _Inverse:
        return _Inverse.of(self.tables)

    def aims(self, arms: Sequence[int], cycles: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """(arms, cycles) both."""
        found = np.stack([self.tables[arm].aims_in(cycles) for arm in arms])
        return found[..., 0], found[..., 1]


def crawl_timing(stances: CrawlStances, arms: int, *, middle: float, duty: float) -> TabledTiming:
    """The rhythm of so many arms whose cycles begin and end with their own stances.

    In the gait a stance takes ``duty`` of a cycle, and is half over at the phase ``middle``,
    radians.
    """
    return TabledTiming([_table(stances, arm, duty) for arm in range(arms)], middle)


def timing_at_rest(
    timing: EvenTiming | TabledTiming,
    length: float,
    *,
    start: bool,
    end: bool,
    middle: float,
    duty: float,
) -> TabledTiming:
    """The same rhythm of a body that starts from a standstill, comes to one, or both.

    An arm that would hang in the air then swings in time, or not yet, or no more: whichever is
    nearer. In between, and for all others, nothing changes.

    Args:
        timing: of the body that goes on before and after its route.
        length: metres of the route.
        start: whether the body stands at the start.
        end: whether it stands at the end.
        middle: phase of the gait half way through a stance, radians.
        duty: share of a cycle that a stance takes.
    """
    if isinstance(timing, EvenTiming):
        ends = (timing.phases(np.array([0.0, length])) - middle) / CYCLE
        tables: Sequence[ContactTable] = [
            _even_table(first, last, timing.stride, duty) for first, last in ends.T.tolist()
        ]
    else:
        tables = timing.tables
    rested = [_rested(table, length, duty, start=start, end=end) for table in tables]
    return TabledTiming(rested, middle)


@dataclass(frozen=True, eq=False)
class CrawlingBody:
    """A body that crawls, and the gait that its arms' cycles are of."""

    line: BodyLine
    """Its way."""
    roots: Floats
    """(arms, 3) metres from the body's centre to where the arms begin, in its own frame."""
    outward: Floats
    """(arms, 4) from each arm's own frame, x outward, to the body's."""
    reach: float
    """Metres that its arms are long."""
    middle: float
    """Phase of the gait half way through a stance, radians."""
    duty: float
    """Share of a cycle that a stance takes in the gait."""

    def samples(self, length: float) -> Floats:
        """Distances (samples,) at which a way of such a length is looked at, metres."""
        return np.linspace(0.0, length, max(2, int(np.ceil(length / self.reach * _PER_REACH)) + 1))

    def path(
        self,
        distance: Floats,
        centres: Floats,
        rotations: Floats,
        stands: tuple[bool, bool] = (False, False),
    ) -> CrawlPath:
        """What a crawl is planned from: the body's centres (samples, 3) and orientations there."""
        directions = rotate(multiply(rotations[:, None], self.outward), np.array([1.0, 0.0, 0.0]))
        places = centres[:, None] + rotate(rotations[:, None], self.roots)
        return CrawlPath(
            distance=distance,
            roots=places[..., :2],
            outward=normalized(directions[..., :2]),
            ahead=normalized(np.gradient(centres[:, :2], axis=0)),
            length=self.reach,
            stands=stands,
        )


def crawling(
    body: CrawlingBody, settings: CrawlSettings, stands: tuple[bool, bool] = (False, False)
) -> TabledTiming:
    """When the arms of a crawling body on its way are in contact with the ground.

    It stands with all arms down at the start of its way, at the end, or not.
    """
    distance = body.samples(body.line.route.length)
    stances = plan_crawl(body.path(distance, *body.line.at(distance), stands), settings)
    return crawl_timing(stances, len(body.roots), middle=body.middle, duty=body.duty)


def crawling_in_place(body: CrawlingBody, settings: CrawlSettings) -> TabledTiming:
    """The same of one that crawls straight on over level ground, and is after its route as before.

    Each arm's stances are cut from a longer crawl, as many as fill the loop best, and stretched or
    shrunk to its length; the place where they are cut is the one where most arms are in contact.
    """
    loop = body.line.route.length
    whole = loop + _SPARE * body.reach
    distance = body.samples(whole)
    (start, end), (turned, _) = body.line.at(np.array([0.0, loop]))
    centres = start + distance[:, None] / loop * (end - start)
    path = body.path(distance, centres, np.tile(turned, (len(distance), 1)))
    stances = plan_crawl(path, settings)
    cuts = [
        [_cut(stances, arm, loop, start) for arm in range(len(body.roots))]
        for start in np.linspace(0.25, 0.5, _CUTS) * (whole - loop)
    ]
    best = max(cuts, key=lambda arms: _support(arms, loop))
    tables = [_looped(*stances, loop, body.duty) for stances in best]
    return TabledTiming(tables, body.middle, cycle_period=[len(start) for start, _, _ in best])


def _cut(
    stances: CrawlStances, arm: int, loop: float, start: float
) -> tuple[Floats, Floats, Floats]:
    """Starts, ends and aims of an arm's holds in a loop that is cut at a distance."""
    own = np.flatnonzero(stances.arm == arm)
    own = own[np.searchsorted(stances.start[own], start) :]
    begins, ends = stances.start[own], stances.end[own]
    lasts = begins[1:] - begins[0]
    many = int(np.argmin(np.abs(np.log(lasts / loop)))) + 1
    factor = loop / lasts[many - 1]
    first = begins[0] - start
    return (
        first + factor * (begins[:many] - begins[0]),
        first + factor * (ends[:many] - begins[0]),
        _aims(stances, own[:many]),
    )


def _aims(stances: CrawlStances, chosen: NDArray[Any]) -> Floats:
    """Angles and distances of some stances (…, 2)."""
    return np.stack([stances.turn[chosen], stances.away[chosen]], axis=-1)


def _support(arms: Sequence[tuple[Floats, Floats, Floats]], loop: float) -> tuple[int, int]:
    """How many arms hold on in a loop at least, and in all."""
    at = np.linspace(0.0, loop, 96, endpoint=False)
    in_stance = np.zeros(len(at), dtype=np.int64)
    for start, end, _ in arms:
        since = np.mod(at[:, None] - start, loop)
        in_stance += np.any(since < end - start, axis=1)
    return int(in_stance.min()), int(in_stance.sum())


def _looped(start: Floats, end: Floats, aims: Floats, loop: float, duty: float) -> ContactTable:
    """The table of an arm whose stances come again after a loop."""
    many = len(start)
    turns = np.arange(-_LOOPS, _LOOPS + 2)
    at = (loop * turns[:, None, None] + np.stack([start, end], axis=1)).ravel()
    number = many * turns[:, None] + np.arange(many, dtype=np.float64)
    values = (number[..., None] + 0.5 * duty * np.array([-1.0, 1.0])).ravel()
    return ContactTable(at, values, _monotone(at, values), aims=aims, repeats=True)


@dataclass(frozen=True, eq=False)
class ContactTable:
    """How far one arm is in its cycles: a rising curve through knots, straight on beyond them."""

    at: Floats
    """(knots,) distances"""
    values: Floats
    """(knots,) cycles from the middle of stance 0"""
    slopes: Floats
    """(knots,)"""
    starts: bool = False
    """Whether there is nothing before its first knot: the body stands …"""
    stops: bool = False
    """… and nothing after its last one."""
    aims: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(stances, 2) where the arm is to take hold, as of :meth:`ContactTiming.aims`, from stance 0
    on …"""
    repeats: bool = False
    """… and whether it does so again after that."""

    def aims_in(self, cycles: NDArray[np.int64]) -> Floats:
        """Of holds by their number (cycles, 2)."""
        many = len(self.aims)
        if self.repeats:
            return self.aims[np.mod(cycles, many)]
        known = np.concatenate([self.aims, [[0.0, np.nan]]])
        return known[np.where((cycles >= 0) & (cycles < many), cycles, many)]

    def cycles(self, distance: Floats) -> Floats:
        """At distances (…,)."""
        low = self.at[0] if self.starts else -np.inf
        distance = np.clip(distance, low, self.at[-1] if self.stops else np.inf)
        t, _, (start, slope, curve, bend) = self._piece(distance)
        inside = start + t * (slope + t * (curve + t * bend))
        before = self.values[0] + (distance - self.at[0]) * self.slopes[0]
        after = self.values[-1] + (distance - self.at[-1]) * self.slopes[-1]
        return np.where(t < 0.0, before, np.where(t > 1.0, after, inside))

    @cached_property
    def steps(self) -> tuple[Floats, Floats]:
        """Distances (steps,) close to each other, and cycles there."""
        number = np.arange((len(self.at) - 1) * _FINE + 1) / _FINE
        fine = np.interp(number, np.arange(len(self.at)), self.at)
        return fine, self.cycles(fine)

    def slopes_at(self, distance: Floats) -> Floats:
        """Cycles per metre at distances (…,)."""
        t, width, (_, slope, curve, bend) = self._piece(distance)
        t = np.clip(t, 0.0, 1.0)
        return (slope + t * (2.0 * curve + 3.0 * t * bend)) / width

    def _piece(self, distance: Floats) -> tuple[Floats, Floats, tuple[Floats, ...]]:
        """Shares of the way between two knots, metres of it, and the cubic's four coefficients."""
        knot = np.clip(np.searchsorted(self.at, distance, "right") - 1, 0, len(self.at) - 2)
        width = self.at[knot + 1] - self.at[knot]
        rise = self.values[knot + 1] - self.values[knot]
        first, last = width * self.slopes[knot], width * self.slopes[knot + 1]
        bend = first + last - 2.0 * rise
        cubic = self.values[knot], first, rise - first - bend, bend
        return (distance - self.at[knot]) / width, width, cubic

    def distances(self, cycles: Floats) -> Floats:
        """At cycles (…,)."""
        low = self.values[0] if self.starts else -np.inf
        cycles = np.clip(cycles, low, self.values[-1] if self.stops else np.inf)
        fine, values = self.steps
        inside = np.interp(cycles, values, fine)
        steep = np.maximum(self.slopes[[0, -1]], 1e-12)
        before = self.at[0] + (cycles - self.values[0]) / steep[0]
        after = self.at[-1] + (cycles - self.values[-1]) / steep[1]
        low, high = cycles < self.values[0], cycles > self.values[-1]
        return np.where(low, before, np.where(high, after, inside))


@dataclass(frozen=True, eq=False)
class _Inverse:
    """Distances by cycles of several tables at once; their steps follow one another."""

    cycles: Floats
    """(steps,)"""
    distances: Floats
    """(steps,)"""
    order: Floats
    """(steps,) cycles since the first step of a table, those of each table after the one before."""
    ends: Floats
    """(4, tables) cycles and distances of the first step, then of the last one."""
    reach: Floats
    """(2, tables) cycles that there are at least and at most."""
    steep: Floats
    """(2, tables) cycles per metre before the first step, and after the last one."""
    apart: float
    """Between the first steps of two tables in that order."""
    first: NDArray[np.intp]
    """(tables + 1,) number of each one's first step."""

    @classmethod
    def of(cls, tables: Sequence[ContactTable]) -> _Inverse:
        """Of these tables."""
        fine, values = zip(*(each.steps for each in tables), strict=True)
        apart = max(float(each[-1] - each[0]) for each in values) + 1.0
        order = [each - each[0] + number * apart for number, each in enumerate(values)]
        lows = [each.values[0] if each.starts else -np.inf for each in tables]
        highs = [each.values[-1] if each.stops else np.inf for each in tables]
        ends = [(v[0], at[0], v[-1], at[-1]) for v, at in zip(values, fine, strict=True)]
        return cls(
            cycles=np.concatenate(values),
            distances=np.concatenate(fine),
            order=np.concatenate(order),
            ends=np.array(ends).T,
            reach=np.array([lows, highs]),
            steep=np.maximum(np.array([each.slopes[[0, -1]] for each in tables]).T, 1e-12),
            apart=apart,
            first=np.cumsum([0, *map(len, values)]),
        )

    def at(self, rows: NDArray[np.intp], cycles: Floats) -> Floats:
        """Of tables (rows, …) at cycles (rows, …)."""
        start, near, stop, far = self.ends[:, rows]
        low, high = self.reach[:, rows]
        cycles = np.clip(cycles, low, high)
        order = np.clip(cycles, start, stop) - start + rows * self.apart
        step = np.searchsorted(self.order, order, "right") - 1
        step = np.clip(step, self.first[rows], self.first[rows + 1] - 2)
        here, there = self.cycles[step], self.cycles[step + 1]
        rise = self.distances[step + 1] - self.distances[step]
        share = np.divide(
            cycles - here, there - here, out=np.zeros_like(cycles), where=there > here
        )
        inside = self.distances[step] + share * rise
        before, after = self.steep[:, rows]
        return np.where(
            cycles < start,
            near + (cycles - start) / before,
            np.where(cycles > stop, far + (cycles - stop) / after, inside),
        )


def _even_table(first: float, last: float, stride: float, duty: float) -> ContactTable:
    """The table of an arm that has the same cycle all the way, its knots where holds begin and end.

    Two knots would do for it. But what is changed next to one of them changes all that lies between
    the two. The route begins and ends so many cycles from the middle of stance 0.
    """
    stances = np.arange(np.floor(first) - 1.0, np.ceil(last) + 2.0)
    values = (stances[:, None] + 0.5 * duty * np.array([-1.0, 1.0])).ravel()
    return ContactTable(stride * (values - first), values, np.full(len(values), 1.0 / stride))


def _table(stances: CrawlStances, arm: int, duty: float) -> ContactTable:
    own: NDArray[np.bool_] = stances.arm == arm
    start, end = stances.start[own], stances.end[own]
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
    return ContactTable(at, values, _monotone(at, values), aims=_aims(stances, own))


def _rested(
    table: ContactTable, length: float, duty: float, *, start: bool, end: bool
) -> ContactTable:
    """The table of an arm that lies on the ground where the body stands."""
    first, low = _going(table, duty) if start else (0.0, -np.inf)
    last, high = _stopping(table, length, duty) if end else (0.0, np.inf)
    if low < high:
        # A knot that is there already, but for its last digits, is not to be there twice.
        same = 1e-9 * (table.at[-1] - table.at[0])
        own = table.at[(table.at > low + same) & (table.at < high - same)]
        at = np.unique([*[0.0, low] * start, *own, *[high, length] * end])
    else:
        at = np.array([0.0, length])
    values, slopes = table.cycles(at), table.slopes_at(at)
    if start:
        values[0] = first
    if end:
        values[-1] = last
    if not low < high:
        # Hardly a step on so short a way: none at all if it were a hasty one.
        own = np.ptp(table.cycles(at))
        last = min(max(first, last), last + 1.0, key=lambda each: abs(each - first - own))
        values[-1] = first if last - first > _HASTE * own else last
    secants = np.diff(values) / np.diff(at)
    if start and low > 0.0:
        slopes[0] = secants[0]
    if end and high < length:
        slopes[-1] = secants[-1]
    # No curve between two knots falls that is at most three times as steep as their chord.
    slopes[1:] = np.minimum(slopes[1:], 3.0 * secants)
    slopes[:-1] = np.minimum(slopes[:-1], 3.0 * secants)
    return replace(table, at=at, values=values, slopes=slopes, starts=start, stops=end)


def _going(table: ContactTable, duty: float) -> tuple[float, float]:
    """Where in its cycles an arm is at the start, and the distance at which it is as it would be.

    It either swings at once, and then lands as it would, or later, and then lets go as it would.
    """
    own = float(table.cycles(np.zeros(1))[0])
    first, middle = _nearest(own, _STARTS, duty, _AT_ONCE)
    if first == own:
        return own, 0.0
    joint = middle + 1.0 - 0.5 * duty if own > first else middle + 0.5 * duty
    return first, float(table.distances(np.array([joint]))[0])


def _stopping(table: ContactTable, length: float, duty: float) -> tuple[float, float]:
    """Where in its cycles an arm is at the end, and the distance up to which it is as it would be.

    It either takes no more step, or takes its last one in time.
    """
    own = float(table.cycles(np.array([length]))[0])
    last, middle = _nearest(own, _STOPS, duty, 1.0 - _AT_ONCE)
    if last == own:
        return own, length
    joint = middle - 0.5 * duty if own > last else middle - 1.0 + 0.5 * duty
    return last, float(table.distances(np.array([joint]))[0])


def _nearest(
    cycles: float, around: tuple[float, float], duty: float, late: float
) -> tuple[float, float]:
    """Cycles nearby at which an arm lies on the ground, and the middle of that stance.

    It lies between two places around the middle of a stance, in stances; so many cycles late, it
    is the next one's.
    """
    middle = np.floor(cycles - late) + 1.0
    low, high = duty * np.array(around)
    return float(np.clip(cycles, middle + low, middle + high)), float(middle)


def _monotone(at: Floats, values: Floats) -> Floats:
    """Slopes at the knots with which a piecewise cubic neither jumps nor turns back."""
    width, rise = np.diff(at), np.diff(values)
    secant = rise / width
    slopes = np.empty_like(at)
    slopes[0], slopes[-1] = secant[0], secant[-1]
    first, last = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    slopes[1:-1] = (first + last) / (first / secant[:-1] + last / secant[1:])
    return slopes
