# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the armature, or its root bone, must be for the body to be on its route."""

from __future__ import annotations

import numpy as np

from ...rotations import Floats, conjugate, from_matrix, multiply, rotate
from ...skeleton import Skeleton
from .arm_chains import BodyFrame


def object_transforms(
    body: BodyFrame, scale: float, positions: Floats, rotations: Floats
) -> tuple[Floats, Floats]:
    """World locations (frames, 3) and orientations (frames, 4) of the armature object.

    Args:
        body: where the body lies in armature space.
        scale: uniform scale of the object in the world.
        positions: (frames, 3) of the body's centre, world space.
        rotations: (frames, 4) of the canonical body, world space.
    """
    turned = multiply(rotations, conjugate(from_matrix(body.rotation)))
    return positions - rotate(turned, scale * body.center), turned


def root_bone_transforms(
    skeleton: Skeleton,
    bone: str,
    world: Floats,
    locations: Floats,
    orientations: Floats,
) -> tuple[Floats, Floats]:
    """Locations (frames, 3) and rotations (frames, 4) of a bone, in its rest frame.

    The bone carries the body as the object would have, were the object at ``locations`` and
    ``orientations``; its own parents stay at rest.

    Args:
        skeleton: the rig.
        bone: name of the root bone.
        world: (4, 4) world matrix of the object, which stays where it is; uniform scale.
        locations: (frames, 3) from ``object_transforms``.
        orientations: (frames, 4) from ``object_transforms``.
    """
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    still = conjugate(from_matrix(world[:3, :3] / scale))
    # The motion that the whole armature would make, seen from the armature where it stands.
    turn = multiply(still, orientations)
    shift = rotate(still, locations - world[:3, 3]) / scale
    number = skeleton.index[bone]
    rest = skeleton.rest_rotations[number]
    head = skeleton.heads[number]
    moved = rotate(turn, head) + shift - head
    return rotate(conjugate(rest), moved), multiply(conjugate(rest), multiply(turn, rest))


def carried_by_root_bone(
    skeleton: Skeleton, bone: str, world: Floats, locations: Floats, rotations: Floats
) -> tuple[Floats, Floats]:
    """Inverse of :func:`root_bone_transforms`.

    Args:
        skeleton: the rig.
        bone: name of the root bone.
        world: (4, 4) world matrix of the object, which stays where it is; uniform scale.
        locations: (frames, 3) of the bone, in its rest frame.
        rotations: (frames, 4) likewise.

    Returns:
        Locations (frames, 3) and orientations (frames, 4) in the world that the object would have
        to have, were it the one that travels.
    """
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    stands = from_matrix(world[:3, :3] / scale)
    number = skeleton.index[bone]
    rest, head = skeleton.rest_rotations[number], skeleton.heads[number]
    turn = multiply(multiply(rest, rotations), conjugate(rest))
    shift = rotate(rest, locations) + head - rotate(turn, head)
    return world[:3, 3] + scale * rotate(stands, shift), multiply(stands, turn)
