# SPDX-License-Identifier: GPL-3.0-or-later
"""Driver of Haply's Inverse3, Inverse3x and Minverse through the maker's service on this computer.

After the service's published messages (docs.haply.co, Inverse SDK 3.5: "WebSocket Protocol",
"Simulation Channel", "Device Configuration", "HTTP"): a WebSocket at port 10001; the service sends
one inventory, then exactly one state for each message that it gets. So a message is sent for each
state that came. Its default axes are Blender's: X right, Y forward, Z up; metres and newtons. The
first message names the session and its axes, the first one to a device says where to count from.
What its version is, the service says by HTTP: at the same port, before 3.5 at the one below.

All three stand in one list, with the same states and commands; which one it is, its configuration
says. They give force alone. Orientation and buttons are those of the grip.
"""

from __future__ import annotations

import http.client
import io
import json
import re
import socket
import time
from contextlib import suppress
from typing import Any, Final

from ...core.errors import DeviceError
from ...core.phrases import phrase
from ...core.rotations.scalars import IDENTITY, ZERO, Quaternion, Vector, normalized, subtract
from ..driver import Description, DeviceLostError, Driver, Dynamics, Kind, Sample, is_possible
from ..stream import LOOPBACK
from .websocket import WebSocket, WebSocketError, received_until

PORT: Final = 10001
OLDEST, TOO_NEW = (3, 1), (4, 0)
_CONFIGURABLE: Final = (3, 5)
"""From here on a session can be given a name and axes."""
_ANSWER_SECONDS: Final = 0.02
"""After so long without an answer the next message is sent all the same."""
_LOST_SECONDS: Final = 0.5
_BUTTONS: Final = ("a", "b", "c")
_MIDDLE: Final[Vector] = (0.0, -0.14, 0.15)
"""m: about the middle of the reach, where a service before 3.5 cannot be asked to count from it."""

_MODELS: Final = {
    "inverse3": ("Haply Inverse3", Dynamics(8.0, damping=0.3, delay=0.001, resolution=1e-5)),
    "inverse3x": ("Haply Inverse3x", Dynamics(8.0, damping=0.3, delay=0.001, resolution=1e-5)),
    "minverse": ("Haply Minverse", Dynamics(3.0, damping=0.15, delay=0.001, resolution=1e-5)),
}
"""Names and mechanics. The latter are cautious guesses: the service states none of them. What they
leave open is the passivity controller's business."""
_INVENTORY_SECONDS: Final = 0.3
"""For the service to say which device it has."""


def service_version(port: int = PORT, seconds: float = 0.3) -> tuple[int, int] | None:
    """Version of the service that runs here; None where none does.

    Raises:
        DeviceError: it is too old or too new.
    """
    answers = (_answered_version(each, seconds) for each in (port, port - 1))
    found = next((each for each in answers if each is not None), None)
    if found is None:
        return None
    version = (int(found[1]), int(found[2]))
    if not OLDEST <= version < TOO_NEW:
        raise DeviceError(
            phrase(
                "The Haply service has version {version}, which Octo Motion does not speak.",
                version=found[0],
            ),
            "Install a version from 3.1 on and before 4 with the Haply Hub.",
        )
    return version


def _answered_version(port: int, seconds: float) -> re.Match[str] | None:
    """The version that whoever listens at a port answers with."""
    request = f"GET /version HTTP/1.1\r\nHost: {LOOPBACK}:{port}\r\nConnection: close\r\n\r\n"
    end = time.monotonic() + seconds
    try:
        with socket.create_connection((LOOPBACK, port), timeout=seconds) as connection:
            connection.sendall(request.encode())
            data = received_until(connection, b"", end)
        return parse_version(data)
    except (OSError, WebSocketError):
        return None


def parse_version(data: bytes) -> re.Match[str] | None:
    """The version in an answer of HTTP: a match whose groups are its first two numbers."""
    answer = http.client.HTTPResponse(_Said(data))  # pyright: ignore[reportArgumentType]
    try:
        answer.begin()
        said: Any = json.loads(answer.read()) if answer.status == 200 else None
    except (OSError, http.client.HTTPException, ValueError, OverflowError, RecursionError):
        return None
    said = said.get("data", said) if isinstance(said, dict) else {}
    if not isinstance(said, dict):
        return None
    tag = str(said.get("git_tag") or said.get("git_describe") or "")
    # No version has more digits, and numbers of thousands of them are not read.
    return re.search(r"(?<!\d)(\d{1,4})\.(\d{1,4})(?!\d)", tag[:64])


