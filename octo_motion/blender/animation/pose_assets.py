# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose for Blender's pose library: an action with one key of each bone, marked as an asset."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ...core.keyframes import rotation_property
from .actions import group_named


def make_pose_asset(
    armature: bpy.types.Object, bones: Sequence[str], name: str
) -> bpy.types.Action:
    """The pose that bones have now, as an asset of this file; the armature's own action stays.

    Args:
        armature: whose pose it is.
        bones: names of those that are part of it.
        name: of the asset.
    """
    action = bpy.data.actions.new(name)
    slot = action.slots.new("OBJECT", armature.name)
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    assert isinstance(strip, bpy.types.ActionKeyframeStrip)
    channelbag = strip.channelbag(slot, ensure=True)
    assert channelbag is not None
    assert armature.pose is not None
    for bone_name in bones:
        bone = armature.pose.bones[bone_name]
        for channel in ("location", rotation_property(bone.rotation_mode), "scale"):
            path = bone.path_from_id(channel)
            for component, value in enumerate(getattr(bone, channel)):
                curve = channelbag.fcurves.new(path, index=component)
                curve.group = group_named(channelbag, bone_name)
                curve.keyframe_points.insert(1.0, value)
    action.asset_mark()
    return action
