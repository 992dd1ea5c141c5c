# SPDX-License-Identifier: GPL-3.0-or-later
"""The creature and its motion for other programs: glTF, FBX, Alembic."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import bpy

from ..core.errors import RigError, WriteError
from .operator_errors import blender_said

_EXPORTERS: Final[Mapping[str, tuple[str, str, Mapping[str, Any]]]] = {
    ".glb": (
        "export_scene",
        "gltf",
        {
            "export_format": "GLB",
            "use_selection": True,
            "export_animation_mode": "ACTIVE_ACTIONS",
            "export_yup": True,
        },
    ),
    ".fbx": (
        "export_scene",
        "fbx",
        {
            "use_selection": True,
            "add_leaf_bones": False,
            "bake_anim": True,
            "bake_anim_use_all_actions": False,
            "bake_anim_use_nla_strips": False,
            "bake_anim_simplify_factor": 0.0,
        },
    ),
    ".abc": ("wm", "alembic_export", {"selected": True, "as_background_job": False}),
}
"""The operator of each format, by its group and name, and its options."""


def check_export(path: Path, armature: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Make sure, before any work, that an armature can be exported to a file.

    Raises:
        RigError: there is nothing that the format could keep.
        WriteError: Blender's exporter is switched off or not there.
    """
    group, name, _options = _EXPORTERS[path.suffix.lower()]
    if name not in dir(getattr(bpy.ops, group)):
        raise WriteError(
            f"This Blender has no exporter for {path.suffix}.",
            "Enable its add-on in the preferences, or take an official build of Blender.",
        )
    meshes = (each for each in _creature(armature, scene) if each.type == "MESH")
    if path.suffix.lower() == ".abc" and next(meshes, None) is None:
        raise RigError(
            f"'{armature.name}' has no mesh, and Alembic keeps no bones.", "Export to .glb or .fbx."
        )


def export(
    path: Path, armature: bpy.types.Object, scene: bpy.types.Scene, first: int, last: int
) -> None:
    """Write an armature, all that hangs on it, and its motion to a file. Changes the selection and
    the scene's frame range.

    Args:
        path: the file; its ending decides the format.
        armature: the creature.
        scene: the context's scene.
        first: first frame of the motion.
        last: last frame of the motion.

    Raises:
        WriteError: the file cannot be written, or the armature is hidden.
    """
    # What is exported is the scene's range.
    scene.frame_start, scene.frame_end = first, last
    scene.frame_set(first)
    _select(list(_creature(armature, scene)), armature)
    group, name, options = _EXPORTERS[path.suffix.lower()]
    exporter: Any = getattr(getattr(bpy.ops, group), name)
    try:
        exporter(filepath=str(path), check_existing=False, **options)
    except RuntimeError as error:
        raise WriteError(
            f"The export to {path.suffix} failed: {blender_said(error)}",
            "Open the .blend file and export there.",
        ) from error


def _creature(armature: bpy.types.Object, scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    below = set(armature.children_recursive)
    for each in scene.objects:
        deformed = each.type == "MESH" and each.find_armature() == armature
        if each == armature or each in below or deformed:
            yield each


def _select(creature: list[bpy.types.Object], armature: bpy.types.Object) -> None:
    layer = bpy.context.view_layer
    assert layer is not None
    for each in layer.objects:
        each.select_set(state=False, view_layer=layer)
    for each in creature:
        if each.name in layer.objects:
            each.hide_set(state=False, view_layer=layer)
            each.select_set(state=True, view_layer=layer)
    if not armature.select_get(view_layer=layer):
        raise WriteError(
            f"'{armature.name}' is hidden and cannot be exported.", "Show it and its collection."
        )
    layer.objects.active = armature
