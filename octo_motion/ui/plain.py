# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of properties as plain data, for JSON."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import bpy

_PASSED = frozenset({"rna_type"})

_known: WeakKeyDictionary[type, list[tuple[str, str, bool]]] = WeakKeyDictionary()
"""The properties of each kind of group, as long as it is registered."""


def plain(group: Any, *, without: frozenset[str] = frozenset()) -> dict[str, Any]:
    """All properties of a group by name: groups become dictionaries, data-blocks their names.

    Args:
        group: any property group.
        without: names that are left out, at every level.
    """
    result: dict[str, Any] = {}
    for name, kind, is_array in _properties(type(group), group):
        if name in without:
            continue
        value = getattr(group, name)
        if kind == "COLLECTION":
            result[name] = [plain(each, without=without) for each in value]
        elif isinstance(value, bpy.types.ID):
            result[name] = value.name
        elif kind == "POINTER":
            result[name] = None if value is None else plain(value, without=without)
        elif is_array:
            result[name] = list(value)
        elif isinstance(value, set):
            result[name] = sorted(value)
        else:
            result[name] = value
    return result


def _properties(kind: type, group: Any) -> list[tuple[str, str, bool]]:
    """Name, type and whether it is an array of each property that groups of a kind have.

    Blender takes longer to tell than all of their values.
    """
    if kind not in _known:
        _known[kind] = [
            (each.identifier, each.type, getattr(each, "is_array", False))
            for each in group.bl_rna.properties
            if each.identifier not in _PASSED
        ]
    return _known[kind]
