# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that get longer and thinner, and which may.

A bone's scale reaches its children. Where they inherit it along their own axes (Blender's
*Aligned*) or not at all, each bone can be as long as it likes; where they inherit it in full,
stretched bones shear those that bend away from them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import bpy
import numpy as np

from ...core.keyframes import Channel
from ...core.rotations import Floats
from ..rig import armature_data

ALIGNED: Final = "ALIGNED"
_APART: Final = {"NONE", "NONE_LEGACY"}
_CLOSE: Final = 1e-4
"""Bone lengths that a bone's head may be off its parent's tail."""
_UNUSED: Final = 1e-5
"""Scales that differ from 1 by less need no keys."""


def may_stretch(armature: bpy.types.Object, bones: Sequence[str]) -> bool:
    """Whether the bones of an arm, root to tip, can be made longer without harm."""
    data = armature_data(armature).bones
    chain = [data[name] for name in bones]
    for upper, lower in pairwise(chain):
        if lower.parent != upper or lower.inherit_scale not in {ALIGNED, *_APART}:
            return False
        if (lower.head_local - upper.tail_local).length > _CLOSE * upper.length:
            return False
    return True


def hands_on(armature: bpy.types.Object, bones: Sequence[str]) -> list[bool]:
    """Of each bone of an arm, root to tip, whether the one before makes it longer with itself."""
    data = armature_data(armature).bones
    return [bool(place) and data[name].inherit_scale == ALIGNED for place, name in enumerate(bones)]


def stretch_channels(
    armature: bpy.types.Object, arms: Sequence[Sequence[str]], strains: Floats
) -> list[Channel]:
    """Scales of bones that are longer by a share, and thinner so that they keep their volume.

    Args:
        armature: the armature object.
        arms: bones of each arm, root to tip.
        strains: (frames, bones) of all arms, one after the other.

    Returns:
        Channels of those bones whose scale differs from 1 at some frame.
    """
    assert armature.pose is not None
    channels: list[Channel] = []
    start = 0
    for bones in arms:
        longer = 1.0 + strains[:, start : start + len(bones)]
        start += len(bones)
        handed = hands_on(armature, bones)
        for place, name in enumerate(bones):
            along = longer[:, place]
            if handed[place]:
                along = along / longer[:, place - 1]
            if np.abs(along - 1.0).max() <= _UNUSED:
                continue
            across = 1.0 / np.sqrt(along)
            bone = armature.pose.bones[name]
            scales = np.stack([across, along, across], axis=1)
            channels.append(Channel(bone.path_from_id("scale"), scales, bone.name))
    return channels


def strains_of(
    armature: bpy.types.Object,
    arms: Sequence[Sequence[str]],
    alongs: Mapping[str, Floats],
    count: int,
) -> Floats:
    """Inverse of :func:`stretch_channels`: by how much bones are longer, as a share.

    Args:
        armature: the armature object.
        arms: bones of each arm, root to tip.
        alongs: by bone, its scale along itself (moments,); a bone without is not scaled.
        count: number of moments.

    Returns:
        (moments, bones) of all arms, one after the other.
    """
    strains = []
    for bones in arms:
        longer = np.ones(count)
        for name, handed in zip(bones, hands_on(armature, bones), strict=True):
            own = alongs.get(name, 1.0)
            longer = longer * own if handed else np.ones(count) * own
            strains.append(longer - 1.0)
    return np.stack(strains, axis=1)
