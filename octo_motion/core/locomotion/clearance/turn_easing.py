# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that would turn faster than an eye can follow take their time.

Where a walk is tighter or steeper than its arms are made for, they are asked for poses on one frame
and for others on the next. Nothing in the motion of one frame can help that: an arm in the air that
has to be elsewhere at once sets out earlier, and comes later. All that happens is a mean over the
frames round the one that is too fast, as wide as it has to be: none where nothing is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, continuous, multiply, normalized
from ...smoothing import blurred, covered, spans
from ..rig import ArmFrames, turns_in_world

_FASTEST: Final = np.radians(28.0) * 24.0
"""Radians a second that bones may turn in the world …"""
_IN_A_CYCLE: Final = np.radians(1400.0)
"""… and radians in a cycle of the gait, if that is more. On level ground none of the ten set-ups
comes there; at 672 Hurry, which does, is 15 % of an arm in bumps instead of 0.4 %, and at 1050
Tiptoe 6 % instead of 1 %."""
_WIDEST: Final = 0.34
"""Seconds to either side over which means are taken at most …"""
_TRIED: Final = (0.125, 0.25, 0.25, 0.5, 0.5, 1.0)
"""… and the shares of that which are taken where the one before was not enough."""
_TORN: Final = 2.0
"""Times that from which on an arm lets go rather than pop: that it holds on is no longer seen."""
_RESTING: Final = 0.05
"""Seconds before and after a hold in which an arm stays what it is."""
_HELPED: Final = 0.5
"""Share of what a turn is too fast by that must be gone for bones to have been given time."""


def fastest_turn(rate: float, per_cycle: float) -> float:
    """Radians that a bone may turn in a frame, at so many frames a second and in a cycle."""
    return max(_FASTEST / rate, _IN_A_CYCLE / per_cycle)


def eased_turns(
    arms: Sequence[ArmFrames],
    rotations: Floats,
    orientations: Floats,
    held: Sequence[np.ndarray],
    *,
    rate: float,
    per_cycle: float,
    every: int = 1,
    cyclic: bool = False,
) -> tuple[Floats, Floats] | None:
    """Arms whose bones turn no faster than an eye can follow, wherever they are free to.

    Args:
        arms: in the order of their bones.
        rotations: (moments, bones, 4) of all arms, one after the other.
        orientations: (moments, 4) of the armature, world.
        held: for each arm (moments,) whether it is to stay as it is.
        rate: frames per second …
        per_cycle: … and in a cycle of the gait.
        every: at every how many moments there is a frame.
        cyclic: whether the last moment is the first again.

    Returns:
        Rotations (moments, bones, 4), and how far each arm was changed (moments, arms), 0…1; none
        where nothing is too fast.
    """
    most = fastest_turn(rate, per_cycle)
    result, changed, start = rotations, np.zeros((len(rotations), len(arms))), 0
    fast = (turns_in_world(arms, rotations, orientations, every) > most).any(axis=0)
    for number, arm in enumerate(arms):
        own = slice(start, start + len(arm.bones))
        start = own.stop
        if not fast[own].any():
            continue
        before = continuous(multiply(orientations[:, None], arm.from_bones(rotations[:, own])))
        if cyclic and np.any(np.sum(before[-1] * before[0], axis=-1) < 0.0):
            continue
        frames, share = _eased(
            before, held[number], most, every=every, rate=every * rate, cyclic=cyclic
        )
        if not share.any():
            continue
        if result is rotations:
            result = rotations.copy()
        some = np.flatnonzero(share)
        turned = multiply(conjugate(orientations[some, None]), frames[some])
        result[some, own] = arm.to_bones(turned)
        changed[:, number] = share
    return None if result is rotations else (result, changed)


def _eased(
    before: Floats, held: np.ndarray, most: float, *, every: int, rate: float, cyclic: bool
) -> tuple[Floats, Floats]:
    """Frames (moments, bones, 4) of an arm, world, with means where it is too fast, and how far
    these count (moments,).
    """
    rests = max(1, round(_RESTING * rate))
    loose = 1.0 - covered(held.astype(np.float64), rests, cyclic=cyclic)
    frames, whole = before, np.zeros(len(before))
    for part in _TRIED:
        width = max(1, round(part * _WIDEST * rate))
        near, torn = (
            covered(_faster(frames, each, every).astype(np.float64), width, cyclic=cyclic)
            for each in (most, _TORN * most)
        )
        share = np.maximum(near * loose, torn)
        if not share.any():
            break
        mean = blurred(frames, width, cyclic=cyclic)
        frames = normalized(frames + share[:, None, None] * (mean - frames))
        whole = np.maximum(whole, share)
    return frames, whole


def where_it_helps(
    arms: Sequence[ArmFrames],
    before: Floats,
    eased: Floats,
    orientations: Floats,
    *,
    most: float,
    every: int = 1,
) -> Floats:
    """Rotations (moments, bones, 4), eased from what they were before; as before wherever an arm
    did not turn by more than the most radians, and where it still does by nearly as much more.
    Arguments are as of :func:`eased_turns`.

    Each stretch of an arm counts by itself: what cannot be helped at one place of a long way
    spoils nothing at another, and what is too fast in a hold changes nothing before and after it.
    """
    then, now = (turns_in_world(arms, each, orientations, every) for each in (before, eased))
    result, start = eased.copy(), 0
    for arm in arms:
        own = slice(start, start + len(arm.bones))
        start = own.stop
        for first, end in spans((before[:, own] != eased[:, own]).any(axis=(1, 2))):
            part = slice(max(first - every, 0), end)
            was, left = (each[part, own].max(initial=0.0) - most for each in (then, now))
            if left > _HELPED * was or was <= 0.0:
                result[first:end, own] = before[first:end, own]
    return result


def _faster(frames: Floats, most: float, every: int) -> np.ndarray:
    """Moments (moments,) within a frame in which some bone of frames (moments, bones, 4) turns by
    more than so many radians.
    """
    over, result = _turns(frames, every) > most, np.zeros(len(frames), dtype=bool)
    for step in range(every + 1):
        result[step : step + len(over)] |= over
    return result


def _turns(frames: Floats, every: int) -> Floats:
    """Radians (moments − every,) that the quickest of the bones turns within a frame."""
    same = np.abs(np.sum(frames[every:] * frames[:-every], axis=-1))
    return 2.0 * np.arccos(np.minimum(same, 1.0)).max(axis=1, initial=0.0)
