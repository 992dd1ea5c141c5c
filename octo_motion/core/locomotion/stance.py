# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that hold on to the ground while the body moves on, and swing to the next foothold.

An arm at a time is one smooth curve: from the body to where it touches, along the ground, and up
again where it is not unrolled yet. In the middle of a swing it is the gait's own shape; between
the two it is a blend. Its segments are then turned, as little as it takes, until the arm meets its
foothold: those that lie on the ground not at all. All of it is a function of the frame's own
phase and place; there is no frame before it.

Vectors are (…, 3, batch), as in ``columns``; the batch is frames × arms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import Floats
from .columns import dot, product, smallest_arc, turned
from .foothold_places import PEELING
from .footholds import UNROLLING, Footholds
from .ground import Ground
from .limbs import Limbs, StanceSettings

_STEPS: Final = (4, 3, 3, 4)
"""Newton's steps each time that an arm is drawn to its foothold, after it was raised."""
_KEPT: Final = 0.3
"""Share of the gait's own shape in an arm that holds on."""
_RAISED: Final = np.radians(12.0)
"""How far an arm that holds on leaves the body upwards of outward."""
_RAISES: Final = 6
_RAISES_BETWEEN: Final = 2
"""How often the lowest joints of an arm are raised, in the air and before it is drawn down."""
_WEAK: Final = 0.02
"""Least lever that joints are raised with, in squares of the first segment's length."""
_ARCHED: Final = np.radians(15.0)
_ARCHING: Final = 0.5
"""How much more where it is slack, and over what share of its length that comes."""
_HALVINGS: Final = 9
"""Steps in which the length of a curve is found."""
_CURLED: Final = np.radians(85.0)
"""How far the tip stands up before it is unrolled."""
_BORDER: Final = 1.6
"""Segments before the ground over which an arm is less and less free to turn."""
_EASY: Final = 0.88
"""Share of its length between body and foothold from which on an arm stretches."""
_CROWDED: Final = 0.7
"""The same below which it shortens …"""
_SHORTER: Final = 0.5
"""… by this share of the most stretch at most."""
_NEARLY: Final = 0.97
_REST: Final = 0.025
"""Share of its length from which on an arm no longer reaches out all the way, and what is left."""
_GENTLE: Final = 0.05
"""Strain over which stretching begins."""
_BOLD: Final = 0.6
"""Radians that a segment turns at a step of Newton's at most."""
_GOING: Final = 0.12
"""Cycles within which an arm in the air comes to go along with its body."""
_AT_ONCE: Final = 20.0
"""How much faster than its hold an arm loses its stiffness against the ground."""
_FIRM: Final = 1e-4
"""What keeps the steps finite where an arm is straight, as a share of its own stiffness."""
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Bodies:
    """What a batch of arms hangs on."""

    roots: Floats
    """(3, batch) P₀, world."""
    outward: Floats
    """(3, batch) unit: straight out of the body, world."""
    upward: Floats
    """(3, batch) unit: the body's up, world."""


@dataclass(frozen=True, eq=False)
class Hold:
    """How a batch of arms holds on at its times."""

    weight: Floats
    """(batch,) 1 holds on, 0 free in the middle of a swing."""
    lies_from: Floats
    """(batch,) metres along the arm from which on it lies on the ground …"""
    lies_to: Floats
    """(batch,) … and up to which."""
    by_tip: np.ndarray
    """(batch,) whether it is the tip that the ground holds, or the joint that touches first."""
    joints: Floats
    """(segments + 1 − c, 3, batch) the joints as they lie, world."""
    carried: Floats
    """(3, batch) metres by which they have gone along with the body since, or still will."""
    normals: Floats
    """(segments + 1 − c, 3, batch) which way up the ground is there."""
    touching: int
    """c"""

    def upwards(self, segments: int) -> Floats:
        """Which way is up for each segment (segments, 3, batch): what lies, lies on its ground."""
        lying = _unit(self.normals[1:] + self.normals[:-1])
        free = np.broadcast_to(self.normals[:1], (self.touching, *self.normals.shape[1:]))
        return np.concatenate([free, lying])[:segments]


