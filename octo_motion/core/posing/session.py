# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing: hands that hold a puppet, in simulated time.

Everything here is plain numbers. The mouse and scripts have one hand, and call ``tick`` with the
time that has passed and where the hand is; the process at the devices has as many as there are
devices, keeps time by itself, and calls ``advance``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from ..rotations import (
    IDENTITY,
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    to_rotation_vector,
)
from .puppet import Elements, Figure, Flags, Pose, joints_of, part_of, turned_bodies
from .solver import Coupling, HandSpring, Obstacle, World, WorldSettings, WorldSnapshot

COARSEST: Final = 4e-3
"""Seconds: longer steps would let a fast hand shake the puppet."""
LONGEST_TICK: Final = 0.1
"""Seconds: what is longer (Blender was busy) is not made up for, so that nothing jerks."""
LONGEST_WORK: Final = 0.1
"""Seconds that one tick may compute."""
BUSY: Final = 0.75
"""Share of real time that steps may take; above, they get longer."""
STILL: Final = 2e-3
"""m/s and rad/s below which a puppet that nobody holds stands still."""
REST_TIME: Final = 0.3
"""Seconds that it must be so before nothing is computed any more."""
ELSEWHERE: Final = 1e-5
"""Of a bone's length: where a joint counts as being elsewhere than the figure has it."""
MOST_STEPS_BACK: Final = 64
GENTLE: Final = 0.1
"""Of the firmest coupling, with joints that just bear what hangs on them."""


@dataclass
class StepLength:
    """Lengthens steps that take too long, and shortens them when there is time again."""

    nominal: float
    """s of the shortest step, which is the most exact."""
    coarsest: float
    """s of the longest: beyond, a fast hand would shake the puppet."""
    busy: float
    """Share of real time that steps may take; above, they get longer."""
    idle: float
    """Of ``busy``: below, they get shorter again."""
    learning: float
    """Of one more measurement, in ``load``."""
    load: float = 0.0
    """s of work for a simulated second, of late."""

    def after(self, spent: float, simulated: float, step: float) -> float:
        """The step, s, to go on with, where so many seconds were worked, and more than none came of
        it.
        """
        self.load += self.learning * (spent / simulated - self.load)
        wanted = step
        if self.load > self.busy and step < self.coarsest:
            wanted = min(2.0 * step, self.coarsest)
        elif self.load < self.idle * self.busy and step > self.nominal:
            wanted = max(0.5 * step, self.nominal)
        # A step costs about the same, however long it is.
        self.load *= step / wanted
        return wanted


@dataclass(frozen=True, eq=False)
class HandSample:
    """Where a hand is, and how fast."""

    position: Floats
    """(3,) to which the grabbed point is pulled, world."""
    orientation: Floats
    """(4,) how the hand is turned, seen as when it grabbed."""
    velocity: Floats = field(default_factory=lambda: np.zeros(6))
    """(6,) linear and angular."""
    share: float = 1.0
    """Of the way there that it goes with the next steps."""


@dataclass(frozen=True)
class TickReport:
    """What one tick was like."""

    simulated: float
    """Seconds."""
    steps: int
    ratio: float
    """Simulated against real time, of late; 1 keeps up."""
    step: float
    """Seconds of one step."""
    resting: bool
    """Whether nothing moves, and nothing was computed."""


