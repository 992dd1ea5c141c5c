# SPDX-License-Identifier: GPL-3.0-or-later
"""Values, handles and joints of keys, such that all bounds hold at every moment.

Key frames are given to begin with, some too few. All curves are fitted at once, as the end of an
arm is moved by all of its bones: what one of them cannot follow, others make up for. Between rounds
of fitting, handles are brought into line, and a corner is allowed again or a key is added where a
bound is broken by most: what is broken by less may yet be fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import Floats
from ..steps import evenly
from .channels import BezierKeys, Booleans, bezier_keys
from .curves import Curves, Singles, inner_product
from .residuals import LinearModel, Residuals
from .tracks import Fine, Integers

_FIRST: Final = 10
"""Steps of fitting to begin with …"""
_STEPS: Final = 8
"""… and in each round."""
_KEPT: Final = 0.999
"""Share of the bounds that is used up: Blender still rounds handles that it aligns."""
_JOINING: Final = 3
"""Round in which handles are brought into line, and from which on keys are added."""
_JOINED: Final = 1.3
"""Share of the bounds within which they are brought there."""
_LIMIT: Final = 1.7
"""Share of the bounds beyond which a key is added at first …"""
_FALLS: Final = 0.7
"""… and how much of its excess is left from round to round."""
_MENDING: Final = 40
"""Rounds in which keys are added; then they get the values of the motion itself …"""
_PINNING: Final = 40
"""… in so many more at most."""
_LAST: Final = 4
"""Rounds in which all tracks get them."""
_TIDYING: Final = 0.95
"""Share of the work that is done then."""


@dataclass(frozen=True, eq=False)
class Ends:
    """How curves go on beyond the first moment and the last one."""

    held: Booleans
    """(tracks, 2) which of them keep a slope there …"""
    slopes: Floats
    """… and (4, tracks, 2) which slope."""


class Search:
    """All tracks of a limb, at all moments at which it is looked at, at least two.

    There are keys to begin with where ``keyed`` (columns, moments) says so, and the motion itself
    has ``corners`` (tracks, moments). In a loop it goes on from its last frame to its first. Slopes
    at both ends are kept, or are as fits best.
    """

    def __init__(
        self,
        fine: Fine,
        keyed: Booleans,
        corners: Booleans,
        *,
        loops: bool = False,
        ends: Ends | None = None,
    ) -> None:
        limb = fine.limb
        self._times, self._keyed, self._loops = fine.times, keyed.copy(), loops
        self._columns = np.array(limb.column_numbers())
        numbers = np.arange(len(self._times))
        self._before = np.maximum.accumulate(np.where(fine.allowed, numbers, 0))
        self._after = np.where(fine.allowed, numbers, len(numbers))[::-1]
        self._after = np.minimum.accumulate(self._after)[::-1]
        self._widths = [track.values.shape[1] for track in limb.tracks]
        self._pinned = np.zeros(corners.shape, dtype=bool)
        self._pinned[:, [0, -1]] = True
        self._errors, self._model = Residuals(limb), LinearModel(limb)
        self._chained = limb.chain is not None
        self._corners = corners
        if loops:
            self._corners = corners.copy()
            turned = self._model.turns_at_the_seam(np.flatnonzero(fine.allowed))
            self._corners[:, [0, -1]] = turned[:, None]
        self._smooth = ~self._corners
        self.held: Booleans = np.zeros((len(corners), 2), dtype=bool)
        """(tracks, 2) which of the slopes at both ends are kept."""
        targets = self._model.targets
        slopes = np.asarray(np.gradient(targets, self._times, axis=2))
        if ends is not None:
            self.held = ends.held.copy()
            slopes[..., [0, -1]] = np.where(self.held, ends.slopes, slopes[..., [0, -1]])
        self._curves = self._laid()
        self._chosen = self._curves.started(targets.reshape(4, -1), slopes.reshape(4, -1))

    def found(self) -> Generator[float, None, list[BezierKeys]]:
        """The keys of each track, in steps that yield the share that is done."""
        yield from evenly(self._fit(_FIRST, bounded=False), 0.0)
        limit = _LIMIT
        for attempt in range(_MENDING + _PINNING):
            done = _TIDYING * (1.0 - 0.85**attempt)
            yield done
            if attempt == _JOINING:
                yield from evenly(self._joining(_JOINED), done)
            if attempt >= _JOINING:
                own, joint = self._off()
                yield done
                if max(own.max(), joint.max()) <= _KEPT:
                    break
                self._mend(own, joint, limit, pin=attempt >= _MENDING)
                limit = max(1.0 + _FALLS * (limit - 1.0), _KEPT) if limit > 1.03 else _KEPT
                yield done
            yield from evenly(self._fit(_STEPS), done)
        else:
            self._pin_all()
        yield _TIDYING
        yield from evenly(self._tidying(), _TIDYING)
        yield 1.0
        return self._as_keys()

    # --- Fitting ------------------------------------------------------------------------------

    def _laid(self) -> Curves:
        keyed = self._keyed[self._columns]
        return Curves(
            self._times, keyed, self._smooth, self._pinned, loops=self._loops, held=self.held
        )

    def _fit(self, steps: int, *, bounded: bool = True) -> Generator[None, None, None]:
        off = self._away()
        change = yield from fitting(self._curves, self._model, off, steps, bounded=bounded)
        self._chosen = self._chosen + change

    def _away(self) -> Singles:
        """How far off values are: (4, tracks, moments)."""
        return (self._curves.at_frames(self._chosen) - self._model.targets).astype(np.float32)

    def _relay(self) -> None:
        """Curves and choices as the keys are now."""
        before, self._curves = self._curves, self._laid()
        self._chosen = self._curves.carried_over(before, self._chosen)
        targets = self._model.targets.reshape(4, -1)
        self._chosen[:, self._curves.pins] = targets[:, self._curves.pinned]

    def _joining(self, bound: float) -> Generator[None, None, None]:
        """Bring the handles of keys into line where errors stay below a share of their bounds, in
        steps.
        """
        before, chosen, kept = self._curves, self._chosen, self._smooth
        self._smooth = np.ones(kept.shape, dtype=bool)
        while True:
            curves = self._curves = self._laid()
            joined = self._chosen = curves.carried_over(before, chosen)
            own, joint = self._sizes()
            worst = np.maximum.reduceat(np.maximum(own, joint).ravel(), curves.heads)
            # Of the two keys of a span, the one goes first whose handles had to turn more.
            optional = ~kept.ravel()[curves.keys] & curves.smooth
            turned = np.where(optional, curves.turned(before, chosen, joined) + 1e-30, 0.0)
            first = curves.begun[worst > bound]
            ends = np.where(turned[first] >= turned[first + 1], first, first + 1)
            ends = ends[optional[ends]]
            if not len(ends):
                return
            self._smooth[curves.tracks[ends], curves.frames[ends]] = False
            yield

    def _tidying(self) -> Generator[None, None, None]:
        """Bring into line what may be, now that all is within its bounds; in steps."""
        if not self._holds():
            return
        before = self._curves, self._chosen, self._smooth
        yield
        yield from self._joining(_KEPT)
        if not self._holds():
            self._curves, self._chosen, self._smooth = before

    # --- Bounds -------------------------------------------------------------------------------

    def _sizes(self) -> tuple[Floats, Floats]:
        """Errors of tracks (tracks, moments) and of what they move (moments,), to first order."""
        errors = self._model.errors(self._away())
        own, *ends = (np.sqrt((each**2).sum(axis=0)) for each in errors)
        return own, np.max(ends, axis=(0, 1)) if ends else np.zeros(own.shape[1])

    def _measured(self) -> tuple[Floats, Floats]:
        """The same of what Blender will play."""
        played = self._curves.played(self._chosen, self._times)
        return self._errors.measure(
            [played[:width, track].T for track, width in enumerate(self._widths)]
        )

    def _off(self) -> tuple[Floats, Floats]:
        """The same as roughly as will do: where much is broken, to first order."""
        own, joint = self._sizes()
        if self._chained and max(own.max(), joint.max()) > _KEPT:
            return own, joint
        return self._measured()

    def _holds(self) -> bool:
        own, joint = self._measured()
        return bool(max(own.max(), joint.max()) <= _KEPT)

    def _mend(self, own: Floats, joint: Floats, limit: float, *, pin: bool) -> None:
        """Allow a corner, or add a key, where errors are beyond a limit."""
        curves, count = self._curves, own.shape[1]
        flat = own.ravel()
        worst = np.maximum.reduceat(flat, curves.heads)
        # The first moment of each span's worst, and what has most to do with ends that are off.
        (peaks,) = np.nonzero((flat == worst[curves.span]) & (flat > limit))
        frames = _peaks(joint, limit)
        elements = np.concatenate([peaks, self._culprits(own, frames) * count + frames])
        if not len(elements):
            return
        if pin:
            self._pin(*np.divmod(elements, count))
            return
        spans, chosen = np.unique(curves.span[elements], return_index=True)
        frames = elements[chosen] % count
        tracks, starts = np.divmod(curves.heads[spans], count)
        ends = curves.tails[spans] % count
        optional = self._smooth & self._corners
        loosened = optional[tracks, starts] | optional[tracks, ends]
        for at in (starts, ends):
            there = loosened & self._corners[tracks, at]
            self._smooth[tracks[there], at[there]] = False
        margin = np.maximum((ends - starts) // 4, 1)
        at = self._before[np.clip(frames, starts + margin, ends - margin)]
        at = np.where(at > starts, at, self._after[np.minimum(starts + 1, ends)])
        split = ~loosened & (at > starts) & (at < ends)
        self._keyed[self._columns[tracks[split]], at[split]] = True
        stuck = ~(loosened | split)
        self._pin(tracks[stuck], frames[stuck])

    def _pin_all(self) -> None:
        """Give all tracks the motion's own values about all moments that are off: what is left to
        do where the one that has most to do with it cannot make up for the others.
        """
        for _ in range(_LAST):
            own, joint = self._measured()
            off = np.flatnonzero(np.maximum(own.max(axis=0), joint) > _KEPT)
            if not len(off):
                return
            tracks = np.arange(len(own))
            self._pin(np.repeat(tracks, len(off)), np.tile(off, len(tracks)))

    def _culprits(self, own: Floats, frames: Integers) -> Integers:
        """The track (frames,) that has most to do with the limb's being off at some frames."""
        if not len(frames):
            return frames
        share = self._model.culprits(self._away(), frames)
        share = np.where((share != 0.0).any(axis=0), share, own[:, frames])
        return share.argmax(axis=0)

    def _pin(self, tracks: Integers, frames: Integers) -> None:
        """Give keys the motion's own values about some moments."""
        for at in (self._before[frames], self._after[frames]):
            self._keyed[self._columns[tracks], at] = True
            self._pinned[tracks, at] = True
            self._smooth[tracks, at] = False
            for side, end in enumerate((0, len(self._times) - 1)):
                self.held[tracks[at == end], side] = False
        self._relay()

    # --- Keys as Blender keeps them -----------------------------------------------------------

    def _as_keys(self) -> list[BezierKeys]:
        curves = self._curves
        out, into = curves.handles(self._chosen)
        result: list[BezierKeys] = []
        for track, width in enumerate(self._widths):
            own = curves.tracks == track
            spans = own[curves.begun]
            result.append(
                bezier_keys(
                    self._times[curves.frames[own]],
                    self._chosen[:width, curves.values[own]].T,
                    out[:width, spans].T,
                    into[:width, spans].T,
                    curves.smooth[own],
                )
            )
        return result


