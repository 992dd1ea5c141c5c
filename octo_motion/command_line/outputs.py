# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written whole or not at all, and exports for other programs.

Each is written under another name in its own folder, so that paths relative to it are right and
taking its place is one step of the file system. Only when all of them are complete do they.
"""

from __future__ import annotations

import json
import secrets
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np

from ..blender import files
from ..blender.animation import curves_of, key_points
from ..blender.rig import armature_data, bone_and_property
from ..core.errors import RigError, WriteError
from ..core.files import replace

_LONGEST_ON_WINDOWS: Final = 259
_ADDED: Final = 16
"""Letters that the name of an unfinished file has more."""


@contextmanager
def staged(outputs: Iterable[Path]) -> Iterator[dict[Path, Path]]:
    """Where to write each output for now. On leaving, nothing of that is left.

    Folders are made as needed.

    Raises:
        WriteError: a folder cannot be made or written to.
    """
    token = secrets.token_hex(4)
    places = {path: path.with_name(f".{path.stem}.{token}.part{path.suffix}") for path in outputs}
    try:
        for path, place in places.items():
            _check_writable(path, place)
        yield places
    finally:
        for place in places.values():
            remove_staged(place)


def commit(places: Mapping[Path, Path]) -> None:
    """Let the files that were written take the places of the outputs.

    Raises:
        WriteError: one is missing, or cannot take its place. As a rule nothing has changed then.
    """
    for path, place in places.items():
        if not place.is_file():
            raise WriteError(f"'{path}' was not written.", "See what Blender said.")
    for path, place in places.items():
        try:
            replace(place, path)
        except OSError as error:
            raise unwritable(f"'{path}'", error) from error


def remove_staged(place: Path) -> None:
    """Delete an unfinished file, and the one that Blender itself first writes beside it."""
    for leftover in (place, place.with_name(place.name + "@")):
        # What cannot be deleted is at least no output.
        try:
            leftover.unlink(missing_ok=True)
        except OSError:
            continue


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all.

    Raises:
        WriteError: it cannot be written.
    """
    with staged([path]) as places:
        try:
            places[path].write_text(text, encoding="utf-8")
        except OSError as error:
            raise unwritable(f"'{path}'", error) from error
        commit(places)


def _check_writable(path: Path, place: Path) -> None:
    if path.is_dir():
        raise WriteError(f"'{path}' is a folder.", "Give the name of a file.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        place.touch(exist_ok=False)
        # An exporter must not find a file there that it has not written itself.
        place.unlink()
    except OSError as error:
        raise unwritable(f"'{path}'", error) from error


def unwritable(what: str, error: OSError) -> WriteError:
    """The error that says that a path, in quotation marks, cannot be written."""
    letters = len(what) - 2
    if sys.platform == "win32" and letters + _ADDED > _LONGEST_ON_WINDOWS:
        return WriteError(
            f"Octo Motion cannot write {what}: its path has {letters} letters, and Windows takes "
            f"{_LONGEST_ON_WINDOWS - _ADDED}.",
            "Choose a folder nearer to the drive.",
        )
    return files.unwritable(what, error)


# --- What Blender's own operators report when they fail, in one line ------------------------------


def blender_said(error: RuntimeError) -> str:
    """The reason in an error raised by one of Blender's operators.

    If it is a traceback of Python, the reason is the first line that is not indented.
    """
    lines = [line for line in str(error).splitlines() if line.strip()]
    if lines and "Traceback" in lines[0]:
        lines = [line for line in lines[1:] if not line.startswith(" ")]
    if not lines:
        return "Blender does not say why."
    reason = lines[0].strip()
    return reason.removeprefix("Error: ").rstrip(".") + "."


# --- The creature and its motion for other programs: glTF, FBX, Alembic, USD ----------------------


_USD: Final = (
    "wm",
    "usd_export",
    {
        "selected_objects_only": True,
        "export_animation": True,
        "export_armatures": True,
        "export_lights": False,
        "export_cameras": False,
        "convert_world_material": False,
    },
)
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
    **dict.fromkeys((".usd", ".usdc", ".usda"), _USD),
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


_SCALED: Final = 0.01
"""Share by which a bone's scale along itself may be off that across without a word."""


def uncarried(path: Path, armature: bpy.types.Object) -> str:
    """What a file of an armature's motion will play otherwise than Blender does, "" for nothing.

    A bone that is scaled shears those that bend away from it in all formats that hand scale on from
    bone to bone; Alembic keeps points of the skin, and has none.
    """
    data = armature.animation_data
    if path.suffix.lower() == ".abc" or data is None or data.action is None:
        return ""
    found: dict[str, list[Any]] = {}
    for curve in curves_of(data.action):
        bone, name = bone_and_property(curve.data_path)
        if name == "scale" and armature_data(armature).bones[bone].children:
            found.setdefault(bone, []).append(key_points(curve, "co").reshape(-1, 2)[:, 1])
    scaled = [
        name
        for name, values in found.items()
        if np.ptp([each.min() for each in values] + [each.max() for each in values]) > _SCALED
    ]
    if not scaled:
        return ""
    return (
        f"{path.suffix} hands the scale of bones on otherwise than Blender: {len(scaled)} bones "
        f"that get longer ('{scaled[0]}') put arms off by some percent of their length there. Set "
        "ground.stretch_as to location, or ground.stretch to 0."
    )


def export(
    path: Path, armature: bpy.types.Object, scene: bpy.types.Scene, first: int, last: int
) -> None:
    """Write an armature, all that hangs on it, and its motion to a file, whose ending decides the
    format. Changes the selection and the frame range of the scene, which is the context's.

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
