# SPDX-License-Identifier: GPL-3.0-or-later
"""Where and when arms hold on to the ground.

An arm holds on once in each cycle of its gait. A foothold belongs to an arm and the number of its
cycle and hangs on nothing else: not on frames, nor on footholds before it. It is laid where the
gait wants it as the body passes, half way through the stance, and near enough for the arm to keep
it while the body moves on.

Where a constant says what was seen when it was other, that is the default octopus with the ten
set-ups on bumps of 0.3 arm lengths, as they are slipping by 0.0001 to 0.0023 arm lengths, bones
turning by 0.05 to 0.58 radians from frame to frame.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...rotations import Floats, rotate, rotate_in_plane
from ...smoothing import smooth_step
from ..gait import CYCLE, UnevenHolds
from ..path import Line, values_along
from .arm_curves import laid
from .contact_timing import ContactTiming
from .surface import Ground, HeightField, Limbs, StanceSettings, normals, touching

PEELING: Final = 0.5
"""Share of a stance in which the arm is peeled off towards its tip, as the body pulls. At 0.2 an
octopus that walks over bumps slips by 0.0014 arm lengths instead of 0.0005; at 0.7 a hurry begins
and ends on half of what lies."""
_PEELED_IN_A_CYCLE: Final = 0.4
"""Arm lengths that are peeled off at most in a cycle's time on the ground: of holds that are cut
down, less. However much, one on tiptoe turns over bumps by 31° in a frame instead of 21°; at 0.6
fourteen bones of it set out all at once on four ways over three grounds, instead of two."""
_SLACK: Final = 0.84
"""Distance from root to where an arm is peeled off, as a share of it, that peels no more. At 0.42
all is peeled off that may be: Walk slips by 0.0011 arm lengths instead of 0.0005."""
_FEW: Final = 2
"""Joints that lie down of an arm that is too stiff to be peeled off: of arms of few bones."""
_LEFT: Final = 0.4
"""Share of the part that lies down which is not peeled off, but let go with the tip: with none of
it the last bones snap, by 0.106 of a quaternion's component from step to step instead of 0.088."""
_EASY: Final = 0.80
"""Distance from root to foothold half way through, as a share of the arm between them. At 0.9 arms
stretch by 0.26 instead of 0.25 and overlap by 0.073 radii instead of 0.057."""
_UPRIGHT: Final = 0.76
"""The same under a body that is as high as arms can bear: where it is lower, it is more. At twice
that Tiptoe, the highest, turns by 0.74 radians from frame to frame instead of 0.53."""
_TAUT: Final = 0.94
"""The same at its longest. At 0.99 arms stretch by 0.28 instead of 0.25."""
_LOOKED_AT: Final = 16
"""Places along an arm at which it is looked at whether it is peeled off."""
_SLACKEST: Final = 0.55
"""The same at its shortest: an arm that is slacker has to fold. Less changes nothing where arms may
shorten; at 1.1 Hurry slips by 0.0032 arm lengths instead of 0.0011."""
_SHORTER: Final = 0.5
"""Share of the most stretch by which a bone that may stretch may get shorter. Half or twice as much
changes no figure by more than a tenth."""
_STRETCHED: Final = 0.6
"""Share of the most stretch that footholds are laid for. At 1.2 Hurry slips by 0.023 arm
lengths."""
_NEAREST: Final = 0.20
"""Least arm lengths from the root, seen from above. At 0.1 Hurry turns by 0.80 radians from frame
to frame instead of 0.58."""
_CLOSEST: Final = 0.05
"""The same where there is no other way: in none of the ten."""
_SHORTENED: Final = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)
"""Shares of its time that a stance may be cut down to where the body moves on too far."""
_NEAR, _NEARER = 0.60, 0.28
_FAR, _FARTHER = 0.94, 0.47
"""Shares of the free part of an arm between which a place may be that it pushes away from, and by
how much more these are for each length that it may get longer by."""
_WOUND: Final = np.radians(45.0)
"""Turn of the body within a hold from which on it is cut down. On a circle of 0.17 arm lengths arms
that hold on are 0.1 arm lengths below the ground, and turn by 176° in a frame, without that."""
_ROUNDS: Final = 3
"""How often a foothold is moved, and the ground under it looked at again. Twice changes no figure
by more than a tenth."""


@dataclass(frozen=True, eq=False)
class _Reach:
    """How far arms reach while they hold on, metres (arms, 1)."""

    free: Floats
    """Length up to where they touch."""
    whole: Floats
    peeled: Floats
    """How much of what lies is peeled off as the stance ends."""
    longer: float
    """Factor that they may stretch by."""
    slackest: Floats
    """Distance from root to foothold below which they have to fold."""


class Passing:
    """Where the body carries the arms' roots, at times since the middle of each stance."""

    def __init__(self, roots: Floats, seen: Floats) -> None:
        self.middle = roots
        """(arms, cycles, 3) half way through, world."""
        self.touch_down, self.peeling, self.lift_off = seen
        """The same as the stance begins, as peeling begins, and as the stance ends."""


def span(settings: StanceSettings, *, may_stretch: bool) -> tuple[float, float]:
    """From where to where, seen from its root, an arm holds on with ease while the body passes.

    Arm lengths. Nearer an arm folds, farther it cannot; one that may get longer need not begin as
    near.
    """
    free = 1.0 - settings.planted
    longer = settings.stretch * may_stretch
    return (_NEAR + _NEARER * longer) * free, (_FAR + _FARTHER * longer) * free


