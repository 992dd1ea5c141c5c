# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of arms as a whole: along a curve, between two others, off the ground, onto a goal.

A shape is the directions of an arm's segments, (segments, 3, batch), unit vectors; the batch comes
last, components first. Every function is smooth in what it is given, so that what it makes of a
motion that is continuous is continuous.

Where a constant says what was seen when it was other, that is the default octopus with the ten
set-ups on bumps of 0.3 arm lengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...content_cache import part_of
from ...rotations import Floats, components_first, conjugate, rotate
from ...rotations.components_first import cumulative_sum, dot
from ..rig import ArmSkin, JointRoom
from .surface import Ground, Limbs

_ROUNDS: Final = 4
"""How often it is looked at how far level a segment leads, where the ground rises or falls. With
two bones are off by 0.5°, with eight by no more than 0.005°."""
_ROUGH_ROUNDS: Final = 2
"""The same of what is to be soon known, and may be off."""
_APART: Final = 0.02
"""Share of its length by which a segment may still be too long or too short then …"""
_STEP_HALVINGS: Final = 14
"""… or else it stands before a step, which is found by halving so often."""
_STEEPEST: Final = 2.0
"""Slope up to which a joint on it is the higher: steeper ground is a step, and ends."""


def laid(
    limbs: Limbs,
    ground: Ground,
    joint: int,
    *,
    skins: Floats,
    spot: Floats,
    heading: Floats,
    curl: Floats,
    rough: bool = False,
) -> Floats:
    """Joints from one on (arms, cycles, joints, 3) on the ground, segments as long as they are.

    Args:
        limbs: the arms.
        ground: what they lie on.
        joint: the one that touches first.
        skins: (arms, cycles, joints) metres from each of them to the skin below it.
        spot: (arms, cycles, 3) where; its height is not looked at.
        heading: (arms, cycles) which way they lie, radians about world Z from +X.
        curl: (arms, cycles) radians by which they are bent to one side on the way to the tip.
        rough: whether they may be a little off.
    """
    lengths = limbs.lengths[joint:]
    span = np.maximum(lengths.sum(axis=0), 1e-12)
    place = spot.copy()
    first = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    place[..., 2] = _resting(ground, spot, skins[..., 0], lengths[0][:, None], first)
    joints, passed = [place], np.zeros(heading.shape[:1])
    for number, length in enumerate(lengths):
        middle = (passed + 0.5 * length) / span
        # More and more to one side: an arm that lies slack ends in a curl.
        turn = heading + curl * (middle * middle)[:, None] * 2.0
        onward = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        bones = lengths[number : number + 2].max(axis=0)[:, None]
        way = _Way(ground, place, onward, skins[..., number + 1], bones)
        whole = np.broadcast_to(length[:, None], heading.shape)
        step, rise = _along(way, whole, _ROUGH_ROUNDS if rough else _ROUNDS)
        place = place + np.concatenate([step[..., None] * onward, rise[..., None]], axis=-1)
        joints.append(place)
        passed = passed + length
    return np.stack(joints, axis=2)


@dataclass(frozen=True, eq=False)
class _Way:
    """Ways straight ahead over the ground."""

    ground: Ground
    place: Floats
    """(…, 3) where they begin."""
    onward: Floats
    """(…, 2) unit."""
    skin: Floats
    """(…,) metres from a joint to the skin below it."""
    bones: Floats
    """(…,) metres that the bones at it are long."""

    def rise(self, step: Floats) -> Floats:
        """How much higher (…,) than where it begins a joint lies so far (…,) ahead."""
        level = self.place[..., :2] + step[..., None] * self.onward
        height = _resting(self.ground, level, self.skin, self.bones, self.onward)
        return height - self.place[..., 2]

    def part(self, chosen: np.ndarray) -> _Way:
        """Some of them (n,)."""
        bones = np.broadcast_to(self.bones, chosen.shape)[chosen]
        return _Way(self.ground, self.place[chosen], self.onward[chosen], self.skin[chosen], bones)


