# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects to grasp: their form as the scene shows it, and where they are over time."""

from __future__ import annotations

from typing import Final

import bpy
import numpy as np

from ...core.errors import RigError
from ...core.phrases import phrase
from ...core.rotations import Floats, continuous, from_matrix
from ..animation import curves_of, is_generated, note_of, time_kept
from ..rig import vertex_positions, world_of

WITH_SURFACE: Final = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that can have faces."""
CARRIED: Final = "carried by {}"
"""What is noted with the keys of an object that an armature of this name carries."""
_SAME: Final = 1e-4
"""Metres or radians by which an object may be off its keys, and not have been moved."""


def read_form(target: bpy.types.Object) -> tuple[Floats, np.ndarray]:
    """The object's surface with its modifiers: vertices (v, 3) and triangles (t, 3).

    In metres along the object's own axes, as :func:`read_places` places them; its scale is in
    them.

    Raises:
        RigError: it has no surface.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = target.evaluated_get(depsgraph)
    try:
        mesh = evaluated.to_mesh() if target.type in WITH_SURFACE else None
        if mesh is None or len(mesh.polygons) == 0:
            raise RigError(
                phrase("'{target}' has no faces to grasp.", target=target.name),
                "Choose an object with a surface.",
            )
        vertices = vertex_positions(mesh)
        mesh.calc_loop_triangles()
        triangles = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
    finally:
        evaluated.to_mesh_clear()
    matrix = np.array(world_of(target, depsgraph), dtype=np.float64)[:3, :3]
    own = matrix_rotation(matrix)
    return vertices @ (own.T @ matrix).T, triangles


def read_places(target: bpy.types.Object, frames: Floats) -> tuple[Floats, Floats]:
    """World positions (frames, 3) and rotations (frames, 4) of an object.

    A still object is read once; otherwise the scene is played through and put back to its frame,
    and what has no keys yet survives.
    """
    scene = bpy.context.scene
    assert scene is not None
    matrices = np.empty((len(frames), 4, 4))
    if not may_move(target):
        still = world_of(target, bpy.context.evaluated_depsgraph_get())
        matrices[:] = np.array(still, dtype=np.float64)
    else:
        with time_kept(scene) as go_to:
            for number, frame in enumerate(frames):
                go_to(float(frame))
                matrices[number] = world_of(target, bpy.context.evaluated_depsgraph_get())
    rotations = from_matrix(np.stack([matrix_rotation(each) for each in matrices[:, :3, :3]]))
    return matrices[:, :3, 3], continuous(rotations)


def may_move(target: bpy.types.Object) -> bool:
    """Whether keys, drivers, constraints, physics or a parent's can move an object."""
    each: bpy.types.Object | None = target
    while each is not None:
        if each.animation_data is not None or len(each.constraints) > 0:
            return True
        if each.rigid_body is not None or each.parent_type not in {"OBJECT", "BONE"}:
            return True
        if each.parent is not None and each.parent_type == "BONE":
            return True
        each = each.parent
    return False


def can_be_carried(target: bpy.types.Object) -> bool:
    """Whether an object stands still, but for keys that were made here."""
    data = target.animation_data
    if data is not None:
        if data.action is not None and not is_generated(data.action):
            return False
        if len(data.drivers) > 0 or len(data.nla_tracks) > 0:
            return False
    if len(target.constraints) > 0 or target.rigid_body is not None:
        return False
    return target.parent is None or (target.parent_type == "OBJECT" and not may_move(target.parent))


def home_of(target: bpy.types.Object) -> tuple[Floats, Floats]:
    """World position (3,) and rotation (4,) where an object stands until it is carried.

    That is where it is, if an artist has put it there since, else where its keys begin.
    """
    action = _generated(target)
    if action is None or _moved_by_hand(target, action):
        matrix = np.array(world_of(target, bpy.context.evaluated_depsgraph_get()))
        return matrix[:3, 3], from_matrix(matrix_rotation(matrix[:3, :3])[None])[0]
    positions, rotations = read_places(target, np.array([action.frame_start]))
    return positions[0], rotations[0]


def put_back(target: bpy.types.Object) -> None:
    """Take an object's keys away that carried it, and let it stand where it stood before."""
    action, data = _generated(target), target.animation_data
    if action is None or data is None:
        return
    if not _moved_by_hand(target, action):
        for curve in curves_of(action):
            values = getattr(target, curve.data_path)
            values[curve.array_index] = curve.evaluate(action.frame_start)
    data.action = None
    bpy.data.actions.remove(action)


def is_carried(target: bpy.types.Object, carrier: str) -> bool:
    """Whether keys that an armature's motion gave an object carry it."""
    action = _generated(target)
    return action is not None and note_of(action) == CARRIED.format(carrier)


def _generated(target: bpy.types.Object) -> bpy.types.Action | None:
    data = target.animation_data
    action = data.action if data is not None else None
    return action if action is not None and is_generated(action) else None


def _moved_by_hand(target: bpy.types.Object, action: bpy.types.Action) -> bool:
    """Whether an object is not where its keys have it: artists put it elsewhere, without a key."""
    scene = bpy.context.scene
    assert scene is not None
    frame = scene.frame_current_final
    return any(
        abs(getattr(target, curve.data_path)[curve.array_index] - curve.evaluate(frame)) > _SAME
        for curve in curves_of(action)
    )


def hangs_on(target: bpy.types.Object, owner: bpy.types.Object) -> bool:
    """Whether an object is the other, or moves with it as its parent or by a constraint."""
    each: bpy.types.Object | None = target
    while each is not None:
        if each == owner or any(
            getattr(constraint, "target", None) == owner and not constraint.mute
            for constraint in each.constraints
        ):
            return True
        each = each.parent
    return False


def matrix_rotation(matrix: Floats) -> Floats:
    """The rotation (3, 3) within a matrix (3, 3) that may scale, shear and mirror."""
    left, _, right = np.linalg.svd(matrix)
    turn = left @ right
    return turn if np.linalg.det(turn) > 0.0 else -turn
