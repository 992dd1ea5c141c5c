# SPDX-License-Identifier: GPL-3.0-or-later
"""From what was read to what is to be computed: gaits on this rig, the way, when, and footholds."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final, TypeVar

import numpy as np

from ...content_cache import ContentCache, content_key
from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import Floats, multiply, normalized, rotate
from ...skeleton import Skeleton
from ...steps import finished
from ..body import BodyTrack, Holds, SelfMotion, Stalking, Surge, self_motion, steps_of, surge
from ..gait import (
    CYCLE,
    Arm,
    GaitPoser,
    GaitSettings,
    RoughGaitPoser,
    roughly,
    target_places,
)
from ..ground import (
    Carpet,
    ContactOverride,
    GroundedWalk,
    GroundMesh,
    HeightField,
    Unrolled,
    roll_out,
)
from ..path import (
    Course,
    GaitTransition,
    Line,
    Route,
    SlowedRoute,
    SwumLine,
    TravelSettings,
    WalkedLine,
    bearings_of,
    check_transitions,
    distances_at,
    duration,
    paced_time,
    plan_travel,
    rounding,
    route_in_place,
    slowed_in_bends,
    strides,
    transition_windows,
    transitions_by_height,
    travel_at,
    travel_in_place,
    unhurried,
    whole_frames,
)
from ..rig import (
    ArmFrames,
    ArmRing,
    BodyFrame,
    arm_azimuths,
    frames_of_arm,
    joint_positions,
    lies_back,
    object_transforms,
    stretch_mantle,
)
from .carrying import Carry, Laid, laid_on
from .job import (
    BodyJob,
    ChangesByHeight,
    Creature,
    GaitJob,
    MotionJob,
    ShownContact,
    Timing,
    Tolerances,
)
from .seabed import Seabed, seabed_below
from .segments import Gait, Nearby, Segments, Standing, Transitions, standing_on

_posers: Final[ContentCache[GaitPoser]] = ContentCache(12)

_unrolled_known: Final[ContentCache[tuple[Unrolled, Floats, np.ndarray] | None]] = ContentCache(2)
_frames_known: Final[ContentCache[list[ArmFrames]]] = ContentCache(4)
_rings_known: Final[ContentCache[ArmRing | None]] = ContentCache(4)


def frames_of_arms(skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame) -> list[ArmFrames]:
    """What leads from bones of each arm to its joints."""
    bones = [arm.bones for arm in arms]
    return _frames_known.get(
        content_key(skeleton, bones, body),
        lambda: [frames_of_arm(skeleton, each, body) for each in bones],
    )


def ring_of_arms(skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame) -> ArmRing | None:
    """The arms that stand side by side round the body; none where none do."""
    bones = [arm.bones for arm in arms]
    return _rings_known.get(
        content_key(skeleton, bones, body),
        lambda: ArmRing.of(
            frames_of_arms(skeleton, arms, body), arm_azimuths(skeleton, bones, body)
        ),
    )


# --- Whether a gait has frames enough to be seen, and what to change if not -----------------------


_HURRIED: Final = 40.0
"""Frames of a cycle below which keys that lead on from frame to frame by themselves would let arms
slide and dip in between."""
_SWING: Final = 5.0
"""Frames that an arm needs at least to let go, swing and lie down: with fewer it jumps."""


@dataclass(frozen=True)
class Pace:
    """How many frames a cycle of the gait has."""

    mean: float
    """Over all of the motion."""
    fastest: float
    """Where the body goes at full speed."""

    @property
    def hurried(self) -> bool:
        """Whether what is between frames is to be looked at, too."""
        return self.mean < _HURRIED


def pace_of(route: Route, travel: TravelSettings, frames: float) -> Pace:
    """The pace of a journey that takes so many frames, which need not be whole."""
    mean = frames / max(strides(route, travel), 1e-9)
    # While it eases in and out, the body is slower than in between.
    paced = paced_time(route, travel)
    fastest = 1.0 if paced is None else paced.fastest
    return Pace(mean, mean * route.length / duration(route, travel, 1.0) / fastest)


def too_few_frames(timing: Timing, pace: Pace) -> list[str]:
    """What there is to say of arms that have no frames to swing in, with what would do."""
    swing = (1.0 - timing.duty) * pace.fastest
    if swing >= _SWING:
        return []
    longer = _SWING / swing
    if timing.kind == "RANGE":
        length = (timing.end - timing.start) * longer
        end = timing.start + math.ceil(length - 1e-6)
        remedy = phrase("Let it end at frame {end:,} or later", end=end)
    elif timing.kind == "SPEED":
        slowest = math.floor(1e3 * timing.speed / longer) / 1e3
        remedy = phrase("Lower Speed to {slowest:g} m/s", slowest=slowest)
    else:
        cycle = math.ceil(1e2 * timing.cycle_time * longer) / 1e2
        remedy = phrase("Raise Cycle to {cycle:g} s", cycle=cycle)
    had = math.floor(10.0 * swing) / 10.0
    return [
        (
            phrase(
                "At full speed an arm has {frames:g} frames for a swing and jumps from pose to "
                "pose: {cycle:.2g} s a cycle are too short. {remedy}, or give the gait a longer "
                "stride.",
                frames=had,
                cycle=pace.fastest / timing.rate,
                remedy=remedy,
            )
        )
    ]


# --- The plan -------------------------------------------------------------------------------------


MOST_FRAMES: Final = 100_000
"""A journey of more is a slip of the hand: over an hour at 24 frames a second."""
LAST_FRAME: Final = 1_048_574
"""The last frame that Blender knows; the first is as far below zero."""

_ROUTE_SAMPLES: Final = 257
_QUICKLY: Final = 12_000
"""Bones times frames up to which it is soon done to look between frames, too."""
_SAMPLES: Final = 40
"""Places per arm length at which a route's height over the ground is looked at."""
_ROOM: Final = 0.5
"""Arm lengths that a body swims higher than it walks at least: room for its arms …"""
_SETTLING: Final = 0.1
"""… and within which it comes down to that."""


