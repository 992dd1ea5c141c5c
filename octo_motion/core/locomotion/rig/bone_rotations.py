# SPDX-License-Identifier: GPL-3.0-or-later
"""From solved joints to bone rotations: swing by the smallest rotation, twist by bank alone.

A bone that follows its segment by the smallest rotation from where its parent carries it gains no
twist of its own. So twist is a channel by itself: bank, and nothing else. The source turns joints
without regard to twist, and to which way suckers face; it names both as what is to be improved.

The smallest rotation is indefinite, and jumps, where a bone points opposite to its rest. Arms of
many rigs hang straight down at rest, and rear up straight when they move. So what the body carries
is turned to where its arm points out of the body first, and from there to its segment: an arm that
points straight into its own body is nowhere to be seen. Likewise its further bones go by way of
where they would go straight on from the one before: the last bone of imported rigs, whose files
know no tails, may stand across its arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...rotations import (
    Floats,
    components_first,
    conjugate,
    cross,
    from_axis_angle,
    from_matrix,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ...rotations.components_first import cumulative_sum, dot
from ...skeleton import Skeleton
from ...smoothing import smooth_step
from .arm_chains import AXES, BodyFrame, joint_positions

_NO_SIDE: Final = 0.1
"""Length of what is across a segment, of a unit vector that does not tell which side is which."""
_MOST_KNOWN: Final = 128
"""Arms whose rest is kept for the next time."""


@dataclass(frozen=True, eq=False)
class ArmRest:
    """One arm at rest, as far as bones are concerned."""

    segments: Floats
    """(bones, 3) unit vectors: each bone's segment, from its head to the next one's, in the
    bone's own rest frame. Not always local Y: imported bones point anywhere."""
    carried: Floats
    """(bones, 4) each bone's rest orientation as its parent in the chain sees it; armature space
    where nothing in the chain turns the bone."""
    follows: tuple[bool, ...]
    """(bones,) whether the bone before turns this one. The first follows the body instead, and a
    bone that does not inherit rotation nothing at all."""
    outward: Floats | None = None
    """(3,) unit: straight out of the body, armature space; none for bones that are no arm."""

    def orientations(self, rotations: Floats) -> Floats:
        """Orientations (…, bones, 4), armature space, of rotations in the bones' rest frames."""
        # Against the bone before; of those that follow nothing, in armature space already.
        result = multiply(self.carried, rotations)
        for bone, follows in enumerate(self.follows):
            if follows:
                result[..., bone, :] = multiply(result[..., bone - 1, :], result[..., bone, :])
        return result

    @cached_property
    def straight_on(self) -> Floats:
        """(bones, 3) unit, in the bones' rest frames: where each points by way of which it is
        turned.

        It goes on from the bone before, or out of the body: at rest it may be bent far from that.
        """
        if self.outward is None:
            return self.segments
        before = np.array(
            [
                self.segments[bone - 1] if follows else self.outward
                for bone, follows in enumerate(self.follows)
            ]
        )
        return rotate(conjugate(self.carried), before)


_rests: Final[ContentCache[ArmRest]] = ContentCache(_MOST_KNOWN)
_sides: Final[ContentCache[Floats]] = ContentCache(_MOST_KNOWN)


def arm_rest(skeleton: Skeleton, bones: Sequence[str]) -> ArmRest:
    """The rest pose of a chain; helper bones within it ride along rigidly.

    Raises:
        RigError: a bone does not exist.
    """
    key = content_key(skeleton, tuple(bones))
    return _rests.get(key, lambda: _arm_rest(skeleton, bones))


def _arm_rest(skeleton: Skeleton, bones: Sequence[str]) -> ArmRest:
    joints = joint_positions(skeleton, bones)
    order = [skeleton.index[name] for name in bones]
    rest = skeleton.rest_rotations[order]
    carried, follows = rest.copy(), [False]
    for place in range(1, len(order)):
        inherits, bone = True, order[place]
        while bone != order[place - 1] and inherits:
            inherits, bone = skeleton.inherits_rotation[bone], skeleton.parents[bone]
        follows.append(inherits)
        if inherits:
            carried[place] = multiply(conjugate(rest[place - 1]), rest[place])
    segments = rotate(conjugate(rest), normalized(np.diff(joints, axis=0)))
    return ArmRest(segments, carried, tuple(follows))


