# SPDX-License-Identifier: GPL-3.0-or-later
"""What is pulled on one side, on the other: ways, places and turns seen in a mirror."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rotations import (
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from .puppet import Figure, Pose


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane through a figure, as its root stands."""

    normal: Floats
    """(3,) unit, world, from the right to the left."""

    @classmethod
    def of(cls, figure: Figure, pose: Pose, side: Floats, root: int = 0) -> Mirror:
        """The plane between the figure's sides; at rest its normal is ``side`` (3,), world."""
        turned = multiply(pose.orientations[root], conjugate(figure.rest[root]))
        normal = rotate(turned, side)
        return cls(normal / np.linalg.norm(normal))

    def way(self, way: Floats) -> Floats:
        """A way (3,) as it is on the other side."""
        return way - 2.0 * float(way @ self.normal) * self.normal

    def turn(self, turn: Floats) -> Floats:
        """A turn (4,) as it is on the other side: its axis is mirrored, and it goes round the other
        way.
        """
        return from_rotation_vector(-self.way(to_rotation_vector(turn)))


def opposite_point(figure: Figure, pose: Pose, bodies: tuple[int, int], point: Floats) -> Floats:
    """The point (3,) on the second of two bodies where a point is on the first: as far along the
    limb, and on its middle line.
    """
    one, other = bodies
    # From the joint to the limb's end, in the middle of which its mass is.
    way = 2.0 * figure.centres[one]
    own = rotate(conjugate(pose.orientations[one]), point - pose.positions[one])
    share = float(own @ way) / max(float(way @ way), 1e-300)
    place = 2.0 * share * figure.centres[other]
    return pose.positions[other] + rotate(pose.orientations[other], place)
