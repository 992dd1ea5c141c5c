# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist wants of single contacts: kept in the settings, changed on markers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ....blender.overrides import linked_names
from ....blender.scene import Contact, markers, read_markers
from ....core.locomotion.gait import Arm
from ....core.locomotion.ground import ContactOverride
from ....core.rotations import Floats
from .ground import OCTO_MOTION_PG_ground

Place = tuple[str, int]
"""Name of an arm, and number of its cycle."""


@dataclass(frozen=True, eq=False)
class ContactEdit:
    """What is wanted of one contact."""

    removed: bool = False
    shift: float = 0.0
    position: Floats | None = None
    """(3,) where it is locked, world."""
    heading: float = 0.0

    @property
    def matters(self) -> bool:
        """Whether it differs from what would be there anyway."""
        return self.removed or self.shift != 0.0 or self.position is not None


def read_overrides(
    settings: OCTO_MOTION_PG_ground, armature: bpy.types.Object
) -> dict[Place, ContactEdit]:
    """All wishes: those in the settings, and what was done to the markers since."""
    wanted = {
        (item.arm, item.cycle): ContactEdit(
            item.removed,
            item.shift,
            np.array(item.position, dtype=np.float64) if item.locked else None,
            item.heading,
        )
        for item in settings.contacts
    }
    wanted = {place: each for place, each in wanted.items() if each.matters}
    if not settings.shown:
        return wanted
    once, places = _shown(settings)
    found = read_markers(armature, once)
    if once != armature.name and not found:
        # A copy of the armature that has markers: nobody has taken any of its own away.
        return wanted
    for place in places:
        if place not in found:
            wanted[place] = replace(wanted.get(place, ContactEdit()), removed=True)
    for place, contact in found.items():
        position = contact.position if contact.locked else None
        wanted[place] = ContactEdit(shift=contact.shift, position=position, heading=contact.heading)
    return {place: each for place, each in wanted.items() if each.matters}


def overrides_for_core(
    wanted: dict[Place, ContactEdit], arms: Sequence[Arm]
) -> list[ContactOverride]:
    """Wishes as core has them, of those arms that there are."""
    numbers = {arm.name: number for number, arm in enumerate(arms)}
    return [
        ContactOverride(
            numbers[arm],
            cycle,
            removed=each.removed,
            shift=each.shift,
            position=each.position,
            heading=each.heading if each.position is not None else None,
        )
        for (arm, cycle), each in wanted.items()
        if arm in numbers
    ]


def store(settings: OCTO_MOTION_PG_ground, wanted: dict[Place, ContactEdit]) -> None:
    """Keep wishes in the settings.

    What a library override has from its linked file can be changed, but not removed: there it says
    nothing any more.
    """
    linked = linked_names(settings, "contacts")
    for number in reversed(range(len(settings.contacts))):
        item = settings.contacts[number]
        if item.name not in linked:
            settings.contacts.remove(number)
        elif (item.arm, item.cycle) not in wanted:
            item.removed, item.shift, item.locked = False, 0.0, False
    for (arm, cycle), each in sorted(wanted.items()):
        name = _name(arm, cycle)
        item = settings.contacts.get(name)
        if item is None:
            item = settings.contacts.add()
            item.name, item.arm, item.cycle = name, arm, cycle
        item.removed = each.removed
        item.shift, item.locked = each.shift, each.position is not None
        if each.position is not None:
            item.position, item.heading = each.position, each.heading


def rename_arm(armature: Any, before: str, now: str) -> None:
    """Let reaches, contacts and their markers speak of an arm by its new name."""
    settings = armature.octo_motion.locomotion
    for reach in settings.reaches:
        if reach.arm == before:
            reach.arm = now
    ground = settings.ground
    for item in ground.contacts:
        if item.arm == before:
            item.arm, item.name = now, _name(now, item.cycle)
    once, places = _shown(ground)
    if places:
        renamed = [(now if arm == before else arm, cycle) for arm, cycle in places]
        ground.shown = json.dumps({"armature": once, "contacts": renamed})
    for marker in markers(armature, once):
        own: Any = marker.octo_motion.contact  # type: ignore[attr-defined]
        if own.arm == before:
            own.arm = now


def changed_by_hand(settings: OCTO_MOTION_PG_ground) -> int:
    """How many contacts the settings have wishes of."""
    return sum(item.removed or item.shift != 0.0 or item.locked for item in settings.contacts)


def note_shown(
    settings: OCTO_MOTION_PG_ground, armature: bpy.types.Object, contacts: Sequence[Contact]
) -> None:
    """Remember which markers were put, so that one that is gone is known to be removed."""
    places = [(each.arm, each.cycle) for each in contacts]
    settings.shown = json.dumps({"armature": armature.name, "contacts": places})


def once_called(settings: OCTO_MOTION_PG_ground) -> str:
    """What the armature, or the one that it is a copy of, was called when it got markers."""
    return _shown(settings)[0]


def _name(arm: str, cycle: int) -> str:
    """What a contact is called in the settings."""
    return f"{arm} {cycle}"


def _shown(settings: OCTO_MOTION_PG_ground) -> tuple[str, list[Place]]:
    """What :func:`note_shown` has noted: "" and nothing where no markers are shown."""
    if not settings.shown:
        return "", []
    noted = json.loads(settings.shown)
    return noted["armature"], [(arm, cycle) for arm, cycle in noted["contacts"]]
