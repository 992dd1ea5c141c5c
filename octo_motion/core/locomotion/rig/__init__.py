# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones are arms, and what leads from bones to joints and back."""

from .arm_batches import ArmBatch, batches_by_bones
from .arm_chains import (
    ArmChain,
    BodyFrame,
    Side,
    arm_azimuths,
    body_frame,
    chain_of,
    is_driven,
    joint_positions,
    nearest_axis,
    place_added,
)
from .arm_frames import ArmFrames, bend_rotations, frame_of, frames_of_arm, transport_frames
from .bone_rotations import ArmRest, Facing, arm_rest, carried_to, rotate_bones, sucker_sides
from .detection import Detection, detect_arms
from .joint_room import (
    MARGIN,
    TOLERATED,
    JointRoom,
    lift_to_floor,
    loose_from_root,
    lowest_allowed,
    room_needed,
    smooth_floor,
)
from .mantle import find_mantle, lies_back, stretch_mantle
from .placement import carried_by_root_bone, object_transforms, root_bone_transforms
from .poses import ArmMotion, Poses, halfway_automatic, halfway_linear
from .skin_offset import ArmSkin, arm_skin, nearest_bones

__all__ = [
    "MARGIN",
    "TOLERATED",
    "ArmBatch",
    "ArmChain",
    "ArmFrames",
    "ArmMotion",
    "ArmRest",
    "ArmSkin",
    "BodyFrame",
    "Detection",
    "Facing",
    "JointRoom",
    "Poses",
    "Side",
    "arm_azimuths",
    "arm_rest",
    "arm_skin",
    "batches_by_bones",
    "bend_rotations",
    "body_frame",
    "carried_by_root_bone",
    "carried_to",
    "chain_of",
    "detect_arms",
    "find_mantle",
    "frame_of",
    "frames_of_arm",
    "halfway_automatic",
    "halfway_linear",
    "is_driven",
    "joint_positions",
    "lies_back",
    "lift_to_floor",
    "loose_from_root",
    "lowest_allowed",
    "nearest_axis",
    "nearest_bones",
    "object_transforms",
    "place_added",
    "room_needed",
    "root_bone_transforms",
    "rotate_bones",
    "smooth_floor",
    "stretch_mantle",
    "sucker_sides",
    "transport_frames",
]
