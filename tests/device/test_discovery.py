# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding devices: nobody who is slow or silent keeps the loop from the devices that are there."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import pytest

from octo_motion.core.errors import DeviceError
from octo_motion.device.driver import Driver
from octo_motion.device.hid.system import Found
from octo_motion.device.sources import discovery as finding
from octo_motion.device.sources.discovery import Discovery, Sources
from octo_motion.device.sources.haply import Haply
from tests.device.parts import FakeHandle, HaplyService, found

NOTHING = Sources(hid=False, haply=False)


class Desk:
    """A discovery, and HID devices that the test plugs in."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.there: list[Found] = []
        self.forbidden: set[bytes] = set()
        self.looks = 0
        self.now = 100.0
        monkeypatch.setattr(finding, "descriptor_fingerprint", lambda: None)
        monkeypatch.setattr(finding, "list_devices", self._list)
        monkeypatch.setattr(finding, "_EVERY_COSTLY", 0.0)
        # Its own clock alone: what is opened goes on by the real one.
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=time.sleep)
        monkeypatch.setattr(finding, "time", clock)
        for module in ("space_mouse", "force_profile"):
            monkeypatch.setattr(f"octo_motion.device.hid.{module}.open_device", self._open)
        self.discovery = Discovery(Sources(haply=False))
        self.drivers: list[Driver] = []

    def _list(self) -> list[Found]:
        self.looks += 1
        return list(self.there)

    def _open(self, what: Found) -> FakeHandle:
        if what.path in self.forbidden:
            raise DeviceError("It may not be read.", "Add the rule.")
        return FakeHandle()

    def look(self) -> None:
        """One whole look, begun now."""
        for _ in range(2):  # one may have been under way
            before = self.looks
            for _ in range(20_000):
                self.drivers += self.discovery.look()
                if self.looks > before:
                    break
                time.sleep(0.001)
            assert self.looks > before
        self.drivers += self.discovery.look()

    def names(self) -> list[str]:
        return [each.description.identity for each in self.drivers]


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    desk = Desk(monkeypatch)
    yield desk
    desk.discovery.close()


def found_by(discovery: Discovery, why: str) -> list[Driver]:
    end = time.monotonic() + 20.0
    while True:
        got = list(discovery.look())
        if got:
            return got
        assert time.monotonic() < end, why
        time.sleep(0.002)


def test_service_that_does_not_answer_keeps_nobody_waiting() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        discovery = Discovery(Sources(hid=False, haply_port=mute.getsockname()[1]))
        mute.settimeout(20.0)
        assert list(discovery.look()) == []
        asking, _ = mute.accept()
        with asking:
            asking.settimeout(20.0)
            assert asking.recv(4096).startswith(b"GET /version")
            assert list(discovery.look()) == []
            # Whoever asks still waits for the answer; the loop has gone on.
            asking.settimeout(0.0)
            with pytest.raises(BlockingIOError):
                asking.recv(4096)
        discovery.close()


def test_haply_is_found_when_its_service_starts() -> None:
    service = HaplyService()
    try:
        discovery = Discovery(Sources(hid=False, haply_port=service.port))
        (device,) = found_by(discovery, "the service is found")
        assert isinstance(device, Haply)
        device.close()
        discovery.close()
    finally:
        service.close()


def test_haply_service_of_another_version_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(finding, "_EVERY_COSTLY", 0.0)
    service = HaplyService("2.9.0")
    asked = threading.Semaphore(0)
    opened = Haply.open
    monkeypatch.setattr(finding.Haply, "open", lambda port: (asked.release(), opened(port))[1])
    try:
        discovery = Discovery(Sources(hid=False, haply_port=service.port))
        for _ in range(3):
            list(discovery.look())
            assert asked.acquire(timeout=20.0)
        end = time.monotonic() + 20.0
        while not discovery.problems:
            list(discovery.look())
            assert time.monotonic() < end
        assert len(discovery.problems) == 1
        assert "2.9" in discovery.problems[0].problem
        discovery.close()
    finally:
        service.close()


def test_device_that_is_used_is_not_opened_twice_and_comes_again_when_lost(desk: Desk) -> None:
    desk.there = [found()]
    desk.look()
    desk.look()
    assert len(desk.drivers) == 1
    desk.discovery.lost(desk.names()[0])
    desk.look()
    assert len(desk.drivers) == 2
    assert len(set(desk.names())) == 1


def test_device_that_the_system_lets_us_read_in_a_moment_is_no_problem(desk: Desk) -> None:
    """A device is there before the rule that lets its user read it has been applied."""
    desk.there, desk.forbidden = [found()], {found().path}
    desk.look()
    desk.now += 0.5
    desk.look()
    desk.forbidden.clear()
    desk.now += 0.5
    desk.look()
    assert len(desk.drivers) == 1
    desk.now += 10.0
    desk.look()
    assert desk.discovery.problems == []


def test_device_that_may_not_be_read_is_told_once_and_again_when_it_is_plugged_in_again(
    desk: Desk,
) -> None:
    desk.there, desk.forbidden = [found()], {found().path}
    for _ in range(5):
        desk.look()
        desk.now += 1.0
    assert [each.problem for each in desk.discovery.problems] == ["It may not be read."]
    desk.there = []
    desk.look()
    desk.there = [found()]
    for _ in range(5):
        desk.look()
        desk.now += 1.0
    assert len(desk.discovery.problems) == 2


def test_two_devices_with_the_same_serial_number_are_two(desk: Desk) -> None:
    """Makers who give every piece the same number are not rare."""
    first = found()
    second = replace(first, path=b"/dev/hidraw8")
    desk.there = [first, second]
    desk.look()
    desk.look()
    assert len(set(desk.names())) == len(desk.drivers) == 2
    desk.discovery.lost(desk.names()[1])
    desk.look()
    assert desk.names()[2] == desk.names()[1]


def test_device_plugged_in_again_before_its_loss_was_noticed_is_not_opened_twice(
    desk: Desk,
) -> None:
    desk.there = [found()]
    desk.look()
    again = replace(found(), path=b"/dev/hidraw8")
    desk.there = [again]
    desk.look()
    assert len(desk.drivers) == 1
    desk.discovery.lost(desk.names()[0])
    desk.look()
    assert desk.names() == [again.identity] * 2


def test_look_that_fails_is_not_the_last_one(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    good: Callable[[], list[Found]] = finding.list_devices

    def fails() -> list[Found]:
        good()
        raise RuntimeError("a fault of the system")

    monkeypatch.setattr(finding, "list_devices", fails)
    desk.there = [found()]
    desk.look()
    assert "a fault of the system" in caplog.text
    monkeypatch.setattr(finding, "list_devices", good)
    desk.look()
    assert len(desk.drivers) == 1


def test_what_was_found_and_not_taken_is_closed() -> None:
    service = HaplyService()
    try:
        discovery = Discovery(Sources(hid=False, haply_port=service.port))
        list(discovery.look())
        end = time.monotonic() + 20.0
        (search,) = discovery._searches
        while not search.drivers:
            assert time.monotonic() < end
            time.sleep(0.002)
        device = search.drivers[0]
        discovery.close()
        assert isinstance(device, Haply)
        assert device._socket is None
    finally:
        service.close()


def test_device_that_hangs_while_it_is_opened_delays_no_other(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Firmware that is stuck does not answer for seconds."""
    hangs, answers = found(), replace(found(), path=b"/dev/hidraw8", serial="B2")
    free = threading.Event()
    opened = desk._open

    def open_one(what: Found) -> FakeHandle:
        if what.path == hangs.path:
            free.wait(20.0)
        return opened(what)

    monkeypatch.setattr("octo_motion.device.hid.space_mouse.open_device", open_one)
    desk.there = [hangs, answers]
    desk.look()
    desk.look()
    assert desk.names() == [answers.identity], "and the one that hangs is not tried twice"
    free.set()
    end = time.monotonic() + 10.0
    while len(desk.drivers) < 2:
        desk.drivers += desk.discovery.look()
        assert time.monotonic() < end
    assert set(desk.names()) == {answers.identity, hangs.identity}


