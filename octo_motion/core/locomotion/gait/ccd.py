# SPDX-License-Identifier: GPL-3.0-or-later
"""Weighted cyclic coordinate descent of an arm's three groups, in batch [Octopus, §3.1.4].

An arm is handled as the directions of its segments in the arm's own frame (x outward, z up). The
batch is all frames of all arms that are built alike. It is the last axis here, unlike elsewhere:
vectors are (3, batch) and directions (segments, 3, batch), so that each component is one run of
memory, which is what makes the solver fast.

The result depends on nothing but the angles of its own frame. So each frame must start afresh,
and must not pop where a target crosses the line of the group before it. The usual start, a
straight continuation, bends there to one side in one frame and to the other in the next. Ours is
the shape that the gait asks for: it bends at each link as far as the table says, which changes
with time as smoothly as the table, and it sways a little across that bend, so that a group which
goes from one side to the other passes round the straight line and not through it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...rotations import Floats, components_first
from ...rotations.components_first import cumulative_sum
from ..rig import lift_to_floor

GROUPS = 3


def diameters(joints: int, first: float = 1.0, taper: float = 0.01) -> Floats:
    """Diameters ``w_i = w₀ (1 − τ i)``, i = 0 … joints − 1, in metres [Octopus, eq. 3.1].

    τ is the share of w₀, the diameter at the root, that each joint loses; 1/n makes a cone, and
    more would leave joints that are thinner than nothing.
    """
    return first * (1.0 - taper * np.arange(joints, dtype=np.float64))


def split_groups(lengths: Floats, least: tuple[int, int, int] = (1, 1, 1)) -> tuple[int, int, int]:
    """Sizes of the three groups, as equal in length as whole segments allow, none less than asked.

    The source cuts n segments, n a multiple of three, into thirds. Artists' arms have any number of
    segments of any length, at least three, not all zero, so the cuts are made where the three sums
    differ least (the sum of their squares is smallest); of equal cuts the one nearest to equal
    counts wins.
    """
    count = len(lengths)
    reach = np.concatenate([[0.0], np.cumsum(lengths)])
    first = np.arange(1, count - 1)[:, None]
    second = np.arange(2, count)[None, :]
    sums = np.stack(
        np.broadcast_arrays(
            reach[first], reach[second] - reach[first], reach[count] - reach[second]
        )
    )
    cost = np.sum(sums**2, axis=0) / reach[count] ** 2
    counts = np.stack(np.broadcast_arrays(first, second - first, count - second))
    # The second term only decides between cuts of equal cost.
    cost = cost + 1e-9 * np.sum((counts / count) ** 2, axis=0)
    enough = np.all(counts >= np.array(least)[:, None, None], axis=0)
    cost = np.where(enough, cost, np.inf)
    row, column = np.unravel_index(np.argmin(cost), cost.shape)
    cut_first, cut_second = int(first[row, 0]), int(second[0, column])
    return cut_first, cut_second - cut_first, count - cut_second


# Share of its segments by length that a group keeps at least, whatever the weights, and two of two:
# a group of a single one has nothing to bend.
_KEPT_SEGMENTS: Final = 0.5


def weighted_groups(lengths: Floats, weights: Floats) -> tuple[int, int, int]:
    """Sizes of the three groups, as equal as whole segments allow in how far they can bend: length
    times weight (segments,), of the joint at each segment's root.

    So the bends between the gait's links come to be where the joints bend readily.
    """
    alike = split_groups(lengths)
    first, second, third = (
        min(size, max(2, int(np.ceil(_KEPT_SEGMENTS * size)))) for size in alike
    )
    return split_groups(lengths * (weights / weights.max()), (first, second, third))


def group_lengths(lengths: Floats, sizes: tuple[int, int, int]) -> Floats:
    """Rest length H_g of each group, (3,) [Octopus, eq. 3.4–3.6].

    As printed, the sum of eq. 3.4 takes one segment too many; a group's own segments are meant,
    so that the straight arm reaches its own targets.
    """
    ends = np.cumsum(sizes)
    return np.add.reduceat(lengths, [0, ends[0], ends[1]])


# --- Pseudo-targets: the chain Q₀ → Q₁ → Q₂ → Q₃ that an arm's groups converge to [Octopus, §3.1.3]
#
# Everything is in the arm's own frame: x outward, z up, y across, Q₀ = P₀ at the origin.


HEAD, PITCH, BANK = range(3)

# A link shrinks by |F|/2π, so that a table with turns of 360° would leave nothing of it.
SHORTEST = 0.05


def contraction(angles: Floats, factor: float = 1.0) -> Floats:
    """Contraction ``e_g = −|F_g| / 2π`` of each link (…, links), from ``SHORTEST − 1`` to 0
    [Octopus, eq. 3.11].

    The source has one angle for each link; where head and pitch turn it together, F is the length
    of the two as a vector, which equals the one angle when the other is zero. Bank only twists.
    Angles (…, links, 3) are head, pitch, bank in radians; the factor is 1 as in the source, 0 for
    links of fixed width.
    """
    turn = np.hypot(angles[..., HEAD], angles[..., PITCH])
    return np.maximum(-factor * turn / (2.0 * np.pi), SHORTEST - 1.0)


def link_rotations(angles: Floats) -> Floats:
    """Orientation (…, links, 4) of each link, carried by those before it [Octopus, §3.1.3].

    Within a link, pitch turns first about the vertical axis, then head about the lateral axis so
    turned. Bank does not turn the chain: the source moves targets by head and pitch alone. Angles
    (…, links, 3) are head, pitch, bank in radians; positive pitch turns x towards y.
    """
    # Cosines and sines by the tangent of half of the angle, which is quicker; components first.
    half = np.moveaxis(np.tan(0.25 * angles[..., [HEAD, PITCH]]), (-1, -2), (0, 1))
    sine = 2.0 / (1.0 + half * half)
    cosine = sine - 1.0
    sine *= half
    own = np.stack(
        [
            cosine[PITCH] * cosine[HEAD],
            sine[PITCH] * sine[HEAD],
            -cosine[PITCH] * sine[HEAD],
            sine[PITCH] * cosine[HEAD],
        ],
        axis=1,
    )
    each = own.reshape(*own.shape[:2], -1)
    for link in range(1, len(each)):
        each[link] = components_first.multiply(each[link - 1], each[link])
    return np.moveaxis(own, (0, 1), (-2, -1))


def pseudo_targets(rotations: Floats, widths: Floats) -> Floats:
    """Positions Q₀ … Q₃ (…, links + 1, 3), from ``link_rotations``.

    Widths (…, links) are ``H_g (1 + e_g)`` of each link [Octopus, eq. 3.12–3.14, which reuse the
    name H for the change of the width].
    """
    w, x, y, z = np.moveaxis(rotations, -1, 0)
    doubled = 2.0 * widths
    result = np.empty((rotations.shape[-2] + 1, 3, *rotations.shape[:-2]))
    places = np.moveaxis(result, (0, 1), (-2, -1))
    places[..., 0, :] = 0.0
    # What turns of x along the links.
    places[..., 1:, 0] = widths - doubled * (y * y + z * z)
    places[..., 1:, 1] = doubled * (x * y + w * z)
    places[..., 1:, 2] = doubled * (x * z - w * y)
    cumulative_sum(result)
    return places


SWEEPS: Final = 4
"""Sweeps of CCD over a group. Two or eight change slip, overlap and turns of the ten set-ups on
bumps by less than a tenth."""
SOFTENINGS: Final = 4
"""How often bends are spread and the groups closed again. With two Swim has a jerk (as in
``ground/stance_swing``) of 0.085 instead of 0.073, with eight it turns by 0.28 radians from frame
to frame instead of 0.23."""
_SPREADS: Final = 2
"""How often bends are spread before the groups are closed again. With one Swim has a jerk of 0.083
instead of 0.073, with four of 0.100."""

# Stretching a group to its full length is the singular point of any inverse kinematics: its bend
# grows like the square root of what is left. Rounding the corner off costs half of this at most,
# in group lengths.
_ROUNDING: Final = 1.5e-4
# A joint turns the less, the shorter its lever: of a lever of √0.05 of the group, half. So the
# last joints do not curl, and an arm of many bones takes the shape of one of few.
_SHORT_LEVER: Final = 0.05
_JOINTS_OF_A_WEIGHT: Final = 4
# Where a gait bends a group much more than this, the group does not need to sway.
_SLIGHT: Final = np.radians(8.0)
# Square of the tangent of half the largest bend, 170°, of a group that folds up.
_MOST_FOLDED: Final = np.tan(np.radians(85.0)) ** 2
_NEWTON_STEPS: Final = 6
_NEWTON_STEPS_BETWEEN: Final = 2
_ROUGH_SOFTENINGS: Final = 2
_ROUGH_NEWTON_STEPS: Final = 3, 1
"""All three of what is to be soon known, and may be off. With a sweep of CCD besides, it is off by
no less."""
# A step that changes less than this, as a share, is the last: the next one would be its square.
_NEAR: Final = 1e-7
# Arm lengths within which a joint comes to rest on a floor.
FLOOR_ROUNDING: Final = 0.1
_SHORT: Final = 1e-9
_OPPOSITE: Final = 1e-4
"""Where a group has to be turned with more care: a chord of hardly any length, of the unit that
lengths are in, and one plus the cosine of what is nearly half a turn."""
_TINY: Final = 1e-12
_PAIR: Final = 2
"""Segments of a group that has one bend alone."""
_HARDLY: Final = 0.1
"""Share of the sway with which such a group changes sides where it is straight."""


@dataclass(frozen=True, eq=False)
class JointChain:
    """What arms of one build have in common, lengths in any unit."""

    lengths: Floats
    """(segments,) root to tip."""
    sizes: tuple[int, int, int]
    """Segments in each group."""
    weights: Floats
    """(segments,) weight a of the joint at each segment's root, in (0, 1] [Octopus, eq. 3.7]."""
    pairs_as_asked: bool = False
    """Whether a group of two segments bends to the side that its own link turns to, and its one
    bend is not softened. The more its link turns, the shorter a group gets: so that bend comes
    from nothing and goes to nothing where it changes sides. Where the links before and after have
    a say in it, a bend of many degrees changes sides from one frame to the next."""

    @cached_property
    def before(self) -> Floats:
        """(segments,) as of :func:`shares_before`."""
        return shares_before(self.weights)

    @property
    def groups(self) -> tuple[slice, ...]:
        """The segments of each group."""
        ends = np.cumsum(self.sizes)
        return tuple(
            slice(int(end) - size, int(end)) for end, size in zip(ends, self.sizes, strict=True)
        )

    @property
    def pairs(self) -> tuple[slice, ...]:
        """The groups whose one bend is as asked for."""
        each = zip(self.groups, self.sizes, strict=True)
        return tuple(group for group, size in each if size == _PAIR and self.pairs_as_asked)


