# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of an armature's body: its landmarks, and how tall it is."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...blender.animation import read_clip
from ...blender.rig import read_skeleton, world_matrix
from ...core.errors import OctoMotionError
from ...core.skeleton import Skeleton
from ...core.splicing.clip import average_pose
from ...core.splicing.humanoid import LANDMARKS, OPTIONAL, Landmarks, map_skeleton, stature
from .properties import read_landmarks, splicing_settings

_LOOKS: Final = 50
"""Frames of an action that are looked at to see how its bones lie."""


def in_motion(armature: bpy.types.Object) -> Skeleton | None:
    """The bones as they lie in the armature's action, if it has one that moves them."""
    data = armature.animation_data
    if data is None or data.action is None:
        return None
    first, last = data.action.frame_range
    try:
        return average_pose(read_clip(armature, frames=np.unique(np.linspace(first, last, _LOOKS))))
    except OctoMotionError:
        return None


def known_landmarks(
    armature: bpy.types.Object, skeleton: Skeleton, moving: Skeleton | None
) -> tuple[Landmarks | None, str, bool]:
    """Landmarks of an armature: of its table, completed by what can be found.

    Args:
        armature: the armature object.
        skeleton: its bones as they rest.
        moving: the same as they lie in a motion, if there is one.

    Returns:
        The landmarks, none where the table is empty and the skeleton is no humanoid; why that is
        so; and whether the table was empty and could be filled with them.
    """
    bones = dict(read_landmarks(splicing_settings(armature).landmarks).bones)
    if all(each in bones for each in LANDMARKS if each not in OPTIONAL):
        return Landmarks(bones), "", False
    found = map_skeleton(skeleton, moving)
    if found.problem and not bones:
        return None, found.problem, False
    return Landmarks(dict(found.landmarks.bones) | bones), "", not bones


def height_of(armature: bpy.types.Object) -> float | None:
    """How tall the body of an armature stands in the world; none where it is no humanoid."""
    try:
        skeleton = read_skeleton(armature)
    except OctoMotionError:
        return None
    landmarks, _, _ = known_landmarks(armature, skeleton, in_motion(armature))
    height = stature(skeleton, landmarks) if landmarks is not None else None
    if height is None:
        return None
    size = float(np.cbrt(abs(np.linalg.det(world_matrix(armature)[:3, :3]))))
    return size * height or None
