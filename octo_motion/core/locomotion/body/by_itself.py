# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body does by itself over time: it surges with the arms that push it; what swings, breathes
and blinks hangs on where it is at even steps of its time.

An octopus crawls by making arms shorter that take hold, and longer as they push ("Arm
coordination in octopus crawling involves unique motor control strategies", Levy, Flash and
Hochner, Current Biology 25, 2015). A body that is pushed speeds up and rises, and slows down and
sinks until the next arm pushes; it does so the more the fewer arms hold on. All of it hangs on
where the body is on its way and on nothing else: at any frame rate it is the same motion.

What swings hangs on all that was before. So it is worked out at steps of its own, the same at any
frame rate, over the whole motion, and frames look it up: a frame hangs on its own time alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Final

import numpy as np

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import (
    Floats,
    conjugate,
    from_axis_angle,
    multiply,
    normalized,
    rotate,
    rotation_vector_between,
)
from ...settings import check_settings, setting
from ...smoothing import evened, least_jerk

_amount: Final = partial(
    setting, default=0.0, offered=1.0, low=0.0, high=2.0, step=10, precision=2, subtype="FACTOR"
)
"""A slider that reads 0 … 1 … 2: nothing, as it is meant, twice that."""


@dataclass(frozen=True)
class BodySettings:
    """Amounts of what a body does by itself: 0 for nothing, 1 for what is natural, 2 at most."""

    surge: float = _amount(
        "Surge and Bob",
        "Walking: how far the body shoots ahead and rises with each push of its arms, and sinks "
        "and slows down in between: more where fewer arms hold on. Feet stay where they are",
    )

    mantle: float = _amount(
        "Mantle",
        "How far the mantle trails behind the body, swings and settles when that turns, starts and "
        "stops, and how far each stroke of a swim draws it together",
    )
    siphon: float = _amount(
        "Siphon",
        "How far the siphon points against the travel, where the jet goes, and how much it swells "
        "as the mantle breathes out",
    )
    eyes: float = _amount(
        "Eyes",
        "How far the eyes turn towards where the body goes, or to what they look at, blink, and "
        "keep their slits level; from 1 on they are level all the time",
    )
    head: float = _amount(
        "Steady Head",
        "How much of the body's quick turns the head takes back",
    )
    trail: bool = setting(
        "Follow-Through",
        "The outer thirds of free arms trail in the water, swing and settle. What rests on the "
        "ground stays where it is. Generate takes longer",
        default=False,
    )
    settle: float = setting(
        "Settle",
        "Seconds after the last frame of the way in which the body breathes on, and its mantle "
        "and arms that follow through settle. Not for a loop, nor before a pose it ends in",
        default=0.0,
        low=0.0,
        soft_high=5.0,
        step=10,
        precision=1,
    )

    def __post_init__(self) -> None:
        check_settings(self)


# --- Surge and bob --------------------------------------------------------------------------------

_PER_STRIDE: Final = 96
"""Places of the table in a stride."""
_FEWEST: Final = 64
_MOST: Final = 200_000
"""Places of the table in all."""
_BEHIND: Final = 0.65
"""Share of its push that an arm has for standing behind the body: one before it only supports."""
_FASTER: Final = 0.3
"""By how much more than on average a body goes at the height of a push, as a share of its speed …
"""
_MOST_FASTER: Final = 0.4
"""… and at most."""
_FARTHEST: Final = 0.025
"""Arm lengths that it is ahead of its place or behind it at most."""
_HIGHER: Final = 0.008
"""Arm lengths that it rises with a push …"""
_HIGHEST: Final = 0.012
"""… and at most, up or down."""
_STEP: Final = 0.3
"""Arm lengths of a stride below which it rises less: who goes nowhere, does not bob."""
_PUSHES: Final = 8.0
"""Makes the push of one arm of eight that hold on count 1."""
_BRIEF: Final = 0.6
"""Share of what holds usually last below which a push is weaker. Without it Tiptoe's body is thrown
up over bumps by 0.012 arm lengths in a frame, at 1 arms of Walk are 1.3 radii deep in each other
there instead of 0.13."""
_AVERAGE: Final = 0.7
"""Strides over which (standard deviation) what is usual is found."""
_SHIFTED: Final = 0.012
"""Arm lengths to either side by which a body that rests in place shifts its weight …"""
_SHIFTS: Final = 0.5
"""… and how often in a cycle of its gait."""
_UPWARD: Final = np.array([0.0, 0.0, 1.0])
_ENDS: Final = 0.5
"""Strides from where the body starts and stops within which all of it comes and goes."""


