# SPDX-License-Identifier: GPL-3.0-or-later
"""The puppet in the bridge: stepped in real time, held by the hands at the devices."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from ..core.posing.picking import capsules_in_world
from ..core.posing.puppet import Figure, Pose
from ..core.posing.solver import Coupling, Obstacle, World, WorldSettings
from ..core.posing.solver import Grab as Handle
from ..core.rotations import (
    Floats,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from .held_body import Pull
from .ipc import DeviceMessage, HandMessage, HeldMessage, Settings
from .spatial import IDENTITY, ZERO, Vector

log = logging.getLogger(__name__)

COARSEST: Final = 8e-3
"""s: longer steps are not taken; then simulated time falls behind the clock."""
BUSY: Final = 0.7
"""Share of real time that steps may take; above, they get longer."""
FELT: Final = 0.1
"""Of the puppet's weight, held with all the force that a device has: what bends a limb is then
felt as a good part of that."""
_SLACK: Final = 0.1
"""Of the puppet's size, by which a hand that lifts it all is ahead of it at most."""
_STILL: Final = 2e-3
_REST_SECONDS: Final = 0.3
_PROBE: Final = 1e-3
"""Of the puppet's weight: the push with which a held body's mobility is measured."""
_TOO_SLOW: Final = 0.05
"""s for a step, with which seven more at a grab would be noticed."""
_PROMPT: Final = 0.01
"""s from one step to the next, up to which the hand waits for the next and nothing else."""
_EXPECTED: Final = 0.1
"""Of one more turn, in what is expected of the next: one late turn alone is no slow simulation."""
_AT_ONCE: Final = 5
"""Steps in a turn, at most: after a longer pause the puppet is not hurried."""
_LATE: Final = 1.5
"""Times the expected turn, before the next one counts as late."""
_STALE: Final = 0.25
"""s without a word from a hand: it has let go."""
_PAUSE: Final = 0.05
"""s: a longer turn means that the whole machine was busy, and the hand could not speak either."""


@dataclass
class SimulatedPointer:
    """A pointer, as the simulation knows it."""

    told: HandMessage
    device: DeviceMessage | None = None
    scale: float = 1.0
    """m of the scene for a metre of the hand."""
    handle: Handle | None = None
    grab: int = 0
    """The grab that the handle answers."""
    refused: int = 0
    """The grab that found nothing near."""
    pull: Pull = field(default_factory=Pull)
    silence: float = 0.0
    """s that this process has run without a word from the hand."""


@dataclass(frozen=True, eq=False)
class _Way:
    """What a hand's target does in one turn."""

    handle: Handle
    start: Floats
    way: Floats
    """(3,) m"""
    turned: Floats
    """(4,) at the start."""
    swing: Floats
    """(3,) rotation vector."""
    velocity: Floats
    """(6,)"""

    @classmethod
    def to(cls, handle: Handle, told: HandMessage, share: float, seconds: float) -> _Way:
        """The way towards a hand; seconds that it takes, 0: the hand's own velocity holds."""
        assert handle.target_orientation is not None
        way = share * (np.array(told.position) - handle.target_position)
        turned = handle.target_orientation
        swing = share * to_rotation_vector(multiply(np.array(told.orientation), conjugate(turned)))
        velocity = np.array((*told.velocity, *told.angular_velocity))
        if seconds > 0.0:
            velocity = np.concatenate([way, swing]) / seconds
        return cls(handle, handle.target_position, way, turned, swing, velocity)

    def go(self, world: World, share: float) -> None:
        """Move the target along."""
        turn = multiply(from_rotation_vector(share * self.swing), self.turned)
        world.pull(self.handle, self.start + share * self.way, turn, self.velocity)