def _peaks(joint: Floats, limit: float) -> Integers:
    """The worst moments of each stretch in which errors (moments,) are beyond a limit."""
    padded = np.pad(joint, 1)
    worst = (joint > limit) & (joint >= padded[:-2]) & (joint > padded[2:])
    return np.flatnonzero(worst)


# --- The best values and slopes of all keys of a limb together ------------------------------------
#
# What is minimal is a sum of squares: of errors as far as they are near their bounds or beyond,
# and, with very little weight, of all. It is quadratic piece by piece, and a few rounds of Newton's
# method take it down [Nocedal & Wright, *Numerical Optimization*, 2006, §17.1, quadratic penalties
# of inequalities], each by conjugate gradients [Shewchuk, *An introduction to the conjugate
# gradient method without the agonizing pain*, 1994, §B3]: the tracks of a limb are coupled by the
# ends that they move.


_NEAR: Final = 0.9
"""Share of the bounds from which on an error counts."""
_CALM: Final = 0.1
"""Weight, against what counts, with which the rest stays as it is …"""
_HOME: Final = 0.001
"""… and with which it is drawn to where it should be."""
_FAR: Final = 0.05
"""Both for ends of bones, against tracks' own errors: what they couple takes long to solve."""
_BLOCK: Final = 16
"""Choices that are solved for together."""
_RIDGE: Final = 1e-3
"""Share by which they are held for themselves: some hardly matter to any frame."""


