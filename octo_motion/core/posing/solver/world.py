# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulated puppet: what a session holds on to.

A step of length h goes from the poses and velocities of one moment to those of the next:

1. all that acts (weight, elements, stops, contacts, holds) becomes one question for velocities,
   ``Problem``;
2. ``Newton`` answers it (the velocity LCP of [Plastic, eq. 11–15 and 31–33]);
3. bodies turn and roots shift with these velocities; where joints are follows from the turns, so
   none ever opens.

Kinetic energy and the springs' can only fall, except by what gravity, hands, external forces and
moving obstacles bring in.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...rotations import Floats, conjugate, multiply, normalized, rotate
from ..puppet import ElementResponse, Elements, Figure, PlasticLaw, Pose
from .assembly import Gathering, typical_size
from .bodies import Bodies
from .constraint_rows import Answer, Pattern, Rows
from .contact_detection import Contacts, Detector
from .hand_spring import Coupling, Grab
from .holds import Holding, Pin
from .newton import Newton, Solution, Start
from .obstacles import Obstacle
from .problem import Problem
from .state import Energy, WorldSettings, WorldState
from .tree import Tree
from .warm_start import ContactMemory

__all__ = ["Energy", "World", "WorldSettings", "WorldState"]

Integers = NDArray[np.int64]

_WEIGHT = 9.81


