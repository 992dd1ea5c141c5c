# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether arms keep apart: from the rig and its skin to what is said of it."""

from __future__ import annotations

from typing import Final

import bpy

from ....blender.rig import radii_of_skin, skin_key, skin_parts
from ....core.content_cache import ContentCache, content_key
from ....core.locomotion.clearance import BodyVolume, Capsules
from ....core.locomotion.gait import Arm
from ....core.locomotion.motion import Creature
from ....core.locomotion.rig import BodyFrame, frames_of_arm
from ....core.skeleton import Skeleton
from ..settings import OCTO_MOTION_PG_locomotion

_known: Final[ContentCache[BodyVolume]] = ContentCache(2)


def read_volume(
    settings: OCTO_MOTION_PG_locomotion,
    armature: bpy.types.Object,
    creature: Creature,
    *,
    live: bool = False,
) -> BodyVolume | None:
    """The arms and the parts of the body as thick as their skin, where that is asked for.

    Args:
        settings: of the armature.
        armature: the armature object.
        creature: its rig.
        live: whether it is to be quick: which bones a skin follows is then looked at anew only
            where the skin has changed its form, and nothing is told of overlaps.
    """
    if not settings.keep_apart and (live or not settings.tell_overlaps):
        return None
    if not live:
        _known.clear()
    rig = creature.skeleton, creature.arms, creature.body
    key = content_key(*rig, skin_key(armature))
    return _known.get(key, lambda: _read_volume(armature, *rig))


def _read_volume(
    armature: bpy.types.Object, skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame
) -> BodyVolume:
    limbs = {bone for arm in arms for bone in arm.bones}
    parts = [
        name
        for number, name in enumerate(skeleton.names)
        if skeleton.deform[number]
        and skeleton.weighted[number]
        and not _hangs(skeleton, name, limbs)
    ]
    radii = radii_of_skin(armature, [arm.bones for arm in arms])
    still = [
        Capsules(name, ends[None], thick, ends) for name, ends, thick in skin_parts(armature, parts)
    ]
    return BodyVolume(
        arms=tuple(frames_of_arm(skeleton, arm.bones, body) for arm in arms),
        names=tuple(arm.name for arm in arms),
        radii=tuple(radii),
        still=tuple(still),
        upward=body.rotation[:, 2],
    )


def _hangs(skeleton: Skeleton, name: str, limbs: set[str]) -> bool:
    """Whether a bone is of an arm, or hangs on one."""
    bone = skeleton.index[name]
    while bone >= 0:
        if skeleton.names[bone] in limbs:
            return True
        bone = skeleton.parents[bone]
    return False
