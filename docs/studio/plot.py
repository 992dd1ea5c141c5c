# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves drawn by Blender: tubes, text and a flat light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import bpy
import numpy as np
import stage
from mathutils import Vector
from stage import Colour, Pixels

from octo_motion.core.locomotion.gait.table import GaitTable
from octo_motion.core.rotations import Floats

_LINKS: Final[tuple[tuple[str, Colour], ...]] = (
    ("link 1", (0.60, 0.09, 0.05)),
    ("link 2", (0.05, 0.28, 0.55)),
    ("link 3", (0.35, 0.42, 0.05)),
)
_INK: Final[Colour] = (0.03, 0.03, 0.035)
_FAINT: Final[Colour] = (0.62, 0.62, 0.62)
_PAPER: Final[Colour] = (1.0, 1.0, 1.0)
_WIDTH: Final = 1.6
_APART: Final = 2.2
"""From one plot's start to the next one's."""
_MOST: Final = 135.0
"""Degrees that reach to the upper edge."""


def gait_pixels(tables: Sequence[GaitTable], size: tuple[int, int]) -> Pixels:
    """Head angles of the links over the phase, one plot per gait, side by side.

    Args:
        tables: gaits whose pairs of arms share one curve.
        size: of the picture, in pixels.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    stage.set_flat_light(stage.the_scene(), _PAPER)
    for number, table in enumerate(tables):
        _plot(table, number * _APART)
    camera = stage.add_camera("Plot")
    assert isinstance(camera.data, bpy.types.Camera)
    left, right = -0.42, (len(tables) - 1) * _APART + _WIDTH + 0.12
    camera.data.ortho_scale = right - left
    camera.location = Vector((0.5 * (left + right), 0.0, 5.0))
    return stage.render_pixels(*size, finer=3)


def _plot(table: GaitTable, left: float) -> None:
    for degrees in (-120, -60, 0, 60, 120):
        y = degrees / _MOST
        line([(left, y), (left + _WIDTH, y)], _INK if degrees == 0 else _FAINT, 0.004)
        text(f"{degrees}°", left - 0.04, y, "RIGHT", _INK)
    for phase in (0, 90, 180, 270, 360):
        x = left + _WIDTH * phase / 360.0
        line([(x, -1.0), (x, 1.0)], _FAINT, 0.004)
        text(f"{phase}°", x, -1.09, "CENTER", _INK)
    text("phase", left + 0.5 * _WIDTH, -1.22, "CENTER", _INK)
    text("head", left - 0.04, 1.0, "RIGHT", _INK)
    text(table.name, left, 1.16, "LEFT", _INK, size=0.15)
    curve = table.curve(1)
    x = left + _WIDTH * curve.phases / (2.0 * np.pi)
    for link, (name, colour) in enumerate(_LINKS):
        y = np.degrees(curve.angles[:, link, 0]) / _MOST
        line(np.stack([x, y], axis=1).tolist(), colour, 0.014, height=0.1 * (link + 1))
        text(name, left + 0.6 + 0.35 * link, 1.16, "LEFT", colour, size=0.1)


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves over one axis, from 0."""

    title: str
    along: str
    """Unit of the axis to the right."""
    up: str
    """Unit of the axis upwards."""
    x: Floats
    """(samples,)"""
    curves: dict[str, Floats]
    """(samples,) by name."""


def curves_pixels(panels: Sequence[Panel], size: tuple[int, int]) -> Pixels:
    """Panels side by side, each with axes of its own."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    stage.set_flat_light(stage.the_scene(), _PAPER)
    for number, panel in enumerate(panels):
        _panel(panel, number * _APART)
    camera = stage.add_camera("Plot")
    assert isinstance(camera.data, bpy.types.Camera)
    left, right = -0.42, (len(panels) - 1) * _APART + _WIDTH + 0.12
    camera.data.ortho_scale = right - left
    camera.location = Vector((0.5 * (left + right), 0.5, 5.0))
    return stage.render_pixels(*size, finer=3)


def _panel(panel: Panel, left: float) -> None:
    longest = float(panel.x[-1])
    highest = max(float(curve.max()) for curve in panel.curves.values())
    lowest = min(0.0, *(float(curve.min()) for curve in panel.curves.values()))
    across, up = _round_step(longest), _round_step(highest - lowest)
    bottom, top = np.floor(lowest / up) * up, np.ceil(highest / up) * up
    for value in np.arange(bottom, top + 0.5 * up, up):
        y = float((value - bottom) / (top - bottom))
        line([(left, y), (left + _WIDTH, y)], _FAINT if abs(value) > 1e-9 else _INK, 0.004)
        text(f"{value + 0.0:.4g}", left - 0.04, y, "RIGHT", _INK)
    for value in np.arange(0.0, longest + 0.01 * across, across):
        x = left + _WIDTH * float(value) / longest
        line([(x, 0.0), (x, 1.0)], _FAINT if value else _INK, 0.004)
        text(f"{value:.4g}", x, -0.08, "CENTER", _INK)
    text(panel.along, left + 0.5 * _WIDTH, -0.2, "CENTER", _INK)
    text(panel.up, left - 0.04, 1.14, "RIGHT", _INK)
    text(panel.title, left, 1.14, "LEFT", _INK, size=0.12)
    kept = np.unique(np.linspace(0, len(panel.x) - 1, 250).astype(int))
    for number, (name, curve) in enumerate(panel.curves.items()):
        colour = _LINKS[number][1]
        x = left + _WIDTH * panel.x[kept] / longest
        line(
            np.stack([x, (curve[kept] - bottom) / (top - bottom)], axis=1).tolist(),
            colour,
            0.014,
            height=0.1 * (number + 1),
        )
        text(name, left + _WIDTH - 0.05, 0.93 - 0.12 * number, "RIGHT", colour)


def _round_step(most: float) -> float:
    """A step of 1, 2 or 5 times a power of ten, three to eight of which reach ``most``."""
    power = 10.0 ** np.floor(np.log10(most))
    steps = [power * factor for factor in (0.1, 0.2, 0.5, 1.0)]
    return float(next(step for step in steps if most / step <= 8.0))


def line(
    points: Sequence[Sequence[float]], colour: Colour, width: float, height: float = 0.0
) -> None:
    """A tube through points (x, y), so high above the paper."""
    data = bpy.data.curves.new("Line", "CURVE")
    data.dimensions = "3D"
    data.bevel_depth = 0.5 * width
    data.use_fill_caps = True
    # A spline for each piece: at a sharp corner Blender would squeeze the tube.
    for piece in pairwise(points):
        spline = data.splines.new("POLY")
        spline.points.add(1)
        for point, (x, y) in zip(spline.points, piece, strict=True):
            point.co = Vector((x, y, height, 1.0))
    _link(data, colour)


def text(
    body: str,
    x: float,
    y: float,
    align: str,
    colour: Colour,
    *,
    size: float = 0.1,
    over: float = 0.5,
) -> None:
    """A line of text, so high above the paper; ``align`` is LEFT, CENTER or RIGHT."""
    data = bpy.data.curves.new("Text", "FONT")
    assert isinstance(data, bpy.types.TextCurve)
    data.body, data.size = body, size
    data.align_x, data.align_y = align, "CENTER"
    _link(data, colour).location = Vector((x, y, over))


def _link(data: bpy.types.Curve, colour: Colour) -> bpy.types.Object:
    data.materials.append(stage.new_material("Ink", colour))
    item = bpy.data.objects.new(data.name, data)
    stage.the_scene().collection.objects.link(item)
    return item
