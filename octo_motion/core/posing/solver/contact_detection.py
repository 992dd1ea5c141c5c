# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a figure touches something, or is about to: its capsules against obstacles and each other.

A capsule is seen as spheres along its axis. Both end spheres can touch; between them only the
nearest one to the obstacle, found on samples no further apart than the radius and then refined.

An end that has got into a box or through it within a step, for what turns fast moves on an arc that
no step foresees, is seen from the face that it went in by until it is out of there again: by its
nearest face a thin board would let it out on the other side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from ...rotations import Floats, rotate, to_matrix
from ..puppet import Figure, Flags, Integers, capsules_in_world, rest_pose
from .obstacle_shapes import Box, Obstacle, Plane

_MOST_SAMPLES: Final = 9
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Contacts:
    """Pairs of points that touch or may within the step."""

    bodies: Integers
    """(contacts,)"""
    others: Integers
    """(contacts,) the other body, −1 where it is an obstacle."""
    points: Floats
    """(contacts, 3) on the body's surface, world."""
    normals: Floats
    """(contacts, 3) from the other to the body."""
    gaps: Floats
    """(contacts,) less than 0 where they overlap."""
    labels: Integers
    """(contacts,) the same number for the same place on the same thing in every step."""

    def __len__(self) -> int:
        return len(self.bodies)


_NOBODY: Final = np.zeros(0, np.int64)
_NO_ROWS: Final = np.zeros((0, 3))
_NO_ONES: Final = np.zeros(0)
_NONE: Final = Contacts(_NOBODY, _NOBODY, _NO_ROWS, _NO_ROWS, _NO_ONES, _NOBODY)


@dataclass(eq=False)
class _Touched:
    """A plane, and what touched it in the last step: often the same ends again."""

    normal: Floats
    """(3,)"""
    reach: Floats
    """(ends,) how far along the normal an end touches it."""
    key: tuple[int, bytes] = (0, b"")
    """First label, and which ends were near."""
    found: Contacts | None = None
    """Their contacts, of which places and gaps are old."""
    inward: Floats = field(default_factory=_NO_ROWS.copy)
    """(contacts, 3) from the surface to the end's middle."""


