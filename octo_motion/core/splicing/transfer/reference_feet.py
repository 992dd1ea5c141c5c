# SPDX-License-Identifier: GPL-3.0-or-later
"""How feet lie that stand flat and point straight ahead, from where ankles and balls are.

A foot is flat where both are as low as they ever are: whether it stands still does not count, for
on a treadmill none does. How steeply a foot falls from ankle to ball is its body's, the same on
both sides: the foot that stands more often tells it for the other one too.

Up is square to the ground, and that is told by the way of the feet, for runners lean. Where nobody
goes anywhere, it is as the body stands. So whichever way the whole lies in its file does not count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, dot, from_matrix, multiply, normalized, rotate
from ...smoothing import smooth_step
from ..clip import robust_direction

_LOW: Final = 0.01
"""Heights of the neck above its lowest at which a point says half as much of the ground."""

_FLOOR: Final = 0.05
"""Of all moments: for how many a point may be lower than where it stands."""

_FAR: Final = 0.2
"""Heights of the neck, as a standard deviation, of a way that says half of how the ground lies."""

_STEEP: Final = (np.radians(15.0), np.radians(25.0))
"""How far ground is off square to who stands on it, where one begins to take it for stairs."""

_SQUARE: Final = 0.05
"""Sine of the angle between up and where a foot points, at least."""

_SHORT: Final = 0.005
"""Heights of the neck: what is nearer to an ankle is no ball."""

_FORWARD, _UP = -np.eye(3)[1], np.eye(3)[2]


@dataclass(frozen=True, eq=False)
class FootMoments:
    """Feet at some moments, in the world."""

    bones: Mapping[int, int]
    """Toes' bone by foot's bone, −1 where there are none."""
    turns: Mapping[int, Floats]
    """(moments, 4) of feet."""
    heads: Mapping[int, Floats]
    """(moments, 3) of feet and toes, in units of the armature."""
    upward: Floats
    """(moments, 3) from feet to head."""
    forward: Floats
    """(moments, 3) where the pelvis faces."""
    standing: Floats
    """(moments,) weights: how much each says of how somebody stands."""

    @cached_property
    def height(self) -> float:
        """Of the neck above the feet of who stands, in units of the armature."""
        return float(np.linalg.norm(self.upward, axis=1).max())

    @cached_property
    def toes(self) -> dict[int, int]:
        """Toes' bone by foot's bone, −1 where none tells how the foot lies."""
        least = _SHORT * self.height

        def tells(foot: int, toe: int) -> bool:
            way = self.heads[toe] - self.heads[foot]
            return toe >= 0 and bool(np.linalg.norm(way, axis=1).min() > least)

        return {foot: toe if tells(foot, toe) else -1 for foot, toe in self.bones.items()}

    @cached_property
    def up(self) -> Floats:
        """(3,) square to the ground."""
        standing = robust_direction(self.upward, self.standing)
        ankles = np.stack([self.heads[foot] for foot in self.toes])
        level = np.linalg.svd(standing[None])[2][1:]
        places = ankles.mean(axis=0) @ level.T / self.height
        places -= places.mean(axis=0)
        heights = (ankles @ standing).min(axis=0) / self.height
        spread = places.T @ places / len(places) + _FAR**2 * np.eye(2)
        rise = np.linalg.solve(spread, places.T @ (heights - heights.mean()) / len(places))
        least, most = _STEEP
        slope = np.arctan(np.array(np.linalg.norm(rise)))
        share = 1.0 - smooth_step((slope - least) / (most - least))
        return normalized(standing - share * rise @ level)

    @cached_property
    def flat(self) -> dict[int, Floats]:
        """(moments,) by foot: weights, 1 where it lies flat."""
        found = dict.fromkeys(self.toes, self.standing)
        balls = {foot: toe for foot, toe in self.toes.items() if toe >= 0}
        for points in ({foot: foot for foot in self.toes}, balls):
            if not points:
                continue
            heights = np.stack([self.heads[bone] @ self.up for bone in points.values()])
            above = np.maximum(heights - np.quantile(heights, _FLOOR), 0.0)
            for foot, each in zip(points, above, strict=True):
                found[foot] = found[foot] / (1.0 + (each / (_LOW * self.height)) ** 4)
        return found

    @cached_property
    def rise(self) -> float:
        """Sine of how far balls lie higher than ankles, of feet that are flat."""
        slopes = [dot(self.along(foot), self.up) for foot, toe in self.toes.items() if toe >= 0]
        weights = [self.flat[foot] for foot, toe in self.toes.items() if toe >= 0]
        order = np.argsort(every := np.concatenate(slopes), kind="stable")
        passed = np.cumsum(np.concatenate(weights)[order])
        return float(every[order][np.searchsorted(passed, 0.5 * passed[-1])])

    def along(self, foot: int) -> Floats:
        """(moments, 3) from its ankle to its ball, of length one."""
        return normalized(self.heads[self.toes[foot]] - self.heads[foot])

    def seen(self, foot: int, vectors: Floats) -> Floats:
        """Directions (moments, 3) along a foot's axes."""
        return rotate(conjugate(self.turns[foot]), vectors)


def feet_at_rest(moments: FootMoments, *, toes: bool) -> dict[int, Floats]:
    """Orientations (4,) by foot, of a body that is upright and faces −Y; none of a foot that points
    up or down on average.

    ``toes``: whether feet point where their toes are. Where one of two bodies has none, both point
    as they do on average, seen from the pelvis.
    """
    found = {}
    for foot, toe in moments.toes.items():
        flat = moments.flat[foot]
        up = robust_direction(moments.seen(foot, moments.up), flat)
        ahead = robust_direction(moments.seen(foot, moments.forward), flat)
        if toe >= 0:
            along = robust_direction(moments.seen(foot, moments.along(foot)), np.ones(len(flat)))
            aside = normalized(up - (up @ along) * along)
            up = moments.rise * along + np.sqrt(1.0 - moments.rise**2) * aside
            ahead = along if toes else ahead
        if np.linalg.norm(np.cross(up, ahead)) > _SQUARE:
            found[foot] = multiply(_axes(_UP, _FORWARD), conjugate(_axes(up, ahead)))
    return found


def _axes(up: Floats, ahead: Floats) -> Floats:
    ahead = normalized(ahead - (ahead @ up) * up)
    return from_matrix(np.stack([np.cross(up, ahead), up, ahead], axis=-1))
