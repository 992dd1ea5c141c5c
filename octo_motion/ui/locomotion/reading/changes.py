# SPDX-License-Identifier: GPL-3.0-or-later
"""A journey on which the gait changes, from the settings to the arms' poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from ....core.easing import least_jerk
from ....core.errors import SettingsError
from ....core.locomotion.clearance import afloat
from ....core.locomotion.gait import CYCLE, GaitPoser, GaitTable
from ....core.locomotion.ground import (
    BodyLine,
    ContactOverride,
    GroundedWalk,
    Raise,
    SwingSmoothing,
    frames_around,
)
from ....core.locomotion.path import (
    Course,
    GaitTransition,
    Line,
    Route,
    SwumLine,
    Travel,
    TravelSettings,
    WalkedLine,
    Windows,
    bearings_of,
    blend_motions,
    check_transitions,
    slowing,
    transition_windows,
    transitions_by_height,
    travel_at,
    way_weights,
)
from ....core.rotations import Floats
from ..settings.changes import OCTO_MOTION_PG_change
from .ground import Standing

_SAMPLES: Final = 40
"""Places per arm length at which a route's height over the ground is looked at."""
_CALM: Final = 0.2
"""Share of a change within which an arm that goes over comes to rest."""
_APART: Final = 1_000_000
_ROOM: Final = 0.5
"""Arm lengths that a body swims higher than it walks at least: room for its arms …"""
_SETTLING: Final = 0.1
"""… and within which it comes down to that."""


@dataclass(frozen=True, eq=False)
class GaitSegment:
    """One way of moving."""

    gait: GaitTable
    generator: GaitPoser
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
    evened: list[Floats] = field(default_factory=list)
    """For each build of the way's walk (segments, 3, frames, arms): ``GroundedPoses.evened``."""

    @classmethod
    def still(cls, frames: int, bones: Sequence[int]) -> Moved:
        """Arms at rest that hold on to nothing.

        Args:
            frames: how many.
            bones: how many bones each arm has.
        """
        rotations = np.zeros((frames, sum(bones), 4))
        rotations[..., 0] = 1.0
        return cls(
            rotations=rotations,
            strains=np.zeros((frames, sum(bones))),
            late=np.zeros((frames, len(bones))),
            misses=np.zeros((frames, len(bones))),
            lying=[np.zeros((frames, each + 1), dtype=bool) for each in bones],
            cycles=np.zeros((frames, len(bones)), dtype=np.int64),
        )

    def copy(self) -> Moved:
        """The same, whose poses may be changed."""
        return replace(
            self,
            rotations=self.rotations.copy(),
            strains=self.strains.copy(),
            late=self.late.copy(),
        )


@dataclass(frozen=True, eq=False)
class SegmentedMotion:
    """The arms on all legs of a journey, one for each way along it."""

    changing: GaitTransitionPlan
    distance: Floats
    """(frames,) metres along the route."""
    places: tuple[Floats, Floats]
    """Centres (frames, 3) and orientations (frames, 4) of the body."""
    legs: tuple[Moved, ...]

    @cached_property
    def moved(self) -> Moved:
        """The arms."""
        return self.changing.joined(self.legs, self.distance)

    def higher(self, chosen: np.ndarray, lift: Floats) -> tuple[Floats, Floats, Floats]:
        """Some frames anew, with arms that are higher.

        Args:
            chosen: (n,) frames.
            lift: (n, arms) arm lengths by which they are to be higher than they have to be.

        Returns:
            Rotations (n, bones, 4), strains (n, bones), and arm lengths (n, arms) from arms to
            footholds that they cannot reach.
        """
        legs = [self.changing.again(leg, self, chosen, lift) for leg in range(len(self.legs))]
        # All frames, so that bones turn the same way round from one leg to the next as they did.
        moved = self.changing.joined(legs, self.distance)
        return moved.rotations[chosen], moved.strains[chosen], moved.late[chosen]


