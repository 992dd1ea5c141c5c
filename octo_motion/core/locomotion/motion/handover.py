# SPDX-License-Identifier: GPL-3.0-or-later
"""From a pose of the artist's into the motion, and from the motion into one.

The body eases from where it stands in the pose to its way, and each bone turns from its pose into
what the motion has there. An arm that stands on the ground in the pose stays there while the body
leaves, until it is its turn: then it steps over.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...keyframes import Channel
from ...rotations import (
    IDENTITY,
    Floats,
    angle_between,
    conjugate,
    from_matrix,
    from_rotation_vector,
    multiply,
    rotate,
    shortest_arc,
    to_rotation_vector,
)
from ...smoothing import least_jerk, smooth_step
from ..body import OrganPoses
from ..clearance import ArmsOverGround, keeping_off_ground
from ..ground import Ground, drawn
from ..path import blend_motions
from ..rig import ArmFrames, ArmMotion, BodyFrame, Poses
from .job import Creature, GivenPose

_STANDING: Final = 0.03
"""Arm lengths above its skin's height up to which a joint stands on the ground."""
_OUTER: Final = 0.4
"""Share of an arm from its root that never stands."""
_STEPS: Final = 0.3, 0.65
"""Shares of the time that an arm which stands takes to step over at least, while others stand, and
at most, where it has far to turn …"""
_GENTLE: Final = np.radians(20.0)
"""… so that it does no more than that from frame to frame."""
_STEEPEST: Final = 15.0 / 8.0
"""Slope of ``least_jerk`` half way."""
_LIFT: Final = 0.08
"""Arm lengths that it is lifted meanwhile."""
_PULLS: Final = 12
"""Newton's steps with which an arm is held where it stands."""
_ASIDE: Final = 0.2
"""Arm lengths that a body may be off its way while arms hold on to the ground …"""
_ASKEW: Final = 0.4
"""… and radians: further off, they are carried along."""
_UNMOVED: Final = 1e-7
_UNHEARD: Final = 1_000_000
"""Cycles before the motion's own, of an arm that stands in a pose."""
_ALONG: Final = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Handover:
    """A pose at an end of a motion."""

    pose: GivenPose
    time: Floats
    """(moments,) 0 in the pose, 1 where the motion is its own."""
    moment: int
    """The one in the pose: the first, or the last."""

    @property
    def share(self) -> Floats:
        """(moments,) how far the motion has taken over."""
        return least_jerk(self.time)

    def toward(self, values: Floats, given: Floats) -> Floats:
        """Values (moments, components) that are the given ones (components,) in the pose."""
        return values + (1.0 - self.share)[:, None] * (given - values[self.moment])

    def turned(self, rotations: Floats, given: Floats, share: Floats | None = None) -> Floats:
        """Rotations (moments, bones, 4) that are the given ones (…, bones, 4) in the pose."""
        start = np.broadcast_to(given, rotations.shape)
        shares = np.broadcast_to(self.share[:, None], rotations.shape[:2])
        return blend_motions(start, rotations, shares if share is None else share)


def handovers(
    begin: GivenPose | None, end: GivenPose | None, frames: Floats, ends: tuple[float, float]
) -> list[Handover]:
    """The poses that a motion begins and ends in, at frames (moments,) of it, whose ends are known.

    Where there is no time for both they share it.
    """
    first, last = ends
    lengths = np.array([0.0 if each is None else float(each.frames) for each in (begin, end)])
    lengths *= min(1.0, (last - first) / max(float(lengths.sum()), 1.0))
    found: list[Handover] = []
    for pose, length, since, moment in (
        (begin, lengths[0], frames - first, 0),
        (end, lengths[1], last - frames, -1),
    ):
        if pose is not None:
            found.append(Handover(pose, np.clip(since / length, 0.0, 1.0), moment))
    return found