def solving_ccd(
    chain: JointChain,
    shape: Floats,
    links: Floats,
    targets: Floats,
    *,
    softness: float = 0.8,
    stretch_slack: float = 0.0,
    floor: Floats | None = None,
    rough: bool = False,
) -> Iterator[Floats]:
    """Directions (segments, 3, batch) of arms whose groups end at their targets: as far as they are
    found after each of some steps, the last ones are the answer.

    Sweeps of weighted CCD [Octopus, eq. 3.3, 3.7], and ours besides: closing and softening.

    Args:
        chain: the arms' build.
        shape: (segments, 3, batch) the shape to start from, each group seen from its own link
            (see ``asked_shape``).
        links: (links, 4, batch) orientations of the links.
        targets: (links + 1, 3, batch) pseudo-targets Q₀ … Q₃; those out of reach are pointed at.
        softness: 0 leaves the bends as they are; towards 1 they are spread over neighbours.
        stretch_slack: group lengths by which a group may reach beyond its target as it straightens.
        floor: (batch,) height that joints between the groups' ends keep above, as far as the
            targets let them.
        rough: whether it may do without sweeps, and the shape may differ a little.
    """
    directions, sweeps = np.empty_like(shape), 0 if rough else SWEEPS
    exact, between = _ROUGH_NEWTON_STEPS if rough else (_NEWTON_STEPS, _NEWTON_STEPS_BETWEEN)
    root = np.zeros_like(targets[0])
    for group, segments in enumerate(chain.groups):
        lengths, goal = chain.lengths[segments], targets[group + 1] - root
        own = aimed(components_first.rotate(links[group], shape[segments]), lengths, goal)
        for _ in range(sweeps if len(own) > 1 else 0):
            own = swept(own, lengths, chain.weights[segments], goal)
        directions[segments] = close_group(own, lengths, goal, exact, stretch_slack=stretch_slack)
        root = root + chord(directions[segments], lengths)
        yield directions
    iterations = SOFTENINGS if softness > 0.0 or floor is not None else 0
    iterations = min(iterations, _ROUGH_SOFTENINGS) if rough else iterations
    for number in range(1, iterations + 1):
        before = directions
        for _ in range(_SPREADS):
            directions = softened(directions, softness, chain.before)
        for segments in chain.pairs:
            directions[segments] = before[segments]
        if floor is not None:
            directions = lifted(directions, chain.lengths, floor)
        # Only the last closing has to be exact.
        steps = exact if number == iterations else between
        root = np.zeros_like(root)
        for group, segments in enumerate(chain.groups):
            lengths, goal = chain.lengths[segments], targets[group + 1] - root
            directions[segments] = close_group(
                directions[segments], lengths, goal, steps, stretch_slack=stretch_slack
            )
            root = root + chord(directions[segments], lengths)
        yield directions


