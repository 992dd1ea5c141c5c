# SPDX-License-Identifier: GPL-3.0-or-later
"""Where and when arms hold on to the ground.

An arm holds on once in each cycle of its gait. A foothold belongs to an arm and the number of its
cycle and hangs on nothing else: not on frames, nor on footholds before it. It is laid where the
gait wants it as the body passes, half way through the hold, and near enough for the arm to keep
it while the body moves on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..errors import SettingsError
from ..rotations import Floats, rotate
from .course import Line
from .ground import Ground, normals
from .rhythm import Rhythm

_CYCLE: Final = 2.0 * np.pi
UNROLLING: Final = 0.3
"""Share of a hold in which the arm lies down, from where it first touches to its tip."""
PEELING: Final = 0.5
"""Share of a hold in which the arm is peeled off, in the same direction, as the body pulls."""
_SLACK: Final = 0.84
"""Distance from root to where it is peeled off, as a share of the arm between, that peels no more."""
_FEW: Final = 2
"""Joints that lie down of an arm that is too stiff to be peeled off."""
_LEFT: Final = 0.4
"""Share of the part that lies down which is not peeled off, but let go with the tip."""
_EASY: Final = 0.80
"""Distance from root to foothold half way through, as a share of the arm between them."""
_TAUT: Final = 0.94
"""The same at its longest."""
_SLACKEST: Final = 0.55
"""The same at its shortest: an arm that is slacker has to fold."""
_SHORTER: Final = 0.5
"""Share of the most stretch by which a bone that may stretch may get shorter."""
_STRETCHED: Final = 0.6
"""Share of the most stretch that footholds are laid for."""
_NEAREST: Final = 0.20
"""Arm lengths from the root, seen from above."""
_CLOSEST: Final = 0.05
"""The same where there is no other way."""
_SHORTENED: Final = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)
"""Shares of its time that a hold may be cut down to where the body moves on too far."""
_CURL: Final = np.radians(50.0)
"""Range of the angle by which the part that lies down is bent to one side, from step to step."""
_EARLIEST: Final = 0.46
"""Cycles before and after its middle that a hold may reach."""


@dataclass(frozen=True)
class StanceSettings:
    """How arms hold on to the ground. Lengths in arm lengths, angles in radians."""

    duty: float = 0.55
    """Share of the cycle that an arm holds on."""
    planted: float = 0.3
    """Share of the arm that lies down."""
    stretch: float = 0.4
    """How much longer bones may get that may stretch."""
    lift: float = 0.06
    """How far above the ground an arm is moved at least."""
    lean: float = 0.7
    """How far the body leans with the ground."""
    smoothing: float = 0.35
    """How far along the way the body evens the ground out."""

    def __post_init__(self) -> None:
        numbers = (self.duty, self.planted, self.stretch, self.lift, self.lean, self.smoothing)
        if not np.all(np.isfinite(numbers)):
            raise SettingsError("A setting of the ground is not a number.", "Set it anew.")
        if not 0.1 <= self.duty <= 0.85:
            raise SettingsError(
                f"Arms hold on for {self.duty:g} of the cycle.", "Give 0.1 to 0.85."
            )
        if not 0.1 <= self.planted <= 0.8:
            raise SettingsError(
                f"{self.planted:g} of each arm lies on the ground.", "Give 0.1 to 0.8."
            )


@dataclass(frozen=True, eq=False)
class Wish:
    """What an artist wants of one foothold."""

    arm: int
    cycle: int
    removed: bool = False
    shift: float = 0.0
    """Cycles by which it is later."""
    position: Floats | None = None
    """(3,) where the arm is to touch, world."""
    heading: float | None = None
    """Which way it then lies, radians about world Z from +X."""


@dataclass(frozen=True, eq=False)
class Limbs:
    """Arms that are built alike, in the world's measure."""

    arms: tuple[int, ...]
    """Their numbers among all arms of the body."""
    roots: Floats
    """(arms, 3) metres from the body's centre, in the body's frame."""
    outward: Floats
    """(arms, 4) from an arm's own frame, x outward and z up, to the body's."""
    offsets: Floats
    """(arms,) radians that each arm's phase is ahead of the body's."""
    lengths: Floats
    """(segments, arms) metres."""
    radii: Floats
    """(segments + 1, arms) metres from each joint to the skin below it."""
    aims: Floats
    """(arms, 2) radians about the arm's vertical: where the gait has the foothold, and which way
    the arm lies from there, from straight outward."""
    may_stretch: bool = False
    free: np.ndarray | None = None
    """(arms,) whether the gait keeps an arm off the ground, none if it keeps no arm off."""

    @property
    def reach(self) -> Floats:
        """(segments + 1, arms) metres along the arm to each joint."""
        return np.concatenate([0.0 * self.lengths[:1], np.cumsum(self.lengths, axis=0)])

    def touching(self, planted: float) -> int:
        """The joint that touches first, so that about a share of the arm lies beyond it."""
        along = self.reach[:, 0] / self.reach[-1, 0]
        free = int(np.argmin(np.abs(along - (1.0 - planted))))
        return int(np.clip(free, min(2, len(self.lengths) - 1), len(self.lengths) - 1))


