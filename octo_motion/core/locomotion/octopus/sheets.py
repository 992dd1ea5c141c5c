# SPDX-License-Identifier: GPL-3.0-or-later
"""The two sheets of the octopus' skin, above and below, and how finely they are cut.

Rows of the upper sheet run from the mantle down over the head, those of the lower from the mouth
outwards; both go on along the arms' roots and the web between them to the web's margin. Columns
go round the body's axis from the front towards the left, a sector for each arm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats
from .rig import BODY
from .shape import HEAD_BASE, MANTLE_WIDEST, BodyForm, OctopusShape
from .surface import Influences, along_arm, along_body, mixed, ramp

_FEW_ARMS: Final = 16
"""Up to so many arms get the fine cut."""
_LEAST_ROUND_HEAD: Final = 48
"""Faces round the head, at least."""
_SIDE: Final = math.radians(15.0)
"""Angle above and below the arm's side at which its upper and lower half end."""
_ROW_SPACING: Final = 0.27
"""Length of a face in diameters of the arm."""
_SLENDER: Final = 0.22
"""Where an arm is thinner than that share of its root, faces do not get shorter any more."""
_MOST_ROWS: Final = 240
_FLAT_BELOW: Final = 0.85
"""Height of the lower half of an arm's outline against the upper."""
_LEAST_WITH_WEB: Final = 3
"""Arms; two stand too far apart for a web between them."""
_TIP_POLAR: Final = np.radians([90.0, 50.0, 20.0])
"""Angles of the rings that round off the tip."""


@dataclass(frozen=True)
class Columns:
    """How many faces go round; all numbers are even."""

    dorsal: int
    """Over the top of an arm."""
    ventral: int
    """Under an arm, two for each row of suckers; one more on either side makes the tube."""
    web: int
    """Across the web between two arms."""

    @staticmethod
    def of(arms: int) -> Columns:
        """As many as the eye needs, fewer for a crowd of arms."""
        dorsal, ventral, web = (6, 4, 6) if arms <= _FEW_ARMS else (4, 2, 2)
        wanted = 2 * math.ceil((_LEAST_ROUND_HEAD / arms - dorsal) / 2)
        return Columns(dorsal, ventral, max(web, wanted))


@dataclass(frozen=True)
class ArmLayout:
    """Rows along every arm and columns round it."""

    shape: OctopusShape

    @cached_property
    def columns(self) -> Columns:
        """Faces round an arm and between arms."""
        return Columns.of(self.shape.arms)

    @cached_property
    def stations(self) -> Floats:
        """Distances (rows,) from P₀ of the rings along an arm, in metres."""
        shape = self.shape
        length = shape.arm_length
        radius = 0.5 * float(shape.skin_diameter(np.asarray(length)))
        tip = min(1.1 * radius, 0.1 * length)
        along = _even_steps(shape)
        along = along[along < length - 1.2 * tip]
        return np.concatenate([along, length - tip + tip * np.cos(_TIP_POLAR)])

    @cached_property
    def scales(self) -> Floats:
        """Share (rows,) of the skin's diameter at each ring: the last ones round off the tip."""
        straight = np.ones(len(self.stations) - len(_TIP_POLAR))
        return np.concatenate([straight, np.sin(_TIP_POLAR)])

    @cached_property
    def web_row(self) -> int:
        """The row at which the skin that the arms' roots share ends."""
        extent = min(0.22 * self.shape.arm_length, 2.4 * self.shape.first_diameter)
        return int(np.clip(np.searchsorted(self.stations, extent), 2, len(self.stations) - 4))

    @cached_property
    def web_rows(self) -> int:
        """How many rows the web goes on from there."""
        shape = self.shape
        if shape.arms < _LEAST_WITH_WEB:
            return 0
        last = np.searchsorted(self.stations, shape.web * shape.arm_length)
        return max(0, min(int(last), len(self.stations) - 4) - self.web_row)

    def section(self, distance: Floats, scale: Floats | float = 1.0) -> tuple[Floats, Floats]:
        """Outlines of the upper half (rows, dorsal + 1, 3) and of the lower (rows, ventral + 1, 3).

        In the frame of an arm: outwards from the body's axis, across towards the left, up from the
        ground. Columns go from right to left. Distances (rows,) are from P₀, in metres, negative
        under the body; the scale (rows,) is a share of the skin's diameter.
        """
        shape = self.shape
        radius = 0.5 * shape.skin_diameter(distance) * scale
        outward = shape.crown_radius + distance
        width = radius
        if shape.arms > 2:
            # Neighbours must not run into each other where they come together under the body.
            room = 0.78 * np.maximum(outward, 0.0) * math.tan(shape.half_sector)
            width = radius * room / (radius**4 + room**4) ** 0.25
        height = radius * (width / radius) ** 0.35
        upper = _half_outline(self.columns.dorsal, outward, width, height)
        lower = _half_outline(self.columns.ventral, outward, width, -_FLAT_BELOW * height)
        upper[..., 2] += shape.arm_height
        lower[..., 2] += shape.arm_height
        return upper, lower


