# SPDX-License-Identifier: GPL-3.0-or-later
"""What a clip may come from, and what it may go onto: actions that fit, and armatures at rest."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.rotations import IDENTITY, Floats
from ...core.splicing.clip import Clip
from ..rig import armature_data, bone_and_property, read_skeleton, world_matrix
from .actions import curves_of


def still_clip(armature: bpy.types.Object, frames: Floats, rate: float) -> Clip:
    """An armature that rests where it stands now, over some frames (frames,).

    Raises:
        RigError: the object is no armature, or has no bones.
    """
    skeleton = read_skeleton(armature)
    count = len(frames)
    return Clip(
        armature.name,
        skeleton,
        frames,
        rate,
        np.tile(IDENTITY, (count, len(skeleton), 1)),
        np.zeros((count, len(skeleton), 3)),
        np.tile(world_matrix(armature), (count, 1, 1)),
    )


def actions_for(armature: bpy.types.Object) -> list[bpy.types.Action]:
    """All actions of the file that move bones, and most of them bones that this armature has.

    Raises:
        RigError: the object is no armature.
    """
    bones = set(armature_data(armature).bones.keys())
    found = []
    for action in bpy.data.actions:
        moved = {bone_and_property(curve.data_path)[0] for curve in curves_of(action)} - {""}
        if moved and 2 * len(moved & bones) > len(moved):
            found.append(action)
    return found
