# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground that moves or deforms: each place of it is a point in a face, which is carried along."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats, dot, from_matrix, normalized
from .surface import HeightField, faces_of

_HIDDEN: Final = (1, 2, 4, 8, 16, 32, 64)
"""Samples away from which one without a face takes the next one's, in turn."""


@dataclass(frozen=True, eq=False)
class MovingMesh:
    """A mesh over time, of the same faces all the time."""

    frames: Floats
    """(n,) ascending; the first is that at which motions are planned."""
    points: np.ndarray
    """(n, vertices, 3) world, single precision: many frames of a large mesh are much."""
    corners: np.ndarray
    """(faces, 3) vertices of each triangle."""

    @cached_property
    def triangles(self) -> Floats:
        """(faces, 3, 3) at the first frame, world."""
        return self.points[0].astype(np.float64)[self.corners]

    def at(self, face: np.ndarray, frame: Floats) -> Floats:
        """Corners (n, 3, 3) of faces (n,) at frames (n,), also between two."""
        place = np.interp(frame, self.frames, np.arange(len(self.frames)))
        before = np.minimum(place.astype(np.int64), len(self.frames) - 1)
        after = np.minimum(before + 1, len(self.frames) - 1)
        vertices = self.corners[face]
        share = (place - before)[:, None, None]
        first = self.points[before[:, None], vertices].astype(np.float64)
        return first + share * (self.points[after[:, None], vertices] - first)


@dataclass(frozen=True, eq=False)
class Carpet:
    """A ground as it was planned on, sample by sample a part of a mesh that moves."""

    mesh: MovingMesh
    field: HeightField
    faces: np.ndarray
    """(nx, ny) of the mesh, at each sample of the field."""

    @classmethod
    def of(cls, mesh: MovingMesh, field: HeightField, plan: Floats, source: np.ndarray) -> Carpet:
        """The ground that faces (m, 3, 3) make, which come from (m,) faces of a mesh."""
        found = faces_of(plan, field)
        found = np.where(found >= 0, source[found], -1)
        for step in _HIDDEN:
            for axis, way in ((0, step), (0, -step), (1, step), (1, -step)):
                found = np.where(found < 0, np.roll(found, way, axis=axis), found)
        return cls(mesh, field, np.maximum(found, 0))

    def around(self, points: Floats) -> tuple[Floats, np.ndarray, Floats]:
        """The samples (n, 4, 3) round points (n, 2 or 3), the faces they are of (n, 4), and how
        much each of them counts (n, 4).
        """
        origin, spacing = np.array(self.field.origin), self.field.spacing
        most = np.array(self.faces.shape) - 2
        place = (points[:, :2] - origin) / spacing
        first = np.clip(np.floor(place).astype(np.int64), 0, most)
        share = np.clip(place - first, 0.0, 1.0)
        steps = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
        number = first[:, None] + steps
        column, row = number[..., 0], number[..., 1]
        weights = np.prod(np.where(steps == 1, share[:, None], 1.0 - share[:, None]), axis=-1)
        samples = np.empty((*column.shape, 3))
        samples[..., :2] = origin + spacing * number
        samples[..., 2] = self.field.heights[column, row]
        return samples, self.faces[column, row], weights

    def moved(self, samples: Floats, faces: np.ndarray, frames: Floats) -> Floats:
        """Where places (n, 4, 3) of faces (n, 4) at the first frame, world, are at others (n,)."""
        face, place = faces.reshape(-1), samples.reshape(-1, 3)
        corners = self.mesh.at(face, np.full(len(face), self.mesh.frames[0]))
        first, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        away = place - first
        uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(away, u), dot(away, v)
        area = np.maximum(uu * vv - uv * uv, 1e-30)
        s, t = (wu * vv - wv * uv) / area, (wv * uu - wu * uv) / area
        there = self.mesh.at(face, np.repeat(frames, faces.shape[1]))
        sides = s[:, None] * (there[:, 1] - there[:, 0]) + t[:, None] * (there[:, 2] - there[:, 0])
        return (there[:, 0] + sides).reshape(samples.shape)


def turn_between(before: Floats, after: Floats) -> Floats:
    """Turns (n, 4) from one cross of four places (n, 4, 3) to another: before, behind, to either
    side of a point.
    """
    axes: list[Floats] = []
    for cross in (before, after):
        along, across = cross[:, 0] - cross[:, 1], cross[:, 2] - cross[:, 3]
        up = normalized(np.cross(along, across))
        ahead = normalized(normalized(along) + np.cross(normalized(across), up))
        axes.append(np.stack([ahead, np.cross(up, ahead), up], axis=-1))
    return from_matrix(axes[1] @ np.swapaxes(axes[0], -1, -2))