def easy_height(
    reach: Floats, radii: Floats, settings: StanceSettings, *, may_stretch: bool
) -> float:
    """How far above the ground an arm may begin and still hold on with ease.

    Reach (segments + 1,) is along it to each joint, radii (segments + 1,) from there to the skin
    below.
    """
    joint = touching(reach, settings.planted)
    longer = 1.0 + _STRETCHED * settings.stretch * may_stretch
    level = (_UPRIGHT * longer * reach[joint]) ** 2 - (_NEAREST * reach[-1]) ** 2
    return float(np.sqrt(max(level, 0.0)) + radii[joint])


def stance_times(duty: Floats) -> tuple[tuple[Floats, Floats, Floats], ...]:
    """Times (arms, cycles) that :func:`spots` wants to know the roots at, for holds of so many
    cycles (arms, cycles) cut down more and more.
    """
    return tuple(
        (-0.5 * width, (0.5 - PEELING) * width, 0.5 * width)
        for width in (duty * share for share in _SHORTENED)
    )


def spots(
    limbs: Limbs,
    ground: Ground,
    settings: StanceSettings,
    passings: Iterable[tuple[Floats, Passing]],
    *,
    aim: Floats,
    away: Floats,
    farther: Floats,
) -> tuple[Floats, Floats]:
    """Footholds as far out as an arm holds on with ease, and near enough to be kept.

    Args:
        limbs: the arms.
        ground: what they touch.
        settings: how they hold on.
        passings: half of how long holds last (arms, cycles), in cycles, and the body's passing
            meanwhile, for each of :func:`stance_times`.
        aim: (arms, cycles, 2) unit vectors in which the arms are to touch, world.
        away: (arms, cycles) metres from the root, seen from above, at which they are to do so if
            they can; nan for where it is easy.
        farther: (arms, cycles) metres by which it is to be beyond that.

    Returns:
        Metres (arms, cycles) from the root, seen from above, and half of how long the stance lasts
        (arms, cycles), in cycles.
    """
    reach = _reach(limbs, settings)
    shape = aim.shape[:2]
    distance, half, short = np.zeros(shape), np.zeros(shape), np.full(shape, np.inf)
    undecided = np.ones(shape, dtype=bool)
    for lasts, passing in passings:
        found, lack = _spot(ground, reach, passing, aim, (away, farther))
        better = undecided & (lack < short)
        distance = np.where(better, found, distance)
        half = np.where(better, lasts, half)
        short = np.where(better, lack, short)
        undecided &= short > 0.0
        if not np.any(undecided):
            break
    return distance, half


def _reach(limbs: Limbs, settings: StanceSettings) -> _Reach:
    along = limbs.reach
    joint = limbs.touching(settings.planted)
    free, whole = along[joint][:, None], along[-1][:, None]
    stiff = len(along) - joint <= _FEW
    stretch = settings.stretch * limbs.may_stretch
    return _Reach(
        free=free,
        whole=whole,
        peeled=(0.0 if stiff else 1.0 - _LEFT) * (whole - free),
        longer=1.0 + _STRETCHED * stretch,
        slackest=_SLACKEST * (1.0 - _SHORTER * stretch) * free,
    )


