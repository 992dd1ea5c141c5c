# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulated puppet: what a session holds on to.

A step of length h goes from the poses and velocities of one moment to those of the next:

1. all that acts (weight, elements, stops, contacts, holds) becomes one question for velocities,
   ``Problem``;
2. ``Newton`` answers it (the velocity LCP of [Plastic, eq. 11–15 and 31–33]);
3. bodies turn and roots shift with these velocities; where joints are follows from the turns, so
   none ever opens.

Between steps each body keeps the angular momentum it had, but for what turning it would add to its
energy. Kinetic energy and the springs' can only fall, except by what gravity, hands, external
forces and moving obstacles bring in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SettingsError
from ..rotations import Floats, conjugate, multiply, normalized, rotate
from .contacts import Contacts, Detector
from .coupling import Coupling, Grab
from .figure import Elements, Figure, Pose
from .kinematics import (
    exponential,
    inverse_product,
    logarithm,
    matrices,
    product,
    product_inverse,
    skew,
)
from .limits import JointStops
from .newton import Newton, Solution
from .obstacles import Obstacle
from .plastic import PlasticLaw
from .problem import Problem, spatial_inertias
from .rows import Holds, Rows
from .tree import Tree

Integers = NDArray[np.int64]

_PIN_GAIN = 1e5
"""Of pins, in masses of the figure: they give way by h·g/10⁵ a second before they are put right."""
_STOP_GAIN = 1e3
_WEIGHT = 9.81
_BLOW = 50.0
"""m/s²: a change of speed in a step that only a blow makes."""


@dataclass(frozen=True)
class WorldSettings:
    """What holds for the whole simulation."""

    step: float = 1e-3
    """h, seconds."""
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """m/s²; off by default, a puppet is posed more easily without weight."""
    pinned: frozenset[int] = frozenset()
    """Bodies pinned from the start, see ``World.pin``."""
    self_collision: bool = False
    """Whether limbs that are no neighbours push each other away."""
    friction: float = 0.6
    """Coulomb's coefficient where an obstacle has none of its own."""
    drag: float = 0.0
    """1/s: how fast all motion dies away, as under water; calms a free puppet without weight."""
    tolerance: float = 1e-3
    """Error of an impulse, against the largest, with which the solver is content. Where contacts
    neither slip nor open, and in all joints that hold, its answer is exact whatever this says."""
    iterations: int = 12
    """Most linear systems solved in a step; after that the best answer so far is taken."""


@dataclass(frozen=True, eq=False)
class WorldState:
    """All that a simulation remembers from step to step, as copies; holds are not part of it."""

    time: float
    roots: Floats
    """(roots, 3) positions of the roots' joints, world."""
    orientations: Floats
    """(bodies, 4)"""
    plastic_rest: Floats
    """(bodies, 4) where each joint's spring has its rest, in the parent's frame."""
    linear: Floats
    """(bodies, 3) velocity of the centres of mass."""
    angular: Floats
    """(bodies, 3)"""
    spin: Floats
    """(bodies, 3) angular momentum about the centre of mass, world axes."""
    speeds: Floats
    """(slots, 3) where the solver begins."""
    grips: Floats
    """(contacts, 3) friction of the last step, N·s."""
    labels: NDArray[np.int64]
    """(contacts,) to know them by."""


