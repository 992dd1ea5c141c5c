# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist chooses about an octopus, and the proportions that follow from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...rotations import Floats
from ..gait import diameters

ARMS: Final = (1, 64)
JOINTS: Final = (3, 200)
_SHORTEST_BONE: Final = 1e-5
"""In metres; Blender deletes bones a tenth as long."""


@dataclass(frozen=True)
class OctopusShape:
    """The parameters of the redo panel; the defaults give an octopus of about half a metre.

    An arm follows eq. 3.1 and 3.2 of [Octopus]: joint i has the diameter ``w_i = w₀ (1 − τ i)``,
    and segment i is as long in proportion. There ``l_i = w_i / 2``, which ties an arm's length to
    its thickness; here the length is free, ``l_i = L w_i / Σ w``, and is the source's where
    ``L = Σ w / 2``.
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

    def __post_init__(self) -> None:
        _check_range("Arms", self.arms, *ARMS)
        _check_range("Joints per arm", self.joints, *JOINTS)
        _check_range("Taper", self.taper, 0.0, 1.0)
        _check_range("Mesh taper", self.mesh_taper, 0.0, 1.0)
        _check_size("Arm length", self.arm_length)
        _check_size("First diameter", self.first_diameter)
        shortest = float(np.min(self.segments))
        if shortest < _SHORTEST_BONE:
            raise SettingsError(
                f"The last bones of an arm would be only {shortest:.1g} m long.",
                "Choose longer arms, fewer joints or less taper.",
            )

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
        """Directions of the arms, (arms,): radians from the front (−Y) towards the left (+X)."""
        return (np.arange(float(self.arms)) + 0.5) * (2.0 * math.pi / self.arms)

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


def _check_range(name: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:
        raise SettingsError(
            f"{name} is {value:g}.", f"Choose a value from {lowest:g} to {highest:g}."
        )


def _check_size(name: str, value: float) -> None:
    if not (value > 0.0 and math.isfinite(value)):
        raise SettingsError(f"{name} is {value:g}.", "Choose a length greater than zero.")
