# SPDX-License-Identifier: GPL-3.0-or-later
"""Head and mantle of a swimming body: stretched out along the way, in line with the arms.

At rest an octopus carries its mantle leaning back. Swimming it goes mantle first, and a mantle
that hangs off to the side would brake it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..rotations import Floats, normalized
from ..skeleton import Skeleton
from .chains import BodyFrame, joint_positions
from .poses import arm_rest, bone_rotations

_FARTHEST_LEAN: Final = np.radians(75.0)
"""A part that leans further than this is not built to be straightened."""


def find_mantle(
    skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame
) -> tuple[str, ...]:
    """Bones from what the arms stand on to the body's highest tip; none if there is no such part.

    Args:
        skeleton: the rig.
        arms: bone names, root to tip.
        body: which way the body faces.
    """
    limbs = {skeleton.index[bone] for bones in arms for bone in bones}
    carrying: set[int] = set()
    for bones in arms:
        bone = skeleton.parents[skeleton.index[bones[0]]]
        while bone >= 0:
            carrying.add(bone)
            bone = skeleton.parents[bone]
    heights = body.to_body(skeleton.tails)[:, 2]
    best: tuple[int, ...] = ()
    for tip in range(len(skeleton)):
        path = _path(skeleton, tip, carrying)
        usable = path and limbs.isdisjoint(path) and heights[tip] > 0.0
        if usable and (not best or heights[tip] > heights[best[-1]]):
            best = path
    if any(skeleton.constrained[bone] for bone in best):
        return ()
    leaning = np.arccos(np.clip(_directions(skeleton, best) @ body.rotation[:, 2], -1.0, 1.0))
    if np.any(leaning > _FARTHEST_LEAN):
        return ()
    return tuple(skeleton.names[bone] for bone in best)


def stretched(skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame, amount: float) -> Floats:
    """Rotations (bones, 4) in each bone's rest frame that stretch the mantle towards the body's +Z.

    Args:
        skeleton: the rig.
        mantle: bone names from ``find_mantle``.
        body: which way the body faces.
        amount: 0 leaves it at rest, 1 makes it straight.
    """
    if not mantle:
        return np.empty((0, 4))
    rest = _directions(skeleton, [skeleton.index[name] for name in mantle])
    towards = normalized((1.0 - amount) * rest + amount * body.rotation[:, 2])
    turns = bone_rotations(
        [arm_rest(skeleton, mantle)],
        towards[:, :, None, None],
        np.zeros((len(mantle), 1, 1)),
    )
    return turns[0, 0]


def _path(skeleton: Skeleton, tip: int, carrying: set[int]) -> tuple[int, ...]:
    """Bones from below what carries the arms to a tip; none if it does not hang on that."""
    path: list[int] = []
    bone = tip
    while bone >= 0 and bone not in carrying:
        path.append(bone)
        bone = skeleton.parents[bone]
    return tuple(reversed(path)) if bone >= 0 else ()


def _directions(skeleton: Skeleton, bones: Sequence[int]) -> Floats:
    """Unit vectors (bones, 3) along the segments, armature space."""
    names = [skeleton.names[bone] for bone in bones]
    if not names:
        return np.empty((0, 3))
    return normalized(np.diff(joint_positions(skeleton, names), axis=0))