class Simulation:
    """A world, and the hands in it."""

    def __init__(
        self,
        figure: Figure,
        pose: Pose,
        settings: WorldSettings,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.world = World(figure, pose, settings)
        self.hands: dict[int, SimulatedPointer] = {}
        self.reach = Settings.reach
        self.steps = 0
        self.cost = 0.0
        """s that a step takes to compute, of late."""
        self.time = 0.0
        """s simulated since the figure came."""
        self.changed = True
        """Whether something may have moved since the last time that the pose was told."""
        self._nominal = settings.step
        self._clock = clock
        self._load = 0.0
        self._due = 0.0
        self._simulated = 0.0
        self._turn = 0.0
        self._turns = 0
        self._calm = 0.0
        self._now = -math.inf
        self._obstacles: dict[int, Obstacle] = {}
        self._pins: dict[int, bool] = {}

    @property
    def resting(self) -> bool:
        """Whether nothing is held and nothing moves."""
        return self._calm >= _REST_SECONDS and not any(each.handle for each in self.hands.values())

    @property
    def step_seconds(self) -> float:
        """Of one step, h."""
        return self.world.settings.step

    # --- What is told ----------------------------------------------------------------------------

    def place(self, pose: Pose) -> None:
        """Put the puppet into a pose, at rest; hands let go."""
        for hand in self.hands.values():
            hand.refused = hand.told.grab  # let go is let go, until it grabs anew
            self._release(hand)
        self.world.set_pose(pose)
        self._pin_again()
        self._wake()

    def pin(self, pins: dict[int, bool]) -> None:
        """Pin these bodies where they are, and no others.

        Args:
            pins: By body, whether its orientation is held as well.
        """
        for body in self.world.pinned - pins.keys():
            self.world.unpin(body)
        for body, firm in sorted(pins.items()):
            if body not in self.world.pinned or self._pins.get(body) != firm:
                self.world.pin(body, firm=firm)
        self._pins = dict(pins)
        self._wake()

    def _pin_again(self) -> None:
        for body, firm in sorted(self._pins.items()):
            self.world.pin(body, firm=firm)

    def put_obstacle(self, number: int, obstacle: Obstacle | None) -> None:
        """Add, move or take away something solid."""
        if obstacle is None:
            self._obstacles.pop(number, None)
        else:
            self._obstacles[number] = obstacle
        self.world.obstacles = tuple(self._obstacles.values())
        self._wake()

    def change(self, settings: WorldSettings) -> None:
        """Take other settings; motion goes on."""
        self._nominal = settings.step
        self._rebuild(settings)

    def hear(
        self, message: HandMessage, device: DeviceMessage | None = None, scale: float = 1.0
    ) -> None:
        """Take over where a hand is, what it wants, and grab or let go.

        Args:
            message: The hand's newest word.
            device: What it holds in reality.
            scale: m of the scene for a metre of the hand.
        """
        hand = self.hands.setdefault(message.pointer, SimulatedPointer(message))
        if message.time != hand.told.time:
            hand.silence = 0.0
        hand.told, hand.device, hand.scale = message, device, scale
        if hand.handle is not None and message.grab != hand.grab:
            self._release(hand)
        if message.grab and hand.handle is None and message.grab != hand.refused:
            self._grab(hand)

    def forget(self, pointer: int) -> None:
        """A hand is gone."""
        hand = self.hands.pop(pointer, None)
        if hand is not None:
            self._release(hand)

    def _grab(self, hand: SimulatedPointer) -> None:
        point, turn = np.array(hand.told.position), np.array(hand.told.orientation)
        body, gap = nearest_body(self.world.figure, self.world.pose(), point)
        if gap > self.reach:
            hand.refused = hand.told.grab
            return
        # A machine too slow for the measurement goes on without: the body then keeps its velocity.
        mobility, angular = (0.0, 0.0) if self.cost > _TOO_SLOW else self._mobility(body, point)
        coupling = self._coupling(hand)
        hand.handle = self.world.grab(body, point, turn, coupling)
        self.world.pull(hand.handle, point, turn)
        hand.grab = hand.told.grab
        hand.pull = Pull(
            *(coupling.stiffness, coupling.damping, coupling.turning_stiffness),
            *(coupling.turning_damping, mobility, angular),
        )
        self._wake()

    def _release(self, hand: SimulatedPointer) -> None:
        if hand.handle is not None:
            self.world.release(hand.handle)
        hand.handle, hand.grab = None, 0
        self._wake()

    def _coupling(self, hand: SimulatedPointer) -> Coupling:
        """How firmly a hand holds: so that what it can feel fits the puppet's weight.

        The hand feels its own spring over the way by which the body lags behind. A world's
        spring r times as stiff then means that r newtons on the puppet are one on the hand. But
        the softest device must still move the puppet: the world's spring lifts it all when it is
        drawn out by a tenth of the puppet's size.
        """
        figure = self.world.figure
        firm = Coupling.for_figure(figure)
        device = hand.device
        if device is None or device.force <= 0.0 or device.stiffness <= 0.0:
            return firm
        weight = float(figure.masses.sum()) * 9.81
        size = float(np.ptp(capsules_in_world(figure, self.world.pose()), axis=(0, 1)).max())
        arm = float(np.median(figure.lengths))
        softest = weight / (_SLACK * size)
        wanted = FELT * weight / device.force * device.stiffness / hand.scale
        stiffness = min(firm.stiffness, max(softest, wanted))
        turning = firm.turning_stiffness
        if device.angular_stiffness > 0.0 and device.torque > 0.0:
            wanted = FELT * weight * arm / device.torque * device.angular_stiffness
            turning = min(turning, max(softest * arm * arm, wanted))
        return replace(
            firm,
            stiffness=stiffness,
            damping=firm.damping * math.sqrt(stiffness / firm.stiffness),
            turning_stiffness=turning,
            turning_damping=firm.turning_damping * math.sqrt(turning / firm.turning_stiffness),
        )

    def _mobility(self, body: int, point: Floats) -> tuple[float, float]:
        """How easily a body gives way at a point: 1/kg and 1/(kg·m²), averaged over directions.

        Measured, with everything that holds it: one step with a small push each way, against one
        without, and time turned back after each.
        """
        world = self.world
        before = world.state()
        h = world.settings.step
        size = _PROBE * float(world.figure.masses.sum()) * 9.81
        pose = world.pose()
        centre = pose.positions[body] + rotate(pose.orientations[body], world.figure.centres[body])
        lever = point - centre

        def after(force: Floats, torque: Floats) -> tuple[Floats, Floats]:
            kept = world.forces[body].copy()
            world.forces[body] += np.concatenate([force, torque + np.cross(lever, force)])
            world.step()
            velocity = world.velocities()[body]
            world.forces[body] = kept
            world.restore(before)
            return velocity[:3] + np.cross(velocity[3:], lever), velocity[3:]

        still, still_turning = after(np.zeros(3), np.zeros(3))
        gives = turns = 0.0
        for axis in np.eye(3):
            moved, _ = after(size * axis, np.zeros(3))
            _, turned = after(np.zeros(3), size * axis)
            gives += float((moved - still) @ axis)
            turns += float((turned - still_turning) @ axis)
        return max(0.0, gives) / (3.0 * size * h), max(0.0, turns) / (3.0 * size * h)

    # --- Time ------------------------------------------------------------------------------------

    def step(self, now: float) -> None:
        """Go on by what has passed, with the hands where they were last heard of.

        That is one step as a rule, and a few where the machine did not wake this process in time;
        what would take longer than there is time is left out, and simulated time falls behind.
        """
        for hand in self.hands.values():
            if hand.handle is None:
                continue
            hand.silence += min(now - self._now, _PAUSE)
            if hand.silence > _STALE:
                log.info("A hand was not heard of for %.2f s and let go", hand.silence)
                hand.refused = hand.grab  # let go is let go, until it grabs anew
                self._release(hand)
        passed, self._now = now - self._now, now
        if self.resting:
            return
        h = self.step_seconds
        count = self._count(passed)
        self._time(passed, count * h)
        before = self._clock()
        ways = self._ways(passed, count * h)
        for number in range(1, count + 1):
            for way in ways:
                way.go(self.world, number / count)
            self.world.step()
        spent = (self._clock() - before) / max(count, 1)
        self.steps += count
        self.time += count * h
        self.changed = True
        calm = float(np.abs(self.world.velocities()).max(initial=0.0)) < _STILL
        self._calm = self._calm + count * h if calm else 0.0
        if count:
            self.cost += (0.05 if self.cost > 0.0 else 1.0) * (spent - self.cost)

    def _ways(self, passed: float, simulated: float) -> list[_Way]:
        """Where the held bodies are drawn in this turn.

        To where the hands are, as a rule. Where simulated time falls behind, only as much of the
        way as is simulated of the time: a target that jumps would yank the puppet.
        """
        late = simulated < 0.7 * passed < math.inf
        share = simulated / passed if late else 1.0
        return [
            _Way.to(hand.handle, hand.told, share, simulated if late else 0.0)
            for hand in self.hands.values()
            if hand.handle is not None
        ]

    def _count(self, passed: float) -> int:
        """How many steps are due, and can be afforded; never more than real time asks for."""
        h = self.step_seconds
        if not 0.0 < passed < _STALE:
            self._due = 0.0
            return 1
        self._due += passed
        count = wanted = round(self._due / h)
        if count > 1:
            affordable = int(BUSY * passed / self.cost) if self.cost > 0.0 else 1
            count = max(1, min(count, affordable, _AT_ONCE))
        self._due = 0.0 if count < wanted else self._due - count * h
        return count

    def _time(self, passed: float, simulated: float) -> None:
        """Learn from one more turn how long they take, and how much of that is simulated."""
        if not 0.0 < passed < _STALE:
            return
        self._turns += 1
        share = max(_EXPECTED, 1.0 / self._turns)
        self._turn += share * (passed - self._turn)
        self._simulated += share * (simulated - self._simulated)

    @property
    def pace(self) -> float:
        """Simulated against real time, of late; 1 keeps up."""
        return min(1.0, self._simulated / self._turn) if self._turn > 0.0 else 1.0

    @property
    def holds(self) -> float:
        """For how many seconds hands need not expect the next step; 0 where they come promptly."""
        return _LATE * self._turn if self._turn > _PROMPT else 0.0

    def worked(self, seconds: float) -> None:
        """Lengthen steps if turns take too long, shorten them when there is time again.

        Args:
            seconds: that a whole turn took to compute: the step, and all that is heard and told.
        """
        if self.resting:
            return
        h = self.step_seconds
        self._load += 0.05 * (seconds - self._load)
        if self._load > BUSY * h and h < COARSEST:
            self._rebuild(replace(self.world.settings, step=min(2.0 * h, COARSEST)))
        elif self._load < 0.3 * BUSY * h and h > self._nominal:
            self._rebuild(replace(self.world.settings, step=max(0.5 * h, self._nominal)))

    def _rebuild(self, settings: WorldSettings) -> None:
        old = self.world
        self.world = World(
            *(old.figure, old.pose(), replace(settings, pinned=frozenset()), old.obstacles)
        )
        self.world.restore(old.state())
        self._pin_again()
        for hand in self.hands.values():
            if hand.handle is not None:
                held = hand.handle
                hand.handle = self.world.grab(
                    *(held.body, old.held_point(held), held.target_orientation, held.coupling)
                )
                hand.handle.point, hand.handle.grip = held.point, held.grip
                hand.handle.wrench = held.wrench
        self._wake()

    def _wake(self) -> None:
        self._calm = 0.0
        self.changed = True

    # --- What is told back -----------------------------------------------------------------------

    def held(self, now: float) -> Iterator[HeldMessage]:
        """For each hand that wants something: where what it holds is, which was true at ``now``."""
        for pointer, hand in self.hands.items():
            if hand.told.grab:
                yield self._held(pointer, hand, now)

    def _held(self, pointer: int, hand: SimulatedPointer, now: float) -> HeldMessage:
        grab = hand.handle
        if grab is None:
            return HeldMessage(
                *(pointer, hand.told.grab, False, now, 0.0),
                *(ZERO, IDENTITY, ZERO, ZERO, Pull(), ZERO, ZERO),
            )
        place, turn = self.coupled(grab)
        # What the hand sees: where simulated time is slow, all moves slowly and is hard to move.
        pace = self.pace
        velocity = pace * self.world.velocities()[grab.body]
        pull = hand.pull._replace(
            mobility=pace * pace * hand.pull.mobility,
            angular_mobility=pace * pace * hand.pull.angular_mobility,
        )
        pose = self.world.pose()
        centre = pose.positions[grab.body] + rotate(
            pose.orientations[grab.body], self.world.figure.centres[grab.body]
        )
        at_point = velocity[:3] + np.cross(velocity[3:], place - centre)
        w, x, y, z = map(float, turn)
        return HeldMessage(
            *(pointer, hand.grab, True, now, self.holds, _tuple(place), (w, x, y, z)),
            *(_tuple(at_point), _tuple(velocity[3:]), pull),
            *(_tuple(grab.wrench[:3]), _tuple(grab.wrench[3:])),
        )

    def coupled(self, grab: Handle) -> tuple[Floats, Floats]:
        """Where the held point is, and how a hand would be turned that held it without lag."""
        turn = multiply(self.world.pose().orientations[grab.body], conjugate(grab.grip))
        return self.world.held_point(grab), turn


def nearest_body(figure: Figure, pose: Pose, point: Floats) -> tuple[int, float]:
    """The body nearest to a point (3,), and how far its surface is; less than 0 within."""
    ends = capsules_in_world(figure, pose)
    axis = ends[:, 1] - ends[:, 0]
    along = ((point - ends[:, 0]) * axis).sum(axis=1)
    share = np.clip(along / np.maximum((axis * axis).sum(axis=1), 1e-12), 0.0, 1.0)
    gaps = np.linalg.norm(ends[:, 0] + share[:, None] * axis - point, axis=1) - figure.radii
    body = int(np.argmin(gaps))
    return body, float(gaps[body])


def _tuple(values: Floats) -> Vector:
    x, y, z = map(float, values)
    return (x, y, z)
