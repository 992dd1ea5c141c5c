# SPDX-License-Identifier: GPL-3.0-or-later
"""Where and when arms hold on to the ground.

An arm holds on once in each cycle of its gait. A foothold belongs to an arm and the number of its
cycle and hangs on nothing else: not on frames, nor on footholds before it. It is laid where the
gait wants it as the body passes, half way through the hold, and near enough for the arm to keep
it while the body moves on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...rotations import Floats, rotate, rotate_in_plane
from ..gait import CYCLE
from ..path import Line
from .contact_curve import laid
from .contact_timing import ContactTiming
from .foothold_reach import PEELING, Passing, Spots, peeled_to, spots, stance_times
from .foothold_relaxation import settled
from .stance_settings import Limbs, StanceSettings
from .surface import Ground, normals

UNROLLING: Final = 0.3
"""Share of a stance in which the arm lies down, from where it first touches to its tip. At 0.1 an
octopus that walks over bumps slips by 0.0012 arm lengths instead of 0.0005."""
_CURL: Final = np.radians(50.0)
"""Range of the angle by which the part that lies down is bent to one side, from step to step."""
_EARLIEST: Final = 0.46
"""Cycles before and after its middle that a hold may reach."""


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
    """(arms, cycles) when the hold begins, in cycles from the middle that the gait gives it."""
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
    """(arms, cycles) metres along the arm up to which it is peeled off as the hold ends."""
    roots_at_touch_down: Floats
    """(arms, cycles, 3) where the arm's root is as the hold begins, world …"""
    roots_at_lift_off: Floats
    """(arms, cycles, 3) … and as it ends."""
    short: Floats
    """(arms, cycles) metres that it is out of reach."""

    def unrolled(self) -> Floats:
        """(arms, cycles) when all of it lies down."""
        return self.touch_down + UNROLLING * (self.lift_off - self.touch_down)

    def peeled(self) -> Floats:
        """(arms, cycles) when it begins to be peeled off."""
        return self.lift_off - PEELING * (self.lift_off - self.touch_down)


def cycles_at(phases: Floats, middle: float) -> tuple[np.ndarray, Floats]:
    """The cycle (…) that arms' phases (…) belong to, and cycles (…) from its hold's middle.

    From half way through one swing to half way through the next it is one cycle.
    """
    turns = (phases - middle) / CYCLE
    number = np.floor(turns + 0.5)
    return number.astype(np.int64), turns - number


def lay(
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
) -> Footholds:
    """Lay all footholds of some arms.

    Args:
        limbs: the arms.
        line: the body's way.
        ground: what it walks on.
        settings: how arms hold on.
        timing: when they do.
        middle: phase of the gait, radians, half way through the hold.
        cycles: the first and the last that are wanted.
        contact_overrides: the artist's; of arms by their number in the body.
        seed: of the small differences from step to step.
        cyclic: whether there are none, so that each cycle is like the one before.
    """
    first, last = cycles
    numbers = np.arange(first, last + 1)
    shape = len(limbs.arms), len(numbers)
    overridden = _overridden(limbs, shape, first, contact_overrides)
    roots = _RootPath(limbs, line, timing, numbers, middle / CYCLE)
    curl = _curls(limbs, 0 * numbers if cyclic else numbers, seed)
    joint = limbs.touching(settings.planted)
    spot, lie, found = _places(roots, overridden.shift, ground, settings)
    spot = np.where(overridden.moved[..., None], overridden.places, spot)
    heading = np.where(overridden.turned, overridden.headings, np.arctan2(lie[..., 1], lie[..., 0]))
    skins = _round_skins(limbs, joint, len(numbers))
    joints = laid(limbs, ground, joint, skins=skins, spot=spot, heading=heading, curl=curl)
    touch_down, lift_off, middles = _times(overridden.shift, found.half)
    at_touch_down, at_lift_off = roots.at(touch_down)[0], roots.at(lift_off)[0]
    return Footholds(
        first=first,
        touching=joint,
        touch_down=touch_down,
        lift_off=lift_off,
        middle=middles,
        present=overridden.present,
        joints=joints,
        normals=normals(ground, joints),
        skins=skins,
        headings=heading,
        curls=curl,
        peeled_to=peeled_to(limbs, joint, joints, at_lift_off),
        roots_at_touch_down=at_touch_down,
        roots_at_lift_off=at_lift_off,
        short=found.short,
    )


