# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of devices that reach the bridge: a program may be the device."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from octo_motion.device.driver import Dynamics
from octo_motion.device.ipc.client import Client
from octo_motion.device.sources import packets
from octo_motion.ui.posing import device_settings
from tests.device.firmware import Program
from tests.device.parts import wait_for


@pytest.fixture
def client() -> Iterator[Client]:
    client = Client()
    yield client
    client.stop()


def test_without_a_port_no_program_is_let_in() -> None:
    assert device_settings.bridge_arguments(SimpleNamespace(simulate=False, port=0)) == []
    arguments = device_settings.bridge_arguments(SimpleNamespace(simulate=True, port=0))
    assert arguments == ["--simulate"]


def test_program_with_the_key_of_the_panel_is_a_device(
    client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "Ünder a space"
    monkeypatch.setattr(device_settings, "own_folder", lambda **_: folder)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = SimpleNamespace(simulate=False, port=port)
    client.start([*device_settings.bridge_arguments(settings), "--no-hid", "--no-haply"])
    wait_for(lambda: device_settings.key_file().is_file() and (client.poll(), client.hello)[1])
    program = Program(packets.key_in(device_settings.key_file()))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.connect(("127.0.0.1", port))
        line.settimeout(0.1)

        def asked() -> bytes:
            try:
                line.send(program.greeting())
                return line.recv(2048)
            except (TimeoutError, ConnectionError):
                return b""

        program.asked(wait_for(asked))
        line.send(program.features(packets.NetworkFeatures("My arm", 2, Dynamics(5.0))))
        wait_for(lambda: (client.poll(), client.devices)[1])
        (device,) = client.devices.values()
        assert (device.name, device.force) == ("My arm", 5.0)
    if sys.platform == "linux":
        children = Path("/proc/self/task").glob("*/children")
        started = {each for path in children for each in path.read_text(encoding="utf-8").split()}
        lines = [Path(f"/proc/{each}/cmdline").read_bytes() for each in started]
        key = device_settings.key_file().read_bytes().strip()
        assert lines
        assert not any(key in line for line in lines), "no key on a command line"
