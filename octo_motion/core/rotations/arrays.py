# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors (…, 3) and unit quaternions (…, 4), any axes before their components; all broadcast."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

IDENTITY: Final[Floats] = np.array([1.0, 0.0, 0.0, 0.0])

_TINY: Final = 1e-12
"""Length below which a vector has no direction: far below what single precision tells of 1."""


def normalized(vectors: ArrayLike) -> Floats:
    """Vectors (or quaternions) scaled to length one; those of no length stay zero."""
    array = np.asarray(vectors, dtype=np.float64)
    length = np.sqrt(dot(array, array))[..., None]
    return array / np.where(length > _TINY, length, np.inf)


def dot(first: Floats, second: Floats) -> Floats:
    """Scalar products (…) of vectors (…, components), quickest where those are few."""
    total = first[..., 0] * second[..., 0]
    for component in range(1, first.shape[-1]):
        total = total + first[..., component] * second[..., component]
    return total


def multiply(first: ArrayLike, second: ArrayLike) -> Floats:
    """Hamilton product ``first ∘ second``: rotates by ``second`` and then by ``first``."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    # Its shape is the whole's: numpy's own broadcasting of two arrays takes longer than the product
    # where there are few.
    w = aw * bw - ax * bx - ay * by - az * bz
    result = np.empty((*w.shape, 4))
    result[..., 0] = w
    result[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    result[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    result[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return result


def conjugate(quaternion: ArrayLike) -> Floats:
    """The inverse rotation of a unit quaternion."""
    return np.asarray(quaternion, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(quaternion: ArrayLike, vectors: ArrayLike) -> Floats:
    """Vectors ``(…, 3)`` turned by unit quaternions ``(…, 4)``."""
    q = np.asarray(quaternion, dtype=np.float64)
    v = np.asarray(vectors, dtype=np.float64)
    twice = 2.0 * cross(q[..., 1:], v)
    return v + q[..., :1] * twice + cross(q[..., 1:], twice)


def cross(first: Floats, second: Floats) -> Floats:
    """Cross product in the last axis; several times faster than ``numpy.cross`` in batch."""
    ax, ay, az = first[..., 0], first[..., 1], first[..., 2]
    bx, by, bz = second[..., 0], second[..., 1], second[..., 2]
    x = ay * bz - az * by
    result = np.empty((*x.shape, 3))
    result[..., 0] = x
    result[..., 1] = az * bx - ax * bz
    result[..., 2] = ax * by - ay * bx
    return result


def from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> Floats:
    """Turn by ``angle`` (…) about the unit vector ``axis`` (…, 3)."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)[..., None]
    unit = np.asarray(axis, dtype=np.float64)
    w, xyz = np.broadcast_arrays(np.cos(half), np.sin(half) * unit)
    return np.concatenate([w[..., :1], xyz], axis=-1)


def from_rotation_vector(vector: ArrayLike) -> Floats:
    """Exponential map: axis times angle ``(…, 3)`` to unit quaternions."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.sqrt(dot(v, v))[..., None]
    # numpy's sinc(x) is sin(πx)/(πx), smooth through zero.
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * v], axis=-1)


def to_rotation_vector(quaternion: ArrayLike) -> Floats:
    """Logarithm: unit quaternions to axis times angle, the angle within [0, π]."""
    q = np.asarray(quaternion, dtype=np.float64)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.sqrt(dot(q[..., 1:], q[..., 1:]))[..., None]
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    factor = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > _TINY)
    return factor * q[..., 1:]


def rotation_vector_between(first: ArrayLike, second: ArrayLike) -> Floats:
    """The shortest turn (…, 3) from one orientation (…, 4) to the other, in the first's frame."""
    return to_rotation_vector(multiply(conjugate(first), second))


def angle_between(first: ArrayLike, second: ArrayLike) -> Floats:
    """Angle of the rotation that leads from one orientation to the other, in [0, π]."""
    difference = multiply(conjugate(first), second)
    sine = np.linalg.norm(difference[..., 1:], axis=-1)
    return 2.0 * np.arctan2(sine, np.abs(difference[..., 0]))


def shortest_arc(start: ArrayLike, end: ArrayLike) -> Floats:
    """The smallest rotation that takes unit vectors ``start`` to unit vectors ``end``.

    It has no twist about either. Opposite vectors have no smallest rotation: there the turn is
    by π about an axis across ``start``.
    """
    a, b = np.broadcast_arrays(
        np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    )
    # 1 + a · b, without the cancellation where they are nearly opposite.
    w = 0.5 * np.sum((a + b) ** 2, axis=-1, keepdims=True)
    q = np.concatenate([w, cross(a, b)], axis=-1)
    # Opposite to within the accuracy of the cross product's direction.
    opposite = (w[..., 0] < 1.0) & (np.sum(q[..., 1:] ** 2, axis=-1) < 1e-16)
    if np.any(opposite):
        least = np.eye(3)[np.argmin(np.abs(a[opposite]), axis=-1)]
        q[opposite, 0] = 0.0
        q[opposite, 1:] = cross(a[opposite], least)
    return normalized(q)


