# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of a drag, kept while the frames go by and written as few keys."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import bpy
import numpy as np

from ...blender.animation import ObjectKeys, PoseKeys, pose_values, restore_pose
from ...blender.rig import Puppet
from ...blender.scene import LooseObject
from ...core.keyframes import rotation_property
from ...core.posing.puppet import Pose, turned_bodies
from ...core.rotations import Floats
from .properties import posing_settings

_LOCATION_SHARE: Final = 0.002
"""Of the figure's size: how far a recorded location's keys may be off."""


_ANGLE: Final = float(np.radians(0.5))
"""By which a recorded object's keys may be off."""


class Recording:
    """The poses of a puppet, frame by frame, from the one where it begins."""

    def __init__(self, puppet: Puppet, frame: float, pose: Pose) -> None:
        self._puppet = puppet
        self._own = pose_values(puppet.armature())
        """Of the bones, at the beginning."""
        self._moments: dict[float, tuple[Pose, Floats, Floats]] = {}
        """By frame: the pose, and rotations (bodies, 4) and locations (bodies, 3) of the bones."""
        self.keep(frame, pose)

    def keep(self, frame: float, pose: Pose) -> None:
        """One frame more, or another pose at one."""
        self._moments[frame] = pose, *self._puppet.local(pose)

    def armature(self) -> bpy.types.Object:
        """Whose pose it is."""
        return self._puppet.armature()

    def is_past(self, frame: float) -> bool:
        """Whether a frame lies before the last one: playback has come round."""
        return frame < max(self._moments)

    def write(self, keys: PoseKeys) -> tuple[list[str], int]:
        """Set keys; names of the bones that got some, and the number of key frames."""
        puppet = self._puppet
        frames = np.array(sorted(self._moments))
        moments = (self._moments[frame] for frame in frames)
        poses, rotations, locations = zip(*moments, strict=True)
        moved: set[int] = set()
        for pose in poses[1:]:
            moved |= set(turned_bodies(puppet.figure, poses[0], pose))
        if not moved:
            return [], 0
        bodies = {puppet.figure.names[body]: body for body in puppet.with_followers(moved)}
        turns, places = np.stack(rotations, axis=1), np.stack(locations, axis=1)
        armature = puppet.armature()
        settings: Any = posing_settings(armature)
        size = float(np.ptp(puppet.rig.skeleton.heads, axis=0).max())
        count = keys.insert_motion(
            armature,
            frames,
            {name: turns[body] for name, body in bodies.items()},
            {name: places[body] for name, body in bodies.items() if puppet.places(body)},
            angle=settings.record_angle,
            distance=_LOCATION_SHARE * size,
        )
        return list(bodies), count

    def go_along(self, recorded: Iterable[str]) -> bool:
        """Let what stood still in the recording go on with what carries it; whether anything did.

        While a root bone travels, the figure's own root is held back to stay in its place, and is
        to be no further off once that is over: unless it was moved, it is not among the recorded
        bones.
        """
        puppet, armature = self._puppet, self._puppet.armature()
        loose = {name for body, name in enumerate(puppet.figure.names) if puppet.places(body)}
        now = pose_values(armature)
        back = {
            bone: own
            for bone, own in self._own.items()
            if bone in loose.difference(recorded) and now.get(bone) != own
        }
        restore_pose(armature, back)
        return bool(back)


class ObjectRecording:
    """Where a loose object is, frame by frame, from the one where it begins."""

    def __init__(self, thing: LooseObject, frame: float) -> None:
        self._thing = thing
        self._moments: dict[float, tuple[Floats, Floats]] = {}
        self.keep(frame)

    def keep(self, frame: float) -> None:
        """One frame more, as the object is now."""
        item = self._thing.found()
        turn = getattr(item, rotation_property(item.rotation_mode))
        self._moments[frame] = np.array(item.location), np.array(turn)

    def write(self, keys: ObjectKeys) -> int:
        """Set keys; 1 where the object has moved, else 0."""
        frames = np.array(sorted(self._moments))
        places, turns = (
            np.array(each) for each in zip(*map(self._moments.get, frames), strict=True)
        )
        if len(frames) < 2 or not (np.ptp(places, axis=0).any() or np.ptp(turns, axis=0).any()):
            return 0
        item = self._thing.found()
        if item.rotation_mode == "QUATERNION":
            # The same turn has two signs; the way between keys must not go through nothing.
            flips = np.cumprod(np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
            turns[1:] *= flips[:, None]
        size = float(np.array(item.dimensions).max()) or 1.0
        keys.insert_path(
            item,
            frames,
            {"location": places, rotation_property(item.rotation_mode): turns},
            angle=_ANGLE,
            distance=_LOCATION_SHARE * size,
        )
        return 1