@dataclass(frozen=True, eq=False)
class Footholds:
    """The footholds of arms that are built alike, by arm and cycle."""

    first: int
    """Number of the first cycle that is here."""
    touching: int
    """The joint c that touches first."""
    on: Floats
    """(arms, cycles) when the hold begins, in cycles from the middle that the gait gives it."""
    off: Floats
    """(arms, cycles) when it ends."""
    middle: Floats
    """(arms, cycles) halfway between unrolled and peeling."""
    present: np.ndarray
    """(arms, cycles) whether there is one at all."""
    joints: Floats
    """(arms, cycles, segments + 1 − c, 3) world: joints c … n as they lie on the ground."""
    normals: Floats
    """(arms, cycles, segments + 1 − c, 3) which way up the ground is there."""
    headings: Floats
    """(arms, cycles) radians about world Z from +X."""
    peeled_to: Floats
    """(arms, cycles) metres along the arm up to which it is peeled off as the hold ends."""
    roots_on: Floats
    """(arms, cycles, 3) where the arm's root is as the hold begins, world …"""
    roots_off: Floats
    """(arms, cycles, 3) … and as it ends."""
    short: Floats
    """(arms, cycles) metres that it is out of reach."""

    def unrolled(self) -> Floats:
        """(arms, cycles) when all of it lies down."""
        return self.on + UNROLLING * (self.off - self.on)

    def peeled(self) -> Floats:
        """(arms, cycles) when it begins to be peeled off."""
        return self.off - PEELING * (self.off - self.on)


def cycles_at(phases: Floats, middle: float) -> tuple[np.ndarray, Floats]:
    """The cycle (…) that arms' phases (…) belong to, and cycles (…) from its hold's middle.

    From half way through one swing to half way through the next it is one cycle.
    """
    turns = (phases - middle) / _CYCLE
    number = np.floor(turns + 0.5)
    return number.astype(np.int64), turns - number