def _half_outline(faces: int, outward: Floats, width: Floats, height: Floats) -> Floats:
    angles = np.linspace(_SIDE, math.pi - _SIDE, faces + 1)
    return np.stack(
        np.broadcast_arrays(
            outward[:, None],
            -width[:, None] * np.cos(angles),
            height[:, None] * np.sin(angles),
        ),
        axis=-1,
    )


def _even_steps(shape: OctopusShape) -> Floats:
    """Distances from P₀ to the tip whose steps suit the arm's thickness and its bones."""
    joints = shape.joints
    rows_per_bone = 3 if joints <= 24 else 2 if joints <= 60 else 1
    distance = np.linspace(0.0, shape.arm_length, 16 * joints + 257)
    thickness = np.maximum(shape.skin_diameter(distance), _SLENDER * shape.first_diameter)
    bone = np.clip(np.searchsorted(shape.reach, distance, side="right") - 1, 0, joints - 1)
    step = np.minimum(_ROW_SPACING * thickness, shape.segments[bone] / rows_per_bone)
    density = 1.0 / step
    between = 0.5 * (density[1:] + density[:-1]) * np.diff(distance)
    row = np.concatenate([[0.0], np.cumsum(between)])
    rows = min(math.ceil(row[-1]), max(_MOST_ROWS, rows_per_bone * joints))
    return np.interp(np.arange(rows + 1), row * (rows / row[-1]), distance)


# --- The sheets: points and weights, rows by columns ----------------------------------------------


HEAD_ROWS: Final = 24
END_ROWS: Final = 4
"""Rows of the mantle's rounded end; what they leave open is filled by a grid."""
END_POLAR: Final = math.radians(48.0)
"""Angle from the apex at which that grid begins."""
_CROWN_ROWS: Final = 4
"""Rows between the head and P₀."""
_CROWN_START: Final = 0.88
"""Distance of the first of them from the axis, in crown radii."""

_MOUTH: Final = np.array(
    [
        (0.13, 0.14),
        (0.15, 0.02),
        (0.18, -0.10),
        (0.23, -0.17),
        (0.29, -0.13),
        (0.36, -0.09),
        (0.46, -0.10),
        (0.58, -0.13),
        (0.72, -0.17),
        (0.86, -0.20),
    ]
)
"""Profile of mouth and lips: distance from the axis and height, in crown radii."""
BEAK_ROWS: Final = 1
"""Rows of faces at the mouth that belong to the beak."""
ARMS_BELOW: Final = 6
"""Row of the lower sheet from which on the arms are told apart."""


@dataclass(frozen=True)
class Sheet:
    """A grid of points; the first column follows the last."""

    points: Floats
    """(rows, columns, 3)"""
    influences: Influences
    """(rows, columns, k)"""
    distances: Floats
    """(rows,), distance from P₀ along the arms, far below zero on the head."""
    sector: int
    """Columns of each arm's sector."""
    arm_columns: int
    """Faces across the arm; those of the web lie half before and half after."""

    @property
    def half_web(self) -> int:
        """First column of a sector that belongs to the arm."""
        return (self.sector - self.arm_columns) // 2

    @property
    def front(self) -> int:
        """The column on the plane of symmetry in front: between two arms, or in the middle of the
        first of an odd number.
        """
        arms = self.points.shape[1] // self.sector
        return self.sector // 2 if arms % 2 and arms > 1 else 0


@dataclass(frozen=True)
class _Sector:
    """One arm's sector, (rows, sector + 1) each, from the web on the right to that on the left."""

    angle: Floats
    """From the arm, positive towards the left."""
    radius: Floats
    """Distance from the body's axis."""
    height: Floats

    def round_the_axis(self, shape: OctopusShape) -> Floats:
        """All arms' sectors, (rows, arms · sector, 3)."""
        turn = shape.angles[None, :, None] + self.angle[:, None, :-1]
        radius = np.broadcast_to(self.radius[:, None, :-1], turn.shape)
        height = np.broadcast_to(self.height[:, None, :-1], turn.shape)
        points = np.stack([radius * np.sin(turn), -radius * np.cos(turn), height], axis=-1)
        return points.reshape(len(turn), -1, 3)