def asked_shape(chain: JointChain, angles: Floats, sway: Floats) -> Floats:
    """The shape that the gait asks for, (segments, 3, batch), each group seen from its link.

    Along each group the direction turns from halfway back to the link before to halfway on to
    the link after, about the link's own direction in the mean; a parabola is the simplest that
    does. The first group leaves the body the way that the arm does.

    Args:
        chain: the arms' build.
        angles: (links, 2, batch) head and pitch of each link.
        sway: (2, batch) head and pitch of the bend that is added at the root of the first group
            where it is nearly straight; it changes sides along each group.
    """
    # The first group leaves the body straight, and nothing pulls at the last one's end: there it
    # goes on as it came.
    before = -0.5 * angles * np.array([2.0, 1.0, 1.0])[:, None, None]
    after = 0.5 * angles[[1, 2, 2]]
    asked = np.sum(before**2 + after**2, axis=1, keepdims=True)
    swaying = sway * (_SLIGHT**2 / (_SLIGHT**2 + asked))
    # Where groups before give, those after them are still bent while their links are straight.
    gives = False
    shape = np.zeros((len(chain.lengths), 3, angles.shape[-1]))
    shape[:, 0] = 1.0
    for group, segments in enumerate(chain.groups):
        lengths = chain.lengths[segments]
        if len(lengths) == 1:
            continue
        leading, aside = after[group], (-1.0) ** group * swaying[group]
        if segments in chain.pairs:
            leading = np.zeros_like(leading)
            aside = aside if gives else _HARDLY * aside
        gives = True
        reach = np.cumsum(lengths)
        along = ((reach - 0.5 * lengths) / reach[-1])[:, None, None]
        turn = (
            before[group] * (1.0 - 4.0 * along + 3.0 * along**2)
            + leading * (3.0 * along**2 - 2.0 * along)
            + aside * (1.0 - 2.0 * along)
        )
        # Cosines and sines by the tangent of half of the angle, which is quicker.
        half = np.tan(0.5 * turn)
        share = 2.0 / (1.0 + half * half)
        half *= share
        share -= 1.0
        shape[segments, 0] = share[:, 0] * share[:, 1]
        shape[segments, 1] = share[:, 0] * half[:, 1]
        shape[segments, 2] = half[:, 0]
    return shape