@dataclass(frozen=True, eq=False)
class Facing:
    """Which side of each bone is to face which way, as far as twisting lets it."""

    sides: Sequence[Floats]
    """For each arm (bones, 3): unit vectors across the segments, in the bones' rest frames."""
    towards: Floats
    """(bones, 3, frames, arms) unit vectors, armature space."""
    most_turn: Floats
    """(bones, frames, arms) radians that a bone is turned at most against the one before."""


def sucker_sides(skeleton: Skeleton, bones: Sequence[str], down: Floats) -> Floats:
    """The side of each bone (bones, 3) of an arm that the suckers are on, in its rest frame.

    Where the rig does not say, it is the side that looks down (3,), armature space, at rest.
    """
    key = content_key(skeleton, tuple(bones), down)
    return _sides.get(key, lambda: _sucker_sides(skeleton, bones, down))


def _sucker_sides(skeleton: Skeleton, bones: Sequence[str], down: Floats) -> Floats:
    rest = arm_rest(skeleton, bones)
    order = [skeleton.index[name] for name in bones]
    looking = rotate(conjugate(skeleton.rest_rotations[order]), down)
    for place, number in enumerate(order):
        if axis := AXES.get(skeleton.sucker_axes[number]):
            looking[place] = axis
    along = np.sum(looking * rest.segments, axis=-1, keepdims=True)
    across = looking - along * rest.segments
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    sides = np.where(size > _NO_SIDE, across / np.maximum(size, _NO_SIDE), 0.0)
    # A bone that hangs straight down at rest has no side that looks down: it has that of the bone
    # before, which is turned to it on the shortest way.
    for bone in range(1, len(sides)):
        if rest.follows[bone] and not sides[bone].any() and sides[bone - 1].any():
            back = conjugate(rest.carried[bone])
            before = rotate(back, rest.segments[bone - 1])
            turn = shortest_arc(before, rest.segments[bone])
            sides[bone] = rotate(turn, rotate(back, sides[bone - 1]))
    return sides


def rotate_bones(
    rests: Sequence[ArmRest], directions: Floats, bank: Floats, facing: Facing | None = None
) -> Floats:
    """Rotations (frames, arms, bones, 4) in each bone's rest frame (Blender's ``matrix_basis``) of
    arms of as many bones, their segments along unit ``directions`` (bones, 3, frames, arms),
    armature space.

    Each bone is twisted by ``bank`` (bones, frames, arms), radians, about its own segment, against
    the bone before. Of the way that a side of the arms is to face, a bone that faces askew by θ is
    turned by sin θ cos(θ/2): nothing for one that faces right, and hardly anything for one
    that faces nearly away, which would have no better side to turn to. So it never flips.
    """
    bones, _, frames, arms = directions.shape
    batch = frames * arms
    wanted = directions.reshape(bones, 3, batch)
    half = 0.5 * bank.reshape(bones, batch)
    turns, twists = np.empty((bones, 4, batch)), half.copy()
    orientation = np.zeros((4, batch))
    orientation[0] = 1.0
    own = _tiled([rest.carried for rest in rests], frames)
    segments = _tiled([rest.segments for rest in rests], frames)
    first, between = _straightened(rests, segments, frames)
    follows = np.array([rest.follows for rest in rests]).T
    sides = _tiled(facing.sides, frames) if facing is not None else None
    banked = np.cumsum(2.0 * half, axis=0) if facing is not None else half
    for bone in range(bones):
        carried = own[bone]
        if np.all(follows[bone]):
            carried = components_first.multiply(orientation, carried)
        elif np.any(follows[bone]):
            carried = np.where(
                np.tile(follows[bone], frames),
                components_first.multiply(orientation, carried),
                carried,
            )
        goal = components_first.rotate(components_first.conjugate(carried), wanted[bone])
        turn = components_first.shortest_arc(between[bone], goal)
        if first is not None:
            turn = components_first.multiply(turn, first[bone])
        turns[bone], twisted = turn, twists[bone]
        orientation = components_first.multiply(carried, turn)
        if facing is not None and sides is not None:
            side = components_first.rotate(orientation, sides[bone])
            # Bank is meant to be seen: it is what the side is turned away by.
            towards = facing.towards[bone].reshape(3, batch)
            sine = dot(components_first.cross(side, towards), wanted[bone])
            cosine = dot(side, towards) - dot(side, wanted[bone]) * dot(towards, wanted[bone])
            seen, aside = np.cos(banked[bone]), np.sin(banked[bone])
            askew = aside * cosine + seen * sine
            # Where all face away, each would add its own to what those before it turned.
            right = seen * cosine - aside * sine
            askew *= np.sqrt(np.maximum(0.5 * (1.0 + right), 0.0))
            twisted += 0.5 * facing.most_turn[bone].reshape(batch) * askew
        if np.any(twisted):
            twist = np.concatenate([np.cos(twisted)[None], np.sin(twisted) * segments[bone]])
            turns[bone] = components_first.multiply(turn, twist)
            orientation = components_first.multiply(orientation, twist)
    return np.ascontiguousarray(turns.reshape(bones, 4, frames, arms).transpose(2, 3, 0, 1))


