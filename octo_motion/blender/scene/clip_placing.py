# SPDX-License-Identifier: GPL-3.0-or-later
"""Imported clips made larger, moved and shown, as whole objects: their keys stay as the files have
them.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Final

import bpy
import numpy as np

from ...core.rotations import Floats, rotate
from ..animation import curves_of, read_clip
from ..rig import bone_and_property
from .imports import ImportedClip, clips_collection

_PLACING: Final = ("location", "rotation", "scale", "delta_")
"""How the names of properties begin that say where an object is."""

_LOOKS: Final = 50
"""Frames at which is looked at what room a clip takes."""


def place_clip(
    clip: ImportedClip, scene: bpy.types.Scene, *, scale: float = 1.0, move: Floats | None = None
) -> ImportedClip:
    """Scale all of a clip about the world's origin, then move it by (3,).

    Objects that no other carries are scaled and moved themselves; where keys do that to them, an
    empty is made that carries them.

    Returns:
        The clip, with what was made for it.
    """
    tops = [each for each in _objects_of(clip) if each.parent is None]
    if any(_is_keyed(bpy.data.actions[name]) for name in clip.actions):
        empty = bpy.data.objects.new(f"{clip.armatures[0]} Place", None)
        clips_collection(scene).objects.link(empty)
        for each in tops:
            each.parent = empty
        tops = [empty]
        clip = replace(clip, blocks=clip.blocks | {empty.session_uid})
    for each in tops:
        place = scale * np.array(each.location) + (0.0 if move is None else move)
        each.location = place.tolist()
        each.scale = (scale * np.array(each.scale)).tolist()
    return clip


def _objects_of(clip: ImportedClip) -> list[bpy.types.Object]:
    return [each for each in bpy.data.objects if each.session_uid in clip.blocks]


def _is_keyed(action: bpy.types.Action) -> bool:
    """Whether an action says where objects are."""
    split = (bone_and_property(curve.data_path) for curve in curves_of(action))
    return any(not bone and name.startswith(_PLACING) for bone, name in split)


def room_of(clip: ImportedClip) -> Floats:
    """The joints and ends of all bones of a clip in the world, (frames, points, 3), at some frames
    of what is shown of it, the first one first.

    Raises:
        OctoMotionError: it cannot be read.
    """
    points = []
    for armature in (bpy.data.objects[name] for name in clip.armatures):
        data = armature.animation_data
        if data is None or data.action is None:
            continue
        first, last = data.action.frame_range
        motion = read_clip(armature, frames=np.unique(np.linspace(first, last, _LOOKS)))
        turns, heads = motion.posed()
        along = np.zeros(heads.shape)
        along[..., 1] = motion.scale * motion.skeleton.lengths
        both = np.concatenate([heads, heads + rotate(turns, along)], axis=1)
        # Of all armatures as many frames.
        points.append(both[np.linspace(0, len(both) - 1, _LOOKS).astype(np.intp)])
    return np.concatenate(points, axis=1)


def show_selected(context: bpy.types.Context) -> None:
    """Let the window's 3D views show all that is selected, but for those that look through a camera
    or at a few objects alone. Without a window nothing happens.
    """
    window = context.window
    for area in window.screen.areas if window is not None else ():
        space = area.spaces.active
        if not isinstance(space, bpy.types.SpaceView3D) or space.local_view:
            continue
        view = space.region_3d
        region = next((each for each in area.regions if each.type == "WINDOW"), None)
        if view is None or view.view_perspective == "CAMERA" or region is None:
            continue
        # What is imported is imported, whatever a view makes of it.
        with suppress(RuntimeError), context.temp_override(area=area, region=region):
            bpy.ops.view3d.view_selected()
