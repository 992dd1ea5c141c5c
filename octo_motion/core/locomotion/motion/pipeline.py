# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole motion, on plain arrays: planned, posed, cleared, measured, keyed.

Everything that takes time is done here, in steps that yield the share that is done, and may be
dropped between any two.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, TypeVar

import numpy as np

from ...keyframes import Channel
from ...phrases import phrase
from ...rotations import IDENTITY, Floats, conjugate, from_matrix, multiply, rotate, slerp
from ...smoothing import covered, smooth_step, spans
from ..body import BodyMoments, OrganPoses, carriages, pose_organs
from ..clearance import (
    ArmsOverGround,
    BodyVolume,
    Haste,
    Opened,
    keeping_off_ground,
    lead_past,
    raising_between_frames,
    separating_arms,
)
from ..gait import CYCLE
from ..ground import Ground, sample_ground
from ..metrics import TOLD, Figure, Measured, finding_figures
from ..path import Travel, bearings_of, plan_travel, travel_at
from ..reaching import Carried, Reached, Travelling
from ..rig import (
    MARGIN,
    TOLERATED,
    ArmMotion,
    Poses,
    easing_turns,
    fastest_turn,
    halfway_automatic,
    keeping_where_calm,
    keeping_where_gentle,
    keeping_where_it_helps,
    object_transforms,
    root_bone_transforms,
    softening_starts,
    turn_limits,
    turns_in_world,
)
from .carrying import Carry, Laid, carried
from .few_keys import Motion, measuring_keyed, reduced
from .handover import (
    ArmsAround,
    Handover,
    eased_places,
    eased_stay,
    further_channels,
    hand_over_organs,
    hand_over_stretch,
    handing_over_arms,
    handovers,
    near_enough,
)
from .job import Creature, MotionJob, Tolerances, Trailing
from .planning import MotionPlan, frames_of_arms, plan_motion, ring_of_arms, scaled
from .segments import SegmentedMotion
from .trailing import trailed


@dataclass(frozen=True, eq=False)
class MotionResult:
    """What a motion has come to."""

    plan: MotionPlan
    channels: Sequence[Channel]
    """All that gets keys."""
    automatic: bool
    """Whether keys without handles of their own have automatic ones."""
    arms: ArmMotion
    """The arms at all moments at which they were worked out: frames, or those and half frames."""
    phase: Floats
    """(frames,) radians of the gait, unwrapped."""
    carried: tuple[Carried, ...] = ()
    """Where arms that reach take objects."""
    measured: Measured | None = None
    """What the figures are taken from, none where they are not wanted."""
    figures: tuple[Figure, ...] = ()
    """The worst of each kind."""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    """What arms that reach do."""

    @property
    def frames(self) -> Floats:
        """(frames,) whole numbers."""
        return self.plan.schedule.frames

    @property
    def known(self) -> KnownMotion:
        """What motions that are nearly the same are soon drawn from."""
        return KnownMotion(self.plan, self.arms, 0)

    @property
    def miss(self) -> float:
        """Arm lengths that an arm is from the targets of its gait at most."""
        return float(self.arms.misses[:: self.plan.stride].max())


MISS: Final = TOLD["MISS"]
"""Arm lengths by which a target may be missed without a word."""

_KEPT: Final = 2**25 - 2**16
"""Bytes of the largest arrays whose memory is kept: glibc keeps that of none beyond 2**25."""
_LARGE: Final = 31 * 2**20
"""Bytes of two arrays that together are less than what glibc gives back as soon as it is free.
Large pages for more gain nothing: where the system has none at hand, it takes long to find them."""
_PLANNING: Final = 0.1
"""Share of the work that is over when the motion is planned …"""
_TRAILING: Final = 0.7
"""Share of the time until the motion is there after which outer parts of arms follow, if they do.
"""
_MOVING: Final = 0.4
"""… and when it is there, but not yet its few keys."""
_EXACT_ANGLE: Final = np.radians(0.5)
"""Radians that keys on every frame may be off there …"""
_EXACT_DISTANCE: Final = 0.002
"""… and arm lengths of an arm's tip."""
_BONES_AT_ONCE: Final = 96_000
"""Bones times frames of one step of the work: some tens of megabytes …"""
_BONES_IN_BRIEF: Final = 3_500
"""… and where Blender goes on meanwhile; the numbers are the same."""
_EASINGS: Final = 4
"""How often bones that turn too fast are given more time, and kept off the ground again."""
_GENTLER: Final = 5
"""How often bones that set out all at once are made to do so more gently. With once 38 of them do
still in Hurry on eight ways over bumps, a slope and stairs, with all two."""
_GENTLY: Final = 0.12
"""Seconds in which an arm that reaches sets out from where it stands, however short its way is."""
_DEEP: Final = 0.1
"""Arm lengths that an arm lies in the ground in a pose, from which on it is not made to leave that
sooner than its pose."""
_FIRMLY: Final = 0.95
"""How far an arm holds something from which on it stays as it is, as one that stands."""
_FLOOR_AROUND: Final = 2.5
"""Arm lengths to all sides of the body in which the floor is looked at …"""
_FLOOR_FINE: Final = 0.02
"""… and those from one sample of it to the next."""
_FLOOR_HEADROOM: Final = 0.0
"""Arm lengths above the body up to which a surface is a floor and not a roof."""
_FLOOR_PLACES: Final = 1000
"""Places of the body, or twice as many, that say which of several surfaces is below it."""
_FLOOR_NOWHERE: Final = 1000.0
"""Arm lengths below the body: as deep as this is what has no faces."""

_UNSCALED: Final = 1e-5
"""Scales that differ from 1 by less get no keys."""
_AROUND_CYCLES: Final = 0.15
"""Cycles to either side of a frame that a glimpse of it is worked out from, and as moments at least
and at most. Swings are evened out and arms make way for each other within that."""
_WAY: Final = 97
"""Places of the body that show its way."""
_AROUND_MOMENTS: Final = (8, 16)

_Outcome = TypeVar("_Outcome")
Steps = Generator[float, None, _Outcome]
"""Work in steps that yield the share of it that is done, 0…1."""
Travelled = tuple[Floats, Floats]
"""Locations (moments, 3) and orientations (moments, 4) of the armature, world."""