@dataclass(frozen=True, eq=False)
class Holds:
    """Arms that hold on to the ground, as the body goes by."""

    start: Floats
    """(holds,) metres of the way at which an arm takes hold …"""
    end: Floats
    """(holds,) … and lets go."""
    behind: Floats
    """(holds,) how far it stands behind the body half way, −1 … 1: −1 right ahead."""


@dataclass(frozen=True, eq=False)
class Surge:
    """How far a body is from its place, all along its way."""

    spacing: float
    """Metres from one place of the table to the next."""
    table: Floats
    """(n, 3) metres, world, from the start of the way on."""
    cyclic: bool
    """Whether the last place is the first again."""

    def at(self, distance: Floats) -> Floats:
        """Metres (moments, 3), world, at distances (moments,)."""
        last = len(self.table) - 1
        place = distance / self.spacing
        place = np.mod(place, last) if self.cyclic else np.clip(place, 0.0, last)
        index = np.minimum(place.astype(np.int64), last - 1)
        t = (place - index)[:, None]
        before, here, then, after = (self._row(index + step) for step in (-1, 0, 1, 2))
        slope, rise = 0.5 * (then - before), then - here
        bend = slope + 0.5 * (after - here) - 2.0 * rise
        return here + t * (slope + t * (rise - slope - bend + t * bend))

    def _row(self, index: np.ndarray) -> Floats:
        last = len(self.table) - 1
        return self.table[index % last if self.cyclic else np.clip(index, 0, last)]


def surge(
    holds: Holds,
    centres: Callable[[Floats], Floats],
    length: float,
    *,
    stride: float,
    reach: float,
    amount: float,
    calm: Floats | None = None,
    cyclic: bool = False,
) -> Surge | None:
    """What the arms that hold on make of a body's speed and height; none if that is nothing.

    Args:
        holds: all of them.
        centres: places (n, 3) of the body, world, at distances (n,).
        length: metres of the way.
        stride: metres of one cycle.
        reach: metres that arms are long.
        amount: 1 for as much as is natural.
        calm: stretches of the way (n, 2), metres, in which the body keeps to its place.
        cyclic: whether it is a loop, whose end is its start.
    """
    if amount <= 0.0 or not len(holds.start):
        return None
    count = int(np.clip(np.ceil(_PER_STRIDE * length / stride), _FEWEST, _MOST))
    spacing = length / count
    distance = np.linspace(0.0, length, count + 1)
    pushed, down = _pushes(holds, distance, length if cyclic else None)
    width = min(_AVERAGE * stride, 0.5 * length) / spacing
    usual = evened(pushed, width, cyclic=cyclic)
    more = (pushed - usual) / np.maximum(evened(down, width, cyclic=cyclic), 0.5)
    faster = _MOST_FASTER * np.tanh(amount * _FASTER / _MOST_FASTER * _PUSHES * more)
    ahead = spacing * np.concatenate([[0.0], np.cumsum(0.5 * (faster[1:] + faster[:-1]))])
    if cyclic:
        ahead -= ahead[-1] * distance / length
    ahead -= evened(ahead, width, cyclic=cyclic)
    up = amount * _HIGHER * _PUSHES * more * min(stride / (_STEP * reach), 1.0)
    share = _share(distance, length, stride, calm, cyclic=cyclic)
    along = normalized(np.gradient(centres(distance), axis=0))
    table = (share * _held(ahead, _FARTHEST * reach))[:, None] * along
    table[:, 2] += share * _held(reach * up, _HIGHEST * reach)
    if cyclic:
        resting = amount * max(1.0 - stride / (_STEP * reach), 0.0)
        table += resting * reach * _shifting(distance / length, length / stride, along)
    if cyclic:
        table[-1] = table[0]
    return Surge(spacing, table, cyclic)


