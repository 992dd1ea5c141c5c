# SPDX-License-Identifier: GPL-3.0-or-later
"""Weighted cyclic coordinate descent of an arm's three groups, in batch [Octopus, §3.1.4].

An arm is handled as the directions of its segments, arrays of shape (segments, batch, 3) in the
arm's own frame (x outward, z up); the batch is all frames of all arms that are built alike.

The result depends on nothing but the angles of its own frame. So each frame must start afresh,
and must not pop where a target crosses the line of the group before it. The usual start, a
straight continuation, bends there to one side in one frame and to the other in the next. Ours is
the shape that the gait asks for: it bends at each link as far as the table says, which changes
with time as smoothly as the table, and it sways a little across that bend, so that a group which
goes from one side to the other passes round the straight line and not through it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ..rotations import Floats, cross, from_rotation_vector, normalized, rotate, shortest_arc

SWEEPS: Final = 4
SOFTENINGS: Final = 8

# Stretching a group to its full length is the singular point of any inverse kinematics: its bend
# grows like the square root of what is left. Rounding the corner off costs half of this at most,
# in group lengths.
_ROUNDING: Final = 2.0e-3
# A joint turns the less, the shorter its lever: of a lever of √0.05 of the group, half. So the
# last joints do not curl, and an arm of many bones takes the shape of one of few.
_SHORT_LEVER: Final = 0.05
_JOINTS_OF_A_WEIGHT: Final = 4
# Where a gait bends a group much more than this, the group does not need to sway.
_SLIGHT: Final = np.radians(8.0)
# No segment is bent further away from the chord when a group folds up.
_FARTHEST_BEND: Final = 1.5 * np.pi
_NEWTON_STEPS: Final = 6
_NEWTON_STEPS_BETWEEN: Final = 3
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class Chain:
    """What arms of one build have in common, lengths in any unit."""

    lengths: Floats
    """(segments,) root to tip."""
    sizes: tuple[int, int, int]
    """Segments in each group."""
    weights: Floats
    """(segments,) weight a of the joint at each segment's root, in (0, 1] [Octopus, eq. 3.7]."""

    @property
    def groups(self) -> tuple[slice, ...]:
        """The segments of each group."""
        ends = np.cumsum(self.sizes)
        return tuple(
            slice(int(end) - size, int(end)) for end, size in zip(ends, self.sizes, strict=True)
        )


def solve(
    chain: Chain,
    shape: Floats,
    links: Floats,
    targets: Floats,
    softness: float = 1.0,
) -> Floats:
    """Directions (segments, batch, 3) of arms whose groups end at their targets.

    Args:
        chain: the arms' build.
        shape: (segments, batch, 3) the shape to start from, each group seen from its own link
            (see ``asked_shape``).
        links: (batch, 3, 4) orientations of the links.
        targets: (batch, 4, 3) pseudo-targets Q₀ … Q₃; those out of reach are pointed at.
        softness: 0 leaves the bends as they are; towards 1 they are spread over neighbours.
    """
    directions = np.empty_like(shape)
    for group, segments in enumerate(chain.groups):
        directions[segments] = rotate(links[:, group], shape[segments])
    root = np.zeros_like(targets[:, 0])
    for group, segments in enumerate(chain.groups):
        lengths, goal = chain.lengths[segments], targets[:, group + 1] - root
        own = aimed(directions[segments], lengths, goal)
        for _ in range(SWEEPS if len(own) > 1 else 0):
            own = swept(own, lengths, chain.weights[segments], goal)
        directions[segments] = closed(own, lengths, goal)
        root = root + chord(directions[segments], lengths)
    rounds = SOFTENINGS if softness > 0.0 else 0
    for number in range(1, rounds + 1):
        directions = softened(directions, softness)
        # Only the last closing has to be exact.
        steps = _NEWTON_STEPS if number == rounds else _NEWTON_STEPS_BETWEEN
        root = np.zeros_like(root)
        for group, segments in enumerate(chain.groups):
            lengths, goal = chain.lengths[segments], targets[:, group + 1] - root
            directions[segments] = closed(directions[segments], lengths, goal, steps)
            root = root + chord(directions[segments], lengths)
    return directions


