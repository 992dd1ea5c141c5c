# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the pictures of the documentation anew, into docs/images."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import bpy
import contact_sheet
import experiment
import following
import grounds
import numpy as np
import plot
import puppet_curves
import puppet_things
import puppets
import reaching
import rigify_person
import setups
import shots
import stage
import weights
from mathutils import Vector
from stage import Pixels

import octo_motion
from octo_motion.core.locomotion.gait import table as gait

_WIDE: Final = (768, 432)
_CELL: Final = (264, 198)
_FAR_WALK: Final = replace(
    shots.WALK, route=((-1.2, 0.6, 0.0), (-0.5, -0.7, 0.0), (0.4, 0.8, 0.0), (1.3, 0.0, 0.0))
)
"""Far enough for several octopuses to stand side by side."""
_UP: Final = np.array([0.0, 0.0, 1.0])


def main() -> None:
    """Render all pictures, or those that are named."""
    parser = argparse.ArgumentParser(prog="make pictures", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(PICTURES)}; all if none is named")
    parser.add_argument("--folder", type=Path, default=Path("docs/images"), help="where they go")
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(PICTURES):
        parser.error(f"there is no picture '{unknown.pop()}'")
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # Blender tells of everything that it does; here only the pictures matter.
    told = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    octo_motion.register()
    try:
        for name in arguments.names or PICTURES:
            start = time.perf_counter()
            path = folder / f"{name}.png"
            stage.save_pixels(PICTURES[name](), path)
            if name == "setups":
                # Beside it, for the test that asks whether it is older than the list.
                path.with_suffix(".txt").write_text(setups.shown(), encoding="utf-8")
            size = path.stat().st_size // 1000
            seconds = time.perf_counter() - start
            print(f"{path}  {size} kB, {seconds:.0f} s", file=told, flush=True)
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()


def hero() -> Pixels:
    """The walking octopus from near, its route under it."""
    performance = shots.perform(shots.WALK, _WIDE)
    frame = performance.cycle(8)[5]
    points = stage.skin_points(performance.octopus, [frame])
    camera = stage.the_scene().camera
    assert camera is not None
    stage.look(camera, np.array([-0.55, 0.8, -0.3]), _UP)
    stage.frame_points(camera, points, margin=0.1)
    return stage.render_pixels(*_WIDE)


def cycle_of(shot: shots.Shot, view: contact_sheet.View) -> Callable[[], Pixels]:
    """Eight phases of a gait from one side."""
    return lambda: contact_sheet.cycle_pixels(shots.perform(shot, _WIDE), view, _CELL)


def along_route(shot: shots.Shot, times: int) -> Callable[[], Pixels]:
    """The octopus at several times at once, along its route."""

    def picture() -> Pixels:
        performance = shots.perform(shot, _WIDE)
        scene = stage.the_scene()
        for frame in np.linspace(scene.frame_start, scene.frame_end, times):
            stage.go_to(float(frame))
            stage.leave_copy(performance.octopus)
        for child in performance.octopus.children:
            child.hide_render = True
        return stage.render_pixels(*_WIDE)

    return picture


def rig() -> Pixels:
    """The skin from below, where the suckers are, and the bones from above."""
    size = (480, 400)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.octo_motion.add_octopus()
    octopus = bpy.context.object
    assert octopus is not None
    scene = stage.the_scene()
    stage.set_light(scene)
    camera = stage.add_camera("Camera", lens=60.0)
    points = stage.skin_points(octopus, [1])
    stage.set_resolution(*size)
    stage.look(camera, np.array([0.1, 0.45, 0.8]), _UP)
    stage.frame_points(camera, points)
    below = stage.render_pixels(*size, note="skin, from below")
    for child in octopus.children:
        child.hide_render = True
    stage.show_bones(octopus)
    stage.look(camera, np.array([-0.1, 0.75, -0.8]), _UP)
    stage.frame_points(camera, points)
    above = stage.render_pixels(*size, note="bones, from above")
    return contact_sheet.joined([[below, above]])


def body() -> Pixels:
    """Head and mantle through a stroke: carried by the arms alone, and moving by themselves."""
    moments = np.array([0.34, 0.42, 0.62, 0.85])
    rows: list[list[Pixels]] = []
    for amount in (0.0, 1.0):
        performance = shots.perform(shots.SWIM, _CELL, partial(_by_itself, amount))
        camera = stage.add_camera("Body")
        assert isinstance(camera.data, bpy.types.Camera)
        camera.data.ortho_scale = 0.62
        pictures: list[Pixels] = []
        for moment, frame in zip(moments, performance.at(moments), strict=True):
            stage.go_to(frame)
            octopus = performance.octopus
            assert octopus.pose is not None
            place = octopus.matrix_world @ octopus.pose.bones["head"].head
            # Its left side, seen a little from before.
            away = octopus.matrix_world.to_3x3() @ Vector((0.95, -0.3, 0.1))
            stage.look(camera, -np.array(away, dtype=np.float64), _UP)
            camera.location = place + 3.0 * away
            told = "by itself" if amount else "carried"
            note = f"{told}, {round(360.0 * moment)}°"
            pictures.append(stage.render_pixels(*_CELL, note=note))
        rows.append(pictures)
    return contact_sheet.joined(rows)


def _by_itself(amount: float, settings: Any) -> None:
    """Let a body do so much by itself."""
    settings.breathing = 0.05 * amount
    for name in ("surge", "mantle", "siphon", "eyes", "head"):
        setattr(settings.body, name, amount)


def gaits() -> Pixels:
    """Curves of the presets that the source has."""
    presets = gait.gait_presets()
    return plot.gait_pixels([presets["walk"], presets["swim"]], (1000, 600))


def puppet_plots() -> Pixels:
    """The plastic element under load, and the energy of an arm."""
    return puppet_curves.pixels((1000, 400))


def splices() -> Pixels:
    """The paper's experiment with clips of the project's own."""
    return experiment.sheet(experiment.find_clips(experiment.CLIPS))


PICTURES: Final[dict[str, Callable[[], Pixels]]] = {
    "hero": hero,
    "walk_side": cycle_of(shots.WALK, contact_sheet.SIDE),
    "walk_above": cycle_of(shots.WALK, contact_sheet.ABOVE),
    "swim_side": cycle_of(shots.SWIM, contact_sheet.SIDE),
    "swim_above": cycle_of(shots.SWIM, contact_sheet.ABOVE),
    "walk_route": along_route(_FAR_WALK, 4),
    "swim_route": along_route(shots.SWIM, 5),
    "ground": grounds.sheet,
    "setups": setups.gallery,
    "alive": setups.alive,
    "rig": rig,
    "body": body,
    "gaits": gaits,
    "weights": weights.strip,
    "reach": reaching.reach,
    "coil": reaching.coil,
    "hold": reaching.hold,
    "mouth": reaching.mouth,
    "pose_octopus": puppets.octopus,
    "pose_doll": puppets.doll,
    "pose_things": puppet_things.sheet,
    "pose_rigify": rigify_person.picture,
    "puppet_plots": puppet_plots,
    "splices": splices,
    "follow_braid": following.braid,
    "follow_swim": following.swim,
}
"""By file name."""

if __name__ == "__main__":
    main()