@dataclass(frozen=True, eq=False)
class GaitTransitionPlan:
    """A journey with several ways of moving, ready to be computed."""

    ways: Sequence[GaitSegment]
    changes: Sequence[GaitTransition]
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
        self,
        distance: Floats,
        places: tuple[Floats, Floats],
        step: int,
        frames_per_metre: float,
    ) -> Iterator[SegmentedMotion | float]:
        """Yield the share that is done, and in the end the arms.

        Args:
            distance: (frames,) metres along the route.
            places: centres (frames, 3) and orientations (frames, 4) of the body.
            step: frames to be worked on at a time.
            frames_per_metre: on the way.
        """
        legs: list[Moved] = []
        count = len(self.changes) + 1
        for leg in range(count):
            part = np.flatnonzero(self._within(leg, distance))
            moved = Moved.still(len(distance), self.bones)
            way = self.ways[self._way(leg)]
            cycle = frames_per_metre * way.travel.stride
            steady = SwingSmoothing.over(way.generator.settings.smoothing_cycles, cycle)
            for start in range(0, len(part), step):
                chosen = slice(start, min(start + step, len(part)))
                self._pose(leg, distance, places, moved, frames=part, part=chosen, steady=steady)
                yield 0.9 * (leg + start / max(len(part), 1)) / count
            self._calm(leg, distance, np.arange(len(distance)), moved)
            legs.append(moved)
        yield SegmentedMotion(self, distance, places, tuple(legs))

    def _way(self, leg: int) -> int:
        """The way before the first change, and then the one after each."""
        return self.changes[leg - 1].way if leg else 0

    def _within(self, leg: int, distance: Floats) -> np.ndarray:
        """At which distances (frames,) any arm goes this way."""
        begin = float(self.windows[leg - 1].start.min()) if leg else -np.inf
        end = float(self.windows[leg].end.max()) if leg < len(self.changes) else np.inf
        return (distance >= begin) & (distance <= end)

    def _calm(
        self,
        leg: int,
        distance: Floats,
        frames: np.ndarray,
        moved: Moved,
        lift: Floats | None = None,
    ) -> None:
        """Let arms that are about to go over, or have just done so, come to rest in their way.

        The body turns meanwhile as no walking body does: what an arm on the ground would make of
        that is wild. So an arm goes over from the pose in which it let go.

        Args:
            leg: which of the ways along the journey.
            distance: (frames,) metres along the route.
            frames: (n,) which of them are looked at.
            moved: the arms on this leg; changed in place.
            lift: (n, arms) arm lengths by which arms are to be higher, and nothing happens to the
                others; none for all of them as high as they have to be.
        """
        walk = self.walks[self._way(leg)]
        if walk is None:
            return
        bones = self._bones_of
        for change, leaving in ((leg, True), (leg - 1, False)):
            if not 0 <= change < len(self.changes):
                continue
            window = self.windows[change]
            within = _CALM * (self.changes[change].end - self.changes[change].start)
            asked: list[tuple[int, np.ndarray, np.ndarray, slice]] = []
            stops: list[Floats] = []
            for arm in range(len(self.bones)):
                start, end = window.start[arm], window.end[arm]
                inside = (distance[frames] > start) & (distance[frames] < end)
                if lift is not None:
                    inside &= lift[:, arm] > 0.0
                own = np.flatnonzero(inside)
                higher = np.zeros(len(own)) if lift is None else lift[own, arm]
                here = distance[frames[own]]
                if leaving:
                    here = start + slowing(here - start, within)
                else:
                    here = end - slowing(end - here, within)
                # At rest it is in the same pose from frame to frame.
                both = np.stack([here, higher], axis=1)
                single, again = np.unique(both, axis=0, return_inverse=True)
                count = sum(len(each) for each in stops)
                stops.append(single)
                part = slice(count, count + len(single))
                asked.append((arm, frames[own], again.reshape(-1), part))
            here, higher = np.concatenate(stops).T
            if not len(here):
                continue
            raised = None
            if lift is not None:
                raised = Raise(np.zeros((len(here), len(self.bones))))
                for arm, _, _, part in asked:
                    raised.lift[part, arm] = higher[part]
            travel = self._travel(self._way(leg), here)
            stood = walk.pose(travel.phase, travel.turn, *self.course.at(here), raised)
            for arm, chosen, again, part in asked:
                moved.rotations[chosen, bones[arm]] = stood.rotations[part, bones[arm]][again]
                moved.strains[chosen, bones[arm]] = stood.strains[part, bones[arm]][again]
                moved.late[chosen, arm] = 0.0

    def again(self, leg: int, journey: SegmentedMotion, chosen: np.ndarray, lift: Floats) -> Moved:
        """The arms on one leg of a journey, higher at some frames.

        Args:
            leg: which of the ways along the journey.
            journey: as it was.
            chosen: (n,) frames.
            lift: (n, arms) arm lengths by which they are to be higher.
        """
        distance, places, before = journey.distance, journey.places, journey.legs[leg]
        walk, inside = self.walks[self._way(leg)], self._within(leg, distance[chosen])
        if walk is None or not np.any(lift[inside]):
            return before
        moved = before.copy()
        frames = chosen[inside]
        raised = Raise(lift[inside], evened=tuple(each[:, :, frames] for each in before.evened))
        travel = self._travel(self._way(leg), distance[frames])
        stood = walk.pose(travel.phase, travel.turn, places[0][frames], places[1][frames], raised)
        for arm in raised.arms:
            bones, higher = self._bones_of[arm], raised.lift[:, arm] > 0.0
            own = frames[higher]
            moved.rotations[own, bones] = stood.rotations[higher, bones]
            moved.strains[own, bones] = stood.strains[higher, bones]
            moved.late[own, arm] = stood.misses[higher, arm]
        self._calm(leg, distance, chosen, moved, lift)
        return moved

    @cached_property
    def _bones_of(self) -> list[slice]:
        """Which bones of all arms' are those of each."""
        ends = np.cumsum([0, *self.bones]).tolist()
        return [slice(start, end) for start, end in pairwise(ends)]

    def joined(self, legs: Sequence[Moved], distance: Floats) -> Moved:
        """The whole journey (frames, …) of the arms on each of its legs.

        Args:
            legs: one after the other.
            distance: (frames,) metres along the route.
        """
        result = legs[0]
        for change, leg in enumerate(legs[1:]):
            result = self._joined(result, leg, self._shares(change, distance))
        return result

    def afloat(self, distance: Floats) -> Floats:
        """How far arms (frames, arms) are to be kept off a ground that their gait knows not."""
        legs = range(len(self.changes) + 1)
        swims = [self.walks[self._way(leg)] is None for leg in legs]
        shares = [self._shares(change, distance) for change in range(len(self.changes))]
        return afloat(swims, shares)

    def _shares(self, change: int, distance: Floats) -> Floats:
        """How far each arm (frames, arms) has gone over at a change."""
        found = self.windows[change]
        return least_jerk((distance[:, None] - found.start) / (found.end - found.start))

    def _travel(self, number: int, distance: Floats) -> Travel:
        """The body at some distances as one of the ways has it."""
        way, line = self.ways[number], self.course.lines[number]
        if isinstance(line, SwumLine):
            return line.travel(distance)
        phase = CYCLE * distance / way.travel.stride
        bearings = way.standing.bearings if way.standing else bearings_of(line.route, way.travel)
        return travel_at(line.route, way.travel, bearings, distance, phase)

    def _pose(
        self,
        leg: int,
        distance: Floats,
        places: tuple[Floats, Floats],
        moved: Moved,
        *,
        frames: np.ndarray,
        part: slice,
        steady: SwingSmoothing | None,
    ) -> None:
        """Pose the arms at a part of the frames of a leg."""
        number = self._way(leg)
        way, walk, chosen = self.ways[number], self.walks[number], frames[part]
        if walk is not None:
            inside, own = frames_around(
                part, steady.reach if steady else 0, len(frames), cyclic=False
            )
            wide = frames[inside]
            travel = self._travel(number, distance[wide])
            where = places[0][wide], places[1][wide]
            stood = walk.pose(travel.phase, travel.turn, *where, smoothing=steady).part(own)
            moved.rotations[chosen], moved.strains[chosen] = stood.rotations, stood.strains
            if not moved.evened:
                count = len(distance)
                moved.evened.extend(
                    np.zeros((*each.shape[:2], count, each.shape[3])) for each in stood.evened
                )
            for whole, each in zip(moved.evened, stood.evened, strict=True):
                whole[:, :, chosen] = each
            moved.late[chosen] = stood.misses
            # Ways have cycles of their own.
            moved.cycles[chosen] = stood.cycles + _APART * number
            for arm, rests in zip(moved.lying, walk.by_arm(stood.in_contact), strict=True):
                arm[chosen] = rests
        else:
            travel = self._travel(number, distance[chosen])
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
            turned = blend_motions(
                first.rotations[inside], second.rotations[inside], per_bone[inside]
            )
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
    settings: OCTO_MOTION_PG_change,
    ways: dict[str, int],
    route: Route,
    reach: float,
    ground: GaitSegment,
) -> tuple[GaitTransition, ...]:
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
        found = transitions_by_height(
            distance,
            places[:, 2] - floor,
            take_off=settings.height * reach,
            length=settings.length * reach,
        )
        above = ways[settings.gait]
        found = [GaitTransition(each.start, each.end, above * each.way) for each in found]
        # One that is done before the route begins is no place of it.
        done = [each for each in found if each.middle < 0.0]
        return (*done, *check_transitions(found[len(done) :], route.length))
    return check_transitions(
        [
            GaitTransition(
                item.position * route.length - 0.5 * item.length * reach,
                item.position * route.length + 0.5 * item.length * reach,
                ways[item.gait],
            )
            for item in settings.places
        ],
        route.length,
    )