class Detector:
    """Finds the contacts of one figure; what hangs on the figure alone is worked out once."""

    def __init__(self, figure: Figure, *, self_collision: bool) -> None:
        self._radii = figure.radii
        self._ends = figure.capsules.copy()
        self._first_label = len(figure) ** 2
        keep = _separate_ends(figure)
        self._keep = keep
        # (2 bodies,) how far from a plane both ends of each capsule touch it; never some.
        self._end_radii = np.where(keep, figure.radii[:, None], -np.inf).ravel()
        lengths = np.linalg.norm(figure.capsules[:, 1] - figure.capsules[:, 0], axis=-1)
        self._long = lengths > 1e-6 * figure.radii + _TINY
        most = float(np.max(lengths / np.maximum(figure.radii, _TINY), initial=1.0))
        self._samples = int(min(max(np.ceil(most) + 1, 3), _MOST_SAMPLES))
        self._pairs = _pairs(figure) if self_collision else None
        # What was worked out of obstacles, kept as long as they are the same ones.
        self._planes: WeakKeyDictionary[Plane, _Touched] = WeakKeyDictionary()
        self._world_boxes: WeakKeyDictionary[Obstacle, Floats] = WeakKeyDictionary()
        self.forget()
        self._reach = float(figure.radii.max(initial=0.0))

    def forget(self) -> None:
        """The figure was put elsewhere: it came there by no way."""
        # Of each box (bodies, 2 ends, 3), in its frame: where ends were last that are not in it.
        self._outside: WeakKeyDictionary[Box, Floats] = WeakKeyDictionary()

    def find(
        self, positions: Floats, matrices: Floats, obstacles: Sequence[Obstacle], margin: float
    ) -> Contacts:
        """Contacts with a gap below ``margin``, m, of bodies whose joints are at positions (bodies,
        3), world, with orientations (bodies, 3, 3).
        """
        if not obstacles and self._pairs is None:
            return _NONE
        ends = self._ends @ matrices.transpose(0, 2, 1)
        ends += positions[:, None]
        found: list[Contacts] = []
        boxes: tuple[Floats, Floats] | None = None
        # Three places on each capsule: its ends and between.
        label = self._first_label
        for obstacle in obstacles:
            if isinstance(obstacle, Plane):
                contacts = self._on_plane(ends, obstacle, margin, label)
            else:
                if boxes is None:
                    boxes = self._boxes(ends, margin)
                contacts = self._on_solid(ends, boxes, obstacle, margin, label)
            label += 3 * len(self._radii)
            if contacts is not None:
                found.append(contacts)
        if self._pairs is not None:
            contacts = self._on_itself(ends, boxes or self._boxes(ends, margin), margin)
            if contacts is not None:
                found.append(contacts)
        return _joined(found)

    def _boxes(self, ends: Floats, margin: float) -> tuple[Floats, Floats]:
        around = (self._radii + margin)[:, None]
        first, second = ends[:, 0], ends[:, 1]
        return np.minimum(first, second) - around, np.maximum(first, second) + around

    def _on_plane(self, ends: Floats, plane: Plane, margin: float, label: int) -> Contacts | None:
        touched = self._touched(plane)
        centres = ends.reshape(-1, 3)
        gaps = centres @ touched.normal
        gaps -= touched.reach
        near = (gaps < margin).nonzero()[0]
        if not len(near):
            return None
        gaps = gaps.take(near)
        found = touched.found
        if found is None or touched.key != (label, near.tobytes()):
            bodies = near >> 1
            normals = np.tile(touched.normal, (len(near), 1))
            labels = 3 * bodies + (near & 1) + label
            touched.inward = self._radii[bodies, None] * normals
            points = centres.take(near, 0) - touched.inward
            touched.found = _with_obstacle(bodies, points, normals, gaps, labels)
            touched.key = label, near.tobytes()
            return touched.found
        points = centres.take(near, 0) - touched.inward
        return Contacts(found.bodies, found.others, points, found.normals, gaps, found.labels)

    def _on_solid(
        self,
        ends: Floats,
        boxes: tuple[Floats, Floats],
        obstacle: Obstacle,
        margin: float,
        label: int,
    ) -> Contacts | None:
        near = self._around(obstacle, boxes)
        if not len(near):
            return None
        frame = to_matrix(obstacle.orientation)
        local = (ends[near] - obstacle.position) @ frame
        start, along = local[:, :1], local[:, 1:] - local[:, :1]
        reach = self._reach + margin
        shares = np.broadcast_to(
            np.linspace(0.0, 1.0, self._samples), (len(near), self._samples)
        ).copy()
        distances, outs = obstacle.closest(start + shares[..., None] * along, reach)
        self._see_from_outside(obstacle, near, local, distances, outs)
        rows = np.arange(len(near))
        limits = self._radii[near] + margin
        # Bodies, labels, distances, directions and places, each in parts.
        found: list[tuple[Integers, Integers, Floats, Floats, Floats]] = []

        def add(which: Integers, sample: Integers | int, place: int) -> None:
            centres = start[which, 0] + shares[which, sample, None] * along[which, 0]
            labels = 3 * near[which] + place + label
            apart, outward = distances[which, sample], outs[which, sample]
            found.append((near[which], labels, apart, outward, centres))

        for end, sample in ((0, 0), (1, self._samples - 1)):
            kept = self._keep[near, end] & (distances[:, sample] < limits)
            add(np.flatnonzero(kept), sample, end)
        best, least = np.argmin(distances, axis=1), distances.min(axis=1)
        slack = 1e-6 * self._radii[near]
        inner = (best > 0) & (best < self._samples - 1) & self._long[near] & (least < limits)
        # No nearer than an end, and the end will do.
        inner &= least < np.minimum(distances[:, 0], distances[:, -1]) - slack
        picked = np.flatnonzero(inner)
        if len(picked):
            middle = _middle(shares[picked], distances[picked], slack[picked])
            start, along = start[picked], along[picked]
            rows, near, slack = np.arange(len(picked)), near[picked], slack[picked]
            width = 1.0 / (self._samples - 1)
            for _ in range(3):
                shares = np.clip(middle[:, None] + width * _AROUND, 0.0, 1.0)
                distances, outs = obstacle.closest(start + shares[..., None] * along, reach)
                middle = _middle(shares, distances, slack)
                width *= _AROUND[1] - _AROUND[0]
            shares = middle[:, None]
            distances, outs = obstacle.closest(start + shares[..., None] * along, reach)
            add(rows, 0, 2)
        bodies, labels, apart, outward, centres = map(np.concatenate, zip(*found, strict=True))
        if not len(bodies):
            return None
        radii = self._radii[bodies]
        normals = outward @ frame.T
        points = centres @ frame.T + obstacle.position - radii[:, None] * normals
        return _with_obstacle(bodies, points, normals, apart - radii, labels)

    def _see_from_outside(
        self, box: Obstacle, near: Integers, ends: Floats, distances: Floats, outs: Floats
    ) -> None:
        """Let distances (near, samples) and ways out (near, samples, 3) of ends (near, 2, 3) that
        have gone into a box be those of the face that they went in by.
        """
        if not isinstance(box, Box):
            return
        known = self._outside.get(box)
        now = np.full((len(self._radii), 2, 3), np.nan)
        now[near] = ends
        if known is not None:
            before = known[near]
            entered, axis = box.entered(before, ends)
            if entered.any():
                now[near] = np.where(entered[..., None], before, ends)
                body, end = entered.nonzero()
                face = axis[body, end]
                side = np.sign(before[body, end, face])
                sample = -end
                outs[body, sample] = side[:, None] * np.eye(3)[face]
                distances[body, sample] = side * ends[body, end, face] - box.half[face]
        self._outside[box] = now

    def _around(self, obstacle: Obstacle, boxes: tuple[Floats, Floats]) -> Integers:
        """The bodies whose boxes touch that of an obstacle."""
        low, high = boxes
        box = self._world_box(obstacle)
        if box is None:
            return np.arange(len(low))
        return np.flatnonzero(((low <= box[1]) & (high >= box[0])).all(axis=1))

    def _on_itself(
        self, ends: Floats, boxes: tuple[Floats, Floats], margin: float
    ) -> Contacts | None:
        low, high = boxes
        assert self._pairs is not None
        overlap = self._pairs.copy()
        for axis in range(3):
            overlap &= low[:, None, axis] <= high[None, :, axis] - margin
            overlap &= high[:, None, axis] - margin >= low[None, :, axis]
        first, second = np.nonzero(overlap)
        if not len(first):
            return None
        on_first, on_second = nearest_on_segments(ends[first], ends[second])
        away = on_first - on_second
        distance = np.sqrt((away * away).sum(axis=-1))
        gaps = distance - self._radii[first] - self._radii[second]
        near = np.flatnonzero((gaps < margin) & (distance > _TINY))
        if not len(near):
            return None
        normals = away[near] / distance[near, None]
        bodies = first[near]
        points = on_first[near] - normals * (self._radii[bodies] + 0.5 * gaps[near])[:, None]
        labels = bodies * len(self._radii) + second[near]
        return Contacts(bodies, second[near], points, normals, gaps[near], labels)

    def _touched(self, plane: Plane) -> _Touched:
        known = self._planes.get(plane)
        if known is None:
            normal = rotate(plane.orientation, (0.0, 0.0, 1.0))
            known = _Touched(normal, self._end_radii + float(normal @ plane.position))
            self._planes[plane] = known
        return known

    def _world_box(self, obstacle: Obstacle) -> Floats | None:
        """Lower and upper corner in the world."""
        known, bounds = self._world_boxes.get(obstacle), obstacle.bounds
        if known is not None or bounds is None:
            return known
        frame = to_matrix(obstacle.orientation)
        middle = frame @ bounds.mean(axis=0) + obstacle.position
        half = np.abs(frame) @ (0.5 * (bounds[1] - bounds[0]))
        known = self._world_boxes[obstacle] = np.stack([middle - half, middle + half])
        return known