@dataclass(frozen=True, eq=False)
class Schedule:
    """Where a motion goes, and when."""

    route: Route
    travel: TravelSettings
    frames: Floats
    """(frames,) whole numbers."""
    times: Floats
    """(frames,) share of the journey's time: 0…1, and more while the body settles after it."""
    seconds: float
    head: tuple[str, ...]
    """Bones of the mantle, root to tip."""
    lean: float
    """Radians from the body's +Z back to the way along which it swims as it lies."""


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """A motion, ready to be computed."""

    job: MotionJob
    segments: Segments
    schedule: Schedule
    pace: Pace
    mantle: tuple[str, ...]
    """Bones that are stretched out, none in a walk."""
    mantle_rotations: Floats
    """(bones, 4) how, the same at every frame."""
    self_motion: SelfMotion | None
    """What the body does by itself, none for nothing."""
    surge: Surge | None
    """How far the body is from its place, as its arms push it; none for nowhere."""
    stalking: Stalking | None
    """What it does as it stops on its way; none where it never stops."""
    warnings: tuple[str, ...]
    carry: Carry | None = None
    """What takes the motion from the plan to the world; none where they are the same."""
    laid: Laid | None = None
    """Onto what a body that rests in place is laid; none where it stays on level ground."""

    @property
    def first(self) -> Gait:
        """The gait that the motion begins with."""
        return self.segments.gaits[0]

    @property
    def standing(self) -> list[Standing]:
        """What holds the ground, of every gait that does."""
        return [gait.standing for gait in self.segments.gaits if gait.standing is not None]

    @property
    def below(self) -> Standing | Seabed | None:
        """What arms are kept off, with what they need of room; none where there is no ground."""
        return self.standing[0] if self.standing else self.segments.seabed

    @property
    def can_show_contacts(self) -> bool:
        """Whether there are contacts with the ground, at places that stay."""
        return self.first.standing is not None and not self.job.in_place

    @property
    def keeps_contacts(self) -> bool:
        """Whether what the artist wants of contacts is kept as soon as the motion is made: where
        the gait changes, that is done only when contacts are shown.
        """
        return self.can_show_contacts and self.segments.transitions is None

    @property
    def height(self) -> float:
        """Metres from the route to the body's centre."""
        standing = self.first.standing
        return float(standing.line.clearances[0]) if standing is not None else self.first.height

    @property
    def wants_subframes(self) -> bool:
        """Whether a cycle has so few frames that its keys have to keep to what is half way between
        them, too. What is reached for is known on frames alone.
        """
        if not (self.standing or self.segments.transitions) or self.job.reaching is not None:
            return False
        return self.pace.hurried

    @cached_property
    def subframe_sampled(self) -> bool:
        """Whether the motion is worked out half way between frames, too."""
        affordable = len(self.schedule.frames) * len(self.first.poser.bones) <= _QUICKLY
        return self.wants_subframes and (affordable or not self.job.live)

    @property
    def stride(self) -> int:
        """At every how many moments that are worked out there is a frame."""
        return 2 if self.subframe_sampled else 1

    @cached_property
    def moments(self) -> tuple[Floats, Floats]:
        """Frames and times (moments,) at which the motion is worked out."""
        halves = with_half_frames if self.subframe_sampled else np.asarray
        return halves(self.schedule.frames), halves(self.schedule.times)

    def moment_of(self, frame: float) -> int:
        """Number of the moment that is nearest to a frame; of a loop, in the round that it has
        moments of.
        """
        frames = self.moments[0]
        if self.job.repeats:
            frame = frames[0] + (frame - frames[0]) % (frames[-1] - frames[0])
        return int(np.abs(frames - frame).argmin())

    @property
    def tolerances(self) -> Tolerances | None:
        """How far few keys may be off, in the armature's units; none for a key on every frame."""
        asked, length = self.job.tolerances, self.first.poser.arm_length
        if asked is None or self.job.live:
            return None
        return replace(asked, distance=asked.distance * length, held=asked.held * length)


