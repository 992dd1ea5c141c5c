# SPDX-License-Identifier: GPL-3.0-or-later
"""All that an F-curve's keys are, as arrays: to keep, to put back, and to replace a stretch of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np

from ...core.keyframes import BezierKeys

_VECTORS: Final = ("co", "handle_left", "handle_right")
_NUMBERS: Final = ("back", "amplitude", "period")
_KINDS: Final = (
    *("interpolation", "easing", "type"),
    *("handle_left_type", "handle_right_type"),
)
_FLAGS: Final = ("select_control_point", "select_left_handle", "select_right_handle")

_SAME_FRAME: Final = 0.01
"""Frames by which keys must be apart."""


@dataclass(frozen=True, eq=False)
class KeyArrays:
    """The keys of one curve: by property an array with a row for each key."""

    values: dict[str, np.ndarray]

    def __len__(self) -> int:
        """Number of keys."""
        return len(self.values["co"])

    @property
    def frames(self) -> np.ndarray:
        """Frames (keys,) of the keys."""
        return self.values["co"][:, 0]

    def chosen(self, rows: np.ndarray) -> KeyArrays:
        """Some of the keys."""
        return KeyArrays({name: values[rows] for name, values in self.values.items()})


def read_keys(curve: bpy.types.FCurve) -> KeyArrays:
    """All keys of a curve."""
    points = curve.keyframe_points
    count = len(points)
    values: dict[str, np.ndarray] = {}
    for name in _VECTORS:
        values[name] = np.empty((count, 2), dtype=np.float32)
    for name in _NUMBERS:
        values[name] = np.empty(count, dtype=np.float32)
    for name in _KINDS:
        values[name] = np.empty(count, dtype=np.uint8)
    for name in _FLAGS:
        values[name] = np.empty(count, dtype=bool)
    for name, each in values.items():
        points.foreach_get(name, each.ravel())
    return KeyArrays(values)


def write_keys(curve: bpy.types.FCurve, keys: KeyArrays) -> None:
    """Make a curve's keys these and no others."""
    points = curve.keyframe_points
    points.clear()
    if len(keys):
        points.add(len(keys))
    for name, each in keys.values.items():
        points.foreach_set(name, np.ascontiguousarray(each).ravel())
    curve.update()


def bezier_arrays(keys: BezierKeys, component: int) -> KeyArrays:
    """Reduced keys of one component, as a tool's own."""
    count = len(keys)
    aligned, free = (_kind("handle_left_type", item) for item in ("ALIGNED", "FREE"))
    kinds = np.where(keys.smooth, aligned, free).astype(np.uint8)
    return KeyArrays(
        {
            "co": np.column_stack([keys.frames, keys.values[:, component]]).astype(np.float32),
            "handle_left": np.ascontiguousarray(keys.left[:, component], dtype=np.float32),
            "handle_right": np.ascontiguousarray(keys.right[:, component], dtype=np.float32),
            "back": np.zeros(count, dtype=np.float32),
            "amplitude": np.zeros(count, dtype=np.float32),
            "period": np.zeros(count, dtype=np.float32),
            "interpolation": np.full(count, _kind("interpolation", "BEZIER"), dtype=np.uint8),
            "easing": np.full(count, _kind("easing", "AUTO"), dtype=np.uint8),
            "type": np.full(count, _kind("type", "GENERATED"), dtype=np.uint8),
            "handle_left_type": kinds,
            "handle_right_type": kinds.copy(),
            "select_control_point": np.zeros(count, dtype=bool),
            "select_left_handle": np.zeros(count, dtype=bool),
            "select_right_handle": np.zeros(count, dtype=bool),
        }
    )


def replace_stretch(curve: bpy.types.FCurve, keys: KeyArrays) -> None:
    """Put keys into a curve in place of those that it has between the first and last of them."""
    before = read_keys(curve)
    start, end = float(keys.frames[0]), float(keys.frames[-1])
    early = before.chosen(before.frames < start - _SAME_FRAME)
    late = before.chosen(before.frames > end + _SAME_FRAME)
    write_keys(
        curve,
        KeyArrays(
            {
                name: np.concatenate([early.values[name], keys.values[name], late.values[name]])
                for name in keys.values
            }
        ),
    )


def _kind(name: str, item: str) -> int:
    definition = bpy.types.Keyframe.bl_rna.properties[name]
    assert isinstance(definition, bpy.types.EnumProperty)
    return definition.enum_items[item].value
