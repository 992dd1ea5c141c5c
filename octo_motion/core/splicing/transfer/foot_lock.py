# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet that stand in their clip stand in the result as well, on its ground.

After Kovar, Schreiner and Gleicher, "Footskate Cleanup for Motion Capture Editing" (2002): while a
foot is flat, ankle and ball stay where they are; while its heel lifts the ball alone stays, and the
foot turns about it. Between two stances the way that a foot had to be moved changes smoothly from
one to the other, as fast at both ends as it did there. Where a leg is too short to reach, the
pelvis comes down in time, and where it would have to fold too tightly, it rises. All of it is
worked out at once, at moments that lie close whatever the frame rate is; frames take what is there.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    cross,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    slerp,
    to_rotation_vector,
)
from ...smoothing import blur_reach, blurred, covered, widened
from ...steps import finished
from ..clip import Clip, Posture, posture_of, sample_clip, sample_world
from .foot_contacts import (
    ANKLE,
    BALL,
    FootContacts,
    FootPaths,
    Stance,
    ball_places,
    fine_moments,
    foot_bones,
    foot_paths,
    runs,
    short_gaps,
)
from .limb_rotation import LimbTriangle, bend_to_reach
from .loop_rounds import Rounds, own_round, repeated
from .retarget import MappedClip

_REACH: Final = 0.5
"""Seconds over which a foot that has stood goes back to its own way, if it does not stand again
before."""

_BRAKE: Final = 0.2
"""Seconds in which a foot that is let go comes to go as fast as it would have."""

_APART: Final = 0.05
"""Seconds to either side of the moment at which one point of a foot lets go as the other one takes
hold: so long it is in the air."""

_SOFT: Final = 0.004
"""Of a leg's length: what is kept from being stretched out, where it was not before."""

_LOWERING: Final = 0.25
"""Seconds that the pelvis takes to come down, and to rise again."""

_LOWEST: Final = 0.25
"""Leg lengths that it comes down at most for a foot that stands, …"""

_LOWEST_IN_AIR: Final = 0.05
"""… and for one that swings."""

_STEP: Final = 0.08
"""Leg lengths that a foot stands higher or lower than usual before it counts as a step: less is
how exact a clip is."""

_STEEP: Final = np.radians(35.0)
"""From which on a foot does not lie on its sole."""

_LEVEL: Final = np.array([1.0, 1.0, 0.0])
_UP: Final = np.array([0.0, 0.0, 1.0])


class GroundHeight(Protocol):
    """A surface over the world's XY plane."""

    def height(self, points: Floats) -> Floats:
        """World Z (…,) of the ground at points (…, 3)."""
        ...

    def slope(self, points: Floats) -> Floats:
        """Rise per metre along X and Y (…, 2)."""
        ...


@dataclass(frozen=True, eq=False)
class Footing:
    """On what feet are to stand, and when."""

    contacts: FootContacts
    """When they do, …"""
    moments: Floats
    """(moments,) … at these of their own clip."""
    stance: Stance
    """How the body stands; with a ground, above that."""
    steps: Floats
    """(moments, 2) how much higher than usual each foot stands in its own clip, world units of the
    result: stairs."""
    shown: Floats
    """(frames,) of their own clip that the result's frames show."""
    ground: GroundHeight | None = None
    """What it stands on; none for where its stance is."""
    balls: Floats | None = None
    """(2, 3) where the balls of the feet are as seen from their bones, if not as usual."""
    cyclic: bool = False
    """Whether the result is a loop: contacts and steps are then those of three rounds, and what it
    shows are its own frames."""

    def at(self, frames: Floats, moments: Floats) -> Footing:
        """As it is at some moments (moments,) of the result, which has these frames (frames,)."""
        if self.cyclic:
            return self
        before, after, share = _beside(moments, frames)
        # Where a clip begins anew nothing is shown between its end and its start.
        share = np.where(self.shown[after] < self.shown[before], np.round(share), share)
        shown = self.shown[before] + share * (self.shown[after] - self.shown[before])
        last = len(self.moments) - 1
        places = np.interp(shown, self.moments, np.arange(last + 1.0))
        rows = np.clip(np.round(places), 0, last).astype(np.intp)
        return replace(
            self,
            contacts=FootContacts(self.contacts.held[rows]),
            moments=self.moments[rows],
            steps=self.steps[rows],
        )


