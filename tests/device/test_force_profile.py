# SPDX-License-Identifier: GPL-3.0-or-later
"""The open profile: what firmware writes is what we read, and damaged reports are left out."""

from __future__ import annotations

import itertools
import math
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import DeviceError
from octo_motion.core.rotations.scalars import from_rotation_vector
from octo_motion.device.driver import DeviceLostError, Dynamics, Sample
from octo_motion.device.hid import force_profile as profile
from octo_motion.device.hid import system
from octo_motion.device.hid.force_profile import ForceDevice
from tests.device import firmware
from tests.device.parts import FakeHandle, found, wait_for

DYNAMICS = Dynamics(8.0, 0.4, 0.5, 0.001, 0.02, 0.0005, 1e-5, 1e-4, 0.001)
metres = st.floats(-1.0, 1.0)
vectors = st.tuples(metres, metres, metres)


def state(**changes: object) -> firmware.FirmwareState:
    values: dict[str, object] = {
        "sequence": 7,
        "clock": 123456,
        "answered": 5,
        "buttons": 0b101,
        "held": True,
        "powered": True,
        "position": (0.01, -0.02, 0.03),
        "orientation": from_rotation_vector((0.1, 0.2, 0.3)),
        "velocity": (0.1, -0.2, 0.3),
        "angular_velocity": (1.0, -2.0, 3.0),
    }
    return firmware.FirmwareState(**{**values, **changes})  # pyright: ignore[reportArgumentType]


@given(place=vectors, turn=vectors, velocity=vectors)
def test_state_survives_to_the_step_of_its_numbers(
    place: tuple[float, float, float],
    turn: tuple[float, float, float],
    velocity: tuple[float, float, float],
) -> None:
    sent = state(position=place, orientation=from_rotation_vector(turn), velocity=velocity)
    report = firmware.pack_state(sent)
    got = profile.parse_state(report, 12.0)
    assert got.position == pytest.approx(sent.position, abs=6e-8)
    assert got.orientation == pytest.approx(sent.orientation, abs=2e-9)
    assert got.velocity == pytest.approx(sent.velocity, abs=6e-5)
    assert profile.unpack(profile.STATE, report)[:4] == (7, 123456, 5, 0b101)
    assert got.buttons == 0b101
    assert got.time == 12.0
    assert got.held