def upper_sheet(layout: ArmLayout, form: BodyForm) -> Sheet:
    """Mantle, head, and the upper side of arms and web."""
    shape, columns = layout.shape, layout.columns
    unit = form.unit
    sector_columns = columns.web + columns.dorsal
    round_head = column_angles(shape.arms * sector_columns, _first_column(shape))
    polar = np.linspace(END_POLAR, 0.5 * math.pi, END_ROWS, endpoint=False)
    stations = np.linspace(MANTLE_WIDEST, HEAD_BASE, HEAD_ROWS)
    crown = unit * (np.linspace(_CROWN_START, 1.0, _CROWN_ROWS, endpoint=False) - 1.0)
    distance = np.concatenate([crown, layout.stations[: layout.web_row + 1]])

    sector = _arms_and_web(layout, distance, upper=True)
    # The head's even columns gather into arms and web over the crown.
    gathered = ramp(-0.15 * unit, 0.0, distance)[:, None]
    sector = _blend(_even_ring(layout, distance, sector), sector, gathered)
    skirt = _head_skirt(unit, sector.radius) + shape.arm_height
    height = _smooth_maximum(sector.height, skirt, 0.22 * unit)
    outer = _Sector(sector.angle, sector.radius, height).round_the_axis(shape)

    points = np.concatenate(
        [form.mantle_end(polar).points(round_head), form.ring(stations).points(round_head), outer]
    )
    row = np.arange(float(len(points))) - (END_ROWS + HEAD_ROWS + _CROWN_ROWS)
    amount = 0.6 * ramp(-11, -5, row) * (1.0 - ramp(0, 3, row))
    points = _relaxed(points, amount, rounds=12)
    body_stations = np.concatenate(
        [
            np.full(END_ROWS, MANTLE_WIDEST),
            stations,
            np.linspace(-0.2, -1.0, _CROWN_ROWS),
            np.full(layout.web_row + 1, -1.0),
        ]
    )
    on_the_head = np.full(END_ROWS + HEAD_ROWS, -10.0 * shape.first_diameter)
    distance = np.concatenate([on_the_head, distance])
    influences = _influences(layout, points, distance, body_stations, columns.dorsal)
    return Sheet(points, influences, distance, sector_columns, columns.dorsal)


def lower_sheet(layout: ArmLayout, form: BodyForm) -> Sheet:
    """Mouth, and the underside of arms and web."""
    shape, columns = layout.shape, layout.columns
    unit = form.unit
    mouth = unit * (_MOUTH[:, 0] - 1.0)
    distance = np.concatenate([mouth, layout.stations[: layout.web_row + 1]])
    sector = _arms_and_web(layout, distance, upper=False)
    gathered = ramp(-0.75 * unit, -0.3 * unit, distance)[:, None]
    disc = shape.arm_height + unit * np.interp(distance / unit + 1.0, *_MOUTH.T)
    ring = _even_ring(layout, distance, sector)
    inside = (distance < 0.0)[:, None]
    ring = _Sector(ring.angle, ring.radius, np.where(inside, disc[:, None], ring.height))
    points = _blend(ring, sector, gathered).round_the_axis(shape)

    row = np.arange(float(len(points))) - len(_MOUTH)
    amount = 0.5 * ramp(-6, -4, row) * (1.0 - ramp(0, 3, row))
    points = _relaxed(points, amount, rounds=8)
    influences = _influences(layout, points, distance, np.full(len(points), -1.0), columns.ventral)
    return Sheet(points, influences, distance, columns.web + columns.ventral, columns.ventral)


def column_angles(columns: int, first: float = 0.0) -> Floats:
    """Angles (columns,) of evenly spread columns, from the front towards the left, where the first
    one is given.
    """
    return first + np.arange(float(columns)) * (2.0 * math.pi / columns)


def _first_column(shape: OctopusShape) -> float:
    """Where columns begin: half way from the last arm to the first, radians from the front."""
    return float(shape.angles[0]) - shape.half_sector


