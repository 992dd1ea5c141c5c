# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties made from the settings that core declares, and core's dataclasses from properties."""

from __future__ import annotations

from typing import Any, TypeVar

from ..core.settings import Setting, declared_settings
from .overridable import BoolProperty, EnumProperty, FloatProperty, IntProperty

Settings = TypeVar("Settings")


def declared(kind: type, field: str) -> Any:
    """The property of a setting.

    Args:
        kind: the dataclass that declares it.
        field: its name there; the property's own is the one that it is stored as.
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

    Args:
        kind: the dataclass.
        group: the properties.
        worked_out: the fields that are no settings, and settings that do not count here.
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
