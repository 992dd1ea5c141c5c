# SPDX-License-Identifier: GPL-3.0-or-later
"""The bridge: the process between Blender and the devices, in which the puppet is simulated.

It starts the process at the devices, steps the puppet, sends Blender poses sixty times a second
and the devices, at each step, where the held bodies are. When Blender is gone it ends, and with it
the process at the devices, which takes all force away.
"""

from __future__ import annotations

import logging
import os
import platform
import sys
import time
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Final

import numpy as np

from ..core.errors import DeviceError, OctoMotionError
from ..core.phrases import phrase
from ..core.posing.balance import carried
from ..core.posing.puppet import Figure, Pose
from ..core.posing.session import TickReport
from ..core.posing.solver import Obstacle, WorldSettings
from . import messages
from .calibration import Phase
from .haptics import Schedule
from .ipc import ALONE, ChannelClosedError, Child, MessageChannel, Parent
from .simulation import SimulatedPointer, Simulation

log = logging.getLogger(__name__)

_SEND_EVERY: Final = 1.0 / 60.0
_IDLE_PERIOD: Final = 2e-3
_AWAKE: Final = 0.00015
"""s before a turn from which on the bridge does not sleep."""
_LAG_SHARE: Final = 0.05
"""Of a new lag, in what is sent of it: so that is the last third of a second."""
_STARTS: Final = 4
_SETTLED: Final = 60.0
"""s after which a process at the devices counts as one that runs."""


