# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses without keys: what a bone keeps of its own where an action says nothing.

Most bones are then at rest. But glTF files pose bones once and leave them out of their actions,
and rigs come with hands that are set half closed. Blender shows such a pose under any action; once
an action that keys all bones has been on the armature, it is gone. So it is kept beforehand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import bpy

from .fcurves import is_shown

AT_REST: Final[Mapping[str, tuple[float, ...]]] = {
    "location": (0.0, 0.0, 0.0),
    "scale": (1.0, 1.0, 1.0),
    "rotation_quaternion": (1.0, 0.0, 0.0, 0.0),
    "rotation_euler": (0.0, 0.0, 0.0),
    "rotation_axis_angle": (0.0, 0.0, 1.0, 0.0),
}
"""Values of a bone's properties at rest."""

UnkeyedPose = dict[tuple[str, str], tuple[float, ...]]
"""Values by bone and property, where they are not those at rest."""

KEPT: Final = "octo_motion_unkeyed_pose"
"""Custom property of an armature object: its unkeyed pose before we first gave it an action."""


def rotation_channel(mode: str) -> str:
    """The property that holds a bone's rotation in this mode."""
    return f"rotation_{mode.lower()}" if mode in ("QUATERNION", "AXIS_ANGLE") else "rotation_euler"


def unkeyed_pose(armature: bpy.types.Object) -> UnkeyedPose:
    """What bones keep where an action has no curve for them.

    That is what was kept, or else the present pose, without what an action that acts now has made
    of it.
    """
    kept = armature.get(KEPT)
    if kept is not None:
        return {
            (name, channel): tuple(values)
            for name, channels in kept.items()
            for channel, values in channels.items()
        }
    if armature.pose is None:
        return {}
    moved = set(_moved(armature))
    pose: UnkeyedPose = {}
    for bone in armature.pose.bones:
        for channel in ("location", "scale", rotation_channel(bone.rotation_mode)):
            values = tuple(getattr(bone, channel))
            if values != AT_REST[channel] and (bone.name, channel) not in moved:
                pose[bone.name, channel] = values
    return pose


def keep_unkeyed_pose(armature: bpy.types.Object) -> None:
    """Note the unkeyed pose on the armature, before an action is given to it that keys all."""
    if armature.get(KEPT) is not None:
        return
    kept: dict[str, dict[str, list[float]]] = {}
    for (name, channel), values in unkeyed_pose(armature).items():
        kept.setdefault(name, {})[channel] = list(values)
    armature[KEPT] = kept


def _moved(armature: bpy.types.Object) -> Iterator[tuple[str, str]]:
    """Bones and properties that some action moves at present."""
    data = armature.animation_data
    if data is None:
        return
    acting = [(data.action, data.action_slot)]
    if data.use_nla:
        tracks = (track for track in data.nla_tracks if not track.mute)
        acting += [
            (strip.action, strip.action_slot)
            for track in tracks
            for strip in track.strips
            if not strip.mute
        ]
    for action, slot in acting:
        if action is None or slot is None:
            continue
        for path in _paths(action, slot):
            start, _, rest = path.partition('pose.bones["')
            name, _, channel = rest.rpartition('"].')
            if not start:
                yield bpy.utils.unescape_identifier(name), channel


def _paths(action: bpy.types.Action, slot: bpy.types.ActionSlot) -> Iterable[str]:
    for layer in action.layers:
        for strip in layer.strips:
            if isinstance(strip, bpy.types.ActionKeyframeStrip):
                channelbag = strip.channelbag(slot)
                if channelbag is not None:
                    yield from (curve.data_path for curve in channelbag.fcurves if is_shown(curve))