def chord(directions: Floats, lengths: Floats) -> Floats:
    """Vector (3, batch) from a group's root to its end."""
    # Not by way of BLAS, whose threads wait for each other longer than they work.
    return np.einsum("s,scb->cb", lengths, directions)


def aimed(directions: Floats, lengths: Floats, goal: Floats) -> Floats:
    """A group turned as a whole about its root, its end towards the goal (3, batch)."""
    end = chord(directions, lengths)
    sizes = _size(end), _size(goal)
    if min(float(each.min(initial=1.0)) for each in sizes) < _SHORT:
        return components_first.rotate(components_first.shortest_arc(end, goal), directions)
    ends = np.stack([end / sizes[0], goal / sizes[1]])
    facing = 1.0 + np.einsum("cb,cb->b", ends[0], ends[1])
    if float(facing.min(initial=1.0)) < _OPPOSITE:
        return components_first.rotate(components_first.shortest_arc(end, goal), directions)
    # Two reflections make the turn from one to the other: in the first, in what lies half way.
    shares = np.einsum("xcb,scb->xsb", ends, directions)
    half = (shares[0] + shares[1]) / facing
    shares[1] = 2.0 * shares[0] - half
    shares[0] = -half
    result = np.einsum("xsb,xcb->scb", shares, ends)
    result += directions
    return result


