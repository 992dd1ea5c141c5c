# SPDX-License-Identifier: GPL-3.0-or-later
"""A device's own zero and range: learned while it is moved, and used from then on."""

from __future__ import annotations

import math
import struct
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core.errors import DeviceError
from octo_motion.device import messages as say
from octo_motion.device.calibration import NONE, Calibration, Calibrator, Phase, reached
from octo_motion.device.codec import MessageError
from octo_motion.device.driver import Axes, Kind, Sample
from octo_motion.device.haptics.pointer import Pointer
from octo_motion.device.hid.space_mouse import SpaceMouse, classic_layout
from octo_motion.device.messages import Settings
from tests.device.parts import FakeHandle, found
from tests.device.test_pointer import ROCK, Table

WORN: Axes = (0.1, 0.0, -0.05, 0.0, 0.0, 0.02)
"""Where a worn cap comes to rest."""
NOTHING, FULL = NONE.rest, NONE.most
ENDS: tuple[Axes, Axes] = ((-0.7, -0.8, -0.9, -0.6, -0.7, -0.8), (0.8, 0.9, 0.7, 0.7, 0.9, 0.6))


def learned(kind: Kind, *told: Axes, rest: Axes = WORN, seconds: float = 1.2) -> Calibrator:
    """A calibrator that has heard of a device at rest, then of it at these places."""
    calibrator = Calibrator(kind)
    now = 0.0
    for each in (*[rest] * round(seconds / 0.01), *told):
        now += 0.01
        calibrator.feed(now, said(kind, now, each))
    return calibrator


def said(kind: Kind, now: float, axes: Axes) -> Sample:
    """A sample of a device whose axes say this."""
    if kind is Kind.RATE:
        return Sample(now, push=axes)
    return Sample(now, position=axes[:3])


def test_worn_cap_is_at_rest_where_it_rests_and_at_its_end_where_it_ends() -> None:
    calibration = learned(Kind.RATE, *ENDS).finish()
    assert calibration.rest == pytest.approx(WORN)
    assert calibration.push(WORN) == pytest.approx((0.0,) * 6)
    assert calibration.push(ENDS[0]) == pytest.approx((-1.0,) * 6)
    assert calibration.push(ENDS[1]) == pytest.approx((1.0,) * 6)
    assert calibration.push((2.0, 2.0, 2.0, 2.0, 2.0, 2.0)) == FULL


def test_axis_that_was_not_moved_goes_as_far_as_its_maker_says() -> None:
    calibration = learned(Kind.RATE, (0.9, 0.0, 0.0, 0.0, 0.0, 0.0)).finish()
    # Pushed to the right alone: as far to the left.
    assert calibration.least[0] == pytest.approx(0.1 - 0.8)
    assert calibration.most[0] == pytest.approx(0.9)
    assert (calibration.least[1], calibration.most[1]) == (-1.0, 1.0)
    assert calibration.rest == pytest.approx(WORN), "its zero is learned all the same"


def test_cap_that_is_touched_is_waited_for() -> None:
    calibrator = Calibrator(Kind.RATE)
    for tick in range(300):
        push = (0.3 * math.sin(0.1 * tick), 0.0, 0.0, 0.0, 0.0, 0.0)
        calibrator.feed(0.01 * tick, said(Kind.RATE, 0.0, push))
    assert calibrator.phase is Phase.REST
    for tick in range(300):
        held = said(Kind.RATE, 0.0, (0.9, 0.0, 0.0, 0.0, 0.0, 0.0))
        calibrator.feed(3.0 + 0.01 * tick, held)
    assert calibrator.phase is Phase.REST, "held at its end it is not left alone"
    for tick in range(110):
        calibrator.feed(6.0 + 0.01 * tick, said(Kind.RATE, 0.0, WORN))
    assert calibrator.phase is Phase.REACH


@pytest.mark.parametrize("kind", Kind)
def test_device_that_was_not_moved_is_not_calibrated(kind: Kind) -> None:
    calibrator = learned(kind)
    with pytest.raises(DeviceError, match="was not moved"):
        calibrator.finish()
    assert calibrator.phase is Phase.FAILED
    with pytest.raises(DeviceError, match="was not moved"):
        Calibrator(kind).finish()


