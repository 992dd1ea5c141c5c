# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion's segments: one for each gait along its way, and how arms go over from one to the next.

A motion with one gait all the way is one segment. Where the gait changes, each arm is worked out in
both, goes over between two of its stances, and comes to rest in either meanwhile.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...phrases import phrase
from ...rotations import Floats, rotate
from ...smoothing import least_jerk, smooth_step
from ...steps import evenly
from ..clearance import afloat
from ..gait import CYCLE, GaitPoser, GaitTable
from ..ground import (
    BodyLine,
    ContactOverride,
    ContactTiming,
    CrawlingBody,
    CrawlSettings,
    EvenTiming,
    Ground,
    GroundedPoses,
    GroundedWalk,
    LevelGround,
    Raise,
    StanceSettings,
    SwingSmoothing,
    crawling,
    crawling_in_place,
    easy_height,
    finding_line,
    frames_around,
    ground_along_path,
    leaning,
    passes_over_itself,
    sampling_ground,
    span,
    timing_at_rest,
)
from ..path import (
    Bearings,
    Course,
    GaitTransition,
    Line,
    Route,
    SwumLine,
    Travel,
    TravelSettings,
    Windows,
    bearings_of,
    blend_motions,
    raised_along,
    slowing,
    strides,
    travel_at,
    values_along,
    walked_at,
    way_weights,
)
from ..rig import ArmMotion
from .job import EDGE, FINE, Creature, GroundJob
from .seabed import Seabed

_COARSE: Final = 0.1
"""Arm lengths between the samples of a ground that only follows the route."""
_AROUND: Final = 1.8
"""Arm lengths to all sides of the route that the ground is sampled."""
_HEADROOM: Final = 2.0
"""Arm lengths above the route up to which a surface is ground and not a roof."""
_LOWEST: Final = 0.12
"""Arm lengths that a body is above its ground at least."""
_GAP: Final = 1.0
"""Arm lengths without ground that are stepped over."""
_CLIMBED: Final = 0.7
"""Arm lengths that ground may rise or fall within half of one for nothing to be said: 54°, or a
step of as much. On a hill that rises by 0.61 at its steepest Walk holds on upright."""
_UPRIGHT: Final = (
    "The ground rises or falls by {rise:.2g} arm lengths within half of one: upright, arms slide "
    "there. Set Up to By Itself."
)
_PATH_STEP: Final = 0.1
"""Arm lengths between the points of the route that the ground is looked for under."""
_AROUND_STRIDES: Final = 1.0
"""Strides of the way to either side of a place that the arms there hang on …"""
_RESTED_STRIDES: Final = 2.0
"""… and from either end within which it matters to them whether the body stands there."""
_ASIDE: Final = 0.7
"""Arm lengths that a route may lie beside another one whose ground is taken over …"""
_LOOKS_ALONG: Final = 33
"""… and at how many places that is looked at."""

_OVER_ITSELF: Final = (
    "The route passes over itself: the ground between its levels is half way up. Choose a mesh as "
    "the ground, or switch Hold the Ground off."
)

_grounds: Final[ContentCache[tuple[Ground, Ground]]] = ContentCache(2)


@dataclass(frozen=True, eq=False)
class Standing:
    """A walk's ground and its way over it; :meth:`walk` lays the footholds."""

    creature: Creature
    poser: GaitPoser
    job: GroundJob
    line: BodyLine
    bearings: Bearings
    ground: Ground
    underfoot: Ground
    """The same as its arms feel it: with its edges rounded."""
    timing: ContactTiming | None
    """When arms hold on; none for the gait's own."""
    phases: tuple[float, float]
    """The first and the last of the body's phases, radians."""
    cyclic: bool
    """Whether each cycle is like the one before: a loop in place."""
    warnings: tuple[str, ...] = ()

    @property
    def stretching(self) -> bool:
        """Whether any bones may stretch."""
        return any(self.job.may_stretch)

    @property
    def radii(self) -> list[Floats]:
        """For each arm (bones + 1,) armature units from each joint to the skin below it."""
        return [each.radii for each in self.job.skins]

    @property
    def under(self) -> float:
        """Metres that a body's skin reaches below its centre where its arms begin."""
        return _under(self.poser, self.job) * self.creature.scale

    def place(self, travel: Travel) -> tuple[Floats, Floats]:
        """World positions (frames, 3) and orientations (frames, 4) of the canonical body."""
        centres, upright = self.line.ride(travel.positions, travel.distance)
        return centres, leaning(upright, travel.rotations)

    def walk(self, line: Line, overrides: Sequence[ContactOverride]) -> GroundedWalk:
        """The walk with its footholds and the artist's, on this body's way, or one that it is part
        of.
        """
        creature = self.creature
        return GroundedWalk(
            creature.skeleton,
            self.poser,
            creature.body,
            line,
            self.underfoot,
            settings=self.job.stance,
            scale=creature.scale,
            radii=self.radii,
            may_stretch=self.job.may_stretch,
            phases=self.phases,
            contact_overrides=overrides,
            timing=self.timing,
            cyclic=self.cyclic,
            skins=self.job.skins,
        )

    def walking(self, overrides: Sequence[ContactOverride]) -> Generator[None, None, GroundedWalk]:
        """The same on this body's own way, its footholds laid in steps."""
        walk = self.walk(self.line, overrides)
        yield from walk.laying()
        return walk


