# SPDX-License-Identifier: GPL-3.0-or-later
"""What the list of arms needs of an armature object."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Vector

from ...core.errors import RigError, WriteError
from ...core.rotations import Floats
from .. import versions
from .armature import armature_data


def world_directions(armature: bpy.types.Object) -> tuple[Floats, Floats]:
    """The world's up (+Z), and where a character faces (−Y), in armature space, (3,) each."""
    inverse = armature.matrix_world.to_3x3().inverted_safe()
    up, front = (inverse @ Vector(axis) for axis in ((0, 0, 1), (0, -1, 0)))
    return np.array(up, dtype=np.float64), np.array(front, dtype=np.float64)


def require_editable(armature: bpy.types.Object) -> None:
    """Make sure that settings written on this armature are saved with the file.

    Raises:
        RigError: the object is no armature.
        WriteError: it is linked, or a library override that is not editable.
    """
    armature_data(armature)
    if armature.library is not None:
        raise WriteError(
            f"'{armature.name}' is linked from '{armature.library.name}': its settings are "
            "read-only here.",
            "Make a library override (Object > Library Override > Make).",
        )
    override = armature.override_library
    if override is not None and override.is_system_override:
        raise WriteError(
            f"'{armature.name}' is a library override that is not editable.",
            "Make it editable: select it and choose Object > Library Override > Make.",
        )


def hidden_bones(armature: bpy.types.Object, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the bones that pose mode does not show.

    Raises:
        RigError: a bone does not exist.
    """
    bones = _pose_bones(armature, names)
    return tuple(bone.name for bone in bones if not _is_shown(bone))


def select_pose_bones(
    armature: bpy.types.Object, names: Iterable[str], *, extend: bool = False
) -> None:
    """Select bones in pose mode, the first of them active.

    Hidden bones stay unselected: they could be keyed by mistake.

    Raises:
        RigError: a bone does not exist.
    """
    chosen = [bone for bone in _pose_bones(armature, names) if _is_shown(bone)]
    if not extend and armature.pose is not None:
        for bone in armature.pose.bones:
            versions.select(bone, state=False)
    for bone in chosen:
        versions.select(bone, state=True)
    if chosen:
        bones = armature_data(armature).bones
        bones.active = bones[chosen[0].name]


def _pose_bones(armature: bpy.types.Object, names: Iterable[str]) -> list[bpy.types.PoseBone]:
    bones = armature.pose.bones if armature.pose is not None else {}
    found: list[bpy.types.PoseBone] = []
    for name in names:
        bone = bones.get(name)
        if bone is None:
            raise RigError(f"The armature has no bone '{name}'.", "Detect the arms again.")
        found.append(bone)
    return found


def _is_shown(bone: bpy.types.PoseBone) -> bool:
    collections = bone.bone.collections
    in_view = not collections or any(each.is_visible_effectively for each in collections)
    return in_view and not versions.is_hidden(bone)