def with_half_frames(values: Floats) -> Floats:
    """Values (frames,) with those half way in between (2 frames − 1,)."""
    result = np.empty(2 * len(values) - 1)
    result[::2], result[1::2] = values, 0.5 * (values[:-1] + values[1:])
    return result


def in_bends(job: MotionJob) -> MotionJob:
    """The same motion, slower in bends that are too tight for arms that hold on: so it is planned,
    and so it is asked for when what it takes is read.
    """
    planned, _, _ = finished(_planning(job))
    if job.route is None or not isinstance(planned.route, SlowedRoute):
        return job
    return replace(job, route=planned.route.of_curve(job.route.bare))


@lru_cache(maxsize=2)
def slowed_route(job: MotionJob) -> Route | None:
    """The route of a motion in its plan, on which it is slower in tight bends."""
    walks = [each.travel for each in job.gaits if each.settings.gait.on_ground]
    turning = [each for each in walks if each.heading == "ALONG" and each.slow_in_bends > 0.0]
    if job.route is None or job.ground is None or not turning:
        return job.route
    travel = max(turning, key=lambda each: each.stride)
    stride = travel.stride * reach_of(job.creature)
    return slowed_in_bends(
        job.route,
        stride=stride,
        corner=rounding(job.route, travel.corner * stride),
        amount=travel.slow_in_bends,
    )


def schedule(job: MotionJob) -> Schedule:
    """Where a motion goes and when, which is soon known: what is reached for is read on its frames.

    Raises:
        SettingsError: the motion has no frames, or too many; a loop has no cycle.
    """
    creature, first = job.creature, job.gaits[0]
    head = job.body.organs.mantle
    lean = job.streamline * lies_back(creature.skeleton, head, creature.body)
    travel = _travel(job, first, lean)
    route = job.route or route_in_place(travel.stride, job.cycles)
    if first.settings.gait.on_ground and job.ground is not None and any(job.ground.rest):
        within = job.ground.rest_within * travel.stride * np.array(job.ground.rest)
        if (paced := paced_time(route, travel)) is not None:
            # As far as it would come meanwhile if it had the same pace everywhere.
            shares = np.minimum(within / route.length, 1.0)
            within = route.length * np.abs(paced.times(np.abs([0.0, 1.0] - shares)) - [0.0, 1.0])
        travel = unhurried(travel, route.length, start=within[0], end=within[1])
    seconds, frames, times = _timing(job, route, travel)
    return Schedule(route, travel, frames, times, seconds, head, lean)


_Outcome = TypeVar("_Outcome")


def scaled(
    steps: Generator[float | None, None, _Outcome], start: float, end: float
) -> Generator[float, None, _Outcome]:
    """Steps that are a part of the whole work, from one share of it to another, or that do not say
    how far they are.
    """
    while True:
        try:
            share = next(steps)
        except StopIteration as last:
            return last.value
        yield start + (end - start) * (share or 0.0)


