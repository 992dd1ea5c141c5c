# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions that go on: a walk of one cycle as long as it is wanted."""

from __future__ import annotations

import bpy

from ..core.errors import ClipError
from .actions import curves_of


def lasting(action: bpy.types.Action, frames: int) -> bpy.types.Action:
    """A copy of an action that lasts so many frames, from where the action begins.

    A shorter action is repeated by Cycles modifiers, as artists do it: each cycle goes on from
    where the one before has led to. A longer one is cut by its manual frame range. Keys stay.

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
            _repeat(curve)
    copy.use_frame_range = True
    copy.frame_start, copy.frame_end = start, start + frames - 1
    copy.use_fake_user = True
    return copy


def _repeat(curve: bpy.types.FCurve) -> None:
    if any(modifier.type == "CYCLES" for modifier in curve.modifiers):
        return
    cycles = curve.modifiers.new("CYCLES")
    assert isinstance(cycles, bpy.types.FModifierCycles)
    # What travels goes on; what does not is back where it was, so this does nothing to it.
    travels = curve.data_path.endswith("location")
    cycles.mode_before = "NONE"
    cycles.mode_after = "REPEAT_OFFSET" if travels else "REPEAT"
