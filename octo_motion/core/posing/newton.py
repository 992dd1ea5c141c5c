# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast solver: Newton's method in the velocities that keep every joint closed.

All laws of a step (elements, stops, contacts, holds) are piecewise smooth. With each replaced by
its tangent, p = c − W w, the step is one linear system of the tree, for a row at a body adds
Xᵀ W X to that body's inertia and nothing else. Pieces on which the laws are linear (sticking,
resting, apart, below yield) are met exactly by one such solution, begun with the pieces of the
step before; a few more are needed where something starts to touch, to slip or to flow.

Contacts between two bodies of the figure would tie branches together; they are brought in after
the solution, by the Woodbury identity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rotations import Floats
from .problem import Problem, Stops
from .rows import Tangent
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
    """Linear systems solved to find it."""
    miss: float
    """Largest difference of an impulse from its law, against the largest impulse of its kind."""


@dataclass(frozen=True, eq=False)
class _Joints:
    """What elements and stops do at some velocities."""

    speeds: Floats
    """(bodies, 3) relative angular velocities, world axes."""
    impulses: Floats
    """(bodies, 3) world axes."""
    slopes: Floats
    """(bodies, 3, 3)"""
    loads: Floats
    flow: Floats | None
    linear: bool
    """Whether no element flows and no stop is near: then the tangent is the law."""


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
        impulses: Floats | None = None,
        corrections: Floats | None = None,
    ) -> Solution:
        """Velocities at the end of the step.

        Args:
            problem: the step.
            inertias: (bodies, 6, 6) spatial, about the problem's origin.
            start: (slots, 3) velocities to begin with.
            impulses: (rows, 3) to begin with, NaN where none are known.
            corrections: (rows, 3) velocities for positions alone, or None.
        """
        tree = self._tree
        rows = problem.rows
        tree.place(problem.joints)
        slots = len(tree.layout.bodies)
        composite = (tree.beyond @ inertias.reshape(-1, 36)).reshape(slots, 6, 6)
        speeds = start
        velocities = tree.velocities(speeds)
        joints = self._joints(problem, speeds)
        tangent: Tangent | None = None
        row_speeds = _NO_ROWS
        if len(rows):
            row_speeds = rows.speeds(velocities)
            tangent = rows.tangent(rows.pieces(impulses, row_speeds), row_speeds)
        mean: tuple[Floats, Floats] | None = None
        best: Solution | None = None
        for count in range(1, self._iterations + 1):
            solved = self._linear(problem, composite, joints, tangent, corrections)
            speeds = np.ascontiguousarray(solved[..., 0])
            velocities = tree.velocities(speeds)
            now = self._joints(problem, speeds)
            miss = 0.0
            if not (now.linear and joints.linear):
                change = (now.speeds - joints.speeds)[:, :, None]
                expected = joints.impulses - (joints.slopes @ change)[:, :, 0]
                miss = _relative(float(np.abs(expected - now.impulses).max()), now.impulses)
            joints = now
            pushes, pieces = _NO_ROWS, None
            if tangent is not None:
                row_speeds = rows.speeds(velocities)
                pushes = tangent.impulses(row_speeds)
                pieces = rows.pieces(pushes, row_speeds)
                miss = max(miss, _relative(pieces.miss, pushes))
            if best is None or miss < best.miss:
                moving = speeds if corrections is None else solved[..., 1]
                best = Solution(
                    speeds, velocities, moving, now.loads, now.flow, pushes, count, miss
                )
            if miss <= self._tolerance:
                break
            if pieces is None:
                continue
            if count > 1:
                # Contacts that change their minds by turns settle on what they think on average.
                mean = (pushes, row_speeds) if mean is None else _mixed(mean, pushes, row_speeds)
                pieces, row_speeds = rows.pieces(*mean), mean[1]
            tangent = rows.tangent(pieces, row_speeds)
        assert best is not None
        return best

    def _joints(self, problem: Problem, speeds: Floats) -> _Joints:
        joint_speeds = speeds[self._tree.joint_slot]
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
        linear = response.flow is None and not problem.stops
        return _Joints(joint_speeds, impulses, slopes, response.load, response.flow, linear)

    def _linear(
        self,
        problem: Problem,
        composite: Floats,
        joints: _Joints,
        tangent: Tangent | None,
        corrections: Floats | None,
    ) -> Floats:
        """(slots, 3, columns) solution with all laws replaced by their tangents."""
        tree = self._tree
        rows = problem.rows
        columns = 1 if corrections is None else 2
        momenta = np.empty((len(problem.momenta), 6, columns))
        momenta[:] = problem.momenta[:, :, None]
        right = tree.along(momenta)
        paired = rows.paired
        symmetric = True
        if tangent is not None:
            slopes = tangent.slopes
            symmetric = tangent.symmetric
            pulls = np.empty((len(rows), 3, columns))
            # w is the velocity less the target: c − W w = (c + W target) − W X V.
            pulls[:, :, 0] = tangent.offsets
            if not rows.still:
                pulls[:, :, 0] += (slopes @ rows.targets[:, :, None])[:, :, 0]
            if corrections is not None:
                pulls[:, :, 1] = pulls[:, :, 0] + (slopes @ corrections[:, :, None])[:, :, 0]
            if len(paired):
                slopes = slopes.copy()
                slopes[paired] = 0.0
            turned = rows.reach.transpose(0, 2, 1)
            blocks = turned @ slopes @ rows.reach
            chain = tree.beyond[:, rows.bodies]
            composite = composite + (chain @ blocks.reshape(-1, 36)).reshape(-1, 6, 6)
            pushes = turned @ pulls
            right += tree.motion @ (chain @ pushes.reshape(len(rows), -1)).reshape(-1, 6, columns)
            if len(paired):
                chain = tree.beyond[:, rows.others[paired]]
                against = chain @ pushes[paired].reshape(len(paired), -1)
                right -= tree.motion @ against.reshape(-1, 6, columns)
        slopes = joints.slopes
        self._joint_blocks[tree.joint_slot] = slopes
        self._joint_right[tree.joint_slot] = (
            joints.impulses + (slopes @ joints.speeds[:, :, None])[:, :, 0]
        )
        right += self._joint_right[:, :, None]
        tree.assemble(composite, self._joint_blocks, symmetric=symmetric)
        if tangent is not None and len(paired):
            return self._with_pairs(problem, tangent, right)
        return tree.solve(right)

    def _with_pairs(self, problem: Problem, tangent: Tangent, right: Floats) -> Floats:
        """The solution with contacts between bodies of the figure.

        (H + JᵀWJ)⁻¹ r = y − Z (1 + W J Z)⁻¹ W J y with y = H⁻¹ r and Z = H⁻¹ Jᵀ.
        """
        tree = self._tree
        rows = problem.rows
        paired = rows.paired
        slopes = tangent.slopes[paired]
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


def _add_stops(stops: Stops, step: float, speeds: Floats, impulses: Floats, slopes: Floats) -> None:
    """Add a set of stops to the impulses and slopes of the joints."""
    into = (speeds[stops.joints] * stops.axes).sum(axis=1)
    push = -stops.gains * (into + np.maximum(stops.gaps, 0.0) / step)
    stiff = np.where(push >= 0.0, stops.gains, 0.0)
    np.maximum(push, 0.0, out=push)
    impulses[stops.joints] += push[:, None] * stops.axes
    slopes[stops.joints] += stiff[:, None, None] * (stops.axes[:, :, None] * stops.axes[:, None, :])


def _relative(miss: float, impulses: Floats) -> float:
    return miss / (float(np.abs(impulses).max()) + _LEAST)


def _mixed(mean: tuple[Floats, Floats], impulses: Floats, speeds: Floats) -> tuple[Floats, Floats]:
    old_impulses, old_speeds = mean
    return (
        old_impulses + _NEWS * (impulses - old_impulses),
        old_speeds + _NEWS * (speeds - old_speeds),
    )


_LEAST = 1e-12
_NEWS = 0.6
"""Share of the newest impulses and velocities in their running mean."""
_NO_ROWS = np.zeros((0, 3))
