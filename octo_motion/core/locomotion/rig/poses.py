# SPDX-License-Identifier: GPL-3.0-or-later
"""A creature at some moments: how its bones are turned and stretched, and where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...keyframes import halfway_values
from ...rotations import Floats, continuous, normalized


@dataclass(frozen=True, eq=False)
class Poses:
    """A creature at some moments."""

    rotations: Floats
    """(moments, bones, 4) of all arms, one after the other."""
    strains: Floats
    """(moments, bones)"""
    locations: Floats
    """(moments, 3) of the armature, world."""
    orientations: Floats
    """(moments, 4)"""


@dataclass(eq=False)
class ArmMotion:
    """All arms at some moments, while they are worked out."""

    rotations: Floats
    """(moments, bones, 4) of all arms, one after the other."""
    strains: Floats
    """(moments, bones) by how much bones are longer than at rest, as a share."""
    late: Floats
    """(moments, arms) arm lengths from an arm to the foothold that it cannot reach."""
    misses: Floats
    """(moments, arms) arm lengths from an arm to the targets of its gait."""
    in_contact: list[np.ndarray]
    """For each arm (moments, joints) which rest on the ground."""
    cycles: np.ndarray
    """(moments, arms) number of each arm's cycle."""

    @classmethod
    def at_rest(cls, moments: int, bones: Sequence[int]) -> ArmMotion:
        """Arms at rest that hold on to nothing.

        Args:
            moments: how many.
            bones: how many bones each arm has.
        """
        rotations = np.zeros((moments, sum(bones), 4))
        rotations[..., 0] = 1.0
        return cls(
            rotations=rotations,
            strains=np.zeros((moments, sum(bones))),
            late=np.zeros((moments, len(bones))),
            misses=np.zeros((moments, len(bones))),
            in_contact=[np.zeros((moments, each + 1), dtype=bool) for each in bones],
            cycles=np.zeros((moments, len(bones)), dtype=np.int64),
        )

    def at_every(self, count: int) -> ArmMotion:
        """The same at every so many of these moments, from the first on."""
        return ArmMotion(
            rotations=self.rotations[::count],
            strains=self.strains[::count],
            late=self.late[::count],
            misses=self.misses[::count],
            in_contact=[each[::count] for each in self.in_contact],
            cycles=self.cycles[::count],
        )

    def copy(self) -> ArmMotion:
        """The same, whose poses may be changed."""
        return replace(
            self,
            rotations=self.rotations.copy(),
            strains=self.strains.copy(),
            late=self.late.copy(),
        )


def halfway_automatic(poses: Poses, *, cyclic: bool) -> Poses:
    """Half way between frames (frames − 1), as Blender plays keys with automatic handles.

    Args:
        poses: at the frames, one frame apart.
        cyclic: whether the motion is a loop whose curves repeat.
    """
    return Poses(
        _automatic(continuous(poses.rotations), cyclic=cyclic, turns=True),
        _automatic(poses.strains, cyclic=cyclic),
        _automatic(poses.locations, cyclic=cyclic),
        _automatic(continuous(poses.orientations), cyclic=cyclic, turns=True),
    )


def _automatic(values: Floats, *, cyclic: bool, turns: bool = False) -> Floats:
    """Half way between values (frames, …) whose keys have automatic handles.

    The slope at a key is that from its neighbour before to the one after; at either end of a curve
    that does not repeat it is level. The handle's length is Blender's.
    """
    slopes = np.zeros_like(values)
    slopes[1:-1] = 0.5 * (values[2:] - values[:-2])
    if cyclic and len(values) > 2:
        # The last frame is the first again; of a turn it may be so the other way round.
        same = np.sum(values[-1] * values[0], axis=-1, keepdims=True)
        sign = np.where(same < 0.0, -1.0, 1.0) if turns else 1.0
        slopes[0] = 0.5 * (values[1] - values[0] + sign * (values[-1] - values[-2]))
        slopes[-1] = sign * slopes[0]
    half = halfway_values(values, slopes)
    return normalized(half) if turns else half


def halfway_linear(values: Floats, *, turns: bool = False) -> Floats:
    """Values (frames − 1, …) half way from each frame's (frames, …) straight on to the next one's.

    Args:
        values: at the frames.
        turns: whether they are unit quaternions.
    """
    before, after = values[:-1], values[1:]
    if not turns:
        return 0.5 * (before + after)
    other = np.sum(before * after, axis=-1, keepdims=True) < 0.0
    return normalized(before + np.where(other, -after, after))
