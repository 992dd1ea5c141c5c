# SPDX-License-Identifier: GPL-3.0-or-later
"""A journey on which the gait changes, from the settings to the arms' poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...core.errors import SettingsError
from ...core.locomotion.changes import (
    Change,
    Windows,
    blended,
    changes_by_height,
    check_changes,
    eased,
    slowing,
    way_weights,
    windows,
)
from ...core.locomotion.course import Course, Line, SwumLine, WalkedLine
from ...core.locomotion.footholds import Wish
from ...core.locomotion.gait import GaitTable
from ...core.locomotion.generator import Generator
from ...core.locomotion.grounded import GroundedWalk
from ...core.locomotion.route import Route
from ...core.locomotion.travel import Travel, TravelSettings, bearings_of, travel_at
from ...core.rotations import Floats
from .change_properties import OCTO_MOTION_PG_change
from .standing import Standing

_SAMPLES: Final = 40
"""Places per arm length at which a route's height over the ground is looked at."""
_CALM: Final = 0.2
"""Share of a change within which an arm that goes over comes to rest."""
_APART: Final = 1_000_000
_CYCLE: Final = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Way:
    """One way of moving."""

    gait: GaitTable
    generator: Generator
    travel: TravelSettings
    standing: Standing | None
    """What holds the ground, none for a swim."""
    height: float
    """Metres from the route to the body's centre, where nothing holds the ground."""


@dataclass(frozen=True, eq=False)
class Moved:
    """The arms at the frames of a journey."""

    rotations: Floats
    """(frames, bones, 4)"""
    strains: Floats
    """(frames, bones)"""
    late: Floats
    """(frames, arms) arm lengths from an arm to the foothold that it cannot reach."""
    misses: Floats
    """(frames, arms) arm lengths from an arm to the targets of its gait."""
    lying: Sequence[np.ndarray]
    """For each arm (frames, joints) which rest on the ground."""
    cycles: np.ndarray
    """(frames, arms) number of each arm's cycle."""


