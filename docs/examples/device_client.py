# SPDX-License-Identifier: GPL-3.0-or-later
"""A grip on four wires, like SPIDAR, is the device: python device_client.py PORT KEYFILE."""

import hmac
import math
import os
import socket
import struct
import sys
import time
from pathlib import Path

CORNERS = [(0.2, 0.2, 0.2), (0.2, -0.2, -0.2), (-0.2, 0.2, -0.2), (-0.2, -0.2, 0.2)]


class Wires:
    """In place of the maker's library; here a hand of 300 N/m leads the grip in a circle."""

    def __init__(self) -> None:
        self.at = self.pulled = [0.0, 0.0, 0.0]

    def lengths(self) -> list[float]:  # of the wires, m: what encoders tell
        hand = 0.03 * math.cos(time.time()), 0.03 * math.sin(time.time()), 0.0
        self.at = [hand[axis] + self.pulled[axis] / 300.0 for axis in range(3)]
        return [math.dist(self.at, corner) for corner in CORNERS]

    def pull(self, forces: list[float]) -> None:  # of the motors, N, none below zero
        ways = [[c - a for c, a in zip(to, self.at, strict=True)] for to in CORNERS]
        shares = [f / math.hypot(*way) for f, way in zip(forces, ways, strict=True)]
        self.pulled = [sum(shares[i] * ways[i][axis] for i in range(4)) for axis in range(3)]


def packet(kind: int, sequence: int, body: bytes, key: bytes = b"") -> bytes:
    head = struct.pack("<4sHHQ", b"OMDF", 2, kind, sequence)
    return head + (hmac.digest(key, head + body, "sha256")[:16] if key else bytes(16)) + body


def meet(line: socket.socket, key: bytes) -> bytes:
    """Greet, see that who asks knows the key, say what the device can do; the meeting's key."""
    theirs = os.urandom(16)
    while True:
        time.sleep(0.1)
        try:
            line.send(packet(4, 0, theirs))
            ours = (asked := line.recv(2048))[32:]
        except OSError:  # nobody is there yet
            continue
        meeting = hmac.digest(key, b"OMDF\x02\x00" + theirs + ours, "sha256")
        if hmac.compare_digest(asked, packet(5, 0, ours, meeting)):
            # No button; 5 N, no torque; damping, friction, resolution, each of turns too; delay.
            can = (0, 5.0, 0.0, 0.2, 0.0, 0.1, 0.0, 1e-4, 0.0, 1e-3, b"SPIDAR")
            line.send(packet(1, 1, struct.pack("<16s16sB7x9d64s", theirs, ours, *can), meeting))
            return meeting


line, wires = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), Wires()
line.connect(("127.0.0.1", int(sys.argv[1])))
line.settimeout(0.001)
meeting = meet(line, bytes.fromhex(Path(sys.argv[2]).read_text(encoding="ascii")))
newest, until, force, then, was = 0, 0.0, (0.0, 0.0, 0.0), time.perf_counter(), None
for sequence in range(2, sys.maxsize):
    try:
        data = line.recv(2048)  # as often as a force comes, or after a millisecond
        _, number, _, _, watchdog, *felt = struct.unpack("<8sQ16sQI4x6d", data)
        if number > newest and data == packet(3, number, data[32:], meeting):
            newest, until, force = number, time.perf_counter() + 1e-3 * watchdog, felt[:3]
    except (OSError, struct.error):
        pass
    now, squares = time.perf_counter(), [each * each for each in wires.lengths()]
    # l² = p² − 2 p·c + c², and of the corners Σ c = 0, Σ c cᵀ = 0.16: three sums give p.
    parts = [(sum(squares) / 4.0 - square) / 0.32 for square in squares]
    at = [sum(parts[i] * CORNERS[i][axis] for i in range(4)) for axis in range(3)]
    speed = [(a - w) / (now - then) for a, w in zip(at, was or at, strict=True)]
    state = (newest, 0, 1, now, *at, 1.0, 0.0, 0.0, 0.0, *speed, 0.0, 0.0, 0.0)
    was, then = at, now
    line.send(packet(2, sequence, struct.pack("<QIB3x14d", *state), meeting))
    # Wires only pull: all by as much more as leaves none slack. That cancels out near the middle.
    pulls = [sum(c * f for c, f in zip(to, force, strict=True)) / 0.4619 for to in CORNERS]
    wires.pull([each + 0.2 - min(pulls) if now < until else 0.2 for each in pulls])