class _Said:
    """Bytes that have come, for what reads them from a socket."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def makefile(self, *_: object) -> io.BytesIO:
        return io.BytesIO(self._data)


class Haply(Driver):
    """One device of Haply's, and the grip on it where there is one."""

    def __init__(self, line: WebSocket, version: tuple[int, int], came: list[str]) -> None:
        """``came`` is what the service has said already: its inventory."""
        self._socket: WebSocket | None = line
        self._came = came
        self._version = version
        name, dynamics = _MODELS[model_in(came[-1] if came else "")]
        self._device = ""
        self._greeted = self._centred = version < _CONFIGURABLE
        self._asked = 0.0
        self._answered = self._last_state = time.perf_counter()
        super().__init__(
            Description(
                name=name,
                identity="haply",
                kind=Kind.POSE,
                buttons=("A", "B", "C"),
                dynamics=dynamics,
            )
        )

    @classmethod
    def open(cls, port: int = PORT) -> Haply | None:
        """The service's device; None where no service runs.

        Raises:
            DeviceError: the service is too old or too new.
        """
        version = service_version(port)
        if version is None:
            return None
        try:
            line = WebSocket.connect(LOOPBACK, port)
            end = time.monotonic() + _INVENTORY_SECONDS
            while not (came := line.receive()) and time.monotonic() < end:
                time.sleep(0.002)
            return cls(line, version, came)
        except WebSocketError:
            return None

    def read(self) -> Sample | None:
        texts, self._came = self._came or self._there().receive(), []
        now = time.perf_counter()
        if not texts:
            if now - self._answered > _LOST_SECONDS:
                raise DeviceLostError(self.description.name)
            return None
        # The service answers each message: its force has come, but for the way to the device.
        dynamics = self.description.dynamics
        late = now - self._asked + dynamics.delay if self._asked and dynamics else 0.0
        self._answered, self._asked = now, 0.0
        state = parse(texts[-1], self._device)
        if state is None:
            if not self._device:
                self._send({})  # no device yet: ask again
            elif now - self._last_state > _LOST_SECONDS:
                raise DeviceLostError(self.description.name)  # pulled out; the service goes on
            return None
        self._last_state = now
        self._device, sample = state
        if self._version < _CONFIGURABLE:
            sample = sample._replace(position=subtract(sample.position, _MIDDLE))
        return sample._replace(time=now, delay=late)

    def send(self, force: Vector, torque: Vector) -> None:  # noqa: ARG002 - it has no torque
        """Ask for a force; sent once the service has answered the message before."""
        self._there()
        if self._asked and time.perf_counter() - self._asked < _ANSWER_SECONDS:
            return
        x, y, z = force
        device: dict[str, Any] = {
            "device_id": self._device,
            "commands": {"set_cursor_force": {"values": {"x": x, "y": y, "z": z}}},
        }
        if self._device and not self._centred:
            self._centred = True
            device["configure"] = {"preset": {"preset": "arm_front_centered"}}
        self._send({"inverse3": [device]})

    def _send(self, message: dict[str, Any]) -> None:
        if not self._greeted:
            configure = {
                "profile": {"name": "octo-motion:posing"},
                "basis": {"permutation": "XYZ"},
            }
            message = {**message, "session": {"configure": configure}}
        self._greeted = True
        self._asked = time.perf_counter()
        self._there().send(json.dumps(message))

    def _there(self) -> WebSocket:
        if self._socket is None:
            raise DeviceLostError(self.description.name)
        return self._socket

    def close(self) -> None:
        """Take force away and leave the service."""
        if self._socket is not None:
            self._asked = 0.0
            with suppress(DeviceLostError):
                if self._device:
                    self.send(ZERO, ZERO)
            self._socket.close()
            self._socket = None


def parse(text: str, device: str = "") -> tuple[str, Sample] | None:
    """Id and state of the wanted device, or the first, in the service's JSON; None without one."""
    try:
        message: Any = json.loads(text)
        entries: Any = message["inverse3"]
        found = next(each for each in entries if not device or each["device_id"] == device)
        state = found["state"]
        position, velocity = _vector(state["cursor_position"]), _vector(state["cursor_velocity"])
        status = found.get("status") or {}
        orientation, buttons = _grip(message)
        sample = Sample(
            *(0.0, position, orientation, velocity, ZERO, buttons),
            # An arm that does not know where it is, or has no power, is given no force.
            held=bool(status.get("calibrated", True) and status.get("power_supply", True)),
        )
        return (str(found["device_id"])[:64], sample) if is_possible(sample) else None
    except (ValueError, KeyError, StopIteration, TypeError, AttributeError):
        return None
    except (RecursionError, OverflowError):  # nested too deep, a number beyond all floats
        return None


def model_in(text: str) -> str:
    """Which model the first device is, in the service's JSON; an Inverse3 where it does not say."""
    try:
        first = json.loads(text)["inverse3"][0]
        config = first.get("config") or {}
        kind = config.get("type") or (config.get("device_info") or {}).get("type")
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):
        kind = ""
    return kind if isinstance(kind, str) and kind in _MODELS else "inverse3"


def _grip(message: dict[str, Any]) -> tuple[Quaternion, int]:
    for kind in ("wireless_verse_grip", "verse_grip", "custom_verse_grip"):
        for each in message.get(kind) or ():
            state = each["state"]
            turn = state.get("orientation") or {}
            w, x, y, z = (float(turn.get(name, 0.0)) for name in "wxyz")
            pressed = state.get("buttons") or {}
            if "button" in state:  # the wired grip has one
                pressed = {"a": state["button"]}
            buttons = sum(bool(pressed.get(name)) << bit for bit, name in enumerate(_BUTTONS))
            return normalized((w, x, y, z)) or IDENTITY, buttons
    return IDENTITY, 0


def _vector(value: dict[str, Any]) -> Vector:
    x, y, z = (float(value[name]) for name in "xyz")
    return (x, y, z)