def test_command_is_cut_to_what_its_numbers_hold() -> None:
    got = firmware.parse_command(
        profile.pack_command(70000, (100.0, -100.0, 1.5), (0.0, 0.25, -9.0))
    )
    assert got.enabled
    assert got.sequence == 70000 & 0xFFFF
    assert got.force == pytest.approx((32.767, -32.767, 1.5))
    assert got.torque == pytest.approx((0.0, 0.25, -3.2767))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_force_that_is_no_number_is_never_sent(bad: float) -> None:
    with pytest.raises(profile.ReportError):
        profile.pack_command(1, (bad, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_features_survive() -> None:
    got = profile.parse_features(firmware.pack_features(2, DYNAMICS))
    assert got.buttons == 2
    for name in DYNAMICS.__dataclass_fields__:
        assert getattr(got.dynamics, name) == pytest.approx(getattr(DYNAMICS, name), rel=1e-3)


def test_device_stronger_than_a_command_can_say_is_used_as_far_as_that() -> None:
    strong = firmware.pack_features(2, Dynamics(60.0, 6.0, 0.5, 0.001))
    dynamics = profile.parse_features(strong).dynamics
    assert (dynamics.force, dynamics.torque) == pytest.approx((32.767, 3.2767))
    force, torque = (dynamics.force, 0.0, 0.0), (0.0, -dynamics.torque, 0.0)
    command = firmware.parse_command(profile.pack_command(1, force, torque))
    assert command.force == pytest.approx(force)
    assert command.torque == pytest.approx(torque)


def test_other_version_of_the_profile_is_refused() -> None:
    report = bytearray(firmware.pack_features(2, DYNAMICS))
    report[1] = 2
    with pytest.raises(profile.ReportError, match="version 2"):
        profile.parse_features(bytes(report))


@given(st.binary(max_size=80), st.sampled_from([1, 2, 3]))
@settings(max_examples=300)
def test_any_bytes_are_a_report_or_are_refused(data: bytes, number: int) -> None:
    parsers = {
        1: lambda report: profile.parse_state(report, 0.0),
        2: firmware.parse_command,
        3: profile.parse_features,
    }
    try:
        got = parsers[number](bytes([number]) + data)
    except profile.ReportError:
        return
    if isinstance(got, Sample):
        assert math.isclose(sum(each * each for each in got.orientation), 1.0, rel_tol=1e-9)
        assert all(map(math.isfinite, (*got.position, *got.velocity)))


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine takes its time with a thread."""
    monkeypatch.setattr(system, "_WRITES_IN", 10.0)
    monkeypatch.setattr(system, "_CLOSES_IN", 10.0)


def opened() -> tuple[ForceDevice, FakeHandle]:
    handle = FakeHandle()
    return ForceDevice(
        found(page=0xFF4F, usage=1), handle, profile.ForceFeatures(2, DYNAMICS)
    ), handle


def test_newest_whole_report_counts() -> None:
    device, handle = opened()
    handle.reports.extend(firmware.pack_state(state(buttons=value)) for value in (1, 2, 3))
    handle.reports.append(b"\x01damaged")
    sample = device.read()
    assert sample
    assert sample.buttons == 3
    assert device.read() is None


@pytest.mark.parametrize(("held", "powered"), [(True, False), (False, True), (False, False)])
def test_motors_without_power_are_given_no_force_that_would_come_with_it(
    held: bool,  # noqa: FBT001
    powered: bool,  # noqa: FBT001
) -> None:
    """Whoever unlocks the emergency stop in mid-grab must not be struck."""
    device, handle = opened()
    handle.reports.append(firmware.pack_state(state(held=held, powered=powered)))
    sample = device.read()
    assert sample
    assert not sample.held
    handle.reports.append(firmware.pack_state(state()))
    sample = device.read()
    assert sample
    assert sample.held


def test_letting_go_disables_the_motors_and_closing_does_so_once_more() -> None:
    device, handle = opened()
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    device.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    device.close()
    device.close()
    commands = [firmware.parse_command(report) for report in handle.written]
    assert [command.enabled for command in commands] == [True, False, False]
    assert [command.sequence for command in commands] == [1, 2, 3]
    assert {command.watchdog for command in commands} == {20}
    assert handle.closed == 1


def test_unplugged_device_is_lost_when_read_and_when_given_force() -> None:
    device, handle = opened()
    handle.gone = True
    with pytest.raises(DeviceLostError):
        device.read()
    with pytest.raises(DeviceLostError):
        device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    device.close()


def test_device_that_says_nonsense_of_itself_is_refused_and_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    handle = FakeHandle(features=b"\x03\x02rest")
    monkeypatch.setattr(profile, "open_device", lambda _: handle)
    with pytest.raises(DeviceError, match="does not follow the profile"):
        ForceDevice.open(found(page=0xFF4F, usage=1))
    assert handle.closed == 1
    assert ForceDevice.drives(found(page=0xFF4F, usage=1))
    assert not ForceDevice.drives(found())


class StuckHandle(FakeHandle):
    """A device that does not take what is written to it until it is freed."""

    def __init__(self) -> None:
        super().__init__()
        self.free = threading.Event()

    def write(self, data: bytes, /) -> int:
        self.free.wait(20.0)
        return super().write(data)


def test_device_that_takes_nothing_stops_neither_the_loop_nor_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The system waits a second for it: the newest force is sent then, and no older one."""
    monkeypatch.setattr(system, "_WRITES_IN", 0.0005)
    monkeypatch.setattr(system, "_CLOSES_IN", 0.0005)
    handle = StuckHandle()
    device = ForceDevice(found(page=0xFF4F, usage=1), handle, profile.ForceFeatures(2, DYNAMICS))
    for number in range(100):
        device.send((0.01 * number, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert handle.written == []
    device.close()
    assert handle.closed == 0, "not while it is being written to"
    handle.free.set()
    wait_for(lambda: handle.closed)
    commands = [firmware.parse_command(report) for report in handle.written]
    assert len(commands) <= 3
    assert not commands[-1].enabled


def test_states_have_the_devices_clock_that_does_not_go_round_and_how_late_it_answers() -> None:
    device, handle = opened()
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    clocks: list[float | None] = []
    for clock in (0x7FFFFC18, 0x7FFFFFFF, 1, 1001):
        handle.reports.append(firmware.pack_state(state(clock=clock, answered=1)))
        sample = device.read()
        assert sample
        assert 0.0 < sample.delay < 60.0
        clocks.append(sample.clock)
    steps = [b - a for a, b in itertools.pairwise(map(float, filter(None, clocks)))]
    assert steps == pytest.approx([0.000999, 2e-6, 0.001], abs=1e-9)
    handle.reports.append(firmware.pack_state(state(answered=9)))
    sample = device.read()
    assert sample
    assert sample.delay == 0.0, "a command that was never sent"
