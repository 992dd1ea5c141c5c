# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that send without end to whatever listens: python -m tests.device.floods KIND PORT [KEY]

``udp`` and ``tcp``: strangers; ``program-udp`` and ``program-tcp``: one that knows the key, is a
device, and then says where its hand is as often as it can; ``haply``: a service that says its state
without being asked. They end with whoever started them.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
import threading
import time
from pathlib import Path

from octo_motion.device.driver import Dynamics, Sample
from octo_motion.device.sources import packets
from octo_motion.device.sources.packets import NetworkFeatures
from octo_motion.device.sources.websocket import accept_key, frame
from tests.device.firmware import Program
from tests.device.parts import HaplyService

KINDS = ("udp", "tcp", "program-udp", "program-tcp", "haply")
_SHAPES = {"udp": socket.SOCK_DGRAM, "tcp": socket.SOCK_STREAM}


def end_with_parent() -> None:
    """End once standard input does, as it does when whoever started this is gone."""

    def watch() -> None:
        while os.read(0, 100):
            pass
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def strangers(kind: str, port: int) -> None:
    """Garbage, and greetings, from one address after another."""
    said = (b"garbage" * 100, Program(bytes(16)).greeting())
    while True:
        with contextlib.suppress(OSError), socket.socket(socket.AF_INET, _SHAPES[kind]) as line:
            line.settimeout(1.0)
            line.connect(("127.0.0.1", port))
            for index in range(10_000):
                line.send(said[index % 2])


def program(kind: str, port: int, key: bytes) -> None:
    """A device that says where it is as often as it can, and reads nothing."""
    while True:
        with contextlib.suppress(OSError), socket.socket(socket.AF_INET, _SHAPES[kind]) as line:
            line.settimeout(0.2)
            line.connect(("127.0.0.1", port))
            one = Program(key)
            line.send(one.greeting())
            one.asked(line.recv(packets.SIZES[packets.QUESTION]))
            line.send(one.features(NetworkFeatures("Flood", 1, Dynamics(5.0))))
            line.settimeout(None)
            while True:
                line.send(one.state(Sample(0.0, clock=time.perf_counter())))


def haply() -> int:
    """A service that answers as Haply's does, and then says its state without end; its port."""
    service = HaplyService()
    text = frame(0x1, json.dumps(service.state()).encode()) * 50

    def talk(client: socket.socket) -> None:
        with client, contextlib.suppress(OSError, IndexError):
            request = client.recv(4096)
            if request.startswith(b"GET /version "):
                body = b'{"git_tag": "3.5.0"}'
                client.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 20\r\n\r\n" + body)
                return
            key = request.split(b"Sec-WebSocket-Key: ")[1].split(b"\r\n")[0]
            client.sendall(
                b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + accept_key(key) + b"\r\n\r\n"
            )
            while True:
                client.sendall(text)

    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            talk(server.accept()[0])

    threading.Thread(target=serve, daemon=True).start()
    return server.getsockname()[1]


def main() -> None:
    """Run the command line."""
    kind = sys.argv[1]
    if hasattr(os, "nice"):
        os.nice(5)  # what is measured needs processors that are not all taken by this
    if kind == "haply":
        print(haply(), flush=True)
        end_with_parent()
        threading.Event().wait()
    end_with_parent()
    port = int(sys.argv[2])
    if kind.startswith("program-"):
        program(kind.removeprefix("program-"), port, packets.key_in(Path(sys.argv[3])))
    else:
        strangers(kind, port)


if __name__ == "__main__":
    main()
