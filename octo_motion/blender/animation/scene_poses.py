# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses as the scene shows them, frame by frame: NLA, constraints, drivers and all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import bpy
import numpy as np

from ...core.errors import ClipError
from ...core.rotations import Floats
from .scene_playback import time_kept

_CHANNELS: Final = (
    *("location", "scale"),
    *("rotation_quaternion", "rotation_euler", "rotation_axis_angle"),
)


def shown_poses(armature: bpy.types.Object, frames: Floats) -> tuple[Floats, Floats, Floats]:
    """What an armature looks like at these frames of the current scene.

    The scene is played through and put back to its frame; what has no keys yet survives.

    Returns:
        Bone matrices (frames, bones, 4, 4) in armature space, in the order of the armature's
        bones, the object's world matrices (frames, 4, 4), and what its own channels make of it
        (frames, 4, 4), before parents and constraints.
    """
    scene = bpy.context.scene
    assert scene is not None
    assert armature.pose is not None
    count = len(armature.pose.bones)
    bones = np.empty((len(frames), count, 4, 4))
    world, own = np.empty((2, len(frames), 4, 4))
    buffer = np.empty(16 * count, dtype=np.float32)
    with _pose_kept(armature), time_kept(scene) as go_to:
        for number, frame in enumerate(frames):
            go_to(float(frame))
            shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
            assert shown.pose is not None
            shown.pose.bones.foreach_get("matrix", buffer)
            # Blender hands over matrices column by column.
            bones[number] = buffer.reshape(count, 4, 4).transpose(0, 2, 1)
            world[number], own[number] = shown.matrix_world, shown.matrix_basis
    return bones, world, own


@contextmanager
def assigned(
    armature: bpy.types.Object, action: bpy.types.Action, slot: bpy.types.ActionSlot
) -> Iterator[None]:
    """An action on the armature for a while; then what it had before, its pose included.

    Raises:
        ClipError: the armature is in NLA tweak mode, on another action.
    """
    data = armature.animation_data
    had_none = data is None
    data = data or armature.animation_data_create()
    assert data is not None
    before, slot_before = data.action, data.action_slot
    if before == action and slot_before == slot:
        yield
        return
    if data.is_property_readonly("action"):
        raise ClipError(
            f"'{armature.name}' is in the tweak mode of the NLA editor.",
            "Leave tweak mode there (Tab) and try again.",
        )
    with _pose_kept(armature):
        try:
            data.action = action
            data.action_slot = slot
            yield
        finally:
            data.action = before
            if before is not None:
                data.action_slot = slot_before
            if had_none:
                armature.animation_data_clear()
            if bpy.context.view_layer is not None:
                # Blender poses all by its keys for that: now, and not when it draws next.
                bpy.context.view_layer.update()


@contextmanager
def _pose_kept(armature: bpy.types.Object) -> Iterator[None]:
    """The pose as it was: what an action that is assigned for a while moves is no one else's."""
    assert armature.pose is not None
    owners = (armature, *armature.pose.bones)
    values = [[tuple(getattr(owner, name)) for name in _CHANNELS] for owner in owners]
    try:
        yield
    finally:
        for owner, mine in zip(owners, values, strict=True):
            for name, value in zip(_CHANNELS, mine, strict=True):
                if tuple(getattr(owner, name)) != value:
                    setattr(owner, name, value)
