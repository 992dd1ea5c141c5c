# SPDX-License-Identifier: GPL-3.0-or-later
"""F-curves that stay as they are, but for stretches of them that get keys of their own.

Outside a stretch a curve plays what it did, between frames too: segments are cut where it begins
and ends, and keys, handles and interpolation of all others are left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import bpy
import numpy as np

from ...core.keyframes import BezierKeys, Stretch, cut_segment, stretch_keys
from ...core.rotations import Floats
from .actions import enum_value
from .fcurves import (
    SAME_FRAME,
    KeyArrays,
    bezier_arrays,
    evaluate_fcurve,
    joined,
    key_range,
    read_keys,
    write_keys,
)

_LOOK: Final = ("auto_smoothing", "color_mode", "color", "extrapolation", "hide", "lock", "mute")
_APPEARANCE: Final = frozenset({"name", "type", "show_expanded", "active", "is_valid"})
"""Properties of a modifier that are not copied: they cannot be set, or change nothing."""

_CLOSE: Final = 8
"""Keys per frame in place of an eased segment that has to be cut."""
_HOLDS: Final = 0.05
"""Frames between two keys at which the first one holds: a hard cut."""
_MOVED: Final = 1e-5
"""Share of a handle's length, or of its value, by which one may be off where it is to stay."""


def copy_curve(source: bpy.types.FCurve, target: bpy.types.FCurve, *, keys: bool = True) -> None:
    """Make a curve what another one is: modifiers, looks, and its keys if they are wanted."""
    if source == target:
        return
    for name in _LOOK:
        if getattr(target, name) != getattr(source, name):
            setattr(target, name, getattr(source, name))
    if keys:
        write_kept_keys(target, keys_of(source))
    for modifier in list(target.modifiers):
        target.modifiers.remove(modifier)
    for modifier in source.modifiers:
        _copy_modifier(modifier, target.modifiers.new(modifier.type))


def keys_of(curve: bpy.types.FCurve) -> KeyArrays:
    """All keys of a curve; of one that was made into samples, straight keys in their place."""
    if len(curve.keyframe_points) or not len(curve.sampled_points):
        return read_keys(curve)
    samples = np.array([each.co[:] for each in curve.sampled_points], dtype=np.float32)
    return straight_keys(samples)


def write_kept_keys(curve: bpy.types.FCurve, keys: KeyArrays) -> None:
    """Make a curve's keys these, with handles where they are.

    Blender works out automatic handles anew, which may hang on all other keys: those that come to
    lie elsewhere are automatic no more.
    """
    write_keys(curve, keys)
    if not (keys.values["interpolation"] == enum_value("interpolation", "BEZIER")).any():
        return
    values = dict(keys.values)
    moved = np.zeros(len(keys), dtype=bool)
    for name in ("handle_left", "handle_right"):
        now = np.empty((len(keys), 2), dtype=np.float32)
        curve.keyframe_points.foreach_get(name, now.ravel())
        reach = np.abs(values[name] - values["co"]) + np.abs(values["co"])
        moved |= (np.abs(now - values[name]) > _MOVED * np.maximum(reach, 1e-3)).any(axis=1)
    if moved.any():
        free = enum_value("handle_left_type", "FREE")
        for name in ("handle_left_type", "handle_right_type"):
            values[name] = np.where(moved, np.uint8(free), values[name])
        write_keys(curve, KeyArrays(values))


def can_be_cut(curve: bpy.types.FCurve, stretches: Sequence[Stretch]) -> bool:
    """Whether a stretch can be replaced: no modifier makes something else of its keys.

    Cycles do so only outside of all keys; then each round has the stretch.
    """
    acting = [each for each in curve.modifiers if not each.mute]
    if not acting:
        return True
    if any(each.type != "CYCLES" for each in acting) or not len(curve.keyframe_points):
        return False
    first, last = key_range(curve)
    return all(
        first - SAME_FRAME < each.frames[0] and each.frames[-1] < last + SAME_FRAME
        for each in stretches
    ) and not (
        (stretches[0].begins and stretches[0].frames[0] > first + SAME_FRAME)
        or (stretches[-1].ends and stretches[-1].frames[-1] < last - SAME_FRAME)
    )


def write_stretches(
    curve: bpy.types.FCurve,
    kept: bpy.types.FCurve | None,
    stretches: Sequence[tuple[Stretch, BezierKeys]],
    component: int,
) -> None:
    """Give a curve the keys of another one, but for stretches of it.

    Args:
        curve: the curve.
        kept: the curve that it is otherwise; none where there is nothing else.
        stretches: in order, and their keys.
        component: of the property, that the curve is of.
    """
    whole = stretches[0][0].begins and stretches[0][0].ends
    keys = KeyArrays.zeros(0) if kept is None or whole else keys_of(kept)
    for stretch, found in stretches:
        piece = _holding(bezier_arrays(found, component))
        if kept is not None and len(keys):
            for frame, is_open in (
                (stretch.frames[0], stretch.begins),
                (stretch.frames[-1], stretch.ends),
            ):
                if not is_open:
                    keys = _cut(keys, kept, float(np.float32(frame)))
        keys = _replaced(keys, piece, stretch)
    write_kept_keys(curve, keys)


