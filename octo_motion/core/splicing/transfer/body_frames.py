# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of the body from which parts are seen: the chest's and the pelvis's.

Each is fixed to a bone but built from landmarks, so that it does not hang on how a file lays its
bones' axes: X to the body's left, Y to its back, Z up along the trunk, as for a figure that faces
Blender's front. Landmarks are taken in the reference pose, which comes from the clip; a skeleton
that has none is taken at rest.

Where two skeletons carry the same joints at the same places of the bone, these joints are laid over
each other instead: the frames then agree to the last digit whatever the two people do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...errors import ClipError
from ...phrases import phrase
from ...rotations import Floats, conjugate, from_matrix, multiply, normalized, rotate
from ...skeleton import Skeleton
from ..clip import Posture
from ..humanoid import Landmarks
from .parts import landmark_bone
from .reference_pose import ReferencePose

_CHEST_JOINTS: Final = (
    *("clavicle.L", "clavicle.R", "upper_arm.L", "upper_arm.R"),
    *("neck", "head"),
)
_PELVIS_JOINTS: Final = ("thigh.L", "thigh.R", "spine", "chest")

_SAME: Final = 0.01
"""Of its size: how far joints may lie off each other and count as the same body's."""

_FLAT: Final = 0.02
"""Of its length: joints that spread less than this sideways do not tell how a bone is turned."""


@dataclass(frozen=True, eq=False)
class AnatomicalFrame:
    """A frame that rides on a bone."""

    bone: int
    """The bone, or −1 for the armature itself."""
    turn: Floats
    """(4,) from the frame's axes to the bone's."""
    origin: Floats
    """(3,) from the bone's head, along the bone's axes."""
    joints: dict[str, Floats]
    """Places of the joints that hang on the bone, along the bone's axes, by landmark."""

    def orientation(self, posture: Posture) -> Floats:
        """(frames, 4), armature space."""
        if self.bone < 0:
            return self.turn
        return multiply(posture.orientation(self.bone), self.turn)

    def place(self, posture: Posture) -> Floats:
        """Origin (frames, 3), armature space."""
        if self.bone < 0:
            return self.origin
        return posture.head(self.bone) + rotate(posture.orientation(self.bone), self.origin)

    def beginning_at(self, joint: int, skeleton: Skeleton) -> AnatomicalFrame:
        """The same one with its origin where a joint is at rest."""
        return self.midway((joint,), skeleton)

    def midway(self, joints: Sequence[int], skeleton: Skeleton) -> AnatomicalFrame:
        """The same one with its origin midway between joints at rest."""
        back = conjugate(skeleton.rest_rotations[self.bone])
        middle = skeleton.heads[list(joints)].mean(axis=0)
        return replace(self, origin=rotate(back, middle - skeleton.heads[self.bone]))

    def at_rest(self, skeleton: Skeleton) -> Floats:
        """Orientation (4,) in the rest pose, armature space."""
        if self.bone < 0:
            return self.turn
        return multiply(skeleton.rest_rotations[self.bone], self.turn)


def chest_frame(
    skeleton: Skeleton, landmarks: Landmarks, reference: ReferencePose | None = None
) -> AnatomicalFrame:
    """The chest's frame; its origin is midway between the shoulders.

    ``reference``: the skeleton's, if it rests in it.

    Raises:
        ClipError: a landmark is missing, or they lie in one line.
    """
    chest = landmark_bone(skeleton, landmarks, "chest")
    left, right, top, low = (
        skeleton.heads[landmark_bone(skeleton, landmarks, *choices)]
        for choices in (("upper_arm.L",), ("upper_arm.R",), ("neck", "head"), ("spine", "hips"))
    )
    middle = 0.5 * (left + right)
    if reference is not None:
        return _referred(skeleton, chest, middle, reference.fixed["chest"])
    joints = _joints(skeleton, landmarks, chest, _CHEST_JOINTS)
    return _frame(skeleton, chest, left - right, top - low, origin=middle, joints=joints)


def pelvis_frame(
    skeleton: Skeleton, landmarks: Landmarks, reference: ReferencePose | None = None
) -> AnatomicalFrame:
    """The pelvis's frame; its origin is midway between the hip joints.

    ``reference``: the skeleton's, if it rests in it.

    Raises:
        ClipError: a landmark is missing, or they lie in one line.
    """
    hips = landmark_bone(skeleton, landmarks, "hips")
    left, right, top = (
        skeleton.heads[landmark_bone(skeleton, landmarks, *choices)]
        for choices in (("thigh.L",), ("thigh.R",), ("neck", "head"))
    )
    middle = 0.5 * (left + right)
    if reference is not None:
        return _referred(skeleton, hips, middle, reference.fixed["hips"])
    joints = _joints(skeleton, landmarks, hips, _PELVIS_JOINTS)
    return _frame(skeleton, hips, left - right, top - middle, origin=middle, joints=joints)


