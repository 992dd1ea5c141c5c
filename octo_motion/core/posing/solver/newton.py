# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast solver: Newton's method in the velocities that keep every joint closed.

All laws of a step (elements, stops, contacts, holds) give an impulse that falls as its velocity
grows, the slope of a convex function ℓ. The velocities at the step's end are the lowest point of

    ½ (u − u*)ᵀ SᵀMS (u − u*) + Σ ℓ(w),      Sᵀ M (v + h f) = SᵀMS u*

With impulses replaced by their tangents, p ≈ p_k − W (w − w_k), that is one linear system of the
tree, for a row at a body adds Xᵀ W X to that body's inertia and nothing else. Where the laws are
linear (sticking, resting, apart, below yield) a single solution is exact; a few more are needed
where something starts to touch, to slip or to flow. No step goes beyond the lowest point on its
way, so that it always arrives.

It begins with the tangents of contacts where the step before ended, and not at its velocities: a
contact is stiff, and the little that a velocity means in another direction when the figure has
turned by a thousandth would already lift it. What slides slides on in a single solution.

Contacts between two bodies of the figure would tie branches together; they are brought in after
the solution, by the Woodbury identity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...rotations import Floats
from ...rotations.small_batches import matvec
from ..puppet import ElementResponse
from .constraint_rows import Flags, Pattern, RowImpulses, Rows, Tangent
from .joint_stops import Stops
from .problem import SPATIAL, Problem
from .tree import Tree


# Those that are made in every step are not frozen: that would take eight times as long.
@dataclass(eq=False)
class Iterate:
    """Velocities, and what all laws do there."""

    speeds: Floats
    """(slots, 3) u."""
    velocities: Floats
    """(bodies, 6) V."""
    joint_speeds: Floats
    """(bodies, 3) relative angular velocities, world axes."""
    joint_impulses: Floats
    """(bodies, 3) of elements and stops, world axes."""
    response: ElementResponse
    """Loads and flow of the elements, world axes."""
    pressed: Flags | None
    """(stops,) which ends of ranges bear; None where none is near."""
    rows: RowImpulses | None
    """What the rows do; None where there are none."""


@dataclass(eq=False)
class Solution(Iterate):
    """Velocities and impulses after a step."""

    moving: Floats | None
    """(slots, 3) u with which positions move, with corrections that are not kept; None where there
    are none."""
    iterations: int
    """Linear systems solved."""
    miss: float
    """Largest difference of an impulse from its law, against the largest impulse of its kind."""

    @property
    def impulses(self) -> Floats:
        """(rows, 3) of the rows."""
        return _NO_ROWS if self.rows is None else self.rows.impulses


@dataclass(eq=False)
class InitialGuess:
    """Where the step before ended."""

    speeds: Floats
    """(slots, 3) u."""
    rows: RowImpulses | None = None
    """What the rows did then, as they are now; None begins at ``speeds`` and nothing else."""
    response: ElementResponse | None = None
    """What the elements did then; None where none flowed, and then it begins as if none will."""
    pressed: Flags | None = None
    """(stops,) which ends of ranges bore; None begins with what they do at ``speeds``."""


@dataclass(eq=False)
class _Tangents:
    """All laws of a step as planes."""

    slopes: Floats
    """(bodies, 3, 3) of the joints."""
    right: Floats
    """(bodies, 3) impulses of the joints at rest."""
    linear: bool
    """Whether the joints' laws are these planes: no element flows and no stop is near."""
    rows: Tangent | None