def swept(directions: Floats, lengths: Floats, weights: Floats, goal: Floats) -> Floats:
    """One sweep of weighted CCD over a group, tip to root [Octopus, eq. 3.3, 3.7].

    At each joint everything beyond it turns about ``(P_e − P_j) × (Q − P_j)`` by ``a_j ξ_j``.
    The joints nearer to the root have not moved yet when a joint turns, and those beyond move as
    one piece.

    Weights count for groups of four joints, as in the source; where more joints share the bend,
    each takes the less of it.
    """
    count = len(directions)
    steps = lengths[:, None, None] * directions
    whole = float(np.sum(lengths))
    scale = min(1.0, _JOINTS_OF_A_WEIGHT / count)
    to_goal = goal - steps.sum(axis=0)
    result, end = directions.copy(), np.zeros_like(goal)
    for joint in range(count - 1, -1, -1):
        end += steps[joint]
        to_goal += steps[joint]
        _turn_partly(end, to_goal, weights[joint] * scale, whole, result[joint:])
    return result


def close_group(
    directions: Floats,
    lengths: Floats,
    goal: Floats,
    steps: int = _NEWTON_STEPS,
    *,
    stretch_slack: float = 0.0,
) -> Floats:
    """A group bent as much as it takes for its end to be at the goal, in the shape it has.

    The bends are the angles between the segments and the chord. The tangents of half of them are
    all scaled by one factor, so that the chord is as long as the goal is far; then the group is
    turned about its root.

    The bend goes with the square root of what the chord is short of the group. So a goal that
    comes and goes at an even speed straightens the group with a snap. With s what the chord is
    short of, in group lengths, s² / (s + give) in its place makes the bend go with s itself where
    that is little.
    """
    whole = float(np.sum(lengths))
    if len(lengths) > 1:
        slack = 1.0 - _size(goal) / whole
        slack = 0.5 * (slack + np.sqrt(slack * slack + _ROUNDING**2))
        # Far out of reach it is nothing at all, and would be divided by nothing.
        slack = np.maximum(slack, _TINY)
        slack *= slack / (slack + stretch_slack)
        directions = _scaled(directions, lengths, np.maximum(whole * (1.0 - slack), 0.0), steps)
    return aimed(directions, lengths, goal)


