# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand-ins for what is not on every desk: HID handles, a clock, a wall, Haply's service."""

from __future__ import annotations

import base64
import json
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from octo_motion.core.rotations.scalars import ZERO, Vector
from octo_motion.device.driver import Description, DeviceLostError, Driver, Dynamics, Kind, Sample
from octo_motion.device.hid.system import Found
from octo_motion.device.sources.websocket import accept_key, frame, masked

SPACE_MOUSE = bytes.fromhex(
    # A space mouse with separate reports 1 and 2 of ±350, and 32 buttons in report 3.
    "05 01 09 08 a1 01"
    "a1 00 85 01 16 a2 fe 26 5e 01 36 88 fa 46 78 05 55 0c 65 11"
    "09 30 09 31 09 32 75 10 95 03 81 06 c0"
    "a1 00 85 02 09 33 09 34 09 35 75 10 95 03 81 06 c0"
    "a1 02 85 03 05 01 05 09 19 01 29 20 15 00 25 01 35 00 45 01 75 01 95 20 81 02 c0"
    "c0"
)
COMBINED = bytes.fromhex(
    "05 01 09 08 a1 01 a1 00 85 01 16 a2 fe 26 5e 01"
    "09 30 09 31 09 32 09 33 09 34 09 35 75 10 95 06 81 06 c0"
    "a1 02 85 03 05 09 19 01 29 02 15 00 25 01 75 01 95 02 81 02 95 0e 81 03 c0 c0"
)


def found(vendor: int = 0x256F, product: int = 0xC635, page: int = 1, usage: int = 8) -> Found:
    return Found(b"/dev/hidraw7", vendor, product, page, usage, "SpaceMouse Compact", "A1")


@dataclass
class FakeHandle:
    """A HID device whose reports are put in by the test."""

    reports: deque[bytes] = field(default_factory=deque[bytes])
    written: list[bytes] = field(default_factory=list[bytes])
    features: bytes = b""
    gone: bool = False
    closed: int = 0

    def read(self, _most: int, /) -> list[int]:
        if self.gone:
            raise OSError("read error")
        return list(self.reports.popleft()) if self.reports else []

    def write(self, data: bytes, /) -> int:
        if self.gone:
            return -1
        self.written.append(bytes(data))
        return len(data)

    def get_feature_report(self, _number: int, _most: int, /) -> list[int]:
        return list(self.features)

    def close(self) -> None:
        self.closed += 1


@dataclass
class FakeDriver(Driver):
    """A force device whose samples are put in by the test; a clock of its own."""

    dynamics: Dynamics | None = field(default_factory=lambda: Dynamics(8.0, 0.4, 0.5, 0.0012))
    kind: Kind = Kind.POSE
    samples: deque[Sample] = field(default_factory=deque[Sample])
    sent: list[tuple[Vector, Vector]] = field(default_factory=list[tuple[Vector, Vector]])
    gone: bool = False
    closed: int = 0

    def __post_init__(self) -> None:
        self.name_it("Fake")

    def name_it(self, name: str) -> None:
        super().__init__(Description(name, name, self.kind, ("Grab", "Key"), self.dynamics))

    def read(self) -> Sample | None:
        if self.gone:
            raise DeviceLostError("Fake")
        return self.samples.popleft() if self.samples else None

    def send(self, force: Vector, torque: Vector) -> None:
        self.sent.append((force, torque))

    def close(self) -> None:
        self.send(ZERO, ZERO)
        self.closed += 1


def wait_for(what: Callable[[], object]) -> Any:
    """What comes of asking until something does."""
    end = time.monotonic() + 10.0
    while True:
        got = what()
        if got:
            return got
        assert time.monotonic() < end
        time.sleep(0.001)


