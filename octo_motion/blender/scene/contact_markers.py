# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts with the ground as objects that an artist can drag, turn, lock and delete.

A marker is an empty, a cone that points the way the arm lies. What it stands for is written on
it (``Object.octo_motion.contact``); its armature is known by name, so that nothing here outlives
an undo or a file, and no deleted armature is kept in it. An armature that was renamed since is told
from a copy of it by what it was once called: of a copy, the other one is still there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix

from ...core.rotations import Floats
from .octopus import own_collection

_SIZE: Final = 0.07
"""Arm lengths."""
_COLLECTION: Final = " Contacts"
"""How names of collections of markers end, after that of their armature."""
_MOVED: Final = 1e-4
"""Marker sizes by which a marker may be off where it was put, and radians."""


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact, as a marker shows it."""

    arm: str
    cycle: int
    position: Floats
    """(3,) world."""
    heading: float
    """Radians about world Z from +X."""
    locked: bool = False
    shift: float = 0.0
    """Cycles by which it is later."""
    frame_on: float = 0.0
    frame_off: float = 0.0
    cycle_frames: float = 1.0
    """Frames that a cycle takes there."""


def markers(armature: bpy.types.Object, once: str = "") -> list[bpy.types.Object]:
    """The markers of an armature that are in some scene, by name.

    ``once`` is what it was called when its markers were put.
    """
    names = {armature.name}
    if once and bpy.data.objects.get((once, None)) is None:
        names.add(once)
    # Once for all of them: Blender looks through all scenes for each.
    there = {item for scene in bpy.data.scenes for item in scene.objects if item.type == "EMPTY"}
    found = [item for item in there if _own(item).armature in names]
    return sorted(found, key=lambda item: item.name)


def read_markers(armature: bpy.types.Object, once: str = "") -> dict[tuple[str, int], Contact]:
    """What the markers say: one that was moved or turned is locked where it is now.

    Of two copies of a marker, the first by name counts. Arguments as of :func:`markers`.
    """
    contacts: dict[tuple[str, int], Contact] = {}
    for item in markers(armature, once):
        own, world = _own(item), item.matrix_world
        place, put, known = world.translation, own.position, own.heading
        far = max(abs(place[axis] - put[axis]) for axis in range(3))
        moved = far > _MOVED * item.empty_display_size
        heading = _heading(world)
        turned = abs((heading - known + math.pi) % (2.0 * math.pi) - math.pi) > _MOVED
        arm, cycle = own.arm, own.cycle
        contacts.setdefault(
            (arm, cycle),
            Contact(
                arm,
                cycle,
                np.array(place if moved else put, dtype=np.float64),
                heading if turned else known,
                locked=own.locked or moved or turned,
                shift=own.shift,
            ),
        )
    return contacts


def write_markers(
    armature: bpy.types.Object, contacts: Sequence[Contact], arm_length: float, once: str = ""
) -> None:
    """Put markers where all the contacts are: those that are there are moved, others made or
    removed.

    The arm's length is in metres; ``once`` is as of :func:`markers`.
    """
    known: dict[tuple[str, int], bpy.types.Object] = {}
    surplus: list[bpy.types.Object] = []
    for item in markers(armature, once):
        place = _own(item).arm, _own(item).cycle
        (surplus.append(item) if place in known else known.setdefault(place, item))
    collection = None
    for contact in contacts:
        item = known.pop((contact.arm, contact.cycle), None)
        if item is None:
            collection = collection or _collection(armature)
            item = bpy.data.objects.new(f"{contact.arm} Contact {contact.cycle:02}", None)
            item.empty_display_type = "CONE"
            item.show_in_front = True
            collection.objects.link(item)
        item.empty_display_size = _SIZE * arm_length
        _write(item, armature, contact)
    _remove([*known.values(), *surplus])


def remove_markers(armature: bpy.types.Object, once: str = "") -> None:
    """Take all markers of an armature away, and their collection.

    Arguments as of :func:`markers`.
    """
    found = markers(armature, once)
    # An armature may have been renamed since its collection was made.
    holders = {each.name for item in found for each in item.users_collection}
    _remove(found)
    for name in {f"{armature.name}{_COLLECTION}", *holders}:
        each = bpy.data.collections.get((name, None)) if name.endswith(_COLLECTION) else None
        if each is not None and not each.all_objects and not each.children:
            bpy.data.collections.remove(each)


def _own(item: bpy.types.Object) -> Any:
    return item.octo_motion.contact  # type: ignore[attr-defined]


def _write(item: bpy.types.Object, armature: bpy.types.Object, contact: Contact) -> None:
    own = _own(item)
    own.armature, own.arm, own.cycle = armature.name, contact.arm, contact.cycle
    own.locked, own.shift = contact.locked, contact.shift
    own.frame_on, own.frame_off = contact.frame_on, contact.frame_off
    own.cycle_frames = contact.cycle_frames
    turn = Matrix.Rotation(contact.heading - 0.5 * np.pi, 4, "Z")
    item.matrix_world = Matrix.Translation(contact.position.tolist()) @ turn
    # As single precision has them: what is read back must not look moved.
    own.position = item.matrix_world.translation
    own.heading = _heading(item.matrix_world)


def _heading(world: Matrix) -> float:
    """Which way a marker with this matrix points, radians about world Z from +X."""
    return math.atan2(world[1][1], world[0][1])


def _remove(items: Iterable[bpy.types.Object]) -> None:
    for item in items:
        bpy.data.objects.remove(item)


def _collection(armature: bpy.types.Object) -> bpy.types.Collection:
    name = f"{armature.name}{_COLLECTION}"
    # A linked file may have one of that name, too.
    collection = bpy.data.collections.get((name, None)) or bpy.data.collections.new(name)
    scene = bpy.context.scene
    assert scene is not None
    if collection not in scene.collection.children_recursive:
        own = own_collection(armature)
        inside = own is not None and own in scene.collection.children_recursive
        (own if own is not None and inside else scene.collection).children.link(collection)
    return collection
