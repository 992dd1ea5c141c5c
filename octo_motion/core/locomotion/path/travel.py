# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the body is on its route over time, and which way it faces there."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import acos, atan2, cos, exp, sin, sqrt
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...content_cache import ContentCache, content_key, part_of
from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import (
    IDENTITY,
    Floats,
    conjugate,
    continuous,
    from_axis_angle,
    from_matrix,
    less_whole_turns,
    multiply,
    normalized,
    rotate,
    rotate_in_plane,
    shortest_arc,
)
from ...settings import check_settings, setting, share_setting
from ...smoothing import smooth_step
from ..gait import CYCLE
from .along_route import PacedTime, Stops, ValuesAlong
from .route import Route, past_joints

_FEWEST: Final = 1024
_MOST: Final = 32768
"""Intervals of the table."""
_PER_CORNER: Final = 8
"""Intervals of the table within the corner radius, at least four …"""
_PER_CORNER_COARSE: Final = 4
"""… and of one that is soon made."""
_MOST_CORNER: Final = 1.0 / 24.0
"""Corner radius as a share of the route, at most."""
_TAIL: Final = 12.0
"""Corner radii after which a delay is forgotten: e⁻¹²."""

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
    travel: Floats
    """(n, 3) unit: the way of travel, its corners rounded off."""
    pace: float
    """Share of the way that an angle that has lost its hold comes back with each step."""

    # What a body asks that walks upright is worked out at once with the rest of it left aside.

    @cached_property
    def carried(self) -> Floats:
        """(n, 4) world orientations with local +Z along travel, carried with the least roll."""
        return continuous(self._carried)

    @cached_property
    def roll(self) -> Floats:
        """(n,) radians about travel from the carried frame to the one whose −Y faces up."""
        up = rotate(conjugate(self._carried), _UP)
        wanted = np.arctan2(up[:, 0], -up[:, 1])
        return _held_angle(wanted, self._level, self.pace, -self.lap, self.cyclic)

    @cached_property
    def compass(self) -> Floats:
        """(n,) radians about world Z, unwrapped, from −Y to the horizontal direction of travel."""
        wanted = np.arctan2(self.travel[:, 0], -self.travel[:, 1])
        return _held_angle(wanted, self._level, self.pace, 0.0, self.cyclic)

    @cached_property
    def bend(self) -> Floats:
        """(n, 2) how far travel has turned towards +X and +Y of the carried frame, radians."""
        local = rotate(conjugate(self._carried[:-1]), self.travel[1:])
        across = local[:, :2]
        sine = np.hypot(across[:, 0], across[:, 1])
        angle = np.arctan2(sine, local[:, 2])
        factor = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0)
        return np.concatenate([np.zeros((1, 2)), np.cumsum(factor[:, None] * across, axis=0)])

    @cached_property
    def lap(self) -> float:
        """Radians about travel by which the carried frame of a closed route turns within a lap."""
        if not self.cyclic:
            return 0.0
        lap = multiply(conjugate(self._carried[0]), self._carried[-1])
        return 2.0 * atan2(lap[3], lap[0])

    @cached_property
    def _carried(self) -> Floats:
        return _carry(self.travel)

    @cached_property
    def _level(self) -> Floats:
        """(n,) sine of the angle between travel and the vertical."""
        return np.hypot(self.travel[:, 0], self.travel[:, 1])

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
        return _between(table, distance * ((len(table) - 1) / self.length))


def _between(table: Floats, place: Floats) -> Floats:
    """A table at places ``(frames,)``, by the cubic through its neighbours' slopes."""
    first = 2.0 * table[:1] - table[1:2]
    last = 2.0 * table[-1:] - table[-2:-1]
    padded = np.concatenate([first, table, last])
    index = np.clip(place.astype(np.int64), 0, len(table) - 2)
    t = (place - index).reshape(-1, *[1] * (table.ndim - 1))
    p0, p1, p2, p3 = (padded[index + step] for step in range(4))
    slope, reach = p2 - p0, p3 - p1
    ends = (2.0 * t - 3.0) * t * t
    cubic = p1 + ends * (p1 - p2)
    return cubic + 0.5 * t * (1.0 - t) * ((1.0 - t) * slope - t * reach)


