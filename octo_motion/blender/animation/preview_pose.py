# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose that is only shown: put on an armature for a while, without keys, and taken off again."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from mathutils import Matrix, Quaternion, Vector

from ...core.rotations import Floats
from ..rig import carrying_axes

_CHANNELS = ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale")

PoseValues = dict[str, tuple[tuple[float, ...], ...]]
"""A bone's own values by its name."""


def pose_values(armature: bpy.types.Object) -> PoseValues:
    """The pose that an armature has now."""
    if armature.pose is None:
        return {}
    return {
        bone.name: tuple(tuple(getattr(bone, channel)) for channel in _CHANNELS)
        for bone in armature.pose.bones
    }


def restore_pose(armature: bpy.types.Object, values: PoseValues) -> None:
    """Put bones back to values of :func:`pose_values`; bones that are gone are passed."""
    if armature.pose is None:
        return
    for bone in armature.pose.bones:
        for channel, value in zip(_CHANNELS, values.get(bone.name, ()), strict=False):
            setattr(bone, channel, value)


def show_pose(
    armature: bpy.types.Object,
    names: Sequence[str],
    rotations: Floats,
    locations: Floats,
    scales: Floats | None = None,
) -> None:
    """Pose bones, without keys: the next change of frame brings back what the action says.

    Args:
        armature: the armature object.
        names: bones; those that are gone are passed.
        rotations: (bones, 4), from rest.
        locations: (bones, 3), in each bone's rest frame.
        scales: (bones, 3), if any bone has one.
    """
    if armature.pose is None:
        return
    bones = armature.pose.bones
    sizes = [None] * len(names) if scales is None else scales.tolist()
    for name, rotation, location, size in zip(
        names, rotations.tolist(), locations.tolist(), sizes, strict=True
    ):
        bone = bones.get(name)
        if bone is not None:
            place = Vector(location)
            if not bone.bone.use_local_location:
                place = carrying_axes(bone.bone) @ place
            bone.matrix_basis = Matrix.LocRotScale(place[:], Quaternion(rotation), size)
