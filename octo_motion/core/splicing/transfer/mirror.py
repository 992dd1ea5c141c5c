# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips seen in a mirror: a throw with the right arm becomes one with the left.

The whole armature is mirrored, bones at rest included: what was a right hand is then a left one,
joint positions are mirror images to the last digit, and nothing needs to be symmetric, neither the
body nor its bones' axes nor its rest pose. How the mirrored body goes onto a base is the same
matter as with any other body.

The mirror is the armature's YZ plane. Which plane it is changes nothing: all of them differ by
where the clip stands and the way it faces.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from ...rotations import Floats
from ...skeleton import Skeleton
from ..clip import Clip
from ..humanoid import Landmarks, mirror_images, opposite

_ACROSS: Final = np.array([-1.0, 1.0, 1.0])
"""A place in the mirror; of a bone's axes X alone turns round, so that it points along Y still."""

_TURN: Final = np.array([1.0, 1.0, -1.0, -1.0])
"""A rotation in the mirror, (w, x, y, z)."""

_MATRIX: Final = np.diag([-1.0, 1.0, 1.0, 1.0])

_AXES: Final = {"+X": "-X", "-X": "+X"}


def mirrored_clip(clip: Clip, landmarks: Landmarks | None) -> tuple[Clip, Landmarks | None]:
    """A clip and its landmarks in the mirror. Twice mirrored they are as they were.

    A bone has the name of its mirror image, so that fingers of two clips answer by name.
    """
    images = mirror_images(clip.skeleton, landmarks)
    result = replace(
        clip,
        skeleton=_mirrored_skeleton(clip.skeleton, images),
        rotations=clip.rotations * _TURN,
        locations=clip.locations * _ACROSS,
        world=_mirrored_matrices(clip.world),
        own=None if clip.own is None else _mirrored_matrices(clip.own),
    )
    if landmarks is None:
        return result, None
    bones = {
        opposite(landmark): _image_name(clip.skeleton, images, bone)
        for landmark, bone in landmarks.bones.items()
    }
    return result, Landmarks(bones, landmarks.reference)


def mirror_name(skeleton: Skeleton, landmarks: Landmarks | None, bone: str) -> str:
    """What a bone is called in the mirror."""
    return _image_name(skeleton, mirror_images(skeleton, landmarks), bone)


def _image_name(skeleton: Skeleton, images: tuple[int, ...], bone: str) -> str:
    number = skeleton.index.get(bone)
    return bone if number is None else skeleton.names[images[number]]


def _mirrored_skeleton(skeleton: Skeleton, images: tuple[int, ...]) -> Skeleton:
    return replace(
        skeleton,
        names=tuple(skeleton.names[image] for image in images),
        rest_matrices=_mirrored_matrices(skeleton.rest_matrices),
        sucker_axes=tuple(_AXES.get(axis, axis) for axis in skeleton.sucker_axes),
    )


def _mirrored_matrices(matrices: Floats) -> Floats:
    """Frames (…, 4, 4) in the mirror, their own X axes turned round."""
    return _MATRIX @ matrices @ _MATRIX