@dataclass(frozen=True, eq=False)
class _Leg:
    """Bones of a leg, and where its joints are in the world, (moments, 3) each."""

    bones: tuple[int, int, int]
    joints: LimbTriangle
    goal: Floats
    """(moments, 3) where the ankle is to be; before the body is brought along, while it stands."""
    turn: Floats
    """(moments, 4) how the foot is to be turned more, world."""
    standing: np.ndarray
    """(moments,) whether it stands."""

    def taken(self, rows: slice) -> _Leg:
        """Of some frames."""
        joints = (self.joints.joint, self.joints.elbow, self.joints.hand)
        own = LimbTriangle(*(each[rows] for each in joints))
        return _Leg(self.bones, own, self.goal[rows], self.turn[rows], self.standing[rows])


def steps_of(paths: FootPaths, contacts: FootContacts, stance: Stance, size: float) -> Floats:
    """How much higher than usual each foot stands, (frames, 2), in units that are ``size`` times
    as large; nothing where it does not stand, and where it is a trifle.
    """
    held = contacts.held
    off = paths.points[..., 2] - np.array([stance.ankle, stance.ball])
    usual = np.where(held[..., ANKLE], off[..., ANKLE], off[..., BALL])
    result = np.zeros(usual.shape)
    for side in range(2):
        for start, stop in zip(*runs(held[:, side].any(axis=-1)), strict=True):
            height = float(np.median(usual[start:stop, side]))
            if abs(height) > _STEP * paths.leg:
                result[start:stop, side] = size * height
    return result


def lock_feet(
    mapped: MappedClip, clip: Clip, footing: Footing, weights: Floats | None = None
) -> Clip:
    """What :func:`locking_feet` comes to."""
    return finished(locking_feet(mapped, clip, footing, weights))


def locking_feet(
    mapped: MappedClip, clip: Clip, footing: Footing, weights: Floats | None = None
) -> Generator[None, None, Clip]:
    """A clip whose feet stand while they are said to, in steps.

    Args:
        mapped: says which bones of the clip's skeleton are which.
        clip: of that skeleton; of its hips the locations, of its legs the rotations are changed.
        footing: on what and when feet stand.
        weights: (frames,) how much of it is done, 1 if none are given.

    Raises:
        ClipError: a landmark is missing.
    """
    if len(clip) < 2 or not footing.contacts.held.any():
        return clip
    moments = fine_moments(clip.frames, clip.rate)
    posture = sample_clip(clip, moments)
    # The clip's own rate counts, not that of the one by which the body is known.
    paths = foot_paths(replace(mapped, clip=clip), posture, moments, footing.balls)
    rounds = Rounds.between(paths.hips) if footing.cyclic else None
    footing = footing.at(clip.frames, moments)
    share = np.ones(len(clip)) if weights is None else weights
    share = np.interp(moments, clip.frames, share)
    share = (share if rounds is None else repeated(share))[:, None]
    yield
    moved = _Legs(mapped, posture, clip, moments, rounds)
    balls = ball_places(mapped) if footing.balls is None else footing.balls
    legs: list[_Leg] = []
    for side in range(2):
        legs.append(_leg(moved, footing, balls[side], paths.rate, side))
        yield
    carried = _carried(legs, paths.rate)
    yield
    legs = [_brought(leg, carried, share, paths.rate) for leg in legs]
    yield
    carried = share * (carried - _lowered(legs, share * carried, paths.rate)[:, None] * _UP)
    if rounds is not None:
        own = own_round(len(moments))
        legs, carried = [each.taken(own) for each in legs], carried[own]
    return _written(mapped, clip, legs, carried, moments)


