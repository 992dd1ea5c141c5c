# SPDX-License-Identifier: GPL-3.0-or-later
"""How finely the skin is cut, and the outline of an arm: rows along it, columns round it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats
from .shape import OctopusShape

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
        """The row at which the web ends."""
        extent = min(0.22 * self.shape.arm_length, 2.4 * self.shape.first_diameter)
        return int(np.clip(np.searchsorted(self.stations, extent), 2, len(self.stations) - 4))

    def section(self, distance: Floats, scale: Floats | float = 1.0) -> tuple[Floats, Floats]:
        """Outlines of the upper half (rows, dorsal + 1, 3) and of the lower (rows, ventral + 1, 3).

        In the frame of an arm: outwards from the body's axis, across towards the left, up from
        the ground. Columns go from right to left.

        Args:
            distance: (rows,) from P₀, in metres; negative under the body.
            scale: (rows,), share of the skin's diameter.
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