def bearings(route: Route, corner: float, settle: float, *, coarse: bool = False) -> Bearings:
    """The table of a route, or a coarse one.

    Before and after a sharp corner most of it is turned through within some metres; within others,
    a body that is not upright comes most of the way to settle there.
    """
    curve, corner = route.bare, rounding(route, corner)
    per_corner, fewest = (_PER_CORNER_COARSE, 0) if coarse else (_PER_CORNER, _FEWEST)
    count = int(np.clip(np.ceil(per_corner * curve.length / corner), fewest, _MOST))
    spacing = curve.length / count
    corner = max(corner, 4.0 * spacing)
    distances = np.linspace(0.0, curve.length, count + 1)
    samples = curve.parameter_near(distances) if coarse else curve.parameter_at(distances)
    raw = curve.tangent(past_joints(samples, curve.breaks))
    travel = _rounded(raw, exp(-spacing / corner), int(_TAIL * corner / spacing), curve.cyclic)
    if curve is not route:
        # A corner is rounded off by metres as they are, however many they count as.
        places = route.metres_at(np.linspace(0.0, route.length, count + 1))
        travel = normalized(_between(travel, places / spacing))
    return Bearings(route.length, route.cyclic, travel, route.length / count / settle)


def rounding(route: Route, corner: float) -> float:
    """Metres within which a corner of a route is rounded off that is to be so within some."""
    return min(corner, _MOST_CORNER * route.bare.length)


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
    """An angle (n,), radians, unwrapped, that keeps to the wanted one (n,), any branch, where that
    holds, and comes back to it elsewhere, by ``pace`` of the way with each step.

    ``level`` (n,) is the sine of the angle between travel and the vertical, the hold of ``wanted``;
    ``lap`` radians are to be gained, up to whole turns, over a closed route.
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


# --- How the body goes along its route: where it is at each time, which way it faces, and the phase
#
# of its gait.
#
# [Octopus] §3.5 moves its octopus along a Bézier curve with the parameter linear in time. Here too
# if wanted (``speed="NATURAL"``); besides, evenly by arc length, with ease in and out. Gait phase
# advances with the distance travelled, 2π per stride, so that arms and ground agree at any speed.
#
# The canonical body has its left side at +X, its front at −Y and its mantle at +Z.


Manner = Literal["WALK", "SWIM"]
Speed = Literal["EVEN", "NATURAL"]
Heading = Literal["ALONG", "FIXED"]

_LEFT: Final = np.array([1.0, 0.0])
_SIDEWAYS: Final = np.array([1.0, 0.0, 0.0])
_SETTLE: Final = 1.0
"""Strides within which a body that is not upright after a loop comes most of the way."""
_LAID_FORWARD: Final = np.array([0.0, 0.0, np.sqrt(0.5), -np.sqrt(0.5)])
"""From a body whose +Z travels and −Y faces up to one whose −Y travels and +Z faces up."""


_tables: Final[ContentCache[Bearings]] = ContentCache(4)


@dataclass(frozen=True)
class AlongRoute:
    """The settings that differ along a route; none of those that do not."""

    pace: ValuesAlong | None = None
    """How many times as fast the body is."""
    lift: ValuesAlong | None = None
    """As of ``StanceSettings``, …"""
    hold: ValuesAlong | None = None
    """… its ``duty``, …"""
    lean: ValuesAlong | None = None
    """… likewise."""
    height: ValuesAlong | None = None
    """How much higher the body is, metres."""

    def scaled(self, metres: float) -> AlongRoute:
        """The same, of which heights were given in a unit of so many metres."""
        if self.height is None:
            return self
        values = tuple(metres * each for each in self.height.values)
        return replace(self, height=replace(self.height, values=values))


def values_along(values: ValuesAlong | None, share: ArrayLike, otherwise: float) -> Floats:
    """Values at shares (…,) of the route; the same everywhere if there are none."""
    return np.full(np.shape(share), otherwise) if values is None else values.at(share)


@dataclass(frozen=True)
class TravelSettings:
    """How a route is travelled. Angles in radians, lengths in metres."""

    manner: Manner = "WALK"
    """WALK: upright, front along travel. SWIM: mantle (+Z) along travel, the arms trail, and the
    front faces up as far as it can: the body leans back."""
    speed: Speed = setting(
        "Pace",
        "How travel is spread over the time",
        default="EVEN",
        stored_as="speed_mode",
        items=(
            ("EVEN", "Even", "Equal distances in equal times, however the curve is drawn", 0),
            (
                "NATURAL",
                "Natural",
                "The curve's own parameter runs evenly: slower where its points lie close",
                1,
            ),
        ),
    )
    ease_in: float = share_setting(
        "Ease In",
        "Share of the time spent speeding up from a standstill",
        default=0.0,
        offered=0.1,
    )
    ease_out: float = share_setting(
        "Ease Out",
        "Share of the time spent slowing down to a standstill",
        default=0.0,
        offered=0.1,
    )
    stride: float = 1.0
    """Metres travelled per gait cycle."""
    heading: Heading = setting(
        "Heading",
        "Which way a walking body faces; a swimming one turns with its route",
        default="ALONG",
        items=(
            ("ALONG", "Along", "Turn with the route", 0),
            ("FIXED", "Fixed", "Keep facing one way, as an octopus can while it crawls", 1),
        ),
    )
    heading_angle: float = setting(
        "Angle",
        "Along: how far the front is turned away from travel, to the left, so that a body can "
        "crawl sideways. Fixed: compass angle of the front about Z, 0 faces -Y",
        default=0.0,
        soft_low=-np.pi,
        soft_high=np.pi,
        step=500,
        precision=1,
        subtype="ANGLE",
    )
    burst: float = share_setting(
        "Burst",
        "Swimming: 0 glides evenly, 1 shoots ahead with each stroke and nearly stops",
        default=0.6,
    )
    stroke_phase: float = 0.75 * np.pi
    """SWIM: phase of the middle of the power stroke. In the table β₁ falls from π/2 to π."""
    stalk: float = share_setting(
        "Stalk",
        "Walking: go, stop in the middle of a step, crouch, look about, go on. 1 comes to a "
        "standstill, less creeps on meanwhile, 0 goes evenly",
        default=0.0,
    )
    look_ahead: float = setting(
        "Look Ahead",
        "How many strides ahead the body looks for the turn that its arms prepare",
        default=1.0,
        low=0.0,
        soft_high=5.0,
        step=10,
    )
    """At most the whole of a closed route."""
    bank: float = setting(
        "Bank in Turns",
        "Swimming: how far the body rolls into a turn. At 1, a turn of 45° in a stride rolls it "
        "by 38°",
        default=0.0,
        stored_as="bank_in_turns",
        low=0.0,
        high=4.0,
        soft_high=1.0,
        step=5,
    )
    """At 1 a turn of θ per stride rolls the body by atan θ."""
    lean: float = 0.0
    """SWIM: how far from +Z towards the back the way lies that goes along travel, for bodies whose
    mantle lies flat behind them; at 90° they swim backwards, upright."""
    slow_in_bends: float = share_setting(
        "Slow in Bends",
        "How much a body slows down where its way bends too tightly for arms that hold on: they "
        "take more and shorter steps there. 0 keeps its pace",
        default=0.0,
        offered=1.0,
    )
    keep_upright: bool = setting(
        "Keep Upright",
        "Walking, stay upright on a slope instead of leaning with it",
        default=True,
    )
    corner: float = setting(
        "Corner",
        "Strides before and after a sharp corner within which the body turns; gentle bends are "
        "left as they are",
        default=0.2,
        low=0.01,
        soft_high=2.0,
        step=5,
    )
    """Within these most of the corner is turned through. The body stays on the route."""
    along: AlongRoute = field(default_factory=AlongRoute)
    """What differs along the route."""

    def __post_init__(self) -> None:
        check_settings(self)
        if self.stride <= 0.0:
            raise SettingsError(
                phrase("The stride is {stride:g} m.", stride=self.stride),
                "Give a stride longer than nothing.",
            )
        if self.ease_in + self.ease_out > 1.0 + 1e-9:
            raise SettingsError(
                phrase(
                    "Ease in ({ease_in:g}) and ease out ({ease_out:g}) do not fit into the time.",
                    ease_in=self.ease_in,
                    ease_out=self.ease_out,
                ),
                "Give shares of the time that make 1 at most together.",
            )


@dataclass(frozen=True, eq=False)
class Travel:
    """A body's motion along a route, frame by frame."""

    times: Floats
    """(frames,) from 0, at the start of the route, to 1, at its end."""
    distance: Floats
    """(frames,) metres along the route."""
    phase: Floats
    """(frames,) radians of the gait, unwrapped, 0 at the start of the route."""
    positions: Floats
    """(frames, 3) world space."""
    rotations: Floats
    """(frames, 4) world orientations of the canonical body, signs continuous along the route."""
    turn: Floats
    """(frames, 2) direction in the body's XY plane towards which travel will have turned a look
    ahead from here; its length is the angle, at most π. Zero where the route is straight. Of a body
    that swims as it lies, in the plane across its way."""
    stood: Floats
    """(frames,) stops of a body that stalks that are over, with the part of one that goes on."""

    def at(self, frames: np.ndarray) -> Travel:
        """The motion at some of the frames (n,)."""
        return part_of(self, frames, axis=0)