def write_baked(
    curve: bpy.types.FCurve,
    kept: bpy.types.FCurve,
    pieces: Sequence[tuple[Floats, Floats]],
    frames: Floats,
    bound: float,
) -> None:
    """The same of a curve that cannot be cut: what it plays at these frames (frames,) as keys.

    Args:
        curve: the curve.
        kept: what it is otherwise.
        pieces: moments and values of each stretch.
        frames: (frames,) ascending; fractions are allowed.
        bound: by how much values may be off in between.
    """
    values = evaluate_fcurve(kept, frames)
    for moments, own in pieces:
        outside = (frames < moments[0] - 1e-6) | (frames > moments[-1] + 1e-6)
        frames = np.concatenate([frames[outside], moments])
        values = np.concatenate([values[outside], own])
        order = np.argsort(frames, kind="stable")
        frames, values = frames[order], values[order]
    whole = Stretch(frames, values[:, None], begins=True, ends=True)
    cuts = [frame for moments, _ in pieces for frame in moments[[0, -1]]]
    for modifier in list(curve.modifiers):
        curve.modifiers.remove(modifier)
    write_keys(curve, _holding(bezier_arrays(stretch_keys(whole, bound, cuts), 0)))


def key_ends(curve: bpy.types.FCurve, first: float, last: float) -> None:
    """See that a curve has keys at two frames: those between which it is to repeat."""
    keys = ended = read_keys(curve)
    for frame in (first, last):
        ended = _cut(ended, curve, frame)
    if len(ended) > len(keys):
        write_kept_keys(curve, ended)


def keep_between(curve: bpy.types.FCurve, first: float, last: float) -> None:
    """Take a curve's keys away outside of two frames, at which it gets keys."""
    keys = read_keys(curve)
    for frame in (first, last):
        keys = _cut(keys, curve, float(np.float32(frame)))
    inside = (keys.frames > first - SAME_FRAME) & (keys.frames < last + SAME_FRAME)
    write_kept_keys(curve, keys.chosen(inside))


def _copy_modifier(source: Any, target: Any) -> None:
    """All that can be set of a modifier; what decides how much else there is comes first."""
    names = [each.identifier for each in source.bl_rna.properties if not each.is_readonly]
    first = [each for each in ("mode", "poly_order") if each in names]
    for name in [*first, *(each for each in names if each not in first)]:
        if name not in _APPEARANCE:
            setattr(target, name, getattr(source, name))
    for point in getattr(source, "control_points", ()):
        made = target.control_points.add(point.frame)
        made.min, made.max = point.min, point.max


def straight_keys(points: np.ndarray) -> KeyArrays:
    """Straight keys at points (keys, 2), as a tool's own."""
    keys = KeyArrays.zeros(len(points))
    values = keys.values
    values["co"][:] = values["handle_left"][:] = values["handle_right"][:] = points
    values["interpolation"][:] = enum_value("interpolation", "LINEAR")
    values["easing"][:] = enum_value("easing", "AUTO")
    values["type"][:] = enum_value("type", "GENERATED")
    for name in ("handle_left_type", "handle_right_type"):
        values[name][:] = enum_value(name, "VECTOR")
    return keys


def _holding(keys: KeyArrays) -> KeyArrays:
    """The same where a key holds its value if the next one is there at once."""
    close = np.append(np.diff(keys.frames) < _HOLDS, False)
    keys.values["interpolation"][close] = enum_value("interpolation", "CONSTANT")
    return keys


# --- Cutting --------------------------------------------------------------------------------------


def _cut(keys: KeyArrays, curve: bpy.types.FCurve, frame: float) -> KeyArrays:
    """The same keys and one at a frame, if there is none: all plays as it did.

    Args:
        keys: those of the curve, or what was made of them.
        curve: the curve.
        frame: where to cut, as Blender keeps it.
    """
    if (np.abs(keys.frames - frame) < SAME_FRAME).any():
        return keys
    at = int(np.searchsorted(keys.frames, frame)) - 1
    kind = keys.values["interpolation"][max(at, 0)]
    known = [enum_value("interpolation", each) for each in ("CONSTANT", "LINEAR", "BEZIER")]
    inside = 0 <= at < len(keys) - 1
    if not inside:
        return _extended(keys, curve, frame, at)
    if kind == known[2]:
        return _cut_bezier(keys, frame, at)
    if kind not in known:
        return _uneased(keys, curve, frame, at)
    (start, first), (end, second) = keys.values["co"][at : at + 2].astype(np.float64)
    share = 0.0 if kind == known[0] else (frame - start) / (end - start)
    new = straight_keys(np.array([[frame, first + share * (second - first)]]))
    new.values["interpolation"][:] = kind
    return _with(keys, new, at + 1)


