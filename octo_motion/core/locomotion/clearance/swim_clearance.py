# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that neither lie nor walk kept off the ground: those of a swimmer, and on their way there.

A gait in the water knows no ground. Where a body takes off from it, or comes down to it, arms
would hang into it. They are raised just as arms are that swing, by turning the bones before their
lowest joints as little as it takes; each bone keeps its own twist.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...easing import smooth_step
from ...rotations import Floats, conjugate, multiply, rotate, shortest_arc
from ..ground import raise_over_ground
from ..rig import JointRoom, Poses, loose_from_root, room_needed
from .subframe_clearance import ArmsOverGround

_ROUNDS: Final = 6
_SOFT: Final = 0.5
"""Share of the height that a joint needs within which it begins to be raised."""
_RAMP: Final = 0.15
"""Share of the way from one gait to another within which arms come to be raised, or are no more."""
_ALONG: Final = np.array([1.0, 0.0, 0.0])


def afloat(swims: Sequence[bool], shares: Sequence[Floats]) -> Floats:
    """How far arms (frames, arms) are to be kept off the ground, 0…1.

    Those that walk see to it themselves; all that swim or go over from one gait to another do not.

    Args:
        swims: whether each segment of the route is swum, one at least.
        shares: for each change from one to the next, how far each arm (frames, arms) has gone
            over.
    """
    result = np.full(shares[0].shape if shares else (1, 1), float(swims[0]))
    for swum, share in zip(swims[1:], shares, strict=True):
        leaving = np.maximum(result, smooth_step(share / _RAMP))
        coming = smooth_step((1.0 - share) / _RAMP) if not swum else 1.0
        result = np.where(share > 0.0, leaving * coming, result)
    return result


def keep_off_ground(
    course: ArmsOverGround, poses: Poses, radii: Sequence[Floats], loose: Floats
) -> Floats:
    """Rotations (frames, bones, 4) of the same arms off the ground.

    Args:
        course: the arms and the ground.
        poses: the arms as they are.
        radii: for each arm (joints,) metres from each joint to the skin below it.
        loose: (frames, arms) how far each is to be raised, 0…1.
    """
    result = poses.rotations.copy()
    for number, arm in enumerate(course.arms):
        chosen, bones = np.flatnonzero(loose[:, number] > 0.0), course.bones[number]
        if not len(chosen):
            continue
        frames = arm.from_bones(np.ascontiguousarray(poses.rotations[chosen, bones]))
        lengths = course.scale * arm.lengths * (1.0 + poses.strains[chosen, bones])
        facing = poses.orientations[chosen, None]
        directions = rotate(multiply(facing, frames), _ALONG)
        roots = poses.locations[chosen] + rotate(facing[:, 0], course.scale * arm.root)
        reach = np.concatenate([np.zeros((len(chosen), 1)), np.cumsum(lengths, axis=1)], axis=1)
        needed = room_needed(radii[number], reach[:, -1:])
        own = loose_from_root(reach, reach[:, -1:]) * loose[chosen, number, None]
        room = JointRoom(
            np.ascontiguousarray(needed.T),
            np.ascontiguousarray(own.T),
            _SOFT * needed.max(axis=1),
        )
        turned = raise_over_ground(
            np.ascontiguousarray(np.moveaxis(directions, 0, -1)),
            np.ascontiguousarray(lengths.T),
            room,
            free=np.ones_like(lengths.T),
            roots=np.ascontiguousarray(roots.T),
            ground=course.ground,
            iterations=_ROUNDS,
        )
        back = conjugate(facing)
        before, after = (rotate(back, each) for each in (directions, np.moveaxis(turned, -1, 0)))
        moved = np.any(np.abs(after - before) > 1e-12, axis=(1, 2))
        higher = multiply(shortest_arc(before[moved], after[moved]), frames[moved])
        result[chosen[moved], bones] = arm.to_bones(higher)
    return result
