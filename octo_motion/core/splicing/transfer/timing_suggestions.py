# SPDX-License-Identifier: GPL-3.0-or-later
"""Where in a base a splice fits best: legs that do the same at the same time.

After Heck, Kovar and Gleicher, "Splicing Upper-Body Actions with Locomotion" (2006), who align two
motions by dynamic time warping of their lower bodies. There the warp itself is used; here it only
judges, with little slack, each moment at which the splice could begin, for the artist to choose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, rotate
from ..clip import Timing, sample_clip, splice_clock
from ..humanoid import chain_length
from .body_frames import laid_over, pelvis_frame
from .parts import LEG
from .retarget import MappedClip, compared

_RATE: Final = 20.0
"""Samples per second: more than legs need."""

_LONGEST: Final = 160
"""Samples of the splice that are compared; longer ones are sampled less often."""

_SLACK: Final = 0.08
"""Of the splice's length: how far the two may run ahead of each other."""

_LEAST: Final = 0.5
"""Of the splice's length (and of the base's): what has to overlap for a comparison to mean much."""

_APART: Final = 0.2
"""Seconds between two suggestions."""

_SWING: Final = 0.1
"""Seconds by which speeds are multiplied to stand beside positions."""


@dataclass(frozen=True)
class Suggestion:
    """A moment at which a splice could begin."""

    base_start: float
    """Frame of the base."""
    cost: float
    """How unlike the legs are from then on, on average, in leg lengths; 0 is the same."""


def suggest_timings(
    base: MappedClip, splice: MappedClip, timing: Timing, count: int = 3
) -> list[Suggestion]:
    """The best moments for a splice to begin, at most so many, best first, none close to another.

    Where it begins in its clip, its rate and its length are as the timing says, and its warp as it
    is at the start that it has.

    Raises:
        ClipError: a landmark is missing.
    """
    base, splice = compared(base, splice)
    ours, theirs = base.clip, splice.clip
    # As it goes by from its start on, wherever in the base that comes to be.
    clock = splice_clock(timing, ours.rate, theirs.rate)
    begins, ends = timing.base_start, float(clock.when(theirs.frames[-1]))
    if timing.length is not None:
        ends = min(ends, begins + timing.length)
    seconds = max((ends - begins) / ours.rate, 1e-3)
    pace = min(_RATE, _LONGEST / seconds)
    moments = np.arange(begins, max(ends, begins) + 1e-6, ours.rate / pace)
    seen = _legs(splice, base, clock.at(moments), pace)
    step = ours.rate / pace
    first, last = ours.frames[0], ours.frames[-1]
    # Samples may be several frames apart; every frame may be the one to begin with.
    grids = [np.arange(first + phase, last + 1e-6, step) for phase in range(max(1, round(step)))]
    grids = [grid for grid in grids if len(grid)]
    costs = np.concatenate(
        [_warped(_distances(_legs(base, base, grid, pace), seen)) for grid in grids]
    )
    frames = np.round(np.concatenate(grids))
    apart = _APART * ours.rate
    found: list[Suggestion] = []
    for number in np.argsort(costs, kind="stable"):
        if len(found) == count or not np.isfinite(costs[number]):
            break
        frame = float(frames[number])
        if all(abs(frame - other.base_start) >= apart for other in found):
            found.append(Suggestion(frame, float(costs[number])))
    return found


def _legs(mapped: MappedClip, base: MappedClip, frames: Floats, pace: float) -> Floats:
    """Where knees and feet are in the pelvis's frame and how they swing, (frames, 24), in leg
    lengths.
    """
    ours, theirs = (
        pelvis_frame(each.skeleton, each.humanoid(), each.reference) for each in (base, mapped)
    )
    frame = laid_over(theirs, ours)
    posture = sample_clip(mapped.clip, frames)
    back, place = conjugate(frame.orientation(posture)), frame.place(posture)
    positions = []
    for side in "LR":
        joints = [mapped.bone(name) for name in LEG.limb_on(side)]
        length = chain_length(mapped.skeleton, joints)
        positions += [rotate(back, posture.head(bone) - place) / length for bone in joints[1:]]
    seen = np.concatenate(positions, axis=-1)
    speeds = np.gradient(seen, axis=0) * pace if len(seen) > 1 else np.zeros_like(seen)
    return np.concatenate([seen, _SWING * speeds], axis=-1)


def _distances(ours: Floats, theirs: Floats) -> Floats:
    """(base, splice) distances of all samples from all."""
    squares = np.sum(ours**2, axis=1)[:, None] + np.sum(theirs**2, axis=1) - 2.0 * ours @ theirs.T
    return np.sqrt(np.maximum(squares, 0.0) / 4.0)


def _warped(distances: Floats) -> Floats:
    """Cost (base,) of beginning at each base sample: dynamic time warping within a band, per
    sample; infinite where too little overlaps.
    """
    samples, length = distances.shape
    band = max(1, round(_SLACK * length))
    width = 2 * band + 1
    least = max(2, round(_LEAST * min(length, samples)))
    starts = np.arange(samples)
    shifts = np.arange(-band, band + 1)
    costs = np.full((samples, width), np.inf)
    costs[:, band] = 0.0
    result = np.full(samples, np.inf)
    for step in range(length):
        at = starts[:, None] + step + shifts
        inside = (at >= starts[:, None]) & (at < samples)
        here = np.where(inside, distances[np.clip(at, 0, samples - 1), step], np.inf)
        if step > 0:
            # The base waits (its shift shrinks by one) or both go on.
            waits = np.concatenate([costs[:, 1:], np.full((samples, 1), np.inf)], axis=1)
            costs = np.minimum(costs, waits)
        costs = costs + here
        for shift in range(1, width):
            # The splice waits.
            costs[:, shift] = np.minimum(costs[:, shift], costs[:, shift - 1] + here[:, shift])
        last = np.minimum(samples - starts, length) - 1 == step
        if step + 1 >= least:
            result[last] = costs[last].min(axis=1) / (step + 1)
    return result
