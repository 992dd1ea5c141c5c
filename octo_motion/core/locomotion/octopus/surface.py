# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh that grows by blocks of vertices and quads, with materials and influences of bones.

A loop of vertices runs anticlockwise seen from outside, so that every face looks outwards.
Influences are a pair of arrays of one shape (…, k): indices of bones and their weights. A bone
may occur twice, and an influence of weight zero means nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats
from ...smoothing import smooth_step
from .rig import BODY, FIRST_ARM_BONE, HEAD, MANTLE
from .shape import HEAD_MIDDLE, MANTLE_EDGE, NECK, OctopusShape

Indices = NDArray[np.int64]


def sheet_quads(sheet: Indices) -> Indices:
    """Faces of a grid of vertices (…, rows, columns), as (…, rows − 1, columns − 1, 4).

    They look towards rows × columns (right-handed).
    """
    return np.stack(
        [sheet[..., :-1, :-1], sheet[..., 1:, :-1], sheet[..., 1:, 1:], sheet[..., :-1, 1:]],
        axis=-1,
    )


def closed(sheet: Indices) -> Indices:
    """The grid (…, columns) with its first column again after the last, to close it to a tube."""
    return np.concatenate([sheet, sheet[..., :1]], axis=-1)


def ring_quads(outer: Indices, inner: Indices) -> Indices:
    """Faces from a closed loop (…, n) to the loop (…, n) inside or above it, as (…, n, 4)."""
    return np.stack(
        [outer, np.roll(outer, -1, axis=-1), np.roll(inner, -1, axis=-1), inner], axis=-1
    )


def cap_size(loop_length: int) -> tuple[int, int]:
    """Sides (a, b), a even, of the grid that fills a loop of ``2 (a + b)`` vertices."""
    a = max(2, 2 * round(loop_length / 8))
    return a, loop_length // 2 - a


def cap_grid(loop: Indices, interior: Indices, a: int) -> Indices:
    """Vertices of a filling grid, (…, a + 1, b + 1), from its border and its inside (…, a − 1, b −
    1).

    The loop (…, 2 (a + b)) begins with the corner (0, 0), then comes side a.
    """
    b = loop.shape[-1] // 2 - a
    grid = np.empty((*loop.shape[:-1], a + 1, b + 1), dtype=loop.dtype)
    grid[..., :, 0] = loop[..., : a + 1]
    grid[..., a, :] = loop[..., a : a + b + 1]
    grid[..., ::-1, b] = loop[..., a + b : 2 * a + b + 1]
    grid[..., 0, 1:b] = loop[..., : 2 * a + b : -1]
    grid[..., 1:a, 1:b] = interior
    return grid


def cap_interior(border: Floats, a: int) -> Floats:
    """Points inside a filled loop (…, a − 1, b − 1, d): Coons' patch.

    The border (…, 2 (a + b), d) is positions, or anything else that blends; a, faces along its
    first side.
    """
    b = border.shape[-2] // 2 - a
    bottom = border[..., : a + 1, :]
    right = border[..., a : a + b + 1, :]
    top = border[..., a + b : 2 * a + b + 1, :][..., ::-1, :]
    left = np.concatenate([border[..., 2 * a + b :, :], border[..., :1, :]], axis=-2)[..., ::-1, :]
    u = (np.arange(1, a) / a)[:, None, None]
    v = (np.arange(1, b) / b)[None, :, None]
    corners = (
        (1 - u) * (1 - v) * bottom[..., None, :1, :]
        + u * (1 - v) * bottom[..., None, -1:, :]
        + u * v * top[..., None, -1:, :]
        + (1 - u) * v * top[..., None, :1, :]
    )
    return (
        (1 - v) * bottom[..., 1:-1, None, :]
        + v * top[..., 1:-1, None, :]
        + (1 - u) * left[..., None, 1:-1, :]
        + u * right[..., None, 1:-1, :]
        - corners
    )


def patch_border(patch: Indices) -> Indices:
    """The loops (…, 2 (r + c)) around holes that take the place of grids (…, r + 1, c + 1)."""
    return np.concatenate(
        [
            patch[..., :-1, 0],
            patch[..., -1, :-1],
            patch[..., :0:-1, -1],
            patch[..., 0, :0:-1],
        ],
        axis=-1,
    )


# --- Which bones move a point of the skin, and how much -------------------------------------------


