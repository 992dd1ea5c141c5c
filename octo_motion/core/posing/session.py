# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of posing: a hand that holds a puppet, in simulated time that keeps up with the clock.

Everything here is plain numbers. Whoever has a window, a device or a script calls ``tick`` with
the time that has passed and where the hand is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from .picking import Hit
from .puppet import Elements, Figure, Pose, joints_of, turned_bodies
from .solver import Coupling, Grab, Obstacle, World, WorldSettings, WorldState

COARSEST: Final = 4e-3
"""Seconds: longer steps would let a fast hand shake the puppet."""
LONGEST_TICK: Final = 0.1
"""Seconds: what is longer (Blender was busy) is not made up for, so that nothing jerks."""
LONGEST_WORK: Final = 0.1
"""Seconds that one tick may compute."""
TOUCHED: Final = float(np.radians(0.1))
"""A joint that was turned by more counts as touched."""
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


@dataclass(frozen=True, eq=False)
class HandSample:
    """Where the hand is."""

    position: Floats
    """(3,) to which the grabbed point is pulled, world."""
    orientation: Floats
    """(4,) how the hand is turned since it grabbed."""


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


@dataclass(eq=False)
class Grip:
    """What the hand holds."""

    body: int
    handle: Grab
    position: Floats
    """(3,) where the hand is, world."""
    turn: Floats
    """(4,) the hand's turn since it took hold."""
    turns: bool = False
    """Whether the hand has turned: only then does it keep the bone from turning by itself."""


def hand_for(figure: Figure, strength: float = 1.0) -> Coupling:
    """A hand that bends joints of a strength, and not many times more.

    A mouse asks for any place at all. Pulled far beyond its reach with all the force that a hand
    could have, a chain of light bones would be a string under a tension that long steps cannot
    simulate; three times the figure's weight is plenty.
    """
    return Coupling.for_figure(figure, GENTLE * max(strength, 1.0))