def plan_transitions(
    ways: Sequence[GaitSegment],
    changes: Sequence[GaitTransition],
    route: Route,
    wishes: Sequence[ContactOverride],
    bones: Sequence[int],
) -> GaitTransitionPlan:
    """Lay all footholds of a journey, and find when each arm goes over."""
    floor = next((way.standing.line for way in ways if way.standing is not None), None)
    lines = [_line(way, number, changes, route, floor) for number, way in enumerate(ways)]
    course = Course(lines, changes)
    asked: list[list[ContactOverride]] = [
        list(wishes) if number == 0 else [] for number in range(len(ways))
    ]
    walks = _walks(ways, course, asked)
    found = []
    for number, change in enumerate(changes):
        before = changes[number - 1].way if number else 0
        first = changes[number - 1].middle if number else -np.inf
        last = changes[number + 1].middle if number + 1 < len(changes) else np.inf
        holds = [
            _holds(walks[way], ways[way], len(bones), first, last) for way in (before, change.way)
        ]
        window = transition_windows(change, *([each[0] for each in arms] for arms in holds))
        for way, arms, dropped in zip(
            (before, change.way),
            holds,
            (window.dropped_before, window.dropped_after),
            strict=True,
        ):
            for arm, (_, cycles) in enumerate(arms):
                left_out = cycles[dropped[arm]]
                asked[way].extend(
                    ContactOverride(arm, int(cycle), removed=True) for cycle in left_out
                )
        found.append(window)
    return GaitTransitionPlan(ways, changes, found, course, _walks(ways, course, asked), bones)


