# SPDX-License-Identifier: GPL-3.0-or-later
"""Reaches of the list: what is reached for, and where that is meanwhile."""

from __future__ import annotations

from typing import Any, Final

import bpy
import numpy as np

from ....blender.animation import standing_of, writable_object
from ....blender.rig import radii_of_skin
from ....blender.scene import (
    can_be_carried,
    hangs_on,
    home_of,
    is_carried,
    read_form,
    read_places,
)
from ....core.errors import SettingsError
from ....core.locomotion.reaching import Reach, Reaching, Timeline, profile_of
from ....core.locomotion.rig import frames_of_arm
from ....core.rotations import Floats
from .rig import RigRead, keyed_anew

_AXES: Final = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


def read_reaches(
    armature: bpy.types.Object, settings: Any, rig: RigRead, frames: Floats
) -> Reaching | None:
    """What the list of reaches asks for; none if it is empty or muted.

    Args:
        armature: the armature object.
        settings: its settings.
        rig: as it was read.
        frames: (frames,) of the motion.

    Raises:
        OctoMotionError: an object is missing, has no surface, or moves with the armature; frames
            are out of order.
    """
    items = [item for item in settings.reaches if not item.mute]
    if not items:
        return None
    creature = rig.creature
    bones, arms = creature.bones, creature.arms
    anew = keyed_anew(settings, armature, creature.root_bone)
    return Reaching(
        arms=arms,
        frames=tuple(frames_of_arm(creature.at_rest, each, rig.rest_body) for each in bones),
        radii=tuple(radii_of_skin(armature, bones)),
        standings=tuple(standing_of(armature, each[0], left_out=anew) for each in bones),
        up=rig.rest_body.rotation[:, 2],
        reaches=tuple(_reach(item, armature, frames) for item in items),
    )


def _reach(item: Any, armature: bpy.types.Object, frames: Floats) -> Reach:
    closed = item.frame_contact + (item.coil_frames if item.mode == "COIL" else 0)
    timeline = Timeline(
        *(item.frame_start, item.frame_contact, min(closed, item.frame_release)),
        *(item.frame_release, item.frame_release + item.back_frames),
    )
    still = np.zeros((len(frames), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(frames), 1))
    if item.mode == "CURL":
        return Reach(item.name, item.arm, item.mode, 0.0, timeline, "", None, *still)
    if item.target is None:
        raise SettingsError(
            f"The reach '{item.name}' has no object.", "Choose what it reaches for, or mute it."
        )
    if hangs_on(item.target, armature):
        raise SettingsError(
            f"'{item.target.name}' hangs on '{armature.name}', which reaches for it.",
            "Clear its parent and its constraints to the armature.",
        )
    carry = item.carry and item.mode == "COIL"
    if carry:
        writable_object(item.target)
        if not can_be_carried(item.target):
            raise SettingsError(
                f"'{item.target.name}' moves by itself and cannot be carried.",
                "Remove its action, constraints and physics, or switch Carry off.",
            )
    axis = np.array(_AXES[item.axis]) if item.axis in _AXES else None
    profile = profile_of(*read_form(item.target), axis)
    asked = (frames >= timeline.start) & (frames <= timeline.end)
    positions, rotations = still
    if carry or is_carried(item.target, armature.name):
        # Keys that it got before are made anew, or taken away.
        position, rotation = home_of(item.target)
        positions, rotations = (
            np.tile(position, (len(frames), 1)),
            np.tile(rotation, (len(frames), 1)),
        )
    elif np.any(asked):
        positions[asked], rotations[asked] = read_places(item.target, frames[asked])
        # Before and after, nothing asks where it is.
        first, last = np.flatnonzero(asked)[[0, -1]]
        positions[:first], rotations[:first] = positions[first], rotations[first]
        positions[last + 1 :], rotations[last + 1 :] = positions[last], rotations[last]
    return Reach(
        item.name, item.arm, item.mode, item.turns, timeline, item.target.name, profile,
        positions, rotations, carry,
    )  # fmt: skip
