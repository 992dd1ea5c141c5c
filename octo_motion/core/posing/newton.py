# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast solver: Newton's method in the velocities that keep every joint closed.

All laws of a step (elements, stops, contacts, holds) give an impulse that falls as its velocity
grows, the slope of a convex function ℓ. The velocities at the step's end are the lowest point of

    ½ (u − u*)ᵀ SᵀMS (u − u*) + Σ ℓ(w),      Sᵀ M (v + h f) = SᵀMS u*

With impulses replaced by their tangents, p ≈ p_k − W (w − w_k), that is one linear system of the
tree, for a row at a body adds Xᵀ W X to that body's inertia and nothing else. Where the laws are
linear (sticking, resting, apart, below yield) a single solution is exact, begun with the velocities
of the step before; a few more are needed where something starts to touch, to slip or to flow. No
step goes beyond the lowest point on its way, so that it always arrives.

Contacts between two bodies of the figure would tie branches together; they are brought in after
the solution, by the Woodbury identity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rotations import Floats
from .problem import Problem, Stops
from .rows import Answer
from .tree import Tree


@dataclass(frozen=True, eq=False)
class Solution:
    """Velocities and impulses after a step."""

    speeds: Floats
    """(slots, 3) u."""
    velocities: Floats
    """(bodies, 6) V."""
    moving: Floats
    """(slots, 3) u with which positions move: with corrections that are not kept."""
    loads: Floats
    """(bodies, 3) λ of the elements, in the problem's axes."""
    flow: Floats | None
    """(bodies, 3) w_d, in the problem's axes; None where nothing flows."""
    impulses: Floats
    """(rows, 3)"""
    iterations: int
    """Linear systems solved."""
    miss: float
    """Largest difference of an impulse from its law, against the largest impulse of its kind."""


@dataclass(frozen=True, eq=False)
class _Point:
    """Velocities, and what all laws do there."""

    speeds: Floats
    """(slots, 3) u."""
    velocities: Floats
    """(bodies, 6)"""
    joint_speeds: Floats
    """(bodies, 3) relative angular velocities, world axes."""
    joint_impulses: Floats
    """(bodies, 3) of elements and stops, world axes."""
    joint_slopes: Floats
    """(bodies, 3, 3)"""
    loads: Floats
    flow: Floats | None
    linear: bool
    """Whether no element flows and no stop is near: then the joints' tangent is their law."""
    row_speeds: Floats
    """(rows, 3)"""
    rows: Answer | None


