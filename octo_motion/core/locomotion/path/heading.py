# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way a body turns as it goes along a route: a table over the distance, made once.

A direction of travel alone leaves open how the body is rolled about it, has no compass angle
where it is vertical, and jumps at a corner. The table settles all three for the whole route, so
that what a frame shows is a function of the frame's distance alone:

1. *Corners.* Directions follow the route's tangent with a delay, first forwards and then
   backwards, so that the two delays cancel: a corner is turned through evenly on both sides of
   it, and a smooth bend is left as it is. A route that doubles back is turned through to the left.
2. *Least roll.* A frame is carried along the directions by the smallest rotation from each to the
   next: a rotation-minimising frame of the dense table.
3. *Upright.* The frame is rolled, and likewise the compass heading turned, towards what "up" asks
   for. Where that is well defined it is kept exactly; near the vertical, where it spins or flips,
   it loses its hold, and afterwards it is approached gently.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, cos, exp, sin, sqrt
from typing import Final

import numpy as np

from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    continuous,
    from_matrix,
    less_whole_turns,
    multiply,
    normalized,
    rotate,
    rotate_in_plane,
    shortest_arc,
)
from ...smoothing import smooth_step
from .route import Route

_FEWEST: Final = 1024
_MOST: Final = 32768
"""Intervals of the table."""
_PER_CORNER: Final = 8
"""Intervals of the table within the corner radius."""
_MOST_CORNER: Final = 1.0 / 24.0
"""Corner radius as a share of the route, at most."""
_TAIL: Final = 12.0
"""Corner radii after which a delay is forgotten: e⁻¹²."""
_AT_JOINT: Final = 1e-12
"""Share of the route's parameter within which a sample lies at a joint: far above rounding, some
1e-15, and far below the table's intervals, 3e-5 and more."""

# Sine of the angle between travel and the vertical: up holds fully above the one, not at all
# below the other.
_HELD: Final = 0.35
_LOST: Final = 0.1

_UP: Final = np.array([0.0, 0.0, 1.0])
_FRONT: Final = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Bearings:
    """Directions and turns along a route at equal distances from its start to its end."""

    length: float
    """Metres of route that the table spans."""
    cyclic: bool
    carried: Floats
    """(n, 4) world orientations with local +Z along travel, carried with the least roll."""
    roll: Floats
    """(n,) radians about travel from the carried frame to the one whose −Y faces up."""
    compass: Floats
    """(n,) radians about world Z, unwrapped, from −Y to the horizontal direction of travel."""
    bend: Floats
    """(n, 2) how far travel has turned towards +X and +Y of the carried frame, radians."""
    lap: float
    """Radians about travel by which the carried frame of a closed route has turned after a lap."""

    def carried_at(self, distance: Floats) -> Floats:
        """Orientations ``(frames, 4)``, signs continuous along the route."""
        return normalized(self._between(self.carried, distance))

    def roll_at(self, distance: Floats) -> Floats:
        """Radians ``(frames,)``."""
        return self._between(self.roll, distance)

    def compass_at(self, distance: Floats) -> Floats:
        """Radians ``(frames,)``; beyond an end of a closed route on the next lap."""
        laps, rest = self._laps(distance)
        return self._between(self.compass, rest) + laps * (self.compass[-1] - self.compass[0])

    def bend_at(self, distance: Floats) -> Floats:
        """Radians ``(frames, 2)``; up to one lap beyond an end of a closed route."""
        laps, rest = self._laps(distance)
        value, whole = self._between(self.bend, rest), self.bend[-1]
        # On the next lap the carried frame stands turned by `lap`, so its axes see less of it.
        after = whole + rotate_in_plane(value, -self.lap)
        before = rotate_in_plane(value - whole, self.lap)
        lap = laps[:, None]
        return np.where(lap > 0.0, after, np.where(lap < 0.0, before, value))

    def _laps(self, distance: Floats) -> tuple[Floats, Floats]:
        if not self.cyclic:
            return np.zeros_like(distance), np.clip(distance, 0.0, self.length)
        # The very end belongs to the first lap.
        over = np.where(distance > self.length, np.floor(distance / self.length), 0.0)
        laps = np.where(distance < 0.0, np.floor(distance / self.length), over)
        return laps, distance - laps * self.length

    def _between(self, table: Floats, distance: Floats) -> Floats:
        """The table at distances ``(frames,)``, by the cubic through its neighbours' slopes."""
        first = 2.0 * table[:1] - table[1:2]
        last = 2.0 * table[-1:] - table[-2:-1]
        padded = np.concatenate([first, table, last])
        place = distance * ((len(table) - 1) / self.length)
        index = np.clip(place.astype(np.int64), 0, len(table) - 2)
        t = (place - index).reshape(-1, *[1] * (table.ndim - 1))
        p0, p1, p2, p3 = (padded[index + step] for step in range(4))
        slope, reach = p2 - p0, p3 - p1
        ends = (2.0 * t - 3.0) * t * t
        cubic = p1 + ends * (p1 - p2)
        return cubic + 0.5 * t * (1.0 - t) * ((1.0 - t) * slope - t * reach)