def _shifting(share: Floats, cycles: float, along: Floats) -> Floats:
    """Arm lengths (n, 3) by which a body that stays shifts its weight, at shares (n,) of a loop:
    from arms on the one side to those on the other, and a little forth and back.
    """
    turn = 2.0 * np.pi * max(round(_SHIFTS * cycles), 1) * share
    aside = np.cross(_UPWARD, along)
    lower = 0.5 * _SHIFTED * (np.cos(2.0 * turn) - 1.0)
    forth = 0.5 * _SHIFTED * np.sin(2.0 * turn + 0.7)
    return (
        _SHIFTED * np.sin(turn)[:, None] * aside
        + forth[:, None] * along
        + (0.3 * lower[:, None] * _UPWARD)
    )


def _held(values: Floats, most: float) -> Floats:
    """Values that come near to a bound, and not beyond it."""
    return most * np.tanh(values / most)


def _pushes(holds: Holds, distance: Floats, loop: float | None) -> tuple[Floats, Floats]:
    """How strongly arms push at distances (n,), and how many hold on there.

    An arm's push rises from nothing and falls to nothing, without a corner. One that holds on
    briefly moves the body as far as a steady force does in that time: it does not jolt it.
    """
    weights = 1.0 - _BEHIND * 0.5 * (1.0 - holds.behind)
    lasts = holds.end - holds.start
    brief = np.minimum(lasts / (_BRIEF * np.median(lasts)), 1.0) ** 2
    # What the ends of the way cut is no brief hold; a loop has none.
    cut = (holds.start <= distance[0]) | (holds.end >= distance[-1])
    weights = np.where(cut & (loop is None), weights, weights * brief)
    every = np.stack([holds.start, holds.end, weights], axis=1)
    if loop is not None:
        # Those of one round, and the same before it and after it.
        middle = 0.5 * (holds.start + holds.end) + 1e-9 * loop
        once = every[(middle >= 0.0) & (middle < loop)]
        round_it = np.array([loop, loop, 0.0])
        every = np.concatenate([once - round_it, once, once + round_it])
    # All places of all holds, one hold after the other.
    first, last = np.searchsorted(distance, every[:, 0]), np.searchsorted(distance, every[:, 1])
    many = np.maximum(last - first, 0)
    place = np.arange(many.sum()) + np.repeat(first - np.cumsum(many) + many, many)
    start, end, weight = np.repeat(every, many, axis=0).T
    share = (distance[place] - start) / np.maximum(end - start, 1e-9)
    pushing = weight * (4.0 * share * (1.0 - share)) ** 3
    holding = least_jerk(8.0 * share) * least_jerk(8.0 * (1.0 - share))
    pushed, down = (
        np.bincount(place, weights=each, minlength=len(distance)) for each in (pushing, holding)
    )
    return pushed, down


def _share(
    distance: Floats, length: float, stride: float, calm: Floats | None, *, cyclic: bool
) -> Floats:
    """How much of it all there is at distances (n,): nothing where the body starts, stops, or is to
    be calm.
    """
    ramp = min(_ENDS * stride, 0.5 * length)
    share = np.ones(len(distance))
    if not cyclic:
        share = least_jerk(distance / ramp) * least_jerk((length - distance) / ramp)
    for start, end in calm if calm is not None else ():
        away = np.maximum(start - distance, distance - end)
        share = share * least_jerk(away / ramp)
    return share


# --- Stops of a body that stalks ------------------------------------------------------------------

_CROUCHES: Final = 0.3, 0.26
"""Shares of a stop within which the body crouches, and rises again at its end."""
_TURNS: Final = (0.1, 0.34), (0.42, 0.7), (0.76, 1.0)
"""Shares of a stop within which it turns to one side, to the other, and ahead again; from each of
these to the next it looks there and keeps still."""
_SIDEWAYS: Final = 0.3, 0.45
"""Radians that it looks to a side, at least and at most …"""
_BODY_ABOUT: Final = 0.4
"""… and share of it that the body turns."""


