# SPDX-License-Identifier: GPL-3.0-or-later
"""When feet stand: found from how they move in their own clip.

Each foot has two points on which it may rest, the ankle and the ball: while a foot is flat both
stand still, as its heel lifts only the ball does. How high they are does not count: stairs, slopes
and mats need no ground to be known, and a foot held still in the air is to be still as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...rotations import Floats, conjugate, rotate
from ..clip import Posture, sample_clip, sample_world
from ..humanoid import chain_length
from .parts import LEG
from .retarget import MappedClip

ANKLE: Final = 0
BALL: Final = 1
"""The points of a foot, in the order of arrays."""

_FINE: Final = 120.0
"""Moments per second at which feet are looked at, about: between frames too, so that a motion says
the same at any frame rate."""

_SLOW: Final = 0.14
"""Leg lengths per second: a point that stands is slower than this at some time, …"""

_STILL: Final = 0.28
"""… and never faster than this."""

_SECONDS: Final = 0.04
"""Over which a speed is measured, to either side: less would measure noise."""

_SHORTEST: Final = 0.08
"""Seconds for which a foot stands at least. At the top of a jump it is slow for less."""

_ROOM: Final = np.array([(0.06, 0.06, 0.02), (0.06, 0.06, 0.04)])
"""Leg lengths along X, Y and Z that ankle and ball are off the middle of where they stand, at most:
a point that creeps on for long does not stand, nor does a heel that rises slowly."""

_ROUNDS: Final = 3
"""Of taking out what is too far off: what is left has another middle."""

_LOWER: Final = 0.05
"""Of all that stands: how much of it lies below where one begins to look for the ground. With a
third the greater part of a clip that drifts upwards told it, and its beginning was buried."""

_SHIFTS: Final = 20
"""Steps to where most of it lies near by."""

_SPREAD: Final = 0.02
"""Leg lengths by which heights on one ground differ: breath, soft soles, and what files lose."""

_LOW: Final = 0.12
"""Leg lengths above its lowest that a point which stands says little of the ground."""

_LEAST: Final = 0.04
"""Of all frames: for how many at least somebody stands, or nothing is known of it."""

_FLOOR: Final = 0.05
"""Of all frames: for how many a point may be lower than where it stands."""


@dataclass(frozen=True, eq=False)
class FootPaths:
    """Where feet are in the world; axis 1 is left and right, axis 2 ankle and ball."""

    points: Floats
    """(moments, 2, 2, 3)"""
    leg: float
    """Length of a leg, world units."""
    rate: float
    """Moments per second."""
    hips: Floats
    """(moments, 2, 3) hip joints."""
    moments: Floats
    """(moments,) in the clip's frame numbers."""


@dataclass(frozen=True, eq=False)
class FootContacts:
    """Which points of the feet stand; axes as in :class:`FootPaths`."""

    held: np.ndarray
    """(moments, 2, 2) bool"""


def fine_moments(frames: Floats, rate: float) -> Floats:
    """Moments (moments,) from the first to the last of some frames, evenly apart and all frames
    among them if these are; of a clip of so many frames a second.
    """
    if len(frames) < 2:
        return frames
    pace = float(np.median(np.diff(frames)))
    parts = max(1, round(_FINE * pace / rate))
    count = int(np.ceil((frames[-1] - frames[0]) / pace * parts - 1e-6))
    return frames[0] + np.arange(count + 1.0) * (pace / parts)


def foot_bones(mapped: MappedClip, side: str) -> tuple[int, int, int, int]:
    """Thigh, shin, foot and toes of a side; −1 where there are no toes.

    Raises:
        ClipError: a landmark is missing.
    """
    thigh, shin, foot = (mapped.bone(name) for name in LEG.limb_on(side))
    toe = mapped.skeleton.index.get(mapped.humanoid().get(f"toe.{side}") or "", -1)
    if toe not in mapped.skeleton.children[foot]:
        toe = -1
    return thigh, shin, foot, toe


