# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of arms as a whole: along a curve, between two others, off the ground, onto a goal.

A shape is the directions of an arm's segments, (segments, 3, batch), unit vectors; the batch comes
last, as in ``columns``. Every function is smooth in what it is given, so that what it makes of a
motion that is continuous is continuous.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ..rotations import Floats
from .columns import dot, product, smallest_arc, turned
from .ground import Ground

_WEAK: Final = 0.02
"""Least lever that joints are raised with, in squares of the first segment's length."""
_SHORTEST: Final = 0.2
_LONGEST: Final = 4.0
"""Handles of a curve, in its lengths."""
_HALVINGS: Final = 7
"""Steps in which they are found."""
_BOLD: Final = 0.6
"""Radians that a segment turns at a step of Newton's at most."""
_FIRM: Final = 1e-4
"""What keeps the steps finite where an arm is straight, as a share of its own stiffness."""
_TINY: Final = 1e-12


def curve(
    *,
    leaving: Floats,
    arriving: Floats,
    chord: Floats,
    size: Floats,
    middles: Floats,
    parts: Floats,
) -> Floats:
    """Directions (segments, 3, batch) along a cubic that is about as long as it should be.

    Args:
        leaving: (3, batch) unit, at its start.
        arriving: (3, batch) unit, at its end.
        chord: (3, batch) from start to end.
        size: (batch,) how long it should be.
        middles: (segments, 1, batch) where on it the segments' middles are, 0…1.
        parts: (segments, batch) how much of each segment is on it.
    """
    t = middles
    start, end = 1.0 - 4.0 * t + 3.0 * t * t, 3.0 * t * t - 2.0 * t
    straight = 6.0 * t * (1.0 - t) * chord
    handles = size * (start * leaving + end * arriving)
    share = parts / np.maximum(np.sum(parts, axis=0), _TINY)
    wanted = np.sqrt(dot(chord, chord)) / size

    def excess(handle: Floats) -> Floats:
        mean = np.sum(share[:, None] * unit(straight + handle * handles), axis=0)
        return np.sqrt(dot(mean, mean)) - wanted

    # The longer the handles, the more of its length the curve spends on its way round.
    low, high = np.full(size.shape, _SHORTEST), np.full(size.shape, _LONGEST)
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        short = excess(middle) < 0.0
        low, high = np.where(short, low, middle), np.where(short, middle, high)
    # Between the two, in proportion: so the curve does not change by steps.
    above, below = np.maximum(excess(low), 0.0), np.maximum(-excess(high), 0.0)
    handle = low + (high - low) * above / np.maximum(above + below, _TINY)
    return unit(straight + handle * handles)


def blended(outward: Floats, start: Floats, end: Floats, share: Floats) -> Floats:
    """Shapes (segments, 3, batch) between two others, by the angles at their joints.

    Directions themselves would have no middle where they are opposite. What an arm's shape
    consists of are its bends, from each segment to the next, seen along the arm without twist:
    two numbers at each joint, and these are far from a half turn.

    Args:
        outward: (3, batch) unit: what the first segment's direction is told from.
        start: (segments, 3, batch) unit.
        end: (segments, 3, batch) unit.
        share: (batch,) 0 at the start, 1 at the end.
    """
    between = np.flatnonzero((share > 0.0) & (share < 1.0))
    result = np.where(share < 1.0, start, end)
    if len(between) == 0:
        return result
    first = np.broadcast_to(np.array([[1.0], [0.0], [0.0]]), (3, len(between)))
    rest = smallest_arc(first, outward[:, between])
    share = share[between]
    frames = [rest, rest, rest]
    for number in range(len(start)):
        bends = []
        for which, shape in enumerate((start, end)):
            local = turned(_conjugate(frames[which]), shape[number][:, between])
            bends.append(_bend(local))
            frames[which] = product(frames[which], _swing(bends[-1]))
        bend = bends[0] + share * (bends[1] - bends[0])
        frames[2] = product(frames[2], _swing(bend))
        result[number][:, between] = _first_axis(frames[2])
    return result


def _conjugate(turns: Floats) -> Floats:
    return turns * np.array([[1.0], [-1.0], [-1.0], [-1.0]])


def _bend(direction: Floats) -> Floats:
    """Rotation vector (2, batch: about y and z) of the smallest turn from x to a direction."""
    across = np.hypot(direction[1], direction[2])
    angle = np.arctan2(across, direction[0])
    factor = np.where(across > 1e-9, angle / np.maximum(across, 1e-9), 1.0)
    return np.stack([-direction[2] * factor, direction[1] * factor])


def _swing(bend: Floats) -> Floats:
    """Quaternions (4, batch) of such rotation vectors."""
    angle = np.hypot(bend[0], bend[1])
    factor = 0.5 * np.sinc(angle * (0.5 / np.pi))
    zero = np.zeros_like(angle)
    return np.stack([np.cos(0.5 * angle), zero, bend[0] * factor, bend[1] * factor])


def _first_axis(turns: Floats) -> Floats:
    """Where quaternions (4, batch) carry x."""
    w, x, y, z = turns
    return np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)])


