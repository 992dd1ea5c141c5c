# SPDX-License-Identifier: GPL-3.0-or-later
"""How the body goes along its route: where it is at each time, which way it faces, and the phase
of its gait.

[Octopus] §3.5 moves its octopus along a Bézier curve with the parameter linear in time. Here too
if wanted (``speed="NATURAL"``); besides, evenly by arc length, with ease in and out. Gait phase
advances with the distance travelled, 2π per stride, so that arms and ground agree at any speed.

The canonical body has its left side at +X, its front at −Y and its mantle at +Z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...array_parts import part_of
from ...content_cache import ContentCache, content_key
from ...errors import SettingsError
from ...rotations import Floats, from_axis_angle, multiply, rotate_in_plane
from ...settings import check_settings, setting
from ..gait import CYCLE
from .heading import Bearings, bearings
from .route import Route

Manner = Literal["WALK", "SWIM"]
Speed = Literal["EVEN", "NATURAL"]
Heading = Literal["ALONG", "FIXED"]

_UP: Final = np.array([0.0, 0.0, 1.0])
_LEFT: Final = np.array([1.0, 0.0])
_SIDEWAYS: Final = np.array([1.0, 0.0, 0.0])
_SETTLE: Final = 1.0
"""Strides within which a body that is not upright after a loop comes most of the way."""
_LAID_FORWARD: Final = np.array([0.0, 0.0, np.sqrt(0.5), -np.sqrt(0.5)])
"""From a body whose +Z travels and −Y faces up to one whose −Y travels and +Z faces up."""


_tables: Final[ContentCache[Bearings]] = ContentCache(4)


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
    ease_in: float = setting(
        "Ease In",
        "Share of the time spent speeding up from a standstill",
        default=0.0,
        offered=0.1,
        low=0.0,
        high=1.0,
        subtype="FACTOR",
    )
    ease_out: float = setting(
        "Ease Out",
        "Share of the time spent slowing down to a standstill",
        default=0.0,
        offered=0.1,
        low=0.0,
        high=1.0,
        subtype="FACTOR",
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
    burst: float = setting(
        "Burst",
        "Swimming: 0 glides evenly, 1 shoots ahead with each stroke and nearly stops",
        default=0.6,
        low=0.0,
        high=1.0,
        subtype="FACTOR",
    )
    stroke_phase: float = 0.75 * np.pi
    """SWIM: phase of the middle of the power stroke. In the table β₁ falls from π/2 to π."""
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

    def __post_init__(self) -> None:
        check_settings(self)
        if self.stride <= 0.0:
            raise SettingsError(
                f"The stride is {self.stride:g} m.", "Give a stride longer than nothing."
            )
        if self.ease_in + self.ease_out > 1.0 + 1e-9:
            raise SettingsError(
                f"Ease in ({self.ease_in:g}) and ease out ({self.ease_out:g}) do not fit into the "
                "time.",
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

    def at(self, frames: np.ndarray) -> Travel:
        """The motion at some of the frames (n,)."""
        return part_of(self, frames, axis=0)


def bearings_of(route: Route, settings: TravelSettings) -> Bearings:
    """The table of directions that the functions here ask; made once for several of them."""
    corner, settle = settings.corner * settings.stride, _SETTLE * settings.stride
    return _tables.get(content_key(route, corner, settle), lambda: bearings(route, corner, settle))


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
    distance, phase = _progress(route, settings, at)
    table = bearings_of(route, settings) if table is None else table
    return replace(travel_at(route, settings, table, distance, phase), times=at)


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
    return Travel(distance / route.length, distance, phase, positions, rotations, turn)


def walked_at(
    route: Route, settings: TravelSettings, table: Bearings, distance: ArrayLike
) -> tuple[Floats, Floats]:
    """Where a walking, upright body is at distances (n,) along its route, and before and after it.

    Beyond the ends of an open route it goes straight on; a closed one it goes round again.

    Returns:
        World positions (n, 3) and orientations (n, 4).
    """
    wanted = np.asarray(distance, dtype=np.float64)
    inside = np.mod(wanted, route.length) if route.cyclic else np.clip(wanted, 0.0, route.length)
    positions = route.position(route.parameter_at(inside))
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
            f"The speed is {metres_per_second:g} m/s.", "Give a speed greater than zero."
        )
    return route.length / (metres_per_second * _mean_speed(settings))


def unhurried(
    settings: TravelSettings, length: float, *, start: float = 0.0, end: float = 0.0
) -> TravelSettings:
    """The same travel, but with more time to get going and to stop, if it has too little.

    Args:
        settings: how the route is travelled.
        length: metres of the route.
        start: metres within which the body speeds up at least; 0 leaves that as it is.
        end: metres within which it slows down at least.
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


def _progress(route: Route, settings: TravelSettings, times: Floats) -> tuple[Floats, Floats]:
    """Distances and phases ``(frames,)``."""
    share = _eased(times, settings.ease_in, settings.ease_out) / _mean_speed(settings)
    if settings.speed == "NATURAL":
        share = route.distance_at(share) / route.length
    last = _last_phase(route, settings)
    phase = share * last
    if settings.manner == "SWIM":
        whole = stroke_distance(np.array([last]), settings.burst, settings.stroke_phase)
        share = stroke_distance(phase, settings.burst, settings.stroke_phase) / whole
    return np.clip(share, 0.0, 1.0) * route.length, phase


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
    """Distance covered since phase 0, in units in which one stroke is 2π.

    Strictly increasing, equal to the phase at whole strokes, twice continuously differentiable.

    Args:
        phase: (…,) radians, unwrapped.
        burst: 0 steady (distance = phase) … 1 all travel comes from the push.
        stroke_phase: phase of the middle of the push.

    Returns:
        (…,)
    """
    turned = np.asarray(phase, dtype=np.float64)
    start = np.array(-stroke_phase)
    fading = _FADE * (_speed(turned + start) - _speed(start))
    pushed = _push_so_far(turned + start) - _push_so_far(start)
    return (1.0 - burst) * turned + burst * (pushed - fading)


def stroke_speed(phase: ArrayLike, burst: float, stroke_phase: float) -> Floats:
    """Derivative of :func:`stroke_distance` by the phase ``(…,)``: mean 1, always positive."""
    return (1.0 - burst) + burst * _speed(np.asarray(phase, dtype=np.float64) - stroke_phase)


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
