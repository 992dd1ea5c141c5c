# SPDX-License-Identifier: GPL-3.0-or-later
"""Other programs as devices: over UDP, TCP, and Haply's service."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import DeviceError
from octo_motion.core.rotations.scalars import IDENTITY
from octo_motion.device.driver import DeviceLostError, Dynamics, Kind, Sample
from octo_motion.device.sources import haply, network
from octo_motion.device.sources.haply import Haply
from octo_motion.device.sources.network import (
    NetworkFeatures,
    NetworkState,
    PacketError,
    Port,
    parse_datagram,
)
from octo_motion.device.sources.websocket import (
    FrameReader,
    WebSocket,
    WebSocketError,
    frame,
    masked,
)
from tests.device.firmware import Force, pack_packet, parse_force
from tests.device.parts import HaplyService

KEY = bytes(range(16))
FEATURES = NetworkFeatures("My arm", 3, Dynamics(5.0, 0.2, 0.4))
STATE = NetworkState(
    9,
    Sample(
        time=0.0,
        position=(0.1, 0.2, 0.3),
        orientation=(1.0, 0.0, 0.0, 0.0),
        velocity=(1.0, 2.0, 3.0),
        angular_velocity=(4.0, 5.0, 6.0),
        buttons=2,
    ),
)
FORCE = network.pack_force(1, 9, (1.0, 0.0, 0.0), (0.0, 0.1, 0.0), KEY)


def state(**changes: Any) -> NetworkState:
    return STATE._replace(sample=STATE.sample._replace(**changes))


def wait_for(what: Callable[[], object]) -> object:
    end = time.monotonic() + 10.0
    while True:
        found = what()
        if found:
            return found
        assert time.monotonic() < end
        time.sleep(0.001)


# --- Packets -------------------------------------------------------------------------------------


@pytest.mark.parametrize("packet", [FEATURES, STATE])
def test_packet_arrives_as_it_was_sent(packet: NetworkFeatures | NetworkState) -> None:
    data = pack_packet(packet, KEY)
    got = parse_datagram(data, KEY)
    if isinstance(got, NetworkState):
        got = got._replace(sample=got.sample._replace(time=0.0))
    assert got == packet
    assert len(data) == {NetworkFeatures: 168, NetworkState: 144}[type(packet)]


def test_force_arrives_as_it_was_sent_and_is_nothing_that_a_program_sends() -> None:
    assert parse_force(FORCE, KEY) == Force(1, 9, 20, (1.0, 0.0, 0.0), (0.0, 0.1, 0.0))
    assert len(FORCE) == 88
    with pytest.raises(PacketError, match="ours to send"):
        parse_datagram(FORCE, KEY)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (pack_packet(STATE, b"wrong key, sorry"), "key is wrong"),
        (pack_packet(STATE, KEY)[:-1], "another length"),
        (b"GET / HTTP/1.1\r\n\r\n0123456789", "not one of our packets"),
        (b"OMDF\x02\0" + pack_packet(STATE, KEY)[6:], "version 2"),
        (b"", "cut off"),
        (pack_packet(state(velocity=(1e308, 0.0, 0.0)), KEY), "cannot be"),
        (pack_packet(state(angular_velocity=(0.0, 0.0, -2e3)), KEY), "cannot be"),
        (pack_packet(state(position=(math.nan, 0.0, 0.0)), KEY), "cannot be"),
        (pack_packet(replace(FEATURES, dynamics=Dynamics(1e300)), KEY), "cannot be"),
        (pack_packet(replace(FEATURES, dynamics=Dynamics(5.0, 0.2, 1e308)), KEY), "cannot be"),
    ],
)
def test_packet_that_is_none_is_refused(data: bytes, said: str) -> None:
    with pytest.raises(PacketError, match=said):
        parse_datagram(data, KEY)


@given(st.sampled_from([FEATURES, STATE]), st.lists(st.tuples(st.integers(0), st.integers(0, 255))))
@settings(max_examples=300)
def test_packet_with_bytes_changed_is_read_or_refused(
    packet: NetworkFeatures | NetworkState, changes: list[tuple[int, int]]
) -> None:
    data = bytearray(pack_packet(packet, KEY))
    for at, value in changes:
        data[at % len(data)] = value
    try:
        got = parse_datagram(bytes(data), KEY)
    except PacketError:
        return
    if isinstance(got, NetworkState):
        assert all(map(math.isfinite, (*got.sample.position, *got.sample.velocity)))
        assert math.isclose(sum(each**2 for each in got.sample.orientation), 1.0, rel_tol=1e-9)


@pytest.fixture(params=["udp", "tcp"])
def port(request: pytest.FixtureRequest) -> Iterator[tuple[Port, socket.socket]]:
    """A port, and a program's socket that talks to it."""
    port = Port(request.param, 0, KEY)
    kind = socket.SOCK_DGRAM if request.param == "udp" else socket.SOCK_STREAM
    program = socket.socket(socket.AF_INET, kind)
    program.connect(("127.0.0.1", port.number))
    program.settimeout(5.0)
    yield port, program
    program.close()
    port.close()