def plan_motion(job: MotionJob) -> Generator[float, None, MotionPlan]:
    """Plan a motion, in steps that yield the share that is done.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    job, carry, faces = yield from scaled(_planning(job), 0.0, 0.0)
    yield 0.0
    when = schedule(job)
    route, lean = when.route, when.lean
    plane = _lowest(route) if isinstance(job.changes, ChangesByHeight) else None
    changes = bool(job.changes) and not job.in_place
    gaits: list[Gait] = []
    for number, each in enumerate(job.gaits if changes else job.gaits[:1]):
        poser = _poser(job, each, lean)
        share = 0.5 * (number + 0.2) / len(job.gaits)
        yield from scaled(poser.preparing(), share, share)
        making = _making_gait(job, each, poser, route, lean=lean, plane=plane)
        end = 0.5 * (number + 1.0) / len(job.gaits)
        gaits.append((yield from scaled(making, share, end)))
        yield end
    overrides = job.ground.overrides if job.ground is not None else ()
    standing = gaits[0].standing
    if changes:
        # The pace is the same for all gaits: a stroke's burst is the swimming gait's own.
        when = replace(when, travel=replace(when.travel, burst=0.0))
        segments = yield from _with_transitions(job, gaits, route, overrides)
    else:
        # Contacts are places in the world; in place the ground goes by.
        asked = () if job.in_place else overrides
        walk = (yield from scaled(standing.walking(asked), 0.6, 0.6)) if standing else None
        segments = Segments(gaits, [walk], None, [len(each) for each in job.creature.bones], route)
    yield 0.8
    segments = _over_seabed(job, segments, when.head)
    pace = pace_of(route, when.travel, when.seconds * job.timing.rate)
    warnings = [*job.warnings, *(standing.warnings if standing is not None else ())]
    warnings += too_few_frames(job.timing, pace) if standing is not None or changes else ()
    swims = any(not gait.table.on_ground for gait in gaits)
    # A mantle that lies flat is swum along as it is.
    mantle = when.head if swims and job.streamline > 0.0 and not lean else ()
    creature, pushed = job.creature, _surge(job, segments, route)
    stalking = _stalking(job, when, segments)
    yield 0.9
    moving = _self_moving(job, when, segments, pushed, stalking, stretched=len(mantle) > 0)
    self_motion = yield from scaled(moving, 0.9, 0.95)
    yield 0.95
    return MotionPlan(
        job=job,
        segments=segments,
        schedule=when,
        pace=pace,
        mantle=mantle,
        mantle_rotations=stretch_mantle(creature.skeleton, mantle, creature.body, job.streamline),
        self_motion=self_motion,
        surge=pushed,
        stalking=stalking,
        warnings=tuple(warnings),
        carry=_along(job, carry, faces, standing),
        laid=laid_on(job, standing, reach_of(creature)) if job.in_place else None,
    )


def _over_seabed(job: MotionJob, segments: Segments, head: tuple[str, ...]) -> Segments:
    """The same over the ground below it, where the body swims all the way with its head, the bones
    from root to tip, before it.
    """
    swims = not any(gait.table.on_ground for gait in segments.gaits)
    if job.floor is None or job.in_place or not swims:
        return segments
    route, travel = segments.route, segments.gaits[0].travel

    def centres(distance: Floats) -> Floats:
        phase, bearings = np.zeros_like(distance), bearings_of(route, travel)
        return segments.places(travel_at(route, travel, bearings, distance, phase))[0]

    creature, joints = job.creature, np.zeros((1, 3))
    if head:
        joints = creature.body.to_body(joint_positions(creature.skeleton, head))
    along = float(np.linalg.norm(np.diff(joints, axis=0, prepend=0.0), axis=1).sum())
    sizes = {"reach": reach_of(creature), "ahead": creature.scale * along}
    return replace(segments, seabed=seabed_below(job.floor, route, centres, **sizes))


def _lowest(route: Route) -> float:
    """World Z of the lowest place of a route."""
    return float(route.position(np.linspace(0.0, 1.0, _ROUTE_SAMPLES))[:, 2].min())


def plan_near(
    job: MotionJob, known: MotionPlan, first: float, last: float, *, anew: bool = False
) -> Generator[float, None, tuple[MotionPlan, slice]]:
    """A rough plan for a motion from one frame to another, in steps, from that of a motion that is
    nearly the same; with it come the numbers of the moments there.

    Both have one gait all the way. What has little to do with where the arms are is taken over.
    What moves the arms is made anew if it is not known, or in any case.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    job = replace(job, route=slowed_route(job))
    when, gait, before = schedule(job), job.gaits[0], known.first.standing
    plan = replace(known, job=job, schedule=when)
    moments, near = slice(plan.moment_of(first), plan.moment_of(last) + 1), None
    if before is not None:
        distance = distances_at(when.route, when.travel, plan.moments[1][moments])
        near = Nearby(before, float(distance[0]), float(distance[-1]))
    poser = _rough_poser(job, when.lean, anew=anew)
    yield 0.3
    if isinstance(poser, RoughGaitPoser):
        rough = _rough_poser(known.job, known.schedule.lean, anew=True)
        poser = poser.corrected(rough, known.first.poser)
        yield 0.5
    moving = yield from _making_gait(
        job, gait, poser, when.route, lean=when.lean, plane=None, near=near
    )
    yield 0.7
    walk, standing = None, moving.standing
    if standing is not None:
        asked = job.ground.overrides if job.ground is not None and not job.in_place else ()
        walk = standing.walk(standing.line, asked)
    bones = [len(each) for each in job.creature.bones]
    segments = Segments([moving], [walk], None, bones, when.route)
    segments = _over_seabed(job, segments, when.head)
    yield 1.0
    return replace(plan, segments=segments), moments


def _along(
    job: MotionJob, carry: Carry | None, source: np.ndarray | None, standing: Standing | None
) -> Carry | None:
    """What carries the motion, its ground's own motion too."""
    ground = job.ground
    if ground is None or ground.moving is None or ground.mesh is None or standing is None:
        return carry
    if not isinstance(standing.ground, HeightField):
        return carry
    faces = ground.mesh.triangles
    source = np.arange(len(faces)) if source is None else source
    carpet = Carpet.of(ground.moving, standing.ground, faces, source)
    reach = reach_of(job.creature)
    unrolled = carry.unrolled if carry is not None else None
    return Carry(unrolled, reach, standing.line.route, carpet)


