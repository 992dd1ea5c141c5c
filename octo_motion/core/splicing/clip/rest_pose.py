# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips on another rest pose than their file's, and robust means to find one with."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from ...rotations import IDENTITY, Floats, conjugate, multiply, normalized, rotate, to_matrix
from ...skeleton import Skeleton
from .clip import Clip, spread_clip

_NEAR: Final = 0.05
"""Radians (and of a unit vector): what lies nearer to the robust mean weighs no more than this."""

_ROUNDING: Final = 1e-9
"""Of a body's size: below, a bone sits where it did."""

_ROUNDS: Final = 12
"""Of reweighting: means move by less than 1e-4 afterwards."""

_LOOKS: Final = 100
"""Moments of a clip from which its average pose is found."""


def with_rest_pose(
    skeleton: Skeleton, orientations: Floats, offsets: Floats | None = None
) -> Skeleton:
    """The same bones at rest with other orientations (bones, 4), armature space; roots begin where
    they did, others where they sit on their parents: ``offsets`` (bones, 3) along these, as at rest
    if not given.
    """
    offsets = rest_offsets(skeleton) if offsets is None else offsets
    matrices = skeleton.rest_matrices.copy()
    matrices[:, :3, :3] = to_matrix(orientations)
    for bone, parent in enumerate(skeleton.parents):
        if parent >= 0:
            turned = rotate(orientations[parent], offsets[bone])
            matrices[bone, :3, 3] = matrices[parent, :3, 3] + turned
    return replace(skeleton, rest_matrices=matrices)


def rest_offsets(skeleton: Skeleton) -> Floats:
    """Where bones sit on their parents at rest (bones, 3), along the parents' axes; of roots 0."""
    parents = np.array(skeleton.parents)
    above = np.maximum(parents, 0)
    offsets = rotate(
        conjugate(skeleton.rest_rotations[above]), skeleton.heads - skeleton.heads[above]
    )
    return np.where((parents < 0)[:, None], 0.0, offsets)


def usual_offsets(clip: Clip) -> Floats:
    """Where bones sit on their parents while a clip plays (bones, 3), along the parents' axes, as a
    robust mean; of roots 0. A file may rest with its joints elsewhere, and move them with keys.
    """
    skeleton = clip.skeleton
    offsets = rest_offsets(skeleton)
    looks = spread_clip(clip, _LOOKS)
    moved = [
        bone
        for bone in np.flatnonzero(looks.locations.any(axis=(0, 2))).tolist()
        if skeleton.parents[bone] >= 0
    ]
    if not moved:
        return offsets
    turns, heads = skeleton.pose(looks.rotations, looks.locations)
    parents = [skeleton.parents[bone] for bone in moved]
    places = rotate(conjugate(turns[:, parents]), heads[:, moved] - heads[:, parents])
    offsets[moved] = robust_places(places)
    return offsets


def robust_places(places: Floats) -> Floats:
    """Geometric medians (bones, 3) of places (moments, bones, 3), after Weiszfeld."""
    mean = places.mean(axis=0)
    near = np.linalg.norm(places - mean, axis=-1).max(axis=0) * _NEAR + 1e-12
    for _ in range(_ROUNDS):
        weights = 1.0 / np.maximum(np.linalg.norm(places - mean, axis=-1), near)
        mean = np.einsum("mb,mbi->bi", weights, places) / weights.sum(axis=0)[:, None]
    return mean


def average_pose(clip: Clip) -> Skeleton:
    """A clip's skeleton resting as its bones lie on average: whatever its rest pose is, that is a
    pose of its body.
    """
    skeleton = clip.skeleton
    turns, _ = skeleton.pose(spread_clip(clip, _LOOKS).rotations)
    parents = np.array(skeleton.parents)
    between = multiply(conjugate(turns[:, np.maximum(parents, 0)]), turns)
    between[:, parents < 0] = turns[:, parents < 0]
    means = robust_rotations(between, np.ones((len(turns), 1)))
    for bone, parent in enumerate(skeleton.parents):
        if parent >= 0:
            means[bone] = multiply(means[parent], means[bone])
    return with_rest_pose(skeleton, means, usual_offsets(clip))