MOST_INFLUENCES: Final = 4
"""What game engines and real-time viewers take."""
_NEGLIGIBLE: Final = 1e-3
"""Smaller weights are left out."""


class Influences(NamedTuple):
    bones: Indices
    weights: Floats


def ramp(start: float, stop: float, values: Floats) -> Floats:
    """0 before ``start``, 1 after ``stop``, and a smooth step (…) in between."""
    return smooth_step((values - start) / (stop - start))


def rigid(bone: int, shape: tuple[int, ...]) -> Influences:
    """Points that move with one bone alone."""
    return Influences(np.full((*shape, 1), bone, dtype=np.int64), np.ones((*shape, 1)))


def mixed(first: Influences, second: Influences, share: Floats) -> Influences:
    """Both, with ``share`` (…) of the second."""
    first_weights, second_weights = first.weights, second.weights
    return Influences(
        np.concatenate([first.bones, second.bones], axis=-1),
        np.concatenate(
            [first_weights * (1.0 - share[..., None]), second_weights * share[..., None]], axis=-1
        ),
    )


def along_arm(shape: OctopusShape, arm: Indices, distance: Floats) -> Influences:
    """Influences (…, 3) at distances from P₀ along arms (negative under the body).

    The weights are the quadratic B-spline over the bones: each bone's share rises and falls with
    a continuous slope, half of it is gone at its joints, and its neighbours take the rest. A
    coil then bends the skin evenly, not at the joints. Before P₀ the body takes over, within one
    diameter.
    """
    joint = np.where(
        distance < 0.0,
        distance / shape.first_diameter,
        np.interp(distance, shape.reach, np.arange(shape.joints + 1.0)),
    )
    bone = np.clip(np.floor(joint), -1, shape.joints - 1)
    f = np.maximum(joint - bone, 0.0)
    weights = np.stack([0.5 * (1 - f) ** 2, 0.75 - (f - 0.5) ** 2, 0.5 * f**2], axis=-1)
    index = bone[..., None].astype(np.int64) + np.array([-1, 0, 1])
    in_skeleton = FIRST_ARM_BONE + arm[..., None] * shape.joints
    return Influences(
        np.where(index < 0, BODY, in_skeleton + np.minimum(index, shape.joints - 1)), weights
    )


def along_body(station: Floats) -> Influences:
    """Influences (…, 3) of body, head and mantle at stations of the body's axis."""
    head = ramp(-1.0, HEAD_MIDDLE, station)
    mantle = ramp(NECK - 0.7, MANTLE_EDGE + 1.0, station)
    bones = np.broadcast_to(np.array([BODY, HEAD, MANTLE]), (*station.shape, 3))
    return Influences(bones, np.stack([1.0 - head, head * (1.0 - mantle), head * mantle], axis=-1))


def strongest(influences: Influences) -> Influences:
    """At most ``MOST_INFLUENCES`` of them, each bone once, strongest first, with sum one.

    What the first one left out weighs is taken from all that stay: so the choice does not jump
    between neighbouring points, and equal weights stay or go together.
    """
    bones, weights = influences.bones, influences.weights.copy()
    count = bones.shape[-1]
    for later in range(1, count):
        for earlier in range(later):
            same = bones[..., earlier] == bones[..., later]
            weights[..., earlier] += np.where(same, weights[..., later], 0.0)
            weights[..., later] = np.where(same, 0.0, weights[..., later])
    if count < MOST_INFLUENCES:
        widen = [(0, 0)] * (bones.ndim - 1) + [(0, MOST_INFLUENCES - count)]
        bones, weights = np.pad(bones, widen), np.pad(weights, widen)
    order = np.argsort(-weights, axis=-1, kind="stable")
    bones = np.take_along_axis(bones, order, axis=-1)
    weights = np.take_along_axis(weights, order, axis=-1)
    kept = weights[..., :MOST_INFLUENCES]
    if count > MOST_INFLUENCES:
        kept = kept - weights[..., MOST_INFLUENCES, None]
    kept = np.where(kept > _NEGLIGIBLE, kept, 0.0)
    return Influences(bones[..., :MOST_INFLUENCES], kept / np.sum(kept, axis=-1, keepdims=True))


# --- The mesh -------------------------------------------------------------------------------------


class SkinMaterial(IntEnum):
    """Slots of the mesh's materials."""

    SKIN = 0
    UNDERSIDE = 1
    SUCKER = 2
    EYE = 3
    PUPIL = 4
    BEAK = 5


