# SPDX-License-Identifier: GPL-3.0-or-later
"""One device in the loop: its pointer in the scene, what it holds, and what the hand feels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from ...core.rotations.scalars import (
    IDENTITY,
    ZERO,
    Quaternion,
    Vector,
    add,
    add_scaled,
    conjugate,
    integrate,
    length,
    multiply,
    normalized,
    rotate,
    scale,
    subtract,
    to_rotation_vector,
)
from ..calibration import NONE, Calibration, Calibrator, corrected
from ..driver import FRESH_SECONDS, Driver, Dynamics, Kind, Sample
from ..messages import HandMessage, HeldMessage, Settings, Workspace
from .evidence import Evidence
from .force import Gains, Shaper, wrench
from .local_model import LocalModel
from .passivity import Passivity

_FULL_PUSH: Final = 0.1
"""s: a rate device that has not been read for so long stands still."""
_GIVE_UP: Final = 0.25
"""s of ticks without a message from the simulation, after which the hand has let go for good."""
MOST_HOLDS: Final = 0.1
"""s for which a local model is trusted at most, however long the simulation's steps take."""
_LEAP: Final = 0.02
_FASTEST: Final = 10.0
"""m, and m/s beyond it: a hand that holds something does not move farther from one sample to the
next."""
_SWING: Final = 0.5
_FASTEST_TURN: Final = 100.0
"""rad, and rad/s beyond it, likewise."""
_STALL: Final = 3.0
"""Periods without a tick that are no jitter, of a loop that is slow by itself."""
_TEST_SECONDS: Final = 0.6
_TEST_SHARE: Final = 0.15
"""Of the device's force, for the test of a device."""


