# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that stay behind: bones keep what an action gave them when it no longer does."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Final

import bpy
import numpy as np
from mathutils import Matrix

from ..core.rotations import Floats

SCALE: Final = ("scale",)
"""Channels of a bone that stretches."""
_STILL: Final = 0.01
"""Bone lengths, radians and factors by which a bone may be off its rest pose unnoticed."""


def animated_bones(
    action: bpy.types.Action, channels: tuple[str, ...] = ("location", "rotation_")
) -> set[str]:
    """Names of the bones whose channels of these kinds the action keys."""
    # The components of a property have the same path.
    paths = {
        curve.data_path
        for layer in action.layers
        for strip in layer.strips
        if isinstance(strip, bpy.types.ActionKeyframeStrip)
        for channelbag in strip.channelbags
        for curve in channelbag.fcurves
    }
    names: set[str] = set()
    for path in paths:
        start, _, rest = path.partition('pose.bones["')
        name, _, channel = rest.partition('"].')
        if not start and channel.startswith(channels):
            names.add(bpy.utils.unescape_identifier(name))
    return names


def rest_bones(armature: bpy.types.Object, names: Iterable[str]) -> None:
    """Put bones back to their rest location and rotation; names that are no bone's are passed."""
    if armature.pose is None:
        return
    for name in names:
        bone = armature.pose.bones.get(name)
        if bone is None:
            continue
        bone.location = (0.0, 0.0, 0.0)
        if bone.rotation_mode == "QUATERNION":
            bone.rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
        elif bone.rotation_mode == "AXIS_ANGLE":
            bone.rotation_axis_angle = (0.0, 0.0, 1.0, 0.0)
        else:
            bone.rotation_euler = (0.0, 0.0, 0.0)


def unscale_bones(armature: bpy.types.Object, names: Iterable[str]) -> None:
    """Put bones back to their rest scale; names that are no bone's are passed."""
    bones = armature.pose.bones if armature.pose is not None else {}
    for name in names:
        if name in bones:
            bones[name].scale = (1.0, 1.0, 1.0)


def standing_of(
    armature: bpy.types.Object, bone: str, *, left_out: Collection[str] = ()
) -> tuple[Floats, Floats]:
    """Where the poses of a bone's ancestors have brought what it hangs on.

    Args:
        armature: the armature object.
        bone: name of a bone.
        left_out: ancestors whose pose does not count.

    Returns:
        A shift (3,) and a turn (4,) of armature space; scale is left out.
    """
    assert armature.pose is not None
    ancestors = list(reversed(armature.pose.bones[bone].parent_recursive))
    moved = Matrix.Identity(4)
    for each in ancestors:
        rest = each.bone.matrix_local
        if each.name not in left_out:
            # What it does to its own rest, in armature space, carried by those above it.
            moved = moved @ rest @ each.matrix_basis @ rest.inverted_safe()
    shift, turn, _ = moved.decompose()
    return np.array(shift, dtype=np.float64), np.array(turn, dtype=np.float64)


def displaced_bones(
    armature: bpy.types.Object, turned: Iterable[str], carrying: Iterable[str]
) -> list[str]:
    """Those of the bones that are posed by more than what is going to be keyed.

    Args:
        armature: the armature object.
        turned: bones whose rotation is going to be keyed: location and scale count.
        carrying: bones that get no keys: rotation counts as well.
    """
    if armature.pose is None:
        return []
    bones = armature.pose.bones
    found: list[str] = []
    for name in turned:
        bone = bones[name]
        moved = np.abs(np.array(bone.location)).max() / bone.length
        if max(moved, np.abs(np.array(bone.scale) - 1.0).max()) > _STILL:
            found.append(name)
    for name in carrying:
        basis = np.array(bones[name].matrix_basis)
        basis[:3, 3] /= bones[name].length
        if np.abs(basis - np.eye(4)).max() > _STILL:
            found.append(name)
    return found
