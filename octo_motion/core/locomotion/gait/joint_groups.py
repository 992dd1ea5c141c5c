# SPDX-License-Identifier: GPL-3.0-or-later
"""One arm: its diameters, segments and three groups [Octopus, §3.1.1].

An arm of n segments has joints P₀ … Pₙ. Joint i is a ball of diameter ``w_i``; segment i runs
from joint i to joint i + 1.
"""

from __future__ import annotations

import numpy as np

from ...rotations import Floats

GROUPS = 3


def diameters(joints: int, first: float = 1.0, taper: float = 0.01) -> Floats:
    """Diameters ``w_i = w₀ (1 − τ i)``, i = 0 … joints − 1 [Octopus, eq. 3.1].

    Args:
        joints: number of segments n.
        first: diameter w₀ at the root, in metres.
        taper: τ, the share of w₀ that each joint loses; 1/n makes a cone, and more would leave
            joints that are thinner than nothing.

    Returns:
        (joints,) in metres.
    """
    return first * (1.0 - taper * np.arange(joints, dtype=np.float64))


def segment_lengths(joints: int, first: float = 1.0, taper: float = 0.01) -> Floats:
    """Lengths ``l_i = w_i / 2`` (joints,) of the segments, root to tip [Octopus, eq. 3.2]."""
    return 0.5 * diameters(joints, first, taper)


def split_groups(lengths: Floats) -> tuple[int, int, int]:
    """Sizes of the three groups, as equal in length as whole segments allow.

    The source cuts n segments, n a multiple of three, into thirds. Artists' arms have any number
    of segments of any length, so the cuts are made where the three sums differ least (the sum of
    their squares is smallest); of equal cuts the one nearest to equal counts wins.

    Args:
        lengths: (segments,), at least three of them, not all zero.
    """
    count = len(lengths)
    reach = np.concatenate([[0.0], np.cumsum(lengths)])
    first = np.arange(1, count - 1)[:, None]
    second = np.arange(2, count)[None, :]
    sums = np.stack(
        np.broadcast_arrays(
            reach[first], reach[second] - reach[first], reach[count] - reach[second]
        )
    )
    cost = np.sum(sums**2, axis=0) / reach[count] ** 2
    counts = np.stack(np.broadcast_arrays(first, second - first, count - second))
    # The second term only decides between cuts of equal cost.
    cost = cost + 1e-9 * np.sum((counts / count) ** 2, axis=0)
    cost = np.where(second > first, cost, np.inf)
    row, column = np.unravel_index(np.argmin(cost), cost.shape)
    cut_first, cut_second = int(first[row, 0]), int(second[0, column])
    return cut_first, cut_second - cut_first, count - cut_second


def group_lengths(lengths: Floats, sizes: tuple[int, int, int]) -> Floats:
    """Rest length H_g of each group, (3,) [Octopus, eq. 3.4–3.6].

    As printed, the sum of eq. 3.4 takes one segment too many; a group's own segments are meant,
    so that the straight arm reaches its own targets.
    """
    ends = np.cumsum(sizes)
    return np.add.reduceat(lengths, [0, ends[0], ends[1]])