def asked_shape(chain: Chain, angles: Floats, sway: Floats) -> Floats:
    """The shape that the gait asks for, (segments, batch, 3), each group seen from its link.

    Along each group the direction turns from halfway back to the link before to halfway on to
    the link after, about the link's own direction in the mean; a parabola is the simplest that
    does. The first group leaves the body the way that the arm does.

    Args:
        chain: the arms' build.
        angles: (batch, 3, 2) head and pitch of each link.
        sway: (batch, 2) head and pitch of the bend that is added at the root of the first group
            where it is nearly straight; it changes sides along each group.
    """
    # The first group leaves the body straight, and nothing pulls at the last one's end: there it
    # goes on as it came.
    before = -0.5 * angles * np.array([2.0, 1.0, 1.0])[:, None]
    after = 0.5 * np.concatenate([angles[:, 1:], angles[:, 2:]], axis=1)
    shape = np.empty((len(chain.lengths), len(angles), 3))
    asked = np.sum(before**2 + after**2, axis=-1)[..., None]
    swaying = sway[:, None] * _SLIGHT**2 / (_SLIGHT**2 + asked)
    for group, segments in enumerate(chain.groups):
        lengths = chain.lengths[segments]
        reach = np.cumsum(lengths)
        along = ((reach - 0.5 * lengths) / reach[-1])[:, None, None]
        turn = (
            before[:, group] * (1.0 - 4.0 * along + 3.0 * along**2)
            + after[:, group] * (3.0 * along**2 - 2.0 * along)
            + (-1.0) ** group * swaying[:, group] * (1.0 - 2.0 * along)
        )
        if len(lengths) == 1:
            turn = np.zeros_like(turn)
        head, pitch = turn[..., 0], turn[..., 1]
        shape[segments] = np.stack(
            [np.cos(head) * np.cos(pitch), np.cos(head) * np.sin(pitch), np.sin(head)], axis=-1
        )
    return shape


def chord(directions: Floats, lengths: Floats) -> Floats:
    """Vector (batch, 3) from a group's root to its end."""
    return np.einsum("s,sbc->bc", lengths, directions)


def aimed(directions: Floats, lengths: Floats, goal: Floats) -> Floats:
    """A group turned as a whole about its root, its end towards the goal (batch, 3)."""
    turn = shortest_arc(normalized(chord(directions, lengths)), normalized(goal))
    return rotate(turn, directions)


def swept(directions: Floats, lengths: Floats, weights: Floats, goal: Floats) -> Floats:
    """One sweep of weighted CCD over a group, tip to root [Octopus, eq. 3.3, 3.7].

    At each joint everything beyond it turns about ``(P_e − P_j) × (Q − P_j)`` by ``a_j ξ_j``.
    The joints nearer to the root have not moved yet when a joint turns, and those beyond move as
    one piece; so it is enough to carry along the vector from the joint to the end, and to apply
    to each segment all turns from the root up to its own joint.
    """
    count = len(directions)
    steps = lengths[:, None, None] * directions
    to_goal = goal - np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps[:-1], axis=0)])
    turns = np.empty((*directions.shape[:-1], 4))
    whole = float(np.sum(lengths))
    scale = min(1.0, _JOINTS_OF_A_WEIGHT / count)
    end = np.zeros_like(goal)
    for joint in range(count - 1, -1, -1):
        end = end + steps[joint]
        turns[joint] = _partial_arc(end, to_goal[joint], weights[joint] * scale, whole)
        end = rotate(turns[joint], end)
    result = np.empty_like(directions)
    turn = turns[0]
    result[0] = rotate(turn, directions[0])
    for joint in range(1, count):
        turn = _product(turn, turns[joint])
        result[joint] = rotate(turn, directions[joint])
    return result


def closed(directions: Floats, lengths: Floats, goal: Floats, steps: int = _NEWTON_STEPS) -> Floats:
    """A group bent as much as it takes for its end to be at the goal, in the shape it has.

    The bends are the angles between the segments and the chord. All are scaled by one factor,
    found by Newton's method, so that the chord is as long as the goal is far; then the group is
    turned about its root.
    """
    whole = float(np.sum(lengths))
    distance = np.sqrt(np.sum(goal * goal, axis=-1))
    if len(lengths) > 1:
        slack = 1.0 - distance / whole
        slack = 0.5 * (slack + np.sqrt(slack * slack + _ROUNDING**2))
        directions = _scaled(directions, lengths, np.maximum(whole * (1.0 - slack), 0.0), steps)
    return aimed(directions, lengths, goal)


