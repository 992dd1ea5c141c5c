# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh objects to what a creature walks on, and meshes to how thick its arms are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import bpy
import numpy as np

from ...core.content_cache import ContentCache, content_key
from ...core.errors import GroundError
from ...core.locomotion.rig import ArmSkin, arm_skin, joint_positions, nearest_bones
from ...core.rotations import Floats
from ...core.skeleton import Skeleton
from ..rig import deformed_meshes
from .world import world_of

_MOST_POINTS: Final = 6000
"""Points of a skin that are looked at; an arm's thickness needs no more."""
_THICKEST: Final = 0.2
"""Arm lengths from an arm's middle line: what is further away is not its skin."""
_SLENDER: Final = (0.03, 0.008)
"""Radius of an arm without a skin at its root and at its tip, in arm lengths."""
_ROUNDED: Final = 1e-5
"""Share of an armature's size, and of 1, to which it is known where its skin is."""
_SHARE: Final = 0.9
"""Of the points round a joint, the share that lies nearer to it than its radius: an arm lies on its
suckers, and on what comes out at bends …"""
_STANDS_OUT: Final = 1.25
"""… unless they are so many times as far away as half of them: webs and fins are no thickness …"""
_AT_LEAST: Final = 0.7
"""… but then this share lies nearer."""


_skins_known: Final[ContentCache[list[ArmSkin]]] = ContentCache(4)
_faces_known: Final[ContentCache[Floats]] = ContentCache(2)
_corners_known: Final[ContentCache[np.ndarray]] = ContentCache(2)


def read_triangles(
    ground: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> tuple[Floats, bytes]:
    """The faces of a mesh object as it is seen, modifiers and all, (faces, 3, 3) world.

    With them comes a key of their content, for what is made from them.

    Raises:
        GroundError: the object is no mesh, or has no faces.
    """
    if ground.type != "MESH":
        raise GroundError(f"'{ground.name}' is not a mesh.", "Choose a mesh as the ground.")
    if ground.mode == "EDIT":
        ground.update_from_editmode()
    evaluated = ground.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        if mesh is None or len(mesh.loop_triangles) == 0:
            raise GroundError(f"The ground '{ground.name}' has no faces.", "Choose another mesh.")
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        _read(mesh, "position", "vector", points.ravel())
        corners, content = _corners(mesh, points)
    finally:
        evaluated.to_mesh_clear()
    world = np.array(world_of(ground, depsgraph), dtype=np.float64)
    key = content_key(content, world)

    def placed() -> Floats:
        moved = points.astype(np.float64) @ world[:3, :3].T + world[:3, 3]
        return moved[corners]

    return _faces_known.get(key, placed), key


def _corners(mesh: bpy.types.Mesh, points: np.ndarray) -> tuple[np.ndarray, bytes]:
    """Vertices (faces, 3) of a mesh's triangles, and a key of its content.

    Args:
        mesh: the mesh.
        points: (vertices, 3) its vertices.
    """

    def read() -> np.ndarray:
        corners = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners.ravel())
        return corners

    # How faces are cut into triangles hangs on nothing else, and takes much longer to read.
    starts = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    vertices = np.empty(len(mesh.loops), dtype=np.int32)
    _read(mesh, ".corner_vert", "value", vertices)
    content = content_key(points, starts, vertices)
    return _corners_known.get(content, read), content


def _read(mesh: bpy.types.Mesh, name: str, what: str, values: np.ndarray) -> None:
    """Read an attribute into an array: much quicker than the property that shows the same."""
    data: Any = mesh.attributes[name]
    data.data.foreach_get(what, values)


def arm_skins(
    armature: bpy.types.Object, skeleton: Skeleton, arms: Sequence[Sequence[str]]
) -> list[ArmSkin]:
    """How far the skin of each arm is from its bones at rest.

    Where no mesh hangs on the armature, arms are taken to be slender.
    """
    joints = [joint_positions(skeleton, bones) for bones in arms]
    frames = [skeleton.rest_rotations[[skeleton.index[name] for name in bones]] for bones in arms]
    points = _skin(armature, float(np.ptp(np.concatenate(joints), axis=0).max()))
    return _skins_known.get(
        content_key(points, joints, frames), lambda: _arm_skins(points, joints, frames)
    )


def _arm_skins(points: Floats, joints: Sequence[Floats], frames: Sequence[Floats]) -> list[ArmSkin]:
    """The same from points of the skin.

    Args:
        points: (n, 3).
        joints: for each arm (bones + 1, 3).
        frames: for each arm (bones, 4) its bones' rest orientations.
    """
    lengths = [float(np.linalg.norm(np.diff(each, axis=0), axis=1).sum()) for each in joints]
    found = [nearest_bones(points, each) for each in joints]
    distances = np.stack([np.linalg.norm(off, axis=1) for _, _, off in found])
    nearest = distances.argmin(axis=0)
    skins = []
    for arm, (bone, share, _) in enumerate(found):
        own = (nearest == arm) & (distances[arm] < _THICKEST * lengths[arm])
        slender = lengths[arm] * np.linspace(*_SLENDER, len(joints[arm]))
        radii = _radii(distances[arm][own], (bone + share)[own], slender)
        skins.append(arm_skin(points[own], joints[arm], frames[arm], radii))
    return skins


def _skin(armature: bpy.types.Object, size: float) -> Floats:
    """Some points (n, 3) of the meshes that the armature moves, at rest, armature space.

    Args:
        armature: the armature object.
        size: how large it is, armature units.
    """
    inverse = np.linalg.inv(np.array(armature.matrix_world, dtype=np.float64))
    found: list[tuple[np.ndarray, Floats]] = []
    for item in deformed_meshes(armature):
        mesh = item.data
        assert isinstance(mesh, bpy.types.Mesh)
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        if len(points):
            _read(mesh, "position", "vector", points.ravel())
        place = inverse @ np.array(item.matrix_world, dtype=np.float64)
        # Wherever the armature has walked to, its skin is as thick.
        place[:3, :3] = np.round(place[:3, :3] / _ROUNDED) * _ROUNDED
        place[:3, 3] = np.round(place[:3, 3] / (_ROUNDED * size)) * (_ROUNDED * size)
        found.append((points, place))
    step = max(1, sum(len(points) for points, _ in found) // _MOST_POINTS)
    parts, passed = [np.empty((0, 3))], 0
    for points, place in found:
        some = points[-passed % step :: step].astype(np.float64)
        parts.append(some @ place[:3, :3].T + place[:3, 3])
        passed += len(points)
    return np.concatenate(parts)


def _radii(distance: Floats, along: Floats, otherwise: Floats) -> Floats:
    """The radius at each joint (joints,), where there are points round it, else its neighbours'."""
    places = np.arange(len(otherwise))
    radii = np.full(len(otherwise), np.nan)
    for joint in places:
        near = distance[np.abs(along - joint) <= 0.5]
        if len(near):
            half, many, most = np.quantile(near, [0.5, _AT_LEAST, _SHARE])
            radii[joint] = max(many, min(most, _STANDS_OUT * half))
    known = np.isfinite(radii)
    if not np.any(known):
        return otherwise
    return np.interp(places, places[known], radii[known])
