# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own settings of keying: which channels get a key, and under which conditions."""

from __future__ import annotations

from typing import Final

import bpy

from .unkeyed import rotation_channel

_SETS: Final[tuple[tuple[str, str], ...]] = (
    ("Loc", "location"),
    ("Rot", "rotation"),
    ("Scal", "scale"),
)
"""Parts of the names of Blender's own keying sets, and what they key."""


def options(scene: bpy.types.Scene, *, auto: bool) -> set[str]:
    """The artist's settings of keying, those of Insert Keyframe or of auto keying."""
    preferences = bpy.context.preferences
    assert preferences is not None
    assert scene.tool_settings is not None
    found: set[str] = set()
    edit = preferences.edit
    if edit.use_auto_keyframe_insert_needed if auto else edit.use_keyframe_insert_needed:
        found.add("INSERTKEY_NEEDED")
    if auto and edit.use_keyframe_insert_available:
        found.add("INSERTKEY_AVAILABLE")
    if auto and scene.tool_settings.auto_keying_mode == "REPLACE_KEYS":
        found.add("INSERTKEY_REPLACE")
    if edit.use_visual_keying:
        found.add("INSERTKEY_VISUAL")
    if scene.tool_settings.use_keyframe_cycle_aware:
        found.add("INSERTKEY_CYCLE_AWARE")
    return found


def key_type(scene: bpy.types.Scene) -> str:
    """The kind of keys that the timeline is set to."""
    assert scene.tool_settings is not None
    return scene.tool_settings.keyframe_type


def with_set(options: set[str], active: bpy.types.KeyingSet | None) -> set[str]:
    """The options, with what a keying set says of them."""
    if active is None:
        return options
    result = set(options)
    for own, option in (("needed", "INSERTKEY_NEEDED"), ("visual", "INSERTKEY_VISUAL")):
        if getattr(active, f"use_insertkey_override_{own}"):
            result.discard(option)
            result |= {option} if getattr(active, f"use_insertkey_{own}") else set()
    if active.bl_idname == "Available":
        result.add("INSERTKEY_AVAILABLE")
    elif active.type_info is not None and "Visual" in active.bl_idname:
        result.add("INSERTKEY_VISUAL")
    return result


def channels(
    bone: bpy.types.PoseBone, active: bpy.types.KeyingSet | None, *, placed: bool
) -> list[str]:
    """Properties of a bone that get a key."""
    rotation = rotation_channel(bone.rotation_mode)
    if active is not None:
        name = active.bl_idname
        if name.startswith(("Available", "WholeCharacter")):
            return ["location", rotation, "scale"]
        found = [channel for part, channel in _SETS if part in name and "Delta" not in name]
        if found:
            return [rotation if each == "rotation" else each for each in found]
    return ["location", rotation] if placed else [rotation]
