# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the bodies are, from the turns of the joints."""

from __future__ import annotations

import numpy as np

from ...rotations import Floats, multiply, rotate
from .figure import Figure, Pose


def rest_pose(figure: Figure) -> Pose:
    """The figure as it was made, its roots' joints at the origin."""
    return pose_of(figure, figure.rest, np.zeros((len(figure), 3)))


def pose_of(figure: Figure, turns: Floats, roots: Floats) -> Pose:
    """The pose with joints turned so; every joint is closed.

    Args:
        figure: the puppet.
        turns: (bodies, 4) orientation of each body in its parent's frame.
        roots: (bodies, 3) world position of the roots' joints; other rows count for nothing.
    """
    positions = np.array(roots, dtype=np.float64)
    orientations = np.array(turns, dtype=np.float64)
    for body, parent in enumerate(figure.parents):
        if parent >= 0:
            orientations[body] = multiply(orientations[parent], orientations[body])
            arm = rotate(orientations[parent], figure.anchors[body])
            positions[body] = positions[parent] + arm
    return Pose(positions, orientations)
