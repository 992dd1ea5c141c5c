# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of arms between properties and core's plain data."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final, cast

import bpy

from ....blender.overrides import linked_names
from ....blender.rig import armature_data, world_directions
from ....core.locomotion.rig import ArmChain, Detection, Side, nearest_axis
from ....core.skeleton import Skeleton
from ...override_groups import assign
from ..settings import OCTO_MOTION_PG_locomotion

# Names that detection gives, and the numbers that keep them apart.
_GIVEN_NAME: Final = re.compile(r"Arm \d+( [LR])?(\.\d+)?")


def list_owner(settings: OCTO_MOTION_PG_locomotion) -> bpy.types.Object:
    """The armature object that the settings belong to."""
    return cast("bpy.types.Object", settings.id_data)


def active_arm(settings: OCTO_MOTION_PG_locomotion) -> Any:
    """The list's active arm, ``None`` in an empty list."""
    number = settings.active_arm
    return settings.arms[number] if 0 <= number < len(settings.arms) else None


def bones_of(arm: Any) -> tuple[str, ...]:
    """Names of an arm's bones, root to tip."""
    return tuple(bone.name for bone in arm.bones)


def placed_arms(
    settings: OCTO_MOTION_PG_locomotion, skeleton: Skeleton
) -> list[tuple[tuple[str, ...], Side, int]]:
    """Bones, side and pair of the arms in the list whose bones all exist."""
    return [
        (bones, cast("Side", arm.side), arm.pair)
        for arm in settings.arms
        if (bones := bones_of(arm)) and skeleton.index.keys() >= set(bones)
    ]


def body_axes(settings: OCTO_MOTION_PG_locomotion, armature: bpy.types.Object) -> tuple[str, str]:
    """The body's up and front: as set, or as the armature stands in the world."""
    if settings.arms or settings.is_property_set("body_front"):
        return settings.body_up, settings.body_front
    world_up, world_front = world_directions(armature)
    up = nearest_axis(world_up)
    return up, nearest_axis(world_front, across=up)


def write_arms(settings: OCTO_MOTION_PG_locomotion, arms: Iterable[ArmChain]) -> int:
    """Make the list these arms, keeping what the artist has set on those it had.

    Returns how many arms of a linked file could only be switched off.
    """
    linked = linked_names(settings, "arms")
    kept: dict[tuple[str, ...], dict[str, Any]] = {}
    for number in reversed(range(len(settings.arms))):
        item = settings.arms[number]
        if item.name not in linked:
            kept[bones_of(item)] = _set_by_hand(item)
            settings.arms.remove(number)
    remaining = {bones_of(item): item.name for item in settings.arms}
    for arm in arms:
        name = remaining.pop(arm.bones, None)
        if name is None:
            item = add_item(settings, arm, **kept.get(arm.bones, {}))
        else:
            item = settings.arms[name]
        assign(item, "side", arm.side)
        assign(item, "pair", arm.pair)
    for name in remaining.values():
        assign(settings.arms[name], "enabled", value=False)
    settings.active_arm = min(settings.active_arm, max(0, len(settings.arms) - 1))
    return len(remaining)


def _set_by_hand(item: Any) -> dict[str, Any]:
    values = {"phase": item.phase, "flip": item.flip, "enabled": item.enabled}
    if not _GIVEN_NAME.fullmatch(item.name):
        values["name"] = item.name
    return values


def add_item(settings: OCTO_MOTION_PG_locomotion, arm: ArmChain, **values: Any) -> Any:
    """Append an arm under a name that no other has, with these values of its properties."""
    name = values.pop("name", arm.name)
    taken = {each.name for each in settings.arms}
    number = 1
    unique = name
    while unique in taken:
        unique = f"{name}.{number:03}"
        number += 1
    item = settings.arms.add()
    item.name, item.side, item.pair = unique, arm.side, arm.pair
    for bone in arm.bones:
        item.bones.add().name = bone
    for key, value in values.items():
        setattr(item, key, value)
    return item


def write_body(settings: OCTO_MOTION_PG_locomotion, found: Detection) -> None:
    """Set which way the body faces; the root bone stays as it is if it is one."""
    assign(settings, "body_up", found.up)
    assign(settings, "body_front", found.front)
    if settings.root_bone not in armature_data(list_owner(settings)).bones:
        assign(settings, "root_bone", found.root_bone)
