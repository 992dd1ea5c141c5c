# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses without keys: what a bone keeps of its own where an action says nothing.

Most bones are then at rest. But glTF files pose bones once and leave them out of their actions,
and rigs come with hands that are set half closed. Blender shows such a pose under any action; once
an action that keys all bones has been on the armature, it is gone. So it is kept beforehand, and
taken anew when an artist has changed it meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, cast

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from .actions import curves_of, flattened, is_generated
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

_SAME: Final = 1e-5
"""How far values may be off a curve, single precision, and be taken from it."""

KEPT: Final = "octo_motion_unkeyed_pose"
"""Custom property of an armature object: its unkeyed pose before we last gave it an action."""


def rotation_channel(mode: str) -> str:
    """The property that holds a bone's rotation in this mode."""
    return f"rotation_{mode.lower()}" if mode in ("QUATERNION", "AXIS_ANGLE") else "rotation_euler"


def unkeyed_pose(armature: bpy.types.Object) -> UnkeyedPose:
    """What bones keep where an action has no curve for them.

    That is the present pose where no action moves it now. Where one does, or where one that we made
    has left its own pose behind, it is what was kept.
    """
    pose = _kept(armature)
    if armature.pose is None:
        return pose
    # An artist may change the rotation mode of a bone that is moved: then no mode of it is free.
    moved = {(name, _plain(channel)) for name, channel in _moved(armature)}
    ours = _Generated(armature)
    for bone in armature.pose.bones:
        for channel in ("location", "scale", rotation_channel(bone.rotation_mode)):
            place = bone.name, channel
            values = tuple(getattr(bone, channel))
            if (bone.name, _plain(channel)) in moved or ours.left_behind(bone, channel, values):
                continue
            pose.pop(place, None)
            if values != AT_REST[channel]:
                pose[place] = values
    return pose


def _plain(channel: str) -> str:
    return "rotation" if channel.startswith("rotation") else channel


def keep_unkeyed_pose(armature: bpy.types.Object) -> None:
    """Note the unkeyed pose on the armature, before an action is given to it that keys all."""
    kept: dict[str, dict[str, list[float]]] = {}
    for (name, channel), values in unkeyed_pose(armature).items():
        kept.setdefault(name, {})[channel] = list(values)
    armature[KEPT] = kept


def _kept(armature: bpy.types.Object) -> UnkeyedPose:
    kept = armature.get(KEPT)
    if kept is None or armature.pose is None:
        return {}
    pose: UnkeyedPose = {}
    bones = armature.pose.bones
    for name, channels in kept.items():
        bone = bones.get(name)
        for channel, values in channels.items():
            if bone is not None and channel.startswith("rotation"):
                # The bone may have another rotation mode by now.
                wanted = rotation_channel(bone.rotation_mode)
                pose[name, wanted] = _converted(channel, tuple(values), bone.rotation_mode)
            else:
                pose[name, channel] = tuple(values)
    return pose


def _converted(channel: str, values: tuple[float, ...], mode: str) -> tuple[float, ...]:
    """Values of a rotation in a bone's mode; Euler angles are taken to be of its order."""
    if channel == rotation_channel(mode):
        return values
    if channel == "rotation_quaternion":
        turn = Quaternion(values)
    elif channel == "rotation_axis_angle":
        turn = Quaternion(values[1:], values[0])
    else:
        turn = Euler(values).to_quaternion()
    if mode == "QUATERNION":
        return (turn.w, turn.x, turn.y, turn.z)
    if mode == "AXIS_ANGLE":
        axis, angle = turn.to_axis_angle()
        return (angle, *axis)
    angles = turn.to_euler(cast("Any", mode))
    return (angles.x, angles.y, angles.z)


class _Generated:
    """The actions that were made here for an armature: what they leave is nobody's pose."""

    def __init__(self, armature: bpy.types.Object) -> None:
        self._armature = armature
        self._curves: dict[str, list[dict[int, bpy.types.FCurve]]] | None = None

    def left_behind(
        self, bone: bpy.types.PoseBone, channel: str, values: tuple[float, ...]
    ) -> bool:
        """Whether one of them shows these values at some time."""
        if self._armature.get(KEPT) is None:
            # None was made before.
            return False
        if self._curves is None:
            self._curves = self._read()
        path = bone.path_from_id(channel)
        return any(_shows(curves, values) for curves in self._curves.get(path, ()))

    def _read(self) -> dict[str, list[dict[int, bpy.types.FCurve]]]:
        found: dict[str, list[dict[int, bpy.types.FCurve]]] = {}
        for action in bpy.data.actions:
            if not is_generated(action):
                continue
            own: dict[str, dict[int, bpy.types.FCurve]] = {}
            for curve in curves_of(action):
                own.setdefault(curve.data_path, {})[curve.array_index] = curve
            for path, components in own.items():
                found.setdefault(path, []).append(components)
        return found


def _shows(curves: Mapping[int, bpy.types.FCurve], values: tuple[float, ...]) -> bool:
    """Whether F-curves of a property have these values at a frame, or between two."""
    count = min(len(curve.keyframe_points) for curve in curves.values())
    if count == 0 or set(curves) != set(range(len(values))):
        return False
    rows = np.empty((count, len(values)))
    for component, curve in curves.items():
        points = np.empty((len(curve.keyframe_points), 2), dtype=np.float32)
        curve.keyframe_points.foreach_get("co", points.ravel())
        rows[:, component] = points[:count, 1]
    start = rows[:-1] if count > 1 else rows
    along = rows[1:] - start if count > 1 else np.zeros_like(rows)
    away = np.array(values) - start
    share = np.sum(away * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-30)
    nearest = away - np.clip(share, 0.0, 1.0)[:, None] * along
    return bool(np.linalg.norm(nearest, axis=1).min() < _SAME * max(1.0, np.abs(rows).max()))


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
            for strip in flattened(track.strips)
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