def _planning(
    job: MotionJob,
) -> Generator[None, None, tuple[MotionJob, Carry | None, np.ndarray | None]]:
    """The same motion in its plan, slower in tight bends. In steps; see :func:`_rolling_out`."""
    job, carry, source = yield from _rolling_out(job)
    job = replace(job, route=slowed_route(job))
    if carry is not None and job.route is not None:
        carry = replace(carry, route=job.route)
    return job, carry, source


def _rolling_out(
    job: MotionJob,
) -> Generator[None, None, tuple[MotionJob, Carry | None, np.ndarray | None]]:
    """The same motion on its ground rolled out, where that has an up of its own; then which of its
    faces each one of the plan is from. In steps.
    """
    ground, route = job.ground, job.route
    if ground is None or ground.mesh is None or route is None or ground.stance.up == "WORLD":
        return job, None, None
    mesh = ground.mesh
    reach, always = reach_of(job.creature), ground.stance.up == "GROUND"
    beyond = max(each.travel.stride for each in job.gaits) * reach + reach
    sizes = reach, beyond, always
    yield
    # To read them takes as long as to look at them.
    _ = mesh.triangles
    yield

    def made() -> tuple[Unrolled, Floats, np.ndarray] | None:
        space = roll_out(route, mesh.triangles, reach=reach, beyond=beyond, always=always)
        return None if space is None else (space, *space.faces(mesh.triangles))

    key = content_key(mesh.content, route.controls, route.breaks, route.cyclic, *sizes)
    if (found := _unrolled_known.get(key, made)) is None:
        return job, None, None
    space, faces, source = found
    overrides = tuple(_in_plan(each, space) for each in ground.overrides)
    ground = replace(ground, mesh=GroundMesh(key, lambda: faces), overrides=overrides)
    flat = space.route(route)
    return replace(job, route=flat, ground=ground), Carry(space, reach, flat), source


def _in_plan(override: ContactOverride, space: Unrolled) -> ContactOverride:
    """What the artist wants of a foothold, in the plan."""
    if override.position is None:
        return override
    apart = np.linalg.norm(space.world - override.position, axis=1)
    along = np.array([space.start + space.spacing * float(apart.argmin())])
    return replace(override, position=space.to_plan(override.position[None], along)[0][0])


@dataclass(frozen=True, eq=False)
class GaitTargets:
    """Where the gait that a motion begins with has its pseudo-targets, whatever the ground is."""

    frames: Floats
    """(frames,)"""
    places: Floats
    """(frames, arms, 4, 3) Q₀ … Q₃, armature space, of a body that stands as it does at rest."""
    groups: tuple[tuple[tuple[str, ...], ...], ...]
    """Of each arm the bones of its three groups, root to tip."""

    def at(self, frame: float, arm: int) -> Floats:
        """Those of an arm at a frame (4, 3): before and after the motion as at its ends."""
        places = self.places[:, arm].reshape(len(self.frames), -1)
        return np.array([np.interp(frame, self.frames, each) for each in places.T]).reshape(-1, 3)


def gait_targets(job: MotionJob) -> GaitTargets:
    """The pseudo-targets of a motion, which is not computed for that.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    when = schedule(in_bends(job))
    poser, body = _poser(job, job.gaits[0], when.lean), job.creature.body
    travel = plan_travel(when.route, when.travel, when.times)
    places = body.center + target_places(poser, travel.phase, travel.turn) @ body.rotation.T
    sizes = {arm: build.chain.sizes for build in poser.builds for arm in build.arms}
    groups = tuple(
        tuple(arm.bones[end - size : end] for end, size in zip(np.cumsum(own), own, strict=True))
        for arm, own in ((arm, sizes[number]) for number, arm in enumerate(poser.arms))
    )
    return GaitTargets(when.frames, places, groups)


@lru_cache(maxsize=2)
def reach_of(creature: Creature) -> float:
    """Mean length of the arms, metres: what strides are counted in."""
    joints = [
        creature.body.to_body(joint_positions(creature.skeleton, each)) for each in creature.bones
    ]
    lengths = [float(np.linalg.norm(np.diff(each, axis=0), axis=1).sum()) for each in joints]
    return float(np.array(lengths).mean()) * creature.scale


def _poser(job: MotionJob, gait: GaitJob, lean: float) -> GaitPoser:
    """What moves the arms in a gait, the same as before while nothing of it has changed."""
    moved = _moved_by(job, gait, lean)
    return _posers.get(content_key(*moved), lambda: GaitPoser(*moved))


def _rough_poser(job: MotionJob, lean: float, *, anew: bool) -> GaitPoser:
    """What moves the arms roughly in a motion's gait: the same as before, or soon made anew."""
    moved, key = _moved_by(job, job.gaits[0], lean), _key_of_gait(job, lean)
    if (known := _posers.known(key)) is not None and not anew:
        return roughly(known)
    return _posers.get(key + b"rough", lambda: RoughGaitPoser(*moved))


@lru_cache(maxsize=4)
def _key_of_gait(job: MotionJob, lean: float) -> bytes:
    """A key of what moves the arms in the gait that a motion begins with."""
    return content_key(*_moved_by(job, job.gaits[0], lean))


