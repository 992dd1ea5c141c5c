# SPDX-License-Identifier: GPL-3.0-or-later
"""Loops: clips that end in the pose in which they begin, wherever that has led them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, angle_between, from_axis_angle, multiply, rotate
from .foot_contacts import FootPaths
from .parts import bones_beneath
from .retarget import MappedClip

_ALIKE: Final = np.radians(2.0)
"""How far a bone may be turned otherwise in the last frame than in the first, …"""

_PLACED: Final = 0.01
"""… and, in leg lengths, how far a foot may be off where it was, as seen from the hips."""

_SHORTEST: Final = 8
"""Frames that a loop has at least."""

_UP: Final = np.array([0.0, 0.0, 1.0])
_LEVEL: Final = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Rounds:
    """From a round of a loop to the next: about the vertical, and on over the ground."""

    turn: Floats
    """(4,)"""
    first: Floats
    """(3,) a place in the first frame, level, …"""
    last: Floats
    """(3,) … and in the last."""

    @classmethod
    def between(cls, hips: Floats) -> Rounds:
        """Of hip joints (frames, 2, 3), left and right, world."""
        ends = hips[[0, -1]] * _LEVEL
        left = ends[:, 0] - ends[:, 1]
        angles = np.arctan2(left[:, 1], left[:, 0])
        first, last = ends.mean(axis=1)
        return cls(from_axis_angle(_UP, angles[1] - angles[0]), first, last)

    def points(self, points: Floats) -> Floats:
        """Points (frames, …, 3) with those of the round before and of the one behind, whose ends
        are the same frames.
        """
        back = self.turn * np.array([1.0, -1.0, -1.0, -1.0])
        before = self.first + rotate(back, points[:-1] - self.last)
        behind = self.last + rotate(self.turn, points[1:] - self.first)
        return np.concatenate([before, points, behind])

    def turns(self, turns: Floats) -> Floats:
        """Orientations (frames, 4), likewise."""
        back = self.turn * np.array([1.0, -1.0, -1.0, -1.0])
        return np.concatenate([multiply(back, turns[:-1]), turns, multiply(self.turn, turns[1:])])


def repeated(values: np.ndarray) -> np.ndarray:
    """What is the same in every round, (frames, …), likewise."""
    return np.concatenate([values[:-1], values, values[1:]])


def own_round(count: int) -> slice:
    """The rows of the round itself, of so many frames."""
    return slice(count - 1, 2 * count - 1)


def is_loop(mapped: MappedClip, paths: FootPaths) -> bool:
    """Whether a clip ends in the pose in which it begins."""
    clip = mapped.clip
    if len(clip) < _SHORTEST:
        return False
    ends = clip.rotations[[0, -1]]
    hips = mapped.bone("hips")
    inside = [bone for bone in bones_beneath(clip.skeleton, [hips]) if bone != hips]
    if angle_between(ends[0, inside], ends[1, inside]).max() > _ALIKE:
        return False
    around = Rounds.between(paths.hips)
    feet = paths.points[[0, -1], :, 0]
    there = around.last + rotate(around.turn, feet[0] - around.first)
    return bool(np.linalg.norm(there - feet[1], axis=-1).max() < _PLACED * paths.leg)