def _beside(looks: Floats, times: Floats) -> tuple[np.ndarray, np.ndarray, Floats]:
    """Rows of some times (times,) on either side of each look (looks,), and how far it is between;
    what misses a time by rounding alone is that time.
    """
    last = len(times) - 1
    places = np.interp(looks, times, np.arange(last + 1.0))
    places = np.where(np.abs(places - np.round(places)) < 1e-6, np.round(places), places)
    before = np.minimum(places.astype(np.intp), last)
    return before, np.minimum(before + 1, last), places - before


class _Legs:
    """Legs of a clip in the world at some moments, of three rounds if it is a loop."""

    def __init__(
        self,
        mapped: MappedClip,
        posture: Posture,
        clip: Clip,
        moments: Floats,
        rounds: Rounds | None = None,
    ) -> None:
        self._mapped, self._posture, self._rounds = mapped, posture, rounds
        self._turns, self._shifts, self._scale = sample_world(clip, moments)

    def bones(self, side: int) -> tuple[int, int, int]:
        """Thigh, shin and foot."""
        thigh, shin, foot, _ = foot_bones(self._mapped, "LR"[side])
        return thigh, shin, foot

    def joints(self, side: int) -> LimbTriangle:
        """Hip joint, knee and ankle."""
        return LimbTriangle(*(self.place(bone) for bone in self.bones(side)))

    def place(self, bone: int) -> Floats:
        """Where a bone begins, (moments, 3)."""
        return self._all(self._shifts + self._scale * rotate(self._turns, self._posture.head(bone)))

    def orientation(self, bone: int) -> Floats:
        """How a bone is turned, (moments, 4)."""
        turned = multiply(self._turns, self._posture.orientation(bone))
        return turned if self._rounds is None else self._rounds.turns(turned)

    def along(self, foot: int, ball: Floats) -> Floats:
        """(moments, 3) from ankle to ball, which is given as seen from the foot's bone."""
        return rotate(self.orientation(foot), self._scale * ball)

    def _all(self, points: Floats) -> Floats:
        return points if self._rounds is None else self._rounds.points(points)


def _leg(legs: _Legs, footing: Footing, ball: Floats, rate: float, side: int) -> _Leg:
    """Where a foot is to be while it stands, and how it is turned."""
    bones = legs.bones(side)
    joints = legs.joints(side)
    along = legs.along(bones[2], ball)
    width = max(1, round(_APART * rate))
    held = _set_apart(footing.contacts.held[:, side], width)
    flat = held.all(axis=-1)
    flat &= ~_around(short_gaps(flat, 2 * width), width)
    foot = joints.hand, legs.orientation(bones[2]), along
    laid = _laid_flat(flat, foot, footing, side)
    turn = from_rotation_vector(bridged(laid, flat, *_lengths(rate)))
    shift = _planted(joints.hand, rotate(turn, along), held, footing, side)
    return _Leg(bones, joints, joints.hand + shift, turn, held.any(axis=-1))


def _brought(leg: _Leg, carried: Floats, share: Floats, rate: float) -> _Leg:
    """A leg with a goal for its foot at all frames, of a body that is carried along (frames, 3)."""
    shift = leg.goal - leg.joints.hand - carried
    shift = share * (carried + bridged(shift, leg.standing, *_lengths(rate)))
    turn = from_rotation_vector(share * to_rotation_vector(leg.turn))
    return replace(leg, goal=leg.joints.hand + shift, turn=turn)


def _lengths(rate: float) -> tuple[int, int]:
    """Frames of reach and brake for :func:`bridged`."""
    return max(1, round(_REACH * rate)), max(1, round(_BRAKE * rate))


def _set_apart(held: np.ndarray, width: int) -> np.ndarray:
    """Contacts (frames, 2) with some frames at least between two stances, where the foot is on its
    way: also where one point lets go just as the other one takes hold.
    """
    # A point that moves for a moment while the other one stands has not let go.
    gaps = [short_gaps(each, 2 * width) for each in held.T]
    held = held | (np.stack(gaps, axis=-1) & held[:, ::-1])
    standing = held.any(axis=-1)
    hands_over = standing[1:] & standing[:-1] & ~(held[1:] & held[:-1]).any(axis=-1)
    edges = np.concatenate([hands_over, [False]]) | np.concatenate([[False], hands_over])
    near = _around(edges | short_gaps(standing, 2 * width), width)
    return held & ~near[:, None]


