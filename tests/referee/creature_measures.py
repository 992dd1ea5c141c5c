# SPDX-License-Identifier: GPL-3.0-or-later
"""What an animator sees go wrong in a creature's motion, measured on what is played.

Lengths are in arm lengths, angles in degrees, of the world. Nothing here knows gaits, footholds or
solvers: what rests is told by that it lies on the ground and is not carried along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from mathutils.bvhtree import BVHTree

from .recording import Flags, Floats, Integers, Recording, Skin
from .surface import Surface

NEAR = 0.012
"""Arm lengths over the ground: skin that is nearer lies on it."""
TOUCHES = 0.002
"""Arm lengths over the ground: skin that is nearer touches it."""
_SOME = 4
"""Of so many vertices one is followed."""
LONG = 0.3
"""Seconds: what lies for less is passing by."""
CARRIED = 0.5
"""Share of the body's speed: what is faster is taken along, not resting."""
CREEPING = 0.1
"""Arm lengths a second: in place, what is slower rests."""
STILL = 0.0072
"""Arm lengths a second: ends of a bone that go slower hold still."""
VISIBLE = 0.005
"""Arm lengths: what is deeper in the ground is seen to be."""
_JUMP = 6.0
"""Degrees."""
SUDDEN = 5.0
"""Times the turn of the frame before …"""
MUCH = 15.0
"""… and degrees: together a start that an eye takes for a jerk."""
TREMOR = 4.0
"""Hertz: what is faster is no swing of an arm."""
_TINY = 1e-9
"""Metres: an edge of no length has no stretch."""
_FEW = 40
"""Edges: a bone that has fewer says little of the skin."""


@dataclass(frozen=True)
class Worst:
    """The largest of something, and where to look at it."""

    value: float
    frame: float
    name: str = ""

    @classmethod
    def of(cls, values: Floats, frames: Floats, names: Sequence[str]) -> Worst:
        """Of (moments, names)."""
        if values.size == 0:
            return cls(0.0, float(frames[0]) if len(frames) else 0.0)
        # What is no number is the worst of all.
        values = np.nan_to_num(values, nan=np.inf)
        row, column = np.unravel_index(np.argmax(values), values.shape)
        return cls(float(values[row, column]), float(frames[row]), names[int(column)])


def angles_between(first: Floats, second: Floats) -> Floats:
    """Degrees between orientations (…, 3, 3)."""
    # The chord between them: exact for small angles too, where a cosine is not.
    chord = np.linalg.norm(first - second, axis=(-2, -1))
    return np.degrees(2.0 * np.arcsin(np.clip(chord / (2.0 * np.sqrt(2.0)), 0.0, 1.0)))


def arm_length(recording: Recording, arms: Sequence[Sequence[str]]) -> float:
    """Metres of the longest arm, at the first moment."""
    return max(
        float(np.linalg.norm(recording.tails[0, rows] - recording.heads[0, rows], axis=-1).sum())
        for rows in (recording.chain(arm) for arm in arms)
    )


def turns(recording: Recording) -> Worst:
    """How far a bone turns in the world from one frame to the next: over 60° it has flipped."""
    values = angles_between(recording.turns[1:], recording.turns[:-1])
    return Worst.of(values, recording.frames[1:], recording.names)


def sudden_starts(recording: Recording) -> int:
    """How often a bone goes off all at once: the jerk of a marionette whose string was plucked."""
    values = angles_between(recording.turns[1:], recording.turns[:-1])
    return int(np.sum((values[1:] > SUDDEN * values[:-1]) & (values[1:] > MUCH)))


def jumps(recording: Recording) -> int:
    """How often a bone turns by more than 6° in a single frame amid others in which it does not
    turn by a quarter of that: it trembles between two poses.
    """
    values = angles_between(recording.turns[1:], recording.turns[:-1])
    beside = np.maximum(np.maximum(values[:-2], values[2:]), 1.0)
    return int(np.sum((values[1:-1] > _JUMP) & (values[1:-1] > 4.0 * beside)))


