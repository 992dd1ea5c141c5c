# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys on an object's own transform that a session of posing makes, and can take back."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.keyframes import (
    LOCATION,
    Channel,
    Limb,
    Track,
    reduce_keys,
    rotation_property,
)
from ...core.rotations import Floats
from .fcurves import bezier_arrays
from .pose_keys import PoseKeys, key_type, keying_options, mark_file_changed

_GROUP = "Object Transforms"
"""Where Blender's own keying puts an object's channels."""


class ObjectKeys(PoseKeys):
    """Keys on one object, in the action that it has, or a new one.

    Raises:
        WriteError: it cannot be animated here.
    """

    def __init__(self, item: bpy.types.Object) -> None:
        super().__init__(item)

    def insert_object(self, item: bpy.types.Object, frame: float, *, auto: bool = False) -> bool:
        """Key where an object is and how it is turned, by the settings of (auto) keying; whether
        it took a key.

        Raises:
            WriteError: the action cannot be written.
        """
        scene = bpy.context.scene
        assert scene is not None
        known = len(self._noted)
        channels = ("location", rotation_property(item.rotation_mode))
        self._prepare(item, (channels, frame))
        options = keying_options(scene, auto=auto)
        if self._blends(item):
            # What is there to be keyed is in the motion beneath.
            options.discard("INSERTKEY_AVAILABLE")
        how = options, key_type(scene)
        keyed = [each for each in channels if self._insert(item, each, frame, _GROUP, how)]
        done = bool(keyed)
        if not done and len(self._noted) > known:
            # No action is left behind that nothing went into.
            self.drop_last(item)
        self._inserted(item, frame, any_done=done)
        return done

    def insert_path(
        self,
        item: bpy.types.Object,
        frames: Floats,
        transforms: dict[str, Floats],
        *,
        angle: float,
        distance: float,
    ) -> int:
        """Write an object's way as few keys, in place of what it had between its ends; number of
        key frames.

        At frames (frames,), ascending, its channels have values (frames, components): "location",
        and the one that its rotation mode has. They may be off by a distance, its own units, and an
        angle, radians.
        """
        self._prepare(item)
        names = list(transforms)
        tracks = [
            Track(transforms[each], LOCATION if each == "location" else item.rotation_mode)
            for each in names
        ]
        (found,) = reduce_keys(frames, [Limb(tracks, angle, distance)])
        for name, keys in zip(names, found, strict=True):
            count = np.shape(transforms[name])[1]
            channel = Channel(name, transforms[name], _GROUP)
            self._replace(item, channel, [bezier_arrays(keys, each) for each in range(count)])
        self.count += 1
        mark_file_changed()
        return len(found[0])
