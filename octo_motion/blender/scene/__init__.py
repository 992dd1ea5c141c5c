# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves, meshes, markers and importers."""

from .clip_placing import place_clip, room_of, show_selected
from .company import Company, check_partner, part_of_pose
from .contact_markers import Contact, markers, read_markers, remove_markers, write_markers
from .curves import add_route_curve, read_route, suggested_control_points
from .grasp_target import (
    CARRIED,
    WITH_SURFACE,
    can_be_carried,
    hangs_on,
    home_of,
    is_carried,
    may_move,
    put_back,
    read_form,
    read_places,
)
from .imports import NOTE, ImportedClip, Up, import_clip, remove_clips
from .loose_objects import LooseObject, put_transform, transform_of
from .octopus import add_octopus, own_collection
from .surfaces import (
    is_enabled,
    may_change,
    read_ground_mesh,
    read_motion,
    read_obstacle,
    read_triangles,
)

__all__ = [
    "CARRIED",
    "NOTE",
    "WITH_SURFACE",
    "Company",
    "Contact",
    "ImportedClip",
    "LooseObject",
    "Up",
    "add_octopus",
    "add_route_curve",
    "can_be_carried",
    "check_partner",
    "hangs_on",
    "home_of",
    "import_clip",
    "is_carried",
    "is_enabled",
    "markers",
    "may_change",
    "may_move",
    "own_collection",
    "part_of_pose",
    "place_clip",
    "put_back",
    "put_transform",
    "read_form",
    "read_ground_mesh",
    "read_markers",
    "read_motion",
    "read_obstacle",
    "read_places",
    "read_route",
    "read_triangles",
    "remove_clips",
    "remove_markers",
    "room_of",
    "show_selected",
    "suggested_control_points",
    "transform_of",
    "write_markers",
]