def _around(mask: np.ndarray, width: int) -> np.ndarray:
    """(frames,) where something is true within so many frames."""
    return widened(mask.astype(np.float64), width) > 0.0 if mask.any() else mask


def _laid_flat(
    flat: np.ndarray, foot: tuple[Floats, Floats, Floats], footing: Footing, side: int
) -> Floats:
    """Rotation vectors (moments, 3), world, that hold each flat foot still and lay it on the
    ground; of no meaning where it is not flat. Of the foot the ankle's place, how it is turned and
    the way to its ball are given.
    """
    ankle, orientation, along = foot
    starts, stops = runs(flat)
    result = np.zeros((len(flat), 3))
    if not len(starts):
        return result
    counts = stops - starts
    rows = np.flatnonzero(flat)
    middle = np.repeat(starts + counts // 2, counts)
    off = to_rotation_vector(multiply(orientation[rows], conjugate(orientation[middle])))
    mean = _means(off, counts)
    # The foot's usual way, laid so that its ball is as high above its ankle as when it stands.
    center = starts + counts // 2
    rest = rotate(from_rotation_vector(mean), along[center])
    length = np.maximum(np.linalg.norm(rest, axis=-1), 1e-12)
    rise = footing.stance.ball - footing.stance.ankle
    level = normalized(rest * _LEVEL)
    rise = np.clip(rise / length, -0.98, 0.98)
    wanted = level * np.sqrt(1.0 - rise**2)[:, None] + rise[:, None] * _UP
    if footing.ground is not None:
        tilt = _tilt(footing.ground, ankle[center] + 0.5 * rest)
        wanted = rotate(tilt, wanted)
    lay = shortest_arc(normalized(rest), wanted)
    # What is held high up, or steeply, is no sole on the ground.
    steep = 2.0 * np.arccos(np.clip(np.abs(lay[:, 0]), 0.0, 1.0)) > _STEEP
    steep |= length < 1e-9
    lay[steep | (footing.steps[starts, side] != 0.0)] = IDENTITY
    still = multiply(lay, from_rotation_vector(mean))
    result[rows] = to_rotation_vector(
        multiply(np.repeat(still, counts, axis=0), from_rotation_vector(-off))
    )
    return result


def _tilt(ground: GroundHeight, at: Floats) -> Floats:
    """From upright to the ground's normal, (…, 4)."""
    slope = ground.slope(at)
    normal = normalized(np.concatenate([-slope, np.ones((*slope.shape[:-1], 1))], axis=-1))
    return shortest_arc(np.broadcast_to(_UP, normal.shape), normal)


def _planted(ankle: Floats, along: Floats, held: np.ndarray, footing: Footing, side: int) -> Floats:
    """(frames, 3) by how much a foot has to be moved to stand; of no meaning where it does not."""
    both = held[1:] & held[:-1]
    steps = -np.diff(ankle, axis=0)
    steps = np.where(both[:, [ANKLE]], steps, -np.diff(ankle + along, axis=0))
    steps[~both.any(axis=-1)] = 0.0
    passed = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    # Frames that are held together move together; a point that takes over does so where it is.
    together = np.concatenate([[False], both.any(axis=-1)])
    standing = held.any(axis=-1)
    rows = np.flatnonzero(standing)
    starts = np.flatnonzero(~together[rows])
    counts = np.diff(np.append(starts, len(rows)))
    stance = footing.stance
    by_ankle = held[rows, ANKLE]
    points = np.where(by_ankle[:, None], ankle[rows], ankle[rows] + along[rows])
    heights = np.where(by_ankle, stance.ankle, stance.ball) + footing.steps[rows, side]
    passed = passed[rows]
    wanted = -passed
    wanted[:, 2] = heights - points[:, 2] - passed[:, 2]
    offsets = _means(wanted, counts)
    if footing.ground is not None:
        middle = starts + counts // 2
        place = points[middle] + offsets + passed[middle]
        offsets[:, 2] += footing.ground.height(place)
    result = np.zeros(ankle.shape)
    result[rows] = passed + np.repeat(offsets, counts, axis=0)
    return result


def _means(values: Floats, counts: np.ndarray) -> Floats:
    """Means (runs, …) of values (rows, …) of runs one after the other."""
    starts = np.cumsum(counts) - counts
    return np.add.reduceat(values, starts, axis=0) / counts[:, None]


def bridged(values: Floats, known: np.ndarray, reach: int, brake: int) -> Floats:
    """Values that are kept where they are known, and go smoothly to zero from there, or straight on
    to the next that are known: by cubics that leave and arrive as fast as the values do.

    Args:
        values: (frames, …)
        known: (frames,)
        reach: frames that they take to zero, and half of what they take to the next.
        brake: frames in which the speed that they had is gone.
    """
    count = len(values)
    rows = np.arange(count)
    if not known.any():
        return np.zeros_like(values)
    before = np.maximum.accumulate(np.where(known, rows, -1))
    after = np.minimum.accumulate(np.where(known, rows, 2 * count)[::-1])[::-1]
    speeds = _edge_speeds(values, known)
    left, right = np.maximum(before, 0), np.minimum(after, count - 1)
    has_left, has_right = before >= 0, after < count
    gap = (after - before).astype(np.float64)
    alone = ~(has_left & has_right) | (gap > 2.0 * reach)
    length = np.where(alone, float(reach), np.maximum(gap, 1.0))
    passed, ahead = (rows - before) / length, (after - rows) / length
    leaving = np.where(
        has_left[:, None], _hermite(passed, length, values[left], speeds[left], brake), 0.0
    )
    coming = np.where(
        has_right[:, None], _hermite(ahead, length, values[right], -speeds[right], brake), 0.0
    )
    return np.where(known[:, None], values, leaving + coming)


def _hermite(share: Floats, length: Floats, value: Floats, speed: Floats, brake: int) -> Floats:
    """From a value with a speed per frame to rest at zero, over a share 0…1 of a length."""
    t = np.clip(share, 0.0, 1.0)[:, None]
    slowing = np.minimum(length, brake)
    u = np.clip(share * length / slowing, 0.0, 1.0)[:, None]
    return (1.0 + 2.0 * t) * (1.0 - t) ** 2 * value + u * (1.0 - u) ** 2 * slowing[:, None] * speed


def _edge_speeds(values: Floats, known: np.ndarray) -> Floats:
    """Change per frame at the first and last frame of each run of known values."""
    speeds = np.zeros_like(values)
    steps = np.diff(values, axis=0)
    together = known[1:] & known[:-1]
    steps[~together] = 0.0
    starts, stops = runs(known)
    last = stops - 1
    inside = stops - starts > 1
    speeds[starts[inside]] = steps[starts[inside]]
    speeds[last[inside]] = steps[last[inside] - 1]
    return speeds


def _carried(legs: list[_Leg], rate: float) -> Floats:
    """(frames, 3) by how much the whole body is moved: along with the feet that stand."""
    standing = np.stack([leg.standing for leg in legs])[..., None]
    moved = np.stack([leg.goal - leg.joints.hand for leg in legs])
    stood = np.flatnonzero(standing.any(axis=(0, 2)))
    if not len(stood):
        return np.zeros(moved.shape[1:])
    means = (standing * moved).sum(axis=0)[stood] / standing.sum(axis=0)[stood]
    rows = np.arange(moved.shape[1], dtype=np.float64)
    between = [np.interp(rows, stood, axis) for axis in means.T]
    return blurred(np.stack(between, axis=-1), _width(rate))


def _lowered(legs: list[_Leg], carried: Floats, rate: float) -> Floats:
    """(frames,) by how much the pelvis has to come down so that both legs reach, or to rise
    (negative) so that neither is folded tighter than it folds of itself.
    """
    down, up = np.zeros(len(carried)), np.zeros(len(carried))
    for leg in legs:
        joints = leg.joints
        length = np.linalg.norm(joints.upper, axis=-1) + np.linalg.norm(joints.lower, axis=-1)
        own = np.linalg.norm(joints.hand - joints.joint, axis=-1)
        most = np.maximum((1.0 - _SOFT) * length, own)
        least = np.minimum(joints.folded, own)
        way = leg.goal - joints.joint - carried
        across = np.sum((way * _LEVEL) ** 2, axis=-1)
        stretched, folded = (np.sqrt(np.maximum(r**2 - across, 0.0)) for r in (most, least))
        # A foot in the air need not get where it would be.
        limit = np.where(leg.standing, _LOWEST, _LOWEST_IN_AIR) * length
        down = np.maximum(down, np.minimum(-way[:, 2] - stretched, limit))
        up = np.maximum(up, np.where(way[:, 2] < 0.0, np.minimum(way[:, 2] + folded, limit), 0.0))
    return covered(down, _width(rate)) - covered(up, _width(rate))


def _width(rate: float) -> int:
    return max(1, round(_LOWERING * rate / blur_reach(1)))


def _written(
    mapped: MappedClip, clip: Clip, legs: list[_Leg], carried: Floats, moments: Floats
) -> Clip:
    """The clip with its hips moved and its legs where they go, which is known at some moments."""
    skeleton = clip.skeleton
    rotations, locations = clip.rotations.copy(), clip.locations.copy()
    turns, _, scale = sample_world(clip, clip.frames)
    back = conjugate(turns)
    hips = mapped.bone("hips")
    posture = posture_of(skeleton, clip.rotations, clip.locations)
    before, after, share = _beside(clip.frames, moments)
    share = share[:, None]

    def there(values: Floats) -> Floats:
        return values[before] + share * (values[after] - values[before])

    own_legs = _Legs(mapped, posture, clip, clip.frames)
    carried = there(carried)
    moved = rotate(back, carried) / scale
    locations[:, hips] += rotate(conjugate(posture.location_axes(hips)), moved)
    for side, leg in enumerate(legs):
        joints = own_legs.joints(side)
        goal = joints.hand + there(leg.goal - leg.joints.hand)
        limb = LimbTriangle(joints.joint + carried, joints.elbow + carried, joints.hand + carried)
        aimed = shortest_arc(normalized(limb.hand - limb.joint), normalized(goal - limb.joint))
        turned = limb.turned(aimed)
        hinge = rotate(aimed, _hinge(limb, posture, leg, turns))
        upper, lower = bend_to_reach(turned, goal, hinge, soft=_SOFT)
        upper, lower = multiply(upper, aimed), multiply(lower, aimed)
        world_turns = (upper, lower, slerp(leg.turn[before], leg.turn[after], share[:, 0]))
        own = [multiply(multiply(back, each), turns) for each in world_turns]
        for bone, turn in zip(leg.bones, own, strict=True):
            wanted = multiply(turn, posture.orientation(bone))
            above = posture_of(skeleton, rotations, locations).carried(bone)
            rotations[:, bone] = multiply(conjugate(above), wanted)
    return replace(clip, rotations=rotations, locations=locations)


def _hinge(limb: LimbTriangle, posture: Posture, leg: _Leg, turns: Floats) -> Floats:
    """The axis (frames, 3), world, about which a knee bends: fixed to its thigh."""
    orientation = multiply(turns, posture.orientation(leg.bones[0]))
    normal = rotate(conjugate(orientation), limb.normal).sum(axis=0)
    if np.linalg.norm(normal) < 1e-9:
        along = rotate(conjugate(orientation), limb.upper).sum(axis=0)
        normal = cross(along, np.eye(3)[np.argmin(np.abs(along))])
    return rotate(orientation, normalized(normal))
