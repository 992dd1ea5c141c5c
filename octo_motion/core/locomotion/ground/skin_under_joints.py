# SPDX-License-Identifier: GPL-3.0-or-later
"""How high joints lie whose bones are not in the middle of their skin.

Which side of its skin an arm lies on hangs on how it came there, and that on how high its joints
lie. So it is looked at on an arm that lies as if it were round: brought down to its skin, it hardly
turns any more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, rotate
from ..rig import ArmSkin
from .surface import Ground

_ALONG: Final = np.linspace(0.5, 1.0, 5)
"""Where along the bone that comes down to the ground it is looked at whether it is in it."""


@dataclass(frozen=True, eq=False)
class Seen:
    """One arm at some moments, which lies from joint c on as if its skin were round."""

    joints: Floats
    """(moments, bones + 1, 3) world."""
    orientations: Floats
    """(moments, bones, 4) of its bones, world."""
    upward: Floats
    """(moments, bones + 1 − c, 3) which way up the ground is at the joints that may lie."""
    rests: np.ndarray
    """(moments, bones + 1 − c) which of them do."""
    cycles: np.ndarray
    """(moments,) number of the cycle, 0…"""


def skin_below(skin: ArmSkin, seen: Seen, known: Floats, ground: Ground, *, scale: float) -> Floats:
    """Metres (cycles, bones + 1 − c) from joints that lie to the skin below them.

    Args:
        skin: of the arm.
        seen: how it lies if it is round.
        known: (cycles, bones + 1 − c) the same for round skin.
        ground: what it lies on.
        scale: metres of the armature's unit.
    """
    first = seen.joints.shape[1] - known.shape[1]
    # The bone that comes down has the ground of where it does so.
    upward = seen.upward[:, [0, *range(known.shape[1])]]
    down = -np.stack([upward[:, :-1], upward[:, 1:]], axis=2)
    back = conjugate(seen.orientations[:, first - 1 :])
    reach = scale * skin.below(rotate(back[:, :, None], down), first - 1)
    lies = np.zeros(seen.rests.shape)
    lies[:, :-1] = reach[:, 1:, 0]
    lies[:, 1:] = np.maximum(lies[:, 1:], reach[:, 1:, 1])
    lowered = _lowered(
        seen.joints[:, first - 1 : first + 1], reach[:, 0], seen.upward[:, 0], ground
    )
    lies[:, 0] = np.maximum(lies[:, 0], known[seen.cycles, 0] - lowered)
    below = np.full(known.shape, -np.inf)
    np.maximum.at(below, seen.cycles, np.where(seen.rests, lies, -np.inf))
    return np.where(np.isfinite(below), below, known)


def _lowered(ends: Floats, reach: Floats, upward: Floats, ground: Ground) -> Floats:
    """Metres (moments,) that a bone's tail can be lowered before its skin is in the ground.

    Args:
        ends: (moments, 2, 3) head and tail, world.
        reach: (moments, 2) metres that its skin reaches down there.
        upward: (moments, 3) which way up the ground is there.
        ground: what it comes down to.
    """
    along = _ALONG[:, None]
    points = ends[:, None, 0] + along * (ends[:, 1] - ends[:, 0])[:, None]
    above = (points[..., 2] - ground.height(points)) * upward[:, None, 2]
    room = above - (reach[:, :1] + _ALONG * (reach[:, 1:] - reach[:, :1]))
    return np.min(room / _ALONG, axis=1)