def fitting(
    curves: Curves, model: LinearModel, off: Singles, steps: int, *, bounded: bool
) -> Generator[None, None, Singles]:
    """By how much to change choices (4, size) to make errors smaller, in so many steps of conjugate
    gradients.

    The curves are ``off`` (4, tracks, frames) from what they are to follow. Bounded, errors matter
    near the bounds and beyond, rather than all alike.
    """
    errors = model.errors(off)
    pulls, stiff = [], []
    for each, share in zip(errors, (1.0, _FAR), strict=False):
        if not bounded:
            weights = np.full(each.shape[1:], share, dtype=np.float32)
            pulls.append(weights)
            stiff.append(weights)
            continue
        size = np.sqrt((each**2).sum(axis=0))
        beyond = np.maximum(1.0 - _NEAR / np.maximum(size, _NEAR), 0.0)
        pulls.append(beyond + np.float32(_HOME * share))
        stiff.append((size > _NEAR) + np.float32(_CALM * share))

    def gradient(change: Singles, errors: list[Singles], weights: list[Singles]) -> Singles:
        weighted = [weight * each for weight, each in zip(weights, errors, strict=True)]
        return curves.gathered(model.pull(change, weighted, weights[0]))

    yield
    eased = yield from _easing(curves, model.weights(stiff[0]))
    yield
    rest = -gradient(off, errors, pulls)
    turned = eased(rest)
    way = turned.copy()
    total = np.zeros_like(rest)
    size = inner_product(rest, turned)
    for _ in range(steps):
        yield
        if size <= 1e-12:
            break
        change = curves.spread(way)
        answer = gradient(change, model.errors(change), stiff)
        share = size / max(inner_product(way, answer), 1e-30)
        total += share * way
        rest -= share * answer
        turned = eased(rest)
        before, size = size, inner_product(rest, turned)
        way *= np.float32(size / before)
        way += turned
    return total