def overreach(chords: Floats, whole: Floats, stretch_slack: float) -> Floats:
    """How far beyond goals so far away groups of these lengths reach (see :func:`close_group`)."""
    slack = np.clip(1.0 - chords / whole, _TINY, 1.0)
    return whole * slack * stretch_slack / (slack + stretch_slack)


def shares_before(weights: Floats) -> Floats:
    """Share (segments,) that the segment before each has in the mean of its neighbours.

    A joint between two resists a bend by one over its weight, (segments,) of those at the
    segments' roots: half where weights are alike. So spread again and again, bends come to be in
    proportion to the weights.
    """
    stiff = 1.0 / weights
    return stiff / (stiff + np.append(stiff[1:], stiff[-1:]))


def softened(directions: Floats, amount: float, before: Floats) -> Floats:
    """Directions drawn towards the mean of their neighbours, across the borders of groups too.

    Before the first segment stands the way in which the arm leaves the body, x. Each one's share in
    the mean is from :func:`shares_before`.
    """
    if amount < _TINY:
        return directions
    # In quarters of the amount: it is made of unit length in the end.
    mean = (4.0 / amount - 2.0) * directions
    before = 2.0 * before[:, None, None]
    after = 2.0 - before
    mean[1:] += before[1:] * directions[:-1]
    mean[:-1] += after[:-1] * directions[1:]
    mean[0, 0] += before[0, 0, 0]
    mean[-1] += after[-1] * directions[-1]
    return _made_unit(mean)


def lifted(directions: Floats, lengths: Floats, floor: Floats) -> Floats:
    """An arm whose joints below a floor are raised to it; lengths are kept, ends may move."""
    above = cumulative_sum(lengths[:, None] * directions[:, 2])
    above -= floor
    lift = lift_to_floor(above, FLOOR_ROUNDING)
    lift[1:] -= lift[:-1].copy()
    result = directions.copy()
    result[:, 2] += lift / lengths[:, None]
    return _made_unit(result)


def _scaled(directions: Floats, lengths: Floats, wanted: Floats, steps: int) -> Floats:
    """A group whose bends are scaled so that its chord is as long as wanted (batch,).

    With k = tan²(θ/2) of a segment's bend θ, and q the square of the factor, the segment gets the
    bend of cosine ``(1 − q k) / (1 + q k)``: the chord is a rational function of q, and its
    square is nearly linear where bends are slight. Newton's method finds q.
    """
    count, _, batch = directions.shape
    whole = float(np.sum(lengths))
    axis = chord(directions, lengths)
    reach = _size(axis)
    axis /= np.maximum(reach, _TINY)
    along = np.einsum("scb,cb->sb", directions, axis)
    rest = np.maximum(1.0 + along, 1e-9)
    tangent = np.maximum(1.0 - along, 0.0) / rest
    limit = _MOST_FOLDED / np.maximum(np.max(tangent, axis=0), _TINY)
    square = _squared_arc(wanted / whole) / np.maximum(_squared_arc(reach / whole), _TINY)
    square = np.minimum(square, limit)
    # Of each segment what is across the axis, and half of what makes its length along it.
    parts = np.empty((count, 4, batch))
    across = parts[:, :3]
    np.multiply(along[:, None], axis, out=across)
    np.subtract(directions, across, out=across)
    np.multiply(rest, 0.5, out=parts[:, 3])
    factor = 2.0 / rest
    weighted = lengths[:, None] * factor
    shares = np.empty((2, count, batch))
    goal = wanted * wanted
    # Each one stops on its own account: it hangs on no other.
    found = np.zeros(batch, dtype=bool)
    for _ in range(steps):
        share = square * tangent
        share += 1.0
        np.reciprocal(share, out=share)
        np.multiply(weighted, share, out=shares[0])
        share *= tangent
        np.multiply(shares[0], share, out=shares[1])
        # Sums over the segments, and less their slopes against q. Along the axis the chord is
        # Σ l (2 share − 1), across it the square root of q times Σ l share across.
        sums = np.einsum("wsb,scb->wcb", shares, parts)
        outer = sums[0, :3]
        inner = 2.0 * sums[0, 3] - whole
        spread, fading = np.einsum("wcb,cb->wb", sums[:, :3], outer)
        excess = inner * inner + square * spread - goal
        slope = spread - 2.0 * (2.0 * inner * sums[1, 3] + square * fading)
        step = square - excess / np.minimum(slope, -_TINY)
        np.minimum(step, 4.0 * square, out=step)
        np.maximum(step, 0.25 * square, out=step)
        np.minimum(step, limit, out=step)
        np.copyto(step, square, where=found)
        found |= np.abs(step - square) <= _NEAR * square
        square = step
        if found.all():
            break
    share = 1.0 / (1.0 + square * tangent)
    result = across * (factor * np.sqrt(square) * share)[:, None]
    result += (2.0 * share - 1.0)[:, None] * axis
    return result


