# SPDX-License-Identifier: GPL-3.0-or-later
"""The line between our processes: one peer that knows the secret, and nobody else."""

from __future__ import annotations

import contextlib
import logging
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from octo_motion.core.posing.puppet.figure import Pose
from octo_motion.device.bridge_process import Bridge
from octo_motion.device.calibration import NONE, Phase
from octo_motion.device.ipc import process as line
from octo_motion.device.ipc.process import (
    ChannelClosedError,
    Listener,
    MessageChannel,
    connect,
    new_secret,
)
from octo_motion.device.messages import (
    HEADER,
    MAGIC,
    VERSION,
    Buzz,
    CalibrationMessage,
    FigureMessage,
    Goodbye,
    Notice,
    Place,
    PoseMessage,
    pack,
)
from tests.core.puppets import chain, posed

SECRET = bytes(range(32))


@pytest.fixture
def accepted() -> Iterator[Callable[[], tuple[int, Callable[[], MessageChannel | None]]]]:
    """Begin to listen; the port, and a way to wait for who was let in."""
    made: list[MessageChannel] = []

    def begin() -> tuple[int, Callable[[], MessageChannel | None]]:
        listener = Listener(SECRET)
        got: list[MessageChannel | None] = []
        thread = threading.Thread(target=lambda: got.append(listener.accept(5.0)))
        thread.start()

        def wait() -> MessageChannel | None:
            thread.join()
            made.extend(each for each in got if each)
            return got[0]

        return listener.port, wait

    yield begin
    for channel in made:
        channel.close()


Begin = Callable[[], tuple[int, Callable[[], MessageChannel | None]]]


def pair(begin: Begin) -> tuple[MessageChannel, MessageChannel]:
    port, wait = begin()
    client = connect(port, SECRET)
    server = wait()
    assert server
    return client, server


def received(channel: MessageChannel, count: int) -> list[object]:
    got: list[object] = []
    end = time.monotonic() + 10.0
    while len(got) < count:
        got.extend(channel.receive())
        assert time.monotonic() < end
        time.sleep(0.001)
    return got


def closes(channel: MessageChannel) -> bool:
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        try:
            channel.receive()
        except ChannelClosedError:
            return True
        time.sleep(0.001)
    return False


def test_who_knows_the_secret_is_let_in_and_heard(accepted: Begin) -> None:
    client, server = pair(accepted)
    client.send(Buzz(3))
    client.send(Notice("a", "b"))
    assert received(server, 2) == [Buzz(3), Notice("a", "b")]
    server.send(Goodbye())
    assert received(client, 1) == [Goodbye()]
    client.close()
    assert closes(server)


def test_after_the_right_one_nobody_can_connect(accepted: Begin) -> None:
    port, wait = accepted()
    client = connect(port, SECRET)
    assert wait()
    with pytest.raises(ChannelClosedError):
        connect(port, SECRET)
    client.close()


def test_wrong_secret_is_refused_and_logged_and_the_right_one_still_gets_in(
    accepted: Begin, caplog: pytest.LogCaptureFixture
) -> None:
    port, wait = accepted()
    with caplog.at_level(logging.WARNING), pytest.raises(ChannelClosedError):
        connect(port, new_secret())
    client = connect(port, SECRET)
    assert wait()
    client.close()
    assert "does not know the secret" in caplog.text


@pytest.mark.parametrize(
    ("garbage", "said"),
    [
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" + b"x" * 80, "another language"),
        (struct.pack("<4sH64s", MAGIC, VERSION + 1, b""), f"speaks version {VERSION + 1}"),
        (b"", "did not prove itself"),
        (b"OM", "did not prove itself"),
    ],
    ids=["a browser", "another version", "nothing", "half an answer"],
)
def test_garbage_is_refused_and_logged(
    accepted: Begin, caplog: pytest.LogCaptureFixture, garbage: bytes, said: str
) -> None:
    port, wait = accepted()
    with caplog.at_level(logging.WARNING):
        with socket.create_connection(("127.0.0.1", port)) as stranger:
            stranger.settimeout(5.0)
            with contextlib.suppress(OSError):  # shut out is shut out
                stranger.sendall(garbage)
                stranger.shutdown(socket.SHUT_WR)
                while stranger.recv(100):
                    pass
        client = connect(port, SECRET)
        assert wait()
    client.close()
    assert said in caplog.text


