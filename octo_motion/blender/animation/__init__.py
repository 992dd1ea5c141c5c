# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions, F-curves, keys and clips."""

from .actions import (
    Channel,
    channel_unit,
    channelbags_of,
    curves_of,
    is_edited,
    is_generated,
    key_counts,
    location_channel,
    may_replace,
    note_of,
    object_channels,
    object_places,
    rotation_channels,
    rotation_path,
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
from .stretching import ALIGNED, hands_on, may_stretch, strains_of, stretch_channels

__all__ = [
    "ALIGNED",
    "SCALE",
    "Channel",
    "Keyed",
    "PoseKeys",
    "PoseValues",
    "animated_bones",
    "as_posed",
    "channel_unit",
    "channelbags_of",
    "curves_of",
    "displaced_bones",
    "further_channels",
    "hands_on",
    "is_edited",
    "is_generated",
    "key_counts",
    "lasting",
    "location_channel",
    "may_replace",
    "may_stretch",
    "note_of",
    "object_channels",
    "object_places",
    "pose_values",
    "read_clip",
    "rest_bones",
    "restore_pose",
    "rotation_channels",
    "rotation_path",
    "scaled_channels",
    "show_pose",
    "standing_of",
    "strains_of",
    "stretch_channels",
    "time_kept",
    "unscale_bones",
    "writable_armature",
    "writable_object",
    "write_action",
    "write_clip",
]
