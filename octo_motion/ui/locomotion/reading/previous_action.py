# SPDX-License-Identifier: GPL-3.0-or-later
"""The action that a motion is made anew in place of."""

from __future__ import annotations

from typing import Any, cast

import bpy

from ....blender.animation import is_generated
from ..settings import OCTO_MOTION_PG_locomotion


def playing_action(armature: bpy.types.Object) -> bpy.types.Action | None:
    """The action that an armature has."""
    data = armature.animation_data
    return data.action if data is not None else None


def previous_action(
    armature: bpy.types.Object, settings: OCTO_MOTION_PG_locomotion
) -> bpy.types.Action | None:
    """The action to make anew: the one that plays if it was generated, else the last result."""
    spliced = cast("Any", armature).octo_motion.splicing.result
    playing = playing_action(armature)
    if playing is not None and playing != spliced and is_generated(playing):
        return playing
    return settings.result
