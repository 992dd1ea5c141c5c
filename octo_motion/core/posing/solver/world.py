# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulated puppet: what a session holds on to.

A step of length h goes from the poses and velocities of one moment to those of the next:

1. all that acts (weight, elements, stops, contacts, holds) becomes one question for velocities,
   ``Problem``;
2. ``Newton`` answers it (the velocity LCP of [Plastic, eq. 11–15 and 31–33]);
3. bodies turn and roots shift with these velocities; where joints are follows from the turns, so
   none ever opens.

Kinetic energy and the springs' can only fall, except by what gravity, hands and external forces
bring in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import SettingsError
from ...rotations import IDENTITY, Floats, conjugate, multiply, normalized, rotate
from ...rotations.small_batches import vecdot, vecmat
from ..puppet import Elements, Figure, Flags, Pose, law_of, part_of
from .bodies import Bodies
from .constraint_rows import Pattern, Rows
from .contact_detection import NO_CONTACTS, Contacts, Detector, apart_at
from .holds import Coupling, HandSpring, Hold, HoldBuilder
from .newton import InitialGuess, Newton, Solution
from .obstacle_shapes import Obstacle
from .problem import Problem, ProblemBuilder, typical_size
from .segments import tree_of
from .warm_start import WarmStart

_WEIGHT = 9.81


@dataclass(frozen=True)
class WorldSettings:
    """What holds for the whole simulation."""

    step: float = 1e-3
    """h, seconds."""
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """m/s²; off by default, a puppet is posed more easily without weight."""
    self_collision: bool = False
    """Whether limbs that are no neighbours push each other away."""
    friction: float = 0.6
    """Coulomb's coefficient."""
    drag: float = 0.0
    """1/s: how fast all motion dies away, as under water; calms a free puppet without weight."""
    tolerance: float = 5e-3
    """Error of an impulse, against the largest, with which the solver is content. Where contacts
    neither slip nor open, and in all joints that hold, its answer is exact whatever this says. A
    doll dragged over the floor for two seconds ends 2e-6 of its size from where 1e-9 leads it, an
    octopus 1e-4; with 1e-3 it was 3e-7 and 3e-4, and the slowest steps took another system."""
    iterations: int = 12
    """Most linear systems solved in a step; after that the best answer so far is taken."""

    def check(self, figure: Figure) -> None:
        """See whether a figure can be simulated so.

        Raises:
            SettingsError: a setting that makes no sense, or a figure without bodies.
        """
        if not len(figure):
            raise SettingsError("The figure has no bodies.", "Choose an armature with bones.")
        if not (np.isfinite(self.step) and self.step > 0.0):
            raise SettingsError(
                "The step of the simulation is not positive.", "Take 0.001 seconds, for example."
            )


