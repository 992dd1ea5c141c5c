# SPDX-License-Identifier: GPL-3.0-or-later
"""F-curves and their keys as arrays: the values that Blender would show, and what the keys are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import bpy
import numpy as np

from ...core.errors import ClipError
from ...core.keyframes import BezierKeys, segment_values
from ...core.phrases import phrase
from ...core.rotations import Floats
from .actions import curves_of, enum_value, key_points

_WHOLE: Final = 1e-3
"""Frames by which importers miss whole ones."""

_ON_KEY: Final = 1e-4
"""Frames by which Blender lets a time miss a key and still takes the key's value."""


def evaluate_fcurve(curve: bpy.types.FCurve, frames: Floats) -> Floats:
    """The values (frames,) of one F-curve at these frames, subframes included.

    Straight, stepped and Bézier keys are read in bulk. Whatever else there is (between eased keys,
    modifiers, sampled curves) Blender evaluates itself.
    """
    keys = _readable_keys(curve)
    if keys is None:
        return np.array([curve.evaluate(float(frame)) for frame in frames])
    times, values, kinds = keys
    straight = (kinds == enum_value("interpolation", "LINEAR")).all()
    if straight and curve.extrapolation == "CONSTANT":
        return np.interp(frames, times, values)
    asked = _at_keys(times, values, frames)
    if asked is not None:
        return asked
    result = np.interp(frames, times, values)
    at = np.searchsorted(times, frames + _ON_KEY, side="right") - 1
    own = np.where(at >= 0, kinds[np.maximum(at, 0)], enum_value("interpolation", "LINEAR"))
    held = own == enum_value("interpolation", "CONSTANT")
    result[held] = values[at[held]]
    within = (at < len(times) - 1) & (np.abs(times[np.maximum(at, 0)] - frames) > _ON_KEY)
    curved = within & (own == enum_value("interpolation", "BEZIER"))
    if curved.any():
        result[curved] = segment_values(_segments(curve)[at[curved]], frames[curved])
    strange = within & ~np.isin(own, _read_in_bulk())
    if curve.extrapolation == "LINEAR" and len(times) > 1:
        strange |= (frames < times[0]) | (frames > times[-1])
    for place in np.flatnonzero(strange):
        result[place] = curve.evaluate(float(frames[place]))
    return result


def key_range(curve: bpy.types.FCurve) -> tuple[float, float]:
    """First and last frame of a curve's keys, whatever its modifiers do outside."""
    start, end = curve.range()
    return float(start), float(end)


def goes_straight(curve: bpy.types.FCurve, off: float = 0.0) -> bool:
    """Whether a curve goes straight from whole frame to whole frame, as recorded motions do, or
    between frames that are so much ``off`` these.
    """
    keys = _readable_keys(curve)
    if keys is None:
        return False
    times, _, kinds = keys
    straight = (kinds == enum_value("interpolation", "LINEAR")).all()
    return bool(straight and np.abs(times - off - np.round(times - off)).max() < _WHOLE)


@cache
def _read_in_bulk() -> tuple[int, ...]:
    return tuple(enum_value("interpolation", each) for each in ("CONSTANT", "LINEAR", "BEZIER"))


def _readable_keys(curve: bpy.types.FCurve) -> tuple[Floats, Floats, np.ndarray] | None:
    """Times, values and kinds of interpolation, all (keys,), where nothing but keys counts."""
    count = len(curve.keyframe_points)
    if count == 0 or len(curve.modifiers):
        return None
    kinds = np.empty(count, dtype=np.uint8)
    curve.keyframe_points.foreach_get("interpolation", kinds)
    times, values = key_points(curve).T.astype(np.float64)
    if (np.diff(times) <= _ON_KEY).any():
        return None
    return times, values, kinds


def _segments(curve: bpy.types.FCurve) -> Floats:
    """From each key to the next one (keys − 1, 4, 2): key, handle, handle, key."""
    keys, left, right = (
        key_points(curve, name).astype(np.float64) for name in ("co", "handle_left", "handle_right")
    )
    return np.stack([keys[:-1], right[:-1], left[1:], keys[1:]], axis=1)


def _at_keys(times: Floats, values: Floats, frames: Floats) -> Floats | None:
    """Values at frames that have keys, all of them; else none."""
    if not len(frames) or (np.diff(times) <= 2.0 * _ON_KEY).any():
        return None
    nearest = np.searchsorted(0.5 * (times[1:] + times[:-1]), frames)
    return values[nearest] if np.all(np.abs(times[nearest] - frames) <= 1e-6) else None


# --- All that an F-curve's keys are, as arrays: to keep, to put back, and to replace a stretch of


_VECTORS: Final = ("co", "handle_left", "handle_right")
_NUMBERS: Final = ("back", "amplitude", "period")
_KINDS: Final = (
    *("interpolation", "easing", "type"),
    *("handle_left_type", "handle_right_type"),
)
_FLAGS: Final = ("select_control_point", "select_left_handle", "select_right_handle")

SAME_FRAME: Final = 0.01
"""Frames by which keys must be apart."""


@dataclass(frozen=True, eq=False)
class KeyArrays:
    """The keys of one curve: by property an array with a row for each key."""

    values: dict[str, np.ndarray]

    @classmethod
    def zeros(cls, count: int) -> KeyArrays:
        """So many keys, all of whose numbers are 0."""
        kinds = {
            **dict.fromkeys(_NUMBERS, np.float32),
            **dict.fromkeys(_KINDS, np.uint8),
            **dict.fromkeys(_FLAGS, np.bool_),
        }
        values = {name: np.zeros((count, 2), dtype=np.float32) for name in _VECTORS}
        return cls(values | {name: np.zeros(count, dtype=kind) for name, kind in kinds.items()})

    def __len__(self) -> int:
        return len(self.values["co"])

    @property
    def frames(self) -> np.ndarray:
        """Frames (keys,) of the keys."""
        return self.values["co"][:, 0]

    def chosen(self, rows: np.ndarray) -> KeyArrays:
        return KeyArrays({name: values[rows] for name, values in self.values.items()})