def _along(way: _Way, length: Floats, rounds: int) -> tuple[Floats, Floats]:
    """How far a segment (…,) leads level, and how much up, both (…,) metres."""
    step, rise = length, np.zeros(length.shape)
    for _ in range(rounds):
        rise = way.rise(step)
        step = step * length / np.sqrt(step * step + rise * rise)
    factor = length / np.sqrt(step * step + rise * rise)
    step, rise = step * factor, rise * factor
    there = way.rise(step)
    apart = np.abs(np.sqrt(step * step + there * there) - length) > _APART * length
    if np.any(apart):
        step[apart], rise[apart] = _at_a_step(way.part(apart), length[apart])
    return step, rise


def _at_a_step(way: _Way, length: Floats) -> tuple[Floats, Floats]:
    """The same (n,) where the ground rises or falls by more than a segment is long.

    It leads up the step, or hangs down it: on its lower side either way.
    """
    low, high = np.zeros(length.shape), length.copy()
    for _ in range(_STEP_HALVINGS):
        middle = 0.5 * (low + high)
        rise = way.rise(middle)
        over = middle * middle + rise * rise > length * length
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    falls = way.rise(high) < 0.0
    step = np.where(falls, high, low)
    rise = np.sqrt(np.maximum(length * length - step * step, 0.0))
    return step, np.where(falls, -rise, rise)


def _resting(
    ground: Ground, points: Floats, radius: Floats, bones: Floats, ahead: Floats
) -> Floats:
    """Height (…,) of a joint at points (…, 2 or 3) such that the skin of the bones at it lies on
    the ground, a radius (…,) of metres below.

    Between its ends a bone (…,) of metres is straight, and lies ahead (…, 2), unit. Over a crest
    both are higher, by what it would cut off.
    """
    points = points[..., :2]
    slope = ground.slope(points)
    steep = np.minimum(np.sum(slope * slope, axis=-1), _STEEPEST**2)
    half = 0.5 * bones[..., None] * ahead
    height, before, behind = ground.height(np.stack([points, points + half, points - half]))
    chord = 0.5 * (before + behind)
    return height + np.maximum(height - chord, 0.0) + radius * np.sqrt(1.0 + steep)


# --- How high joints lie whose bones are not in the middle of their skin --------------------------
#
# Which side of its skin an arm lies on hangs on how it came there, and that on how high its
# joints lie. So it is looked at on an arm that lies as if it were round: brought down to its
# skin, it hardly turns any more.


_ALONG: Final = np.linspace(0.5, 1.0, 5)
"""Where along the bone that comes down to the ground it is looked at whether it is in it."""


@dataclass(frozen=True, eq=False)
class Seen:
    """One arm at some moments, which lies from joint c on as if its skin were round."""

    joints: Floats
    """(moments, bones + 1, 3) world."""
    orientations: Floats
    """(moments, bones, 4) of its bones, world."""
    upward: Floats
    """(moments, bones + 1 − c, 3) which way up the ground is at the joints that may lie."""
    rests: np.ndarray
    """(moments, bones + 1 − c) which of them do."""
    cycles: np.ndarray
    """(moments,) number of the cycle, 0…"""


def skin_below(skin: ArmSkin, seen: Seen, known: Floats, ground: Ground, *, scale: float) -> Floats:
    """Metres (cycles, bones + 1 − c) from joints that lie to the skin below them.

    If it is round, they are as ``known``; the arm lies as ``seen`` on the ground, by a scale of
    metres to the armature's unit.
    """
    first = seen.joints.shape[1] - known.shape[1]
    # The bone that comes down has the ground of where it does so.
    upward = seen.upward[:, [0, *range(known.shape[1])]]
    down = -np.stack([upward[:, :-1], upward[:, 1:]], axis=2)
    back = conjugate(seen.orientations[:, first - 1 :])
    reach = scale * skin.below(rotate(back[:, :, None], down), first - 1)
    lies = np.zeros(seen.rests.shape)
    lies[:, :-1] = reach[:, 1:, 0]
    lies[:, 1:] = np.maximum(lies[:, 1:], reach[:, 1:, 1])
    lowered = _lowered(
        seen.joints[:, first - 1 : first + 1], reach[:, 0], seen.upward[:, 0], ground
    )
    lies[:, 0] = np.maximum(lies[:, 0], known[seen.cycles, 0] - lowered)
    below = np.full(known.shape, -np.inf)
    np.maximum.at(below, seen.cycles, np.where(seen.rests, lies, -np.inf))
    return np.where(np.isfinite(below), below, known)


