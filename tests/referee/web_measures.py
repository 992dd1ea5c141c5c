# SPDX-License-Identifier: GPL-3.0-or-later
"""How a web between arms fares: below the ground, drawn long, turned inside out.

Its two sheets are told by where their faces look at rest. A place of the upper sheet is inside out
where it looks to where the lower one is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mathutils.kdtree import KDTree

from .creature_measures import Worst
from .recording import Floats, Integers, Recording, Skin
from .surface import Surface

_LEVEL = 0.3
"""Of a face's normal at rest, how much lies across the web for the face to be in a sheet."""


@dataclass(frozen=True)
class Web:
    """The worst of a web at any moment."""

    deepest: Worst
    """Arm lengths below the ground."""
    stretch: Worst
    """Times its length at rest that an edge has."""
    inside_out: Worst
    """Share of the upper sheet's area at rest whose faces look to the lower sheet."""
    turned_over: float
    """The mean of that share over all moments."""


def web(recording: Recording, surface: Surface, length: float) -> Web:
    """Measure the webs of all skins together."""
    found = [_of(skin, surface, length) for skin in recording.skins if skin.web.any()]
    worst = [
        Worst.of(np.stack(each, axis=-1), recording.frames, [""] * len(found))
        for each in zip(*found, strict=True)
    ]
    mean = max(float(np.mean(through)) for _, _, through in found)
    return Web(*worst, turned_over=mean)


def _of(skin: Skin, surface: Surface, length: float) -> tuple[Floats, Floats, Floats]:
    """Depth, stretch and share inside out (moments,) each."""
    depths = np.maximum(surface.depths(skin.points[:, skin.web]).max(axis=1), 0.0) / length
    edges = skin.edges[skin.web[skin.edges].any(axis=1)]
    rest = np.linalg.norm(skin.rest[edges[:, 0]] - skin.rest[edges[:, 1]], axis=-1)
    lengths = np.linalg.norm(skin.points[:, edges[:, 0]] - skin.points[:, edges[:, 1]], axis=-1)
    return depths, (lengths / rest).max(axis=1), _inside_out(skin)


def _inside_out(skin: Skin) -> Floats:
    faces = np.array([face for face in skin.faces if skin.web[list(face)].any()])
    # Across the web as a whole, however it is turned in the world; either side may be up.
    own = skin.rest[skin.web]
    across = np.linalg.svd(own - own.mean(axis=0), full_matrices=False)[2][2]
    normals = _normals(skin.rest[faces])
    upright = normals @ across / np.linalg.norm(normals, axis=-1)
    upper, lower = faces[upright > _LEVEL], faces[upright < -_LEVEL]
    assert len(upper) == len(lower) > 0
    partner = _partners(skin, upper, lower)
    areas = np.linalg.norm(_normals(skin.rest[upper]), axis=-1)
    # Where an arm's own skin is a corner, the others tell.
    known = (partner[upper] >= 0)[..., None]
    through = np.zeros(len(skin.points))
    for moment, points in enumerate(skin.points.astype(float)):
        up = np.where(known, points[upper] - points[partner[upper]], 0.0).sum(axis=1)
        turned = np.sum(_normals(points[upper]) * up, axis=-1) < 0.0
        through[moment] = areas[turned].sum() / areas.sum()
    return through


def _normals(corners: Floats) -> Floats:
    """Of faces with corners (faces, 4, 3); their length is twice the area."""
    return np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def _partners(skin: Skin, upper: Integers, lower: Integers) -> Integers:
    """(vertices,) of the lower sheet below each of the upper one at rest, -1 for all others."""
    above, below = (np.unique(each[skin.web[each]]) for each in (upper, lower))
    tree = KDTree(len(below))
    for number in below.tolist():
        tree.insert(skin.rest[number].tolist(), number)
    tree.balance()
    partner = np.full(len(skin.web), -1)
    for number in above.tolist():
        partner[number] = tree.find(skin.rest[number].tolist())[1]
    return partner