def bearings(route: Route, corner: float, settle: float) -> Bearings:
    """The table of a route.

    Args:
        route: what is travelled.
        corner: metres before and after a sharp corner within which most of it is turned through.
        settle: metres within which a body that is not upright comes most of the way there.
    """
    corner = min(corner, _MOST_CORNER * route.length)
    count = int(np.clip(np.ceil(_PER_CORNER * route.length / corner), _FEWEST, _MOST))
    spacing = route.length / count
    corner = max(corner, 4.0 * spacing)
    samples = route.parameter_at(np.linspace(0.0, route.length, count + 1))
    raw = route.tangent(_past_joints(samples, route.breaks))
    travel = _rounded(raw, exp(-spacing / corner), int(_TAIL * corner / spacing), route.cyclic)

    carried = _carry(travel)
    local = rotate(conjugate(carried[:-1]), travel[1:])
    across = local[:, :2]
    sine = np.hypot(across[:, 0], across[:, 1])
    angle = np.arctan2(sine, local[:, 2])
    factor = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0)
    bend = np.concatenate([np.zeros((1, 2)), np.cumsum(factor[:, None] * across, axis=0)])

    lap = multiply(conjugate(carried[0]), carried[-1])
    around = 2.0 * atan2(lap[3], lap[0]) if route.cyclic else 0.0
    level = np.hypot(travel[:, 0], travel[:, 1])
    up = rotate(conjugate(carried), _UP)
    roll = _held_angle(
        np.arctan2(up[:, 0], -up[:, 1]), level, spacing / settle, -around, route.cyclic
    )
    compass = _held_angle(
        np.arctan2(travel[:, 0], -travel[:, 1]), level, spacing / settle, 0.0, route.cyclic
    )
    return Bearings(route.length, route.cyclic, continuous(carried), roll, compass, bend, around)


def _past_joints(samples: Floats, breaks: Floats) -> Floats:
    """Parameters ``(n,)`` of which those at a joint of the route's segments are exactly there.

    Directions jump at a corner, and a sample there has the one that follows. Rounding alone would
    choose between the two, and the same route elsewhere would turn one sample earlier or later.
    """
    joint = breaks[np.searchsorted(breaks, samples - _AT_JOINT)]
    return np.where(np.abs(samples - joint) <= _AT_JOINT, joint, samples)


def _rounded(raw: Floats, keep: float, tail: int, cyclic: bool) -> Floats:  # noqa: FBT001
    """Directions ``(n, 3)`` with their corners rounded off, by a delay there and back.

    Both delays need a run-up: a closed route's other end, or the route's own bend carried on
    beyond its end (the directions mirrored through the last one).
    """
    if cyclic:
        # The end is the start again, also where a corner lies there.
        raw = _through_the_side(np.concatenate([raw[:-1], raw[:1]]))
        raw[0] = raw[-1]
        before, after = raw[-1 - tail : -1], raw[1 : 1 + tail]
    else:
        raw = _through_the_side(raw)
        before = _mirrored(raw[tail:0:-1], raw[0])
        after = _mirrored(raw[-2 : -2 - tail : -1], raw[-1])
    there = _delayed(np.concatenate([before, raw, after]), keep)
    back = _delayed(there[::-1], keep)[::-1]
    result = back[tail : tail + len(raw)]
    if cyclic:
        result[-1] = result[0]
    return result


def _through_the_side(raw: Floats) -> Floats:
    """Directions ``(n, 3)`` that turn back by way of the left, or of −Y if they are vertical.

    From a direction to its opposite no way is shorter than the others; one sample to the side
    settles it.
    """
    result = raw.copy()
    left = np.cross(_UP, raw[:-1])
    vertical = np.linalg.norm(left, axis=-1, keepdims=True) < 1e-3
    back = np.sum(raw[1:] * raw[:-1], axis=-1) < -1.0 + 1e-4
    result[1:][back] = normalized(np.where(vertical, _FRONT, left))[back]
    return result


