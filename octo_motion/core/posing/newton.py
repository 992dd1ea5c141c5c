# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast solver: Newton's method in the velocities that keep every joint closed.

All laws of a step (elements, stops, contacts, holds) give an impulse that falls as the velocity
grows. With impulses replaced by their tangents at the velocities at hand, p ≈ p_k − W (w − w_k),
the step is one linear system of the tree, for a row at a body adds Xᵀ W X to that body's inertia
and nothing else. Pieces on which the laws are linear (sticking, resting, apart, below yield) are
met exactly by one such solution, begun with the pieces of the step before; a few more are needed
where something starts to touch, to slip or to flow. Friction's bound μ p_n is that of the
iteration before, which makes every iteration the search for the lowest point of a convex function.

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
    flow: Floats
    """(bodies, 3) w_d, in the problem's axes."""
    impulses: Floats
    """(rows, 3)"""
    iterations: int
    converged: bool


@dataclass(frozen=True, eq=False)
class _Tangent:
    """The laws at some velocities, and their slopes."""

    speeds: Floats
    velocities: Floats
    joint_speeds: Floats
    row_speeds: Floats
    rows: Answer
    loads: Floats
    flow: Floats
    joint_impulses: Floats
    """(bodies, 3) of elements and stops, world axes."""
    joint_slopes: Floats
    """(bodies, 3, 3)"""