class Newton:
    """Solves the problems of one figure."""

    def __init__(self, tree: Tree, *, tolerance: float, iterations: int) -> None:
        self._tree = tree
        self._tolerance = tolerance
        self._iterations = iterations
        slots = len(tree.layout.bodies)
        self._joint_blocks = np.zeros((slots, 3, 3))
        self._slopes: Floats | None = None
        self._pattern: Pattern | None = None
        self._maps = tuple(_with_columns(columns) for columns in (1, 2))

    def solve(
        self, problem: Problem, start: InitialGuess, corrections: Floats | None = None
    ) -> Solution:
        """Velocities at the end of the step; corrections (rows, 3) are velocities for positions
        alone.
        """
        self._tree.place(problem.joints)
        self._base = problem.law.at_rest(problem.springs)
        if problem.driven is not None:
            self._base = self._base + problem.law.drawn(problem.driven)
        self._held = problem.step * self._base
        bodies = self._bodies(problem, 1 if corrections is None else 2)
        point, tangents = self._begin(problem, start)
        shift: Floats | None = None
        miss = np.inf
        count = rounds = 0
        while True:
            count += 1
            solved = self._linear(problem, bodies, tangents, corrections)
            if corrections is not None:
                shift = solved[..., 1] - solved[..., 0]
            end = self._at(problem, np.ascontiguousarray(solved[:, :, 0]))
            joints, pushes = _predicted(tangents, end)
            miss = _miss(end, joints, pushes)
            if miss > self._tolerance and point is not None:
                end = self._lowest(problem, point, end, joints, pushes)
            point = end
            if count >= self._iterations:
                break
            # Where slipping began or ended in a blow, once more with the speed that is left. The
            # tangents stay the same: impulses change less than what they are asked for.
            if miss <= _NEARLY and rounds < _ROUNDS and self._follow(problem, end):
                rounds += 1
                point = None
            elif miss <= self._tolerance:
                break
            tangents = self._tangents(problem, end)
        # The shift is added to what was settled on, which need not be where the last system led.
        moving = None if shift is None else end.speeds + shift
        return Solution(
            end.speeds,
            end.velocities,
            end.joint_speeds,
            end.joint_impulses,
            end.response,
            end.pressed,
            end.rows,
            moving,
            count,
            miss,
        )

    def _begin(self, problem: Problem, start: InitialGuess) -> tuple[Iterate | None, _Tangents]:
        """The first tangents, and the velocities where they touch if all do at the same."""
        if start.rows is None and len(problem.rows.bodies):
            point = self._at(problem, start.speeds)
            return point, self._tangents(problem, point)
        pressed, response, law = start.pressed, start.response, problem.law
        if pressed is None and problem.stops:
            speeds = self._tree.of_joints(start.speeds)
            pressed = _pushes(problem.stops[0], speeds) >= 0.0
        rows = None if start.rows is None else problem.rows.tangent(start.rows)
        if response is None:
            return None, _planes(problem, law.held, self._held, pressed, rows)
        # At the speeds at which they would bear now what they bore then.
        slopes, right = response.planes(self._base, None)
        return None, _planes(problem, slopes, right, pressed, rows, linear=False)

    def _follow(self, problem: Problem, point: Iterate) -> bool:
        rows = problem.rows
        if point.rows is None or (point.rows.slips is None and not rows.followed):
            return False
        return rows.follow(rows.slip(point.rows), problem.blow)

    def _at(self, problem: Problem, speeds: Floats) -> Iterate:
        """All laws at u (slots, 3)."""
        tree = self._tree
        velocities = tree.velocities(speeds)
        joint_speeds = tree.of_joints(speeds)
        response, impulses, pressed = self._joints(problem, joint_speeds)
        rows = problem.rows
        answer = rows.respond(rows.wanted(velocities)) if len(rows.bodies) else None
        return Iterate(speeds, velocities, joint_speeds, impulses, response, pressed, answer)

    def _joints(
        self, problem: Problem, speeds: Floats
    ) -> tuple[ElementResponse, Floats, Flags | None]:
        """Elements, impulses (bodies, 3) of joints that turn so (bodies, 3), stops that bear."""
        response = problem.law.respond(self._base, speeds)
        impulses = problem.step * response.load
        if not problem.stops:
            return response, impulses, None
        stops = problem.stops[0]
        push = _pushes(stops, speeds)
        pressed = push >= 0.0
        if np.count_nonzero(pressed):
            impulses += stops.spread @ (np.maximum(push, 0.0)[:, None] * stops.axes)
        return response, impulses, pressed

    def _tangents(self, problem: Problem, point: Iterate) -> _Tangents:
        """All laws as planes that touch them at a point."""
        rows = None if point.rows is None else problem.rows.tangent(point.rows)
        if point.response.flows is None:
            return _planes(problem, problem.law.held, self._held, point.pressed, rows)
        slopes, right = point.response.planes(self._base, point.joint_speeds)
        return _planes(problem, slopes, right, point.pressed, rows, linear=False)

    def _bodies(self, problem: Problem, columns: int) -> Floats:
        """What a step's systems share: inertias and momenta of all bodies as ``Tree.summed``."""
        rows, bodies = problem.rows, len(problem.masses)
        own = (problem.moments @ self._maps[columns - 1]).reshape(bodies, 6, -1)
        own[:, :, 6:] = problem.momenta[:, :, None]
        if rows.pattern is not self._pattern:
            onto = np.zeros((bodies, len(rows.bodies)))
            onto[rows.bodies, np.arange(len(rows.bodies))] = 1.0
            # A push between two bodies of the figure is taken from the other one. Its stiffness is
            # not here, see ``_with_pairs``.
            onto[rows.others[rows.paired], rows.paired] -= 1.0
            self._tree.use_rows(onto)
            self._pattern = rows.pattern
        return self._tree.summed(own)

    def _linear(
        self, problem: Problem, bodies: Floats, tangents: _Tangents, corrections: Floats | None
    ) -> Floats:
        """(slots, 3, columns) solution with all laws replaced by their tangents."""
        tree, rows, planes = self._tree, problem.rows, tangents.rows
        own = _NO_INERTIAS
        if planes is not None:
            lowered = _lowered(rows, planes, corrections, bodies.shape[-1] - 6)
            own = rows.reach.transpose(0, 2, 1) @ lowered
        if tangents.slopes is not self._slopes:
            self._slopes = tangents.slopes
            self._joint_blocks[tree.joint_slot] = tangents.slopes
        firm = 0.0
        if problem.carried is not None:
            # Held so firmly that what hangs on them changes nothing.
            firm = _FIRM * float(problem.masses.sum())
            self._joint_blocks[tree.carried_slots] = firm * _UNIT
        right = tree.fill(bodies, own, self._joint_blocks)
        unknowns, columns = 3 * len(self._joint_blocks), right.shape[1]
        of_slots = right[:unknowns].reshape(-1, 3, columns)
        of_slots[tree.joint_slot] += tangents.right[:, :, None]
        if problem.carried is not None:
            of_slots[tree.carried_slots] += firm * problem.carried[:, :, None]
        if planes is not None and len(rows.paired):
            solved = self._with_pairs(problem, planes, right)
        else:
            solved = tree.solve_all(right)
        return solved[:unknowns].reshape(-1, 3, columns)

    def _with_pairs(self, problem: Problem, tangent: Tangent, right: Floats) -> Floats:
        """The solution with contacts between bodies of the figure.

        (H + JᵀWJ)⁻¹ r = y − Z (1 + W J Z)⁻¹ W J y with y = H⁻¹ r and Z = H⁻¹ Jᵀ.
        """
        tree = self._tree
        rows = problem.rows
        paired = rows.paired
        slopes = rows.pattern.gains[paired, None, None] * tangent.blocks()[paired]
        loaded = slopes.any(axis=(1, 2))
        paired, slopes = paired[loaded], slopes[loaded]
        if not len(paired):
            return tree.solve_all(right)
        count = len(paired)
        # (unknowns, 3 count): Sᵀ Xᵀ, with a sign for which of the two bodies a slot moves.
        wide = rows.reach[paired].transpose(2, 0, 1).reshape(6, 3 * count)
        spread = tree.spread(wide, np.repeat(tree.moved[:, paired], 3, axis=1))
        both = tree.solve_all(np.concatenate([spread, right], axis=1))
        response = spread.T @ both
        weighted = (slopes @ response.reshape(count, 3, -1)).reshape(3 * count, -1)
        inner = weighted[:, : 3 * count].copy()
        inner[np.arange(3 * count), np.arange(3 * count)] += 1.0
        pull = np.linalg.solve(inner, weighted[:, 3 * count :])
        return both[:, 3 * count :] - both[:, : 3 * count] @ pull

    def _lowest(
        self,
        problem: Problem,
        start: Iterate,
        end: Iterate,
        joints: Floats,
        rows: Floats | None,
    ) -> Iterate:
        """The lowest point of the convex function between two, or a little before the end.

        Along the way d its slope is d·SᵀMS(u − u*) − Σ p·dw. At the end the first part is what
        the tangents' impulses do along the way, and it is linear before.
        """
        joint_way = end.joint_speeds - start.joint_speeds
        body_way = end.velocities - start.velocities
        mass = float((body_way * matvec(problem.spatial, body_way)).sum())
        pull = float((joints * joint_way).sum())
        row_way = _NO_ROWS
        if rows is not None:
            assert start.rows is not None
            assert end.rows is not None
            row_way = (start.rows.wanted - end.rows.wanted) / problem.rows.pattern.column
            pull += float((rows * row_way).sum())

        def slope(at: Iterate, share: float) -> float:
            value = pull - (1.0 - share) * mass - float((at.joint_impulses * joint_way).sum())
            if at.rows is not None:
                value -= float((at.rows.impulses * row_way).sum())
            return value

        low, high = 0.0, 1.0
        at_low, at_high = slope(start, low), slope(end, high)
        if at_high <= _ENOUGH * abs(at_low) or at_low >= 0.0:
            return end
        first, last = at_low, 0.0
        best = end
        for _ in range(_SEARCHES):
            # False position, kept away from the ends: the slope may jump.
            share = low + (high - low) * min(max(at_low / (at_low - at_high), 0.1), 0.9)
            best = self._between(problem, start, end, share)
            value = slope(best, share)
            if abs(value) <= _ENOUGH * abs(first):
                break
            # Where one end stays twice, half of its slope counts (Dowell and Jarratt 1971): beside
            # a joint that has stopped to flow it is hundreds of times the other's.
            if value > 0.0:
                high, at_high = share, value
                at_low *= 0.5 if last > 0.0 else 1.0
            else:
                low, at_low = share, value
                at_high *= 0.5 if last < 0.0 else 1.0
            last = value
        return best

    def _between(self, problem: Problem, start: Iterate, end: Iterate, share: float) -> Iterate:
        """All laws on the way from one point to another, where velocities need no products."""
        joint_speeds = start.joint_speeds + share * (end.joint_speeds - start.joint_speeds)
        response, impulses, pressed = self._joints(problem, joint_speeds)
        answer = None
        if start.rows is not None and end.rows is not None:
            wanted = start.rows.wanted + share * (end.rows.wanted - start.rows.wanted)
            answer = problem.rows.respond(wanted)
        return Iterate(
            start.speeds + share * (end.speeds - start.speeds),
            start.velocities + share * (end.velocities - start.velocities),
            joint_speeds,
            impulses,
            response,
            pressed,
            answer,
        )