class Bridge:
    """What the bridge does, turn by turn."""

    def __init__(self, blender: MessageChannel, hand_arguments: Sequence[str] | None) -> None:
        """Say things to Blender, and start the process at the devices with these arguments; without
        any, there are no devices.
        """
        self._blender = blender
        self._hand_arguments = hand_arguments
        self._hands: Child | None = None
        self._starts = 0
        self._started = 0.0
        self._gave_up = False
        self._greeted = False
        self._figure: Figure | None = None
        self._world = WorldSettings(step=messages.WorldMessage.step)
        self._obstacles: dict[int, Obstacle | None] = {}
        """By Blender's number; None: gone."""
        self._remembered: dict[tuple[type[messages.Message], int], messages.Message] = {}
        self._devices: dict[int, messages.DeviceMessage] = {}
        self._workspaces: dict[int, messages.Workspace] = {}
        self._heard: dict[int, messages.HandMessage] = {}
        self.simulation: Simulation | None = None
        self._sent = 0.0
        self._lag = 0.0
        self._placed = 0

    @property
    def period(self) -> float:
        """S from one turn to the next."""
        return _IDLE_PERIOD if self.simulation is None else self.simulation.step_seconds

    def turn(self, now: float) -> None:
        """Receive from both sides, go on by a step, send to both.

        Raises:
            ChannelClosedError: Blender is gone.
        """
        for message in self._blender.receive():
            self._hear_blender(message)
        if self._hand_arguments is not None:
            if self._hands is None:
                self._start_hands(self._hand_arguments)
            self._hear_hands()
        elif not self._greeted:
            self._greeted = True
            version = platform.python_version()
            self._blender.send(messages.Hello(os.getpid(), version, "normal"))
        simulation = self.simulation
        if simulation is not None:
            for message in self._heard.values():
                device = self._devices.get(message.pointer)
                space = self._workspaces.get(message.pointer)
                simulation.hear(message, device, space.scale if space else 1.0)
            simulation.step(now)
            # A step that kept up leads to a moment to come; one that did not is over only now.
            true = max(now, time.perf_counter() - simulation.step_seconds)
            for held in list(simulation.held(true)):  # sending may lose the devices
                self._send_to_hands(held)
        if now - self._sent >= _SEND_EVERY:
            self._sent = now
            self._send_to_blender()

    # --- Blender ---------------------------------------------------------------------------------

    def _hear_blender(self, message: messages.Message) -> None:
        try:
            self._take(message)
        except (messages.MessageError, OctoMotionError) as error:
            log.warning("Not taken: %s", error)
            remedy = error.remedy if isinstance(error, OctoMotionError) else ""
            problem = phrase("The bridge did not take a message: {error}", error=error)
            self._blender.send(messages.Notice(problem, remedy))

    def _take(self, message: messages.Message) -> None:
        simulation = self.simulation
        match message:
            case messages.FigureMessage():
                self._take_figure(message)
            case messages.Place():
                self._placed += 1
                self._place(message)
            case messages.Tick():
                self._tick(message)
            case messages.Take() | messages.LetGo() | messages.TurnBack():
                if simulation is not None:
                    _take_hand(simulation, message)
            case messages.Pins():
                if simulation is not None:
                    pins = message.pins()
                    if pins and max(pins) >= len(simulation.session.figure):
                        raise messages.MessageError("a pin on a body that does not exist")
                    simulation.pin(pins)
            case messages.WorldMessage():
                self._world = message.settings()
                if simulation is not None:
                    simulation.change(self._world)
            case messages.ObstacleMessage():
                self._obstacles[message.number] = message.obstacle()
                if simulation is not None:
                    simulation.session.change_obstacles(self._solid())
            case messages.Settings():
                message.response()
                if simulation is not None:
                    simulation.reach = message.reach
                self._pass_on(message, 0)
            case messages.Workspace():
                if message.scale <= 0.0:
                    raise messages.MessageError("a workspace without size")
                self._workspaces[message.pointer] = message
                self._pass_on(message, message.pointer)
            case messages.Grab() | messages.Buzz() | messages.Calibrate():
                self._send_to_hands(message)
            case messages.CalibrationMessage():
                message.calibration()  # refused here if it is none
                self._pass_on(message, message.pointer)
            case messages.Goodbye():
                raise ChannelClosedError("goodbye")
            case _:
                raise messages.MessageError(f"{type(message).__name__} is not for here")

    def _place(self, message: messages.Place) -> None:
        if self._figure is None:
            raise messages.MessageError("a pose came before a figure")
        motion = message.motion(len(self._figure))
        pose = Pose(message.positions, message.orientations)
        if self.simulation is not None:
            self.simulation.place(pose, motion)
            return
        simulation = Simulation(self._figure, pose, self._world)
        simulation.session.move_on(motion)
        simulation.session.change_obstacles(self._solid())
        settings = self._remembered.get((messages.Settings, 0))
        if isinstance(settings, messages.Settings):
            simulation.reach = settings.reach
        self.simulation = simulation

    def _take_figure(self, message: messages.FigureMessage) -> None:
        """Take another figure, or the same one of another material, which goes on as it moves."""
        before, self._figure = self._figure, message.figure()
        if before is None or self.simulation is None or not _is_same(before, self._figure):
            self.simulation = None
        else:
            self.simulation.session.change_elements(self._figure.elements)

    def _tick(self, message: messages.Tick) -> None:
        simulation = self.simulation
        if simulation is None:
            raise messages.MessageError("a tick came before a pose")
        report = simulation.tick(message)
        self._send_pointers()
        self._blender.send(_ticked(message.number, self._placed, simulation, report))

    def _solid(self) -> tuple[Obstacle, ...]:
        return tuple(each for each in self._obstacles.values() if each is not None)

    def _pass_on(self, message: messages.Message, number: int) -> None:
        self._remembered[type(message), number] = message
        self._send_to_hands(message)

    def _send_to_blender(self) -> None:
        self._send_pointers()
        simulation = self.simulation
        # Who ticks hears of poses by that.
        if simulation is not None and not simulation.ticked and simulation.session.changed:
            pose = simulation.session.pose
            # What was left out is sent once Blender reads again: it may be the last for long.
            simulation.session.changed = not self._blender.send(
                messages.PoseMessage(
                    *(self._placed, simulation.steps, simulation.session.time),
                    *(pose.positions, pose.orientations),
                ),
                droppable=True,
            )

    def _send_pointers(self) -> None:
        """Say where devices are, before any pose that follows: who hears that a limb is held must
        not have seen yet that it moves.
        """
        simulation = self.simulation
        for pointer, message in self._heard.items():
            hand = simulation.hands.get(pointer) if simulation else None
            if hand is not None and hand.spring is not None:
                self._lag += _LAG_SHARE * (time.perf_counter() - message.time - self._lag)
            self._blender.send(self._pointer(message, hand), droppable=True)

    def _pointer(
        self, message: messages.HandMessage, hand: SimulatedPointer | None
    ) -> messages.PointerMessage:
        place, body = message.position, -1
        if hand is not None and hand.spring is not None and self.simulation is not None:
            place = tuple(self.simulation.world.held_point(hand.spring))
            body = hand.spring.body
        return messages.PointerMessage(
            *(message.pointer, body, message.position, message.orientation, place),
            *(message.force, message.torque, message.buttons),
        )

    # --- The devices -----------------------------------------------------------------------------

    def _send_to_hands(self, message: messages.Message) -> None:
        if self._hands is not None:
            try:
                self._hands.channel.send(message)
            except ChannelClosedError:
                self._lose_hands()

    def _hear_hands(self) -> None:
        try:
            came = self._hands.channel.receive() if self._hands else []
        except ChannelClosedError:
            self._lose_hands()
            return
        for message in came:
            match message:
                case messages.HandMessage():
                    self._heard[message.pointer] = message
                case messages.DeviceMessage():
                    self._hear_device(message)
                case messages.LoopTimesMessage():
                    self._send_times(message)
                case messages.Hello():
                    if not self._greeted:
                        self._greeted = True
                        self._blender.send(replace(message, process=os.getpid()))
                case messages.Button() | messages.Notice():
                    self._blender.send(message)
                case messages.CalibrationMessage():
                    self._hear_calibration(message)
                case _:
                    log.warning("The devices' process says %s", type(message).__name__)

    def _hear_calibration(self, message: messages.CalibrationMessage) -> None:
        if message.phase == Phase.DONE:  # for a process at the devices that is started anew
            self._remembered[messages.CalibrationMessage, message.pointer] = message
        # While it is learned, the next word comes at once: a Blender that renders needs none twice.
        learning = message.phase in {Phase.REST, Phase.REACH}
        self._blender.send(message, droppable=learning)

    def _hear_device(self, message: messages.DeviceMessage) -> None:
        if message.present:
            self._devices[message.pointer] = message
        else:
            self._devices.pop(message.pointer, None)
            self._heard.pop(message.pointer, None)
            if self.simulation is not None:
                self.simulation.forget(message.pointer)
        self._blender.send(message)

    def _send_times(self, message: messages.LoopTimesMessage) -> None:
        if time.monotonic() - self._started > _SETTLED:
            self._starts = 1  # what was long ago does not count
        simulation = self.simulation
        cost, pace = (simulation.cost, simulation.pace) if simulation else (0.0, 1.0)
        self._blender.send(
            messages.Times(
                *(message.rate, message.late, message.computing, message.missed),
                *(cost, pace, self._lag),
            ),
            droppable=True,
        )

    def _lose_hands(self) -> None:
        """The process at the devices ended: let go of everything; the next turn starts it again."""
        if self._hands is not None:
            self._hands.stop(0.0)
        self._hands = None
        for device in list(self._devices.values()):
            self._hear_device(replace(device, present=False))
        log.warning("The process at the devices ended")

    def _start_hands(self, arguments: Sequence[str]) -> None:
        """Start the process at the devices, and send it what it needs to know.

        Where that fails it is tried again at the next turns, a few times.
        """
        if self._starts > _STARTS:
            if not self._gave_up:
                self._gave_up = True
                self._blender.send(
                    messages.Notice(
                        "The program at the devices ends again and again.",
                        "Unplug the device, then start the bridge again.",
                    )
                )
            return
        self._starts += 1
        self._started = time.monotonic()
        try:
            self._hands = Child.start(("hands", *arguments), Path(sys.executable))
            for message in self._remembered.values():
                self._hands.channel.send(message)
        except (DeviceError, ChannelClosedError) as error:
            log.warning("The process at the devices did not start: %s", error)
            self._hands = None

    def close(self) -> None:
        if self._hands is not None:
            self._hands.stop(0.5)
            self._hands = None


