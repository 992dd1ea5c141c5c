# SPDX-License-Identifier: GPL-3.0-or-later
"""Stretches of time over which a property is not what its curves say, and the keys they get.

Before and after a stretch the curves stay as they are. Within it there is a key on every whole
frame, and handles are those that come closest to what is wanted in between; where that is not
close enough, as at a hard cut or where a clip of few frames per second turns, there are keys
between frames too.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import Floats
from .channels import BezierKeys, Booleans, bezier_keys
from .curves import hermite
from .tracks import Integers

_PULL: Final = 1e-4
"""Weight, against that of a moment, of the wish that slopes are those of the motion: it decides
where there are too few moments between two keys to tell them."""
STEP: Final = 1.0 / 32.0
"""Frames between the moment before a hard cut and the one behind it."""
_WHOLE: Final = 1e-4
"""Frames by which a moment may miss a whole frame."""
_BULGE: Final = 4.0 / 27.0
"""How far a cubic moves at most when a slope at its end changes by one, per unit of its length."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """What a property is over a time."""

    frames: Floats
    """(moments,) ascending."""
    values: Floats
    """(moments, components); at the first and the last they are those of the curves that stay,
    on the sides that are not open."""
    begins: bool = False
    """Whether no curve goes before it."""
    ends: bool = False
    """Whether no curve comes after it."""


def runs_of(differs: Booleans, frames: Floats) -> list[tuple[int, int]]:
    """First and last moments of the runs in which something differs, with one more moment on
    either side, where there is one: there nothing does yet, or any more.

    Args:
        differs: (moments,)
        frames: (moments,) ascending; runs less than a frame apart are one.
    """
    places = np.flatnonzero(differs)
    if not len(places):
        return []
    breaks = np.flatnonzero(np.diff(frames[places]) > 1.0)
    firsts = places[np.concatenate([[0], breaks + 1])]
    lasts = places[np.concatenate([breaks, [len(places) - 1]])]
    return [
        (max(int(first) - 1, 0), min(int(last) + 1, len(differs) - 1))
        for first, last in zip(firsts, lasts, strict=True)
    ]


def stretch_keys(stretch: Stretch, bound: float, also: Iterable[float] = ()) -> BezierKeys:
    """Keys of a stretch: its own values on whole frames, its ends, and where more are needed.

    Args:
        stretch: of at least two moments.
        bound: by how much a value may be off in between.
        also: further frames that have keys, if they are among the moments.
    """
    frames = stretch.frames
    keyed = np.abs(frames - np.round(frames)) < _WHOLE
    keyed |= np.isin(frames, np.fromiter(also, dtype=np.float64))
    keyed[[0, -1]] = True
    while True:
        at = np.flatnonzero(keyed)
        out, into = _slopes(stretch, at)
        smooth = _lined_up(frames[at], out, into, bound)
        off = np.abs(_played(stretch, at, out, into) - stretch.values).max(axis=1)
        worst = _worst(off, at)
        worst = worst[off[worst] > bound]
        if not len(worst):
            return _keys(frames[at], stretch.values[at], out, into, smooth)
        keyed[worst] = True


def _worst(off: Floats, at: Integers) -> Integers:
    """The moment of each span that is off most."""
    span = np.repeat(np.arange(len(at) - 1), np.diff(at))
    order = np.lexsort((off[:-1], span))
    last = np.append(np.flatnonzero(np.diff(span[order])), len(order) - 1)
    return order[last]


def _basis(stretch: Stretch, at: Integers) -> tuple[Floats, Integers]:
    """What values and slopes at the keys are to each moment but the last (4, moments − 1), and
    its span.
    """
    span = np.repeat(np.arange(len(at) - 1), np.diff(at))
    times = stretch.frames[at]
    length = np.diff(times)[span]
    return hermite((stretch.frames[:-1] - times[span]) / length, length), span


def _slopes(stretch: Stretch, at: Integers) -> tuple[Floats, Floats]:
    """Slopes (spans, components) after each key and before the next: least squares of what is off
    in between, span by span.
    """
    (first, outs, intos, last), span = _basis(stretch, at)
    values = stretch.values
    wanted = np.gradient(values, stretch.frames, axis=0)
    out, into = wanted[at[:-1]].copy(), wanted[at[1:]].copy()
    # Where nothing is known in between, straight on: a hard cut is to swing neither way.
    lone = np.flatnonzero(np.diff(at) == 1)
    steps = np.diff(values[at], axis=0) / np.diff(stretch.frames[at])[:, None]
    out[lone] = into[lone] = steps[lone]
    left = values[:-1] - first[:, None] * values[at][span] - last[:, None] * values[at][span + 1]
    left -= outs[:, None] * out[span] + intos[:, None] * into[span]

    def sums(each: Floats) -> Floats:
        return np.add.reduceat(each, at[:-1], axis=0)

    pull = _PULL * np.diff(stretch.frames[at]) ** 2
    a, b, c = sums(outs**2) + pull, sums(outs * intos), sums(intos**2) + pull
    ones, twos = sums(outs[:, None] * left), sums(intos[:, None] * left)
    scale = (a * c - b * b)[:, None]
    a, b, c = a[:, None], b[:, None], c[:, None]
    return out + (c * ones - b * twos) / scale, into + (a * twos - b * ones) / scale


def _lined_up(times: Floats, out: Floats, into: Floats, bound: float) -> Booleans:
    """Make slopes before and after a key one where that hardly moves the curves; which keys."""
    smooth = np.zeros(len(times), dtype=bool)
    if len(times) < 3:
        return smooth
    before, after = into[:-1], out[1:]
    lengths = np.diff(times)
    longest = np.maximum(lengths[:-1], lengths[1:])
    moved = 0.5 * np.abs(after - before).max(axis=1) * longest * _BULGE
    smooth[1:-1] = moved < 0.25 * bound
    mean = 0.5 * (before + after)
    chosen = smooth[1:-1, None]
    into[:-1], out[1:] = np.where(chosen, mean, before), np.where(chosen, mean, after)
    return smooth


def _played(stretch: Stretch, at: Integers, out: Floats, into: Floats) -> Floats:
    (first, outs, intos, last), span = _basis(stretch, at)
    values = stretch.values[at]
    result = first[:, None] * values[span] + last[:, None] * values[span + 1]
    result += outs[:, None] * out[span] + intos[:, None] * into[span]
    return np.concatenate([result, stretch.values[-1:]])


def _keys(
    frames: Floats, values: Floats, out: Floats, into: Floats, smooth: Booleans
) -> BezierKeys:
    third = np.diff(frames)[:, None] / 3.0
    return bezier_keys(frames, values, values[:-1] + third * out, values[1:] - third * into, smooth)