def _mirrored(directions: Floats, through: Floats) -> Floats:
    """Unit vectors ``(n, 3)`` turned by half a turn about the unit vector ``through``."""
    return 2.0 * np.sum(directions * through, axis=-1, keepdims=True) * through - directions


def _delayed(directions: Floats, keep: float) -> Floats:
    """Directions that keep the share ``keep`` of their angle to the given ones at each step.

    One after the other by nature, and so in plain Python; a table is made once for all frames.
    """
    (x, y, z), share = directions[0].tolist(), 1.0 - keep
    result = []
    for u, v, w in directions.tolist():
        dot = x * u + y * v + z * w
        if dot > 0.999:
            a, b = keep, share
        elif dot > -1.0 + 1e-9:
            angle = acos(dot)
            a, b = sin(keep * angle) / sin(angle), sin(share * angle) / sin(angle)
        else:
            a, b = 1.0, 0.0
        x, y, z = a * x + b * u, a * y + b * v, a * z + b * w
        size = sqrt(x * x + y * y + z * z)
        x, y, z = x / size, y / size, z / size
        result.append((x, y, z))
    return np.array(result)


def _carry(travel: Floats) -> Floats:
    """Orientations ``(n, 4)`` with +Z along ``travel`` (n, 3), each the last turned the least.

    The first has its −Y facing up, or to world −Y where travel starts vertically.
    """
    first = travel[0]
    upward = _UP if np.hypot(first[0], first[1]) > 1e-6 else _FRONT
    front = normalized(upward - np.sum(upward * first) * first)
    side = np.cross(first, front)
    start = from_matrix(np.stack([side, -front, first], axis=-1))
    # The product of all turns up to each sample, by doubling the number of factors.
    turns = np.concatenate([IDENTITY[None], shortest_arc(travel[:-1], travel[1:])])
    reach = 1
    while reach < len(turns):
        turns[reach:] = multiply(turns[reach:], turns[:-reach])
        reach *= 2
    return normalized(multiply(turns, start))


def _held_angle(
    wanted: Floats,
    level: Floats,
    pace: float,
    lap: float,
    cyclic: bool,  # noqa: FBT001
) -> Floats:
    """An angle that keeps to the wanted one where that holds, and comes back to it elsewhere.

    Args:
        wanted: (n,) radians, any branch.
        level: (n,) sine of the angle between travel and the vertical, the hold of ``wanted``.
        pace: one step's share of the way back.
        lap: radians to be gained, up to whole turns, over a closed route.
        cyclic: whether the route is closed.

    Returns:
        (n,) radians, unwrapped.
    """
    if np.max(level) < 1e-6:
        # Straight up or down: nothing is wanted.
        return np.linspace(0.0, lap, len(wanted)) if cyclic else np.zeros(len(wanted))
    steps = less_whole_turns(np.diff(wanted))
    anchor = int(np.argmax(level >= min(_HELD, float(np.max(level)))))
    angles = np.empty(len(wanted))
    # What leads to the first good place is steered back from there.
    angles[: anchor + 1] = _steered(
        wanted[anchor::-1], level[anchor::-1], -steps[:anchor][::-1], pace, float(wanted[anchor])
    )[::-1]
    angles[anchor:] = _steered(
        wanted[anchor:], level[anchor:], steps[anchor:], pace, angles[anchor]
    )
    if not cyclic:
        return angles
    for _ in range(8):
        start = angles[-1] - lap
        miss = float(less_whole_turns(start - angles[0]))
        if abs(miss) < 1e-10:
            break
        angles = _steered(wanted, level, steps, pace, angles[0] + miss)
    # What going round does not settle is shared out, so that the lap closes.
    miss = float(less_whole_turns(angles[0] + lap - angles[-1]))
    return angles + np.linspace(0.0, miss, len(angles))


def _steered(wanted: Floats, level: Floats, steps: Floats, pace: float, start: float) -> Floats:
    hold = smooth_step((np.minimum(level[1:], level[:-1]) - _LOST) / (_HELD - _LOST))
    given = (hold * steps).tolist()
    pulls = (pace * level[:-1] ** 2).tolist()
    angle, result = start, [start]
    for target, step, pull in zip(wanted[:-1].tolist(), given, pulls, strict=True):
        off = target - angle
        # Zero for an angle that is right, at most 1, and a little more than zero for one that is
        # wrong by half a turn: after a planar loop the body rolls back, always the same way.
        angle += step + pull * (sin(off) + 0.125 * (1.0 - cos(off)))
        result.append(angle)
    return np.array(result)