def bearings_of(route: Route, settings: TravelSettings, *, coarse: bool = False) -> Bearings:
    """The table of directions that the functions here ask; made once for several of them.

    A coarse one is soon made, and turns by less than a degree otherwise.
    """
    corner, settle = settings.corner * settings.stride, _SETTLE * settings.stride
    return _tables.get(
        content_key(route, corner, settle, coarse),
        lambda: bearings(route, corner, settle, coarse=coarse),
    )


def plan_travel(
    route: Route, settings: TravelSettings, times: ArrayLike, table: Bearings | None = None
) -> Travel:
    """The motion at the given times.

    A frame is a function of its own time: times may come in any order and any density, and one
    frame alone gives the numbers that it has among others.

    A swimming body bursts and glides, so a stroke covers its stride unevenly, but each whole
    stroke covers one stride exactly. The phase at the route's end is the one at which the strokes
    have covered the route's length, so that the body starts at the one end and comes to rest at
    the other without any stretching.

    Args:
        route: where to.
        settings: how.
        times: (frames,) in 0…1; earlier and later times hold the ends.
        table: from ``bearings_of``, if it is there already.
    """
    at = np.clip(np.asarray(times, dtype=np.float64), 0.0, 1.0)
    distance, phase, stood = _progress(route, settings, at)
    table = bearings_of(route, settings) if table is None else table
    return replace(travel_at(route, settings, table, distance, phase), times=at, stood=stood)


