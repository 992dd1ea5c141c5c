# SPDX-License-Identifier: GPL-3.0-or-later
"""What a ray hits: the capsules of a figure under the mouse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rotations import Floats
from .puppet import Figure, Pose, capsules_in_world, distances_to_axes

_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class Hit:
    """A place on a body."""

    body: int
    point: Floats
    """(3,) world."""
    distance: float
    """Along the ray."""


def pick(
    figure: Figure, pose: Pose, origin: Floats, direction: Floats, *, margin: float = 0.0
) -> Hit | None:
    """The body that a ray from an origin (3,) in a direction (3,) meets first, or else passes
    nearest to.

    It may be missed by ``margin``, a share of the distance: thin arms are hard to hit.
    """
    way = direction / np.linalg.norm(direction)
    ends = capsules_in_world(figure, pose)
    along, across, on_axis = _nearest(ends, origin, way)
    # Where the ray enters, to good accuracy, for a capsule seen from outside.
    depth = np.sqrt(np.maximum(figure.radii**2 - across**2, 0.0))
    hit = (across <= figure.radii) & (along > 0.0)
    if hit.any():
        entry = np.where(hit, along - depth, np.inf)
        body = int(np.argmin(entry))
        distance = float(max(entry[body], 0.0))
        return Hit(body, origin + distance * way, distance)
    missed = np.where(along > 0.0, across - figure.radii, np.inf) / np.maximum(along, _TINY)
    body = int(np.argmin(missed))
    if not missed[body] <= margin:
        return None
    return Hit(body, on_axis[body].copy(), float(along[body]))


def _nearest(ends: Floats, origin: Floats, way: Floats) -> tuple[Floats, Floats, Floats]:
    """Where a ray passes the axes (bodies, 2, 3): distance along it, gap, and point on the axis."""
    start, axis = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = (axis * axis).sum(axis=1)
    offset = start - origin
    lean = axis @ way
    inner = length - lean**2
    # The axis' point nearest to the ray's line; a parallel axis takes its nearer end.
    share = np.where(
        inner > _TINY,
        (lean * (offset @ way) - (axis * offset).sum(axis=1)) / np.maximum(inner, _TINY),
        (lean < 0.0).astype(np.float64),
    )
    points = start + np.clip(share, 0.0, 1.0)[:, None] * axis
    along = np.maximum((points - origin) @ way, 0.0)
    gap = np.linalg.norm(points - origin - along[:, None] * way, axis=1)
    return along, gap, points


def nearest_body(figure: Figure, pose: Pose, point: Floats) -> tuple[int, float]:
    """The body nearest to a point (3,), and how far its surface is; less than 0 within."""
    gaps = distances_to_axes(capsules_in_world(figure, pose), point) - figure.radii
    body = int(np.argmin(gaps))
    return body, float(gaps[body])
