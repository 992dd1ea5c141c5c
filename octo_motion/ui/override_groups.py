# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of properties in a library override."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np


def make_overridable(armature: bpy.types.Object) -> None:
    """Let a library override keep its settings where the linked object has none.

    Blender 5.2 compares groups of properties with those of the linked object. Where that has
    never had any, it saves an override of the group as a whole, which it cannot read back. A
    group comes into being when it is looked at.
    """
    override = armature.override_library
    if override is not None and isinstance(override.reference, bpy.types.Object):
        _look_at(override.reference.octo_motion)  # type: ignore[attr-defined]


def assign(group: Any, name: str, value: Any) -> None:
    """Set a property only if it differs: in a library override, what is set no longer follows."""
    before = getattr(group, name)
    is_array = isinstance(value, tuple | list | np.ndarray)
    if list(before) != list(value) if is_array else before != value:
        setattr(group, name, value)


def _look_at(group: bpy.types.PropertyGroup) -> None:
    for definition in group.bl_rna.properties:
        if definition.type == "POINTER" and definition.identifier != "rna_type":
            value = getattr(group, definition.identifier)
            if isinstance(value, bpy.types.PropertyGroup):
                _look_at(value)