@dataclass(frozen=True, eq=False)
class Nearby:
    """A walk that is nearly the same, and where on its way the body is that is asked for."""

    standing: Standing
    start: float
    """Metres along the route, from there …"""
    end: float
    """… to there."""

    def around(self, stride: float, length: float) -> tuple[float, float]:
        """Metres along the route from where to where there is anything that matters there."""
        away = _AROUND_STRIDES * stride
        return max(self.start - away, 0.0), min(self.end + away, length)

    def phases(self, stride: float) -> tuple[float, float]:
        """The first and the last phase, radians, of the body that is asked for."""
        return CYCLE / stride * self.start, CYCLE / stride * self.end

    def as_rested(self, job: GroundJob, stride: float, length: float) -> GroundJob:
        """The same without what arms do as the body stands at its ends, where it is far off."""
        near_end = min(self.start, length - self.end) < _RESTED_STRIDES * stride
        return job if near_end else replace(job, rest=(False, False))

    def same_ground(
        self, job: GroundJob, route: Route, reach: float
    ) -> tuple[Ground, Ground] | None:
        """Its ground, as it is and as arms feel it, where that is as good for another walk: the
        same, or elsewhere, that was sampled as widely. None where it is not.
        """
        here, there = self.standing.job.mesh, job.mesh
        shift = there.shift_from(here) if here is not None and there is not None else None
        if shift is None:
            return None
        share = np.linspace(0.0, 1.0, _LOOKS_ALONG)
        apart = route.position(share) - self.standing.line.route.position(share) - shift
        if float(np.abs(apart).max()) >= _ASIDE * reach:
            return None
        known = self.standing.ground, self.standing.underfoot
        return (known[0].moved(shift), known[1].moved(shift)) if shift.any() else known


def standing_on(
    creature: Creature,
    poser: GaitPoser,
    job: GroundJob,
    route: Route,
    travel: TravelSettings,
    *,
    height: float | None,
    plane: float | None = None,
    cyclic: bool = False,
    near: Nearby | None = None,
) -> Generator[float, None, Standing]:
    """A walk's ground, its height over it, and when its arms hold on; in steps.

    Args:
        creature: whose walk it is.
        poser: its gait.
        job: the ground, and how arms hold on to it.
        route: where to.
        travel: how it travels.
        height: metres from the ground to the body's centre, none for as high as the gait is.
        plane: world Z of the level ground where no mesh is set, none to follow the route.
        cyclic: whether each cycle is like the one before, on level ground: for a loop in place.
        near: a walk that is nearly the same; then only one place of this one is wanted.

    Raises:
        GroundError: the route leaves the ground.
    """
    bearings, scale = bearings_of(route, travel, coarse=near is not None), creature.scale
    yield 0.0
    reach, phases = poser.arm_length * scale, (0.0, CYCLE * strides(route, travel))
    (ground, underfoot), warnings = yield from _finding_ground(
        job, route, travel, bearings, reach=reach, plane=plane, cyclic=cyclic, near=near
    )
    line = yield from finding_line(
        *(route, travel, bearings, ground),
        clearance=_height(poser, job) * scale if height is None else height,
        reach=reach,
        lean=job.stance.lean,
        smoothing=job.stance.smoothing,
        under=_under(poser, job) * scale,
        around=near and near.around(travel.stride, route.length),
    )
    if near and not cyclic:
        phases, job = near.phases(travel.stride), near.as_rested(job, travel.stride, route.length)
    return Standing(
        creature=creature,
        poser=poser,
        job=job,
        line=line,
        bearings=bearings,
        ground=ground,
        underfoot=underfoot,
        timing=_timing(poser, job, line, route, scale=scale, cyclic=cyclic),
        phases=phases,
        cyclic=cyclic,
        warnings=warnings,
    )


