# SPDX-License-Identifier: GPL-3.0-or-later
"""Other programs as devices, over UDP and TCP: only one that knows the key, and it alone."""

from __future__ import annotations

import contextlib
import math
import os
import socket
import stat
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octo_motion.core.errors import DeviceError
from octo_motion.device.driver import DeviceLostError, Dynamics, Sample
from octo_motion.device.sources import network, packets
from octo_motion.device.sources.network import NetworkDevice, Port
from octo_motion.device.sources.packets import NetworkFeatures, PacketError
from tests.device.firmware import Force, Program
from tests.device.parts import wait_for

KEY = bytes(range(16))
FEATURES = NetworkFeatures("My arm", 3, Dynamics(5.0, 0.2, 0.4))
STATE = Sample(
    time=0.0,
    position=(0.1, 0.2, 0.3),
    orientation=(1.0, 0.0, 0.0, 0.0),
    velocity=(1.0, 2.0, 3.0),
    angular_velocity=(4.0, 5.0, 6.0),
    buttons=2,
    clock=7.5,
)
SHAPES = {"udp": socket.SOCK_DGRAM, "tcp": socket.SOCK_STREAM}


@dataclass
class Meeting:
    """A port, and a program's socket that talks to it."""

    kind: str
    port: Port
    line: socket.socket
    program: Program

    def ask(self) -> None:
        """Greet, and be asked."""
        self.line.sendall(self.program.greeting())
        self.line.settimeout(0.01)

        def asked() -> bytes:
            self.port.device()
            try:
                return self.line.recv(packets.SIZES[packets.QUESTION])
            except TimeoutError:
                return b""

        self.program.asked(wait_for(asked))
        self.line.settimeout(5.0)

    def device(self) -> NetworkDevice:
        """Greet, answer, and be a device."""
        self.ask()
        self.line.sendall(self.program.features(FEATURES))
        return wait_for(self.port.device)

    def another(self, key: bytes = KEY) -> Meeting:
        """The same port and another program."""
        return Meeting(self.kind, self.port, line_to(self.kind, self.port), Program(key))


def line_to(kind: str, port: Port) -> socket.socket:
    line = socket.socket(socket.AF_INET, SHAPES[kind])
    line.connect(("127.0.0.1", port.number))
    line.settimeout(5.0)
    return line


@pytest.fixture(params=["udp", "tcp"])
def meeting(request: pytest.FixtureRequest) -> Iterator[Meeting]:
    port = Port(request.param, 0, KEY)
    with line_to(request.param, port) as line:
        yield Meeting(request.param, port, line, Program(KEY))
    port.close()


def nothing_comes_of(port: Port) -> None:
    end = time.monotonic() + 0.2
    while time.monotonic() < end:
        assert port.device() is None
        time.sleep(0.005)


# --- Packets -------------------------------------------------------------------------------------


def met() -> Program:
    """A program that has been asked."""
    program = Program(KEY)
    theirs = packets.read(program.greeting()).values[0]
    ours = bytes(16)
    key = packets.meeting_key(KEY, theirs, ours)
    program.asked(packets.pack(packets.QUESTION, 0, ours, key=key))
    return program


def test_packets_arrive_as_they_were_sent() -> None:
    program = met()
    features = packets.read(program.features(FEATURES))
    assert packets.features_of(features.values) == FEATURES
    state = packets.read(program.state(STATE, 9))
    got = packets.state_of(state.values)
    assert got.answered == 9
    assert got.sample._replace(time=0.0) == STATE
    assert (features.sequence, state.sequence) == (1, 2)


def spoilt(features: NetworkFeatures = FEATURES, **changes: Any) -> None:
    program = met()
    packets.features_of(packets.read(program.features(features)).values)
    packets.state_of(packets.read(program.state(STATE._replace(**changes))).values)