def eased_places(
    hands: Iterable[Handover], body: BodyFrame, scale: float, places: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Centres (moments, 3) and orientations (moments, 4) of a canonical body that is where it is in
    the poses there.
    """
    centres, turns = places
    for hand in hands:
        if hand.pose.place is None:
            continue
        location, turn = hand.pose.place
        centre = location + rotate(turn, scale * body.center)
        facing = multiply(turn, from_matrix(body.rotation))
        centres = centres + (1.0 - hand.share)[:, None] * (centre - centres)
        turns = hand.turned(turns[:, None], facing)[:, 0]
    return centres, turns


def near_enough(
    places: tuple[Floats, Floats], eased: tuple[Floats, Floats], reach: float
) -> tuple[Floats, Floats]:
    """Centres (moments, 3) and orientations (moments, 4) of a body that is off its way as it eases,
    but no further than its arms of a reach, metres, can hold on meanwhile.
    """
    aside = _limited(eased[0] - places[0], _ASIDE * reach)
    turn = to_rotation_vector(multiply(eased[1], conjugate(places[1])))
    return places[0] + aside, multiply(from_rotation_vector(_limited(turn, _ASKEW)), places[1])


def _limited(vectors: Floats, most: float) -> Floats:
    """Vectors (…, 3) that are shorter than so much; much shorter ones are as they were."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True) / most
    return vectors / (1.0 + size**4) ** 0.25


def eased_stay(hands: Iterable[Handover], places: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Locations (moments, 3) and orientations (moments, 4) of an armature that stays, likewise."""
    still = BodyFrame(np.zeros(3), np.eye(3))
    return eased_places(hands, still, 1.0, places)


# --- Arms -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ArmsAround:
    """The arms of a creature, and what is about them."""

    creature: Creature
    frames: Sequence[ArmFrames]
    """Of each arm."""
    going: tuple[Floats, Floats]
    """Locations (moments, 3) and orientations (moments, 4) of the armature."""
    ground: tuple[Ground, Sequence[Floats]] | None
    """What poses stand on, and armature units from each arm's joints to the skin below; none where
    they do not."""


def handing_over_arms(
    hands: Iterable[Handover], arms: ArmMotion, around: ArmsAround
) -> Generator[None, None, None]:
    """Let arms, which are changed, go over between their motion and poses; in steps."""
    creature, frames, going, ground = around.creature, around.frames, around.going, around.ground
    names = [name for bones in creature.bones for name in bones]
    ends = np.cumsum([0, *(len(bones) for bones in creature.bones)])
    for hand in hands:
        chosen = np.flatnonzero(hand.time < 1.0)
        if not len(chosen):
            continue
        given = np.array([hand.pose.turns.get(name, IDENTITY) for name in names])
        alongs = {name: size[1:2] for name, size in hand.pose.sizes.items()}
        longer = creature.channels.strains(creature.bones, alongs, 1)[0]
        start = np.tile(given, (len(chosen), 1, 1))
        where = going[0][chosen], going[1][chosen]
        shares = np.repeat(hand.share[chosen, None], len(frames), axis=1)
        lifts = np.zeros(shares.shape)
        standing = _standing(hand, given, longer, around)
        for rank, (number, joint) in enumerate(_in_turns(standing)):
            own = slice(ends[number], ends[number + 1])
            held = _Held(frames[number], given[own], longer[own], joint, creature.scale)
            at = going[0][hand.moment], going[1][hand.moment]
            start[:, own] = held.while_body_leaves(at, where)
            last = start[-1 - hand.moment, own], arms.rotations[chosen[-1 - hand.moment], own]
            one, other = (frames[number].from_bones(each) for each in last)
            turn = float(angle_between(one, other).max())
            step = np.clip(_STEEPEST * turn / _GENTLE / hand.pose.frames, *_STEPS)
            late = (1.0 - step) * rank / max(len(standing) - 1, 1)
            shares[:, number] = least_jerk((hand.time[chosen] - late) / step)
            lifts[:, number] = _LIFT * frames[number].length * creature.scale
            rests = chosen[shares[:, number] <= 0.0]
            arms.in_contact[number][rests] = False
            arms.in_contact[number][rests, joint:] = True
        per_bone = np.repeat(shares, np.diff(ends), axis=1)
        target = arms.rotations[chosen]
        turned = blend_motions(start, target, per_bone)
        strains = longer + per_bone * (arms.strains[chosen] - longer)
        if ground is not None:
            course = ArmsOverGround(frames, ground[0], creature.scale)
            radii = _raised(ground[1], creature.scale, lifts * _bump(shares))
            poses = Poses(turned, strains, *where)
            turned = yield from keeping_off_ground(course, poses, radii, _bump(shares))
        arms.rotations[chosen], arms.strains[chosen] = turned, strains
        gone = shares < 1.0
        for number in range(len(frames)):
            between = (shares[:, number] > 0.0) & gone[:, number]
            arms.in_contact[number][chosen[between]] = False
            if number not in standing:
                arms.in_contact[number][chosen[gone[:, number]]] = False
        rows, columns = np.nonzero(gone)
        arms.late[chosen[rows], columns] = arms.misses[chosen[rows], columns] = 0.0
        arms.cycles[chosen[rows], columns] = -_UNHEARD + hand.moment
        yield


def _bump(shares: Floats) -> Floats:
    """0 where an arm is in its pose or its motion, 1 half way."""
    return smooth_step(4.0 * shares * (1.0 - shares))


def _raised(radii: Sequence[Floats], scale: float, lifts: Floats) -> list[Floats]:
    """Metres (moments, joints) from each arm's joints to the skin below it, and lifts (moments,
    arms), towards its tip.
    """
    return [
        scale * own + lift[:, None] * np.linspace(0.0, 1.0, len(own))
        for own, lift in zip(radii, lifts.T, strict=True)
    ]


def _in_turns(standing: Mapping[int, int]) -> list[tuple[int, int]]:
    """Arms that stand in the order in which they step over: never two neighbours at once."""
    numbers = sorted(standing)
    return [(number, standing[number]) for number in (*numbers[::2], *numbers[1::2])]


def _standing(hand: Handover, given: Floats, longer: Floats, around: ArmsAround) -> dict[int, int]:
    """The arms that stand in a pose, and the joint from which on each does."""
    if around.ground is None:
        return {}
    (surface, radii), scale = around.ground, around.creature.scale
    course = ArmsOverGround(around.frames, surface, scale)
    at = around.going[0][hand.moment][None], around.going[1][hand.moment][None]
    joints = course.joints(Poses(given[None], longer[None], *at))
    found: dict[int, int] = {}
    for number, (arm, own, skin) in enumerate(zip(around.frames, joints, radii, strict=True)):
        above = own[0, :, 2] - surface.height(own[0]) - scale * skin
        on = (above < _STANDING * scale * arm.length) & (arm.reach > _OUTER * arm.length)
        if np.any(on):
            found[number] = int(np.flatnonzero(on)[0])
    return found


@dataclass(frozen=True, eq=False)
class _Held:
    """An arm that stands in a pose."""

    arm: ArmFrames
    given: Floats
    """(bones, 4) rotations."""
    longer: Floats
    """(bones,) strains."""
    joint: int
    """The one from which on it rests."""
    scale: float

    def while_body_leaves(self, at: tuple[Floats, Floats], where: tuple[Floats, Floats]) -> Floats:
        """Rotations (moments, bones, 4) of the arm while the armature goes from its location (3,)
        and orientation (4,) in the pose to others (moments, 3) and (moments, 4).
        """
        frames = self.arm.from_bones(self.given)
        lengths = self.scale * self.arm.lengths * (1.0 + self.longer)
        resting = rotate(multiply(at[1], frames), _ALONG)
        root = at[0] + rotate(at[1], self.scale * self.arm.root)
        goal = root + (lengths[:, None] * resting)[: self.joint].sum(axis=0)
        facing = where[1][:, None]
        carried = rotate(multiply(facing, frames), _ALONG)
        free = (np.arange(len(lengths)) < self.joint).astype(np.float64)
        before = np.where(free[:, None] > 0.0, carried, resting)
        roots = where[0] + rotate(where[1], self.scale * self.arm.root)
        # What would be out of its reach is carried along.
        gone = roots - root
        goals = goal + gone - _limited(gone, _ASIDE * float(lengths.sum()))
        count = len(roots)
        after = drawn(
            np.ascontiguousarray(np.moveaxis(before, 0, -1)),
            np.repeat(lengths[:, None], count, axis=1),
            free=np.repeat(free[:, None], count, axis=1),
            chosen=np.repeat(free[:, None], count, axis=1),
            roots=np.ascontiguousarray(roots.T),
            goal=np.ascontiguousarray(goals.T),
            steps=_PULLS,
        )
        own = rotate(conjugate(facing), np.moveaxis(after, -1, 0))
        turned = shortest_arc(np.broadcast_to(rotate(frames, _ALONG), own.shape), own)
        return self.arm.to_bones(multiply(turned, frames))


# --- The body's bones, and all that the motion has no keys of -------------------------------------


def hand_over_organs(hands: Iterable[Handover], organs: OrganPoses) -> OrganPoses:
    """The same of bones of the body that move by themselves."""
    rotations, scales = organs.rotations, dict(organs.scales)
    for hand in hands:
        given = np.array([hand.pose.turns.get(name, IDENTITY) for name in organs.bones])
        if len(given):
            rotations = hand.turned(rotations, given)
        for name, values in scales.items():
            scales[name] = hand.toward(values, hand.pose.sizes.get(name, np.ones(3)))
    return replace(organs, rotations=rotations, scales=scales)


def hand_over_stretch(hands: Iterable[Handover], channels: Sequence[Channel]) -> list[Channel]:
    """The same of scales of bones that stretch, which poses may have otherwise."""
    result = list(channels)
    for hand in hands:
        result = [
            replace(
                each, values=hand.toward(each.values, hand.pose.sizes.get(each.group, np.ones(3)))
            )
            for each in result
        ]
    return result


def further_channels(
    hands: Sequence[Handover], creature: Creature, taken: Iterable[Channel], moments: int
) -> list[Channel]:
    """Channels of what poses move and the motion does not: it goes to rest, and comes from there.

    Taken are those that the motion has.
    """
    paths, channels = {each.data_path for each in taken}, creature.channels
    found: list[Channel] = []
    for name in dict.fromkeys(name for hand in hands for name in hand.pose.turns):
        turns = np.tile(IDENTITY, (moments, 1, 1))
        moves, sizes = np.zeros((moments, 3)), np.ones((moments, 3))
        for hand in hands:
            turns = hand.turned(turns, hand.pose.turns.get(name, IDENTITY))
            moves = hand.toward(moves, hand.pose.moves.get(name, np.zeros(3)))
            sizes = hand.toward(sizes, hand.pose.sizes.get(name, np.ones(3)))
        if np.abs(turns - IDENTITY).max() > _UNMOVED:
            found += channels.rotations([name], turns)
        if np.abs(moves).max() > _UNMOVED:
            found.append(channels.location(name, moves))
        if np.abs(sizes - 1.0).max() > _UNMOVED:
            found.append(channels.scale(name, sizes))
    return [each for each in found if each.data_path not in paths]