def _lowered(ends: Floats, reach: Floats, upward: Floats, ground: Ground) -> Floats:
    """Metres (moments,) that a bone's tail can be lowered before its skin is in the ground.

    Its ends (moments, 2, 3) are head and tail, world; skin reaches (moments, 2) metres down there,
    and the ground's up is (moments, 3).
    """
    along = _ALONG[:, None]
    points = ends[:, None, 0] + along * (ends[:, 1] - ends[:, 0])[:, None]
    above = (points[..., 2] - ground.height(points)) * upward[:, None, 2]
    room = above - (reach[:, :1] + _ALONG * (reach[:, 1:] - reach[:, :1]))
    return np.min(room / _ALONG, axis=1)


_WEAK: Final = 0.02
"""Least lever that joints are raised with, in squares of the first segment's length. Half or twice
as much changes no figure by a tenth."""
_SHORTEST: Final = 0.2
_LONGEST: Final = 4.0
"""Handles of a curve, in its lengths: at 2 arms of Hurry overlap by 0.058 radii instead of 0.045,
and longer ones are not asked for."""
_OPEN: Final = 0.36
"""Share of the angle between a circle's arc and its chord that there is at a curve's ends at least.
At 0.72 arms of Settle overlap by 0.068 radii instead of 0.019."""
_OPENING: Final = 0.06
"""Radians over which that comes …"""
_NO_CORNER: Final = 0.05
"""… and within which an angle of nothing has no corner. Half or twice as much of either changes
figures by an eighth at most."""
_HALVINGS: Final = 7
"""Steps in which they are found. With 4 arms of the default octopus overlap by 0.064 radii instead
of 0.057."""
_BACKWARDS: Final = 1e-4
"""Least of one and the cosine of an angle whose half has a tangent."""
_BENDINGS: Final = 6
"""Newton's steps in which it is found how much more a curve is bent: three leave 5e-8 of it."""
_BOLD: Final = 0.6
"""Radians that a segment turns at a step of Newton's at most. At 0.3 arms of Hurry overlap by 0.065
radii instead of 0.045."""
_FIRM: Final = 1e-4
"""What keeps the steps finite where an arm is straight, as a share of its own stiffness. Half or
twice as much turns bones by 0.002° at most."""
_MANY: Final = 0.5
"""Share of a batch from which on all of it is raised, rather than those that are too low."""
_TINY: Final = 1e-12


def spread_chain(
    ways: tuple[Floats, Floats], chord: Floats, upward: Floats, ratio: Floats
) -> tuple[Floats, Floats]:
    """Ways in which a curve leaves and arrives, far enough from its chord for how long it is.

    A cubic between ends that are in line with its chord can only be longer than that by doubling
    back on itself, at a point where it turns over at once. The ends of a circle's arc as long would
    be √(6 (1 − ratio)) from its chord, nearly; a share of that is needed, and what is lacking is
    added to both, upwards.

    Args:
        ways: (3, batch) unit vectors both, at its start and at its end.
        chord: (3, batch) from start to end.
        upward: (3, batch) unit: which way it is to rise.
        ratio: (batch,) of the chord to its length.
    """
    along = components_first.normalized(chord)
    up = components_first.normalized(upward - dot(upward, along) * along)
    apart = 0.5 * (_between(ways[0], along) + _between(ways[1], along))
    lack = _OPEN * np.sqrt(6.0 * np.maximum(1.0 - ratio, 0.0)) - apart
    near = np.maximum(lack + _OPENING, 0.0)
    lack = np.where(lack > _OPENING, lack, near * near / (4.0 * _OPENING))
    return _tipped(ways[0], along, up, lack), _tipped(ways[1], along, up, -lack)


