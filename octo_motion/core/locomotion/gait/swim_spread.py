# SPDX-License-Identifier: GPL-3.0-or-later
"""How the arms of a swimming body stand round its way when that is not the body's up.

A body whose mantle lies flat behind it swims as it lies: its way leads out at its back, and its
arms open across that and close before its face. Arms that stand round their way, as a squid's do,
stay where they are. Most bodies that lie carry theirs in a fan to the front and the sides, like
the fingers of a hand on a table: opened across the way all of it would lie in one plane, and
arms on each other. They open all round instead, in the order in which they lie, those in the
middle of the fan above: their undersides face the inside of the bell, as they do on any octopus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ...rotations import Floats, from_axis_angle, less_whole_turns, to_matrix
from ...skeleton import Skeleton
from ...smoothing import smooth_step
from ..rig import BodyFrame, arm_azimuths
from .ccd import HEAD

_OPEN: Final = np.radians(45.0)
"""Lean from which on arms have opened all the way."""
_WIDEST: Final = np.radians(140.0)
"""Arms that leave no gap as wide as this stand all round."""
_ROOM: Final = 0.1
"""Arm lengths beside the way of a swimming body at which its arms trail, at least."""
_TRAILING: Final = 0.75
"""Share of its length that the first group of an arm that trails spans: such a group is bent."""
_SIDEWAYS: Final = np.array([1.0, 0.0, 0.0])


def swim_azimuths(
    skeleton: Skeleton, arms: Sequence[Sequence[str]], body: BodyFrame, lean: float
) -> Floats:
    """Where each arm, its bones root to tip, opens to (arms,), seen along the way: radians from the
    front, left positive.

    The way leans, radians, from the body's +Z towards its back.
    """
    fan = arm_azimuths(skeleton, arms, body)
    turned = body.rotation @ to_matrix(from_axis_angle(_SIDEWAYS, -lean))
    found = arm_azimuths(skeleton, arms, replace(body, rotation=turned))
    if _gap(found) >= _WIDEST:
        order = np.argsort(fan, kind="stable")
        apart = 2.0 * np.pi / (len(fan) + 1)
        found[order] = (np.arange(len(fan)) - 0.5 * (len(fan) - 1)) * apart
    return fan + smooth_step(lean / _OPEN) * less_whole_turns(found - fan)


def trailing_asides(roots: Floats, first_groups: Floats) -> Floats:
    """By how far the first link of each arm (arms,) has to point beside the way, radians.

    Roots (arms,) are arm lengths from the way, first groups (arms,) as many long.
    """
    if len(roots) < 2:
        return np.zeros(len(roots))
    short = np.maximum(_ROOM - roots, 0.0) / (_TRAILING * first_groups)
    return np.arcsin(np.minimum(short, 1.0))


def trailing_beside(angles: Floats, asides: Floats) -> Floats:
    """Angles (frames, arms, links, 3) with which no arm trails in the line of all others.

    Arms that spring from one point would all come to lie in it as they close. They turn in less
    far, by :func:`trailing_asides`, with their first links, and what is left with their second
    ones: so they trail side by side.
    """
    off = asides > 0.0
    if not np.any(off):
        return angles
    result = angles.copy()
    # All of it where an arm trails in the line of the others, little before.
    closed = angles[:, off, 0, HEAD] / (0.5 * np.pi)
    short = -asides[off] * closed * np.abs(closed)
    result[:, off, 0, HEAD] += short
    result[:, off, 1, HEAD] -= short
    return result


def _gap(azimuths: Floats) -> float:
    """The widest between neighbours, radians."""
    around = np.sort(less_whole_turns(azimuths))
    return float(np.max(np.diff(around, append=around[0] + 2.0 * np.pi)))
