# SPDX-License-Identifier: GPL-3.0-or-later
"""Few Bézier keys in place of one key per frame, within bounds that hold at every frame.

What an animator edits is a pose key: one frame at which all channels of a limb have a key. So the
channels of a :class:`Limb` share their key frames, and each key holds the dense motion's own pose.
Between two keys every channel is a cubic whose handles stand at thirds of the time: Blender's
curve is then a cubic in time itself. Where the motion is smooth, handles follow its slope, so that
the curve runs through the key without a corner; elsewhere they are found by linear least squares
over the frames between the keys, and then brought into line wherever the bounds allow it.

Key frames are found from left to right, each as far on as the bounds allow: no choice has fewer
keys, as long as what can be spanned in one piece can be spanned in parts. Many limbs and many
stretches of the shot are worked on at once. In the end every frame is measured on the keys as
Blender keeps them, in single precision, and keys are added until all bounds hold.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .rotations import (
    Floats,
    from_axis_angle,
    from_euler,
    multiply,
    normalized,
    rotate,
    to_matrix,
)
from .skeleton import Skeleton

LOCATION: Final = "LOCATION"

_STRETCH: Final = 64
"""Frames that are worked on at once; stretches meet where a key is needed anyway."""
_ROWS: Final = 8192
"""Frames times limbs measured at a time: what stays within a processor's cache."""
_CHOOSING: Final = 0.8
"""Share of the work that it takes to choose key frames; the rest is for their handles."""
_PULL: Final = 0.01
"""Weight, against that of a frame, of the wish that handles follow the motion's slope."""
_GENTLE_PULL: Final = 1e-3
"""The same where there is but a moment between two keys."""
_SPARE: Final = 0.998
"""Share of the bounds that is used up before values are rounded."""
_KEPT: Final = 0.999
"""Share of them that is used up afterwards: Blender still rounds handles that it aligns."""
_KINK: Final = 0.1
"""Bounds by which the motion must turn aside within a frame to be let have a corner there."""

Integers = NDArray[np.intp]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Track:
    """One animated property, at every frame."""

    values: Floats
    """(frames, components)"""
    kind: str
    """``"LOCATION"``, or Blender's rotation mode: ``"QUATERNION"``, ``"AXIS_ANGLE"``, ``"XYZ"``…"""


@dataclass(frozen=True, eq=False)
class Chain:
    """Forward kinematics from the rotations of a limb's tracks to the position of its tip."""

    turned: tuple[int, ...]
    """For each bone from root to tip, the track that rotates it; −1 for one without."""
    follows: tuple[bool, ...]
    """Whether the bone before turns this one."""
    rest_rotations: Floats
    """(bones, 4)"""
    steps: Floats
    """(bones, 3) from each bone's head to the next one's, the last to its tail, at rest."""


@dataclass(frozen=True, eq=False)
class Limb:
    """Tracks whose keys stand at the same frames, and how far they may be off.

    The distance bounds the sum of each location's error and ``lever`` times each rotation's
    (the length of the chord), and the error of the chain's tip.
    """

    tracks: Sequence[Track]
    angle: float
    """Radians by which each rotation may be off."""
    distance: float
    """In the units of the locations and of the chain."""
    lever: float = 0.0
    chain: Chain | None = None


@dataclass(frozen=True, eq=False)
class BezierKeys:
    """Keys of one track in single precision, as Blender keeps them."""

    frames: NDArray[np.float32]
    """(keys,)"""
    values: NDArray[np.float32]
    """(keys, components)"""
    left: NDArray[np.float32]
    """(keys, components, 2) frame and value of the handles before the keys."""
    right: NDArray[np.float32]
    """(keys, components, 2) likewise after them."""
    smooth: Booleans
    """(keys,) whether both handles lie on one line, as Blender's aligned ones do."""

    def __len__(self) -> int:
        """Number of keys of each component."""
        return len(self.frames)


