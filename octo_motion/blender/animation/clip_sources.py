# SPDX-License-Identifier: GPL-3.0-or-later
"""What a clip may come from, and what it may go onto: actions that fit, and armatures at rest."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...core.errors import ClipError
from ...core.phrases import phrase
from ...core.rotations import IDENTITY, Floats
from ...core.splicing.clip import Clip
from ..rig import armature_data, bone_and_property, read_skeleton, world_matrix
from .actions import curves_of

_ON_FRAME: Final = 1e-3
"""Frames by which a strip may begin elsewhere than its action, and still play it as it is."""


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


def strips_of(armature: bpy.types.Object) -> list[bpy.types.NlaStrip]:
    """The strips of the NLA that play an action of the armature's, muted ones left out."""
    data = armature.animation_data
    if data is None or not data.use_nla:
        return []
    return [
        strip
        for track in data.nla_tracks
        for strip in track.strips
        if not (track.mute or strip.mute) and strip.action is not None
    ]


def strips_alone(armature: bpy.types.Object) -> ClipError:
    """Why no action can be taken of an armature whose motion lies in strips."""
    return ClipError(
        phrase(
            "The motion of '{armature}' lies in strips of the NLA.",
            armature=armature.name,
        ),
        "Choose the action of one, or make one of all (Object > Animation > Bake Action).",
    )


def own_action(armature: bpy.types.Object) -> tuple[bpy.types.Action, str] | None:
    """The action of an armature and the identifier of its slot, "" if it has none."""
    data = armature.animation_data
    if data is None or data.action is None:
        return None
    return _with_slot(data.action, data.action_slot)


def played_action(armature: bpy.types.Object) -> tuple[bpy.types.Action, str] | None:
    """The same; without an action that of the one NLA strip there is, if it plays it as it is."""
    own, strips = own_action(armature), strips_of(armature)
    if own is not None or len(strips) != 1:
        return own
    (strip,) = strips
    assert strip.action is not None
    moved = abs(strip.frame_start - strip.action_frame_start) > _ON_FRAME
    if moved or strip.scale != 1.0 or strip.repeat != 1.0 or strip.use_reverse:
        return None
    return _with_slot(strip.action, strip.action_slot)


def _with_slot(
    action: bpy.types.Action, slot: bpy.types.ActionSlot | None
) -> tuple[bpy.types.Action, str]:
    return action, slot.identifier if slot else ""