def ball_places(mapped: MappedClip) -> Floats:
    """Where the balls of the feet are as seen from their bones, (2, 3), left and right: where the
    toes begin. Of a foot without toes the ankle is all that is known: where its bone ends is the
    file's choice.

    Raises:
        ClipError: a landmark is missing.
    """
    skeleton = mapped.skeleton
    found = np.zeros((2, 3))
    for side, name in enumerate("LR"):
        _, _, foot, toe = foot_bones(mapped, name)
        if toe >= 0:
            back = conjugate(skeleton.rest_rotations[foot])
            found[side] = rotate(back, skeleton.heads[toe] - skeleton.heads[foot])
    return found


def foot_paths(
    mapped: MappedClip, posture: Posture, moments: Floats, balls: Floats | None = None
) -> FootPaths:
    """Where the feet are at some moments of a clip, whose posture there is given.

    Args:
        mapped: the clip.
        posture: at those moments.
        moments: (moments,)
        balls: (2, 3) where the balls of the feet are if elsewhere than :func:`ball_places` says.

    Raises:
        ClipError: a landmark is missing.
    """
    clip = mapped.clip
    turns, shifts, scale = sample_world(clip, moments)
    points, hips = np.empty((len(moments), 2, 2, 3)), np.empty((len(moments), 2, 3))
    balls = ball_places(mapped) if balls is None else balls
    leg = 0.0
    for side, name in enumerate("LR"):
        thigh, shin, foot, _ = foot_bones(mapped, name)
        leg += 0.5 * scale * chain_length(mapped.skeleton, (thigh, shin, foot))
        hips[:, side] = shifts + scale * rotate(turns, posture.head(thigh))
        ankle = posture.head(foot)
        along = rotate(posture.orientation(foot), balls[side])
        for number, place in ((ANKLE, ankle), (BALL, ankle + along)):
            points[:, side, number] = shifts + scale * rotate(turns, place)
    pace = float(np.median(np.diff(moments))) if len(moments) > 1 else 1.0
    return FootPaths(points, leg, clip.rate / pace, hips, moments)


def own_paths(mapped: MappedClip, balls: Floats | None = None) -> FootPaths:
    """Where the feet of a clip are, at its frames and between them."""
    clip = mapped.clip
    moments = fine_moments(clip.frames, clip.rate)
    return foot_paths(mapped, sample_clip(clip, moments), moments, balls)


def find_contacts(paths: FootPaths) -> FootContacts:
    """When the points of the feet stand."""
    points = paths.points
    count = len(points)
    if count < 2:
        return FootContacts(np.ones(points.shape[:3], dtype=bool))
    speeds = _speeds(paths)
    still = speeds < _STILL
    held = np.zeros_like(still)
    shortest = min(_SHORTEST * paths.rate, count)
    for side in range(2):
        for point in range(2):
            own = side, point
            held[:, side, point] = _standing(
                still[:, *own], speeds[:, *own], points[:, *own], shortest, _ROOM[point] * paths.leg
            )
    return FootContacts(held)


def _speeds(paths: FootPaths) -> Floats:
    """(frames, 2, 2) leg lengths per second."""
    points, count = paths.points, len(paths.points)
    reach = max(1, round(_SECONDS * paths.rate))
    rows = np.arange(count)
    before, after = np.maximum(rows - reach, 0), np.minimum(rows + reach, count - 1)
    seconds = np.maximum(after - before, 1)[:, None, None] / paths.rate
    return np.linalg.norm(points[after] - points[before], axis=-1) / seconds / paths.leg