def _moved_by(
    job: MotionJob, gait: GaitJob, lean: float
) -> tuple[Skeleton, tuple[Arm, ...], BodyFrame, GaitSettings]:
    settings = replace(gait.settings, swim_lean=0.0 if gait.settings.gait.on_ground else lean)
    return job.creature.skeleton, job.creature.arms, job.creature.body, settings


def _travel(job: MotionJob, gait: GaitJob, lean: float) -> TravelSettings:
    """How the body travels in a gait."""
    reach = reach_of(job.creature)
    travel = replace(
        gait.travel,
        stride=gait.travel.stride * reach,
        along=gait.travel.along.scaled(reach),
        lean=0.0 if gait.settings.gait.on_ground else lean,
    )
    return travel_in_place(travel) if job.in_place else travel


def _making_gait(
    job: MotionJob,
    gait: GaitJob,
    poser: GaitPoser,
    route: Route,
    *,
    lean: float,
    plane: float | None,
    near: Nearby | None = None,
) -> Generator[float, None, Gait]:
    """One way of moving along this route, all of it or near one place, in steps."""
    table, travel, standing = gait.settings.gait, _travel(job, gait, lean), None
    if table.on_ground and job.ground is not None:
        standing = yield from standing_on(
            job.creature,
            poser,
            job.ground,
            route,
            travel,
            height=job.height,
            plane=plane,
            cyclic=job.in_place,
            near=near,
        )
    height = job.height
    if height is None:
        height = poser.clearance * job.creature.scale if table.on_ground else 0.0
    return Gait(table, poser, travel, standing, height)


def _timing(job: MotionJob, route: Route, travel: TravelSettings) -> tuple[float, Floats, Floats]:
    """Seconds that the journey takes, its frames, and the share of its time at each."""
    timing = job.timing
    start, rate = timing.start, timing.rate
    if timing.kind == "RANGE":
        length = timing.end - start
        if length < 1:
            raise SettingsError(
                phrase(
                    "The motion ends at frame {end} and starts at {start}.",
                    end=timing.end,
                    start=start,
                ),
                "Let it end after its start.",
            )
        exact = float(length)
    elif timing.kind == "SPEED":
        exact = duration(route, travel, timing.speed) * rate
    else:
        # At full speed a cycle takes the cycle time; so many cycles make the route.
        cycles = strides(route, travel)
        cruising = route.length / (cycles * timing.cycle_time)
        exact = duration(route, travel, cruising) * rate
    if job.in_place:
        exact = whole_frames(exact)
    if exact > MOST_FRAMES:
        raise SettingsError(
            phrase(
                "The motion would take {exact:,.0f} frames, more than {most_frames:,}.",
                exact=exact,
                most_frames=MOST_FRAMES,
            ),
            "Shorten the route, or make the body faster.",
        )
    # The motion is the same at any frame rate: it ends when it ends, and the frame after that
    # holds the end. A length that is whole but for rounding does not need that frame.
    settling = 0.0 if job.in_place or job.end is not None else job.body.settings.settle * rate
    count = max(math.ceil(exact + settling - 1e-4), 1) + 1
    if start < -LAST_FRAME:
        raise SettingsError(
            phrase(
                "The motion would start at frame {start:,}, before Blender's first.", start=start
            ),
            "Let it start later.",
        )
    if start + count - 1 > LAST_FRAME:
        raise SettingsError(
            phrase(
                "The motion would end at frame {end:,}, after Blender's last.",
                end=start + count - 1,
            ),
            "Let it start earlier.",
        )
    steps = np.arange(count, dtype=np.float64)
    return exact / rate, start + steps, np.minimum(steps, exact + settling) / exact


def _moves_by_itself(body: BodyJob) -> bool:
    """Whether any organ does anything."""
    of = body.settings
    return max(of.mantle, of.siphon, of.eyes, of.head, body.breathing.amount) > 0.0


def _self_moving(
    job: MotionJob,
    when: Schedule,
    segments: Segments,
    pushed: Surge | None,
    stalking: Stalking | None,
    *,
    stretched: bool,
) -> Generator[None, None, SelfMotion | None]:
    """What the body does by itself, at even steps of its time; in steps. A mantle that is stretched
    out is one of the organs.
    """
    if not (stretched or _moves_by_itself(job.body)):
        return None
    creature, first, body = job.creature, segments.gaits[0], job.body
    times = steps_of(when.seconds * float(when.times[-1]))
    bearings = first.standing.bearings if first.standing is not None else None
    travel = plan_travel(when.route, when.travel, times / when.seconds, bearings)
    yield
    places, turns = segments.places(travel)
    if pushed is not None:
        places = places + pushed.at(travel.distance)
    if stalking is not None:
        places, turns = stalking.placed((places, turns), travel.stood)
    swims = segments.swimming(travel.distance)
    if swims is None:
        swims = np.full(len(times), 0.0 if first.table.on_ground else 1.0)
    track = BodyTrack(
        times=times,
        locations=places / (first.poser.arm_length * creature.scale),
        orientations=object_transforms(creature.body, creature.scale, places, turns)[1],
        strokes=segments.strokes(travel),
        swimming=swims,
        cyclic=job.in_place,
        looks=None if stalking is None else stalking.looks(travel.stood),
    )
    return self_motion(
        track,
        body.settings,
        breath=(body.breathing.amount, body.breathing.seconds),
        unlike=body.unlike,
        seed=body.seed,
        eyes=len(body.organs.eyes),
    )