def _easing(curves: Curves, weight: Singles) -> Generator[None, None, Callable[[Singles], Singles]]:
    """What nearly solves the system of tracks by themselves, whose values weigh so much (tracks,
    frames): the choices of some keys at a time. In steps.
    """
    blocks = -(-curves.size // _BLOCK)
    matrix = np.zeros((blocks, _BLOCK, _BLOCK), dtype=np.float32)
    for one in range(4):
        for two in range(one, 4):
            rows, columns = curves.choices[one], curves.choices[two]
            near = (rows // _BLOCK == columns // _BLOCK) & curves.free[rows] & curves.free[columns]
            rows, columns = rows[near], columns[near]
            both = curves.coupled(one, two, weight)[near]
            # No two spans have the same choice in the same place: nothing is added twice at once.
            matrix[rows // _BLOCK, rows % _BLOCK, columns % _BLOCK] += both
            if one != two:
                matrix[rows // _BLOCK, columns % _BLOCK, rows % _BLOCK] += both
        yield
    place = np.arange(_BLOCK)
    diagonal = matrix[:, place, place]
    # What is not free, and what fills up the last block, is by itself.
    matrix[:, place, place] = diagonal * np.float32(1.0 + _RIDGE) + (diagonal == 0.0)
    inverse = np.linalg.inv(matrix)

    def solved(pulls: Singles) -> Singles:
        padded = np.zeros((4, blocks * _BLOCK), dtype=np.float32)
        padded[:, : curves.size] = pulls
        result = inverse @ padded.reshape(4, blocks, _BLOCK).transpose(1, 2, 0)
        return result.transpose(2, 0, 1).reshape(4, -1)[:, : curves.size]

    return solved
