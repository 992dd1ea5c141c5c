# SPDX-License-Identifier: GPL-3.0-or-later
"""A new kind of device is one module and one row: the example of docs/extending.md, as it is."""

from __future__ import annotations

import struct
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from octo_motion.device import __main__ as program
from octo_motion.device.calibration import Calibration
from octo_motion.device.driver import Driver, Kind, Sample
from octo_motion.device.haptics.pointer import Pointer
from octo_motion.device.hid.force_profile import USAGE, USAGE_PAGE, ForceDevice
from octo_motion.device.hid.space_mouse import SpaceMouse
from octo_motion.device.hid.system import Found, HidDriver
from octo_motion.device.messages import Settings
from octo_motion.device.sources import discovery
from octo_motion.device.sources.discovery import HID_DRIVERS, hid_driver_for
from tests.device.parts import FakeHandle, found

PAGE = Path(__file__).resolve().parents[2] / "docs" / "extending.md"
KNOB = replace(found(0x1209, 0x4B01, page=0x0C), name="Studio knob")
HANDLE = FakeHandle()


@pytest.fixture
def knob(monkeypatch: pytest.MonkeyPatch) -> type[Driver]:
    """The driver that the page shows, with its row in the table."""
    HANDLE.reports.clear()
    chapter = PAGE.read_text(encoding="utf-8").split("\n## A device\n")[1].split("\n## ")[0]
    code, row = (each.split("```")[0] for each in chapter.split("```text\n")[1:3])
    names: dict[str, Any] = {
        each.__name__: each for each in (ForceDevice, Found, HidDriver, Kind, Sample, SpaceMouse)
    }
    names |= {"Final": Final, "struct": struct, "time": time}
    names["open_device"] = lambda _found: HANDLE
    exec(f"from __future__ import annotations\n{code}", names)  # noqa: S102 - our own page
    exec(f"from __future__ import annotations\n{row}", names)  # noqa: S102 - our own page
    assert names["HID_DRIVERS"][:-1] == HID_DRIVERS
    monkeypatch.setattr(discovery, "HID_DRIVERS", names["HID_DRIVERS"])
    return names["Knob"]


def test_knob_is_found_and_turns_the_pointer_as_settings_and_calibration_say(
    knob: type[Driver],
) -> None:
    kind = hid_driver_for(KNOB)
    assert kind
    assert kind.name == "knob"
    driver = kind.open(KNOB)
    assert isinstance(driver, knob)
    none, one = (0.0,) * 6, (1.0,) * 6
    settings = Settings(angular_speed=3.0, dead_zone=none, curve=one)  # pyright: ignore[reportArgumentType]
    pointer = Pointer(0, driver, 0.001, settings)
    HANDLE.reports.append(struct.pack("<bB", 50, 1))
    pointer.tick(time.perf_counter())
    assert pointer.angular_velocity == pytest.approx((0.0, 0.0, 1.5))
    assert pointer.grab
    pointer.correct(Calibration(rest=(0.0, 0.0, 0.0, 0.0, 0.0, 0.5)))
    HANDLE.reports.append(struct.pack("<bB", 50, 0))
    pointer.tick(time.perf_counter())
    assert pointer.angular_velocity == pytest.approx((0.0, 0.0, 0.0))


def test_devices_are_listed_by_the_table(
    knob: type[Driver], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert knob
    force = replace(found(0x1209, 1, USAGE_PAGE, USAGE), name="My arm")
    hid = __import__("octo_motion.device.hid", fromlist=["list_devices"])
    mouse = replace(found(product=0xC656), usage=2)
    monkeypatch.setattr(hid, "list_devices", lambda: [KNOB, found(), force, mouse])
    monkeypatch.setattr(hid, "open_device", lambda _found: FakeHandle())
    assert program.main(["list"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "1209:4b01  Studio knob (knob)",
        "256f:c635  SpaceMouse Compact (space mouse)",
        "1209:0001  My arm (force device)",
    ]


def test_no_interface_belongs_to_two_kinds() -> None:
    for page, usage in ((1, 8), (0, 0), (USAGE_PAGE, USAGE), (1, 2)):
        assert sum(each.drives(found(page=page, usage=usage)) for each in HID_DRIVERS) <= 1