def lay(
    limbs: Limbs,
    line: Line,
    ground: Ground,
    settings: StanceSettings,
    rhythm: Rhythm,
    *,
    middle: float,
    cycles: tuple[int, int],
    wishes: Sequence[Wish] = (),
    seed: int = 0,
) -> Footholds:
    """Lay all footholds of some arms.

    Args:
        limbs: the arms.
        line: the body's way.
        ground: what it walks on.
        settings: how arms hold on.
        rhythm: when they do.
        middle: phase of the gait, radians, half way through the hold.
        cycles: the first and the last that are wanted.
        wishes: the artist's; of arms by their number in the body.
        seed: of the small differences from step to step.
    """
    first, last = cycles
    count, arms = last - first + 1, len(limbs.arms)
    numbers = np.arange(first, last + 1)
    shift, present = np.zeros((arms, count)), np.ones((arms, count), dtype=bool)
    if limbs.free is not None:
        present[limbs.free] = False
    moved = np.zeros((arms, count), dtype=bool)
    turned = np.zeros((arms, count), dtype=bool)
    places, headings_wanted = np.zeros((arms, count, 3)), np.zeros((arms, count))
    for wish in wishes:
        if wish.arm not in limbs.arms or not first <= wish.cycle <= last:
            continue
        at = limbs.arms.index(wish.arm), wish.cycle - first
        present[at], shift[at] = present[at] and not wish.removed, wish.shift
        if wish.position is not None:
            moved[at], places[at] = True, wish.position
        if wish.heading is not None:
            turned[at], headings_wanted[at] = True, wish.heading

    # Metres along the route at which the body is half way through each hold.
    given: Floats = np.broadcast_to(middle / _CYCLE + numbers.astype(np.float64), (arms, count))
    centre = rhythm.distances(limbs.arms, given + shift)
    body, rotations = line.at(centre)
    roots = body + rotate(rotations, limbs.roots[:, None])
    # Which way the arm points, and lies, seen from above.
    ahead = np.zeros((arms, 2, 3))
    ahead[..., 0], ahead[..., 1] = np.cos(limbs.aims), np.sin(limbs.aims)
    ahead = rotate(limbs.outward[:, None], ahead)
    ahead = rotate(rotations[:, :, None], ahead[:, None])[..., :2]
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
    aim, lie = ahead[:, :, 0], ahead[:, :, 1]

    joint = limbs.touching(settings.planted)
    along = limbs.reach
    free, whole = along[joint][:, None], along[-1][:, None]
    crowded = _SLACKEST * (1.0 - _SHORTER * settings.stretch * limbs.may_stretch)
    longer = 1.0 + _STRETCHED * settings.stretch * limbs.may_stretch
    distance = np.zeros((arms, count))
    half = np.zeros((arms, count))
    short = np.full((arms, count), np.inf)
    open_ = np.ones((arms, count), dtype=bool)
    # How much of the part that lies down is peeled off at the farthest.
    stiff = len(along) - joint <= _FEW
    peeled = 0.0 if stiff else (1.0 - _LEFT) * (whole - free)
    for share in _SHORTENED:
        width = settings.duty * share
        times = (-0.5 * width, (0.5 - PEELING) * width, 0.5 * width)
        seen = [
            _roots(limbs, line, rhythm.distances(limbs.arms, given + shift + each))
            for each in times
        ]
        reaches = (_TAUT * longer * free, _TAUT * longer * free, _TAUT * longer * (free + peeled))
        beyond = (0.0, 0.0, peeled)
        nearest = _NEAREST * whole
        found = np.full((arms, count), 0.5) * free
        for _ in range(3):
            spot = roots[..., :2] + found[..., None] * aim
            z = ground.height(spot)
            easy = (_EASY * free) ** 2 - (roots[..., 2] - z) ** 2
            limit = np.sqrt(np.maximum(easy, nearest**2))
            least = np.broadcast_to(nearest, limit.shape)
            for root in (seen[0], roots, seen[-1]):
                onto = np.sum((root[..., :2] - roots[..., :2]) * aim, axis=-1)
                loosest = (crowded * free) ** 2 - (root[..., 2] - z) ** 2
                least = np.maximum(least, onto + np.sqrt(np.maximum(loosest, nearest**2)))
            lack, farthest = np.zeros((arms, count)), np.full((arms, count), np.inf)
            for root, far, extra in zip(seen, reaches, beyond, strict=True):
                level = far**2 - (root[..., 2] - z) ** 2
                apart = roots[..., :2] - root[..., :2]
                # |apart + d aim|² ≤ level, for the largest d.
                onto = np.sum(apart * aim, axis=-1)
                inside = onto**2 - np.sum(apart**2, axis=-1) + level
                largest = np.sqrt(np.maximum(inside, 0.0)) - onto - extra
                lack = np.maximum(lack, np.where(inside < 0.0, whole, least - largest))
                farthest = np.minimum(farthest, largest)
            # What is too near looks bad, but what is too far slides.
            found = np.minimum(np.maximum(limit, least), np.maximum(farthest, _CLOSEST * whole))
        better = open_ & (lack < short)
        distance = np.where(better, found, distance)
        half = np.where(better, 0.5 * width, half)
        short = np.where(better, lack, short)
        open_ &= short > 0.0
        if not np.any(open_):
            break
    spot = roots.copy()
    spot[..., :2] += distance[..., None] * aim
    spot = np.where(moved[..., None], places, spot)
    side = _hash(np.array(limbs.arms)[:, None], numbers, seed)
    heading = np.arctan2(lie[..., 1], lie[..., 0])
    heading = np.where(turned, headings_wanted, heading)
    joints = _laid(limbs, ground, spot, heading, _CURL * (side - 0.5), joint)
    on = np.maximum(shift - half, -_EARLIEST)
    off = np.minimum(shift + half, _EARLIEST)
    between = 0.5 * ((on + UNROLLING * (off - on)) + (off - PEELING * (off - on)))
    # Shifted holds are told from the middle that the gait gives them.
    roots_on, roots_off = (
        _roots(limbs, line, rhythm.distances(limbs.arms, given + each)) for each in (on, off)
    )
    return Footholds(
        first=first,
        touching=joint,
        on=on,
        off=off,
        middle=between,
        present=present,
        joints=joints,
        normals=normals(ground, joints),
        headings=heading,
        peeled_to=_peeled_to(limbs, joints, roots_off, joint),
        roots_on=roots_on,
        roots_off=roots_off,
        short=np.maximum(short, 0.0),
    )


