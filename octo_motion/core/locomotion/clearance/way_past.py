# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that reach, led past the other arms, the body and the ground.

An arm that reaches crosses others, which stand or walk: it goes over them. Each frame is by itself.
Where the arm is too near to something, its joints are asked to move away from it and up, by as much
as it is too near; then the arm gives way as an elastic rod does, all its segments turning as little
and as evenly as it takes (``turned_towards``). What it holds stays where it is. All that is asked
is a smooth function of where arms are; but a little that is asked again and again can be a lot.
Where an arm would be flung aside, it goes rather through what it meets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...content_cache import part_of
from ...rotations import Floats
from ...rotations.components_first import dot
from ...smoothing import blurred, covered, smooth_step
from ...steps import finished
from ..ground import drawn
from .capsule_overlap import Capsules, Crowd, Touches, Touching
from .overlap_solver import Floor, joints_of, turned_towards, unit

_ROUNDS: Final = 32
_GAIN: Final = 2.0
"""How much more is asked than there is: what is asked for is spread over the frames around."""
_ROOM: Final = 0.1
"""Share of the sum of the radii that is to be between them."""
_BELIEVED: Final = 4.0
"""How soon a depth, as a share of that, says that an arm has to go over the other."""
_BLUNT: Final = 0.05
"""So that nobody is sent a way that is nowhere certain."""
_PINNED: Final = 30.0
"""How much more the place where an arm holds on counts than that it makes way."""
_STEPS: Final = 6
"""Newton's steps that draw an arm back to where it holds."""
_SOFT: Final = 0.1
"""Share of a radius within which it begins gently to matter what is asked."""
_TAKEN_BACK: Final = 8
"""How often it is looked whether an arm is flung aside still."""
_LEAST_BACK: Final = 0.3
"""Share of the way aside that is taken back at least where it is."""
_TINY: Final = 1e-12


@dataclass(frozen=True)
class Haste:
    """How fast arms may be led."""

    most: float
    """Radians that a bone may turn in a frame, if it does not anyway, while the arm holds
    something; twice that while it does not, for there it is given time."""
    gently: int
    """Width of the means over frames (``smoothing.covered``) by which they are led less."""


@dataclass(frozen=True, eq=False)
class Passing:
    """Which arms reach."""

    share: Floats
    """(frames, arms) how far they may be led another way, past the others and the body, 0…1, …"""
    above: Floats
    """… and how far over the ground."""
    holds: Floats
    """(frames, arms) how far they hold something, 0…1."""
    anchors: np.ndarray
    """(frames, arms) from which joint on."""


def led_past(
    crowd: Crowd,
    body: Sequence[Capsules],
    passing: Passing,
    floor: Floor | None,
    *,
    width: int,
    haste: Haste,
) -> Floats | None:
    """Joints (frames, arms, joints, 3) where arms that reach keep clear; none if all do anyway.

    Parts of the body have one frame, or one for each of the arms'; ``width`` is that of the means
    over frames of what is asked (``smoothing.blurred``).
    """
    items = np.nonzero((passing.share > 0.0) | (passing.above > 0.0))
    if not len(items[0]):
        return None
    touching = Touching(crowd, body)
    watched = (passing.share > 0.0).any(axis=1)
    finished(touching.looking_at(watched, np.zeros(0, dtype=np.intp)))
    rod = _Rods.of(crowd, passing, items)
    joints = crowd.joints.copy()

    def led(*, others: bool) -> bool:
        """Whether anybody had to make way, for the others too or for the ground alone."""
        for number in range(_ROUNDS):
            wanted, weights = np.zeros(joints.shape), np.zeros(joints.shape[:3])
            if others:
                wanted, weights = _wanted(crowd, touching.at(joints), passing)
                wanted *= passing.share[..., None, None]
            if floor is not None:
                goals, matters = wanted[items], weights[items]
                height = floor.clearance(items[0], joints[items])
                lacking = np.maximum(crowd.radii[items[1]] - height, 0.0)
                lacking *= passing.above[items][:, None]
                _rise(crowd.radii[items[1]], lacking, goals, matters, crowd.up[items[0]])
                wanted[items], weights[items] = goals, matters
            if not np.any(wanted):
                return number > 0
            goals, matters = (_GAIN * blurred(each, width)[items] for each in (wanted, weights))
            joints[items] = rod.bent(goals[:, 1:], np.minimum(matters[:, 1:], 1.0))
        return True

    if not led(others=True):
        return None
    back = _taken_back(crowd.joints, joints, passing, haste)
    if back.any():
        joints[items] = rod.taken_back(back[items])
        led(others=False)
    return joints


