# SPDX-License-Identifier: GPL-3.0-or-later
"""How much room a joint needs over the ground: one notion for all that keeps arms off it.

A joint that lies on the ground is as high as its skin is thick. One that does not keeps a margin
besides. It is raised gently as it comes near to that, and the less the nearer it is to the root,
which the body carries. Half way between frames, and where another arm pushes, a joint may be a
little lower than it was to be: by what nobody sees.

Heights are over the ground under the joint, along world Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, rotate, shortest_arc
from ...smoothing import smooth_step

MARGIN: Final = 0.03
"""Arm lengths that joints which do not lie keep between their skin and the ground: between two of
them the skin is lower, where the ground is bent upwards or the arm sideways."""
TOLERATED: Final = 0.002
"""Arm lengths that a joint may be lower than it was to be where it cannot be helped."""
_ROOT: Final = 0.15
"""Share of an arm from its root on which joints are not raised all the way."""


def room_needed(skin: Floats, length: Floats, more: Floats | float = 0.0) -> Floats:
    """Heights of joints that do not lie, by how far skin is below them and the length of their
    arms, in one unit; some are to be higher by ``more``.
    """
    return skin + (MARGIN * length + more)


def lowest_allowed(heights: Floats, skin: Floats) -> Floats:
    """Heights that joints at such heights must not be pushed below, or no further."""
    return np.minimum(heights, skin)


def loose_from_root(reach: Floats, length: Floats) -> Floats:
    """How far joints, at a reach from the root of an arm of a length, are free to be raised: 0 at
    the root, 1 a little further out.
    """
    return smooth_step(reach / (_ROOT * length))


def smooth_floor(heights: Floats, floor: Floats | float, rounding: float) -> Floats:
    """Heights that are never below a floor, with a smooth passage of about such a width.

    ``floor + (h + √(h² + r²)) / 2`` of heights h above it. Differences never grow: what is within
    reach of each other stays so.
    """
    above = heights - floor
    return floor + 0.5 * (above + np.sqrt(above * above + rounding**2))


def lift_to_floor(above: Floats, rounding: float) -> Floats:
    """How far what is so much above a floor is to be lifted: ``(√(h² + r²) − h) / 2``."""
    return 0.5 * (np.sqrt(above * above + rounding**2) - above)


@dataclass(frozen=True, eq=False)
class JointRoom:
    """The room that joints of a batch of arms are to have."""

    needed: Floats
    """(segments + 1, batch) how high above the ground each joint should be."""
    loose: Floats
    """(segments + 1, batch) how far each is to be raised to that, 0…1."""
    soft: Floats
    """(…, batch) how much above what is needed they begin to be raised."""

    def lacking(self, heights: Floats) -> Floats:
        """By how much (segments + 1, batch) joints at such heights are to be raised."""
        below = self.needed - heights
        near = np.maximum(below + self.soft, 0.0)
        below = np.where(below > self.soft, below, near * near * (0.25 / self.soft))
        below *= self.loose
        return below


# --- How far an arm's skin reaches from its bones: on many rigs these are not in the middle of it
#
# An arm that lies rests on its skin. Where that is round about its bones it is as far from them on
# whichever side it lies; an imported creature's bones may as well run along its back, and taken as
# round it would hover. So the skin is seen from all sides, bone by bone, once for a rig.


_SIDES: Final = 36
"""Sides that a bone is seen from, all round it."""
_SIDE: Final = 2.0 * np.pi / _SIDES
_LIES: Final = 6
"""Sides either way of its suckers' that an arm comes to lie on."""
_ROLL: Final = np.radians(10.0)
"""How far a bone may roll from how it was seen to lie."""
_MOST: Final = 0.97
"""Share of a bone's points that do not reach further than it says."""
_FEW: Final = 4
"""Points of a bone's half that do not yet tell how far its skin reaches."""
_ASKEW: Final = 0.6
"""Share of its radius up to which a skin that reaches no further counts as it is …"""
_ROUND: Final = 0.8
"""… and from which on it is round: points are few, and none may be just below a bone."""
_NEAREST: Final = 0.12
"""Radii that a skin is taken to reach at least: bones that lie need room for what keys lose."""
_FARTHEST: Final = 1.5
"""Radii that a skin is taken to reach at most: what is further is a web, or a fin."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class ArmSkin:
    """The skin of one arm."""

    radii: Floats
    """(bones + 1,) armature units from each joint to the skin about it, as if it were round."""
    across: Floats
    """(bones, 2, 3) unit vectors across each bone, in its rest frame, the second a quarter round
    from the first."""
    reaches: Floats
    """(bones, 2, sides) armature units that the skin reaches from the bone's axis, at its head and
    at its tail, to sides all round from the first of ``across`` to the second and on."""

    def is_round(self, sides: Floats, first: int) -> bool:
        """Whether it reaches as far to whichever side the joints that may lie, from the first on,
        may lie on, as nearly as can be told.

        Suckers are on sides (bones, 3), in the bones' rest frames; none of a bone whose any side
        may come to be below.
        """
        seen = np.einsum("bc,bac->ba", sides, self.across)
        middle = np.rint(np.arctan2(seen[:, 1], seen[:, 0]) / _SIDE).astype(np.int64)
        aside = np.arange(-_LIES, _LIES + 1)
        bones, ends = np.arange(len(sides))[:, None, None], np.arange(2)[:, None]
        parts = self._parts
        facing = parts[bones, ends, (middle[:, None] + aside)[:, None] % _SIDES]
        anyhow = np.all(sides == 0.0, axis=1)
        facing[anyhow] = np.min(parts[anyhow], axis=-1, keepdims=True)
        at_joints = np.concatenate([np.maximum(facing[:-1, 1], facing[1:, 0]), facing[-1:, 1]])
        return bool(np.all(at_joints[first - 1 :] >= _ROUND))

    @cached_property
    def _parts(self) -> Floats:
        """``reaches``, of the skin's radius there."""
        ends = np.stack([self.radii[:-1], self.radii[1:]], axis=-1)
        return self.reaches / np.maximum(ends, _TINY)[..., None]

    def seen_below(self, down: Floats) -> Floats:
        """How far the skin was seen to reach down (…, bones, 3), in the bones' rest frames, at both
        ends of bones (…, bones, 2), armature units; :meth:`below` leaves room for what is not
        known.
        """
        seen = np.einsum("...bc,bac->...ba", down, self.across)
        side = np.rint(np.arctan2(seen[..., 1], seen[..., 0]) / _SIDE).astype(np.int64) % _SIDES
        reach = self.reaches[np.arange(len(self.across)), :, side]
        return np.clip(reach, 0.0, np.stack([self.radii[:-1], self.radii[1:]], axis=-1))

    def below(self, down: Floats, first: int = 0) -> Floats:
        """How far the skin reaches down (…, bones, 2, 3), in the bones' rest frames, at both ends
        of bones (…, bones, 2), from the first on, armature units.

        A bone that is outside its skin is not in the ground either.
        """
        seen = np.einsum("...bec,bac->...bea", down, self.across[first:])
        place = np.arctan2(seen[..., 1], seen[..., 0]) / _SIDE
        lower = np.floor(place)
        share = place - lower
        low = lower.astype(np.int64) % _SIDES
        bones, ends = np.arange(first, len(self.across))[:, None], np.arange(2)
        # Whichever side it may come to show, if it rolls a little.
        steps = int(np.ceil(_ROLL / _SIDE))
        rolled = np.max(
            [np.roll(self._parts, step, axis=-1) for step in range(-steps, steps + 1)], axis=0
        )
        one, other = rolled[bones, ends, low], rolled[bones, ends, (low + 1) % _SIDES]
        part = np.clip(one + share * (other - one), _NEAREST, _FARTHEST)
        rounder = smooth_step((part - _ASKEW) / (_ROUND - _ASKEW))
        part += np.maximum(1.0 - part, 0.0) * rounder
        return part * np.stack([self.radii[first:-1], self.radii[first + 1 :]], axis=-1)


