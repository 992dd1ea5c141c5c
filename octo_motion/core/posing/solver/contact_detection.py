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
from dataclasses import dataclass, field, fields, replace
from operator import attrgetter
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from ...rotations import Floats, rotate, to_matrix
from ..puppet import Figure, Flags, Integers, Pose, capsules_in_world, rest_pose
from .moving_shapes import MovingShapes, Placed, Touches, placed
from .obstacle_shapes import Box, Hull, Obstacle, Plane, nearest_on_segments

_MOST_SAMPLES: Final = 9
_TINY: Final = 1e-12


@dataclass(eq=False)
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
    speeds: Floats | None = None
    """(contacts, 3) velocity of the obstacle's surface there, m/s; None where all stand still."""

    def __len__(self) -> int:
        return len(self.bodies)


@dataclass(frozen=True, eq=False)
class CarriedCapsules:
    """Capsules that something else moves, whatever touches them."""

    ends: Floats
    """(capsules, 2, 3) of their axes, world."""
    radii: Floats
    """(capsules,)"""
    speeds: Floats
    """(capsules, 2, 3) of the ends, m/s."""
    meets: Flags
    """(bodies, capsules) which of the figure's bodies each can touch, …"""
    slack: Floats
    """… (bodies, capsules) and how far it has to be in it for that, m."""


