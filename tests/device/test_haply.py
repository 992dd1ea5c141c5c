# SPDX-License-Identifier: GPL-3.0-or-later
"""Haply's service as a device, and the WebSocket that leads to it."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import DeviceError
from octo_motion.core.rotations.scalars import IDENTITY
from octo_motion.device.driver import DeviceLostError, Kind, Sample
from octo_motion.device.sources import haply
from octo_motion.device.sources.haply import Haply
from octo_motion.device.sources.websocket import (
    FrameReader,
    WebSocket,
    WebSocketError,
    accept_key,
    frame,
    masked,
)
from tests.device.parts import HaplyService, wait_for

# --- WebSocket -----------------------------------------------------------------------------------


@given(st.binary(max_size=300), st.binary(min_size=4, max_size=4))
def test_mask_taken_twice_is_none(payload: bytes, mask: bytes) -> None:
    assert masked(masked(payload, mask), mask) == payload


@pytest.mark.parametrize("size", [0, 1, 125, 126, 65535, 65536])
def test_frame_of_any_size_is_read_in_any_pieces(size: int) -> None:
    payload = bytes(index & 0xFF for index in range(size))
    data = frame(0x1, payload)
    reader = FrameReader()
    got: list[tuple[int, bytes]] = []
    for at in range(0, len(data), 1000):
        got += reader.feed(data[at : at + 1000])
    assert got == [(0x1, payload)]


@given(st.lists(st.binary(max_size=40), max_size=6))
@settings(max_examples=300)
def test_any_bytes_are_frames_or_are_refused(pieces: list[bytes]) -> None:
    reader = FrameReader()
    try:
        for piece in pieces:
            reader.feed(piece)
    except WebSocketError:
        pass


@pytest.mark.parametrize(
    "data",
    [b"\x81\x81mask.", b"\xf1\x00", b"\x80\x00", b"\x09\x00", b"\x81\x7f" + b"\xff" * 8],
    ids=["masked", "reserved bits", "no beginning", "ping in pieces", "endless"],
)
def test_frame_against_the_rules_is_refused(data: bytes) -> None:
    with pytest.raises(WebSocketError):
        FrameReader().feed(data)


def test_server_that_is_no_websocket_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            client, _ = server.accept()
            client.recv(1000)
            client.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n")
            client.close()

        threading.Thread(target=answer, daemon=True).start()
        with pytest.raises(WebSocketError, match="no WebSocket server"):
            WebSocket.connect("127.0.0.1", server.getsockname()[1])
    with pytest.raises(WebSocketError, match="nobody"):
        WebSocket.connect("127.0.0.1", 1)


# --- Haply ---------------------------------------------------------------------------------------


class Flood:
    """A service at which everything is right, but that it sends without end once it is open."""

    def __init__(self, what: bytes) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self._what = what
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        client, _ = self._server.accept()
        with client, suppress(OSError):
            request = client.recv(4096)
            key = request.split(b"Sec-WebSocket-Key: ")[1].split(b"\r\n")[0]
            client.sendall(
                b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + accept_key(key) + b"\r\n\r\n"
            )
            while True:
                client.sendall(self._what)

    def close(self) -> None:
        self._server.close()


@pytest.mark.parametrize(
    "what",
    [
        frame(0x9, b"") * 20_000,
        frame(0x1, b"{}") * 10_000,
        frame(0x1, b"[" * 60_000),
        bytes([0x01]) + frame(0x0, b"x" * 4000)[1:] + (bytes([0x00]) + frame(0x0, b"x" * 4000)[1:]),
        b"\x81\x7f" + (1 << 40).to_bytes(8, "big"),
    ],
    ids=["pings", "states", "brackets", "one message", "a huge frame"],
)
def test_service_that_sends_without_end_neither_holds_the_loop_nor_fills_memory(
    what: bytes,
) -> None:
    service = Flood(what)
    line: WebSocket | None = None
    try:
        line = WebSocket.connect("127.0.0.1", service.port, 5.0)
        ends = time.monotonic() + 0.5
        while time.monotonic() < ends:
            for text in line.receive():
                haply.parse(text)
            assert len(line._stream.received) + len(line._reader._data) <= 200_000
            line.send("{}")
            assert len(line._stream.unsent) <= 100_000
    except WebSocketError:
        pass  # sent away
    finally:
        if line is not None:
            line.close()
        service.close()


def test_no_look_at_what_came_takes_more_than_it_has_to() -> None:
    """Bounds of one look: 64 frames and 64 kB of what a service sends."""
    with pytest.raises(WebSocketError, match="without end"):
        FrameReader().feed(frame(0x9, b"") * 100)
    with pytest.raises(WebSocketError, match="too long"):
        FrameReader().feed(frame(0x1, b"x" * 70_000))
    assert len(FrameReader().feed(frame(0x1, b"{}") * 3)) == 3


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("inverse3", "Haply Inverse3"),
        ("inverse3x", "Haply Inverse3x"),
        ("minverse", "Haply Minverse"),
        ("another", "Haply Inverse3"),
    ],
)
def test_haply_is_the_model_that_its_service_lists(kind: str, name: str) -> None:
    service = HaplyService()
    service.config = {"type": kind}
    device = open_haply(service)
    assert device.description.name == name
    dynamics = device.description.dynamics
    assert dynamics
    assert (dynamics.force < 8.0) == (kind == "minverse"), "the small one is given less"
    assert wait_for(device.read)
    device.close()
    service.close()


@pytest.fixture
def service() -> Iterator[HaplyService]:
    service = HaplyService()
    yield service
    service.close()


def open_haply(service: HaplyService) -> Haply:
    device = Haply.open(service.port)
    assert device
    return device


def test_haply_tells_pose_buttons_and_gets_force(service: HaplyService) -> None:
    service.buttons["a"] = True
    device = open_haply(service)
    assert device.description.kind is Kind.POSE
    sample = wait_for(device.read)
    assert isinstance(sample, Sample)
    assert sample.position == (0.01, 0.02, 0.03)
    assert sample.velocity == (0.1, 0.0, -0.1)
    assert sample.orientation == (0.0, 0.0, 0.0, 1.0)
    assert sample.buttons == 1
    device.send((1.0, -2.0, 3.0), (0.0, 0.0, 0.0))
    wait_for(lambda: service.received)
    first = service.received[0]
    assert first["session"]["configure"]["profile"]["name"] == "octo-motion:posing"
    assert first["session"]["configure"]["basis"] == {"permutation": "XYZ"}
    assert first["inverse3"] == [
        {
            "device_id": "049D",
            "configure": {"preset": {"preset": "arm_front_centered"}},
            "commands": {"set_cursor_force": {"values": {"x": 1.0, "y": -2.0, "z": 3.0}}},
        }
    ]
    wait_for(device.read)
    device.send((0.5, 0.0, 0.0), (0.0, 0.0, 0.0))
    wait_for(lambda: len(service.received) == 2)
    assert "session" not in service.received[1], "a session is configured once"
    assert "configure" not in service.received[1]["inverse3"][0], "and so is a device"
    device.close()
    device.close()


def test_haply_tells_how_late_a_force_comes(service: HaplyService) -> None:
    """As late as the service's answer, and a millisecond of the device's own."""
    device = open_haply(service)
    first = wait_for(device.read)
    assert isinstance(first, Sample)
    assert first.delay == 0.0, "nothing was sent yet"
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    answer = wait_for(device.read)
    assert isinstance(answer, Sample)
    assert 0.001 < answer.delay < 1.0
    device.close()


def test_haply_is_sent_one_message_for_each_state(service: HaplyService) -> None:
    device = open_haply(service)
    wait_for(device.read)
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    device.send((2.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # not before the service has answered
    wait_for(device.read)
    device.send((3.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wait_for(lambda: len(service.received) == 2)
    forces = [
        each["inverse3"][0]["commands"]["set_cursor_force"]["values"]["x"]
        for each in service.received
    ]
    assert forces == [1.0, 3.0]
    device.close()


def test_older_haply_service_is_not_asked_for_what_it_does_not_know() -> None:
    service = HaplyService("3.1.1")
    device = open_haply(service)
    sample = wait_for(device.read)
    assert isinstance(sample, Sample)
    assert sample.position == pytest.approx((0.01, 0.16, -0.12))  # counted from the middle
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wait_for(lambda: service.received)
    assert "session" not in service.received[0]
    assert "configure" not in service.received[0]["inverse3"][0]
    device.close()
    service.close()


def test_older_haply_service_tells_its_version_at_the_port_below() -> None:
    service = HaplyService("3.3.0")
    try:
        service.tell_version_below()
    except OSError:
        pytest.skip("the port below is taken")
    device = open_haply(service)
    assert wait_for(device.read)
    device.close()
    service.close()


@pytest.mark.parametrize("lacking", ["calibrated", "power_supply"])
def test_haply_that_is_not_ready_is_given_no_force(service: HaplyService, lacking: str) -> None:
    device = open_haply(service)
    sample = wait_for(device.read)
    assert isinstance(sample, Sample)
    assert sample.held
    service.status[lacking] = False
    device.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    sample = wait_for(device.read)
    assert isinstance(sample, Sample)
    assert not sample.held
    device.close()


@pytest.mark.parametrize("version", ["3.0.8", "4.0.0", "2.9"])
def test_haply_service_of_another_version_is_named(version: str) -> None:
    service = HaplyService(version)
    with pytest.raises(DeviceError, match=r"version \d\.\d"):
        Haply.open(service.port)
    service.close()


def test_without_haply_service_there_is_no_device() -> None:
    assert Haply.open(1) is None


def test_haply_service_that_ends_is_a_lost_device(service: HaplyService) -> None:
    device = open_haply(service)
    wait_for(device.read)
    service.close()
    with pytest.raises(DeviceLostError):
        wait_for(lambda: device.read() and None)
    device.close()


def test_haply_service_that_falls_silent_is_a_lost_device(
    service: HaplyService, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = open_haply(service)
    wait_for(device.read)
    later = time.perf_counter() + 1.0
    monkeypatch.setattr(haply.time, "perf_counter", lambda: later)
    with pytest.raises(DeviceLostError):
        device.read()
    device.close()


def test_haply_pulled_out_while_its_service_goes_on_is_a_lost_device(
    service: HaplyService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a hand would hold its limb, where it was, for ever."""
    device = open_haply(service)
    wait_for(device.read)
    service.with_device = False
    start, clock = time.perf_counter(), time.perf_counter
    monkeypatch.setattr(haply.time, "perf_counter", lambda: start + 4.0 * (clock() - start))

    def go_on() -> None:
        end = time.monotonic() + 10.0
        while time.monotonic() < end:
            device.read()
            device.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            time.sleep(0.001)

    with pytest.raises(DeviceLostError):
        go_on()
    assert len(service.received) > 3, "the service has answered all the while"
    device.close()


