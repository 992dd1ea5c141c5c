# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground as a mesh: how high it is under a point, and how deep a point is in it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from .recording import Flags, Floats, Integers

_UPRIGHT = 1e-9
"""Square metres on the map: less is a wall, that nothing stands on."""
_AT_ONCE = 1 << 20
"""Points: all of a skin over a thousand moments would fill gigabytes several times."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles, sorted into cells of the map."""

    planes: Floats
    """(9, triangles) of corners a, b, c, with u = b − a and v = c − a: a on the map; what x and y
    from there count in shares of u and of v; and heights of a, u and v. Metres."""
    low: Floats
    """(2,) the map's corner."""
    cell: float
    """Metres."""
    shape: tuple[int, int]
    listed: Integers
    """(cells, most) triangles over each cell, -1 for none."""
    ceiling: Floats
    """(cells,) height of the highest corner over each cell, metres."""
    tree: BVHTree

    @classmethod
    def of(cls, ground: bpy.types.Object) -> Surface:
        """A mesh object's, as it is in the world."""
        graph = bpy.context.evaluated_depsgraph_get()
        played = ground.evaluated_get(graph)
        mesh = played.to_mesh()
        assert mesh is not None
        mesh.calc_loop_triangles()
        world = np.array(played.matrix_world)
        corners = np.array([vertex.co for vertex in mesh.vertices]) @ world[:3, :3].T + world[:3, 3]
        indices = np.array([each.vertices for each in mesh.loop_triangles])
        played.to_mesh_clear()
        tree = BVHTree.FromPolygons(corners.tolist(), indices.tolist())
        triangles = corners[indices]
        edges = triangles[:, 1:, :2] - triangles[:, :1, :2]
        area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
        floors = triangles[area > _UPRIGHT]
        low, high = floors[..., :2].min(axis=(0, 1)), floors[..., :2].max(axis=(0, 1))
        # As wide as most are narrow: beside each other on a cell of long treads were a dozen.
        extent = np.ptp(floors[..., :2], axis=1).min(axis=-1)
        cell = float(max(np.median(extent), np.max(high - low) / 400.0))
        shape = (int((high[0] - low[0]) / cell) + 1, int((high[1] - low[1]) / cell) + 1)
        listed = _listed(floors, low, cell, shape)
        tops = np.where(listed >= 0, floors[listed].max(axis=-2)[..., 2], -np.inf)
        return cls(_planes(floors), low, cell, shape, listed, tops.max(axis=-1), tree)

    def near(self, points: Floats, height: float = 0.0) -> Flags:
        """Which points (…, 3) may be less than so high over the ground: a quick look."""
        flat = points.reshape(-1, 3)
        found = np.empty(len(flat), bool)
        for few in _few(len(flat)):
            cells, inside = self._cells(flat[few])
            found[few] = inside & (flat[few, 2] - height < self.ceiling[cells])
        return found.reshape(points.shape[:-1])

    def heights(self, points: Floats) -> Floats:
        """How high the ground is under points (…, 3), metres; -inf beside it."""
        flat = points.reshape(-1, 3)
        found = [self._heights(flat[few]) for few in _few(len(flat))]
        return np.concatenate([*found, np.empty(0)]).reshape(points.shape[:-1])

    def _heights(self, flat: Floats) -> Floats:
        cells, inside = self._cells(flat)
        heights = np.full(len(flat), -np.inf)
        for column in self.listed.T:
            numbers = column[cells]
            some = np.flatnonzero(inside & (numbers >= 0))
            a_x, a_y, s_x, s_y, t_x, t_y, a_z, u_z, v_z = self.planes[:, numbers[some]]
            x, y = flat[some, 0] - a_x, flat[some, 1] - a_y
            s, t = x * s_x + y * s_y, x * t_x + y * t_y
            over = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)
            z = a_z + s * u_z + t * v_z
            rows = some[over]
            heights[rows] = np.maximum(heights[rows], z[over])
        return heights

    def depths(self, points: Floats) -> Floats:
        """How far points (…, 3) are below the surface, metres; negative, or -inf, above it.

        Beside a wall a point is as deep as the wall is near, not as the wall is high.
        """
        found = np.full(points.shape[:-1], -np.inf)
        some = self.near(points)
        picked = points[some]
        depths = self.heights(picked) - picked[:, 2]
        for row in np.flatnonzero(depths > 0.0):
            nearest = self.tree.find_nearest(picked[row].tolist())
            if nearest[3] is not None:
                depths[row] = min(depths[row], nearest[3])
        found[some] = depths
        return found

    def _cells(self, points: Floats) -> tuple[Integers, Flags]:
        places = np.floor((points[..., :2] - self.low) / self.cell).astype(int)
        inside = np.all((places >= 0) & (places < self.shape), axis=-1)
        return np.where(inside, places[..., 0] * self.shape[1] + places[..., 1], 0), inside


def _planes(triangles: Floats) -> Floats:
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    shares = v[:, 1] / area, -v[:, 0] / area, -u[:, 1] / area, u[:, 0] / area
    return np.stack([a[:, 0], a[:, 1], *shares, a[:, 2], u[:, 2], v[:, 2]])


def _few(count: int) -> list[slice]:
    return [slice(start, start + _AT_ONCE) for start in range(0, count, _AT_ONCE)]


def _listed(triangles: Floats, low: Floats, cell: float, shape: tuple[int, int]) -> Integers:
    first = ((triangles[..., :2].min(axis=1) - low) / cell).astype(int)
    last = ((triangles[..., :2].max(axis=1) - low) / cell).astype(int)
    cells: list[list[int]] = [[] for _ in range(shape[0] * shape[1])]
    for number, ((i0, j0), (i1, j1)) in enumerate(zip(first, last, strict=True)):
        for i in range(i0, min(i1, shape[0] - 1) + 1):
            for j in range(j0, min(j1, shape[1] - 1) + 1):
                cells[i * shape[1] + j].append(number)
    most = max(len(each) for each in cells)
    return np.array([each + [-1] * (most - len(each)) for each in cells])
