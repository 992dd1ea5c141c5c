# SPDX-License-Identifier: GPL-3.0-or-later
"""What shots may name, asked of Blender: settings, gaits, files."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from ..blender.files import load_gait, read_gait_file
from ..core.errors import ClipError, OctoMotionError, SettingsError
from ..core.locomotion.gait import gait_to_json
from ..core.splicing.clip import MOTION_SUFFIXES, check_bvh
from ..ui.follow_through import FollowChain, OCTO_MOTION_PG_follow_through
from ..ui.locomotion import AlongItem, ChangeItem, ContactItem, OCTO_MOTION_PG_locomotion, ReachItem
from ..ui.splicing import (
    PARTS,
    OCTO_MOTION_PG_landmarks,
    OCTO_MOTION_PG_retarget,
    OCTO_MOTION_PG_splicing,
    SpliceItem,
)
from .schema import Choice, Kind, Known, Number, Reading, Text, flag, point
from .shot_schema import ShotRequest, gait_name, is_motion, read_shot

_OWN_KEYS = {"name", "gait"}
"""No settings: Blender's own name of a group, and the gait, which a shot names itself."""
BACKSLASHES = "Write / between folders: every system takes it."
"""What to do about paths as Windows writes them."""
_LISTED = {
    "along": AlongItem,
    "changes": ChangeItem,
    "reaches": ReachItem,
    "contacts": ContactItem,
    "chains": FollowChain,
}
"""What the items are of the lists that a shot may have."""


def known() -> Known:
    """What shots may name in this Blender."""
    parts = tuple(identifier for identifier, *_ in PARTS)
    return Known(
        {
            "generate": dict(_settings(OCTO_MOTION_PG_locomotion)),
            "splice": dict(_settings(OCTO_MOTION_PG_splicing)),
            "follow": {
                **dict(_settings(OCTO_MOTION_PG_follow_through)),
                "wind": point,
            },
            "retarget": {
                **dict(_settings(OCTO_MOTION_PG_retarget)),
                **dict(_settings(OCTO_MOTION_PG_landmarks, "landmarks.")),
            },
            "splices": {
                "name": Text(may_be_empty=True),
                **dict(_settings(SpliceItem)),
                "part": Choice(parts, "part"),
                **dict(_settings(OCTO_MOTION_PG_landmarks, "landmarks.")),
            },
            **{name: dict(_of_item(item)) for name, item in _LISTED.items()},
        },
        load_gait,
        action_names,
    )


def action_names(file: Path) -> list[str]:
    """Names of the actions that a .blend file has, without opening it.

    Raises:
        OctoMotionError: Blender cannot read the file.
    """
    if not file.is_file():
        raise OctoMotionError(f"There is no file '{file}'.", "Give the path of a .blend file.")
    if bpy.data.filepath and file.samefile(bpy.data.filepath):
        # Blender does not look into the file that is open.
        return [each.name for each in bpy.data.actions]
    try:
        library: Any = bpy.data.libraries.load(str(file))
        with library as (inside, _taken):
            return list(inside.actions)
    except OSError as error:
        raise OctoMotionError(
            f"'{file}' is not a file that this Blender can read.", "Give a .blend file."
        ) from error


def _of_item(item: Any) -> Iterator[tuple[str, Kind]]:
    """What may be said of an item of a list: of an object its name, of a contact its place."""
    yield "name", Text(may_be_empty=True)
    for name in item.__annotations__:
        each: Any = item.bl_rna.properties[name]
        if name == "gait":
            yield name, gait_name
        elif each.type == "POINTER":
            yield name, Text(may_be_empty=True)
        elif each.type == "FLOAT" and each.is_array:
            yield name, point
    yield from _settings(item)


def _settings(group: Any, before: str = "") -> Iterator[tuple[str, Kind]]:
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
        elif each.type == "ENUM":
            yield name, Choice(tuple(item.identifier for item in each.enum_items))
        elif each.type == "STRING":
            yield name, Text(may_be_empty=True)
        elif each.type == "BOOLEAN" and not each.is_array:
            yield name, flag
        elif each.type in {"INT", "FLOAT"} and not each.is_array:
            whole, is_angle = each.type == "INT", each.unit == "ROTATION"
            yield name, Number(each.hard_min, each.hard_max, whole=whole, is_angle=is_angle)


def resolver(job: Path, name: str, *, follow: bool = True) -> Callable[[str], Path]:
    """The paths that the texts of a shot mean, by the job's path and the shot's name; links are
    followed, unless nothing is to be looked up.
    """

    def resolve(text: str) -> Path:
        check_path(text)
        path = job.parent / Path(text.replace("{name}", name)).expanduser()
        # An output that is a link is written where the link leads.
        return path.resolve() if follow else Path(os.path.normpath(path))

    return resolve


def check_path(text: str) -> None:
    """Make sure that a path of a job file is one, on every system.

    Raises:
        SettingsError: a backslash was read as something else, or would be, on another system.
    """
    if any(ord(letter) < 32 for letter in text):
        raise SettingsError(
            f"The path {text!r} has letters that cannot be seen: a backslash in double quotes "
            "means something else.",
            BACKSLASHES,
        )
    if "\\" in text and sys.platform != "win32":
        raise SettingsError(
            f"The path '{text}' has backslashes, which Windows alone takes.", BACKSLASHES
        )


def make_request(
    table: Mapping[str, Any], resolve: Callable[[str], Path], *, has_open_file: bool = False
) -> ShotRequest:
    """The shot that a single table asks for, with the content of its gait file.

    Raises:
        OctoMotionError: the table is wrong, with everything that is wrong with it.
    """
    reading = Reading(known(), resolve, has_open_file=has_open_file)
    shot = read_shot(table, reading)
    if reading.faults:
        raise SettingsError("\n".join(reading.faults))
    return with_gait(shot)


def with_gait(shot: ShotRequest) -> ShotRequest:
    """The shot with the content of its gait file, if it has one.

    Raises:
        GaitError: it cannot be read, or is no gait.
    """
    if not isinstance(shot.gait, Path):
        return shot
    return replace(shot, gait=gait_to_json(read_gait_file(shot.gait)))


def check_file(file: Path) -> None:
    """Make sure that Blender can read a file, without opening it.

    Raises:
        OctoMotionError: there is no such file, or it is neither Blender's nor one of motion.
    """
    if is_motion(file):
        _check_motion(file)
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


def _check_motion(path: Path) -> None:
    """Find out without importing it whether it is there, and of BVH, which is text, everything."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise ClipError(
            f"There is no file '{path}'.", f"Give a motion file ({', '.join(MOTION_SUFFIXES)})."
        ) from None
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise ClipError(f"'{path}' cannot be read: {reason}.", "Give another file.") from error
    if not content:
        raise ClipError(f"'{path}' is empty.", "Export it again.")
    if path.suffix.lower() == ".bvh":
        try:
            check_bvh(content)
        except ClipError as error:
            raise ClipError(f"'{path}': {error.problem}", error.remedy) from error
