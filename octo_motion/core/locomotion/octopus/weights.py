# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bones move a point of the skin, and how much.

Influences are a pair of arrays of one shape (…, k): indices of bones and their weights. A bone
may occur twice, and an influence of weight zero means nothing.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from ...rotations import Floats
from ...smoothing import smooth_step
from .body import HEAD_MIDDLE, MANTLE_EDGE, NECK
from .rig import BODY, FIRST_ARM_BONE, HEAD, MANTLE
from .shape import OctopusShape
from .topology import Indices

MOST_INFLUENCES: Final = 4
"""What game engines and real-time viewers take."""
_NEGLIGIBLE: Final = 1e-3
"""Smaller weights are left out."""


class Influences(NamedTuple):
    bones: Indices
    weights: Floats


def ramp(start: float, stop: float, values: Floats) -> Floats:
    """0 before ``start``, 1 after ``stop``, and a smooth step (…) in between."""
    return smooth_step((values - start) / (stop - start))


def rigid(bone: int, shape: tuple[int, ...]) -> Influences:
    """Points that move with one bone alone."""
    return Influences(np.full((*shape, 1), bone, dtype=np.int64), np.ones((*shape, 1)))


def mixed(first: Influences, second: Influences, share: Floats) -> Influences:
    """Both, with ``share`` (…) of the second."""
    first_weights, second_weights = first.weights, second.weights
    return Influences(
        np.concatenate([first.bones, second.bones], axis=-1),
        np.concatenate(
            [first_weights * (1.0 - share[..., None]), second_weights * share[..., None]], axis=-1
        ),
    )


def along_arm(shape: OctopusShape, arm: Indices, distance: Floats) -> Influences:
    """Influences (…, 3) at distances from P₀ along arms (negative under the body).

    The weights are the quadratic B-spline over the bones: each bone's share rises and falls with
    a continuous slope, half of it is gone at its joints, and its neighbours take the rest. A
    coil then bends the skin evenly, not at the joints. Before P₀ the body takes over, within one
    diameter.
    """
    joint = np.where(
        distance < 0.0,
        distance / shape.first_diameter,
        np.interp(distance, shape.reach, np.arange(shape.joints + 1.0)),
    )
    bone = np.clip(np.floor(joint), -1, shape.joints - 1)
    f = np.maximum(joint - bone, 0.0)
    weights = np.stack([0.5 * (1 - f) ** 2, 0.75 - (f - 0.5) ** 2, 0.5 * f**2], axis=-1)
    index = bone[..., None].astype(np.int64) + np.array([-1, 0, 1])
    in_skeleton = FIRST_ARM_BONE + arm[..., None] * shape.joints
    return Influences(
        np.where(index < 0, BODY, in_skeleton + np.minimum(index, shape.joints - 1)), weights
    )


def along_body(station: Floats) -> Influences:
    """Influences (…, 3) of body, head and mantle at stations of the body's axis."""
    head = ramp(-1.0, HEAD_MIDDLE, station)
    mantle = ramp(NECK - 0.7, MANTLE_EDGE + 1.0, station)
    bones = np.broadcast_to(np.array([BODY, HEAD, MANTLE]), (*station.shape, 3))
    return Influences(bones, np.stack([1.0 - head, head * (1.0 - mantle), head * mantle], axis=-1))


def strongest(influences: Influences) -> Influences:
    """At most ``MOST_INFLUENCES`` of them, each bone once, strongest first, with sum one.

    What the first one left out weighs is taken from all that stay: so the choice does not jump
    between neighbouring points, and equal weights stay or go together.
    """
    bones, weights = influences.bones, influences.weights.copy()
    count = bones.shape[-1]
    for later in range(1, count):
        for earlier in range(later):
            same = bones[..., earlier] == bones[..., later]
            weights[..., earlier] += np.where(same, weights[..., later], 0.0)
            weights[..., later] = np.where(same, 0.0, weights[..., later])
    if count < MOST_INFLUENCES:
        widen = [(0, 0)] * (bones.ndim - 1) + [(0, MOST_INFLUENCES - count)]
        bones, weights = np.pad(bones, widen), np.pad(weights, widen)
    order = np.argsort(-weights, axis=-1, kind="stable")
    bones = np.take_along_axis(bones, order, axis=-1)
    weights = np.take_along_axis(weights, order, axis=-1)
    kept = weights[..., :MOST_INFLUENCES]
    if count > MOST_INFLUENCES:
        kept = kept - weights[..., MOST_INFLUENCES, None]
    kept = np.where(kept > _NEGLIGIBLE, kept, 0.0)
    return Influences(bones[..., :MOST_INFLUENCES], kept / np.sum(kept, axis=-1, keepdims=True))
