# SPDX-License-Identifier: GPL-3.0-or-later
"""Where bones are at any time: smooth through the frames that were read, and beyond them.

Between frames places and rotations are cubic, with slopes from five frames: errors fall with the
fourth power of the time between two frames, so that an action that was read at 24 frames a second
leads as one at 60 does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rotations import (
    Floats,
    angle_between,
    conjugate,
    continuous,
    multiply,
    normalized,
    rotate,
    to_rotation_vector,
)

_AROUND = 2
"""Frames on either side that a slope is made of."""
_ALIKE = 0.01
"""Of a body's size, how far its bones may be from where they began …"""
_ALIKE_TURN = np.radians(1.0)
"""… and turned from how they were, in a motion that repeats; and by how much more than ever their
turn from frame to frame may change."""


@dataclass(frozen=True, eq=False)
class BoneMotion:
    """Bones at frames that are equally far apart in time."""

    rate: float
    """Frames per second."""
    positions: Floats
    """(frames, bones, 3) of their heads, world."""
    orientations: Floats
    """(frames, bones, 4), world."""

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def seconds(self) -> float:
        """From the first frame to the last."""
        return (len(self) - 1) / self.rate

    def of(self, bones: list[int]) -> BoneMotion:
        """Some bones alone."""
        return BoneMotion(self.rate, self.positions[:, bones], self.orientations[:, bones])


@dataclass(frozen=True, eq=False)
class Displacement:
    """Where a cycle leads: what was at a place is, a round later, turned and shifted so."""

    turn: Floats
    """(4,)"""
    shift: Floats
    """(3,)"""

    def after(self, rounds: int) -> Displacement:
        """Of so many rounds."""
        turn, shift = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        for _ in range(rounds):
            turn, shift = multiply(self.turn, turn), rotate(self.turn, shift) + self.shift
        return Displacement(turn, shift)

    def back(self) -> Displacement:
        """The other way."""
        turn = conjugate(self.turn)
        return Displacement(turn, -rotate(turn, self.shift))

    def of(self, motion: BoneMotion) -> BoneMotion:
        """A motion that is turned and shifted."""
        return BoneMotion(
            motion.rate,
            rotate(self.turn, motion.positions) + self.shift,
            multiply(self.turn, motion.orientations),
        )


def displacement(motion: BoneMotion, bone: int) -> Displacement:
    """By how much a bone of a cycle is elsewhere at its last frame."""
    turn = multiply(motion.orientations[-1, bone], conjugate(motion.orientations[0, bone]))
    shift = motion.positions[-1, bone] - rotate(turn, motion.positions[0, bone])
    return Displacement(normalized(turn), shift)


def repeats(motion: BoneMotion, cycle: Displacement) -> bool:
    """Whether a motion ends as it begins, in pose and in speed, here or elsewhere.

    Files of clips do not say which of them are loops, and loops are what most of them are. What has
    turned meanwhile is none: a body that only rocks to and fro is alike at any time.
    """
    turned = angle_between(cycle.turn, np.array([1.0, 0.0, 0.0, 0.0]))
    if len(motion) <= _AROUND or turned > _ALIKE_TURN:
        return False
    # A single bone has no size: then what is lost in rounding is no reason.
    size = np.ptp(motion.positions[0], axis=0).max() + 1e-6 * np.abs(motion.positions).max()
    again = cycle.of(_rows(motion, np.array([0, 1])))
    off = np.linalg.norm(again.positions[0] - motion.positions[-1], axis=-1)
    turned = angle_between(again.orientations[0], motion.orientations[-1])
    if off.max() > _ALIKE * size or turned.max() > _ALIKE_TURN:
        return False
    # One more step, of the next round: at the seam speeds change no more than elsewhere.
    turns = np.concatenate([motion.orientations, again.orientations[1:]])
    speeds = to_rotation_vector(multiply(turns[1:], conjugate(turns[:-1])))
    changes = np.linalg.norm(np.diff(speeds, axis=0), axis=-1)
    return bool((changes[-1] <= _ALIKE_TURN + changes[:-1].max(axis=0)).all())


