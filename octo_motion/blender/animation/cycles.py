# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions that go on: a walk of one cycle as long as it is wanted."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...core.errors import ClipError
from ...core.rotations import Floats
from .actions import curves_of
from .fcurves import evaluate_fcurve, key_range

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
            f"Action '{action.name}' has only one frame: it cannot be repeated.",
            "Choose an action with keys at two frames or more.",
        )
    copy = action.copy()
    assert copy is not None
    copy.name = f"{action.name} {frames}"
    if start + frames - 1 > end:
        for curve in curves_of(copy):
            _repeat(curve, start, end)
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
