# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports of space mice: every layout, Blender's axes, nothing that a broken device can upset."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.device.hid import descriptor
from octo_motion.device.hid.descriptor import DescriptorError, ReportField, parse_descriptor
from octo_motion.device.hid.force_profile import report_descriptor
from octo_motion.device.hid.space_mouse import MODELS, MultiAxis, classic_layout, model_of
from tests.device.parts import COMBINED, SPACE_MOUSE

KNOWN = (SPACE_MOUSE, COMBINED, report_descriptor())


def axes(number: int, *values: int) -> bytes:
    return struct.pack(f"<B{len(values)}h", number, *values)


def test_separate_reports_push_with_one_and_turn_with_two() -> None:
    mouse = MultiAxis(parse_descriptor(SPACE_MOUSE))
    assert mouse.feed(axes(1, 350, 175, -350))
    assert mouse.feed(axes(2, 70, -350, 35))
    assert mouse.push == pytest.approx((1.0, -0.5, 1.0, 0.2, 1.0, -0.1))


def test_combined_report_holds_all_six_axes() -> None:
    mouse = MultiAxis(parse_descriptor(COMBINED))
    assert mouse.feed(axes(1, 350, 175, -350, 70, -350, 35))
    assert mouse.push == pytest.approx((1.0, -0.5, 1.0, 0.2, 1.0, -0.1))


@pytest.mark.parametrize("descriptor", [SPACE_MOUSE, COMBINED], ids=["separate", "combined"])
def test_layout_of_the_family_is_what_its_descriptors_say(descriptor: bytes) -> None:
    combined = descriptor is COMBINED
    told = MultiAxis(parse_descriptor(descriptor))
    assumed = MultiAxis(classic_layout(combined=combined))
    reports = [axes(1, 100, -200, 300, 5, 6, 7)[: 13 if combined else 7], b"\x03\x02\0\0\0"]
    reports += [] if combined else [axes(2, 5, 6, 7)]
    for report in reports:
        assert told.feed(report)
        assert assumed.feed(report)
    assert told.push == assumed.push
    assert told.buttons == assumed.buttons == 2


def test_right_is_right_away_is_away_and_up_is_up() -> None:
    # The device's own axes: X right, Y towards the user, Z down.
    mouse = MultiAxis(parse_descriptor(SPACE_MOUSE))
    mouse.feed(axes(1, 350, 0, 0))
    assert mouse.push[:3] == (1.0, 0.0, 0.0)
    mouse.feed(axes(1, 0, -350, 0))
    assert mouse.push[:3] == (0.0, 1.0, 0.0)
    mouse.feed(axes(1, 0, 0, -350))
    assert mouse.push[:3] == (0.0, 0.0, 1.0)


def test_buttons_are_bits_and_stay_until_they_are_let_go() -> None:
    mouse = MultiAxis(parse_descriptor(SPACE_MOUSE))
    mouse.feed(b"\x03\x01\0\0\0")
    mouse.feed(axes(1, 1, 2, 3))
    assert mouse.buttons == 1
    mouse.feed(b"\x03\x00\x10\0\0")
    assert mouse.buttons == 1 << 12
    mouse.feed(b"\x03\0\0\0\0")
    assert mouse.buttons == 0


def test_more_than_full_push_counts_as_full() -> None:
    mouse = MultiAxis(parse_descriptor(SPACE_MOUSE))
    mouse.feed(axes(1, 500, -32768, 0))
    assert mouse.push[:2] == (1.0, 1.0)


def test_short_and_strange_reports_change_nothing_they_do_not_hold() -> None:
    mouse = MultiAxis(parse_descriptor(SPACE_MOUSE))
    mouse.feed(axes(1, 350, 0, 0))
    for report in (b"", b"\x01", b"\x17\x64", b"\x09" * 20):
        assert not mouse.feed(report)
    assert mouse.push[0] == 1.0


def test_device_without_report_numbers_and_with_odd_widths_is_read() -> None:
    # Six axes of ten bits each after three buttons, as home-made devices have them.
    odd = bytes.fromhex(
        "05 01 09 08 a1 01 a1 00 05 09 19 01 29 03 15 00 25 01 95 03 75 01 81 02 05 01"
        "09 30 09 31 09 32 09 33 09 34 09 35 16 00 fe 26 00 02 75 0a 95 06 81 06 c0 c0"
    )
    mouse = MultiAxis(parse_descriptor(odd))
    bits = 0b101 | (256 << 3) | ((-512 & 0x3FF) << 13)
    assert mouse.feed(bits.to_bytes(8, "little"))
    assert mouse.buttons == 0b101
    assert mouse.push[:2] == (0.5, 1.0)