def _with(keys: KeyArrays, new: KeyArrays, place: int) -> KeyArrays:
    rows = np.arange(len(keys))
    return joined([keys.chosen(rows < place), new, keys.chosen(rows >= place)])


def _extended(keys: KeyArrays, curve: bpy.types.FCurve, frame: float, at: int) -> KeyArrays:
    """A key before all others, or after them."""
    new = straight_keys(np.array([[frame, curve.evaluate(frame)]]))
    if at < 0:
        return _with(keys, new, 0)
    values = {name: each.copy() for name, each in keys.values.items()}
    level = values["handle_right"][-1, 1] == values["co"][-1, 1]
    if not (level and curve.extrapolation == "CONSTANT"):
        values["interpolation"][-1] = enum_value("interpolation", "LINEAR")
    return _with(KeyArrays(values), new, at + 1)


def _cut_bezier(keys: KeyArrays, frame: float, at: int) -> KeyArrays:
    values = {name: each.copy() for name, each in keys.values.items()}
    points, left, right = values["co"], values["handle_left"], values["handle_right"]
    cut = cut_segment(np.stack([points[at], right[at], left[at + 1], points[at + 1]]), frame)
    right[at], left[at + 1] = cut[1], cut[5]
    auto = [enum_value("handle_left_type", each) for each in ("AUTO", "AUTO_CLAMPED")]
    aligned, free = (enum_value("handle_left_type", each) for each in ("ALIGNED", "FREE"))
    for row, side in ((at, "handle_right_type"), (at + 1, "handle_left_type")):
        both = values["handle_left_type"][row], values["handle_right_type"][row]
        if all(each in auto for each in both):
            values["handle_left_type"][row] = values["handle_right_type"][row] = aligned
        elif values[side][row] != aligned:
            values[side][row] = free
    new = straight_keys(cut[3:4])
    new.values["interpolation"][:] = enum_value("interpolation", "BEZIER")
    new.values["handle_left"][:], new.values["handle_right"][:] = cut[2], cut[4]
    for name in ("handle_left_type", "handle_right_type"):
        new.values[name][:] = free
    return _with(KeyArrays(values), new, at + 1)


def _uneased(keys: KeyArrays, curve: bpy.types.FCurve, frame: float, at: int) -> KeyArrays:
    """Straight keys close to each other in place of an eased segment, which no key can divide."""
    start, end = keys.frames[at : at + 2].astype(np.float64)
    grid = np.arange(np.floor(start) * _CLOSE, np.ceil(end) * _CLOSE + 1.0) / _CLOSE
    grid = grid[np.abs(grid - frame) > _HOLDS]
    grid = np.sort(np.append(grid, frame))
    grid = grid[(grid > start + _HOLDS) & (grid < end - _HOLDS)]
    new = straight_keys(np.column_stack([grid, evaluate_fcurve(curve, grid)]))
    values = {name: each.copy() for name, each in keys.values.items()}
    values["interpolation"][at] = enum_value("interpolation", "LINEAR")
    return _with(KeyArrays(values), new, at + 1)


_BEFORE: Final = ("co", "handle_left", "handle_left_type", "type")
"""What of a key belongs to the curve before it, if it is where a stretch begins, …"""
_AFTER: Final = (
    *("co", "handle_right", "handle_right_type", "type"),
    *("interpolation", "easing", "back", "amplitude", "period"),
)
"""… and to the curve behind it, where a stretch ends."""


def _replaced(keys: KeyArrays, piece: KeyArrays, stretch: Stretch) -> KeyArrays:
    """Keys with those of a stretch; where it begins and ends there are keys by now."""
    frames, start, end = keys.frames, float(piece.frames[0]), float(piece.frames[-1])
    values = {name: each.copy() for name, each in piece.values.items()}
    free = enum_value("handle_left_type", "FREE")
    for frame, names, row, is_open in (
        (start, _BEFORE, 0, stretch.begins),
        (end, _AFTER, -1, stretch.ends),
    ):
        near = np.flatnonzero(np.abs(frames - frame) < SAME_FRAME)
        for name in names if len(near) and not is_open else ():
            own = keys.values[name][near[0]]
            values[name][row] = free if name.startswith("handle_") and own.ndim == 0 else own
    early = frames < (-np.inf if stretch.begins else start - SAME_FRAME)
    late = frames > (np.inf if stretch.ends else end + SAME_FRAME)
    return joined([keys.chosen(early), KeyArrays(values), keys.chosen(late)])