class HaplyService:
    """A server that follows the published messages of Haply's service, one client at a time."""

    def __init__(self, version: str = "3.5.0", *, with_device: bool = True) -> None:
        self.version = version
        self.with_device = with_device
        self.status = {"calibrated": True, "power_supply": True, "ready": True, "started": True}
        self.config: dict[str, Any] = {}
        self.older: socket.socket | None = None
        self.received: list[dict[str, Any]] = []
        self.position = {"x": 0.01, "y": 0.02, "z": 0.03}
        self.buttons = {"a": False, "b": False, "c": False}
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self._clients: list[socket.socket] = []
        threading.Thread(target=self._serve, args=(self._server,), daemon=True).start()

    def tell_version_below(self) -> None:
        """As before 3.5: HTTP at a port of its own, the one below."""
        self.older = socket.create_server(("127.0.0.1", self.port - 1))
        threading.Thread(target=self._serve, args=(self.older,), daemon=True).start()

    def state(self) -> dict[str, Any]:
        inverse3 = {
            "device_id": "049D",
            "config": self.config,
            "state": {
                "cursor_position": self.position,
                "cursor_velocity": {"x": 0.1, "y": 0.0, "z": -0.1},
                "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
                "current_cursor_force": {"x": 0.0, "y": 0.0, "z": 0.0},
                "control_mode": "idle",
            },
            "status": self.status,
        }
        grip = {
            "device_id": "61548",
            "state": {
                "orientation": {"w": 0.0, "x": 0.0, "y": 0.0, "z": 1.0},
                "buttons": self.buttons,
            },
        }
        return {
            "session_id": 7,
            "inverse3": [inverse3] if self.with_device else [],
            "verse_grip": [],
            "wireless_verse_grip": [grip],
        }

    def close(self) -> None:
        self._server.close()
        if self.older is not None:
            self.older.close()
        for client in self._clients:
            client.close()

    def _serve(self, server: socket.socket) -> None:
        while True:
            try:
                client, _ = server.accept()
            except OSError:
                return
            self._clients.append(client)
            threading.Thread(target=self._talk, args=(client, server), daemon=True).start()

    def _talk(self, client: socket.socket, server: socket.socket) -> None:
        try:
            request = b""
            while b"\r\n\r\n" not in request:
                request += client.recv(4096)
            if request.startswith(b"GET /version ") and self.older not in {None, server}:
                client.sendall(b"HTTP/1.1 426 Upgrade Required\r\nContent-Length: 0\r\n\r\n")
                client.close()
                return
            if request.startswith(b"GET /version "):
                body = json.dumps({"git_tag": self.version, "git_describe": self.version}).encode()
                client.sendall(
                    b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"
                    + f"Content-Length: {len(body)}\r\n\r\n".encode()
                    + body
                )
                client.close()
                return
            lines = request.split(b"\r\n")
            key = next(x.split(b": ")[1] for x in lines if x.startswith(b"Sec-WebSocket-Key"))
            assert len(base64.b64decode(key)) == 16
            client.sendall(
                b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + accept_key(key) + b"\r\n\r\n"
            )
            self._say(client)
            for text in self._texts(client):
                self.received.append(json.loads(text))
                self._say(client)  # one state for each message
        except (OSError, EOFError, IndexError):
            client.close()

    def _say(self, client: socket.socket) -> None:
        text = json.dumps(self.state()).encode()
        # In two frames with a ping between them, as a server may.
        first, second = frame(0x1, text[:40]), frame(0x0, text[40:])
        client.sendall(bytes([first[0] & 0x7F]) + first[1:] + frame(0x9, b"there?") + second)

    def _texts(self, client: socket.socket) -> Iterable[bytes]:
        while True:
            head = _exactly(client, 2)
            size = head[1] & 0x7F
            assert head[1] & 0x80, "a client masks its frames"
            if size == 126:
                size = int.from_bytes(_exactly(client, 2), "big")
            mask = _exactly(client, 4)
            payload = masked(_exactly(client, size), mask)
            if head[0] & 0xF == 0x1:
                yield payload


def _exactly(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        got = client.recv(count - len(data))
        if not got:
            raise EOFError
        data += got
    return data