def distances_at(route: Route, settings: TravelSettings, times: Floats) -> Floats:
    """Metres (frames,) along the route at times (frames,) of a journey."""
    return _progress(route, settings, np.clip(times, 0.0, 1.0))[0]


def travel_at(
    route: Route, settings: TravelSettings, table: Bearings, distance: Floats, phase: Floats
) -> Travel:
    """The motion at distances (frames,) along the route, with phases (frames,) of the gait.

    Its times count as if all distances took equally long.
    """
    distance = np.clip(distance, 0.0, route.length)
    ahead = distance + min(settings.look_ahead * settings.stride, route.length)
    turning = _swum if settings.manner == "SWIM" else _walked
    rotations, turn = turning(table, settings, distance, ahead)
    size = np.sqrt(turn[:, 0] * turn[:, 0] + turn[:, 1] * turn[:, 1])
    turn = turn * np.minimum(1.0, np.pi / np.maximum(size, np.pi))[:, None]
    positions = route.position(route.parameter_at(distance))
    stood = np.zeros_like(distance)
    return Travel(distance / route.length, distance, phase, positions, rotations, turn, stood)


def walked_at(
    route: Route,
    settings: TravelSettings,
    table: Bearings,
    distance: ArrayLike,
    *,
    coarse: bool = False,
) -> tuple[Floats, Floats]:
    """Where a walking, upright body is, (n, 3) and (n, 4) world, at distances (n,) along its route,
    and before and after it; coarse, as near to these as ``Route.parameter_near`` finds at once.

    Beyond the ends of an open route it goes straight on; a closed one it goes round again.
    """
    wanted = np.asarray(distance, dtype=np.float64)
    inside = np.mod(wanted, route.length) if route.cyclic else np.clip(wanted, 0.0, route.length)
    found = route.parameter_near(inside) if coarse else route.parameter_at(inside)
    positions = route.position(found)
    if not route.cyclic:
        ends = route.tangent(np.array([0.0, 1.0]))
        beyond = wanted - inside
        positions = positions + beyond[:, None] * np.where(beyond[:, None] < 0.0, ends[0], ends[1])
    upright = replace(settings, keep_upright=True)
    rotations, _ = _walked(table, upright, inside, inside)
    return positions, rotations