def _spot(
    ground: Ground, reach: _Reach, passing: Passing, aim: Floats, wanted: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Distances from the root, and metres that these are wrong by, both (arms, cycles)."""
    (away, farther), roots, nearest = wanted, passing.middle, _NEAREST * reach.whole
    # As it is seen from the root half way through: where it is then, and as the hold begins, as it
    # ends, and as peeling begins.
    seen = np.stack([roots, passing.touch_down, passing.lift_off, passing.peeling])
    aside = seen[..., :2] - roots[..., :2]
    onto = np.sum(aside * aim, axis=-1)
    taut = _TAUT * reach.longer * np.stack([reach.free, reach.free + reach.peeled, reach.free])
    beyond = np.stack([0.0 * reach.free, reach.peeled, 0.0 * reach.free])
    level = onto[1:] ** 2 - np.sum(aside[1:] ** 2, axis=-1)
    found = np.broadcast_to(0.5 * reach.free, aim.shape[:2])
    lack = np.zeros(aim.shape[:2])
    for _ in range(_ROUNDS):
        z = ground.height(roots[..., :2] + found[..., None] * aim)
        above = (seen[..., 2] - z) ** 2
        easy = (_EASY * reach.free) ** 2 - above[0]
        slackest = np.sqrt(np.maximum(reach.slackest**2 - above[:3], nearest**2))
        least = np.maximum(nearest, (onto[:3] + slackest).max(axis=0))
        # |d aim − aside|² ≤ taut² − above, for the largest d.
        inside = level + (taut**2 - above[1:])
        largest = np.sqrt(np.maximum(inside, 0.0)) + onto[1:] - beyond
        lacking = np.where(inside < 0.0, reach.whole, least - largest)
        lack, farthest = np.maximum(lacking.max(axis=0), 0.0), largest.min(axis=0)
        easily = np.sqrt(np.maximum(easy, nearest**2))
        limit = np.minimum(np.where(np.isnan(away), easily, away) + farther, farthest)
        # What is too near looks bad, but what is too far slides.
        found = np.minimum(np.maximum(limit, least), np.maximum(farthest, _CLOSEST * reach.whole))
    return found, lack


def peeled_to(limbs: Limbs, joint: int, joints: Floats, roots: Floats, lasts: Floats) -> Floats:
    """Metres along the arm (arms, cycles) up to which a body at its farthest peels it off.

    From the joint that touches first on, joints (arms, cycles, joints, 3) lie as they are, for so
    many cycles (arms, cycles); the roots are (arms, cycles, 3) then, world.
    """
    along = limbs.reach[joint:]
    first, last = along[0][:, None], along[-1][:, None]
    if len(along) <= _FEW:
        return np.broadcast_to(first, roots.shape[:2]).copy()
    arms, cycles = np.arange(roots.shape[0])[:, None], np.arange(roots.shape[1])
    shares = np.linspace(0.0, 1.0 - _LEFT, _LOOKED_AT)[:, None, None]
    place = shares * (last - first) + first
    number = np.minimum((along[1:-1, None, :, None] < place).sum(axis=0), len(along) - 2)
    low, high = along[number, arms], along[number + 1, arms]
    within = ((place - low) / (high - low))[..., None]
    start, end = joints[arms, cycles, number], joints[arms, cycles, number + 1]
    apart = np.linalg.norm(start + within * (end - start) - roots, axis=-1)
    farthest = np.where(apart >= _SLACK * place, place, first).max(axis=0)
    most = _PEELED_IN_A_CYCLE * limbs.reach[-1][:, None] * lasts
    return np.minimum(farthest, first + most)


# --- Places on uneven ground where an arm lies well -----------------------------------------------
#
# An arm that takes hold on the crest of a bump, and hangs down behind it, is bent where it is
# peeled off: as the body pulls, it has to come over the crest, and does so in a jerk. Just before
# a crest, or behind it, it lies well. So an arm that may choose looks around a little.


_TURNS: Final = np.radians([0.0, -6.0, 6.0, -12.0, 12.0, -18.0, 18.0])
"""Where an arm looks besides straight ahead: half as far, arms of Crawl overlap by 0.044 radii
instead of 0.019 …"""
_STEPS: Final = np.array([0.0, -0.04, 0.04, -0.08, 0.08, -0.12, 0.12])
"""… and nearer or farther, in arm lengths."""
_ASTRAY: Final = np.array([0.25, 0.15])
"""How much worse the farthest of these are, as a share of what a bend of a radian is: half or twice
as much changes no figure by more than a tenth …"""
_BEND: Final = np.radians(14.0)
"""… more than this, by which the ground falls away under an arm that lies on it. At 28° arms of
Crawl overlap by 0.071 radii instead of 0.019."""
_POINTS: Final = np.linspace(0.0, 1.0, 8)


def settled(
    ground: Ground, roots: Floats, aims: Floats, lies: Floats, away: Floats, *, sizes: Floats
) -> tuple[Floats, Floats]:
    """Which way and how far from where they wanted to take hold arms do so.

    Args:
        ground: what they lie on.
        roots: (arms, cycles, 3) where they begin, world.
        aims: (arms, cycles, 2) unit: which way they want to.
        lies: (arms, cycles, 2) unit: which way they lie from there.
        away: (arms, cycles) metres from the root, seen from above; nan where they have no choice.
        sizes: (arms, 2) metres of the whole arm, and of what lies.

    Returns:
        Radians (arms, cycles) anticlockwise, and metres (arms, cycles) by which they are farther.
    """
    turns, farther = np.zeros(away.shape), np.zeros(away.shape)
    arm, cycle = np.nonzero(np.isfinite(away))
    whole, lying = sizes[arm].T

    def badness(chosen: np.ndarray, turn: Floats, step: Floats) -> Floats:
        """Of some of them (chosen, …), tried otherwise (…)."""
        at = arm[chosen], cycle[chosen]
        extra = (slice(None), *[None] * turn.ndim)
        root, length = roots[at][extra], whole[chosen][extra]
        place = root[..., :2] + (away[at][extra] + step * length)[..., None] * rotate_in_plane(
            aims[at][extra], turn
        )
        along = (lying[chosen][extra] * _POINTS.reshape(-1, *[1] * (turn.ndim + 1)))[..., None]
        height = ground.height(place + along * rotate_in_plane(lies[at][extra], turn))
        slope = np.arctan(np.diff(height, axis=0) / (lying[chosen][extra] * _POINTS[1]))
        # The arm comes down to its place, and from there on the ground falls away more.
        comes = np.arctan2(height[0] - root[..., 2], away[at][extra] + step * length)
        falls = np.max(np.maximum.accumulate(np.maximum(slope, comes), axis=0) - slope, axis=0)
        return np.maximum(falls - _BEND, 0.0)

    if not len(arm):
        return turns, farther
    bad = np.flatnonzero(badness(np.arange(len(arm)), np.zeros(()), np.zeros(())) > 0.0)
    if len(bad):
        turn, step = (each.ravel() for each in np.meshgrid(_TURNS, _STEPS, indexing="ij"))
        astray = _ASTRAY[0] * np.abs(turn) / _TURNS.max() + _ASTRAY[1] * np.abs(step) / _STEPS.max()
        best = np.argmin(badness(bad, turn, step) + astray, axis=1)
        at = arm[bad], cycle[bad]
        turns[at], farther[at] = turn[best], step[best] * whole[bad]
    return turns, farther


_BESIDE: Final = np.arange(0.05, 0.85, 0.05)
"""Arm lengths to the side at which an arm looks for ground that finds none where it wants it …"""
_ROUND: Final = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
"""… and in which directions."""
_BRIEF: Final = 0.2
"""How many arm lengths farther are as bad as a hold that is cut down to nothing."""
UNROLLING: Final = 0.3
"""Share of a stance in which the arm lies down, from where it first touches to its tip. At 0.1 an
octopus that walks over bumps slips by 0.0012 arm lengths instead of 0.0005."""
_CURL: Final = np.radians(50.0)
"""Range of the angle by which the part that lies down is bent to one side, from step to step. A
choice of looks: at 100° Crawl turns by 0.19 radians from frame to frame instead of 0.16."""
_EARLIEST: Final = 0.46
"""Cycles before and after its middle that a stance may reach, a little less than to the next one's:
no gait's own does."""


@dataclass(frozen=True, eq=False)
class ContactOverride:
    """What an artist wants of one foothold."""

    arm: int
    cycle: int
    removed: bool = False
    shift: float = 0.0
    """Cycles by which it is later, −0.3…0.3: beyond that a hold would leave its cycle."""
    position: Floats | None = None
    """(3,) where the arm is to touch, world."""
    heading: float | None = None
    """Which way it then lies, radians about world Z from +X."""


@dataclass(frozen=True, eq=False)
class Footholds:
    """The footholds of arms that are built alike, by arm and cycle."""

    first: int
    """Number of the first cycle that is here."""
    touching: int
    """The joint c that touches first."""
    touch_down: Floats
    """(arms, cycles) when the stance begins, in cycles from the middle that the gait gives it."""
    lift_off: Floats
    """(arms, cycles) when it ends."""
    middle: Floats
    """(arms, cycles) halfway between unrolled and peeling."""
    present: np.ndarray
    """(arms, cycles) whether there is one at all."""
    joints: Floats
    """(arms, cycles, segments + 1 − c, 3) world: joints c … n as they lie on the ground."""
    normals: Floats
    """(arms, cycles, segments + 1 − c, 3) which way up the ground is there."""
    skins: Floats
    """(arms, cycles, segments + 1 − c) metres from each of these joints to the skin below it."""
    headings: Floats
    """(arms, cycles) radians about world Z from +X."""
    curls: Floats
    """(arms, cycles) radians by which they are bent to one side on the way to the tip."""
    peeled_to: Floats
    """(arms, cycles) metres along the arm up to which it is peeled off as the stance ends."""
    roots_at_touch_down: Floats
    """(arms, cycles, 3) where the arm's root is as the stance begins, world …"""
    roots_at_lift_off: Floats
    """(arms, cycles, 3) … and as it ends."""

    def peeled(self) -> Floats:
        """(arms, cycles) when it begins to be peeled off."""
        return self.lift_off - PEELING * (self.lift_off - self.touch_down)


def cycles_at(phases: Floats, middle: float) -> tuple[np.ndarray, Floats]:
    """The cycle (…) that arms' phases (…) belong to, and cycles (…) from its stance's middle.

    From half way through one swing to half way through the next it is one cycle.
    """
    turns = (phases - middle) / CYCLE
    number = np.floor(turns + 0.5)
    return number.astype(np.int64), turns - number


def laying(
    limbs: Limbs,
    line: Line,
    ground: Ground,
    settings: StanceSettings,
    timing: ContactTiming,
    *,
    middle: float,
    cycles: tuple[int, int],
    contact_overrides: Sequence[ContactOverride] = (),
    seed: int = 0,
    cyclic: bool = False,
    uneven: UnevenHolds | None = None,
    rough: bool = False,
) -> Generator[None, None, Footholds]:
    """Lay all footholds of some arms, in steps.

    Args:
        limbs: the arms.
        line: the body's way.
        ground: what it walks on.
        settings: how arms hold on.
        timing: when they do.
        middle: phase of the gait, radians, half way through the stance.
        cycles: the first and the last that are wanted.
        contact_overrides: the artist's; of arms by their number in the body.
        seed: of the small differences from step to step.
        cyclic: whether there are none, so that each cycle is like the one before …
        uneven: … but for what holds differ by in place.
        rough: whether they are soon found, and may be a little off.
    """
    joint = limbs.touching(settings.planted)
    # A place hangs on those of its neighbours in the cycles beside it, once for each look at them.
    wide = np.arange(cycles[0] - _LOOKS, cycles[1] + _LOOKS + 1)
    roots = _RootPath(limbs, line, timing, wide, middle / CYCLE)
    curls = _curls(limbs, 0 * wide if cyclic else wide, seed)
    placed = yield from _placing(roots, ground, settings, contact_overrides, uneven, curls=curls)
    placed, numbers = placed.part(slice(_LOOKS, -_LOOKS)), wide[_LOOKS:-_LOOKS]
    skins, curl = _as_if_round(limbs, joint, len(numbers)), placed.curls
    lie = {"skins": skins, "spot": placed.spots, "heading": placed.headings, "curl": curl}
    joints = laid(limbs, ground, joint, **lie, rough=rough)
    yield
    times = _times(replace(roots, numbers=numbers), placed.shift, placed.half)
    touch_down, lift_off, middles, (at_touch_down, at_lift_off) = times
    return Footholds(
        first=cycles[0],
        touching=joint,
        touch_down=touch_down,
        lift_off=lift_off,
        middle=middles,
        present=placed.present,
        joints=joints,
        normals=normals(ground, joints),
        skins=skins,
        headings=placed.headings,
        curls=curl,
        peeled_to=peeled_to(limbs, joint, joints, at_lift_off, lift_off - touch_down),
        roots_at_touch_down=at_touch_down,
        roots_at_lift_off=at_lift_off,
    )


def _as_if_round(limbs: Limbs, joint: int, cycles: int) -> Floats:
    """Metres (arms, cycles, segments + 1 − c) from joints c … n of round arms to the skin below."""
    skins = limbs.radii[joint:].T
    return np.broadcast_to(skins[:, None], (len(skins), cycles, skins.shape[1]))


def _times(roots: _RootPath, shift: Floats, half: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """When stances begin and end, and half way between unrolled and peeling, (arms, cycles) each;
    and where roots are as they begin and end (2, arms, cycles, 3), world.

    Stances that are shifted are told from the middle that the gait gives them.
    """
    touch_down = np.maximum(shift - half, -_EARLIEST)
    lift_off = np.minimum(shift + half, _EARLIEST)
    unrolled = touch_down + UNROLLING * (lift_off - touch_down)
    peeling = lift_off - PEELING * (lift_off - touch_down)
    at_ends = roots.at(np.stack([touch_down, lift_off]))[0]
    return touch_down, lift_off, 0.5 * (unrolled + peeling), at_ends


@dataclass(frozen=True, eq=False)
class _Placed:
    """Where and when arms take hold, (arms, cycles) each."""

    shift: Floats
    """Cycles by which a hold is later than the gait has it …"""
    half: Floats
    """… and half of how long it is."""
    spots: Floats
    """(arms, cycles, 3) where they touch, world …"""
    headings: Floats
    """… and which way they lie from there, radians about Z …"""
    curls: Floats
    """… and by how many they are bent to one side on the way to the tip."""
    present: np.ndarray
    """Whether there is one at all."""

    def part(self, cycles: slice) -> _Placed:
        """Some cycles of them."""
        return _Placed(**{name: each[:, cycles] for name, each in vars(self).items()})


def _placing(
    path: _RootPath,
    ground: Ground,
    settings: StanceSettings,
    contact_overrides: Sequence[ContactOverride],
    uneven: UnevenHolds | None,
    *,
    curls: Floats,
) -> Generator[None, None, _Placed]:
    """Where and when arms take hold, in steps: as the artist wishes, or as they do with ease. What
    lies is usually bent by so much (arms, cycles).
    """
    limbs, numbers = path.limbs, path.numbers
    shape = len(limbs.arms), len(numbers)
    overridden = _overridden(limbs, shape, int(numbers[0]), contact_overrides)
    late, aside, beyond, bent = _differing(uneven, limbs, numbers)
    shift, beside = overridden.shift + late, (aside, beyond, curls + bent)
    spot, lie, half, firm = yield from _finding_places(path, shift, ground, settings, beside)
    spot, heading = overridden.put(spot, np.arctan2(lie[..., 1], lie[..., 0]))
    present = overridden.present & (firm | overridden.moved)
    return _Placed(shift, half, spot, heading, beside[2], present)


@dataclass(frozen=True, eq=False)
class _RootPath:
    """Where the body carries the roots of its arms."""

    limbs: Limbs
    line: Line
    timing: ContactTiming
    numbers: np.ndarray
    """(cycles,) of each arm …"""
    middle: float
    """… and by how much its stance's middle is later, as the gait has it, in cycles."""

    def at(self, since: Floats) -> tuple[Floats, Floats]:
        """World positions (…, arms, cycles, 3) and the body's orientations, at times since then
        (…, arms, cycles).
        """
        centres, rotations = self.line.at(self._distances(since))
        return centres + rotate(rotations, self.limbs.roots[:, None]), rotations

    def duty(self, settings: StanceSettings, shift: Floats) -> Floats:
        """Cycles (arms, cycles) that stances last which are shifted by so many (arms, cycles)."""
        share = self.line.route.share_at(self._distances(shift))
        return values_along(self.line.settings.along.hold, share, settings.duty)

    def holds(self, shift: Floats, half: Floats) -> tuple[Floats, Floats]:
        """Metres (arms, cycles) along the route at which holds begin and end, from their middles
        and half of how long they last, (arms, cycles) in cycles.
        """
        begins, ends = self._distances(np.stack([shift - half, shift + half]))
        return begins, ends

    def _distances(self, since: Floats) -> Floats:
        """Metres (…, arms, cycles) along the route at times since the middles of stances."""
        middles = self.middle + self.numbers.astype(np.float64)
        cycles = np.moveaxis(middles + since, -2, 0)
        return np.moveaxis(self.timing.distances(self.limbs.arms, cycles), 0, -2)


def _finding_places(
    path: _RootPath,
    shift: Floats,
    ground: Ground,
    settings: StanceSettings,
    beside: Sequence[Floats],
) -> Generator[None, None, tuple[Floats, Floats, Floats, np.ndarray]]:
    """Where arms touch (arms, cycles, 3), which way they lie (arms, cycles, 2), half of how long
    they do (arms, cycles), in cycles, and whether at all (arms, cycles); stances (arms, cycles) are
    shifted by so many cycles, places are beside the usual ones by radians and arm lengths (arms,
    cycles), and what lies there is bent to one side by radians (arms, cycles). In steps.
    """
    limbs = path.limbs
    turns, away = path.timing.aims(limbs.arms, path.numbers)
    joint = limbs.touching(settings.planted)
    roots, rotations = path.at(shift)
    aim, lie = (rotate_in_plane(each, turns) for each in _ahead(limbs, rotations))
    sizes = np.stack([limbs.reach[-1], limbs.reach[-1] - limbs.reach[joint]], axis=-1)
    aside, farther = settled(ground, roots, aim, lie, away, sizes=sizes)
    aside, farther = aside + beside[0], farther + beside[1] * limbs.reach[-1][:, None]
    aim, lie = rotate_in_plane(aim, aside), rotate_in_plane(lie, aside)
    yield

    def found(aim: Floats) -> tuple[Floats, Floats]:
        # One after the other, for the first will do for nearly all.
        passings = (
            (times[2], Passing(roots, path.at(shift + np.stack(times))[0]))
            for times in stance_times(path.duty(settings, shift))
        )
        return spots(limbs, ground, settings, passings, aim=aim, away=away, farther=farther)

    distance, half = found(aim)
    yield
    neighbours = Neighbours.of(limbs, *path.holds(shift, half), path.line)
    resting = smooth_step((2.0 * half - _LONG[0]) / (_LONG[1] - _LONG[0]))
    for number in range(_LOOKS):
        seen = roots[..., :2] + distance[..., None] * aim
        turned = neighbours.aside(limbs, joint, (seen, lie, beside[2]), distance, resting)
        turned = turned if number < _BRIEFLY else turned * resting
        if not turned.any():
            break
        aim, lie = rotate_in_plane(aim, turned), rotate_in_plane(lie, turned)
        distance, half = found(aim)
    yield
    spot = roots.copy()
    spot[..., :2] += distance[..., None] * aim
    half = half * _unturned(path, shift, half)
    spot, half, firm = _over_gaps(path, (shift, half), ground, settings, (spot, lie))
    yield
    return spot, lie, half, firm


# --- Feet of neighbours ---------------------------------------------------------------------------
#
# A foothold is laid for its own arm, where that passes it with ease. In a bend, an arm that has
# held on for a while is left behind as the body turns, and its neighbour, which leads, comes down
# right on it: both hold, neither can make way, and they go through each other. So places that would
# come too near to those of a neighbour, or beyond them, are turned away from them, both by half of
# it, before anything moves.

_ROOM: Final = 2.0
"""Sums of both radii that are to be between them. At 1.5 arms are in each other by 0.3 radii on one
winding way of a hurry more."""
_LONGER: Final = 1.2
"""Times as long as holds last for which they are counted: an arm comes down where another is just
leaving. At 1 arms go through each other on eight of twelve winding ways still, at 1.4 on one on
which they did not."""
_ALONG: Final = np.array([0.0, 0.35, 1.0])
"""Where along what lies it is looked at, as shares from where an arm touches to its tip. Without
tips, arms of Settle, which lie long, come down across those of their neighbours on 27 of 40 winding
ways, by two radii of a tip; with them on six."""
_THICK: Final = np.array([1.0, 1.0, 0.2])
"""How thick arms are there, as shares of what they are where they touch."""
_CHORD: Final = 2.0 / 3.0
"""Share of the angle by which what lies is bent to one side that its chord is turned by."""
_HOPS: Final = 2
"""To the how manieth arm it is looked: in a bend the next but one may come down where one holds on
while the one between them swings."""
_UNRELATED: Final = np.radians(100.0)
"""How far apart, as the body sees them, places are that have nothing to do with each other."""
_MOST_ASIDE: Final = np.radians(30.0)
"""By which a place is turned about the arm's root at once."""
_LONG: Final = (0.6, 0.65)
"""Cycles of a hold from which on, and at which, tips count: those of shorter ones are off the
ground before others come. If they always do, arms turn by 29° in a frame where a swim begins."""
_BRIEFLY: Final = 2
"""How often it is looked whether arms are apart that hold on for less …"""
_LOOKS: Final = 6
"""… and at most: an arm that is turned away from one comes to be near to another. With two, tips
are still across others on seven of fourteen of those ways."""


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Holds of arms next to each other that meet in time: of one and of the next anticlockwise."""

    arms: tuple[np.ndarray, np.ndarray]
    """Numbers (pairs,) among the limbs …"""
    cycles: tuple[np.ndarray, np.ndarray]
    """… and (pairs,) of their cycles."""
    centres: Floats
    """(2, 1, pairs, 2) where the body is as both begin to hold and as one lets go, from above."""

    @classmethod
    def of(cls, limbs: Limbs, begins: Floats, ends: Floats, line: Line) -> Neighbours:
        """Of holds that last from distances (arms, cycles) along the line to others."""
        holding = np.arange(len(limbs.arms))
        if limbs.free is not None:
            holding = holding[~limbs.free]
        angles = np.arctan2(limbs.roots[holding, 1], limbs.roots[holding, 0])
        order = np.argsort(angles)
        pairs = []
        for hop in range(1, min(_HOPS, len(order) - 1) + 1):
            gaps = np.mod(np.roll(angles[order], -hop) - angles[order], 2.0 * np.pi)
            # Across the open side of those that do not stand all round, nobody is a neighbour.
            near = (gaps > 0.0) & (gaps < np.pi)
            pairs.append([holding[order][near], holding[np.roll(order, -hop)][near]])
        one, other = np.concatenate(pairs, axis=1) if pairs else np.zeros((2, 0), dtype=np.int64)
        middle, half = 0.5 * (begins + ends), 0.5 * _LONGER * (ends - begins)
        low, high = middle - half, middle + half
        # The other's holds in the cycle before, in the same one, and in the next.
        beside = [
            np.pad(each[other], ((0, 0), (1, 1)), constant_values=np.nan) for each in (low, high)
        ]
        shifted = np.stack([np.arange(begins.shape[1]) + step for step in range(3)])
        first = np.maximum(low[one][:, None], beside[0][:, shifted])
        last = np.minimum(high[one][:, None], beside[1][:, shifted])
        pair, step, cycle = np.nonzero(last > first)
        chosen = pair, step, cycle
        centres = line.at(np.stack([first[chosen], last[chosen]]))[0][:, None, :, :2]
        return cls((one[pair], other[pair]), (cycle, cycle + step - 1), centres)

    def aside(
        self,
        limbs: Limbs,
        joint: int,
        lies: tuple[Floats, Floats, Floats],
        distance: Floats,
        resting: Floats,
    ) -> Floats:
        """Radians (arms, cycles), anticlockwise, by which places are to be turned about the roots.

        Args:
            limbs: the arms.
            joint: the one that touches first.
            lies: (arms, cycles, 2) where it does, seen from above, unit vectors (arms, cycles, 2)
                along which arms lie from there, and radians (arms, cycles) by which they are bent.
            distance: (arms, cycles) metres from the roots to there.
            resting: (arms, cycles) how far tips count, 0…1: those of holds that are long.
        """
        spots, lie, curls = lies
        lying = (limbs.reach[-1] - limbs.reach[joint])[:, None] * _ALONG
        places, away, out = [], [], []
        for arm, cycle in zip(self.arms, self.cycles, strict=True):
            far = lying[arm].T
            aside = np.multiply.outer(_CHORD * _ALONG**2, curls[arm, cycle])
            way = np.broadcast_to(lie[arm, cycle], (*aside.shape, 2))
            place = spots[arm, cycle] + far[..., None] * rotate_in_plane(way, aside)
            places.append(place - self.centres)
            away.append(np.linalg.norm(places[-1], axis=-1))
            out.append(np.maximum(distance[arm, cycle] + far, 1e-9))
        (ax, ay), (bx, by) = (np.moveaxis(each, -1, 0) for each in places)
        between = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        wide = limbs.radii[joint][self.arms[0]] + limbs.radii[joint][self.arms[1]]
        needed = _ROOM * _THICK[:, None] * wide / np.maximum(0.5 * (away[0] + away[1]), 1e-9)
        lacks = np.where(np.abs(between) < _UNRELATED, np.maximum(needed - between, 0.0), 0.0)
        one, other = (resting[where] for where in zip(self.arms, self.cycles, strict=True))
        lacks[:, -1] *= np.minimum(one, other)
        back, forth = np.zeros(distance.shape), np.zeros(distance.shape)
        for number, result in ((0, back), (1, forth)):
            turns = np.minimum(0.5 * lacks * away[number] / out[number], _MOST_ASIDE).max(
                axis=(0, 1)
            )
            np.maximum.at(result, (self.arms[number], self.cycles[number]), turns)
        return forth - back


def _differing(uneven: UnevenHolds | None, limbs: Limbs, cycles: np.ndarray) -> Floats:
    """What holds in cycles (cycles,) differ by (4, arms, cycles), as ``UnevenHolds`` has it."""
    if uneven is None:
        return np.zeros((4, len(limbs.arms), len(cycles)))
    return uneven.of(limbs.arms, cycles)


def _unturned(path: _RootPath, shift: Floats, half: Floats) -> Floats:
    """Shares (arms, cycles) that holds are cut down to where the body turns too far meanwhile.

    An arm that lies where it lies while the body turns is wound round it, and lets go wildly.
    """
    ways, _ = _ahead(path.limbs, path.at(shift + half * np.reshape([-1.0, 0.0, 1.0], (3, 1, 1)))[1])
    turned = np.arccos(np.clip(np.sum(ways[1:] * ways[:-1], axis=-1), -1.0, 1.0)).sum(axis=0)
    return 1.0 / (1.0 + np.maximum(turned / _WOUND - 1.0, 0.0))


def _over_gaps(
    path: _RootPath,
    times: tuple[Floats, Floats],
    ground: Ground,
    settings: StanceSettings,
    places: tuple[Floats, Floats],
) -> tuple[Floats, Floats, np.ndarray]:
    """Footholds that would be over a gap, laid beside it.

    Args:
        path: of the arms' roots.
        times: (arms, cycles) cycles by which a hold is shifted, and half of how long it is.
        ground: what there is.
        settings: how arms hold on.
        places: (arms, cycles, 3) where they touch, (arms, cycles, 2) which way they lie from there.

    Returns:
        Places (arms, cycles, 3), half of the holds' times (arms, cycles), and whether there is one
        at all (arms, cycles): an arm that finds no ground passes over the gap in the air.
    """
    (shift, half), (spot, lie) = times, places
    firm = np.ones(shift.shape, dtype=bool)
    if not isinstance(ground, HeightField) or ground.gaps is None:
        return spot, half, firm
    reach, limbs = _reach(path.limbs, settings), path.limbs
    lying = np.broadcast_to(reach.whole - reach.free, shift.shape)
    arm, cycle = np.nonzero(_in_gap(ground, spot, lie, lying))
    if not len(arm):
        return spot, half, firm
    whole = reach.whole[arm, 0]
    away, angle = (each.ravel() for each in np.meshgrid(_BESIDE, _ROUND, indexing="ij"))
    aside = away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    tried = np.repeat(spot[arm, cycle][:, None], len(aside), axis=1)
    tried[..., :2] += whole[:, None, None] * aside
    tried[..., 2] = ground.height(tried)
    ways = np.broadcast_to(lie[arm, cycle][:, None], (*tried.shape[:2], 2))
    good = ~_in_gap(ground, tried, ways, lying[arm, cycle][:, None])
    far = _TAUT * reach.longer * limbs.reach[limbs.touching(settings.planted)]
    # For as long as the arm reaches there.
    best, share = np.full(good.shape, np.inf), np.zeros(good.shape)
    for part in _SHORTENED:
        ends = [path.at(shift + each * part * half)[0][arm, cycle] for each in (-1.0, 0.0, 1.0)]
        apart = [np.linalg.norm(tried - each[:, None], axis=-1) for each in ends]
        can = good & (np.max(apart, axis=0) <= far[arm, None]) & (share == 0.0)
        best = np.where(can, away + _BRIEF * (1.0 - part), best)
        share = np.where(can, part, share)
    chosen = np.argmin(best, axis=1)
    row = np.arange(len(arm))
    spot, half = spot.copy(), half.copy()
    spot[arm, cycle] = tried[row, chosen]
    half[arm, cycle] *= np.maximum(share[row, chosen], min(_SHORTENED))
    firm[arm, cycle] = np.isfinite(best[row, chosen])
    return spot, half, firm


def _in_gap(ground: HeightField, spot: Floats, lie: Floats, lying: Floats) -> np.ndarray:
    """Whether arms (…) that lie from somewhere (…, 3) on would be over a gap with some of them.

    They lie along unit vectors (…, 2), so many metres (…).
    """
    along = (lying[..., None] * _POINTS)[..., None]
    found = np.zeros(spot.shape[:-1], dtype=bool)
    # Where they are bent to one side, too.
    for aside in (-0.5 * _CURL, 0.0, 0.5 * _CURL):
        way = rotate_in_plane(lie, np.full(lie.shape[:-1], aside))
        found |= ground.is_gap(spot[..., None, :2] + along * way[..., None, :]).any(axis=-1)
    return found


def relaid(footholds: Footholds, limbs: Limbs, ground: Ground, skins: Floats) -> Footholds:
    """The same footholds of arms that lie otherwise.

    Skins (arms, cycles, segments + 1 − c) are metres from each joint to the skin below it.
    """
    joint, spot = footholds.touching, footholds.joints[:, :, 0]
    heading, curl = footholds.headings, footholds.curls
    lasts = footholds.lift_off - footholds.touch_down
    joints = laid(limbs, ground, joint, skins=skins, spot=spot, heading=heading, curl=curl)
    return replace(
        footholds,
        joints=joints,
        normals=normals(ground, joints),
        skins=skins,
        peeled_to=peeled_to(limbs, joint, joints, footholds.roots_at_lift_off, lasts),
    )


@dataclass(frozen=True, eq=False)
class _Overridden:
    """Wishes by arm and cycle, (arms, cycles)."""

    present: np.ndarray
    shift: Floats
    moved: np.ndarray
    places: Floats
    turned: np.ndarray
    headings: Floats

    def put(self, spot: Floats, heading: Floats) -> tuple[Floats, Floats]:
        """Places (arms, cycles, 3) and headings (arms, cycles), but where others are wished for."""
        places = np.where(self.moved[..., None], self.places, spot)
        return places, np.where(self.turned, self.headings, heading)


def _overridden(
    limbs: Limbs, shape: tuple[int, int], first: int, contact_overrides: Sequence[ContactOverride]
) -> _Overridden:
    present, moved, turned = np.ones(shape, dtype=bool), *np.zeros((2, *shape), dtype=bool)
    places, (shift, headings) = np.zeros((*shape, 3)), np.zeros((2, *shape))
    if limbs.free is not None:
        present[limbs.free] = False
    for override in contact_overrides:
        if override.arm not in limbs.arms or not 0 <= override.cycle - first < shape[1]:
            continue
        at = limbs.arms.index(override.arm), override.cycle - first
        present[at], shift[at] = present[at] and not override.removed, override.shift
        if override.position is not None:
            moved[at], places[at] = True, override.position
        if override.heading is not None:
            turned[at], headings[at] = True, override.heading
    return _Overridden(present, shift, moved, places, turned, headings)


def _ahead(limbs: Limbs, rotations: Floats) -> tuple[Floats, Floats]:
    """Which way arms of a body's orientations (…, arms, cycles, 4) point, and lie, seen from above:
    unit vectors (…, arms, cycles, 2) both.
    """
    ahead = np.zeros((len(limbs.arms), 2, 3))
    ahead[..., 0], ahead[..., 1] = np.cos(limbs.aims), np.sin(limbs.aims)
    ahead = rotate(limbs.outward[:, None], ahead)
    ahead = rotate(rotations[..., None, :], ahead[:, None])[..., :2]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
    return ahead[..., 0, :], ahead[..., 1, :]


def _curls(limbs: Limbs, cycles: np.ndarray, seed: int) -> Floats:
    """Radians (arms, cycles) by which arms are bent to one side on the way to the tip.

    They are random, but hang on arm, cycle and seed alone.
    """
    arms = np.array(limbs.arms)[:, None]
    mixed = np.sin(12.9898 * (arms + 1.0) + 78.233 * (cycles + 0.5) + 37.719 * (seed + 1.0))
    return _CURL * (np.mod(43758.5453 * mixed, 1.0) - 0.5)