def test_program_is_a_device_once_it_says_what_it_can(port: tuple[Port, socket.socket]) -> None:
    here, program = port
    assert here.device() is None
    program.sendall(pack_packet(FEATURES, KEY))
    device = wait_for(here.device)
    assert isinstance(device, network.NetworkDevice)
    assert device.description.name == "My arm"
    assert device.description.dynamics == FEATURES.dynamics
    program.sendall(pack_packet(STATE, KEY))
    sample = wait_for(device.read)
    assert isinstance(sample, Sample)
    assert sample.position == STATE.sample.position
    assert sample.buttons == 2
    device.send((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    got = parse_force(program.recv(2048), KEY)
    assert got == Force(1, 9, 20, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))


def test_program_without_the_key_is_no_device(port: tuple[Port, socket.socket]) -> None:
    here, program = port
    program.sendall(pack_packet(FEATURES, b"another key 16b!"))
    end = time.monotonic() + 0.2
    while time.monotonic() < end:
        assert here.device() is None
        time.sleep(0.005)


def test_program_that_falls_silent_is_lost(
    port: tuple[Port, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    here, program = port
    program.sendall(pack_packet(FEATURES, KEY))
    device = wait_for(here.device)
    assert isinstance(device, network.NetworkDevice)
    assert device.read() is None
    later = time.perf_counter() + 2.0
    monkeypatch.setattr(network.time, "perf_counter", lambda: later)
    with pytest.raises(DeviceLostError):
        device.read()
    device.close()
    device.close()


def test_program_may_say_again_what_its_device_can_do(port: tuple[Port, socket.socket]) -> None:
    """Over UDP it may get lost, so careful programs repeat it: that is no other device."""
    here, program = port
    program.sendall(pack_packet(FEATURES, KEY))
    device = wait_for(here.device)
    assert isinstance(device, network.NetworkDevice)
    program.sendall(pack_packet(FEATURES, KEY))
    program.sendall(pack_packet(STATE, KEY))
    assert wait_for(device.read)
    assert here.device() is None
    program.sendall(pack_packet(replace(FEATURES, name="Another"), KEY))
    other = wait_for(here.device)
    assert isinstance(other, network.NetworkDevice)
    assert other.description.name == "Another"


def test_garbage_does_not_keep_poses_from_arriving() -> None:
    here = Port("udp", 0, KEY)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program:
        program.connect(("127.0.0.1", here.number))
        program.send(pack_packet(FEATURES, KEY))
        device = wait_for(here.device)
        assert isinstance(device, network.NetworkDevice)
        for _ in range(30):
            program.send(b"garbage")
        program.send(pack_packet(STATE, KEY))
        assert device.read() is not None, "loopback delivers at once"
    here.close()


def test_program_that_reads_slowly_gets_whole_packets() -> None:
    here = Port("tcp", 0, KEY)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as program:
        program.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        program.connect(("127.0.0.1", here.number))
        program.settimeout(5.0)
        program.sendall(pack_packet(FEATURES, KEY))
        device = wait_for(here.device)
        assert isinstance(device, network.NetworkDevice)
        for number in range(100_000):  # a minute and a half of them
            device.send((float(number), 0.0, 0.0), (0.0, 0.0, 0.0))
        got = b""
        size = network.SIZES[network.FORCE]
        last = 0
        while last < 100_010:
            device.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            got += program.recv(1 << 20)
            while len(got) >= size:
                packet = parse_force(got[:size], KEY)
                assert packet.sequence > last
                got, last = got[size:], packet.sequence
    here.close()


def test_stranger_who_says_nothing_does_not_keep_the_port(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    here = Port("tcp", 0, KEY)
    with socket.create_connection(("127.0.0.1", here.number)) as stranger:
        wait_for(lambda: here.device() or here._peer)
        with socket.create_connection(("127.0.0.1", here.number)) as program:
            program.sendall(pack_packet(FEATURES, KEY))
            later = time.perf_counter() + 2.0
            monkeypatch.setattr(network.time, "perf_counter", lambda: later)
            assert wait_for(here.device)
        stranger.settimeout(5.0)
        assert stranger.recv(1) == b""
    here.close()


def test_key_of_another_length_opens_no_port() -> None:
    with pytest.raises(ValueError, match="16"):
        Port("udp", 0, b"short")


# --- WebSocket -----------------------------------------------------------------------------------


@given(st.binary(max_size=300), st.binary(min_size=4, max_size=4))
def test_mask_taken_twice_is_none(payload: bytes, mask: bytes) -> None:
    assert masked(masked(payload, mask), mask) == payload


@pytest.mark.parametrize("size", [0, 1, 125, 126, 65535, 65536, 200_000])
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
    monkeypatch.setattr(haply.time, "perf_counter", lambda: start + 20.0 * (clock() - start))

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