def _with_columns(count: int) -> Floats:
    """(16, 36 + 6 count) ``SPATIAL`` with empty columns beside each matrix."""
    wide = np.concatenate([SPATIAL.reshape(16, 6, 6), np.zeros((16, 6, count))], axis=2)
    return wide.reshape(16, -1)


def _lowered(rows: Rows, planes: Tangent, corrections: Floats | None, columns: int) -> Floats:
    """(rows, 3, 6 + columns) P a X, and P y₀ with what is left at rest: the rows' tangents."""
    whole = np.empty((len(rows.bodies), 3, 6 + columns))
    np.multiply(rows.reach, rows.pattern.gains[:, None, None], out=whole[:, :, :6])
    whole[:, :, 6] = rows.asked
    if corrections is not None:
        np.add(rows.asked, rows.pattern.column * corrections, out=whole[:, :, 7])
    if planes.planes is None:
        assert planes.shares is not None
        whole *= planes.shares[:, None, None]
    else:
        whole = planes.planes @ whole
    if planes.rest is not None:
        whole[:, :, 6:] += planes.rest[:, :, None]
    if len(rows.paired):
        whole[rows.paired, :, :6] = 0.0
    return whole


def _planes(
    problem: Problem,
    slopes: Floats,
    right: Floats,
    pressed: Flags | None,
    rows: Tangent | None,
    *,
    linear: bool = True,
) -> _Tangents:
    """Planes of elements and of stops that bear."""
    if pressed is not None and pressed.any():
        stops = problem.stops[0]
        stiff = (pressed * stops.gains)[:, None] * stops.axes
        right = right - stops.spread @ (stops.rates[:, None] * stiff)
        blocks = stiff[:, :, None] * stops.axes[:, None, :]
        slopes = slopes + (stops.spread @ blocks.reshape(-1, 9)).reshape(-1, 3, 3)
    return _Tangents(slopes, right, linear and pressed is None, rows)


