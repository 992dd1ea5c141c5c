# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions, F-curves, keys and clips."""

from .actions import (
    Channel,
    channelbags_of,
    curves_of,
    is_edited,
    is_generated,
    key_counts,
    location_channel,
    may_replace,
    note_of,
    object_channels,
    read_channels,
    rotation_channels,
    writable_armature,
    writable_object,
    write_action,
)
from .clips import further_channels, read_clip, scaled_channels, write_clip
from .cycles import lasting
from .leftover_poses import (
    SCALE,
    animated_bones,
    as_posed,
    displaced_bones,
    rest_bones,
    standing_of,
    unscale_bones,
)
from .pose_keys import Keyed, PoseKeys
from .preview_pose import PoseValues, pose_values, restore_pose, show_pose
from .scene_playback import time_kept
from .stretching import ALIGNED, may_stretch

__all__ = [
    "ALIGNED",
    "SCALE",
    "Channel",
    "Keyed",
    "PoseKeys",
    "PoseValues",
    "animated_bones",
    "as_posed",
    "channelbags_of",
    "curves_of",
    "displaced_bones",
    "further_channels",
    "is_edited",
    "is_generated",
    "key_counts",
    "lasting",
    "location_channel",
    "may_replace",
    "may_stretch",
    "note_of",
    "object_channels",
    "pose_values",
    "read_channels",
    "read_clip",
    "rest_bones",
    "restore_pose",
    "rotation_channels",
    "scaled_channels",
    "show_pose",
    "standing_of",
    "time_kept",
    "unscale_bones",
    "writable_armature",
    "writable_object",
    "write_action",
    "write_clip",
]
