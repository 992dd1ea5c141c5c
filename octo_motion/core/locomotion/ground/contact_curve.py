# SPDX-License-Identifier: GPL-3.0-or-later
"""How an arm lies on the ground, joint by joint: along it, over crests, up and down steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats
from .stance_settings import Limbs
from .surface import Ground

_ROUNDS: Final = 4
"""How often it is looked at how far level a segment leads, where the ground rises or falls."""
_APART: Final = 0.02
"""Share of its length by which a segment may still be too long or too short then …"""
_HALVINGS: Final = 14
"""… or else it stands before a step, which is found by halving so often."""
_STEEPEST: Final = 2.0
"""Slope up to which a joint on it is the higher: steeper ground is a step, and ends."""


def laid(
    limbs: Limbs,
    ground: Ground,
    joint: int,
    *,
    skins: Floats,
    spot: Floats,
    heading: Floats,
    curl: Floats,
) -> Floats:
    """Joints from one on (arms, cycles, joints, 3) on the ground, segments as long as they are.

    Args:
        limbs: the arms.
        ground: what they lie on.
        joint: the one that touches first.
        skins: (arms, cycles, joints) metres from each of them to the skin below it.
        spot: (arms, cycles, 3) where; its height is not looked at.
        heading: (arms, cycles) which way they lie, radians about world Z from +X.
        curl: (arms, cycles) radians by which they are bent to one side on the way to the tip.
    """
    lengths = limbs.lengths[joint:]
    span = np.maximum(lengths.sum(axis=0), 1e-12)
    place = spot.copy()
    first = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    place[..., 2] = _resting(ground, spot, skins[..., 0], lengths[0][:, None], first)
    joints, passed = [place], np.zeros(heading.shape[:1])
    for number, length in enumerate(lengths):
        middle = (passed + 0.5 * length) / span
        # More and more to one side: an arm that lies slack ends in a curl.
        turn = heading + curl * (middle * middle)[:, None] * 2.0
        onward = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        bones = lengths[number : number + 2].max(axis=0)[:, None]
        way = _Way(ground, place, onward, skins[..., number + 1], bones)
        whole = np.broadcast_to(length[:, None], heading.shape)
        step, rise = _along(way, whole)
        place = place + np.concatenate([step[..., None] * onward, rise[..., None]], axis=-1)
        joints.append(place)
        passed = passed + length
    return np.stack(joints, axis=2)


@dataclass(frozen=True, eq=False)
class _Way:
    """Ways straight ahead over the ground."""

    ground: Ground
    place: Floats
    """(…, 3) where they begin."""
    onward: Floats
    """(…, 2) unit."""
    skin: Floats
    """(…,) metres from a joint to the skin below it."""
    bones: Floats
    """(…,) metres that the bones at it are long."""

    def rise(self, step: Floats) -> Floats:
        """How much higher (…,) than where it begins a joint lies so far (…,) ahead."""
        level = self.place[..., :2] + step[..., None] * self.onward
        height = _resting(self.ground, level, self.skin, self.bones, self.onward)
        return height - self.place[..., 2]

    def part(self, chosen: np.ndarray) -> _Way:
        """Some of them (n,)."""
        bones = np.broadcast_to(self.bones, chosen.shape)[chosen]
        return _Way(self.ground, self.place[chosen], self.onward[chosen], self.skin[chosen], bones)


def _along(way: _Way, length: Floats) -> tuple[Floats, Floats]:
    """How far a segment (…,) leads level, and how much up, both (…,) metres."""
    step, rise = length, np.zeros(length.shape)
    for _ in range(_ROUNDS):
        rise = way.rise(step)
        step = step * length / np.sqrt(step * step + rise * rise)
    factor = length / np.sqrt(step * step + rise * rise)
    step, rise = step * factor, rise * factor
    there = way.rise(step)
    apart = np.abs(np.sqrt(step * step + there * there) - length) > _APART * length
    if np.any(apart):
        step[apart], rise[apart] = _at_a_step(way.part(apart), length[apart])
    return step, rise


def _at_a_step(way: _Way, length: Floats) -> tuple[Floats, Floats]:
    """The same (n,) where the ground rises or falls by more than a segment is long.

    It leads up the step, or hangs down it: on its lower side either way.
    """
    low, high = np.zeros(length.shape), length.copy()
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        rise = way.rise(middle)
        over = middle * middle + rise * rise > length * length
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    falls = way.rise(high) < 0.0
    step = np.where(falls, high, low)
    rise = np.sqrt(np.maximum(length * length - step * step, 0.0))
    return step, np.where(falls, -rise, rise)


def _resting(
    ground: Ground, points: Floats, radius: Floats, bones: Floats, ahead: Floats
) -> Floats:
    """Height (…,) of a joint such that the skin of the bones at it lies on the ground.

    Between its ends a bone is straight. Over a crest both are higher, by what it would cut off.

    Args:
        ground: what it lies on.
        points: (…, 2 or 3) where the joint is.
        radius: (…,) metres from it to the skin below.
        bones: (…,) metres that these bones are long.
        ahead: (…, 2) unit: which way they lie.
    """
    points = points[..., :2]
    slope = ground.slope(points)
    steep = np.minimum(np.sum(slope * slope, axis=-1), _STEEPEST**2)
    height = ground.height(points)
    half = 0.5 * bones[..., None] * ahead
    chord = 0.5 * (ground.height(points + half) + ground.height(points - half))
    return height + np.maximum(height - chord, 0.0) + radius * np.sqrt(1.0 + steep)
