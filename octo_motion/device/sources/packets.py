# SPDX-License-Identifier: GPL-3.0-or-later
"""Packets between a program that is a device and us; docs/device.md publishes them.

Both know a key, and neither says it. The program greets with a random number and is asked with
another; a key for this meeting alone is made of all three, HMAC-SHA-256, and each further packet
carries a tag made with it and a sequence that grows. So a packet that somebody else wrote, that was
changed, or that was overheard and is sent again, is none.

What the program does, greeting and writing states, is in tests/device/firmware.py.
"""

from __future__ import annotations

import hmac
import os
import secrets
import struct
import time
from dataclasses import astuple, dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Final, NamedTuple

from ...core.errors import DeviceError
from ...core.phrases import phrase
from ...core.rotations.scalars import Vector, normalized
from ..driver import Dynamics, Sample, is_possible

MAGIC: Final = b"OMDF"
VERSION: Final = 2
KEY_BYTES: Final = 16
NONCE_BYTES: Final = 16
TAG_BYTES: Final = 16
FEATURES, STATE, FORCE, GREETING, QUESTION = 1, 2, 3, 4, 5
HEAD: Final = struct.Struct(f"<4sHHQ{TAG_BYTES}s")
BODIES: Final = {
    GREETING: struct.Struct(f"<{NONCE_BYTES}s"),
    QUESTION: struct.Struct(f"<{NONCE_BYTES}s"),
    FEATURES: struct.Struct(f"<{NONCE_BYTES}s{NONCE_BYTES}sB7x9d64s"),
    STATE: struct.Struct("<QIB3x14d"),
    FORCE: struct.Struct("<QI4x6d"),
}
SIZES: Final = {kind: HEAD.size + body.size for kind, body in BODIES.items()}
_TAG_AT: Final = HEAD.size - TAG_BYTES
_WATCHDOG: Final = 20
"""ms after which a force ends if no other follows."""
_MOST: Final = 1000.0
"""Newtons, and all else that a device says of itself."""


class PacketError(ValueError):
    """The bytes are no packet of ours."""


@dataclass(frozen=True)
class NetworkFeatures:
    """What the program's device can do."""

    name: str
    buttons: int
    dynamics: Dynamics


class NetworkState(NamedTuple):
    """What its hand does."""

    answered: int
    """Sequence of the newest force that reached the program; 0: none yet."""
    sample: Sample


class Packet(NamedTuple):
    """A packet that is whole, and says so itself; nobody has proved yet that it is right."""

    kind: int
    sequence: int
    values: tuple[Any, ...]


def key_in(path: Path) -> bytes:
    """The key in a file that its owner alone may read; made anew where there is none.

    Raises:
        DeviceError: others may read it, it cannot be read or made, or has no key.
    """
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch(mode=0o600)
            path.write_text(secrets.token_hex(KEY_BYTES) + "\n", encoding="ascii")
        # Windows keeps a user's own folders from others by itself, and has no such bits.
        if os.name != "nt" and path.stat().st_mode & 0o077:
            raise DeviceError(
                phrase("The key in {path} may be read by others.", path=path),
                "Delete the file: a new one is made, which only you may read.",
            )
        key = bytes.fromhex(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        key = b""
    if len(key) != KEY_BYTES:
        raise DeviceError(
            phrase("The file {path} has no key for programs.", path=path),
            phrase(
                "Delete it, and a new one is made; or write {digits} hexadecimal digits.",
                digits=2 * KEY_BYTES,
            ),
        )
    return key


# --- Writing and reading -------------------------------------------------------------------------


def pack(kind: int, sequence: int, *values: float | bytes, key: bytes = b"") -> bytes:
    """A packet with the fields of its body, and a tag if there is a key of the meeting."""
    body = BODIES[kind].pack(*values)
    head = HEAD.pack(MAGIC, VERSION, kind, sequence, b"")
    return head[:_TAG_AT] + _tag(key, head, body) + body


def _tag(key: bytes, head: bytes, body: bytes) -> bytes:
    if not key:
        return bytes(TAG_BYTES)
    return hmac.digest(key, head[:_TAG_AT] + body, "sha256")[:TAG_BYTES]


def meeting_key(key: bytes, theirs: bytes, ours: bytes) -> bytes:
    """Of one meeting: of the key, the program's number and ours."""
    return hmac.digest(key, MAGIC + struct.pack("<H", VERSION) + theirs + ours, "sha256")


def size_of(data: bytes | bytearray) -> int:
    """Bytes of the packet that begins here, by its head.

    Raises:
        PacketError: it is no packet of ours.
    """
    if len(data) < HEAD.size:
        raise PacketError("cut off")
    magic, version, kind, _, _ = HEAD.unpack_from(data)
    if magic != MAGIC:
        raise PacketError("not one of our packets")
    if version != VERSION:
        raise PacketError(f"version {version} of the packets, not {VERSION}")
    if kind not in SIZES:
        raise PacketError("an unknown kind of packet")
    return SIZES[kind]


def read(data: bytes) -> Packet:
    """The packet that these bytes are.

    Raises:
        PacketError: they are none.
    """
    if len(data) != size_of(data):
        raise PacketError("of another length")
    _, _, kind, sequence, _ = HEAD.unpack_from(data)
    return Packet(kind, sequence, BODIES[kind].unpack_from(data, HEAD.size))


def is_tagged(data: bytes, key: bytes) -> bool:
    """Whether a packet was written, as it is, by one who knows the key of the meeting."""
    theirs = data[_TAG_AT : HEAD.size]
    return hmac.compare_digest(theirs, _tag(key, data[:_TAG_AT], data[HEAD.size :]))


def pack_force(sequence: int, answered: int, force: Vector, torque: Vector, key: bytes) -> bytes:
    """What the program's hand shall feel; ``answered`` is the sequence of the newest state."""
    return pack(FORCE, sequence, answered, _WATCHDOG, *force, *torque, key=key)


def state_of(values: tuple[Any, ...]) -> NetworkState:
    """What the body of a state says.

    Raises:
        PacketError: no hand can be there.
    """
    answered, buttons, held, clock, x, y, z, *turn, vx, vy, vz, wx, wy, wz = values
    orientation = normalized((turn[0], turn[1], turn[2], turn[3]))
    if orientation is None:
        raise PacketError("a pose that cannot be")
    sample = Sample(
        time=time.perf_counter(),
        position=(x, y, z),
        orientation=orientation,
        velocity=(vx, vy, vz),
        angular_velocity=(wx, wy, wz),
        buttons=buttons,
        held=bool(held),
        clock=clock,
    )
    if not is_possible(sample) or not isfinite(clock):
        raise PacketError("a pose that cannot be")
    return NetworkState(answered, sample)


def features_of(values: tuple[Any, ...]) -> NetworkFeatures:
    """What the body of features says.

    Raises:
        PacketError: no device is like that.
    """
    _theirs, _ours, buttons, *numbers, name = values
    dynamics = Dynamics(*numbers)
    possible = all(0.0 <= each <= _MOST for each in astuple(dynamics))
    if buttons > 32 or dynamics.force == 0.0 or not possible:
        raise PacketError("a device that cannot be")
    text = name.rstrip(b"\0").decode(errors="replace")
    return NetworkFeatures("".join(each for each in text if each.isprintable()), buttons, dynamics)