def softened(directions: Floats, amount: float) -> Floats:
    """Directions drawn towards the mean of their neighbours, across the borders of groups too.

    Before the first segment stands the way in which the arm leaves the body, x.
    """
    outward = np.zeros_like(directions[:1])
    outward[..., 0] = 1.0
    before = np.concatenate([outward, directions[:-1]])
    after = np.concatenate([directions[1:], directions[-1:]])
    mean = (1.0 - 0.5 * amount) * directions + 0.25 * amount * (before + after)
    size = np.sqrt(np.einsum("sbc,sbc->sb", mean, mean))
    return mean / np.maximum(size, _TINY)[..., None]


def _scaled(directions: Floats, lengths: Floats, wanted: Floats, steps: int) -> Floats:
    """A group whose bends are scaled so that its chord is as long as wanted (batch,)."""
    axis = chord(directions, lengths)
    found = np.sqrt(np.sum(axis * axis, axis=-1))
    axis = axis / np.maximum(found, _TINY)[:, None]
    along = np.einsum("sbc,bc->sb", directions, axis)
    across = directions - along[..., None] * axis
    sine = np.sqrt(np.einsum("sbc,sbc->sb", across, across))
    bend = np.arctan2(sine, along)
    across = across / np.maximum(sine, _TINY)[..., None]
    # The squared chord is nearly linear in the square of the factor, so Newton's method takes
    # that as its unknown; a bracket keeps it safe.
    low = np.zeros_like(wanted)
    high = (_FARTHEST_BEND / np.maximum(np.max(bend, axis=0), _TINY)) ** 2
    whole = float(np.sum(lengths))
    square = _squared_arc(wanted / whole) / np.maximum(_squared_arc(found / whole), _TINY)
    square = np.minimum(square, 0.9 * high)
    for _ in range(steps):
        factor = np.sqrt(square)
        angle = factor * bend
        cosine, sinus = np.cos(angle), np.sin(angle)
        inner = np.einsum("s,sb->b", lengths, cosine)
        outer = np.einsum("s,sb,sbc->bc", lengths, sinus, across)
        excess = inner * inner + np.sum(outer * outer, axis=-1) - wanted * wanted
        low = np.where(excess > 0.0, square, low)
        high = np.where(excess > 0.0, high, square)
        inner_slope = -np.einsum("s,sb,sb->b", lengths, bend, sinus)
        outer_slope = np.einsum("s,sb,sb,sbc->bc", lengths, bend, cosine, across)
        slope = (inner * inner_slope + np.sum(outer * outer_slope, axis=-1)) / np.maximum(
            factor, _TINY
        )
        step = square - excess / np.where(np.abs(slope) > _TINY, slope, -_TINY)
        square = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
    angle = np.sqrt(square) * bend
    return np.cos(angle)[..., None] * axis + np.sin(angle)[..., None] * across


def _squared_arc(ratio: Floats) -> Floats:
    """About the square of half the angle of a circle's arc, from the ratio of chord to arc."""
    missing = 1.0 - ratio
    return missing * (6.0 + (np.pi**2 - 6.0) * missing)


def _partial_arc(start: Floats, goal: Floats, share: float, whole: float) -> Floats:
    """Quaternions (batch, 4) of a share of the smallest turn from one vector to another.

    Where the turn has no definite axis it fades out: near half a turn, and where the vectors are
    short against the ``whole`` group.
    """
    normal = cross(start, goal)
    sine = np.sqrt(np.sum(normal * normal, axis=-1))
    cosine = np.sum(start * goal, axis=-1)
    angle = np.arctan2(sine, cosine)
    angle = angle * share * np.clip(4.0 * (1.0 - angle / np.pi), 0.0, 1.0)
    size = np.sqrt(sine * sine + cosine * cosine)
    angle = angle * size / (size + _SHORT_LEVER * whole * whole)
    return from_rotation_vector(normal * (angle / np.maximum(sine, _TINY))[:, None])


def _product(first: Floats, second: Floats) -> Floats:
    w = first[:, :1] * second[:, :1] - np.sum(first[:, 1:] * second[:, 1:], -1, keepdims=True)
    xyz = (
        first[:, :1] * second[:, 1:]
        + second[:, :1] * first[:, 1:]
        + cross(first[:, 1:], second[:, 1:])
    )
    return np.concatenate([w, xyz], axis=-1)
