# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys over a motion that has one on every frame: a layer that comes in and goes out again.

A single key among dense ones is a pose of one frame: it pops. So such keys go to a new action over
the motion, whose values are combined with those below it: as posed at the frame, and nothing some
frames before and after.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import bpy
import numpy as np

from .actions import curves_of, key_points
from .poses import AT_REST

BLENDING: Final = "octo_motion_blends"
"""Custom property of such an action: over how many frames it comes in, and goes out."""

_NEAR: Final = 3.0
"""Frames before and after in which keys are counted, …"""
_DENSE: Final = 1.5
"""… and the distance of keys on either side, in frames, up to which they are dense."""
_SAME: Final = 1e-3
"""Frames by which a key may be off a frame and still be at it."""
_NOTHING: Final = 1e-6
"""By which values are off those that change nothing."""


def bone_paths(bones: Iterable[str]) -> tuple[str, ...]:
    """How the data paths of bones begin."""
    return tuple(f'pose.bones["{bpy.utils.escape_identifier(each)}"]' for each in bones)


def is_dense(
    action: bpy.types.Action, slot: bpy.types.ActionSlot, starts: tuple[str, ...], frame: float
) -> bool:
    """Whether curves whose data paths begin in one of some ways have keys on all frames about one,
    on both sides.
    """
    for curve in curves_of(action, slot):
        if not curve.data_path.startswith(starts) or len(curve.keyframe_points) < 2 * _NEAR:
            continue
        times = key_points(curve)[:, 0].astype(np.float64) - frame
        beside = times[np.abs(times) > _SAME]
        before, after = beside[beside < 0.0], beside[beside > 0.0]
        close = len(before) and len(after) and max(-before.max(), after.min()) <= _DENSE
        if close and (np.abs(beside) <= _NEAR).sum() >= 2 * _NEAR - 2:
            return True
    return False


def blend_about(
    action: bpy.types.Action, slot: bpy.types.ActionSlot, paths: Iterable[str], frame: float
) -> None:
    """Let the keys of properties at a frame come in and go out over the action's own frames.

    Where another pose stands within these, it goes on from one to the other.
    """
    length, wanted = float(action[BLENDING]), set(paths)
    for curve in curves_of(action, slot):
        if curve.data_path not in wanted or curve.lock or (curve.group and curve.group.lock):
            continue
        nothing = AT_REST[curve.data_path.rpartition(".")[2]][curve.array_index]
        for side in (-1.0, 1.0):
            _pass_over(curve, frame, side * length, nothing, wanted_at=_posed(action, slot, curve))


def _posed(
    action: bpy.types.Action, slot: bpy.types.ActionSlot, curve: bpy.types.FCurve
) -> set[float]:
    """Frames at which the property of a curve is posed: some component is not at rest."""
    found: set[float] = set()
    for each in curves_of(action, slot):
        if each.data_path != curve.data_path:
            continue
        nothing = AT_REST[each.data_path.rpartition(".")[2]][each.array_index]
        points = key_points(each)
        found |= {float(time) for time, value in points if abs(value - nothing) > _NOTHING}
    return found


def _pass_over(
    curve: bpy.types.FCurve, frame: float, length: float, nothing: float, wanted_at: set[float]
) -> None:
    """On one side of a frame: no key that means nothing up to the end, and one there."""
    low, high = sorted((frame, frame + length))
    between = [each for each in wanted_at if low - _SAME <= each <= high + _SAME]
    if any(abs(each - frame) > _SAME for each in between):
        reach = min(abs(each - frame) for each in between if abs(each - frame) > _SAME)
        low, high = sorted((frame, frame + np.sign(length) * reach))
    points = curve.keyframe_points
    for number in reversed(range(len(points))):
        time = points[number].co[0]
        inside = low + _SAME < time < high - _SAME
        if inside and abs(points[number].co[1] - nothing) <= _NOTHING:
            points.remove(points[number], fast=True)
    if all(abs(each - frame) <= _SAME for each in between):
        points.insert(frame + length, nothing)
    curve.update()
