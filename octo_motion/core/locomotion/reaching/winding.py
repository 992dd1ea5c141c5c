# SPDX-License-Identifier: GPL-3.0-or-later
"""The form of an object round an axis, and the way of an arm that winds about it.

An object is cut across its axis into slices; of each slice only the outline is kept that a tight
string round it would have: its support function ``h(φ)``, the farthest that it reaches in each
direction. What such a slice becomes when it grows by the thickness of an arm is ``h + ρ``, so an
arm's middle line keeps clear of corners by exactly as much as of flat faces. Slices may differ
along the axis: a bottle's neck stays narrow. Across the axis hollows count as filled.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import RigError
from ...rotations import Floats, normalized

_SLICES: Final = 48
_DIRECTIONS: Final = 72
_ELONGATED: Final = 1.2
"""An object so many times as long as wide has its axis along it."""
_SNAP: Final = np.cos(np.radians(10.0))
"""An axis as close as this to one of the object's own is that."""
_WIDEST: Final = 0.1
"""Cosine of the widest angle at which a slice's outline is looked at."""
_HALVINGS: Final = 20
_THICKNESSES: Final = 5
_LIFTINGS: Final = 6
_PRESSED: Final = 0.3
"""Share of the skin's radius by which the middle of a bone presses into the object: flesh gives."""
_ROUND: Final = 1.5
"""An object less long than so many times its width is held where it is wide."""
_WIDE: Final = 0.95
"""Share of the largest radius that counts as wide."""

_ANGLES: Final = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
_CIRCLE: Final = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


@dataclass(frozen=True, eq=False)
class Profile:
    """An object's form about its axis, in the frame of the object, any unit of length."""

    center: Floats
    """(3,) a point on the axis, from which heights count."""
    axes: Floats
    """(3, 3) columns: two directions across, and the axis."""
    heights: Floats
    """(slices,) along the axis, ascending."""
    support: Floats
    """(slices, directions) how far each slice reaches in even directions round the axis."""

    def to_profile(self, points: Floats) -> Floats:
        """Points (…, 3) of the object's frame as two coordinates across and a height."""
        return (points - self.center) @ self.axes

    def to_object(self, points: Floats) -> Floats:
        """Inverse of :meth:`to_profile`."""
        return points @ self.axes.T + self.center

    @property
    def outline(self) -> Floats:
        """(points, 3) all round its slices, in the object's frame."""
        across = self.support[..., None] * _CIRCLE.T
        along = np.broadcast_to(self.heights[:, None, None], (*self.support.shape, 1))
        return self.to_object(np.concatenate([across, along], axis=-1)).reshape(-1, 3)

    def clearance(self, points: Floats) -> Floats:
        """Distance (…,) across the axis from the surface, negative within; object's frame.

        Beyond the ends of the axis it is the distance from them, where that is more.
        """
        local = self.to_profile(points)
        flat = local.reshape(-1, 3)
        outline = _at_height(self.heights, self.support, flat[:, 2])
        across = np.max(flat[:, :2] @ _CIRCLE - outline, axis=-1)
        beyond = np.maximum(self.heights[0] - flat[:, 2], flat[:, 2] - self.heights[-1])
        return np.maximum(across, beyond).reshape(local.shape[:-1])

    def scaled(self, factor: float) -> Profile:
        """The same in another unit."""
        sizes = (factor * self.heights, factor * self.support)
        return Profile(factor * self.center, self.axes, *sizes)

    def way_out(self, points: Floats, near: Floats) -> Floats:
        """Vectors (…, 3) from the axis towards points (…, 3), across it; object's frame.

        Their length is 1 far from the axis, 0.7 at the distance ``near`` (…) and 0 on it, so that
        nothing jumps where a point passes from one side to the other.
        """
        local = self.to_profile(points)
        local[..., 2] = 0.0
        size = np.sqrt(np.sum(local * local, axis=-1) + near * near)
        return (local / size[..., None]) @ self.axes.T

    def grown(self, skin: float) -> Floats:
        """Support (slices, directions) of the object with a skin of this thickness all over it."""
        apart = self.heights[:, None] - self.heights
        near = np.abs(apart) <= skin
        reach = np.where(near, np.sqrt(np.maximum(skin * skin - apart * apart, 0.0)), -np.inf)
        return np.max(self.support[None] + reach[..., None], axis=1)


