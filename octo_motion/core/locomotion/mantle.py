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
"""A part that leans further than this is not built to be straightened: it would swallow the head
that it lies behind."""
_SAME_PLACE: Final = 1e-3
"""Joints that are closer than this share of the body's size are one."""


def find_mantle(
    skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame
) -> tuple[str, ...]:
    """Bones from what the arms stand on to the tip of the largest part that is no arm; none if
    there is no such part above the arms.

    Bones without length of their own, as importers put between others, are left out: they ride
    along.

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
    same = _SAME_PLACE * float(np.max(np.ptp(skeleton.heads, axis=0), initial=0.0))
    best: tuple[int, ...] = ()
    largest = 0.0
    for tip in range(len(skeleton)):
        path = _path(skeleton, tip, carrying, same)
        if not path or not limbs.isdisjoint(path):
            continue
        joints = joint_positions(skeleton, [skeleton.names[bone] for bone in path])
        size = float(np.linalg.norm(joints[-1] - joints[0]))
        # Of two that come equally far, the one that hangs on the other.
        if size > largest - same and body.to_body(joints[-1])[2] > 0.0:
            best, largest = path, size
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


def _path(skeleton: Skeleton, tip: int, carrying: set[int], same: float) -> tuple[int, ...]:
    """Bones from below what carries the arms to a tip; none if it does not hang on that.

    A bone without a parent hangs on what carries the arms if it begins where that begins or ends.
    """
    path: list[int] = []
    bone = tip
    while bone >= 0 and bone not in carrying:
        if not path or np.linalg.norm(skeleton.heads[bone] - skeleton.heads[path[-1]]) > same:
            path.append(bone)
        bone = skeleton.parents[bone]
    if bone < 0 and path:
        ends = [place[each] for each in carrying for place in (skeleton.heads, skeleton.tails)]
        start = skeleton.heads[path[-1]]
        if all(np.linalg.norm(end - start) > same for end in ends):
            return ()
    return tuple(reversed(path))


def _directions(skeleton: Skeleton, bones: Sequence[int]) -> Floats:
    """Unit vectors (bones, 3) along the segments, armature space."""
    names = [skeleton.names[bone] for bone in bones]
    if not names:
        return np.empty((0, 3))
    return normalized(np.diff(joint_positions(skeleton, names), axis=0))