def chain_to_tip(skeleton: Skeleton, bones: Sequence[str]) -> Chain:
    """The chain of an arm whose tracks are the rotations of its bones, root to tip.

    Bones in between that have no track ride along; what the first bone hangs on stays at rest.
    """
    tracks = {skeleton.index[name]: number for number, name in enumerate(bones)}
    path = [skeleton.index[bones[-1]]]
    while path[-1] != skeleton.index[bones[0]]:
        path.append(skeleton.parents[path[-1]])
    path.reverse()
    points = [*(skeleton.heads[bone] for bone in path), skeleton.tails[path[-1]]]
    return Chain(
        turned=tuple(tracks.get(bone, -1) for bone in path),
        follows=tuple(skeleton.inherits_rotation[bone] for bone in path),
        rest_rotations=skeleton.rest_rotations[path],
        steps=np.diff(points, axis=0),
    )


def check_bounds(angle: float, distance: float) -> None:
    """Make sure that there is something to reduce within.

    Raises:
        SettingsError: a bound is not above zero.
    """
    if not (angle > 0.0 and distance > 0.0):
        raise SettingsError(
            "Without any tolerance, no key can be left out.",
            "Choose an angle and a distance above zero, or keys on every frame.",
        )


def reduce_keys(frames: Floats, limbs: Sequence[Limb]) -> list[list[BezierKeys]]:
    """As few keys as keep each limb within its bounds at every frame.

    Args:
        frames: (frames,) ascending, as Blender keeps them.
        limbs: any number; those that are alike are worked on together.

    Returns:
        The keys of each limb's tracks.

    Raises:
        SettingsError: a bound is not above zero.
    """
    steps = reducing(frames, limbs)
    while True:
        try:
            next(steps)
        except StopIteration as finished:
            return finished.value


def reducing(
    frames: Floats, limbs: Sequence[Limb], *, every: int = 1, all_of_them: bool = False
) -> Generator[float, None, list[list[BezierKeys]]]:
    """The same in steps, yielding the share that is done: 0…1. May be dropped between any two.

    Args:
        frames: (frames,) ascending, as Blender keeps them.
        limbs: any number; those that are alike are worked on together.
        every: at every how many of the frames there may be a key, from the first to the last one;
            those in between are moments at which the bounds hold too.
        all_of_them: whether there is a key wherever there may be one.
    """
    for limb in limbs:
        check_bounds(limb.angle, limb.distance)
    times = np.asarray(frames, dtype=np.float32).astype(np.float64)
    alike: dict[object, list[int]] = {}
    for number, limb in enumerate(limbs):
        chain = limb.chain and (limb.chain.turned, limb.chain.follows)
        form = tuple((track.kind, track.values.shape[1]) for track in limb.tracks)
        alike.setdefault((form, chain), []).append(number)
    result: list[list[BezierKeys]] = [[] for _ in limbs]
    tracks = [len(limb.tracks) for limb in limbs]
    done, whole = 0, max(sum(tracks), 1)
    for numbers in alike.values():
        own = sum(tracks[number] for number in numbers)
        own_limbs = [limbs[number] for number in numbers]
        steps = _Work(times, own_limbs, every).reduced(all_of_them=all_of_them)
        while True:
            try:
                share = next(steps)
            except StopIteration as finished:
                for number, keys in zip(numbers, finished.value, strict=True):
                    result[number] = keys
                break
            yield (done + own * share) / whole
        done += own
    return result


def _nothing() -> Floats:
    return np.empty(0)


