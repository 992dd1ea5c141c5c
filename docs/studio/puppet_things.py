# SPDX-License-Identifier: GPL-3.0-or-later
"""A wooden doll among things that it pushes about, and what its hand feels of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import bpy
import contact_sheet
import numpy as np
import plot
import puppets
import stage
from stage import Colour, Pixels, Points

from octo_motion.ui.posing.puppet_session import PuppetSession

_CELL: Final = (330, 290)
_TICK: Final = 1.0 / 60.0
_SHOVE: Final = (0.5, 0.0, 0.0)
_COLOURS: Final[tuple[Colour, ...]] = ((0.80, 0.45, 0.12), (0.16, 0.42, 0.55), (0.60, 0.16, 0.12))


def sheet() -> Pixels:
    """Before, while a hand shoves a stack of boxes, and after; the force below."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    figure: Any = puppets.make_doll()
    figure.octo_motion.posing.material = "DOLL"
    figure.octo_motion.posing.floor = True
    figure.show_in_front = False
    things = [_box((0.66, -0.28, 0.15 + 0.301 * n), 0.3, _COLOURS[n]) for n in range(3)]
    things.append(_ball((0.66, -0.28, 1.005), 0.1))
    bpy.context.view_layer.objects.active = figure
    scene = stage.the_scene()
    stage.set_light(scene)
    stage.add_ground(stage.skin_points(figure, [1]), 0.0)
    camera = stage.add_camera("Camera", lens=60.0)
    stage.set_resolution(*_CELL)
    stage.look(camera, np.array([-0.45, 0.85, -0.22]), np.array([0.0, 0.0, 1.0]))
    corners = np.array([(x, y, z) for x in (-0.5, 1.3) for y in (-0.5, 0.2) for z in (0.0, 1.75)])
    stage.frame_points(camera, corners, margin=0.0)
    pictures = [_taken("before")]
    session = PuppetSession(figure, scene, clock=None)
    lead = _drag(session, "hand.L", (-0.12, -0.26, 0.06), 0.8)
    rows = []
    for number in _drag_on(session, lead, _SHOVE, 1.6):
        pose = session.core.pose.positions / session.unit
        felt = 0.0 if session.held is None else float(np.linalg.norm(session.held.wrench[:3]))
        places = [pose[session.body(each.name)] for each in things]
        rows.append((number / round(1.6 / _TICK), felt, places[2][2], places[3][2]))
        if number == 60:
            pictures.append(_taken("shoved"))
    session.release()
    for _ in range(90):
        session.tick(_TICK)
    pictures.append(_taken("let go"))
    session.finish()
    wide = 3 * _CELL[0] + 8
    way, force, top, ball = np.array(rows).T
    way = way * float(np.linalg.norm(_SHOVE))
    panels = [
        plot.Panel("the hand's pull", "m", "N", way, {"force": force}),
        plot.Panel("heights", "m", "m", way, {"top box": top, "ball": ball}),
    ]
    curves = plot.curves_pixels(panels, (wide, wide // 4))
    return contact_sheet.stacked([contact_sheet.joined([pictures]), curves])


def _drag(session: PuppetSession, bone: str, by: Sequence[float], seconds: float) -> Points:
    """Take hold of the end of a limb and lead it a way; where the hand is then."""
    start = session.grab_bone(bone, 1.0)
    for _ in _drag_on(session, start, by, seconds):
        pass
    return start + np.array(by)


def _drag_on(session: PuppetSession, start: Points, by: Sequence[float], seconds: float) -> Any:
    count = round(seconds / _TICK)
    for number in range(1, count + 1):
        session.tick(_TICK, start + number / count * np.array(by))
        yield number


def _taken(note: str) -> Pixels:
    bpy.context.view_layer.update()
    return stage.render_pixels(*_CELL, note=note)


def _box(at: tuple[float, float, float], size: float, colour: Colour) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=size, location=at)
    return _loose("BOX", 3.0, colour)


def _ball(at: tuple[float, float, float], radius: float) -> Any:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=at)
    return _loose("SPHERE", 1.0, _COLOURS[2])


def _loose(shape: str, mass: float, colour: Colour) -> Any:
    made: Any = bpy.context.object
    made.octo_motion.posing.obstacle = shape
    made.octo_motion.posing.moves = "MOVES"
    made.octo_motion.posing.mass = mass
    made.data.materials.append(stage.new_material(shape, colour))
    return made
