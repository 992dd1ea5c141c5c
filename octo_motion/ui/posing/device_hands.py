# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices on a session of posing, without a window: the bridge simulates, the armature follows.

Everything that the bridge hears is in the puppet's metres; whatever is shown is in the world's.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...blender.files import load_calibrations, save_calibrations
from ...blender.versions import ndof_sensitivities
from ...core.errors import SettingsError, WriteError
from ...core.phrases import phrase
from ...core.posing.picking import nearest_body
from ...core.posing.puppet import Pose, bodies_with, part_of
from ...core.posing.session import HandSample
from ...core.posing.solver import Coupling, HandSpring
from ...core.rotations import IDENTITY, Floats, from_matrix, from_rotation_vector, multiply
from ...device.calibration import NONE, Calibration
from ...device.driver import Kind
from ...device.ipc import Client, ClientState
from ...device.messages import (
    Button,
    CalibrationMessage,
    DeviceMessage,
    Grab,
    Notice,
    Order,
    PointerMessage,
    Workspace,
    WorldMessage,
)
from ...device.messages import Settings as DeviceSettings
from ...device.simulation import coupling_for
from .aids import HeldByDevice
from .controls import PoseControls
from .properties import posing_settings
from .puppet_session import PuppetSession

_WIDTH: Final = 0.25
"""m: the room of a desktop device, which is as wide as the view."""
_NARROWEST: Final = 0.01
"""m: of a room that was learned."""
RATE_WIDTH: Final = 1.0
"""m: full push of a space mouse crosses the view in 2.5 s."""
_ANSWER: Final = 0.4
"""s after which a grab that holds nothing has found nothing."""
NOTHING_NEAR: Final = phrase("No limb is near enough to grab")
NDOF_NAME: Final = phrase("Space mouse, through Blender")
NDOF_GRAB_BUTTONS: Final = frozenset({"NDOF_BUTTON_MENU", "NDOF_BUTTON_1", "NDOF_BUTTON_V1"})
NDOF_KEY_BUTTONS: Final = frozenset({"NDOF_BUTTON_FIT", "NDOF_BUTTON_2", "NDOF_BUTTON_V2"})
_LONGEST: Final = 0.1
"""s: a longer time between two events is a pause, not a long push."""


@dataclass(frozen=True, eq=False)
class ViewRoom:
    """What the view says of where devices are in the scene."""

    middle: Floats
    """(3,) the middle of the view, world."""
    axes: Floats
    """(3, 3) as columns: right, up, and towards the eye."""
    width: float
    """Of what is seen, world."""


@dataclass(frozen=True, eq=False)
class ShownPointer:
    """A pointer, as it is drawn."""

    number: int
    position: Floats
    """(3,) world."""
    coupled: Floats
    """(3,) world, where the held point is."""
    body: int
    force: float
    """Share of what the device can give."""
    name: str


class HandsBase:
    """What devices and Blender's own space mouse share as hands of a session; the client may be
    off.
    """

    def __init__(self, session: PuppetSession, client: Client, clock: Callable[[], float]) -> None:
        self.session = session
        self.client = client
        self.mouse = PoseControls(session)
        """One hand more."""
        self._clock = clock
        self._last = clock()
        self.message = ""
        """The last thing worth telling."""

    @property
    def hand(self) -> Floats | None:
        """(3,) where the mouse's hand is while it holds, world."""
        return self.mouse.hand

    def passed(self) -> float:
        """Seconds since this was asked."""
        now = self._clock()
        seconds, self._last = now - self._last, now
        return seconds

    @property
    def held(self) -> HandSpring | None:
        """What the mouse's hand holds."""
        return self.mouse.held

    @property
    def hover(self) -> int | None:
        """The limb that a device holds, or the first of several; else the one under the mouse."""
        raise NotImplementedError

    @property
    def holding(self) -> bool:
        """Whether a hand at a device holds a limb."""
        raise NotImplementedError

    def trouble(self) -> str:
        """What is wrong with the program at the devices; empty where it answers."""
        if self.client.state is ClientState.LOST:
            return phrase("has ended")
        return phrase("does not answer") if self.client.silent else ""

    def pin(self) -> None:
        """Pin what is held, or take the pin out."""
        held = self.hover
        self.message = "Hold a limb to pin it" if held is None else self.session.toggle_pin(held)

    def restore(self) -> None:
        """Back to the pose at the start; hands let go."""
        self.session.restore()

    def step_back(self) -> bool:
        """Back to before the last grab or restoring, hands let go; whether there was one."""
        return self.session.step_back()

    def step_forward(self) -> bool:
        """On to what the last step back has undone, hands let go; whether there was one."""
        return self.session.step_forward()

    def notices(self) -> list[Notice]:
        """What is to be shown to the user, each once."""
        notices, self.client.notices = self.client.notices, []
        return notices


