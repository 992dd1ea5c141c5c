# SPDX-License-Identifier: GPL-3.0-or-later
"""The way that [Splice] starts from: upper bodies on lower bodies, after Heck, Kovar and Gleicher,
"Splicing Upper-Body Actions with Locomotion" (2006), shortly.

Legs and way are the base's, everything from the spine up is the clip's. In time the two are matched
by dynamic time warping of the lower bodies; in space the upper body faces, seen from where the
pelvis goes, as it did in its clip. Their transfer of the torso's finer posture is left out.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from octo_motion.core.rotations import Floats, conjugate, from_axis_angle, multiply
from octo_motion.core.splicing.clip.clip import Clip, sample_clip
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from tests.bench.splice_joints import joints_at
from tests.referee import clip_measures as measures

_ABOVE: Final = ("spine", "chest", "neck", "head", "clavicle", "upper_arm", "forearm", "hand")
_FAST: Final = 0.1
"""Seconds by which speeds are multiplied to stand beside positions."""


def warped_moments(
    base: Clip, landmarks: Landmarks, other: Clip, others: Landmarks, frames: Floats
) -> Floats:
    """The clip's moment for each of the base's frames, so that the legs do the same as far as can
    be; the clip's end may be left out, and its start.
    """
    moments = np.arange(other.frames[0], other.frames[-1] + 1e-6)
    ours = _legs(base, landmarks, frames)
    theirs = _legs(other, others, moments)
    apart = np.linalg.norm(ours[:, None] - theirs, axis=-1)
    total = np.full(apart.shape, np.inf)
    came = np.zeros(apart.shape, int)
    total[0] = apart[0]
    for row in range(1, len(frames)):
        for column in range(len(moments)):
            # Stays, goes on as the base does, or twice as fast.
            steps = [
                total[row - 1, column - back] if column >= back else np.inf for back in range(3)
            ]
            came[row, column] = int(np.argmin(steps))
            total[row, column] = apart[row, column] + min(steps)
    column = int(np.argmin(total[-1]))
    found = np.empty(len(frames))
    for row in range(len(frames) - 1, -1, -1):
        found[row] = moments[column]
        column -= came[row, column]
    return found


def _legs(clip: Clip, landmarks: Landmarks, frames: Floats) -> Floats:
    """(frames, 24) of knees and feet, seen as the pelvis faces, with speeds, in leg lengths."""
    joints = joints_at(clip, landmarks, frames)
    axes = measures.level(joints)
    rows = [
        np.einsum("mji,mj->mi", axes, joints[f"{side}_{joint}"] - joints["hips"])
        for side in measures.SIDES
        for joint in ("knee", "foot")
    ]
    places = np.concatenate(rows, axis=1)
    places /= np.linalg.norm(places.reshape(len(frames), 4, 3), axis=-1).max()
    speeds = np.gradient(places, axis=0) * clip.rate
    return np.concatenate([places, _FAST * speeds], axis=1)


def upper_on_lower(  # noqa: PLR0917
    base: Clip,
    landmarks: Landmarks,
    other: Clip,
    others: Landmarks,
    frames: Floats,
    moments: Floats,
) -> Clip:
    """The base with the clip's upper body in these frames, each from a moment of the clip."""
    rows = np.searchsorted(base.frames, frames)
    ours, theirs = sample_clip(base, frames), sample_clip(other, moments)
    rotations = base.rotations.copy()
    skeleton, source = base.skeleton, other.skeleton
    mapped = [
        (skeleton.index[name], source.index[answer])
        for landmark, name in landmarks.bones.items()
        if landmark.partition(".")[0] in _ABOVE and (answer := others.get(landmark))
    ]
    for bone, answer in mapped:
        between = multiply(conjugate(skeleton.rest_rotations[bone]), source.rest_rotations[answer])
        rotations[rows, bone] = multiply(
            multiply(between, theirs.rotation(answer)), conjugate(between)
        )
    first, answer = min(mapped)
    parent = skeleton.parents[first]
    ahead = multiply(
        _facing(joints_at(base, landmarks, frames)),
        conjugate(_facing(joints_at(other, others, moments))),
    )
    # How far its rest is turned from the other's is not how far the bone is.
    between = multiply(source.rest_rotations[answer], conjugate(skeleton.rest_rotations[first]))
    wanted = multiply(ahead, multiply(theirs.orientation(answer), conjugate(between)))
    hangs = multiply(
        ours.orientation(parent),
        multiply(conjugate(skeleton.rest_rotations[parent]), skeleton.rest_rotations[first]),
    )
    rotations[rows, first] = multiply(conjugate(hangs), wanted)
    return Clip(
        *(base.name, skeleton, base.frames, base.rate, rotations, base.locations, base.world)
    )


def _facing(joints: dict[str, Floats]) -> Floats:
    """(frames, 4) about the vertical, the way that the pelvis faces."""
    across = joints["left_thigh"] - joints["right_thigh"]
    return from_axis_angle([0.0, 0.0, 1.0], np.arctan2(across[:, 1], across[:, 0]))