class Session:
    """A figure in a world, and a hand.

    Args:
        figure: the puppet.
        pose: where it starts.
        settings: of the world; their step is the nominal one.
        obstacles: what it can touch.
        clock: seconds; without, no tick asks for the time, steps stay as they are, and the same
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
        self.figure = figure
        self.world = World(figure, pose, settings, obstacles)
        self.grip: Grip | None = None
        self.hand = hand_for(figure)
        """How firmly the next grab holds."""
        self.time = 0.0
        """Simulated seconds."""
        self._start = self.world.pose()
        self._reference = self._start
        self._touched: set[int] = set()
        self._nominal = settings.step
        self._clock = clock
        self._left = 0.0
        self._load = 0.0
        self._ratio = 1.0
        self._calm = 0.0
        self._firm: dict[int, bool] = {}
        self._before: list[WorldState] = []
        for body in sorted(settings.pinned):
            self.pin(body, state=True)

    # --- The hand -----------------------------------------------------------------------------

    @property
    def pose(self) -> Pose:
        """Where the bodies are."""
        return self.world.pose()

    @property
    def pins(self) -> frozenset[int]:
        """Bodies that are nailed to their places."""
        return self.world.pinned

    def grab(self, hit: Hit) -> None:
        """Take hold of a body at a point; what was held is let go."""
        self.release()
        self._before.append(self.world.state())
        del self._before[:-MOST_STEPS_BACK]
        handle = self.world.grab(hit.body, hit.point, IDENTITY, self.hand)
        self.grip = Grip(hit.body, handle, np.array(hit.point, dtype=np.float64), IDENTITY.copy())
        self._calm = 0.0

    def release(self) -> None:
        """Let go."""
        if self.grip is not None:
            self.world.release(self.grip.handle)
            self.grip = None
            self._calm = 0.0
            self._note_touched()

    def held_point(self) -> Floats | None:
        """(3,) where the point in the hand is, world."""
        return None if self.grip is None else self.world.held_point(self.grip.handle)

    def force(self) -> Floats:
        """(3,) with which the hand pulls, newton."""
        return np.zeros(3) if self.grip is None else self.grip.handle.wrench[:3].copy()

    def pin(self, body: int, *, state: bool, firm: bool = True) -> None:
        """Nail a body to where it is, or take the nail out.

        Args:
            body: its index.
            state: whether it is pinned from now on.
            firm: whether it keeps its orientation as well as the place of its joint.
        """
        if state:
            self._firm[body] = firm
            self.world.pin(body, firm=firm)
        else:
            self._firm.pop(body, None)
            self.world.unpin(body)
        self._calm = 0.0

    def _pin_again(self) -> None:
        """Pins hold where bodies are now: they were put elsewhere."""
        for body, firm in sorted(self._firm.items()):
            self.world.pin(body, firm=firm)

    # --- Time -----------------------------------------------------------------------------------

    def tick(self, seconds: float, sample: HandSample | None = None) -> TickReport:
        """Simulate what has passed, with the hand on its way to where it is now.

        Args:
            seconds: real time since the last tick.
            sample: the hand; where it was, if none is given. Without a grip it does nothing.
        """
        step = self.world.settings.step
        if self.grip is None and self._calm >= REST_TIME:
            self._left, self._ratio = 0.0, 1.0
            return TickReport(0.0, 0, 1.0, step, resting=True)
        self._left += min(max(seconds, 0.0), LONGEST_TICK)
        count = int(self._left / step + 1e-9)
        self._left -= count * step
        if self._clock and self._load > 0.0:
            # Slower than real time is better than a window that stands still.
            count = min(count, max(1, int(LONGEST_WORK / (self._load * step))))
        before = self._clock() if self._clock else 0.0
        self._run(count, sample)
        if self._clock and seconds > 0.0:
            self._keep_up(self._clock() - before, count * step, seconds)
        return TickReport(count * step, count, self._ratio, self.world.settings.step, resting=False)

    def _run(self, count: int, sample: HandSample | None) -> None:
        world, grip = self.world, self.grip
        if grip is None:
            for _ in range(count):
                world.step()
        elif count:
            start, turned = grip.position, grip.turn
            way, swing = np.zeros(3), np.zeros(3)
            if sample is not None:
                way = sample.position - start
                swing = to_rotation_vector(multiply(sample.orientation, conjugate(turned)))
                grip.turns = grip.turns or bool(np.linalg.norm(swing) > 0.0)
            for number in range(1, count + 1):
                # The hand moves evenly from where it was: a tick is many steps long.
                share = number / count
                grip.position = start + share * way
                grip.turn = multiply(from_rotation_vector(share * swing), turned)
                world.pull(grip.handle, grip.position, grip.turn if grip.turns else None)
                world.step()
        passed = count * world.settings.step
        self.time += passed
        speeds = world.velocities()
        calm = float(np.abs(speeds).max(initial=0.0)) < STILL
        self._calm = self._calm + passed if calm else 0.0

    def _keep_up(self, spent: float, simulated: float, seconds: float) -> None:
        """Lengthen steps that take too long, shorten them when there is time again."""
        if simulated <= 0.0:
            return
        self._load += 0.2 * (spent / simulated - self._load)
        self._ratio += 0.1 * (min(simulated / seconds, 1.0) - self._ratio)
        step = self.world.settings.step
        if self._load > BUSY and step < COARSEST:
            self.change(step=min(2.0 * step, COARSEST))
            self._load *= 0.5
        elif self._load < 0.4 * BUSY and step > self._nominal:
            self.change(step=max(0.5 * step, self._nominal))
            self._load *= 2.0

    # --- What can be changed on the way ----------------------------------------------------------

    def change(self, **settings: Any) -> None:
        """Take other settings of the world (see ``WorldSettings``); motion goes on."""
        if all(getattr(self.world.settings, name) == value for name, value in settings.items()):
            return
        self._rebuild(replace(self.world.settings, **settings, pinned=frozenset()))

    def change_elements(self, elements: Elements) -> None:
        """Take joints of another material; what is bent stays bent."""
        self.figure = replace(self.figure, elements=elements)
        self.world.set_elements(elements)
        self._calm = 0.0

    def change_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Take other obstacles, or the same ones elsewhere."""
        self.world.obstacles = tuple(obstacles)
        self._calm = 0.0

    def _rebuild(self, settings: WorldSettings) -> None:
        old, grip = self.world, self.grip
        self.world = World(self.figure, old.pose(), settings, old.obstacles)
        self._pin_again()
        self.world.restore(old.state())
        if grip is not None:
            held = grip.handle
            grip.handle = self.world.grab(
                grip.body, old.held_point(held), held.target_orientation, held.coupling
            )
            grip.handle.point, grip.handle.grip = held.point, held.grip
            grip.handle.wrench = held.wrench
        self._calm = 0.0

    # --- What has come of it ---------------------------------------------------------------------

    def touched(self) -> list[int]:
        """Bodies whose joint was turned in this session, and roots that were moved."""
        self._note_touched()
        return sorted(self._touched)

    def adopt(self, pose: Pose) -> None:
        """Take a pose that was given from elsewhere, at rest; the hand lets go.

        It is where the figure is touched from: what was bent before is there no more.
        """
        self.release()
        self._touched.clear()
        anchors = joints_of(self.figure.parents, pose)
        apart = np.linalg.norm(anchors - self.figure.anchors, axis=1)
        if (apart > ELSEWHERE * self.figure.lengths).any():
            # Bones are stretched there, or moved.
            self.figure = replace(self.figure, anchors=anchors)
            self._rebuild(replace(self.world.settings, pinned=frozenset()))
        self.world.set_pose(pose)
        self._pin_again()
        self._reference = self.world.pose()
        self._before.clear()
        self._calm = 0.0

    def restore(self) -> None:
        """Back to the pose at the start."""
        self.release()
        self._before.append(self.world.state())
        self.world.set_pose(self._start)
        self._pin_again()
        self._calm = 0.0

    def step_back(self) -> bool:
        """Back to before the last grab; whether there was one."""
        self.release()
        if not self._before:
            return False
        self.world.restore(self._before.pop())
        self._pin_again()
        self._calm = 0.0
        return True

    def _note_touched(self) -> None:
        self._touched |= set(turned_bodies(self.figure, self._reference, self.pose, TOUCHED))