def _arms_and_web(layout: ArmLayout, distance: Floats, *, upper: bool) -> _Sector:
    """An arm's half outline with half of the web on either side."""
    shape, columns = layout.shape, layout.columns
    sign = 1.0 if upper else -1.0
    outline = layout.section(distance)[0 if upper else 1]
    angle = np.arctan2(outline[..., 1], outline[..., 0])
    radius = np.hypot(outline[..., 0], outline[..., 1])
    height = outline[..., 2]

    # Across the web from the arm's side (v = 0) to the middle (v = 1). Between arms that stand
    # far apart the web hangs back more, and hugs the arms.
    v = np.arange(1, columns.web // 2 + 1) / (columns.web // 2)
    depth, power = web_depth(shape), web_power(shape)
    side_angle, side_radius, side_height = angle[:, -1:], radius[:, -1:], height[:, -1:]
    web_angle = side_angle + (shape.half_sector - side_angle) * v
    base = shape.crown_radius + np.minimum(0.0, distance)[:, None]
    web_radius = base + (side_radius - base) * (depth + (1.0 - depth) * (1.0 - v) ** power)
    side_height = side_height - shape.arm_height
    outwards = np.clip(distance / layout.stations[layout.web_row], 0.0, 1.0)[:, None]
    thickness = 0.05 * shape.first_diameter * (1.0 - 0.6 * outwards)
    thin = sign * np.minimum(thickness, np.abs(side_height))
    web_height = shape.arm_height + thin + (side_height - thin) * (1.0 - v) ** 2

    def with_web(middle: Floats, web: Floats, sign: float = 1.0) -> Floats:
        return np.concatenate([sign * web[:, ::-1], middle, web], axis=1)

    return _Sector(
        with_web(angle, web_angle, -1.0),
        with_web(radius, web_radius),
        with_web(height, web_height),
    )


def web_depth(shape: OctopusShape) -> float:
    """How far the web at the arms' roots reaches in its middle, of what it does at the arms."""
    gap = math.degrees(2.0 * shape.half_sector)
    return float(np.clip(0.5 * (45.0 / gap) ** 0.6, 0.1, 0.8))


def web_power(shape: OctopusShape) -> float:
    """How much the margin of that web hugs the arms."""
    return float(np.clip(math.degrees(2.0 * shape.half_sector) / 25.0, 1.8, 10.0))


def _even_ring(layout: ArmLayout, distance: Floats, sector: _Sector) -> _Sector:
    """Even columns on a circle, where the body and not yet the arms give the form."""
    half = layout.shape.half_sector
    even = np.broadcast_to(np.linspace(-half, half, sector.angle.shape[1]), sector.angle.shape)
    circle = layout.shape.crown_radius + distance[:, None]
    radius = np.where(distance[:, None] < 0.0, circle, sector.radius)
    return _Sector(even, radius, sector.height)


def _blend(first: _Sector, second: _Sector, share: Floats) -> _Sector:
    return _Sector(
        first.angle + (second.angle - first.angle) * share,
        first.radius + (second.radius - first.radius) * share,
        first.height + (second.height - first.height) * share,
    )


def _head_skirt(unit: float, radius: Floats) -> Floats:
    """Height over the arms' plane to which the head's foot lifts the arms' roots."""
    inner, outer = 0.86 * unit, 2.1 * unit
    rise = np.maximum((outer - radius) / (outer - inner), 0.0)
    return unit * (0.9 * rise**2.2 - 0.4)


def _smooth_maximum(a: Floats, b: Floats, blend: float) -> Floats:
    """The larger of both, rounded where they come closer than ``blend``."""
    share = np.clip(0.5 + 0.5 * (a - b) / blend, 0.0, 1.0)
    return b + (a - b) * share + blend * share * (1.0 - share)


def _relaxed(points: Floats, amount: Floats, rounds: int) -> Floats:
    """Rows (rows, columns, 3) smoothed by shares (rows,); the first and the last stay."""
    points = points.copy()
    for _ in range(rounds):
        around = 0.5 * (np.roll(points, 1, axis=1) + np.roll(points, -1, axis=1))
        mean = points.copy()
        mean[1:-1] = 0.5 * around[1:-1] + 0.25 * (points[:-2] + points[2:])
        points += amount[:, None, None] * (mean - points)
    return points


def _influences(
    layout: ArmLayout, points: Floats, distance: Floats, stations: Floats, arm_columns: int
) -> Influences:
    """Weights of a sheet: of the arm, on the web also of the neighbour, and of the body."""
    shape = layout.shape
    half = layout.columns.web // 2
    sector = 2 * half + arm_columns
    arm = np.repeat(np.arange(shape.arms), sector)
    column = np.tile(np.arange(sector), shape.arms)
    step = np.where(column < half, -1, np.where(column > half + arm_columns, 1, 0))
    into_web = np.maximum(half - column, column - half - arm_columns) / half
    share = 0.5 * ramp(0.0, 1.0, into_web)

    # The web hangs back: a point of it goes with the bones beside it, not with those of its row.
    radial = np.hypot(points[..., 0], points[..., 1]) - shape.crown_radius
    row = distance[:, None]
    beside = np.where(row < 0.0, row, np.clip(radial, 0.0, np.maximum(row, 0.0)))
    grid = beside.shape
    arms = mixed(
        along_arm(shape, np.broadcast_to(arm, grid), beside),
        along_arm(shape, np.broadcast_to((arm + step) % shape.arms, grid), beside),
        np.broadcast_to(share, grid),
    )
    # What the arms leave to the body goes to the body's own bones.
    left = np.where(arms.bones == BODY, arms.weights, 0.0)
    body = along_body(np.broadcast_to(stations[:, None], grid))
    return Influences(
        np.concatenate([arms.bones, body.bones], axis=-1),
        np.concatenate(
            [arms.weights - left, body.weights * np.sum(left, axis=-1, keepdims=True)], axis=-1
        ),
    )
