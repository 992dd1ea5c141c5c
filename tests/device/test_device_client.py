# SPDX-License-Identifier: GPL-3.0-or-later
"""The example of a program that is a force device: a grip on wires, as its own process."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from octo_motion.core.rotations.scalars import Vector
from octo_motion.device.driver import Sample
from octo_motion.device.sources.network import NetworkDevice, Port
from tests.device.parts import wait_for

CLIENT = Path(__file__).resolve().parents[2] / "docs" / "examples" / "device_client.py"
KEY = bytes(range(16))
ZERO = (0.0, 0.0, 0.0)


@pytest.fixture
def port() -> Iterator[Port]:
    port = Port("udp", 0, KEY)
    yield port
    port.close()


def started(port: Port, folder: Path, key: bytes) -> subprocess.Popen[bytes]:
    path = folder / "key"
    path.write_text(key.hex(), encoding="ascii")
    return subprocess.Popen([sys.executable, str(CLIENT), str(port.number), str(path)])


@pytest.fixture
def device(port: Port, tmp_path: Path) -> Iterator[NetworkDevice]:
    with started(port, tmp_path, KEY) as client:
        try:
            yield wait_for(port.device)
        finally:
            client.kill()


def felt(device: NetworkDevice, force: Vector) -> list[Sample]:
    """What the grip does while a force is sent a few hundred times."""
    samples: list[Sample] = []
    while len(samples) < 300:
        device.send(force, ZERO)
        sample = device.read()
        if sample is not None:
            samples.append(sample)
        time.sleep(0.0005)
    return samples[100:]


def test_grip_on_wires_goes_where_its_hand_leads_it(device: NetworkDevice) -> None:
    assert device.description.name == "SPIDAR"
    samples = felt(device, ZERO)
    for sample in samples:
        # What the wires' lengths tell is the circle of 3 cm, to what taut wires pull.
        assert math.hypot(*sample.position) == pytest.approx(0.03, abs=1e-3)
        assert sample.orientation == (1.0, 0.0, 0.0, 0.0)
        assert sample.held
    first, last = samples[0], samples[-1]
    assert first.clock is not None
    assert last.clock is not None
    way = math.dist(last.position, first.position) / (last.clock - first.clock)
    assert way == pytest.approx(0.03, rel=0.1)


def test_wires_pull_as_they_are_told_to(device: NetworkDevice) -> None:
    for force in ((3.0, 0.0, 0.0), (0.0, -2.0, 0.0), (1.0, 1.0, 2.0)):
        (*_, last) = felt(device, force)
        assert last.clock is not None
        # The hand of 300 N/m gives way by so much; off the middle wires are a little askew.
        given = [each * 300.0 for each in last.position[2:]]
        assert given == pytest.approx([force[2]], abs=0.5)
        assert last.delay is not None


def test_program_without_the_key_is_no_device(port: Port, tmp_path: Path) -> None:
    with started(port, tmp_path, bytes(16)) as client:
        try:
            end = time.monotonic() + 1.0
            while time.monotonic() < end:
                assert port.device() is None
                time.sleep(0.005)
        finally:
            client.kill()