class Reresting:
    """A clip's rotations and locations from its own rest pose into another one, and back."""

    def __init__(self, skeleton: Skeleton, rested: Skeleton) -> None:
        self.skeleton, self.rested = skeleton, rested
        parents = np.array(skeleton.parents)
        roots = (parents < 0)[:, None]
        free = roots | ~np.array(skeleton.inherits_rotation)[:, None]
        own, other = skeleton.rest_rotations, rested.rest_rotations
        above = [multiply(conjugate(each[np.maximum(parents, 0)]), each) for each in (own, other)]
        alone = multiply(conjugate(other), own)
        carried = multiply(conjugate(above[1]), above[0])
        self._turns = np.where(free, alone, carried)
        self._shifts = np.where(roots, alone, carried)
        # What a bone sits otherwise on its parent, along its own axes there.
        nearer = rest_offsets(skeleton) - rest_offsets(rested)
        size = float(np.ptp(skeleton.heads, axis=0).max())
        there = roots | (np.linalg.norm(nearer, axis=1, keepdims=True) <= _ROUNDING * size)
        self._places = np.where(there, 0.0, rotate(conjugate(above[1]), nearer))

    def into(self, clip: Clip) -> Clip:
        """The clip on the other rest pose: all bones are where they were."""
        return replace(
            clip,
            skeleton=self.rested,
            rotations=multiply(self._turns, clip.rotations),
            locations=rotate(self._shifts, clip.locations) + self._places,
        )

    def back(self, clip: Clip, before: Clip, given: Clip) -> Clip:
        """A clip on its own rest pose again.

        Args:
            clip: changed, on the other rest pose.
            before: the same before it was changed.
            given: the same on its own rest pose: what was not changed stays to the last digit.
        """
        turned = multiply(conjugate(self._turns), clip.rotations)
        moved = rotate(conjugate(self._shifts), clip.locations - self._places)
        still = np.all(clip.rotations == before.rotations, axis=-1, keepdims=True)
        there = np.all(clip.locations == before.locations, axis=-1, keepdims=True)
        return replace(
            clip,
            skeleton=self.skeleton,
            rotations=np.where(still, given.rotations, turned),
            locations=np.where(there, given.locations, moved),
        )


def robust_direction(vectors: Floats, weights: Floats) -> Floats:
    """A mean (3,) of directions (moments, 3) that few strange ones do not draw away: their
    geometric median, after Weiszfeld. Lengths do not count; zero vectors say nothing.
    """
    units = normalized(vectors)
    weights = weights * np.linalg.norm(units, axis=-1)
    mean = (weights[:, None] * units).sum(axis=0)
    for _ in range(_ROUNDS):
        near = weights / np.maximum(np.linalg.norm(units - normalized(mean), axis=-1), _NEAR)
        mean = (near[:, None] * units).sum(axis=0) / max(near.sum(), 1e-12)
    return normalized(mean)


def robust_rotations(rotations: Floats, weights: Floats) -> Floats:
    """Means (bones, 4) of rotations (moments, bones, 4) that few strange ones do not draw away.
    Weights are (moments, 1), or (moments, bones).

    Of weighted quaternions the eigenvector of their outer products (Markley et al., "Averaging
    Quaternions", 2007), reweighted by one over the angle to the mean (L1 averaging: Hartley et al.,
    "Rotation Averaging", 2013). A constant rotation on either side goes through unchanged.
    """
    near = np.broadcast_to(weights, rotations.shape[:2])
    mean = np.broadcast_to(IDENTITY, rotations.shape[1:])
    for _ in range(_ROUNDS):
        products = np.einsum("mb,mbi,mbj->bij", near, rotations, rotations)
        mean = np.linalg.eigh(products)[1][..., -1]
        cosine = np.abs(np.sum(rotations * mean, axis=-1))
        angle = 2.0 * np.arccos(np.minimum(cosine, 1.0))
        near = weights / np.maximum(angle, _NEAR)
    return mean