def raised(
    directions: Floats,
    lengths: Floats,
    *,
    free: Floats,
    roots: Floats,
    needed: Floats,
    loose: Floats,
    ground: Ground,
    rounds: int,
    soft: Floats,
) -> Floats:
    """Directions (segments, 3, batch) of arms whose joints are not too near to the ground.

    The lowest joints are raised by turning the segments before them as little as it takes. A
    segment that stands upright has no lever on the height, and is left alone.

    Args:
        directions: (segments, 3, batch) unit.
        lengths: (segments, batch)
        free: (segments, batch) how far each is free to turn, 0…1.
        roots: (3, batch) world.
        needed: (segments + 1, batch) how high above the ground each joint should be.
        loose: (segments + 1, batch) how far each is to be raised, 0…1.
        ground: what they should be above of.
        rounds: how often the lowest of them are raised.
        soft: (…, batch) how much above what is needed they begin to be raised.
    """
    least = 1e-4 * np.max(np.broadcast_to(soft, needed.shape), axis=0)
    for _ in range(rounds):
        joints = np.concatenate([roots[None], lengths[:, None] * directions]).cumsum(axis=0)
        below = ground.height(np.moveaxis(joints, 1, -1)) + needed - joints[:, 2]
        below = np.where(below > soft, below, np.maximum(below + soft, 0.0) ** 2 / (4.0 * soft))
        below *= loose
        weights = below * below
        weights /= np.sum(weights, axis=0) + least**2
        wanted = np.sum(weights * below, axis=0)
        # Share of the weights beyond each segment: what is raised by turning it.
        carried = weights[:0:-1].cumsum(axis=0)[::-1]
        level = 1.0 - directions[:, 2] ** 2
        lever = free * lengths * carried
        lift = wanted / (
            np.sum(lever * lengths * carried * level, axis=0) + _WEAK * lengths[0] ** 2
        )
        turn = -(lever * lift * directions[:, 2])[:, None] * directions
        turn[:, 2] += lever * lift
        most = np.sqrt(np.max(dot(turn, turn), axis=0))
        directions = unit(directions + turn / np.sqrt(1.0 + (most / _BOLD) ** 2))
    return directions


def drawn(
    directions: Floats,
    lengths: Floats,
    *,
    free: Floats,
    chosen: Floats,
    roots: Floats,
    goal: Floats,
    steps: int,
) -> Floats:
    """Directions turned as little as it takes for the arm to end at the goal, by Newton's method.

    The sum of squares of the turns, each divided by its segment's freedom, is smallest: three
    equations for the multiplier λ, one for each coordinate of the end.

    Args:
        directions: (segments, 3, batch) unit.
        lengths: (segments, batch)
        free: (segments, batch) how far each is free to turn, 0…1.
        chosen: (segments, batch) 1 for the segments up to the end that is drawn, else 0.
        roots: (3, batch) world.
        goal: (3, batch) world.
        steps: of Newton's method.
    """
    turning = chosen * free * lengths
    stiffness = turning * lengths
    whole = np.sum(stiffness, axis=0) + _TINY
    for _ in range(steps):
        ends = roots + np.sum(chosen[:, None] * (lengths[:, None] * directions), axis=0)
        x, y, z = directions[:, 0], directions[:, 1], directions[:, 2]
        wx, wy = stiffness * x, stiffness * y
        base = whole * (1.0 + _FIRM)
        matrix = (
            base - np.sum(wx * x, axis=0),
            -np.sum(wx * y, axis=0),
            -np.sum(wx * z, axis=0),
            base - np.sum(wy * y, axis=0),
            -np.sum(wy * z, axis=0),
            base - np.sum(stiffness * z * z, axis=0),
        )
        multiplier = _solved(matrix, goal - ends)
        turn = turning[:, None] * (
            multiplier - dot(directions, multiplier[None])[:, None] * directions
        )
        most = np.sqrt(np.max(dot(turn, turn), axis=0))
        directions = unit(directions + turn / np.sqrt(1.0 + (most / _BOLD) ** 2))
    return directions


def _solved(matrix: tuple[Floats, ...], right: Floats) -> Floats:
    """Solutions (3, batch) of symmetric equations xx, xy, xz, yy, yz, zz."""
    xx, xy, xz, yy, yz, zz = matrix
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * a + xy * b + xz * c
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    x, y, z = right
    return np.stack([a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z]) * (
        1.0 / np.maximum(determinant, _TINY * xx**3)
    )


def unit(vectors: Floats) -> Floats:
    """Vectors (…, 3, batch) at unit length."""
    return vectors * (1.0 / np.maximum(np.sqrt(dot(vectors, vectors)), _TINY))[..., None, :]


def smooth(share: Floats) -> Floats:
    """From 0 to 1 and from 1 on, level at both ends."""
    inside = np.clip(share, 0.0, 1.0)
    return inside * inside * (3.0 - 2.0 * inside)


def gentle(share: Floats) -> Floats:
    """The same with no acceleration at its ends either: next to a hold nothing moves at first."""
    inside = np.clip(share, 0.0, 1.0)
    return inside * inside * inside * (10.0 + inside * (6.0 * inside - 15.0))
