# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of settings in library overrides."""

from __future__ import annotations

from typing import Any

import bpy


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
