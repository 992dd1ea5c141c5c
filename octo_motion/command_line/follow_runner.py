# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that follow an action, for one shot in this Blender."""

from __future__ import annotations

from typing import Any, Final

import bpy

from ..blender.animation import writable_armature
from ..core.errors import ClipError
from ..ui.follow_through import find_chains, follow_action, follow_settings
from .job_report import ShotSummary
from .schema import set_values, unknown
from .shot_schema import ShotRequest
from .splice_runner import named

_RESULT: Final = "result_as"


def follow(armature: bpy.types.Object, shot: ShotRequest) -> ShotSummary:
    """Let the chains that the shot names follow an action, or those of the armature's list, or what
    hangs loose by its names; the context has its scene.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    writable_armature(armature)
    settings: Any = follow_settings(armature)
    if shot.base:
        _give(armature, shot.base)
    # What is made of a shot is handed on: an action has all of it.
    set_values(settings, {_RESULT: "ACTION", **shot.settings})
    if shot.changes is not None:
        settings.chains.clear()
        for each in shot.changes:
            set_values(settings.chains.add(), each)
    elif not len(settings.chains):
        find_chains(armature, settings)
    made = follow_action(armature)
    return ShotSummary(made.message, made.frames, made.frame_start, made.frame_end, made.warnings)


def _give(armature: bpy.types.Object, name: str) -> None:
    """Let an armature have an action, in the slot that fits."""
    action = named(bpy.data.actions, name)
    if action is None:
        names = sorted(each.name for each in bpy.data.actions)
        raise ClipError(unknown("action", name, names))
    data = armature.animation_data or armature.animation_data_create()
    assert data is not None
    data.action = action
    if data.action_slot is None and len(action.slots):
        data.action_slot = action.slots[0]
