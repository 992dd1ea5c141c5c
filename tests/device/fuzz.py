# SPDX-License-Identifier: GPL-3.0-or-later
"""Fuzz every parser of the device layer: python -m tests.device.fuzz [COUNT] [SEED]

Half of the inputs are random bytes, half are right ones with a few bytes changed, cut out, doubled
or put in. A parser may take them or refuse them with its own error; anything else is a finding.
"""

from __future__ import annotations

import json
import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from octo_motion.device import messages as say
from octo_motion.device.codec import MessageError
from octo_motion.device.hid import force_profile as profile
from octo_motion.device.hid.descriptor import DescriptorError, parse_descriptor
from octo_motion.device.hid.force_profile import ReportError
from octo_motion.device.hid.space_mouse import MultiAxis
from octo_motion.device.sources import haply, packets
from octo_motion.device.sources.packets import PacketError
from octo_motion.device.sources.websocket import FrameReader, WebSocketError, frame
from tests.device import firmware
from tests.device.parts import COMBINED, SPACE_MOUSE
from tests.device.test_force_profile import DYNAMICS, state
from tests.device.test_messages import EXAMPLES
from tests.device.test_programs import FEATURES, STATE, met

_SMALL = 4000
"""Bytes: of messages, the smaller ones show as much."""


@dataclass(frozen=True)
class Target:
    """A parser, right inputs for it, and what it may raise."""

    name: str
    run: Callable[[bytes], object]
    right: list[bytes]
    refusal: type[Exception] | None


def _message(data: bytes) -> None:
    kind, length = say.read_header(data[: say.HEADER.size].ljust(say.HEADER.size, b"\0"))
    message = say.read_body(kind, data[say.HEADER.size : say.HEADER.size + length])
    match message:
        case say.FigureMessage():
            message.figure()
        case say.ObstacleMessage():
            message.obstacle()
        case say.Settings():
            message.response()
        case say.CalibrationMessage():
            message.calibration()
        case say.WorldMessage():
            message.settings()
        case say.Place():
            message.motion(len(message.positions))
        case say.TurnBack():
            message.pose(len(message.joints))
        case say.Tick():
            message.samples()
        case say.Take():
            message.coupling()


def _descriptor(data: bytes) -> None:
    mouse = MultiAxis(parse_descriptor(data))
    mouse.feed(data[:32])
    assert all(-1.0 <= each <= 1.0 for each in mouse.push)


_MICE = [MultiAxis(parse_descriptor(each)) for each in (SPACE_MOUSE, COMBINED)]


def _report(data: bytes) -> None:
    for mouse in _MICE:
        mouse.feed(data)
        assert all(-1.0 <= each <= 1.0 for each in mouse.push)


def _packet(data: bytes) -> None:
    packet = packets.read(data)
    assert not packets.is_tagged(data, b"another meeting's")
    if packet.kind == packets.FEATURES:
        packets.features_of(packet.values)
    elif packet.kind == packets.STATE:
        packets.state_of(packet.values)


def _haply(data: bytes) -> None:
    haply.parse(data.decode(errors="replace"))


def _model(data: bytes) -> None:
    haply.model_in(data.decode(errors="replace"))


_VERSION = b'HTTP/1.1 200 OK\r\nContent-Length: 20\r\n\r\n{"git_tag": "3.5.0"}'
_HAPLY = json.dumps(
    {
        "inverse3": [
            {
                "device_id": "049D",
                "config": {"type": "minverse", "device_info": {"type": "minverse"}},
                "state": {
                    "cursor_position": {"x": 0.1, "y": 0.2, "z": 0.3},
                    "cursor_velocity": {"x": 0.1, "y": 0.2, "z": 0.3},
                },
            }
        ],
        "wireless_verse_grip": [
            {"state": {"orientation": {"w": 1, "x": 0, "y": 0, "z": 0}, "buttons": {"a": True}}}
        ],
    }
).encode()

TARGETS = [
    Target(
        "messages",
        _message,
        [data for each in EXAMPLES if len(data := say.pack(each)) < _SMALL],
        MessageError,
    ),
    Target(
        "report descriptors",
        _descriptor,
        [SPACE_MOUSE, COMBINED, profile.report_descriptor()],
        DescriptorError,
    ),
    Target("reports of space mice", _report, [b"\x01" + bytes(12), b"\x03\x01\0\0\0"], None),
    Target(
        "states of the profile",
        lambda data: profile.parse_state(data, 0.0),
        [firmware.pack_state(state())],
        ReportError,
    ),
    Target(
        "features of the profile",
        profile.parse_features,
        [firmware.pack_features(2, DYNAMICS)],
        ReportError,
    ),
    Target(
        "network packets",
        _packet,
        [met().features(FEATURES), met().state(STATE), met().greeting()],
        PacketError,
    ),
    Target(
        "WebSocket frames",
        lambda data: FrameReader().feed(data),
        [frame(1, b"text"), frame(9, b"") + frame(1, b"x" * 200)],
        WebSocketError,
    ),
    Target("Haply's states", _haply, [_HAPLY], None),
    Target("Haply's inventory", _model, [_HAPLY], None),
    Target("Haply's version", haply.parse_version, [_VERSION], None),
]


def spoilt(data: bytes, dice: random.Random) -> bytes:
    """A right input with something wrong in it."""
    changed = bytearray(data)
    for _ in range(dice.randint(1, 4)):
        at = dice.randrange(len(changed) + 1)
        match dice.randrange(5):
            case 0 if at < len(changed):
                changed[at] = dice.randrange(256)
            case 1 if at < len(changed):
                changed[at] ^= 1 << dice.randrange(8)
            case 2:
                del changed[at : at + dice.randint(1, 8)]
            case 3:
                changed[at:at] = dice.randbytes(dice.randint(1, 8))
            case _:
                changed[at:at] = changed[at : at + dice.randint(1, 16)]
    return bytes(changed)


def run(count: int, seed: int) -> dict[str, float]:
    """Try so many inputs on each parser; microseconds that each took.

    Raises:
        AssertionError: a finding, with the input.
    """
    took: dict[str, float] = {}
    dice = random.Random(seed)  # noqa: S311 - to be drawn again by its seed
    for target in TARGETS:
        start = time.perf_counter()
        for index in range(count):
            if index % 2:
                data = spoilt(dice.choice(target.right), dice)
            else:
                data = dice.randbytes(dice.randrange(80))
            try:
                target.run(data)
            except Exception as error:
                if target.refusal and isinstance(error, target.refusal):
                    continue
                raise AssertionError(f"{target.name}: {data!r}") from error
        took[target.name] = 1e6 * (time.perf_counter() - start) / count
    return took


def main() -> None:
    """Run the command line."""
    total = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    each = -(-total // len(TARGETS))
    for name, microseconds in run(each, seed).items():
        print(f"{name:<26}{each:>9} inputs {microseconds:>7.1f} µs each")
    print(f"{each * len(TARGETS)} inputs, seed {seed}: nothing found")


if __name__ == "__main__":
    main()
