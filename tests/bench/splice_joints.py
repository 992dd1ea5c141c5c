# SPDX-License-Identifier: GPL-3.0-or-later
"""How a splice looks to somebody who sees joints alone: no rest pose, no bone axis has a say.

The measures are the referee's (tests/referee/clip_measures.py), which know nothing of how parts are
spliced.
"""

from __future__ import annotations

import numpy as np

from octo_motion.core.rotations import Floats, rotate
from octo_motion.core.splicing.clip.clip import Clip, sample_clip, sample_world
from octo_motion.core.splicing.clip.splice_timing import splice_window
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.splice import Splice
from tests.referee import clip_measures as measures

_LANDMARKS = {
    "hips": ("hips",),
    "spine": ("spine", "chest"),
    "neck": ("neck", "head"),
    "head": ("head",),
    **{
        f"{side}_{joint}": (f"{landmark}.{side[0].upper()}",)
        for side in measures.SIDES
        for joint, landmark in {
            "shoulder": "upper_arm",
            "elbow": "forearm",
            "hand": "hand",
            "thigh": "thigh",
            "knee": "shin",
            "foot": "foot",
        }.items()
    },
}
"""Landmarks of a joint, the first that there is."""


def joints_at(clip: Clip, landmarks: Landmarks, frames: Floats) -> dict[str, Floats]:
    """Joints (frames, 3) of a person in the world, by their names of the referee."""
    posture = sample_clip(clip, frames)
    turns, places, scale = sample_world(clip, frames)
    found = {}
    for joint, choices in _LANDMARKS.items():
        bone = next(landmarks[each] for each in choices if landmarks.get(each))
        head = posture.head(clip.skeleton.index[bone])
        found[joint] = places + scale * rotate(turns, head)
    return found


def degrees_off(
    result: Clip, base: Clip, landmarks: Landmarks, splice: Splice
) -> tuple[Floats, Floats]:
    """How far a part points elsewhere than in its clip, and how far the body leans otherwise.

    Args:
        result: of the splice.
        base: what it was spliced onto.
        landmarks: of both.
        splice: what was spliced.

    Returns:
        Degrees over the frames in which the splice is fully in. (frames, limbs): from shoulder to
        hand as seen from the chest, from thigh to foot as seen by one who faces as the pelvis does,
        from hips to neck likewise, from neck to head as seen from the chest. (frames,): hips to
        neck against the vertical, which a trunk brings along, and all else leaves to the base.
    """
    assert splice.landmarks is not None
    span = splice_window(splice.timing, base, splice.clip)
    whole = span.weights >= 1.0
    own = base.frames[span.frames][whole]
    ours, before = (joints_at(each, landmarks, own) for each in (result, base))
    theirs = joints_at(splice.clip, splice.landmarks, span.splice_frames[whole])
    name = splice.part.name
    upright = theirs if name == "trunk" else before
    lean = np.abs(measures.lean(ours) - measures.lean(upright))
    if name == "trunk":
        pairs = [(measures.tilt(ours), measures.tilt(theirs))]
    elif name == "head":
        pairs = [(measures.head_direction(ours), measures.head_direction(theirs))]
    else:
        root, end = ("thigh", "foot") if name.endswith(("legs", "leg")) else ("shoulder", "hand")
        axes = measures.level if root == "thigh" else measures.chest
        sides = [each for each in measures.SIDES if each[0].upper() in splice.part.sides]
        pairs = [
            (
                np.einsum("mji,mj->mi", axes(ours), ours[f"{side}_{end}"] - ours[f"{side}_{root}"]),
                np.einsum(
                    "mji,mj->mi", axes(theirs), theirs[f"{side}_{end}"] - theirs[f"{side}_{root}"]
                ),
            )
            for side in sides
        ]
    off = np.empty((len(own), len(pairs)))
    for number, (first, second) in enumerate(pairs):
        off[:, number] = measures.angle(first, second)
    return off, np.asarray(lean, dtype=np.float64)
