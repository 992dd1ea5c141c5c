# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions, F-curves, keys and clips."""

from .actions import (
    Channel,
    curves_of,
    is_edited,
    is_generated,
    key_counts,
    key_points,
    may_replace,
    note_of,
    read_channels,
    read_object_channels,
    unedited_with_note,
    writable_armature,
    writable_object,
    write_action,
)
from .clips import further_channels, read_clip, scaled_channels, write_clip
from .fcurves import lasting
from .pose_keys import Keyed, PoseKeys
from .poses import (
    SCALE,
    PoseValues,
    animated_bones,
    as_posed,
    displaced_bones,
    pose_values,
    rest_bones,
    restore_pose,
    show_pose,
    standing_of,
)
from .scene_playback import play_bones, time_kept

__all__ = [
    "SCALE",
    "Channel",
    "Keyed",
    "PoseKeys",
    "PoseValues",
    "animated_bones",
    "as_posed",
    "curves_of",
    "displaced_bones",
    "further_channels",
    "is_edited",
    "is_generated",
    "key_counts",
    "key_points",
    "lasting",
    "may_replace",
    "note_of",
    "play_bones",
    "pose_values",
    "read_channels",
    "read_clip",
    "read_object_channels",
    "rest_bones",
    "restore_pose",
    "scaled_channels",
    "show_pose",
    "standing_of",
    "time_kept",
    "unedited_with_note",
    "writable_armature",
    "writable_object",
    "write_action",
    "write_clip",
]
