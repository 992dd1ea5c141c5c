# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's own way to solve a step: projected Gauss–Seidel on every row [Plastic, eq. 11–15,
28–33], plain and slow. Tests hold the fast solver against it; nothing else uses it.

Bodies have six velocities each and joints are rows, so nothing here is shared with the fast solver
but the question. Row by row, the impulse is set to what its law asks with all others as they are:

    ball joint   w = 0                                                       (eq. 14)
    element      w + C λ + D q_f = (τ/D_d) s, the right side 0 where the source has no threshold
                                                                             (eq. 25, 31)
    stop         p = max(0, −a (w + g/h))                                    (eq. 15, softened)
    contact      p = the nearest point of the friction cone to b − a (w + g/h n)
    hold         p = the nearest point of a ball to bias − a w
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from octo_motion.core.posing.solver.problem import Problem
from octo_motion.core.rotations import Floats
from octo_motion.core.rotations.small_batches import skew


@dataclass(eq=False)
class _Block:
    """Up to three rows that are set together: their Jacobian on one body or two."""

    bodies: tuple[int, ...]
    jacobians: tuple[Floats, ...]
    """(rows, 6) each, on velocity of the centre of mass and angular velocity."""
    law: Callable[[Floats, Floats, Floats], Floats]
    """New impulse of (w, A, impulse): w as it is, A its own response, the impulse so far."""
    target: Floats
    """(rows,) taken from w."""
    impulse: Floats
    spread: tuple[Floats, ...] = ()
    own: Floats = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class Velocities:
    """What a step leads to."""

    velocities: Floats
    """(bodies, 6) spatial, angular first, about the problem's origin."""
    sweeps: int
    change: float
    """Largest change of an impulse in the last sweep, against the largest impulse."""
    impulses: list[Floats]
    """Of the blocks of rows, for the next step to start from."""


def solve(
    problem: Problem,
    parents: Sequence[int],
    *,
    sweeps: int = 20_000,
    tolerance: float = 1e-12,
    start: Sequence[Floats] = (),
) -> Velocities:
    """Velocities at the end of a step by Gauss–Seidel sweeps over all rows.

    Args:
        problem: the step.
        parents: of the figure.
        sweeps: at most so many.
        tolerance: change of the impulses in a sweep, against the largest, at which it ends.
        start: impulses of the step before, warm as the source has it; none, or of other rows: cold.
    """
    count = len(parents)
    inverse = np.zeros((count, 6, 6))
    inverse[:, :3, :3] = np.eye(3) / problem.masses[:, None, None]
    around = problem.masses[:, None, None] * (problem.skewed @ problem.skewed)
    inverse[:, 3:, 3:] = np.linalg.inv(problem.spatial[:, :3, :3] + around)
    linear = problem.momenta[:, 3:]
    spin = problem.momenta[:, :3] - np.cross(problem.centres, linear)
    velocities = (inverse @ np.concatenate([linear, spin], axis=1)[:, :, None])[:, :, 0]
    blocks = [
        *_joints(problem, parents),
        *_elements(problem, parents),
        *_stops(problem, parents),
        *_contacts(problem),
        *_holds(problem),
    ]
    for block in blocks:
        pairs = list(zip(block.bodies, block.jacobians, strict=True))
        block.spread = tuple(inverse[body] @ jacobian.T for body, jacobian in pairs)
        own = [
            jacobian @ spread
            for jacobian, spread in zip(block.jacobians, block.spread, strict=True)
        ]
        block.own = np.sum(own, axis=0)
    if [len(each) for each in start] == [len(block.impulse) for block in blocks]:
        for block, impulse in zip(blocks, start, strict=True):
            block.impulse = impulse
            for body, spread in zip(block.bodies, block.spread, strict=True):
                velocities[body] += spread @ impulse
    change = np.inf
    done = 0
    while done < sweeps and change > tolerance:
        done += 1
        largest = moved = 0.0
        for block in blocks:
            w = -block.target
            for body, jacobian in zip(block.bodies, block.jacobians, strict=True):
                w = w + jacobian @ velocities[body]
            new = block.law(w, block.own, block.impulse)
            difference = new - block.impulse
            block.impulse = new
            for body, spread in zip(block.bodies, block.spread, strict=True):
                velocities[body] += spread @ difference
            moved = max(moved, float(np.abs(difference).max()))
            largest = max(largest, float(np.abs(new).max()))
        change = moved / (largest + 1e-300)
    result = np.empty((count, 6))
    result[:, :3] = velocities[:, 3:]
    result[:, 3:] = velocities[:, :3] + np.cross(problem.centres, velocities[:, 3:])
    return Velocities(result, done, change, [block.impulse for block in blocks])


def _point(problem: Problem, body: int, place: Floats) -> Floats:
    """(3, 6) from a body's velocities to that of a point of it."""
    arm = place - problem.centres[body]
    return np.concatenate([np.eye(3), skew(-arm[None])[0]], axis=1)


_TURN = np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1)


def _joints(problem: Problem, parents: Sequence[int]) -> list[_Block]:
    def closed(w: Floats, own: Floats, impulse: Floats) -> Floats:
        return impulse - np.linalg.solve(own, w)

    blocks: list[_Block] = []
    for body, parent in enumerate(parents):
        if parent >= 0:
            place = problem.joints[body]
            jacobians = (_point(problem, body, place), -_point(problem, parent, place))
            blocks.append(_Block((body, parent), jacobians, closed, np.zeros(3), np.zeros(3)))
    return blocks