def _between(ways: Floats, along: Floats) -> Floats:
    """Angles (batch,) between unit vectors (3, batch), without a corner where there is none."""
    cosine = dot(ways, along)
    across = ways - cosine * along
    return np.arctan2(np.sqrt(dot(across, across) + _NO_CORNER**2), cosine)


def _tipped(ways: Floats, along: Floats, up: Floats, angle: Floats) -> Floats:
    """Vectors (3, batch) turned by angles (batch,) from one direction to another across it."""
    ahead, rise = dot(ways, along), dot(ways, up)
    cosine, sine = np.cos(angle), np.sin(angle)
    turned_ahead, turned_rise = cosine * ahead - sine * rise, sine * ahead + cosine * rise
    return ways + (turned_ahead - ahead) * along + (turned_rise - rise) * up


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
    t, ways = middles[:, 0], np.stack([chord, leaving, arriving])
    # All of it lies in the space of three vectors: how much of each, and their products.
    amounts = np.stack(
        [
            6.0 * t * (1.0 - t),
            size * (1.0 - 4.0 * t + 3.0 * t * t),
            size * (3.0 * t * t - 2.0 * t),
        ]
    )
    (cc, cl, ca), (_, ll, la), (_, _, aa) = np.einsum("xcb,ycb->xyb", ways, ways)
    along, out, back = amounts
    level = along * along * cc
    slope = 2.0 * along * (out * cl + back * ca)
    bend = out * (out * ll + 2.0 * back * la) + back * back * aa
    share = parts / np.maximum(np.sum(parts, axis=0), _TINY)
    wanted = np.sqrt(cc) / size

    def excess(handle: Floats) -> Floats:
        square = (bend * handle + slope) * handle + level
        weights = share / np.sqrt(np.maximum(square, _TINY * _TINY))
        along, out, back = np.einsum("sb,xsb->xb", weights, amounts)
        out, back = handle * out, handle * back
        square = along * (along * cc + 2.0 * (out * cl + back * ca))
        square += out * (out * ll + 2.0 * back * la) + back * back * aa
        return np.sqrt(np.maximum(square, 0.0)) - wanted

    # The longer the handles, the more of its length the curve spends on its way round.
    low, high = np.full(size.shape, _SHORTEST), np.full(size.shape, _LONGEST)
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        short = excess(middle) < 0.0
        low, high = np.where(short, low, middle), np.where(short, middle, high)
    # Between the two, in proportion: so the curve does not change by steps.
    above, below = np.maximum(excess(low), 0.0), np.maximum(-excess(high), 0.0)
    handle = low + (high - low) * above / np.maximum(above + below, _TINY)
    amounts[1:] *= handle
    return components_first.normalized(np.einsum("xsb,xcb->scb", amounts, ways))


def bent(directions: Floats, parts: Floats, chord: Floats, share: Floats) -> Floats:
    """Directions bent so much more that they lead along a chord no farther than a share of it.

    The tangents of half of the angles to the chord are all scaled by one factor: an arch stays an
    arch, however little of its length is left between its ends.

    Args:
        directions: (segments, 3, batch) unit.
        parts: (segments, batch) how much of each segment counts.
        chord: (3, batch)
        share: (batch,) of how far they have led, 0…1.
    """
    along = components_first.normalized(chord)
    cosines = np.einsum("scb,cb->sb", directions, along)
    across = directions - cosines[:, None] * along
    squares = (1.0 - cosines) / np.maximum(1.0 + cosines, _BACKWARDS)
    wanted = share * np.sum(parts * cosines, axis=0)
    # The logarithm of the factor's square, for which the way led falls evenly.
    factor = np.zeros(share.shape)
    for _ in range(_BENDINGS):
        bends = np.exp(factor) * squares
        far = np.sum(parts * (1.0 - bends) / (1.0 + bends), axis=0)
        slope = np.sum(parts * bends / (1.0 + bends) ** 2, axis=0)
        factor = factor + np.clip(0.5 * (far - wanted) / np.maximum(slope, _TINY), -1.0, 1.0)
    bends = np.exp(factor) * squares
    ahead = (1.0 - bends) / (1.0 + bends)
    size = np.sqrt(np.maximum(1.0 - ahead * ahead, 0.0))
    return ahead[:, None] * along + size[:, None] * components_first.normalized(across)