def _taken_back(before: Floats, after: Floats, passing: Passing, haste: Haste) -> Floats:
    """How far (frames, arms) arms are to go where they did before, joints (frames, arms, joints,
    3), and not where they are led, so that none is flung there, 0…1.
    """
    before, after = _directions(before), _directions(after)
    most = haste.most * (2.0 - np.maximum(passing.holds[1:], passing.holds[:-1]))
    limits = np.maximum(_turned(before), most)
    back, led = np.zeros(passing.share.shape), after
    for _ in range(_TAKEN_BACK):
        flung = np.minimum(_turned(led) / limits - 1.0, 1.0)
        if not np.any(flung > 0.0):
            break
        flung = np.where(flung > 0.0, _LEAST_BACK + (1.0 - _LEAST_BACK) * flung, 0.0)
        wanted = np.zeros_like(back)
        wanted[1:] = flung
        wanted[:-1] = np.maximum(wanted[:-1], flung)
        back += (1.0 - back) * covered(wanted, haste.gently)
        led = unit(after + back[..., None, None] * (before - after))
    return back


def _turned(directions: Floats) -> Floats:
    """Radians (frames − 1, arms) that the segment turns that turns most, from directions (frames,
    arms, segments, 3).
    """
    steps = np.linalg.norm(directions[1:] - directions[:-1], axis=-1).max(axis=-1)
    return 2.0 * np.arcsin(np.minimum(0.5 * steps, 1.0))


def _directions(joints: Floats) -> Floats:
    return unit(np.diff(joints, axis=-2))


@dataclass(eq=False)
class _Rods:
    """Arms (items) that give way."""

    roots: Floats
    """(items, 3)"""
    lengths: Floats
    """(items, segments)"""
    before: Floats
    """(items, segments, 3) unit, as they were …"""
    directions: Floats
    """… and as they are."""
    free: Floats
    """(items, segments) 0…1."""
    holds: Floats
    """(items,) 0…1."""
    anchor: np.ndarray
    """(items,) number of the joint from which on they hold."""
    places: Floats
    """(items, 3) of that joint, where it is to be."""

    @classmethod
    def of(cls, crowd: Crowd, passing: Passing, items: tuple[np.ndarray, ...]) -> _Rods:
        """The arms of a crowd at some frames."""
        joints = crowd.joints[items]
        lengths = np.linalg.norm(np.diff(joints, axis=1), axis=2)
        # Ways from 0 to 1 may be beyond in the last digit.
        anchor, holds = passing.anchors[items], np.clip(passing.holds[items], 0.0, 1.0)
        beyond = np.arange(lengths.shape[1]) >= anchor[:, None]
        directions = _directions(joints)
        return cls(
            joints[:, 0],
            lengths,
            directions,
            directions,
            1.0 - beyond * holds[:, None],
            holds,
            anchor,
            joints[np.arange(len(joints)), anchor],
        )

    def bent(self, goals: Floats, weights: Floats) -> Floats:
        """Joints (items, segments + 1, 3) after they gave way to goals (items, segments, 3) of all
        joints but the first.
        """
        count = self.lengths.shape[1]
        pinned = self.holds[:, None] * (np.arange(1, count + 1) >= self.anchor[:, None])
        self.directions = turned_towards(
            self.directions,
            self.lengths,
            free=self.free,
            goals=goals * (1.0 - pinned)[..., None],
            weights=weights * (1.0 - pinned) + _PINNED * pinned,
        )
        self._draw_back()
        return joints_of(self.roots, self.directions, self.lengths)

    def taken_back(self, share: Floats) -> Floats:
        """Joints (items, segments + 1, 3) as they were by some share (items,)."""
        way = self.before - self.directions
        self.directions = unit(self.directions + share[:, None, None] * way)
        self._draw_back()
        return joints_of(self.roots, self.directions, self.lengths)

    def _draw_back(self) -> None:
        """Let those that hold something hold it where they did."""
        some = np.flatnonzero(self.holds > 0.0)
        if not len(some):
            return
        directions, lengths, anchor = self.directions[some], self.lengths[some], self.anchor[some]
        rows = np.arange(len(some))
        now = joints_of(self.roots[some], directions, lengths)[rows, anchor]
        goal = now + self.holds[some, None] * (self.places[some] - now)
        inside = np.arange(lengths.shape[1]) < anchor[:, None]
        back = drawn(
            np.ascontiguousarray(np.moveaxis(directions, 0, -1)),
            np.ascontiguousarray(lengths.T),
            free=np.ascontiguousarray(self.free[some].T),
            chosen=np.ascontiguousarray(inside.T.astype(np.float64)),
            roots=np.ascontiguousarray(self.roots[some].T),
            goal=np.ascontiguousarray(goal.T),
            steps=_STEPS,
        )
        self.directions[some] = unit(np.moveaxis(back, -1, 0))


