# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether arms keep apart: from the rig and its skin to what is said of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import bpy
import numpy as np

from ....blender.rig import radii_of_skin, skin_key, skin_parts
from ....core.content_cache import ContentCache, content_key
from ....core.locomotion.clearance import (
    MOST_CAPSULES,
    Bulk,
    Capsules,
    Separation,
    joints_that_count,
    measure_overlap,
)
from ....core.locomotion.gait import Arm
from ....core.locomotion.metrics import TOLD
from ....core.locomotion.rig import ArmFrames, BodyFrame, frames_of_arm
from ....core.rotations import Floats
from ....core.skeleton import Skeleton

DEEP: Final = TOLD["OVERLAP"]
"""Share of a radius by which arms may overlap without a word: flesh gives."""

_MOST_PARTED: Final = 200_000_000
"""Distances with more of which arms are not kept apart: half a minute where all are tangled."""
_MOST_DISTANCES: Final = 60_000_000
"""With more, of very many arms over very many frames, only every second, third … is measured."""


@dataclass(frozen=True, eq=False)
class Apart:
    """What it takes to measure how far arms keep apart; see :func:`read_apart`."""

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


_known: Final[ContentCache[Apart]] = ContentCache(2)


def read_apart(
    armature: bpy.types.Object,
    skeleton: Skeleton,
    arms: tuple[Arm, ...],
    body: BodyFrame,
    *,
    live: bool = False,
) -> Apart:
    """The arms and the parts of the body as thick as their skin.

    Args:
        armature: the armature object.
        skeleton: its bones.
        arms: those that move.
        body: which way it faces.
        live: whether it is to be quick: which bones a skin follows is then looked at anew only
            where the skin has changed its form.
    """
    if not live:
        _known.clear()
    key = content_key(skeleton, arms, body, skin_key(armature))
    return _known.get(key, lambda: _read_apart(armature, skeleton, arms, body))


def _read_apart(
    armature: bpy.types.Object, skeleton: Skeleton, arms: tuple[Arm, ...], body: BodyFrame
) -> Apart:
    limbs = {bone for arm in arms for bone in arm.bones}
    parts = [
        name
        for number, name in enumerate(skeleton.names)
        if skeleton.deform[number]
        and skeleton.weighted[number]
        and not _hangs(skeleton, name, limbs)
    ]
    radii = radii_of_skin(armature, [arm.bones for arm in arms])
    still = [
        Capsules(name, ends[None], thick, ends) for name, ends, thick in skin_parts(armature, parts)
    ]
    return Apart(
        arms=tuple(frames_of_arm(skeleton, arm.bones, body) for arm in arms),
        names=tuple(arm.name for arm in arms),
        radii=tuple(radii),
        still=tuple(still),
        upward=body.rotation[:, 2],
    )


def _hangs(skeleton: Skeleton, name: str, limbs: set[str]) -> bool:
    """Whether a bone is of an arm, or hangs on one."""
    bone = skeleton.index[name]
    while bone >= 0:
        if skeleton.names[bone] in limbs:
            return True
        bone = skeleton.parents[bone]
    return False
