# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties made from the settings that core declares, and core's dataclasses from properties."""

from __future__ import annotations

from collections.abc import Callable, Container
from functools import partial
from itertools import chain, count
from typing import Any, Final, TypeVar
from weakref import WeakKeyDictionary

import bpy
import numpy as np
from bpy import props

from ..blender.rig import linked_names
from ..core.settings import Setting, declared_settings
from .language import OWN

BoolProperty: Final = partial(
    props.BoolProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
EnumProperty: Final = partial(
    props.EnumProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
FloatProperty: Final = partial(
    props.FloatProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
FloatVectorProperty: Final = partial(
    props.FloatVectorProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
AngleProperty: Final = partial(FloatProperty, subtype="ANGLE", step=500, precision=1)
FactorProperty: Final = partial(FloatProperty, subtype="FACTOR", min=0.0, max=1.0)
IntProperty: Final = partial(
    props.IntProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
PointerProperty: Final = partial(
    props.PointerProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
StringProperty: Final = partial(
    props.StringProperty, override={"LIBRARY_OVERRIDABLE"}, translation_context=OWN
)
CollectionProperty: Final = partial(
    props.CollectionProperty,
    override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    translation_context=OWN,
)


def is_of(types: Container[str]) -> Callable[[Any, Any], bool]:
    """What lets a pointer offer objects of these types alone."""
    return lambda _owner, candidate: candidate.type in types


# --- Groups of properties in a library override ---------------------------------------------------


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


def free_name(items: Any, name: str) -> str:
    """A name like this that no item of a list has: Blender numbers its own names so as well."""
    taken = {each.name for each in items}
    numbered = (f"{name}.{number:03}" for number in count(1))
    return next(each for each in chain((name,), numbered) if each not in taken)


def emptied(group: Any, name: str) -> list[Any]:
    """Take all items off a list but those that a library override has from its linked file.

    Those can be changed, but not removed.

    Returns:
        the items that stay.
    """
    items, linked = getattr(group, name), linked_names(group, name)
    for number in reversed(range(len(items))):
        if items[number].name not in linked:
            items.remove(number)
    return list(items)


def _look_at(group: bpy.types.PropertyGroup) -> None:
    for definition in group.bl_rna.properties:
        if definition.type == "POINTER" and definition.identifier != "rna_type":
            value = getattr(group, definition.identifier)
            if isinstance(value, bpy.types.PropertyGroup):
                _look_at(value)


# --- Properties made from the settings that core declares, and core's dataclasses from properties -


Settings = TypeVar("Settings")


def declared(kind: type, field: str) -> Any:
    """The property of a setting that a dataclass declares by that name; its own is the one it is
    stored as.
    """
    setting = declared_settings(kind)[field]
    default = setting.default if setting.offered is None else setting.offered
    told: dict[str, Any] = {
        "name": setting.label,
        "description": setting.description,
        "default": default,
    }
    if setting.items:
        return EnumProperty(items=setting.items, **told)
    if isinstance(default, bool):
        return BoolProperty(**told)
    bounds = {
        "min": setting.low,
        "max": setting.high,
        "soft_min": setting.soft_low,
        "soft_max": setting.soft_high,
        "step": setting.step,
        "precision": setting.precision,
    }
    told |= {name: value for name, value in bounds.items() if value is not None}
    if isinstance(default, int):
        return IntProperty(**told)
    told["subtype"] = setting.subtype
    return FloatProperty(**told)


def read_settings(kind: type[Settings], group: Any, **worked_out: Any) -> Settings:
    """Core's settings, as a group of properties has them.

    Worked out are the fields that are no settings, and settings that do not count here.
    """
    own = {
        name: _value(getattr(group, each.stored_as or name), each)
        for name, each in declared_settings(kind).items()
        if name not in worked_out
    }
    return kind(**own, **worked_out)


def _value(value: Any, setting: Setting) -> Any:
    """A property's value without what single precision has added to it."""
    if not isinstance(value, float):
        return value
    if setting.digits is not None:
        value = round(value, setting.digits)
    # A bound such as 0.8 is a little more as a property.
    if setting.low is not None:
        value = max(value, setting.low)
    return value if setting.high is None else min(value, setting.high)


# --- Groups of properties as plain data, for JSON -------------------------------------------------


_known: WeakKeyDictionary[type, list[tuple[str, str, bool]]] = WeakKeyDictionary()
"""The properties of each kind of group, as long as it is registered."""


_SIMPLE: Final = frozenset({"BOOLEAN", "INT", "FLOAT", "STRING"})


def plain(group: Any, *, without: frozenset[str] = frozenset()) -> dict[str, Any]:
    """All properties of a group by name: groups become dictionaries, data-blocks their names.

    Some names are left out, at every level.
    """
    result: dict[str, Any] = {}
    for name, kind, is_array in _properties(type(group), group):
        if name in without:
            continue
        value = getattr(group, name)
        if kind in _SIMPLE and not is_array:
            result[name] = value
        elif kind == "COLLECTION":
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
            if each.identifier != "rna_type"
        ]
    return _known[kind]