@pytest.mark.parametrize(("bits", "rest"), [(8, 128), (10, 512), (16, 32768)])
def test_pad_whose_axes_are_unsigned_is_at_rest_in_the_middle_of_their_range(
    bits: int, rest: int
) -> None:
    most = (1 << bits) - 1
    pad = MultiAxis(
        parse_descriptor(
            b"".join(
                descriptor.item(kind, value)
                for kind, value in (
                    *(("usage_page", 1), ("usage", 8), ("collection", 1)),
                    *(("usage", usage) for usage in range(0x30, 0x36)),
                    *(("logical_minimum", 0), ("logical_maximum", most)),
                    *(("report_size", bits), ("report_count", 6), ("input", 2)),
                    ("end_collection", 0),
                )
            )
        )
    )

    def push(*values: int) -> tuple[float, ...]:
        packed = sum(value << index * bits for index, value in enumerate(values))
        assert pad.feed(packed.to_bytes(6 * bits // 8 + 1, "little"))
        return pad.push

    assert push(*[rest] * 6) == (0.0,) * 6
    assert push(0, 0, 0, most, most, most) == pytest.approx((-1, 1, 1, 1, -1, -1), abs=0.01)
    assert push(rest + rest // 2, *[rest] * 5)[0] == pytest.approx(0.5, abs=0.01)


def test_every_product_is_named_once() -> None:
    ids = [(model.vendor, model.product) for model in MODELS]
    assert len(set(ids)) == len(ids)
    for name in ("SpaceNavigator", "SpaceExplorer", "SpacePilot", "SpacePilot Pro"):
        assert any(model.name == name for model in MODELS)
    receiver = model_of(0x256F, 0xC652)
    assert receiver
    assert receiver.name == "Universal Receiver"


def test_force_profile_describes_itself() -> None:
    layout = parse_descriptor(report_descriptor())
    assert report_descriptor().startswith(bytes.fromhex("06 4f ff 09 01 a1 01"))
    assert layout.numbered
    sizes = {
        each.report: max(f.bit + f.bits for f in layout.fields if f.report == each.report)
        for each in layout.fields
    }
    assert sizes == {1: 8 * 52, 2: 8 * 16, 3: 8 * 20}
    assert {each.way for each in layout.fields} == set(ReportField)


@pytest.mark.parametrize(
    "broken",
    [
        SPACE_MOUSE[:-1],
        SPACE_MOUSE + b"\xc0",
        b"\xb4" * 3,
        b"\xa4" * 100,
        b"\x75\x40\x97\xff\xff\xff\x7f\x81\x02",
        b"\x85\x00",
        b"\x0c" * 5 + b"\xff",
        b"\xa1\x01" * 100,
        b"\0" * 5000,
    ],
)
def test_broken_descriptor_is_refused(broken: bytes) -> None:
    with pytest.raises(DescriptorError):
        parse_descriptor(broken)


@given(st.binary(max_size=300))
@settings(max_examples=300)
def test_any_bytes_are_a_descriptor_or_are_refused(data: bytes) -> None:
    try:
        layout = parse_descriptor(data)
    except DescriptorError:
        return
    mouse = MultiAxis(layout)
    for report in (b"", data[:64], b"\xff" * 64):
        mouse.feed(report)
    assert all(-1.0 <= value <= 1.0 for value in mouse.push)


@given(st.data())
@settings(max_examples=300)
def test_descriptor_with_a_few_bytes_changed_is_read_or_refused(data: st.DataObject) -> None:
    changed = bytearray(data.draw(st.sampled_from(KNOWN)))
    for _ in range(data.draw(st.integers(1, 6))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    try:
        layout = parse_descriptor(bytes(changed))
    except DescriptorError:
        return
    assert len(layout.fields) <= 4096
    mouse = MultiAxis(layout)
    mouse.feed(data.draw(st.binary(max_size=64)))
    assert all(-1.0 <= value <= 1.0 for value in mouse.push)


@given(st.sampled_from(sorted(descriptor._ITEMS)), st.integers(-(2**31), 2**32 - 1))
def test_what_is_written_is_read_again(kind: str, value: int) -> None:
    if kind in {"input", "output", "feature", "collection", "end_collection", "report_id"}:
        return
    signed = descriptor._ITEMS[kind][1]
    if not (-(2**31) <= value < 2**31 if signed else 0 <= value < 2**32):
        with pytest.raises(DescriptorError):
            descriptor.item(kind, value)
        return
    data = descriptor.item(kind, value)
    assert int.from_bytes(data[1:], "little", signed=signed) == value
    parse_descriptor(data)