def _line(
    way: GaitSegment,
    number: int,
    changes: Sequence[GaitTransition],
    route: Route,
    floor: BodyLine | None,
) -> Line:
    if way.standing is not None:
        return way.standing.line
    bearings = bearings_of(route, way.travel)
    if way.gait.on_ground:
        return WalkedLine(route, way.travel, bearings, way.height)
    # The stroke that takes it off the ground, or the first one.
    start = next((each.middle for each in changes if each.way == number), 0.0)
    reach = way.travel.stride / way.gait.stride
    return SwumLine(
        route,
        way.travel,
        bearings,
        start,
        height=way.height,
        floor=floor,
        room=_ROOM * reach,
        softness=_SETTLING * reach,
    )


def _walks(
    ways: Sequence[GaitSegment], course: Course, wishes: Sequence[Sequence[ContactOverride]]
) -> list[GroundedWalk | None]:
    return [
        way.standing.build(course.line(number), wishes[number]) if way.standing else None
        for number, way in enumerate(ways)
    ]


def _holds(
    walk: GroundedWalk | None, way: GaitSegment, arms: int, first: float, last: float
) -> list[tuple[tuple[Floats, Floats], np.ndarray]]:
    """For each arm, where its holds begin and end between two places, and their cycles."""
    found: list[list[tuple[float, float, int]]] = [[] for _ in range(arms)]
    unit = way.travel.stride / CYCLE
    for each in walk.footholds() if walk is not None else ():
        on, off = unit * each.touch_down, unit * each.lift_off
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
