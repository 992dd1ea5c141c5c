# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist chooses about an octopus, the proportions and the form that follow from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import Floats
from ..gait import diameters

ARMS: Final = (1, 64)
JOINTS: Final = (3, 200)
WEB: Final = (0.0, 0.8)
_SHORTEST_BONE: Final = 1e-5
"""In metres; Blender deletes bones a tenth as long."""


@dataclass(frozen=True)
class OctopusShape:
    """The parameters of the redo panel; the defaults give an octopus of about half a metre.

    An arm follows eq. 3.1 and 3.2 of [Octopus]: joint i has the diameter ``w_i = w₀ (1 − τ i)``,
    and segment i is as long in proportion. There ``l_i = w_i / 2``, which ties an arm's length to
    its thickness; here the length is free, ``l_i = L w_i / Σ w``, and is the source's where
    ``L = Σ w / 2``. The defaults are longer than that, 0.6 m for 0.32, and taper more.
    """

    arms: int = 8
    joints: int = 12
    """Segments n of each arm."""
    arm_length: float = 0.6
    """L, root to tip, in metres."""
    first_diameter: float = 0.07
    """w₀, in metres."""
    taper: float = 0.5
    """Share of its diameter that an arm's last joint has lost, ``τ n``: 0 a cylinder, 1 a cone.
    The source's τ = 0.01 at 12 joints is 0.12."""
    mesh_taper: float = 0.9
    """How much thinner still the skin gets towards the tip, in even steps along the arm:
    0 keeps to the diameters of the joints, 1 ends in a point."""
    web: float = 1.0 / 3.0
    """How far the web reaches along the arms, as a share of their length. Within what the arms'
    roots share there is none of its own, nor with fewer than three arms."""

    def __post_init__(self) -> None:
        _check_range(phrase("Arms"), self.arms, *ARMS)
        _check_range(phrase("Joints per arm"), self.joints, *JOINTS)
        _check_range(phrase("Taper"), self.taper, 0.0, 1.0)
        _check_range(phrase("Mesh taper"), self.mesh_taper, 0.0, 1.0)
        _check_range(phrase("Web reach"), self.web, *WEB)
        _check_size(phrase("Arm length"), self.arm_length)
        _check_size(phrase("First diameter"), self.first_diameter)
        shortest = float(np.min(self.segments))
        if shortest < _SHORTEST_BONE:
            raise SettingsError(
                phrase(
                    "The last bones of an arm would be only {shortest:.1g} m long.",
                    shortest=shortest,
                ),
                "Choose longer arms, fewer joints or less taper.",
            )

    def of_arm_length(self, length: float) -> OctopusShape:
        """The same octopus larger or smaller, with arms of a length in metres.

        Raises:
            SettingsError: it would be too small.
        """
        _check_size("Size", length)
        share = length / self.arm_length
        return replace(self, arm_length=length, first_diameter=share * self.first_diameter)

    @cached_property
    def diameters(self) -> Floats:
        """Diameters w_i of the joints, (joints,), in metres [Octopus, eq. 3.1]."""
        return diameters(self.joints, self.first_diameter, self.taper / self.joints)

    @cached_property
    def segments(self) -> Floats:
        """Lengths l_i of the segments, (joints,), in metres [Octopus, eq. 3.2, any length]."""
        return self.diameters * (self.arm_length / float(np.sum(self.diameters)))

    @cached_property
    def reach(self) -> Floats:
        """Distance of joints P₀ … Pₙ from P₀ along the straight arm, (joints + 1,), in metres."""
        return np.concatenate([[0.0], np.cumsum(self.segments)])

    @cached_property
    def angles(self) -> Floats:
        """Directions of the arms, (arms,): radians from the front (−Y) towards the left (+X).

        Of arms of an odd number the one in the middle is in front: behind, between two of them, are
        the mantle and the siphon. One alone is there itself.
        """
        first = 0.0 if self.arms % 2 and self.arms > 1 else 0.5
        return (np.arange(float(self.arms)) + first) * (2.0 * math.pi / self.arms)

    @cached_property
    def half_sector(self) -> float:
        """Half the angle between neighbouring arms, in radians."""
        return math.pi / self.arms

    @cached_property
    def crown_radius(self) -> float:
        """Distance of P₀ from the body's axis, the unit of all the body's proportions.

        The arms stand side by side on that circle. With more than sixteen they crowd, and get
        slender roots, rather than blow up the body; with fewer than six the body stays stout.
        """
        return self.first_diameter / (2.0 * math.sin(math.pi / min(max(self.arms, 6), 16)))

    @cached_property
    def arm_height(self) -> float:
        """Height of the plane of the arms over the ground that the suckers rest on."""
        return 0.53 * self.first_diameter

    def skin_diameter(self, distance: Floats) -> Floats:
        """Diameter of the skin at distances from P₀ along the arm, any shape, in metres."""
        joint = np.interp(distance, self.reach, np.arange(self.joints + 1.0))
        by_joints = 1.0 - (self.taper / self.joints) * joint
        along = np.clip(distance / self.arm_length, 0.0, 1.0)
        # A real cone ends in a point of no thickness, which is no good to a mesh.
        return self.first_diameter * np.maximum(by_joints * (1.0 - self.mesh_taper * along), 0.02)