class World:
    """A figure, the obstacles round it and the hands that hold it, in time."""

    def __init__(
        self,
        figure: Figure,
        pose: Pose,
        settings: WorldSettings | None = None,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        """Start at rest in ``pose``, with the springs of all elements relaxed.

        Raises:
            SettingsError: a setting that makes no sense, or a figure without bodies.
        """
        self.figure = figure
        self.settings = settings or WorldSettings()
        self.settings.check(figure)
        self.obstacles: tuple[Obstacle, ...] = tuple(obstacles)
        """May be replaced between steps; obstacles that move are new ones each time."""
        count = len(figure)
        self.forces: Floats = np.zeros((count, 6))
        """(bodies, 6) force N at the centre of mass and torque N·m, world axes, from outside. Kept
        until changed."""
        self.time = 0.0
        self.last: Solution | None = None
        """The solver's answer in the last step."""
        self.contacts: Contacts | None = None
        """What touched, or nearly, in the last step."""
        self._tree = Tree(figure)
        self._newton = Newton(
            self._tree, tolerance=self.settings.tolerance, iterations=self.settings.iterations
        )
        self._detector = Detector(
            figure,
            self_collision=self.settings.self_collision,
            friction=self.settings.friction,
        )
        self._size = typical_size(figure)
        mass = float(figure.masses.sum())
        # A blow is not held on to: no more than twice the figure's weight on a point.
        self._firmest = 2.0 * _WEIGHT * self.settings.step * mass
        self._gathering = Gathering(figure, self._tree, self.settings)
        self._holding = Holding(mass, self._size, self.settings.step)
        self._memory = ContactMemory()
        self._pattern: Pattern | None = None
        self._grabs: list[Grab] = []
        self._pins: dict[int, Pin] = {}
        self._bodies = Bodies(figure, self._tree, pose)
        self._speeds = np.zeros((len(self._tree.layout.bodies), 3))
        self._response: ElementResponse | None = None
        self._pressed = _NOBODY
        self._loads = np.zeros((count, 3))
        self._use_elements(figure.elements)
        for body in sorted(self.settings.pinned):
            self.pin(body)

    # What the caller reads

    def pose(self) -> Pose:
        """Where the bodies are; every joint is closed."""
        return Pose(self._bodies.positions.copy(), self._bodies.orientations.copy())

    def velocities(self) -> Floats:
        """(bodies, 6) linear velocity of the centre of mass and angular velocity, world axes."""
        return np.concatenate([self._bodies.linear, self._bodies.angular], axis=1)

    def joint_loads(self) -> Floats:
        """(bodies, 3) torque λ that each element bore in the last step, N·m, world axes.

        It acts on the body, its opposite on the parent. Zero for the root of a free figure.
        """
        return self._loads.copy()

    def joint_springs(self) -> Floats:
        """(bodies, 3) q_f of the elements: rotation vectors in the parent's frame, radians."""
        return self._bodies.springs()

    def joint_turns(self) -> Floats:
        """(bodies, 4) orientation of each body in its parent's frame (a root's in the world's)."""
        return self._bodies.turns()

    def energy(self) -> Energy:
        """What the figure holds now."""
        bodies = self._bodies
        kinetic = 0.5 * float(
            (self.figure.masses[:, None] * bodies.linear**2).sum()
            + (bodies.angular * bodies.spin).sum()
        )
        springs = self.joint_springs()
        elastic = 0.5 * float((self._law.stiffness * springs * springs).sum())
        weight = -float(self.figure.masses @ (bodies.centres() @ self.settings.gravity))
        return Energy(kinetic, elastic, weight)

    # What the caller changes

    def set_pose(self, pose: Pose, *, keep_rest: bool = False) -> None:
        """Put the figure into a pose, at rest.

        Positions of all but the roots follow from the orientations.

        Args:
            pose: the new one.
            keep_rest: whether the springs' rest stays, so that they pull towards the pose that
                the figure had; otherwise they are relaxed in the new pose.
        """
        bodies = self._bodies
        bodies.place(pose)
        if not keep_rest:
            bodies.relax()
        bodies.stop()
        self._speeds[:] = 0.0
        self._response = None
        self._pressed = _NOBODY
        self._loads[:] = 0.0
        self._memory.forget()

    def set_elements(self, elements: Elements) -> None:
        """Take other coefficients; what is bent stays bent."""
        self._use_elements(elements)

    def set_velocities(self, velocities: Floats) -> None:
        """Give the bodies velocities (bodies, 6) as ``velocities`` reports them.

        The next step takes from them what the joints allow.
        """
        bodies, tree = self._bodies, self._tree
        bodies.linear = np.array(velocities[:, :3], dtype=np.float64)
        bodies.angular = np.array(velocities[:, 3:], dtype=np.float64)
        bodies.spin = (bodies.inertias() @ bodies.angular[:, :, None])[:, :, 0]
        self._memory.slips = np.zeros(0)
        # Where the solver begins; it ends in the same place from anywhere.
        before = np.where(bodies.is_root[:, None], 0.0, bodies.angular[bodies.parent_or_self])
        self._speeds[:] = 0.0
        self._speeds[tree.joint_slot] = bodies.angular - before
        lever = bodies.positions[tree.roots] - bodies.centres()[tree.roots]
        self._speeds[tree.shift_slot] = bodies.linear[tree.roots] + np.cross(
            bodies.angular[tree.roots], lever
        )

    def pin(self, body: int, *, firm: bool | None = None) -> None:
        """Hold a body's joint where it is now.

        Args:
            body: its index.
            firm: whether its orientation is held as well. By default that of a root is not: a
                pinned root turns about its joint on its own plastic element.
        """
        if not 0 <= body < len(self.figure):
            raise IndexError(body)
        bodies = self._bodies
        if firm is None:
            firm = not bodies.is_root[body]
        if body not in self._pins and bodies.is_root[body]:
            # The element of a root bears nothing while the root is free: it is bent from here on.
            bodies.rest[body] = bodies.orientations[body]
        place, turn = bodies.positions[body].copy(), bodies.orientations[body].copy()
        self._pins[body] = Pin(body, place, turn, firm=bool(firm))
        self._use_elements(self._elements)

    def unpin(self, body: int) -> None:
        """Let a pinned body go; one that is not pinned stays as it is."""
        self._pins.pop(body, None)
        self._use_elements(self._elements)

    @property
    def pinned(self) -> frozenset[int]:
        """The bodies that are pinned now."""
        return frozenset(self._pins)

    def grab(
        self,
        body: int,
        point: Floats,
        orientation: Floats | None = None,
        coupling: Coupling | None = None,
    ) -> Grab:
        """Take hold of a body.

        Args:
            body: its index.
            point: (3,) where, world; it need not lie on the surface.
            orientation: (4,) of the hand now, if its turns are to count; those of later targets
                are seen against it. None takes the body's own, so that targets are the body's.
            coupling: how firmly; one for this figure by default.
        """
        own = self._bodies.orientations[body]
        hand = own if orientation is None else normalized(orientation)
        at = np.array(point, dtype=np.float64)
        grab = Grab(
            body,
            coupling or Coupling.for_figure(self.figure),
            rotate(conjugate(own), at - self._bodies.positions[body]),
            multiply(conjugate(hand), own),
            at,
            None if orientation is None else np.array(hand),
        )
        self._grabs.append(grab)
        return grab

    def pull(
        self,
        grab: Grab,
        target_position: Floats,
        target_orientation: Floats | None = None,
        target_velocity: Floats | None = None,
    ) -> None:
        """Say where the hand is now.

        Args:
            grab: from ``grab``.
            target_position: (3,) where the held point is drawn to, world.
            target_orientation: (4,) of the hand; None leaves the body free to turn.
            target_velocity: (6,) linear and angular, of the hand; at rest by default.
        """
        grab.target_position = np.array(target_position, dtype=np.float64)
        grab.target_orientation = (
            None if target_orientation is None else normalized(target_orientation)
        )
        grab.target_velocity = (
            np.zeros(6) if target_velocity is None else np.array(target_velocity, dtype=np.float64)
        )

    def release(self, grab: Grab) -> None:
        """Let go; a grab that was let go before is left alone."""
        if grab in self._grabs:
            self._grabs.remove(grab)
        grab.wrench = np.zeros(6)

    @property
    def grabs(self) -> tuple[Grab, ...]:
        """What is held now."""
        return tuple(self._grabs)

    def held_point(self, grab: Grab) -> Floats:
        """(3,) where the held point of the body is now, world."""
        bodies = self._bodies
        return bodies.positions[grab.body] + bodies.matrices[grab.body] @ grab.point

    def state(self) -> WorldState:
        """A snapshot for ``restore``. Pins and grabs are the caller's and not part of it."""
        bodies = self._bodies
        return WorldState(
            self.time,
            bodies.roots.copy(),
            bodies.orientations.copy(),
            bodies.rest.copy(),
            bodies.linear.copy(),
            bodies.angular.copy(),
            bodies.spin.copy(),
            self._speeds.copy(),
            np.zeros((0, 3)) if self._response is None else self._response.trial.copy(),
            self._pressed.copy(),
            self._memory.grips.copy(),
            self._memory.wanted.copy(),
            self._memory.slips.copy(),
            self._memory.labels.copy(),
        )

    def restore(self, state: WorldState) -> None:
        """Go back to a snapshot; the same steps after it give the same result."""
        bodies = self._bodies
        self.time = state.time
        bodies.roots = state.roots.copy()
        bodies.orientations = state.orientations.copy()
        bodies.rest = state.plastic_rest.copy()
        bodies.linear = state.linear.copy()
        bodies.angular = state.angular.copy()
        bodies.spin = state.spin.copy()
        self._speeds = state.speeds.copy()
        self._response = self._law.answer(state.trial.copy()) if len(state.trial) else None
        self._pressed = state.pressed.copy()
        self._memory.set(
            state.labels.copy(), state.grips.copy(), state.wanted.copy(), state.slips.copy()
        )
        bodies.refresh()

    # The step

    def step(self) -> None:
        """Go on by h."""
        problem, start = self.problem()
        rows = problem.rows
        corrections = rows.corrections(self._size) if len(rows.bodies) else None
        solution = self._newton.solve(problem, start, corrections)
        self.last, self.contacts = solution, rows.contacts
        self._take(problem, solution)
        self._move(problem, solution)
        self.time += self.settings.step

    def problem(self) -> tuple[Problem, Start]:
        """The question of the coming step, and where to begin with its answer."""
        bodies = self._bodies
        contacts = self._find()
        rows = Rows(
            contacts,
            self._holding.rows(bodies, tuple(self._pins.values()), self._grabs),
            bodies.roots[0],
            self.figure.masses,
            self.settings.step,
            self._memory.grips_of(contacts),
            self._pattern,
        )
        self._pattern = rows.pattern
        problem = self._gathering.problem(bodies, self._law, self.forces, rows, self._speeds)
        before = self._before(problem) if len(rows.bodies) else None
        pressed = None
        if problem.stops:
            pressed = (problem.stops[0].labels[:, None] == self._pressed).any(axis=1)
        return problem, Start(self._speeds, before, self._response, pressed)

    def _find(self) -> Contacts:
        """Contacts that could carry anything within the step."""
        bodies = self._bodies
        linear = bodies.linear
        fastest = float(((linear * linear) @ _ONES).max()) ** 0.5
        margin = 2e-3 * self._size + 2.0 * self.settings.step * fastest
        return self._detector.find(bodies.positions, bodies.matrices, self.obstacles, margin)

    def _before(self, problem: Problem) -> Answer:
        """What the rows of this step did in the step before; they are told how fast they slip."""
        rows, memory = problem.rows, self._memory
        before = memory.before(rows)
        if before is None:
            # New rows begin with what they would do at the velocities of before.
            self._tree.place(problem.joints)
            there = rows.wanted(self._tree.velocities(self._speeds))
            before = memory.before_or(rows, there)
            rows.follow(rows.slip_at(self._velocities_now(problem)), 0.0)
        elif before.slips is not None:
            known = len(memory.slips) == rows.count
            slip = memory.slips if known else rows.slip_at(self._velocities_now(problem))
            rows.follow(slip, 0.0)
        return before

    def _velocities_now(self, problem: Problem) -> Floats:
        """(bodies, 6) spatial, about the problem's origin."""
        bodies = self._bodies
        now = np.empty((len(bodies.linear), 6))
        now[:, :3] = bodies.angular
        around = (problem.skewed @ bodies.angular[:, :, None])[:, :, 0]
        np.add(bodies.linear, around, out=now[:, 3:])
        return now

    def _take(self, problem: Problem, solution: Solution) -> None:
        """Take over velocities, loads and what contacts and hands did."""
        self._speeds = solution.speeds
        self._response = None if solution.response.flows is None else solution.response
        self._pressed = _NOBODY
        if solution.pressed is not None:
            self._pressed = problem.stops[0].labels[solution.pressed]
        self._bodies.take_velocities(solution.velocities, problem.skewed)
        self._loads = loads = solution.response.load
        if problem.frames is not None:
            self._loads = (problem.frames @ loads[:, :, None])[:, :, 0]
        rows = problem.rows
        self._memory.keep(rows, solution.rows, self._firmest * rows.contacts.friction)
        if not self._grabs:
            return
        h = self.settings.step
        row = problem.rows.count + sum(2 if pin.firm else 1 for pin in self._pins.values())
        for grab in self._grabs:
            wrench = np.zeros(6)
            wrench[:3] = solution.impulses[row] / h
            row += 1
            if grab.target_orientation is not None:
                wrench[3:] = solution.impulses[row] / h
                row += 1
            grab.wrench = wrench

    def _move(self, problem: Problem, solution: Solution) -> None:
        h, tree, bodies = self.settings.step, self._tree, self._bodies
        springs, flowing = None, _NOBODY
        if solution.response.flows is not None:
            flowing = solution.response.flows.nonzero()[0]
            springs = self._springs_after(problem, solution, flowing)
        speeds, turning = solution.speeds, solution.velocities[:, :3]
        if solution.moving is not None:
            speeds = solution.moving
            turning = tree.above @ speeds[tree.joint_slot]
        bodies.move(h * turning, h * speeds.take(tree.shift_slot, 0))
        if springs is not None:
            # The spring is at q_f now; its rest has moved by what flowed.
            bodies.rest_springs_at(springs, flowing)

    def _springs_after(self, problem: Problem, solution: Solution, flowing: Integers) -> Floats:
        """(flowing, 3) q_f at the step's end in the parents' frames: eq. 21."""
        speeds = solution.speeds.take(self._tree.joint_slot.take(flowing), 0)
        parents = self._bodies.parent_matrices.take(flowing, 0)
        if problem.frames is not None:
            speeds = (speeds[:, None, :] @ parents)[:, 0]
        flow = solution.response.flow_of(flowing)
        springs = problem.springs.take(flowing, 0) + self.settings.step * (speeds - flow)
        if problem.frames is None:
            springs = (springs[:, None, :] @ parents)[:, 0]
        return springs

    def _use_elements(self, elements: Elements) -> None:
        self._elements = elements
        works = ~self._bodies.is_root
        for body, pin in self._pins.items():
            works[body] |= not pin.firm
        mask = works[:, None]
        used = Elements(
            np.where(mask, elements.stiffness, 0.0),
            np.where(mask, elements.damping, 0.0),
            np.where(mask, elements.flow, 0.0),
            elements.yield_torque,
        )
        self._law = PlasticLaw(used, self.settings.step)
        if self._response is not None:
            self._response = self._law.answer(self._response.trial)


_NOBODY = np.zeros(0, np.int64)
_ONES = np.ones(3)