def _timing(
    poser: GaitPoser, job: GroundJob, line: BodyLine, route: Route, *, scale: float, cyclic: bool
) -> ContactTiming | None:
    """When arms hold on, where that is not the gait's own even timing."""
    gait, stance, timing = poser.settings.gait, job.stance, None
    hold = line.settings.along.hold
    if gait.manner == "CRAWL":
        near, far = span(stance, may_stretch=any(job.may_stretch))
        settings = CrawlSettings(near, far, planted=stance.planted, seed=poser.settings.seed)
        body = CrawlingBody(
            line,
            poser.roots * scale,
            poser.outward,
            reach=poser.arm_length * scale,
            middle=gait.power_phase,
            duty=stance.duty,
        )
        timing = crawling_in_place(body, settings) if cyclic else crawling(body, settings, job.rest)
    if not any(job.rest):
        return timing
    return timing_at_rest(
        timing or EvenTiming(line.settings.stride, poser.offsets),
        route.length,
        start=job.rest[0],
        end=job.rest[1],
        middle=gait.power_phase,
        duty=float(values_along(hold, [0.0, 1.0], stance.duty).min()),
    )


def _under(poser: GaitPoser, job: GroundJob) -> float:
    """How far a body's skin reaches below its centre where its arms begin, armature units."""
    arms = zip(job.skins, poser.roots, strict=True)
    skins = [skin.radii[0] - root[2] for skin, root in arms]
    return float(max(skins))


