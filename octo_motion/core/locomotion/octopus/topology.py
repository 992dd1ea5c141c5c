# SPDX-License-Identifier: GPL-3.0-or-later
"""Quads between rows, rings and holes of vertices: which vertices make a face, not where they are.

A loop of vertices runs anticlockwise seen from outside, so that every face looks outwards.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats

Indices = NDArray[np.int64]


def sheet_quads(sheet: Indices) -> Indices:
    """Faces of a grid of vertices (…, rows, columns), as (…, rows − 1, columns − 1, 4).

    They look towards rows × columns (right-handed).
    """
    return np.stack(
        [sheet[..., :-1, :-1], sheet[..., 1:, :-1], sheet[..., 1:, 1:], sheet[..., :-1, 1:]],
        axis=-1,
    )


def closed(sheet: Indices) -> Indices:
    """The grid (…, columns) with its first column again after the last, to close it to a tube."""
    return np.concatenate([sheet, sheet[..., :1]], axis=-1)


def ring_quads(outer: Indices, inner: Indices) -> Indices:
    """Faces from a closed loop (…, n) to the loop (…, n) inside or above it, as (…, n, 4)."""
    return np.stack(
        [outer, np.roll(outer, -1, axis=-1), np.roll(inner, -1, axis=-1), inner], axis=-1
    )


def cap_size(loop_length: int) -> tuple[int, int]:
    """Sides (a, b), a even, of the grid that fills a loop of ``2 (a + b)`` vertices."""
    a = max(2, 2 * round(loop_length / 8))
    return a, loop_length // 2 - a


def cap_grid(loop: Indices, interior: Indices, a: int) -> Indices:
    """Vertices of a filling grid, (…, a + 1, b + 1), from its border and its inside.

    Args:
        loop: (…, 2 (a + b)); the corner (0, 0) comes first, then side a.
        interior: (…, a − 1, b − 1).
        a: faces along the first side.
    """
    b = loop.shape[-1] // 2 - a
    grid = np.empty((*loop.shape[:-1], a + 1, b + 1), dtype=loop.dtype)
    grid[..., :, 0] = loop[..., : a + 1]
    grid[..., a, :] = loop[..., a : a + b + 1]
    grid[..., ::-1, b] = loop[..., a + b : 2 * a + b + 1]
    grid[..., 0, 1:b] = loop[..., : 2 * a + b : -1]
    grid[..., 1:a, 1:b] = interior
    return grid


def cap_interior(border: Floats, a: int) -> Floats:
    """Points inside a filled loop: Coons' patch.

    Args:
        border: (…, 2 (a + b), d), positions (or anything else that blends) on the loop.
        a: faces along the first side.

    Returns:
        (…, a − 1, b − 1, d)
    """
    b = border.shape[-2] // 2 - a
    bottom = border[..., : a + 1, :]
    right = border[..., a : a + b + 1, :]
    top = border[..., a + b : 2 * a + b + 1, :][..., ::-1, :]
    left = np.concatenate([border[..., 2 * a + b :, :], border[..., :1, :]], axis=-2)[..., ::-1, :]
    u = (np.arange(1, a) / a)[:, None, None]
    v = (np.arange(1, b) / b)[None, :, None]
    corners = (
        (1 - u) * (1 - v) * bottom[..., None, :1, :]
        + u * (1 - v) * bottom[..., None, -1:, :]
        + u * v * top[..., None, -1:, :]
        + (1 - u) * v * top[..., None, :1, :]
    )
    return (
        (1 - v) * bottom[..., 1:-1, None, :]
        + v * top[..., 1:-1, None, :]
        + (1 - u) * left[..., None, 1:-1, :]
        + u * right[..., None, 1:-1, :]
        - corners
    )


def patch_border(patch: Indices) -> Indices:
    """The loops (…, 2 (r + c)) around holes that take the place of grids (…, r + 1, c + 1)."""
    return np.concatenate(
        [
            patch[..., :-1, 0],
            patch[..., -1, :-1],
            patch[..., :0:-1, -1],
            patch[..., 0, :0:-1],
        ],
        axis=-1,
    )