@dataclass(eq=False)
class _Trial:
    tangent: _Tangent
    moving: Floats
    converged: bool


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
        self, problem: Problem, inertias: Floats, start: Floats, corrections: Floats | None
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
        columns = 1 if corrections is None else 2
        tangent = self._tangent(problem, start)
        limits: Floats | None = None
        trial = _Trial(tangent, start, converged=False)
        count = 0
        while count < self._iterations and not trial.converged:
            count += 1
            if count == _WHOLE_STEPS + 1 and len(problem.rows.contacts):
                # Not settled: friction at bounds that hold for one iteration each, and no step
                # beyond the lowest point. The first without friction, for a load to begin with.
                limits = np.zeros(len(problem.rows.contacts))
                tangent = self._tangent(problem, tangent.speeds, limits)
            trial = self._iterate(problem, composite, tangent, corrections, limits)
            if limits is not None:
                if trial.converged:
                    bounds = self._friction_bounds(problem, trial.tangent)
                    change = np.abs(bounds - limits).max()
                    trial.converged = bool(
                        change <= self._tolerance * (np.abs(bounds).max() + _LEAST)
                    )
                    limits = bounds
                    trial.tangent = self._tangent(problem, trial.tangent.speeds, limits)
                else:
                    shorter = self._shortened(problem, tangent, trial.tangent, inertias, limits)
                    trial.tangent = self._tangent(problem, shorter, limits)
            tangent = trial.tangent
        return Solution(
            tangent.speeds,
            tangent.velocities,
            tangent.speeds if corrections is None else trial.moving,
            tangent.loads,
            tangent.flow,
            tangent.rows.impulses,
            count,
            trial.converged,
        )

    def _iterate(
        self,
        problem: Problem,
        composite: Floats,
        tangent: _Tangent,
        corrections: Floats | None,
        limits: Floats | None,
    ) -> _Trial:
        """One linear system, and the laws at its solution."""
        columns = 1 if corrections is None else 2
        solved = self._linear(problem, composite, tangent, corrections, columns)
        after = self._tangent(problem, np.ascontiguousarray(solved[..., 0]), limits)
        return _Trial(after, solved[..., -1], converged=self._agrees(tangent, after))

    @staticmethod
    def _friction_bounds(problem: Problem, tangent: _Tangent) -> Floats:
        contacts = problem.rows.contacts
        loads = (tangent.rows.impulses[: len(contacts)] * contacts.normals).sum(axis=1)
        return contacts.friction * loads

    def _tangent(self, problem: Problem, speeds: Floats, limits: Floats | None = None) -> _Tangent:
        tree = self._tree
        velocities = tree.velocities(speeds)
        rows = problem.rows
        row_speeds = rows.speeds(velocities) if len(rows) else _NO_ROWS
        answer = rows.answer(row_speeds, limits) if len(rows) else _NO_ANSWER
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
            _add_stops(stops, problem.step, joint_speeds, impulses, slopes)
        return _Tangent(
            speeds,
            velocities,
            joint_speeds,
            row_speeds,
            answer,
            response.load,
            response.flow,
            impulses,
            slopes,
        )

    def _linear(
        self,
        problem: Problem,
        composite: Floats,
        tangent: _Tangent,
        corrections: Floats | None,
        columns: int,
    ) -> Floats:
        """(slots, 3, columns) solution with all laws replaced by their tangents."""
        tree = self._tree
        rows = problem.rows
        momenta = np.empty((len(problem.momenta), 6, columns))
        momenta[:] = problem.momenta[:, :, None]
        paired = rows.paired
        if len(rows):
            slopes = tangent.rows.slopes
            pulls = np.empty((len(rows), 3, columns))
            pulls[:] = (tangent.rows.impulses + (slopes @ tangent.row_speeds[:, :, None])[:, :, 0])[
                :, :, None
            ]
            # Targets are part of w: what the obstacle's own motion adds.
            if columns == 2:
                assert corrections is not None
                pulls[:, :, 1] += (slopes @ corrections[:, :, None])[:, :, 0]
            pulls += slopes @ rows.targets[:, :, None]
            reach = rows.reach
            if len(paired):
                slopes = slopes.copy()
                slopes[paired] = 0.0
            turned = reach.transpose(0, 2, 1)
            blocks = turned @ slopes @ reach
            chain = tree.beyond[:, rows.bodies]
            composite = composite + (chain @ blocks.reshape(-1, 36)).reshape(-1, 6, 6)
            pushes = turned @ pulls
            right = tree.along(momenta)
            right += tree.motion @ (chain @ pushes.reshape(len(rows), -1)).reshape(-1, 6, columns)
            if len(paired):
                against = tree.beyond[:, rows.others[paired]] @ pushes[paired].reshape(
                    len(paired), -1
                )
                right -= tree.motion @ against.reshape(-1, 6, columns)
        else:
            right = tree.along(momenta)
        joint = (
            tangent.joint_impulses
            + (tangent.joint_slopes @ tangent.joint_speeds[:, :, None])[:, :, 0]
        )
        self._joint_blocks[tree.joint_slot] = tangent.joint_slopes
        self._joint_right[tree.joint_slot] = joint
        right += self._joint_right[:, :, None]
        tree.assemble(composite, self._joint_blocks, symmetric=tangent.rows.symmetric)
        if len(paired):
            return self._with_pairs(problem, tangent, right)
        return tree.solve(right)

    def _with_pairs(self, problem: Problem, tangent: _Tangent, right: Floats) -> Floats:
        """The solution with contacts between bodies of the figure, which tie branches together.

        (H + JᵀWJ)⁻¹ r = y − Z (1 + W J Z)⁻¹ W J y with y = H⁻¹ r and Z = H⁻¹ Jᵀ.
        """
        tree = self._tree
        rows = problem.rows
        paired = rows.paired
        slopes = tangent.rows.slopes[paired]
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

    def _agrees(self, tangent: _Tangent, after: _Tangent) -> bool:
        """Whether the laws at the solution are what their tangents said they would be."""
        joints = (
            tangent.joint_impulses
            - (tangent.joint_slopes @ (after.joint_speeds - tangent.joint_speeds)[:, :, None])[
                :, :, 0
            ]
        )
        wanted = after.joint_impulses
        if np.abs(joints - wanted).max() > self._tolerance * (np.abs(wanted).max() + _LEAST):
            return False
        if not len(after.row_speeds):
            return True
        rows = self._predicted(tangent, after)
        wanted = after.rows.impulses
        return bool(
            np.abs(rows - wanted).max() <= self._tolerance * (np.abs(wanted).max() + _LEAST)
        )

    @staticmethod
    def _predicted(tangent: _Tangent, after: _Tangent) -> Floats:
        change = after.row_speeds - tangent.row_speeds
        return tangent.rows.impulses - (tangent.rows.slopes @ change[:, :, None])[:, :, 0]

    def _shortened(
        self,
        problem: Problem,
        tangent: _Tangent,
        after: _Tangent,
        inertias: Floats,
        limits: Floats,
    ) -> Floats:
        """The lowest point between two velocities, where a whole step has not settled.

        Along the way d the slope of the convex function is
        d·(M(u − u*) − Jᵀp); at the end M(u − u*) is what the tangents gave.
        """
        way = after.speeds - tangent.speeds
        row_way = after.row_speeds - tangent.row_speeds
        joint_way = after.joint_speeds - tangent.joint_speeds
        body_way = after.velocities - tangent.velocities
        mass = float((body_way * (inertias @ body_way[:, :, None])[:, :, 0]).sum())
        pull = float((self._predicted(tangent, after) * row_way).sum())
        joints = tangent.joint_impulses - (tangent.joint_slopes @ joint_way[:, :, None])[:, :, 0]
        pull += float((joints * joint_way).sum())

        def slope(share: float) -> float:
            at = self._tangent(problem, tangent.speeds + share * way, limits)
            value = pull - (1.0 - share) * mass - float((at.joint_impulses * joint_way).sum())
            return value - float((at.rows.impulses * row_way).sum())

        low, high = 0.0, 1.0
        at_high = slope(high)
        if at_high <= 0.0:
            return after.speeds
        at_low = min(slope(low), -1e-300)
        share = 0.5
        for _ in range(8):
            share = low + (high - low) * min(max(at_low / (at_low - at_high), 0.1), 0.9)
            value = slope(share)
            if abs(value) <= 1e-2 * abs(at_low):
                break
            if value > 0.0:
                high, at_high = share, value
            else:
                low, at_low = share, value
        return tangent.speeds + share * way


def _add_stops(stops: Stops, step: float, speeds: Floats, impulses: Floats, slopes: Floats) -> None:
    """Add a set of stops to the impulses and slopes of the joints."""
    into = (speeds[stops.joints] * stops.axes).sum(axis=1)
    push = -stops.gains * (into + np.maximum(stops.gaps, 0.0) / step)
    stiff = np.where(push >= 0.0, stops.gains, 0.0)
    np.maximum(push, 0.0, out=push)
    impulses[stops.joints] += push[:, None] * stops.axes
    slopes[stops.joints] += stiff[:, None, None] * (stops.axes[:, :, None] * stops.axes[:, None, :])


_LEAST = 1e-12
_WHOLE_STEPS = 8
"""Of Newton's method with friction's bound as part of it, before the careful way."""
_NO_ROWS = np.zeros((0, 3))
_NO_ANSWER = Answer(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, dtype=bool), symmetric=True)