@dataclass(frozen=True)
class Stalking:
    """What a body does while it stops that stalks: it crouches, and looks to both sides.

    All of it hangs on how far a stop has come, and is nothing where it begins and ends.
    """

    amount: float
    """1 for all of it."""
    sinks: float
    """Metres that it crouches by."""
    seed: int
    """Of which side it looks to first, and how far."""

    def looks(self, stood: Floats) -> Floats:
        """Radians (n,) to the left that it looks, where so many stops (n,) are over."""
        number, part = np.divmod(stood, 1.0)
        stop = number.astype(np.int64)
        random = np.random.default_rng([self.seed, 4])
        low, high = _SIDEWAYS
        drawn = random.uniform(low, high, (int(stop.max(initial=0)) + 1, 2))
        drawn *= random.choice([-1.0, 1.0], (len(drawn), 1)) * np.array([1.0, -1.0])
        first, second = drawn[stop].T
        there, over, back = (least_jerk((part - start) / (end - start)) for start, end in _TURNS)
        return self.amount * (there * first + over * (second - first) - back * second)

    def placed(self, places: tuple[Floats, Floats], stood: Floats) -> tuple[Floats, Floats]:
        """Centres (n, 3) and orientations (n, 4) of a body that does so."""
        part = np.mod(stood, 1.0)
        down, up = _CROUCHES
        low = self.amount * self.sinks * least_jerk(part / down) * least_jerk((1.0 - part) / up)
        turn = from_axis_angle(_UPWARD, _BODY_ABOUT * self.looks(stood))
        return places[0] - low[:, None] * _UPWARD, multiply(places[1], turn)


# --- Where the body is at even steps of its time --------------------------------------------------

_MOMENT: Final = 1.0 / 120.0
"""Seconds from one of them to the next."""
_MOST_MOMENTS: Final = 400_000
_QUIET: Final = 0.05
"""Seconds (standard deviation) over which speed and acceleration are evened out."""


def steps_of(seconds: float) -> Floats:
    """Times (n,) in seconds at which a body is looked at."""
    return np.linspace(0.0, seconds, int(np.clip(np.ceil(seconds / _MOMENT), 8, _MOST_MOMENTS)) + 1)


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """Where a body is at even steps of its time."""

    times: Floats
    """(n,) seconds, from ``steps_of``."""
    locations: Floats
    """(n, 3) of the body's centre, world, in arm lengths."""
    orientations: Floats
    """(n, 4) of the armature, world."""
    strokes: Floats
    """(n,) strokes of the swim since the middle of one."""
    swimming: Floats
    """(n,) how far it swims, 0…1."""
    cyclic: bool
    """Whether it is a loop: the last moment is the first again, but for the way between."""
    looks: Floats | None = None
    """(n,) radians to the left that it looks to as it stops on its way, none where it does not."""

    @property
    def step(self) -> float:
        """Seconds from one moment to the next."""
        return float(self.times[1] - self.times[0])

    def evened(self, values: Floats, seconds: float) -> Floats:
        """Values (n, k) evened out over time (standard deviation)."""
        return evened(values, seconds / self.step, cyclic=self.cyclic)

    @cached_property
    def velocity(self) -> Floats:
        """(n, 3) arm lengths per second, world. Before its first moment a body moved on evenly."""
        first, last = self.locations[0], self.locations[-1]
        before, after = 2.0 * first - self.locations[1], 2.0 * last - self.locations[-2]
        if self.cyclic:
            before, after = first - last + self.locations[-2], last - first + self.locations[1]
        wide = np.concatenate([before[None], self.locations, after[None]])
        return self.evened((wide[2:] - wide[:-2]) / (2.0 * self.step), _QUIET)

    @cached_property
    def speed(self) -> Floats:
        """(n,) arm lengths per second."""
        return np.linalg.norm(self.velocity, axis=1)

    def seen(self, vectors: Floats) -> Floats:
        """Vectors (n, 3) of the world as the armature has them."""
        return rotate(conjugate(self.orientations), vectors)

    @cached_property
    def acceleration(self) -> Floats:
        """(n, 3) arm lengths per second squared, as the armature has it."""
        wide = self.velocity
        if self.cyclic:
            wide = np.concatenate([wide[-2:-1], wide, wide[1:2]])
            return self.seen((wide[2:] - wide[:-2]) / (2.0 * self.step))
        return self.seen(np.gradient(wide, self.step, axis=0))

    @cached_property
    def turning(self) -> Floats:
        """(n, 3) radians per second, as the armature has it."""
        turned = rotation_vector_between(self.orientations[:-1], self.orientations[1:]) / self.step
        ends = np.concatenate([turned[-1:], turned, turned[:1]])
        if not self.cyclic:
            ends = np.concatenate([turned[:1], turned, turned[-1:]])
        return self.evened(0.5 * (ends[1:] + ends[:-1]), _QUIET)


