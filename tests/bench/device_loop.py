# SPDX-License-Identifier: GPL-3.0-or-later
"""How well the loop at the devices keeps time while a hand bends a puppet of twenty bodies.

make bench ARGS="device --seconds 60"
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from octo_motion.device import messages as say
from octo_motion.device.ipc.client import Client
from tests.core.puppets import doll, posed, soft


@dataclass(frozen=True)
class Measured:
    """Seconds; of 50, 99 and 99.9 % of all ticks, and of the worst."""

    seconds: float
    rate: float
    priority: str
    late: tuple[float, ...]
    computing: tuple[float, ...]
    missed: int
    step: float
    """To compute one step of the simulation, of late."""


def measure(seconds: float) -> Measured:
    """Run a bridge with a simulated hand that holds the puppet's hand and draws a circle."""
    figure = doll(soft(20, 40.0, 2.0, 100.0, 5.0))
    pose = posed(figure)
    client = Client()
    client.start(("--simulate", "--no-haply", "--no-hid"))
    try:
        client.send_figure(figure, pose)
        client.send_pins({0: False})
        while not client.devices:
            client.poll()
            time.sleep(0.01)
        x, y, z = map(float, pose.positions[8])
        client.send(say.Workspace(0, (x, y, z)))
        _poll(client, 0.5)
        client.send(say.Grab(0, grab=True))
        _poll(client, seconds)
        if client.times is None or client.hello is None or client.pointers[0].body < 0:
            sys.exit(f"The bridge did not hold the puppet: {client.notices}")
        times = client.times
        return Measured(
            *(seconds, times.rate, client.hello.priority, times.late, times.computing),
            *(times.missed, times.step),
        )
    finally:
        client.stop()


def _poll(client: Client, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        client.poll()
        time.sleep(1.0 / 60.0)


def table(measured: Measured) -> str:
    """For people to read."""
    first = (
        f"The loop at the devices, {measured.seconds:.0f} s with 20 bodies in a hand: "
        f"{measured.rate:.1f} Hz, {measured.missed} ticks left out, priority {measured.priority}"
    )
    lines = [
        first,
        f"{'µs':<34}{'50 %':>9}{'99 %':>9}{'99.9 %':>9}{'worst':>9}",
    ]
    for name, values in (
        ("off the period", measured.late),
        ("computing (with the simulated hand)", measured.computing),
    ):
        lines.append(f"{name:<34}" + "".join(f"{1e6 * each:>9.0f}" for each in values))
    lines.append(f"A step of the simulation takes {1e3 * measured.step:.2f} ms.")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench device", description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="how long the hand holds")
    parser.add_argument("--json", type=Path, help="file to write all numbers to")
    options = parser.parse_args(arguments)
    measured = measure(options.seconds)
    print(table(measured))
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(asdict(measured), indent=1) + "\n", encoding="utf-8")
