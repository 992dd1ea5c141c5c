# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures and curves after [Plastic], Matsunaga and Hasegawa."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, Final

import bpy
import contact_sheet
import numpy as np
import plot
import stage
from stage import Pixels

from tests.papers import plastic as figures

_CELL: Final = (300, 280)


def element(folder: Path, *, quick: bool) -> Pixels:
    """Fig. 5: displacement, velocity and force over time, and a CSV of them in the folder."""
    times, *_ = figures.stepped(figures.STEP)
    closed = figures.closed_form(times)
    columns: dict[str, Any] = {
        "t, s": times,
        "F, N": figures.force(times),
        "x closed, m": closed[0],
        "v closed, m/s": closed[1],
    }
    curves: list[dict[str, Any]] = [{"closed": closed[0]}, {"closed": closed[1]}]
    for step in figures.STEPS:
        own, *played, _ = figures.stepped(step)
        for unit, values, kept in zip(("x", "v"), played, curves, strict=True):
            between = np.interp(times, own, values)
            columns[f"{unit} h={step:g}"] = between
            if step in {figures.STEP, figures.STEPS[-1]}:
                kept[f"h = {step:g} s"] = between
    with (folder / "element.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(
            zip(*(np.round(each, 6).tolist() for each in columns.values()), strict=True)
        )
    panels = [
        plot.Panel("fig. 5  displacement", "s", "m", times, curves[0]),
        plot.Panel("velocity", "s", "m/s", times, curves[1]),
        plot.Panel("force", "s", "N", times, {"F": figures.force(times)}),
    ]
    return plot.curves_pixels(panels, (90, 30) if quick else (1080, 300))


def puppet(folder: Path, *, quick: bool) -> Pixels:
    """A doll that is bent, twisted and pushed into a box, and what the hand feels of it."""
    cell = (30, 28) if quick else _CELL
    figure = figures.doll_in_blender()
    scene = stage.the_scene()
    stage.set_light(scene)
    box: Any = bpy.data.objects["Cube"]
    box.data.materials.append(stage.new_material("Box", (0.80, 0.45, 0.12)))
    stage.add_ground(stage.skin_points(figure, [1]), 0.0)
    camera = stage.add_camera("Camera", lens=60.0)
    stage.set_resolution(*cell)
    stage.look(camera, np.array([-0.5, 0.85, -0.15]), np.array([0.0, 0.0, 1.0]))
    stage.frame_points(camera, np.array([[-0.55, 0.0, 0.3], [0.85, -0.3, 1.85]]), margin=0.0)
    pictures: list[Pixels] = []
    found = {}
    for name, drag in figures.DRAGS.items():
        box.hide_render = name != "pushed into a box"

        def shown(*, note: str = name) -> None:
            bpy.context.view_layer.update()
            pictures.append(stage.render_pixels(*cell, note=note))

        found[name] = figures.dragged(figure, **drag, pulled=shown)
    with (folder / "puppet.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["drag", "share of the way", "force, N", "torque, N·m"])
        writer.writerows(
            [name, *np.round(row, 4).tolist()]
            for name, each in found.items()
            for row in each["rows"]
        )
    rows = {name: np.array([(0.0, 0.0, 0.0), *each["rows"]]) for name, each in found.items()}
    bent, twisted, pushed, free = rows.values()
    share = np.linspace(0.0, 1.0, 100)

    def over(drag: Any, part: int) -> Any:
        return np.interp(share, drag[:, 0], drag[:, part])

    panels = [
        plot.Panel("bent", "m", "N", 0.53 * share, {"force": over(bent, 1)}),
        plot.Panel("twisted", "°", "N·m", 60.0 * share, {"torque": over(twisted, 2)}),
        plot.Panel(
            "pushed",
            *("m", "N", 0.3 * share),
            {"into a box": over(pushed, 1), "no box": over(free, 1)},
        ),
    ]
    wide = 3 * cell[0] + 8
    curves = plot.curves_pixels(panels, (wide, wide // 4))
    return contact_sheet.stacked([contact_sheet.joined([pictures[:3]]), curves])
