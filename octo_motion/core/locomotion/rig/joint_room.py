# SPDX-License-Identifier: GPL-3.0-or-later
"""How much room a joint needs over the ground: one notion for all that keeps arms off it.

A joint that lies on the ground is as high as its skin is thick. One that does not keeps a margin
besides. It is raised gently as it comes near to that, and the less the nearer it is to the root,
which the body carries. Half way between frames, and where another arm pushes, a joint may be a
little lower than it was to be: by what nobody sees.

Heights are over the ground under the joint, along world Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...easing import smooth_step
from ...rotations import Floats

MARGIN: Final = 0.03
"""Arm lengths that joints which do not lie keep between their skin and the ground: between two of
them the skin is lower, where the ground is bent upwards or the arm sideways."""
TOLERATED: Final = 0.002
"""Arm lengths that a joint may be lower than it was to be where it cannot be helped."""
_ROOT: Final = 0.15
"""Share of an arm from its root on which joints are not raised all the way."""


def room_needed(skin: Floats, length: Floats, more: Floats | float = 0.0) -> Floats:
    """Heights of joints that do not lie.

    Args:
        skin: from joints to the skin below them.
        length: of their arms, in the same unit.
        more: by how much they are to be higher than they need be.
    """
    return skin + (MARGIN * length + more)


def lowest_allowed(heights: Floats, skin: Floats) -> Floats:
    """Heights that joints at such heights must not be pushed below, or no further."""
    return np.minimum(heights, skin)


def loose_from_root(reach: Floats, length: Floats) -> Floats:
    """How far joints are free to be raised: 0 at the root, 1 a little further out.

    Args:
        reach: from the root, along the arm.
        length: of the arm.
    """
    return smooth_step(reach / (_ROOT * length))


def smooth_floor(heights: Floats, floor: Floats | float, rounding: float) -> Floats:
    """Heights that are never below a floor, with a smooth passage of about such a width.

    ``floor + (h + √(h² + r²)) / 2`` of heights h above it. Differences never grow: what is within
    reach of each other stays so.
    """
    above = heights - floor
    return floor + 0.5 * (above + np.sqrt(above * above + rounding**2))


def lift_to_floor(above: Floats, rounding: float) -> Floats:
    """How far what is so much above a floor is to be lifted: ``(√(h² + r²) − h) / 2``."""
    return 0.5 * (np.sqrt(above * above + rounding**2) - above)


@dataclass(frozen=True, eq=False)
class JointRoom:
    """The room that joints of a batch of arms are to have."""

    needed: Floats
    """(segments + 1, batch) how high above the ground each joint should be."""
    loose: Floats
    """(segments + 1, batch) how far each is to be raised to that, 0…1."""
    soft: Floats
    """(…, batch) how much above what is needed they begin to be raised."""

    def part(self, chosen: np.ndarray | slice) -> JointRoom:
        """Some of the batch."""
        return JointRoom(self.needed[:, chosen], self.loose[:, chosen], self.soft[..., chosen])

    def lacking(self, heights: Floats) -> Floats:
        """By how much (segments + 1, batch) joints at such heights are to be raised."""
        below = self.needed - heights
        near = np.maximum(below + self.soft, 0.0)
        below = np.where(below > self.soft, below, near * near * (0.25 / self.soft))
        below *= self.loose
        return below