def test_device_plugged_in_after_the_service_was_opened_is_found(service: HaplyService) -> None:
    service.with_device = False
    device = open_haply(service)
    end = time.monotonic() + 0.1
    while time.monotonic() < end:
        assert device.read() is None
    service.with_device = True
    assert wait_for(device.read)
    before = len(service.received)
    assert "session" in service.received[0]
    device.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wait_for(lambda: len(service.received) > before)
    assert "configure" in service.received[-1]["inverse3"][0], "centred once it is known"
    device.close()


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["inverse3", "state", "device_id", "cursor_position", "x", "y", "z"]),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@given(json_values)
@settings(max_examples=200)
def test_any_json_is_a_state_or_none(value: object) -> None:
    got = haply.parse(json.dumps({"inverse3": value}))
    assert got is None or all(map(math.isfinite, got[1].position))
    haply.parse(json.dumps(value))


@pytest.mark.parametrize("number", ["1" + "0" * 400, "1e308", "-1e308", "NaN", "Infinity"])
@pytest.mark.parametrize("place", ["cursor_position", "cursor_velocity", "orientation"])
def test_numbers_beyond_any_hand_are_no_state(number: str, place: str) -> None:
    """One damaged message must not end the program at all devices."""
    good = {"x": 0.0, "y": 0.0, "z": 0.0}
    state = {"cursor_position": good, "cursor_velocity": good}
    message: dict[str, Any] = {"inverse3": [{"device_id": "1", "state": state}]}
    if place == "orientation":
        message["verse_grip"] = [{"state": {"orientation": {"w": 1.0, "x": "?"}}}]
    else:
        state[place] = {**good, "x": "?"}  # pyright: ignore[reportArgumentType]
    got = haply.parse(json.dumps(message).replace('"?"', number))
    assert got is None or (place == "orientation" and got[1].orientation == IDENTITY)


@given(st.text(max_size=100))
def test_any_text_is_a_state_or_none(text: str) -> None:
    haply.parse(text)
    haply.parse("[" * 100_000)