def joined(parts: Sequence[KeyArrays]) -> KeyArrays:
    """Keys one after the other."""
    names = parts[0].values
    return KeyArrays(
        {name: np.concatenate([each.values[name] for each in parts]) for name in names}
    )


def read_keys(curve: bpy.types.FCurve) -> KeyArrays:
    """All keys of a curve."""
    keys = KeyArrays.zeros(len(curve.keyframe_points))
    for name, each in keys.values.items():
        curve.keyframe_points.foreach_get(name, each.ravel())
    return keys


def write_keys(curve: bpy.types.FCurve, keys: KeyArrays) -> None:
    """Make a curve's keys these and no others."""
    points = curve.keyframe_points
    points.clear()
    if len(keys):
        points.add(len(keys))
    for name, each in keys.values.items():
        # Most of it is as new keys have it, and need not be said again.
        if name in _VECTORS or (len(keys) and (each != _as_new(points[0], name)).any()):
            points.foreach_set(name, np.ascontiguousarray(each).ravel())
    curve.update()


def _as_new(key: bpy.types.Keyframe, name: str) -> float:
    value = getattr(key, name)
    return enum_value(name, value) if name in _KINDS else value


def bezier_arrays(keys: BezierKeys, component: int) -> KeyArrays:
    """Reduced keys of one component, as a tool's own."""
    aligned, free = (enum_value("handle_left_type", item) for item in ("ALIGNED", "FREE"))
    result = KeyArrays.zeros(len(keys))
    values = result.values
    values["co"][:] = np.column_stack([keys.frames, keys.values[:, component]])
    values["handle_left"][:], values["handle_right"][:] = (
        keys.left[:, component],
        keys.right[:, component],
    )
    for name, item in (("interpolation", "BEZIER"), ("easing", "AUTO"), ("type", "GENERATED")):
        values[name][:] = enum_value(name, item)
    for name in ("handle_left_type", "handle_right_type"):
        values[name][:] = np.where(keys.smooth, aligned, free)
    return result


def replace_stretch(curve: bpy.types.FCurve, keys: KeyArrays) -> None:
    """Put keys into a curve in place of those that it has between the first and last of them."""
    before = read_keys(curve)
    start, end = float(keys.frames[0]), float(keys.frames[-1])
    early = before.chosen(before.frames < start - SAME_FRAME)
    late = before.chosen(before.frames > end + SAME_FRAME)
    write_keys(curve, joined([early, keys, late]))


# --- Actions that go on: a walk of one cycle as long as it is wanted ------------------------------


_SAME: Final = 0.01
"""Frames by which keys may miss the first and last frame of an action."""


def lasting(action: bpy.types.Action, frames: int) -> bpy.types.Action:
    """A copy of an action that lasts so many frames, from where the action begins.

    A shorter action is repeated by Cycles modifiers, as artists do it: each cycle goes on from
    where the one before has led to. A longer one is cut by its manual frame range. Keys stay, but
    for curves to be repeated that do not last as long as the action: they get one on each frame.

    Raises:
        ClipError: it has no keys at two frames.
    """
    start, end = action.frame_range
    if end - start < 0.5:
        raise ClipError(
            phrase(
                "Action '{action}' has only one frame: it cannot be repeated.", action=action.name
            ),
            "Choose an action with keys at two frames or more.",
        )
    copy = action.copy()
    assert copy is not None
    copy.name = f"{action.name} {frames}"
    if start + frames - 1 > end:
        for curve in curves_of(copy):
            _repeat(curve, start, end)
    # Cut elsewhere it is a cycle no more.
    rounds = (frames - 1) / (end - start)
    copy.use_cyclic = copy.use_cyclic and abs(rounds - round(rounds)) < _SAME
    copy.use_frame_range = True
    copy.frame_start, copy.frame_end = start, start + frames - 1
    copy.use_fake_user = True
    return copy


def _repeat(curve: bpy.types.FCurve, start: float, end: float) -> None:
    if any(modifier.type == "CYCLES" for modifier in curve.modifiers):
        return
    # Each curve repeats what lies between its own first and last key.
    own = key_range(curve)
    lasts = max(abs(own[0] - start), abs(own[1] - end)) < _SAME
    if not (lasts or len(curve.modifiers) or len(curve.keyframe_points) < 2):
        _set_anew(curve, np.unique([*np.arange(start, end), end]))
    cycles = curve.modifiers.new("CYCLES")
    assert isinstance(cycles, bpy.types.FModifierCycles)
    # What travels goes on; what does not is back where it was, so this does nothing to it.
    travels = curve.data_path.endswith("location")
    cycles.mode_before = "NONE"
    cycles.mode_after = "REPEAT_OFFSET" if travels else "REPEAT"


def _set_anew(curve: bpy.types.FCurve, frames: Floats) -> None:
    """Give a curve keys at these frames in place of its own."""
    points = np.column_stack([frames, evaluate_fcurve(curve, frames)]).astype(np.float32)
    keys = curve.keyframe_points
    keys.clear()
    keys.add(len(frames))
    keys.foreach_set("co", points.ravel())
    for key in keys:
        key.interpolation = "LINEAR"
    curve.update()