@dataclass(frozen=True, eq=False)
class Changing:
    """A journey with several ways of moving, ready to be computed."""

    ways: Sequence[Way]
    changes: Sequence[Change]
    windows: Sequence[Windows]
    course: Course
    walks: Sequence[GroundedWalk | None]
    """For each way that holds the ground, its walk along the whole course."""
    bones: Sequence[int]
    """How many bones each arm has."""

    def swimming(self, distance: Floats) -> Floats:
        """How far (frames,) the body swims at distances (frames,), 0…1."""
        weights = way_weights(self.changes, len(self.ways), distance)
        return weights[:, [not way.gait.on_ground for way in self.ways]].sum(axis=1)

    def compute(
        self, distance: Floats, places: tuple[Floats, Floats], step: int
    ) -> Iterator[Moved | float]:
        """Yield the share that is done, and in the end the arms.

        Args:
            distance: (frames,) metres along the route.
            places: centres (frames, 3) and orientations (frames, 4) of the body.
            step: frames to be worked on at a time.
        """
        count, arms = len(distance), len(self.bones)
        total = sum(self.bones)
        result: Moved | None = None
        for number in range(len(self.changes) + 1):
            # The way before the first change, and then the one after each.
            way = self.changes[number - 1].way if number else 0
            if number:
                shares = self._shares(number - 1, distance)
                begin = float(self.windows[number - 1].start.min())
            else:
                shares, begin = np.ones((count, arms)), -np.inf
            end = np.inf
            if number < len(self.changes):
                end = float(self.windows[number].end.max())
            part = np.flatnonzero((distance >= begin) & (distance <= end))
            moved = Moved(
                np.zeros((count, total, 4)),
                np.zeros((count, total)),
                np.zeros((count, arms)),
                np.zeros((count, arms)),
                [np.zeros((count, bones + 1), dtype=bool) for bones in self.bones],
                np.zeros((count, arms), dtype=np.int64),
            )
            moved.rotations[..., 0] = 1.0
            for start in range(0, len(part), step):
                chosen = part[start : start + step]
                self._pose(way, distance, places, chosen, moved)
                yield 0.9 * (number + start / max(len(part), 1)) / (len(self.changes) + 1)
            self._calm(number, way, distance, moved)
            result = moved if result is None else self._joined(result, moved, shares)
        assert result is not None
        yield result

    def _calm(self, number: int, way: int, distance: Floats, moved: Moved) -> None:
        """Let arms that are about to go over, or have just done so, come to rest in their way.

        The body turns meanwhile as no walking body does: what an arm on the ground would make of
        that is wild. So an arm goes over from the pose in which it let go.
        """
        walk = self.walks[way]
        if walk is None:
            return
        ends = np.cumsum([0, *self.bones])
        for change, leaving in ((number, True), (number - 1, False)):
            if not 0 <= change < len(self.changes):
                continue
            window = self.windows[change]
            within = _CALM * (self.changes[change].end - self.changes[change].start)
            asked: list[tuple[int, np.ndarray, np.ndarray, slice]] = []
            places: list[Floats] = []
            for arm in range(len(self.bones)):
                start, end = window.start[arm], window.end[arm]
                chosen = np.flatnonzero((distance > start) & (distance < end))
                here = distance[chosen]
                if leaving:
                    here = start + slowing(here - start, within)
                else:
                    here = end - slowing(end - here, within)
                # At rest it is in the same pose from frame to frame.
                here, again = np.unique(here, return_inverse=True)
                count = sum(len(each) for each in places)
                places.append(here)
                asked.append((arm, chosen, again, slice(count, count + len(here))))
            here = np.concatenate(places)
            if not len(here):
                continue
            travel = self._travel(way, here)
            stood = walk.pose(travel.phase, travel.turn, *self.course.at(here))
            for arm, chosen, again, part in asked:
                bones = slice(int(ends[arm]), int(ends[arm + 1]))
                moved.rotations[chosen, bones] = stood.rotations[part, bones][again]
                moved.strains[chosen, bones] = stood.strains[part, bones][again]
                moved.late[chosen, arm] = 0.0

    def _shares(self, change: int, distance: Floats) -> Floats:
        """How far each arm (frames, arms) has gone over at a change."""
        found = self.windows[change]
        return eased((distance[:, None] - found.start) / (found.end - found.start))

    def _travel(self, number: int, distance: Floats) -> Travel:
        """The body at some distances as one of the ways has it."""
        way, line = self.ways[number], self.course.lines[number]
        if isinstance(line, SwumLine):
            return line.travel(distance)
        phase = _CYCLE * distance / way.travel.stride
        bearings = way.standing.bearings if way.standing else bearings_of(line.route, way.travel)
        return travel_at(line.route, way.travel, bearings, distance, phase)

    def _pose(
        self,
        number: int,
        distance: Floats,
        places: tuple[Floats, Floats],
        chosen: np.ndarray,
        moved: Moved,
    ) -> None:
        way, walk = self.ways[number], self.walks[number]
        travel = self._travel(number, distance[chosen])
        if walk is not None:
            stood = walk.pose(travel.phase, travel.turn, places[0][chosen], places[1][chosen])
            moved.rotations[chosen], moved.strains[chosen] = stood.rotations, stood.strains
            moved.late[chosen] = stood.misses
            # Ways have cycles of their own.
            moved.cycles[chosen] = stood.cycles + _APART * number
            for arm, rests in zip(moved.lying, walk.by_arm(stood.lying), strict=True):
                arm[chosen] = rests
        else:
            posed = way.generator.pose(travel.phase, travel.turn)
            moved.rotations[chosen] = posed.rotations
            moved.misses[chosen] = posed.misses.max(axis=2)

    def _joined(self, first: Moved, second: Moved, shares: Floats) -> Moved:
        per_bone = np.repeat(shares, self.bones, axis=1)
        over, going = per_bone > 0.0, (per_bone > 0.0) & (per_bone < 1.0)
        rotations = np.where(over[..., None], second.rotations, first.rotations)
        part = np.flatnonzero(np.any(going, axis=1))
        if len(part):
            inside = slice(int(part[0]), int(part[-1]) + 1)
            turned = blended(first.rotations[inside], second.rotations[inside], per_bone[inside])
            rotations[inside] = np.where(going[inside][..., None], turned, rotations[inside])
        # On the way from one to the other an arm has no place of its own to be at.
        late, misses = (
            np.where(shares >= 1.0, there, np.where(shares <= 0.0, here, 0.0))
            for here, there in ((first.late, second.late), (first.misses, second.misses))
        )
        return Moved(
            rotations,
            first.strains + per_bone * (second.strains - first.strains),
            late,
            misses,
            [
                np.where(share >= 1.0, there, here & (share <= 0.0))
                for share, here, there in zip(
                    shares.T[..., None], first.lying, second.lying, strict=True
                )
            ],
            np.where(shares > 0.0, second.cycles, first.cycles),
        )