def lerp_bends(outward: Floats, start: Floats, end: Floats, share: Floats) -> Floats:
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
    rest = components_first.shortest_arc(first, outward[:, between])
    share = share[between]
    # Frames along the two and along what is between them, carried from segment to segment
    # without twist.
    frames = np.empty((3, *np.eye(3).shape, len(between)))
    frames[:] = [components_first.rotate(rest, axis[:, None]) for axis in np.eye(3)]
    for number in range(len(start)):
        ways = np.stack([start[number][:, between], end[number][:, between]])
        seen = np.einsum("xicb,xcb->xib", frames[:2], ways)
        bends = _bends(seen)
        own = _bent(bends[0] + share * (bends[1] - bends[0]))
        way = np.einsum("icb,ib->cb", frames[2], own)
        _carry(frames, np.concatenate([ways, way[None]]), np.concatenate([seen, own[None]]))
        result[number][:, between] = way
    return result


def _bends(seen: Floats) -> Floats:
    """Which way, y and z, and how far (…, 2, batch) unit vectors (…, 3, batch) are bent from x."""
    x, y, z = seen[..., 0, :], seen[..., 1, :], seen[..., 2, :]
    across = np.sqrt(y * y + z * z)
    factor = np.where(across > 1e-9, np.arctan2(across, x) / np.maximum(across, 1e-9), 1.0)
    return seen[..., 1:, :] * factor[..., None, :]


def _bent(bend: Floats) -> Floats:
    """Inverse of :func:`_bends`: unit vectors (3, batch)."""
    angle = np.sqrt(bend[0] * bend[0] + bend[1] * bend[1])
    # By the tangent of half of it, which is quicker than cosine and sine.
    tangent = np.tan(0.5 * angle)
    share = 2.0 / (1.0 + tangent * tangent)
    result = np.empty((3, len(angle)))
    result[0] = share - 1.0
    result[1:] = bend * (share * tangent / np.maximum(angle, _TINY))
    return result


def _carry(frames: Floats, ways: Floats, seen: Floats) -> None:
    """Turn frames (…, axes, 3, batch) in place as little as it takes for x to point another way:
    along unit vectors (…, 3, batch), given in the world and as they are seen from the frames.
    """
    lost = seen[..., 1:, :] / np.maximum(1.0 + seen[..., :1, :], _TINY)
    frames[..., 1:, :, :] -= lost[..., None, :] * (frames[..., :1, :, :] + ways[..., None, :, :])
    frames[..., 0, :, :] = ways


def evened(directions: Floats, share: Floats, before: Floats) -> Floats:
    """Directions (segments, 3, batch) between those before and after, by a share (segments, batch).

    Sharp bends spread over neighbouring joints; the first and the last segment stay. The one before
    has a share of its own (segments, 1) in the mean of the two.
    """
    result = directions.copy()
    mean = before[1:-1, None] * (directions[:-2] - directions[2:])
    mean += directions[2:]
    mean -= directions[1:-1]
    mean *= share[1:-1, None]
    result[1:-1] += mean
    return components_first.normalized(result)


