# SPDX-License-Identifier: GPL-3.0-or-later
"""Groups of properties as plain data, for JSON."""

from __future__ import annotations

from typing import Any

import bpy

_PASSED = frozenset({"rna_type"})


def plain(group: Any, *, without: frozenset[str] = frozenset()) -> dict[str, Any]:
    """All properties of a group by name: groups become dictionaries, data-blocks their names.

    Args:
        group: any property group.
        without: names that are left out, at every level.
    """
    result: dict[str, Any] = {}
    for definition in group.bl_rna.properties:
        name = definition.identifier
        if name in without or name in _PASSED:
            continue
        value = getattr(group, name)
        if definition.type == "COLLECTION":
            result[name] = [plain(each, without=without) for each in value]
        elif isinstance(value, bpy.types.ID):
            result[name] = value.name
        elif definition.type == "POINTER":
            result[name] = None if value is None else plain(value, without=without)
        elif getattr(definition, "is_array", False):
            result[name] = list(value)
        elif isinstance(value, set):
            result[name] = sorted(value)
        else:
            result[name] = value
    return result
