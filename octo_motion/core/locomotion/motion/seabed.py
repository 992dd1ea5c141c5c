# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground below a body that swims: nothing holds on to it, and nothing goes into it.

The body stays over it, as high as its arms and its mantle want room, and its arms are kept off it
as those are that swing in a walk.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...content_cache import ContentCache, content_key
from ...rotations import Floats, normalized
from ...smoothing import covered
from ..ground import Ground, HeightField, sample_ground
from ..path import Route
from .job import EDGE, FINE, Floor

_ROOM: Final = 0.6
"""Arm lengths above the ground below which the middle of a body does not come, and as much to all
sides …"""
_BESIDE: Final = 0.2
"""… or so many below the tip of a mantle that dives ahead of it, if that is more."""
_STEP: Final = 0.05
"""Arm lengths between the places of the way at which that is looked for …"""
_GENTLE: Final = 4
"""… and to how many to either side, thrice, it is spread: the body rises before it has to."""
_RINGS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the room, to the sides, in which the ground is looked at …"""
_SIDES: Final = 16
"""… in so many directions."""
_AROUND: Final = 1.8
"""Arm lengths to all sides of the way that the ground is sampled."""
_HEADROOM: Final = 0.5
"""Arm lengths above the way up to which a surface is ground and not a roof."""
_NOWHERE: Final = 3.0
"""Arm lengths below the way: as deep as this is what has no faces."""

_known: Final[ContentCache[tuple[HeightField, HeightField]]] = ContentCache(2)


@dataclass(frozen=True, eq=False)
class Seabed:
    """What lies below a body all along its way through the water."""

    ground: Ground
    underfoot: Ground
    """The same as arms feel it: with its edges rounded."""
    radii: Sequence[Floats]
    """For each arm (bones + 1,) armature units from each joint to the skin below it."""
    distance: Floats
    """(n,) metres along the route …"""
    lift: Floats
    """… and by how many (n,) the body is higher there than its way."""

    def lifted(self, distance: Floats) -> Floats:
        """The same at distances (moments,)."""
        return np.interp(distance, self.distance, self.lift)


def seabed_below(
    floor: Floor, route: Route, places: Callable[[Floats], Floats], *, reach: float, ahead: float
) -> Seabed:
    """The ground below a swim.

    Args:
        floor: what lies there.
        route: of the body.
        places: where its centre is without that (n, 3), world, at distances (n,).
        reach: metres that arms are long.
        ahead: metres from the body's centre to the tip of what goes before it.
    """
    distance = np.linspace(
        0.0, route.length, max(int(np.ceil(route.length / _STEP / reach)), 1) + 1
    )
    path = places(distance)
    sizes = {"reach": _AROUND * reach, "spacing": FINE * reach, "headroom": _HEADROOM * reach}
    bare = float(path[:, 2].min()) - _NOWHERE * reach

    def below() -> tuple[HeightField, HeightField]:
        needed = np.zeros(len(path), dtype=bool)
        sampled = sample_ground(
            floor.triangles, path, needed, **sizes, content=floor.content, bare=bare
        )
        return sampled, sampled.rounded(EDGE * reach)

    key = content_key(floor.content, path, sizes, bare)
    ground, underfoot = _known.get(key, below)
    dives = ahead * np.maximum(-normalized(np.gradient(path, axis=0))[:, 2], 0.0)
    room = np.maximum(_ROOM * reach, dives + _BESIDE * reach)
    lacking = _height_over(ground, path, room) - path[:, 2]
    lift = covered(np.maximum(lacking, 0.0), _GENTLE, cyclic=route.cyclic)
    return Seabed(ground, underfoot, [each.radii for each in floor.skins], distance, lift)


def _height_over(ground: Ground, path: Floats, room: Floats) -> Floats:
    """(n,) how high a body is at least whose room (n,), a bowl, lies on the ground below (n, 3)."""
    turns = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    highest = np.full(len(path), -np.inf)
    for share in _RINGS:
        aside = share * room[:, None, None] * (around if share else around[:1])
        over = ground.height(path[:, None, :2] + aside).max(axis=1) + room * (1.0 - share**2)
        highest = np.maximum(highest, over)
    return highest
