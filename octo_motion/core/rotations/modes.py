# SPDX-License-Identifier: GPL-3.0-or-later
"""Quaternions (…, 4) to and from the values of Blender's rotation modes.

A mode is ``"QUATERNION"``, ``"AXIS_ANGLE"`` (angle, x, y, z) or one of the :data:`EULER_ORDERS`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats, continuous, from_axis_angle, less_whole_turns, normalized

EULER_ORDERS: Final = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")

_TINY: Final = 1e-12


def from_mode_values(values: Floats, mode: str) -> Floats:
    """Unit quaternions (…, 4) of values (…, 3 or 4) of a rotation mode."""
    if mode == "QUATERNION":
        return normalized(values)
    if mode == "AXIS_ANGLE":
        # Normalized again: about no axis at all the angle would remain.
        return normalized(from_axis_angle(normalized(values[..., 1:]), values[..., 0]))
    return from_euler(values, mode)


def from_euler(angles: ArrayLike, order: str) -> Floats:
    """Blender's Euler angles ``(…, 3)`` = (x, y, z) in a rotation order such as ``"XYZ"``.

    As in Blender, the first letter is the axis that is turned about first.
    """
    half = 0.5 * np.asarray(angles, dtype=np.float64)
    i, j, k = ("XYZ".index(letter) for letter in order)
    # The product of three turns about the axes, written out. An odd order is an even one seen in a
    # mirror, where all turns go backwards.
    mirror = 1.0 if (j - i) % 3 == 1 else -1.0
    cosine, sine = np.cos(half), np.sin(half)
    (ci, cj, ck), (si, sj, sk) = (
        (each[..., i], each[..., j], each[..., k]) for each in (cosine, sine)
    )
    sk_mirrored = mirror * sk
    both, crossed = cj * ci, sj * si
    one, other = cj * si, sj * ci
    result = np.empty((*half.shape[:-1], 4))
    result[..., 0] = ck * both + sk_mirrored * crossed
    result[..., 1 + i] = ck * one - sk_mirrored * other
    result[..., 1 + j] = ck * other + sk_mirrored * one
    result[..., 1 + k] = sk * both - mirror * ck * crossed
    return result


def to_euler(quaternion: ArrayLike, order: str) -> Floats:
    """Unit quaternions to Blender's Euler angles (x, y, z); the middle angle in [−π/2, π/2].

    Straight from the quaternion, so it is exact near the poles of the middle angle as well; on a
    pole, where first and last angle turn about one axis, the last is zero. After Bernardes and
    Viollet, "Quaternion to Euler angles conversion" (2022).
    """
    q = np.asarray(quaternion, dtype=np.float64)
    i, j, k = ("XYZ".index(letter) for letter in order)
    # An odd order is an even one seen in a mirror, where all turns go backwards.
    mirror = 1.0 if (j - i) % 3 == 1 else -1.0
    w = q[..., 0]
    first, middle, last = (mirror * q[..., 1 + axis] for axis in (i, j, k))
    with_sum = np.hypot(w - middle, last + first)
    with_difference = np.hypot(w + middle, last - first)
    half_sum = np.arctan2(last + first, w - middle)
    half_difference = np.arctan2(last - first, w + middle)
    half_difference = np.where(with_difference < _TINY, -half_sum, half_difference)
    half_sum = np.where(with_sum < _TINY, -half_difference, half_sum)
    result = np.empty((*q.shape[:-1], 3))
    result[..., i] = mirror * less_whole_turns(half_sum - half_difference)
    result[..., j] = mirror * (2.0 * np.arctan2(with_difference, with_sum) - 0.5 * np.pi)
    result[..., k] = mirror * less_whole_turns(half_sum + half_difference)
    return result


def continuous_euler(angles: ArrayLike, order: str) -> Floats:
    """Of the equal triples of Euler angles, those closest to the frame before (first axis).

    Each rotation has two families of triples, apart by whole turns: the given one, and the one
    with its first and last angle turned by π and its middle angle taken from π. The first frame
    gets the triple closest to zero, as Blender itself chooses.
    """
    given = np.asarray(angles, dtype=np.float64)
    # The two families lie 2π apart and more, so within π of the frame before nothing changes: as a
    # rule nowhere, which is quickly seen.
    steps = np.abs(np.diff(given, axis=0)).sum(axis=-1).max(axis=0, initial=0.0)
    start = np.abs(less_whole_turns(given[:1])).sum(axis=-1).max(axis=0, initial=0.0)
    plain = (steps < np.pi) & (start < np.pi)
    result = given + (less_whole_turns(given[:1]) - given[:1])
    if not plain.all():
        result[:, ~plain] = _continued(given[:, ~plain], order)
    return result


def _continued(given: Floats, order: str) -> Floats:
    i, j, k = ("XYZ".index(letter) for letter in order)
    other = given.copy()
    other[..., (i, k)] += np.pi
    other[..., j] = np.pi - other[..., j]
    before = np.concatenate([np.zeros_like(given[:1]), given[:-1]])
    # Changing family costs the same from either to the other, and so does staying in either.
    # So whether to change at a frame hangs on its two triples alone, whatever came before.
    staying = np.abs(less_whole_turns(given - before)).sum(axis=-1)
    changing = np.abs(less_whole_turns(other - before)).sum(axis=-1)
    in_other = np.cumsum(changing < staying, axis=0) % 2 == 1
    chosen = np.where(in_other[..., None], other, given)
    chosen[:1] = less_whole_turns(chosen[:1])
    return np.unwrap(chosen, axis=0)


def continuous_axis_angle(quaternions: ArrayLike) -> Floats:
    """Unit quaternions as ``(angle, x, y, z)``, close to the frame before (first axis).

    Axis and angle keep their direction through the rest pose, where the angle changes sign, and
    past the half turn, where it goes on growing. At rest itself the axis is that of the frame
    before; before the first turn it is that of the first turn, or Y if there is none at all.
    """
    q = continuous(quaternions)
    sine = np.linalg.norm(q[..., 1:], axis=-1)
    turned = sine > _TINY
    # The last frame that was turned, at or before each; before the first such, the first.
    number = np.arange(len(q)).reshape((-1,) + (1,) * (q.ndim - 2))
    source = np.maximum.accumulate(np.where(turned, number, 0), axis=0)
    never = ~np.maximum.accumulate(turned, axis=0)
    source = np.where(never, np.argmax(turned, axis=0), source)
    axes = np.take_along_axis(normalized(q[..., 1:]), source[..., None], axis=0)
    axes[np.broadcast_to(~turned.any(axis=0), turned.shape)] = (0.0, 1.0, 0.0)
    backwards = np.sum(axes[1:] * axes[:-1], axis=-1) < 0.0
    signs = np.where(np.cumsum(backwards, axis=0) % 2 == 1, -1.0, 1.0)
    axes[1:] *= signs[..., None]
    angle = 2.0 * np.arctan2(np.sum(axes * q[..., 1:], axis=-1), q[..., 0])
    # The first frame within half a turn, all others next to the one before.
    angle[:1] = less_whole_turns(angle[:1])
    return np.concatenate([np.unwrap(angle, axis=0)[..., None], axes], axis=-1)
