# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of the scene as surfaces: where they are, what a creature walks on, what is solid."""

from __future__ import annotations

from typing import Any, Final

import bmesh
import bpy
import numpy as np
from mathutils import Vector

from ...core.content_cache import ContentCache, content_key
from ...core.errors import GroundError, RigError
from ...core.locomotion.ground import GroundMesh
from ...core.phrases import phrase
from ...core.posing.solver import Box, Capsule, Hull, Mesh, Obstacle, Plane, Sphere
from ...core.rotations import Floats, from_matrix
from ..animation import time_kept
from ..rig import vertex_positions, world_of
from .grasp_target import may_move


def is_enabled(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether Blender works an object out, hidden by its eye or not: its modifiers count."""
    layer = depsgraph.view_layer
    return not obj.hide_viewport and layer is not None and obj.name in layer.objects


# --- Mesh objects to what a creature walks on, and meshes to how thick its arms are ---------------


_faces_known: Final[ContentCache[Floats]] = ContentCache(2)
_corners_known: Final[ContentCache[np.ndarray]] = ContentCache(2)


def read_triangles(
    ground: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> tuple[Floats, bytes]:
    """The faces of a mesh object as of :func:`read_ground_mesh`, (faces, 3, 3) world.

    With them comes a key of their content, for what is made from them.

    Raises:
        GroundError: the object is no mesh, or has no faces.
    """
    mesh = read_ground_mesh(ground, depsgraph)
    return mesh.triangles, mesh.content


def read_ground_mesh(ground: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> GroundMesh:
    """A mesh object as it is seen, modifiers and all.

    Raises:
        GroundError: the object is no mesh, or has no faces.
    """
    if ground.type != "MESH":
        raise GroundError(
            phrase("'{ground}' is not a mesh.", ground=ground.name), "Choose a mesh as the ground."
        )
    if ground.mode == "EDIT":
        ground.update_from_editmode()
    evaluated = ground.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        if mesh is None or len(mesh.loop_triangles) == 0:
            raise GroundError(
                phrase("The ground '{ground}' has no faces.", ground=ground.name),
                "Choose another mesh.",
            )
        points = vertex_positions(mesh)
        corners, content = _corners(mesh, points)
    finally:
        evaluated.to_mesh_clear()
    world = np.array(world_of(ground, depsgraph), dtype=np.float64)
    key = content_key(content, world)

    def placed() -> Floats:
        moved = points.astype(np.float64) @ world[:3, :3].T + world[:3, 3]
        return moved[corners]

    return GroundMesh(key, lambda: _faces_known.get(key, placed), content, world)


def _corners(mesh: bpy.types.Mesh, points: np.ndarray) -> tuple[np.ndarray, bytes]:
    """Vertices (faces, 3) of a mesh's triangles, and a key of its content; its points are
    (vertices, 3).
    """

    def read() -> np.ndarray:
        corners = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners.ravel())
        return corners

    # How faces are cut into triangles hangs on nothing else, and takes much longer to read.
    starts = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    vertices = np.empty(len(mesh.loops), dtype=np.int32)
    # The attribute is much quicker to read than the property that shows the same.
    attribute: Any = mesh.attributes[".corner_vert"]
    attribute.data.foreach_get("value", vertices)
    content = content_key(points, starts, vertices)
    return _corners_known.get(content, read), content


_DEFORMS: Final = frozenset(
    {
        *("ARMATURE", "CAST", "CLOTH", "CURVE", "DISPLACE", "DYNAMIC_PAINT", "FLUID", "HOOK"),
        *("LATTICE", "MESH_CACHE", "MESH_DEFORM", "MESH_SEQUENCE_CACHE", "NODES", "OCEAN"),
        *("SHRINKWRAP", "SIMPLE_DEFORM", "SOFT_BODY", "SURFACE_DEFORM", "WARP", "WAVE"),
    }
)
"""Modifiers that may make another mesh of the same vertices at another frame."""
_LOOKS: Final = np.array([0.0, 0.29, 0.62, 1.0])
"""Shares of the frames at which it is looked whether it does."""


def may_change(ground: bpy.types.Object) -> bool:
    """Whether a mesh object may be another one at another frame."""
    data = ground.data
    assert isinstance(data, bpy.types.Mesh)
    keys = data.shape_keys
    animated = data.animation_data or (keys is not None and keys.animation_data)
    deforms = any(each.type in _DEFORMS and each.show_viewport for each in ground.modifiers)
    return bool(may_move(ground) or animated or deforms)


def read_motion(ground: bpy.types.Object, frames: Floats) -> tuple[np.ndarray, np.ndarray] | None:
    """How a mesh object moves and deforms: its vertices (n, vertices, 3) at frames (n,), world, and
    those of its triangles (faces, 3); none where it stays as it is.

    Raises:
        GroundError: it has other vertices or faces from frame to frame.
    """
    scene = bpy.context.scene
    assert scene is not None
    with time_kept(scene) as go_to:

        def read(frame: float) -> tuple[np.ndarray, np.ndarray]:
            go_to(frame)
            depsgraph = bpy.context.evaluated_depsgraph_get()
            mesh = ground.evaluated_get(depsgraph).to_mesh()
            assert mesh is not None
            points = vertex_positions(mesh)
            corners = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
            mesh.loop_triangles.foreach_get("vertices", corners.ravel())
            ground.evaluated_get(depsgraph).to_mesh_clear()
            world = np.array(world_of(ground, depsgraph), dtype=np.float64)
            return (points @ world[:3, :3].T + world[:3, 3]).astype(np.float32), corners

        looked = [read(float(frame)) for frame in np.quantile(frames, _LOOKS)]
        first, corners = looked[0]
        for points, others in looked[1:]:
            if points.shape != first.shape or len(others) != len(corners):
                raise GroundError(
                    phrase("The ground '{ground}' changes its faces.", ground=ground.name),
                    "Choose a mesh that keeps its vertices, or apply the modifier that changes "
                    "them.",
                )
        if all(np.array_equal(points, first) for points, _ in looked):
            return None
        return np.stack([read(float(frame))[0] for frame in frames]), corners


# --- Objects that the artist has marked as solid, as obstacles for a puppet -----------------------


MOST_TRIANGLES: Final = 50_000
"""More would keep a session from running in real time."""


def read_obstacle(item: bpy.types.Object, kind: str, unit: float) -> Obstacle:
    """One object as an obstacle, as it is shown now, in puppet metres: ``unit`` of them are one of
    the world's.

    A box, a ball and a capsule are fitted to the object's own bounds, and turn and scale with it; a
    plane lies at its origin and is solid below its local Z axis.

    Raises:
        RigError: the object has no size, no surface, or too much of it, or is nowhere.
    """
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = np.array(shown.matrix_world, dtype=np.float64)
    sizes = np.linalg.norm(world[:3, :3], axis=0)
    if not np.isfinite(world).all():
        raise RigError(
            phrase("The obstacle '{item}' is at an undefined position.", item=item.name),
            "Clear its location, rotation and scale (Object > Clear).",
        )
    if sizes.min() <= 0.0:
        raise RigError(
            phrase("The obstacle '{item}' has no size.", item=item.name), "Repair its scale."
        )
    axes = world[:3, :3] / sizes
    # Of what is mirrored, another axis than a plane's is turned round.
    axes[:, 0] *= np.sign(np.linalg.det(axes)) or 1.0
    turn = from_matrix(axes)
    if kind == "PLANE":
        return Plane(position=world[:3, 3] * unit, orientation=turn)
    if kind in ("HULL", "MESH"):
        corners = _triangles(shown, convex=kind == "HULL") * unit
        return Hull(corners=corners) if kind == "HULL" else Mesh(corners=corners)
    low, high = _bounds(shown)
    half = np.maximum(0.5 * (high - low) * sizes * unit, 1e-6)
    middle = world[:3, :3] @ (0.5 * (low + high)) + world[:3, 3]
    if kind == "BOX":
        return Box(position=middle * unit, orientation=turn, half=half)
    if kind == "SPHERE":
        return Sphere(position=middle * unit, orientation=turn, radius=float(half.max()))
    along = int(np.argmax(half))
    radius = float(np.delete(half, along).max())
    reach = np.zeros(3)
    reach[along] = max(half[along] - radius, 1e-6)
    ends = np.stack([-reach, reach])
    return Capsule(position=middle * unit, orientation=turn, ends=ends, radius=radius)


def _bounds(shown: bpy.types.Object) -> tuple[Floats, Floats]:
    """Lower and upper corner (3,) of an object in its own space."""
    corners = np.array([Vector(corner) for corner in shown.bound_box], dtype=np.float64)
    _check_corners(shown, corners)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not (high > low).any():
        # Empties and the like show how large they are in their own way.
        size = float(getattr(shown, "empty_display_size", 0.0))
        if size <= 0.0:
            raise RigError(
                phrase("The obstacle '{shown}' has no size.", shown=shown.name), "Repair its scale."
            )
        return np.full(3, -size), np.full(3, size)
    return low, high


def _check_corners(shown: bpy.types.Object, places: np.ndarray) -> None:
    if not np.isfinite(places).all():
        raise RigError(
            phrase("The obstacle '{shown}' has corners at undefined positions.", shown=shown.name),
            "Repair its mesh.",
        )


def _triangles(shown: bpy.types.Object, *, convex: bool) -> Floats:
    """Triangles (triangles, 3, 3) of a surface in the world, or of the hull about it."""
    try:
        mesh = shown.to_mesh()
    except RuntimeError:
        mesh = None
    if mesh is None or not len(mesh.polygons):
        raise RigError(
            phrase("The obstacle '{shown}' has no faces.", shown=shown.name),
            "Choose another shape for it: a box.",
        )
    _check_corners(shown, vertex_positions(mesh))
    editable = bmesh.new()
    try:
        editable.from_mesh(mesh)
        editable.transform(shown.matrix_world)
        if convex:
            # What is inside the hull, and what of the surface is no part of it, goes.
            hull = bmesh.ops.convex_hull(
                editable, input=list(editable.verts), use_existing_faces=False
            )
            outer = {each for each in hull["geom"] if isinstance(each, bmesh.types.BMFace)}
            spare = [face for face in editable.faces if face not in outer]
            bmesh.ops.delete(editable, geom=[*spare], context="FACES_ONLY")
        found = np.array(
            [[loop.vert.co[:] for loop in loops] for loops in editable.calc_loop_triangles()],
            dtype=np.float64,
        )
    finally:
        editable.free()
        shown.to_mesh_clear()
    if len(found) > MOST_TRIANGLES:
        raise RigError(
            phrase(
                "The obstacle '{shown}' has {count} triangles, more than {most_triangles}.",
                shown=shown.name,
                count=len(found),
                most_triangles=MOST_TRIANGLES,
            ),
            "Mark a simpler object in its place, or choose another shape for it.",
        )
    return found
