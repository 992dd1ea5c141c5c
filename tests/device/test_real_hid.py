# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices in a real HID stack: found, moved, given force, unplugged in mid-grab, plugged in again.

The kernel makes them (/dev/uhid) and hidapi finds them as it would find any other.
"""

from __future__ import annotations

import contextlib
import os
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from octo_motion.core.rotations.scalars import IDENTITY, ZERO, Quaternion, Vector
from octo_motion.device import messages as say
from octo_motion.device.calibration import NONE, Response, corrected
from octo_motion.device.driver import DeviceLostError, Driver, Dynamics, Kind, Sample
from octo_motion.device.hand_process import HandLoop
from octo_motion.device.haptics.schedule import Schedule
from octo_motion.device.hid import force_profile as profile
from octo_motion.device.ipc.client import Client, ClientState
from octo_motion.device.ipc.process import Listener, MessageChannel, connect
from octo_motion.device.sources.discovery import Discovery, Sources
from tests.core.puppets import chain, posed, soft
from tests.device import firmware, uhid
from tests.device.parts import SPACE_MOUSE

pytestmark = pytest.mark.skipif(not uhid.available(), reason=uhid.WHY_NOT)

SECRET = bytes(32)
HID_ALONE = Sources(haply=False)
OPTIONS = ("--no-haply", "--rate", "50")
PERIOD = 0.02
"""An emulated machine with one processor is no place for 1 kHz."""
DYNAMICS = Dynamics(8.0, 0.4, 0.5, 0.0012)
PATIENCE = 100.0
"""s: of a machine that is emulated; on a real one each wait is over at once."""


@pytest.fixture
def plug() -> Iterator[Callable[..., uhid.VirtualDevice]]:
    devices: list[uhid.VirtualDevice] = []

    def plug_in(*arguments: Any, **named: Any) -> uhid.VirtualDevice:
        devices.append(uhid.VirtualDevice(*arguments, **named))
        return devices[-1]

    yield plug_in
    for device in devices:
        device.unplug()


@pytest.fixture
def client() -> Iterator[Client]:
    client = Client()
    yield client
    client.stop()


def space_mouse(plug: Callable[..., uhid.VirtualDevice]) -> uhid.VirtualDevice:
    return plug("3Dconnexion SpaceMouse Compact", 0x256F, 0xC635, SPACE_MOUSE)


def force_device(plug: Callable[..., uhid.VirtualDevice]) -> uhid.VirtualDevice:
    def features(number: int) -> bytes:
        described = firmware.pack_features(2, DYNAMICS)
        return described if number == profile.FEATURES else b""

    return plug("Octo hand", 0x1209, 0x0001, profile.report_descriptor(), features=features)


def wait_for(what: Callable[[], object], why: str, pause: float = 0.002) -> None:
    end = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < end, f"waited in vain: {why}"
        time.sleep(pause)


def wait_beside(what: Callable[[], object], why: str) -> None:
    """Wait, and leave an only processor to the processes that are waited for."""
    wait_for(what, why, 0.005 if (os.cpu_count() or 1) > 1 else 0.03)


def found_by(discovery: Discovery) -> Driver:
    got: list[Driver] = []

    def look() -> bool:
        got.extend(discovery.look())
        return bool(got)

    wait_for(look, "hidapi finds the device")
    assert discovery.problems == []
    return got[0]


def pose_report(position: Vector, buttons: int = 0, turn: Quaternion = IDENTITY) -> bytes:
    return firmware.pack_state(
        firmware.FirmwareState(
            *(0, 0, 0, buttons),
            held=True,
            powered=True,
            position=position,
            orientation=turn,
            velocity=ZERO,
            angular_velocity=ZERO,
        )
    )


def test_space_mouse_is_found_moved_unplugged_and_plugged_in_again(
    plug: Callable[..., uhid.VirtualDevice],
) -> None:
    device = space_mouse(plug)
    discovery = Discovery(HID_ALONE)
    driver = found_by(discovery)
    assert driver.description.kind is Kind.RATE
    assert driver.description.name == "SpaceMouse Compact"
    device.report(struct.pack("<B3h", 1, 0, 0, -350))
    device.report(struct.pack("<B3h", 2, 350, 0, 0))
    device.report(b"\x03\x01\0\0\0")

    def pushed() -> bool:
        device.report(struct.pack("<B3h", 1, 0, 0, -350))
        sample = driver.read()
        return bool(sample and sample.push and sample.push[2] > 0.0 and sample.buttons == 1)

    wait_for(pushed, "the push arrives")
    sample = driver.read()
    assert sample
    sample = corrected(sample, Kind.RATE, NONE, Response())
    assert sample.velocity == pytest.approx((0.0, 0.0, 0.4))
    assert sample.angular_velocity == pytest.approx((2.0, 0.0, 0.0))

    device.unplug()

    def lost() -> bool:
        try:
            driver.read()
        except DeviceLostError:
            return True
        return False

    wait_for(lost, "the driver notices")
    driver.close()
    discovery.lost(driver.description.identity)
    space_mouse(plug)
    again = found_by(discovery)
    assert again.description.identity == driver.description.identity
    again.close()


def test_force_device_tells_what_it_can_and_gets_force(
    plug: Callable[..., uhid.VirtualDevice],
) -> None:
    device = force_device(plug)
    driver = found_by(Discovery(HID_ALONE))
    assert driver.description.kind is Kind.POSE
    dynamics = driver.description.dynamics
    assert dynamics
    assert dynamics.force == pytest.approx(8.0)
    device.report(pose_report((0.01, 0.02, 0.03), buttons=2))
    sample = waited_for(driver)
    assert sample.position == pytest.approx((0.01, 0.02, 0.03))
    assert sample.buttons == 2
    driver.send((1.5, 0.0, -2.0), (0.0, 0.1, 0.0))
    wait_for(lambda: device.outputs, "the force arrives")
    command = firmware.parse_command(device.outputs[0])
    assert command.enabled
    assert command.force == pytest.approx((1.5, 0.0, -2.0))
    assert command.torque == pytest.approx((0.0, 0.1, 0.0))
    driver.close()
    wait_for(lambda: len(device.outputs) == 2, "the last word arrives")
    assert not firmware.parse_command(device.outputs[-1]).enabled


def waited_for(driver: Driver) -> Sample:
    samples: list[Sample] = []

    def came() -> bool:
        sample = driver.read()
        samples.extend([sample] if sample else [])
        return bool(samples)

    wait_for(came, "the pose arrives")
    return samples[-1]


def test_two_devices_with_one_serial_number_are_both_read(
    plug: Callable[..., uhid.VirtualDevice],
) -> None:
    both = [space_mouse(plug), space_mouse(plug)]
    discovery = Discovery(HID_ALONE)
    drivers: list[Driver] = []
    wait_for(lambda: drivers.extend(discovery.look()) or len(drivers) == 2, "both are found")
    assert len({each.description.identity for each in drivers}) == 2
    for device in both:
        device.report(b"\x03\x01\0\0\0")
    wait_for(lambda: all(waited_for(each).buttons == 1 for each in drivers), "both are heard")
    for each in drivers:
        each.close()


def test_force_device_obeys_one_blender_alone(
    plug: Callable[..., uhid.VirtualDevice],
) -> None:
    device = force_device(plug)
    first, second = Discovery(HID_ALONE), Discovery(HID_ALONE)
    driver = found_by(first)
    wait_for(lambda: list(second.look()) or second.problems, "the second one is told")
    assert second.problems[0].problem == "Octo hand is in use by another Blender."
    assert device.plugged_in
    driver.close()
    driver.close()
    taken: list[Driver] = []
    wait_for(lambda: taken.extend(second.look()) or taken, "it is free for the second one")
    taken[0].close()


def test_device_that_does_not_say_what_it_can_keeps_the_others_moving(
    plug: Callable[..., uhid.VirtualDevice],
) -> None:
    """The kernel waits five seconds for the answer of firmware that hangs."""
    mute = plug("Hung", 0x1209, 0x0002, profile.report_descriptor(), serial="hung")
    mute.hang()
    loop = Loop()

    def ticking(what: Callable[[], object]) -> Callable[[], object]:
        return lambda: (loop.tick(), what())[1]

    wait_for(ticking(lambda: mute.asked), "it is asked what it can do")
    ticks = 0
    while ticks < 100:
        loop.tick()
        assert not loop.notices, "the system still waits for the device; the loop does not"
        ticks += 1
    hand = force_device(plug)
    wait_for(ticking(lambda: loop.devices), "the other one is found")
    assert loop.devices[0].name == "Octo hand"
    wait_for(ticking(lambda: loop.notices), "it is told")
    assert "Hung does not follow the profile" in loop.notices[0].problem
    loop.close()
    hand.unplug()


class Hand:
    """The hand on a virtual force device: moved by the test, reported as firmware would, by itself.

    Args:
        device: whose hand it is.
        every: seconds between two reports; 0: the test reports.
    """

    def __init__(self, device: uhid.VirtualDevice, every: float = 0.0) -> None:
        self.device = device
        self.position: Vector = ZERO
        self.buttons = 0
        if every:
            threading.Thread(target=self._firmware, args=(every,), daemon=True).start()

    def _firmware(self, every: float) -> None:
        with contextlib.suppress(OSError):  # unplugged between the question and the report
            while not self.unplugged:
                self.report()
                time.sleep(every)

    def report(self) -> None:
        self.device.report(pose_report(self.position, self.buttons))

    @property
    def unplugged(self) -> bool:
        return not self.device.plugged_in

    def unplug(self) -> None:
        self.device.unplug()

    def last_command(self) -> firmware.Command:
        wait_for(lambda: not self.forces()[-1].enabled, "the last word arrives")
        return self.forces()[-1]

    def forces(self) -> list[firmware.Command]:
        return [firmware.parse_command(each) for each in self.device.outputs]


def bent(client: Client, start: np.ndarray) -> float:
    assert client.pose
    return float(np.abs(client.pose.orientations - start).max())


class Press:
    """A button that is pressed for a while, let go and pressed again, until it has held."""

    def __init__(self) -> None:
        self.button = 0
        self._next = 0.0

    def is_due(self) -> bool:
        """Whether it changes now."""
        if time.monotonic() < self._next:
            return False
        self.button ^= 1
        self._next = time.monotonic() + (4.0 if self.button else 0.5)
        return True

    def is_over(self) -> None:
        """It has held: what comes next is a new press."""
        self._next = 0.0


class Loop:
    """The loop at the devices, tick by tick, with a rock in the place of a puppet."""

    def __init__(self) -> None:
        listener = Listener(SECRET)
        got: list[MessageChannel | None] = []
        thread = threading.Thread(target=lambda: got.append(listener.accept(PATIENCE)))
        thread.start()
        self.there = connect(listener.port, SECRET)
        thread.join()
        assert got[0]
        self._here = got[0]
        schedule = Schedule(PERIOD)
        self.loop = HandLoop(self._here, Discovery(HID_ALONE), schedule)
        self.devices: list[say.DeviceMessage] = []
        self.notices: list[say.Notice] = []
        self.hand: say.HandMessage | None = None

    def close(self) -> None:
        self.loop.close()
        self._here.close()
        self.there.close()

    def tick(self) -> None:
        now = time.perf_counter()
        self.loop.tick(now)
        for message in self.there.receive():
            if isinstance(message, say.DeviceMessage):
                self.devices.append(message)
            elif isinstance(message, say.HandMessage):
                self.hand = message
            elif isinstance(message, say.Notice):
                self.notices.append(message)
        if self.hand is not None and self.hand.grab:
            self.there.send(say.HeldMessage(0, self.hand.grab, held=True, time=now))


def test_force_is_reported_in_mid_grab_ends_with_the_plug_and_begins_anew(
    plug: Callable[..., uhid.VirtualDevice],
) -> None:
    hand = Hand(force_device(plug))
    loop = Loop()

    def ticking(what: Callable[[], object]) -> Callable[[], object]:
        def look() -> object:
            if not hand.unplugged:
                hand.report()
            loop.tick()
            return what()

        return look

    def feels() -> bool:
        return any(np.linalg.norm(each.force) > 0.5 for each in hand.forces())

    wait_for(ticking(lambda: loop.devices), "the device is found")
    hand.buttons = 1
    wait_for(ticking(lambda: loop.hand and loop.hand.grab), "it grabs")
    hand.position = (0.04, 0.0, 0.0)
    wait_for(ticking(feels), "the hand feels it")
    strongest = max(hand.forces(), key=lambda each: float(np.linalg.norm(each.force)))
    assert strongest.enabled
    assert strongest.watchdog == profile.WATCHDOG_MILLISECONDS
    assert strongest.force[0] < 0.0, "it is drawn back"
    assert strongest.force[1:] == (0.0, 0.0)

    hand.unplug()
    wait_for(ticking(lambda: len(loop.devices) == 2), "the loop notices")
    assert not loop.devices[-1].present
    assert not list(loop.loop.pointers)

    hand = Hand(force_device(plug))
    wait_for(ticking(lambda: len(loop.devices) == 3), "the device is found again")
    assert loop.devices[-1].pointer == loop.devices[0].pointer
    hand.position = (0.04, 0.0, 0.0)
    wait_for(ticking(lambda: len(hand.forces()) > 20), "it is told to give no force")
    assert not any(each.enabled for each in hand.forces())
    hand.buttons = 1
    hand.position = ZERO
    wait_for(ticking(lambda: loop.hand and loop.hand.grab), "it grabs again")
    hand.position = (0.04, 0.0, 0.0)
    wait_for(ticking(feels), "the hand feels it again")
    loop.close()
    assert not hand.last_command().enabled


def test_force_device_bends_a_puppet_and_feels_it_until_it_is_unplugged_in_mid_grab(
    plug: Callable[..., uhid.VirtualDevice], client: Client
) -> None:
    """The whole bridge; also where a step takes so long that the local model must do between."""
    figure = chain(2, elements=soft(2, 40.0, 2.0, 100.0, 1.0))
    pose = posed(figure)
    hand = Hand(force_device(plug), every=0.01)
    client.start(OPTIONS)
    client.send(say.WorldMessage(step=8e-3))
    client.send_figure(figure, pose)
    client.send_pins({0: False})
    press = Press()

    def polled(what: Callable[[], object]) -> Callable[[], object]:
        def look() -> object:
            client.poll()
            assert client.state is ClientState.RUNNING
            return what()

        return look

    def pulls() -> bool:
        # On a machine that stalls the grip is lost, as it must be: grab again, like anyone would.
        held = 0 in client.pointers and client.pointers[0].body == 1
        if held:
            press.is_over()
            hand.position = (0.04, 0.0, 0.04)
        elif press.is_due():
            hand.position = ZERO
            hand.buttons = press.button
        return held

    def felt() -> list[float]:
        return [float(np.linalg.norm(each.force)) for each in hand.forces() if each.enabled]

    wait_beside(polled(lambda: client.devices), "the device is found")
    x, y, z = map(float, pose.positions[1] + [0.0, 0.15, 0.0])
    client.send(say.Workspace(0, (x, y, z)))
    wait_beside(
        polled(lambda: 0 in client.pointers and client.pointers[0].position == (x, y, z)),
        "the pointer is at the tip",
    )
    wait_beside(polled(lambda: pulls() and bent(client, pose.orientations) > 0.02), "it bends")
    wait_beside(polled(lambda: pulls() and max(felt(), default=0.0) > 0.2), "the hand feels it")
    count = len(hand.forces())
    wait_beside(polled(lambda: pulls() and len(hand.forces()) > count + 25), "it goes on")
    wait_beside(polled(lambda: client.times), "how well time is kept is told")
    assert client.times
    print(
        f"A step takes {1e3 * client.times.step:.0f} ms here, {client.times.pace:.2f} of real "
        f"time; force in {len(felt())} of {len(hand.forces())} reports, {max(felt()):.2f} N at most"
    )
    strongest = max(hand.forces(), key=lambda each: float(np.linalg.norm(each.force)))
    assert strongest.watchdog == profile.WATCHDOG_MILLISECONDS
    assert strongest.force[0] < 0.0, "it is drawn back"
    assert strongest.force[2] < 0.0
    assert max(felt()) <= 8.0 + 1e-9

    hand.unplug()
    wait_beside(polled(lambda: not client.devices), "its end is noticed")
    kept = bent(client, pose.orientations)
    assert kept > 0.01, "the pose stays"

    hand = Hand(force_device(plug), every=0.01)
    wait_beside(polled(lambda: client.devices), "the device is found again")
    assert set(client.devices) == {0}, "it is the same pointer as before"
    wait_beside(polled(lambda: 0 in client.pointers), "the pointer is back")
    assert client.pointers[0].body == -1, "nothing is held until it is grabbed again"
    assert not any(each.enabled for each in hand.forces())
    wait_beside(polled(lambda: pulls() and max(felt(), default=0.0) > 0.2), "it is felt again")


def test_space_mouse_bends_a_puppet(
    plug: Callable[..., uhid.VirtualDevice], client: Client
) -> None:
    figure = chain(3, elements=soft(3, 40.0, 2.0, 100.0, 1.0))
    pose = posed(figure)
    device = space_mouse(plug)
    client.start(OPTIONS)
    client.send(say.WorldMessage(step=4e-3))
    client.send_figure(figure, pose)
    client.send_pins({0: False})
    push = struct.pack("<B3h", 1, 0, 0, 0)

    def polled(what: Callable[[], object]) -> Callable[[], object]:
        def look() -> object:
            client.poll()
            device.report(push)
            return what()

        return look

    wait_beside(polled(lambda: client.devices), "the device is found")
    x, y, z = map(float, pose.positions[2] + [0.0, 0.15, 0.0])
    client.send(say.Workspace(0, (x, y, z)))
    wait_beside(
        polled(lambda: 0 in client.pointers and client.pointers[0].position == (x, y, z)),
        "the pointer is at the tip",
    )
    press = Press()

    def holds() -> bool:
        if press.is_due():
            device.report(bytes([3, press.button, 0, 0, 0]))
        return client.pointers[0].body == 2

    wait_beside(polled(holds), "the tip is held")
    push = struct.pack("<B3h", 1, 100, 0, -100)

    wait_beside(polled(lambda: bent(client, pose.orientations) > 0.02), "the puppet bends")
    device.report(b"\x03\0\0\0\0")
    wait_beside(polled(lambda: client.pointers[0].body == -1), "the tip is let go")
