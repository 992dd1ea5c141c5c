# SPDX-License-Identifier: GPL-3.0-or-later
"""Values, handles and joints of keys, such that all bounds hold at every frame.

Key frames are given to begin with, some too few. All curves are fitted at once, as the tip of an
arm is moved by all of its bones: what one of them cannot follow, others make up for. Then keys are
brought into line, and where a bound is still broken, a corner is allowed again, or a key is added.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

import numpy as np

from .key_curves import Aims, Curves
from .key_errors import Errors
from .key_limbs import BezierKeys, Booleans, Integers, Limb
from .rotations import Floats

_POWERS: Final = (0.0, 0.5, 1.0, 1.5, 2.0, 2.0, 2.0)
"""Of the weights in rounds of fitting: towards an even spread of the errors."""
_STEPS: Final = 4
"""Of conjugate gradients in a round."""
_KEPT: Final = 0.999
"""Share of the bounds that is used up: Blender still rounds handles that it aligns."""
_JOINED: Final = 1.3
"""Share of the bounds within which handles are brought into line before the curves are fitted."""
_KINK: Final = 0.1
"""Bounds by which the motion must turn aside at the seam of a loop to be let have a corner."""
_APART: Final = 1e-5
"""Values that differ by less meet at the seam."""
_MENDING: Final = 10
"""Rounds in which keys are added; then they get the values of the motion itself."""
_PINNING: Final = 40
_CULPRITS: Final = 2
"""Bones of an arm that get a key for the sake of its tip, at a time."""


class Search:
    """All tracks of a limb.

    Args:
        times: (frames,) at least two, as Blender keeps them.
        limb: what is keyed.
        keyed: (columns, frames) where there are keys to begin with.
        corners: (tracks, frames) where the motion itself has a corner.
        allowed: (frames,) where there may be a key, the first and the last among them.
        loops: whether the motion goes on from its last frame to its first.
        exact: whether all keys keep the motion's own values, and none is added.
    """

    def __init__(
        self,
        times: Floats,
        limb: Limb,
        keyed: Booleans,
        corners: Booleans,
        *,
        allowed: Booleans | None = None,
        loops: bool = False,
        exact: bool = False,
    ) -> None:
        self._times, self._keyed = times, keyed.copy()
        self._columns = np.array(columns_of(limb))
        self._allowed = np.ones(len(times), dtype=bool) if allowed is None else allowed
        numbers = np.arange(len(times))
        self._before = np.maximum.accumulate(np.where(self._allowed, numbers, 0))
        self._after = np.where(self._allowed, numbers, len(times))[::-1]
        self._after = np.minimum.accumulate(self._after)[::-1]
        self._loops = loops
        self._widths = [track.values.shape[1] for track in limb.tracks]
        self._corners, self._smooth = corners, ~corners
        self._pinned = np.zeros(corners.shape, dtype=bool)
        self._pinned[:, [0, -1]] = True
        if exact:
            self._pinned |= self._keyed[self._columns]
        targets = np.zeros((4, len(self._widths), len(times)))
        for place, track in enumerate(limb.tracks):
            targets[: self._widths[place], place] = track.values.T
        self._errors = Errors([limb])
        self._aims = self._aimed(targets)
        if loops:
            self._corners = corners.copy()
            self._corners[:, [0, -1]] = self._turns_at_the_seam(targets)[:, None]
            self._smooth = ~self._corners
        self._curves = self._laid()
        slopes = np.asarray(np.gradient(targets, times, axis=2)).reshape(4, -1)
        points = self._curves.started(self._aims.targets, slopes)
        self._points = self._curves.aligned(points)

    def found(self) -> Generator[float, None, list[BezierKeys]]:
        """The keys of each track, in steps that yield the share that is done."""
        for done, power in enumerate(_POWERS):
            self._improve(power, 2 * _STEPS if done == 0 else _STEPS)
            yield 0.5 * done / len(_POWERS)
        self._join()
        for power in _POWERS[-2:]:
            self._improve(power, _STEPS)
        for attempt in range(_MENDING + _PINNING):
            yield 0.5 + 0.5 * (1.0 - 0.7**attempt)
            own, joint = self._measured()
            if max(own.max(), joint.max()) <= _KEPT:
                break
            mended = attempt < _MENDING and self._mend(own, joint)
            if not (mended or self._pin(own, joint)):
                break
        return self._as_keys()

    # --- Fitting ------------------------------------------------------------------------------

    def _aimed(self, targets: Floats) -> Aims:
        slopes, ends = self._errors.slopes()
        own, *rest = (
            np.moveaxis(each[0], 0, 2).astype(np.float32).reshape(3, 4, -1)
            for each in (slopes, *ends)
        )
        ridge = np.abs(own).max(axis=(0, 1))
        return Aims(targets.reshape(4, -1), own, rest, ridge, len(self._widths))

    def _turns_at_the_seam(self, targets: Floats) -> Booleans:
        """Whether tracks (tracks,) have a corner where the motion goes on from its start."""
        (at,) = np.nonzero(self._allowed)
        if len(at) < 5:
            return np.ones(len(self._widths), dtype=bool)
        bends = np.diff(targets[..., at[[-3, -2, 0, 1, 2]]], 2, axis=2)
        own = self._aims.own.reshape(3, 4, *targets.shape[1:])[..., :1]
        before, at, after = np.linalg.norm((own * bends).sum(axis=1), axis=0).T
        # A tight bend is one on both sides, too.
        aside = (at > _KINK) & (at > 2.0 * np.maximum(before, after))
        apart = np.abs(targets[..., 0] - targets[..., -1]).max(axis=0) > _APART
        return apart | aside

    def _laid(self) -> Curves:
        keyed = self._keyed[self._columns]
        return Curves(self._times, keyed, self._smooth, self._pinned, loops=self._loops)

    def _improve(self, power: float, steps: int) -> None:
        self._points = self._curves.improved(self._points, self._aims, power, steps)

    def _relay(self) -> None:
        """Curves and control points as the keys are now."""
        before, self._curves = self._curves, self._laid()
        points = self._curves.carried_over(before, self._points, self._times)
        self._points = self._curves.pinned(points, self._aims.targets)
        self._points = self._curves.aligned(self._points)
        for _ in range(2):
            self._improve(_POWERS[-1], _STEPS)

    def _join(self) -> None:
        """Bring the handles of keys into line where that keeps to the bounds, more or less."""
        corners = self._smooth
        # Written through a flat view, which only rows in order have.
        self._smooth = np.ones(self._smooth.shape, dtype=bool)
        while True:
            curves = self._laid()
            points = curves.aligned(self._points)
            own, *ends = (
                np.linalg.norm(each, axis=0)
                for each in self._aims.seen(curves.values(points) - self._aims.targets)
            )
            worst = np.maximum(own, np.max(ends, axis=0, initial=0.0))
            broken = np.maximum.reduceat(worst.ravel(), curves.heads) > _JOINED
            heads, tails = curves.heads[broken], curves.tails[broken]
            # Of the two keys of a span, the one goes first whose handles had to turn more.
            optional = (self._smooth & ~corners).ravel()
            turned = curves.turned(self._points, points)
            turned = np.where(optional, turned + 1e-30, 0.0)
            ends = np.where(turned[heads] >= turned[tails], heads, tails)
            ends = ends[optional[ends]]
            if not len(ends):
                break
            self._smooth.ravel()[ends] = False
        self._curves, self._points = curves, points

    # --- Bounds -------------------------------------------------------------------------------

    def _measured(self) -> tuple[Floats, Floats]:
        """Errors of what Blender will play: (tracks, frames) and (frames,)."""
        played = self._curves.played(self._points, self._times)
        played = played.reshape(4, len(self._widths), -1)
        own, joint = self._errors.measure(
            [played[:width, track].T[None] for track, width in enumerate(self._widths)]
        )
        return own[0], joint[0]

    def _mend(self, own: Floats, joint: Floats) -> bool:
        """Allow a corner, or add a key, where a bound is broken; whether that could be done."""
        curves, count = self._curves, own.shape[1]
        worst = np.maximum.reduceat(own.ravel(), curves.heads)
        (broken,) = np.nonzero(worst > _KEPT)
        places = np.array(
            [
                curves.heads[span] + np.argmax(own.ravel()[curves.heads[span] : curves.tails[span]])
                for span in broken
            ],
            dtype=np.intp,
        )
        elements = np.concatenate([places, self._culprits(own, joint)])
        spans = curves.span[elements]
        spans, chosen = np.unique(spans, return_index=True)
        frames = elements[chosen] % count
        heads, tails = curves.heads[spans], curves.tails[spans]
        optional = (self._smooth & self._corners).ravel()
        loosened = optional[heads] | optional[tails]
        for ends in (heads[loosened], tails[loosened]):
            self._smooth.ravel()[ends[self._corners.ravel()[ends]]] = False
        starts, ends = heads % count, tails % count
        margin = np.maximum((ends - starts) // 4, 1)
        at = np.clip(frames, starts + margin, ends - margin)
        at = self._before[at]
        split = ~loosened & (at > starts) & (at < ends)
        columns = self._columns[heads[split] // count]
        self._keyed[columns, at[split]] = True
        if not (loosened.any() or split.any()):
            return False
        self._relay()
        return True

    def _culprits(self, own: Floats, joint: Floats) -> Integers:
        """Elements of those tracks that have most to do with the limb's being off."""
        frames = _peaks(joint)
        count = own.shape[1]
        rows = (np.arange(len(own))[:, None] * count + frames).ravel()
        off = self._curves.values(self._points) - self._aims.targets
        share = np.zeros((len(own), len(frames)))
        for slopes in self._aims.ends:
            moved = (slopes[:, :, rows] * off[:, rows]).sum(axis=1)
            moved = moved.reshape(3, len(own), len(frames))
            each = (moved * moved.sum(axis=1, keepdims=True)).sum(axis=0)
            # Of the end that is off by more.
            share = np.where(each.sum(axis=0) > share.sum(axis=0), each, share)
        share = np.where((share != 0.0).any(axis=0), share, own[:, frames])
        tracks = np.argsort(-share, axis=0)[:_CULPRITS]
        return (tracks * count + frames).ravel()

    def _pin(self, own: Floats, joint: Floats) -> bool:
        """Give keys the motion's own values where a bound is broken; whether that is new."""
        broken = (own > _KEPT) | (joint > _KEPT)
        tracks, frames = np.nonzero(broken)
        before = self._pinned.copy(), self._keyed.copy()
        for at in (self._before[frames], self._after[frames]):
            self._keyed[self._columns[tracks], at] = True
            self._pinned[tracks, at] = True
            self._smooth[tracks, at] = False
        if (before[0] == self._pinned).all() and (before[1] == self._keyed).all():
            return False
        self._relay()
        return True

    # --- Keys as Blender keeps them -----------------------------------------------------------

    def _as_keys(self) -> list[BezierKeys]:
        curves, times = self._curves, self._times
        result: list[BezierKeys] = []
        for track, width in enumerate(self._widths):
            own_keys = curves.tracks == track
            places, rows = curves.frames[own_keys], curves.rows[own_keys]
            at, points = times[places], self._points[:width]
            values = points[:, rows].T
            third = np.diff(at)[:, None] / 3.0
            left, right = np.empty((2, *values.shape, 2))
            left[1:, :, 0], left[1:, :, 1] = at[1:, None] - third, points[:, rows[1:] - 1].T
            right[:-1, :, 0], right[:-1, :, 1] = at[:-1, None] + third, points[:, rows[:-1] + 1].T
            # Nothing lies before the first key and after the last: their handles go straight on.
            own = np.stack(np.broadcast_arrays(at[:, None], values), axis=-1)
            left[0], right[-1] = 2.0 * own[0] - right[0], 2.0 * own[-1] - left[-1]
            smooth = self._smooth[track, places]
            smooth[[0, -1]] = False
            result.append(
                BezierKeys(
                    frames=at.astype(np.float32),
                    values=values.astype(np.float32),
                    left=left.astype(np.float32),
                    right=right.astype(np.float32),
                    smooth=smooth,
                )
            )
        return result


def columns_of(limb: Limb) -> list[int]:
    """Of each track its column of key frames, numbered from 0."""
    given = limb.columns if limb.columns is not None else [0] * len(limb.tracks)
    numbers = {column: number for number, column in enumerate(dict.fromkeys(given))}
    return [numbers[column] for column in given]


def _peaks(joint: Floats) -> Integers:
    """The worst frames of each stretch at which a bound is broken."""
    padded = np.pad(joint, 1)
    worst = (joint > _KEPT) & (joint >= padded[:-2]) & (joint > padded[2:])
    return np.flatnonzero(worst)