def _straightened(
    rests: Sequence[ArmRest], segments: Floats, frames: int
) -> tuple[Floats | None, Floats]:
    """Turns (bones, 4, batch) of each bone's segment (bones, 3, batch) to where it goes straight on
    from the one before, and where that is (bones, 3, batch), in its rest frame; none where the arms
    lead out of no body.
    """
    if all(rest.outward is None for rest in rests):
        return None, segments
    on = np.array([each.straight_on for each in rests])
    own = np.array([rest.segments for rest in rests])
    flat = components_first.shortest_arc(own.reshape(-1, 3).T, on.reshape(-1, 3).T)
    turns = flat.T.reshape(*on.shape[:2], 4)
    return _tiled(list(turns), frames), _tiled(list(on), frames)


def _tiled(each: Sequence[Floats], frames: int) -> Floats:
    """What differs by arm, (bones, components) each, as (bones, components, frames × arms)."""
    return np.tile(np.stack(each, axis=-1), (1, 1, frames))


# --- Arms as frames along them, whatever rig they belong to: where the rig's own axes end ---------
#
# Each segment has a frame: x along the segment, y towards the suckers, z across. What one frame is
# against the one before is all that an arm's shape consists of; shapes are blended and bent there,
# in angle space, so lengths never change. Bones come in at the ends alone.


_ALONG = np.array([1.0, 0.0, 0.0])
_FACING = np.array([0.0, 1.0, 0.0])
_NEARLY_ALONG = 0.3
"""Length of what is across a segment, of a unit vector that does not tell which side is which."""


@dataclass(frozen=True, eq=False)
class ArmFrames:
    """One arm of a rig, between its bones and frames along it."""

    bones: tuple[str, ...]
    root: Floats
    """(3,) P₀ at rest, armature space."""
    lengths: Floats
    """(bones,) of the segments, armature units."""
    rest: ArmRest
    own: Floats
    """(bones, 4) each segment's frame in its bone's rest frame."""

    @cached_property
    def reach(self) -> Floats:
        """(bones + 1,) distance of each joint from P₀ along the arm."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @property
    def length(self) -> float:
        """Of the whole arm."""
        return float(self.reach[-1])

    @property
    def along(self) -> Floats:
        """(bones,) how far along the arm each bone begins, 0…1."""
        return self.reach[:-1] / self.length

    @cached_property
    def at_rest(self) -> Floats:
        """(bones, 4) frames at rest, armature space."""
        still = np.zeros((1, len(self.bones), 4))
        still[..., 0] = 1.0
        return self.from_bones(still)[0]

    def from_bones(self, rotations: Floats) -> Floats:
        """Frames (…, bones, 4) in armature space of bones' rotations (…, bones, 4)."""
        return multiply(self.rest.orientations(rotations), self.own)

    def to_bones(self, frames: Floats) -> Floats:
        """Rotations (…, bones, 4) in each bone's rest frame (Blender's ``matrix_basis``)."""
        orientations = multiply(frames, conjugate(self.own))
        carried = np.broadcast_to(self.rest.carried, orientations.shape).copy()
        follows = np.array(self.rest.follows)
        before = orientations[..., np.flatnonzero(follows) - 1, :]
        carried[..., follows, :] = multiply(before, self.rest.carried[follows])
        return multiply(conjugate(carried), orientations)

    def shape(self, frames: Floats) -> Floats:
        """Turns (…, bones, 4) of each frame against the one before, of the first against rest."""
        result = frames.copy()
        result[..., 0, :] = multiply(conjugate(self.at_rest[0]), frames[..., 0, :])
        result[..., 1:, :] = multiply(conjugate(frames[..., :-1, :]), frames[..., 1:, :])
        return result

    def shaped(self, shape: Floats) -> Floats:
        """Inverse of :meth:`shape`: frames (…, bones, 4) in armature space."""
        result = shape.copy()
        before = self.at_rest[0]
        for bone in range(len(self.bones)):
            before = multiply(before, shape[..., bone, :])
            result[..., bone, :] = before
        return result

    def joints(self, frames: Floats, strains: Floats | None = None) -> Floats:
        """Joints P₀ … Pₙ (…, bones + 1, 3) in armature space of an arm with frames (…, bones, 4),
        whose bones are longer than at rest by strains (…, bones), as a share.
        """
        lengths = self.lengths if strains is None else self.lengths * (1.0 + strains)
        steps = lengths[..., None] * along_segments(frames)
        start = np.broadcast_to(self.root, (*steps.shape[:-2], 1, 3))
        return np.concatenate([start, self.root + np.cumsum(steps, axis=-2)], axis=-2)


