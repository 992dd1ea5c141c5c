# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop at the devices: each has its own pointer, and one that goes leaves the others alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from octo_motion.core.errors import DeviceError
from octo_motion.core.posing.solver.world import WorldSettings
from octo_motion.core.rotations.scalars import IDENTITY
from octo_motion.device import messages as say
from octo_motion.device.calibration import NONE, Calibration
from octo_motion.device.driver import Driver, Sample
from octo_motion.device.hand_process import HandLoop
from octo_motion.device.haptics.schedule import Schedule
from octo_motion.device.ipc.process import ChannelClosedError, Listener, MessageChannel, connect
from octo_motion.device.simulation import Simulation
from tests.core.puppets import chain, posed, soft
from tests.device.parts import FakeDriver

SECRET = bytes(32)
PERIOD = 0.001


class Named(FakeDriver):
    """A device with a name of its own, whose hand stays where the test puts it."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name_it(name)
        self.place = (0.0, 0.0, 0.0)
        self.buttons = 0
        self.now = 0.0

    def read(self) -> Sample | None:
        super().read()
        return Sample(self.now, self.place, IDENTITY, buttons=self.buttons)


@dataclass
class FakeDiscovery:
    """What the test plugs in."""

    coming: list[Driver] = field(default_factory=list[Driver])
    problems: list[DeviceError] = field(default_factory=list[DeviceError])
    gone: list[str] = field(default_factory=list[str])

    def look(self) -> Iterator[Driver]:
        while self.coming:
            yield self.coming.pop(0)

    def lost(self, identity: str) -> None:
        self.gone.append(identity)

    def close(self) -> None:
        pass


class Desk:
    """A loop, its devices, and whoever started it."""

    def __init__(self) -> None:
        listener = Listener(SECRET)
        got: list[MessageChannel | None] = []
        thread = threading.Thread(target=lambda: got.append(listener.accept(10.0)))
        thread.start()
        self.there = connect(listener.port, SECRET)
        thread.join()
        assert got[0]
        self.here = got[0]
        self.discovery = FakeDiscovery()
        self.loop = HandLoop(
            *(self.here, self.discovery, Schedule(PERIOD))  # pyright: ignore[reportArgumentType]
        )
        self.now = 100.0
        self.heard: list[say.Message] = []

    def ticks(self, count: int, *devices: Named) -> None:
        for _ in range(count):
            self.now += PERIOD
            for device in devices:
                device.now = self.now
            self.loop.tick(self.now)
            self.heard += self.there.receive()

    def last(self, pointer: int) -> say.HandMessage:
        # What was sent may take a moment to arrive, also on loopback.
        end = time.monotonic() + 5.0
        while True:
            self.heard += self.there.receive()
            found = [
                each
                for each in self.heard
                if isinstance(each, say.HandMessage) and each.pointer == pointer
            ]
            if found and self.now - found[-1].time < 3 * PERIOD:
                return found[-1]
            assert time.monotonic() < end

    def told(self, kind: type[say.Message], count: int) -> list[say.Message]:
        end = time.monotonic() + 5.0
        while len(found := [each for each in self.heard if isinstance(each, kind)]) < count:
            self.heard += self.there.receive()
            assert time.monotonic() < end
        return found

    def close(self) -> None:
        self.loop.close()
        self.here.close()
        self.there.close()


@pytest.fixture
def desk() -> Iterator[Desk]:
    desk = Desk()
    yield desk
    desk.close()


def test_two_hands_hold_two_limbs_at_once(desk: Desk) -> None:
    left, right = Named("left"), Named("right")
    desk.discovery.coming = [left, right]
    figure = chain(3, elements=soft(3, 40.0, 2.0, 100.0, 1.0))
    simulation = Simulation(figure, posed(figure), WorldSettings(step=4e-3), clock=lambda: 0.0)
    desk.ticks(2, left, right)
    left.place, right.place = (0.0, 0.1, 0.0), (0.0, 0.55, 0.0)
    left.buttons = right.buttons = 1
    desk.ticks(5, left, right)
    for pointer in (0, 1):
        simulation.hear(desk.last(pointer))
    simulation.step(desk.now)
    held = {number: hand.spring.body for number, hand in simulation.hands.items() if hand.spring}
    assert held == {0: 0, 1: 2}
    left.buttons = 0
    desk.ticks(5, left, right)
    for pointer in (0, 1):
        simulation.hear(desk.last(pointer))
    assert simulation.hands[0].spring is None
    assert simulation.hands[1].spring is not None
    simulation.forget(1)
    assert simulation.session.world.grabs == ()


def test_device_that_goes_leaves_the_other_alone_and_comes_back_as_itself(desk: Desk) -> None:
    left, right = Named("left"), Named("right")
    desk.discovery.coming = [left, right]
    desk.ticks(2, left, right)
    left.gone = True
    desk.ticks(5, left, right)
    assert desk.discovery.gone == ["left"]
    assert left.closed == 1
    assert [each.number for each in desk.loop.pointers] == [1]
    again = Named("left")
    desk.discovery.coming = [again]
    desk.ticks(200, again, right)
    assert sorted(each.number for each in desk.loop.pointers) == [0, 1]
    devices = desk.told(say.DeviceMessage, 4)
    assert [(each.pointer, each.present) for each in devices] == [
        (0, True),
        (1, True),
        (0, False),
        (0, True),
    ]


def test_device_that_is_another_one_each_time_is_never_refused(desk: Desk) -> None:
    """A Mac names a device without serial number anew each time that it is plugged in."""
    keeps = Named("keeps")
    desk.discovery.coming = [keeps]
    desk.ticks(2, keeps)
    for time_plugged in range(20):
        loose = Named(f"loose {time_plugged}")
        desk.discovery.coming = [loose]
        desk.ticks(200, keeps, loose)
        assert len(list(desk.loop.pointers)) == 2
        loose.gone = True
        desk.ticks(2, keeps)
    numbers = {each.pointer for each in desk.told(say.DeviceMessage, 41)}
    assert numbers == set(range(8))
    assert [each.number for each in desk.loop.pointers] == [0]


def test_number_that_another_device_had_comes_without_its_calibration(desk: Desk) -> None:
    own = Calibration(rest=(0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
    for number in range(8):
        first = Named(f"first {number}")
        desk.discovery.coming = [first]
        desk.ticks(200, first)
        desk.there.send(say.CalibrationMessage.of(number, own))
        desk.ticks(20, first)
        first.gone = True
        desk.ticks(2)
    other = Named("other")
    desk.discovery.coming = [other]
    desk.ticks(200, other)
    (pointer,) = desk.loop.pointers
    assert pointer.number == 0
    assert pointer.calibration == NONE


def test_eight_devices_follow_the_view(desk: Desk) -> None:
    devices = [Named(str(number)) for number in range(9)]
    desk.discovery.coming = list(devices)
    desk.ticks(2, *devices)
    assert len(list(desk.loop.pointers)) == 8, "and a ninth is left alone"
    assert devices[8].closed == 1
    for height in (1.0, 2.0):
        for number in range(8):
            desk.there.send(say.Workspace(number, (0.0, 0.0, height)))
        desk.ticks(50, *devices)
        assert {each.workspace.origin[2] for each in desk.loop.pointers} == {height}


def test_program_that_becomes_another_device_is_another_one(desk: Desk) -> None:
    first, second = Named("program"), Named("program")
    desk.discovery.coming = [first]
    desk.ticks(2, first)
    desk.discovery.coming = [second]
    desk.ticks(200, second)
    told = desk.told(say.DeviceMessage, 3)
    assert [(each.pointer, each.present) for each in told] == [
        (0, True),
        (0, False),
        (0, True),
    ]


def test_nothing_is_looked_for_while_a_hand_holds(desk: Desk) -> None:
    left, right = Named("left"), Named("right")
    desk.discovery.coming = [left]
    desk.ticks(2, left)
    left.buttons = 1
    desk.ticks(2, left)
    desk.discovery.coming = [right]
    desk.ticks(300, left, right)
    assert len(list(desk.loop.pointers)) == 1
    left.buttons = 0
    desk.ticks(300, left, right)
    assert len(list(desk.loop.pointers)) == 2


def test_problems_are_told_and_settings_that_make_no_sense_change_nothing(desk: Desk) -> None:
    desk.discovery.problems.append(DeviceError("It may not be read.", "Add the rule."))
    desk.ticks(2)
    assert desk.told(say.Notice, 1) == [say.Notice("It may not be read.", "Add the rule.")]
    desk.there.send(say.Settings(curve=(0.0,) * 6))  # pyright: ignore[reportArgumentType]
    end = time.monotonic() + 5.0
    while len([each for each in desk.heard if isinstance(each, say.Notice)]) < 2:
        desk.ticks(1)
        assert time.monotonic() < end
    assert desk.loop._settings == say.Settings()


def test_goodbye_ends_the_loop_and_all_force(desk: Desk) -> None:
    left = Named("left")
    desk.discovery.coming = [left]
    desk.ticks(2, left)
    desk.there.send(say.Goodbye())

    def go_on() -> None:
        end = time.monotonic() + 5.0
        while time.monotonic() < end:
            desk.ticks(1, left)

    with pytest.raises(ChannelClosedError):
        go_on()
    desk.loop.close()
    assert left.sent[-1] == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_loop_ticks_seldom_while_nothing_is_held_and_a_push_goes_as_far(desk: Desk) -> None:
    """So a hand that rests costs no processor; and a space mouse is as fast as ever."""
    left = Named("left")
    desk.discovery.coming = [left]
    desk.ticks(3, left)
    assert 125.0 <= 1.0 / desk.loop._schedule.period <= 250.0
    (pointer,) = desk.loop.pointers
    assert pointer.period == desk.loop._schedule.period
    left.buttons = 1
    desk.ticks(2, left)
    assert desk.loop._schedule.period == pointer.period == PERIOD
    left.buttons = 0
    desk.ticks(60, left)
    assert pointer.period > PERIOD
