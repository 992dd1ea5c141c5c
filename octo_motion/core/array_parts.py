# SPDX-License-Identifier: GPL-3.0-or-later
"""Some items of a whole dataclass of arrays."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Literal, TypeVar

import numpy as np

_Record = TypeVar("_Record")


def part_of(record: _Record, chosen: np.ndarray | slice, axis: Literal[0, -1] = -1) -> _Record:
    """The same record, of whose arrays only some items are there; what is no array stays.

    Args:
        record: a dataclass of arrays, and of rows of arrays.
        chosen: numbers of the items, or a slice of them.
        axis: along which they are, the same for all of its arrays.
    """
    place = (..., chosen) if axis else chosen

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[place]
        if isinstance(value, list):
            return [part(each) for each in value]
        if isinstance(value, tuple):
            return tuple(part(each) for each in value)
        return value

    whole: Any = record
    return replace(whole, **{each.name: part(getattr(whole, each.name)) for each in fields(whole)})