def frames_of_arm(skeleton: Skeleton, bones: Sequence[str], body: BodyFrame) -> ArmFrames:
    """An arm as its rig has it.

    Suckers face the axis that the rig names, else the ground; where an arm at rest leads up or
    down, the body's axis.

    Raises:
        RigError: a bone does not exist.
    """
    joints = joint_positions(skeleton, bones)
    steps = np.diff(joints, axis=0)
    rest = arm_rest(skeleton, bones)
    order = [skeleton.index[name] for name in bones]
    orientations = skeleton.rest_rotations[order]
    down = -body.rotation[:, 2]
    inward = body.center - joints[:-1]
    inward -= np.outer(inward @ down, down)
    back = conjugate(orientations)
    along = rest.segments
    named = np.array([AXES.get(skeleton.sucker_axes[bone], (0.0, 0.0, 0.0)) for bone in order])
    least = np.eye(3)[np.argmin(np.abs(along), axis=-1)]
    choices = np.stack([named, rotate(back, down), rotate(back, normalized(inward)), least])
    sides = choices - np.sum(choices * along, axis=-1, keepdims=True) * along
    # The first that tells which side is which; what has no name is of no length.
    first = np.argmax(np.linalg.norm(sides, axis=-1) > _NEARLY_ALONG, axis=0)
    facing = sides[first, np.arange(len(order))]
    own = frame_of(rest.segments, facing)
    return ArmFrames(tuple(bones), joints[0], np.linalg.norm(steps, axis=1), rest, own)


def along_segments(frames: Floats) -> Floats:
    """Unit vectors (…, 3) along the segments that frames (…, 4) are of."""
    return rotate(frames, _ALONG)


def frame_of(along: Floats, facing: Floats) -> Floats:
    """Quaternions (…, 4) of frames with x along (…, 3) and y as near to facing (…, 3) as can be."""
    x = normalized(along)
    y = normalized(facing - np.sum(facing * x, axis=-1, keepdims=True) * x)
    return from_matrix(np.stack(np.broadcast_arrays(x, y, cross(x, y)), axis=-1))


def bend_rotations(angles: Floats) -> Floats:
    """Turns (…, 4) by angles (…) that bend an arm to its back, away from the suckers."""
    return from_axis_angle(np.array([0.0, 0.0, 1.0]), -angles)


def transport_frames(directions: Floats, first: Floats) -> Floats:
    """Frames (…, segments, 4) without twist along directions (…, segments, 3), unit.

    A frame (…, 4) before the first segment is turned the shortest way to it.
    """
    result = np.empty((*directions.shape[:-1], 4))
    before = first
    for segment in range(directions.shape[-2]):
        along = directions[..., segment, :]
        turn = shortest_arc(along_segments(before), along)
        facing = rotate(turn, rotate(before, _FACING))
        before = frame_of(along, facing)
        result[..., segment, :] = before
    return result


# --- Arms of as many bones each, from their bones to their joints and back, all of them at once ---
#
# The same as ``ArmFrames`` says of one arm, without its frames: each bone's orientation tells
# where its segment points. Components come first and the batch last, as in
# ``rotations.components_first``.

