# SPDX-License-Identifier: GPL-3.0-or-later
"""What a walk holds on to: the settings, the ground's mesh and the skin of the arms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import bpy

from ....blender.animation import may_stretch
from ....blender.scene import arm_skins, is_enabled, read_triangles
from ....core.locomotion.ground import StanceSettings
from ....core.locomotion.motion import Creature, GroundJob
from ...declared_settings import read_settings
from ..settings import ContactEdit, OCTO_MOTION_PG_locomotion, Place, overrides_for_core

_BARE: Final = (
    "The ground '{name}' is disabled in viewports or excluded: its modifiers do not count. Hide it "
    "with its eye in the outliner instead."
)


def resting(settings: OCTO_MOTION_PG_locomotion) -> tuple[bool, bool]:
    """Whether all arms lie on the ground at the start of a walk, and at its end."""
    ground = settings.ground
    if not ground.use or settings.travel_on == "NONE":
        return False, False
    return (
        ground.start_at_rest and settings.ease_in > 0.0,
        ground.come_to_rest and settings.ease_out > 0.0,
    )


def read_ground(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    creature: Creature,
    edits: Mapping[Place, ContactEdit],
    *,
    walks: bool,
) -> GroundJob | None:
    """The ground under a walk, none where nothing holds it.

    Args:
        settings: of the armature.
        armature: the armature object.
        depsgraph: the evaluated scene.
        creature: its rig.
        edits: the artist's, of single contacts.
        walks: whether any of its gaits goes over the ground.

    Raises:
        GroundError: the ground is no mesh, or has no faces.
    """
    ground = settings.ground
    if not ground.use or not walks:
        return None
    mesh, warnings = None, ()
    if ground.object is not None and settings.travel_on != "NONE":
        mesh = read_triangles(ground.object, depsgraph)
        if len(ground.object.modifiers) > 0 and not is_enabled(ground.object, depsgraph):
            warnings = (_BARE.format(name=ground.object.name),)
    return GroundJob(
        stance=read_settings(StanceSettings, ground),
        skins=arm_skins(armature, creature.at_rest, creature.bones),
        may_stretch=[may_stretch(armature, bones) for bones in creature.bones],
        mesh=mesh,
        overrides=tuple(overrides_for_core(dict(edits), creature.arms)),
        rest=resting(settings),
        rest_within=ground.rest_within,
        warnings=warnings,
    )
