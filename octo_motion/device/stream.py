# SPDX-License-Identifier: GPL-3.0-or-later
"""Bytes to and from one peer over TCP, never waiting."""

from __future__ import annotations

import socket
from typing import Final

LOOPBACK: Final = "127.0.0.1"
"""The one address that anything here listens at or talks to, this computer's own: Blender's
*Allow Online Access* (``bpy.app.online_access``) is about the internet, and not asked for."""
_MOST_BYTES: Final = 262_144
"""In one call: whoever sends without end does not keep a loop from going on."""


class Stream:
    """A connection that is open, what has come over it, and what waits to be sent."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.settimeout(0.0)
        self._socket = connection
        self.received = bytearray()
        """To be taken away by whoever reads it."""
        self.unsent = bytearray()

    def receive(self, most: int = _MOST_BYTES) -> bool:
        """Take in so many bytes of what has come; False once the peer has ended and said all."""
        try:
            data = self._socket.recv(most)
        except (BlockingIOError, InterruptedError):
            return True
        except OSError:
            return False
        self.received += data
        return bool(data)

    def flush(self) -> bool:
        """Send what waits, as far as the peer takes it; False where the peer is gone."""
        while self.unsent:
            try:
                sent = self._socket.send(self.unsent)
            except (BlockingIOError, InterruptedError):
                return True
            except OSError:
                return False
            del self.unsent[:sent]
        return True

    def close(self) -> None:
        """End the connection; what still waits is tried once more."""
        self.flush()
        self._socket.close()