class Sampler:
    """A motion at any time, seconds from its first frame."""

    def __init__(self, motion: BoneMotion, *, cycle: Displacement | None, still: bool) -> None:
        """Of a cycle, by where it leads. Else, before its first frame it is held ``still``, or goes
        on as if seen in a mirror there: as fast, from where it would have come.
        """
        self.motion, self._cycle, self._still = motion, cycle, still
        self._rounds: dict[int, Displacement] = {}
        reach = len(motion) - 1
        if cycle is not None:
            before = cycle.back().of(_rows(motion, np.arange(reach - _AROUND, reach) % reach))
            after = cycle.of(_rows(motion, 1 + np.arange(_AROUND) % reach))
            self._first = _AROUND
        else:
            # As far back as anyone can ask for, in frames: what is beyond is held.
            self._first = max(reach, 0) + _AROUND
            away = np.minimum(np.arange(self._first, 0, -1), reach)
            before = _held(motion, 0, self._first) if still else _mirrored(motion, 0, away)
            away = np.minimum(1 + np.arange(_AROUND), reach)
            after = _mirrored(motion, reach, reach - away)
        self._places = np.concatenate([before.positions, motion.positions, after.positions])
        turns = np.concatenate([before.orientations, motion.orientations, after.orientations])
        self._turns = continuous(turns)

    def at(self, seconds: Floats) -> BoneMotion:
        """At ascending times (times,); of a cycle all within one round."""
        motion = self.motion
        frames = np.asarray(seconds, dtype=np.float64) * motion.rate
        lead = None
        if self._cycle is not None:
            length = len(motion) - 1
            whole = int(np.floor((0.5 * (frames[0] + frames[-1])) / length))
            frames = frames - whole * length
            if whole not in self._rounds:
                self._rounds[whole] = self._cycle.after(whole)
            lead = self._rounds[whole]
        if self._still and self._cycle is None:
            frames = np.maximum(frames, 0.0)
        places = frames + self._first
        last = len(self._places) - 1 - _AROUND
        number = np.clip(np.floor(places).astype(np.intp), _AROUND, max(last - 1, _AROUND))
        share: Floats = np.clip(places - number.astype(np.float64), 0.0, 1.0)
        found = BoneMotion(
            motion.rate,
            _cubic(self._places, number, share),
            normalized(_cubic(self._turns, number, share)),
        )
        return found if lead is None else lead.of(found)


def _cubic(values: Floats, number: np.ndarray, share: Floats) -> Floats:
    """Between rows number and number + 1 of values (rows, …), at shares (times,) of the way."""
    if len(values) < 2 * _AROUND + 2:
        return values[number]
    s = share.reshape(-1, *(1,) * (values.ndim - 1))
    first, second = values[number], values[number + 1]
    into, out = _slopes(values, number), _slopes(values, number + 1)
    t, r = s * s, 1.0 - s
    ends = first * (1.0 + 2.0 * s) * r * r + second * t * (3.0 - 2.0 * s)
    return ends + into * s * r * r - out * t * r


def _slopes(values: Floats, number: np.ndarray) -> Floats:
    """Per row, at rows that have two on either side."""
    near = values[number + 1] - values[number - 1]
    number = np.minimum(number, len(values) - 1 - _AROUND)
    far = values[number + 2] - values[number - 2]
    return (8.0 * near - far) / 12.0


def _rows(motion: BoneMotion, rows: np.ndarray) -> BoneMotion:
    return BoneMotion(motion.rate, motion.positions[rows], motion.orientations[rows])


def _held(motion: BoneMotion, row: int, count: int) -> BoneMotion:
    return _rows(motion, np.full(count, row))


def _mirrored(motion: BoneMotion, centre: int, rows: np.ndarray) -> BoneMotion:
    """Frames seen through one of them: where it would have come from, or gone to."""
    place, turn = motion.positions[centre], motion.orientations[centre]
    beyond = _rows(motion, rows)
    return BoneMotion(
        motion.rate,
        2.0 * place - beyond.positions,
        multiply(turn, multiply(conjugate(beyond.orientations), turn)),
    )
