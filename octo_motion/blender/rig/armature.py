# SPDX-License-Identifier: GPL-3.0-or-later
"""Armatures: their rest skeleton as plain arrays, their bones, and what may be done to them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.content_cache import ContentCache
from ...core.errors import RigError, WriteError
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


def pose_of(armature: bpy.types.Object) -> bpy.types.Pose:
    """An armature object's pose.

    Raises:
        RigError: it has none yet.
    """
    if armature.pose is None:
        # An armature that was made a moment ago gets its pose with the next update.
        bpy.context.view_layer.update()
    if armature.pose is None:
        raise RigError(
            f"'{armature.name}' has no pose yet.", "Put it into a scene and leave edit mode."
        )
    return armature.pose


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
    weighted = {group.name for item in deformed_meshes(armature) for group in item.vertex_groups}
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
    transforms = ("location", "rotation_", "scale")
    return names | {
        name for name, channel, _ in driven_channels(armature) if channel.startswith(transforms)
    }


def driven_channels(
    armature: bpy.types.Object,
) -> Iterator[tuple[str, str, bpy.types.FCurve]]:
    """Bone, property and driver of all properties of bones that have one."""
    data = armature.animation_data
    for curve in data.drivers if data is not None else ():
        name, channel = bone_and_property(curve.data_path)
        if name:
            yield name, channel, curve


_BONE_PATH: Final = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.?(.*)', re.DOTALL)


def bone_and_property(data_path: str) -> tuple[str, str]:
    """Name of the bone and its property that a data path leads to; "" and the path for others."""
    found = _BONE_PATH.fullmatch(data_path)
    if found is None:
        return "", data_path
    return bpy.utils.unescape_identifier(found[1]), found[2]


def is_driven_object(obj: bpy.types.Object) -> bool:
    """Whether drivers move or turn an object."""
    data = obj.animation_data
    moved = ("location", "rotation_", "delta_location", "delta_rotation_")
    return data is not None and any(
        not curve.mute and curve.data_path.startswith(moved) for curve in data.drivers
    )


def carrying_axes(bone: bpy.types.Bone) -> Matrix:
    """A bone's axes, seen along those in which its location is given when it is not local."""
    axes = bone.matrix_local.to_3x3()
    return axes if bone.parent is None else bone.parent.matrix_local.to_3x3().inverted() @ axes


# --- What the list of arms needs of an armature object --------------------------------------------


def world_directions(armature: bpy.types.Object) -> tuple[Floats, Floats]:
    """The world's up (+Z), and where a character faces (−Y), in armature space, (3,) each."""
    inverse = armature.matrix_world.to_3x3().inverted_safe()
    up, front = (inverse @ Vector(axis) for axis in ((0, 0, 1), (0, -1, 0)))
    return np.array(up, dtype=np.float64), np.array(front, dtype=np.float64)


def require_editable(armature: bpy.types.Object) -> None:
    """Make sure that settings written on this armature are saved with the file.

    Raises:
        RigError: the object is no armature.
        WriteError: it is linked, or a library override that is not editable.
    """
    armature_data(armature)
    if armature.library is not None:
        raise WriteError(
            f"'{armature.name}' is linked from '{armature.library.name}': its settings are "
            "read-only here.",
            "Make a library override (Object > Library Override > Make).",
        )
    override = armature.override_library
    if override is not None and override.is_system_override:
        raise WriteError(
            f"'{armature.name}' is a library override that is not editable.",
            "Make it editable: select it and choose Object > Library Override > Make.",
        )


def hidden_bones(armature: bpy.types.Object, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the bones that pose mode does not show.

    Raises:
        RigError: a bone does not exist.
    """
    bones = _pose_bones(armature, names)
    return tuple(bone.name for bone in bones if not _is_shown(bone))


def select_pose_bones(
    armature: bpy.types.Object, names: Iterable[str], *, extend: bool = False
) -> None:
    """Select bones in pose mode, the first of them active.

    Hidden bones stay unselected: they could be keyed by mistake.

    Raises:
        RigError: a bone does not exist.
    """
    chosen = [bone for bone in _pose_bones(armature, names) if _is_shown(bone)]
    if not extend and armature.pose is not None:
        for bone in armature.pose.bones:
            versions.select(bone, state=False)
    for bone in chosen:
        versions.select(bone, state=True)
    if chosen:
        bones = armature_data(armature).bones
        bones.active = bones[chosen[0].name]


def _pose_bones(armature: bpy.types.Object, names: Iterable[str]) -> list[bpy.types.PoseBone]:
    bones = armature.pose.bones if armature.pose is not None else {}
    found: list[bpy.types.PoseBone] = []
    for name in names:
        bone = bones.get(name)
        if bone is None:
            raise RigError(f"The armature has no bone '{name}'.", "Detect the arms again.")
        found.append(bone)
    return found


def _is_shown(bone: bpy.types.PoseBone) -> bool:
    collections = bone.bone.collections
    in_view = not collections or any(each.is_visible_effectively for each in collections)
    return in_view and not versions.is_hidden(bone)


# --- Which bones may get longer and thinner -------------------------------------------------------
#
# A bone's scale reaches its children. Where they inherit it along their own axes (Blender's
# *Aligned*) or not at all, each bone can be as long as it likes; where they inherit it in full,
# stretched bones shear those that bend away from them.


ALIGNED: Final = "ALIGNED"
_APART: Final = {"NONE", "NONE_LEGACY"}
"""Ways of a bone not to inherit its parent's scale."""
_CLOSE: Final = 1e-4
"""Bone lengths that a bone's head may be off its parent's tail."""


def may_stretch(armature: bpy.types.Object, bones: Sequence[str]) -> bool:
    """Whether the bones of an arm, root to tip, can be made longer without harm."""
    data = armature_data(armature).bones
    chain = [data[name] for name in bones]
    for upper, lower in pairwise(chain):
        if lower.parent != upper or lower.inherit_scale not in {ALIGNED, *_APART}:
            return False
        if (lower.head_local - upper.tail_local).length > _CLOSE * upper.length:
            return False
    return True


# --- Lists of settings in library overrides -------------------------------------------------------


def linked_names(settings: bpy.types.PropertyGroup, collection: str) -> frozenset[str]:
    """Names of a list's items that a library override has from its linked file.

    Blender allows to change their settings, but neither to rename, remove nor reorder them; items
    added in this file are free.

    Args:
        settings: a group of an object's settings.
        collection: which of its lists.
    """
    override = settings.id_data.override_library if settings.id_data else None
    if override is None or override.reference is None:
        return frozenset()
    original: Any = override.reference.path_resolve(settings.path_from_id())
    return frozenset(item.name for item in getattr(original, collection))
