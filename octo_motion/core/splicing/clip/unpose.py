# SPDX-License-Identifier: GPL-3.0-or-later
"""Forward kinematics backwards: from where the bones are to how each is turned and moved."""

from __future__ import annotations

import numpy as np

from ...rotations import Floats, conjugate, multiply, normalized, rotate
from ...skeleton import Skeleton


def unposed(skeleton: Skeleton, orientations: Floats, heads: Floats) -> tuple[Floats, Floats]:
    """Rotations (…, bones, 4) and locations (…, bones, 3) in each bone's rest frame.

    The inverse of ``Skeleton.pose``.

    Args:
        skeleton: the bones.
        orientations: (…, bones, 4) quaternions, armature space.
        heads: (…, bones, 3), armature space.
    """
    rotations, locations = np.empty(orientations.shape), np.empty(heads.shape)
    for bone, parent in enumerate(skeleton.parents):
        rest, position = skeleton.rest_rotations[bone], skeleton.heads[bone]
        carried = rest
        if parent >= 0:
            turn = multiply(
                orientations[..., parent, :], conjugate(skeleton.rest_rotations[parent])
            )
            position = heads[..., parent, :] + rotate(turn, position - skeleton.heads[parent])
            carried = multiply(turn, rest)
        moved = heads[..., bone, :] - position
        locations[..., bone, :] = rotate(conjugate(carried), moved)
        if not skeleton.inherits_rotation[bone]:
            carried = rest
        rotations[..., bone, :] = multiply(conjugate(carried), orientations[..., bone, :])
    return rotations, locations


def orientations_of(matrices: Floats) -> Floats:
    """Orthonormal axes (…, 3, 3) of matrices that may scale and shear.

    Y, along which a bone points, keeps its direction, and X its side.
    """
    y = normalized(matrices[..., :, 1])
    x = matrices[..., :, 0]
    x = normalized(x - np.sum(x * y, axis=-1, keepdims=True) * y)
    return np.stack([x, y, np.cross(x, y)], axis=-1)