def raise_over_ground(
    directions: Floats,
    lengths: Floats,
    room: JointRoom,
    *,
    free: Floats,
    roots: Floats,
    ground: Ground,
    iterations: int,
) -> Floats:
    """Directions (segments, 3, batch) of arms whose joints are not too near to the ground.

    The lowest joints are raised by turning the segments before them as little as it takes. A
    segment that stands upright has no lever on the height, and is left alone.

    Args:
        directions: (segments, 3, batch) unit.
        lengths: (segments, batch)
        room: what the joints are to have.
        free: (segments, batch) how far each segment is free to turn, 0…1.
        roots: (3, batch) world.
        ground: what they should be above of.
        iterations: how often the lowest of them are raised.
    """
    result = directions.copy()
    below = room.lacking(_heights(directions, lengths, roots, ground))
    low = np.flatnonzero(below.any(axis=0))
    if not len(low):
        return result
    # Those that are high enough stay as they are, if they are many.
    chosen = low if len(low) < _MANY * len(below[0]) else slice(None)
    # What is picked out by numbers lies otherwise in memory: slower, and summed in another order.
    own = np.ascontiguousarray(result[..., chosen])
    below = np.ascontiguousarray(below[:, chosen])
    lengths, free, roots = lengths[:, chosen], free[:, chosen], roots[:, chosen]
    room = part_of(room, chosen)
    least = (1e-4 * np.max(np.broadcast_to(room.soft, room.needed.shape), axis=0)) ** 2
    loosened, weak = free * lengths, _WEAK * lengths[0] ** 2
    for number in range(iterations):
        if number:
            below = room.lacking(_heights(own, lengths, roots, ground))
        weights = below * below
        weights *= 1.0 / (np.sum(weights, axis=0) + least)
        wanted = np.einsum("sb,sb->b", weights, below)
        # Share of the weights beyond each segment: what is raised by turning it.
        carried = cumulative_sum(weights[:0:-1].copy())[::-1]
        z = own[:, 2]
        level = 1.0 - z * z
        turn = loosened * carried
        carried = carried * lengths
        carried *= level
        turn *= wanted / (np.einsum("sb,sb->b", turn, carried) + weak)
        _turn_up(own, turn, level)
    result[..., chosen] = own
    return result


def _heights(directions: Floats, lengths: Floats, roots: Floats, ground: Ground) -> Floats:
    """Metres (segments + 1, batch) that joints are above the ground."""
    joints = np.empty((len(lengths) + 1, *roots.shape))
    joints[0] = roots
    np.multiply(lengths[:, None], directions, out=joints[1:])
    cumulative_sum(joints)
    return joints[:, 2] - ground.height(joints.swapaxes(1, 2))


def _turn_up(directions: Floats, turn: Floats, level: Floats) -> None:
    """Turn directions (segments, 3, batch), unit, in place towards z, by the share of it in
    ``turn`` (segments, batch), which is changed too.

    ``level`` (segments, batch) is the square of what is level of each direction.
    """
    square = turn * turn
    square *= level
    less = 1.0 / (1.0 + np.max(square, axis=0) / _BOLD**2)
    turn *= np.sqrt(less)
    square *= less
    square += 1.0
    # Only what of z is across a direction turns it.
    size = np.reciprocal(np.sqrt(square, out=square), out=square)
    left = turn * directions[:, 2]
    np.subtract(1.0, left, out=left)
    left *= size
    directions *= left[:, None]
    turn *= size
    directions[:, 2] += turn


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
    reach = chosen * lengths
    turning = reach * free
    stiffness = turning * lengths
    base = (1.0 + _FIRM) * (np.sum(stiffness, axis=0) + _TINY * np.sum(lengths, axis=0) ** 2)
    squared, way = turning * turning, goal - roots
    result = directions.copy()
    weighted = np.empty_like(result)
    for _ in range(steps):
        left = way - np.einsum("sb,scb->cb", reach, result)
        np.multiply(stiffness[:, None], result, out=weighted)
        xx, xy, xz, yy, yz, zz = (
            np.einsum("sb,sb->b", weighted[:, one], result[:, other])
            for one, other in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        )
        pull = _solved((base - xx, -xy, -xz, base - yy, -yz, base - zz), left)
        # Only what of it is across a segment turns that.
        along = np.einsum("scb,cb->sb", result, pull)
        square = along * along
        np.subtract(np.einsum("cb,cb->b", pull, pull), square, out=square)
        np.maximum(square, 0.0, out=square)
        square *= squared
        less = 1.0 / (1.0 + np.max(square, axis=0) / _BOLD**2)
        turn = turning * np.sqrt(less)
        square *= less
        square += 1.0
        size = np.reciprocal(np.sqrt(square, out=square), out=square)
        along *= turn
        np.subtract(1.0, along, out=along)
        along *= size
        result *= along[:, None]
        turn *= size
        result += np.multiply(turn[:, None], pull, out=weighted)
    return result


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