def compute(job: MotionJob, *, brief: bool = False) -> Steps[MotionResult]:
    """Work a motion out, in steps that yield the share that is done: 0…1, 1 at the end. Brief,
    steps take less long, and all of them longer; the numbers are the same.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    keep_memory()
    plan = yield from scaled(plan_motion(job), 0.0, _PLANNING)
    return (yield from scaled(pose(plan, brief=brief), _PLANNING, 1.0))


def keep_memory() -> None:
    """Have the C library keep the memory of arrays that are done with for those to come, and the
    system give what comes next in large pages.

    glibc gives large arrays back to the system, which clears each page anew for the next: half of
    all pages that the first motion of a session touches. It stops that for all that are no larger
    than one that it has given back [mallopt(3), M_MMAP_THRESHOLD]. From then on they stand on its
    heap, as keys do that Blender allocates. For arrays of some megabytes numpy asks the system for
    large pages [madvise(2), MADV_HUGEPAGE], which stays so where they have stood: what comes there
    next, whoever allocates it, has one page where it would have 512.

    Elsewhere this does nothing. The arrays are never touched, and take no memory.
    """
    np.empty(_KEPT, dtype=np.uint8)
    # Both at once: one after the other they would stand in the same place.
    _ = [np.empty(_LARGE, dtype=np.uint8) for _ in range(2)]


def pose(plan: MotionPlan, *, brief: bool = False) -> Steps[MotionResult]:
    """Work out what is planned, as :func:`compute` does.

    Raises:
        OctoMotionError: an object is out of an arm's reach.
    """
    moments, times = plan.moments
    reducing, every = plan.tolerances is not None or plan.subframe_sampled, plan.stride
    moving = _MOVING if reducing else 1.0
    at_once = _BONES_IN_BRIEF if brief else _BONES_AT_ONCE
    step = max(1, at_once // max(len(plan.first.poser.bones), 1))
    posing = _posed(plan, times, step, cyclic=plan.job.in_place)
    trailing = plan.job.body.trailing
    posed = yield from scaled(posing, 0.0, _TRAILING * moving if trailing else moving)
    if trailing is not None:
        yield from scaled(_trail(plan, trailing, posed), _TRAILING * moving, moving)
    if posed.hands:
        yield from scaled(_handing_over(plan, posed), moving, moving)
    yield moving
    arms, keyed, reached = posed.arms, posed.keyed, posed.reached
    organs = organs_at(plan, moments, keyed, posed.swimming)
    yield moving
    motion, further = _motion(plan, posed, moments, organs)
    yield moving
    measured, overlaps = yield from scaled(_measuring(plan, posed, organs), moving, moving)
    if measured is not None and plan.carry is not None:
        measured = _rolled_up(plan, measured, posed)
    # A key at every moment, unless fewer say the same.
    channels = [*motion.travel, *motion.arms, *motion.mantle, *motion.widths, *motion.stretch]
    if reducing:
        yield moving
        channels = yield from scaled(_reduced(plan, motion, moments, every), moving, 1.0)
        if measured is not None and plan.carry is None:
            keyed_so = measured, plan.job.creature, channels
            measured = yield from measuring_keyed(*keyed_so, travels=not plan.job.in_place)
            yield 1.0
    found = (yield from finding_figures(measured)) if measured is not None else ()
    yield 1.0
    # What is in a pose alone is on each frame, however few keys the motion has.
    further = [replace(each, values=each.values[::every]) for each in further]
    misses = warnings_for_misses(plan, arms.at(slice(None, None, every)))
    result = MotionResult(
        plan=plan,
        channels=plan.job.creature.channels.written([*channels, *further]),
        automatic=not reducing,
        arms=arms,
        phase=posed.phase[::every],
        carried=reached.carried if reached is not None else (),
        measured=measured,
        figures=found,
        warnings=(*plan.warnings, *posed.warnings, *misses, *overlaps),
        notes=reached.notes if reached is not None else (),
    )
    yield 1.0
    return result


@dataclass(frozen=True, eq=False)
class _Posed:
    """A body and its arms at some moments."""

    phase: Floats
    """(moments,) radians of the gait, unwrapped."""
    arms: ArmMotion
    going: Travelled
    """As the body goes …"""
    own: Travelled
    """… without what takes it into poses …"""
    keyed: Travelled
    """… and as it gets keys, which stays where it is in place."""
    swimming: Floats | None
    """How far (moments,) it swims; none where the gait never changes."""
    reached: Reached | None
    warnings: list[str]
    hands: list[Handover]
    """The poses that it begins and ends in."""
    planned: tuple[ArmMotion, Travelled] | None
    """Arms, and the body as it goes, where they were planned; none where that is the world."""
    turning: Floats | None = None
    """Radians (moments − stride, bones) by which bones turn within a frame, where that is known."""


@dataclass(frozen=True, eq=False)
class Body:
    """A body at some moments, before its arms are worked out."""

    travel: Travel
    places: Travelled
    """Centres (moments, 3) and orientations (moments, 4) of the canonical body, world …"""
    eased: Travelled
    """… and as it is brought into poses that are given."""
    hands: list[Handover]
    """These poses."""
    going: Travelled
    """The armature as it goes …"""
    keyed: Travelled
    """… and as it gets keys."""


def body_at(plan: MotionPlan, times: Floats) -> Body:
    """The body at times (moments,)."""
    job, segments, standing = plan.job, plan.segments, plan.first.standing
    travel = plan_travel(
        plan.schedule.route,
        plan.schedule.travel,
        times,
        standing.bearings if standing is not None else None,
    )
    places = segments.places(travel)
    offset = None if plan.surge is None else plan.surge.at(travel.distance)
    if offset is not None:
        places = places[0] + offset, places[1]
    if plan.stalking is not None:
        places = plan.stalking.placed(places, travel.stood)
    creature, hands = job.creature, _handovers(plan, times)
    eased = places
    if hands and not job.in_place and plan.carry is None:
        eased = eased_places(hands, creature.body, creature.scale, places)
        places = near_enough(places, eased, plan.first.poser.arm_length * creature.scale)
    # In place the ground goes by, and arms are measured as if the body went along it.
    going = object_transforms(creature.body, creature.scale, *places)
    keyed = _stays(plan, going, offset) if job.in_place else going
    if hands and job.in_place:
        keyed = eased_stay(hands, keyed)
    return Body(travel, places, eased, hands, going, keyed)


def _posed(plan: MotionPlan, times: Floats, step: int, *, cyclic: bool) -> Steps[_Posed]:
    """Body and arms at times (moments,) that follow one another, so many moments at a step.

    Cyclic, the last moment is the first again.
    """
    job, segments = plan.job, plan.segments
    body = body_at(plan, times)
    yield 0.0
    creature, hands, travel, going, keyed = (
        job.creature,
        body.hands,
        body.travel,
        body.going,
        body.keyed,
    )
    frames_per_metre = plan.stride * plan.pace.mean / plan.schedule.travel.stride
    made = yield from segments.compute(travel, body.places, step, frames_per_metre, cyclic=cyclic)
    # Each of these takes a while; who works in turns looks about in between.
    yield 0.9
    if plan.laid is not None:
        # From here on it plays where it is, on what is there.
        at = travel.distance, times
        going = keyed = _carried(plan, plan.laid, made.arms, keyed, at)
    arms = yield from scaled(_clearing(plan, made, going, cyclic=cyclic), 0.9, 0.9)
    yield 0.93
    swimming = segments.swimming(travel.distance)
    volume = _volume_at(plan, times, keyed, swimming)
    yield 0.94
    # What is reached for is in the world.
    reached, gait = None, (arms.rotations.copy(), arms.strains.copy())
    if plan.carry is None:
        reached = yield from scaled(_reaching(plan, arms, volume, keyed, going), 0.94, 0.94)
    yield 0.96
    separate = partial(_separate, plan, arms, reached, going, volume, swimming=swimming)
    making_way = _making_way(plan, arms, reached, going, separate, cyclic=cyclic)
    warnings, turning = yield from scaled(making_way, 0.96, 0.98)
    rolling = _rolling(plan, arms, reached, going, gait, cyclic=cyclic)
    if (yield from scaled(rolling, 0.98, 0.98)):
        turning = None
    yield 0.98
    if hands or job.in_place or job.body.trailing is not None or plan.carry is not None:
        # What plays is another motion yet.
        turning = None
    planned = None
    if plan.carry is not None:
        planned, arms = (arms, going), arms.copy()
        going = keyed = _carried(plan, plan.carry, arms, going, (travel.distance, times))
        reached = yield from scaled(_reaching(plan, arms, volume, keyed, going), 0.99, 0.99)
        eased = _body_of(creature, going)
        eased = eased_places(hands, creature.body, creature.scale, eased)
    else:
        eased = body.eased
    own = going
    if hands and not job.in_place:
        keyed = going = object_transforms(creature.body, creature.scale, *eased)
    shown = (arms, going, own, keyed, swimming, reached, warnings, hands, planned, turning)
    return _Posed(travel.phase, *shown)


def _rolling(
    plan: MotionPlan,
    arms: ArmMotion,
    reached: Reached | None,
    going: Travelled,
    gait: tuple[Floats, Floats],
    *,
    cyclic: bool,
) -> Generator[None, None, bool]:
    """Let arms roll towards their neighbours, as their gait has these, wherever they have time for
    it: in a quick gait, and where they fold near the body, some have none. Whether any may roll.
    """
    creature = plan.job.creature
    rolled = beside_neighbours(plan, arms, gait)
    if rolled is arms.rotations:
        return False
    arms.rotations = yield from keeping_where_gentle(
        frames_of_arms(creature.skeleton, creature.arms, creature.body),
        *(arms.rotations, rolled, going[1]),
        rate=plan.job.timing.rate,
        limits=_turn_limits(plan, reached),
        every=plan.stride,
        cyclic=cyclic,
    )
    return True


def beside_neighbours(
    plan: MotionPlan, arms: ArmMotion, gait: tuple[Floats, Floats] | None = None
) -> Floats:
    """Rotations (moments, bones, 4) of arms that roll towards their neighbours.

    They do so as their gait has them, by rotations (moments, bones, 4) and strains (moments,
    bones), if that is given: what reaches turns no faster for it, and beside it others walk on.
    """
    creature = plan.job.creature
    ring = ring_of_arms(creature.skeleton, creature.arms, creature.body)
    if ring is None:
        return arms.rotations
    cycle = plan.pace.fastest / plan.job.timing.rate
    return ring.rolled(arms.rotations, arms.strains, cycle, gait=gait)


def _body_of(creature: Creature, going: Travelled) -> Travelled:
    """Centres (moments, 3) and orientations (moments, 4) of the canonical body, world."""
    body = creature.body
    centre = going[0] + rotate(going[1], creature.scale * body.center)
    return centre, multiply(going[1], from_matrix(body.rotation))


def _has_poses(plan: MotionPlan) -> bool:
    """Whether it begins or ends in a pose that is given."""
    return plan.job.begin is not None or plan.job.end is not None


def _handovers(plan: MotionPlan, times: Floats) -> list[Handover]:
    """The poses that a motion begins and ends in, at times (moments,)."""
    if not _has_poses(plan):
        return []
    known = plan.schedule
    frames = np.interp(times, known.times, known.frames)
    ends = float(known.frames[0]), float(known.frames[-1])
    return handovers(plan.job.begin, plan.job.end, frames, ends)


def _handing_over(plan: MotionPlan, posed: _Posed) -> Generator[None, None, None]:
    """Let arms go over between their motion and poses, in steps; in place there is nothing to stand
    on.
    """
    creature, ground = plan.job.creature, _underfoot(plan)
    frames = frames_of_arms(creature.skeleton, creature.arms, creature.body)
    below = None
    if ground is not None and not plan.job.in_place and plan.carry is None:
        below = ground, _radii(plan)
    around, arms = ArmsAround(creature, frames, posed.going, below), posed.arms
    yield from handing_over_arms(posed.hands, arms, around)
    if plan.carry is not None:
        return
    # Far from its pose an arm may have to be elsewhere at once: it sets out earlier, as in a walk.
    over = np.any([hand.time < 1.0 for hand in posed.hands], axis=0)
    ends = [hand.moment for hand in posed.hands if hand.time[hand.moment] <= 0.0]
    over[ends] = False
    held = [~over[:, None]] * len(frames)
    before, limits = arms.rotations.copy(), turn_limits(plan.job.timing.rate, np.inf)
    above = np.ones(arms.late.shape)
    for hand in posed.hands:
        if below is None:
            break
        # Out of a pose that lies in the ground an arm comes gently.
        here = slice(hand.moment, hand.moment + 1 or None)
        course = ArmsOverGround(frames, below[0], creature.scale)
        where = (each[here] for each in posed.going)
        joints = course.joints(Poses(arms.rotations[here], arms.strains[here], *where))
        deep = smooth_step(-course.clear(joints) / _DEEP)
        above *= 1.0 - deep * (1.0 - hand.share)[:, None]
    yield from _giving_time(plan, arms, posed.going, held, limits, above=above, cyclic=False)
    arms.rotations[ends] = before[ends]


def _carried(
    plan: MotionPlan,
    carry: Carry | Laid,
    arms: ArmMotion,
    going: Travelled,
    come: tuple[Floats, Floats],
) -> Travelled:
    """Where the armature is in the world that has come so far (moments,) at times (moments,); arms
    are taken there in place.
    """
    job, creature = plan.job, plan.job.creature
    assert job.ground is not None
    return carried(
        carry,
        frames_of_arms(creature.skeleton, creature.arms, creature.body),
        arms,
        going,
        come[0],
        np.interp(come[1], plan.schedule.times, plan.schedule.frames),
        body=creature.body,
        scale=creature.scale,
        may_stretch=job.ground.may_stretch,
    )


def glimpse(plan: MotionPlan, frame: float) -> Steps[Glimpse]:
    """What a motion is at one of its frames, long before all of it is worked out.

    Worked out, in steps, from the moments around it that it hangs on. Before the first frame and
    after the last it is as it is there.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    moments, times = plan.moments
    middle = plan.moment_of(frame)
    around = plan.stride * plan.pace.mean * _AROUND_CYCLES
    around = int(np.clip(np.ceil(around), *_AROUND_MOMENTS))
    first, last = max(middle - around, 0), middle + around + 1
    posed = yield from _posed(plan, times[first:last], 2 * around + 1, cyclic=False)
    if posed.hands:
        yield from scaled(_handing_over(plan, posed), 1.0, 1.0)
    yield 1.0
    organs = organs_at(plan, moments[first:last], posed.keyed, posed.swimming)
    yield 1.0
    values = _values(plan, posed, moments[first:last], middle - first, organs)
    # What is far from the middle hangs on more than these moments.
    within = max(middle - around // 2, 0)
    part = slice(within - first, middle - first + around // 2 + 1)
    return Glimpse(values, KnownMotion(plan, posed.arms.at(part), within))


def glimpsed(
    plan: MotionPlan, arms: ArmMotion, body: Body, moments: Floats, organs: OrganPoses
) -> list[Glimpsed]:
    """The values of all channels at one moment (1,), of a body with its arms and organs there."""
    going = body.going, body.going, body.keyed
    posed = _Posed(body.travel.phase, arms, *going, None, None, [], [], None)
    return _values(plan, posed, moments, 0, organs)


def _values(
    plan: MotionPlan, posed: _Posed, moments: Floats, number: int, organs: OrganPoses
) -> list[Glimpsed]:
    """The values of all channels at one of some moments (moments,), by its number."""
    motion, further = _motion(plan, posed, moments, organs, every_width=True)
    # A scale of 1 as well: what it is elsewhere in the motion is not known here.
    channels = [*motion.travel, *motion.arms, *motion.mantle, *motion.widths, *motion.stretch]
    channels = plan.job.creature.channels.written([*channels, *further])
    return [Glimpsed(each.data_path, each.values[number]) for each in channels]


def way_of(plan: MotionPlan) -> tuple[Floats, Floats, Floats]:
    """Where a motion leads, long before it is worked out: places of the body's centre (n, 3), as
    far one after the other, and of all footholds (m, 3), world; at these it has come (m,) metres.
    """
    standing, segments = plan.first.standing, plan.segments
    distance = np.linspace(0.0, plan.schedule.route.length, _WAY)
    if segments.transitions is None and standing is not None:
        centres, _ = standing.line.at(distance)
    else:
        when = plan.schedule
        table = bearings_of(when.route, when.travel)
        centres, _ = segments.places(
            travel_at(when.route, when.travel, table, distance, np.zeros(_WAY))
        )
    walks = [walk for walk in plan.segments.walks if walk is not None]
    found = [(each.position, each.touch_down) for walk in walks for each in walk.footholds()]
    held = np.array([each for each, _ in found], dtype=np.float64).reshape(-1, 3)
    come = plan.schedule.travel.stride / CYCLE * np.array([each for _, each in found])
    if plan.carry is not None:
        centres, _ = plan.carry.places(centres, distance)
        held, _ = plan.carry.places(held, come)
    return centres, held, come


@dataclass(frozen=True, eq=False)
class Glimpsed:
    """A property at one moment."""

    data_path: str
    values: Floats
    """(components,)"""


@dataclass(frozen=True, eq=False)
class KnownMotion:
    """A motion that was worked out, or a few of its moments."""

    plan: MotionPlan
    arms: ArmMotion
    """At some moments that follow one another …"""
    first: int
    """… and the number of the first of these."""


@dataclass(frozen=True, eq=False)
class Glimpse:
    """What a motion is at one of its frames."""

    values: list[Glimpsed]
    """Of all channels."""
    known: KnownMotion
    """The moments around it."""


def _stays(plan: MotionPlan, going: Travelled, offset: Floats | None) -> Travelled:
    """Where an armature is that stays, but for how far (moments, 3) it is from its place.

    Its origin is taken to be on the ground; a root bone lifts a walking body to its height.
    """
    count = len(going[1])
    creature = plan.job.creature
    up, world = creature.body.rotation[:, 2], creature.world
    lift = plan.height / creature.scale - float(creature.body.center @ up)
    lifted = bool(creature.root_bone) and plan.first.table.on_ground
    raised = lift * up if lifted else 0.0 * up
    location = world[:3, 3] + world[:3, :3] @ raised
    orientation = np.tile(from_matrix(world[:3, :3] / creature.scale), (count, 1))
    locations = np.tile(location, (count, 1))
    if offset is not None:
        locations += rotate(multiply(orientation, conjugate(going[1])), offset)
    return locations, orientation


def _ground(plan: MotionPlan) -> Ground | None:
    """What the arms stand on, or are kept off; none where there is none."""
    if plan.laid is not None:
        return plan.laid.ground
    return plan.below.ground if plan.below is not None else None


def _underfoot(plan: MotionPlan) -> Ground | None:
    """The same as they feel it."""
    if plan.laid is not None:
        return plan.laid.felt
    return plan.below.underfoot if plan.below is not None else None


def _radii(plan: MotionPlan) -> Sequence[Floats]:
    """What arms that are kept off the ground need of room, armature units."""
    assert plan.below is not None
    return plan.below.radii


def _clearing(
    plan: MotionPlan, made: SegmentedMotion, going: Travelled, *, cyclic: bool
) -> Generator[None, None, ArmMotion]:
    """In steps, arms that do not dip into the ground between frames, nor swim into it."""
    arms, ground, creature = made.arms, _underfoot(plan), plan.job.creature
    if ground is None:
        return arms
    frames = frames_of_arms(creature.skeleton, creature.arms, creature.body)
    course = ArmsOverGround(frames, ground, creature.scale, cyclic=cyclic)
    loose = plan.segments.afloat(made.travel)

    def keeping_off(poses: Poses, share: Floats | None) -> Generator[None, None, Poses]:
        """The same with arms off the ground that know of none, in steps."""
        if share is None:
            return poses
        radii = [creature.scale * each for each in _radii(plan)]
        rotations = yield from keeping_off_ground(course, poses, radii, share)
        return replace(poses, rotations=rotations)

    def again(
        chosen: np.ndarray, lift: Floats
    ) -> Generator[None, None, tuple[Poses, Sequence[Floats]]]:
        """Some frames anew, with arms raised; others are left as they are."""
        higher, joints = yield from made.higher(chosen, lift)
        arms.late[chosen] = higher.late
        poses = Poses(higher.rotations, higher.strains, going[0][chosen], going[1][chosen])
        poses = yield from keeping_off(poses, None if loose is None else loose[chosen])
        return poses, joints if joints is not None else course.joints(poses)

    whole = yield from keeping_off(Poses(arms.rotations, arms.strains, *going), loose)
    yield
    if not plan.standing:
        # Nothing lies on the ground, so there is nothing to raise between frames.
        arms.rotations = whole.rotations
        return arms
    joints = made.joints
    raised = yield from raising_between_frames(
        course, whole, joints if joints is not None else course.joints(whole), again
    )
    arms.rotations, arms.strains = raised.rotations, raised.strains
    return arms


def _volume_at(
    plan: MotionPlan, times: Floats, keyed: Travelled, swimming: Floats | None
) -> BodyVolume | None:
    """How much room arms and body take at times (moments,); none where nobody asks."""
    if plan.job.volume is None:
        return None
    frames = np.interp(times, plan.schedule.times, plan.schedule.frames)
    return _volume(plan, plan.job.volume, organs_at(plan, frames, keyed, swimming))


def _volume(plan: MotionPlan, volume: BodyVolume, organs: OrganPoses) -> BodyVolume:
    """The same as the body moves by itself."""
    moving = plan.self_motion
    if moving is None:
        return volume
    names = [each.name for each in volume.body]
    # As wide as it ever gets: what arms do at a moment does not hang on which others are asked.
    wider = dict.fromkeys(plan.job.body.organs.mantle[-1:], moving.widest)
    return volume.carried(carriages(organs, plan.job.creature.skeleton, names), wider)


def _reaching(
    plan: MotionPlan,
    arms: ArmMotion,
    volume: BodyVolume | None,
    keyed: Travelled,
    going: Travelled,
) -> Generator[None, None, Reached | None]:
    """Let arms reach, past each other and the ground; none where nothing is reached for. In steps.

    Arms which reach hold no ground and follow no gait.
    """
    reaching, creature = plan.job.reaching, plan.job.creature
    if reaching is None:
        return None
    before = arms.rotations.copy()
    ground = _ground(plan) if plan.carry is None else None
    heights = ground.height if ground is not None else None
    travelling = Travelling(*keyed, creature.scale, heights)
    reached = reaching.apply(plan.schedule.frames, arms.rotations, travelling, arms.strains)
    yield
    yield from _leading_past(plan, arms, reached, volume, going)
    moved = np.any(arms.rotations != before, axis=-1)
    for number, bones in enumerate(plan.segments.bones_of):
        own = moved[:, bones]
        arms.in_contact[number][:, 1:] &= ~np.logical_or.accumulate(own, axis=1)
        busy = own.any(axis=1)
        arms.late[busy, number] = arms.misses[busy, number] = 0.0
    return reached


def _leading_past(
    plan: MotionPlan,
    arms: ArmMotion,
    reached: Reached,
    volume: BodyVolume | None,
    going: Travelled,
) -> Generator[None, None, None]:
    """Lead arms that reach past the others, and over the ground, in steps."""
    job, scale = plan.job, plan.job.creature.scale
    ground = _ground(plan) if plan.carry is None else None
    if volume is not None and job.keep_apart:
        past = lead_past(
            volume,
            arms.rotations,
            arms.strains,
            share=reached.led,
            above=reached.away,
            held=reached.held,
            travel=going,
            ground=ground,
            scale=scale,
            frames_per_cycle=plan.stride * plan.pace.mean,
            haste=Haste(
                fastest_turn(plan.stride * job.timing.rate, np.inf),
                max(1, round(_GENTLY * plan.stride * job.timing.rate)),
            ),
        )
        arms.rotations = past if past is not None else arms.rotations
        yield
    if ground is not None and job.reaching is not None:
        course = ArmsOverGround(job.reaching.frames, ground, scale, cyclic=job.in_place)
        poses = Poses(arms.rotations, arms.strains, *going)
        radii = [scale * each for each in job.reaching.radii]
        loose = reached.away * (1.0 - np.stack([each.max(axis=1) for each in reached.held], axis=1))
        arms.rotations = yield from keeping_off_ground(course, poses, radii, loose)


def _making_way(
    plan: MotionPlan,
    arms: ArmMotion,
    reached: Reached | None,
    going: Travelled,
    separate: Callable[..., Steps[list[str]]],
    *,
    cyclic: bool,
) -> Steps[tuple[list[str], Floats | None]]:
    """Let arms make way for each other and bones take their time, and what is left after that get
    out the nearest way: what could not get to its own side, and what came to be in another's way
    for taking its time.

    What there is to warn of, and radians (moments − stride, bones) by which bones turn within a
    frame, if nothing was moved.
    """
    before = arms.rotations
    warnings = yield from separate(cyclic=cyclic)
    limits = _turn_limits(plan, reached)
    taking_time = _taking_time(plan, arms, reached, going, limits, cyclic=cyclic)
    turning = yield from scaled(taking_time, 1.0, 1.0)
    eased = arms.rotations
    if eased is before:
        return warnings, turning
    yield from scaled(separate(nearest=True, cyclic=cyclic), 1.0, 1.0)
    if arms.rotations is eased:
        return warnings, turning
    creature = plan.job.creature
    keeping = keeping_where_calm(
        frames_of_arms(creature.skeleton, creature.arms, creature.body),
        *(eased, arms.rotations, going[1]),
        limits=limits,
        every=plan.stride,
        cyclic=cyclic,
    )
    arms.rotations = yield from scaled(keeping, 1.0, 1.0)
    parted, held = arms.rotations, _held_in_time(arms, reached)
    gently = _setting_out_gently(plan, arms, going, held, limits, turning=None, cyclic=cyclic)
    yield from scaled(gently, 1.0, 1.0)
    if reached is not None and arms.rotations is not parted:
        _hold_on(plan, arms, parted, reached)
    return warnings, None


def _turn_limits(plan: MotionPlan, reached: Reached | None) -> Floats:
    """Radians (moments − stride, arms) that bones may turn within a frame."""
    reaching = None if reached is None else reached.away > 0.0
    return turn_limits(plan.job.timing.rate, plan.pace.fastest, reaching, plan.stride)


def _separate(
    plan: MotionPlan,
    arms: ArmMotion,
    reached: Reached | None,
    going: Travelled,
    volume: BodyVolume | None,
    *,
    swimming: Floats | None,
    nearest: bool = False,
    cyclic: bool,
) -> Steps[list[str]]:
    """Let arms make way for each other, but for those that reach, to their own sides or the nearest
    way; what there is to warn of.
    """
    job = plan.job
    if volume is None or not job.keep_apart:
        return []
    if too_many := volume.too_many(len(arms.rotations)):
        return [too_many]
    moved = yield from separating_arms(
        volume,
        arms.rotations,
        arms.strains,
        in_contact=arms.in_contact,
        busy=reached.away > 0.0 if reached is not None else np.zeros(arms.late.shape, dtype=bool),
        travel=going,
        ground=_underfoot(plan),
        scale=job.creature.scale,
        frames_per_cycle=plan.stride * plan.pace.mean,
        most=fastest_turn(plan.stride * job.timing.rate, np.inf),
        opened=_opened(plan, len(arms.rotations), swimming),
        nearest=nearest,
        cyclic=cyclic,
    )
    if moved is not None:
        arms.rotations = moved
    return []


def _taking_time(
    plan: MotionPlan,
    arms: ArmMotion,
    reached: Reached | None,
    going: Travelled,
    limits: Floats,
    *,
    cyclic: bool,
) -> Generator[None, None, Floats | None]:
    """Let bones that would turn too fast for an eye take their time, off the ground; but where
    nothing is to be evened out, and arms are to be at every corner of the gait's table in time.
    In steps.

    Radians (moments − stride, bones) by which they turn within a frame, if none did.
    """
    every, creature = plan.stride, plan.job.creature
    if not any(gait.poser.settings.smoothing_cycles for gait in plan.segments.gaits):
        frames = frames_of_arms(creature.skeleton, creature.arms, creature.body)
        return turns_in_world(frames, arms.rotations, going[1], every)
    before = arms.rotations
    around = plan, arms, going, _held_in_time(arms, reached), limits
    turning = yield from _giving_time(*around, cyclic=cyclic)
    yield from _setting_out_gently(*around, turning=turning, cyclic=cyclic)
    if arms.rotations is before:
        return turning
    if reached is not None:
        _hold_on(plan, arms, before, reached)
    return None


def _up_to_the_last(lying: np.ndarray) -> np.ndarray:
    """Which bones (moments, bones) hold joints where they are that lie (moments, bones + 1)."""
    return np.logical_or.accumulate(lying[:, :0:-1], axis=1)[:, ::-1]


def _hold_on(plan: MotionPlan, arms: ArmMotion, before: Floats, reached: Reached) -> None:
    """Let arms that are going to reach, or have just done so, stand as before, rotations (moments,
    bones, 4), and set out and come back gently: one that has little time would leave at once.
    """
    gently = max(1, round(_GENTLY * plan.stride * plan.job.timing.rate))
    for number in np.flatnonzero(reached.away.any(axis=0)).tolist():
        stands = arms.in_contact[number].any(axis=1) & (reached.away[:, number] <= 0.0)
        share = 1.0 - covered(stands.astype(np.float64), gently)
        bones, some = plan.segments.bones_of[number], share < 1.0
        own, eased = before[some, bones], arms.rotations[some, bones]
        arms.rotations[some, bones] = slerp(own, eased, share[some, None])


def _held_in_time(arms: ArmMotion, reached: Reached | None) -> list[np.ndarray]:
    """Which bones (moments, bones or 1) of each arm are to stay as they are, whatever takes its
    time.
    """
    holding = np.zeros(arms.late.shape, dtype=bool)
    if reached is not None:
        holding = np.stack([each.max(axis=1) > _FIRMLY for each in reached.held], axis=1)
    # Up to the last joint that lies: beyond it a tip still comes down, or is off already.
    return [
        (_up_to_the_last(lying) & (late <= MISS)[:, None]) | own[:, None]
        for lying, late, own in zip(arms.in_contact, arms.late.T, holding.T, strict=True)
    ]


def _giving_time(
    plan: MotionPlan,
    arms: ArmMotion,
    going: Travelled,
    held: Sequence[np.ndarray],
    limits: Floats,
    *,
    above: Floats | float = 1.0,
    cyclic: bool,
) -> Generator[None, None, Floats | None]:
    """Let bones take their time that turn by more than the limits, but of arms while they are held
    (moments,), and off the ground, as far (moments, arms) as they are to be above it. In steps.

    Radians (moments − stride, bones) by which they turn within a frame, if none did.
    """
    job, every, creature = plan.job, plan.stride, plan.job.creature
    frames = frames_of_arms(creature.skeleton, creature.arms, creature.body)
    before = arms.rotations
    turning = turns_in_world(frames, before, going[1], every)
    yield
    for number in range(_EASINGS):
        eased = yield from easing_turns(
            *(frames, arms.rotations, going[1], held),
            rate=job.timing.rate,
            limits=limits,
            every=every,
            cyclic=cyclic,
            turning=turning if number == 0 else None,
        )
        if eased is None:
            break
        arms.rotations, changed = eased
        # What comes of that is jerked as little as can be: out of the ground itself, and no more.
        last = number == _EASINGS - 1
        ground = _ground(plan) if last else _underfoot(plan)
        if ground is not None:
            course = ArmsOverGround(frames, ground, creature.scale, cyclic=cyclic)
            poses = Poses(arms.rotations, arms.strains, *going)
            radii = [creature.scale * each for each in _radii(plan)]
            closer = MARGIN if last else 0.0
            share = above * changed
            keeping_off = keeping_off_ground(course, poses, radii, share, closer=closer)
            arms.rotations = yield from keeping_off
    if arms.rotations is before:
        return turning
    # Where it is no help, it is no good either.
    arms.rotations = yield from keeping_where_it_helps(
        *(frames, before, arms.rotations, going[1]), limits=limits, every=every, cyclic=cyclic
    )
    return None


def _setting_out_gently(
    plan: MotionPlan,
    arms: ArmMotion,
    going: Travelled,
    held: Sequence[np.ndarray],
    limits: Floats,
    *,
    turning: Floats | None,
    cyclic: bool,
) -> Generator[None, None, None]:
    """Let bones that set out all at once do so more gently, again and again: what keeps one off the
    ground may have another do so. Arguments are as of :func:`_softening`; in steps.
    """
    for _ in range(_GENTLER):
        before = arms.rotations
        yield from _softening(plan, arms, going, held, limits, turning=turning, cyclic=cyclic)
        if arms.rotations is before:
            break
        turning = None


def _stretches_with(some: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Stretches in which arms were moved (moments, arms) that have some moments (moments, arms) of
    a kind.
    """
    result = np.zeros(moved.shape, dtype=bool)
    for number in np.flatnonzero(some.any(axis=0)).tolist():
        for first, end in spans(moved[:, number]):
            result[first:end, number] = some[first:end, number].any()
    return result


def _softening(
    plan: MotionPlan,
    arms: ArmMotion,
    going: Travelled,
    held: Sequence[np.ndarray],
    limits: Floats,
    *,
    turning: Floats | None,
    cyclic: bool,
) -> Generator[None, None, None]:
    """Let bones that set out all at once do so more gently, but of arms while they are held
    (moments, bones or 1), and where no arm comes to be in the ground for it. In steps.

    They turn by so much within a frame (moments − stride, bones), if that is known.
    """
    creature, before, every = plan.job.creature, arms.rotations, plan.stride
    frames = frames_of_arms(creature.skeleton, creature.arms, creature.body)
    found = yield from softening_starts(
        *(frames, before, going[1], held),
        rate=plan.job.timing.rate,
        per_cycle=plan.pace.fastest,
        every=every,
        cyclic=cyclic,
        turning=turning,
    )
    if found is None:
        return
    softened, moved = found
    lower, ground = np.zeros(moved.shape, dtype=bool), _underfoot(plan)
    if ground is not None:
        course = ArmsOverGround(frames, ground, creature.scale, cyclic=cyclic)
        radii = [creature.scale * each for each in _radii(plan)]
        least = np.minimum(course.room(Poses(before, arms.strains, *going), radii), 0.0)
        yield
        poses = Poses(softened, arms.strains, *going)
        lower = course.room(poses, radii) < least - TOLERATED
        yield
        if lower.any():
            # Nothing else: raised frame by frame, it could come to be lower between two of them.
            share = np.where(_stretches_with(lower, moved > 0.0), np.cbrt(moved), 0.0)
            softened = yield from keeping_off_ground(course, poses, radii, share, closer=MARGIN)
            poses = replace(poses, rotations=softened)
            lower = course.room(poses, radii) < least - TOLERATED
            yield
    arms.rotations = yield from keeping_where_gentle(
        *(frames, before, softened, going[1]),
        rate=plan.job.timing.rate,
        limits=limits,
        lower=lower,
        every=every,
        cyclic=cyclic,
    )


def _trail(plan: MotionPlan, trailing: Trailing, posed: _Posed) -> Steps[None]:
    """Let outer parts of free arms follow, over the ground."""
    job, creature, arms = plan.job, plan.job.creature, posed.arms
    ground = _underfoot(plan) if plan.carry is None else None
    away = posed.reached.away if posed.reached is not None else np.zeros(arms.late.shape)
    held = [
        lying.any(axis=1) | (own > 0.0) for lying, own in zip(arms.in_contact, away.T, strict=True)
    ]
    rate, cyclic = plan.stride * job.timing.rate, job.in_place
    # Arms follow the motion, and poses take over from it: what brings a body into a pose within a
    # second would sweep them away.
    share = np.prod([np.ones(len(posed.own[0])), *(each.share for each in posed.hands)], axis=0)
    following = trailing, creature, arms.rotations, posed.own, held
    found = trailed(*following, share=share, rate=rate, cyclic=cyclic)
    arms.rotations, free = yield from found
    if ground is not None:
        frames = frames_of_arms(creature.skeleton, creature.arms, creature.body)
        course = ArmsOverGround(frames, ground, creature.scale, cyclic=cyclic)
        poses = Poses(arms.rotations, arms.strains, *posed.going)
        radii = [creature.scale * each for each in _radii(plan)]
        keeping_off = keeping_off_ground(course, poses, radii, free)
        arms.rotations = yield from scaled(keeping_off, 1.0, 1.0)


def _opened(plan: MotionPlan, count: int, swimming: Floats | None) -> Opened | None:
    """Where arms stand round a body that swims as it lies, none if it never does."""
    posers = [gait.poser for gait in plan.segments.gaits]
    lying = next((each for each in posers if each.settings.swim_lean), None)
    if lying is None:
        return None
    return Opened(lying.opens_to, np.ones(count) if swimming is None else swimming)


def _measuring(
    plan: MotionPlan, posed: _Posed, organs: OrganPoses
) -> Generator[None, None, tuple[Measured | None, tuple[str, ...]]]:
    """In steps, what figures are taken from, where they are wanted, and what overlaps in words."""
    job, creature, separation, every = plan.job, plan.job.creature, None, 1
    on_frames, turning = slice(None, None, plan.stride), posed.turning
    # The ground is as it was planned on.
    planned, along = posed.planned or (posed.arms, posed.going)
    going, keyed = ((each[0][on_frames], each[1][on_frames]) for each in (along, posed.keyed))
    arms = planned.at(on_frames)
    overlaps: tuple[str, ...] = ()
    if job.volume is not None and job.tell_overlaps:
        volume = _volume(plan, job.volume, organs.at(on_frames))
        separation, every = yield from volume.measuring(arms.rotations, arms.strains)
        yield
        overlaps = volume.told(separation, every, plan.schedule.frames)
    if job.live:
        return None, overlaps
    yield
    poses = Poses(arms.rotations, arms.strains, *going)
    below = plan.standing[0].job if plan.standing else job.floor
    ground, stays, floor = _ground(plan) if plan.standing else None, None, None
    if plan.laid is None:
        stays = keyed if job.in_place else None
        floor = _floor_under(job, keyed, plan.first.poser.arm_length * creature.scale)
    yield
    # Between frames it matters what is below.
    nowhere = ground is None and floor is None
    measured = Measured(
        frames=plan.schedule.frames,
        arms=frames_of_arms(creature.skeleton, creature.arms, creature.body),
        names=[arm.name for arm in creature.arms],
        poses=poses,
        misses=np.maximum(arms.late, arms.misses),
        scale=creature.scale,
        ground=ground,
        lying=arms.in_contact,
        cycles=arms.cycles,
        separation=separation,
        every=every,
        halfway=None if nowhere else halfway_automatic(poses, cyclic=job.repeats),
        skins=below.skins if below is not None else None,
        rate=job.timing.rate,
        stays=stays,
        floor=floor,
        turning=None if turning is None else turning[:: plan.stride],
    )
    return measured, overlaps


def _rolled_up(plan: MotionPlan, measured: Measured, posed: _Posed) -> Measured:
    """What is measured of a plan with what plays of it, which reaches and poses have changed."""
    arms, (locations, orientations), every = posed.arms, posed.going, plan.stride

    def poses(part: slice) -> Poses:
        own = arms.at(part)
        return Poses(own.rotations, own.strains, locations[part], orientations[part])

    on_frames = poses(slice(None, None, every))
    between = poses(slice(1, None, 2)) if every == 2 else halfway_automatic(on_frames, cyclic=False)
    now = arms.at(slice(None, None, every))
    return replace(
        measured,
        rolled_up=(on_frames, between),
        ground_moves=plan.carry is not None and plan.carry.carpet is not None,
        lying=now.in_contact,
        cycles=now.cycles,
    )


def organs_at(
    plan: MotionPlan, frames: Floats, keyed: Travelled, swimming: Floats | None
) -> OrganPoses:
    """What the body does by itself at frames (moments,), which need not be whole."""
    job, creature = plan.job, plan.job.creature
    if plan.self_motion is None:
        return OrganPoses((), np.zeros((len(frames), 0, 4)), {})
    schedule, held = plan.schedule, np.tile(plan.mantle_rotations, (len(frames), 1, 1))
    if swimming is not None:
        rest = np.broadcast_to(IDENTITY, held.shape)
        held = slerp(rest, held, np.repeat(swimming[:, None], held.shape[1], axis=1))
    organs, look = job.body.organs, job.body.look_at
    if look is not None:
        columns = [np.interp(frames, schedule.frames, each) for each in look.T]
        eyes = [creature.skeleton.index[name] for name in organs.eyes]
        middle = creature.skeleton.heads[eyes].mean(axis=0) if eyes else creature.body.center
        look = np.stack(columns, axis=1) - keyed[0] - rotate(keyed[1], creature.scale * middle)
    times = np.interp(frames, schedule.frames, schedule.times) * schedule.seconds
    moments = BodyMoments(times, keyed[1], look, held)
    up = creature.body.rotation[:, 2]
    return pose_organs(plan.self_motion, organs, creature.skeleton, up, moments)


def _motion(
    plan: MotionPlan,
    posed: _Posed,
    moments: Floats,
    organs: OrganPoses,
    *,
    every_width: bool = False,
) -> tuple[Motion, list[Channel]]:
    """What was computed, as channels with a key at every moment (moments,), and those of what only
    poses have that it begins or ends in.
    """
    arms, keyed, hands = posed.arms, posed.keyed, posed.hands
    creature, channels = plan.job.creature, plan.job.creature.channels
    if hands:
        organs = hand_over_organs(hands, organs)
    if bone := creature.root_bone:
        locations, rotations = root_bone_transforms(creature.skeleton, bone, creature.world, *keyed)
        travel = [
            channels.location(bone, locations),
            *channels.rotations([bone], rotations[:, None]),
        ]
    elif plan.job.in_place:
        travel = []
    else:
        assert channels.own is not None
        travel = channels.own.channels(*keyed)
    stretches: list[Channel] = []
    # A swim that becomes a walk stretches there.
    if any(each.stretching for each in plan.standing):
        stretches = channels.stretches(creature.bones, arms.strains)
    if hands:
        stretches = hand_over_stretch(hands, stretches)
    motion = Motion(
        travel=travel,
        arms=channels.rotations(plan.first.poser.bones, arms.rotations),
        mantle=channels.rotations(organs.bones, organs.rotations),
        widths=[
            channels.scale(name, each)
            for name, each in organs.scales.items()
            if every_width or np.abs(each - 1.0).max() > _UNSCALED
        ],
        stretch=stretches,
        lying=arms.in_contact if plan.standing else (),
    )
    if not hands:
        return motion, []
    own = [*motion.travel, *motion.arms, *motion.mantle, *motion.widths, *motion.stretch]
    return motion, further_channels(hands, creature, own, len(moments))


def _reduced(plan: MotionPlan, motion: Motion, moments: Floats, every: int) -> Steps[list[Channel]]:
    """Keys with handles of their own: few, or on every frame and right between them."""
    tolerances = plan.tolerances
    exact = Tolerances(_EXACT_ANGLE, _EXACT_DISTANCE * plan.first.poser.arm_length)
    return reduced(
        moments,
        plan.job.creature,
        motion,
        tolerances or exact,
        every=every,
        dense=tolerances is None,
        loops=plan.job.in_place and not _has_poses(plan),
    )


def warnings_for_misses(plan: MotionPlan, arms: ArmMotion) -> Iterator[str]:
    """What there is to say of arms that miss their footholds or the targets of their gait."""
    names, late = [arm.name for arm in plan.job.creature.arms], arms.late
    if late.max() > MISS:
        frame, arm = np.unravel_index(late.argmax(), late.shape)
        # Bones that may not get longer do not, whatever Stretch is.
        longer = any(each.stretching for each in plan.standing)
        remedy = phrase("raise Stretch") if longer else phrase("lower Height")
        dragged = _dragged(plan.job, int(arm))
        first = phrase("Drag its marker nearer") if dragged else phrase("Lower Hold")
        yield (
            phrase(
                "'{name}' slides at frame {frame:.0f}: its contact is {far:.2g} arm lengths out "
                "of reach. {first}, {remedy} or shorten the stride.",
                name=names[arm],
                frame=plan.schedule.frames[frame],
                far=late[frame, arm],
                first=first,
                remedy=remedy,
            )
        )
        return
    misses = arms.misses.max(axis=0)
    worst = int(misses.argmax())
    if misses[worst] > MISS:
        yield (
            phrase(
                "{some} of {count} arms cannot follow the gait everywhere: '{name}' stays "
                "{far:.2g} arm lengths away.",
                some=int((misses > MISS).sum()),
                count=len(names),
                name=names[worst],
                far=misses[worst],
            )
        )


def _dragged(job: MotionJob, arm: int) -> bool:
    """Whether a contact of an arm is where the artist has put it."""
    overrides = job.ground.overrides if job.ground is not None else ()
    return any(each.arm == arm and each.position is not None for each in overrides)


def _floor_under(job: MotionJob, places: tuple[Floats, Floats], length: float) -> Ground | None:
    """The floor that no gait holds on to, none where there is none: below a body that swims, or
    about one that stays. A gait in the water knows no ground, and one in place a level one that
    goes by; what a mesh that lies there all the same has of their arms in it is measured.

    Args:
        job: the motion.
        places: locations (moments, 3) and orientations (moments, 4) of the armature, world.
        length: of an arm, metres.
    """
    if job.floor is None:
        return None
    creature = job.creature
    some = slice(None, None, max(1, len(places[0]) // _FLOOR_PLACES))
    path = places[0][some] + rotate(places[1][some], creature.scale * creature.body.center)
    return sample_ground(
        job.floor.triangles,
        path,
        np.zeros(len(path), dtype=bool),
        reach=_FLOOR_AROUND * length,
        spacing=_FLOOR_FINE * length,
        headroom=_FLOOR_HEADROOM * length,
        content=job.floor.content,
        bare=float(path[:, 2].min()) - _FLOOR_NOWHERE * length,
    )
