# SPDX-License-Identifier: GPL-3.0-or-later
"""The process at the devices: reads them, gives force, a thousand times a second, and no more.

No simulation, nothing that waits: looking for devices has a thread of its own. Whoever started it
is sent what the hands do, and sends where the held bodies are.
"""

from __future__ import annotations

import contextlib
import logging
import os
import platform
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from ..core.errors import DeviceError
from ..core.phrases import phrase
from . import messages
from .calibration import Calibration, Phase
from .driver import DeviceLostError, Driver
from .haptics import Pointer, Schedule, make_real_time
from .ipc import ChannelClosedError, MessageChannel, Parent
from .sources import Discovery, Sources

log = logging.getLogger(__name__)

MOST_POINTERS: Final = 8
_SEND_EVERY: Final = 0.002
"""s between two messages on where the hands are."""
_TIMES_EVERY: Final = 1.0
_LET_GO_SECONDS: Final = 0.2
"""For taking all force away, once whoever started us is gone; a tick is enough, unless the system
call of a driver does not return."""
_IDLE_PERIOD: Final = 0.004
"""s from tick to tick while no hand feels anything."""
_LOOK_EVERY: Final = 0.1
"""s after which the discovery may look for devices again."""


class HandLoop:
    """All devices of this machine, tick by tick."""

    def __init__(self, channel: MessageChannel, discovery: Discovery, schedule: Schedule) -> None:
        self._channel = channel
        self._discovery = discovery
        self._schedule = schedule
        self._period = schedule.period
        self._pointers: dict[int, Pointer] = {}
        self._numbers: dict[str, int] = {}
        self._workspaces: dict[int, messages.Workspace] = {}
        self._corrections: dict[int, Calibration] = {}
        """By pointer: zeros and ranges that were sent or learned."""
        self._settings = messages.Settings()
        self._hands_sent = self._times_sent = self._looked = 0.0
        self._held = False

    @property
    def pointers(self) -> Iterable[Pointer]:
        return self._pointers.values()

    def tick(self, now: float) -> None:
        """Receive, feel, send.

        Raises:
            ChannelClosedError: whoever started us is gone.
        """
        held = self._held
        for message in self._channel.receive():
            self._receive(message, now)
        for number, pointer in list(self._pointers.items()):
            try:
                pointer.tick(now)
            except DeviceLostError:
                self._lose(number)
        self._send(now)
        self._held = any(each.grab for each in self.pointers)
        if self._held and not held:
            self._schedule.forget()  # the clock's times are those of holding something
        self._keep_pace(now)
        if not self._held and now - self._looked > _LOOK_EVERY:
            self._looked = now
            self._look()

    def _keep_pace(self, now: float) -> None:
        """Tick as often as a hand needs it that feels something; seldom where none does."""
        busy = any(each.busy(now) for each in self.pointers)
        period = self._period if busy else max(self._period, _IDLE_PERIOD)
        if period != self._schedule.period:
            self._schedule.period = period
            for pointer in self.pointers:
                pointer.period = period

    def _receive(self, message: messages.Message, now: float) -> None:
        pointer = self._pointers.get(getattr(message, "pointer", -1))
        match message:
            case messages.HeldMessage() if pointer is not None:
                pointer.hold(message, now)
            case messages.Calibrate() if pointer is not None:
                self._calibrate(pointer, message.order)
            case messages.CalibrationMessage():
                self._correct(pointer, message)
            case messages.Settings():
                self._take_settings(message)
            case messages.Workspace() if message.scale > 0.0 and message.pointer < MOST_POINTERS:
                self._workspaces[message.pointer] = message
                if pointer is not None:
                    pointer.place(message)
            case messages.Grab() if pointer is not None:
                pointer.want(grab=message.grab)
            case messages.Buzz() if pointer is not None:
                pointer.test(now)
            case messages.Goodbye():
                raise ChannelClosedError("goodbye")
            case _:  # most likely to a device that has just gone
                log.debug("Not taken: %s", type(message).__name__)

    def _calibrate(self, pointer: Pointer, order: int) -> None:
        learner = pointer.calibrator
        phase = Phase.FAILED
        if order == messages.Order.FINISH and learner is not None:
            try:
                pointer.correct(learner.finish())
                self._corrections[pointer.number] = pointer.calibration
            except DeviceError as error:
                self._channel.send(messages.Notice(error.problem, error.remedy))
            phase = learner.phase
        begin = order == messages.Order.BEGIN
        if begin or learner is not None:
            pointer.calibrate(begin=begin)
        if learner is not None and not begin:
            done = messages.CalibrationMessage.of(pointer.number, pointer.calibration, phase)
            self._channel.send(done)

    def _correct(self, pointer: Pointer | None, message: messages.CalibrationMessage) -> None:
        with contextlib.suppress(messages.MessageError):  # as without one, then
            calibration = message.calibration()
            if message.pointer < MOST_POINTERS:
                self._corrections[message.pointer] = calibration
            if pointer is not None:
                pointer.correct(calibration)

    def _take_settings(self, settings: messages.Settings) -> None:
        try:
            settings.response()
        except messages.MessageError as error:
            self._channel.send(
                messages.Notice(
                    phrase("The device's settings were not taken: {error}", error=error), ""
                )
            )
            return
        self._settings = settings
        for pointer in self.pointers:
            pointer.use(settings)

    def _send(self, now: float) -> None:
        due = now - self._hands_sent > _SEND_EVERY - 0.5 * self._schedule.period
        if due:
            self._hands_sent = now
        for pointer in self.pointers:
            for index, pressed in pointer.presses:
                self._channel.send(messages.Button(pointer.number, index, pressed))
            changed = bool(pointer.presses)
            pointer.presses.clear()
            if changed or due:
                self._channel.send(pointer.message(now), droppable=not changed)
            learner = pointer.calibrator
            if learner is not None and due:
                self._channel.send(
                    messages.CalibrationMessage.of(pointer.number, learner.so_far, learner.phase),
                    droppable=True,
                )
        if now - self._times_sent > _TIMES_EVERY:
            self._times_sent = now
            self._channel.send(self._schedule.times())

    def _look(self) -> None:
        for driver in self._discovery.look():
            self._welcome(driver)
        for error in self._discovery.problems:
            self._channel.send(messages.Notice(error.problem, error.remedy))
        self._discovery.problems.clear()

    def _welcome(self, driver: Driver) -> None:
        who = driver.description
        number = self._number_for(who.identity)
        if number is None:
            log.warning("%s is one device too many", who.name)
            driver.close()
            return
        if number in self._pointers:  # the same program, and another device
            self._send_device(self._pointers[number], present=False)
        pointer = Pointer(number, driver, self._period, self._settings)
        pointer.period = self._schedule.period
        if number in self._corrections:
            pointer.correct(self._corrections[number])
        if number in self._workspaces:
            pointer.place(self._workspaces[number])
        self._pointers[number] = pointer
        log.info("Found: %s", who.name)
        self._send_device(pointer, present=True)

    def _number_for(self, identity: str) -> int | None:
        """The pointer's number: the one that the device had before, or one that is free."""
        number = self._numbers.pop(identity, None)
        if number is None:
            given = set(self._numbers.values())
            number = next((each for each in range(MOST_POINTERS) if each not in given), None)
        if number is None:
            # Without serial numbers some are another one each time that they are plugged in.
            gone = (each for each, used in self._numbers.items() if used not in self._pointers)
            longest = next(gone, None)
            if longest is None:
                return None
            number = self._numbers.pop(longest)
            self._corrections.pop(number, None)
        self._numbers[identity] = number
        return number

    def _lose(self, number: int) -> None:
        pointer = self._pointers.pop(number)
        pointer.close()
        self._discovery.lost(pointer.driver.description.identity)
        log.info("Gone: %s", pointer.driver.description.name)
        self._send_device(pointer, present=False)

    def _send_device(self, pointer: Pointer, *, present: bool) -> None:
        who, dynamics, gains = pointer.driver.description, pointer.dynamics, pointer.gains
        self._channel.send(
            messages.DeviceMessage(
                *(pointer.number, present, who.kind, dynamics.force, dynamics.torque),
                *(gains.stiffness, gains.angular_stiffness, who.name),
                *(who.lasting or who.identity, who.buttons),
            )
        )

    def close(self) -> None:
        for pointer in self.pointers:
            pointer.close()
        self._pointers.clear()
        self._discovery.close()


def discovery_of(sources: Sources) -> Discovery:
    """The search for devices; without programs, which it says, where their port cannot be used."""
    try:
        return Discovery(sources)
    except (OSError, OverflowError) as error:
        problem = DeviceError(
            phrase("The network port cannot be used: {error}.", error=error), "Choose another one."
        )
    except DeviceError as error:
        problem = error
    discovery = Discovery(replace(sources, network=None))
    discovery.problems.append(problem)
    return discovery


def run(sources: Sources, rate: float) -> int:
    """Serve whoever started this process until it is gone; the exit status."""
    parent = Parent(_LET_GO_SECONDS)
    channel = parent.line()
    if channel is None:
        return 2
    discovery = discovery_of(sources)
    priority = make_real_time()
    channel.send(messages.Hello(os.getpid(), platform.python_version(), priority))
    schedule = Schedule(1.0 / rate)
    loop = HandLoop(channel, discovery, schedule)
    try:
        while not parent.gone:
            now = schedule.begin()
            loop.tick(now)
            schedule.end()
    except ChannelClosedError:
        pass
    except DeviceError as error:
        log.error("%s", error)
    finally:
        loop.close()
        channel.close()
    return 0
