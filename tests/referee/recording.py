# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender plays: evaluated bones and deformed skin, in the world, at any moments.

Nothing here comes from the add-on: whatever made the action, what is recorded is what an artist
sees, with all constraints, drivers, parents and modifiers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Integers = NDArray[np.integer[Any]]
Flags = NDArray[np.bool_]

WEB = "Web"
"""Vertex group of a skin that is a web between limbs, and no limb's own."""


@dataclass(frozen=True, eq=False)
class Skin:
    """One deformed mesh over time."""

    points: Floats
    """(moments, vertices, 3), metres."""
    rest: Floats
    """(vertices, 3): undeformed, in the world."""
    edges: Integers
    """(edges, 2)."""
    faces: list[tuple[int, ...]]
    bones: Integers
    """(vertices,) the bone that each vertex follows most, -1 for none."""
    web: Flags
    """(vertices,) whether it is a web between limbs, by the vertex group that says so."""


@dataclass(frozen=True, eq=False)
class Recording:
    """An armature over time, as it is played."""

    frames: Floats
    """(moments,), between frames too."""
    fps: float
    names: list[str]
    """Of the bones that deform."""
    parents: Integers
    """(bones,) the nearest one above that deforms too, -1 for none."""
    heads: Floats
    """(moments, bones, 3), metres."""
    tails: Floats
    """(moments, bones, 3), metres."""
    turns: Floats
    """(moments, bones, 3, 3): orientation in the world."""
    skins: list[Skin]

    @property
    def middles(self) -> Floats:
        """(moments, bones, 3): the middle of each bone."""
        return 0.5 * (self.heads + self.tails)

    def chain(self, names: Sequence[str]) -> Integers:
        """Rows of bones by name."""
        return np.array([self.names.index(name) for name in names])


def moments(start: int, end: int, per_frame: int = 1) -> Floats:
    """Moments from one frame to another, so many per frame."""
    return np.linspace(start, end, (end - start) * per_frame + 1)


def show(scene: bpy.types.Scene, frame: float) -> None:
    """Let the scene be at a moment."""
    whole = int(np.floor(frame))
    scene.frame_set(whole, subframe=float(frame - whole))


def record(armature: bpy.types.Object, frames: Floats, *, with_skin: bool = True) -> Recording:
    """Play a scene through these moments, and keep what is there."""
    scene = bpy.context.scene
    assert scene is not None
    assert isinstance(armature.data, bpy.types.Armature)
    bones = [bone for bone in armature.data.bones if bone.use_deform]
    names = [bone.name for bone in bones]
    rows = {name: row for row, name in enumerate(names)}
    parents = np.array([_parent(bone, rows) for bone in bones])
    skin = [each for each in bpy.data.objects if _deforms(each, armature)]
    if not with_skin:
        # Nobody looks at it: Blender need not deform it at each moment.
        for mesh in skin:
            mesh.hide_viewport = True
    meshes = skin if with_skin else []
    heads, tails, turns = [], [], []
    points: list[list[Floats]] = [[] for _ in meshes]
    for frame in frames:
        show(scene, float(frame))
        graph = bpy.context.evaluated_depsgraph_get()
        played = armature.evaluated_get(graph)
        world = np.array(played.matrix_world)
        assert played.pose is not None
        matrices = np.array([world @ np.array(played.pose.bones[name].matrix) for name in names])
        lengths = np.array([played.pose.bones[name].length for name in names])
        axes = matrices[:, :3, :3]
        scales = np.linalg.norm(axes, axis=1, keepdims=True)
        heads.append(matrices[:, :3, 3])
        tails.append(matrices[:, :3, 3] + axes[:, :, 1] * lengths[:, None])
        turns.append(axes / scales)
        for mesh, kept in zip(meshes, points, strict=True):
            kept.append(_points(mesh.evaluated_get(graph)))
    skins = [_skin(mesh, np.array(kept), rows) for mesh, kept in zip(meshes, points, strict=True)]
    return Recording(
        frames,
        scene.render.fps / scene.render.fps_base,
        names,
        parents,
        np.array(heads),
        np.array(tails),
        np.array(turns),
        skins,
    )


def _parent(bone: bpy.types.Bone, rows: dict[str, int]) -> int:
    above = bone.parent
    while above is not None and above.name not in rows:
        above = above.parent
    return rows[above.name] if above is not None else -1


def _deforms(mesh: bpy.types.Object, armature: bpy.types.Object) -> bool:
    return (
        mesh.type == "MESH"
        and not mesh.hide_render
        and any(
            isinstance(each, bpy.types.ArmatureModifier) and each.object == armature
            for each in mesh.modifiers
        )
    )


def _points(played: bpy.types.Object) -> Floats:
    mesh = played.to_mesh()
    assert mesh is not None
    local = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", local)
    played.to_mesh_clear()
    world = np.array(played.matrix_world)
    placed = local.reshape(-1, 3).astype(float) @ world[:3, :3].T + world[:3, 3]
    # Half the memory: a thousand moments of a detailed skin are many.
    return placed.astype(np.float32)


def _skin(mesh: bpy.types.Object, points: Floats, rows: dict[str, int]) -> Skin:
    assert isinstance(mesh.data, bpy.types.Mesh)
    data = mesh.data
    if len(data.vertices) != points.shape[1]:
        raise ValueError(f"'{mesh.name}' has modifiers that add vertices: switch them off.")
    rest = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", rest)
    edges = np.empty(2 * len(data.edges), np.int32)
    data.edges.foreach_get("vertices", edges)
    groups = [rows.get(group.name, -1) for group in mesh.vertex_groups]
    bones = np.full(len(data.vertices), -1)
    web = np.zeros(len(data.vertices), bool)
    said = mesh.vertex_groups.find(WEB)
    for vertex in data.vertices:
        web[vertex.index] = any(each.group == said for each in vertex.groups)
        felt = [each for each in vertex.groups if groups[each.group] >= 0]
        if felt:
            bones[vertex.index] = groups[max(felt, key=lambda each: each.weight).group]
    world = np.array(mesh.matrix_world)
    return Skin(
        points,
        rest.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3],
        edges.reshape(-1, 2).astype(np.int64),
        [tuple(np.array(face.vertices).tolist()) for face in data.polygons],
        bones,
        web,
    )
