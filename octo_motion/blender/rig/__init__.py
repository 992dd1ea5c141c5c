# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures, arms, skins and puppets."""

from .armature import (
    ALIGNED,
    SUCKER_PROPERTY,
    active_armature,
    armature_data,
    bone_and_property,
    carrying_axes,
    deformed_meshes,
    hidden_bones,
    is_driven_object,
    linked_names,
    may_stretch,
    pose_of,
    read_skeleton,
    require_editable,
    select_pose_bones,
    selected_bones,
    world_directions,
    world_matrix,
)
from .puppet import Puppet
from .puppet_reading import bone_materials, is_part_of, mark_bones, read_rig, set_bone_material
from .skin import arm_skins, radii_of_skin, skin_key, skin_parts, vertex_positions

__all__ = [
    "ALIGNED",
    "SUCKER_PROPERTY",
    "Puppet",
    "active_armature",
    "arm_skins",
    "armature_data",
    "bone_and_property",
    "bone_materials",
    "carrying_axes",
    "deformed_meshes",
    "hidden_bones",
    "is_driven_object",
    "is_part_of",
    "linked_names",
    "mark_bones",
    "may_stretch",
    "pose_of",
    "radii_of_skin",
    "read_rig",
    "read_skeleton",
    "require_editable",
    "select_pose_bones",
    "selected_bones",
    "set_bone_material",
    "skin_key",
    "skin_parts",
    "vertex_positions",
    "world_directions",
    "world_matrix",
]
