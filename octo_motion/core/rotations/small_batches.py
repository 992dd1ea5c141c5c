# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors (count, 3) and unit quaternions (count, 4), some hundred at a time, in few calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from . import arrays
from .arrays import Floats

_Of2: TypeAlias = Callable[[Floats, Floats], Floats]


def _vecdot(first: Floats, second: Floats) -> Floats:
    return np.einsum("...i,...i", first, second)


def _matvec(matrices: Floats, vectors: Floats) -> Floats:
    return (matrices @ vectors[:, :, None])[:, :, 0]


def _vecmat(vectors: Floats, matrices: Floats) -> Floats:
    return (vectors[:, None, :] @ matrices)[:, 0]


# Each a single call, which numpy has since 2.2: Blender 4.5 comes with an older one.
vecdot: Final[_Of2] = getattr(np, "vecdot", _vecdot)
"""Products ``a · b`` (…) of vectors (…, n)."""
matvec: Final[_Of2] = getattr(np, "matvec", _matvec)
"""Products ``M v`` (count, m) of matrices (count, m, n) and vectors (count, n)."""
vecmat: Final[_Of2] = getattr(np, "vecmat", _vecmat)
"""Products ``v M``, or ``Mᵀ v`` (count, n), of vectors (count, m) and matrices (count, m, n)."""


def multiply(first: Floats, second: Floats) -> Floats:
    """Hamilton products of (count, 4), as one linear map of all pairs of components."""
    return ((first @ _EACH) * (second @ _ALL)) @ _PRODUCT


def multiply_conjugate(first: Floats, second: Floats) -> Floats:
    """``first ∘ second⁻¹`` of unit quaternions (count, 4)."""
    return ((first @ _EACH) * (second @ _ALL)) @ _PRODUCT_INVERSE


def conjugate_multiply(first: Floats, second: Floats) -> Floats:
    """``first⁻¹ ∘ second`` of unit quaternions (count, 4)."""
    return ((first @ _EACH) * (second @ _ALL)) @ _INVERSE_PRODUCT


def to_matrix(quaternions: Floats) -> Floats:
    """Rotation matrices (count, 3, 3) of unit quaternions (count, 4)."""
    pairs = (quaternions @ _EACH) * (quaternions @ _ALL)
    return (pairs @ _MATRIX).reshape(-1, 3, 3)


def left_factor(quaternions: Floats) -> Floats:
    """What products need of their first quaternions (count, 4), for those that have many of them
    (count, 16).
    """
    return quaternions @ _EACH


def right_factor(quaternions: Floats) -> Floats:
    """The same of their second ones."""
    return quaternions @ _ALL


def product(left: Floats, right: Floats) -> Floats:
    """``multiply`` of such factors."""
    return (left * right) @ _PRODUCT


def inverse_product(left: Floats, right: Floats) -> Floats:
    """``conjugate_multiply`` of such factors."""
    return (left * right) @ _INVERSE_PRODUCT


def to_transforms(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Homogeneous matrices of rotations (count, 4, 4), and their transposes, both contiguous, of
    both factors of their quaternions.
    """
    pairs = left * right
    return (pairs @ _TRANSFORM).reshape(-1, 4, 4), (pairs @ _TRANSPOSED).reshape(-1, 4, 4)


def from_rotation_vector(vectors: Floats) -> Floats:
    """Unit quaternions (count, 4) of rotation vectors (count, 3)."""
    half = np.sqrt(vecdot(vectors, vectors))
    half *= 0.5
    result = np.empty((len(vectors), 4))
    result[:, 0] = np.cos(half)
    # sin(x)/2x, with a floor under x that changes no digit.
    np.maximum(half, 1e-9, out=half)
    np.multiply(vectors, (np.sin(half) / half * 0.5)[:, None], out=result[:, 1:])
    return result


def to_rotation_vector(quaternions: Floats) -> Floats:
    """Rotation vectors (count, 3), at most π long, of unit quaternions (count, 4)."""
    imaginary = quaternions[:, 1:]
    sine = np.sqrt(vecdot(imaginary, imaginary))
    real = quaternions[:, 0]
    factor = np.arctan2(sine, np.abs(real))
    # Where sine is 0 the vector is as well.
    factor /= sine + 1e-150
    factor *= np.copysign(2.0, real)
    return imaginary * factor[:, None]


def skew(vectors: Floats) -> Floats:
    """Matrices (count, 3, 3) of the cross products with (count, 3): ``skew(a) @ b = a × b``."""
    return (vectors @ _SKEW).reshape(-1, 3, 3)


def _basis_products(*, first: float, second: float) -> Floats:
    signs = np.array([1.0, -1.0, -1.0, -1.0])
    unit = np.eye(4)
    one = unit * (signs if first < 0.0 else 1.0)
    two = unit * (signs if second < 0.0 else 1.0)
    return arrays.multiply(one[:, None], two[None, :]).reshape(16, 4)


def _matrix_map() -> Floats:
    """Rows: products q_a q_b; columns: entries of the matrix of q, row by row."""
    result = np.zeros((16, 9))
    # v ↦ the imaginary part of q v q*.
    unit = np.eye(4)
    signs = np.array([1.0, -1.0, -1.0, -1.0])
    for a in range(4):
        for b in range(4):
            for column in range(3):
                turned = arrays.multiply(
                    arrays.multiply(unit[a], unit[1 + column]), unit[b] * signs
                )
                result[4 * a + b, column::3] = turned[1:]
    return result


# All pairs of components of two quaternions, one after another: matrix products of so few numbers
# take less time than numpy's broadcasting along short axes.
_EACH: Final = np.repeat(np.eye(4), 4, axis=1)
_ALL: Final = np.tile(np.eye(4), 4)
_PRODUCT: Final = _basis_products(first=1.0, second=1.0)
_PRODUCT_INVERSE: Final = _basis_products(first=1.0, second=-1.0)
_INVERSE_PRODUCT: Final = _basis_products(first=-1.0, second=1.0)
_MATRIX: Final = _matrix_map()
_TRANSFORM: Final = np.zeros((16, 16))
_TRANSFORM.reshape(16, 4, 4)[:, :3, :3] = _MATRIX.reshape(16, 3, 3)
# The last entry is the quaternion's length, squared: 1.
_TRANSFORM[:, 15] = np.eye(4).ravel()
_TRANSPOSED: Final = _TRANSFORM.reshape(16, 4, 4).transpose(0, 2, 1).reshape(16, 16).copy()
_SKEW: Final = np.zeros((3, 9))
for _row, _column, _axis, _sign in (
    (0, 1, 2, -1.0),
    (0, 2, 1, 1.0),
    (1, 0, 2, 1.0),
    (1, 2, 0, -1.0),
    (2, 0, 1, -1.0),
    (2, 1, 0, 1.0),
):
    _SKEW[_axis, 3 * _row + _column] = _sign
