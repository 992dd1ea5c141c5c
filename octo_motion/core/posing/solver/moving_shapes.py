# SPDX-License-Identifier: GPL-3.0-or-later
"""Where boxes and hulls that are pushed about touch what stands still, and each other.

Two convex bodies touch across the axis along which they are the least deep in each other, which is
the normal of a face or the cross product of two edges (Gottschalk et al. 1996); there the faces,
edges or corners that look at each other are cut with each other. In a plane, a ball or a mesh it is
the thing's corners that count. Capsules, of limbs and of balls, are the ``Detector``'s own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from ...rotations import Floats, to_matrix
from ..puppet import Integers
from .facing import Facing, features_facing
from .obstacle_shapes import Box, Capsule, Hull, Obstacle, Sphere

_MOST: Final = 8
"""Contacts between two things: more make nothing stand more firmly."""
_MOST_CROSSINGS: Final = 4096
"""Pairs of edges whose cross products are looked at; of hulls with more, faces alone count."""
_EDGES_LAG: Final = 0.02
"""Of the size, by which an edge must be better than a face to be taken: faces make things stand."""
_TINY: Final = 1e-12
_AXIS_SAMPLES: Final = 5
_LABELS: Final = 1 << 40
"""For two things."""


@dataclass(frozen=True, eq=False)
class Corners:
    """What of a shape can get into another one, in its own frame."""

    points: Floats
    """(points, 3)"""
    radius: float
    """Of balls about the points; 0 for corners."""
    normals: Floats
    """(normals, 3) of its faces; none where it is not bounded by faces."""
    edges: Floats
    """(edges, 3) unit, the ways along its edges."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A shape and where it is now."""

    shape: Obstacle
    body: int
    """−1 for one that stands."""
    frame: Floats
    """(3, 3)"""
    position: Floats
    """(3,)"""
    box: Floats | None
    """(2, 3) lower and upper corner in the world; None for one without end."""

    def near(self, other: Placed, margin: float) -> bool:
        """Whether the boxes about both are nearer than a margin."""
        if self.box is None or other.box is None:
            return True
        apart = np.maximum(self.box[0] - other.box[1], other.box[0] - self.box[1])
        return bool((apart < margin).all())


@dataclass(frozen=True, eq=False)
class Touches:
    """Contacts of one thing with another; of the first body, seen from the other."""

    body: int
    other: int
    points: Floats
    normals: Floats
    gaps: Floats
    labels: Integers


def placed(shape: Obstacle, body: int, frame: Floats, position: Floats) -> Placed:
    """A shape at a place."""
    bounds = shape.bounds
    if bounds is None:
        return Placed(shape, body, frame, position, None)
    middle = frame @ bounds.mean(axis=0) + position
    half = np.abs(frame) @ (0.5 * (bounds[1] - bounds[0]))
    return Placed(shape, body, frame, position, np.stack([middle - half, middle + half]))


class MovingShapes:
    """Finds contacts of things that have a shape; what hangs on shapes alone is kept."""

    def __init__(self) -> None:
        self._corners: WeakKeyDictionary[Obstacle, Corners | None] = WeakKeyDictionary()
        self._still: WeakKeyDictionary[Obstacle, Placed] = WeakKeyDictionary()

    def standing(self, obstacle: Obstacle) -> Placed:
        """An obstacle where it stands."""
        known = self._still.get(obstacle)
        if known is None:
            known = placed(obstacle, -1, to_matrix(obstacle.orientation), obstacle.position)
            self._still[obstacle] = known
        return known

    def find(
        self, moving: Sequence[Placed], still: Sequence[Obstacle], margin: float, label: int
    ) -> list[Touches]:
        """Contacts with a gap below ``margin``, m; labels count from one on."""
        found: list[Touches | None] = []
        others = [self.standing(each) for each in still]
        for number, thing in enumerate(moving):
            for other in (*others, *moving[number + 1 :]):
                if thing.near(other, margin):
                    found.append(self._between(thing, other, margin, label))
                label += _LABELS
        return [each for each in found if each is not None]

    def _between(self, one: Placed, other: Placed, margin: float, label: int) -> Touches | None:
        """Contacts of two things, the first of which moves."""
        ours, theirs = self._corners_of(one.shape), self._corners_of(other.shape)
        assert ours is not None
        if theirs is None:
            return _in(one, ours, other, margin, label)
        if not len(theirs.normals):
            found = _in(other, theirs, one, margin, label)
            return None if found is None else _turned_round(found)
        return _across(one, ours, other, theirs, margin, label)

    def _corners_of(self, shape: Obstacle) -> Corners | None:
        if shape not in self._corners:
            self._corners[shape] = corners_of(shape)
        return self._corners[shape]


