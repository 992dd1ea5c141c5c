# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors (…, 3, batch) and unit quaternions (4, batch): the batch last, components before it."""

from __future__ import annotations

from typing import Final

import numpy as np

from . import arrays
from .arrays import IDENTITY, Floats

_TINY: Final = 1e-12
_FEW: Final = 512
"""Vectors and quaternions up to which a call of numpy takes longer than what it does: there as few
calls as can be, with the same numbers to the last bit; with 1,000 quaternions that is slower."""
_NEXT: Final = np.array([1, 2, 0])
_LAST: Final = np.array([2, 0, 1])
_HAMILTON: Final = (
    ((0, 0), (1, 1, np.subtract), (2, 2, np.subtract), (3, 3, np.subtract)),
    ((0, 1), (1, 0, np.add), (2, 3, np.add), (3, 2, np.subtract)),
    ((0, 2), (2, 0, np.add), (3, 1, np.add), (1, 3, np.subtract)),
    ((0, 3), (3, 0, np.add), (1, 2, np.add), (2, 1, np.subtract)),
)
"""Which components of two quaternions make each of their product's: those that are multiplied, and
whether that is added or taken off."""
_FIRSTS: Final = np.array([[term[0] for term in terms] for terms in _HAMILTON]).T
_SECONDS: Final = np.array([[term[1] for term in terms] for terms in _HAMILTON]).T
_SIGNS: Final = np.array(
    [[-1.0 if np.subtract in term else 1.0 for term in terms] for terms in _HAMILTON]
).T
"""(terms, components), the same as tables."""


def dot(first: Floats, second: Floats) -> Floats:
    """Scalar product (…, batch) of vectors of any number of components."""
    return np.einsum("...cb,...cb->...b", first, second)


def normalized(vectors: Floats) -> Floats:
    """Vectors (…, 3, batch) at unit length; those of no length stay zero."""
    return vectors * (1.0 / np.maximum(np.sqrt(dot(vectors, vectors)), _TINY))[..., None, :]


def cross(first: Floats, second: Floats) -> Floats:
    """Vector product (…, 3, batch)."""
    a, b = first, second
    if a.size <= 3 * _FEW and b.size <= 3 * _FEW:
        few = a.take(_NEXT, -2) * b.take(_LAST, -2)
        few -= a.take(_LAST, -2) * b.take(_NEXT, -2)
        return few
    shape = a.shape if a.shape == b.shape else np.broadcast_shapes(a.shape, b.shape)
    result = np.empty(shape)
    lost = np.empty((*result.shape[:-2], result.shape[-1]))
    for axis, (one, other) in enumerate(((1, 2), (2, 0), (0, 1))):
        part = result[..., axis, :]
        np.multiply(a[..., one, :], b[..., other, :], out=part)
        np.multiply(a[..., other, :], b[..., one, :], out=lost)
        np.subtract(part, lost, out=part)
    return result


def conjugate(turn: Floats) -> Floats:
    """The opposite turns (4, batch)."""
    return turn * np.array([1.0, -1.0, -1.0, -1.0])[:, None]


def rotate(turn: Floats, vectors: Floats) -> Floats:
    """Vectors (…, 3, batch) turned by quaternions (4, batch)."""
    if vectors.ndim > turn.ndim:
        # Several by each: by way of matrices.
        return np.einsum("ijb,...jb->...ib", to_matrix(turn), vectors)
    twice = cross(turn[1:], vectors)
    twice += twice
    result = turn[0] * twice
    result += vectors
    result += cross(turn[1:], twice)
    return result


def to_matrix(turn: Floats) -> Floats:
    """Matrices (3, 3, batch) of unit quaternions (4, batch)."""
    doubled = 2.0 * turn[1:]
    (wx, wy, wz), (xx, xy, xz) = turn[0] * doubled, turn[1] * doubled
    yy, yz, zz = turn[2] * doubled[1], turn[2] * doubled[2], turn[3] * doubled[2]
    result = np.empty((3, 3, turn.shape[-1]))
    result[0, 0], result[0, 1], result[0, 2] = 1.0 - (yy + zz), xy - wz, xz + wy
    result[1, 0], result[1, 1], result[1, 2] = xy + wz, 1.0 - (xx + zz), yz - wx
    result[2, 0], result[2, 1], result[2, 2] = xz - wy, yz + wx, 1.0 - (xx + yy)
    return result


def multiply(first: Floats, second: Floats) -> Floats:
    """Quaternions (4, batch) that turn by the second and then by the first."""
    if first.size <= 4 * _FEW and second.size <= 4 * _FEW:
        products = first.take(_FIRSTS, 0) * second.take(_SECONDS, 0)
        products *= _SIGNS.reshape(4, 4, *(1,) * (products.ndim - 2))
        return np.add.reduce(products, axis=0)
    alike = first.shape == second.shape
    result = np.empty(first.shape if alike else np.broadcast_shapes(first.shape, second.shape))
    a, b, part = list(first), list(second), np.empty(result.shape[1:])
    for total, (begin, *rest) in zip(result, _HAMILTON, strict=True):
        np.multiply(a[begin[0]], b[begin[1]], out=total)
        for one, other, add in rest:
            np.multiply(a[one], b[other], out=part)
            add(total, part, out=total)
    return result


def shortest_arc(start: Floats, goal: Floats) -> Floats:
    """Quaternions (4, batch) of the smallest turn from vectors (3, batch) of any length to others.

    A vector of no length turns nothing. Opposite vectors turn by π about an axis across the
    first.
    """
    size = np.sqrt(dot(start, start) * dot(goal, goal))
    turn = np.empty((4, size.shape[-1]))
    turn[0] = size + dot(start, goal)
    turn[1:] = cross(start, goal)
    length = np.sqrt(dot(turn, turn))
    there = size > _TINY * _TINY
    definite = there & (length > 1e-8 * size)
    if not np.all(definite):
        opposite = there & ~definite
        turn[:, opposite] = arrays.shortest_arc(
            arrays.normalized(np.broadcast_to(start, goal.shape)[:, opposite].T),
            arrays.normalized(goal[:, opposite].T),
        ).T
        turn[:, ~there] = IDENTITY[:, None]
        length = np.where(definite, length, 1.0)
    return turn / length


def cumulative_sum(values: Floats) -> Floats:
    """Sums of the first, the first two … rows (n, …) of values, which are changed in place.

    Long rows are added several times faster than ``numpy.cumsum`` adds along them.
    """
    for row in range(1, len(values)):
        values[row] += values[row - 1]
    return values
