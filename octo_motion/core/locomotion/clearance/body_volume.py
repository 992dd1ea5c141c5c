# SPDX-License-Identifier: GPL-3.0-or-later
"""How much room a creature takes, and whether its arms keep apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from ..rig import ArmFrames
from .arm_separation import MOST_CAPSULES, Bulk, joints_that_count
from .capsule_overlap import Capsules, Separation, measure_overlap

DEEP: Final = 0.1
"""Share of a radius by which arms may overlap without a word: flesh gives."""

_MOST_PARTED: Final = 200_000_000
"""Distances with more of which arms are not kept apart: half a minute where all are tangled."""

_MOST_DISTANCES: Final = 60_000_000
"""With more, of very many arms over very many frames, only every second, third … is measured."""


@dataclass(frozen=True, eq=False)
class BodyVolume:
    """How much room arms and body take: what it takes to measure how far they keep apart."""

    arms: tuple[ArmFrames, ...]
    names: tuple[str, ...]
    radii: tuple[Floats, ...]
    still: tuple[Capsules, ...]
    """Of the body, one frame."""
    upward: Floats
    """(3,) unit: the body's, armature space."""

    @property
    def bulk(self) -> Bulk:
        """What must not pass through itself."""
        return Bulk(self.arms, self.radii, self.still, self.upward)

    def _distances(self, frames: int) -> int:
        """How many there are to be looked at over so many frames."""
        capsules = sum(min(len(arm.bones), MOST_CAPSULES) for arm in self.arms) + len(self.still)
        return frames * capsules * capsules

    def too_many(self, frames: int) -> str:
        """Why arms cannot be kept apart over so many frames, "" if they can."""
        if self._distances(frames) <= _MOST_PARTED:
            return ""
        return (
            f"Arms are not kept apart: {len(self.arms)} arms over {frames:,} frames would take too "
            "long. Make shorter motions, or switch arms off."
        )

    def measure(self, rotations: Floats, strains: Floats) -> tuple[Separation, int]:
        """What overlaps, and at every how many frames it was looked for.

        Args:
            rotations: (frames, bones, 4) of all arms, one after the other.
            strains: (frames, bones) by how much bones are longer than at rest.
        """
        every = max(1, -(-self._distances(len(rotations)) // _MOST_DISTANCES))
        looked = rotations[::every]
        ends = np.cumsum([0, *(len(arm.bones) for arm in self.arms)])
        chains: list[Capsules] = []
        for number, arm in enumerate(self.arms):
            columns = slice(int(ends[number]), int(ends[number + 1]))
            own, longer = looked[:, columns], strains[::every, columns]
            some = joints_that_count(len(arm.bones))
            joints, rest = arm.joints(arm.from_bones(own), longer), arm.joints(arm.at_rest)
            radii = self.radii[number][some]
            chains.append(Capsules(self.names[number], joints[:, some], radii, rest[some]))
        still = [
            Capsules(each.name, np.tile(each.joints, (len(looked), 1, 1)), each.radii, each.at_rest)
            for each in self.still
        ]
        return measure_overlap(chains, still), every

    @staticmethod
    def told(found: Separation, every: int, frames: Floats) -> tuple[str, ...]:
        """A sentence on the deepest overlap, none if arms keep apart.

        Args:
            found: what :meth:`measure_overlap` says.
            every: at every how many frames it looked.
            frames: (frames,) their numbers in the scene.
        """
        worst = found.worst
        if worst is None or worst.depth <= DEEP:
            return ()
        share = 100.0 * float(np.mean(found.depths > DEEP))
        told = (
            f"'{worst.first}' passes through '{worst.second}' at frame "
            f"{frames[worst.frame * every]:.0f}, by {worst.depth:.1f} of the radius; something "
            f"overlaps at {share:.0f} % of the frames."
        )
        return (told,)