def test_middle_of_its_way_is_the_zero_of_a_device_that_tells_where_the_hand_is() -> None:
    calibrator = learned(
        *(Kind.POSE, (0.1, 0.0, 0.3, 0.0, 0.0, 0.0), (-0.06, -0.02, 0.1, 0.0, 0.0, 0.0)),
        rest=(0.0, 0.0, 0.2, 0.0, 0.0, 0.0),
    )
    assert reached(calibrator.so_far, Kind.POSE) == (3, 3)
    calibration = calibrator.finish()
    assert calibration.rest[:3] == pytest.approx((0.02, -0.01, 0.2))
    assert calibration.width == pytest.approx(0.2)


def test_progress_counts_the_ends_that_were_reached() -> None:
    assert reached(learned(Kind.RATE).so_far, Kind.RATE) == (0, 12)
    one_side = learned(Kind.RATE, ENDS[0])
    assert reached(one_side.so_far, Kind.RATE) == (6, 12)
    assert reached(learned(Kind.RATE, *ENDS).so_far, Kind.RATE) == (12, 12)


shares = st.floats(-1.0, 1.0)
axes = st.tuples(*[shares] * 6)


@given(st.tuples(*[st.floats(-0.45, 0.45)] * 6), st.lists(axes, min_size=1, max_size=8))
def test_whatever_is_learned_is_a_range_about_its_rest(rest: Axes, told: list[Axes]) -> None:
    calibrator = learned(Kind.RATE, *told, rest=rest)
    try:
        calibration = calibrator.finish()
    except DeviceError:
        return
    assert calibration.push(calibration.rest) == NOTHING
    for each in told:
        assert all(-1.0 <= push <= 1.0 for push in calibration.push(each))


@pytest.mark.parametrize(
    ("name", "value"), [("rest", 2.0), ("least", 0.5), ("most", math.nan), ("most", math.inf)]
)
def test_calibration_that_makes_no_sense_is_refused(name: str, value: float) -> None:
    wrong: dict[str, Axes] = {name: (value, value, value, value, value, value)}
    with pytest.raises(DeviceError, match="damaged"):
        Calibration(**wrong)


def test_message_that_carries_nonsense_is_refused() -> None:
    message = say.CalibrationMessage(0, 0, FULL, NOTHING, NOTHING)
    with pytest.raises(MessageError):
        message.calibration()
    assert say.CalibrationMessage.of(0, NONE).calibration() == NONE


# --- Used by the loop ----------------------------------------------------------------------------


def test_space_mouse_no_longer_creeps_once_it_is_calibrated() -> None:
    handle = FakeHandle()
    mouse = SpaceMouse(found(), handle, classic_layout(combined=False))
    pointer = Pointer(0, mouse, 0.001, Settings(dead_zone=NOTHING, curve=FULL))
    creeping = struct.pack("<B3h", 1, 35, 0, 0)  # a tenth of the way, with nobody touching it
    handle.reports.append(creeping)
    pointer.tick(time.perf_counter())
    assert pointer.sample.push
    assert pointer.sample.push[0] == pytest.approx(0.1)
    assert pointer.velocity == pytest.approx((0.04, 0.0, 0.0))
    pointer.correct(Calibration(rest=(0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    handle.reports.append(creeping)
    pointer.tick(time.perf_counter())
    assert pointer.velocity == pytest.approx((0.0, 0.0, 0.0))


def test_nothing_is_grabbed_or_given_force_while_a_device_is_calibrated() -> None:
    table = Table()
    table.pointer.calibrate(begin=True)
    table.buttons = 1
    table.place = (0.02, 0.0, 0.0)
    table.ticks(50, ROCK)
    assert table.pointer.grab == 0
    table.pointer.want(grab=True)
    table.place = (-0.04, 0.02, 0.0)
    table.ticks(50, ROCK)
    assert table.pointer.grab == 0
    assert table.force == 0.0
    assert table.pointer.calibrator
    calibration = table.pointer.calibrator.finish()
    table.pointer.correct(calibration)
    table.pointer.calibrate(begin=False)
    table.place = (0.02, 0.0, 0.0)
    table.ticks(1)
    # The middle between −4 and 2 cm is now zero.
    assert table.pointer.position == pytest.approx((0.03, -0.01, 0.0))