def duration(route: Route, settings: TravelSettings, metres_per_second: float) -> float:
    """Seconds that the route takes at a cruising speed, slower while it eases in and out.

    Uneven speeds (NATURAL, burst and glide) cruise at it on average.
    """
    if not metres_per_second > 0.0:
        raise SettingsError(
            phrase("The speed is {metres_per_second:g} m/s.", metres_per_second=metres_per_second),
            "Give a speed greater than zero.",
        )
    paced = paced_time(route, settings)
    slower = 1.0 if paced is None else paced.slower
    return slower * route.length / (metres_per_second * _mean_speed(settings))


_LEG: Final = 1.6
"""Strides from stop to stop of a body that stalks; in time that it takes for a stride it …"""
_HALT: Final = 0.14
"""… comes to a standstill, and gets going again within as long, …"""
_STAND: Final = 0.36
"""… and stands so long."""
_PACED: Final = 4096
"""Steps of the table of a pace that differs along the route."""


def paced_time(route: Route, settings: TravelSettings) -> PacedTime | None:
    """How a route is come through on which the pace differs or the body stops; none where it does
    neither.
    """
    pace, stops = settings.along.pace, _stops(route, settings)
    if pace is None and stops is None:
        return None
    share = _share_of_way(route, settings, np.linspace(0, 1, _PACED))
    return PacedTime(pace, stops, route.share_at(share * route.length))


def _stops(route: Route, settings: TravelSettings) -> Stops | None:
    """Where a body stops on its way, none where it never does."""
    stride = settings.stride / route.length
    legs = round(1.0 / (_LEG * stride))
    if settings.manner != "WALK" or settings.stalk <= 0.0 or legs < 2:
        return None
    return Stops(legs, _HALT * stride, _STAND * stride, settings.stalk)


def _share_of_way(route: Route, settings: TravelSettings, parameter: Floats) -> Floats:
    """Share of the route's length at parameters (…,) that run evenly where the pace is the same."""
    if settings.speed == "NATURAL":
        return route.distance_at(parameter) / route.length
    return parameter


def raised_along(route: Route, settings: TravelSettings, distance: Floats) -> Floats:
    """Metres (…,) by which a body is higher at distances (…,) than elsewhere on its route."""
    return values_along(settings.along.height, route.share_at(distance), 0.0)


def unhurried(
    settings: TravelSettings, length: float, *, start: float = 0.0, end: float = 0.0
) -> TravelSettings:
    """The same travel, but with more time to get going and to stop, if it has too little.

    All is in metres: the length of the route, and those within which the body speeds up and slows
    down at least; 0 leaves that as it is.
    """
    # While the body eases it is half as fast on average, so m = 1 / (1 + a + b) of the time would
    # do at full speed, a and b being the shares of the way.
    shares = np.clip(np.array([start, end]) / max(length, 1e-12), 0.0, 1.0)
    shares /= max(float(shares.sum()), 1.0)
    own = np.array([settings.ease_in, settings.ease_out])
    more = np.maximum(2.0 * shares / (1.0 + shares.sum()) - own, 0.0)
    more *= min(1.0, max(1.0 - float(own.sum()), 0.0) / max(float(more.sum()), 1e-12))
    ease_in, ease_out = (own + more).tolist()
    return replace(settings, ease_in=ease_in, ease_out=ease_out)