class Newton:
    """Solves the problems of one figure."""

    def __init__(self, tree: Tree, *, tolerance: float, iterations: int) -> None:
        self._tree = tree
        self._tolerance = tolerance
        self._iterations = iterations
        slots = len(tree.layout.bodies)
        self._joint_blocks = np.zeros((slots, 3, 3))
        self._joint_right = np.zeros((slots, 3))

    def solve(
        self,
        problem: Problem,
        inertias: Floats,
        start: Floats,
        corrections: Floats | None = None,
    ) -> Solution:
        """Velocities at the end of the step.

        Args:
            problem: the step.
            inertias: (bodies, 6, 6) spatial, about the problem's origin.
            start: (slots, 3) velocities to begin with.
            corrections: (rows, 3) velocities for positions alone, or None.
        """
        tree = self._tree
        tree.place(problem.joints)
        slots = len(tree.layout.bodies)
        composite = (tree.beyond @ inertias.reshape(-1, 36)).reshape(slots, 6, 6)
        rows = problem.rows
        point = self._at(problem, start)
        shift: Floats | None = None
        miss = np.inf
        count = rounds = 0
        while count < self._iterations:
            if miss <= self._tolerance:
                # Where slipping began or ended in a blow, once more with the speed that is left.
                rounds += 1
                none = point.rows is None or point.rows.slips is None
                if rounds > _ROUNDS or not rows.follow(
                    point.row_speeds, problem.blow, slips_none=none
                ):
                    break
                point = self._at(problem, point.speeds)
            count += 1
            slopes = None if point.rows is None else problem.rows.slopes(point.rows)
            solved = self._linear(problem, composite, point, slopes, corrections)
            if corrections is not None:
                shift = solved[..., 1] - solved[..., 0]
            end = self._at(problem, np.ascontiguousarray(solved[..., 0]))
            joints, pushes = _predicted(point, end, slopes)
            miss = _miss(end, joints, pushes)
            if miss > self._tolerance:
                end = self._lowest(problem, inertias, point, end, joints, pushes)
            point = end
        return Solution(
            point.speeds,
            point.velocities,
            # Added to what was settled on, which need not be where the last system led.
            point.speeds if shift is None else point.speeds + shift,
            point.loads,
            point.flow,
            _NO_ROWS if point.rows is None else point.rows.impulses,
            count,
            miss,
        )

    def _at(self, problem: Problem, speeds: Floats) -> _Point:
        """All laws at u (slots, 3)."""
        tree = self._tree
        velocities = tree.velocities(speeds)
        joint_speeds = speeds[tree.joint_slot]
        frames = problem.frames
        if frames is None:
            response = problem.law.respond(problem.springs, joint_speeds)
            impulses = problem.step * response.load
            slopes = problem.step * response.slope
        else:
            seen = (joint_speeds[:, None, :] @ frames)[:, 0]
            response = problem.law.respond(problem.springs, seen)
            impulses = problem.step * (frames @ response.load[:, :, None])[:, :, 0]
            slopes = problem.step * (frames @ response.slope @ frames.transpose(0, 2, 1))
        for stops in problem.stops:
            _add_stops(stops, joint_speeds, impulses, slopes)
        rows = problem.rows
        row_speeds, answer = _NO_ROWS, None
        if len(rows.bodies):
            row_speeds = rows.speeds(velocities)
            answer = rows.answer(row_speeds)
        return _Point(
            speeds,
            velocities,
            joint_speeds,
            impulses,
            slopes,
            response.load,
            response.flow,
            response.flow is None and not problem.stops,
            row_speeds,
            answer,
        )

    def _linear(
        self,
        problem: Problem,
        composite: Floats,
        point: _Point,
        slopes: Floats | None,
        corrections: Floats | None,
    ) -> Floats:
        """(slots, 3, columns) solution with all laws replaced by their tangents."""
        tree = self._tree
        rows = problem.rows
        paired = rows.paired
        columns = 1 if corrections is None else 2
        momenta = np.empty((len(problem.momenta), 6, columns))
        momenta[:] = problem.momenta[:, :, None]
        right = tree.along(momenta)
        if slopes is not None:
            assert point.rows is not None
            # p_k + W w_k − W w, with w the velocity less the target.
            at = point.row_speeds if rows.still else point.row_speeds + rows.targets
            pulls = np.empty((len(slopes), 3, columns))
            pulls[:, :, 0] = point.rows.impulses + (slopes @ at[:, :, None])[:, :, 0]
            if corrections is not None:
                pulls[:, :, 1] = pulls[:, :, 0] + (slopes @ corrections[:, :, None])[:, :, 0]
            alone = slopes
            if len(paired):
                alone = slopes.copy()
                alone[paired] = 0.0
            turned = rows.reach.transpose(0, 2, 1)
            blocks = turned @ alone @ rows.reach
            chain = tree.beyond[:, rows.bodies]
            composite = composite + (chain @ blocks.reshape(-1, 36)).reshape(-1, 6, 6)
            pushes = turned @ pulls
            right += tree.motion @ (chain @ pushes.reshape(len(slopes), -1)).reshape(-1, 6, columns)
            if len(paired):
                chain = tree.beyond[:, rows.others[paired]]
                against = chain @ pushes[paired].reshape(len(paired), -1)
                right -= tree.motion @ against.reshape(-1, 6, columns)
        stiff = point.joint_slopes
        self._joint_blocks[tree.joint_slot] = stiff
        self._joint_right[tree.joint_slot] = (
            point.joint_impulses + (stiff @ point.joint_speeds[:, :, None])[:, :, 0]
        )
        right += self._joint_right[:, :, None]
        tree.assemble(composite, self._joint_blocks)
        if slopes is not None and len(paired):
            return self._with_pairs(problem, slopes, right)
        return tree.solve(right)

    def _with_pairs(self, problem: Problem, slopes: Floats, right: Floats) -> Floats:
        """The solution with contacts between bodies of the figure.

        (H + JᵀWJ)⁻¹ r = y − Z (1 + W J Z)⁻¹ W J y with y = H⁻¹ r and Z = H⁻¹ Jᵀ.
        """
        tree = self._tree
        rows = problem.rows
        paired = rows.paired
        slopes = slopes[paired]
        loaded = slopes.any(axis=(1, 2))
        paired, slopes = paired[loaded], slopes[loaded]
        if not len(paired):
            return tree.solve(right)
        count, columns = len(paired), right.shape[-1]
        # (slots, 3, 3 count): Sᵀ Xᵀ, with a sign for which of the two bodies a slot moves.
        signs = tree.beyond[:, rows.bodies[paired]] - tree.beyond[:, rows.others[paired]]
        wide = rows.reach[paired].transpose(2, 0, 1).reshape(6, 3 * count)
        spread = tree.motion @ wide
        spread *= np.repeat(signs, 3, axis=1)[:, None, :]
        both = tree.solve(np.concatenate([spread, right], axis=2))
        flat = spread.reshape(-1, 3 * count)
        response = flat.T @ both.reshape(len(flat), -1)
        weighted = (slopes @ response.reshape(count, 3, -1)).reshape(3 * count, -1)
        inner = weighted[:, : 3 * count].copy()
        inner[np.arange(3 * count), np.arange(3 * count)] += 1.0
        pull = np.linalg.solve(inner, weighted[:, 3 * count :])
        result = both[:, :, 3 * count :] - both[:, :, : 3 * count] @ pull
        return result.reshape(-1, 3, columns)

    def _lowest(  # noqa: PLR0917
        self,
        problem: Problem,
        inertias: Floats,
        start: _Point,
        end: _Point,
        joints: Floats,
        rows: Floats | None,
    ) -> _Point:
        """The lowest point of the convex function between two, or a little before the end.

        Along the way d its slope is d·SᵀMS(u − u*) − Σ p·dw. At the end the first part is what
        the tangents' impulses do along the way, and it is linear before.
        """
        joint_way = end.joint_speeds - start.joint_speeds
        row_way = end.row_speeds - start.row_speeds
        body_way = end.velocities - start.velocities
        mass = float((body_way * (inertias @ body_way[:, :, None])[:, :, 0]).sum())
        pull = float((joints * joint_way).sum())
        if rows is not None:
            pull += float((rows * row_way).sum())

        def slope(at: _Point, share: float) -> float:
            value = pull - (1.0 - share) * mass - float((at.joint_impulses * joint_way).sum())
            if at.rows is not None:
                value -= float((at.rows.impulses * row_way).sum())
            return value

        low, high = 0.0, 1.0
        at_low, at_high = slope(start, low), slope(end, high)
        if at_high <= _ENOUGH * abs(at_low) or at_low >= 0.0:
            return end
        best = end
        for _ in range(_SEARCHES):
            # False position, kept away from the ends: the slope may jump.
            share = low + (high - low) * min(max(at_low / (at_low - at_high), 0.1), 0.9)
            best = self._at(problem, start.speeds + share * (end.speeds - start.speeds))
            value = slope(best, share)
            if abs(value) <= _ENOUGH * abs(at_low):
                break
            if value > 0.0:
                high, at_high = share, value
            else:
                low, at_low = share, value
        return best


