# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties that lead limbs as control bones do: their names among those of bones, and their places.

An empty is the control of many a simple rig: inverse kinematics reach for it, a pole is one, the
curve of a spline is hooked to some. Only empties are taken: what has a shape of its own, a ball in
a hand, a camera that is looked at, is there for more than to lead a limb.
"""

from __future__ import annotations

from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.errors import RigError
from ...core.phrases import phrase
from .armature import acts, even_scale

_OBJECT: Final = "\n"
"""Before the name of an object among those of bones: none of these has a line's end in it."""
_MOVED: Final = ("location", "rotation_")
"""Properties whose drivers move an object."""

Control = bpy.types.PoseBone | bpy.types.Object
"""What an artist moves, and limbs go along."""


def object_control(item: bpy.types.Object) -> str:
    """The name that an object has among the controls of a rig; "" if it is none.

    Those are empties of this file that an artist can see and move, and nothing else does.
    """
    own: Any = item.original
    item = own
    if item.type != "EMPTY" or item.library is not None or not item.is_editable:
        return ""
    data = item.animation_data
    driven = data is not None and any(
        not each.mute and each.data_path.startswith(_MOVED) for each in data.drivers
    )
    locked = bool(np.array(item.lock_location).all() and np.array(item.lock_rotation).all())
    held = driven or locked or any(acts(each) for each in item.constraints)
    if held or not item.visible_get():
        return ""
    if data is not None and (
        data.use_tweak_mode or (data.action is not None and not data.action.is_editable)
    ):
        return ""
    return f"{_OBJECT}{item.name}"


def is_object(name: str) -> bool:
    """Whether a control is an object, and no bone."""
    return name.startswith(_OBJECT)


def object_of(name: str) -> bpy.types.Object:
    """The object that is a control.

    Raises:
        RigError: it is gone.
    """
    own = name.removeprefix(_OBJECT)
    found = bpy.data.objects.get((own, None))
    if found is None:
        raise RigError(phrase("'{name}' is gone.", name=own), "Start posing again.")
    return found


def control_of(armature: bpy.types.Object, name: str) -> Control:
    """The bone or the object that is a control.

    Raises:
        RigError: the object is gone.
    """
    if is_object(name):
        return object_of(name)
    assert armature.pose is not None
    return armature.pose.bones[name]


def units_of(control: Control) -> float:
    """How many of the units in which a control's location is given make a metre in the world."""
    if isinstance(control, bpy.types.PoseBone):
        armature: Any = control.id_data
        return 1.0 / even_scale(armature)
    volume = abs(np.linalg.det(_carrying(control)))
    return float(volume ** (-1.0 / 3.0)) if volume > 0.0 else 1.0


def world_place(armature: bpy.types.Object, name: str) -> Vector:
    """Where a control is now, world, as Blender shows it."""
    graph = bpy.context.evaluated_depsgraph_get()
    if is_object(name):
        return object_of(name).evaluated_get(graph).matrix_world.to_translation()
    shown = armature.evaluated_get(graph)
    assert shown.pose is not None
    return shown.matrix_world @ shown.pose.bones[name].head


def lead_to(armature: bpy.types.Object, name: str, place: Vector, pose: Matrix | None) -> None:
    """Let a control be at a place in the world: an object turned as it is, a bone as in a pose of
    the armature's space.
    """
    if pose is None:
        item = object_of(name)
        way = place - world_place(armature, name)
        item.location += Matrix(_carrying(item).tolist()).inverted_safe() @ way
        return
    assert armature.pose is not None
    moved = pose.copy()
    moved.translation = armature.matrix_world.inverted_safe() @ place
    armature.pose.bones[name].matrix = moved


def _carrying(item: bpy.types.Object) -> np.ndarray:
    """(3, 3) from the axes in which an object's location is given to those of the world."""
    parent = item.parent
    if parent is None:
        return np.eye(3)
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    own = np.array(shown.matrix_basis, dtype=np.float64)
    if abs(np.linalg.det(own[:3, :3])) < 1e-12:
        return np.eye(3)
    return (np.array(shown.matrix_world, dtype=np.float64) @ np.linalg.inv(own))[:3, :3]