def strides(route: Route, settings: TravelSettings) -> float:
    """Gait cycles from the start of the route to its end."""
    return _last_phase(route, settings) / CYCLE


def _last_phase(route: Route, settings: TravelSettings) -> float:
    covered = CYCLE * route.length / settings.stride
    if settings.manner == "WALK":
        return covered
    return phase_at_distance(covered, settings.burst, settings.stroke_phase)


def _progress(
    route: Route, settings: TravelSettings, times: Floats
) -> tuple[Floats, Floats, Floats]:
    """Distances, phases and stops that are over ``(frames,)``."""
    share = _eased(times, settings.ease_in, settings.ease_out) / _mean_speed(settings)
    paced, stood = paced_time(route, settings), np.zeros_like(share)
    if paced is not None:
        stood = stood if paced.stops is None else paced.stops.stood(share)
        share = paced.parameter(share)
    share = _share_of_way(route, settings, share)
    last = _last_phase(route, settings)
    phase = share * last
    if settings.manner == "SWIM":
        whole = stroke_distance(np.array([last]), settings.burst, settings.stroke_phase)
        share = stroke_distance(phase, settings.burst, settings.stroke_phase) / whole
    return np.clip(share, 0.0, 1.0) * route.length, phase, stood


def _mean_speed(settings: TravelSettings) -> float:
    """Of the eased travel, as a share of its cruising speed."""
    return 1.0 - 0.5 * (settings.ease_in + settings.ease_out)


def _eased(times: Floats, ease_in: float, ease_out: float) -> Floats:
    """Progress at cruising speed 1 that rises and falls as 3t² − 2t³ ``(frames,)``."""
    run_up = _smooth_ramp(np.minimum(times, ease_in), ease_in)
    left = 1.0 - times
    run_out = 0.5 * ease_out - _smooth_ramp(np.minimum(left, ease_out), ease_out)
    cruise = np.clip(times, ease_in, 1.0 - ease_out) - ease_in
    return run_up + cruise + run_out


def _smooth_ramp(time: Floats, whole: float) -> Floats:
    """Integral of 3t² − 2t³ over a ramp that takes ``whole``."""
    if whole <= 0.0:
        return np.zeros_like(time)
    t = time / whole
    return whole * t * t * t * (1.0 - 0.5 * t)


def _swum(
    table: Bearings, settings: TravelSettings, distance: Floats, ahead: Floats
) -> tuple[Floats, Floats]:
    """Orientations ``(frames, 4)`` and turns ``(frames, 2)`` of a swimming body."""
    roll = table.roll_at(distance)
    if settings.bank:
        half = 0.5 * min(settings.stride, table.length)
        per_stride = table.bend_at(distance + half) - table.bend_at(distance - half)
        sideways = rotate_in_plane(per_stride, -roll)[:, 0].copy()
        roll = roll + settings.bank * np.arctan(sideways)
    rotations = multiply(table.carried_at(distance), from_axis_angle(_UP, roll))
    turn = rotate_in_plane(table.bend_at(ahead) - table.bend_at(distance), -roll)
    if settings.lean:
        rotations = multiply(rotations, from_axis_angle(_SIDEWAYS, settings.lean))
    return rotations, turn


def _walked(
    table: Bearings, settings: TravelSettings, distance: Floats, ahead: Floats
) -> tuple[Floats, Floats]:
    """Orientations ``(frames, 4)`` and turns ``(frames, 2)`` of a walking body."""
    compass = table.compass_at(distance)
    if settings.heading == "ALONG":
        off = np.full_like(distance, settings.heading_angle)
    else:
        off = settings.heading_angle - compass
    if settings.keep_upright:
        rotations = from_axis_angle(_UP, compass + off)
    else:
        rolled = from_axis_angle(_UP, table.roll_at(distance))
        tilted = multiply(multiply(table.carried_at(distance), rolled), _LAID_FORWARD)
        rotations = multiply(tilted, from_axis_angle(_UP, off))
    leftwards = table.compass_at(ahead) - compass
    return rotations, leftwards[:, None] * rotate_in_plane(_LEFT, -off)


