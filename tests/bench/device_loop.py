# SPDX-License-Identifier: GPL-3.0-or-later
"""How well the loop at the devices keeps time while a hand bends a puppet of twenty bodies.

make bench ARGS="device --seconds 60"
make bench ARGS="device --floods", while somebody sends without end to each of the sockets
"""

from __future__ import annotations

import argparse
import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from octo_motion.device import messages as say
from octo_motion.device.ipc.client import Client
from octo_motion.device.sources import packets
from tests.core.puppets import doll, posed, soft
from tests.device import floods, fuzz, kill


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


def measure(seconds: float, *options: str) -> Measured:
    """Run a bridge with a simulated hand that holds the puppet's hand and draws a circle.

    The options are further ones of the bridge.
    """
    figure = doll(soft(20, 40.0, 2.0, 100.0, 5.0))
    pose = posed(figure)
    client = Client()
    haply = () if "--haply-port" in options else ("--no-haply",)
    client.start(("--simulate", "--no-hid", *haply, *options))
    try:
        client.send_figure(figure, pose)
        client.send_pins({0: False})
        while not (hands := _simulated(client)):
            client.poll()
            time.sleep(0.01)
        x, y, z = map(float, pose.positions[8])
        client.send(say.Workspace(hands[0], (x, y, z)))
        _poll(client, 2.0 if options else 0.5)  # time for whoever else comes
        for _ in range(5):  # where others keep the machine busy, it may have been let go
            client.send(say.Grab(hands[0], grab=True))
            _poll(client, seconds)
            if (hands := _simulated(client)) and client.pointers[hands[0]].body >= 0:
                break
            client.send(say.Grab(hands[0], grab=False))
            _poll(client, 0.1)
        if client.times is None or client.hello is None or not hands:
            sys.exit(f"The bridge says no more: {client.notices}")
        if client.pointers[hands[0]].body < 0:
            sys.exit(f"The bridge did not hold the puppet: {client.notices}, {client.times}")
        times = client.times
        return Measured(
            *(seconds, times.rate, client.hello.priority, times.late, times.computing),
            *(times.missed, times.step),
        )
    finally:
        client.stop()


def _simulated(client: Client) -> list[int]:
    return [number for number, each in client.devices.items() if each.name == "Simulated hand"]


def flooded(seconds: float) -> dict[str, Any]:
    """The same while somebody sends without end, to each of the sockets in turn."""
    result = {"nobody": asdict(measure(seconds))}
    with tempfile.TemporaryDirectory(prefix="octo-motion-bench-") as folder:
        key_file = str(Path(folder) / "key")
        packets.key_in(Path(key_file))
        for kind in floods.KINDS:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
                free.bind(("127.0.0.1", 0))
                port = str(free.getsockname()[1])
            with subprocess.Popen(
                [sys.executable, "-m", "tests.device.floods", kind, port, key_file],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            ) as flood:
                assert flood.stdin
                assert flood.stdout
                try:
                    if kind == "haply":
                        options = ("--haply-port", flood.stdout.readline().decode().strip())
                    else:
                        own = "--tcp" if kind.endswith("tcp") else "--udp"
                        options = (own, port, "--key-file", key_file)
                    result[kind] = asdict(measure(seconds, *options))
                finally:
                    flood.kill()
    return result


_WHO: Final = {
    "nobody": "nobody",
    "udp": "strangers, over UDP",
    "tcp": "strangers, over TCP",
    "program-udp": "a device with the key, over UDP",
    "program-tcp": "a device with the key, over TCP",
    "haply": "Haply's service",
}


def text_flooded(found: Any) -> str:
    """The table of floods."""
    lines = [f"{'who sends without end':<34}{'Hz':>9}{'left out':>9}{'99 % off, µs':>14}"]
    lines += [
        f"{_WHO[kind]:<34}{each['rate']:>9.1f}{each['missed']:>9}{1e6 * each['late'][1]:>14.0f}"
        for kind, each in found.items()
    ]
    return "\n".join(lines)


def text(found: Any) -> str:
    """The table of one run."""
    return table(Measured(**found))


def killed(times: int) -> Any:
    """Seconds after which all is over, or back, of each way in which something is killed."""
    return kill.measure(times)


def text_killed(found: Any) -> str:
    """The table of processes that were killed."""
    lines = [f"{'seconds':<40}{'median':>8}{'worst':>8}"]
    lines += [f"{name:<40}{each[0]:>8.3f}{each[1]:>8.3f}" for name, each in found.items()]
    return "\n".join(lines)


def fuzzed(count: int) -> Any:
    """Inputs for each parser, and the microseconds that one takes."""
    each = -(-count // len(fuzz.TARGETS))
    return {"each": each, "took": fuzz.run(each, seed=1)}


def text_fuzzed(found: Any) -> str:
    """The table of inputs that make no sense."""
    lines = [f"{'parser':<28}{'inputs':>9}{'µs each':>9}"]
    lines += [f"{name:<28}{found['each']:>9}{took:>9.1f}" for name, took in found["took"].items()]
    return "\n".join([*lines, "", "each taken, or refused with its own error"])


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
    parser.add_argument(
        "--floods", action="store_true", help="while somebody sends without end, to each socket"
    )
    parser.add_argument("--json", type=Path, help="file to write all numbers to")
    options = parser.parse_args(arguments)
    if options.floods:
        found: Any = flooded(options.seconds)
        print(text_flooded(found))
    else:
        found = asdict(measure(options.seconds))
        print(text(found))
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