def joint_frame(skeleton: Skeleton, bone: int, body: AnatomicalFrame) -> AnatomicalFrame:
    """The frame of a part's own joint: fixed to what its first bone hangs on, and at rest as the
    body's frame is.
    """
    parent = skeleton.parents[bone]
    if parent < 0:
        return body
    back = conjugate(skeleton.rest_rotations[parent])
    offset = rotate(back, skeleton.heads[bone] - skeleton.heads[parent])
    return AnatomicalFrame(parent, multiply(back, body.at_rest(skeleton)), offset, {})


def chain_frame(skeleton: Skeleton, bones: Sequence[int]) -> AnatomicalFrame:
    """The frame of a chain that is no limb of a humanoid: fixed to what the chain hangs on, with
    X along the chain at rest and Z up.
    """
    root, parent = bones[0], skeleton.parents[bones[0]]
    along = skeleton.tails[bones[-1]] - skeleton.heads[root]
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(up, along)
    if np.linalg.norm(side) < 1e-3 * np.linalg.norm(along):
        side = np.array([0.0, 1.0, 0.0])
    x, y = normalized(along), normalized(side)
    y = normalized(y - np.dot(x, y) * x)
    turn = from_matrix(np.stack([x, y, np.cross(x, y)], axis=-1))
    if parent < 0:
        return AnatomicalFrame(-1, turn, skeleton.heads[root], {})
    back = conjugate(skeleton.rest_rotations[parent])
    offset = rotate(back, skeleton.heads[root] - skeleton.heads[parent])
    return AnatomicalFrame(parent, multiply(back, turn), offset, {})


def laid_over(splice: AnatomicalFrame, base: AnatomicalFrame) -> AnatomicalFrame:
    """The splice body's frame, made to agree with the base's where the two are the same body."""
    names = sorted(splice.joints.keys() & base.joints.keys())
    if len(names) < 2:
        return splice
    # The bone's own head is a joint as well.
    ours = np.array([np.zeros(3), *(base.joints[name] for name in names)])
    theirs = np.array([np.zeros(3), *(splice.joints[name] for name in names)])
    our_middle, their_middle = ours.mean(axis=0), theirs.mean(axis=0)
    ours, theirs = ours - our_middle, theirs - their_middle
    spreads = [np.linalg.svd(points, compute_uv=False) for points in (ours, theirs)]
    if any(spread[1] <= _FLAT * spread[0] for spread in spreads):
        return splice
    scale = np.linalg.norm(ours) / np.linalg.norm(theirs)
    left, _, right = np.linalg.svd(ours.T @ theirs)
    proper = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    turn = left @ proper @ right
    misses = np.linalg.norm(ours - scale * theirs @ turn.T, axis=1)
    if misses.max() > _SAME * np.linalg.norm(ours):
        return splice
    back = conjugate(from_matrix(turn))
    origin = their_middle + rotate(back, base.origin - our_middle) / scale
    return AnatomicalFrame(splice.bone, multiply(back, base.turn), origin, splice.joints)


def _referred(
    skeleton: Skeleton, bone: int, origin: Floats, joints: dict[str, Floats]
) -> AnatomicalFrame:
    """The frame of a bone that rests in the reference pose, where all frames are upright."""
    back = conjugate(skeleton.rest_rotations[bone])
    return AnatomicalFrame(bone, back, rotate(back, origin - skeleton.heads[bone]), joints)


def _frame(
    skeleton: Skeleton,
    bone: int,
    left: Floats,
    up: Floats,
    *,
    origin: Floats,
    joints: dict[str, Floats],
) -> AnatomicalFrame:
    """A frame with X along ``left`` and Z as near to ``up`` as that allows, armature space."""
    left, up = normalized(left), normalized(up)
    up = up - np.dot(left, up) * left
    if np.linalg.norm(left) < 0.5 or np.linalg.norm(up) < 1e-3:
        raise ClipError(
            phrase(
                "Left, right and up cannot be told at '{name}': its joints lie in one line.",
                name=skeleton.names[bone],
            ),
            "Look at the bone table.",
        )
    up = normalized(up)
    axes = from_matrix(np.stack([left, np.cross(up, left), up], axis=-1))
    back = conjugate(skeleton.rest_rotations[bone])
    offset = rotate(back, origin - skeleton.heads[bone])
    return AnatomicalFrame(bone, multiply(back, axes), offset, joints)


def _joints(
    skeleton: Skeleton, landmarks: Landmarks, bone: int, names: Sequence[str]
) -> dict[str, Floats]:
    """Where the bone's children on the way to landmarks begin: these places are fixed to it."""
    back = conjugate(skeleton.rest_rotations[bone])
    places = {}
    for name in names:
        end = skeleton.index.get(landmarks.get(name) or "")
        path = [] if end is None else [end, *skeleton.ancestors(end)]
        for child in path:
            if skeleton.parents[child] == bone:
                places[name] = rotate(back, skeleton.heads[child] - skeleton.heads[bone])
    return places
