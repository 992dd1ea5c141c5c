# SPDX-License-Identifier: GPL-3.0-or-later
"""From solved joints to bone rotations: swing by the smallest rotation, twist by bank alone.

A bone that follows its segment by the smallest rotation from where its parent carries it gains no
twist of its own. So twist is a channel by itself: bank, and nothing else: the
source's first open problem was arms that wring themselves, and suckers that face the sky.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..rotations import Floats, conjugate, multiply, normalized, rotate
from ..skeleton import Skeleton
from .chains import joint_positions
from .columns import product, smallest_arc, turned


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


def arm_rest(skeleton: Skeleton, bones: Sequence[str]) -> ArmRest:
    """The rest pose of a chain; helper bones within it ride along rigidly.

    Raises:
        RigError: a bone does not exist.
    """
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


def bone_rotations(rests: Sequence[ArmRest], directions: Floats, bank: Floats) -> Floats:
    """Rotations (frames, arms, bones, 4) in each bone's rest frame (Blender's ``matrix_basis``).

    Args:
        rests: the arms, all of as many bones.
        directions: (bones, 3, frames, arms) unit vectors along the segments, armature space.
        bank: (bones, frames, arms) radians by which each bone is twisted about its own segment,
            against the bone before.
    """
    bones, _, frames, arms = directions.shape
    batch = frames * arms
    wanted = directions.reshape(bones, 3, batch)
    half = 0.5 * bank.reshape(bones, batch)
    result = np.empty((frames, arms, bones, 4))
    orientation = np.zeros((4, batch))
    orientation[0] = 1.0
    for bone in range(bones):
        segment = _tiled([rest.segments[bone] for rest in rests], frames)
        carried = _tiled([rest.carried[bone] for rest in rests], frames)
        follows = np.array([rest.follows[bone] for rest in rests])
        if np.all(follows):
            carried = product(orientation, carried)
        elif np.any(follows):
            carried = np.where(np.tile(follows, frames), product(orientation, carried), carried)
        backwards = carried * np.array([1.0, -1.0, -1.0, -1.0])[:, None]
        turn = smallest_arc(segment, turned(backwards, wanted[bone]))
        if np.any(half[bone]):
            twist = np.concatenate([np.cos(half[bone])[None], np.sin(half[bone]) * segment])
            turn = product(turn, twist)
        orientation = product(carried, turn)
        result[:, :, bone] = turn.T.reshape(frames, arms, 4)
    return result


def _tiled(each: Sequence[Floats], frames: int) -> Floats:
    """What differs by arm, (components,) each, as (components, frames × arms)."""
    return np.tile(np.stack(each, axis=-1), (1, frames))