@dataclass(frozen=True, eq=False)
class _Sweep:
    """What a hand's target does while some steps are taken."""

    spring: HandSpring
    start: Floats
    """(3,) world."""
    way: Floats
    """(3,) m"""
    turned: Floats | None
    """(4,) at the start; None while the hand has not turned, and the bone turns freely."""
    swing: Floats
    """(3,) rotation vector."""
    velocity: Floats
    """(6,)"""

    @classmethod
    def towards(cls, spring: HandSpring, hand: HandSample, share: float, seconds: float) -> _Sweep:
        """A share of the hand's way to where it is; if not the whole one, in so many seconds."""
        way = hand.share * (hand.position - spring.target_position)
        turned = spring.target_orientation
        swing = hand.share * to_rotation_vector(
            multiply(hand.orientation, conjugate(IDENTITY if turned is None else turned))
        )
        if turned is None and swing.any():
            turned = IDENTITY
        velocity = hand.velocity
        if share < 1.0:
            way, swing = share * way, share * swing
            velocity = np.concatenate([way, swing]) / seconds
        return cls(spring, spring.target_position, way, turned, swing, velocity)

    def pull(self, share: float) -> None:
        """Move the target to a share of the way."""
        turn = self.turned
        if turn is not None:
            turn = multiply(from_rotation_vector(share * self.swing), turn)
        self.spring.pull(self.start + share * self.way, turn, self.velocity)


def hand_for(figure: Figure, strength: float = 1.0) -> Coupling:
    """A hand that bends joints of a strength, and not many times more.

    A mouse asks for any place at all. Pulled far beyond its reach with all the force that a hand
    could have, a chain of light bones would be a string under a tension that long steps cannot
    simulate; three times the figure's weight is plenty.
    """
    return Coupling.for_figure(figure, GENTLE * max(strength, 1.0))


def lead(hands: Mapping[HandSpring, HandSample]) -> None:
    """Let hands be where they are now, without a step."""
    for spring, hand in hands.items():
        _Sweep.towards(spring, hand, 1.0, 0.0).pull(1.0)


def _coupling_at(session: Session, body: int) -> Coupling:
    figure = session.figure
    if not figure.owners or figure.owners[body] == figure.owners[0]:
        return session.coupling
    # Another figure, or a thing, is held as is right for its own weight.
    return hand_for(part_of(figure, body))