def slerp(first: Floats, second: Floats, share: Floats) -> Floats:
    """Between two orientations (…, 4) the short way, at constant speed; share (…) in [0, 1].

    K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.
    """
    cosine = np.sum(first * second, axis=-1)
    near = np.where(cosine[..., None] < 0.0, -second, second)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    small = sine < 1e-6
    divisor = np.where(small, 1.0, sine)
    left = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / divisor)
    right = np.where(small, share, np.sin(share * angle) / divisor)
    result = normalized(left[..., None] * first + right[..., None] * near)
    # No digit is lost where nothing is blended.
    return np.where((share == 0.0)[..., None], first, result)


def slerp_in_sense(first: Floats, second: Floats, share: Floats, sense: Floats) -> Floats:
    """Between two orientations (…, 4), by shares (…,) 0…1, turning the way round that is nearer to
    a given one: ``sense`` (…, 3), a rotation vector in the first orientation's frame.

    Half a turn is as short the one way as the other, and must not be taken now this way and now
    that.
    """
    turn = rotation_vector_between(first, second)
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    against = (np.sum(turn * sense, axis=-1, keepdims=True) < 0.0) & (angle > 0.5 * np.pi)
    turn = np.where(against, turn * (1.0 - 2.0 * np.pi / np.maximum(angle, _TINY)), turn)
    return multiply(first, from_rotation_vector(share[..., None] * turn))


def lerp_rotation_vectors(start: Floats, end: Floats, share: Floats) -> Floats:
    """Between turns (…, 4) of joints, by a share (…), by way of their rotation vectors.

    The shortest way from one to the other changes sides where they are half a turn apart; an arm
    that bends one way and then the other goes through being straight instead.
    """
    part = share[..., None]
    return from_rotation_vector(
        (1.0 - part) * to_rotation_vector(start) + part * to_rotation_vector(end)
    )


def continuous(quaternions: ArrayLike) -> Floats:
    """Signs chosen so that neighbours along the *first* axis (frames) lie close together."""
    q = np.asarray(quaternions, dtype=np.float64)
    if len(q) < 2:
        return q.copy()
    flips = dot(q[1:], q[:-1]) < 0.0
    if not np.any(flips):
        return q.copy()
    signs = np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)
    return np.concatenate([q[:1], q[1:] * signs[..., None]], axis=0)


def from_matrix(matrix: ArrayLike) -> Floats:
    """Rotation matrices ``(…, 3, 3)`` to unit quaternions with w ≥ 0 (Shepperd's method)."""
    m = np.asarray(matrix, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Four times the square of each component; the largest is the safe one to divide by.
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], -1)
    wx, wy, wz = (
        m[..., 2, 1] - m[..., 1, 2],
        m[..., 0, 2] - m[..., 2, 0],
        m[..., 1, 0] - m[..., 0, 1],
    )
    xy, xz, yz = (
        m[..., 0, 1] + m[..., 1, 0],
        m[..., 0, 2] + m[..., 2, 0],
        m[..., 1, 2] + m[..., 2, 1],
    )
    candidates = np.stack(
        [
            np.stack([squares[..., 0], wx, wy, wz], -1),
            np.stack([wx, squares[..., 1], xy, xz], -1),
            np.stack([wy, xy, squares[..., 2], yz], -1),
            np.stack([wz, xz, yz, squares[..., 3]], -1),
        ],
        -2,
    )
    best = np.argmax(squares, axis=-1)[..., None, None]
    q = normalized(np.take_along_axis(candidates, best, axis=-2)[..., 0, :])
    return np.where(q[..., :1] < 0.0, -q, q)


def to_matrix(quaternion: ArrayLike) -> Floats:
    """Unit quaternions to rotation matrices ``(…, 3, 3)``."""
    q = np.asarray(quaternion, dtype=np.float64)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def less_whole_turns(angle: Floats) -> Floats:
    """The same angles (…,) within [−π, π]."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def rotate_in_plane(vectors: Floats, angle: float | Floats) -> Floats:
    """Plane vectors ``(…, 2)`` turned anticlockwise by angles ``(…,)``."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


# --- Quaternions (…, 4) to and from the values of Blender's rotation modes ------------------------
#
# A mode is ``"QUATERNION"``, ``"AXIS_ANGLE"`` (angle, x, y, z) or one of the :data:`EULER_ORDERS`.


EULER_ORDERS: Final = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


def from_mode_values(values: Floats, mode: str) -> Floats:
    """Unit quaternions (…, 4) of values (…, 3 or 4) of a rotation mode.

    A quaternion of no length is no rotation, as in Blender.
    """
    if mode not in ("QUATERNION", "AXIS_ANGLE"):
        return from_euler(values, mode)
    if mode == "AXIS_ANGLE":
        values = from_axis_angle(normalized(values[..., 1:]), values[..., 0])
    # Of an axis of no length the angle remains, and is taken off here.
    unit = normalized(values)
    return np.where(np.any(unit, axis=-1, keepdims=True), unit, IDENTITY)


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
