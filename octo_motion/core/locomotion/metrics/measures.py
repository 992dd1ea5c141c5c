# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a motion is, in figures: the worst of each kind, and where it is.

Everything is measured on arrays that may come from anywhere: as computed, or as Blender plays
them, between frames too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats, angle_between
from ..ground import Ground


@dataclass(frozen=True)
class Worst:
    """The largest value of its kind."""

    value: float
    sample: int
    """Number of the frame among those that were given."""
    arm: int
    """Number of the arm among those that were given; of bones, of the bone."""


def slip(joints: Floats, lying: np.ndarray, cycles: np.ndarray, lengths: Floats) -> Worst:
    """How far a joint that rests on the ground has moved since it came to rest, in arm lengths.

    Args:
        joints: (frames, arms, joints, 3) world, frames in their order.
        lying: (frames, arms, joints) which rest.
        cycles: (frames, arms) number of each arm's cycle: in another cycle it rests anew.
        lengths: (arms,) in the units of the joints.
    """
    fresh = lying.copy()
    same = cycles[1:] == cycles[:-1]
    fresh[1:] &= ~(lying[:-1] & same[..., None])
    numbers = np.arange(len(joints))[:, None, None]
    since = np.maximum.accumulate(np.where(fresh, numbers, 0), axis=0)
    start = np.take_along_axis(joints, since[..., None], axis=0)
    moved = np.linalg.norm(joints - start, axis=-1) * lying
    return _worst(moved.max(axis=-1, initial=0.0) / lengths)


def depth(joints: Floats, ground: Ground, lengths: Floats, radii: Floats | None = None) -> Worst:
    """How far a joint is below the ground, in arm lengths; negative if all are above.

    The root is left out: it is the body's.

    Args:
        joints: (frames, arms, joints, 3) world.
        ground: what they should be above of.
        lengths: (arms,) in the units of the joints.
        radii: (arms, joints) of the skin below the joints, or none for the joints themselves.
    """
    below = ground.height(joints[..., 1:, :]) - joints[..., 1:, 2]
    if radii is not None:
        below = below + radii[:, 1:]
    return _worst(below.max(axis=-1) / lengths)


def strain(strains: Floats) -> Worst:
    """By how much a bone is longer or shorter than at rest, as a share: (frames, bones)."""
    return _worst(np.abs(strains))


def miss(misses: Floats) -> Worst:
    """How far an arm is from its target or its foothold: (frames, arms) arm lengths."""
    return _worst(misses)


def change(rotations: Floats, frames: Floats) -> Worst:
    """How far a bone turns from one frame to the next, radians per frame.

    Args:
        rotations: (frames, bones, 4) unit quaternions.
        frames: (frames,) ascending; need not be whole.
    """
    angle = angle_between(rotations[:-1], rotations[1:])
    return _worst(angle / np.diff(frames)[:, None])


def _worst(values: Floats) -> Worst:
    """The largest of values (frames, arms)."""
    if values.size == 0:
        return Worst(0.0, 0, 0)
    sample, arm = np.unravel_index(int(np.argmax(values)), values.shape)
    return Worst(float(values[sample, arm]), int(sample), int(arm))