class Calibrations:
    """The zero and range that devices have learned here: kept in a file, and handed to them."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.learned = load_calibrations()
        """By a device's identity."""
        self.sent: dict[int, str] = {}
        """Identities of devices whose calibration the bridge was told."""

    def reset(self, number: int) -> None:
        """Forget what was learned of a device.

        Raises:
            SettingsError: nothing was.
            WriteError: the file of calibrations cannot be written.
        """
        identity = self._client.devices[number].identity
        if identity not in self.learned:
            raise SettingsError("This device was not calibrated.", "It is as its maker says.")
        left = {name: each for name, each in self._all().items() if name != identity}
        save_calibrations(left)
        self.learned = left
        self._client.send(CalibrationMessage.of(number, NONE))

    def keep_learned(self) -> list[tuple[int, DeviceMessage]]:
        """Keep what devices have learned since the last time; which did."""
        client = self._client
        calibrated, client.calibrated = client.calibrated, {}
        present = [number for number in calibrated if number in client.devices]
        for number in present:
            self.keep(client.devices[number], calibrated[number].calibration())
        return [(number, client.devices[number]) for number in present]

    def keep(self, device: DeviceMessage, calibration: Calibration) -> None:
        """Keep what was learned of one device."""
        self.learned = {**self._all(), device.identity: calibration}
        try:
            save_calibrations(self.learned)
        except WriteError as error:
            # It holds for now all the same.
            self._client.notices.append(Notice(error.problem, error.remedy))

    def send(self) -> None:
        """Tell devices that came what was learned of them."""
        client = self._client
        present = {number: device.identity for number, device in client.devices.items()}
        for number, identity in present.items():
            if self.sent.get(number) != identity:
                # Also where none was learned: another device may have had its number.
                wanted = self.learned.get(identity, NONE)
                client.send(CalibrationMessage.of(number, wanted))
        self.sent = present

    def _all(self) -> dict[str, Calibration]:
        """Those known here, and what another Blender may have learned since they were read."""
        return {**self.learned, **load_calibrations()}


