# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors and rotations one at a time, as tuples of floats.

A call of numpy costs about a microsecond whatever the size of its arrays, and a tick of the haptic
loop needs some hundred operations on three numbers each. In plain floats they cost a tenth of that.
"""

from __future__ import annotations

from math import acos, cos, isfinite, sin, sqrt
from typing import Final

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ZERO: Final[Vector] = (0.0, 0.0, 0.0)
IDENTITY: Final[Quaternion] = (1.0, 0.0, 0.0, 0.0)

_SMALL: Final = 1e-9
"""Length without a direction; in double precision the sine of such an angle is the angle."""


def add(a: Vector, b: Vector) -> Vector:
    """``a + b``."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """``a − b``."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector, factor: float) -> Vector:
    """``a · factor``."""
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def add_scaled(a: Vector, b: Vector, factor: float) -> Vector:
    """``a + b · factor``."""
    return (a[0] + b[0] * factor, a[1] + b[1] * factor, a[2] + b[2] * factor)


def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a: Vector) -> float:
    """Euclidean norm."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def clamp_length(a: Vector, most: float) -> Vector:
    """The vector itself, or one of the same direction with the length ``most``."""
    size = length(a)
    return a if size <= most else scale(a, most / size)


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: turns by ``b``, then by ``a``."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def conjugate(q: Quaternion) -> Quaternion:
    """The inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q: Quaternion, a: Vector) -> Vector:
    """A vector turned by a unit quaternion."""
    axis = (q[1], q[2], q[3])
    twice = scale(cross(axis, a), 2.0)
    return add(add_scaled(a, twice, q[0]), cross(axis, twice))


def normalized(q: Quaternion) -> Quaternion | None:
    """The quaternion with length one; None where it has no direction or is not finite."""
    size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if not isfinite(size) or size < _SMALL:
        return None
    return (q[0] / size, q[1] / size, q[2] / size, q[3] / size)


def from_rotation_vector(a: Vector) -> Quaternion:
    """Rotation about ``a`` by its length."""
    angle = length(a)
    if angle < _SMALL:
        return (1.0, 0.5 * a[0], 0.5 * a[1], 0.5 * a[2])
    share = sin(0.5 * angle) / angle
    return (cos(0.5 * angle), a[0] * share, a[1] * share, a[2] * share)


def to_rotation_vector(q: Quaternion) -> Vector:
    """Axis times angle, at most half a turn."""
    if q[0] < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    share = 2.0 if sine < _SMALL else 2.0 * acos(min(1.0, q[0])) / sine
    return (q[1] * share, q[2] * share, q[3] * share)


def integrate(q: Quaternion, angular_velocity: Vector, seconds: float) -> Quaternion:
    """An orientation after turning with an angular velocity (rad/s) seen from the world."""
    moved = multiply(from_rotation_vector(scale(angular_velocity, seconds)), q)
    return normalized(moved) or q
