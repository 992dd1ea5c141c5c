# SPDX-License-Identifier: GPL-3.0-or-later
"""From solved joints to bone rotations: swing by the smallest rotation, twist by bank alone.

A bone that follows its segment by the smallest rotation from where its parent carries it gains no
twist of its own. So twist is a channel by itself: bank, and nothing else: the
source's first open problem was arms that wring themselves, and suckers that face the sky.

The smallest rotation is indefinite, and jumps, where a bone points opposite to its rest. Arms of
many rigs hang straight down at rest, and rear up straight when they move. So what the body carries
is turned to where its arm points out of the body first, and from there to its segment: an arm that
points straight into its own body is nowhere to be seen. Likewise its further bones go by way of
where they would go straight on from the one before: the last bone of imported rigs, whose files
know no tails, may stand across its arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...rotations import Floats, components_first, conjugate, multiply, normalized, rotate
from ...rotations.components_first import dot
from ...skeleton import Skeleton
from .arm_chains import AXES, joint_positions

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

    def straight_on(self, bone: int) -> Floats:
        """(3,) unit, in its rest frame: where a bone points by way of which it is turned.

        It goes on from the bone before, or out of the body: at rest it may be bent far from that.
        """
        if self.outward is None:
            return self.segments[bone]
        back = conjugate(self.carried[bone])
        return rotate(back, self.segments[bone - 1] if self.follows[bone] else self.outward)


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
    """The side of each bone (bones, 3) that the suckers are on, in its rest frame.

    Where the rig does not say, it is the side that looks down at rest.

    Args:
        skeleton: the rig.
        bones: of an arm.
        down: (3,) armature space.
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
    # A bone that hangs straight down at rest has no side that looks down: it follows its parent.
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    return np.where(size > _NO_SIDE, across / np.maximum(size, _NO_SIDE), 0.0)


def rotate_bones(
    rests: Sequence[ArmRest], directions: Floats, bank: Floats, facing: Facing | None = None
) -> Floats:
    """Rotations (frames, arms, bones, 4) in each bone's rest frame (Blender's ``matrix_basis``).

    Args:
        rests: the arms, all of as many bones.
        directions: (bones, 3, frames, arms) unit vectors along the segments, armature space.
        bank: (bones, frames, arms) radians by which each bone is twisted about its own segment,
            against the bone before.
        facing: which way a side of the arms turns besides. A bone that faces askew by θ is turned
            by sin θ (1 + cos θ) / 2: nothing for one that faces right, and hardly anything for one
            that faces nearly away, which would have no better side to turn to. So it never flips.
    """
    bones, _, frames, arms = directions.shape
    batch = frames * arms
    wanted = directions.reshape(bones, 3, batch)
    half = 0.5 * bank.reshape(bones, batch)
    result = np.empty((frames, arms, bones, 4))
    orientation = np.zeros((4, batch))
    orientation[0] = 1.0
    banked = np.zeros(batch)
    for bone in range(bones):
        segment = _tiled([rest.segments[bone] for rest in rests], frames)
        carried = _tiled([rest.carried[bone] for rest in rests], frames)
        follows = np.array([rest.follows[bone] for rest in rests])
        if np.all(follows):
            carried = components_first.multiply(orientation, carried)
        elif np.any(follows):
            carried = np.where(
                np.tile(follows, frames), components_first.multiply(orientation, carried), carried
            )
        turn = _swing(rests, bone, carried, wanted[bone])
        twisted = half[bone]
        if facing is not None:
            side = _tiled([each[bone] for each in facing.sides], frames)
            side = components_first.rotate(components_first.multiply(carried, turn), side)
            # Bank is meant to be seen: it is what the side is turned away by.
            banked = banked + 2.0 * half[bone]
            towards = facing.towards[bone].reshape(3, batch)
            sine = dot(components_first.cross(side, towards), wanted[bone])
            cosine = dot(side, towards) - dot(side, wanted[bone]) * dot(towards, wanted[bone])
            askew = np.sin(banked) * cosine + np.cos(banked) * sine
            # Where all face away, each would add its own to what those before it turned.
            right = np.cos(banked) * cosine - np.sin(banked) * sine
            askew *= 0.5 * (1.0 + right)
            twisted = twisted + 0.5 * facing.most_turn[bone].reshape(batch) * askew
        if np.any(twisted):
            turn = components_first.multiply(
                turn, np.concatenate([np.cos(twisted)[None], np.sin(twisted) * segment])
            )
        orientation = components_first.multiply(carried, turn)
        result[:, :, bone] = turn.T.reshape(frames, arms, 4)
    return result


def carried_to(rests: Sequence[ArmRest], rotations: Floats) -> Floats:
    """Orientations (frames, arms, bones, 4) that bones are carried to, armature space.

    Args:
        rests: the arms, all of as many bones.
        rotations: (frames, arms, bones, 4) in each bone's rest frame.
    """
    result = np.empty(rotations.shape)
    for arm, rest in enumerate(rests):
        for bone, follows in enumerate(rest.follows):
            carried = rest.carried[bone]
            if follows:
                carried = multiply(result[:, arm, bone - 1], carried)
            result[:, arm, bone] = multiply(carried, rotations[:, arm, bone])
    return result


def _swing(rests: Sequence[ArmRest], bone: int, carried: Floats, wanted: Floats) -> Floats:
    """Quaternions (4, batch), in the bone's rest frame, that bring its segment where it is wanted.

    Args:
        rests: the arms.
        bone: which bone of theirs.
        carried: (4, batch) where it is carried, armature space.
        wanted: (3, batch) unit, armature space.
    """
    frames = wanted.shape[-1] // len(rests)
    segment = _tiled([rest.segments[bone] for rest in rests], frames)
    goal = components_first.rotate(components_first.conjugate(carried), wanted)
    if all(rest.outward is None for rest in rests):
        return components_first.shortest_arc(segment, goal)
    between = [rest.straight_on(bone) for rest in rests]
    first = components_first.shortest_arc(
        _tiled([rest.segments[bone] for rest in rests], 1), _tiled(between, 1)
    )
    return components_first.multiply(
        components_first.shortest_arc(_tiled(between, frames), goal), np.tile(first, (1, frames))
    )


def _tiled(each: Sequence[Floats], frames: int) -> Floats:
    """What differs by arm, (components,) each, as (components, frames × arms)."""
    return np.tile(np.stack(each, axis=-1), (1, frames))