class Session:
    """A figure in a world, and hands that hold it; the settings' step is the nominal one.

    Without a clock, in seconds, no tick asks for the time, steps stay as they are, and the same
    calls give the same result.
    """

    def __init__(
        self,
        figure: Figure,
        pose: Pose,
        settings: WorldSettings,
        obstacles: Sequence[Obstacle] = (),
        *,
        clock: Callable[[], float] | None = time.perf_counter,
    ) -> None:
        self.world = World(figure, pose, settings, obstacles)
        self.coupling = hand_for(part_of(figure, 0))
        """How firmly the next grab holds, if it does not say so itself."""
        self.time = 0.0
        """Simulated seconds."""
        self.changed = True
        """Whether something may have moved since someone last set this to false."""
        self._start = self.world.pose()
        self._reference = self._start
        self._touched: set[int] = set()
        self.pulled: Flags | None = np.zeros(len(figure), dtype=bool)
        """Joints that were pulled since the figure was put there; None: it may be all of them."""
        # Of a figure that nobody has held yet, those that something touches.
        self._yielding = self.pulled
        self._clock = clock
        self._length = StepLength(settings.step, COARSEST, BUSY, 0.4, 0.2)
        self._left = 0.0
        self._ratio = 1.0
        self._calm = 0.0
        self._before: list[WorldSnapshot] = []
        self._after: list[WorldSnapshot] = []
        """What steps back have undone."""

    @property
    def figure(self) -> Figure:
        return self.world.figure

    @property
    def pose(self) -> Pose:
        return self.world.pose()

    @property
    def resting(self) -> bool:
        """Whether nobody holds the puppet and nothing moves."""
        return not self.world.grabs and self._calm >= REST_TIME

    def wake(self) -> None:
        """Something was changed: there is something to compute again."""
        self._calm = 0.0
        self.changed = True

    # --- Hands --------------------------------------------------------------------------------

    @property
    def held(self) -> HandSpring | None:
        """What the first hand holds: of a mouse, the only one."""
        return next(iter(self.world.grabs), None)

    def grab(
        self,
        body: int,
        point: Floats,
        orientation: Floats | None = None,
        coupling: Coupling | None = None,
    ) -> HandSpring:
        """Take hold of a body with one more hand, see ``World.grab``."""
        self.remember()
        self._note_touched()
        spring = self.world.grab(body, point, orientation, coupling or _coupling_at(self, body))
        self.wake()
        return spring

    def release(self, spring: HandSpring | None = None) -> None:
        """Let one hand go, or all of them."""
        springs = self.world.grabs if spring is None else (spring,)
        for each in springs:
            self.world.release(each)
        if springs:
            self._note_touched()
            self.wake()

    def held_point(self, spring: HandSpring | None = None) -> Floats | None:
        """(3,) where the point in a hand is, the first if it is not said which, world."""
        spring = spring or self.held
        return None if spring is None else self.world.held_point(spring)

    # --- Time -----------------------------------------------------------------------------------

    def tick(
        self, seconds: float, hands: Mapping[HandSpring, HandSample] | None = None
    ) -> TickReport:
        """Simulate the real time that has passed, with hands on their way to where they are now.

        Hands are known by what they hold; who is not there stays where it was.
        """
        step = self.world.settings.step
        if self.resting:
            self._left, self._ratio = 0.0, 1.0
            return TickReport(0.0, 0, 1.0, step, resting=True)
        self._left += min(max(seconds, 0.0), LONGEST_TICK)
        count = int(self._left / step + 1e-9)
        self._left -= count * step
        if self._clock and self._length.load > 0.0:
            # Slower than real time is better than a window that stands still.
            count = min(count, max(1, int(LONGEST_WORK / (self._length.load * step))))
        before = self._clock() if self._clock else 0.0
        self.advance(count, hands or {})
        if self._clock and seconds > 0.0 and count:
            simulated = count * step
            self._ratio += 0.1 * (min(simulated / seconds, 1.0) - self._ratio)
            self.change(step=self._length.after(self._clock() - before, simulated, step))
        return TickReport(count * step, count, self._ratio, self.world.settings.step, resting=False)

    def advance(
        self, count: int, hands: Mapping[HandSpring, HandSample], *, share: float = 1.0
    ) -> None:
        """Take some steps, with hands going evenly from where they were to where they are now.

        They go a share of their way, less than 1 where simulated time falls behind: a target that
        jumps would yank the puppet.
        """
        world, passed = self.world, count * self.world.settings.step
        sweeps = [
            _Sweep.towards(spring, hand, share, passed) for spring, hand in hands.items() if count
        ]
        for number in range(1, count + 1):
            for sweep in sweeps:
                sweep.pull(number / count)
            self._let_yield()
            world.step()
        self.time += passed
        calm = float(np.abs(world.velocities()).max(initial=0.0)) < STILL
        self._calm = self._calm + passed if calm else 0.0
        self.changed = True

    def _let_yield(self) -> None:
        """Let joints give way that are pulled, and no others: in a quick drag their own inertia
        would bend limbs that nobody touches.

        Those that were pulled last go on giving way after the hand has let go. Where nobody holds
        a figure that has weight, all do.
        """
        world, joints = self.world, self._yielding
        if world.grabs:
            joints = world.pulled()
        elif any(world.settings.gravity):
            joints = None
        elif joints is not None:
            joints = joints | world.pulled()
        world.let_yield(joints)
        self._yielding = joints
        self.pulled = None if joints is None or self.pulled is None else self.pulled | joints

    # --- What can be changed on the way ----------------------------------------------------------

    @property
    def pins(self) -> dict[int, bool]:
        """Bodies that are nailed to their places, and whether their orientations are as well."""
        return self.world.pins

    def pin(self, body: int, *, state: bool, firm: bool = True) -> None:
        """Nail a body to where it is, if ``firm`` its orientation as well, or take the nail out."""
        if state:
            self.world.pin(body, firm=firm)
        else:
            self.world.unpin(body)
        self.wake()

    def change(self, **settings: Any) -> None:
        """Take other settings of the world (see ``WorldSettings``); motion goes on."""
        wanted = replace(self.world.settings, **settings)
        if wanted != self.world.settings:
            self.world.change(wanted)
            self.wake()

    def change_elements(self, elements: Elements) -> None:
        """Take joints of another material; what is bent stays bent."""
        self.world.set_elements(elements)
        self.wake()

    def change_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Take other obstacles, or the same ones elsewhere."""
        self.world.obstacles = tuple(obstacles)
        self.wake()

    # --- What has come of it ---------------------------------------------------------------------

    def touched(self) -> list[int]:
        """Bodies whose joint was pulled and turned in this session, and roots that were moved."""
        self._note_touched()
        return sorted(self._touched)

    def put_back(self) -> None:
        """Turn back what was turned by too little to count: a figure that is keyed where it was
        touched looks so.

        Of a figure in a hand that is what nobody pulls; where its weight bends it, nothing.
        """
        if self.pulled is None:
            return
        joints = ~self.pulled
        if not self.world.grabs:
            joints[:] = True
            joints[self.touched()] = False
        # Roots are where they are.
        joints[np.array(self.figure.parents) < 0] = False
        self._turn_back(joints, self._reference)

    def _turn_back(self, joints: Flags, pose: Pose) -> None:
        self.world.turn_back(joints, pose)
        self.changed = True

    def move_on(self, motion: Mapping[str, Floats]) -> None:
        """Take over where bodies are and how they move, as ``WorldSnapshot`` has them."""
        now = self.world.state()
        self.world.restore(replace(now, bodies={**now.bodies, **motion}))
        self.changed = True

    def adopt(self, pose: Pose) -> None:
        """Take a pose that was given from elsewhere, at rest; hands let go.

        It is where the figure is touched from: what was bent before is there no more.
        """
        self.release()
        self._touched.clear()
        self._before.clear()
        self._after.clear()
        old = self.world
        anchors = joints_of(self.figure.parents, pose)
        apart = np.linalg.norm(anchors - self.figure.anchors, axis=1)
        if (apart > ELSEWHERE * self.figure.lengths).any():
            # Bones are stretched there, or moved: another figure.
            figure = replace(self.figure, anchors=anchors)
            self.world = World(figure, pose, old.settings, old.obstacles)
            for body, firm in old.pins.items():
                self.world.pin(body, firm=firm)
        self.show(pose)
        self._reference = self.world.pose()
        self.pulled = np.zeros(len(self.figure), dtype=bool)

    def show(self, pose: Pose) -> None:
        """Stand in a pose at rest, pins where bodies are then; hands go on holding."""
        self.world.set_pose(pose)
        self.world.pin_here()
        # It may be bent anywhere.
        self.pulled = None
        self.wake()

    def come_to(self, pose: Pose) -> None:
        """The same where something else than hands and joints has led there: what was pulled stays
        what was pulled.
        """
        pulled = self.pulled
        self.show(pose)
        self.pulled = pulled

    def restore(self) -> None:
        self.release()
        self.remember()
        self.show(self._start)

    def step_back(self) -> bool:
        """Back to before the last grab or restoring; whether there was one."""
        return self._step(self._before, self._after)

    def step_forward(self) -> bool:
        """On to where the last step back came from; whether there was one since the last grab."""
        return self._step(self._after, self._before)

    def _step(self, taken: list[WorldSnapshot], kept: list[WorldSnapshot]) -> bool:
        self.release()
        if not taken:
            return False
        kept.append(self.world.state())
        # Contacts of another moment are no beginning: as in a pose that is given.
        self.world.set_pose(self.pose)
        self.move_on(taken.pop().bodies)
        self.world.pin_here()
        self.wake()
        return True

    def remember(self) -> None:
        """Let a step back lead to how all is now."""
        self._before.append(self.world.state())
        self._after.clear()
        del self._before[:-MOST_STEPS_BACK]

    def _note_touched(self) -> None:
        turned = turned_bodies(self.figure, self._reference, self.pose)
        if self.pulled is not None:
            # Others give way to nothing: what they are bent by now, they spring back.
            turned = [body for body in turned if self.pulled[body]]
        self._touched |= set(turned)