def arm_skin(points: Floats, joints: Floats, frames: Floats, radii: Floats) -> ArmSkin:
    """The skin of an arm from points (n, 3) of it at rest, about joints (bones + 1, 3), armature
    space.

    Frames (bones, 4) are the bones' rest orientations, radii (bones + 1,) from each joint to the
    skin about it, as if it were round.
    """
    steps = np.diff(joints, axis=0)
    segments = steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), _TINY)
    across = _across(segments)
    angles = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    ways = np.stack([np.cos(angles), np.sin(angles)])
    bone, share, off = nearest_bones(points, joints)
    ends = np.stack([radii[:-1], radii[1:]], axis=-1)[..., None]
    parts = np.full((len(steps), 2, _SIDES), np.nan)
    for number, sides in enumerate(across):
        own = bone == number
        parts[number] = _at_ends(off[own] @ sides.T @ ways, share[own])
    parts /= np.maximum(ends, _TINY)
    parts = _filled(parts.reshape(-1, _SIDES)).reshape(parts.shape)
    return ArmSkin(radii, rotate(conjugate(frames)[:, None], across), parts * ends)


def _across(segments: Floats) -> Floats:
    """Unit vectors across each bone (bones, 2, 3): along the arm they turn as little as it does."""
    first = np.empty(segments.shape)
    # Across the first bone, any way: the axis that is least along it.
    before = np.eye(3)[np.abs(segments[0]).argmin()]
    for number, segment in enumerate(segments):
        if number:
            before = rotate(shortest_arc(segments[number - 1], segment), before)
        across = before - (before @ segment) * segment
        before = across / max(float(np.linalg.norm(across)), _TINY)
        first[number] = before
    return np.stack([first, np.cross(segments, first)], axis=1)


