# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips of files onto the armature of one shot, in this Blender."""

from __future__ import annotations

from typing import Any

import bpy

from ..blender.animation import writable_armature
from ..core.errors import ClipError
from ..ui.splicing import ClipReader, RetargetSession, file_clip, splicing_settings
from .job_report import ShotSummary
from .schema import set_values
from .shot_schema import ShotRequest
from .splice_runner import mesh_named

_FIRST_FRAME = 1


def retarget(armature: bpy.types.Object, shot: ShotRequest) -> ShotSummary:
    """Each clip as an action of the armature; the context has its scene.

    Raises:
        OctoMotionError: something is wrong that the user can put right.
    """
    writable_armature(armature)
    settings: Any = splicing_settings(armature)
    landmarks = {name: each for name, each in shot.settings.items() if "." in name}
    own = {name: each for name, each in shot.settings.items() if "." not in name}
    set_values(settings, landmarks)
    set_values(settings.retarget, own)
    if shot.ground:
        settings.retarget.ground = mesh_named(shot.ground)
    paths = [each.clip for each in shot.splices or () if each.clip is not None]
    reader = ClipReader()
    clips = [(path.stem, file_clip(armature.name, path, _FIRST_FRAME, reader)) for path in paths]
    session = RetargetSession(armature, clips)
    for _ in session.steps():
        pass
    if session.refused:
        name, error = session.refused[0]
        raise ClipError(f"'{name}': {error.problem}", error.remedy)
    made = session.end().made
    ranges = [bpy.data.actions[each.action].frame_range for each in made]
    first = round(min(each[0] for each in ranges))
    last = round(max(each[1] for each in ranges))
    warnings = tuple(dict.fromkeys(warning for each in made for warning in each.warnings))
    return ShotSummary(session.message, sum(each.frames for each in made), first, last, warnings)
