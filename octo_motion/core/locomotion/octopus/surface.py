# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh that grows by blocks of vertices and quads, with materials and influences of bones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from ...rotations import Floats
from .topology import Indices, cap_grid, cap_interior, ring_quads, sheet_quads
from .weights import Influences, strongest


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

    def mesh(self) -> OctopusMesh:
        """All of it, without vertices that no face uses: holes were cut round them."""
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
        )
