# SPDX-License-Identifier: GPL-3.0-or-later
"""Suckers: round cups that take the place of patches of two by two faces under the arms."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from ...rotations import Floats, normalized
from .shape import OctopusShape
from .surface import SkinMaterial, Surface
from .topology import Indices, patch_border, sheet_quads
from .weights import Influences, along_arm

_MOST: Final = 4000
"""Of more suckers, only every second, third … gets made."""
_BARE_TIP: Final = 1
"""Patches at the tip without suckers."""
_FILL: Final = 0.45
"""Radius of a sucker in widths of its patch."""
_RINGS: Final = np.array([(1.0, 0.04), (0.95, 0.42), (0.62, 0.46), (0.42, 0.12)])
"""From foot over rim into the cup: radius, height over the skin, in radii of the sucker."""
_MATERIALS: Final = (
    SkinMaterial.UNDERSIDE,
    SkinMaterial.SUCKER,
    SkinMaterial.SUCKER,
    SkinMaterial.SUCKER,
)
_DIRECTIONS: Final = np.radians(225.0 + 45.0 * np.arange(8))
"""Of the vertices round a patch, from the one at its corner (0, 0)."""


def add_ventral_strips(
    surface: Surface, shape: OctopusShape, strips: Indices, points: Floats, distance: Floats
) -> None:
    """Faces of the arms' undersides, with suckers.

    Args:
        surface: takes the faces.
        shape: the artist's choices.
        strips: (arms, rows, columns + 1) vertices, rows outwards, columns even in number and
            from left to right, so that faces look down.
        points: (arms, rows, columns + 1, 3) their positions.
        distance: (rows,) from P₀.
    """
    pairs = (strips.shape[1] - 1) // 2
    lanes = (strips.shape[2] - 1) // 2
    row = 2 * np.arange(pairs)[:, None, None, None] + np.arange(3)[:, None]
    column = 2 * np.arange(lanes)[:, None, None] + np.arange(3)
    patches = strips[:, row, column]
    every = math.ceil(shape.arms * pairs * lanes / _MOST)
    pair = np.arange(pairs)
    with_sucker = (pair < pairs - _BARE_TIP) & (pair % every == 0)

    surface.add_quads(sheet_quads(patches[:, ~with_sucker]), SkinMaterial.UNDERSIDE)
    surface.add_quads(sheet_quads(strips[:, 2 * pairs :]), SkinMaterial.UNDERSIDE)
    _add_suckers(
        surface,
        patches[:, with_sucker],
        points[:, row, column][:, with_sucker],
        _rigid_to_arms(shape, distance[1 : 2 * pairs : 2][with_sucker]),
    )


def _rigid_to_arms(shape: OctopusShape, distance: Floats) -> Influences:
    """Influences (arms, suckers, 1, 1, k): a sucker keeps its form when its arm bends."""
    arm, along = np.broadcast_arrays(np.arange(shape.arms)[:, None], distance)
    influences = along_arm(shape, arm, along)
    return Influences(influences.bones[:, :, None, None], influences.weights[:, :, None, None])


def _add_suckers(
    surface: Surface, patches: Indices, points: Floats, influences: Influences
) -> None:
    """Suckers in patches (arms, suckers, lanes, 3, 3)."""
    along = np.mean(points[..., 2, :, :] - points[..., 0, :, :], axis=-2)
    across = np.mean(points[..., :, 2, :] - points[..., :, 0, :], axis=-2)
    width = np.minimum(np.linalg.norm(along, axis=-1), np.linalg.norm(across, axis=-1))
    radius = (_FILL * width)[..., None]
    u = normalized(along)
    v = normalized(across - np.sum(across * u, axis=-1, keepdims=True) * u)
    normal = np.cross(u, v)
    centre = points[..., 1, 1, :]

    circle = (
        u[..., None, :] * np.cos(_DIRECTIONS)[:, None]
        + v[..., None, :] * np.sin(_DIRECTIONS)[:, None]
    )
    rings = np.stack(
        [
            (centre + height * radius * normal)[..., None, :] + size * radius[..., None] * circle
            for size, height in _RINGS
        ],
        axis=-3,
    )
    ringwise = Influences(influences.bones[..., None, :], influences.weights[..., None, :])
    loop = surface.add_rings(patch_border(patches), rings, ringwise, _MATERIALS)
    surface.add_cap(loop, rings[..., -1, :, :], ringwise, SkinMaterial.SUCKER, first_side=2)