EACH_ARM: Final = (slice(None), None)
"""Which arm each item of a batch is, whose shape is (arms, moments): nothing has to be gathered."""
_Which = np.ndarray | tuple[slice, None]


@dataclass(frozen=True, eq=False)
class ArmBatch:
    """Arms of as many bones each; the batch is any of them, at any moments."""

    roots: Floats
    """(3, arms) P₀ at rest, armature space."""
    lengths: Floats
    """(bones, arms) of the segments, armature units."""
    segments: Floats
    """(bones, 3, arms) unit vectors along the segments, in the bones' rest frames."""
    carried: Floats
    """(bones, 4, arms) each bone's rest orientation as the bone before sees it."""
    follows: np.ndarray
    """(bones, arms) whether the bone before turns this one."""

    @classmethod
    def of(cls, arms: Sequence[ArmFrames]) -> ArmBatch:
        """Some arms, all of as many bones."""
        return cls(
            np.stack([arm.root for arm in arms], axis=-1),
            np.stack([arm.lengths for arm in arms], axis=-1),
            np.stack([arm.rest.segments for arm in arms], axis=-1),
            np.stack([arm.rest.carried for arm in arms], axis=-1),
            np.stack([np.array(arm.rest.follows) for arm in arms], axis=-1),
        )

    def orientations(
        self, rotations: Floats, arm: _Which, armature: Floats | None = None
    ) -> Floats:
        """Orientations (bones, 4, batch) in armature space, of rotations (bones, 4, batch) in each
        bone's rest frame; ``arm`` (batch,) is which of the arms each one is. They are of the world
        where that of the armature (4, batch) is given. With ``EACH_ARM`` the batch is (arms,
        moments).
        """
        result = np.empty(rotations.shape)
        for bone, own in enumerate(rotations):
            before = result[bone - 1] if bone else None
            carried = self._carried(bone, arm, before, armature)
            result[bone] = components_first.multiply(carried, own)
        return result

    def rotations(self, orientations: Floats, arm: np.ndarray) -> Floats:
        """Inverse of :meth:`orientations`."""
        result = np.empty(orientations.shape)
        for bone, own in enumerate(orientations):
            before = orientations[bone - 1] if bone else None
            back = self._carried(bone, arm, before)
            back[1:] *= -1.0
            result[bone] = components_first.multiply(back, own)
        return result

    def _carried(
        self, bone: int, arm: _Which, before: Floats | None, armature: Floats | None = None
    ) -> Floats:
        """Where a bone of arms (batch,) is when it is not turned (4, batch), in armature space or
        that of the armature (4, batch).

        That hangs on the orientation of the bone before (4, batch).
        """
        place = arm if isinstance(arm, tuple) else (arm,)
        carried = self.carried[bone][(slice(None), *place)]
        follows = self.follows[bone]
        if before is None or not follows.all():
            # Of those that follow nothing it is in armature space already.
            free = carried if armature is None else components_first.multiply(armature, carried)
            if before is None or not follows.any():
                return free
            return np.where(follows[place], components_first.multiply(before, carried), free)
        return components_first.multiply(before, carried)

    def joints(self, orientations: Floats, arm: np.ndarray, strains: Floats) -> Floats:
        """Joints P₀ … Pₙ (bones + 1, 3, batch) in armature space, of orientations (bones, 4,
        batch).

        Bones are longer than at rest by strains (bones, batch), as a share; ``arm`` (batch,) is
        which of the arms each one is.
        """
        result = np.empty((len(orientations) + 1, 3, orientations.shape[2]))
        result[0] = self.roots[:, arm]
        lengths = self.lengths[:, arm] * (1.0 + strains)
        for bone, own in enumerate(orientations):
            along = components_first.rotate(own, self.segments[bone][:, arm])
            np.multiply(along, lengths[bone], out=result[bone + 1])
        return cumulative_sum(result)


def batches_by_bones(arms: Sequence[ArmFrames]) -> list[tuple[list[int], ArmBatch]]:
    """Arms, and their numbers, by how many bones they have."""
    by_bones: dict[int, list[int]] = {}
    for number, arm in enumerate(arms):
        by_bones.setdefault(len(arm.bones), []).append(number)
    return [
        (numbers, ArmBatch.of([arms[number] for number in numbers]))
        for numbers in by_bones.values()
    ]


