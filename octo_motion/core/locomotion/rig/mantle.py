# SPDX-License-Identifier: GPL-3.0-or-later
"""Head and mantle of a swimming body: stretched out along the way, in line with the arms.

At rest an octopus carries its mantle leaning back. Swimming it goes mantle first, and a mantle
that hangs off to the side would brake it. One that leans is raised. One that lies flat behind the
head, on bodies that are built lying as a squid is, would swallow the head: such a body swims as it
lies, and its arms close before its face.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...rotations import Floats, normalized
from ...skeleton import Skeleton
from .arm_chains import BodyFrame, joint_positions
from .bone_rotations import arm_rest, rotate_bones

_FARTHEST_LEAN: Final = np.radians(75.0)
"""A part that leans further than this is not built to be straightened: it would swallow the head
that it lies behind."""
_FARTHEST_BACK: Final = np.radians(105.0)
"""A mantle that hangs lower than this behind the head does not lie."""
_MOST_ASIDE: Final = np.radians(30.0)
"""Nor does one that points this far to a side."""
_SAME_PLACE: Final = 1e-3
"""Joints that are closer than this share of the body's size are one."""


def find_mantle(
    skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame
) -> tuple[str, ...]:
    """Bones from what the arms stand on to the tip of the largest part that is no arm; none if
    there is no such part above the arms or level behind them, or if it can neither be raised nor
    be swum along.

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
        if size > largest - same and _is_above(body.to_body(joints[-1]), size):
            best, largest = path, size
    if any(skeleton.constrained[bone] for bone in best):
        return ()
    mantle = tuple(skeleton.names[bone] for bone in best)
    if len(_not_raised(skeleton, mantle, body)) and not lies_back(skeleton, mantle, body):
        return ()
    return mantle


def lies_back(skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame) -> float:
    """How far from the body's +Z a mantle lies back that is not to be raised, radians; else 0.

    Args:
        skeleton: the rig.
        mantle: bone names from ``find_mantle``.
        body: which way the body faces.
    """
    lying = _not_raised(skeleton, mantle, body)
    if not len(lying):
        return 0.0
    aside, behind, above = (lying[-1] - lying[0]).tolist()
    lean = float(np.arctan2(behind, above))
    if not 0.0 < lean < _FARTHEST_BACK or abs(aside) > np.tan(_MOST_ASIDE) * np.hypot(
        behind, above
    ):
        return 0.0
    return lean


def stretch_mantle(
    skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame, amount: float
) -> Floats:
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
    turns = rotate_bones(
        [arm_rest(skeleton, mantle)],
        towards[:, :, None, None],
        np.zeros((len(mantle), 1, 1)),
    )
    return turns[0, 0]


def _is_above(tip: Floats, size: float) -> bool:
    """Whether a part of such a size whose tip (3,) is there, canonical, is above the arms.

    One that lies behind them may be level with them.
    """
    _, behind, above = tip.tolist()
    return above > 0.0 or (behind > 0.0 and above > np.cos(_FARTHEST_BACK) * size)


def _not_raised(skeleton: Skeleton, mantle: Sequence[str], body: BodyFrame) -> Floats:
    """Canonical joints (n, 3) of a mantle from the first bone on that leans too far to be raised.

    None at all if it can be.
    """
    if not mantle:
        return np.empty((0, 3))
    joints = body.to_body(joint_positions(skeleton, mantle))
    rising = normalized(np.diff(joints, axis=0))[:, 2]
    far = np.flatnonzero(rising < np.cos(_FARTHEST_LEAN))
    return joints[far[0] :] if len(far) else np.empty((0, 3))


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
