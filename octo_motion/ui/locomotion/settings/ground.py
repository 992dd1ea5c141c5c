# SPDX-License-Identifier: GPL-3.0-or-later
"""What a walk stands on, as it is set: ``octo_motion.locomotion.ground``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import bpy
import numpy as np

from ....blender.scene import Contact, markers, read_markers
from ....core.locomotion.gait import Arm
from ....core.locomotion.ground import ContactOverride, StanceSettings
from ....core.rotations import Floats
from ... import declared_settings as props
from ...declared_settings import declared, emptied


def may_be_ground(settings: Any, candidate: bpy.types.Object) -> bool:
    """Whether an object is offered as ground: a mesh, but nobody's own skin."""
    return candidate.type == "MESH" and candidate.find_armature() != settings.id_data


def _shift() -> Any:
    return props.FloatProperty(
        name="Shift",
        description="Share of a cycle by which the contact is later, negative if it is earlier",
        min=-0.3,
        max=0.3,
        step=1,
        precision=3,
    )


class ContactItem(bpy.types.PropertyGroup):
    """What an artist wants of one contact: it stays when the motion is generated again."""

    arm: props.StringProperty(name="Arm", description="Name of the arm in the list")
    cycle: props.IntProperty(name="Cycle", description="Number of the arm's cycle along the route")
    removed: props.BoolProperty(
        name="Removed", description="The arm does not touch the ground here"
    )
    shift: _shift()
    locked: props.BoolProperty(
        name="Locked",
        description="The contact stays where it is in the world, however the route or the gait "
        "are changed",
    )
    position: props.FloatVectorProperty(
        name="Position",
        description="Where the arm touches the ground, if the contact is locked",
        subtype="TRANSLATION",
        size=3,
    )
    heading: props.FloatProperty(
        name="Heading",
        description="Which way the arm lies from there, about the world's Z axis, if the contact "
        "is locked",
        subtype="ANGLE",
    )


class OCTO_MOTION_PG_ground(bpy.types.PropertyGroup):
    """How a walking creature stands on the ground."""

    use: props.BoolProperty(
        name="Hold the Ground",
        description="Walking, each arm takes hold of the ground and does not slide over it, while "
        "the body moves on. Off, the arms move as the gait alone has them",
        default=True,
    )
    object: props.PointerProperty(
        name="Ground",
        description="Mesh to walk on, as it is seen: with its modifiers, moved and scaled. Without "
        "one, the ground is where the route is",
        type=bpy.types.Object,
        poll=may_be_ground,
    )
    duty: declared(StanceSettings, "duty")
    planted: declared(StanceSettings, "planted")
    stretch: declared(StanceSettings, "stretch")
    lift: declared(StanceSettings, "lift")
    lean: declared(StanceSettings, "lean")
    smoothing: declared(StanceSettings, "smoothing")
    start_at_rest: props.BoolProperty(
        name="Start at Rest",
        description="All arms lie on the ground at the start, and leave it as the body gets going. "
        "Only with an Ease In: without one the creature comes walking",
        default=True,
    )
    come_to_rest: props.BoolProperty(
        name="Come to Rest",
        description="All arms lie on the ground at the end: each takes its last step in time. Only "
        "with an Ease Out: without one the creature walks on",
        default=True,
    )
    rest_within: props.FloatProperty(
        name="Within",
        description="Cycles of the gait that the body takes at least to get going from its rest, "
        "and to come to it, if that is more than Ease In and Out give it",
        default=1.0,
        min=0.0,
        soft_max=4.0,
        max=100.0,
        step=10,
    )
    shown: props.StringProperty(
        name="Shown",
        description="Which contacts have markers",
        options={"HIDDEN"},
    )
    contacts: props.CollectionProperty(
        name="Contacts",
        description="Contacts that were moved, locked, shifted or removed by hand",
        type=ContactItem,
    )


_HiddenFloat: Final = partial(props.FloatProperty, options={"HIDDEN"})
_HiddenText: Final = partial(props.StringProperty, options={"HIDDEN"})


class OCTO_MOTION_PG_contact(bpy.types.PropertyGroup):
    """What a marker stands for: ``Object.octo_motion.contact``."""

    armature: _HiddenText(name="Armature", description="Object whose arm touches here")
    arm: _HiddenText(name="Arm", description="Name of the arm")
    cycle: props.IntProperty(
        name="Cycle",
        description="Number of the arm's cycle along the route",
        options={"HIDDEN"},
    )
    locked: props.BoolProperty(
        name="Locked",
        description="The contact stays here, however the route or the gait are changed. One that "
        "was dragged or turned is locked; free it to have it where the gait wants it",
    )
    shift: _shift()
    position: props.FloatVectorProperty(
        name="Position",
        description="Where the marker was put",
        size=3,
        options={"HIDDEN"},
    )
    heading: _HiddenFloat(name="Heading", description="How the marker was turned")
    frame_on: _HiddenFloat(name="From", description="Frame at which the arm takes hold")
    frame_off: _HiddenFloat(name="To", description="Frame at which the arm lets go")
    cycle_frames: _HiddenFloat(
        name="Cycle Frames", description="Frames that a cycle takes there", default=1.0
    )


# --- What an artist wants of single contacts: kept in the settings, changed on markers ------------


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
    once, places = _shown(settings)
    found = read_markers(armature, once) if settings.shown else {}
    # Of a copy of an armature that has markers, nobody has taken any away.
    if found or once == armature.name:
        for place in places:
            if place not in found:
                wanted[place] = replace(wanted.get(place, ContactEdit()), removed=True)
    for place, contact in found.items():
        wanted[place] = ContactEdit(
            shift=contact.shift,
            position=contact.position if contact.locked else None,
            heading=contact.heading,
        )
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
    """Keep wishes in the settings."""
    for item in emptied(settings, "contacts"):
        if (item.arm, item.cycle) not in wanted:
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
