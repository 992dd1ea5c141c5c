# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses that stay behind: bones keep what an action gave them when it no longer does."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Final

import bpy
import numpy as np
from mathutils import Matrix

from ...core.rotations import Floats
from ...core.skeleton import Skeleton

SCALE: Final = ("scale",)
"""Channels of a bone that stretches."""
_UNSCALED: Final = 1e-3
_UNSHEARED: Final = 1e-3
"""Factors that are no scale, and cosines that are no shear."""
_TINY: Final = 1e-6
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


def as_posed(
    armature: bpy.types.Object, skeleton: Skeleton, posed: Iterable[str], kept: Iterable[str]
) -> Skeleton | None:
    """The skeleton as if some bones' poses were part of the rest pose.

    Args:
        armature: the armature object.
        skeleton: its rest skeleton.
        posed: bones that stay as they are posed now; all others are at rest.
        kept: bones that must keep their shape.

    Returns:
        The skeleton, or none where its numbers cannot tell it: something else than its pose moves
        a bone, some of ``kept`` would be sheared or scaled unequally, or a rotation or a scale is
        not handed on as a whole.
    """
    assert armature.pose is not None
    bones, posed = armature.pose.bones, set(posed)
    if any(skeleton.constrained[skeleton.index[name]] for name in posed):
        return None
    basis = {name: np.array(bones[name].matrix_basis, dtype=np.float64) for name in posed}
    sizes = [np.linalg.norm(each[:3, :3], axis=0) for each in basis.values()]
    scaled = any(np.abs(size - 1.0).max() > _UNSCALED for size in sizes)
    moved: list[Floats] = []
    for number, parent in enumerate(skeleton.parents):
        bone = bones[skeleton.names[number]].bone
        if not skeleton.inherits_rotation[number] or (scaled and bone.inherit_scale != "FULL"):
            return None
        rest = skeleton.rest_matrices[number]
        matrix = rest
        if parent >= 0:
            matrix = moved[parent] @ np.linalg.inv(skeleton.rest_matrices[parent]) @ rest
        moved.append(matrix @ basis.get(skeleton.names[number], np.eye(4)))
    matrices = np.stack(moved)
    axes = matrices[:, :3, :3]
    sizes = np.cbrt(np.abs(np.linalg.det(axes)))
    if sizes.min() < _TINY:
        return None
    sheared = np.abs(np.swapaxes(axes, 1, 2) @ axes / sizes[:, None, None] ** 2 - np.eye(3))
    order = [skeleton.index[name] for name in kept]
    if sheared[order].max(initial=0.0) > _UNSHEARED:
        return None
    # The turns of what is sheared, as near as can be.
    before, _, after = np.linalg.svd(axes)
    matrices[:, :3, :3] = before @ after
    return replace(skeleton, rest_matrices=matrices, lengths=skeleton.lengths * sizes)


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
