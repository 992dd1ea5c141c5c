# SPDX-License-Identifier: GPL-3.0-or-later
"""The session of posing in the bridge: held by hands at devices, in time with the clock, and by
hands of Blender's, which has time go on by ticks where there is no device.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from ..core.posing.balance import keep_balance
from ..core.posing.picking import nearest_body
from ..core.posing.puppet import Figure, Pose, bodies_with, capsules_in_world, part_of
from ..core.posing.session import (
    LONGEST_TICK,
    LONGEST_WORK,
    HandSample,
    Session,
    StepLength,
    TickReport,
)
from ..core.posing.solver import Coupling, HandSpring, World, WorldSettings
from ..core.rotations import Floats, conjugate, multiply, rotate
from ..core.rotations.scalars import Vector
from .messages import (
    MOST_HANDS,
    DeviceMessage,
    HandMessage,
    HeldMessage,
    MessageError,
    Pull,
    Settings,
    Take,
    Tick,
    TurnBack,
)

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
_PARTS: Final = 5
"""In which the time that a long redraw took is simulated, at most: what is longer is a pause."""
_LATE: Final = 1.5
"""Times the expected turn, before the next one counts as late."""
_STALE: Final = 0.25
"""s without a message from a hand: it has let go."""
_PAUSE: Final = 0.05
"""s: a longer turn means that the whole machine was busy, and the hand could not speak either."""


@dataclass
class SimulatedPointer:
    """A pointer, as the simulation knows it."""

    message: HandMessage
    """The newest of the hand."""
    device: DeviceMessage | None = None
    scale: float = 1.0
    """m of the scene for a metre of the hand."""
    spring: HandSpring | None = None
    """What it holds."""
    grab: int = 0
    """The grab that holds it."""
    refused: int = 0
    """The grab that found nothing near."""
    pull: Pull = field(default_factory=Pull)
    silence: float = 0.0
    """s that this process has run without a message from the hand."""

    def sample(self) -> HandSample:
        message = self.message
        velocity = np.array((*message.velocity, *message.angular_velocity))
        return HandSample(np.array(message.position), np.array(message.orientation), velocity)


class Simulation:
    """A session of posing whose hands are at devices, kept in time with the clock (s) of those.

    The step in the settings is the nominal one.
    """

    def __init__(
        self,
        figure: Figure,
        pose: Pose,
        settings: WorldSettings,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.session = Session(figure, pose, settings, clock=clock)
        self.hands: dict[int, SimulatedPointer] = {}
        self.own: dict[int, HandSpring] = {}
        """What hands of Blender's hold, by their numbers."""
        self.ticked = False
        """Whether Blender says what time has passed there."""
        self._own_way: dict[HandSpring, HandSample] = {}
        self._own_time = 0.0
        self._balanced = range(0)
        self.reach = Settings.reach
        self.steps = 0
        self.cost = 0.0
        """s that a step takes to compute, of late."""
        self._length = StepLength(settings.step, COARSEST, BUSY, 0.3, 0.05)
        self._clock = clock
        self._due = 0.0
        self._simulated = 0.0
        self._turn = 0.0
        self._turns = 0
        self._now = -math.inf

    @property
    def world(self) -> World:
        return self.session.world

    @property
    def step_seconds(self) -> float:
        """Of one step, h."""
        return self.world.settings.step

    # --- What Blender and the devices say --------------------------------------------------------

    def place(self, pose: Pose, motion: Mapping[str, Floats] | None = None) -> None:
        """Put the puppet into a pose, at rest or in motion as ``WorldSnapshot`` has it; hands let
        go.
        """
        for hand in self.hands.values():
            hand.refused = hand.message.grab  # let go is let go, until it grabs anew
            self._release(hand)
        self.own.clear()
        self._own_way.clear()
        self.session.adopt(pose)
        self.session.move_on(motion or {})
        self.world.pin_here()

    def pin(self, pins: dict[int, bool]) -> None:
        """Pin these bodies and no others where they are; those that say so do not turn either."""
        before = self.session.pins
        for body in before.keys() - pins.keys():
            self.session.pin(body, state=False)
        for body, firm in sorted(pins.items()):
            if before.get(body) != firm:
                self.session.pin(body, state=True, firm=firm)

    def change(self, settings: WorldSettings) -> None:
        """Take other settings; motion goes on."""
        self._length.nominal = settings.step
        self.session.change(**vars(settings))

    # --- Hands of Blender's ----------------------------------------------------------------------

    @property
    def keeps_time(self) -> bool:
        """Whether time goes on by the clock: hands at devices do not wait for Blender."""
        return bool(self.hands) or not self.ticked

    def take(self, message: Take) -> None:
        """Let one more hand of Blender's take hold.

        Raises:
            MessageError: there is no such body, or there are too many hands.
        """
        if message.body >= len(self.session.figure) or len(self.own) >= MOST_HANDS:
            raise MessageError("a hand on nothing")
        coupling = message.coupling()
        self.let_go(message.hand)
        point = np.array(message.point)
        self.own[message.hand] = self.session.grab(message.body, point, coupling=coupling)

    def let_go(self, hand: int) -> None:
        """A hand of Blender's lets go; one that holds nothing is left alone."""
        spring = self.own.pop(hand, None)
        if spring is not None:
            self._own_way.pop(spring, None)
            self.session.release(spring)

    def turn_back(self, message: TurnBack) -> None:
        """Turn some joints back, while all else goes on."""
        pose = message.pose(len(self.session.figure))
        self.session.world.turn_back(np.array(message.joints, dtype=bool), pose)
        self.session.changed = True

    def tick(self, message: Tick) -> TickReport:
        """Blender's hands are there now; simulate the time that has passed, if nobody else does."""
        session, self.ticked = self.session, True
        samples = {
            self.own[hand]: sample for hand, sample in message.samples().items() if hand in self.own
        }
        self._balanced = range(min(message.balanced, len(session.figure)))
        if self.keeps_time:
            # They go there within the time that the next tick takes to come.
            self._own_way, self._own_time = samples, message.seconds
            return TickReport(0.0, 0, self.pace, self.step_seconds, resting=session.resting)
        # A redraw may take long: physics does not wait for it, as long as it keeps up itself.
        count = min(max(1, math.ceil(message.seconds / LONGEST_TICK - 1e-9)), _PARTS)
        begun, simulated, steps = self._clock(), 0.0, 0
        report = TickReport(0.0, 0, 1.0, self.step_seconds, resting=session.resting)
        for left in range(count, 0, -1):
            keep_balance(session, self._balanced)
            ways = {spring: replace(way, share=1.0 / left) for spring, way in samples.items()}
            report = session.tick(message.seconds / count, ways)
            simulated, steps = simulated + report.simulated, steps + report.steps
            if self._clock() - begun > LONGEST_WORK:
                break
        self.steps += steps
        return replace(report, simulated=simulated, steps=steps)

    def _samples(self, simulated: float) -> dict[HandSpring, HandSample]:
        """Where all hands are that hold something, after so many seconds of their way."""
        found = {hand.spring: hand.sample() for hand in self.hands.values() if hand.spring}
        left = self._own_time
        share = min(1.0, simulated / left) if left > 0.0 else 1.0
        self._own_time = max(0.0, left - simulated)
        return found | {each: replace(way, share=share) for each, way in self._own_way.items()}

    # --- Hands at devices ------------------------------------------------------------------------

    def hear(
        self, message: HandMessage, device: DeviceMessage | None = None, scale: float = 1.0
    ) -> None:
        """Take over where a hand is and what it wants, and grab or let go.

        The device is what it holds in reality; a metre of its way is ``scale`` m of the scene.
        """
        hand = self.hands.setdefault(message.pointer, SimulatedPointer(message))
        if message.time != hand.message.time:
            hand.silence = 0.0
        hand.message, hand.device, hand.scale = message, device, scale
        if hand.spring is not None and message.grab != hand.grab:
            self._release(hand)
        if message.grab and hand.spring is None and message.grab != hand.refused:
            self._grab(hand)

    def forget(self, pointer: int) -> None:
        """A hand is gone."""
        hand = self.hands.pop(pointer, None)
        if hand is not None:
            self._release(hand)

    def _grab(self, hand: SimulatedPointer) -> None:
        message, session = hand.message, self.session
        point = np.array(message.position)
        body, gap = nearest_body(session.figure, session.pose, point)
        if gap > self.reach:
            hand.refused = message.grab
            return
        # A machine too slow for the measurement goes on without: the body then keeps its velocity.
        slow = self.cost > _TOO_SLOW
        mobility, angular = (0.0, 0.0) if slow else _mobility(self.world, body, point)
        which, pose = bodies_with(session.figure, body), session.pose
        coupling = coupling_for(
            part_of(session.figure, body),
            Pose(pose.positions[which], pose.orientations[which]),
            hand.device,
            hand.scale,
        )
        hand.spring = session.grab(body, point, np.array(message.orientation), coupling)
        hand.grab = message.grab
        hand.pull = Pull(
            *(coupling.stiffness, coupling.damping, coupling.turning_stiffness),
            *(coupling.turning_damping, mobility, angular),
        )

    def _release(self, hand: SimulatedPointer) -> None:
        if hand.spring is not None:
            self.session.release(hand.spring)
        hand.spring, hand.grab = None, 0

    # --- Time ------------------------------------------------------------------------------------

    def step(self, now: float) -> None:
        """Go on by what has passed, with the hands where they were last heard of.

        That is one step as a rule, and a few where the machine did not wake this process in time;
        what would take longer than there is time is left out, and simulated time falls behind.
        """
        for hand in self.hands.values():
            if hand.spring is None:
                continue
            hand.silence += min(now - self._now, _PAUSE)
            if hand.silence > _STALE:
                log.info("A hand was not heard of for %.2f s and let go", hand.silence)
                hand.refused = hand.grab  # let go is let go, until it grabs anew
                self._release(hand)
        passed, self._now = now - self._now, now
        if not self.keeps_time:
            return
        keep_balance(self.session, self._balanced)
        if self.session.resting:
            return
        h = self.step_seconds
        count = self._count(passed)
        simulated = count * h
        self._time(passed, simulated)
        # Where simulated time falls behind, hands go only as much of their way as is simulated of
        # the time.
        late = simulated < 0.7 * passed < math.inf
        before = self._clock()
        self.session.advance(
            count,
            self._samples(simulated),
            share=simulated / passed if late else 1.0,
        )
        self.steps += count
        if count:
            spent = (self._clock() - before) / count
            self.cost += (0.05 if self.cost > 0.0 else 1.0) * (spent - self.cost)

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
        """Lengthen steps if whole turns, messages and all, take too long, or shorten them again."""
        if self.keeps_time and not self.session.resting:
            step = self.step_seconds
            self.session.change(step=self._length.after(seconds, step, step))

    # --- What the devices hear -------------------------------------------------------------------

    def held(self, now: float) -> Iterator[HeldMessage]:
        """For each hand that wants something: where what it holds is, which was true at ``now``."""
        for pointer, hand in self.hands.items():
            if hand.message.grab:
                yield self._held(pointer, hand, now)

    def _held(self, pointer: int, hand: SimulatedPointer, now: float) -> HeldMessage:
        spring = hand.spring
        if spring is None:
            return HeldMessage(pointer, hand.message.grab, held=False, time=now)
        place = self.world.held_point(spring)
        # What the hand sees: where simulated time is slow, all moves slowly and is hard to move.
        pace = self.pace
        velocity = pace * self.world.velocities()[spring.body]
        pull = hand.pull._replace(
            mobility=pace * pace * hand.pull.mobility,
            angular_mobility=pace * pace * hand.pull.angular_mobility,
        )
        at_point = velocity[:3] + np.cross(velocity[3:], place - _centre(self.world, spring.body))
        # How a hand would be turned that held it without lag.
        turn = multiply(self.session.pose.orientations[spring.body], conjugate(spring.grip))
        w, x, y, z = map(float, turn)
        return HeldMessage(
            *(pointer, hand.grab, True, now, self.holds, _tuple(place), (w, x, y, z)),
            *(_tuple(at_point), _tuple(velocity[3:]), pull),
            *(_tuple(spring.wrench[:3]), _tuple(spring.wrench[3:])),
        )


