# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose as an action with one key of each bone, for Blender's pose library too."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ...core.keyframes import rotation_property
from .actions import group_named


def make_pose_asset(
    armature: bpy.types.Object, bones: Sequence[str], name: str
) -> bpy.types.Action:
    """The pose that bones have now, as an asset of this file; the armature's own action stays.

    It is that of bones by their names.
    """
    action = make_pose_action(armature, bones, name)
    action.asset_mark()
    return action


def make_pose_action(
    armature: bpy.types.Object,
    bones: Sequence[str],
    name: str,
    *,
    frame: float = 1.0,
    with_object: bool = False,
) -> bpy.types.Action:
    """The pose that bones have now, as an action; the armature's own stays.

    Args:
        armature: whose pose it is.
        bones: names of those that are part of it.
        name: of the action.
        frame: of its keys.
        with_object: whether the object's place is part of it.
    """
    action = bpy.data.actions.new(name)
    slot = action.slots.new("OBJECT", armature.name)
    strip = action.layers.new("Layer").strips.new(type="KEYFRAME")
    assert isinstance(strip, bpy.types.ActionKeyframeStrip)
    channelbag = strip.channelbag(slot, ensure=True)
    assert channelbag is not None
    assert armature.pose is not None
    posed = [armature.pose.bones[bone_name] for bone_name in bones]
    for owner in (*posed, *[armature] * with_object):
        turn = rotation_property(owner.rotation_mode)
        for channel in ("location", turn, "scale") if owner != armature else ("location", turn):
            path = channel if owner == armature else owner.path_from_id(channel)
            for component, value in enumerate(getattr(owner, channel)):
                curve = channelbag.fcurves.new(path, index=component)
                curve.group = group_named(channelbag, owner.name)
                curve.keyframe_points.insert(frame, value)
    return action