_CROUCHED: Final = 0.05
"""Arm lengths by which a body that stalks crouches at its stops …"""
_ABOVE: Final = 0.5
"""… and of its height over what its skin would touch at most."""


def _stalking(job: MotionJob, when: Schedule, segments: Segments) -> Stalking | None:
    """What the body does as it stops on its way."""
    paced, standing = paced_time(when.route, when.travel), segments.gaits[0].standing
    if paced is None or paced.stops is None or standing is None:
        return None
    room = float(standing.line.clearances.min()) - standing.under
    sinks = min(_CROUCHED * reach_of(job.creature), _ABOVE * max(room, 0.0))
    return Stalking(paced.stops.amount, sinks, job.body.seed)


def _surge(job: MotionJob, segments: Segments, route: Route) -> Surge | None:
    """How far the body is from its place, as the arms push it that hold on to the ground."""
    # What has nothing to travel on stays where it is.
    if job.in_place and not job.creature.root_bone:
        return None
    reach = segments.gaits[0].poser.arm_length * job.creature.scale
    changes = [(-np.inf, 0.0), *((each.start, each.end) for each in segments.changes)]
    ends = [*(each.start for each in segments.changes), np.inf]
    found: list[Floats] = []
    calm = changes[1:]
    line: Line | Course | None = None
    for segment, ((_, first), last) in enumerate(zip(changes, ends, strict=True)):
        number = segments.gait_of(segment)
        walk, gait = segments.walks[number], segments.gaits[number]
        if walk is None or gait.standing is None:
            calm.append((first, min(last, route.length)))
            continue
        line = segments.transitions.course if segments.transitions else gait.standing.line
        unit = gait.travel.stride / CYCLE
        holds = np.array(
            [(unit * each.touch_down, unit * each.lift_off, each.arm) for each in walk.footholds()]
        ).reshape(-1, 3)
        middles = 0.5 * (holds[:, 0] + holds[:, 1])
        found.append(holds if job.in_place else holds[(middles > first) & (middles < last)])
    if line is None or not (holds := np.concatenate(found)).size:
        return None
    return surge(
        _holds_behind(holds, line, segments.gaits[0].poser),
        lambda distance: line.at(distance)[0],
        route.length,
        stride=segments.gaits[0].travel.stride,
        reach=reach,
        amount=job.body.settings.surge,
        calm=np.array(calm).reshape(-1, 2),
        cyclic=job.in_place,
    )


def _holds_behind(holds: Floats, line: Line | Course, poser: GaitPoser) -> Holds:
    """Holds (n, 3) from a distance to a distance, of arms by their numbers, and how far these stand
    behind the body half way, by where they lead out of it.
    """
    start, end, arms = holds.T
    middle, step = 0.5 * (start + end), 0.25 * np.maximum(end - start, 1e-9)
    (before, _), (after, _) = line.at(middle - step), line.at(middle + step)
    outward = poser.outward[arms.astype(int)]
    points = rotate(multiply(line.at(middle)[1], outward), np.array([1.0, 0.0, 0.0]))
    return Holds(start, end, -np.sum(points * normalized(after - before), axis=1))


# --- Where the gait changes ----------------------------------------------------------------------


def _transitions(job: MotionJob, route: Route, first: Gait) -> tuple[GaitTransition, ...]:
    """Where the gait changes.

    Raises:
        SettingsError: two changes overlap, or the route does not change its height.
    """
    reach, changes = first.poser.arm_length * job.creature.scale, job.changes
    if not isinstance(changes, ChangesByHeight):
        found = [
            GaitTransition(
                place - 0.5 * each.length * reach, place + 0.5 * each.length * reach, each.gait
            )
            for each in changes
            for place in (route.distance_of(each.position),)
        ]
        return check_transitions(found, route.length)
    count = int(np.ceil(_SAMPLES * route.length / reach)) + 2
    distance = np.linspace(0.0, route.length, count)
    places = route.position(route.parameter_at(distance))
    floor = np.full(count, places[:, 2].min())
    if first.standing is not None:
        floor = first.standing.ground.height(places[:, :2])
    found = transitions_by_height(
        distance,
        places[:, 2] - floor,
        take_off=changes.height * reach,
        length=changes.length * reach,
    )
    found = [GaitTransition(each.start, each.end, changes.gait * each.way) for each in found]
    # One that is done before the route begins is no place of it.
    done = [each for each in found if each.middle < 0.0]
    return (*done, *check_transitions(found[len(done) :], route.length))