def sprung(
    values: Floats, step: float, *, frequency: float, damping: float, cyclic: bool
) -> Floats:
    """What a damped spring makes of the places (n, k) that it is drawn to, at steps of so many
    seconds: x″ + 2ζω x′ + ω² x = ω² u, exact for what is straight from step to step.

    It is at rest where it is drawn to at first; of a loop, the last value is the first.
    """
    whole = 2.0 * np.pi * frequency
    pole = whole * complex(-damping, np.sqrt(1.0 - damping * damping))

    def kept(seconds: Any) -> Any:
        # Some C libraries lack exp of complex numbers, which numpy would ask them for.
        turn = pole.imag * seconds
        return np.exp(pole.real * seconds) * (np.cos(turn) + 1j * np.sin(turn))

    keep = complex(kept(step))
    last = (keep - 1.0 - pole * step) / (pole * pole * step)
    first = (keep - 1.0) / pole - last
    state = np.empty(values.shape, dtype=np.complex128)
    state[0] = 0.0 if cyclic else -values[0] / pole
    state[1:] = first * values[:-1] + last * values[1:]
    reach, factor = 1, keep
    while reach < len(state) and abs(factor) > 1e-18:
        state[reach:] += factor * state[:-reach].copy()
        reach, factor = 2 * reach, factor * factor
    if cyclic:
        # What is left of a round at its end is there at its start.
        left = kept(step * np.arange(len(values)))
        state += left[:, None] * (state[-1] / (1.0 - left[-1]))
    return whole * whole / pole.imag * state.imag


# --- Mantle, head, siphon and eyes over time ------------------------------------------------------

_TRAILS: Final = 0.22
"""Seconds: by how much of the way that a body goes in that time its mantle trails, in lengths of an
arm and of the mantle …"""
_LAGS: Final = 0.12
"""Seconds squared: … and by how much for its acceleration …"""
_STAYS: Final = 0.25
"""Seconds: … and of which part of its turn the mantle stays behind."""
_SWINGS: Final = 1.1
"""Hz with which it swings about that …"""
_DAMPED: Final = 0.3
"""… and share of the damping that would let it not swing at all."""
_FARTHEST_SWING: Final = 0.45
"""Radians that it is off at most."""
_STEADY: Final = 0.6
"""Share of the body's quick turns that the head takes back …"""
_QUICK: Final = 0.4
"""… and seconds (standard deviation) that make them quick."""
_MOST_STEADY: Final = 0.3
"""Radians."""
_HASTE: Final = 0.8
"""By how much more often a body breathes that goes an arm length in a second."""
_SWIM_BREATH: Final = 0.3
"""Share of a breath that is left in a swim, whose strokes do the rest."""
_UNLIKE: Final = 0.25, 0.12
"""By how much breaths differ at most: in depth, and in when they begin, as shares of one."""
_INHALE: Final = 0.42
"""Share of a breath spent breathing in, which is quicker than breathing out."""
_DRAWN: Final = 0.13
"""By how much narrower a stroke makes the mantle …"""
_SWOLLEN: Final = 0.04
"""… and the glide before it wider."""
_HEADED: Final = 0.25
"""Seconds (standard deviation) over which the direction of travel is evened out for them."""
_GLANCES: Final = 1.8
"""Seconds for which who stands looks one way …"""
_HELD: Final = 0.8
"""… the share of them in which nothing moves …"""
_ABOUT: Final = 0.35
"""… and radians to either side at most."""
_STANDING: Final = 0.05
"""Arm lengths per second at which a quarter of that is left."""
_BLINKS: Final = 5.5
"""Seconds from one blink to the next on average …"""
_BLINK: Final = 0.13
"""… and half of what one takes."""


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """What a body does by itself, at even steps of its time."""

    track: BodyTrack
    settings: BodySettings
    swing: Floats
    """(n, 6) where the mantle's tip is, in lengths of it, and how far that is turned back."""
    steady: Floats
    """(n, 3) turn of the head, as the armature has it."""
    filled: Floats
    """(n,) by how much wider than at rest the mantle is, as a share …"""
    outflow: Floats
    """(n,) … and how strongly it lets water out, 0…1."""
    shut: Floats
    """(n, eyes)"""
    about: Floats
    """(n,) radians to the left that a body looks about by that rests, or stops on its way."""
    way: Floats
    """(n, 3) arm lengths per second: where it goes, without the hurry of each push, as the armature
    has it."""

    @property
    def widest(self) -> float:
        """How many times as wide as at rest the mantle is at most, 1 at least."""
        return 1.0 + max(float(self.filled.max(initial=0.0)), 0.0)

    def at(self, table: Floats, times: Floats) -> Floats:
        """A table (n, …) at times (moments,), seconds."""
        place = np.clip(times / self.track.step, 0.0, len(table) - 1.0)
        index = np.minimum(place.astype(np.int64), len(table) - 2)
        share = (place - index).reshape(-1, *[1] * (table.ndim - 1))
        return table[index] + share * (table[index + 1] - table[index])