@dataclass(frozen=True, eq=False)
class Stood:
    """A batch of arms on the ground."""

    directions: Floats
    """(segments, 3, batch) unit, world."""
    strains: Floats
    """(segments, batch) by how much each is longer than at rest, as a share."""
    joints: Floats
    """(segments + 1, 3, batch) world."""
    misses: Floats
    """(batch,) metres between an arm that holds on and its foothold."""
    lying: np.ndarray
    """(segments + 1, batch) which joints rest on the ground and must not move."""


def hold(
    footholds: Footholds,
    limbs: Limbs,
    cycles: np.ndarray,
    since: Floats,
    arms: np.ndarray,
    roots: Floats,
) -> Hold:
    """The footholds of a batch, and how far each is laid down or peeled off.

    Args:
        footholds: of these limbs.
        limbs: the arms.
        cycles: (batch,) number of each one's cycle.
        since: (batch,) cycles since the middle of the hold that the gait gives it.
        arms: (batch,) place of each one's arm among the limbs.
        roots: (3, batch) P₀, world.
    """
    at = arms, cycles - footholds.first
    on, off = footholds.on[at], footholds.off[at]
    reach = limbs.reach
    touching, whole = reach[footholds.touching][arms], reach[-1][arms]
    down = _smooth((since - on) / (UNROLLING * (off - on)))
    gone = _smooth((since - footholds.peeled()[at]) / (PEELING * (off - on)))
    landing = _gentle((since + 0.5) / (on + 0.5))
    leaving = _gentle((0.5 - since) / (0.5 - off))
    weight = np.where(since < on, landing, np.where(since > off, leaving, 1.0))
    joints = np.moveaxis(footholds.joints[at], 0, -1)
    # An arm in the air goes along with the body, and does so gently at first.
    before, after = np.maximum(on - since, 0.0), np.maximum(since - off, 0.0)
    moved = np.where(
        since < on, roots - footholds.roots_on[at].T, roots - footholds.roots_off[at].T
    )
    carried = moved * _gentle((before + after) / _GOING)
    return Hold(
        weight=weight * footholds.present[at],
        lies_from=touching + gone * (footholds.peeled_to[at] - touching),
        lies_to=touching + down * (whole - touching),
        by_tip=since > footholds.middle[at],
        joints=np.ascontiguousarray(joints),
        carried=carried,
        normals=np.ascontiguousarray(np.moveaxis(footholds.normals[at], 0, -1)),
        touching=footholds.touching,
    )


def stand(
    limbs: Limbs,
    arms: np.ndarray,
    shapes: Floats,
    bodies: Bodies,
    held: Hold,
    ground: Ground,
    settings: StanceSettings,
) -> Stood:
    """Arms with their gait's shapes, brought to their footholds and off the ground.

    Args:
        limbs: the arms.
        arms: (batch,) place of each one's arm among them.
        shapes: (segments, 3, batch) the gait's directions, world.
        bodies: where each one is.
        held: how each one holds on.
        ground: what it must not pass through.
        settings: how arms hold on.
    """
    reach, radii = limbs.reach[:, arms], limbs.radii[:, arms]
    strains, standing = _held(limbs, arms, shapes, bodies, held, ground, settings)
    lengths = limbs.lengths[:, arms] * (1.0 + strains)
    weight = held.weight
    directions = _blended(bodies, standing, shapes, 1.0 - weight)
    swinging = np.flatnonzero(weight < 1.0)
    if len(swinging):
        away = 1.0 - weight[swinging]
        own = _part(held, swinging)
        let_go = _smooth(_AT_ONCE * away)
        free = _freedom(limbs.lengths[:, arms[swinging]], reach[:, swinging], own)
        directions[..., swinging] = _raised(
            directions[..., swinging],
            lengths[:, swinging],
            free + (1.0 - free) * let_go,
            bodies.roots[:, swinging],
            radii[:, swinging] + settings.lift * reach[-1, swinging] * away**2,
            let_go * _out(reach[:, swinging]),
            ground,
            _RAISES,
        )
    joints = np.concatenate([bodies.roots[None], lengths[:, None] * directions]).cumsum(axis=0)
    goal = np.where(held.by_tip, held.joints[-1], held.joints[0])
    missed = np.where(held.by_tip, joints[-1], joints[held.touching]) - goal
    slack = 1e-9 * reach[-1]
    lying = (reach >= held.lies_from - slack) & (reach <= held.lies_to + slack) & (weight >= 1.0)
    return Stood(directions, strains, joints, np.sqrt(dot(missed, missed)) * (weight >= 1.0), lying)


