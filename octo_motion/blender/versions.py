# SPDX-License-Identifier: GPL-3.0-or-later
"""Every difference between the Blender versions we run on, and nothing else."""

# The stubs describe one version only.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import bpy

_SELECTION_ON_POSE_BONE = bpy.app.version >= (5, 0, 0)


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


def is_hidden(pose_bone: bpy.types.PoseBone) -> bool:
    """Whether a bone is hidden in pose mode by the artist (not by its collections)."""
    if _SELECTION_ON_POSE_BONE:
        return pose_bone.hide
    return pose_bone.bone.hide
