# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that lean as they should.

Seen from upright axes that face as the pelvis does, what leans in the one clip leans alike on the
other body, however the two pelvises are tilted. And as a limb's hand is brought into its direction
[Splice, 2.2], so is the neck over the hips: a spine is built differently from file to file. Who
lies or turns over is seen from the pelvis instead.

All of it from joints, so that neither rest pose nor bone axes have a say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    dot,
    from_axis_angle,
    multiply,
    normalized,
    rotate,
    shortest_arc,
    slerp,
)
from ...skeleton import Skeleton
from ...smoothing import smooth_step
from ..clip import Posture
from ..humanoid import Landmarks
from .parts import landmark_bone

_LYING: Final = float(np.cos(np.radians(75.0)))
_STANDING: Final = float(np.cos(np.radians(45.0)))
"""Cosines of tilts: of who leans more than the first, legs and trunk, nothing stands upright."""

_X, _Z = np.eye(3)[[0, 2]]


@dataclass(frozen=True)
class Body:
    """The bones that say how somebody stands."""

    hips: int
    waist: int
    """The lowest bone above the pelvis on the way to the chest."""
    neck: int
    feet: tuple[int, int]
    """Or the lowest that is known of each leg."""

    def lean(self, posture: Posture) -> Floats:
        """(frames, 3) from hips to neck, of length one, armature space."""
        return normalized(posture.head(self.neck) - posture.head(self.hips))

    def standing(self, posture: Posture, up: Floats) -> Floats:
        """How much the body stands on its legs or holds its trunk upright, (frames,) 0…1."""
        feet = 0.5 * (posture.head(self.feet[0]) + posture.head(self.feet[1]))
        legs = normalized(posture.head(self.hips) - feet)
        most = np.maximum(dot(legs, up), dot(self.lean(posture), up))
        return smooth_step((most - _LYING) / (_STANDING - _LYING))


def body_of(skeleton: Skeleton, landmarks: Landmarks) -> Body | None:
    """The body; none if its trunk does not hang on the hips and go along with them.

    Raises:
        ClipError: hips, chest, head or a thigh are not known.
    """
    hips, chest = (landmark_bone(skeleton, landmarks, each) for each in ("hips", "chest"))
    neck = landmark_bone(skeleton, landmarks, "neck", "head")
    left, right = (
        landmark_bone(skeleton, landmarks, f"foot.{side}", f"shin.{side}", f"thigh.{side}")
        for side in "LR"
    )
    above = [chest, *skeleton.ancestors(chest)]
    if hips not in above[1:] or chest not in skeleton.ancestors(neck):
        return None
    waist = above[above.index(hips) - 1]
    if not skeleton.inherits_rotation[waist]:
        return None
    return Body(hips, waist, neck, (left, right))


def heading(goal: Floats, start: Floats) -> Floats:
    """The turn about Z (…, 4) that brings one orientation closest to another."""
    between = multiply(goal, conjugate(start)) * [1.0, 0.0, 0.0, 1.0]
    # Upside down there is none.
    between[..., 0] += 1e-12
    return normalized(between)


def facing(pelvis: Floats, up: Floats) -> Floats:
    """Upright orientations (frames, 4), with the left on the side where pelvises have it.

    Args:
        pelvis: (frames, 4), X to the left: two joints tell that axis, whatever the others are.
        up: (3,) of length one.
    """
    standing = shortest_arc(_Z, up)
    left = rotate(multiply(conjugate(standing), pelvis), _X)
    return multiply(standing, from_axis_angle(_Z, np.arctan2(left[:, 1], left[:, 0])))


def stand_over(body: Body, posture: Posture, rotations: Floats, way: Floats, share: Floats) -> None:
    """Turn the waist so that the neck lies in a direction from the hips.

    Args:
        body: of the posture's skeleton.
        posture: as it is.
        rotations: (frames, bones, 4) of it, to be changed.
        way: (frames, 3) from hips to neck as wanted, of length one, armature space.
        share: (frames,) how far to go, 0…1.
    """
    waist = body.waist
    turning = posture.head(body.neck) - posture.head(waist)
    # What stays as it is: between hips and waist.
    still = posture.head(waist) - posture.head(body.hips)
    along = dot(way, still)
    room = along**2 - dot(still, still) + dot(turning, turning)
    wanted = (along + np.sqrt(np.maximum(room, 0.0)))[:, None] * way - still
    turn = slerp(IDENTITY, shortest_arc(normalized(turning), normalized(wanted)), share)
    turned = multiply(turn, posture.orientation(waist))
    rotations[:, waist] = multiply(conjugate(posture.carried(waist)), turned)
