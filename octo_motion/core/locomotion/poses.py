# SPDX-License-Identifier: GPL-3.0-or-later
"""From solved joints to bone rotations: swing by the smallest rotation, twist by bank alone.

A bone that follows its segment by the smallest rotation from where its parent carries it gains no
twist of its own. So twist is a channel by itself: bank, and nothing else [SPEC of the source's
first open problem: arms that wring themselves, suckers that face the sky].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..rotations import (
    Floats,
    conjugate,
    from_axis_angle,
    multiply,
    normalized,
    rotate,
    shortest_arc,
)
from ..skeleton import Skeleton
from .chains import joint_positions


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


def bone_rotations(rest: ArmRest, directions: Floats, bank: Floats) -> Floats:
    """Rotations (bones, frames, 4) in each bone's rest frame (Blender's ``matrix_basis``).

    Args:
        rest: the arm.
        directions: (bones, frames, 3) unit vectors along the segments, armature space.
        bank: (bones, frames) radians by which each bone is twisted about its own segment,
            against the bone before.
    """
    result = np.empty((*directions.shape[:-1], 4))
    orientation = np.empty(0)
    for bone, segment in enumerate(rest.segments):
        carried = rest.carried[bone]
        if rest.follows[bone]:
            carried = multiply(orientation, carried)
        wanted = rotate(conjugate(carried), directions[bone])
        swing = shortest_arc(segment, wanted)
        result[bone] = multiply(swing, from_axis_angle(segment, bank[bone]))
        orientation = multiply(carried, result[bone])
    return result