def _filled(parts: Floats) -> Floats:
    """Rows (ends, sides) of what is not known taken from those before and after; else 1."""
    known = np.flatnonzero(np.isfinite(parts[:, 0]))
    if len(known) == 0:
        return np.ones(parts.shape)
    rows = np.arange(len(parts))
    return np.stack([np.interp(rows, known, side[known]) for side in parts.T], axis=1)


def nearest_bones(points: Floats, joints: Floats) -> tuple[np.ndarray, Floats, Floats]:
    """The bone of a chain of joints (bones + 1, 3) that each point (n, 3) is nearest to.

    Its number (n,), where along it that is (n,), 0…1, and the way from there (n, 3).
    """
    starts, steps = joints[:-1], np.diff(joints, axis=0)
    seen = points[:, None] - starts
    share = np.einsum("nsc,sc->ns", seen, steps) / np.maximum(np.sum(steps**2, axis=1), _TINY)
    share = np.clip(share, 0.0, 1.0)
    off = seen - share[..., None] * steps
    bone = np.einsum("nsc,nsc->ns", off, off).argmin(axis=1)
    rows = np.arange(len(points))
    return bone, share[rows, bone], off[rows, bone]


def _at_ends(reach: Floats, share: Floats) -> Floats:
    """How far a bone's skin reaches at its ends (2, sides), nan where its points are too few.

    So far (n, sides) does each of its points, at a share (n,) along it, 0…1.
    """
    ends = np.full((2, reach.shape[1]), np.nan)
    for end, near in enumerate((share <= 0.5, share >= 0.5)):
        if np.count_nonzero(near) >= _FEW:
            ends[end] = np.quantile(reach[near], _MOST, axis=0)
    if np.all(np.isfinite(ends)):
        # A bone is straight: what bulges between its ends must not be in the ground either.
        line = ends[0] + share[:, None] * (ends[1] - ends[0])
        ends += np.maximum(np.quantile(reach - line, _MOST, axis=0), 0.0)
    return ends
