# SPDX-License-Identifier: GPL-3.0-or-later
"""How high a walking body travels over its ground, and how far it leans with it.

A body does not follow every bump: the heights under it, across its way and along it, are weighed
together as a function of the distance travelled. So the body's place at a frame depends on
nothing but where on its route it is then.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...rotations import Floats, continuous, multiply, normalized, shortest_arc
from ..path import Bearings, Route, TravelSettings, walked_at
from .surface import Ground

_PER_REACH: Final = 24
"""Places of the table within the arms' reach."""
_ACROSS: Final = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
"""Where the ground is felt across the way, in reaches."""
_SHARES: Final = np.array([1.0, 2.0, 2.0, 2.0, 1.0]) / 8.0
_HEADROOM: Final = 0.55
"""Share of its height over the ground that a body keeps over a bump right under it."""
_MOST_HEADROOM: Final = 0.9
"""The same at most, where that is not enough for its skin."""
_LIFTS: Final = 3
"""How often what a body lacks of it is added, evened out: that alone takes some of it away."""
_UNDER: Final = 0.25
"""Reaches before, behind and beside the body's centre that count as right under it."""
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class BodyLine:
    """A walking body's places along its route, also before and after it."""

    route: Route
    settings: TravelSettings
    bearings: Bearings
    clearance: float
    """Metres from the ground to the body's centre."""
    start: float
    """Metres along the route of the table's first place."""
    spacing: float
    heights: Floats
    """(n,) world Z of the ground as the body feels it."""
    uprights: Floats
    """(n, 3) unit vectors: which way up the body is."""
    ways: Floats
    """(n, 3) points of the route, world."""
    turns: Floats
    """(n, 4) orientations of the body as it would be upright, signs continuous."""

    def ride(self, positions: Floats, distance: Floats) -> tuple[Floats, Floats]:
        """The body's centre (…, 3) above points (…, 3) of its way, and its upright (…, 3).

        Seen from above the body stays on its route; a slope is as far below as level ground is.
        """
        upright = normalized(self._at(self.uprights, distance))
        centre = positions.copy()
        centre[..., 2] = self._at(self.heights, distance) + self.clearance / upright[..., 2]
        return centre, upright

    def at(self, distance: ArrayLike) -> tuple[Floats, Floats]:
        """World positions (…, 3) and orientations (…, 4) of the body at distances (…,)."""
        wanted = np.asarray(distance, dtype=np.float64)
        # As near to the route as footholds need: it costs a tenth of asking the route itself.
        centre, upright = self.ride(self._at(self.ways, wanted), wanted)
        return centre, leaning(upright, normalized(self._at(self.turns, wanted)))

    def _at(self, table: Floats, distance: Floats) -> Floats:
        """The table at distances (…,), by the cubic through its neighbours' slopes."""
        place = np.clip((distance - self.start) / self.spacing, 1.0, len(table) - 2.001)
        index = place.astype(np.int64)
        t = (place - index).reshape(*place.shape, *[1] * (table.ndim - 1))
        before, here, then, after = (table[index + step] for step in (-1, 0, 1, 2))
        slope, last = 0.5 * (then - before), 0.5 * (after - here)
        rise = then - here
        bend = slope + last - 2.0 * rise
        return here + t * (slope + t * (rise - slope - bend + t * bend))


def leaning(upright: Floats, rotations: Floats) -> Floats:
    """Orientations (…, 4) of upright bodies, tilted the shortest way."""
    return multiply(shortest_arc(np.broadcast_to(_UP, upright.shape), upright), rotations)


def body_line(
    route: Route,
    settings: TravelSettings,
    bearings: Bearings,
    ground: Ground,
    *,
    clearance: float,
    reach: float,
    lean: float,
    smoothing: float,
    under: float = 0.0,
) -> BodyLine:
    """The line of a body that walks on a ground.

    Args:
        route: where to.
        settings: how it travels.
        bearings: the route's directions.
        ground: what it walks on.
        clearance: metres from the ground to the body's centre.
        reach: metres that its arms are long.
        lean: 0 stays upright, 1 leans as the ground does.
        smoothing: reaches over which the ground is evened out along the way (standard deviation).
        under: metres from the body's centre to its lowest skin.
    """
    spacing, width = reach / _PER_REACH, smoothing * reach
    margin = 2.0 * settings.stride + 4.0 * width + reach
    count = int(np.ceil((route.length + 2.0 * margin) / spacing)) + 1
    distance = -margin + spacing * np.arange(count)
    positions, turns = walked_at(route, settings, bearings, distance)
    along = np.gradient(positions[:, :2], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    felt = ground.height(positions[:, None, :2] + reach * _ACROSS[:, None] * left[:, None])
    kernel = _bell(width / spacing)
    headroom = max(_HEADROOM * clearance, min(under, _MOST_HEADROOM * clearance))
    level = _over_bumps(
        _evened(felt @ _SHARES, kernel), felt, (clearance, headroom), _bell(0.5 * width / spacing)
    )
    ahead = np.gradient(level, spacing)
    # Least squares through the heights across the way.
    sideways = _evened(felt @ _ACROSS / (_ACROSS @ _ACROSS * reach), kernel)
    tilt = -ahead[:, None] * along - sideways[:, None] * left
    leaned = normalized(np.concatenate([tilt, np.ones((count, 1))], axis=1))
    uprights = normalized((1.0 - lean) * _UP + lean * leaned)
    return BodyLine(
        route=route,
        settings=settings,
        bearings=bearings,
        clearance=clearance,
        start=float(distance[0]),
        spacing=spacing,
        heights=level,
        uprights=uprights,
        ways=positions,
        turns=continuous(turns),
    )


def _over_bumps(
    level: Floats, felt: Floats, heights: tuple[float, float], kernel: Floats
) -> Floats:
    """Heights (n,) raised where a bump right under the body would come too near to it.

    Args:
        level: (n,) metres, the ground as it is evened out.
        felt: (n, places across the way) metres, the ground as it is.
        heights: metres of the body's centre above the level, and at least above the bump.
        kernel: by which what is lacking is evened out.
    """
    clearance, headroom = heights
    near = np.abs(_ACROSS) <= _UNDER
    top = _highest(felt[:, near].max(axis=1), int(np.ceil(_UNDER * _PER_REACH)))
    for _ in range(_LIFTS):
        level = level + _evened(np.maximum(top + headroom - (level + clearance), 0.0), kernel)
    return level


def _bell(deviation: float) -> Floats:
    """A Gauss bell that sums to 1, of whole steps."""
    half = max(1, int(np.ceil(4.0 * deviation)))
    steps = np.arange(-half, half + 1) / max(deviation, 1e-6)
    bell = np.exp(-0.5 * steps * steps)
    return bell / bell.sum()


def _evened(values: Floats, kernel: Floats) -> Floats:
    """Values (n,) averaged over their neighbours; beyond the ends they go on as they end."""
    half = len(kernel) // 2
    padded = (
        np.pad(values, half, mode="reflect", reflect_type="odd")
        if len(values) > half
        else (np.pad(values, half, mode="edge"))
    )
    return np.convolve(padded, kernel, mode="valid")


def _highest(values: Floats, reach: int) -> Floats:
    """The largest value (n,) within so many steps to either side."""
    padded = np.pad(values, reach, mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=-1)