def profile_of(vertices: Floats, triangles: np.ndarray, axis: Floats | None = None) -> Profile:
    """The form of a mesh with vertices (vertices, 3) in the object's frame, and triangles
    (triangles, 3).

    It is wound about an axis (3,); without one, about the longest way through the object, and where
    no way is longest, the one nearest to z.

    Raises:
        RigError: the mesh has no faces, or no size along its axis.
    """
    if len(triangles) == 0:
        raise RigError("The object to grasp has no faces.", "Choose an object with a surface.")
    corners = vertices[triangles]
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    whole = float(areas.sum())
    if not np.isfinite(whole) or whole <= 0.0:
        raise RigError("The object to grasp has no size.", "Give it a scale greater than zero.")
    center = areas @ corners.mean(axis=1) / whole
    along = _main_axis(corners - center, areas / whole) if axis is None else normalized(axis)
    across = np.eye(3)[np.argmin(np.abs(along))]
    first = normalized(across - (across @ along) * along)
    axes = np.stack([first, np.cross(along, first), along], axis=1)
    local = (corners - center) @ axes
    low, high = float(local[..., 2].min()), float(local[..., 2].max())
    inset = 1e-4 * max(high - low, 1e-9)
    heights = np.linspace(low + inset, high - inset, _SLICES)
    return Profile(center, axes, heights, _slices(local, heights))


def _main_axis(corners: Floats, shares: Floats) -> Floats:
    middles = corners.mean(axis=1)
    # The second moments of a triangle's surface about a point.
    moments = np.einsum("t,tka,tkb->ab", shares / 12.0, corners, corners)
    moments += np.einsum("t,ta,tb->ab", 0.75 * shares, middles, middles)
    sizes, axes = np.linalg.eigh(moments)
    if np.sqrt(sizes[2]) < _ELONGATED * np.sqrt(sizes[1]):
        return np.array([0.0, 0.0, 1.0])
    along = axes[:, 2]
    nearest = int(np.argmax(np.abs(along)))
    if abs(along[nearest]) > _SNAP:
        along = np.eye(3)[nearest]
    return along if along[np.argmax(np.abs(along))] > 0.0 else -along


def _slices(corners: Floats, heights: Floats) -> Floats:
    """Support (slices, directions) of the cuts of triangles (triangles, 3, 3)."""
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    low = edges[..., 2].min(axis=1)
    high = edges[..., 2].max(axis=1)
    support = np.empty((len(heights), _DIRECTIONS))
    for number, height in enumerate(heights):
        cut = edges[(low <= height) & (high > height)]
        if len(cut) == 0:
            # Parts of a mesh apart from each other: between them there is nothing to hold.
            support[number] = -np.inf
            continue
        share = (height - cut[:, 0, 2]) / (cut[:, 1, 2] - cut[:, 0, 2])
        points = cut[:, 0, :2] + share[:, None] * (cut[:, 1, :2] - cut[:, 0, :2])
        support[number] = np.max(points @ _CIRCLE, axis=0)
    known = np.isfinite(support[:, 0])
    if not known.any():
        # All of it is at one height: it is flat.
        raise RigError(
            "The object to grasp has no size.",
            "Give it some height along the axis that the arm winds about, or choose another axis.",
        )
    numbers = np.arange(len(heights))
    for direction in range(_DIRECTIONS):
        support[:, direction] = np.interp(numbers, numbers[known], support[known, direction])
    return support


def _at_height(heights: Floats, support: Floats, queries: Floats) -> Floats:
    """Support (queries, directions) at heights, held beyond the ends."""
    place = np.clip((queries - heights[0]) / (heights[1] - heights[0]), 0.0, len(heights) - 1.001)
    number = place.astype(np.int64)
    share = (place - number)[:, None]
    return (1.0 - share) * support[number] + share * support[number + 1]


