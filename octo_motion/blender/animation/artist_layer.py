# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist keys over a generated motion: a layer, which stays when the motion is made anew.

The motion becomes a strip of the NLA, and the armature plays a new action over it whose values are
combined with it: nothing until something is keyed. When the motion is made anew its strip follows,
and keys of the layer go with the cycle that they were set in.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import bpy
import numpy as np

from ...core.errors import WriteError
from ...core.phrases import phrase
from ...core.rotations import Floats
from .actions import MARK, curves_of, new_action
from .splice_layer import fit_strip, make_strip

LAYER: Final = "octo_motion_edits"
"""Custom property of such an action."""
CYCLES: Final = "octo_motion_cycles"
"""Custom property of a motion: the frames of its cycles' quarters."""
_WHOLE: Final = 1e-3
"""Frames by which a key may be off a frame and be on it."""


def edit_layer(armature: bpy.types.Object, motion: bpy.types.Action) -> bpy.types.Action | None:
    """The layer that an armature plays over a motion, none if it does not."""
    data = armature.animation_data
    if data is None or data.action is None or LAYER not in data.action:
        return None
    return data.action if _strip(data, motion) is not None else None


def is_layer(action: bpy.types.Action | None) -> bool:
    """Whether an action was made to lie over a motion."""
    return action is not None and LAYER in action


def lay_edits(armature: bpy.types.Object, motion: bpy.types.Action) -> bpy.types.Action:
    """Let an armature play a motion as a strip, and a new layer over it; the layer.

    Raises:
        WriteError: the NLA is switched off.
    """
    data = armature.animation_data or armature.animation_data_create()
    assert data is not None
    if not data.use_nla:
        raise WriteError(
            phrase(
                "The NLA of '{armature}' is switched off: no layer would be seen.",
                armature=armature.name,
            ),
            "Switch it on in the NLA editor.",
        )
    layer = new_action(armature, f"{armature.name} Edits")
    layer[LAYER] = motion.name
    if _strip(data, motion) is None:
        track = data.nla_tracks.new()
        track.name = motion.name
        motion[MARK]["track"] = track.name
        make_strip(track, motion, motion.slots[0])
    data.action = layer
    (data.action_slot,) = layer.slots
    data.action_blend_type, data.action_influence = "COMBINE", 1.0
    data.action_extrapolation = "HOLD"
    return layer


def follow(
    armature: bpy.types.Object,
    layer: bpy.types.Action,
    strip: tuple[bpy.types.Action, bpy.types.Action],
    before: Sequence[float],
) -> None:
    """Let the strip of a motion, and a layer over it, follow what was made of it anew.

    Args:
        armature: whose they are.
        layer: the artist's.
        strip: the action that the strip has, and the one that it is to have.
        before: frames of the cycles' quarters of the motion before.
    """
    data = armature.animation_data
    old, new = strip
    found = _strip(data, old) if data is not None else None
    if found is None:
        return
    if new != old:
        found.action = new
        (found.action_slot,) = new.slots
        new[MARK]["track"] = old[MARK].get("track", "")
    fit_strip(found, new)
    after = np.array(new.get(CYCLES, ()), dtype=np.float64)
    if len(before) > 1 and len(after) > 1:
        _shift(layer, np.array(before, dtype=np.float64), after)


def _shift(layer: bpy.types.Action, before: Floats, after: Floats) -> None:
    """Let keys of a layer stay in their cycles; before the first and after the last with these."""
    count = min(len(before), len(after))
    moved = after[:count] - before[:count]
    if not np.any(np.abs(moved) > _WHOLE):
        return
    for curve in curves_of(layer):
        for key in curve.keyframe_points:
            by = float(np.interp(key.co[0], before[:count], moved))
            if abs(key.co[0] - round(key.co[0])) < _WHOLE:
                by = round(key.co[0] + by) - key.co[0]
            # Handles go along.
            key.co_ui[0] += by
        curve.update()


def _strip(data: bpy.types.AnimData, motion: bpy.types.Action) -> bpy.types.NlaStrip | None:
    track = data.nla_tracks.get(motion[MARK].get("track", "")) if MARK in motion else None
    strips = () if track is None else track.strips
    return next((strip for strip in strips if strip.action == motion), None)