def _is_same(one: Figure, other: Figure) -> bool:
    """Whether two figures are alike but for the material of their joints."""
    return all(
        np.array_equal(getattr(one, each.name), getattr(other, each.name))
        for each in fields(one)
        if each.name != "elements"
    )


def _take_hand(
    simulation: Simulation, message: messages.Take | messages.LetGo | messages.TurnBack
) -> None:
    match message:
        case messages.Take():
            simulation.take(message)
        case messages.LetGo():
            simulation.let_go(message.hand)
        case messages.TurnBack():
            simulation.turn_back(message)


def _ticked(
    number: int, placed: int, simulation: Simulation, report: TickReport
) -> messages.Ticked:
    """What has come of a tick."""
    session, world = simulation.session, simulation.world
    pose, moving, joints = session.pose, world.state().bodies, session.pulled
    wrenches = np.array([each.wrench for each in simulation.own.values()]).reshape(-1, 6)
    return messages.Ticked(
        *(number, placed, simulation.steps, session.time),
        *(report.simulated, report.steps, report.ratio, report.step, report.resting),
        *(pose.positions, pose.orientations),
        *(moving[name] for name in messages.MOTION),
        loads=world.joint_loads(),
        pulled=() if joints is None else tuple(map(int, joints)),
        carried=tuple(carried(session)),
        hands=tuple(simulation.own),
        wrenches=wrenches,
    )


def run(hand_arguments: Sequence[str]) -> int:
    """Serve whoever started this process until it is gone; the exit status."""
    # Nothing here has to be tidied up: the lines to both sides end with the process, and whoever
    # holds a device lets go of it when its line ends.
    blender = Parent().line()
    if blender is None:
        return 2
    bridge = Bridge(blender, None if ALONE in hand_arguments else hand_arguments)
    # A step that begins a little late is made up for: it is not worth a whole processor's time, as
    # it would be on Windows.
    schedule = Schedule(bridge.period, awake=_AWAKE)
    try:
        while True:
            schedule.period = bridge.period
            now = schedule.begin()
            bridge.turn(now)
            schedule.end()
            if bridge.simulation is not None:
                bridge.simulation.worked(time.perf_counter() - now)
    except ChannelClosedError:
        pass
    finally:
        bridge.close()
        blender.close()
    return 0