def read_changes(
    settings: OCTO_MOTION_PG_change, ways: dict[str, int], route: Route, reach: float, ground: Way
) -> tuple[Change, ...]:
    """Where the gait changes.

    Args:
        settings: what decides.
        ways: numbers of the gaits by name; the one that the route begins with is 0.
        route: where to.
        reach: metres that an arm is long.
        ground: the way over whose ground heights count.

    Raises:
        SettingsError: two changes overlap, or the route does not change its height.
    """
    if settings.by == "HEIGHT":
        count = int(np.ceil(_SAMPLES * route.length / reach)) + 2
        distance = np.linspace(0.0, route.length, count)
        places = route.position(route.parameter_at(distance))
        floor = np.full(count, places[:, 2].min())
        if ground.standing is not None:
            floor = ground.standing.ground.height(places[:, :2])
        found = changes_by_height(
            distance,
            places[:, 2] - floor,
            take_off=settings.height * reach,
            length=settings.length * reach,
        )
        above = ways[settings.gait]
        found = [Change(each.start, each.end, above * each.way) for each in found]
        # One that is done before the route begins is no place of it.
        done = [each for each in found if each.middle < 0.0]
        return (*done, *check_changes(found[len(done) :], route.length))
    return check_changes(
        [
            Change(
                item.position * route.length - 0.5 * item.length * reach,
                item.position * route.length + 0.5 * item.length * reach,
                ways[item.gait],
            )
            for item in settings.places
        ],
        route.length,
    )


def plan(
    ways: Sequence[Way],
    changes: Sequence[Change],
    route: Route,
    wishes: Sequence[Wish],
    bones: Sequence[int],
) -> Changing:
    """Lay all footholds of a journey, and find when each arm goes over."""
    lines = [_line(way, number, changes, route) for number, way in enumerate(ways)]
    course = Course(lines, changes)
    asked: list[list[Wish]] = [list(wishes) if number == 0 else [] for number in range(len(ways))]
    walks = _walks(ways, course, asked)
    found = []
    for number, change in enumerate(changes):
        before = changes[number - 1].way if number else 0
        first = changes[number - 1].middle if number else -np.inf
        last = changes[number + 1].middle if number + 1 < len(changes) else np.inf
        holds = [
            _holds(walks[way], ways[way], len(bones), first, last) for way in (before, change.way)
        ]
        window = windows(change, *([each[0] for each in arms] for arms in holds))
        for way, arms, dropped in zip(
            (before, change.way),
            holds,
            (window.dropped_before, window.dropped_after),
            strict=True,
        ):
            for arm, (_, cycles) in enumerate(arms):
                left_out = cycles[dropped[arm]]
                asked[way].extend(Wish(arm, int(cycle), removed=True) for cycle in left_out)
        found.append(window)
    return Changing(ways, changes, found, course, _walks(ways, course, asked), bones)


def _line(way: Way, number: int, changes: Sequence[Change], route: Route) -> Line:
    if way.standing is not None:
        return way.standing.line
    bearings = bearings_of(route, way.travel)
    if way.gait.on_ground:
        return WalkedLine(route, way.travel, bearings, way.height)
    # The stroke that takes it off the ground, or the first one.
    start = next((each.middle for each in changes if each.way == number), 0.0)
    return SwumLine(route, way.travel, bearings, start, way.height)


def _walks(
    ways: Sequence[Way], course: Course, wishes: Sequence[Sequence[Wish]]
) -> list[GroundedWalk | None]:
    return [
        way.standing.build(course.line(number), wishes[number]) if way.standing else None
        for number, way in enumerate(ways)
    ]


def _holds(
    walk: GroundedWalk | None, way: Way, arms: int, first: float, last: float
) -> list[tuple[tuple[Floats, Floats], np.ndarray]]:
    """For each arm, where its holds begin and end between two places, and their cycles."""
    found: list[list[tuple[float, float, int]]] = [[] for _ in range(arms)]
    unit = way.travel.stride / _CYCLE
    for each in walk.footholds() if walk is not None else ():
        on, off = unit * each.on, unit * each.off
        if first < 0.5 * (on + off) <= last:
            found[each.arm].append((on, off, each.cycle))
    result = []
    for holds in found:
        table = np.array(sorted(holds), dtype=np.float64).reshape(len(holds), 3)
        result.append(((table[:, 0], table[:, 1]), table[:, 2].astype(int)))
    return result


def gaits_of(settings: OCTO_MOTION_PG_change) -> list[str]:
    """Names of the gaits that a journey changes to.

    Raises:
        SettingsError: there is no place to change at.
    """
    if settings.by == "HEIGHT":
        return [settings.gait]
    if settings.by == "MARKERS":
        if not len(settings.places):
            raise SettingsError(
                "The gait is to change at places, and there are none.",
                "Add a place, or set Change Gait to Never.",
            )
        return [item.gait for item in settings.places]
    return []