_TURNS_AT_ONCE: Final = 100_000
"""Bones times moments whose turns are worked out in one portion, which the cache then holds."""


def turns_in_world(
    arms: Sequence[ArmFrames], rotations: Floats, orientations: Floats, every: int = 1
) -> Floats:
    """Radians (moments − every, bones) by which bones turn in the world within a frame.

    Args:
        arms: in the order of their bones.
        rotations: (moments, bones, 4) of all arms, one after the other, in the bones' rest frames.
        orientations: (moments, 4) of the armature, world.
        every: at every how many moments there is a frame.
    """
    count = max(len(rotations) - every, 0)
    result = np.empty((count, rotations.shape[1]))
    ends = np.cumsum([0, *(len(arm.bones) for arm in arms)])
    step = max(1, _TURNS_AT_ONCE // max(rotations.shape[1], 1))
    for numbers, batch in batches_by_bones(arms):
        bones = np.stack([np.arange(*ends[number : number + 2]) for number in numbers], axis=-1)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count) + every)
            own = rotations[part].transpose(1, 2, 0)[bones].transpose(0, 2, 1, 3)
            world = batch.orientations(own, EACH_ARM, orientations[part].T[:, None])
            same = np.einsum("bcaf,bcaf->fba", world[..., every:], world[..., :-every])
            result[part.start : part.stop - every, bones] = same
    np.abs(result, out=result)
    np.minimum(result, 1.0, out=result)
    np.arccos(result, out=result)
    result *= 2.0
    return result


# --- Arms that roll towards their neighbours, where one skin joins them ---------------------------
#
# Near the body arms side by side share a skin, and a web goes on between them. Their suckers look
# down whatever the neighbours do: where an arm comes to be above or below the next one, the skin
# between them stands upright, and was turned inside out. So arms roll there about themselves, to
# lie between their neighbours as they do at rest; their joints stay where they are.