def _wanted(crowd: Crowd, touches: Touches, passing: Passing) -> tuple[Floats, Floats]:
    """By how much joints (frames, arms, joints, 3) of arms that reach would have to move, and how
    much that matters (frames, arms, joints).
    """
    frames, arms, count = crowd.joints.shape[:3]
    size = frames * arms * count
    sums, weight = np.zeros((3, size)), np.zeros(size)
    soft = _SOFT * float(crowd.radii.mean())
    away = crowd.at_rest[:, 1] - crowd.at_rest[:, 0].mean(axis=0)
    away -= (away @ crowd.upward)[:, None] * crowd.upward
    away = (away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), _TINY)).T
    for which in (0, 1):
        arm = np.minimum(touches.arms[which], arms - 1)
        own = (touches.arms[which] < arms) & (passing.share[touches.frame, arm] > 0.0)
        near = touches.distance < (1.0 + _ROOM) * touches.wide
        some = np.flatnonzero(own & near)
        frame, arm = touches.frame[some], arm[some]
        body = touches.arms[1 - which][some] >= arms
        outward = np.where(body, away[:, arm], crowd.upward[:, None])
        push = _over(part_of(touches, some), 1.0 - 2.0 * which, outward)
        far = np.sqrt(dot(push, push))
        first = (frame * arms + arm) * count + touches.segments[which][some]
        share = touches.shares[which][some]
        for joint, part in ((0, 1.0 - share), (1, share)):
            heavy = far * part
            weight += np.bincount(first + joint, heavy, size)
            for axis in range(3):
                sums[axis] += np.bincount(first + joint, heavy * push[axis], size)
    goals = (sums / (weight + soft)).T.reshape(frames, arms, count, 3)
    matters = weight / (weight + soft)
    return goals, matters.reshape(frames, arms, count)


def _over(touches: Touches, sign: Floats | float, outward: Floats) -> Floats:
    """By how much (3, touches) an arm is to go past another, or past the body.

    The arm is the first of the two with a sign of 1, the second with −1. Where they only just touch
    it gives way straight; the deeper they are in each other, the more it goes to where it belongs:
    ``outward`` (3, touches).
    """
    gap, wide = sign * touches.gap, touches.wide * (1.0 + _ROOM)
    deep = np.maximum(1.0 - touches.distance / wide, 0.0)
    way = gap / wide + smooth_step(_BELIEVED * deep) * outward
    size = np.sqrt(dot(way, way) + _BLUNT * deep)
    return wide * deep * way / np.maximum(size, _TINY)


def _rise(radii: Floats, lacking: Floats, goals: Floats, weights: Floats, up: Floats) -> None:
    """Ask joints (items, joints) to rise (items, 3) by what is lacking, in place."""
    goals += lacking[..., None] * up[:, None]
    weights += lacking / (lacking + _SOFT * radii)
