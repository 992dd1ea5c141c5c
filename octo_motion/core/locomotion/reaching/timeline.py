# SPDX-License-Identifier: GPL-3.0-or-later
"""How an octopus reaches: a bend that travels along the arm from its base to its tip.

Gutfreund, Flash, Yarom, Fiorito, Segev and Hochner, "Organization of octopus arm movements: a
model system for studying the control of flexible arms" (Journal of Neuroscience 16, 1996), found
that an octopus reaches by pushing a bend along its arm: what lies before the bend is straight and
points at the target, what lies behind follows it curled; the bend's speed has one peak between
start and end, and the movement stays near a plane. Here time is given to each stretch of the way as
it turns the arm, on a course whose speed is such a bell (``even_bell``). What lies behind the bend
is a logarithmic spiral: its radius is in proportion to what is left of the arm, so it does not run
into itself. Suckers face outwards there, and lead at the bend, as they do in nature.

After the touch the same front runs on to the tip, and the arm winds about the object as it passes.
An arm that only curls up has the same spiral, which forms at its tip.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...errors import SettingsError
from ...phrases import phrase
from ...rotations import (
    Floats,
    angle_between,
    from_axis_angle,
    lerp_rotation_vectors,
    multiply,
)
from ...smoothing import blurred, least_jerk
from ..rig import ArmFrames, bend_rotations

FOLD: Final = np.radians(70.0)
"""Angle of the travelling bend."""
_SPIRAL: Final = 0.8
"""Radians of the spiral for each time that what is left of the arm gets e times shorter."""
_BLUNT: Final = 0.2
"""Arm lengths that the spiral thinks are left at the tip, so that it is not wound up endlessly."""
_SHY: Final = 0.2
"""Share of bend and spiral while the bend is at the root: an arm that folds back there would lie
over the head."""
_BOLD: Final = 0.6
"""Where along the arm, in its lengths, the bend has its full angle."""
_MOST_BENT: Final = np.radians(75.0)
"""Of one joint."""
_FRONT: Final = 0.36
"""Width of the front in arm lengths."""
_FRONT_SEGMENTS: Final = 2.0
"""Least width of the front in segments."""
_FIRST_BEND: Final = 0.1
"""Where the bend forms, in arm lengths from the root."""
_GATHERED: Final = 0.7
"""Share of the reach by which the arm has left what it did otherwise."""
_STAGGER: Final = 0.5
"""How much later the root joins in than the tip, in times that each of them takes."""
_UNWOUND: Final = 0.7
"""Share of the return by which the arm has let go."""
_LEAVES: Final = 0.3
"""Share of the return after which the arm begins to go back to what it does otherwise."""
_LIMP: Final = 0.4
"""Share of bend and spiral that an arm has left when it has let go: it does not fling its tip."""


_SOON: Final = 0.15
"""Share of the way out within which an arm has set out, and of the way back within which it is
back."""
_TAKES: Final = 0.4
"""The same within which what it holds comes to stay where it is, and stays there no more."""
_SAMPLES: Final = 65
"""Moments of a part of a reach at which is looked how it turns."""
_EVEN_SHARES: Final = np.linspace(0.0, 1.0, _SAMPLES)
_LOUDEST: Final = 6.0
"""Power of the mean over an arm's bones of how far they turn: nearly the largest, and smooth."""
_EVEN: Final = 0.25
"""Share of the mean turn that time is given for where nothing turns."""
_AT_ONCE: Final = 1e-6
"""Frames that what takes none takes."""


