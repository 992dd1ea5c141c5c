# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion clip as plain arrays: what splicing takes and gives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...rotations import Floats, from_matrix, multiply, rotate
from ...skeleton import Skeleton

MOTION_SUFFIXES: Final = (".bvh", ".fbx", ".glb", ".gltf")
"""Endings of the files from which clips may come."""


@dataclass(frozen=True, eq=False)
class Clip:
    """The motion of one armature, frame by frame."""

    name: str
    skeleton: Skeleton
    frames: Floats
    """(frames,) ascending frame numbers; fractions are allowed."""
    rate: float
    """Frames per second."""
    rotations: Floats
    """(frames, bones, 4) unit quaternions in each bone's rest frame (Blender's matrix_basis)."""
    locations: Floats
    """(frames, bones, 3) in each bone's rest frame, armature units."""
    world: Floats
    """(frames, 4, 4) world matrix of the armature object; uniform scale."""
    scales: Floats | None = None
    """(frames, bones, 3) of bones that get longer or thicker without bending those they carry; none
    if there are none. They go along with a part, and count for nothing else."""
    own: Floats | None = None
    """(frames, 4, 4) of ``world`` what the object's own channels make, where parents or constraints
    may carry it further; none if nothing is known of that."""

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    @cached_property
    def scale(self) -> float:
        """World size of one armature unit, metres."""
        return float(np.cbrt(abs(np.linalg.det(self.world[0, :3, :3]))))

    def posed(self) -> tuple[Floats, Floats]:
        """World orientations (frames, bones, 4) and head positions (frames, bones, 3)."""
        orientations, heads = self.skeleton.pose(self.rotations, self.locations)
        turn = from_matrix(self.world[:, :3, :3] / self.scale)[:, None]
        shift = self.world[:, None, :3, 3]
        return multiply(turn, orientations), shift + self.scale * rotate(turn, heads)

    def taken(self, rows: ArrayLike) -> Clip:
        """Some of its frames alone, by number from 0, ascending."""
        chosen = np.asarray(rows, dtype=np.intp)
        return replace(
            self,
            frames=self.frames[chosen],
            rotations=self.rotations[chosen],
            locations=self.locations[chosen],
            world=self.world[chosen],
            scales=None if self.scales is None else self.scales[chosen],
            own=None if self.own is None else self.own[chosen],
        )