def drip(connection: socket.socket) -> None:
    """Answer for ever, a letter at a time."""
    while True:
        connection.sendall(b"H")
        time.sleep(0.05)


def answer(body: bytes) -> Callable[[socket.socket], None]:
    """Answer with a body, and end."""
    head = f"HTTP/1.1 200 OK\r\nContent-Length: {len(body)}\r\n\r\n".encode()

    def said(connection: socket.socket) -> None:
        connection.sendall(head + body)

    return said


def pour(connection: socket.socket) -> None:
    """Send without end."""
    while True:
        connection.sendall(bytes(65536))


@pytest.mark.parametrize(
    "says",
    [
        drip,
        pour,
        answer(b'{"git_tag": "' + b"9" * 5000 + b'.1"}'),
        answer(b"[" * 60_000 + b"]" * 60_000),
    ],
    ids=["drips", "pours", "a version of 5000 digits", "60,000 brackets"],
)
def test_whoever_answers_at_haplys_port_hides_no_hid_device(
    desk: Desk, says: Callable[[socket.socket], None], caplog: pytest.LogCaptureFixture
) -> None:
    asked: list[bytes] = []

    def talk(connection: socket.socket) -> None:
        with connection, suppress(OSError):
            asked.append(connection.recv(4096))
            says(connection)

    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    threading.Thread(target=talk, args=(connection,), daemon=True).start()

        threading.Thread(target=serve, daemon=True).start()
        desk.discovery.close()
        desk.discovery = Discovery(Sources(haply_port=server.getsockname()[1]))
        desk.there = [found()]
        desk.look()
        assert desk.names() == [found().identity]
        before = len(asked)
        # That it ends at all is asked here: who drips holds nobody for ever.
        assert Haply.open(server.getsockname()[1]) is None
        assert len(asked) > before, "it was talked to"
    assert "failed" not in caplog.text


def test_nothing_to_look_for_starts_no_thread() -> None:
    before = threading.active_count()
    discovery = Discovery(NOTHING)
    assert list(discovery.look()) == []
    assert threading.active_count() == before
    discovery.close()