_NOBODY: Final = np.zeros(0, np.int64)
_NO_ROWS: Final = np.zeros((0, 3))
_NO_ONES: Final = np.zeros(0)
NO_CONTACTS: Final = Contacts(_NOBODY, _NOBODY, _NO_ROWS, _NO_ROWS, _NO_ONES, _NOBODY)


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

    def __init__(
        self,
        figure: Figure,
        *,
        self_collision: bool,
        apart: Flags | None = None,
        stands: Pose | None = None,
    ) -> None:
        """Bodies of different owners push each other away but for those that are not ``apart``
        (bodies, bodies), see ``apart_at``. Limbs of one figure that overlap where it stands, or at
        rest where that is not said, never collide.
        """
        self._radii = figure.radii
        self._ends = figure.capsules.copy()
        self._first_label = len(figure) ** 2
        self._separate = _separate_ends(figure)
        self._owners = np.array(figure.owners or (0,) * len(figure))
        self._shapes = MovingShapes()
        lengths = np.linalg.norm(figure.capsules[:, 1] - figure.capsules[:, 0], axis=-1)
        self._long = lengths > 1e-6 * figure.radii + _TINY
        most = float(np.max(lengths / np.maximum(figure.radii, _TINY), initial=1.0))
        self._samples = int(min(max(np.ceil(most) + 1, 3), _MOST_SAMPLES))
        self._all_pairs = _pairs(figure, self._owners, stands, self_collision=self_collision)
        if apart is not None and self._all_pairs is not None:
            self._all_pairs &= apart
        # What was worked out of obstacles, kept as long as they are the same ones.
        self._planes: WeakKeyDictionary[Plane, _Touched] = WeakKeyDictionary()
        self._use_shapes(())
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
        if not obstacles and self.idle:
            return NO_CONTACTS
        ends = self._ends @ matrices.transpose(0, 2, 1)
        ends += positions[:, None]
        found: list[Contacts | None] = []
        boxes: tuple[Floats, Floats] | None = None
        moving = [each for each in obstacles if each.body >= 0]
        if moving or self._shaped:
            moving = [each for each in moving if _has_shape(each, len(self._radii))]
            self._use_shapes(tuple(each.body for each in moving))
            obstacles = [each for each in obstacles if each.body < 0]
        # Three places on each capsule: its ends and between.
        label = self._first_label
        for obstacle in obstacles:
            if isinstance(obstacle, Plane):
                found.append(self._on_plane(ends, obstacle, margin, label))
            else:
                boxes = boxes or self._boxes(ends, margin)
                there = self._shapes.standing(obstacle)
                found.append(self._on_solid(ends, boxes, there, margin, label))
            label += 3 * len(self._radii)
        if moving:
            boxes = boxes or self._boxes(ends, margin)
            there = [
                placed(each, each.body, matrices[each.body], positions[each.body])
                for each in moving
            ]
            for each in there:
                found.append(self._on_solid(ends, boxes, each, margin, label))
                label += 3 * len(self._radii)
            found += map(_touching, self._shapes.find(there, obstacles, margin, label))
        if self._pairs is not None:
            found.append(self._on_itself(ends, boxes or self._boxes(ends, margin), margin))
        return _joined([each for each in found if each is not None])

    def _use_shapes(self, bodies: tuple[int, ...]) -> None:
        """Let bodies that have a shape not touch by their capsules."""
        if getattr(self, "_shaped", None) == bodies:
            return
        self._shaped = bodies
        bare = np.ones(len(self._radii), dtype=bool)
        bare[list(bodies)] = False
        self._bare = bare
        self._keep = self._separate & bare[:, None]
        # (2 bodies,) how far from a plane both ends of each capsule touch it; never some.
        self._end_radii = np.where(self._keep, self._radii[:, None], -np.inf).ravel()
        self._planes.clear()
        pairs = self._all_pairs
        self._pairs = pairs if pairs is None or not bodies else pairs & bare & bare[:, None]
        self.idle = self._pairs is None
        """Whether no limb can touch another one."""

    def find_solids(
        self, positions: Floats, matrices: Floats, solids: Sequence[Obstacle], margin: float
    ) -> list[Contacts | None]:
        """The same with each of some solids that something else moves."""
        ends = self._ends @ matrices.transpose(0, 2, 1)
        ends += positions[:, None]
        boxes, found = self._boxes(ends, margin), list[Contacts | None]()
        label = self._first_label + _BEYOND
        for each in solids:
            if isinstance(each, Plane):
                found.append(self._on_plane(ends, each, margin, label))
            else:
                there = placed(each, -1, to_matrix(each.orientation), each.position)
                found.append(self._on_solid(ends, boxes, there, margin, label))
            label += 3 * len(self._radii)
        return found

    def find_carried(
        self, positions: Floats, matrices: Floats, carried: CarriedCapsules, margin: float
    ) -> Contacts:
        """The same with capsules that something else moves."""
        ends = self._ends @ matrices.transpose(0, 2, 1)
        ends += positions[:, None]
        low, high = self._boxes(ends, margin)
        around = carried.radii[:, None]
        own_low = np.minimum(carried.ends[:, 0], carried.ends[:, 1]) - around
        own_high = np.maximum(carried.ends[:, 0], carried.ends[:, 1]) + around
        near = carried.meets & (low[:, None] <= own_high).all(axis=2)
        near &= (high[:, None] >= own_low).all(axis=2)
        bodies, which = np.nonzero(near)
        if not len(bodies):
            return NO_CONTACTS
        on_body, on_other = nearest_on_segments(ends[bodies], carried.ends[which])
        away = on_body - on_other
        distance = np.sqrt((away * away).sum(axis=-1))
        gaps = distance - self._radii[bodies] - carried.radii[which] + carried.slack[bodies, which]
        touching = np.flatnonzero((gaps < margin) & (distance > _TINY))
        if not len(touching):
            return NO_CONTACTS
        bodies, which, gaps = bodies[touching], which[touching], gaps[touching]
        normals = away[touching] / distance[touching, None]
        points = on_body[touching] - normals * self._radii[bodies, None]
        # Below all others: what obstacles there are may change.
        labels = -1 - (bodies * len(carried.radii) + which)
        share = _share(carried.ends[which], on_other[touching])
        speeds = carried.speeds[which, 0] * (1.0 - share) + carried.speeds[which, 1] * share
        others = np.full(len(bodies), -1)
        return Contacts(bodies, others, points, normals, gaps, labels, speeds)

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
        there: Placed,
        margin: float,
        label: int,
    ) -> Contacts | None:
        near, obstacle, frame = self._around(there, boxes), there.shape, there.frame
        if not len(near):
            return None
        local = (ends[near] - there.position) @ frame
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
        points = centres @ frame.T + there.position - radii[:, None] * normals
        return _with_obstacle(bodies, points, normals, apart - radii, labels, there.body)

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

    def _around(self, there: Placed, boxes: tuple[Floats, Floats]) -> Integers:
        """The bodies whose capsules' boxes touch that of an obstacle."""
        low, high = boxes
        touch = self._bare
        if there.box is not None:
            touch = ((low <= there.box[1]) & (high >= there.box[0])).all(axis=1) & touch
        if there.body >= 0:
            touch = touch & (self._owners != self._owners[there.body])
        return np.flatnonzero(touch)

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