@dataclass(eq=False)
class _Spans:
    """Stretches of limbs from one key to the next, and their handles."""

    limbs: Integers
    starts: Integers
    ends: Integers
    out: Floats = field(default_factory=_nothing)
    """(spans, components) values of the handles after the first keys."""
    into: Floats = field(default_factory=_nothing)
    """(spans, components) values of the handles before the last keys."""
    out_frames: Floats = field(default_factory=_nothing)
    """(spans,) frames of the handles; without, they are at thirds."""
    into_frames: Floats = field(default_factory=_nothing)

    def __len__(self) -> int:
        return len(self.starts)

    def part(self, chosen: slice | Booleans) -> _Spans:
        def cut(each: Floats) -> Floats:
            return each[chosen] if len(each) else each

        return _Spans(
            limbs=self.limbs[chosen],
            starts=self.starts[chosen],
            ends=self.ends[chosen],
            out=cut(self.out),
            into=cut(self.into),
            out_frames=cut(self.out_frames),
            into_frames=cut(self.into_frames),
        )


class _Work:
    """Limbs that are alike: as many tracks of the same kinds, the same chain."""

    def __init__(self, times: Floats, limbs: Sequence[Limb], every: int = 1) -> None:
        self._times, self._every = times, every
        self._kinds = [track.kind for track in limbs[0].tracks]
        self._widths = [track.values.shape[1] for track in limbs[0].tracks]
        ends = np.cumsum([0, *self._widths])
        self._columns = [slice(*pair) for pair in pairwise(ends)]
        # What the keys hold is rounded; what is aimed at is not.
        exact = np.stack(
            [np.concatenate([track.values for track in limb.tracks], axis=1) for limb in limbs]
        )
        self._values = exact.astype(np.float32).astype(np.float64)
        self._angle = np.array([limb.angle for limb in limbs])
        self._distance = np.array([limb.distance for limb in limbs])
        self._lever = np.array([limb.lever for limb in limbs])
        self._chain = limbs[0].chain
        if self._chain is not None:
            chains = [limb.chain for limb in limbs if limb.chain is not None]
            self._rest = to_matrix(np.stack([each.rest_rotations for each in chains]))
            self._steps = np.stack([each.steps for each in chains])
        self._rotations, self._locations = self._decoded(exact)
        self._loose = self._kinks()
        self._loose[:, (0, -1)] = True
        numbers = np.arange(len(limbs))[:, None]
        self._tips = self._tip_positions(
            np.broadcast_to(numbers, exact.shape[:2]).ravel(),
            self._rotations.reshape(numbers.size * len(times), -1, 4),
        ).reshape(*exact.shape[:2], -1)

    def reduced(
        self, *, all_of_them: bool = False
    ) -> Generator[float, None, list[list[BezierKeys]]]:
        """The keys of each limb's tracks, in steps that yield the share that is done."""
        last = len(self._times) - 1
        keyed = np.zeros(self._values.shape[:2], dtype=bool)
        keyed[:, (0, last)] = True
        if self._every > 1 and last > 0:
            self._let_go()
        if all_of_them:
            keyed[:, :: self._every] = True
        elif last > 0:
            for share in self._choose(keyed):
                yield _CHOOSING * share
        return (yield from self._written(keyed))

    # --- Which frames ------------------------------------------------------------------------

    def _choose(self, keyed: Booleans) -> Iterator[float]:
        """Mark the key frames of all limbs, (limbs, frames); the share that is done."""
        limbs, starts, ends = self._stretches()
        whole = int((ends - starts).sum())
        keyed[limbs, starts] = True
        # Of each stretch: the last key, the furthest frame that it can span, the nearest that it
        # cannot, and how far to look next.
        every = self._every
        starts, ends = starts // every, ends // every
        at, good, bad = starts.copy(), starts + 1, ends + 1
        guess = np.minimum(starts + 8, ends)
        while len(at):
            probed = guess > good
            spans = _Spans(limbs[probed], every * at[probed], every * guess[probed])
            fits = np.ones(len(at), dtype=bool)
            fits[probed] = self._fitted(spans) <= _SPARE
            length = guess - at
            good = np.where(fits, np.maximum(guess, good), good)
            bad = np.where(fits, bad, guess)
            found = good + 1 >= bad
            keyed[limbs[found], every * good[found]] = True
            step = good - at
            at = np.where(found, good, at)
            # The next span is looked for at the length of this one, a longer one by doubling.
            unknown = bad > ends
            guess = np.where(unknown, good + length, (good + bad) // 2)
            guess = np.where(found, good + step, guess)
            good = np.where(found, at + 1, good)
            bad = np.where(found, ends + 1, bad)
            guess = np.clip(guess, good, np.minimum(ends, bad))
            guess = np.where((guess == good) & ~found & (good + 1 < bad), good + 1, guess)
            going = at < ends
            limbs, ends = limbs[going], ends[going]
            at, good, bad, guess = at[going], good[going], bad[going], guess[going]
            yield 1.0 - int((ends - at).sum()) / whole

    def _stretches(self) -> tuple[Integers, Integers, Integers]:
        """Limb, first and last frame of the stretches, cut where the motion bends most."""
        count = len(self._times)
        bend = np.zeros(self._values.shape[:2])
        bend[:, 1:-1] = np.abs(np.diff(self._values, 2, axis=1)).max(axis=2)
        nominal = np.arange(_STRETCH, count - _STRETCH // 2, _STRETCH)
        around = np.arange(-_STRETCH // 4, _STRETCH // 4)
        windows = nominal[:, None] + around
        cuts = windows[:, 0] + bend[:, windows].argmax(axis=2)
        cuts -= cuts % self._every
        rows = len(self._values)
        edges = np.column_stack(
            [np.zeros(rows, dtype=np.intp), cuts, np.full(rows, count - 1, dtype=np.intp)]
        )
        limbs = np.repeat(np.arange(rows), edges.shape[1] - 1)
        return limbs, edges[:, :-1].ravel(), edges[:, 1:].ravel()

    # --- Handles -----------------------------------------------------------------------------

    def _kinks(self) -> Booleans:
        """Where the motion itself has a corner: (limbs, frames, tracks)."""
        bend = np.zeros(self._values.shape)
        bend[:, 1:-1] = np.diff(self._values, 2, axis=1)
        # What sets a corner apart from a tight bend is that the frames beside it bend less.
        bend[:, 1:-1] -= 0.5 * (bend[:, :-2] + bend[:, 2:])
        kinks = np.empty((*self._values.shape[:2], len(self._kinds)), dtype=bool)
        for track, (kind, columns) in enumerate(zip(self._kinds, self._columns, strict=True)):
            bound = self._distance if kind == LOCATION else self._angle
            # A quaternion changes by half the angle.
            size = np.linalg.norm(bend[..., columns], axis=2) * (1.0 + (kind == "QUATERNION"))
            kinks[..., track] = size > _KINK * bound[:, None]
        return kinks

    def _let_go(self) -> None:
        """Let the motion have a corner wherever it does not keep to its slope for a frame.

        From one key to the next there are moments in between then, and none to put a key at.
        """
        rows, count = self._values.shape[:2]
        starts = np.arange(0, count - 1, self._every)
        limbs, starts = np.repeat(np.arange(rows), len(starts)), np.tile(starts, rows)
        spans = _Spans(limbs, starts, starts + self._every)
        off = self._fitted(spans) > _SPARE
        self._loose[limbs[off], starts[off]] = True
        self._loose[limbs[off], starts[off] + self._every] = True

    def _fitted(self, spans: _Spans) -> Floats:
        """Give spans the handles that fit best; the errors that remain, as shares of the bounds."""
        components = self._values.shape[2]
        spans.out, spans.into = np.empty((2, len(spans), components))
        errors = np.zeros(len(spans))
        for part in _blocks(spans.ends - spans.starts):
            self._fit(spans, part)
            errors[part] = self._errors(spans.part(part))
        return errors

    def _fit(self, spans: _Spans, part: slice) -> None:
        limbs, starts, ends = spans.limbs[part], spans.starts[part], spans.ends[part]
        third = (self._times[ends] - self._times[starts])[:, None] / 3.0
        first, last = self._values[limbs, starts], self._values[limbs, ends]
        wanted_out = first + third * self._slopes(limbs, starts)
        wanted_into = last - third * self._slopes(limbs, ends)
        owner, frames, heads = _rows(starts, ends)
        share = (self._times[frames] - self._times[starts][owner]) / (3.0 * third[owner, 0])
        weights = _bernstein(share)
        rest = self._values[limbs[owner], frames]
        rest -= weights[0][:, None] * first[owner] + weights[3][:, None] * last[owner]
        one, two = weights[1], weights[2]
        sums = np.add.reduceat(np.column_stack([one * one, one * two, two * two]), heads)
        # A single moment in between has little to say against it.
        single = (ends - starts == self._every) & (self._every > 1)
        pull = np.where(single, _GENTLE_PULL, _PULL)[:, None]
        ones = np.add.reduceat(one[:, None] * rest, heads) + pull * wanted_out
        twos = np.add.reduceat(two[:, None] * rest, heads) + pull * wanted_into
        sums += pull * (1.0, 0.0, 1.0)
        a, b, c = sums.T[:, :, None]
        scale = a * c - b * b
        out, into = (c * ones - b * twos) / scale, (a * twos - b * ones) / scale
        loose_out = np.repeat(self._loose[limbs, starts], self._widths, axis=1)
        loose_into = np.repeat(self._loose[limbs, ends], self._widths, axis=1)
        # Where the motion is smooth, so are the keys: their handles follow its own slope.
        alone = (ones - b * wanted_into) / a
        spans.out[part] = np.where(loose_out, np.where(loose_into, out, alone), wanted_out)
        alone = (twos - b * wanted_out) / c
        spans.into[part] = np.where(loose_into, np.where(loose_out, into, alone), wanted_into)

    def _slopes(self, limbs: Integers, frames: Integers) -> Floats:
        """How fast the dense values change, (…, components) per frame."""
        before = np.maximum(frames - 1, 0)
        after = np.minimum(frames + 1, len(self._times) - 1)
        change = self._values[limbs, after] - self._values[limbs, before]
        return change / (self._times[after] - self._times[before])[:, None]

    def _errors(self, spans: _Spans) -> Floats:
        """Largest error of each span at its frames, as a share of the bounds."""
        owner, frames, heads = _rows(spans.starts, spans.ends)
        starts, ends = self._times[spans.starts], self._times[spans.ends]
        share = (self._times[frames] - starts[owner]) / (ends - starts)[owner]
        if len(spans.out_frames):
            corners = (starts, spans.out_frames, spans.into_frames, ends)
            share = _parameters(self._times[frames], *(each[owner] for each in corners))
        weights = _bernstein(share)
        limbs = spans.limbs[owner]
        values = weights[0][:, None] * self._values[spans.limbs, spans.starts][owner]
        values += weights[1][:, None] * spans.out[owner]
        values += weights[2][:, None] * spans.into[owner]
        values += weights[3][:, None] * self._values[spans.limbs, spans.ends][owner]
        return np.maximum.reduceat(self._deviation(limbs, frames, values), heads)

    def _deviation(self, limbs: Integers, frames: Integers, values: Floats) -> Floats:
        """How far values (rows, components) are off, as a share of the bounds: (rows,)."""
        rotations, locations = self._decoded(values)
        cosine = np.einsum("rbi,rbi->rb", rotations, self._rotations[limbs, frames])
        half = np.arccos(np.minimum(np.abs(cosine), 1.0)).max(axis=1, initial=0.0)
        away = np.linalg.norm(locations - self._locations[limbs, frames], axis=2)
        distance = away.max(axis=1, initial=0.0) + self._lever[limbs] * 2.0 * np.sin(half)
        if self._chain is not None:
            tips = self._tip_positions(limbs, rotations) - self._tips[limbs, frames]
            distance = np.maximum(distance, np.linalg.norm(tips, axis=1))
        return np.maximum(2.0 * half / self._angle[limbs], distance / self._distance[limbs])

    def _decoded(self, values: Floats) -> tuple[Floats, Floats]:
        """Rotations (…, rotated tracks, 4) and locations (…, located tracks, 3)."""
        ahead = values.shape[:-1]
        if all(kind == "QUATERNION" for kind in self._kinds):
            return normalized(values.reshape(*ahead, -1, 4)), np.zeros((*ahead, 0, 3))
        rotations, locations = [], []
        for kind, columns in zip(self._kinds, self._columns, strict=True):
            own = values[..., columns]
            if kind == LOCATION:
                locations.append(own)
            elif kind == "QUATERNION":
                rotations.append(normalized(own))
            elif kind == "AXIS_ANGLE":
                rotations.append(from_axis_angle(normalized(own[..., 1:]), own[..., 0]))
            else:
                rotations.append(from_euler(own, kind))
        return (
            np.stack(rotations, axis=-2) if rotations else np.zeros((*ahead, 0, 4)),
            np.stack(locations, axis=-2) if locations else np.zeros((*ahead, 0, 3)),
        )

    def _tip_positions(self, limbs: Integers, rotations: Floats) -> Floats:
        """Where the chain's tip is seen from its root: (rows, 3)."""
        tips = np.zeros((len(limbs), 3))
        if self._chain is None:
            return tips
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(limbs), 1))
        for bone, track in enumerate(self._chain.turned):
            if not self._chain.follows[bone]:
                turn = np.tile([1.0, 0.0, 0.0, 0.0], (len(limbs), 1))
            if track >= 0:
                own = rotations[:, track].copy()
                own[:, 1:] = np.einsum("rij,rj->ri", self._rest[limbs, bone], own[:, 1:])
                turn = multiply(turn, own)
            tips += rotate(turn, self._steps[limbs, bone])
        return tips

    # --- Keys as Blender keeps them --------------------------------------------------------------

    def _written(self, keyed: Booleans) -> Generator[float, None, list[list[BezierKeys]]]:
        """Keys at these frames; more are added where rounding would break a bound."""
        while True:
            spans = _spans_between(keyed)
            self._fitted(spans)
            self._round(spans)
            limbs, starts, ends = spans.limbs, spans.starts, spans.ends
            split = self._broken(spans) & (ends - starts > self._every)
            if not split.any():
                return self._as_keys(spans, keyed, self._joined(spans))
            middles = (starts + ends)[split] // 2
            keyed[limbs[split], middles - middles % self._every] = True
            yield _CHOOSING

    def _joined(self, spans: _Spans) -> Booleans:
        """Bring the two handles of a key into line wherever that keeps to the bounds.

        Returns:
            Whether they are, (limbs, frames, tracks).
        """
        thirds = (self._times[spans.ends] - self._times[spans.starts])[:, None] / 3.0
        values = self._values[spans.limbs[1:], spans.starts[1:]]
        before, after = thirds[:-1], thirds[1:]
        into, out = spans.into[:-1].copy(), spans.out[1:].copy()
        # A slope that is off moves the curve by as much as the span is long, at as many frames.
        slope = before**2 * (values - into) + after**2 * (out - values)
        slope /= before**3 + after**3
        met = spans.limbs[1:] == spans.limbs[:-1]
        while True:
            spans.into[:-1] = np.where(met[:, None], values - before * slope, into)
            spans.out[1:] = np.where(met[:, None], values + after * slope, out)
            self._round(spans)
            broken = self._broken(spans)
            undone = met & (broken[:-1] | broken[1:])
            if not undone.any():
                break
            met &= ~undone
        joined = ~self._loose
        joined[spans.limbs[1:][met], spans.starts[1:][met]] = True
        return joined

    def _broken(self, spans: _Spans) -> Booleans:
        """Whether spans leave the bounds."""
        broken = np.zeros(len(spans), dtype=bool)
        for part in _blocks(spans.ends - spans.starts):
            broken[part] = self._errors(spans.part(part)) > _KEPT
        return broken

    def _round(self, spans: _Spans) -> None:
        starts, ends = self._times[spans.starts], self._times[spans.ends]
        third = (ends - starts) / 3.0
        spans.out_frames = (starts + third).astype(np.float32).astype(np.float64)
        spans.into_frames = (ends - third).astype(np.float32).astype(np.float64)
        spans.out = spans.out.astype(np.float32).astype(np.float64)
        spans.into = spans.into.astype(np.float32).astype(np.float64)

    def _as_keys(self, spans: _Spans, keyed: Booleans, joined: Booleans) -> list[list[BezierKeys]]:
        result: list[list[BezierKeys]] = []
        for limb, marked in enumerate(keyed):
            (places,) = np.nonzero(marked)
            own = spans.part(spans.limbs == limb)
            values = self._values[limb, places]
            times = self._times[places]
            left, right = np.empty((2, *values.shape, 2))
            left[1:, :, 0], left[1:, :, 1] = own.into_frames[:, None], own.into
            right[:-1, :, 0], right[:-1, :, 1] = own.out_frames[:, None], own.out
            # Nothing lies before the first key and after the last: their handles go straight on.
            own_point = np.stack(np.broadcast_arrays(times[:, None], values), axis=-1)
            if len(places) == 1:
                left[0], right[0] = own_point[0] - (1.0, 0.0), own_point[0] + (1.0, 0.0)
            else:
                left[0] = 2.0 * own_point[0] - right[0]
                right[-1] = 2.0 * own_point[-1] - left[-1]
            result.append(
                [
                    BezierKeys(
                        frames=times.astype(np.float32),
                        values=values[:, columns].astype(np.float32),
                        left=left[:, columns].astype(np.float32),
                        right=right[:, columns].astype(np.float32),
                        smooth=joined[limb, places, track],
                    )
                    for track, columns in enumerate(self._columns)
                ]
            )
        return result


def _spans_between(keyed: Booleans) -> _Spans:
    limbs, frames = np.nonzero(keyed)
    same = limbs[1:] == limbs[:-1]
    return _Spans(limbs[:-1][same], frames[:-1][same], frames[1:][same])


def _blocks(lengths: Integers) -> Iterator[slice]:
    """Spans one after the other, so many at a time that their frames stay within limits."""
    filled = np.cumsum(lengths + 1) // _ROWS
    edges = [0, *(np.flatnonzero(np.diff(filled)) + 1), len(lengths)]
    for start, stop in pairwise(edges):
        if stop > start:
            yield slice(int(start), int(stop))


def _rows(starts: Integers, ends: Integers) -> tuple[Integers, Integers, Integers]:
    """All frames of all spans, both ends included: span, frame, and where each span begins."""
    counts = ends - starts + 1
    heads = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(starts)), counts)
    frames = np.arange(len(owner)) - heads[owner] + starts[owner]
    return owner, frames, heads


def _bernstein(share: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    rest = 1.0 - share
    return rest**3, 3.0 * share * rest**2, 3.0 * share**2 * rest, share**3


def _parameters(times: Floats, starts: Floats, outs: Floats, intos: Floats, ends: Floats) -> Floats:
    """Where on their Bézier curves, 0…1, these times are reached (Newton; handles near thirds)."""
    share = (times - starts) / (ends - starts)
    for _ in range(4):
        weights = _bernstein(share)
        off = weights[0] * starts + weights[1] * outs + weights[2] * intos + weights[3] * ends
        rest = 1.0 - share
        speed = rest**2 * (outs - starts) + 2.0 * share * rest * (intos - outs)
        speed += share**2 * (ends - intos)
        share = np.clip(share - (off - times) / (3.0 * np.maximum(speed, 1e-3)), 0.0, 1.0)
    return share