def _times(shift: Floats, half: Floats) -> tuple[Floats, Floats, Floats]:
    """When stances begin and end, and half way between unrolled and peeling, (arms, cycles) each.

    Stances that are shifted are told from the middle that the gait gives them.
    """
    touch_down = np.maximum(shift - half, -_EARLIEST)
    lift_off = np.minimum(shift + half, _EARLIEST)
    unrolled = touch_down + UNROLLING * (lift_off - touch_down)
    peeling = lift_off - PEELING * (lift_off - touch_down)
    return touch_down, lift_off, 0.5 * (unrolled + peeling)


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
        """World positions (arms, cycles, 3) and the body's orientations, at times since then."""
        middles = self.middle + self.numbers.astype(np.float64)
        distances = self.timing.distances(self.limbs.arms, middles + since)
        centres, rotations = self.line.at(distances)
        return centres + rotate(rotations, self.limbs.roots[:, None]), rotations


def _places(
    path: _RootPath, shift: Floats, ground: Ground, settings: StanceSettings
) -> tuple[Floats, Floats, Spots]:
    """Where arms touch (arms, cycles, 3), which way they lie (arms, cycles, 2), for how long.

    Args:
        path: of the arms' roots.
        shift: (arms, cycles) by how much stances are later than the gait has them.
        ground: what they touch.
        settings: how arms hold on.
    """
    limbs = path.limbs
    turns, away = path.timing.aims(limbs.arms, path.numbers)
    joint = limbs.touching(settings.planted)
    roots, rotations = path.at(shift)
    aim, lie = (rotate_in_plane(each, turns) for each in _ahead(limbs, rotations))
    sizes = np.stack([limbs.reach[-1], limbs.reach[-1] - limbs.reach[joint]], axis=-1)
    aside, farther = settled(ground, roots, aim, lie, away, sizes=sizes)
    aim, lie = rotate_in_plane(aim, aside), rotate_in_plane(lie, aside)
    # One after the other, for the first will do for nearly all.
    passings = (
        Passing(roots, [path.at(shift + each)[0] for each in times])
        for times in stance_times(settings)
    )
    found = spots(limbs, ground, settings, passings, aim=aim, away=away + farther)
    spot = roots.copy()
    spot[..., :2] += found.distance[..., None] * aim
    return spot, lie, found


def relaid(footholds: Footholds, limbs: Limbs, ground: Ground, skins: Floats) -> Footholds:
    """The same footholds of arms that lie otherwise.

    Args:
        footholds: of these arms.
        limbs: the arms.
        ground: what they lie on.
        skins: (arms, cycles, segments + 1 − c) metres from each joint to the skin below it.
    """
    joint, spot = footholds.touching, footholds.joints[:, :, 0]
    turns = {"heading": footholds.headings, "curl": footholds.curls}
    joints = laid(limbs, ground, joint, skins=skins, spot=spot, **turns)
    return replace(
        footholds,
        joints=joints,
        normals=normals(ground, joints),
        skins=skins,
        peeled_to=peeled_to(limbs, joint, joints, footholds.roots_at_lift_off),
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
    """Which way arms point, and lie, seen from above: unit vectors (arms, cycles, 2) both."""
    ahead = np.zeros((len(limbs.arms), 2, 3))
    ahead[..., 0], ahead[..., 1] = np.cos(limbs.aims), np.sin(limbs.aims)
    ahead = rotate(limbs.outward[:, None], ahead)
    ahead = rotate(rotations[:, :, None], ahead[:, None])[..., :2]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
    return ahead[:, :, 0], ahead[:, :, 1]


def _round_skins(limbs: Limbs, joint: int, cycles: int) -> Floats:
    """Metres (arms, cycles, segments + 1 − c) from joints to the skin below, if it is round."""
    own = limbs.radii[joint:].T[:, None]
    return np.broadcast_to(own, (len(limbs.arms), cycles, own.shape[-1]))


def _curls(limbs: Limbs, cycles: np.ndarray, seed: int) -> Floats:
    """Radians (arms, cycles) by which arms are bent to one side on the way to the tip."""
    return _CURL * (_hash(np.array(limbs.arms)[:, None], cycles, seed) - 0.5)


def _hash(arms: np.ndarray, cycles: np.ndarray, seed: int) -> Floats:
    """Numbers (arms, cycles) from 0 to 1 that hang on arm, cycle and seed alone."""
    mixed = np.sin(12.9898 * (arms + 1.0) + 78.233 * (cycles + 0.5) + 37.719 * (seed + 1.0))
    return np.mod(43758.5453 * mixed, 1.0)