def _with_obstacle(  # noqa: PLR0917
    bodies: Integers,
    points: Floats,
    normals: Floats,
    gaps: Floats,
    labels: Integers,
    other: int = -1,
) -> Contacts:
    others = np.empty(len(bodies), np.int64)
    others.fill(other)
    return Contacts(bodies, others, points, normals, gaps, labels)


def _touching(touches: Touches) -> Contacts:
    count = len(touches.gaps)
    bodies = np.full(count, touches.body)
    place = (touches.points, touches.normals, touches.gaps, touches.labels)
    return _with_obstacle(bodies, *place, touches.other)


def _has_shape(obstacle: Obstacle, bodies: int) -> bool:
    """Whether it is a shape that one of so many bodies can have."""
    return obstacle.body < bodies and isinstance(obstacle, Box | Hull)


def _share(ends: Floats, points: Floats) -> Floats:
    """(rows, 1) how far along segments (rows, 2, 3) points (rows, 3) on them are."""
    along = ends[:, 1] - ends[:, 0]
    square = np.maximum((along * along).sum(axis=1), _TINY)
    return (((points - ends[:, 0]) * along).sum(axis=1) / square)[:, None]


def joined_contacts(found: Sequence[Contacts]) -> Contacts:
    """All of them, in this order."""
    return _joined([each for each in found if len(each)])


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


def _pairs(
    figure: Figure, owners: Integers, stands: Pose | None, *, self_collision: bool
) -> Flags | None:
    """(bodies, bodies) which capsules may collide: those of different owners, and limbs of one
    figure that are no neighbours and do not overlap where it stands, or at rest. None where none
    may.
    """
    strangers = np.triu(owners[:, None] != owners, 1)
    if not self_collision:
        return strangers if strangers.any() else None
    parents = np.array(figure.parents)
    allowed = np.triu(owners[:, None] == owners, 1)
    for body, parent in enumerate(parents):
        if parent >= 0:
            allowed[parent, body] = False
            allowed[np.ix_([body], np.flatnonzero(parents == parent))] = False
    return (allowed & apart_at(figure, stands or rest_pose(figure))) | strangers


def apart_at(figure: Figure, pose: Pose) -> Flags:
    """(bodies, bodies) which capsules, the first before the second, do not overlap in a pose."""
    count = len(figure)
    first, second = np.triu_indices(count, 1)
    ends = capsules_in_world(figure, pose)
    a, b = nearest_on_segments(ends[first], ends[second])
    room = np.linalg.norm(a - b, axis=-1) - figure.radii[first] - figure.radii[second]
    apart = np.zeros((count, count), dtype=bool)
    apart[first, second] = room > 0.0
    return apart


_columns: Final = attrgetter(*(each.name for each in fields(Contacts) if each.name != "speeds"))


def _joined(found: list[Contacts]) -> Contacts:
    if not found:
        return NO_CONTACTS
    if len(found) == 1:
        return found[0]
    columns = (np.concatenate(column) for column in zip(*map(_columns, found), strict=True))
    speeds = None
    if any(each.speeds is not None for each in found):
        still = (np.zeros((len(each), 3)) if each.speeds is None else each.speeds for each in found)
        speeds = np.concatenate([*still])
    return replace(Contacts(*columns), speeds=speeds)


_BEYOND: Final = 1 << 50
"""Labels from there on are those of solids that are carried."""
_AROUND: Final = np.linspace(-1.0, 1.0, 7)
