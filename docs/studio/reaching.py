# SPDX-License-Identifier: GPL-3.0-or-later
"""An octopus that reaches for things and holds them, in pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import bpy
import contact_sheet
import numpy as np
import shots
import stage
from stage import Pixels, Points

_UP: Final = np.array([0.0, 0.0, 1.0])
_CELL: Final = (300, 230)
_CLOSE: Final = (440, 330)
_GLASS: Final = (0.1, 0.35, 0.16)
_BLUE: Final = (0.1, 0.3, 0.6)
_AROUND: Final = 48
_START, _CONTACT, _COIL, _RELEASE, _BACK = 1, 34, 24, 100, 40


@dataclass(frozen=True)
class View:
    """Where the camera looks, and how much of the surroundings it sees."""

    forward: tuple[float, float, float]
    around: float = 0.0
    """Metres about the thing; 0 for all of the octopus."""


_WIDE: Final = View((-0.5, 0.8, -0.35))


def reach() -> Pixels:
    """An arm reaches for a bottle: the bend runs along it, and it winds about the bottle."""
    octopus = _octopus()
    thing = _bottle((0.2, -0.4, 0.0))
    _reach(octopus, thing)
    return _sheet(octopus, thing, (6, 14, 20, 25, 29, 34, 44, 58), _WIDE)


def coil() -> Pixels:
    """Close-ups: about a rod, and about a ball."""
    octopus = _octopus()
    thing = _turned("Rod", [(0.0, -0.5), (0.02, -0.5), (0.02, 0.5), (0.0, 0.5)], _GLASS)
    thing.location, thing.rotation_euler = (0.0, -0.36, 0.2), (0.0, 0.5 * math.pi, 0.0)
    for arm in ("Arm 1 L", "Arm 1 R"):
        _reach(octopus, thing, arm=arm, turns=3.0)
    view = View((-0.3, 0.8, -0.4), around=0.2)
    rods = _sheet(octopus, thing, (38, 60), view, middle=(0.0, -0.36, 0.16))
    octopus = _octopus()
    steps = np.linspace(0.0, math.pi, 33)
    outline = [(0.09 * math.sin(each), -0.09 * math.cos(each)) for each in steps]
    thing = _turned("Ball", outline, _BLUE)
    thing.location = (0.15, -0.33, 0.09)
    _reach(octopus, thing)
    balls = _sheet(octopus, thing, (38, 60), View((-0.4, 0.85, -0.4), around=0.17))
    return contact_sheet.stacked([rods, balls])


def mouth() -> Pixels:
    """An arm brings a ball to the mouth, and those beside it close over it."""
    octopus = _octopus()
    steps = np.linspace(0.0, math.pi, 33)
    outline = [(0.035 * math.sin(each), -0.035 * math.cos(each)) for each in steps]
    thing = _turned("Prey", outline, _BLUE)
    thing.location = (0.2, -0.33, 0.035)
    _reach(octopus, thing)
    item = octopus.octo_motion.locomotion.reaches[0]
    item.mode, item.frame_release = "MOUTH", 125
    octopus.octo_motion.locomotion.frame_end = 170
    view = View((-0.45, 0.85, -0.12))
    return _sheet(octopus, thing, (14, 26, 58, 72, 78, 82, 86, 98), view)


def hold() -> Pixels:
    """An arm holds on to a bottle while the body walks by."""
    octopus = _octopus(in_place=False)
    bpy.ops.octo_motion.add_route(
        b0=(0.0, 0.0, 0.0), b1=(0.0, -0.15, 0.0), b2=(0.0, -0.3, 0.0), b3=(0.0, -0.45, 0.0)
    )
    thing = _bottle((0.38, -0.42, 0.0))
    _reach(octopus, thing)
    view = View((-0.6, 0.75, -0.45))
    return _sheet(octopus, thing, (10, 30, 44, 64, 80, 98, 112, 134), view)


def _octopus(*, in_place: bool = True) -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    stage.the_scene().render.fps = shots.RATE
    bpy.ops.octo_motion.add_octopus()
    octopus: Any = bpy.context.object
    octopus.show_in_front = False
    bpy.ops.octo_motion.detect_arms()
    settings = octopus.octo_motion.locomotion
    if in_place:
        settings.travel_on, settings.gait, settings.repeat = "NONE", "idle", False
    settings.timing, settings.frame_end = "RANGE", 145
    return octopus


def _reach(octopus: Any, thing: Any, *, arm: str = "", turns: float = 2.0) -> None:
    item = octopus.octo_motion.locomotion.reaches.add()
    item.name, item.target, item.arm, item.turns = f"{thing.name} {arm}", thing, arm, turns
    item.frame_start, item.frame_contact, item.coil_frames = _START, _CONTACT, _COIL
    item.frame_release, item.back_frames = _RELEASE, _BACK


def _sheet(
    octopus: Any,
    thing: Any,
    frames: Sequence[int],
    view: View,
    middle: tuple[float, float, float] | None = None,
) -> Pixels:
    bpy.context.view_layer.objects.active = octopus
    bpy.ops.octo_motion.generate_locomotion()
    scene = stage.the_scene()
    stage.set_light(scene)
    seen: Points = stage.skin_points(octopus, frames)
    stage.add_ground(seen, 0.0)
    camera = stage.add_camera("Camera", lens=50.0)
    stage.look(camera, np.array(view.forward), _UP)
    size = _CELL if view.around == 0.0 else _CLOSE
    stage.set_resolution(*size)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    if view.around:
        centre = np.array(thing.location if middle is None else middle)
        seen = centre + view.around * corners
    stage.frame_points(camera, seen, margin=0.02)
    pictures = []
    for frame in frames:
        stage.go_to(frame)
        pictures.append(stage.render_pixels(*size, note=f"frame {frame}"))
    columns = 4 if view.around == 0.0 else 2
    rows = [pictures[at : at + columns] for at in range(0, len(pictures), columns)]
    return contact_sheet.joined(rows)


def _bottle(place: tuple[float, float, float]) -> Any:
    radius, height = 0.04, 0.3
    outline = [
        *((0.0, 0.0), (radius, 0.0), (radius, 0.6 * height), (0.9 * radius, 0.68 * height)),
        *((0.4 * radius, 0.8 * height), (0.35 * radius, height), (0.0, height)),
    ]
    thing = _turned("Bottle", outline, _GLASS)
    thing.location = place
    return thing


def _turned(name: str, outline: Sequence[tuple[float, float]], colour: stage.Colour) -> Any:
    """A solid turned about z from (radius, height) pairs, from its bottom to its top."""
    angles = np.linspace(0.0, 2.0 * math.pi, _AROUND, endpoint=False)
    rows = [
        np.stack([r * np.cos(angles), r * np.sin(angles), np.full(_AROUND, z)], axis=1)
        for r, z in outline
    ]
    lower = np.arange(_AROUND)
    upper = np.roll(lower, -1)
    faces = [
        np.stack([lower, upper, upper + _AROUND, lower + _AROUND], axis=1) + _AROUND * row
        for row in range(len(outline) - 1)
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.concatenate(rows).tolist(), [], np.concatenate(faces).tolist())
    mesh.shade_smooth()
    mesh.materials.append(stage.new_material(name, colour, roughness=0.2))
    thing = bpy.data.objects.new(name, mesh)
    stage.the_scene().collection.objects.link(thing)
    return thing
