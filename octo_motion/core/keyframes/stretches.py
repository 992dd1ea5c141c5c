# SPDX-License-Identifier: GPL-3.0-or-later
"""Long shots, a stretch at a time: each is fitted, and mended, for itself.

How many rounds a shot takes is said by the worst of its places, and what does not fit into a
processor's cache takes longer. So a long shot is cut, at key frames. There its curves keep the
motion's own values, and its own slopes where it has no corner: what is found on one side of a cut
has nothing to do with the other, and yet both go on in one line.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from ..rotations import Floats
from ..steps import finished
from .channels import BezierKeys, Booleans
from .residuals import LinearModel
from .search import Ends, Search
from .tracks import Fine, Integers

_KEYS: Final = 64
"""Of each column in a stretch, at least: what a cut adds to them is little."""
_FRAMES: Final = 512
"""Of a stretch in the mean, at least: shorter ones are worked out no faster."""
_NEAR: Final = 64
"""Frames on either side of where a cut would be, among which the best place is chosen."""
_SEAM: Final = 3
"""Frames on either side of a loop's seam that say whether it has a corner."""


@dataclass(frozen=True, eq=False)
class Part:
    """One stretch of a limb's shot, with what is given to begin with as :class:`search.Search` has
    it.
    """

    fine: Fine
    keyed: Booleans
    corners: Booleans
    loops: bool = False
    ends: Ends | None = None

    @property
    def work(self) -> int:
        """How much there is to do, in values that change from moment to moment."""
        return self.corners.size


Found = tuple[list[BezierKeys], Booleans]
"""The keys of each track, and which of the slopes at both ends (tracks, 2) they keep."""


def parts(fine: Fine, keyed: Booleans, corners: Booleans, *, loops: bool = False) -> Iterator[Part]:
    """The stretches of a limb's shot, one after the other; what is given is as
    :class:`search.Search` has it.
    """
    cuts = _cuts(fine, keyed)
    if len(cuts) == 2:
        yield Part(fine, keyed, corners, loops=loops)
        return
    held = ~corners[:, cuts]
    held[:, [0, -1]] = False
    slopes = _slopes(fine, cuts)
    if loops:
        held[:, [0, -1]] = ~_turned_at_the_seam(fine)[:, None]
    keyed = keyed.copy()
    keyed[:, cuts] = True
    for number, (first, last) in enumerate(pairwise(cuts)):
        at, ends = slice(first, last + 1), slice(number, number + 2)
        own = Ends(held[:, ends], slopes[..., ends])
        yield Part(fine.between(first, last), keyed[:, at], corners[:, at], ends=own)


def searching(part: Part) -> Generator[float, None, Found]:
    """The keys of one stretch, in steps that yield the share that is done."""
    search = Search(part.fine, part.keyed, part.corners, loops=part.loops, ends=part.ends)
    yield 0.0
    keys = yield from search.found()
    yield 1.0
    return keys, search.held


def searched(part: Part) -> Found:
    """The same at once."""
    return finished(searching(part))


def together(found: Sequence[Found]) -> list[BezierKeys]:
    """The keys of each track of a limb, from those of its stretches."""
    (keys, _), *more = found
    if not more:
        return keys
    kept = [held for _, held in found]
    smooth = np.stack([before[:, 1] & after[:, 0] for before, after in pairwise(kept)])
    tracks = zip(*(keys for keys, _ in found), strict=True)
    return [_joined(own, at) for own, at in zip(tracks, smooth.T, strict=True)]


def _cuts(fine: Fine, keyed: Booleans) -> Integers:
    """Moments at which a shot is cut, those of its first frame and its last one among them."""
    (allowed,) = np.nonzero(fine.allowed)
    keys = keyed[:, allowed].sum(axis=0)
    upto = np.cumsum(keys) / len(keyed)
    count = max(int(min(upto[-1] / _KEYS, len(allowed) / _FRAMES)), 1)
    middles = np.searchsorted(upto, upto[-1] * np.arange(1, count) / count)
    # Where most of the limb has a key anyway.
    windows = np.clip(middles[:, None] + np.arange(-_NEAR, _NEAR), 1, len(allowed) - 2)
    inner = windows[np.arange(count - 1), keys[windows].argmax(axis=1)]
    return allowed[np.unique([0, *inner, len(allowed) - 1])]


def _slopes(fine: Fine, cuts: Integers) -> Floats:
    """How fast the motion changes at cuts: (4, tracks, cuts); a loop goes on at both ends."""
    last = len(fine.times) - 1
    before, after = np.maximum(cuts - 1, 0), np.minimum(cuts + 1, last)
    lengths = fine.times[after] - fine.times[before]
    lengths[[0, -1]] = lengths[0] + lengths[-1]
    slopes = np.zeros((4, len(fine.limb.tracks), len(cuts)))
    for place, track in enumerate(fine.limb.tracks):
        values = track.values.T
        change = values[:, after] - values[:, before]
        change[:, [0, -1]] = (change[:, 0] + change[:, -1])[:, None]
        slopes[: len(values), place] = change / lengths
    return slopes


def _turned_at_the_seam(fine: Fine) -> Booleans:
    """Whether tracks (tracks,) have a corner where a loop goes on from its start."""
    (allowed,) = np.nonzero(fine.allowed)
    near = np.zeros(len(fine.times), dtype=bool)
    near[allowed[:_SEAM]] = near[allowed[-_SEAM:]] = True
    return LinearModel(fine.limb.at(near)).turns_at_the_seam(np.arange(2 * _SEAM))


def _joined(parts: Sequence[BezierKeys], smooth: Booleans) -> BezierKeys:
    """The keys of a track from stretch to stretch, whose parts' last keys are the first ones of the
    next.

    ``smooth`` (parts − 1,) says of each such key whether its handles lie on one line.
    """
    *before, last = parts
    first, *after = parts
    joined = np.concatenate([*(each.smooth[:-1] for each in before), last.smooth])
    joined[np.cumsum([len(each) - 1 for each in before])] = smooth
    return BezierKeys(
        frames=np.concatenate([*(each.frames[:-1] for each in before), last.frames]),
        values=np.concatenate([*(each.values[:-1] for each in before), last.values]),
        left=np.concatenate([first.left, *(each.left[1:] for each in after)]),
        right=np.concatenate([*(each.right[:-1] for each in before), last.right]),
        smooth=joined,
    )