@dataclass(frozen=True, eq=False)
class WorldSnapshot:
    """All that a simulation remembers from step to step; holds are not part of it."""

    bodies: dict[str, Floats]
    start: WarmStart


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
        self.obstacles: tuple[Obstacle, ...] = tuple(obstacles)
        """May be replaced between steps; obstacles that move are new ones each time."""
        self.forces: Floats = np.zeros((len(figure), 6))
        """(bodies, 6) force N at the centre of mass and torque N·m, world axes, from outside. Kept
        until changed."""
        self.last: Solution | None = None
        """The solver's answer in the last step."""
        self.contacts: Contacts | None = None
        """What touched, or nearly, in the last step."""
        self._size = typical_size(figure)
        self._springs: list[HandSpring] = []
        self._pins: dict[int, Hold] = {}
        self._yielding: Flags | None = None
        settings = settings or WorldSettings()
        settings.check(figure)
        # Limbs of two figures that are in each other from the start would be thrown apart.
        self._apart = apart_at(figure, pose) | _same(figure) if figure.owners else None
        self._tree = tree_of(figure)
        self._bodies = Bodies(figure, self._tree, pose)
        self._warm = WarmStart(self._tree)
        self._loads = np.zeros((len(figure), 3))
        self._use(settings)

    def _use(self, settings: WorldSettings) -> None:
        """All that hangs on the settings; what moves stays as it is."""
        figure, mass = self.figure, float(self.figure.masses.sum())
        self.settings = settings
        self._newton = Newton(
            self._tree, tolerance=settings.tolerance, iterations=settings.iterations
        )
        self._detector = Detector(figure, self_collision=settings.self_collision, apart=self._apart)
        # A blow is not held on to: no more than twice the figure's weight on a point.
        self._firmest = 2.0 * _WEIGHT * settings.step * mass * settings.friction
        self._builder = ProblemBuilder(
            figure, self._tree, settings.step, settings.gravity, settings.drag
        )
        self._hold_builder = HoldBuilder(mass, self._size, settings.step)
        self._pattern: Pattern | None = None
        self._use_elements()

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

    # What the caller changes

    def set_pose(self, pose: Pose) -> None:
        """Put the figure into a pose, at rest and with relaxed springs.

        Positions of all but the roots follow from the orientations.
        """
        self._bodies.place(pose)
        self._bodies.stop()
        self._detector.forget()
        self._warm.forget()
        self._loads = np.zeros_like(self._loads)

    def turn_back(self, joints: Flags, pose: Pose) -> None:
        """Turn joints of a mask (bodies,) as a pose has them, with relaxed springs; others, and all
        that moves, stay as they are.
        """
        self._bodies.turn_back(joints, pose)

    def change(self, settings: WorldSettings) -> None:
        """Take other settings; motion, pins and hands stay as they are.

        Raises:
            SettingsError: a setting that makes no sense.
        """
        settings.check(self.figure)
        state = self.state()
        self._use(settings)
        self.restore(state)

    def set_elements(self, elements: Elements) -> None:
        """Take other coefficients; what is bent stays bent."""
        self.figure = replace(self.figure, elements=elements)
        self._use_elements()

    def pulled(self) -> Flags:
        """(bodies,) joints through which a hand, a pin, a force from outside or a touch of the last
        step pulls: it is at what hangs on them. On others there is nothing but weight and inertia.
        """
        at = self.forces.any(axis=1)
        at[[*self._pins, *(spring.body for spring in self._springs)]] = True
        if self.contacts is not None and len(self.contacts):
            at[self.contacts.bodies] = True
            at[self.contacts.others[self.contacts.others >= 0]] = True
        return self._tree.above[at].any(axis=0)

    def let_yield(self, joints: Flags | None) -> None:
        """From now on, of a mask (bodies,) of joints these give way alone; None lets all."""
        if not np.array_equal(self._yielding, joints):
            self._yielding = joints
            self._use_elements()

    def pin(self, body: int, *, firm: bool | None = None) -> None:
        """Hold a body's joint where it is now, and its orientation too if ``firm``.

        By default that of a root is not: a pinned root turns about its joint on its own plastic
        element.
        """
        if not 0 <= body < len(self.figure):
            raise IndexError(body)
        bodies = self._bodies
        if firm is None:
            firm = not bodies.is_root[body]
        if body not in self._pins and bodies.is_root[body]:
            # The element of a root bears nothing while the root is free: it is bent from here on.
            bodies.rest[body] = bodies.orientations[body]
        self._pins[body] = self._pin(body, firm=bool(firm))
        self._use_elements()

    def _pin(self, body: int, *, firm: bool) -> Hold:
        """One that holds where a body is now."""
        bodies = self._bodies
        return Hold(
            body=body,
            point=np.zeros(3),
            grip=IDENTITY,
            target_position=bodies.positions[body].copy(),
            target_orientation=bodies.orientations[body].copy() if firm else None,
        )

    def unpin(self, body: int) -> None:
        """Let a pinned body go; one that is not pinned stays as it is."""
        self._pins.pop(body, None)
        self._use_elements()

    def pin_here(self) -> None:
        """Let the pins hold where their bodies are now: they were put elsewhere."""
        for body, pin in self._pins.items():
            self._pins[body] = self._pin(body, firm=pin.turns)

    @property
    def pins(self) -> dict[int, bool]:
        """The bodies that are pinned now, and whether their orientations are held as well."""
        return {body: self._pins[body].turns for body in sorted(self._pins)}

    def grab(
        self,
        body: int,
        point: Floats,
        orientation: Floats | None = None,
        coupling: Coupling | None = None,
    ) -> HandSpring:
        """Take hold of a body at a point (3,), world, that need not lie on the surface.

        Where the hand's orientation (4,), world, is given, it keeps the body from turning from the
        start; else it does so once it has turned, and its turns count from here. It holds by a
        coupling for this figure, if none is given.
        """
        own = self._bodies.orientations[body]
        hand = IDENTITY if orientation is None else normalized(orientation)
        at = np.array(point, dtype=np.float64)
        spring = HandSpring(
            body=body,
            coupling=coupling or Coupling.for_figure(part_of(self.figure, body)),
            point=rotate(conjugate(own), at - self._bodies.positions[body]),
            grip=multiply(conjugate(hand), own),
            target_position=at,
            target_orientation=None if orientation is None else hand,
        )
        self._springs.append(spring)
        return spring

    def release(self, spring: HandSpring) -> None:
        """Let go; what was let go before is left alone."""
        if spring in self._springs:
            self._springs.remove(spring)
        spring.wrench = np.zeros(6)

    @property
    def grabs(self) -> tuple[HandSpring, ...]:
        """What is held now, in the order in which it was taken hold of."""
        return tuple(self._springs)

    def held_point(self, spring: HandSpring) -> Floats:
        """(3,) where the held point of the body is now, world."""
        bodies = self._bodies
        return bodies.positions[spring.body] + bodies.matrices[spring.body] @ spring.point

    def state(self) -> WorldSnapshot:
        """A snapshot for ``restore``. Pins and grabs are the caller's and not part of it."""
        return WorldSnapshot(self._bodies.state(), self._warm.state())

    def restore(self, state: WorldSnapshot) -> None:
        """Go back to a snapshot; the same steps after it give the same result."""
        self._bodies.restore(state.bodies)
        self._detector.forget()
        self._warm.restore(state.start, self._law)

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

    def problem(self) -> tuple[Problem, InitialGuess]:
        """The question of the coming step, and where to begin with its answer."""
        bodies = self._bodies
        contacts = self._find()
        rows = Rows(
            contacts,
            self._hold_builder.rows(bodies, (*self._pins.values(), *self._springs)),
            bodies.roots[0],
            self.figure.masses,
            self.settings.step,
            self.settings.friction,
            self._warm.contacts.grips_of(contacts),
            self._pattern,
        )
        self._pattern = rows.pattern
        problem = self._builder.problem(bodies, self._law, self.forces, rows, self._warm.speeds)
        return problem, self._warm.start(problem, bodies)

    def _find(self) -> Contacts:
        """Contacts that could carry anything within the step."""
        bodies = self._bodies
        if not self.obstacles and self._detector.idle:
            return NO_CONTACTS
        linear = bodies.linear
        fastest = float(vecdot(linear, linear).max()) ** 0.5
        margin = 2e-3 * self._size + 2.0 * self.settings.step * fastest
        return self._detector.find(bodies.positions, bodies.matrices, self.obstacles, margin)

    def _take(self, problem: Problem, solution: Solution) -> None:
        """Take over velocities, loads and what contacts and hands did."""
        rows = problem.rows
        self._warm.keep(problem, solution, self._firmest)
        self._bodies.take_velocities(solution.velocities, problem.skewed)
        self._loads = solution.response.load
        self._hold_builder.take(self._springs, solution.impulses[rows.count :])

    def _move(self, problem: Problem, solution: Solution) -> None:
        h, tree, bodies = self.settings.step, self._tree, self._bodies
        speeds, turning = solution.speeds, solution.velocities[:, :3]
        response, to_rest = solution.response, None
        if response.flows is not None:
            to_rest = self._to_rest_after(problem, solution)
        if solution.moving is not None:
            speeds = solution.moving
            turning = tree.from_roots(tree.of_joints(speeds))
        # A spring is at q_f then; its rest moves by what flowed.
        bodies.move(h * turning, h * speeds.take(tree.shift_slot, 0), to_rest, response.flows)

    def _to_rest_after(self, problem: Problem, solution: Solution) -> Floats:
        """(bodies, 3) −q_f at the step's end in the parents' frames: eq. 21."""
        to_rest = solution.response.flows_with() - solution.joint_speeds
        to_rest *= self.settings.step
        to_rest -= problem.springs
        return vecmat(to_rest, self._bodies.parent_matrices)

    def _use_elements(self) -> None:
        works = ~self._bodies.is_root
        for body, pin in self._pins.items():
            works[body] |= not pin.turns
        elements = self.figure.elements.where(works)
        if self._yielding is not None:
            limits = np.where(self._yielding, elements.yield_torque, np.inf)
            elements = replace(elements, yield_torque=limits)
        self._law = law_of(elements, self.settings.step)
        self._warm.use_law(self._law)


def _same(figure: Figure) -> Flags:
    owners = np.array(figure.owners)
    return owners[:, None] == owners
