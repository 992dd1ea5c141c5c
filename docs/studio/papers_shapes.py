# SPDX-License-Identifier: GPL-3.0-or-later
"""A sheet of paper on which arms of spheres, lines and words lie: one rendering for all of it.

The paper's plane is x to the right and y up; what is drawn stands out of it along z.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import bmesh
import bpy
import numpy as np
import plot
import stage
from mathutils import Vector
from stage import Colour, Pixels, Points

INK: Final[Colour] = (0.03, 0.03, 0.035)
FAINT: Final[Colour] = (0.55, 0.55, 0.55)
RED: Final[Colour] = (0.60, 0.09, 0.05)
BLUE: Final[Colour] = (0.05, 0.28, 0.55)
GREEN: Final[Colour] = (0.20, 0.35, 0.03)
ORANGE: Final[Colour] = (0.86, 0.30, 0.03)
TEAL: Final[Colour] = (0.03, 0.42, 0.50)
GREY: Final[Colour] = (0.62, 0.62, 0.60)
GROUPS: Final = (RED, BLUE, GREEN)
"""Of an arm's three groups of joints, as the curves of the gaits have them."""
_PAPER: Final[Colour] = (1.0, 1.0, 1.0)


def begin() -> None:
    """An empty sheet."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = stage.the_scene()
    stage.set_light(scene)
    assert scene.display is not None
    assert scene.display.shading is not None
    assert scene.world is not None
    scene.world.color = _PAPER
    scene.display.shading.show_shadows = False


def end(x: tuple[float, float], y: tuple[float, float], width: int, *, quick: bool) -> Pixels:
    """The sheet from x[0] to x[1] and y[0] to y[1], so many pixels wide, a tenth if quick."""
    width = width // 10 if quick else width
    camera = stage.add_camera("Sheet")
    assert isinstance(camera.data, bpy.types.Camera)
    camera.data.clip_end = 1000.0
    camera.location = Vector((0.5 * sum(x), 0.5 * sum(y), 200.0))
    high = round(width * (y[1] - y[0]) / (x[1] - x[0]))
    # The greater side, whichever it is.
    camera.data.ortho_scale = max(x[1] - x[0], y[1] - y[0])
    return stage.render_pixels(width, high)


def side_view(points: Points) -> Points:
    """Points (…, 3) of the world, x outward and z up, on the paper."""
    return points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]


def spheres(
    places: Points,
    diameters: Points | float,
    colour: Colour,
    below: tuple[Colour, Points] | None = None,
) -> None:
    """Balls at places (balls, 3), perhaps with halves of another colour.

    Args:
        places: their middles, on the paper.
        diameters: (balls,) or of all.
        colour: of the balls.
        below: colour of the halves that face ways (balls, 3).
    """
    made = bmesh.new()
    bmesh.ops.create_icosphere(made, subdivisions=3, radius=0.5)
    ball = np.array([vertex.co[:] for vertex in made.verts])
    corners = np.array([[vertex.index for vertex in face.verts] for face in made.faces])
    made.free()
    count = len(places)
    sizes = np.broadcast_to(np.asarray(diameters, dtype=np.float64), (count,))
    points = places[:, None] + sizes[:, None, None] * ball
    faces = (np.arange(count)[:, None, None] * len(ball) + corners).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Balls")
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces.tolist())
    mesh.shade_smooth()
    mesh.materials.append(stage.new_material("Ball", colour, roughness=0.6))
    if below is not None:
        mesh.materials.append(stage.new_material("Half", below[0], roughness=0.6))
        middles = ball[corners].mean(axis=1)
        half = (np.einsum("fi,bi->bf", middles, below[1]) > 0.08).astype(np.int32)
        mesh.polygons.foreach_set("material_index", half.ravel())
    item = bpy.data.objects.new("Balls", mesh)
    stage.the_scene().collection.objects.link(item)


def line(
    points: Points | Sequence[Points], colour: Colour, width: float, over: float = 3.0
) -> None:
    """A line through points (…, 2 or 3), so high over the paper."""
    flat = np.asarray(points, dtype=np.float64)[:, :2]
    plot.line(flat.tolist(), colour, width, height=over)


def arrow(start: Points, end: Points, colour: Colour, width: float, over: float = 3.0) -> None:
    """A line with a head at its end."""
    start, end = np.asarray(start)[:2], np.asarray(end)[:2]
    way = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    aside = np.array([-way[1], way[0]])
    barbs = [end - 5.0 * width * way + side * 2.5 * width * aside for side in (1.0, -1.0)]
    line([start, end], colour, width, over)
    line([barbs[0], end, barbs[1]], colour, width, over)


def arc(  # noqa: PLR0917
    centre: Points, start: Points, end: Points, radius: float, colour: Colour, width: float
) -> None:
    """The angle at a centre from one place to another, the shorter way round."""
    first, last = (np.arctan2(each[1] - centre[1], each[0] - centre[0]) for each in (start, end))
    turn = (last - first + np.pi) % (2.0 * np.pi) - np.pi
    bow = first + turn * np.linspace(0.0, 1.0, 24)
    line(
        np.asarray(centre)[:2] + radius * np.stack([np.cos(bow), np.sin(bow)], axis=1),
        colour,
        width,
        over=4.0,
    )


def text(  # noqa: PLR0917
    body: str, x: float, y: float, size: float, colour: Colour = INK, align: str = "CENTER"
) -> None:
    """Words."""
    plot.text(body, x, y, align, colour, size=size, over=6.0)
