# SPDX-License-Identifier: GPL-3.0-or-later
"""Every difference between the Blender versions we run on, and nothing else."""

# The stubs describe one version only.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import bpy

_SELECTION_ON_POSE_BONE = bpy.app.version >= (5, 0, 0)
_NDOF_SENSITIVITIES = (
    ("ndof_translation_sensitivity", "ndof_rotation_sensitivity")
    if bpy.app.version >= (5, 0, 0)
    else ("ndof_sensitivity", "ndof_orbit_sensitivity")
)


def is_selected(pose_bone: bpy.types.PoseBone) -> bool:
    """Whether a bone is selected in pose mode."""
    if _SELECTION_ON_POSE_BONE:
        return pose_bone.select
    return pose_bone.bone.select


def select(pose_bone: bpy.types.PoseBone, *, state: bool) -> None:
    """Select or deselect a bone in pose mode."""
    if _SELECTION_ON_POSE_BONE:
        pose_bone.select = state
    else:
        pose_bone.bone.select = state
        pose_bone.bone.select_head = state
        pose_bone.bone.select_tail = state


def ndof_sensitivities() -> tuple[float, float]:
    """By which Blender multiplies a space mouse's push and turn before a script sees them.

    Both are preferences for flying about. A Blender that was built without space mice has neither.
    """
    assert bpy.context.preferences is not None
    inputs = bpy.context.preferences.inputs
    push, turn = (float(getattr(inputs, name, 1.0)) for name in _NDOF_SENSITIVITIES)
    return push or 1.0, turn or 1.0


def is_hidden(pose_bone: bpy.types.PoseBone) -> bool:
    """Whether a bone is hidden in pose mode by the artist (not by its collections)."""
    if _SELECTION_ON_POSE_BONE:
        return pose_bone.hide
    return pose_bone.bone.hide