def _curve(
    leaving: Floats, arriving: Floats, chord: Floats, size: Floats, middles: Floats, parts: Floats
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
    low, high = np.full(size.shape, 0.2), np.full(size.shape, 4.0)
    # The longer the handles, the more of its length the curve spends on its way round.
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        mean = np.sum(share[:, None] * _unit(straight + middle * handles), axis=0)
        short = np.sqrt(dot(mean, mean)) < wanted
        low, high = np.where(short, low, middle), np.where(short, middle, high)
    return _unit(straight + np.sqrt(low * high) * handles)


def _part(held: Hold, chosen: np.ndarray) -> Hold:
    """Some of the batch."""
    return Hold(
        held.weight[chosen],
        held.lies_from[chosen],
        held.lies_to[chosen],
        held.by_tip[chosen],
        held.joints[..., chosen],
        held.carried[:, chosen],
        held.normals[..., chosen],
        held.touching,
    )


def _held(
    limbs: Limbs,
    arms: np.ndarray,
    shapes: Floats,
    bodies: Bodies,
    held: Hold,
    ground: Ground,
    settings: StanceSettings,
) -> tuple[Floats, Floats]:
    """Strains (segments, batch) and directions (segments, 3, batch) of arms that hold on.

    Arms that do not, for the moment, are posed as they held on last, or will next; of those that
    never do it is the gait's shape.
    """
    strains, directions = np.zeros(shapes[:, 0].shape), shapes.copy()
    chosen = np.flatnonzero(held.weight > 0.0)
    if len(chosen) == 0:
        return strains, directions
    held, arms, shapes = _part(held, chosen), arms[chosen], shapes[..., chosen]
    bodies = Bodies(bodies.roots[:, chosen], bodies.outward[:, chosen], bodies.upward[:, chosen])
    lengths, reach = limbs.lengths[:, arms], limbs.reach[:, arms]
    free, loose = _freedom(lengths, reach, held), _loose(reach, held)
    strain, guess, chord = _asked(lengths, reach, held, bodies, limbs, settings)
    strain = strain * free
    # What is out of reach is pointed at: at full stretch no solver has a definite answer.
    ratio = np.sqrt(dot(chord, chord)) / (held.lies_from + np.sum(lengths * strain, axis=0))
    over = np.maximum(ratio - _NEARLY, 0.0)
    short = (over - _REST * np.tanh(over / _REST)) / np.maximum(ratio, _TINY)
    lengths = lengths * (1.0 + strain)
    # Some of the gait stays, but for what lies or unrolls.
    first = np.arange(len(lengths))[:, None] < held.touching
    own = _unit(guess + (_KEPT * free)[:, None] * (shapes - guess))
    goal = held.carried + np.where(held.by_tip, held.joints[-1], held.joints[0])
    goal = goal - short * chord
    to_goal = (first | held.by_tip).astype(np.float64)
    radii = limbs.radii[:, arms]
    for steps in _STEPS:
        own = _raised(own, lengths, free, bodies.roots, radii, loose, ground, _RAISES_BETWEEN)
        own = _drawn(own, lengths, to_goal * free, to_goal[:, None], bodies, goal, steps)
    # What is beyond the joint that is held can be raised without letting go.
    beyond = (1.0 - to_goal) * _smooth((reach[1:] - held.lies_to) / lengths)
    own = _raised(own, lengths, beyond, bodies.roots, radii, loose, ground, _RAISES_BETWEEN)
    strains[:, chosen], directions[..., chosen] = strain * held.weight, own
    return strains, directions


def _freedom(lengths: Floats, reach: Floats, held: Hold) -> Floats:
    """How far each segment (segments, batch) is free to turn: 0 where it lies on the ground."""
    before = (held.lies_from - reach[:-1]) / (_BORDER * lengths)
    return _smooth(before)


def _loose(reach: Floats, held: Hold) -> Floats:
    """How far each joint (segments + 1, batch) may be raised: 0 where it lies, and at the root."""
    width = reach[1]
    before = _smooth((held.lies_from - reach) / width)
    after = _smooth((reach - held.lies_to) / width)
    return np.maximum(before, np.where(held.by_tip, 0.0, after)) * _out(reach)


def _out(reach: Floats) -> Floats:
    """0 at the root, which the body carries, 1 a little further out."""
    return _smooth(reach / (0.15 * reach[-1]))


def _asked(
    lengths: Floats,
    reach: Floats,
    held: Hold,
    bodies: Bodies,
    limbs: Limbs,
    settings: StanceSettings,
) -> tuple[Floats, Floats, Floats]:
    """Strains (1, batch) and directions (segments, 3, batch) of arms that hold on.

    And the way (3, batch) from each one's root to where it meets the ground.
    """
    count, first = len(lengths), held.touching
    lying = np.diff(held.joints, axis=0)
    lying /= lengths[first:, None]
    # Directions at the joints that lie, and what the arm runs into where it meets the ground.
    at_joints = np.concatenate([lying[:1], 0.5 * (lying[1:] + lying[:-1]), lying[-1:]])
    place = held.carried.copy()
    arriving = np.zeros_like(bodies.roots)
    for number in range(count - first):
        low, high = reach[first + number], reach[first + number + 1]
        share = np.clip((held.lies_from - low) / (high - low), 0.0, 1.0)
        inside = (held.lies_from >= low) & ((held.lies_from < high) | (number == count - first - 1))
        place += inside * (held.joints[number] + share * lying[number] * lengths[first + number])
        arriving += inside * (
            at_joints[number] + share * (at_joints[number + 1] - at_joints[number])
        )
    arriving = _unit(arriving)
    chord = place - bodies.roots
    ratio = np.sqrt(dot(chord, chord)) / held.lies_from
    strain = np.zeros((1, ratio.shape[-1]))
    if limbs.may_stretch and settings.stretch > 0.0:
        taut = np.maximum(ratio / _EASY - 1.0, 0.0)
        taut = taut * taut / (taut + _GENTLE)
        slack = np.maximum(1.0 - ratio / _CROWDED, 0.0)
        slack = slack * slack / (slack + _GENTLE)
        shortest = _SHORTER * settings.stretch
        strain[0] = settings.stretch * np.tanh(taut / settings.stretch)
        strain[0] -= shortest * np.tanh(slack / shortest)
    # A cubic from body to ground that leaves and arrives as the arm does, and is as long. The
    # slacker the arm, the more it rises.
    rising = _RAISED + _ARCHED * _smooth((_EASY - ratio) / _ARCHING)
    leaving = np.cos(rising) * bodies.outward + np.sin(rising) * bodies.upward
    size = held.lies_from * (1.0 + strain[0])
    middles = np.clip(0.5 * (reach[1:] + reach[:-1]) / held.lies_from, 0.0, 1.0)[:, None]
    parts = np.clip(held.lies_from - reach[:-1], 0.0, lengths)
    directions = _curve(leaving, arriving, chord, size, middles, parts)
    through = np.clip((held.lies_from - reach[first:-1]) / lengths[first:], 0.0, 1.0)[:, None]
    directions[first:] = through * directions[first:] + (1.0 - through) * lying
    # Not unrolled yet: the part beyond stands up, the more, the further out.
    span = reach[-1] - reach[first]
    beyond = np.maximum(reach[first + 1 :] - held.lies_to, 0.0) / span
    angle = (_CURLED * beyond * np.sqrt(beyond))[:, None]
    up = np.zeros_like(lying)
    up[:, 2] = 1.0
    up = _unit(up - dot(up, lying)[:, None] * lying)
    rolled = np.cos(angle) * lying + np.sin(angle) * up
    directions[first:] = np.where(held.by_tip, directions[first:], rolled)
    return strain, _unit(directions), chord


def _blended(bodies: Bodies, start: Floats, end: Floats, share: Floats) -> Floats:
    """Shapes (segments, 3, batch) between two others, by the angles at their joints.

    Directions themselves would have no middle where they are opposite. What an arm's shape
    consists of are its bends, from each segment to the next, seen along the arm without twist:
    two numbers at each joint, and these are far from a half turn.
    """
    between = np.flatnonzero((share > 0.0) & (share < 1.0))
    result = np.where(share < 1.0, start, end)
    if len(between) == 0:
        return result
    rest = _frames(bodies.outward[:, between], bodies.upward[:, between])
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


def _frames(outward: Floats, upward: Floats) -> Floats:
    """Quaternions (4, batch) of the frames with x outward and z upward."""
    return product(
        smallest_arc(np.array([[1.0], [0.0], [0.0]]) + 0.0 * outward, outward),
        np.array([[1.0], [0.0], [0.0], [0.0]]),
    )


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


def _raised(
    directions: Floats,
    lengths: Floats,
    free: Floats,
    roots: Floats,
    needed: Floats,
    loose: Floats,
    ground: Ground,
    rounds: int,
) -> Floats:
    """Directions of arms whose joints are not nearer to the ground than needed (joints, batch).

    The lowest joints are raised by turning the segments before them as little as it takes. A
    segment that stands upright has no lever on the height, and is left alone.
    """
    soft = 0.25 * np.max(needed, axis=0) + _TINY
    for _ in range(rounds):
        joints = np.concatenate([roots[None], lengths[:, None] * directions]).cumsum(axis=0)
        below = ground.height(np.moveaxis(joints, 1, -1)) + needed - joints[:, 2]
        below = np.where(below > soft, below, np.maximum(below + soft, 0.0) ** 2 / (4.0 * soft))
        below *= loose
        weights = below * below
        weights /= np.sum(weights, axis=0) + (1e-4 * soft) ** 2
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
        directions = _unit(directions + turn / np.sqrt(1.0 + (most / _BOLD) ** 2))
    return directions


def _drawn(
    directions: Floats,
    lengths: Floats,
    free: Floats,
    chosen: Floats,
    bodies: Bodies,
    goal: Floats,
    steps: int,
) -> Floats:
    """Directions turned as little as it takes for the arm to end at the goal, by Newton's method.

    The sum of squares of the turns, each divided by its segment's freedom, is smallest: three
    equations for the multiplier λ, one for each coordinate of the end.
    """
    turning = free * lengths
    stiffness = turning * lengths
    whole = np.sum(stiffness, axis=0) + _TINY
    for _ in range(steps):
        ends = bodies.roots + np.sum(chosen * (lengths[:, None] * directions), axis=0)
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
        directions = _unit(directions + turn / np.sqrt(1.0 + (most / _BOLD) ** 2))
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


def _unit(vectors: Floats) -> Floats:
    """Vectors (…, 3, batch) at unit length."""
    return vectors * (1.0 / np.maximum(np.sqrt(dot(vectors, vectors)), _TINY))[..., None, :]


def _smooth(share: Floats) -> Floats:
    """From 0 to 1 and from 1 on, level at both ends."""
    inside = np.clip(share, 0.0, 1.0)
    return inside * inside * (3.0 - 2.0 * inside)


def _gentle(share: Floats) -> Floats:
    """The same with no acceleration at its ends either: next to a hold nothing moves at first."""
    inside = np.clip(share, 0.0, 1.0)
    return inside * inside * inside * (10.0 + inside * (6.0 * inside - 15.0))
