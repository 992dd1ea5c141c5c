# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the viewport while a puppet is posed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import bpy
import numpy as np

from ...core.posing.puppet import capsules_in_world
from ...core.posing.wireframe import arrow_lines, capsule_lines, load_colours, pin_lines
from ...core.rotations import Floats
from ..overlay_lines import Lines, draw_lines
from .controls import PoseControls
from .device_hands import DeviceHands, NdofHands
from .properties import posing_settings
from .puppet_session import PuppetSession

_HOVERED: Final = (1.0, 1.0, 1.0, 0.9)
_HELD: Final = (1.0, 0.6, 0.1, 1.0)
_PIN: Final = (0.2, 0.9, 0.9, 1.0)
_ARROW: Final = (1.0, 0.45, 0.05, 1.0)
_ALPHA: Final = 0.55
_FREE: Final = (0.6, 0.9, 1.0, 1.0)
_HOLDING: Final = (1.0, 0.6, 0.1, 1.0)
_STRONG: Final = (1.0, 0.1, 0.1, 1.0)
_EARLIER: Final = (0.25, 0.45, 0.95, 0.35)
_LATER: Final = (0.25, 0.85, 0.35, 0.35)
_STANDS: Final = (0.3, 0.95, 0.35, 1.0)
_FALLS: Final = (1.0, 0.25, 0.15, 1.0)
_POINTER: Final = 0.03
"""Of the figure."""


def overlay_lines(
    controls: PoseControls | DeviceHands | NdofHands, eye: Floats, *, loads: bool = True
) -> Lines:
    """All lines of a session, in the world, seen from a direction (3,) towards the eye.

    With ``loads`` all limbs are shown, by what they bear.
    """
    session = controls.session
    ends, radii = session.capsules()
    lines = capsule_lines(ends, radii)
    found: Lines = []
    if loads:
        colours = np.concatenate(
            [load_colours(session.loads()), np.full((len(radii), 1), _ALPHA)], axis=1
        )
        each = np.repeat(colours, 2 * lines.shape[1], axis=0)
        found.append((lines.reshape(-1, 3), each, 1.0))
    held = controls.held
    if held is not None:
        found.append(_one_colour(lines[held.body], _HELD, 2.0))
        point = session.held_point(held)
        if point is not None and controls.hand is not None:
            found.append(_one_colour(arrow_lines(point, controls.hand, eye), _ARROW, 3.0))
    elif controls.hover is not None:
        found.append(_one_colour(lines[controls.hover], _HOVERED, 2.0))
    pins = session.pins()
    if pins:
        size = 0.012 * session.size
        joints = session.core.pose.positions[pins] / session.unit
        found.append(_one_colour(pin_lines(joints, size), _PIN, 2.0))
    return found + _aid_lines(session)


def _aid_lines(session: PuppetSession) -> Lines:
    """Onion skins, arcs and balance, as far as they are wanted."""
    found: Lines = []
    wanted, unit, own = session.settings, session.unit, session.puppet.own
    frame = session.scene().frame_current_final
    for later, pose in session.traces.ghosts(frame, wanted.onion, wanted.onion_step):
        ends = capsules_in_world(session.figure, pose)[own.start : own.stop] / unit
        radii = session.figure.radii[own.start : own.stop] / unit
        found.append(_one_colour(capsule_lines(ends, radii), _LATER if later else _EARLIER, 1.0))
    if wanted.trails:
        for way, colour in ((session.traces.hand, _ARROW), (session.traces.tip, _HOVERED)):
            if len(way) > 1:
                found.append(_one_colour(np.stack([way[:-1], way[1:]], axis=1), colour, 2.0))
    if wanted.balance != "OFF":
        balance = session.balance()
        centre, outline = balance.centre / unit, balance.outline / unit
        colour = _STANDS if balance.room > 0.0 else _FALLS
        size = 0.02 * session.size
        cross = np.stack([centre - size * np.eye(3), centre + size * np.eye(3)], axis=1)
        found.append(_one_colour(cross, colour, 3.0))
        if len(outline):
            around = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
            foot = np.array([*centre[:2], outline[0, 2]])
            found.append(_one_colour(around, colour, 2.0))
            found.append(_one_colour(np.stack([centre, foot])[None], colour, 1.0))
    return found


def _one_colour(lines: Floats, colour: tuple[float, ...], width: float) -> Any:
    points = lines.reshape(-1, 3)
    return points, np.tile(np.array(colour), (len(points), 1)), width


_shown: list[Overlay] = []


def take_down_all() -> None:
    """Leave no drawing behind."""
    for each in _shown:
        each.take_down()


class Overlay:
    """The drawing of one session, in all 3D viewports, until it is taken down.

    Controls are those of the session; a device's have the same attributes.
    """

    def __init__(self, controls: Any, lines: Callable[..., Lines] = overlay_lines) -> None:
        self._controls = controls
        self._lines = lines
        self._handle: Any = bpy.types.SpaceView3D.draw_handler_add(
            self._draw, (), "WINDOW", "POST_VIEW"
        )
        _shown.append(self)

    def take_down(self) -> None:
        """Draw no more; safe to call twice."""
        handle, self._handle = self._handle, None
        if handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
            _shown.remove(self)

    def _draw(self) -> None:
        context: Any = bpy.context
        session = self._controls.session
        armature = bpy.data.objects.get((session.puppet.name, None))
        if armature is None or context.region_data is None:
            return
        settings: Any = posing_settings(armature)
        eye = np.array(context.region_data.view_matrix.inverted(), dtype=np.float64)[:3, 2]
        draw_lines(self._lines(self._controls, eye, loads=settings.show_loads))


def device_lines(hands: DeviceHands | NdofHands, eye: Floats, *, loads: bool = True) -> Lines:
    """All lines of a session with devices, in the world; as ``overlay_lines``."""
    found = overlay_lines(hands, eye, loads=loads)
    size = _POINTER * hands.session.size
    for each in hands.shown():
        cross = np.stack([each.position - size * np.eye(3), each.position + size * np.eye(3)], 1)
        colour = _FREE if each.body < 0 else _HOLDING
        found.append(_one_colour(cross, colour, 2.0))
        if each.body >= 0:
            spring = np.stack([each.coupled, each.position])
            mixed = np.array(_HOLDING) + min(1.0, each.force) * np.subtract(_STRONG, _HOLDING)
            found.append(_one_colour(spring, tuple(mixed), 3.0))
    return found