class DeviceHands(HandsBase):
    """Hands at devices: the bridge, started, simulates; the session steps no more by itself."""

    def __init__(
        self,
        session: PuppetSession,
        client: Client,
        settings: DeviceSettings,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        super().__init__(session, client, clock)
        self._asked: float | None = None
        self._settings: DeviceSettings | None = None
        self._spaces: dict[int, Workspace] = {}
        self.calibrations = Calibrations(client)
        session.core.share(client, WorldMessage.step)
        self._send(settings)

    def restart(self) -> None:
        """Start the bridge again, and tell it all that the one before it knew.

        Raises:
            DeviceError: it cannot be started; pose and keys are as they were.
        """
        self.client.restart()
        settings, self._settings = self._settings, None
        self.calibrations.sent = {}
        self._asked = None
        self.recentre()
        if settings is not None:
            self._send(settings)

    # --- What is there --------------------------------------------------------------------------

    @property
    def hover(self) -> int | None:
        held = (each.body for each in self.client.pointers.values() if each.body >= 0)
        return next(held, self.mouse.hover)

    @property
    def holding(self) -> bool:
        """Whether a hand at a device holds a limb."""
        return any(each.body >= 0 for each in self.client.pointers.values())

    def shown(self) -> list[ShownPointer]:
        return [self._shown(each) for each in self.client.pointers.values()]

    def _shown(self, pointer: PointerMessage) -> ShownPointer:
        device = self.client.devices.get(pointer.pointer)
        most = device.force if device else 0.0
        unit = self.session.unit
        return ShownPointer(
            pointer.pointer,
            np.array(pointer.position) / unit,
            np.array(pointer.coupled_position) / unit,
            pointer.body,
            float(np.linalg.norm(pointer.force)) / most if most > 0.0 else 0.0,
            device.name if device else "",
        )

    # --- What the artist does -------------------------------------------------------------------

    def grab(self) -> None:
        """Grab with the first device what is near, or let go."""
        number = min(self.client.pointers, default=None)
        if number is None:
            self.message = "No device is there"
            return
        held = self.client.pointers[number].body >= 0
        self.client.send(Grab(number, grab=not held))
        if not held:
            self._asked = time.monotonic()

    def recentre(self) -> None:
        """Bring all pointers to the middle of the view."""
        self._spaces.clear()

    def calibrate(self, number: int, order: Order) -> None:
        """Begin to learn a device's zero and range, use what was learned, or go on as before."""
        self.client.calibrate(number, order)
        name = self.client.devices[number].name
        self.message = phrase("Calibrating: {name}", name=name) if order is Order.BEGIN else ""

    def reset_calibration(self, number: int) -> None:
        """Forget what was learned of a device.

        Raises:
            SettingsError: nothing was.
            WriteError: the file of calibrations cannot be written.
        """
        self.calibrations.reset(number)
        self._fit(number, self.client.devices[number])
        self.message = "As its maker says"

    # --- Time -----------------------------------------------------------------------------------

    def tick(self, settings: DeviceSettings, room: ViewRoom | None = None) -> list[Button]:
        """Take over what the bridge says, pose the armature, and tell the bridge what changed.

        What the view says of where devices are is the room. Returns buttons that were pressed or
        let go.

        Raises:
            RigError: the armature is gone, changed or in edit mode.
        """
        core = self.session.core
        self._mirror()
        self.mouse.tick(self.passed())
        buttons, core.buttons = core.buttons, []
        if settings != self._settings:
            self._send(settings)
        for number, device in self.calibrations.keep_learned():
            self.message = phrase("Calibrated: {device}", device=device.name)
            self._fit(number, device)
        self.calibrations.send()
        if room is not None:
            self._place(room)
        if any(each.pressed and each.button == settings.grab_button for each in buttons):
            self._asked = time.monotonic()
        if self.holding:
            self._asked = None
            self.message = "" if self.message == NOTHING_NEAR else self.message
        elif self._asked is not None and time.monotonic() - self._asked > _ANSWER:
            self._asked = None
            self.message = NOTHING_NEAR
        return buttons

    def _mirror(self) -> None:
        """Where that is wanted, let the other side do as devices do."""
        session = self.session
        wanted = posing_settings(session.puppet.armature()).mirror and session.core.shared
        session.other_side.follow(
            {
                number: HeldByDevice(
                    each.body,
                    np.array(each.coupled_position),
                    HandSample(np.array(each.position), np.array(each.orientation)),
                    self._coupling(number, each.body),
                )
                for number, each in self.client.pointers.items()
                if wanted and each.body in session.puppet.own
            }
        )

    def _coupling(self, number: int, body: int) -> Coupling:
        """Of the spring with which a device holds a body."""
        figure, pose, space = self.session.figure, self.session.core.pose, self._spaces.get(number)
        which = bodies_with(figure, body)
        return coupling_for(
            part_of(figure, body),
            Pose(pose.positions[which], pose.orientations[which]),
            self.client.devices.get(number),
            space.scale if space else 1.0,
        )

    def _fit(self, number: int, device: DeviceMessage) -> None:
        """Lay the room of a device anew, whose own is another one now."""
        if device.kind == Kind.POSE:
            self._spaces.pop(number, None)

    def _send(self, settings: DeviceSettings) -> None:
        self._settings = settings
        self.client.send(settings)

    def _place(self, room: ViewRoom) -> None:
        """Tell devices where the view is; a hand that holds something stays where it is."""
        right, up, towards = room.axes.T
        turn = from_matrix(np.stack([right, -towards, up], axis=1))
        w, x, y, z = (float(each) for each in turn)
        unit = self.session.unit
        for number, device in self.client.devices.items():
            pointer = self.client.pointers.get(number)
            if pointer is not None and pointer.body >= 0:
                continue
            before = self._spaces.get(number)
            rate = device.kind == Kind.RATE
            middle = room.middle * unit
            if rate and before is not None:
                # A space mouse has its pointer where it was pushed to, whatever the view does.
                middle = np.array(before.origin)
            learned = self.calibrations.learned.get(device.identity)
            own = RATE_WIDTH if rate else max(learned.width, _NARROWEST) if learned else _WIDTH
            scale = room.width * unit / own
            a, b, c = (float(each) for each in middle)
            space = Workspace(number, (a, b, c), (w, x, y, z), scale)
            if before is None or not _near(before, space):
                self._spaces[number] = space
                self.client.send(space)

    def stop(self) -> None:
        self.client.stop()


def _near(first: Workspace, second: Workspace) -> bool:
    """Whether two rooms are so alike that nobody sees the difference."""
    far = max(abs(a - b) for a, b in zip(first.origin, second.origin, strict=True))
    off = max(abs(a - b) for a, b in zip(first.orientation, second.orientation, strict=True))
    return far < 1e-4 * second.scale and off < 1e-4 and abs(first.scale / second.scale - 1.0) < 1e-3


class NdofHands(HandsBase):
    """One pointer, moved by the events of a space mouse that Blender itself has, beside the mouse.

    The bridge needs no devices then: it only simulates.
    """

    def __init__(
        self,
        session: PuppetSession,
        clock: Callable[[], float] = time.perf_counter,
        mouse: PoseControls | None = None,
    ) -> None:
        """Of a session; the mouse may hold something already."""
        super().__init__(session, Client(), clock)
        self.mouse = mouse or self.mouse
        self.position: Floats | None = None
        """(3,) of the pointer, world; none before the first push."""
        self._spring: HandSpring | None = None
        self._turn = IDENTITY.copy()
        self._reach = 0.0

    @property
    def hover(self) -> int | None:
        held = self.session.still_held(self._spring)
        return self.mouse.hover if held is None else held.body

    @property
    def holding(self) -> bool:
        return self.session.still_held(self._spring) is not None

    def shown(self) -> list[ShownPointer]:
        if self.position is None:
            return []
        held = self.session.still_held(self._spring)
        if held is None:
            return [ShownPointer(0, self.position, self.position, -1, 0.0, NDOF_NAME)]
        point = self.session.held_point(held)
        assert point is not None
        pull = min(1.0, self.session.pull(held))
        return [ShownPointer(0, self.position, point, held.body, pull, NDOF_NAME)]

    def move(
        self,
        translation: Sequence[float],
        rotation: Sequence[float],
        seconds: float,
        room: ViewRoom,
        settings: DeviceSettings,
    ) -> None:
        """One event of Blender's: a push (3,) right, up, towards the user, and a turn (3,) about
        these.

        It is made for a camera: a turn is told as the scene then seems to turn, against the cap
        (GHOST_NDOFManagerUnix and libspnav's spnav_posrot_moveobj differ in all three signs). And
        it is multiplied by what the preferences say of flying. So many seconds have passed since
        the event before.
        """
        if self.position is None:
            self.position = room.middle.copy()
        seconds = min(max(seconds, 0.0), _LONGEST)
        push, turn = ndof_sensitivities()
        way = room.axes @ np.array(translation, dtype=np.float64) / push
        self.position = self.position + way * (settings.speed * seconds * room.width / RATE_WIDTH)
        swing = room.axes @ np.array(rotation, dtype=np.float64) / -turn
        more = from_rotation_vector(swing * settings.angular_speed * seconds)
        self._turn = multiply(more, self._turn)

    def grab(self) -> None:
        """Grab what is near, or let go."""
        if self.holding:
            self.session.release(self._spring)
            return
        if self.position is None:
            self.message = "Push the space mouse first"
            return
        point = self.position * self.session.unit
        body, gap = nearest_body(self.session.figure, self.session.core.pose, point)
        if gap > self._reach:
            self.message = NOTHING_NEAR
            return
        self.message = ""
        self._turn = IDENTITY.copy()
        self._spring = self.session.take(body, point)

    def recentre(self) -> None:
        """Bring the pointer to the middle of the view, with the next push."""
        self.position = None

    def tick(self, settings: DeviceSettings, room: ViewRoom | None = None) -> list[Button]:  # noqa: ARG002
        """Simulate what has passed, and pose the armature."""
        self._reach = settings.reach
        held = self.session.still_held(self._spring)
        if held is None or self.position is None:
            self.mouse.tick(self.passed())
        else:
            self.mouse.tick(self.passed(), {held: (self.position, self._turn)})
        return []

    def trouble(self) -> str:
        """Blender has the device, and goes on by itself."""
        return ""

    def stop(self) -> None:
        self.client.stop()
        self.session.core.release()