def test_listener_that_does_not_know_the_secret_is_not_talked_to() -> None:
    with socket.create_server(("127.0.0.1", 0)) as impostor:
        port = impostor.getsockname()[1]

        def pretend() -> None:
            connection, _ = impostor.accept()
            connection.sendall(struct.pack("<4sH32s", MAGIC, VERSION, b"n" * 32))
            connection.recv(100)
            connection.sendall(b"p" * 32)
            connection.close()

        threading.Thread(target=pretend, daemon=True).start()
        with pytest.raises(ChannelClosedError, match="does not know the secret"):
            connect(port, SECRET)


def test_older_bridge_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as old:
        port = old.getsockname()[1]

        def serve() -> None:
            connection, _ = old.accept()
            connection.sendall(struct.pack("<4sH32s", MAGIC, 0, b""))
            connection.recv(100)
            connection.close()

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(ChannelClosedError, match="version 0 listens"):
            connect(port, SECRET)


def test_nobody_in_time_is_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Listener(SECRET).accept(0.05) is None
    monkeypatch.setattr(line, "_PATIENCE", 0.2)
    with pytest.raises(ChannelClosedError, match="nobody listens"):
        connect(1, SECRET)


def test_message_that_comes_in_pieces_is_put_together(accepted: Begin) -> None:
    client, server = pair(accepted)
    data = pack(Notice("one", "two")) + pack(Buzz(7))
    for at in range(len(data)):
        client._stream._socket.send(data[at : at + 1])
    assert received(server, 2) == [Notice("one", "two"), Buzz(7)]
    client.close()


@pytest.mark.parametrize(
    "data",
    [
        b"garbage that is no message at all",
        HEADER.pack(MAGIC, VERSION + 1, 15, 1) + b"\0",
        HEADER.pack(MAGIC, VERSION, 15, 1000) + b"\0" * 1000,
    ],
    ids=["garbage", "another version", "a wrong length"],
)
def test_peer_that_sends_nonsense_is_shut_out_and_it_is_logged(
    accepted: Begin, caplog: pytest.LogCaptureFixture, data: bytes
) -> None:
    client, server = pair(accepted)
    client._stream._socket.send(data)
    with caplog.at_level(logging.WARNING):
        assert closes(server)
    assert "Connection closed" in caplog.text
    client.close()


def test_peer_that_dies_in_the_middle_of_a_message_is_noticed(
    accepted: Begin, caplog: pytest.LogCaptureFixture
) -> None:
    client, server = pair(accepted)
    client._stream._socket.send(pack(Notice("one", "two"))[:-2])
    client.close()
    with caplog.at_level(logging.WARNING):
        assert closes(server)
    assert "in the middle of a message" in caplog.text


def test_blender_that_renders_while_a_device_is_calibrated_does_not_lose_the_bridge(
    accepted: Begin,
) -> None:
    client, server = pair(accepted)
    bridge = Bridge(server, ())
    for _ in range(60_000):  # two minutes of them
        bridge._hear_calibration(CalibrationMessage.of(0, NONE, Phase.REACH))
    assert len(server._stream.unsent) < 1_000_000
    client.close()
    server.close()


def test_pose_in_which_a_puppet_came_to_rest_reaches_a_blender_that_was_busy(
    accepted: Begin,
) -> None:
    client, server = pair(accepted)
    bridge = Bridge(server, ())
    figure = chain(2)
    pose = posed(figure)
    bridge._hear_blender(FigureMessage.of(figure))
    bridge._hear_blender(Place(pose.positions, pose.orientations))
    while len(server._stream.unsent) < 100_000:
        server.send(Notice("x" * 900, ""))
    assert bridge.simulation
    bridge._send_to_blender()
    bridge.simulation.session.world.set_pose(Pose(pose.positions + 1.0, pose.orientations))
    bridge._send_to_blender()
    end = time.monotonic() + 10.0
    poses: list[PoseMessage] = []
    while not poses:
        poses += [each for each in client.receive() if isinstance(each, PoseMessage)]
        server.flush()
        bridge._send_to_blender()
        assert time.monotonic() < end
    np.testing.assert_allclose(poses[-1].positions, pose.positions + 1.0)
    assert not bridge.simulation.session.changed
    client.close()
    server.close()


def test_peer_that_does_not_read_costs_no_poses_twice_and_at_last_its_place(
    accepted: Begin,
) -> None:
    client, server = pair(accepted)
    message = Place(np.zeros((4000, 3)), np.zeros((4000, 4)))
    for _ in range(200):
        client.send(message, droppable=True)
    assert len(client._stream.unsent) < 1_000_000, "what is replaced anyway is left out"

    def insist() -> None:
        for _ in range(200):
            client.send(message)

    with pytest.raises(ChannelClosedError):
        insist()
    assert client.closed
    server.close()