def self_motion(
    track: BodyTrack,
    settings: BodySettings,
    *,
    breath: tuple[float, float],
    unlike: float,
    seed: int,
    eyes: int,
) -> SelfMotion:
    """What a body does by itself on its way.

    Args:
        track: its way.
        settings: how much of each.
        breath: by how much wider a breath makes the mantle, as a share, and seconds of a breath.
        unlike: how much breaths differ from each other, 1 for as much as is natural.
        seed: of what is drawn at random.
        eyes: how many it has.

    Raises:
        SettingsError: a breath takes no time.
    """
    drawn = -_LAGS * track.acceleration - _TRAILS * track.seen(track.velocity)
    wanted = np.concatenate([_within(drawn, _FARTHEST_SWING), -_STAYS * track.turning], axis=1)
    swing = sprung(wanted, track.step, frequency=_SWINGS, damping=_DAMPED, cyclic=track.cyclic)
    drift = np.cumsum(track.turning, axis=0) * track.step
    quick = _within(drift - _going_on(track, drift), _MOST_STEADY)
    filled, outflow = _breathing(track, breath, unlike, seed)
    squeezed, swollen = _stroke(track)
    pumped = settings.mantle * track.swimming * (_SWOLLEN * swollen - _DRAWN * squeezed)
    rate = np.maximum(np.gradient(squeezed, track.step), 0.0) * track.swimming
    return SelfMotion(
        track=track,
        settings=settings,
        swing=settings.mantle * swing,
        steady=-settings.head * _STEADY * quick,
        filled=filled + pumped,
        outflow=np.maximum(outflow, np.tanh(0.4 * rate)),
        shut=np.stack([_blinking(track, seed, eye) for eye in range(eyes)], axis=1)
        if eyes
        else np.zeros((len(track.times), 0)),
        about=_looking_about(track, seed),
        way=track.evened(track.seen(track.velocity), _HEADED),
    )


