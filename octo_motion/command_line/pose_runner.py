# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose script of one shot, played in this Blender."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..ui.posing import play_file
from .job_report import ShotSummary


def is_posable(armature: bpy.types.Object) -> bool:
    """Whether an armature could be meant: it has bones."""
    return isinstance(armature.data, bpy.types.Armature) and bool(len(armature.data.bones))


def pose(armature: bpy.types.Object, scene: bpy.types.Scene, script: Path) -> ShotSummary:
    """Play a pose script on an armature; the context has its scene.

    Raises:
        OctoMotionError: the script or a step of it is wrong; the armature is as it was.
    """
    player = play_file(armature, scene, script)
    first, last = scene.frame_start, scene.frame_end
    message = f"played '{script.name}', {player.keys} bones keyed."
    return ShotSummary(message, last - first + 1, first, last)
