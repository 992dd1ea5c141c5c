# SPDX-License-Identifier: GPL-3.0-or-later
"""Places on uneven ground where an arm lies well.

An arm that takes hold on the crest of a bump, and hangs down behind it, is bent where it is peeled
off: as the body pulls, it has to come over the crest, and does so in a jerk. Just before a crest,
or behind it, it lies well. So an arm that may choose looks around a little.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ...rotations import Floats, rotate_in_plane
from .surface import Ground

_TURNS: Final = np.radians([0.0, -6.0, 6.0, -12.0, 12.0, -18.0, 18.0])
"""Where an arm looks besides straight ahead …"""
_STEPS: Final = np.array([0.0, -0.04, 0.04, -0.08, 0.08, -0.12, 0.12])
"""… and nearer or farther, in arm lengths."""
_ASTRAY: Final = np.array([0.25, 0.15])
"""How much worse the farthest of these are, as a share of what a bend of a radian is …"""
_BEND: Final = np.radians(14.0)
"""… more than this, by which the ground falls away under an arm that lies on it."""
_POINTS: Final = np.linspace(0.0, 1.0, 8)


def settled(
    ground: Ground, roots: Floats, aims: Floats, lies: Floats, away: Floats, *, sizes: Floats
) -> tuple[Floats, Floats]:
    """Which way and how far from where they wanted to take hold arms do so.

    Args:
        ground: what they lie on.
        roots: (arms, cycles, 3) where they begin, world.
        aims: (arms, cycles, 2) unit: which way they want to.
        lies: (arms, cycles, 2) unit: which way they lie from there.
        away: (arms, cycles) metres from the root, seen from above; nan where they have no choice.
        sizes: (arms, 2) metres of the whole arm, and of what lies.

    Returns:
        Radians (arms, cycles) anticlockwise, and metres (arms, cycles) by which they are farther.
    """
    turns, farther = np.zeros(away.shape), np.zeros(away.shape)
    arm, cycle = np.nonzero(np.isfinite(away))
    whole, lying = sizes[arm].T

    def badness(chosen: np.ndarray, turn: Floats, step: Floats) -> Floats:
        """Of some of them (chosen, …), tried otherwise (…)."""
        at = arm[chosen], cycle[chosen]
        extra = (slice(None), *[None] * turn.ndim)
        root, length = roots[at][extra], whole[chosen][extra]
        place = root[..., :2] + (away[at][extra] + step * length)[..., None] * rotate_in_plane(
            aims[at][extra], turn
        )
        along = (lying[chosen][extra] * _POINTS.reshape(-1, *[1] * (turn.ndim + 1)))[..., None]
        height = ground.height(place + along * rotate_in_plane(lies[at][extra], turn))
        slope = np.arctan(np.diff(height, axis=0) / (lying[chosen][extra] * _POINTS[1]))
        # The arm comes down to its place, and from there on the ground falls away more.
        comes = np.arctan2(height[0] - root[..., 2], away[at][extra] + step * length)
        falls = np.max(np.maximum.accumulate(np.maximum(slope, comes), axis=0) - slope, axis=0)
        return np.maximum(falls - _BEND, 0.0)

    if not len(arm):
        return turns, farther
    bad = np.flatnonzero(badness(np.arange(len(arm)), np.zeros(()), np.zeros(())) > 0.0)
    if len(bad):
        turn, step = (each.ravel() for each in np.meshgrid(_TURNS, _STEPS, indexing="ij"))
        astray = _ASTRAY[0] * np.abs(turn) / _TURNS.max() + _ASTRAY[1] * np.abs(step) / _STEPS.max()
        best = np.argmin(badness(bad, turn, step) + astray, axis=1)
        at = arm[bad], cycle[bad]
        turns[at], farther[at] = turn[best], step[best] * whole[bad]
    return turns, farther
