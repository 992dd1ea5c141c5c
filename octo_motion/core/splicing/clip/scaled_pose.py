# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that are scaled: where they and those they carry come to lie."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...rotations import Floats, from_matrix, to_matrix
from ...skeleton import Skeleton
from .unpose import orientations_of, unposed

_LEAST: Final = 1e-4
"""Scale of what is scaled to nothing, to hide it: which way it points is still to be seen."""


def without_scale(
    skeleton: Skeleton, rotations: Floats, locations: Floats, scales: Floats
) -> tuple[Floats, Floats]:
    """Rotations and locations that put all bones where they are when each scales its children.

    For bones that inherit all of their parent's scale and rotation, which is the usual.

    Args:
        skeleton: the bones.
        rotations: (frames, bones, 4) in each bone's rest frame.
        locations: (frames, bones, 3) in each bone's rest frame.
        scales: (frames, bones, 3) in each bone's rest frame.
    """
    scales = np.where(np.abs(scales) < _LEAST, _LEAST, scales)
    basis = np.zeros((*rotations.shape[:2], 4, 4))
    basis[..., :3, :3] = to_matrix(rotations) * scales[..., None, :]
    basis[..., :3, 3] = locations
    basis[..., 3, 3] = 1.0
    posed = np.empty_like(basis)
    for bone, parent in enumerate(skeleton.parents):
        rest = skeleton.rest_matrices[bone]
        if parent < 0:
            posed[:, bone] = rest @ basis[:, bone]
        else:
            offset = np.linalg.inv(skeleton.rest_matrices[parent]) @ rest
            posed[:, bone] = posed[:, parent] @ offset @ basis[:, bone]
    return unposed(skeleton, from_matrix(orientations_of(posed[..., :3, :3])), posed[..., :3, 3])
