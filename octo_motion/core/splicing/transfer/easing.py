# SPDX-License-Identifier: GPL-3.0-or-later
"""A splice that comes and goes: the base mixed back in, such that joints alone say what is between.

No joint tells how a limb is turned about itself against another file's, so two files of one body
may disagree by a constant turn of each bone about its own length, which what hangs on it takes
back. Mixed bone by bone as it is, half of that turn and half of what takes it back put elbow and
hand elsewhere. So that turn is taken out first, over an easing as a whole, and what hangs on the
bone is turned along; it is put back in as the splice comes, and again what hangs on it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import (
    Floats,
    conjugate,
    continuous,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    to_rotation_vector,
)
from ...skeleton import Skeleton
from ..clip import Clip, SpliceWindow, rest_offsets, window_middle

_FLAT: Final = 0.05
"""Of their length: joints that spread less than this sideways lie in one line, and do not tell how
the bone that carries them is turned about it."""


def ease(
    base: Clip, span: SpliceWindow, bones: Sequence[int], rotations: Floats, locations: Floats
) -> None:
    """Mix the base back in where the splice comes and goes.

    Args:
        base: as it was.
        span: when.
        bones: of the part, parents first.
        rotations: (window, bones, 4) of the whole base, fully spliced; changed.
        locations: (window, bones, 3), likewise.
    """
    # Where the splice has no weight, the very values of the base.
    for own, made in ((base.rotations, rotations), (base.locations, locations)):
        rows = np.ix_(np.flatnonzero(span.weights == 0.0), bones)
        made[rows] = own[span.frames][rows]
    limbs = _Lengthwise.of(base.skeleton, bones)
    for chosen in span.easings:
        frames, rows = chosen + span.frames.start, np.ix_(chosen, bones)
        weights, own = span.weights[chosen][:, None], base.rotations[frames][:, bones]
        turns = limbs.turns(own, rotations[rows], span.telling[chosen])
        there = limbs.without(rotations[rows], turns)
        # The way round is chosen once, where the two are about equally strong, and kept: the short
        # way frame by frame would jump where they are half a turn apart.
        between = continuous(multiply(conjugate(own), there))
        center = window_middle(weights[:, 0])
        between = np.where(between[center, :, :1] < 0.0, -between, between)
        mixed = multiply(own, _power(between, weights))
        rotations[rows] = limbs.without(mixed, -weights * turns)
        still = base.locations[frames][:, bones]
        moved = limbs.carried(locations[rows], turns)
        moved = still + weights[..., None] * (moved - still)
        locations[rows] = limbs.carried(moved, -weights * turns)


@dataclass(frozen=True, eq=False)
class _Lengthwise:
    """Bones of a part that may be turned about their own length: no joint moves if what hangs on
    them is turned back.
    """

    axes: Floats
    """(bones, 3) of each along itself; 0 where joints tell how it is turned, or nothing does."""
    above: tuple[int, ...]
    """Number of each one's parent among them, −1 if that is none, or turns it not."""
    along: Floats
    """(bones, 3) the parent's axis along the bone itself."""

    @classmethod
    def of(cls, skeleton: Skeleton, bones: Sequence[int]) -> _Lengthwise:
        """Bones of a part, parents first."""
        number = {bone: place for place, bone in enumerate(bones)}
        offsets = rest_offsets(skeleton)
        axes = np.zeros((len(bones), 3))
        for place, bone in enumerate(bones):
            children = skeleton.children[bone]
            if children and all(each in number for each in children):
                axes[place] = _line(offsets[list(children)])
        above = tuple(
            number.get(skeleton.parents[bone], -1) if skeleton.inherits_rotation[bone] else -1
            for bone in bones
        )
        parents = np.maximum([skeleton.parents[bone] for bone in bones], 0)
        lies = multiply(
            conjugate(skeleton.rest_rotations[parents]), skeleton.rest_rotations[list(bones)]
        )
        inside = np.array(above)
        along = np.where(inside[:, None] < 0, 0.0, rotate(conjugate(lies), axes[inside]))
        return cls(axes, above, along)

    def turns(self, own: Floats, made: Floats, says: Floats) -> Floats:
        """By how much (bones,) bones are turned about their length from one pose to another.

        The angle that is best over an easing, by the scalar parts of quaternions (Markley et al.,
        "Averaging Quaternions", 2007).

        Args:
            own: (moments, bones, 4)
            made: (moments, bones, 4)
            says: (moments,) how much each says.
        """
        rows = np.flatnonzero(says > 0.0)
        own, made, says = conjugate(own[rows]), made[rows], says[rows]
        turns = np.zeros(len(self.axes))
        for bone, parent in enumerate(self.above):
            # The axis that a bone without a parent has along it is 0.
            if not self.axes[bone].any():
                continue
            back = from_rotation_vector(turns[parent] * self.along[bone])
            turned = multiply(own[:, bone], multiply(back, made[:, bone]))
            parts = np.stack([turned[:, 0], turned[:, 1:] @ self.axes[bone]], axis=-1)
            best = np.linalg.eigh(np.einsum("m,mi,mj->ij", says, parts, parts))[1][:, -1]
            turns[bone] = 2.0 * np.arctan2(*(best[::-1] * (1.0 if best[0] >= 0.0 else -1.0)))
        return turns

    def without(self, rotations: Floats, turns: Floats) -> Floats:
        """Rotations (moments, bones, 4) without these turns (…, bones): all joints stay."""
        own = from_rotation_vector(-turns[..., None] * self.axes)
        return multiply(multiply(self._back(turns), rotations), own)

    def carried(self, locations: Floats, turns: Floats) -> Floats:
        """Likewise locations (moments, bones, 3), which the bones' parents carry."""
        return rotate(self._back(turns), locations)

    def _back(self, turns: Floats) -> Floats:
        """(…, bones, 4) of each bone: what keeps it where it is if its parent is not turned."""
        return from_rotation_vector(turns[..., self.above, None] * self.along)


def _line(places: Floats) -> Floats:
    """The direction (3,) from a joint to others (count, 3) that lie in one line with it, 0 if they
    do not.
    """
    _, spread, ways = np.linalg.svd(places)
    if spread[0] <= 0.0 or (len(spread) > 1 and spread[1] > _FLAT * spread[0]):
        return np.zeros(3)
    return normalized(ways[0])


def _power(quaternions: Floats, shares: Floats) -> Floats:
    """A share of each rotation, along the way round that its sign says."""
    far = quaternions[..., :1] < 0.0
    vector = to_rotation_vector(quaternions)
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    # The sign of a quaternion tells the short way round from the long one.
    long_way = 1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9)
    vector = np.where(far, vector * long_way, vector)
    return from_rotation_vector(vector * shares[..., None])