@dataclass(frozen=True, eq=False)
class Coil:
    """The way of an arm's end about an object, in the object's frame."""

    first: int
    """Number of the joint at which it begins."""
    joints: Floats
    """(segments + 1, 3) of the segments that wind, the first where the coil begins."""
    facing: Floats
    """(segments, 3) unit: to the axis, where suckers are."""
    angle: float
    """Radians wound."""

    @property
    def directions(self) -> Floats:
        """(segments, 3) unit vectors along the segments."""
        return normalized(np.diff(self.joints, axis=0))


@dataclass(frozen=True)
class Winding:
    """Which way an arm winds."""

    turns: float
    """At most so many."""
    sense: int
    """+1 anticlockwise seen from the axis' end, −1 clockwise."""


@dataclass(frozen=True)
class WindingStart:
    """Where a coil begins."""

    joint: int
    """Number of the arm's joint."""
    root: Floats
    """(3,) the arm's root, in the object's frame: where the arm comes from."""


@dataclass(frozen=True, eq=False)
class Skins:
    """An object grown by the skin of an arm, as thick as it is at each of its joints."""

    profile: Profile
    radii: Floats
    """(joints,)"""
    thickness: Floats
    """(tables,) ascending, for which there are tables."""
    tables: Floats
    """(tables, slices, directions) support."""

    @staticmethod
    def of(profile: Profile, radii: Floats) -> Skins:
        """Tables for a few thicknesses; between them supports are linear enough."""
        # No two tables of one thickness, however even the arm.
        thinnest, thickest = float(radii.min()), float(radii.max())
        apart = max(thickest - thinnest, 1e-9 * thickest, 1e-30)
        thickness = np.linspace(thinnest, thinnest + apart, _THICKNESSES)
        tables = np.stack([profile.grown(float(each)) for each in thickness])
        return Skins(profile, radii, thickness, tables)

    def radius(self, joint: int, angle: float, height: float) -> float:
        """Distance from the axis at which a joint's skin touches, in one direction."""
        heights, thickness = self.profile.heights, self.thickness
        place = (height - heights[0]) / (heights[1] - heights[0])
        place = min(max(place, 0.0), len(heights) - 1.001)
        row, share = int(place), place % 1.0
        between = (self.radii[joint] - thickness[0]) / (thickness[1] - thickness[0])
        table = min(int(between), len(thickness) - 2)
        between -= table
        four = self.tables[table : table + 2, row : row + 2]
        outline = np.array([1.0 - between, between]) @ (
            four[:, 0] * (1.0 - share) + four[:, 1] * share
        )
        facing = np.cos(_ANGLES - angle)
        seen = facing > _WIDEST
        return float(np.min(outline[seen] / facing[seen]))


def wind(skins: Skins, lengths: Floats, start: WindingStart, winding: Winding) -> Coil:
    """Wind the segments (segments,) from a joint on about an object, lengths in its profile's unit.

    Where the arm comes from decides where it touches: on the line that only just passes the object.
    Bones are straight, so joints lie as far out as it takes for the middle of each bone to be where
    the skin lies on the object. From turn to turn the coil climbs by an arm's diameter, to the side
    that has more room, as long as there is object.

    Raises:
        RigError: the arm starts within the object.
    """
    lift = np.zeros(len(lengths) + 1)
    coil = _wound(skins, lengths, start, winding, lift)
    for _ in range(_LIFTINGS):
        lacking = _lacking(skins, coil)
        if not np.any(lacking > 0.0):
            break
        # Round a corner a bone would cut in: its two joints move out.
        joints = slice(start.joint, start.joint + len(coil.joints))
        lift[joints] += np.maximum(np.append(lacking, 0.0), np.append(0.0, lacking))
        coil = _wound(skins, lengths, start, winding, lift)
    return coil


def _lacking(skins: Skins, coil: Coil) -> Floats:
    """How far (segments,) each bone of a coil presses in more than it may."""
    count = len(coil.facing)
    share = np.linspace(0.0, 1.0, 7)[1:-1, None, None]
    points = (1.0 - share) * coil.joints[:-1] + share * coil.joints[1:]
    radii = skins.radii[coil.first : coil.first + count + 1]
    skin = (1.0 - share[..., 0]) * radii[:-1] + share[..., 0] * radii[1:]
    missing = (1.0 - _PRESSED) * skin - skins.profile.clearance(points)
    return np.max(missing, axis=0) - 1e-3 * skin[0]