def _check_range(label: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:
        raise SettingsError(
            phrase("{label} is {value:g}.", label=label, value=value),
            phrase(
                "Choose a value from {lowest:g} to {highest:g}.", lowest=lowest, highest=highest
            ),
        )


def _check_size(label: str, value: float) -> None:
    if not (value > 0.0 and math.isfinite(value)):
        raise SettingsError(
            phrase("{label} is {value:g}.", label=label, value=value),
            "Choose a length greater than zero.",
        )


# --- The form of head and mantle, and the landmarks on them that both bones and skin need ---------


# Rings around the axis of head and mantle, from the crown of the arms upwards. In crown radii
# from the middle of the arms' plane: y, z, tilt of the ring towards the back in degrees,
# half width, half depth.
_STATIONS: Final = np.array(
    [
        (0.02, 0.45, 0.0, 0.90, 0.86),
        (0.03, 0.74, 6.0, 0.83, 0.79),
        (0.07, 1.02, 14.0, 0.80, 0.73),
        (0.19, 1.30, 28.0, 0.74, 0.66),
        (0.40, 1.56, 42.0, 0.77, 0.65),
        (0.72, 1.82, 51.0, 0.97, 0.83),
        (1.12, 2.10, 55.0, 1.12, 0.98),
        (1.62, 2.43, 56.0, 1.17, 1.03),
    ]
)
HEAD_BASE: Final = 0.0
HEAD_MIDDLE: Final = 2.0
NECK: Final = 3.6
MANTLE_EDGE: Final = 5.0
EYE_STATION: Final = 2.7
EYE_ANGLE: Final = math.radians(64.0)
"""Of the left eye, from the front."""
SIPHON_STATION: Final = 1.9
MANTLE_WIDEST: Final = len(_STATIONS) - 1.0
_MANTLE_END: Final = 1.3
"""Length of the rounded end, an ellipsoid, beyond the widest ring."""


@dataclass(frozen=True)
class Ring:
    """Rings around the axis, all arrays of one leading shape, in metres and radians."""

    centre: Floats
    """(…, 2): y, z."""
    tilt: Floats
    half_width: Floats
    half_depth: Floats

    def points(self, angles: Floats) -> Floats:
        """Points (…, columns, 3) at angles (…, columns) from the front towards the left."""
        lateral = self.half_width[..., None] * np.sin(angles)
        forward = self.half_depth[..., None] * np.cos(angles)
        tilt = self.tilt[..., None]
        return np.stack(
            [
                lateral,
                self.centre[..., 0, None] - forward * np.cos(tilt),
                self.centre[..., 1, None] + forward * np.sin(tilt),
            ],
            axis=-1,
        )


@dataclass(frozen=True)
class BodyForm:
    """Head and mantle of one octopus."""

    unit: float
    """Crown radius, in metres."""
    height: float
    """Height of the plane of the arms."""

    def ring(self, station: Floats) -> Ring:
        """Rings at stations (any shape) from ``HEAD_BASE`` to ``MANTLE_WIDEST``."""
        y, z, tilt, width, depth = np.moveaxis(_smooth_curve(_STATIONS, station), -1, 0)
        return Ring(
            centre=np.stack([y * self.unit, z * self.unit + self.height], axis=-1),
            tilt=np.radians(tilt),
            half_width=width * self.unit,
            half_depth=depth * self.unit,
        )

    def mantle_end(self, polar: Floats) -> Ring:
        """Rings of the rounded end, at angles from π/2 (widest ring) down to 0 (apex)."""
        widest = self.ring(np.asarray(MANTLE_WIDEST))
        along = _MANTLE_END * self.unit * np.cos(polar)
        axis = np.array([np.sin(widest.tilt), np.cos(widest.tilt)])
        return Ring(
            centre=widest.centre + along[..., None] * axis,
            tilt=np.broadcast_to(widest.tilt, polar.shape),
            half_width=widest.half_width * np.sin(polar),
            half_depth=widest.half_depth * np.sin(polar),
        )

    def point(self, station: float) -> Floats:
        """Point (3,) of the axis."""
        return np.concatenate([[0.0], self.ring(np.asarray(station)).centre])

    @property
    def apex(self) -> Floats:
        """Point (3,) at the mantle's end."""
        return np.concatenate([[0.0], self.mantle_end(np.asarray(0.0)).centre])

    @property
    def eye_radius(self) -> float:
        """Radius of an eyeball."""
        return 0.26 * self.unit

    @property
    def eye_gaze(self) -> Floats:
        """Unit vector (3,) that the left eye looks along."""
        side, up = EYE_ANGLE, math.radians(26.0)
        return np.array(
            [math.sin(side) * math.cos(up), -math.cos(side) * math.cos(up), math.sin(up)]
        )

    @property
    def eye_centre(self) -> Floats:
        """Centre (3,) of the left eyeball, half sunk into the head."""
        surface = self.ring(np.asarray(EYE_STATION)).points(np.array([EYE_ANGLE]))[0]
        return surface - 0.25 * self.eye_radius * self.eye_gaze

    @property
    def siphon_root(self) -> Floats:
        """Where the siphon leaves the body (3,), at the back below the mantle's edge."""
        return self.ring(np.asarray(SIPHON_STATION)).points(np.array([math.pi]))[0]

    @property
    def siphon_tip(self) -> Floats:
        """The siphon's opening (3,)."""
        return self.siphon_root + self.unit * np.array([0.0, 0.48, -0.12])


def body_form(shape: OctopusShape) -> BodyForm:
    """Head and mantle in proportion to the arms' roots."""
    return BodyForm(unit=shape.crown_radius, height=shape.arm_height)


def _smooth_curve(knots: Floats, parameter: Floats) -> Floats:
    """Catmull-Rom curve through knots (n, d) at parameters 0 … n − 1, (…, d)."""
    parameter = np.asarray(parameter, dtype=np.float64)
    padded = np.concatenate([2 * knots[:1] - knots[1:2], knots, 2 * knots[-1:] - knots[-2:-1]])
    first = np.clip(np.floor(parameter).astype(np.int64), 0, len(knots) - 2)
    t = (parameter - first)[..., None]
    p0, p1, p2, p3 = (padded[first + step] for step in range(4))
    return p1 + 0.5 * t * (
        p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0))
    )