@pytest.mark.parametrize(
    "changes",
    [
        {"velocity": (1e308, 0.0, 0.0)},
        {"angular_velocity": (0.0, 0.0, -2e3)},
        {"position": (math.nan, 0.0, 0.0)},
        {"orientation": (0.0, 0.0, 0.0, 0.0)},
        {"clock": math.inf},
        {"features": replace(FEATURES, dynamics=Dynamics(1e300))},
        {"features": replace(FEATURES, dynamics=Dynamics(5.0, 0.2, 1e308))},
    ],
)
def test_what_no_hand_and_no_device_can_be_is_refused(changes: dict[str, Any]) -> None:
    spoilt()
    with pytest.raises(PacketError, match="cannot be"):
        spoilt(**changes)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (Program(KEY).greeting()[:-1], "another length"),
        (b"GET / HTTP/1.1\r\n\r\n0123456789 0123456789", "not one of our packets"),
        (b"OMDF\x01\0" + Program(KEY).greeting()[6:], "version 1"),
        (b"OMDF\x02\0\x09\0" + Program(KEY).greeting()[8:], "unknown kind"),
        (b"", "cut off"),
    ],
)
def test_bytes_that_are_no_packet_are_refused(data: bytes, said: str) -> None:
    with pytest.raises(PacketError, match=said):
        packets.read(data)


@given(st.lists(st.tuples(st.integers(0), st.integers(0, 255)), min_size=1))
@settings(max_examples=200)
def test_a_packet_with_any_byte_changed_is_not_taken(changes: list[tuple[int, int]]) -> None:
    program = met()
    good = program.state(STATE)
    data = bytearray(good)
    for at, value in changes:
        data[at % len(data)] = value
    key = program._meeting
    assert packets.is_tagged(good, key)
    assert packets.is_tagged(bytes(data), key) == (bytes(data) == good)


# --- Meetings ------------------------------------------------------------------------------------