def _wound(
    skins: Skins, lengths: Floats, start: WindingStart, winding: Winding, lift: Floats
) -> Coil:
    first, root = start.joint, skins.profile.to_profile(start.root)
    segments = np.arange(first, len(lengths))
    profile, radii = skins.profile, skins.radii
    # Of the longer of the two bones that meet at a joint.
    half = 0.5 * np.maximum(np.append(lengths[0], lengths), np.append(lengths, lengths[-1]))

    def point(joint: int, angle: float, height: float) -> Floats:
        clear = skins.radius(joint, angle, height)
        pressed = clear - _PRESSED * float(radii[joint])
        out = max(clear, float(np.hypot(pressed, half[joint]))) + float(lift[joint])
        return np.array([out * np.cos(angle), out * np.sin(angle), height])

    skin = float(radii[first])
    limits = _height_limits(profile, skin)
    level = float(np.clip(root[2], *limits))
    climb = 1.0 if limits[1] - level >= level - limits[0] else -1.0
    room = max(limits[1] - level, level - limits[0])
    wanted = 2.0 * skin * winding.turns
    if room < wanted:
        # Begin far enough from the end for all turns, as far as the object is long enough.
        level = float(np.clip(level - climb * (wanted - room), *limits))
    angle = _touching_angle(lambda at: point(first, at, level), root, winding, profile)
    joints = [point(first, angle, level)]
    wound = 0.0
    for segment in segments:
        if wound >= 2.0 * np.pi * winding.turns:
            break
        pitch = 2.0 * float(radii[segment]) * 1.08 / (2.0 * np.pi)
        low, high = 0.0, np.pi
        for _ in range(_HALVINGS):
            turn = 0.5 * (low + high)
            up = float(np.clip(level + climb * pitch * turn, *limits))
            there = point(int(segment) + 1, angle + winding.sense * turn, up)
            near = np.linalg.norm(there - joints[-1]) < lengths[segment]
            low, high = (turn, high) if near else (low, turn)
        turn = 0.5 * (low + high)
        level = float(np.clip(level + climb * pitch * turn, *limits))
        angle += winding.sense * turn
        wound += turn
        there = point(int(segment) + 1, angle, level)
        # The last digits of the length.
        step = normalized(there - joints[-1]) * lengths[segment]
        joints.append(joints[-1] + step)
    local = np.array(joints)
    inward = -0.5 * (local[1:] + local[:-1])
    inward[:, 2] = 0.0
    facing = normalized(inward) @ profile.axes.T
    return Coil(first, profile.to_object(local), facing, wound)


def _height_limits(profile: Profile, skin: float) -> tuple[float, float]:
    """Heights between which an arm with such a skin winds: on an object, and where it is wide."""
    heights = profile.heights
    inset = min(skin, 0.5 * np.ptp(heights))
    low, high = heights[0] + inset, heights[-1] - inset
    widths = profile.support.mean(axis=1)
    if np.ptp(heights) < 2.0 * _ROUND * widths.max():
        wide = heights[widths > _WIDE * widths.max()]
        return max(low, float(wide[0])), min(high, float(wide[-1]))
    return low, high


def _touching_angle(
    point: Callable[[float], Floats], root: Floats, winding: Winding, profile: Profile
) -> float:
    """In which direction from the axis the line from an arm's root (3,), as the profile has it,
    only just passes the object.

    Raises:
        RigError: the arm starts within the object.
    """
    distance, bearing = float(np.hypot(root[0], root[1])), float(np.arctan2(root[1], root[0]))
    angle = bearing
    for _ in range(8):
        out = float(np.hypot(*point(angle)[:2]))
        if out >= distance:
            if profile.heights[0] < root[2] < profile.heights[-1] or out >= 1.5 * distance:
                raise RigError(
                    "The arm starts within the object to grasp.",
                    "Move the body or the object until they are apart.",
                )
            # From above or below: there is no line past it; touch the near side.
            return bearing
        angle = bearing + winding.sense * np.arccos(out / distance)
    return angle
