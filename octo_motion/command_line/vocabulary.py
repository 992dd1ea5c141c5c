# SPDX-License-Identifier: GPL-3.0-or-later
"""What shots may name, asked of Blender: settings, gaits, files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy

from ..blender.files import load_gait
from ..core.errors import OctoMotionError
from ..ui.locomotion.settings.changes import ChangeItem
from ..ui.locomotion.settings.ground import ContactItem
from ..ui.locomotion.settings.properties import OCTO_MOTION_PG_locomotion
from ..ui.locomotion.settings.reaches import ReachItem
from ..ui.splicing.landmark_properties import OCTO_MOTION_PG_landmarks
from ..ui.splicing.properties import OCTO_MOTION_PG_splicing
from ..ui.splicing.splice_properties import SpliceItem
from .job_file import Known
from .motion_files import check_motion, is_motion
from .setting_values import Setting

_OWN_KEYS = {"name", "gait"}
"""No settings: Blender's own name of a group, and the gait, which a shot names itself."""
_LISTED = {"changes": ChangeItem, "reaches": ReachItem, "contacts": ContactItem}
"""What the items are of the lists that a shot may have."""


def known() -> Known:
    """What shots may name in this Blender."""
    return Known(
        settings=_by_name(_settings(OCTO_MOTION_PG_locomotion)),
        gait=load_gait,
        splicing_settings=_by_name(_settings(OCTO_MOTION_PG_splicing)),
        splice_settings=_by_name(
            (
                Setting("name", "STRING"),
                *_settings(SpliceItem),
                *_settings(OCTO_MOTION_PG_landmarks, "landmarks."),
            )
        ),
        lists={name: _by_name(_of_item(item)) for name, item in _LISTED.items()},
    )


def _by_name(settings: Iterable[Setting]) -> dict[str, Setting]:
    return {setting.name: setting for setting in settings}


def _of_item(item: Any) -> Iterator[Setting]:
    """What may be said of an item of a list: of an object its name, of a contact its place."""
    yield Setting("name", "STRING")
    for name in item.__annotations__:
        each: Any = item.bl_rna.properties[name]
        if each.type == "POINTER" or name == "gait":
            yield Setting(name, "STRING")
        elif each.type == "FLOAT" and each.is_array:
            yield Setting(name, "POINT")
    yield from _settings(item)


def _settings(group: Any, before: str = "") -> Iterator[Setting]:
    """Plain values of a group of properties, and of the groups within."""
    properties: Any = group.bl_rna.properties  # of many types, which the stubs do not tell apart
    for each in properties:
        name = before + each.identifier
        if each.identifier in {"rna_type", "name"} or name in _OWN_KEYS or each.is_hidden:
            continue
        if each.type == "POINTER":
            inner = bpy.types.PropertyGroup.bl_rna_get_subclass_py(each.fixed_type.identifier, None)
            if inner is not None:
                yield from _settings(inner, f"{name}.")
        elif each.type in {"BOOLEAN", "INT", "FLOAT"} and each.is_array:
            continue
        elif each.type in {"INT", "FLOAT"}:
            yield Setting(
                name,
                each.type,
                minimum=each.hard_min,
                maximum=each.hard_max,
                is_angle=each.unit == "ROTATION",
            )
        elif each.type == "ENUM":
            choices = tuple(item.identifier for item in each.enum_items)
            yield Setting(name, "ENUM", choices=choices)
        elif each.type in {"BOOLEAN", "STRING"}:
            yield Setting(name, each.type)


def check_file(file: Path) -> None:
    """Make sure that Blender can read a file, without opening it.

    Raises:
        OctoMotionError: there is no such file, or it is neither Blender's nor one of motion.
    """
    if is_motion(file):
        check_motion(file)
        return
    if not file.is_file():
        raise OctoMotionError(f"There is no file '{file}'.", "Give the path of a .blend file.")
    if bpy.data.filepath and file.samefile(bpy.data.filepath):
        # Blender does not look into the file that is open.
        return
    try:
        library: Any = bpy.data.libraries.load(str(file))  # the stubs know no context manager
        with library:
            pass
    except OSError as error:
        raise OctoMotionError(
            f"'{file}' is not a file that this Blender can read.", "Give a .blend file."
        ) from error