def test_program_is_a_device_once_it_says_what_it_can(meeting: Meeting) -> None:
    assert meeting.port.device() is None
    device = meeting.device()
    assert device.description.name == "My arm"
    assert device.description.dynamics == FEATURES.dynamics
    meeting.line.sendall(meeting.program.state(STATE))
    sample = wait_for(device.read)
    assert sample._replace(time=0.0) == STATE
    device.send((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    got = meeting.program.force(meeting.line.recv(2048))
    assert got == Force(1, 2, 20, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))


def test_how_long_a_force_takes_to_the_program_and_back_is_measured(meeting: Meeting) -> None:
    device = meeting.device()
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    force = meeting.program.force(meeting.line.recv(2048))
    begun = time.perf_counter()
    while time.perf_counter() - begun < 0.02:
        pass
    meeting.line.sendall(meeting.program.state(STATE, force.sequence))
    assert 0.02 <= wait_for(device.read).delay < 2.0


@pytest.mark.parametrize("key", [bytes(16), KEY[::-1]])
def test_program_without_the_key_is_no_device_and_learns_nothing_of_it(
    meeting: Meeting, key: bytes
) -> None:
    stranger = meeting.another(key)
    with stranger.line, pytest.raises(PacketError, match="does not know the key"):
        stranger.ask()
    with stranger.line:
        said = stranger.program.features(FEATURES)
        assert KEY not in said
        meeting.ask()
        answer = meeting.program.features(FEATURES)
        assert KEY not in answer
        # Another's answer over a line of his own, and one of his own with a wrong key.
        for data in (answer, said):
            other = meeting.another()
            with other.line:
                other.ask()
                other.line.sendall(data)
                nothing_comes_of(meeting.port)


def test_what_was_said_in_one_meeting_does_nothing_in_the_next(meeting: Meeting) -> None:
    """Whoever overheard a program, and says it all again."""
    meeting.ask()
    heard = [meeting.program.greeting(), meeting.program.features(FEATURES)]
    heard += [meeting.program.state(STATE) for _ in range(3)]
    meeting.line.sendall(heard[1])
    device: NetworkDevice = wait_for(meeting.port.device)
    meeting.line.sendall(heard[2])
    assert wait_for(device.read)
    device.close()
    with line_to(meeting.kind, meeting.port) as another:
        line = meeting.line if meeting.kind == "udp" else another
        for data in heard:
            with contextlib.suppress(ConnectionError):  # sent away
                line.send(data)
            assert meeting.port.device() is None
        nothing_comes_of(meeting.port)


def test_state_that_is_said_again_does_nothing(meeting: Meeting) -> None:
    device = meeting.device()
    first = meeting.program.state(STATE)
    second = meeting.program.state(STATE._replace(position=(0.2, 0.0, 0.0)))
    meeting.line.sendall(second)
    assert wait_for(device.read).position == (0.2, 0.0, 0.0)
    for _ in range(3):
        meeting.line.sendall(first)
        meeting.line.sendall(second)
    end = time.monotonic() + 0.1
    while time.monotonic() < end:
        assert device.read() is None
        time.sleep(0.001)


def test_stranger_has_no_effect_on_a_program_that_is_there(meeting: Meeting) -> None:
    device = meeting.device()
    stranger = meeting.another()
    with stranger.line:
        for index in range(200):
            with contextlib.suppress(ConnectionError):  # refused by the system
                stranger.line.send(stranger.program.greeting() if index % 2 else b"garbage" * 9)
            meeting.line.sendall(meeting.program.state(STATE))
            assert wait_for(device.read)
        assert meeting.port.device() is None
    device.send((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert meeting.program.force(meeting.line.recv(2048)).force == (1.0, 0.0, 0.0)


def test_program_that_falls_silent_is_lost_and_may_come_again(
    meeting: Meeting, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = meeting.device()
    assert device.read() is None
    with monkeypatch.context() as later:
        then = time.perf_counter() + 2.0
        later.setattr(network.time, "perf_counter", lambda: then)
        with pytest.raises(DeviceLostError):
            device.read()
    device.close()
    device.close()
    again = meeting.another()
    with again.line:
        assert again.device()


def test_program_may_say_again_what_its_device_can_do(meeting: Meeting) -> None:
    """Over UDP it may get lost, so careful programs repeat it: that is no other device."""
    device = meeting.device()
    meeting.line.sendall(meeting.program.features(FEATURES))
    meeting.line.sendall(meeting.program.state(STATE))
    assert wait_for(device.read)
    assert meeting.port.device() is None
    meeting.line.sendall(meeting.program.features(replace(FEATURES, name="Another")))
    assert wait_for(meeting.port.device).description.name == "Another"


def test_program_that_reads_slowly_gets_whole_packets() -> None:
    here = Port("tcp", 0, KEY)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.connect(("127.0.0.1", here.number))
        meeting = Meeting("tcp", here, line, Program(KEY))
        device = meeting.device()
        for number in range(50_000):  # most of a minute of them
            device.send((float(number), 0.0, 0.0), (0.0, 0.0, 0.0))
        got = b""
        size = packets.SIZES[packets.FORCE]
        last = 0
        while last < 50_010:
            device.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            got += line.recv(1 << 20)
            while len(got) >= size:
                force = meeting.program.force(got[:size])
                assert force.sequence > last
                got, last = got[size:], force.sequence
    here.close()


def test_connections_that_say_nothing_hold_no_place() -> None:
    """However many there are: who knows the key comes in, at once, and they go."""
    here = Port("tcp", 0, KEY)
    idle: list[socket.socket] = []
    try:
        for _ in range(100):
            idle.append(line_to("tcp", here))
            here.device()
        with line_to("tcp", here) as line:
            meeting = Meeting("tcp", here, line, Program(KEY))
            device = meeting.device()
            for each in idle:
                each.settimeout(5.0)
                assert each.recv(1) == b"", "it is sent away"
            line.sendall(meeting.program.state(STATE))
            assert wait_for(device.read)
    finally:
        for each in idle:
            each.close()
        here.close()


def test_garbage_before_a_greeting_does_not_keep_a_program_out() -> None:
    here = Port("udp", 0, KEY)
    with line_to("udp", here) as stranger, line_to("udp", here) as line:
        for _ in range(50):
            stranger.send(b"garbage")
        assert Meeting("udp", here, line, Program(KEY)).device()
    here.close()


# --- The key -------------------------------------------------------------------------------------


def test_key_is_made_once_and_only_its_owner_may_read_it(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "key"
    key = packets.key_in(path)
    assert len(key) == 16
    assert packets.key_in(path) == key
    assert bytes.fromhex(path.read_text(encoding="utf-8")) == key
    if os.name != "nt":
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        path.chmod(0o644)
        with pytest.raises(DeviceError, match="read by others"):
            packets.key_in(path)


@pytest.mark.parametrize("text", ["", "zz" * 16, "00" * 15, "00" * 17, "\xe4" * 32])
def test_file_without_a_key_is_told(tmp_path: Path, text: str) -> None:
    path = tmp_path / "key"
    path.touch(mode=0o600)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DeviceError, match="no key"):
        packets.key_in(path)


def test_key_of_another_length_opens_no_port() -> None:
    with pytest.raises(ValueError, match="16"):
        Port("udp", 0, b"short")