def _elements(problem: Problem, parents: Sequence[int]) -> list[_Block]:
    blocks: list[_Block] = []
    law, h = problem.law, problem.step
    for body, parent in enumerate(parents):
        if not law.backward[body]:
            continue
        bodies, jacobians = ((body,), (_TURN,))
        if parent >= 0:
            bodies, jacobians = (body, parent), (_TURN, -_TURN)

        def bears(w: Floats, own: Floats, impulse: Floats, *, body: int = body) -> Floats:
            stiffness, backward = law.stiffness[body], law.backward[body]
            spring, limit = problem.springs[body], law.yield_torque[body]
            result = impulse.copy()
            # Which side of the threshold, and which way: as the sweep finds it now.
            load = -stiffness * spring - backward * w
            size = float(np.sqrt(load @ load))
            flows = limit == 0.0 or size > limit
            share = backward * law.compliance[body]
            kept = 1.0 - share if flows else 1.0
            held = np.zeros(3)
            if flows and limit > 0.0:
                held = share * limit * load / size
            for axis in range(3):
                # λ = held + kept (−K q − G w) and w = w₀ + A P with P = h λ.
                without = w[axis] + own[axis] @ (result - impulse) - own[axis, axis] * result[axis]
                slope = kept * backward
                rest = held[axis] - kept * stiffness * spring[axis]
                result[axis] = h * (rest - slope * without) / (1.0 + h * slope * own[axis, axis])
            return result

        blocks.append(_Block(bodies, jacobians, bears, np.zeros(3), np.zeros(3)))
    return blocks


def _stops(problem: Problem, parents: Sequence[int]) -> list[_Block]:
    blocks: list[_Block] = []
    for stops in problem.stops:
        for joint, axis, rate, gain in zip(
            stops.joints, stops.axes, stops.rates.tolist(), stops.gains, strict=True
        ):

            def holds(
                w: Floats, own: Floats, impulse: Floats, *, rate: float = rate, gain: float = gain
            ) -> Floats:
                without = w - own[0] * impulse
                return np.maximum(-gain * (without + rate) / (1.0 + gain * own[0]), 0.0)

            row = (axis @ _TURN)[None]
            blocks.append(
                _Block(
                    (int(joint), parents[int(joint)]), (row, -row), holds, np.zeros(1), np.zeros(1)
                )
            )
    return blocks


def _contacts(problem: Problem) -> list[_Block]:
    rows, contacts = problem.rows, problem.rows.contacts
    blocks: list[_Block] = []
    for number in range(len(contacts)):
        normal, gain = contacts.normals[number], rows.gains[number]
        before = np.zeros(3) if rows.grips is None else rows.grips[number]
        friction, rate = rows.pattern.friction, rows.rates[number]

        def presses(
            w: Floats,
            own: Floats,
            impulse: Floats,
            *,
            normal: Floats = normal,
            gain: float = gain,
            before: Floats = before,
            friction: float = friction,
            rate: float = rate,
        ) -> Floats:
            scale = 1.0 / (np.linalg.eigvalsh(own)[-1] + 1.0 / gain)
            result = impulse
            for _ in range(5):
                speed = w + own @ (result - impulse) + rate * normal
                result = _in_cone(
                    result - scale * (speed + (result - before) / gain), normal, friction
                )
            return result

        place = rows.places[number]
        body, other = int(rows.bodies[number]), int(rows.others[number])
        bodies, jacobians = (body,), (_point(problem, body, place),)
        if other >= 0:
            bodies, jacobians = (body, other), (*jacobians, -_point(problem, other, place))
        blocks.append(_Block(bodies, jacobians, presses, np.zeros(3), np.zeros(3)))
    return blocks


def _holds(problem: Problem) -> list[_Block]:
    rows, holds = problem.rows, problem.rows.holds
    blocks: list[_Block] = []
    if holds is None:
        return blocks
    for number in range(len(holds)):
        gain, bias, bound = holds.gains[number], holds.biases[number], holds.bounds[number]

        def pulls(
            w: Floats,
            own: Floats,
            impulse: Floats,
            *,
            gain: float = gain,
            bias: Floats = bias,
            bound: float = bound,
        ) -> Floats:
            scale = 1.0 / (np.linalg.eigvalsh(own)[-1] + 1.0 / gain)
            result = impulse
            for _ in range(5):
                speed = w + own @ (result - impulse)
                result = result - scale * (speed + (result - bias) / gain)
                size = float(np.sqrt(result @ result))
                result = result * min(1.0, bound / max(size, 1e-300))
            return result

        body = int(holds.bodies[number])
        jacobian = _point(problem, body, rows.places[rows.count + number])
        if holds.turns[number]:
            jacobian = _TURN
        blocks.append(_Block((body,), (jacobian,), pulls, np.zeros(3), np.zeros(3)))
    return blocks


def _in_cone(impulse: Floats, normal: Floats, friction: float) -> Floats:
    """The nearest point of the cone |p_t| ≤ μ p_n."""
    push = float(impulse @ normal)
    across = impulse - push * normal
    size = float(np.sqrt(across @ across))
    if size <= friction * push:
        return impulse
    if friction * size <= -push:
        return np.zeros(3)
    load = (push + friction * size) / (1.0 + friction**2)
    return load * normal + friction * load * across / size
