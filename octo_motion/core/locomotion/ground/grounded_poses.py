# SPDX-License-Identifier: GPL-3.0-or-later
"""What a walk on the ground is asked for, and what it says: poses and footholds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats


@dataclass(frozen=True, eq=False)
class GroundedPoses:
    """Arms on the ground at some frames; joints of arms of different builds are apart."""

    rotations: Floats
    """(frames, bones, 4) unit quaternions in each bone's rest frame."""
    strains: Floats
    """(frames, bones) by how much each bone is longer than at rest, as a share."""
    misses: Floats
    """(frames, arms) distance of an arm that holds on from its foothold, in arm lengths."""
    joints: tuple[Floats, ...]
    """For each build (frames, arms, segments + 1, 3), world."""
    in_contact: tuple[np.ndarray, ...]
    """For each build (frames, arms, segments + 1): which joints rest on the ground."""
    cycles: np.ndarray
    """(frames, arms) number of the cycle that each arm is in."""
    shapes: tuple[Floats, ...]
    """For each build (segments, 3, frames, arms): the gait's own, in the arms' frames."""
    evened: tuple[Floats, ...]
    """For each build (segments, 3, frames, arms): what evening out over time has added to the arms'
    directions, world; empty where nothing was evened out."""

    def part(self, frames: slice) -> GroundedPoses:
        """Some of the frames."""
        return GroundedPoses(
            self.rotations[frames],
            self.strains[frames],
            self.misses[frames],
            tuple(each[frames] for each in self.joints),
            tuple(each[frames] for each in self.in_contact),
            self.cycles[frames],
            tuple(each[:, :, frames] for each in self.shapes),
            tuple(each[:, :, frames] for each in self.evened),
        )


@dataclass(frozen=True, eq=False)
class Raise:
    """What is asked of arms that are to be higher than they need be."""

    lift: Floats
    """(frames, arms) arm lengths, where they do not lie."""
    shapes: tuple[Floats, ...] | None = None
    """``GroundedPoses.shapes`` of the same frames, none where nobody has kept them."""
    evened: tuple[Floats, ...] = ()
    """``GroundedPoses.evened`` of the same frames."""

    @property
    def arms(self) -> list[int]:
        """Those that are raised at any frame."""
        return np.flatnonzero(np.any(self.lift > 0.0, axis=0)).tolist()


@dataclass(frozen=True, eq=False)
class Foothold:
    """One foothold, as it is shown to the artist."""

    arm: int
    cycle: int
    position: Floats
    """(3,) the joint that touches first, world."""
    heading: float
    """Radians about world Z from +X."""
    touch_down: float
    """Phase of the body, radians, at which the arm touches …"""
    lift_off: float
    """… and at which it lets go."""
    lasts: float
    """Cycles of the arm in between, which a body at rest is slow to come through."""
    short: float
    """Arm lengths by which it is out of reach."""
