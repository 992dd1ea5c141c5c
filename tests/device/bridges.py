# SPDX-License-Identifier: GPL-3.0-or-later
"""A bridge with a puppet and a simulated hand, and processes that are killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from octo_motion.core.posing.puppet.figure import Figure, Pose
from octo_motion.device import messages as say
from octo_motion.device.ipc.client import Client, ClientState
from tests.core.puppets import chain, posed, soft
from tests.processes import alive, children_of, end

OPTIONS = ("--simulate", "--no-haply", "--no-hid")
FIGURE: Figure = chain(3, elements=soft(3, 40.0, 2.0, 100.0, 1.0))
POSE: Pose = posed(FIGURE)
PATIENCE = 20.0
"""s: a wait for another process is over at once, unless it is in vain."""


def wait_for(client: Client, what: Callable[[], object], why: str) -> None:
    """Poll until something is true."""
    latest = time.monotonic() + PATIENCE
    while not what():
        client.poll()
        assert time.monotonic() < latest, f"waited in vain: {why}; {client.state}, {client.notices}"
        time.sleep(0.002)


def bridge_of(client: Client) -> int | None:
    """The process that the client has started, or that which this one has become on Windows."""
    if not client._child:
        return None
    started = client._child._process.pid
    return client.hello.process if client.hello else started


def holding(client: Client) -> None:
    """Start a bridge whose simulated hand holds the tip of a puppet."""
    client.start(OPTIONS)
    client.send_figure(FIGURE, POSE)
    client.send_pins({0: False})
    wait_for(client, lambda: client.devices, "the hand is there")
    x, y, z = map(float, POSE.positions[2] + [0.0, 0.15, 0.0])
    client.send(say.Workspace(0, (x, y, z)))
    client.send(say.Grab(0, grab=True))
    wait_for(client, lambda: 0 in client.pointers and client.pointers[0].body == 2, "it holds")


def seconds_to_end(processes: list[int]) -> float:
    """How long it takes until none of these runs."""
    start = time.monotonic()
    while any(map(alive, processes)):
        assert time.monotonic() - start < PATIENCE
        time.sleep(0.002)
    return time.monotonic() - start


def kill_bridge_and_start_again() -> tuple[float, float]:
    """Kill the bridge in mid-grab.

    Returns:
        Seconds until the client said so, and until the process at the devices had ended.
    """
    client = Client()
    try:
        holding(client)
        bridge = bridge_of(client)
        assert bridge
        hands = children_of(bridge)
        assert hands
        wait_for(client, lambda: client.steps > 20, "it moves")
        last = client.pose
        assert last
        start = time.monotonic()
        end(bridge)
        wait_for(client, lambda: client.state is ClientState.LOST, "the client notices")
        noticed = time.monotonic() - start
        ended = seconds_to_end(hands)
        assert client.pose is not None
        assert client.notices[-1].problem == (
            "The program between Blender and the device has ended."
        )
        kept = client.pose
        client.restart()
        wait_for(client, lambda: client.devices and client.steps > 0, "it goes on")
        assert abs(client.pose.orientations - kept.orientations).max() < 0.2
    finally:
        client.stop()
    return noticed, ended


BLENDER = """
import os, sys, time
from octo_motion.device.ipc.client import Client
from tests.device.bridges import bridge_of, holding
from tests.processes import children_of
client = Client()
holding(client)
print(bridge_of(client), *children_of(bridge_of(client)), flush=True)
while True:
    client.poll()
    time.sleep(0.01)
"""


def kill_blender() -> float:
    """Kill a process that has a bridge in mid-grab; seconds until all that it started has ended."""
    blender = subprocess.Popen(
        [sys.executable, "-c", BLENDER],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
    )
    assert blender.stdout
    with blender.stdout:
        started = [int(each) for each in blender.stdout.readline().split()]
    assert len(started) >= 2
    assert all(map(alive, started))
    blender.kill()
    blender.wait()
    return seconds_to_end(started)


def kill_hands() -> float:
    """Kill the process at the devices in mid-grab; seconds until the hand is there again."""
    client = Client()
    try:
        holding(client)
        bridge = bridge_of(client)
        assert bridge
        hands = children_of(bridge)[-1]
        start = time.monotonic()
        end(hands)
        wait_for(client, lambda: not client.devices, "the hand is gone")
        wait_for(client, lambda: client.devices, "the hand is back")
        assert client.state is ClientState.RUNNING
        return time.monotonic() - start
    finally:
        client.stop()