@dataclass(frozen=True)
class Timeline:
    """When an arm does what, in frames."""

    start: float
    """It sets out."""
    contact: float
    """It touches."""
    closed: float
    """It is wound all the way."""
    release: float
    """It begins to let go."""
    end: float
    """It does what it would do otherwise."""

    def __post_init__(self) -> None:
        times = (self.start, self.contact, self.closed, self.release, self.end)
        if not np.all(np.isfinite(times)):
            raise SettingsError("A time of the reach is not a number.", "Set it anew.")
        if not self.start < self.contact <= self.closed <= self.release < self.end:
            raise SettingsError(
                phrase(
                    "A reach that starts at frame {start:g}, touches at {contact:g}, holds from "
                    "{closed:g} to {release:g} and ends at {end:g} is out of order.",
                    start=self.start,
                    contact=self.contact,
                    closed=self.closed,
                    release=self.release,
                    end=self.end,
                ),
                "Let each come after the one before.",
            )

    def progress(self, times: Floats, pace: Pace | None = None) -> Progress:
        """How far reaching out, winding and going back are at times (frames,)."""
        shares = [
            even_bell((times - begin) / max(end - begin, _AT_ONCE)) for begin, end in self.spans
        ]
        if pace is not None:
            shares = [
                np.interp(share, own, _EVEN_SHARES)
                for share, own in zip(shares, pace.ways, strict=True)
            ]
        return Progress(*shares)

    @property
    def spans(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """First and last frame of reaching out, of winding and of going back."""
        return (
            (self.start, self.contact),
            (self.contact, self.closed),
            (self.release, self.end),
        )

    def passing(self, pace: Pace | None = None) -> tuple[Floats, ...]:
        """Frames (moments,) at which each part is so far as ``Pace.of`` looks at it."""
        ways = (_EVEN_SHARES,) * 3 if pace is None else pace.ways
        course = even_bell(_EVEN_SHARES)
        return tuple(
            begin + (end - begin) * np.interp(way, course, _EVEN_SHARES)
            for (begin, end), way in zip(self.spans, ways, strict=True)
        )


@dataclass(frozen=True, eq=False)
class Progress:
    """How far the three parts of a reach are, (moments,) each, 0…1."""

    out: Floats
    wound: Floats
    back: Floats

    def __getitem__(self, chosen: np.ndarray) -> Progress:
        """At some of the moments."""
        return Progress(self.out[chosen], self.wound[chosen], self.back[chosen])

    def weight(self, along: Floats) -> Floats:
        """How far (moments, joints) the arm has left what it does otherwise, 0…1, of joints along
        it (joints,), 0…1.

        The tip curls up before the root aims, and stretches out after the root has gone back: so
        the arm does not sweep over what it reaches for.
        """
        out = self.out[:, None] / _GATHERED
        gone = (self.back[:, None] - _LEAVES) / (1.0 - _LEAVES)
        out = least_jerk((1.0 + _STAGGER) * out - _STAGGER * (1.0 - along))
        gone = least_jerk((1.0 + _STAGGER) * gone - _STAGGER * along)
        return out * (1.0 - gone)

    @property
    def away(self) -> Floats:
        """How far (moments,) the arm has left what it does otherwise, 0…1, at its very ends."""
        return least_jerk(self.out / _SOON) * least_jerk((1.0 - self.back) / _SOON)

    @property
    def holds(self) -> Floats:
        """How far (moments,) the arm holds what it reaches for, 0…1: all of it only meanwhile."""
        return least_jerk((self.out - 1.0) / _TAKES + 1.0) * least_jerk(1.0 - self.back / _TAKES)

    @property
    def limp(self) -> Floats:
        """Share (moments,) of bend and spiral that the arm has, 1 until it lets go."""
        return 1.0 - (1.0 - _LIMP) * least_jerk(self.back)

    def front(self, *, begins: float, touches: float, ends: float, freed: float) -> Floats:
        """Where (moments,) the front is along the arm, from its four places: the last is where it
        is when all of the arm is off the object again.
        """
        place = begins + (touches - begins) * self.out + (ends - touches) * self.wound
        return place + (freed - ends) * self.back / _UNWOUND


@dataclass(frozen=True, eq=False)
class Pace:
    """Which share of the turning of a reach is over by each moment of its even progress, for its
    three parts: time is given to each stretch as it turns the arm.
    """

    ways: tuple[Floats, Floats, Floats]

    @classmethod
    def of(cls, shape: Callable[[Progress, Floats], Floats], passing: Sequence[Floats]) -> Pace:
        """The pace at which no part of the way is hurried, from the frames (moments, bones, 4) that
        an arm has at some progress; each part is ``passing`` it at frames (moments,).
        """
        even, none, whole = _EVEN_SHARES, np.zeros(_SAMPLES), np.ones(_SAMPLES)
        parts = (
            Progress(even, none, none),
            Progress(whole, even, none),
            Progress(whole, whole, even),
        )
        out, wound, back = (
            _turned(shape(part, times)) for part, times in zip(parts, passing, strict=True)
        )
        return cls((out, wound, back))


def unhurried(share: Floats, shape: Callable[[Floats], Floats]) -> Floats:
    """Shares (…) of a way that hurries nowhere, from those of its time, by the frames (moments,
    bones, 4) that an arm has at shares (moments,) of the way.
    """
    return np.interp(even_bell(share), _turned(shape(_EVEN_SHARES)), _EVEN_SHARES)


def _turned(frames: Floats) -> Floats:
    """Which share of its turning an arm has behind it, at the moments of its frames (moments,
    bones, 4).
    """
    turned = angle_between(frames[:-1], frames[1:])
    most = np.sum(turned**_LOUDEST, axis=-1) ** (1.0 / _LOUDEST)
    most = blurred(most[:, None], _SAMPLES // 32)[:, 0]
    way = np.cumsum(np.append(0.0, most + _EVEN * (most.mean() + _AT_ONCE)))
    return way / way[-1]


def even_bell(share: Floats) -> Floats:
    """A way from rest to rest whose speed is a bell with a broad top, ``(1 − u⁴)²`` for u from −1
    to 1: at its highest 1.41 times the mean, where that of least jerk is 1.88 times as high.
    """
    u = 2.0 * np.minimum(np.maximum(share, 0.0), 1.0) - 1.0
    fourth = u * u * u * u
    return 0.5 + 0.5 * u * (1.0 - fourth * (0.4 - fourth / 9.0)) / _BELL


_BELL: Final = 1.0 - 0.4 + 1.0 / 9.0
"""What is under half of it."""


def front_width(lengths: Floats) -> float:
    """Over how long a stretch of the arm the front passes."""
    return max(_FRONT * float(lengths.sum()), _FRONT_SEGMENTS * float(lengths.mean()))


def first_place(lengths: Floats) -> float:
    """Where the front is when the bend forms."""
    return _FIRST_BEND * float(lengths.sum())


def passed(lengths: Floats, front: Floats) -> Floats:
    """How far (…, segments) the front (…) has passed the joint at each segment's root, 0…1.

    The first joint aims the arm; it is always passed.
    """
    joints = np.cumsum(lengths) - lengths
    result = least_jerk((front[..., None] - joints) / front_width(lengths))
    result[..., 0] = 1.0
    return result


def folded(
    lengths: Floats, front: Floats, *, bend: Floats | float = 1.0, curl: Floats | float = 1.0
) -> Floats:
    """Turns (…, segments, 4) of what the front (…), a place along the arm, has not passed: so much
    of the bend, and of the spiral beyond it.
    """
    whole, width = float(lengths.sum()), front_width(lengths)
    shy = _SHY + (1.0 - _SHY) * least_jerk(front[..., None] / (_BOLD * whole))
    shy = np.where(front[..., None] < 0.0, 1.0, shy)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    left = whole - ends + _BLUNT * whole
    spiral = curl * _SPIRAL * np.log(left[:-1] / left[1:])
    # The bend lies within the front: its angle up to each place along the arm runs as the front.
    behind = front[..., None] - 0.5 * width
    so_far = least_jerk((ends - 0.5 * np.append(lengths, lengths[-1]) - behind) / width)
    fold = bend * FOLD * np.diff(so_far, axis=-1)
    angles = np.minimum(shy * (spiral + fold), _MOST_BENT)
    angles[..., 0] = 0.0
    return bend_rotations(angles)


# --- An arm that curls up from its tip, and stretches again ---------------------------------------


_FREE: Final = 0.3
"""Share of the arm, from its root, that hardly curls."""
_TIGHT: Final = 4.65
"""How much tighter than that of a reach the spiral is."""
_EMBRACE: Final = np.radians(95.0)
"""Of all bones together to the side, of an arm that closes over what another has brought …"""
_DOWN: Final = np.radians(30.0)
"""… to its suckers …"""
_LEANS: Final = np.radians(20.0)
"""… and of its first."""
_SUCKERS: Final = np.array([0.0, 1.0, 0.0])
_ACROSS: Final = np.array([0.0, 0.0, 1.0])
_WAVE: Final = 0.5
"""How much of the time the curl needs to run along the arm."""


def curled(arm: ArmFrames, timeline: Timeline, times: Floats, otherwise: Floats) -> Floats:
    """Rotations (frames, bones, 4) of an arm that curls up until it "touches", in arm lengths.

    A spiral forms at the tip and runs towards the root; letting go, the root is first to stretch.
    Of the timeline ``start``, ``contact``, ``release`` and ``end`` count.
    """
    share = _curling(arm, timeline, times) * least_jerk(arm.along / _FREE)
    usual = arm.shape(arm.from_bones(otherwise))
    # A front before the arm's root: all of it is behind.
    spiral = folded(arm.lengths, np.full(len(times), -arm.length), bend=0.0, curl=_TIGHT)
    spiral[:, 0] = usual[:, 0]
    return _blended(arm, usual, spiral, share, otherwise)


def embracing(
    arm: ArmFrames, timeline: Timeline, times: Floats, otherwise: Floats, way: float
) -> Floats:
    """Rotations (frames, bones, 4) of an arm that bends to its side, the way (1 or −1) about the
    side of its suckers, as one that closes over what another arm has brought.

    Times are as in :func:`curled`.
    """
    share = _curling(arm, timeline, times)
    usual = arm.shape(arm.from_bones(otherwise))
    share_of_it = arm.lengths / arm.length
    aside = from_axis_angle(_SUCKERS, way * _EMBRACE * share_of_it)
    aside = multiply(aside, from_axis_angle(_ACROSS, _DOWN * share_of_it))
    turned = np.tile(aside, (len(times), 1, 1))
    turned[:, 0] = multiply(usual[:, 0], from_axis_angle(_SUCKERS, way * _LEANS))
    return _blended(arm, usual, turned, share, otherwise)


def _curling(arm: ArmFrames, timeline: Timeline, times: Floats) -> Floats:
    """How far (frames, bones) an arm is curled, the tip first, and the root first to stretch."""
    along = arm.along
    up = (times[:, None] - timeline.start) / (timeline.contact - timeline.start)
    down = (times[:, None] - timeline.release) / (timeline.end - timeline.release)
    up = least_jerk((up - _WAVE * (1.0 - along)) / (1.0 - _WAVE))
    return up * (1.0 - least_jerk((down - _WAVE * along) / (1.0 - _WAVE)))


def _blended(
    arm: ArmFrames, usual: Floats, other: Floats, share: Floats, otherwise: Floats
) -> Floats:
    """Rotations (frames, bones, 4) of an arm between two shapes; ``otherwise`` where it is in the
    first.
    """
    shape = arm.shaped(lerp_rotation_vectors(usual, other, share))
    result = otherwise.copy()
    moves = np.any(share > 0.0, axis=-1)
    result[moves] = arm.to_bones(shape)[moves]
    return result
