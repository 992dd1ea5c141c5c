# SPDX-License-Identifier: GPL-3.0-or-later
"""A space mouse moves the pointer as it is pushed, and never runs away with it."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import DeviceError
from octo_motion.device.calibration import NONE, Response, corrected
from octo_motion.device.driver import Axes, DeviceLostError, Kind, Sample
from octo_motion.device.hid import space_mouse, system
from octo_motion.device.hid.descriptor import parse_descriptor
from octo_motion.device.hid.space_mouse import SpaceMouse
from tests.device.parts import SPACE_MOUSE, FakeHandle, found


def six(value: float) -> Axes:
    return (value, value, value, value, value, value)


PROPORTIONAL = Response(dead_zone=six(0.0), curve=six(1.0))


def plugged_in() -> tuple[SpaceMouse, FakeHandle]:
    handle = FakeHandle()
    return SpaceMouse(found(), handle, parse_descriptor(SPACE_MOUSE)), handle


def read(mouse: SpaceMouse) -> Sample:
    """As the loop reads it."""
    sample = mouse.read()
    assert sample
    return corrected(sample, Kind.RATE, NONE, PROPORTIONAL)


def push(*values: int) -> bytes:
    return struct.pack("<B3h", 1, *values)


def test_newest_report_counts_and_all_older_ones_are_taken() -> None:
    mouse, handle = plugged_in()
    handle.reports.extend(push(value, 0, 0) for value in range(0, 351, 10))
    sample = read(mouse)
    assert sample.velocity[0] == pytest.approx(PROPORTIONAL.speed)
    assert not handle.reports


def test_full_push_is_full_speed_in_metres_and_radians_a_second() -> None:
    mouse, handle = plugged_in()
    handle.reports.append(push(0, -350, 0))
    handle.reports.append(struct.pack("<B3h", 2, 0, 0, -350))
    sample = read(mouse)
    assert sample.velocity == pytest.approx((0.0, 0.4, 0.0))
    assert sample.angular_velocity == pytest.approx((0.0, 0.0, 2.0))


def test_push_that_is_not_repeated_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(space_mouse.time, "perf_counter", lambda: now)
    mouse, handle = plugged_in()
    handle.reports.append(push(350, 0, 0))
    sample = read(mouse)
    assert sample.velocity[0] > 0.0
    now += 0.6
    sample = read(mouse)
    assert sample.velocity == (0.0, 0.0, 0.0)


def test_unplugged_mouse_says_so_once_and_for_all() -> None:
    mouse, handle = plugged_in()
    handle.gone = True
    with pytest.raises(DeviceLostError):
        mouse.read()
    mouse.close()
    mouse.close()
    assert handle.closed == 1
    with pytest.raises(DeviceLostError):
        mouse.read()


def test_buttons_have_the_names_that_stand_on_the_device() -> None:
    mouse, handle = plugged_in()
    assert mouse.description.buttons == ("Left", "Right")
    assert mouse.description.name == "SpaceMouse Compact"
    assert mouse.description.kind is Kind.RATE
    handle.reports.append(b"\x03\x02\0\0\0")
    sample = mouse.read()
    assert sample
    assert sample.buttons == 2


def test_any_multi_axis_controller_is_taken_and_other_products_of_the_family_are_not() -> None:
    assert SpaceMouse.drives(found())
    assert SpaceMouse.drives(found(vendor=0x1234, product=0x5678))
    assert not SpaceMouse.drives(found(product=0xC656, page=1, usage=2))  # a CadMouse
    assert not SpaceMouse.drives(found(page=0xFF00, usage=1))
    # Where the system tells no usage, the table decides.
    assert SpaceMouse.drives(found(page=0, usage=0))
    assert not SpaceMouse.drives(found(product=0xC656, page=0, usage=0))


unit = st.floats(-1.0, 1.0)


@given(
    push=st.tuples(unit, unit, unit, unit, unit, unit),
    zone=st.floats(0.0, 0.9),
    curve=st.floats(0.2, 5.0),
)
def test_response_keeps_direction_and_stays_within_full_speed(
    push: tuple[float, float, float, float, float, float], zone: float, curve: float
) -> None:
    response = Response(dead_zone=six(zone), curve=six(curve))
    for index, (value, speed) in enumerate(zip(push, response.speeds(push), strict=True)):
        full = response.speed if index < 3 else response.angular_speed
        assert abs(speed) <= full * (1 + 1e-12)
        assert speed * value >= 0.0
        if abs(value) <= zone:
            assert speed == 0.0


@pytest.mark.parametrize(
    "broken",
    [{"dead_zone": six(1.0)}, {"curve": six(0.0)}, {"gain": six(float("nan"))}],
)
def test_response_that_makes_no_sense_is_refused(broken: dict[str, Axes]) -> None:
    with pytest.raises(DeviceError):
        Response(**broken)  # pyright: ignore[reportArgumentType]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="permissions of Linux")
def test_device_that_may_not_be_read_comes_with_the_rule_to_add(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "hidraw0"
    path.touch()

    class Refusing:
        def open_path(self, _path: bytes) -> None:
            raise OSError("open failed")

    class Module:
        device = Refusing

    monkeypatch.setattr(system, "hidapi", Module)
    monkeypatch.setattr(system.os, "access", lambda *_: False)
    monkeypatch.setattr(system.sys, "platform", "linux")
    device = system.Found(os.fsencode(path), 0x256F, 0xC635, 1, 8, "SpaceMouse", "")
    with pytest.raises(DeviceError) as caught:
        system.open_device(device)
    assert 'KERNELS=="*:256F:C635.*", TAG+="uaccess"' in caught.value.remedy
    assert "/etc/udev/rules.d/70-octo-motion.rules" in caught.value.remedy


def test_python_without_hidapi_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(system.importlib, "import_module", missing)
    with pytest.raises(DeviceError, match="hidapi"):
        system.list_devices()
