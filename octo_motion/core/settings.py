# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings declared once: default, bounds and words of what an artist sets, beside the field of
the dataclass that core reads.

Core checks the values against what is declared here; the panel's property, and the reader that
makes the dataclass from properties, are made from it (ui/declared_settings.py). A field that is not
declared is no setting: it is worked out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, Final

import numpy as np

from .errors import SettingsError
from .phrases import as_phrase, phrase

_KEY: Final = "setting"


@dataclass(frozen=True)
class Setting:
    """What is declared of one setting; angles in radians."""

    label: str
    """What it is called in the panel."""
    description: str
    """What it does: the tooltip."""
    default: Any
    """What the field is if it is not given."""
    offered: Any = None
    """What an artist begins with, if that is not the default, which leaves a step out."""
    stored_as: str = ""
    """Name of the property that scripts and files know, if it is not the field's."""
    low: float | None = None
    high: float | None = None
    """Bounds that are kept, inclusive, …"""
    soft_low: float | None = None
    soft_high: float | None = None
    """… and those that a slider has."""
    step: int | None = None
    """Hundredths by which an arrow of the slider changes it."""
    precision: int | None = None
    """Digits that are shown after the point."""
    subtype: str = "NONE"
    """What kind of number it is, in Blender's word: "FACTOR", "ANGLE"."""
    items: tuple[tuple[str, str, str, int], ...] = ()
    """Of a choice: identifier, label, description and number of each."""
    digits: int | None = None
    """Digits after the point that count. Properties are single precision; where something is
    counted from a setting, 0.55 has to be 0.55."""


def setting(label: str, description: str, *, default: Any, **more: Any) -> Any:
    """The field of a dataclass that is a setting; what ``more`` may say is in :class:`Setting`."""
    return field(default=default, metadata={_KEY: Setting(label, description, default, **more)})


share_setting: Final = partial(setting, low=0.0, high=1.0, subtype="FACTOR")
"""The same of a share, from 0 to 1."""


def declared_settings(kind: type) -> dict[str, Setting]:
    """The settings of a dataclass by the names of its fields."""
    return {each.name: each.metadata[_KEY] for each in fields(kind) if _KEY in each.metadata}


def check_settings(settings: Any) -> None:
    """Check that all numbers of a dataclass are finite, and its settings within their bounds.

    Raises:
        SettingsError: one is not.
    """
    for each in fields(settings):
        value, declared = getattr(settings, each.name), each.metadata.get(_KEY)
        if not isinstance(value, float | int | tuple):
            continue
        known = np.all(np.isfinite(value)) if isinstance(value, tuple) else math.isfinite(value)
        low, high = (declared.low, declared.high) if declared else (None, None)
        if known and (low is None or value >= low) and (high is None or value <= high):
            continue
        label = as_phrase(declared.label if declared else _title(each.name))
        if not known:
            raise SettingsError(phrase("{label} is not a number.", label=label), "Set it anew.")
        raise SettingsError(
            phrase("{label} is {value:g}.", label=label, value=value), _remedy(low, high)
        )


def _title(name: str) -> str:
    return name.replace("_", " ").capitalize()


def _remedy(low: float | None, high: float | None) -> str:
    if high is None:
        return phrase("Give {low:g} or more.", low=low)
    return (
        phrase("Give {high:g} or less.", high=high)
        if low is None
        else phrase("Give a value from {low:g} to {high:g}.", low=low, high=high)
    )