# --- Burst and glide: how far a swimming body has come at each phase of its stroke ----------------
#
# The power stroke pushes for a quarter of the cycle; water slows the body in proportion to its
# speed. Speed v over the phase φ is then the periodic solution of ``v′ + v/λ = push(φ)``: it rises
# during the stroke and fades exponentially afterwards. Its integral needs no quadrature, for
# ``∫v = λ (∫push − v)``. [Octopus] moves its body evenly; this is ours.


_REACH: Final = 0.25 * np.pi
"""The push lasts from this phase before its middle to this phase after it: β₁ of the swim table
falls from +10° to −80° within π/2."""
_FADE: Final = 1.0
"""λ: the phase within which a gliding body loses all but 1/e of its speed. At the end of a glide
of 3π/2 about 1 % is left of the stroke's speed."""


def stroke_distance(phase: ArrayLike, burst: float, stroke_phase: float) -> Floats:
    """Distance (…,) covered since phase 0, radians, unwrapped, in units in which one stroke is 2π.

    Strictly increasing, equal to the phase at whole strokes, twice continuously differentiable. A
    burst of 0 is steady, of 1 all travel comes from the push, whose middle is at a phase.
    """
    turned = np.asarray(phase, dtype=np.float64)
    start = np.array(-stroke_phase)
    fading = _FADE * (_speed(turned + start) - _speed(start))
    pushed = _push_so_far(turned + start) - _push_so_far(start)
    return (1.0 - burst) * turned + burst * (pushed - fading)


def phase_at_distance(distance: float, burst: float, stroke_phase: float) -> float:
    """Inverse of :func:`stroke_distance` for one distance, by bisection."""
    low, high = distance - CYCLE, distance + CYCLE
    while low < (middle := 0.5 * (low + high)) < high:
        if stroke_distance(middle, burst, stroke_phase) < distance:
            low = middle
        else:
            high = middle
    return high


def _wrapped(phase: Floats) -> Floats:
    """The phase from the middle of the push on, from −_REACH up to a cycle later."""
    return np.mod(phase + _REACH, CYCLE) - _REACH


_K: Final = np.pi / _REACH
_RATE: Final = 1.0 / _FADE
_HEIGHT: Final = _RATE * CYCLE / _REACH
"""Peak of the push, such that the speed's mean over a cycle is 1."""


def _driven(offset: Floats) -> Floats:
    """The speed while pushing, without its fading part."""
    swing = _RATE * np.cos(_K * offset) + _K * np.sin(_K * offset)
    return 0.5 * _HEIGHT * (_FADE + swing / (_RATE**2 + _K**2))


_GLIDE: Final = float(np.exp(-_RATE * (CYCLE - 2.0 * _REACH)))
_EDGE: Final = float(_driven(np.array(_REACH)))
# The push is as strong at its start as at its end, and the glide leads from its end to its start.
_FADING: Final = (
    -_EDGE * (1.0 - _GLIDE) / (np.exp(_RATE * _REACH) - _GLIDE * np.exp(-_RATE * _REACH))
)
_RELEASED: Final = _EDGE + float(_FADING * np.exp(-_RATE * _REACH))


def _speed(phase: Floats) -> Floats:
    offset = _wrapped(phase)
    pushing = _driven(offset) + _FADING * np.exp(-_RATE * offset)
    gliding = _RELEASED * np.exp(-_RATE * (offset - _REACH))
    return np.where(offset < _REACH, pushing, gliding)


def _push_so_far(phase: Floats) -> Floats:
    """∫push · λ over the phase, from an arbitrary start: 2π for each cycle."""
    offset = _wrapped(phase)
    inside = np.minimum(offset, _REACH)
    risen = 0.5 * _HEIGHT * _FADE * (inside + _REACH + np.sin(_K * inside) / _K)
    return risen + (phase - offset)