def _with_transitions(
    job: MotionJob, gaits: Sequence[Gait], route: Route, overrides: Sequence[ContactOverride]
) -> Generator[float, None, Segments]:
    """Lay all footholds of a motion, and find when each arm goes over."""
    bones = [len(each) for each in job.creature.bones]
    changes = _transitions(job, route, gaits[0])
    lines = [_line(gait, number, changes, route, gaits) for number, gait in enumerate(gaits)]
    course = Course(lines, changes)
    asked: list[list[ContactOverride]] = [list(overrides), *([] for _ in gaits[1:])]
    walks = _walks(gaits, course, asked)
    yield 0.7
    found = []
    for number, change in enumerate(changes):
        before = changes[number - 1].way if number else 0
        first = changes[number - 1].middle if number else -np.inf
        last = changes[number + 1].middle if number + 1 < len(changes) else np.inf
        over = before, change.way
        holds = [_holds(walks[each], gaits[each], len(bones), first, last) for each in over]
        window = transition_windows(change, *([each[0] for each in arms] for arms in holds))
        dropped = window.dropped_before, window.dropped_after
        for gait, arms, left_out in zip(over, holds, dropped, strict=True):
            for arm, (_, cycles) in enumerate(arms):
                asked[gait].extend(
                    ContactOverride(arm, int(cycle), removed=True)
                    for cycle in cycles[left_out[arm]]
                )
        found.append(window)
    transitions = Transitions(changes, found, course)
    return Segments(gaits, _walks(gaits, course, asked), transitions, bones, route)


def _line(
    gait: Gait, number: int, changes: Sequence[GaitTransition], route: Route, gaits: Sequence[Gait]
) -> Line:
    """The body's way in one of the gaits."""
    if gait.standing is not None:
        return gait.standing.line
    bearings = bearings_of(route, gait.travel)
    if gait.table.on_ground:
        return WalkedLine(route, gait.travel, bearings, gait.height)
    # The stroke that takes it off the ground, or the first one.
    start = next((each.middle for each in changes if each.way == number), 0.0)
    reach = gait.travel.stride / gait.table.stride
    return SwumLine(
        route,
        gait.travel,
        bearings,
        start,
        height=gait.height,
        floor=next((each.standing.line for each in gaits if each.standing is not None), None),
        room=_ROOM * reach,
        softness=_SETTLING * reach,
    )


def _walks(
    gaits: Sequence[Gait], course: Course, overrides: Sequence[Sequence[ContactOverride]]
) -> list[GroundedWalk | None]:
    return [
        gait.standing.walk(course.line(number), overrides[number]) if gait.standing else None
        for number, gait in enumerate(gaits)
    ]


def _holds(
    walk: GroundedWalk | None, gait: Gait, arms: int, first: float, last: float
) -> list[tuple[tuple[Floats, Floats], np.ndarray]]:
    """For each arm, where its stances begin and end between two places, and their cycles."""
    found: list[list[tuple[float, float, int]]] = [[] for _ in range(arms)]
    unit = gait.travel.stride / CYCLE
    for each in walk.footholds() if walk is not None else ():
        on, off = unit * each.touch_down, unit * each.lift_off
        if first < 0.5 * (on + off) <= last:
            found[each.arm].append((on, off, each.cycle))
    result = []
    for holds in found:
        table = np.array(sorted(holds), dtype=np.float64).reshape(len(holds), 3)
        result.append(((table[:, 0], table[:, 1]), table[:, 2].astype(int)))
    return result


def shown_contacts(plan: MotionPlan) -> list[ShownContact]:
    """The contacts with the ground of the gait that a motion begins with, for markers."""
    (walk, *_), standing, when = plan.segments.walks, plan.first.standing, plan.schedule
    assert walk is not None
    assert standing is not None
    if plan.segments.transitions is not None:
        # All of them, as if the gait never changed.
        walk = standing.walk(standing.line, standing.job.overrides)
    travel = plan_travel(when.route, when.travel, when.times, standing.bearings)
    # The first of equal phases, where the body stands still, is as good as any.
    phases, first = np.unique(travel.phase, return_index=True)
    contacts = []
    for each in walk.footholds():
        place = each.position
        if plan.carry is not None:
            come = np.array(0.5 * (each.touch_down + each.lift_off) * when.travel.stride / CYCLE)
            place, _ = plan.carry.places(place, come)
        on, off = np.interp([each.touch_down, each.lift_off], phases, when.frames[first])
        contacts.append(
            ShownContact(
                plan.job.creature.arms[each.arm].name,
                each.cycle,
                place,
                each.heading,
                frame_on=float(on),
                frame_off=float(off),
                cycle_frames=float(off - on) / each.lasts,
            )
        )
    return contacts