def _within(vectors: Floats, most: float) -> Floats:
    """Vectors (n, 3) that come near to a length, and not beyond it."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors * (most * np.tanh(length / most) / np.maximum(length, 1e-12))


def _going_on(track: BodyTrack, drift: Floats) -> Floats:
    """How far a body would have turned (n, 3), did it turn evenly."""
    line = np.linspace(0.0, 1.0, len(drift))[:, None] * (drift[-1] - drift[0]) + drift[0]
    if track.cyclic:
        return line + track.evened(drift - line, _QUICK)
    width = _QUICK / track.step
    margin = min(int(4.0 * width), len(drift) - 1)
    wide = np.pad(drift, ((margin, margin), (0, 0)), mode="reflect", reflect_type="odd")
    return evened(wide, width, cyclic=False)[margin : margin + len(drift)]


def _breathing(
    track: BodyTrack, breath: tuple[float, float], unlike: float, seed: int
) -> tuple[Floats, Floats]:
    """By how much wider a mantle is as it breathes (n,), and how strongly water leaves it (n,)."""
    amount, seconds = breath
    if not seconds > 0.0:
        raise SettingsError(
            phrase("A breath takes {breath:g} seconds.", breath=seconds), "Give more than 0."
        )
    pace = (1.0 + _HASTE * np.tanh(track.speed)) / seconds
    breaths = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]))]) * track.step
    if track.cyclic:
        # A whole number of them, at least one.
        breaths *= max(round(breaths[-1]), 1) / breaths[-1]
    count = int(np.ceil(breaths[-1] - 1e-9)) + 1
    random = np.random.default_rng([seed, 1]).uniform(-1.0, 1.0, (count + 1, 2))
    if track.cyclic:
        random[count - 1 :] = random[: len(random) - count + 1]
    deep, begins = 1.0 + unlike * _UNLIKE[0] * random[:, 0], unlike * _UNLIKE[1] * random[:, 1]
    begins[0] = 0.0
    if track.cyclic:
        begins[count - 1 :] = 0.0
    knots = np.arange(count + 1) + begins
    number = np.clip(np.searchsorted(knots, breaths, side="right") - 1, 0, count - 1)
    share = (breaths - knots[number]) / (knots[number + 1] - knots[number])
    # Half a turn for breathing in and half a turn for breathing out.
    turn = np.interp(share, [0.0, _INHALE, 1.0], [0.0, 0.5, 1.0])
    size = amount * deep[number] * (1.0 - (1.0 - _SWIM_BREATH) * track.swimming)
    out = np.sin(np.pi * np.clip((share - _INHALE) / (1.0 - _INHALE), 0.0, 1.0)) ** 2
    return 0.5 * size * (1.0 - np.cos(2.0 * np.pi * turn)), 0.5 * out * (amount > 0.0)


def _stroke(track: BodyTrack) -> tuple[Floats, Floats]:
    """How far a stroke has drawn a mantle together (n,), and how far it has swollen for it (n,)."""
    since = np.mod(track.strokes + 0.5, 1.0) - 0.5
    drawn = least_jerk((since + 0.14) / 0.2) * (1.0 - least_jerk((since - 0.08) / 0.34))
    before = np.mod(track.strokes, 1.0)
    swollen = least_jerk((before - 0.45) / 0.25) * (1.0 - least_jerk((before - 0.8) / 0.16))
    return drawn, swollen


def _looking_about(track: BodyTrack, seed: int) -> Floats:
    """Radians (n,) to the left by which who stands looks about: now here, now there."""
    whole = float(track.times[-1])
    count = max(round(whole / _GLANCES), 1) if track.cyclic else whole / _GLANCES
    drawn = np.random.default_rng([seed, 3]).uniform(-_ABOUT, _ABOUT, int(count) + 2)
    if track.cyclic:
        drawn[int(count) :] = drawn[0]
    place = track.times / whole * count
    number = np.minimum(place.astype(np.int64), len(drawn) - 2)
    share = least_jerk((place - number - _HELD) / (1.0 - _HELD))
    still = _STANDING / (track.evened(track.speed[:, None], _HEADED)[:, 0] + _STANDING)
    about = still**2 * (drawn[number] + share * (drawn[number + 1] - drawn[number]))
    return about if track.looks is None else about + track.looks


def _blinking(track: BodyTrack, seed: int, eye: int) -> Floats:
    """How far an eye is shut (n,), 0…1."""
    whole = float(track.times[-1])
    count = int(whole / _BLINKS + (0.5 if track.cyclic else 1.0))
    shut = np.zeros(len(track.times))
    random = np.random.default_rng([seed, 2]).uniform(0.25, 0.75, count)
    every = whole / max(count, 1) if track.cyclic else _BLINKS
    # One eye is a little later than the other.
    for middle in every * (np.arange(count) + random) + 0.03 * eye:
        away = np.abs(track.times - middle) / _BLINK
        shut = np.maximum(shut, 1.0 - least_jerk(away))
    return shut