def _mobility(world: World, body: int, point: Floats) -> tuple[float, float]:
    """How easily a body gives way at a point: 1/kg and 1/(kg·m²), averaged over directions.

    Measured, with everything that holds it: one step with a small push each way, against one
    without, and time turned back after each.
    """
    before = world.state()
    h = world.settings.step
    size = _PROBE * float(world.figure.masses.sum()) * 9.81
    lever = point - _centre(world, body)

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


def _centre(world: World, body: int) -> Floats:
    """(3,) the centre of mass of a body, world."""
    pose = world.pose()
    return pose.positions[body] + rotate(pose.orientations[body], world.figure.centres[body])


def coupling_for(
    figure: Figure, pose: Pose, device: DeviceMessage | None, scale: float
) -> Coupling:
    """How firmly a hand at a device holds: so that what it can feel fits the puppet's weight.

    The hand feels its own spring over the way by which the body lags behind. A world's spring r
    times as stiff then means that r newtons on the puppet are one on the hand. But the softest
    device must still move the puppet: the world's spring lifts it all when it is drawn out by a
    tenth of the puppet's size. A metre of the hand is ``scale`` m of the scene.
    """
    firm = Coupling.for_figure(figure)
    if device is None or device.force <= 0.0 or device.stiffness <= 0.0:
        return firm
    weight = float(figure.masses.sum()) * 9.81
    size = float(np.ptp(capsules_in_world(figure, pose), axis=(0, 1)).max())
    arm = float(np.median(figure.lengths))
    softest = weight / (_SLACK * size)
    wanted = FELT * weight / device.force * device.stiffness / scale
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


def _tuple(values: Floats) -> Vector:
    x, y, z = map(float, values)
    return (x, y, z)
