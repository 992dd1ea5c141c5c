# SPDX-License-Identifier: GPL-3.0-or-later
"""A space mouse that Blender itself has: its own events move the pointer, no bridge is needed.

The puppet is then simulated in Blender, as with the mouse.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from ...blender.versions import ndof_sensitivities
from ...core.posing.picking import nearest_body
from ...core.rotations import IDENTITY, Floats, from_rotation_vector, multiply
from ...device.ipc import Client
from ...device.messages import Button
from ...device.messages import Settings as DeviceSettings
from .device_hands import NOTHING_NEAR, RATE_WIDTH, HandsBase, Room, Shown
from .puppet_session import PuppetSession

NAME: Final = "Space mouse, through Blender"
GRAB_BUTTONS: Final = frozenset({"NDOF_BUTTON_MENU", "NDOF_BUTTON_1", "NDOF_BUTTON_V1"})
KEY_BUTTONS: Final = frozenset({"NDOF_BUTTON_FIT", "NDOF_BUTTON_2", "NDOF_BUTTON_V2"})
_LONGEST: Final = 0.1
"""s: a longer time between two events is a pause, not a long push."""


class NdofHands(HandsBase):
    """One pointer on a session's puppet, moved by Blender's events.

    Args:
        session: of posing.
        clock: seconds.
    """

    def __init__(
        self, session: PuppetSession, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(session, Client())
        self.position: Floats | None = None
        """(3,) of the pointer, world; none before the first push."""
        self._turn = IDENTITY.copy()
        self._reach = 0.0
        self._clock = clock
        self._last = clock()

    @property
    def hover(self) -> int | None:
        held = self.session.held
        return None if held is None else held.body

    def shown(self) -> list[Shown]:
        """The pointer."""
        if self.position is None:
            return []
        held, point = self.hover, self.session.held_point()
        body = -1 if held is None else held
        place = self.position if point is None else point
        return [Shown(0, self.position, place, body, min(1.0, self.session.pull()), NAME)]

    def move(
        self,
        translation: Sequence[float],
        rotation: Sequence[float],
        seconds: float,
        room: Room,
        settings: DeviceSettings,
    ) -> None:
        """One event of Blender's.

        It is made for a camera: a turn is told as the scene then seems to turn, against the cap
        (GHOST_NDOFManagerUnix and libspnav's spnav_posrot_moveobj differ in all three signs). And
        it is multiplied by what the preferences say of flying.

        Args:
            translation: (3,) push: right, up, towards the user.
            rotation: (3,) turn about these, against the cap's.
            seconds: since the event before.
            room: what the view shows.
            settings: how devices behave.
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
            self.session.release()
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
        self.session.grab(body, point)

    def recentre(self) -> None:
        """Bring the pointer to the middle of the view, with the next push."""
        self.position = None

    def tick(self, settings: DeviceSettings, room: Room | None = None) -> list[Button]:  # noqa: ARG002
        """Simulate what has passed, and pose the armature."""
        now = self._clock()
        seconds, self._last = now - self._last, now
        self._reach = settings.reach
        held = self.session.held
        if held is None or self.position is None:
            self.session.tick(seconds)
        else:
            self.session.tick(seconds, self.position, self._turn)
        return []

    def stop(self) -> None:
        """Let go."""
        self.session.core.release()
