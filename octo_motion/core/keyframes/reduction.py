# SPDX-License-Identifier: GPL-3.0-or-later
"""Few Bézier keys in place of one key per frame, within bounds that hold at every frame.

What an animator edits is a key: a frame at which all channels of a bone, or of a whole limb, have
a key. Between two keys every channel is a cubic whose handles stand at thirds of the time:
Blender's curve is then a cubic in time itself, and its values depend on those of keys and handles
linearly.

First the frames are chosen (:mod:`.key_times`), for bounds somewhat wider than those that are asked
for. Then all keys of a limb are fitted together (:mod:`.search`: :mod:`.curves` against
:mod:`.residuals`), handles are brought into line, and keys are added where bounds are still broken,
between frames, too. Keys on every frame have handles of their own (:mod:`.dense`).
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..errors import SettingsError
from ..processes import computed_apart, helpers
from ..rotations import Floats
from ..steps import evenly, finished
from .channels import BezierKeys, Booleans
from .dense import dense_keys
from .key_times import Choice
from .stretches import Found, Part, parts, searched, searching, together
from .tracks import LOCATION, SCALE, Limb, Track, looked_at

_SLACK: Final = 1.15
"""Bounds within which key frames are chosen: what fitting makes up for afterwards."""
_LEVERAGE: Final = 2.5
"""Distances of the tip, as shares of the chain's length, that a bone may be turned away when key
frames are chosen: what others make up for …"""
_HELD_LEVERAGE: Final = 4.2
"""… and the same of joints that rest."""
_CHOOSING: Final = 0.2
"""Share of the work that it takes to choose key frames."""
_LONG: Final = 100_000
"""Values (a channel's at a frame) from which on processes of their own are worth their start: they
take about 3 s of one processor, the start of a Python with numpy 0.3 s."""


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


def reduce_keys(
    frames: Floats,
    limbs: Sequence[Limb],
    *,
    every: int = 1,
    all_of_them: bool = False,
    loops: bool = False,
) -> list[list[BezierKeys]]:
    """As few keys as keep each limb within its bounds at every frame.

    Args:
        frames: (frames,) ascending, as Blender keeps them.
        limbs: any number.
        every: at every how many of the frames there may be a key, from the first to the last one;
            those in between are moments at which the bounds hold too.
        all_of_them: whether there is a key wherever there may be one, of the motion's own values.
        loops: whether the motion goes on from its last frame to its first.

    Returns:
        The keys of each limb's tracks.

    Raises:
        SettingsError: a bound is not above zero.
    """
    steps = reducing(frames, limbs, every=every, all_of_them=all_of_them, loops=loops)
    return finished(steps)


def reducing(
    frames: Floats,
    limbs: Sequence[Limb],
    *,
    every: int = 1,
    all_of_them: bool = False,
    loops: bool = False,
) -> Generator[float, None, list[list[BezierKeys]]]:
    """The same in steps, yielding the share that is done: 0…1. May be dropped between any two."""
    for limb in limbs:
        check_bounds(limb.angle, float(np.min(limb.distance)))
    times = np.asarray(frames, dtype=np.float32).astype(np.float64)
    if len(times) == 1:
        return [[_alone(times, track) for track in limb.tracks] for limb in limbs]
    if all_of_them:
        return (yield from _dense(times, limbs, every, loops=loops))
    plans = [_Plan.of(limb, len(times)) for limb in limbs]
    for share in _choose(times, plans, every):
        yield _CHOOSING * share
    batch = _Batch(times, plans, every, loops=loops)
    count = helpers() if batch.size >= _LONG else 0
    steps = batch.searched_apart(count) if count else batch.searched_here()
    while True:
        try:
            yield _CHOOSING + (1.0 - _CHOOSING) * next(steps)
        except StopIteration as last:
            return batch.together(last.value)


class _Batch:
    """The stretches of all limbs, whose keys are searched for one by one or some at a time."""

    def __init__(self, times: Floats, plans: Sequence[_Plan], every: int, *, loops: bool) -> None:
        self._times, self._plans, self._every, self._loops = times, plans, every, loops
        tracks = sum(len(plan.limb.tracks) for plan in plans)
        self.size = len(times) * tracks
        """How many values there are to be fitted."""
        self._whole = max(self.size, 1)
        self._owners: list[int] = []
        self._shares = [0.0]

    def _parts(self) -> Iterator[Part]:
        """One after the other, as they are needed, with note of how far that takes the work."""
        for number, plan in enumerate(self._plans):
            fine = looked_at(self._times, plan.limb, self._every)
            share = len(self._times) / len(fine.times) / self._whole
            marks = fine.marked(plan.keyed), fine.marked(plan.corners)
            for part in parts(fine, *marks, loops=self._loops):
                self._owners.append(number)
                self._shares.append(self._shares[-1] + share * part.corners.size)
                yield part

    def searched_here(self) -> Generator[float, None, list[Found]]:
        """The keys of each stretch, yielding the share that is done."""
        found: list[Found] = []
        for part in self._parts():
            before, after = self._shares[-2:]
            steps = searching(part)
            while True:
                try:
                    yield before + (after - before) * next(steps)
                except StopIteration as last:
                    found.append(last.value)
                    break
        return found

    def searched_apart(self, count: int) -> Generator[float, None, list[Found]]:
        """The same, by so many processes."""
        steps = computed_apart(searched, self._parts(), count)
        while True:
            try:
                yield self._shares[next(steps)]
            except StopIteration as last:
                return last.value

    def together(self, found: Sequence[Found]) -> list[list[BezierKeys]]:
        """The keys of each limb's tracks."""
        by_limb: list[list[Found]] = [[] for _ in self._plans]
        for owner, each in zip(self._owners, found, strict=True):
            by_limb[owner].append(each)
        return [together(each) for each in by_limb]


def _dense(
    times: Floats, limbs: Sequence[Limb], every: int, *, loops: bool
) -> Generator[float, None, list[list[BezierKeys]]]:
    """A key wherever there may be one, of the motion's own values."""
    result: list[list[BezierKeys]] = []
    for limb in limbs:
        done = len(result) / len(limbs)
        result.append((yield from evenly(dense_keys(times, limb, every, loops=loops), done)))
    return result


@dataclass(frozen=True, eq=False)
class _Plan:
    """A limb, and its key frames."""

    limb: Limb
    keyed: Booleans
    """(columns, frames)"""
    corners: Booleans
    """(tracks, frames)"""

    @classmethod
    def of(cls, limb: Limb, frames: int) -> _Plan:
        columns = limb.column_numbers()
        return cls(
            limb,
            np.zeros((max(columns, default=-1) + 1, frames), dtype=bool),
            np.ones((len(columns), frames), dtype=bool),
        )

    def column(self, number: int) -> tuple[list[int], Limb]:
        """Tracks with the same key frames, and a limb of them alone, with wider bounds.

        Where there is a chain, distances are not looked at yet: what moves its tip is fitted
        together. Scales are bounded like locations, by a share of what they are of.
        """
        limb, angle = self.limb, self.limb.angle
        tracks = [place for place, each in enumerate(limb.column_numbers()) if each == number]
        distance = float(np.min(limb.distance))
        if limb.chain is not None:
            # Bones that are further off would move the tip by more than others can make up for.
            length = np.linalg.norm(limb.chain.steps, axis=1).sum()
            distance = _LEVERAGE * float(np.mean(limb.distance))
            if limb.room is not None and np.any(held := np.isfinite(limb.room)):
                distance = min(distance, _HELD_LEVERAGE * float(np.mean(limb.room[held])))
            distance = angle = min(angle, distance / length)
        unit = distance / angle
        kept = [limb.tracks[place] for place in tracks]
        kept = [
            Track(unit * each.values, LOCATION) if each.kind == SCALE else each for each in kept
        ]
        return tracks, Limb(kept, _SLACK * angle, _SLACK * distance, limb.lever)


def _choose(times: Floats, plans: Sequence[_Plan], every: int) -> Generator[float, None, None]:
    """Fill in the key frames of all plans; columns that are alike are worked on together."""
    alike: dict[object, list[tuple[_Plan, int, list[int], Limb]]] = {}
    for plan in plans:
        for number in range(len(plan.keyed)):
            tracks, limb = plan.column(number)
            form = tuple((track.kind, track.values.shape[1]) for track in limb.tracks)
            alike.setdefault(form, []).append((plan, number, tracks, limb))
        yield 0.0
    done, whole = 0, max(sum(len(plan.keyed) for plan in plans), 1)
    for columns in alike.values():
        choice = Choice(times, [limb for *_, limb in columns], every)
        for share in choice.fewest():
            yield (done + len(columns) * share) / whole
        done += len(columns)
        for row, (plan, number, tracks, _) in enumerate(columns):
            plan.keyed[number] = choice.keyed[row]
            plan.corners[tracks] = choice.corners[row].T


def _alone(times: Floats, track: Track) -> BezierKeys:
    """The only key of a single frame."""
    values = track.values[:1]
    point = np.stack(np.broadcast_arrays(times[:, None], values), axis=-1).astype(np.float32)
    return BezierKeys(
        frames=times.astype(np.float32),
        values=values.astype(np.float32),
        left=point - np.array((1.0, 0.0), dtype=np.float32),
        right=point + np.array((1.0, 0.0), dtype=np.float32),
        smooth=np.zeros(1, dtype=bool),
    )
