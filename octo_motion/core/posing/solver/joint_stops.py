# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the solver that keep joints within their ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats, small_batches
from ..puppet import Figure, Integers, bends, slopes

_ENDLESS = np.pi - 1e-9

_NEAR = 0.1
"""Radians from an end at which it is watched, more for joints that turn fast."""

_BACK = 0.1
"""rad/s: how fast a joint that was forced beyond an end is led back. So slow that it is no push,
and yet under a pull that lasts the joint stands still instead of creeping on."""

_OPEN = 5e-4
"""cos² of half the swing; a bone that points backwards has no way to say which way it is bent."""


@dataclass(eq=False)
class Stops:
    """Ends of joints' ranges that are near: one row each, ``axis · w ≥ −rate``.

    The impulse about the axis is max(0, −a (axis·w + rate)).
    """

    joints: Integers
    """(stops,) bodies."""
    axes: Floats
    """(stops, 3) world, unit: the turn that leads back."""
    rates: Floats
    """(stops,) rad/s, gap/h: how fast the joint may turn towards the end; a little below zero
    where it is beyond."""
    gains: Floats
    """(stops,) a, N·m·s per rad/s."""
    spread: Floats
    """(bodies, stops) 1 where the stop is the joint's: sums what a joint's stops do."""
    labels: Integers
    """(stops,) the same number for the same end of the same joint in every step."""


class JointStops:
    """The joints of a figure that have limits, and the rows that hold them."""

    def __init__(self, figure: Figure, gains: Floats) -> None:
        """Find them; limits of roots count for nothing.

        Gains (bodies,) are the a of a row at each joint, N·m·s per rad/s.
        """
        ranges = np.array(figure.limits, dtype=np.float64)
        least = np.where(ranges[..., 0] <= -_ENDLESS, -np.inf, ranges[..., 0])
        most = np.where(ranges[..., 1] >= _ENDLESS, np.inf, ranges[..., 1])
        limited = np.isfinite(least).any(axis=1) | np.isfinite(most).any(axis=1)
        limited &= np.array(figure.parents) >= 0
        self.joints = np.flatnonzero(limited)
        """Bodies whose joints have limits."""
        # Both ends as what has to stay above zero: the bend less the least, the most less it.
        self._signs = np.array([1.0, -1.0])[:, None]
        self._ends = np.stack([-least, most], axis=1)[self.joints]
        self._rest = figure.rest[self.joints]
        self._axes = small_batches.to_matrix(self._rest)
        self._gains = gains[self.joints]
        self._count = len(figure)

    def near(self, turns: Floats, frames: Floats, speeds: Floats, step: float) -> tuple[Stops, ...]:
        """Ends of ranges that a joint could reach within a step, s, or is at, as rows.

        Joints are turned (bodies, 4) in their parents' frames (bodies, 3, 3), and turn with
        (bodies, 3), rad/s.
        """
        if not len(self.joints):
            return ()
        speeds = speeds[self.joints]
        fastest = float(np.sqrt((speeds * speeds).sum(axis=1).max()))
        own = small_batches.conjugate_multiply(self._rest, turns[self.joints])
        gaps = self._signs * bends(own)[:, None, :] + self._ends
        found = gaps < _NEAR + 2.0 * step * fastest
        found &= (own[:, 0] ** 2 + own[:, 2] ** 2 > _OPEN)[:, None, None]
        which, side, axis = found.nonzero()
        if not len(which):
            return ()
        # In world axes: rows times the transposed frame of the bone at rest.
        seen = slopes(own) @ (frames[self.joints] @ self._axes).transpose(0, 2, 1)
        sizes = np.sqrt(small_batches.vecdot(seen, seen))[which, axis]
        rows = seen[which, axis] * (self._signs[side] / sizes[:, None])
        rates = np.maximum(gaps[which, side, axis] / (sizes * step), -_BACK)
        joints = self.joints[which]
        spread = np.zeros((self._count, len(which)))
        spread[joints, np.arange(len(which))] = 1.0
        labels = 6 * which + 3 * side + axis
        return (Stops(joints, rows, rates, self._gains[which], spread, labels),)
