# SPDX-License-Identifier: GPL-3.0-or-later
"""Mantle, head, siphon and eyes over time: what swings, breathes and blinks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import Floats
from ...smoothing import least_jerk
from .evening import evened
from .settings import BodySettings
from .track import BodyTrack, sprung

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
    """(n,) radians to the left that a body at rest looks about by."""
    way: Floats
    """(n, 3) arm lengths per second: where it goes, without the hurry of each push, as the armature
    has it."""

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
    return still**2 * (drawn[number] + share * (drawn[number + 1] - drawn[number]))


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
