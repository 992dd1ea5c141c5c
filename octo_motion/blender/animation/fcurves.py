# SPDX-License-Identifier: GPL-3.0-or-later
"""F-curves to arrays: the values that Blender would show, many frames at once."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...core.rotations import Floats

_SAME_FRAME: Final = 1e-4
"""Frames by which Blender lets a time miss a key and still takes the key's value."""


def evaluate_fcurve(curve: bpy.types.FCurve, frames: Floats) -> Floats:
    """The values (frames,) of one F-curve at these frames, subframes included.

    Straight and stepped keys are read in bulk, and so are values that are asked for where a key is.
    Whatever else there is (between Bézier and eased keys, modifiers, sampled curves) Blender
    evaluates itself.
    """
    keys = _plain_keys(curve)
    if keys is None:
        values = _at_keys(curve, frames)
        if values is not None:
            return values
        return np.array([curve.evaluate(float(frame)) for frame in frames])
    times, values, steps = keys
    result = np.interp(frames, times, values)
    if steps.any():
        at = np.searchsorted(times, frames + _SAME_FRAME, side="right") - 1
        held = (at >= 0) & steps[np.maximum(at, 0)]
        result[held] = values[at[held]]
    if curve.extrapolation == "LINEAR" and len(times) > 1:
        # A stepped end goes on level, as the step itself does.
        for outside, first, second in ((frames < times[0], 0, 1), (frames > times[-1], -1, -2)):
            if not steps[first]:
                slope = (values[second] - values[first]) / (times[second] - times[first])
                result[outside] = values[first] + slope * (frames[outside] - times[first])
    return result


def key_range(curve: bpy.types.FCurve) -> tuple[float, float]:
    """First and last frame of a curve's keys, whatever its modifiers do outside."""
    start, end = curve.range()
    return float(start), float(end)


def is_shown(curve: bpy.types.FCurve) -> bool:
    """Whether Blender lets the curve act; a muted group alone silences nothing."""
    return not (curve.mute or curve.is_empty)


def _plain_keys(curve: bpy.types.FCurve) -> tuple[Floats, Floats, np.ndarray] | None:
    """Times, values and whether each key holds its value until the next, all (keys,)."""
    count = len(curve.keyframe_points)
    if count == 0 or len(curve.modifiers):
        return None
    kinds = np.empty(count, dtype=np.uint8)
    curve.keyframe_points.foreach_get("interpolation", kinds)
    steps = kinds == _CONSTANT
    # The last key's own interpolation matters to extrapolation only.
    if not (steps | (kinds == _LINEAR)).all():
        return None
    points = np.empty(2 * count, dtype=np.float32)
    curve.keyframe_points.foreach_get("co", points)
    times, values = points.reshape(-1, 2).T.astype(np.float64)
    if (np.diff(times) <= _SAME_FRAME).any():
        return None
    return times, values, steps


def _at_keys(curve: bpy.types.FCurve, frames: Floats) -> Floats | None:
    """Values at frames that have keys, all of them; else none."""
    count = len(curve.keyframe_points)
    if count == 0 or len(curve.modifiers) or not len(frames):
        return None
    points = np.empty(2 * count, dtype=np.float32)
    curve.keyframe_points.foreach_get("co", points)
    times, values = points.reshape(-1, 2).T.astype(np.float64)
    if (np.diff(times) <= 2.0 * _SAME_FRAME).any():
        return None
    nearest = np.searchsorted(0.5 * (times[1:] + times[:-1]), frames)
    return values[nearest] if np.all(np.abs(times[nearest] - frames) <= 1e-6) else None


def _kind(name: str) -> int:
    definition = bpy.types.Keyframe.bl_rna.properties["interpolation"]
    assert isinstance(definition, bpy.types.EnumProperty)
    return definition.enum_items[name].value


_CONSTANT: Final = _kind("CONSTANT")
_LINEAR: Final = _kind("LINEAR")
