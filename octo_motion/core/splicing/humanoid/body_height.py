# SPDX-License-Identifier: GPL-3.0-or-later
"""How tall a body is, whatever pose it rests or moves in."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...skeleton import Skeleton
from .landmarks import Landmarks

_ANKLE_TO_HEAD: Final = 0.88
"""Of a person's height, what lies between the ankles and the joint of the head. The ankle is at
0.039 of it; the chin, a little below that joint, at 0.87 (Drillis and Contini, "Body segment
parameters", 1966)."""


def stature(skeleton: Skeleton, landmarks: Landmarks) -> float | None:
    """How tall a person of these bones stands, in armature units.

    From the lengths of the bones along a leg and the trunk: files of one skeleton come out alike,
    whether the body sits or jumps, and whatever its rest pose is. Feet and head, whose far ends
    many files make up, are taken to be a person's.

    Returns:
        The height; none if a landmark is missing or the head does not hang together with the legs.
    """
    asked = [f"{part}.{side}" for part in ("thigh", "shin", "foot") for side in "LR"]
    bones = [skeleton.index.get(landmarks.get(each) or "", -1) for each in (*asked, "head")]
    if min(bones) < 0:
        return None
    *limbs, head = bones
    # Down the legs first, then left and right.
    joints = skeleton.heads[np.array(limbs).reshape(3, 2)]
    leg = np.linalg.norm(np.diff(joints, axis=0), axis=-1).sum(axis=0).mean()
    carriers = {limbs[0], *skeleton.ancestors(limbs[0])} & {limbs[1], *skeleton.ancestors(limbs[1])}
    chain = [head, *skeleton.ancestors(head)]
    shared = next((place for place, bone in enumerate(chain) if bone in carriers), None)
    if not shared:
        return None
    trunk = np.concatenate([skeleton.heads[chain[:shared]], joints[0].mean(axis=0)[None]])
    length = np.linalg.norm(np.diff(trunk, axis=0), axis=-1).sum()
    return float(leg + length) / _ANKLE_TO_HEAD or None