def _predicted(tangents: _Tangents, end: Iterate) -> tuple[Floats, Floats | None]:
    """Impulses at the end by the tangents: joints (bodies, 3), rows (rows, 3)."""
    joints, rows = end.joint_impulses, None
    if not (tangents.linear and end.response.flows is None):
        joints = tangents.right - matvec(tangents.slopes, end.joint_speeds)
    if end.rows is not None:
        assert tangents.rows is not None
        rows = end.rows.impulses
        if end.rows.slips is not None or not tangents.rows.same(end.rows):
            rows = tangents.rows.impulses(end.rows.wanted)
    return joints, rows


def _miss(end: Iterate, joints: Floats, rows: Floats | None) -> float:
    miss = 0.0
    right = end.joint_impulses
    if joints is not right:
        miss = float(np.abs(joints - right).max()) / (float(np.abs(right).max()) + _LEAST)
    if rows is not None:
        assert end.rows is not None
        right = end.rows.impulses
        if rows is not right:
            most = float(np.abs(rows).max()) + _LEAST
            miss = max(miss, float(np.abs(rows - right).max()) / most)
    return miss


def _pushes(stops: Stops, speeds: Floats) -> Floats:
    """(stops,) what each would give, above zero where it is pressed."""
    into = (speeds[stops.joints] * stops.axes).sum(axis=1)
    return -stops.gains * (into + stops.rates)


_LEAST = 1e-12
_FIRM = 1e9
"""Of what is carried, in masses of the figure."""
_UNIT = np.eye(3)
_ENOUGH = 0.1
"""Of the slope at the start: where the lowest point is near enough."""
_SEARCHES = 10
_ROUNDS = 2
"""In which contacts learn from each other how fast they slip."""
_NEARLY = 0.1
"""Miss at which they can: to settle before would be to settle what is asked anew."""
_NO_ROWS = np.zeros((0, 3))
_NO_INERTIAS = np.zeros((0, 6, 7))