def _standing(
    still: np.ndarray, speeds: Floats, places: Floats, shortest: float, room: Floats
) -> np.ndarray:
    """(frames,) where one point stands: of where it is still, where it is slow at some time, long
    enough, and stays within some room about one place.
    """
    count = len(still)
    still = still | short_gaps(still, round(0.5 * shortest))
    for _ in range(_ROUNDS):
        starts, stops = runs(still)
        if not len(starts):
            break
        edges = np.stack([starts, stops], axis=1).ravel()
        slowest = np.minimum.reduceat(np.append(speeds, np.inf), edges)[::2]
        good = (slowest < _SLOW) & (stops - starts >= shortest)
        still = within_runs(starts[good], stops[good], count)
        rows, counts = np.flatnonzero(still), (stops - starts)[good]
        if not len(rows):
            break
        means = np.add.reduceat(places[rows], np.cumsum(counts) - counts, axis=0) / counts[:, None]
        off = (places[rows] - np.repeat(means, counts, axis=0)) / room
        far = np.linalg.norm(off, axis=-1) > 1.0
        if not far.any():
            break
        still[rows[far]] = False
    return still


def runs(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row of each run of true values, and the row after its last."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def short_gaps(mask: np.ndarray, most: int) -> np.ndarray:
    """(frames,) what lies between two runs that are so many frames apart at most."""
    starts, stops = runs(~mask)
    inner = (starts > 0) & (stops < len(mask)) & (stops - starts <= most)
    return within_runs(starts[inner], stops[inner], len(mask))


def within_runs(starts: np.ndarray, stops: np.ndarray, count: int) -> np.ndarray:
    """(count,) whether a row is in one of some runs."""
    steps = np.zeros(count + 1, dtype=np.intp)
    np.add.at(steps, starts, 1)
    np.add.at(steps, stops, -1)
    return np.cumsum(steps)[:-1] > 0


@dataclass(frozen=True, eq=False)
class Stance:
    """How a body stands."""

    ankle: float
    """Height of the ankles of feet that stand flat, world."""
    ball: float
    """Height of the balls of feet that stand, world."""


def find_stance(paths: FootPaths) -> Stance:
    """How a body stands in its clip: the usual heights of feet that do; where none does, of their
    lowest points. A moment says the more the slower a foot is, without a limit from which on it
    says nothing: files that keep a motion a little less exactly tell the same heights.
    """
    heights = paths.points[..., 2]
    floors = np.quantile(heights, _FLOOR, axis=(0, 1))
    # On a treadmill nothing stands, but what turns round in the air is slow.
    low = 1.0 / (1.0 + ((heights - floors) / (_LOW * paths.leg)) ** 4)
    weights = low / (1.0 + (_speeds(paths) / _SLOW) ** 4)
    flat = weights.min(axis=-1)
    said, each_said = flat.max(axis=1).mean(), weights.max(axis=1).mean(axis=0)
    # A foot stands with both on one ground, which may be one of several.
    together = said > _LEAST or 2.0 * said > each_said.max() > _LEAST
    found = []
    for point in (ANKLE, BALL):
        if together or each_said[point] > _LEAST:
            seen = heights.mean(axis=-1) if together else heights[..., point]
            chosen = flat if together else weights[..., point]
            near = _usual(seen.ravel(), chosen.ravel(), _SPREAD * paths.leg)
            found.append(float(near @ heights[..., point].ravel() / near.sum()))
        else:
            found.append(float(floors[point]))
    return Stance(*found)


def _usual(heights: Floats, weights: Floats, near: float) -> Floats:
    """Weights of what is near the lowest height at which somebody stands: ground, not a step.

    From what hardly anything is below it goes to where most is near by: mean shift after Comaniciu
    and Meer, "Mean Shift: A Robust Approach Toward Feature Space Analysis" (2002).
    """
    order = np.argsort(heights)
    passed = np.cumsum(weights[order])
    middles = passed - 0.5 * weights[order]
    height = float(np.interp(_LOWER * passed[-1], middles, heights[order]))
    for _ in range(_SHIFTS):
        around = weights * np.exp(-(((heights - height) / near) ** 2))
        height = float(around @ heights / around.sum())
    return weights * np.exp(-(((heights - height) / near) ** 2))
