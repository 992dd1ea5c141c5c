# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of Blender's own window, in which a simulated hand at a device poses a doll.

The hand moves in real time, so no two pictures are quite alike.
"""

from __future__ import annotations

from typing import Any, Final

import bpy
import contact_sheet
import numpy as np
import puppets
import stage
from mathutils import Euler
from screen import Screen, Steps, WindowError
from stage import Points
from window_scenes import Taking

from octo_motion.device.calibration import Phase, reached
from octo_motion.device.driver import Kind
from octo_motion.ui.posing.device_hands import DeviceHands
from octo_motion.ui.posing.device_pose import active_hands

_FRONT: Final = Euler((0.48 * np.pi, 0.0, 0.1)).to_quaternion()
_SIZE: Final = (640, 700)
_SCALE: Final = 0.4
"""Of the hand's way in the view: slow enough for a computer that draws without a graphics card."""
_LEFT: Final = 200
"""Pixels at the left of the picture: the hand moves about the middle of the viewport."""
_NEAR: Final = 0.06
"""m"""
_FAR: Final = 0.22
"""m"""
_TRIALS: Final = 20
_PACE: Final = 0.95
"""Simulated against real time: with less the panel warns."""


def four_moments() -> Taking:
    """Free, holding a thigh, bending the leg, and keyed."""
    screen = Screen(*_SIZE, header=True, left=_LEFT)
    yield from _start(screen)
    yield from screen.until(
        lambda: _keeps_pace() and _nearest().startswith("thigh"), "The simulated hand in time"
    )
    pictures = [screen.take_moment()]
    yield from _grab(screen, "thigh.R")
    pictures.append(screen.take_moment())
    start = _hand()
    yield from screen.until(
        lambda: bool(np.linalg.norm(_hand() - start) > _FAR), "A pull of the simulated hand"
    )
    pictures.append(screen.take_moment())
    yield from screen.press("K")
    yield from screen.until(lambda: _hands().message.startswith("Keyed"), "A key")
    yield from screen.drawn()
    pictures.append(screen.take_moment())
    yield from screen.press("ESC")
    return contact_sheet.joined([pictures[:2], pictures[2:]])


def calibrate() -> Taking:
    """The panel Device while it learns how far the hand goes."""
    screen = Screen(_SIZE[0])
    yield from _start(screen, present=("posing", "posing_device"))
    bpy.ops.octo_motion.device_calibrate(number=0, step="BEGIN")
    yield from screen.until(lambda: _ends_reached() >= 2, "The end of the simulated hand's way")
    yield from screen.until(_keeps_pace, "Enough time for the simulation")
    pixels = yield from screen.take_panels()
    bpy.ops.octo_motion.device_calibrate(number=0, step="CANCEL")
    yield from screen.press("ESC")
    return pixels


def _start(screen: Screen, present: tuple[str, ...] | None = None) -> Steps:
    """A doll of wood, and the simulated hand."""
    yield from screen.open(("posing", "posing_device"), present)
    doll: Any = puppets.make_doll()
    doll.select_set(state=True)
    doll.octo_motion.tool = "POSE"
    doll.octo_motion.posing.strength = 0.25
    points = stage.skin_points(doll, [1]).reshape(-1, 3)
    yield from screen.look(_FRONT, points, margin=0.08)
    manager: Any = bpy.context.window_manager
    manager.octo_motion_device.simulate = True
    manager.octo_motion_device.scale = _SCALE
    with screen.override():
        bpy.ops.octo_motion.pose_device("INVOKE_DEFAULT")
    yield from screen.until(
        lambda: bool(_hands().client.pointers) and _hands().client.times is not None,
        "The simulated hand",
    )


def _hands() -> DeviceHands:
    hands = active_hands()
    assert isinstance(hands, DeviceHands)
    return hands


def _hand() -> Points:
    """(3,) where the hand is, world."""
    return _hands().shown()[0].position


def _grab(screen: Screen, bone: str) -> Steps:
    """Take hold of a bone as the hand comes by."""
    for _ in range(_TRIALS):
        yield from screen.until(lambda: _nearest() == bone, f"The simulated hand near {bone}")
        yield from screen.press("G")
        yield from screen.until(lambda: _hands().holding, "What the simulated hand holds")
        if _held() == bone:
            # Nothing of trials that failed is to be read.
            _hands().message = ""
            return
        # Blender was slow, and the hand has gone by.
        for key in ("G", "R"):
            yield from screen.press(key)
        yield from screen.until(lambda: not _hands().holding, "An empty hand")
    raise WindowError(f"The simulated hand has missed {bone}: let this computer do nothing else.")


def _nearest() -> str:
    """The bone that the hand would take, if it is near enough to see that it takes it."""
    session = _hands().session
    ends, radii = session.capsules()
    way = ends[:, 1] - ends[:, 0]
    along = np.einsum("ij,ij->i", _hand() - ends[:, 0], way) / np.einsum("ij,ij->i", way, way)
    points = ends[:, 0] + np.clip(along, 0.0, 1.0)[:, None] * way
    distances = np.linalg.norm(_hand() - points, axis=1) - radii
    body = int(distances.argmin())
    return session.bone(body) if distances[body] < _NEAR else ""


def _held() -> str:
    return _hands().session.bone(_hands().shown()[0].body)


def _keeps_pace() -> bool:
    times = _hands().client.times
    return times is not None and times.pace > _PACE


def _ends_reached() -> int:
    learning = _hands().client.calibrating.get(0)
    if learning is None or learning.phase == Phase.REST:
        return 0
    return reached(learning.calibration(), Kind.POSE)[0]