def _with_obstacle(
    bodies: Integers, points: Floats, normals: Floats, gaps: Floats, labels: Integers
) -> Contacts:
    others = np.empty(len(bodies), np.int64)
    others.fill(-1)
    return Contacts(bodies, others, points, normals, gaps, labels)


def nearest_on_segments(first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Nearest points of segments ``(…, 2 ends, 3)``, on each; clamping after Ericson (2005)."""
    p, d = first[..., 0, :], first[..., 1, :] - first[..., 0, :]
    q, e = second[..., 0, :], second[..., 1, :] - second[..., 0, :]
    r = p - q
    dd, ee, de = (d * d).sum(-1), (e * e).sum(-1), (d * e).sum(-1)
    dr, er = (d * r).sum(-1), (e * r).sum(-1)
    determinant = dd * ee - de * de
    # Parallel: any point will do, take the middle of the first.
    skew = determinant > 1e-9 * dd * ee + _TINY**2
    s = np.where(skew, (de * er - dr * ee) / np.where(skew, determinant, 1.0), 0.5)
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((de * s + er) / np.maximum(ee, _TINY), 0.0, 1.0)
    s = np.clip((de * t - dr) / np.maximum(dd, _TINY), 0.0, 1.0)
    return p + s[..., None] * d, q + t[..., None] * e


def _middle(shares: Floats, distances: Floats, slack: Floats) -> Floats:
    """(rows,) the middle of the samples that are as near as the nearest: of a flat top, its."""
    least = distances <= distances.min(axis=1, keepdims=True) + slack[:, None]
    return (shares * least).sum(axis=1) / least.sum(axis=1)


def _separate_ends(figure: Figure) -> Flags:
    """(bodies, 2) which end spheres can touch first: none that lies within a neighbour's."""
    keep = np.ones((len(figure), 2), dtype=bool)
    for body, parent in enumerate(figure.parents):
        if parent < 0:
            continue
        joint = figure.anchors[body]
        near = np.linalg.norm(figure.capsules[body, 0])
        for end in range(2):
            apart = near + np.linalg.norm(figure.capsules[parent, end] - joint)
            larger = figure.radii[parent] - figure.radii[body]
            if apart <= max(larger, 0.0) + 1e-6 * figure.radii[body] and keep[parent, end]:
                keep[body, 0] = False
            elif apart <= max(-larger, 0.0) + 1e-6 * figure.radii[body] and keep[body, 0]:
                keep[parent, end] = False
    return keep


def _pairs(figure: Figure) -> Flags:
    """(bodies, bodies) which capsules may collide: no neighbours, none that overlap at rest."""
    count = len(figure)
    parents = np.array(figure.parents)
    allowed = np.triu(np.ones((count, count), dtype=bool), 1)
    for body, parent in enumerate(parents):
        if parent >= 0:
            allowed[parent, body] = False
            allowed[np.ix_([body], np.flatnonzero(parents == parent))] = False
    ends = capsules_in_world(figure, rest_pose(figure))
    first, second = np.nonzero(allowed)
    if len(first):
        a, b = nearest_on_segments(ends[first], ends[second])
        room = np.linalg.norm(a - b, axis=-1) - figure.radii[first] - figure.radii[second]
        overlapping = room <= 0.0
        allowed[first[overlapping], second[overlapping]] = False
    return allowed


_columns: Final = attrgetter(*(each.name for each in fields(Contacts)))


def _joined(found: list[Contacts]) -> Contacts:
    if not found:
        return _NONE
    if len(found) == 1:
        return found[0]
    return Contacts(*(np.concatenate(column) for column in zip(*map(_columns, found), strict=True)))


_AROUND: Final = np.linspace(-1.0, 1.0, 7)
