# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures, arms, skins and puppets."""

from .armature import (
    SUCKER_PROPERTY,
    active_armature,
    armature_data,
    carrying_axes,
    deformed_meshes,
    is_driven_object,
    read_skeleton,
    selected_bones,
    world_matrix,
)
from .arms import hidden_bones, require_editable, select_pose_bones, world_directions
from .puppet import Puppet
from .puppet_reading import bone_materials, is_part_of, mark_bones, read_rig, set_bone_material
from .skin_radii import radii_of_skin, skin_key, skin_parts

__all__ = [
    "SUCKER_PROPERTY",
    "Puppet",
    "active_armature",
    "armature_data",
    "bone_materials",
    "carrying_axes",
    "deformed_meshes",
    "hidden_bones",
    "is_driven_object",
    "is_part_of",
    "mark_bones",
    "radii_of_skin",
    "read_rig",
    "read_skeleton",
    "require_editable",
    "select_pose_bones",
    "selected_bones",
    "set_bone_material",
    "skin_key",
    "skin_parts",
    "world_directions",
    "world_matrix",
]