@dataclass(frozen=True)
class OctopusMesh:
    """The skin as plain arrays, in the armature's space."""

    vertices: Floats
    """(vertices, 3), in metres."""
    quads: Indices
    """(faces, 4), anticlockwise seen from outside."""
    materials: Indices
    """(faces,), a ``SkinMaterial`` each."""
    bones: Indices
    """(vertices, 4), index of a bone for each influence."""
    weights: Floats
    """(vertices, 4), strongest first, sum 1; zero where there are fewer influences."""
    web: NDArray[np.bool_]
    """(vertices,) whether it belongs to the web between the arms alone."""


@dataclass
class Surface:
    """What is built so far."""

    count: int = 0
    _points: list[Floats] = field(default_factory=list)
    _bones: list[Indices] = field(default_factory=list)
    _weights: list[Floats] = field(default_factory=list)
    _quads: list[Indices] = field(default_factory=list)
    _materials: list[Indices] = field(default_factory=list)
    _mirrored: bool = False

    @contextmanager
    def mirrored(self) -> Iterator[None]:
        """Within it, what is added on the left is added on the right."""
        self._mirrored = True
        try:
            yield
        finally:
            self._mirrored = False

    def add_vertices(self, points: Floats, influences: Influences) -> Indices:
        """New vertices at points (…, 3); their indices (…)."""
        shape = points.shape[:-1]
        bones, weights = strongest(influences)
        if self._mirrored:
            points = points * [-1.0, 1.0, 1.0]
        self._points.append(points.reshape(-1, 3))
        self._bones.append(np.broadcast_to(bones, (*shape, bones.shape[-1])).reshape(-1, 4))
        self._weights.append(np.broadcast_to(weights, (*shape, weights.shape[-1])).reshape(-1, 4))
        indices = self.count + np.arange(len(self._points[-1]))
        self.count += len(indices)
        return indices.reshape(shape)

    def add_quads(self, quads: Indices, material: SkinMaterial | Indices) -> None:
        """New faces (…, 4), of one material or one each (…)."""
        if self._mirrored:
            quads = quads[..., ::-1]
        self._quads.append(quads.reshape(-1, 4))
        materials = np.broadcast_to(np.asarray(material, dtype=np.int64), quads.shape[:-1])
        self._materials.append(materials.reshape(-1))

    def add_cap(
        self,
        loop: Indices,
        border: Floats,
        influences: Influences,
        material: SkinMaterial,
        *,
        first_side: int,
        onto: Callable[[Floats], Floats] | None = None,
    ) -> None:
        """Fill loops with grids.

        Args:
            loop: (…, n) vertices.
            border: (…, n, d) where they are, in space or in the domain of ``onto``.
            influences: (…, 1, 1, k) of the vertices inside.
            material: of the faces.
            first_side: faces along the grid's side that begins with the loop.
            onto: takes the points inside, (…, d), to where they belong, (…, 3).
        """
        interior = cap_interior(border, first_side)
        inside = self.add_vertices(onto(interior) if onto else interior, influences)
        self.add_quads(sheet_quads(cap_grid(loop, inside, first_side)), material)

    def add_rings(
        self,
        loop: Indices,
        rings: Floats,
        influences: Influences,
        materials: Sequence[SkinMaterial],
    ) -> Indices:
        """Faces from loops through rings of new vertices; the last loops (…, n).

        Args:
            loop: (…, n) vertices that are there.
            rings: (…, r, n, 3), points of the rings, one after the other.
            influences: (…, r, n, k)
            materials: r, of the faces that end at each ring.
        """
        vertices = self.add_vertices(rings, influences)
        outer = loop
        for number, material in enumerate(materials):
            inner = vertices[..., number, :]
            self.add_quads(ring_quads(outer, inner), material)
            outer = inner
        return outer

    def mesh(self, without_web: int) -> OctopusMesh:
        """All of it, without vertices that no face uses: holes were cut round them.

        Vertices from that number on are the web's.
        """
        quads = np.concatenate(self._quads)
        used = np.zeros(self.count, dtype=bool)
        used[quads] = True
        renumbered = np.cumsum(used) - 1
        return OctopusMesh(
            vertices=np.concatenate(self._points)[used],
            quads=renumbered[quads],
            materials=np.concatenate(self._materials),
            bones=np.concatenate(self._bones)[used],
            weights=np.concatenate(self._weights)[used],
            web=np.arange(self.count)[used] >= without_web,
        )
