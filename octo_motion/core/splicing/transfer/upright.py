# SPDX-License-Identifier: GPL-3.0-or-later
"""A trunk that leans as it should: the neck stands over the hips where it was seen.

How a spine is built differs from file to file: the same chest over the same pelvis, and the neck
comes to stand elsewhere. As a limb's hand is brought into its direction [Splice, 2.2], so is the
neck, by the lowest bone of the trunk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    dot,
    multiply,
    normalized,
    shortest_arc,
    slerp,
)
from ...skeleton import Skeleton
from ..clip import Posture
from ..humanoid import Landmarks
from .parts import landmark_bone


@dataclass(frozen=True)
class Trunk:
    """The bones that say how a body leans."""

    hips: int
    waist: int
    """The lowest bone above the pelvis on the way to the chest."""
    neck: int

    def lean(self, posture: Posture) -> Floats:
        """(frames, 3) from hips to neck, of length one, armature space."""
        return normalized(posture.head(self.neck) - posture.head(self.hips))


def trunk_of(skeleton: Skeleton, landmarks: Landmarks) -> Trunk | None:
    """The trunk of a body; none if it does not hang on the hips and go along with them.

    Raises:
        ClipError: hips, chest or head are not known.
    """
    hips, chest = (landmark_bone(skeleton, landmarks, each) for each in ("hips", "chest"))
    neck = landmark_bone(skeleton, landmarks, "neck", "head")
    above = [chest, *skeleton.ancestors(chest)]
    if hips not in above[1:] or chest not in skeleton.ancestors(neck):
        return None
    waist = above[above.index(hips) - 1]
    return Trunk(hips, waist, neck) if skeleton.inherits_rotation[waist] else None


def stand_over(
    trunk: Trunk, posture: Posture, rotations: Floats, way: Floats, share: Floats
) -> None:
    """Turn the waist so that the neck lies in a direction from the hips.

    Args:
        trunk: of the posture's skeleton.
        posture: as it is.
        rotations: (frames, bones, 4) of it, to be changed.
        way: (frames, 3) from hips to neck as wanted, of length one, armature space.
        share: (frames,) how far to go, 0…1.
    """
    waist = trunk.waist
    turning = posture.head(trunk.neck) - posture.head(waist)
    # What stays as it is: between hips and waist.
    still = posture.head(waist) - posture.head(trunk.hips)
    along = dot(way, still)
    room = along**2 - dot(still, still) + dot(turning, turning)
    wanted = (along + np.sqrt(np.maximum(room, 0.0)))[:, None] * way - still
    turn = slerp(IDENTITY, shortest_arc(normalized(turning), normalized(wanted)), share)
    turned = multiply(turn, posture.orientation(waist))
    rotations[:, waist] = multiply(conjugate(posture.carried(waist)), turned)