_WIDEST_GAP: Final = np.radians(100.0)
"""Between arms that stand side by side, seen from above: of fewer than four none do."""
_ROLLS: Final = ((0.0, 0.1, 0.35, 0.5), (0.0, 1.0, 1.0, 0.0))
"""How far parts of an arm roll, by shares of its length: a web reaches a third of it."""
_FREE: Final = np.radians(15.0)
"""How askew arms may be without rolling …"""
_ROLLED: Final = 0.6
"""… how much they roll of what is beyond that, as long as it is little …"""
_MOST_ROLL: Final = np.radians(90.0)
"""… and at most. At 1 for 0.6 a bone of a walk turns by 24° in a frame instead of 20°."""
_TOO_FAR: Final = np.radians(110.0)
"""From here on they roll less, and half a turn askew not at all: either way would be as good."""
_IN_TIME: Final = (0.8, 1.0)
"""Seconds of a cycle up to which arms have no time to roll, and from which on all of it. Half of it
in Hurry would turn over 1.5 times as much of the web on ways that wind."""
_NEAR: Final = 0.5
"""Of how far apart the neighbours are at rest: where they are nearer to each other, it is less and
less told which side is whose."""
_SURE: Final = 0.01
"""Arm lengths that they are apart at rest, across a bone, to tell it anything."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class _Roots:
    """Bones of arms, as many of each, that roll, and one more, which gives back what they turn."""

    batch: ArmBatch
    places: np.ndarray
    """(bones, arms) among the bones of all arms."""

    def turned(self, rotations: Floats) -> Floats:
        """Orientations (bones, 4, arms, moments), armature space, of rotations (moments, bones, 4)
        of all arms.
        """
        own = rotations.transpose(1, 2, 0)[self.places].swapaxes(1, 2)
        return self.batch.orientations(own, EACH_ARM)

    def joints(self, turned: Floats, strains: Floats) -> Floats:
        """Joints (3, (bones + 1) · arms, moments), armature space, of orientations (bones, 4, arms,
        moments) and strains (moments, bones) of all arms.
        """
        bones, _, arms, moments = turned.shape
        longer = strains.T[self.places].reshape(bones, -1)
        joints = self.batch.joints(turned.reshape(bones, 4, -1), self._arm(moments), longer)
        return joints.swapaxes(0, 1).reshape(3, (bones + 1) * arms, moments)

    def rotations(self, orientations: Floats) -> Floats:
        """Rotations (moments, bones, arms, 4) of orientations (4, bones · arms, moments)."""
        (bones, arms), moments = self.places.shape, orientations.shape[-1]
        turned = orientations.reshape(4, bones, -1).swapaxes(0, 1)
        own = self.batch.rotations(turned, self._arm(moments))
        return own.reshape(bones, 4, arms, moments).transpose(3, 0, 2, 1)

    def _arm(self, moments: int) -> np.ndarray:
        return np.repeat(np.arange(self.places.shape[1]), moments)


@dataclass(frozen=True, eq=False)
class ArmRing:
    """Arms side by side round a body; bones are those near it, of all arms."""

    roots: tuple[_Roots, ...]
    beside: np.ndarray
    """(2, 2, bones) joints, among those of all arms: of the neighbours before and after, the one
    before and the one after the place beside the middle of a bone, …"""
    part: Floats
    """… and how far (2, bones, 1) that place is from one to the other, 0…1."""
    axes: Floats
    """(3, 3, bones) unit vectors in the bones' rest frames: along their segments, across these
    towards the neighbour after, and square to both."""
    apart: Floats
    """(bones, 1) of the neighbours at rest, across, armature units; infinite where that tells
    nothing."""
    share: Floats
    """(bones, 1) how far each bone rolls, 0…1."""

    @classmethod
    def of(cls, arms: Sequence[ArmFrames], azimuths: Floats) -> ArmRing | None:
        """Some arms as they stand at rest round their body, at so many radians (arms,); none where
        none stand side by side.
        """
        neighbours = _neighbours(azimuths)
        if not neighbours:
            return None
        first = np.cumsum([0, *(len(arm.bones) for arm in arms)])
        roots: list[_Roots] = []
        bones: list[tuple[int, int]] = []
        joints: dict[tuple[int, int], int] = {}
        for numbers, batch in batches_by_bones([_inner(arm) for arm in arms]):
            count = len(batch.lengths)
            roots.append(_Roots(batch, np.arange(count)[:, None] + first[numbers]))
            bones += [(number, bone) for bone in range(count) for number in numbers]
            for joint in range(count + 1):
                joints |= {(number, joint): len(joints) + at for at, number in enumerate(numbers)}
        beside, part = np.zeros((2, 2, len(bones)), dtype=np.int64), np.zeros((2, len(bones), 1))
        share = np.zeros((len(bones), 1))
        for row, (number, bone) in enumerate(bones):
            if number not in neighbours:
                continue
            arm = arms[number]
            middle = 0.5 * (arm.reach[bone] + arm.reach[bone + 1]) / arm.length
            share[row] = np.interp(middle, *_ROLLS)
            for side, other in enumerate(neighbours[number]):
                reach = arms[other].reach / arms[other].length
                at = int(np.searchsorted(reach, middle, side="right")) - 1
                at = min(at, _count(arms[other]) - 1)
                beside[side, :, row] = joints[other, at], joints[other, at + 1]
                part[side, row] = min((middle - reach[at]) / (reach[at + 1] - reach[at]), 1.0)
        along = np.concatenate(
            [each.batch.segments.swapaxes(0, 1).reshape(3, -1) for each in roots], 1
        )
        axes = np.stack([along, 0.0 * along, 0.0 * along])
        still = cls(tuple(roots), beside, part, axes, np.ones((len(bones), 1)), share)
        return still._as_at_rest(arms)

    def _as_at_rest(self, arms: Sequence[ArmFrames]) -> ArmRing:
        """The same, which knows how arms lie between their neighbours at rest."""
        count = sum(len(arm.bones) for arm in arms)
        rest = np.zeros((1, count, 4))
        rest[..., 0] = 1.0
        _, line = self._standing(rest, np.zeros((1, count)))
        along, line = self.axes[0], line[..., 0]
        across = line - dot(along, line) * along
        apart = np.sqrt(dot(across, across))
        side = across / np.maximum(apart, _TINY)
        # A neighbour straight ahead of a bone is on no side of it.
        sure = apart > _SURE * max(arm.length for arm in arms)
        return replace(
            self,
            axes=np.stack([along, side, components_first.cross(along, side)]),
            apart=np.where(sure, apart, np.inf)[:, None],
        )

    def _standing(self, rotations: Floats, strains: Floats) -> tuple[Floats, Floats]:
        """Orientations (4, bones, moments), armature space, and the lines (3, bones, moments) from
        the neighbour before to the one after beside each bone, in its own frame.
        """
        turned = [each.turned(rotations) for each in self.roots]
        there = zip(self.roots, turned, strict=True)
        joints = np.concatenate([each.joints(own, strains) for each, own in there], axis=1)
        turned = _flat(turned)
        before, after = (
            joints[:, first] + part * (joints[:, second] - joints[:, first])
            for (first, second), part in zip(self.beside, self.part, strict=True)
        )
        back = components_first.conjugate(turned.reshape(4, -1))
        line = components_first.rotate(back, (after - before).reshape(3, -1))
        return turned, line.reshape(before.shape)

    def rolled(
        self,
        rotations: Floats,
        strains: Floats,
        cycle: float,
        *,
        gait: tuple[Floats, Floats] | None = None,
    ) -> Floats:
        """Rotations (moments, bones, 4) of all bones of all arms, one after the other, in their
        rest frames, of arms that roll; they are longer than at rest by strains (moments, bones),
        and go through a cycle in so many seconds. They roll as they would with the rotations and
        strains of their gait, if these are others.
        """
        from_seconds, to_seconds = _IN_TIME
        time = smooth_step(np.asarray((cycle - from_seconds) / (to_seconds - from_seconds)))
        if time <= 0.0:
            return rotations
        turned, line = self._standing(*(gait or (rotations, strains)))
        if gait is not None:
            turned = _flat([each.turned(rotations) for each in self.roots])
        along, side, square = self.axes
        side, square = (np.einsum("cb,cbm->bm", each, line) for each in (side, square))
        told = np.minimum(np.hypot(side, square) / (_NEAR * self.apart), 1.0)
        half = 0.5 * time * self.share * told * _rolling(np.arctan2(square, side))
        twist = np.concatenate([np.cos(half)[None], np.sin(half) * along[..., None]])
        flat = turned.reshape(4, -1), twist.reshape(4, -1)
        turned = components_first.multiply(*flat).reshape(turned.shape)
        result, start = rotations.copy(), 0
        for each in self.roots:
            part = slice(start, start + each.places.size)
            result[:, each.places] = each.rotations(turned[:, part])
            start = part.stop
        return result


def _flat(turned: Sequence[Floats]) -> Floats:
    """(4, bones, moments) of (bones, 4, arms, moments) each."""
    return np.concatenate([own.swapaxes(0, 1).reshape(4, -1, own.shape[-1]) for own in turned], 1)


def _neighbours(azimuths: Floats) -> dict[int, tuple[int, int]]:
    """Numbers of the arms before and after those that stand beside both, by where (arms,) all do,
    radians.
    """
    order = np.argsort(azimuths, kind="stable")
    gaps = np.diff(azimuths[order], append=azimuths[order[0]] + 2.0 * np.pi)
    beside = np.maximum(gaps, np.roll(gaps, 1)) < _WIDEST_GAP
    around = zip(order, np.roll(order, 1), np.roll(order, -1), beside, strict=True)
    return {int(arm): (int(before), int(after)) for arm, before, after, near in around if near}


def _count(arm: ArmFrames) -> int:
    """How many of an arm's bones roll, and one more."""
    return min(int(np.searchsorted(arm.along, _ROLLS[0][-1])) + 1, len(arm.bones))


def _inner(arm: ArmFrames) -> ArmFrames:
    """An arm of these bones."""
    rest, count = arm.rest, _count(arm)
    return ArmFrames(
        arm.bones[:count],
        arm.root,
        arm.lengths[:count],
        ArmRest(rest.segments[:count], rest.carried[:count], rest.follows[:count], rest.outward),
        arm.own[:count],
    )


def _rolling(askew: Floats) -> Floats:
    """Radians that bones roll by which are so askew (any shape) between their neighbours."""
    size = np.abs(askew)
    beyond = np.maximum(size - _FREE, 0.0)
    lasting = smooth_step((np.pi - size) / (np.pi - _TOO_FAR))
    return np.sign(askew) * _MOST_ROLL * np.tanh(_ROLLED * beyond / _MOST_ROLL) * lasting
