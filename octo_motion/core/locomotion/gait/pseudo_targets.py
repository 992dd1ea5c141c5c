# SPDX-License-Identifier: GPL-3.0-or-later
"""Pseudo-targets: the chain Q₀ → Q₁ → Q₂ → Q₃ that an arm's groups converge to [Octopus, §3.1.3].

Everything is in the arm's own frame: x outward, z up, y across, Q₀ = P₀ at the origin.
"""

from __future__ import annotations

import numpy as np

from ...rotations import Floats, from_axis_angle, multiply, rotate

HEAD, PITCH, BANK = range(3)

_OUTWARD = np.array([1.0, 0.0, 0.0])
_ACROSS = np.array([0.0, 1.0, 0.0])
_UP = np.array([0.0, 0.0, 1.0])

# A link shrinks by |F|/2π, so that a table with turns of 360° would leave nothing of it.
SHORTEST = 0.05


def contraction(angles: Floats, factor: float = 1.0) -> Floats:
    """Contraction ``e_g = −|F_g| / 2π`` of each link [Octopus, eq. 3.11].

    The source has one angle for each link; where head and pitch turn it together, F is the length
    of the two as a vector, which equals the one angle when the other is zero. Bank only twists.

    Args:
        angles: (…, links, 3) head, pitch, bank in radians.
        factor: 1 as in the source, 0 for links of fixed width.

    Returns:
        (…, links), from ``SHORTEST − 1`` to 0.
    """
    turn = np.hypot(angles[..., HEAD], angles[..., PITCH])
    return np.maximum(-factor * turn / (2.0 * np.pi), SHORTEST - 1.0)


def link_rotations(angles: Floats) -> Floats:
    """Orientation of each link, carried by those before it [Octopus, §3.1.3].

    Within a link, pitch turns first about the vertical axis, then head about the lateral axis so
    turned. Bank does not turn the chain: the source moves targets by head and pitch alone.

    Args:
        angles: (…, links, 3) head, pitch, bank in radians; positive pitch turns x towards y.

    Returns:
        (…, links, 4) quaternions.
    """
    own = multiply(
        from_axis_angle(_UP, angles[..., PITCH]), from_axis_angle(-_ACROSS, angles[..., HEAD])
    )
    result = np.empty_like(own)
    result[..., 0, :] = own[..., 0, :]
    for link in range(1, own.shape[-2]):
        result[..., link, :] = multiply(result[..., link - 1, :], own[..., link, :])
    return result


def pseudo_targets(rotations: Floats, widths: Floats) -> Floats:
    """Positions Q₀ … Q₃.

    Args:
        rotations: (…, links, 4) from ``link_rotations``.
        widths: (…, links) width ``H_g (1 + e_g)`` of each link [Octopus, eq. 3.12–3.14, which
            reuse the name H for the change of the width].

    Returns:
        (…, links + 1, 3).
    """
    steps = rotate(rotations, _OUTWARD * widths[..., None])
    zero = np.zeros_like(steps[..., :1, :])
    return np.concatenate([zero, np.cumsum(steps, axis=-2)], axis=-2)