@dataclass(frozen=True)
class Energy:
    """Joules."""

    kinetic: float
    elastic: float
    """In the springs of the elements."""
    weight: float
    """In the height of the centres of mass, against the origin."""

    @property
    def total(self) -> float:
        """Their sum."""
        return self.kinetic + self.elastic + self.weight


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
        _check(figure, self.settings)
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
        self._size = _size(figure)
        self._mass = float(figure.masses.sum())
        self._gravity = np.array(self.settings.gravity, dtype=np.float64)
        self._parent_index = np.where(self._tree.parents < 0, count, self._tree.parents)
        self._parent_or_self = np.where(
            self._tree.parents < 0, np.arange(count), self._tree.parents
        )
        # (bodies, 3, 2): centre and inverse of inertia are looked up every step.
        self._inverse_inertias = np.linalg.inv(figure.inertias)
        self._centres = figure.centres[:, :, None].copy()
        self._anchors = figure.anchors[:, :, None].copy()
        self._is_root = self._tree.parents < 0
        self._stops = JointStops(figure, _STOP_GAIN * _carried_inertias(figure))
        self._grabs: list[Grab] = []
        self._pins: dict[int, _Pin] = {}
        self._orientations = np.zeros((count, 4))
        self._roots = np.zeros((len(self._tree.roots), 3))
        self._plastic_rest = np.zeros((count, 4))
        self._linear = np.zeros((count, 3))
        self._angular = np.zeros((count, 3))
        self._spin = np.zeros((count, 3))
        self._speeds = np.zeros((len(self._tree.layout.bodies), 3))
        self._grips = np.zeros((0, 3))
        self._labels = np.zeros(0, np.int64)
        self._loads = np.zeros((count, 3))
        self._place(pose)
        self._plastic_rest = self._turns()
        self._use_elements(figure.elements)
        for body in sorted(self.settings.pinned):
            self.pin(body)

    # What the caller reads

    def pose(self) -> Pose:
        """Where the bodies are; every joint is closed."""
        return Pose(self._positions.copy(), self._orientations.copy())

    def velocities(self) -> Floats:
        """(bodies, 6) linear velocity of the centre of mass and angular velocity, world axes."""
        return np.concatenate([self._linear, self._angular], axis=1)

    def joint_loads(self) -> Floats:
        """(bodies, 3) torque λ that each element bore in the last step, N·m, world axes.

        It acts on the body, its opposite on the parent. Zero for the root of a free figure.
        """
        return self._loads.copy()

    def joint_springs(self) -> Floats:
        """(bodies, 3) q_f of the elements: rotation vectors in the parent's frame, radians."""
        return logarithm(product_inverse(self._turns(), self._plastic_rest))

    def joint_turns(self) -> Floats:
        """(bodies, 4) orientation of each body in its parent's frame (a root's in the world's)."""
        return self._turns()

    def energy(self) -> Energy:
        """What the figure holds now."""
        kinetic = 0.5 * float(
            (self.figure.masses[:, None] * self._linear**2).sum()
            + (self._angular * self._spin).sum()
        )
        springs = self.joint_springs()
        elastic = 0.5 * float((self._law.stiffness * springs * springs).sum())
        centres = self._positions + rotate(self._orientations, self.figure.centres)
        weight = -float(self.figure.masses @ (centres @ self._gravity))
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
        self._place(pose)
        if not keep_rest:
            self._plastic_rest = self._turns()
        for array in (self._linear, self._angular, self._spin, self._speeds, self._loads):
            array[:] = 0.0
        self._labels = _NOBODY

    def set_elements(self, elements: Elements) -> None:
        """Take other coefficients; what is bent stays bent."""
        self._use_elements(elements)

    def set_velocities(self, velocities: Floats) -> None:
        """Give the bodies velocities (bodies, 6) as ``velocities`` reports them.

        The next step takes from them what the joints allow.
        """
        self._linear = np.array(velocities[:, :3], dtype=np.float64)
        self._angular = np.array(velocities[:, 3:], dtype=np.float64)
        frames = self._matrices
        inertias = frames @ self.figure.inertias @ frames.transpose(0, 2, 1)
        self._spin = (inertias @ self._angular[:, :, None])[:, :, 0]
        # Where the solver begins; it ends in the same place from anywhere.
        tree = self._tree
        relative = self._angular - np.where(
            self._is_root[:, None], 0.0, self._angular[self._parent_or_self]
        )
        self._speeds[:] = 0.0
        self._speeds[tree.joint_slot] = relative
        lever = self._positions[tree.roots] - self._centre_positions()[tree.roots]
        self._speeds[tree.shift_slot] = self._linear[tree.roots] + np.cross(
            self._angular[tree.roots], lever
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
        if firm is None:
            firm = not self._is_root[body]
        if body not in self._pins and self._is_root[body]:
            # The element of a root bears nothing while the root is free: it is bent from here on.
            self._plastic_rest[body] = self._orientations[body]
        self._pins[body] = _Pin(
            self._positions[body].copy(), self._orientations[body].copy(), firm=bool(firm)
        )
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
        own = self._orientations[body]
        hand = own if orientation is None else normalized(orientation)
        at = np.array(point, dtype=np.float64)
        grab = Grab(
            body,
            coupling or Coupling.for_figure(self.figure),
            rotate(conjugate(own), at - self._positions[body]),
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
        return self._positions[grab.body] + rotate(self._orientations[grab.body], grab.point)

    def state(self) -> WorldState:
        """A snapshot for ``restore``. Pins and grabs are the caller's and not part of it."""
        return WorldState(
            self.time,
            self._roots.copy(),
            self._orientations.copy(),
            self._plastic_rest.copy(),
            self._linear.copy(),
            self._angular.copy(),
            self._spin.copy(),
            self._speeds.copy(),
            self._grips.copy(),
            self._labels.copy(),
        )

    def restore(self, state: WorldState) -> None:
        """Go back to a snapshot; the same steps after it give the same result."""
        self.time = state.time
        self._roots = state.roots.copy()
        self._orientations = state.orientations.copy()
        self._plastic_rest = state.plastic_rest.copy()
        self._linear = state.linear.copy()
        self._angular = state.angular.copy()
        self._spin = state.spin.copy()
        self._speeds = state.speeds.copy()
        self._grips = state.grips.copy()
        self._labels = state.labels.copy()
        self._refresh()

    # The step

    def step(self) -> None:
        """Go on by h."""
        problem, inertias, body_inertias = self.problem()
        h = self.settings.step
        corrections = None
        if len(problem.rows):
            corrections = problem.rows.corrections(self._size)
        solution = self._newton.solve(problem, inertias, self._speeds, corrections)
        self.last = solution
        self.contacts = problem.rows.contacts
        self._take_velocities(problem, solution, body_inertias)
        self._take_grips(problem, solution)
        self._take_wrenches(problem, solution)
        self._move(problem, solution)
        self.time += h

    def problem(self) -> tuple[Problem, Floats, Floats]:
        """The question of the coming step, and inertias in world axes.

        Returns:
            The problem, the spatial inertias (bodies, 6, 6) about its origin, and those (bodies,
            3, 3) about the centres of mass.
        """
        figure = self.figure
        h = self.settings.step
        frames = self._matrices
        origin = self._roots[0]
        joints = self._positions - origin
        centres = (frames @ self._centres)[:, :, 0]
        centres += joints
        skewed = skew(centres)
        inertias = frames @ figure.inertias @ frames.transpose(0, 2, 1)
        spatial = spatial_inertias(figure.masses, inertias, skewed)
        # M v + h f, with the angular momentum that each body kept.
        linear = figure.masses[:, None] * (self._linear + h * self._gravity)
        linear += h * self.forces[:, :3]
        momenta = np.empty((len(figure), 6))
        momenta[:, 3:] = linear
        momenta[:, :3] = (skewed @ linear[:, :, None])[:, :, 0]
        momenta[:, :3] += self._kept_spin(frames) + h * self.forces[:, 3:]
        if self.settings.drag > 0.0:
            momenta *= 1.0 / (1.0 + h * self.settings.drag)
        turns = self._turns()
        springs = logarithm(product_inverse(turns, self._plastic_rest))
        if self._alike:
            parents = self._parent_frames
            springs = (parents @ springs[:, :, None])[:, :, 0]
            axes = None
        else:
            axes = self._parent_frames
        speed = np.sqrt((self._linear * self._linear).sum(axis=1).max())
        margin = 2e-3 * self._size + 2.0 * h * float(speed)
        contacts = self._detector.find(self._positions, frames, self.obstacles, margin)
        rows = Rows(
            contacts,
            self._holds(),
            origin,
            figure.masses,
            h,
            self._grips_before(contacts),
        )
        if len(contacts):
            now = np.empty((len(figure), 6))
            now[:, :3] = self._angular
            now[:, 3:] = self._linear + (skewed @ self._angular[:, :, None])[:, :, 0]
            rows.follow(rows.speeds(now), 0.0)
        problem = Problem(
            h,
            joints,
            centres,
            skewed,
            figure.masses,
            inertias,
            momenta,
            self._law,
            springs,
            axes,
            self._stops.near(turns, self._parent_frames, self._speeds[self._tree.joint_slot], h),
            rows,
            _BLOW * h,
        )
        return problem, spatial, inertias

    def _kept_spin(self, frames: Floats) -> Floats:
        """Angular momenta, shortened where the body's turn would have made energy of them."""
        local = self._spin[:, None, :] @ frames
        now = (local @ self._inverse_inertias * local).sum(axis=(1, 2))
        before = (self._spin * self._angular).sum(axis=1)
        share = np.sqrt(np.maximum(before, 0.0) / np.maximum(now, 1e-300))
        np.minimum(share, 1.0, out=share)
        return self._spin * share[:, None]

    def _holds(self) -> Holds | None:
        if not (self._pins or self._grabs):
            return None
        h = self.settings.step
        builder = _HoldBuilder()
        for body, pin in self._pins.items():
            here = self._positions[body]
            gain = _PIN_GAIN * self._mass
            builder.add(body, here, pin.position - here, gain=gain)
            if pin.firm:
                off = _turn_between(self._orientations[body], pin.orientation)
                builder.add(body, None, off, gain=gain * self._size**2)
        for grab in self._grabs:
            coupling = grab.coupling
            here = self.held_point(grab)
            gain = h * (h * coupling.stiffness + coupling.damping)
            way = grab.target_position - here
            bias = h * coupling.stiffness * way + gain * grab.target_velocity[:3]
            builder.pull(grab.body, here, bias, gain, h * coupling.force_limit)
            if grab.target_orientation is not None:
                gain = h * (h * coupling.turning_stiffness + coupling.turning_damping)
                wanted = multiply(grab.target_orientation, grab.grip)
                turn = _turn_between(self._orientations[grab.body], wanted)
                bias = h * coupling.turning_stiffness * turn + gain * grab.target_velocity[3:]
                builder.pull(grab.body, None, bias, gain, h * coupling.torque_limit)
        return builder.holds()

    def _take_velocities(self, problem: Problem, solution: Solution, inertias: Floats) -> None:
        velocities = solution.velocities
        self._speeds = solution.speeds
        self._angular = velocities[:, :3].copy()
        around = (problem.skewed @ self._angular[:, :, None])[:, :, 0]
        self._linear = velocities[:, 3:] - around
        self._spin = (inertias @ self._angular[:, :, None])[:, :, 0]
        loads = solution.loads
        if problem.frames is not None:
            loads = (problem.frames @ loads[:, :, None])[:, :, 0]
        self._loads = loads

    def _grips_before(self, contacts: Contacts) -> Floats | None:
        """(contacts, 3) friction in the step before, zero for those that are new."""
        labels = self._labels
        if not (len(labels) and len(contacts)):
            return None
        if np.array_equal(labels, contacts.labels):
            return self._grips
        order = np.argsort(labels)
        sorted_labels = labels[order]
        place = np.searchsorted(sorted_labels, contacts.labels)
        place = np.minimum(place, len(labels) - 1)
        same = sorted_labels[place] == contacts.labels
        return np.where(same[:, None], self._grips[order[place]], 0.0)

    def _take_grips(self, problem: Problem, solution: Solution) -> None:
        contacts = problem.rows.contacts
        self._labels = contacts.labels
        count = len(contacts)
        if count:
            impulses = solution.impulses[:count]
            loads = (impulses * contacts.normals).sum(axis=1)
            across = impulses - loads[:, None] * contacts.normals
            # A blow is not held on to: no more than twice the figure's weight on that point.
            most = 2.0 * _WEIGHT * self.settings.step * self._mass * contacts.friction
            size = np.sqrt((across * across).sum(axis=1)) + 1e-300
            self._grips = np.minimum(most / size, 1.0)[:, None] * across

    def _take_wrenches(self, problem: Problem, solution: Solution) -> None:
        if not self._grabs:
            return
        h = self.settings.step
        row = len(problem.rows.contacts) + sum(2 if pin.firm else 1 for pin in self._pins.values())
        for grab in self._grabs:
            wrench = np.zeros(6)
            wrench[:3] = solution.impulses[row] / h
            row += 1
            if grab.target_orientation is not None:
                wrench[3:] = solution.impulses[row] / h
                row += 1
            grab.wrench = wrench

    def _move(self, problem: Problem, solution: Solution) -> None:
        h = self.settings.step
        tree = self._tree
        speeds = solution.moving
        flowing, springs = _NOBODY, None
        if solution.flow is not None:
            flowing = np.flatnonzero(solution.flow.any(axis=1))
            springs = self._springs_after(problem, solution, solution.flow[flowing], flowing)
        turning = tree.above @ speeds[tree.joint_slot]
        self._orientations = product(exponential(h * turning), self._orientations)
        size = (self._orientations * self._orientations).sum(axis=1, keepdims=True)
        self._orientations /= np.sqrt(size)
        self._roots = self._roots + h * speeds[tree.shift_slot]
        self._refresh()
        if springs is not None:
            # The spring is at q_f now; its rest has moved by what flowed.
            turns = self._turns()[flowing]
            rest = product(exponential(-springs), turns)
            self._plastic_rest[flowing] = rest / np.linalg.norm(rest, axis=1, keepdims=True)

    def _springs_after(
        self, problem: Problem, solution: Solution, flow: Floats, flowing: Integers
    ) -> Floats:
        """(flowing, 3) q_f at the step's end in the parents' frames: eq. 21."""
        speeds = solution.speeds[self._tree.joint_slot[flowing]]
        parents = self._parent_frames[flowing]
        if problem.frames is not None:
            speeds = (speeds[:, None, :] @ parents)[:, 0]
        springs = problem.springs[flowing] + self.settings.step * (speeds - flow)
        if problem.frames is None:
            springs = (springs[:, None, :] @ parents)[:, 0]
        return springs

    # Geometry

    def _place(self, pose: Pose) -> None:
        self._orientations = normalized(pose.orientations)
        self._roots = np.array(pose.positions, dtype=np.float64)[self._tree.roots]
        self._refresh()

    def _refresh(self) -> None:
        """Matrices and positions, from orientations and roots."""
        tree = self._tree
        self._matrices = matrices(self._orientations)
        parents = self._matrices[self._parent_or_self]
        arms = (parents @ self._anchors)[:, :, 0]
        parents[tree.roots] = _UNIT
        self._parent_frames = parents
        arms[tree.roots] = self._roots
        self._positions = tree.above @ arms

    def _turns(self) -> Floats:
        parents = self._orientations[self._parent_or_self]
        parents[self._tree.roots] = _UNTURNED
        return inverse_product(parents, self._orientations)

    def _centre_positions(self) -> Floats:
        return self._positions + (self._matrices @ self._centres)[:, :, 0]

    def _use_elements(self, elements: Elements) -> None:
        self._elements = elements
        works = ~self._is_root
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
        self._alike = all(
            bool((array == array[:, :1]).all())
            for array in (used.stiffness, used.damping, used.flow)
        )


@dataclass(frozen=True, eq=False)
class _Pin:
    position: Floats
    orientation: Floats
    firm: bool


class _HoldBuilder:
    """Collects rows of pins and grabs."""

    def __init__(self) -> None:
        self._bodies: list[int] = []
        self._points: list[Floats] = []
        self._turns: list[bool] = []
        self._gains: list[float] = []
        self._biases: list[Floats] = []
        self._bounds: list[float] = []
        self._errors: list[Floats] = []

    def add(self, body: int, point: Floats | None, error: Floats, gain: float) -> None:
        self._row(body, point, gain, np.zeros(3), np.inf, error)

    def pull(
        self, body: int, point: Floats | None, bias: Floats, gain: float, bound: float
    ) -> None:
        self._row(body, point, gain, bias, bound, np.zeros(3))

    def _row(  # noqa: PLR0917
        self,
        body: int,
        point: Floats | None,
        gain: float,
        bias: Floats,
        bound: float,
        error: Floats,
    ) -> None:
        self._bodies.append(body)
        self._points.append(np.zeros(3) if point is None else point)
        self._turns.append(point is None)
        self._gains.append(gain)
        self._biases.append(bias)
        self._bounds.append(bound)
        self._errors.append(error)

    def holds(self) -> Holds:
        return Holds(
            np.array(self._bodies),
            np.array(self._points),
            np.array(self._turns),
            np.array(self._gains),
            np.array(self._biases),
            np.array(self._bounds),
            np.array(self._errors),
        )


def _check(figure: Figure, settings: WorldSettings) -> None:
    if not len(figure):
        raise SettingsError("The figure has no bodies.", "Choose an armature with bones.")
    if not (np.isfinite(settings.step) and settings.step > 0.0):
        raise SettingsError(
            "The step of the simulation is not positive.", "Take 0.001 seconds, for example."
        )
    if not all(0 <= body < len(figure) for body in settings.pinned):
        raise SettingsError("A pinned body does not exist.", "Pin bodies of the figure alone.")


def _turn_between(start: Floats, end: Floats) -> Floats:
    """(3,) rotation vector in world axes that leads from one orientation to another."""
    return logarithm(multiply(end, conjugate(start))[None])[0]


def _size(figure: Figure) -> float:
    """Typical length of a bone, metres."""
    lengths = figure.lengths[figure.lengths > 0.0]
    return float(np.median(lengths)) if len(lengths) else float(np.max(figure.radii, initial=1e-3))


def _carried_inertias(figure: Figure) -> Floats:
    """(bodies,) kg·m²: about each joint, of all that hangs on it when stretched out."""
    count = len(figure)
    result = np.zeros(count)
    reach = np.zeros(count)
    masses = figure.masses.copy()
    for body in range(count - 1, -1, -1):
        own = np.trace(figure.inertias[body]) + figure.masses[body] * float(
            figure.centres[body] @ figure.centres[body]
        )
        result[body] += own
        parent = figure.parents[body]
        if parent >= 0:
            arm = float(np.linalg.norm(figure.anchors[body]))
            masses[parent] += masses[body]
            reach[parent] = max(reach[parent], arm + reach[body])
            result[parent] += result[body] + masses[body] * arm * arm
    return result


_NOBODY = np.zeros(0, np.int64)
_UNIT = np.eye(3)
_UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])
