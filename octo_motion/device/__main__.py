# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m octo_motion.device``: the program at the devices, and what helps to set them up."""

from __future__ import annotations

import argparse
import logging
import os
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .driver import Driver
    from .sources import Sources

# Arrays here are small: threads of a numerical library would only wait for each other. This must be
# set before numpy is first imported.
for _variable in (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
):
    os.environ.setdefault(_variable, "1")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m octo_motion.device",
        description="Six-degree-of-freedom devices of Octo Motion: find, try and serve them.",
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="list the devices that are plugged in, and what they lack")
    # Not abbreviated: a key that is given on the command line must not name a file.
    add = partial(commands.add_parser, allow_abbrev=False)
    watch = add("watch", help="print what the devices say")
    watch.add_argument("--seconds", type=float, default=10.0, help="for how long")
    descriptor = commands.add_parser(
        "descriptor", help="print the report descriptor of the open force profile, for firmware"
    )
    descriptor.add_argument("--table", action="store_true", help="print its reports as tables")
    bridge = add("bridge", help="what Blender starts: simulate, and serve devices")
    bridge.add_argument("--alone", action="store_true", help="only simulate: no devices")
    hands = add("hands", help="what the bridge starts: the loop at the devices")
    for each in (watch, bridge, hands):
        each.add_argument("--no-hid", action="store_true", help="leave HID devices alone")
        each.add_argument("--no-haply", action="store_true", help="do not look for Haply's service")
        each.add_argument("--haply-port", type=int, default=10001, help="of Haply's service")
        each.add_argument("--simulate", action="store_true", help="add a hand made of numbers")
        network = each.add_mutually_exclusive_group()
        network.add_argument("--udp", type=int, help="port at which a program may be a device")
        network.add_argument("--tcp", type=int, help="the same over TCP")
        each.add_argument(
            "--rate", type=float, default=1000.0, help="Hz of the loop; less on a slow machine"
        )
        each.add_argument(
            "--key-file",
            type=Path,
            help="with the key for --udp and --tcp, made if it is not there",
        )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    options = parser.parse_args(given)
    logging.basicConfig(level=logging.INFO, format="Octo Motion device: %(message)s")
    if options.command == "list":
        return _list()
    if options.command == "descriptor":
        return _descriptor(table=options.table)
    from .ipc import end_now  # noqa: PLC0415

    sources = _sources(parser, options)
    if not 50.0 <= options.rate <= 4000.0:
        parser.error("--rate must be from 50 to 4000")
    if options.command == "watch":
        return _watch(sources, options.seconds)
    if options.command == "hands":
        from . import hand_process  # noqa: PLC0415

        return end_now(hand_process.run(sources, options.rate))
    from . import bridge_process  # noqa: PLC0415

    return end_now(bridge_process.run(given[1:]))


def _sources(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Sources:
    from .sources import Sources  # noqa: PLC0415 - what help does without

    ports = ((kind, getattr(options, kind)) for kind in ("udp", "tcp"))
    network = next((each for each in ports if each[1] is not None), None)
    if network is not None and options.key_file is None:
        parser.error("--udp and --tcp need --key-file")
    if network is not None and not 0 <= network[1] <= 0xFFFF:
        parser.error("a port is a number from 0 to 65535")
    return Sources(
        hid=not options.no_hid,
        haply=not options.no_haply,
        haply_port=options.haply_port,
        simulated=options.simulate,
        network=network,
        key_file=options.key_file,
    )


def _list() -> int:
    from ..core.errors import DeviceError  # noqa: PLC0415
    from .hid import list_devices, model_of, open_device  # noqa: PLC0415
    from .sources import HID_DRIVERS, hid_driver_for  # noqa: PLC0415

    try:
        listed = [(each, hid_driver_for(each)) for each in list_devices()]
    except DeviceError as error:
        print(error, file=sys.stderr)
        return 1
    found = [(each, kind) for each, kind in listed if kind]
    if not found:
        kinds = " and ".join(f"no {kind.name}" for kind in reversed(HID_DRIVERS))
        print(f"{kinds.capitalize()} is plugged in.")
    for each, kind in found:
        model = model_of(each.vendor, each.product)
        name = model.name if model else each.name or "unknown"
        print(f"{each.vendor:04x}:{each.product:04x}  {name} ({kind.name})")
        try:
            open_device(each).close()
        except DeviceError as error:
            print(f"           {error}")
    return 0


def _descriptor(*, table: bool) -> int:
    from .hid import REPORTS, SIZES, report_descriptor  # noqa: PLC0415

    if table:
        for number, (way, items) in REPORTS.items():
            print(f"Report {number}, {way}, {SIZES[number]} bytes with its number")
            for each in items:
                kind = {"B": "u8", "H": "u16", "I": "u32", "h": "i16", "i": "i32"}[each.code]
                print(f"  {each.name:<20}{kind} × {each.count}  {each.unit}")
        return 0
    data = report_descriptor()
    for at in range(0, len(data), 12):
        print(", ".join(f"0x{byte:02x}" for byte in data[at : at + 12]) + ",")
    return 0


def _watch(sources: Sources, seconds: float) -> int:
    from .calibration import NONE, Response, corrected  # noqa: PLC0415
    from .driver import DeviceLostError  # noqa: PLC0415
    from .hand_process import discovery_of  # noqa: PLC0415

    discovery = discovery_of(sources)
    drivers: list[Driver] = []
    end = time.monotonic() + seconds
    shown = 0.0
    try:
        while time.monotonic() < end:
            drivers.extend(discovery.look())
            for problem in discovery.problems:
                print(problem, file=sys.stderr)
            discovery.problems.clear()
            due = time.monotonic() - shown > 0.1
            shown = time.monotonic() if due else shown
            for driver in list(drivers):
                try:
                    sample = driver.read()
                    driver.send((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
                except DeviceLostError:
                    print(f"{driver.description.name}: gone")
                    drivers.remove(driver)
                    discovery.lost(driver.description.identity)
                    continue
                if sample is not None and due:
                    sample = corrected(sample, driver.description.kind, NONE, Response())
                    numbers = (*sample.position, *sample.velocity, *sample.angular_velocity)
                    columns = " ".join(f"{each:8.4f}" for each in numbers)
                    print(f"{driver.description.name}: {columns} buttons {sample.buttons:b}")
            time.sleep(0.002)
    except KeyboardInterrupt:
        pass
    finally:
        for driver in drivers:
            driver.close()
        discovery.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