def _predicted(start: _Point, end: _Point, slopes: Floats | None) -> tuple[Floats, Floats | None]:
    """Impulses at the end by the tangents at the start: joints (bodies, 3), rows (rows, 3)."""
    change = (end.joint_speeds - start.joint_speeds)[:, :, None]
    joints = start.joint_impulses - (start.joint_slopes @ change)[:, :, 0]
    if slopes is None:
        return joints, None
    assert start.rows is not None
    change = (end.row_speeds - start.row_speeds)[:, :, None]
    return joints, start.rows.impulses - (slopes @ change)[:, :, 0]


def _miss(end: _Point, joints: Floats, rows: Floats | None) -> float:
    miss = 0.0
    if not end.linear:
        right = end.joint_impulses
        miss = float(np.abs(joints - right).max()) / (float(np.abs(right).max()) + _LEAST)
    if rows is not None:
        assert end.rows is not None
        right = end.rows.impulses
        miss = max(miss, float(np.abs(rows - right).max()) / (float(np.abs(rows).max()) + _LEAST))
    return miss


def _add_stops(stops: Stops, speeds: Floats, impulses: Floats, slopes: Floats) -> None:
    """Add a set of stops to the impulses and slopes of the joints."""
    axes = stops.axes
    push = -stops.gains * ((speeds[stops.joints] * axes).sum(axis=1) + stops.rates)
    pressed = push >= 0.0
    if pressed.any():
        impulses += stops.spread @ (np.maximum(push, 0.0)[:, None] * axes)
        stiff = np.where(pressed, stops.gains, 0.0)[:, None] * axes
        blocks = stiff[:, :, None] * axes[:, None, :]
        slopes += (stops.spread @ blocks.reshape(-1, 9)).reshape(-1, 3, 3)


_LEAST = 1e-12
_ENOUGH = 0.1
"""Of the slope at the start: where the lowest point is near enough."""
_SEARCHES = 6
_ROUNDS = 2
"""In which contacts learn from each other how fast they slip."""
_NO_ROWS = np.zeros((0, 3))