def _in(one: Placed, corners: Corners, other: Placed, margin: float, label: int) -> Touches | None:
    """Corners of one that are in another, or nearly."""
    points = corners.points @ one.frame.T + one.position
    local = (points - other.position) @ other.frame
    distances, outs = other.shape.closest(local, corners.radius + margin)
    gaps = distances - corners.radius
    near = np.flatnonzero(gaps < margin)
    if not len(near):
        return None
    if len(near) > _MOST:
        near = near[_far_apart(points[near], gaps[near])]
    normals = outs[near] @ other.frame.T
    touching = points[near] - corners.radius * normals
    return Touches(one.body, other.body, touching, normals, gaps[near], label + near)


def _across(  # noqa: PLR0917
    one: Placed, ours: Corners, other: Placed, theirs: Corners, margin: float, label: int
) -> Touches | None:
    """Contacts of two convex things with faces."""
    first = ours.points @ one.frame.T + one.position
    second = theirs.points @ other.frame.T + other.position
    axes, faces = _axes(one, ours, other, theirs)
    # Seen from the second to the first; of the second's own faces outwards, of the first's inwards.
    low, high = (first @ axes.T).min(axis=0), (second @ axes.T).max(axis=0)
    apart = low - high
    best = int(np.argmax(apart[:faces]))
    if len(apart) > faces:
        edge = faces + int(np.argmax(apart[faces:]))
        size = float(np.ptp(first, axis=0).max() + np.ptp(second, axis=0).max())
        if apart[edge] > apart[best] + _EDGES_LAG * min(size, max(-apart[best], margin)):
            best = edge
    if apart[best] >= margin:
        return None
    facing = features_facing(Facing(first, second, axes[best]), margin)
    if facing is None:
        return None
    points, gaps, labels = facing
    if len(points) > _MOST:
        few = _far_apart(points, gaps)
        points, gaps, labels = points[few], gaps[few], labels[few]
    normals = np.tile(axes[best], (len(points), 1))
    return Touches(one.body, other.body, points, normals, gaps, label + labels)


def _axes(one: Placed, ours: Corners, other: Placed, theirs: Corners) -> tuple[Floats, int]:
    """(axes, 3) across which two things may be apart, and how many of them are faces'."""
    faces = np.concatenate([-(ours.normals @ one.frame.T), theirs.normals @ other.frame.T])
    if len(ours.edges) * len(theirs.edges) > _MOST_CROSSINGS:
        return faces, len(faces)
    way, across = ours.edges @ one.frame.T, theirs.edges @ other.frame.T
    crossed = np.cross(way[:, None], across[None]).reshape(-1, 3)
    size = np.sqrt((crossed * crossed).sum(axis=1))
    crossed = crossed[size > _PARALLEL] / size[size > _PARALLEL, None]
    return np.concatenate([faces, crossed, -crossed]), len(faces)


def _turned_round(touches: Touches) -> Touches:
    """The same, of the other one: what stands gets no contacts of its own."""
    points = touches.points - touches.gaps[:, None] * touches.normals
    return Touches(
        touches.other, touches.body, points, -touches.normals, touches.gaps, touches.labels
    )


def _far_apart(points: Floats, gaps: Floats) -> Integers:
    """Some of many points: those furthest out, and the deepest."""
    spread = points @ _WAYS.T
    chosen = np.concatenate([spread.argmax(axis=0), spread.argmin(axis=0), [gaps.argmin()]])
    return np.unique(chosen)


def corners_of(shape: Obstacle) -> Corners | None:
    """Of a shape; None where it has none, or too many."""
    if isinstance(shape, Box):
        signs = np.array([[(-1.0) ** (n >> axis & 1) for axis in range(3)] for n in range(8)])
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        return Corners(signs * shape.half, 0.0, normals, np.eye(3))
    if isinstance(shape, Hull):
        flat = shape.corners.reshape(-1, 3)
        edges = (shape.corners - np.roll(shape.corners, 1, axis=1)).reshape(-1, 3)
        edges /= np.maximum(np.linalg.norm(edges, axis=1), _TINY)[:, None]
        # The same way is the same axis, whichever end comes first.
        first = np.argmax(np.abs(edges) > _SAME, axis=1)
        edges *= np.sign(edges[np.arange(len(edges)), first])[:, None]
        return Corners(_different(flat), 0.0, _different(shape.normals), _different(edges))
    if isinstance(shape, Sphere):
        return Corners(np.zeros((1, 3)), shape.radius, _NONE, _NONE)
    if isinstance(shape, Capsule):
        shares = np.linspace(0.0, 1.0, _AXIS_SAMPLES)[:, None]
        points = (1.0 - shares) * shape.ends[0] + shares * shape.ends[1]
        return Corners(points, shape.radius, _NONE, _NONE)
    return None


def _different(rows: Floats) -> Floats:
    """Rows (rows, 3), each once."""
    scale = max(float(np.abs(rows).max()), _TINY)
    _, which = np.unique(np.round(rows / (_SAME * scale)), axis=0, return_index=True)
    return rows[np.sort(which)]


_SAME: Final = 1e-6
_PARALLEL: Final = 1e-3
_NONE: Final = np.zeros((0, 3))
_WAYS: Final = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]], float
)