def _height(poser: GaitPoser, job: GroundJob) -> float:
    """As high as the gait is, and as low as arms reach with ease, armature units."""
    radii = [each.radii for each in job.skins]
    thickness = float(np.mean([each[len(each) // 2] for each in radii]))
    easy = _within_reach(poser, radii, job.may_stretch, job.stance)
    return max(
        min(poser.clearance + thickness, easy), _under(poser, job), _LOWEST * poser.arm_length
    )


def _within_reach(
    poser: GaitPoser, radii: Sequence[Floats], stretches: Sequence[bool], stance: StanceSettings
) -> float:
    """Greatest height at which all arms hold the ground with ease, armature units.

    What a gait asks for may be more than arms are long before they come to lie.
    """
    gait, heights = poser.settings.gait, [np.inf]
    for build in poser.builds:
        along = np.concatenate([[0.0], np.cumsum(build.chain.lengths)])
        for arm in build.arms:
            if not gait.curve(poser.arms[arm].pair).free:
                reach = along * poser.lengths[arm]
                easy = easy_height(reach, radii[arm], stance, may_stretch=stretches[arm])
                heights.append(easy - poser.roots[arm][2])
    return min(heights)


def _finding_ground(
    job: GroundJob,
    route: Route,
    travel: TravelSettings,
    bearings: Bearings,
    *,
    reach: float,
    plane: float | None,
    cyclic: bool,
    near: Nearby | None,
) -> Generator[float, None, tuple[tuple[Ground, Ground], tuple[str, ...]]]:
    """The ground of a walk, as it is and as arms feel it, and what to warn of; in steps."""
    if cyclic:
        level = LevelGround(0.0)
        return (level, level), ()
    if job.mesh is None and plane is not None:
        level = LevelGround(plane)
        return (level, level), job.warnings
    if near is not None and (known := near.same_ground(job, route, reach)) is not None:
        return known, job.warnings
    beyond = 0.0 if route.cyclic else travel.stride + reach
    start, end = (0.0, route.length) if near is None else near.around(travel.stride, route.length)
    count = int(np.ceil((end - start + 2.0 * beyond) / (_PATH_STEP * reach))) + 1
    distance = np.linspace(start - beyond, end + beyond, count)
    path, _ = walked_at(route, travel, bearings, distance, coarse=near is not None)
    if job.mesh is None:
        warnings = job.warnings
        if passes_over_itself(path, 0.5 * reach, 0.5 * reach):
            warnings = (_OVER_ITSELF, *warnings)
        around, spacing = _AROUND * reach, _COARSE * reach
        ground = ground_along_path(path, reach=around, spacing=spacing, softness=0.3 * reach)
        return (ground, ground), warnings
    inside = (distance >= 0.0) & (distance <= route.length)
    mesh = job.mesh
    sizes = {"reach": _AROUND * reach, "spacing": FINE * reach, "headroom": _HEADROOM * reach}
    sizes["gap"] = _GAP * reach
    key = content_key(mesh.content, path, inside, sizes)
    if (found := _grounds.known(key)) is None:
        triangles = mesh.triangles
        yield 0.1
        sampling = sampling_ground(triangles, path, inside, **sizes, content=mesh.content)
        sampled = yield from evenly(sampling, 0.3)
        yield 0.4
        made = sampled, sampled.rounded(EDGE * reach)
        found = _grounds.get(key, lambda: made)
        yield 0.5
    told = _too_steep(found[0], path[inside], reach) if job.stance.up == "WORLD" else ()
    return found, (*told, *job.warnings)


def _too_steep(ground: Ground, path: Floats, reach: float) -> tuple[str, ...]:
    """What there is to say of a way (n, 3) that is walked upright, though none can hold there."""
    height = ground.height(path)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    rise = np.abs(np.interp(along + 0.5 * reach, along, height) - height).max() / reach
    if rise <= _CLIMBED:
        return ()
    return (phrase(_UPRIGHT, rise=float(rise)),)


# --- Segments: one for each gait along the way, and how arms go over from one to the next ---------
#
# A motion with one gait all the way is one segment. Where the gait changes, each arm is worked
# out in both, goes over between two of its stances, and comes to rest in either meanwhile.


_CALM: Final = 0.2
"""Share of a change within which an arm that goes over comes to rest."""
_CROUCHED: Final = 0.2
"""Share of a stop within which a body crouches, as far as arms in the air need room for it."""
_APART: Final = 1_000_000
"""Between the numbers of one gait's cycles and of the next's: each has cycles of its own."""
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Gait:
    """One way of moving along this motion's route."""

    table: GaitTable
    poser: GaitPoser
    travel: TravelSettings
    standing: Standing | None
    """What holds the ground, none for a swim."""
    height: float
    """Metres from the route to the body's centre, where nothing holds the ground."""


@dataclass(frozen=True, eq=False)
class Transitions:
    """Where the gait changes, and when each arm goes over."""

    changes: Sequence[GaitTransition]
    windows: Sequence[Windows]
    course: Course
    """The body's way through all of them."""


@dataclass(eq=False)
class SegmentMotion:
    """The arms on one segment, at all moments of the motion."""

    arms: ArmMotion
    shapes: list[list[Floats]] = field(default_factory=list[list[Floats]])
    """Of each portion, for each build of its walk, ``GroundedPoses.shapes``; kept only where the
    gait never changes."""
    evened: list[Floats] = field(default_factory=list[Floats])
    """For each build (segments, 3, moments, arms): ``GroundedPoses.evened``."""
    joints: list[list[Floats]] = field(default_factory=list[list[Floats]])
    """Of each portion, for each arm (moments, joints, 3), world; kept likewise."""

    def copy(self) -> SegmentMotion:
        """The same, whose poses may be changed."""
        return SegmentMotion(self.arms.copy(), evened=self.evened)

    def keep(self, stood: GroundedPoses, walk: GroundedWalk) -> None:
        """Keep what raising arms asks for, of moments that follow those before."""
        self.shapes.append(list(stood.shapes))
        self.joints.append(walk.by_arm(stood.joints))

    def shapes_at(self, chosen: np.ndarray) -> tuple[Floats, ...] | None:
        """What is kept of some moments, none where nothing is."""
        if not self.shapes:
            return None
        if len(self.shapes) > 1:
            self.shapes = [
                [np.concatenate(each, axis=2) for each in zip(*self.shapes, strict=True)]
            ]
        return tuple(each[:, :, chosen] for each in self.shapes[0])


@dataclass(frozen=True, eq=False)
class Segments:
    """All segments of a motion, ready to be worked out."""

    gaits: Sequence[Gait]
    walks: Sequence[GroundedWalk | None]
    """For each gait that holds the ground, its walk along the whole way."""
    transitions: Transitions | None
    """None for one gait all the way."""
    bones: Sequence[int]
    """How many bones each arm has."""
    route: Route
    seabed: Seabed | None = None
    """What lies below a body that swims all the way; none where nothing does."""

    @property
    def changes(self) -> Sequence[GaitTransition]:
        """From each segment to the next."""
        return self.transitions.changes if self.transitions is not None else ()

    @property
    def count(self) -> int:
        """Number of segments."""
        return len(self.changes) + 1

    def gait_of(self, segment: int) -> int:
        """The gait before the first change, and then the one after each."""
        return self.changes[segment - 1].way if segment else 0

    @cached_property
    def bones_of(self) -> list[slice]:
        """Which bones of all arms' are those of each."""
        ends = np.cumsum([0, *self.bones]).tolist()
        return [slice(start, end) for start, end in pairwise(ends)]

    def places(self, travel: Travel) -> tuple[Floats, Floats]:
        """Centres (moments, 3) and orientations (moments, 4) of the body, world."""
        centres, orientations = self._places(travel)
        if self.seabed is not None:
            centres = centres + self.seabed.lifted(travel.distance)[:, None] * _UP
        return centres, orientations

    def _places(self, travel: Travel) -> tuple[Floats, Floats]:
        gait = self.gaits[0]
        if self.transitions is not None:
            return self.transitions.course.at(travel.distance)
        if gait.standing is not None:
            return gait.standing.place(travel)
        up = rotate(travel.rotations, _UP) if gait.table.on_ground else _UP
        height = gait.height + raised_along(self.route, gait.travel, travel.distance)[:, None]
        return travel.positions + height * up, travel.rotations

    def swimming(self, distance: Floats) -> Floats | None:
        """How far (moments,) the body swims at distances (moments,), 0…1; none for one gait."""
        if self.transitions is None:
            return None
        weights = way_weights(self.changes, len(self.gaits), distance)
        return weights[:, [not gait.table.on_ground for gait in self.gaits]].sum(axis=1)

    def strokes(self, travel: Travel) -> Floats:
        """Strokes (moments,) of the swim since the middle of one; of no use where nothing swims."""
        if self.transitions is None:
            return (travel.phase - self.gaits[0].travel.stroke_phase) / CYCLE
        lines = [each for each in self.transitions.course.lines if isinstance(each, SwumLine)]
        if not lines:
            return np.zeros(len(travel.distance))
        return (lines[0].phase(travel.distance) - lines[0].settings.stroke_phase) / CYCLE

    def afloat(self, travel: Travel) -> Floats | None:
        """How far arms (moments, arms) are to be kept off a ground that their gait knows not."""
        distance = travel.distance
        swims = [self.walks[self.gait_of(segment)] is None for segment in range(self.count)]
        shares = [self.shares(change, distance) for change in range(len(self.changes))]
        # Of a motion on which the gait never changes, one number stands for all.
        stop = np.mod(travel.stood, 1.0)[:, None]
        crouched = smooth_step(np.minimum(stop, 1.0 - stop) / _CROUCHED)
        whole = afloat(swims, shares, crouched)
        whole = np.broadcast_to(whole, (len(distance), len(self.bones)))
        return whole if whole.any() else None

    def shares(self, change: int, distance: Floats) -> Floats:
        """How far each arm (moments, arms) has gone over at a change."""
        assert self.transitions is not None
        found = self.transitions.windows[change]
        return least_jerk((distance[:, None] - found.start) / (found.end - found.start))

    def within(self, segment: int, distance: Floats) -> np.ndarray:
        """At which distances (moments,) any arm goes this way."""
        if self.transitions is None:
            return np.ones(len(distance), dtype=bool)
        windows = self.transitions.windows
        begin = float(windows[segment - 1].start.min()) if segment else -np.inf
        end = float(windows[segment].end.max()) if segment < len(windows) else np.inf
        return (distance >= begin) & (distance <= end)

    def travel_of(self, number: int, distance: Floats) -> Travel:
        """The body at some distances as one of the gaits has it, where the gait changes."""
        assert self.transitions is not None
        gait, line = self.gaits[number], self.transitions.course.lines[number]
        if isinstance(line, SwumLine):
            return line.travel(distance)
        phase = CYCLE * distance / gait.travel.stride
        bearings = gait.standing.bearings if gait.standing else bearings_of(line.route, gait.travel)
        return travel_at(line.route, gait.travel, bearings, distance, phase)

    def posing_by_themselves(
        self, travel: Travel, places: tuple[Floats, Floats]
    ) -> Generator[float, None, ArmMotion]:
        """The arms where the gait never changes, at each moment by itself, in steps: swings as they
        are.
        """
        motion, count = SegmentedMotion(self, travel, places), len(travel.distance)
        motion.segments.append(SegmentMotion(ArmMotion.at_rest(count, self.bones)))
        for _ in motion.posing(0, np.arange(count), slice(0, count), None, cyclic=False):
            yield 0.5
        return motion.segments[0].arms

    def compute(
        self,
        travel: Travel,
        places: tuple[Floats, Floats],
        step: int,
        frames_per_metre: float,
        *,
        cyclic: bool,
    ) -> Generator[float, None, SegmentedMotion]:
        """Work the arms out, so many moments at a step, yielding the share that is done.

        The body travels through centres (moments, 3) and orientations (moments, 4). Cyclic, the
        last moment is the first again.
        """
        motion = SegmentedMotion(self, travel, places)
        for segment in range(self.count):
            part = np.flatnonzero(self.within(segment, travel.distance))
            gait = self.gaits[self.gait_of(segment)]
            smoothing = SwingSmoothing.over(
                gait.poser.settings.smoothing_cycles, frames_per_metre * gait.travel.stride
            )
            made = SegmentMotion(ArmMotion.at_rest(len(travel.distance), self.bones))
            motion.segments.append(made)
            for start in range(0, len(part), step):
                chosen = slice(start, min(start + step, len(part)))
                done = 0.9 * (segment + start / max(len(part), 1)) / self.count
                for _ in motion.posing(segment, part, chosen, smoothing, cyclic=cyclic):
                    yield done
            for _ in motion.calming(segment, np.arange(len(travel.distance)), made.arms):
                yield 0.9 * (segment + 1) / self.count
        return motion


@dataclass(frozen=True, eq=False)
class SegmentedMotion:
    """The arms on all segments of a motion."""

    plan: Segments
    travel: Travel
    """The body's, at all moments."""
    places: tuple[Floats, Floats]
    """Centres (moments, 3) and orientations (moments, 4) of the body."""
    segments: list[SegmentMotion] = field(default_factory=list[SegmentMotion])

    @cached_property
    def arms(self) -> ArmMotion:
        """The arms, on whichever segment they are."""
        return self._joined([each.arms for each in self.segments])

    @property
    def joints(self) -> list[Floats] | None:
        """Of each arm (moments, joints, 3), world; none where that is not known."""
        (first, *more) = self.segments
        if more or not first.joints:
            return None
        return [np.concatenate(each) for each in zip(*first.joints, strict=True)]

    def posing(
        self,
        segment: int,
        moments: np.ndarray,
        part: slice,
        smoothing: SwingSmoothing | None,
        *,
        cyclic: bool,
    ) -> Generator[None, None, None]:
        """Pose the arms at a part of the moments (n,) of a segment, in steps.

        Swings are evened out over time, or not. Cyclic, the last moment is the first again.
        """
        plan, made, chosen = self.plan, self.segments[segment], moments[part]
        number = plan.gait_of(segment)
        walk, arms = plan.walks[number], made.arms
        if walk is None:
            travel = self._travel(number, chosen)
            posed = plan.gaits[number].poser.pose(travel.phase, travel.turn)
            arms.rotations[chosen] = posed.rotations
            arms.misses[chosen] = posed.misses.max(axis=2)
            yield
            return
        around, own = frames_around(
            part, smoothing.reach if smoothing else 0, len(moments), cyclic=cyclic
        )
        wide = moments[around]
        travel = self._travel(number, wide)
        where = self.places[0][wide], self.places[1][wide]
        wider = yield from walk.posing(travel.phase, travel.turn, *where, smoothing=smoothing)
        stood = wider.part(own)
        arms.rotations[chosen], arms.strains[chosen] = stood.rotations, stood.strains
        arms.late[chosen] = stood.misses
        arms.cycles[chosen] = stood.cycles + _APART * number
        for arm, rests in zip(arms.in_contact, walk.by_arm(stood.in_contact), strict=True):
            arm[chosen] = rests
        if not made.evened:
            count = len(arms.late)
            made.evened.extend(
                np.zeros((*each.shape[:2], count, each.shape[3])) for each in stood.evened
            )
        for whole, each in zip(made.evened, stood.evened, strict=True):
            whole[:, :, chosen] = each
        if plan.transitions is None:
            made.keep(stood, walk)

    def _travel(self, number: int, chosen: np.ndarray) -> Travel:
        """The body at some moments as one of the gaits has it."""
        if self.plan.transitions is None:
            return self.travel.at(chosen)
        return self.plan.travel_of(number, self.travel.distance[chosen])

    def calming(
        self, segment: int, moments: np.ndarray, arms: ArmMotion, lift: Floats | None = None
    ) -> Generator[None, None, None]:
        """Let arms that are about to go over, or have just done so, come to rest in their gait, in
        place and in steps.

        The body turns meanwhile as no walking body does: what an arm on the ground would make of
        that is wild. So an arm goes over from the pose in which it let go. With a lift (n, arms) in
        arm lengths, arms are to be so much higher and nothing happens to the others; else they are
        as high as they have to be.
        """
        plan, number = self.plan, self.plan.gait_of(segment)
        walk = plan.walks[number]
        if walk is None or plan.transitions is None:
            return
        for change, leaving in ((segment, True), (segment - 1, False)):
            if not 0 <= change < len(plan.changes):
                continue
            asked, here, higher = self._stops(change, moments, lift, leaving=leaving)
            if not len(here):
                continue
            raised = None
            if lift is not None:
                raised = Raise(np.zeros((len(here), len(plan.bones))))
                for arm, _, _, part in asked:
                    raised.lift[part, arm] = higher[part]
            travel = plan.travel_of(number, here)
            places = plan.transitions.course.at(here)
            stood = yield from walk.posing(travel.phase, travel.turn, *places, raised)
            for arm, chosen, again, part in asked:
                bones = plan.bones_of[arm]
                arms.rotations[chosen, bones] = stood.rotations[part, bones][again]
                arms.strains[chosen, bones] = stood.strains[part, bones][again]
                arms.late[chosen, arm] = 0.0

    def _stops(
        self, change: int, moments: np.ndarray, lift: Floats | None, *, leaving: bool
    ) -> tuple[list[tuple[int, np.ndarray, np.ndarray, slice]], Floats, Floats]:
        """Where arms that go over at a change come to rest: for each arm, which of all moments it
        does so at, which of its own stops that is, and where these are among all; the distances of
        all stops, and how much higher they are.
        """
        transitions = self.plan.transitions
        assert transitions is not None
        window, distance = transitions.windows[change], self.travel.distance
        within = _CALM * (transitions.changes[change].end - transitions.changes[change].start)
        asked: list[tuple[int, np.ndarray, np.ndarray, slice]] = []
        stops: list[Floats] = []
        for arm in range(len(self.plan.bones)):
            start, end = window.start[arm], window.end[arm]
            inside = (distance[moments] > start) & (distance[moments] < end)
            if lift is not None:
                inside &= lift[:, arm] > 0.0
            own = np.flatnonzero(inside)
            higher = np.zeros(len(own)) if lift is None else lift[own, arm]
            here = distance[moments[own]]
            if leaving:
                here = start + slowing(here - start, within)
            else:
                here = end - slowing(end - here, within)
            # At rest it is in the same pose from moment to moment.
            both = np.stack([here, higher], axis=1)
            single, again = np.unique(both, axis=0, return_inverse=True)
            count = sum(len(each) for each in stops)
            stops.append(single)
            part = slice(count, count + len(single))
            asked.append((arm, moments[own], again.reshape(-1), part))
        here, higher = np.concatenate(stops).T
        return asked, here, higher

    def higher(
        self, chosen: np.ndarray, lift: Floats
    ) -> Generator[None, None, tuple[ArmMotion, list[Floats] | None]]:
        """Some moments (n,) anew, in steps, with arms that are a lift (n, arms) of arm lengths
        higher than they have to be.

        Of the arms there, those that are not raised count for nothing where the gait never changes.
        With them come joints of the raised ones by arm, where they are known.
        """
        if self.plan.transitions is None:
            return (yield from self._higher_on_one(chosen, lift))
        again = [each.arms for each in self.segments]
        for number in range(len(again)):
            again[number] = yield from self._again(number, chosen, lift)
        # All moments, so that bones turn the same way round from one to the next as they did.
        arms = self._joined(again)
        return arms.at(chosen), None

    def _higher_on_one(
        self, chosen: np.ndarray, lift: Floats
    ) -> Generator[None, None, tuple[ArmMotion, list[Floats] | None]]:
        (made,), (walk,) = self.segments, self.plan.walks
        assert walk is not None
        evened = tuple(each[:, :, chosen] for each in made.evened)
        raised = Raise(lift, made.shapes_at(chosen), evened)
        travel, places = self.travel.at(chosen), (self.places[0][chosen], self.places[1][chosen])
        stood = yield from walk.posing(travel.phase, travel.turn, *places, raised)
        arms = made.arms.at(chosen)
        arms.rotations, arms.strains = stood.rotations, stood.strains
        arms.late[:, raised.arms] = stood.misses[:, raised.arms]
        return arms, walk.by_arm(stood.joints, raised)

    def _again(
        self, segment: int, chosen: np.ndarray, lift: Floats
    ) -> Generator[None, None, ArmMotion]:
        """The arms on one segment, higher at some moments."""
        plan, distance, before = self.plan, self.travel.distance, self.segments[segment]
        number = plan.gait_of(segment)
        walk, inside = plan.walks[number], plan.within(segment, distance[chosen])
        if walk is None or not np.any(lift[inside]):
            return before.arms
        arms, moments = before.arms.copy(), chosen[inside]
        raised = Raise(lift[inside], evened=tuple(each[:, :, moments] for each in before.evened))
        travel = plan.travel_of(number, distance[moments])
        places = self.places[0][moments], self.places[1][moments]
        stood = yield from walk.posing(travel.phase, travel.turn, *places, raised)
        for arm in raised.arms:
            bones, higher = plan.bones_of[arm], raised.lift[:, arm] > 0.0
            own = moments[higher]
            arms.rotations[own, bones] = stood.rotations[higher, bones]
            arms.strains[own, bones] = stood.strains[higher, bones]
            arms.late[own, arm] = stood.misses[higher, arm]
        yield from self.calming(segment, chosen, arms, lift)
        return arms

    def _joined(self, segments: Sequence[ArmMotion]) -> ArmMotion:
        """The whole motion of the arms on each of its segments."""
        result = segments[0]
        for change, segment in enumerate(segments[1:]):
            shares = self.plan.shares(change, self.travel.distance)
            result = _over(result, segment, shares, self.plan.bones)
        return result


def _over(first: ArmMotion, second: ArmMotion, shares: Floats, bones: Sequence[int]) -> ArmMotion:
    """Arms that go over from one segment to the next by shares (moments, arms)."""
    per_bone = np.repeat(shares, bones, axis=1)
    over, going = per_bone > 0.0, (per_bone > 0.0) & (per_bone < 1.0)
    rotations = np.where(over[..., None], second.rotations, first.rotations)
    part = np.flatnonzero(np.any(going, axis=1))
    if len(part):
        inside = slice(int(part[0]), int(part[-1]) + 1)
        turned = blend_motions(first.rotations[inside], second.rotations[inside], per_bone[inside])
        rotations[inside] = np.where(going[inside][..., None], turned, rotations[inside])
    # On the way from one to the other an arm has no place of its own to be at.
    late, misses = (
        np.where(shares >= 1.0, there, np.where(shares <= 0.0, here, 0.0))
        for here, there in ((first.late, second.late), (first.misses, second.misses))
    )
    return ArmMotion(
        rotations,
        first.strains + per_bone * (second.strains - first.strains),
        late,
        misses,
        [
            np.where(share >= 1.0, there, here & (share <= 0.0))
            for share, here, there in zip(
                shares.T[..., None], first.in_contact, second.in_contact, strict=True
            )
        ],
        np.where(shares > 0.0, second.cycles, first.cycles),
    )
