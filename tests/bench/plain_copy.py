# SPDX-License-Identifier: GPL-3.0-or-later
"""What splicing is measured against: the curves of a part's bones, copied bone by bone.

It is what copying keys in the Graph Editor does, with one kindness: where the axes of two bones lie
differently, the rotation is turned into the other's axes first. Between two skeletons with the same
bones it is the very same keys.
"""

from __future__ import annotations

import numpy as np

from octo_motion.core.rotations import conjugate, multiply, slerp
from octo_motion.core.splicing.clip.clip import Clip, sample_clip
from octo_motion.core.splicing.clip.splice_timing import splice_window
from octo_motion.core.splicing.humanoid.landmarks import Landmarks
from octo_motion.core.splicing.transfer.parts import part_bones
from octo_motion.core.splicing.transfer.splice import Splice


def plain_copy(base: Clip, landmarks: Landmarks, splice: Splice) -> Clip:
    """The base with the rotations of the part's bones copied over, eased as a splice is.

    Args:
        base: the clip to copy onto.
        landmarks: of its skeleton.
        splice: part, clip and timing; how it reaches and travels says nothing here.
    """
    assert splice.landmarks is not None
    span = splice_window(splice.timing, base, splice.clip)
    moment = sample_clip(splice.clip, span.splice_frames)
    part = set(part_bones(splice.part, base.skeleton, landmarks, clavicle=splice.clavicle))
    rotations = base.rotations.copy()
    for landmark, name in landmarks.bones.items():
        answer = splice.landmarks.get(landmark)
        if name not in part or answer is None:
            continue
        bone, other = base.skeleton.index[name], splice.clip.skeleton.index[answer]
        # From one bone's axes to the other's, both in their armatures' rest poses.
        between = multiply(
            conjugate(base.skeleton.rest_rotations[bone]),
            splice.clip.skeleton.rest_rotations[other],
        )
        copied = multiply(multiply(between, moment.rotation(other)), conjugate(between))
        own = rotations[span.frames, bone]
        rotations[span.frames, bone] = slerp(own, copied, np.asarray(span.weights))
    return Clip(
        base.name,
        base.skeleton,
        base.frames,
        base.rate,
        rotations,
        base.locations,
        base.world,
    )
