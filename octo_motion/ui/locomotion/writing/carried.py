# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that arms carry: the keys of their ways."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ....blender.animation import object_channels, write_action
from ....blender.scene import carrying_note, left_behind, put_back
from ....core.locomotion.reaching import Carried


def write_carried(armature: bpy.types.Object, carried: Sequence[Carried]) -> None:
    """Give objects the keys of their ways; those that they got before are made anew.

    What is no longer carried loses them, and stands where it stood before.

    Raises:
        WriteError: an object has become read-only.
    """
    for target in left_behind(armature.name, {each.target for each in carried}):
        put_back(target)
    for each in carried:
        target = bpy.data.objects.get(each.target)
        if target is None:
            continue
        data = target.animation_data
        write_action(
            target,
            f"{target.name} Carried",
            each.frames,
            object_channels(target, each.positions, each.rotations),
            previous=data.action if data is not None else None,
            settings_note=carrying_note(armature.name),
        )