@dataclass
class Pointer:
    """State of one device between two ticks."""

    number: int
    driver: Driver
    period: float
    settings: Settings = field(default_factory=Settings)
    workspace: Workspace = field(default_factory=lambda: Workspace(0))
    sample: Sample = field(default_factory=lambda: Sample(-math.inf))
    position: Vector = ZERO
    orientation: Quaternion = IDENTITY
    velocity: Vector = ZERO
    angular_velocity: Vector = ZERO
    grab: int = 0
    """Number of the grab that is wanted; 0: none."""
    presses: list[tuple[int, bool]] = field(default_factory=list[tuple[int, bool]])
    """Buttons pressed and let go, to be sent."""

    def __post_init__(self) -> None:
        who = self.driver.description
        self.has_force = who.dynamics is not None
        """Whether the device has motors."""
        device = self.dynamics = who.dynamics or Dynamics(0.0, damping=0.0, angular_damping=0.0)
        """All zeros where it has none."""
        self._kind = who.kind
        self._response = self.settings.response()
        self._shaper = Shaper(device.force, device.torque)
        self._push = Passivity(self.period, device.force, device.damping, turns=False)
        self._turn = Passivity(self.period, device.torque, device.angular_damping, turns=True)
        self._evidence = Evidence(device, self.period, who.kind)
        self._model = LocalModel()
        self._answered = 0
        self._last_answer = -math.inf
        self._holds = 0.0
        self._silence = 0.0
        self.calibration = NONE
        """The device's own zero and range."""
        self.calibrator: Calibrator | None = None
        """While the device's zero and range are learned: then it neither points nor grabs."""
        self._grabs = 0
        self._placed = False
        self._test_until = -math.inf
        self._last: tuple[Vector, Quaternion] | None = None
        self._ticked = -math.inf

    @property
    def force(self) -> Vector:
        """N on the hand, the device's axes."""
        return self._shaper.force

    @property
    def gains(self) -> Gains:
        """Of the coupling: softer the later the device answers."""
        return self._evidence.gains

    @property
    def torque(self) -> Vector:
        """N·m on the hand, the device's axes."""
        return self._shaper.torque

    @property
    def given(self) -> float:
        """J that the hand got beyond what it had given."""
        return self._push.given + self._turn.given

    def busy(self, now: float) -> bool:
        """Whether its hand holds something, or feels anything yet."""
        return bool(self.grab or self._answered) or now < self._test_until or self.force != ZERO

    # --- What is asked of it ---------------------------------------------------------------------

    def use(self, settings: Settings) -> None:
        self._response = settings.response()
        self.settings = settings

    def place(self, workspace: Workspace) -> None:
        """Take over where the device's room lies in the scene; lets go, for nothing may jump."""
        if self._placed and workspace == self.workspace:
            return
        moved = not self._placed or workspace.origin != self.workspace.origin
        self.workspace = workspace
        self._placed = True
        if self._kind is Kind.POSE:
            self._lift()
        elif moved:
            self.position, self.orientation = workspace.origin, workspace.orientation

    def want(self, *, grab: bool) -> None:
        """Grab what is near, or let go."""
        if grab and not self.grab and self.calibrator is None:
            self._grabs += 1
            self.grab = self._grabs
        elif not grab:
            self.grab = 0

    def _lift(self) -> None:
        """Let go, and feel no more of what was held: the hand will be elsewhere beside it."""
        self.want(grab=False)
        self._answered = 0

    def hold(self, message: HeldMessage, now: float) -> None:
        """Take over where the simulation says that the held body is.

        Where it holds none, only another grab tries anew.
        """
        grab = message.grab
        if not message.held and grab == self.grab:
            self.want(grab=False)
        if not message.held or not grab or grab != self.grab:
            self._answered = 0
            return
        self._holds = max(0.0, min(MOST_HOLDS, message.holds))
        if self._answered == grab:
            self._model.correct(message, max(0.0, min(FRESH_SECONDS, now - message.time)))
        else:
            self._answered = grab
            self._model.begin(message)
            self._push.begin()
            self._turn.begin()
        self._last_answer = now
        self._silence = 0.0

    def test(self, now: float) -> None:
        """Let the hand feel that the device works: gently to the right, then to the left."""
        if self.calibrator is None:
            self._test_until = now + _TEST_SECONDS

    # --- One tick --------------------------------------------------------------------------------

    def tick(self, now: float) -> None:
        """Read the device, go on with the model, and give the hand its force.

        Raises:
            DeviceLostError: the device is gone.
        """
        sample = self.driver.read()
        if sample is not None and self.calibrator is not None:
            self.calibrator.feed(now, sample)
            self.sample = sample._replace(
                velocity=ZERO, angular_velocity=ZERO, buttons=self.sample.buttons
            )
        elif sample is not None:
            self._press(sample.buttons)
            sample = corrected(sample, self._kind, self.calibration, self._response)
            sample = self._evidence.of(sample)
            stopped = now - self._evidence.clock_moved > FRESH_SECONDS
            if self._answered and (stopped or self._leaps(sample)):
                self._lift()
            self.sample = sample
            self._move(now)
        if not self.has_force:
            return
        if now - self._ticked > max(FRESH_SECONDS, _STALL * self.period):
            # The loop itself stood still, and the device has ended the force by itself.
            self._shaper.drop()
        self._ticked = now
        force, torque, age = self._asked(now)
        self._observe()
        velocity, spin = self.sample.velocity, self.sample.angular_velocity
        self._silence += self.period
        if self._answered and self._silence > _GIVE_UP:
            self.want(grab=False)
            self._answered = 0
        if self._answered:
            late = self._evidence.doubt
            apart, turned = self._apart()
            force = self._push.allowed(force, velocity, apart, late)
            torque = self._turn.allowed(torque, spin, turned, late)
        alive = self.sample.held or not self.settings.dead_man
        holding = alive and (bool(self._answered and self.grab) or now < self._test_until)
        self._shaper.shape(force, torque, self.period, holding=holding, age=age)
        self.driver.send(self._shaper.force, self._shaper.torque)

    # --- Calibration -----------------------------------------------------------------------------

    def calibrate(self, *, begin: bool) -> None:
        """Begin to learn the device's zero and range, or stop without having learned any."""
        self._lift()
        self.velocity = self.angular_velocity = ZERO
        self._last = None
        self._test_until = -math.inf
        self.calibrator = Calibrator(self._kind) if begin else None

    def correct(self, calibration: Calibration) -> None:
        """Take over the device's zero and range; lets go, for nothing may jump."""
        self._lift()
        self.calibration = calibration
        self._last = None

    # --- What a tick is made of ------------------------------------------------------------------

    def _press(self, buttons: int) -> None:
        changed = buttons ^ self.sample.buttons
        for index in range(changed.bit_length()):
            if not changed >> index & 1:
                continue
            pressed, toggle = bool(buttons >> index & 1), self.settings.toggle
            self.presses.append((index, pressed))
            if index == self.settings.grab_button and (pressed or not toggle):
                self.want(grab=not self.grab if toggle else pressed)

    def _move(self, now: float) -> None:
        space, sample = self.workspace, self.sample
        self.velocity = scale(rotate(space.orientation, sample.velocity), space.scale)
        self.angular_velocity = rotate(space.orientation, sample.angular_velocity)
        if self._kind is Kind.POSE:
            self.position = add(
                space.origin, scale(rotate(space.orientation, sample.position), space.scale)
            )
            turn = multiply(space.orientation, sample.orientation)
            self.orientation = normalized(turn) or self.orientation
        elif now - sample.time < _FULL_PUSH:
            self.position = add_scaled(self.position, self.velocity, self.period)
            self.orientation = integrate(self.orientation, self.angular_velocity, self.period)

    def _leaps(self, sample: Sample) -> bool:
        """Whether a device is where no hand can have brought it: it was reset, or is damaged."""
        if self._last is None:
            return False
        seconds = max(self.period, sample.time - self.sample.time)
        place, turn = self._last
        moved = length(subtract(sample.position, place))
        swung = length(to_rotation_vector(multiply(sample.orientation, conjugate(turn))))
        return moved > _LEAP + _FASTEST * seconds or swung > _SWING + _FASTEST_TURN * seconds

    def _asked(self, now: float) -> tuple[Vector, Vector, float]:
        """Force and torque that the coupling asks for, in the device's axes, and how old it is."""
        age = now - self.sample.time
        if now < self._test_until and not self._answered:
            size = _TEST_SHARE * self.dynamics.force * self.settings.force
            late = self._test_until - now
            return (size if late > 0.5 * _TEST_SECONDS else -size, 0.0, 0.0), ZERO, age
        if not self._answered:
            return ZERO, ZERO, age
        model, space = self._model, self.workspace
        model.advance(
            *(self.period, self.position, self.orientation),
            *(self.velocity, self.angular_velocity),
        )
        place, turn = model.felt()
        back = conjugate(space.orientation)
        share = max(0.0, min(1.0, self.settings.force))
        apart = scale(rotate(back, subtract(place, self.position)), share / space.scale)
        drift = scale(rotate(back, subtract(model.velocity, self.velocity)), share / space.scale)
        twist = to_rotation_vector(multiply(turn, conjugate(self.orientation)))
        spin = subtract(model.angular_velocity, self.angular_velocity)
        force, torque = wrench(
            *(self.gains, apart, scale(rotate(back, twist), share), drift),
            scale(rotate(back, spin), share),
        )
        return force, torque, max(age, now - self._last_answer - self._holds)

    def _apart(self) -> tuple[float, float]:
        """How far (m at the device) the hand is from what it holds, and turned (rad)."""
        place, turn = self._model.felt()
        apart = length(subtract(place, self.position)) / self.workspace.scale
        return apart, length(to_rotation_vector(multiply(turn, conjugate(self.orientation))))

    def _observe(self) -> None:
        """Account for the force of the last period, over the way that the hand went in it."""
        place, turn = self.sample.position, self.sample.orientation
        if self._last is not None:
            before, turn_before = self._last
            turned = to_rotation_vector(multiply(turn, conjugate(turn_before)))
            holds = bool(self._answered)
            self._push.observe(self.force, subtract(place, before), holds=holds)
            self._turn.observe(self.torque, turned, holds=holds)
        self._last = place, turn

    def message(self, now: float) -> HandMessage:
        """What the bridge needs to know of this tick."""
        return HandMessage(
            *(self.number, now, self.grab, self.position, self.orientation),
            *(self.velocity, self.angular_velocity, self.force, self.torque),
            self.sample.buttons & 0xFFFFFFFF,
        )

    def close(self) -> None:
        self._shaper.drop()
        self.driver.close()
