# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures to plain arrays."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np
from mathutils import Matrix

from ...core.content_cache import ContentCache
from ...core.errors import RigError
from ...core.rotations import Floats
from ...core.skeleton import Skeleton
from .. import versions

SUCKER_PROPERTY = "octo_motion_sucker"
"""Custom property of a bone: the local axis its suckers face, such as "-Z"."""

_known: Final[ContentCache[Skeleton]] = ContentCache(4)


def active_armature(context: bpy.types.Context) -> bpy.types.Object:
    """The armature that the user works on: the active object, the one that deforms it, the one
    whose contact it marks, or the one whose route it is (a selected one first, of several).

    Raises:
        RigError: there is no such object.
    """
    active = context.object
    if active is None:
        raise RigError("No object is active.", "Select an armature.")
    if active.type == "ARMATURE":
        return active
    armature = active.find_armature() or _marked_armature(active) or _on_route(active, context)
    if armature is None:
        raise RigError(f"'{active.name}' is not an armature.", "Select an armature.")
    return armature


def _marked_armature(active: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that a marker of a contact belongs to."""
    name = active.octo_motion.contact.armature  # type: ignore[attr-defined]
    found = bpy.data.objects.get(name) if name else None
    return found if found is not None and found.type == "ARMATURE" else None


def _on_route(active: bpy.types.Object, context: bpy.types.Context) -> bpy.types.Object | None:
    """The armature that goes along a curve."""
    layer = context.view_layer
    if active.type != "CURVE" or layer is None:
        return None
    followers = [
        each
        for each in layer.objects
        if each.type == "ARMATURE"
        # Settings come into being when they are looked at: what has none is left without.
        and each.is_property_set("octo_motion")
        and each.octo_motion.locomotion.route == active
    ]
    return next((each for each in followers if each.select_get()), next(iter(followers), None))


def armature_data(armature: bpy.types.Object) -> bpy.types.Armature:
    """The armature's data, for an object that may turn out to be something else.

    Raises:
        RigError: the object is no armature.
    """
    data = armature.data
    if not isinstance(data, bpy.types.Armature):
        raise RigError(f"'{armature.name}' is not an armature.", "Select an armature.")
    return data


def read_skeleton(armature: bpy.types.Object) -> Skeleton:
    """The rest skeleton of an armature object, in armature space; it may be in any mode.

    Raises:
        RigError: the object is no armature, has no bones, or a bone without length.
    """
    data = armature_data(armature)
    if armature.mode == "EDIT":
        # Bones made in edit mode exist for everyone else only once they are written back.
        armature.update_from_editmode()
    bones = list(data.bones)
    if not bones:
        raise RigError(f"'{armature.name}' has no bones.", "Add bones, or choose another armature.")
    index = {bone.name: number for number, bone in enumerate(bones)}
    lengths = np.array([bone.length for bone in bones])
    matrices = np.array([bone.matrix_local for bone in bones], dtype=np.float64)
    if not np.isfinite(matrices).all():
        raise RigError(
            f"'{armature.name}' has bones at undefined positions.", "Repair its rest pose."
        )
    driven = _driven_bones(armature)
    weighted = _vertex_group_names(armature)
    skeleton = Skeleton(
        names=tuple(bone.name for bone in bones),
        parents=tuple(index[bone.parent.name] if bone.parent else -1 for bone in bones),
        rest_matrices=matrices,
        lengths=lengths,
        connected=tuple(bone.use_connect for bone in bones),
        deform=tuple(bone.use_deform for bone in bones),
        inherits_rotation=tuple(bone.use_inherit_rotation for bone in bones),
        constrained=tuple(bone.name in driven for bone in bones),
        weighted=tuple(bone.name in weighted for bone in bones),
        bendy_segments=tuple(bone.bbone_segments for bone in bones),
        sucker_axes=tuple(str(bone.get(SUCKER_PROPERTY, "")) for bone in bones),
    )
    # What was worked out of the same bones before stays with them.
    return _known.get(skeleton.content, lambda: skeleton)


def selected_bones(armature: bpy.types.Object) -> tuple[str, ...]:
    """Names of the bones selected in edit mode or in pose mode, parents before children."""
    data = armature_data(armature)
    if armature.mode == "EDIT":
        chosen = {bone.name for bone in data.edit_bones if bone.select}
        return tuple(bone.name for bone in data.edit_bones if bone.name in chosen)
    if armature.pose is None:
        return ()
    return tuple(bone.name for bone in armature.pose.bones if versions.is_selected(bone))


def deformed_meshes(armature: bpy.types.Object) -> list[bpy.types.Object]:
    """The mesh objects that an armature deforms, whether or not they are its children."""
    return [
        item
        for item in bpy.data.objects
        if item.type == "MESH" and item.find_armature() == armature
    ]


def world_matrix(armature: bpy.types.Object) -> Floats:
    """The object's world matrix, (4, 4)."""
    return np.array(armature.matrix_world, dtype=np.float64)


def _driven_bones(armature: bpy.types.Object) -> set[str]:
    """Names of the bones that constraints move, or drivers."""
    if armature.pose is None:
        return set()
    names = {
        bone.name
        for bone in armature.pose.bones
        if any(not constraint.mute and constraint.influence > 0 for constraint in bone.constraints)
    }
    if armature.animation_data is not None:
        transforms = ("location", "rotation_", "scale")
        for curve in armature.animation_data.drivers:
            start, _, rest = curve.data_path.partition('pose.bones["')
            name, _, channel = rest.partition('"].')
            if not start and channel.startswith(transforms):
                names.add(bpy.utils.unescape_identifier(name))
    return names


def is_driven_object(obj: bpy.types.Object) -> bool:
    """Whether drivers move or turn an object."""
    data = obj.animation_data
    moved = ("location", "rotation_", "delta_location", "delta_rotation_")
    return data is not None and any(
        not curve.mute and curve.data_path.startswith(moved) for curve in data.drivers
    )


def _vertex_group_names(armature: bpy.types.Object) -> set[str]:
    """Names of the vertex groups of all meshes that the armature deforms."""
    return {group.name for item in deformed_meshes(armature) for group in item.vertex_groups}


def carrying_axes(bone: bpy.types.Bone) -> Matrix:
    """A bone's axes, seen along those in which its location is given when it is not local."""
    axes = bone.matrix_local.to_3x3()
    return axes if bone.parent is None else bone.parent.matrix_local.to_3x3().inverted() @ axes
