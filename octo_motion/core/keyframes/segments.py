# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments of Bézier curves as Blender plays them: values at any time, and cuts that no one sees.

A segment is four points, each a frame and a value: a key, the handle after it, the handle before
the next key, and that key. A handle reaches no further than the other key, as Blender has it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ..rotations import Floats

_STEPS: Final = 8
"""Of Newton's method; where they do not settle, the interval is halved …"""
_HALVINGS: Final = 54
"""… until nothing is left of it."""
_SETTLED: Final = 1e-12
"""Shares of a segment's time."""


def segment_values(segments: Floats, frames: Floats) -> Floats:
    """Values (n,) of segments (n, 4, 2) at a frame (n,) within each."""
    points = _within_time(segments)
    share = _share_at(points, frames)
    rest = 1.0 - share
    basis = np.stack([rest**3, 3.0 * share * rest**2, 3.0 * share**2 * rest, share**3], axis=-1)
    return np.sum(basis * points[..., 1], axis=-1)


def cut_segment(segment: Floats, frame: float) -> Floats:
    """A segment (4, 2) in two that play the same: (7, 2), the fourth point is the new key.

    De Casteljau's algorithm (Farin, *Curves and Surfaces for CAGD*, ch. 4).
    """
    points = _within_time(segment[None])
    share = float(_share_at(points, np.array([frame]))[0])
    rows = [points[0]]
    while len(rows[-1]) > 1:
        rows.append((1.0 - share) * rows[-1][:-1] + share * rows[-1][1:])
    before = [row[0] for row in rows]
    after = [row[-1] for row in rows[:-1]]
    cut = np.array([*before, *after[::-1]])
    cut[3, 0] = frame
    return cut


def _within_time(segments: Floats) -> Floats:
    """The same with handles made shorter that reach further than the segment lasts."""
    first, out, into, last = np.moveaxis(np.asarray(segments, dtype=np.float64), -2, 0)
    length = (last - first)[..., :1]
    result = [first]
    for key, handle in ((first, out), (last, into)):
        reach = np.abs(handle - key)[..., :1]
        result.append(key + (handle - key) * np.minimum(1.0, length / np.maximum(reach, 1e-30)))
    return np.stack([*result, last], axis=-2)


def _share_at(points: Floats, frames: Floats) -> Floats:
    """The parameter (n,) at which segments (n, 4, 2) are at their frames: the curve's time rises
    with it throughout.
    """
    start, length = points[:, 0, 0], points[:, 3, 0] - points[:, 0, 0]
    out, into = ((points[:, each, 0] - start) / length for each in (1, 2))
    wanted = np.clip((frames - start) / length, 0.0, 1.0)

    def ahead(share: Floats) -> Floats:
        rest = 1.0 - share
        return 3.0 * share * rest * (rest * out + share * into) + share**3 - wanted

    share = wanted.copy()
    for _ in range(_STEPS):
        off = ahead(share)
        if np.abs(off).max(initial=0.0) <= _SETTLED:
            return share
        rest = 1.0 - share
        speed = 3.0 * rest**2 * out + 6.0 * share * rest * (into - out)
        speed += 3.0 * share**2 * (1.0 - into)
        share = np.clip(share - off / np.maximum(speed, 1e-6), 0.0, 1.0)
    loose = np.abs(ahead(share)) > _SETTLED
    if loose.any():
        low, high = np.zeros(len(share)), np.ones(len(share))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            late = ahead(middle) > 0.0
            low, high = np.where(late, low, middle), np.where(late, middle, high)
        share = np.where(loose, 0.5 * (low + high), share)
    return share
