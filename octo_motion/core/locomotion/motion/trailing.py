# SPDX-License-Identifier: GPL-3.0-or-later
"""Outer parts of arms that trail in the water, swing and settle about what the arms do.

What follows is simulated on the motion itself, and let in only while an arm is free: an arm that
rests on the ground, or reaches for something, is where it was, to the last digit.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Final

import numpy as np

from ...follow_through import (
    BoneMotion,
    FollowJob,
    FollowSettings,
    displacement,
    follow,
    own_rotations,
)
from ...rotations import IDENTITY, Floats, multiply, rotate, slerp
from ...smoothing import least_jerk
from .job import Creature, Trailing

_SOFT: Final = FollowSettings(
    material="RUBBER", strength=1.0, damping=0.4, medium="WATER", start="MOTION"
)
"""Flesh in water: it lags behind, and swings over little."""
_COMES: Final = 0.2
"""Seconds within which following comes in after an arm lets go, and goes before it takes hold."""


def trailed(
    trailing: Trailing,
    creature: Creature,
    rotations: Floats,
    going: tuple[Floats, Floats],
    held: Sequence[np.ndarray],
    *,
    share: Floats,
    rate: float,
    cyclic: bool,
) -> Generator[float, None, tuple[Floats, Floats]]:
    """Arms whose outer parts follow, in steps that yield the share that is done.

    Args:
        trailing: what follows.
        creature: whose it is.
        rotations: (moments, bones, 4) of all arms, one after the other.
        going: locations (moments, 3) and orientations (moments, 4) of the armature, world.
        held: (moments,) of each arm, when it is not to be moved.
        share: (moments,) how far arms may follow at all, 0…1.
        rate: moments in a second.
        cyclic: whether the last moment is the first again, but for the way between.

    Returns:
        The same rotations with what follows, and by how much (moments, arms) each arm was free to.
    """
    skeleton, limbs = creature.skeleton, trailing.limbs
    names = [name for bones in creature.bones for name in bones]
    basis = np.tile(IDENTITY, (len(rotations), len(skeleton), 1))
    basis[:, [skeleton.index[name] for name in names]] = rotations
    locations, turns = going
    orientations, heads = skeleton.pose(basis)
    heads = locations[:, None] + creature.scale * rotate(turns[:, None], heads)
    orientations = multiply(turns[:, None], orientations)
    motion = BoneMotion(rate, trailing.unit * heads, orientations)
    root = [*skeleton.ancestors(limbs.bones[0]), limbs.bones[0]][-1]
    cycle = displacement(motion, root) if cyclic else None
    job = FollowJob(limbs, trailing.figure, motion, _SOFT, cycle=cycle)
    found = yield from follow(job)
    own = own_rotations(skeleton, limbs, motion, turns, found)
    free = np.stack([share * _free(each, rate, cyclic=cyclic) for each in held], axis=1)
    result, place = rotations.copy(), {name: number for number, name in enumerate(names)}
    arm_of = [arm for arm, bones in enumerate(creature.bones) for _ in bones]
    for number, bone in enumerate(limbs.bones):
        column = place[skeleton.names[bone]]
        here = free[:, arm_of[column]]
        some = here > 0.0
        result[some, column] = slerp(rotations[some, column], own[some, number], here[some])
    return result, free


def _free(held: np.ndarray, rate: float, *, cyclic: bool) -> Floats:
    """How free an arm is (moments,), 0…1: not at all while it is held, and gently before and after.

    Cyclic, the last moment is the first again.
    """
    times = np.flatnonzero(held).astype(np.float64)
    if not len(times):
        return np.ones(len(held))
    if cyclic:
        times = np.concatenate([times - (len(held) - 1), times, times + len(held) - 1])
    moments = np.arange(len(held), dtype=np.float64)
    after = np.searchsorted(times, moments)
    nearest = np.minimum(
        np.abs(moments - times[np.minimum(after, len(times) - 1)]),
        np.abs(moments - times[np.maximum(after - 1, 0)]),
    )
    return least_jerk(nearest / (rate * _COMES))