def _squared_arc(ratio: Floats) -> Floats:
    """About the square of half the angle of a circle's arc, from the ratio of chord to arc."""
    missing = 1.0 - ratio
    return missing * (6.0 + (np.pi**2 - 6.0) * missing)


def _turn_partly(end: Floats, to_goal: Floats, share: float, whole: float, beyond: Floats) -> None:
    """Turn a vector (3, batch) and directions (segments, 3, batch), all of them in place, by a
    share of the smallest turn from that vector to another.

    Where the turn has no definite axis it fades out: near half a turn, and where the vectors are
    short against the ``whole`` group.
    """
    # Two vectors span the plane which is turned: the one itself, and of the other what is across.
    plane = np.empty((2, *end.shape))
    plane[0] = end
    squared = np.einsum("cb,cb->b", end, end)
    size = np.sqrt(squared)
    one = 1.0 / np.maximum(size, _TINY)
    cosine = np.einsum("cb,cb->b", end, to_goal)
    cosine *= one
    np.multiply(end, cosine * one, out=plane[1])
    np.subtract(to_goal, plane[1], out=plane[1])
    square = np.einsum("cb,cb->b", plane[1], plane[1])
    sine = np.sqrt(square)
    angle = np.arctan2(sine, cosine)
    cosine *= cosine
    cosine += square
    lever = np.sqrt(cosine, out=cosine)
    lever *= size
    half = angle * (-4.0 / np.pi)
    half += 4.0
    np.minimum(half, 1.0, out=half)
    half *= angle
    half *= lever
    lever += _SHORT_LEVER * whole * whole
    lever *= 2.0 / share
    half /= lever
    # By the tangent of half of it, which is quicker than its sine.
    tangent = np.tan(half, out=half)
    turn = tangent * tangent
    turn += 1.0
    np.divide(tangent, turn, out=turn)
    turn *= 2.0
    lost = tangent
    lost *= turn
    # What these vectors lack to be of unit length counts for how much of them there is to be.
    other = 1.0 / np.maximum(sine, _TINY)
    parts = np.einsum("xcb,scb->sxb", plane, beyond)
    parts[:, 0] *= one
    parts[:, 1] *= other
    added = parts * -lost
    parts *= turn
    added[:, 0] -= parts[:, 1]
    added[:, 1] += parts[:, 0]
    added[:, 0] *= one
    added[:, 1] *= other
    beyond += np.einsum("sxb,xcb->scb", added, plane)
    # The vector itself has nothing across.
    turn *= other
    turn *= size
    end -= lost * plane[0]
    end += turn * plane[1]


def _size(vectors: Floats) -> Floats:
    """Lengths (batch,) of vectors (3, batch)."""
    return np.sqrt(np.einsum("cb,cb->b", vectors, vectors))


def _made_unit(vectors: Floats) -> Floats:
    """Vectors (segments, 3, batch), which are changed to unit length in place."""
    size = np.sqrt(np.einsum("scb,scb->sb", vectors, vectors))
    vectors *= (1.0 / np.maximum(size, _TINY))[:, None]
    return vectors
