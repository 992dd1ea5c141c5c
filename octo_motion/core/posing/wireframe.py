# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines that show a puppet: capsules, pins and the arrow of a force."""

from __future__ import annotations

from typing import Final

import numpy as np

from ..rotations import Floats, cross, normalized

_SIDES: Final = 12
_CALM: Final = np.array([0.45, 0.65, 0.80])
_LOADED: Final = np.array([0.95, 0.80, 0.25])
_YIELDING: Final = np.array([0.95, 0.15, 0.10])


def load_colours(loads: Floats) -> Floats:
    """(bodies, 3) from calm over loaded (half of what a joint can bear) to giving way (1)."""
    share = np.clip(loads, 0.0, 1.0)[:, None]
    low = _CALM + 2.0 * np.minimum(share, 0.5) * (_LOADED - _CALM)
    return low + 2.0 * np.maximum(share - 0.5, 0.0) * (_YIELDING - _LOADED)


def capsule_lines(ends: Floats, radii: Floats) -> Floats:
    """Lines (bodies, lines, 2, 3) of capsules with axes (bodies, 2, 3): rings at both ends, sides,
    and half circles over the caps.
    """
    along = normalized(ends[:, 1] - ends[:, 0])
    along = np.where(np.abs(along).sum(axis=1, keepdims=True) > 0.0, along, [0.0, 0.0, 1.0])
    least = np.eye(3)[np.argmin(np.abs(along), axis=1)]
    right = normalized(cross(along, least))
    up = cross(along, right)
    turn = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
    around = np.cos(turn)[:, None, None] * right + np.sin(turn)[:, None, None] * up
    around = np.moveaxis(around, 0, 1) * radii[:, None, None]
    parts = []
    for end, way in ((0, -1.0), (1, 1.0)):
        ring = ends[:, end, None] + around
        parts.append(np.stack([ring[:, :-1], ring[:, 1:]], axis=2))
        half = np.linspace(0.0, np.pi, _SIDES // 2 + 1)
        for side in (right, up):
            cap = (
                np.cos(half)[:, None, None] * side + np.sin(half)[:, None, None] * (way * along)
            ) * radii[:, None]
            arc = ends[:, end, None] + np.moveaxis(cap, 0, 1)
            parts.append(np.stack([arc[:, :-1], arc[:, 1:]], axis=2))
    quarter = around[:, : _SIDES : _SIDES // 4]
    parts.append(np.stack([ends[:, :1] + quarter, ends[:, 1:] + quarter], axis=2))
    return np.concatenate(parts, axis=1)


def arrow_lines(start: Floats, end: Floats, eye: Floats) -> Floats:
    """An arrow (lines, 2, 3) whose head is seen flat from the eye's direction."""
    way = end - start
    length = float(np.linalg.norm(way))
    if length == 0.0:
        return np.zeros((0, 2, 3))
    along = way / length
    side = np.cross(along, eye)
    size = float(np.linalg.norm(side))
    side = (
        side / size
        if size > 1e-9
        else normalized(np.cross(along, np.eye(3)[np.argmin(np.abs(along))]))
    )
    back = end - 0.22 * way
    head = 0.09 * length
    return np.array([[start, end], [end, back + head * side], [end, back - head * side]])


def pin_lines(points: Floats, size: float) -> Floats:
    """Octahedra (lines, 2, 3) about points (pins, 3)."""
    corners = size * np.concatenate([np.eye(3), -np.eye(3)])
    edges = [(a, b) for a in range(6) for b in range(a + 1, 6) if b != a + 3]
    lines = np.array([[corners[a], corners[b]] for a, b in edges])
    return (points[:, None, None] + lines).reshape(-1, 2, 3)
