# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's end of the bridge: start it, talk to it, notice when it is gone.

Nothing here waits, but for ``start``. Call ``poll`` often, at each tick of a modal operator or a
timer; it takes microseconds when nothing has come.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Final

from ...core.errors import DeviceError
from ...core.posing.puppet import Figure, Pose
from ...core.posing.solver import Obstacle
from .. import messages
from ..calibration import Phase
from ..messages import CalibrationMessage, DeviceMessage, Notice, PointerMessage
from .process import ChannelClosedError, Child, Starting

_MOST_WAITING: Final = 100_000_000
"""Bytes: a scene's meshes are sent at one go, two dozen of the largest."""
_SILENT: Final = 5.0
"""s; it speaks once a second at least."""


ALONE: Final = "--alone"
"""Of a bridge that only simulates, without devices."""


class ClientState(Enum):
    """Whether there is a bridge."""

    OFF = "off"
    RUNNING = "running"
    LOST = "lost"
    """It ended without having been stopped; what it last said is kept. Offer to start it again."""


@dataclass
class Client:
    """The bridge as Blender sees it; what it says is kept here, the newest of each kind."""

    state: ClientState = ClientState.OFF
    pose: Pose | None = None
    """The newest; stays when the bridge is lost."""
    steps: int = 0
    """Of the simulation when ``pose`` was true."""
    devices: dict[int, DeviceMessage] = field(default_factory=dict[int, DeviceMessage])
    """By pointer: those that are there."""
    pointers: dict[int, PointerMessage] = field(default_factory=dict[int, PointerMessage])
    calibrating: dict[int, CalibrationMessage] = field(
        default_factory=dict[int, CalibrationMessage]
    )
    """By pointer: what has been learned so far, of devices that are being calibrated."""
    calibrated: dict[int, CalibrationMessage] = field(default_factory=dict[int, CalibrationMessage])
    """By pointer: what was learned, to be kept, then cleared, by the caller."""
    times: messages.Times | None = None
    hello: messages.Hello | None = None
    notices: list[Notice] = field(default_factory=list[Notice])
    """To be shown, then cleared, by the caller."""
    heard: float = 0.0
    """``time.monotonic`` of the last message."""
    log_file: Path | None = None
    """Where the bridge's messages go; without one, to our console."""
    ticked: messages.Ticked | None = None
    """What has come of the newest tick, to be cleared by the caller."""
    _placed: int = 0
    """How often the puppet was put into a pose."""
    _child: Child | None = None
    _starting: Starting | None = None
    _arguments: tuple[str, ...] = ()
    _python: Path | None = None
    _figure: tuple[Figure, Pose] | None = None
    _pins: dict[int, bool] = field(default_factory=dict[int, bool])

    def start(self, arguments: Sequence[str] = (), python: Path | None = None) -> None:
        """Start the bridge; one that runs is stopped first.

        Arguments are options of ``python -m octo_motion.device bridge``; without a Python,
        Blender's own is found.

        Raises:
            DeviceError: it cannot be started.
        """
        self._begin(arguments, python)
        self._take(Child.start(("bridge", *arguments), python, self.log_file))

    def start_soon(self, arguments: Sequence[str] = (), python: Path | None = None) -> None:
        """Start the bridge without waiting for it; it is there once ``poll`` finds that it answers.

        One that cannot be started is lost.
        """
        self._begin(arguments, python)
        self._starting = Starting(("bridge", *arguments), python, self.log_file)

    def _begin(self, arguments: Sequence[str], python: Path | None) -> None:
        self.stop()
        self._arguments, self._python = tuple(arguments), python
        self._forget_devices()
        self.times = self.hello = self.ticked = None
        self._placed = 0

    def _take(self, child: Child) -> None:
        self._child = child
        child.channel.most_waiting = _MOST_WAITING
        self.state = ClientState.RUNNING
        self.heard = time.monotonic()

    def _look(self) -> None:
        """See what has become of a bridge that is being started."""
        starting = self._starting
        if starting is not None and starting.trouble is not None:
            trouble, self._starting = starting.trouble, None
            self.state = ClientState.LOST
            self.notices.append(Notice(trouble.problem, trouble.remedy))
        elif starting is not None and starting.child is not None:
            self._starting = None
            self._take(starting.child)

    def restart(self) -> None:
        """Start a lost bridge again, with the figure it had, in its last pose.

        Raises:
            DeviceError: it cannot be started, and stays lost.
        """
        try:
            self.start(self._arguments, self._python)
        except DeviceError:
            self.state = ClientState.LOST
            raise
        if self._figure is not None:
            figure, pose = self._figure
            self.send_figure(figure, self.pose or pose)
            self.send_pins(self._pins)

    def stop(self) -> None:
        """End the bridge, if there is one; hands let go at once."""
        starting, self._starting = self._starting, None
        if starting is not None:
            starting.drop()
        child, self._child = self._child, None
        if child is not None:
            if child.running:
                with contextlib.suppress(ChannelClosedError):
                    child.channel.send(messages.Goodbye())
            child.stop()
        self.state = ClientState.OFF

    def send(self, message: messages.Message) -> None:
        """Say something to the bridge; without one, nothing happens."""
        if self._child is None:
            return
        if isinstance(message, messages.Place):
            self._placed += 1
            self.steps = 0
        try:
            self._child.channel.send(message)
        except ChannelClosedError:
            self._lose()

    def send_figure(self, figure: Figure, pose: Pose) -> None:
        """Simulate this puppet from now on, standing like this."""
        self._figure = (figure, pose)
        self.pose = pose
        self.steps = 0
        self.send(messages.FigureMessage.of(figure))
        self.send(messages.Place(pose.positions, pose.orientations))

    def send_pose(self, pose: Pose) -> None:
        """Put the puppet into a pose, at rest; hands let go."""
        self.pose = pose
        self.send(messages.Place(pose.positions, pose.orientations))

    def send_pins(self, pins: dict[int, bool]) -> None:
        """Pin these bodies and no others where they are; those that say so do not turn either."""
        self._pins = dict(pins)
        count = len(self._figure[0]) if self._figure else 0
        self.send(messages.Pins.of(pins, count))

    def send_obstacle(self, number: int, obstacle: Obstacle | None) -> None:
        """Add or move something solid; None takes it away."""
        self.send(messages.ObstacleMessage.of(number, obstacle))

    def poll(self) -> list[messages.Button]:
        """Take in all that the bridge has said; buttons that were pressed or let go, in order."""
        buttons: list[messages.Button] = []
        self._look()
        try:
            came = self._child.channel.receive() if self._child else []
        except ChannelClosedError:
            self._lose()
            return buttons
        for message in came:
            self.heard = time.monotonic()
            match message:
                case messages.PoseMessage() if message.placed == self._placed:
                    self.pose = Pose(message.positions, message.orientations)
                    self.steps = message.step
                case messages.Ticked() if message.placed == self._placed:
                    self.ticked = message
                    self.pose = Pose(message.positions, message.orientations)
                    self.steps = message.step
                case PointerMessage():
                    self.pointers[message.pointer] = message
                case DeviceMessage():
                    self._take_device(message)
                case messages.Button():
                    buttons.append(message)
                case messages.Times():
                    self.times = message
                case CalibrationMessage():
                    self._take_calibration(message)
                case messages.Hello():
                    self.hello = message
                case Notice():
                    self.notices.append(message)
        return buttons

    def calibrate(self, pointer: int, order: messages.Order) -> None:
        self.send(messages.Calibrate(pointer, order))

    def _take_calibration(self, message: CalibrationMessage) -> None:
        if message.phase in {Phase.REST, Phase.REACH}:
            self.calibrating[message.pointer] = message
            return
        self.calibrating.pop(message.pointer, None)  # finished, or given up
        if message.phase == Phase.DONE:
            self.calibrated[message.pointer] = message

    def _take_device(self, message: DeviceMessage) -> None:
        if message.present:
            self.devices[message.pointer] = message
        else:
            self.devices.pop(message.pointer, None)
            self.pointers.pop(message.pointer, None)
            self.calibrating.pop(message.pointer, None)

    def _forget_devices(self) -> None:
        # New ones: the bridge may end under the hands of someone who goes through the old.
        self.devices, self.pointers, self.calibrating, self.calibrated = {}, {}, {}, {}

    def _lose(self) -> None:
        """The bridge is gone: say so, and keep what it last said."""
        child, self._child = self._child, None
        if child is not None:
            child.stop(0.0)
        self.state = ClientState.LOST
        self._forget_devices()
        self.notices.append(
            Notice(
                "The program between Blender and the device has ended.",
                "The pose and all keys are kept; start it again to go on.",
            )
        )

    @property
    def bridge(self) -> object:
        """The bridge that runs, another one each time it is started; None where there is none."""
        return self._child

    @property
    def silent(self) -> bool:
        """Whether a bridge that runs has sent nothing for long: it hangs, or gave up."""
        return self.state is ClientState.RUNNING and time.monotonic() - self.heard > _SILENT