def pop(largest: Sequence[float]) -> float:
    """By how much the largest turn of a frame fails to halve as the frame rate doubles.

    1 is smooth: twice the frames, half the turn. 2 is a jump that no frame rate makes smaller.

    Args:
        largest: turns at a frame rate, at twice that, at four times …
    """
    return max(2.0 * after / before for before, after in pairwise(largest))


@dataclass(frozen=True)
class Resting:
    """How still that is which rests on the ground."""

    slip: Worst
    """Arm lengths in a frame: a foot that slides on ice."""
    drift: Worst
    """Arm lengths over one hold: a foot that creeps, too slow to be caught in a frame."""
    share: float
    """Of the arms' bones and moments how many rest."""


def resting(
    recording: Recording, arms: Sequence[Sequence[str]], surface: Surface, length: float
) -> Resting:
    """Slip and drift of whatever lies on the ground.

    A bone rests while its skin, and that of the bones before and after it, lies on the ground, and
    it is not carried along with the body. The ends of a hold are left out, where skin rolls on and
    off.

    Args:
        recording: one moment a frame.
        arms: bones from root to tip.
        surface: the ground.
        length: of an arm, metres.
    """
    rows = np.concatenate([recording.chain(arm) for arm in arms])
    gaps = _gaps(recording, rows, surface, NEAR * length)
    middles = recording.middles[:, rows]
    seconds = 1.0 / recording.fps
    steps = np.linalg.norm(np.diff(middles, axis=0), axis=-1)
    body = np.linalg.norm(np.diff(recording.heads[:, _root(recording)], axis=0), axis=-1)
    slow = np.maximum(CARRIED * body, CREEPING * length * seconds)[:, None]
    # Of a step both ends count.
    moved = np.pad(steps > slow, ((1, 0), (0, 0))) | np.pad(steps > slow, ((0, 1), (0, 0)))
    lying = gaps < NEAR * length
    offset = 0
    rests = np.zeros_like(lying)
    for arm in arms:
        part = slice(offset, offset + len(arm))
        beside = np.pad(lying[:, part], ((0, 0), (1, 1)), constant_values=True)
        rests[:, part] = beside[:, :-2] & beside[:, 1:-1] & beside[:, 2:] & ~moved[:, part]
        offset += len(arm)
    names = [recording.names[row] for row in rows]
    slip, drift = Worst(0.0, recording.frames[0]), Worst(0.0, recording.frames[0])
    counted = 0
    for column, name in enumerate(names):
        for first, last in _runs(rests[:, column]):
            if (last - first) * seconds < LONG:
                continue
            inside = slice(first + 1, last - 1)
            path = middles[inside, column] / length
            counted += last - first
            pace = np.linalg.norm(np.diff(path, axis=0), axis=-1)
            if pace.size and pace.max() > slip.value:
                frame = recording.frames[inside][int(np.argmax(pace)) + 1]
                slip = Worst(float(pace.max()), float(frame), name)
            away = np.linalg.norm(path - path[len(path) // 2], axis=-1)
            if away.max() > drift.value:
                frame = recording.frames[inside][int(np.argmax(away))]
                drift = Worst(float(away.max()), float(frame), name)
    return Resting(slip, drift, counted / rests.size)


def creeping(recording: Recording, surface: Surface, length: float) -> Worst:
    """How far skin that touches the ground slides along it in one hold, in arm lengths.

    Vertex by vertex, one of a few, webs left out: what peels off touches no more, and does not
    count. Otherwise as :func:`resting` has it.
    """
    seconds = 1.0 / recording.fps
    body = np.linalg.norm(np.diff(recording.heads[:, _root(recording)], axis=0), axis=-1)
    slow = np.maximum(CARRIED * body, CREEPING * length * seconds)[:, None]
    worst = Worst(0.0, recording.frames[0])
    for skin in recording.skins:
        near = surface.near(skin.points[:, ::_SOME], TOUCHES * length) & ~skin.web[::_SOME]
        picked = near.any(axis=0)
        near, bones = near[:, picked], skin.bones[::_SOME][picked]
        points = skin.points[:, ::_SOME][:, picked].astype(float)
        below = points.copy()
        below[near, 2] = surface.heights(points[near])
        touches = near & (points[..., 2] - below[..., 2] < TOUCHES * length)
        moved = np.linalg.norm(np.diff(points, axis=0), axis=-1) > slow
        touches &= ~(np.pad(moved, ((1, 0), (0, 0))) | np.pad(moved, ((0, 1), (0, 0))))
        for column in np.flatnonzero(touches.any(axis=0)).tolist():
            for first, last in _runs(touches[:, column]):
                if (last - first) * seconds < LONG:
                    continue
                path = below[first + 1 : last - 1, column] / length
                away = np.linalg.norm(path - path[len(path) // 2], axis=-1)
                if away.max() > worst.value:
                    frame = recording.frames[first + 1 + int(np.argmax(away))]
                    name = recording.names[bones[column]] if bones[column] >= 0 else ""
                    worst = Worst(float(away.max()), float(frame), name)
    return worst


def rolling(
    recording: Recording, arms: Sequence[Sequence[str]], length: float
) -> tuple[Worst, float]:
    """By how much bones turn, in degrees, while both of their ends keep still: suckers that slide
    sideways under an arm which holds on. The worst hold, and the mean of all.

    Args:
        recording: one moment a frame.
        arms: bones from root to tip.
        length: of an arm, metres.
    """
    still = STILL * length / recording.fps
    worst, found = Worst(0.0, recording.frames[0]), [0.0]
    for row in np.concatenate([recording.chain(arm) for arm in arms]):
        ends = np.stack([recording.heads[:, row], recording.tails[:, row]])
        steps = np.linalg.norm(np.diff(ends, axis=1), axis=-1).max(axis=0)
        for first, last in _runs(steps < still):
            if last - first < LONG * recording.fps:
                continue
            turns = recording.turns[first : last + 1, row]
            middle = np.broadcast_to(turns[len(turns) // 2], turns.shape)
            away = angles_between(turns, middle)
            found.append(float(away.max()))
            if away.max() > worst.value:
                frame = recording.frames[first + int(np.argmax(away))]
                worst = Worst(float(away.max()), float(frame), recording.names[row])
    return worst, float(np.mean(found))


def _root(recording: Recording) -> int:
    return int(np.flatnonzero(recording.parents < 0)[0])


def _runs(flags: Flags) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.pad(flags.astype(int), 1)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _gaps(recording: Recording, rows: Integers, surface: Surface, height: float) -> Floats:
    """(moments, rows) how high each bone's lowest skin is over the ground, inf from ``height``."""
    gaps = np.full((len(recording.frames), len(rows)), np.inf)
    covered = np.zeros(len(rows), bool)
    for skin in recording.skins:
        for column, row in enumerate(rows):
            # A web that touches the ground is no arm that rests.
            points = skin.points[:, (skin.bones == row) & ~skin.web]
            covered[column] |= points.shape[1] > 0
            over = np.full(points.shape[:-1], np.inf)
            some = surface.near(points, height)
            over[some] = points[some][:, 2] - surface.heights(points[some])
            gaps[:, column] = np.minimum(gaps[:, column], over.min(axis=1, initial=np.inf))
    bare = ~covered
    points = recording.middles[:, rows[bare]]
    gaps[:, bare] = points[..., 2] - surface.heights(points)
    return gaps


@dataclass(frozen=True)
class Sink:
    """How far a creature is in the ground."""

    deepest: Worst
    """Arm lengths."""
    share: float
    """Of the frames how many show it."""


def sink(recording: Recording, surface: Surface, length: float) -> Sink:
    """Skin below the ground: feet without toes, arms cut off by a stair."""
    deepest = np.zeros((len(recording.frames), len(recording.names) + 1))
    for skin in recording.skins:
        depths = surface.depths(skin.points) / length
        for bone in np.unique(skin.bones):
            found = depths[:, skin.bones == bone].max(axis=1)
            deepest[:, bone] = np.maximum(deepest[:, bone], found)
    worst = Worst.of(deepest, recording.frames, [*recording.names, "no bone"])
    return Sink(worst, float(np.mean(deepest.max(axis=1) > VISIBLE)))


@dataclass(frozen=True)
class Passing:
    """How often skin goes through skin."""

    share: float
    """Of the moments looked at."""
    most: Worst
    """Pairs of faces at once."""


def skin_through_skin(
    recording: Recording, arms: Sequence[Sequence[str]], every: int = 6, *, webs: bool = False
) -> Passing:
    """Arms that pass through each other or through the body, as faces that cut each other.

    Faces that cut at rest are modelled so and do not count; nor do those of one arm, whose inside
    folds where it bends; nor, unless that is asked for, those of webs between arms.
    """
    limb = np.full(len(recording.names) + 1, -1)
    for number, arm in enumerate(arms):
        limb[recording.chain(arm)] = number
    picked = range(0, len(recording.frames), every)
    counts = np.zeros((len(picked), 1))
    where = [""]
    for skin in recording.skins:
        if not webs and skin.web.any():
            kept = [face for face in skin.faces if not skin.web[list(face)].any()]
            skin = replace(skin, faces=kept)  # noqa: PLW2901 - the same skin, less of it
        owners = np.array([limb[_majority(skin, face)] for face in skin.faces])
        built_so = _cuts(skin, skin.rest, owners)
        for place, moment in enumerate(picked):
            counts[place] += len(_cuts(skin, skin.points[moment], owners) - built_so)
    worst = Worst.of(counts, recording.frames[list(picked)], where)
    return Passing(float(np.mean(counts > 0)), worst)


def _majority(skin: Skin, face: tuple[int, ...]) -> int:
    return int(np.bincount(skin.bones[list(face)] + 1).argmax()) - 1


def _cuts(skin: Skin, points: Floats, owners: Integers) -> set[tuple[int, int]]:
    tree = BVHTree.FromPolygons(points.tolist(), skin.faces)
    pairs = tree.overlap(tree)
    assert pairs is not None
    found = np.array(pairs, dtype=np.intp).reshape(-1, 2)
    found = found[found[:, 0] < found[:, 1]]
    found = found[owners[found[:, 0]] != owners[found[:, 1]]]
    faces = skin.faces
    return {(i, j) for i, j in found.tolist() if not set(faces[i]) & set(faces[j])}


def stretch(recording: Recording, every: int = 4) -> Worst:
    """How much longer the skin gets than at rest: skin that tears, or is drawn thin.

    Of a bone's edges the longest twentieth counts as drawn: a single edge in a fold does not show.
    """
    worst = Worst(1.0, float(recording.frames[0]))
    for skin in recording.skins:
        first, second = skin.edges.T
        rest = np.linalg.norm(skin.rest[first] - skin.rest[second], axis=-1)
        some = rest > _TINY
        first, second, rest = first[some], second[some], rest[some]
        points = skin.points[::every]
        shares = np.linalg.norm(points[:, first] - points[:, second], axis=-1) / rest
        # The body's own scale, which is no stretch, is that of the usual edge.
        shares /= np.median(shares)
        owners = skin.bones[first]
        bones = [bone for bone in np.unique(owners) if bone >= 0 and (owners == bone).sum() >= _FEW]
        drawn = [np.quantile(shares[:, owners == bone], 0.95, axis=1) for bone in bones]
        names = [recording.names[bone] for bone in bones]
        found = Worst.of(np.array(drawn).T, recording.frames[::every], names)
        worst = max(worst, found, key=lambda each: each.value)
    return worst


def jitter(recording: Recording, arms: Sequence[Sequence[str]]) -> Worst:
    """Share of the tips' velocity that is faster than an arm swings: hands that shake.

    As power above 4 Hz in all, of the velocity without what is steady.
    """
    tips = np.array([recording.chain(arm)[-1] for arm in arms])
    velocity = np.diff(recording.tails[:, tips], axis=0) * recording.fps
    velocity = velocity - velocity.mean(axis=0)
    window = np.hanning(len(velocity))[:, None, None]
    power = np.sum(np.abs(np.fft.rfft(velocity * window, axis=0)) ** 2, axis=-1)
    rates = np.fft.rfftfreq(len(velocity), 1.0 / recording.fps)
    total = power.sum(axis=0)
    shares = np.where(total > 0.0, power[rates > TREMOR].sum(axis=0) / np.maximum(total, 1e-300), 0)
    number = int(np.argmax(shares))
    return Worst(float(shares[number]), float(recording.frames[0]), recording.names[tips[number]])