def _peeled_to(limbs: Limbs, joints: Floats, roots: Floats, joint: int) -> Floats:
    """Metres along the arm (arms, cycles) up to which a body at its farthest peels it off."""
    along = limbs.reach[joint:]
    first, last = along[0][:, None], along[-1][:, None]
    result = np.broadcast_to(first, roots.shape[:2]).copy()
    if len(along) <= _FEW:
        return result
    share = np.linspace(0.0, 1.0 - _LEFT, 16)
    for each in share:
        place = each * (last - first) + first
        number = np.clip((along[1:-1, :, None] < place).sum(axis=0), 0, len(along) - 2)
        number = np.broadcast_to(number, result.shape)
        arms, cycles = np.indices(result.shape)
        low, high = along[number, arms], along[number + 1, arms]
        within = ((place - low) / (high - low))[..., None]
        start, end = joints[arms, cycles, number], joints[arms, cycles, number + 1]
        apart = np.linalg.norm(start + within * (end - start) - roots, axis=-1)
        result = np.where(apart >= _SLACK * place, np.maximum(result, place), result)
    return result


def _roots(limbs: Limbs, line: Line, distance: Floats) -> Floats:
    centre, rotations = line.at(distance)
    return centre + rotate(rotations, limbs.roots[:, None])


def _laid(
    limbs: Limbs, ground: Ground, spot: Floats, heading: Floats, curl: Floats, joint: int
) -> Floats:
    """Joints c … n (arms, cycles, joints, 3) on the ground, segments as long as they are."""
    radii, lengths = limbs.radii[joint:], limbs.lengths[joint:]
    span = np.maximum(lengths.sum(axis=0), 1e-12)
    place = spot.copy()
    place[..., 2] = _resting(ground, spot, radii[0][:, None])
    joints, passed = [place], np.zeros(heading.shape[:1])
    for number, length in enumerate(lengths):
        middle = (passed + 0.5 * length) / span
        # More and more to one side: an arm that lies slack ends in a curl.
        turn = heading + curl * (middle * middle)[:, None] * 2.0
        onward = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        step = np.broadcast_to(length[:, None], heading.shape)
        for _ in range(4):
            level = place[..., :2] + step[..., None] * onward
            rise = _resting(ground, level, radii[number + 1][:, None]) - place[..., 2]
            step = step * length[:, None] / np.sqrt(step * step + rise * rise)
        ahead = np.concatenate([step[..., None] * onward, rise[..., None]], axis=-1)
        ahead *= (length[:, None] / np.sqrt(step * step + rise * rise))[..., None]
        place = place + ahead
        joints.append(place)
        passed = passed + length
    return np.stack(joints, axis=2)


def _resting(ground: Ground, points: Floats, radius: Floats) -> Floats:
    """Height (…,) of a joint whose skin lies on the ground."""
    slope = ground.slope(points)
    return ground.height(points) + radius * np.sqrt(1.0 + np.sum(slope * slope, axis=-1))


def _hash(arms: np.ndarray, cycles: np.ndarray, seed: int) -> Floats:
    """Numbers (arms, cycles) from 0 to 1 that hang on arm, cycle and seed alone."""
    mixed = np.sin(12.9898 * (arms + 1.0) + 78.233 * (cycles + 0.5) + 37.719 * (seed + 1.0))
    return np.mod(43758.5453 * mixed, 1.0)
