# SPDX-License-Identifier: GPL-3.0-or-later
"""Show every set-up that comes with the add-on: a sheet, a video and a picture for its button.

Those that go over the ground go over bumps of 0.3 arm lengths.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any, Final, TextIO

import bpy
import contact_sheet
import film
import numpy as np
import shots
import stage
from mathutils import Vector
from stage import Pixels, Points

import octo_motion
from octo_motion.ui.locomotion.operators import setups as ours

BUMPS: Final = 0.3
"""Height of the bumps from valley to top, in arm lengths."""
_WAVES: Final = (1.4, 1.2)
"""Arm lengths from one bump to the next along X and Y."""
_FINE: Final = 0.04
"""Arm lengths between the points of the ground."""
_ROUTE: Final = ((-1.1, 0.35, 0.0), (-0.4, -0.45, 0.0), (0.3, 0.5, 0.0), (1.1, 0.0, 0.0))
_RISING: Final = ((-3.6, 0.6, 0.9), (-1.2, -1.5, 0.6), (0.9, 1.8, 1.8), (3.6, 0.3, 2.0))
_LENGTH: Final = 0.58
"""Metres that an arm of the add-on's octopus is long: what the routes are made for."""
_THUMBNAIL: Final = 160
_OBLIQUE: Final = contact_sheet.View("above the side", np.radians(22.0))
_CELL: Final = (180, 135)
_STRIP: Final = 4
"""Pictures of a cycle beside each other."""
_IMPORTERS: Final = {
    ".blend": lambda path: bpy.ops.wm.open_mainfile(filepath=path),
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".fbx": lambda path: bpy.ops.import_scene.fbx(filepath=path),
}
_BY_ITSELF: Final = ("surge", "mantle", "siphon", "eyes", "head")
"""Settings of what a body does without being asked."""
_PHASES: Final = 3
"""Pictures of a body before, and as many after, beside each other."""
_BACKGROUND: Final = (0.06, 0.06, 0.065)


def main() -> None:
    """Make what is asked for."""
    names = list(ours.ORDER)
    parser = argparse.ArgumentParser(prog="make setups", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(names)}; all if none is named")
    parser.add_argument("--folder", type=Path, default=Path("build/setups"), help="where they go")
    parser.add_argument("--film", action="store_true", help="videos as well")
    parser.add_argument(
        "--before",
        action="store_true",
        help="also with a body that does nothing by itself: no web, arms even",
    )
    parser.add_argument(
        "--rig", type=Path, help="a .blend, .glb or .fbx file with another creature"
    )
    parser.add_argument("--armature", default="", help="which of its armatures, if it has several")
    parser.add_argument(
        "--thumbnails", action="store_true", help="only the pictures of the buttons, in their place"
    )
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(names):
        parser.error(f"there is no set-up '{unknown.pop()}'")
    rig: Path | None = arguments.rig
    if rig is not None and not rig.is_file():
        parser.error(f"there is no file '{rig}'")
    if rig is not None and rig.suffix.lower() not in _IMPORTERS:
        parser.error(f"'{rig.name}' is no {', '.join(_IMPORTERS)} file")
    if arguments.armature and rig is None:
        parser.error("--armature needs --rig: the octopus of the add-on has one armature")
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # Blender tells of everything that it does; here only the pictures matter.
    told = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    octo_motion.register()
    try:
        wanted = [(name, True) for name in arguments.names or names]
        if arguments.before:
            wanted = [(name, alive) for name, _ in wanted for alive in (False, True)]
        for name, alive in wanted:
            start = time.perf_counter()
            performance = perform(name, rig, arguments.armature, alive=alive)
            if arguments.thumbnails:
                path = ours.setup_paths()[name].with_suffix(".png")
                stage.save_pixels(_thumbnail(performance), path)
            else:
                path = folder / (f"{name}.png" if alive else f"{name}_before.png")
                stage.save_pixels(_sheet(performance), path)
            _tell(told, path, start)
            if arguments.film and not arguments.thumbnails:
                start = time.perf_counter()
                path = path.with_suffix(".mp4")
                film.render_film(path, (640, 360))
                _tell(told, path, start)
    except RuntimeError as error:
        # What operators of Blender and of the add-on report.
        sys.exit(f"make setups: error: {str(error).removeprefix('Error: ').strip()}")
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()


def _tell(told: TextIO, path: Path, start: float) -> None:
    """Say what was made, and how long it took."""
    print(f"{path}  {time.perf_counter() - start:.0f} s", file=told, flush=True)


def perform(
    name: str, rig: Path | None = None, armature: str = "", *, alive: bool = True
) -> shots.Performance:
    """Start from an empty file: an octopus that moves as the set-up says.

    Args:
        name: of the set-up.
        rig: a file with another creature, none for the octopus of the add-on.
        armature: its name, if the file has several.
        alive: the body does something by itself, and arms are uneven; an octopus has a web.

    Raises:
        RuntimeError: the file has no such creature, or it cannot move so.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if rig is None:
        bpy.ops.octo_motion.add_octopus(web=alive)
        octopus = bpy.context.object
    else:
        octopus = _load(rig, armature)
    assert octopus is not None
    scene = stage.the_scene()
    scene.render.fps = shots.RATE
    bpy.ops.octo_motion.detect_arms()
    settings = octopus.octo_motion.locomotion
    bpy.ops.octo_motion.setup_load(name=name)
    if not alive:
        _still(settings)
    swims = settings.table.manner == "SWIM"
    unit = _arm_length(octopus)
    route = np.array(_RISING if swims else _ROUTE) * (unit / _LENGTH)
    bpy.ops.octo_motion.add_route(**dict(zip(("b0", "b1", "b2", "b3"), route, strict=True)))
    scene.frame_end = 1
    stays = settings.travel_on == "NONE"
    level = not swims and not stays and not settings.ground.use
    if not swims and not stays and not level:
        settings.ground.object = add_bumps(route, unit)
    bpy.ops.octo_motion.generate_locomotion()
    octopus.show_in_front = False
    points = stage.skin_points(octopus, range(scene.frame_start, scene.frame_end + 1, 4))
    stage.set_light(scene)
    if swims:
        stage.add_ground(points, float(points[..., 2].min()) - 0.4 * unit)
    if level:
        stage.add_ground(points, float(points[..., 2].min()))
    if stays:
        stage.add_ground(points, _floor(octopus, points))
    camera = stage.add_camera("Camera", lens=50.0)
    stage.look(camera, np.array((-0.35, 0.9, -0.45)), np.array([0.0, 0.0, 1.0]))
    stage.set_resolution(640, 360)
    stage.frame_points(camera, points)
    scene.frame_set(scene.frame_start)
    shot = shots.Shot(settings.gait, (), (-0.35, 0.9, -0.45), None)
    return shots.Performance(shot, octopus, settings.route, points)


def _still(settings: Any) -> None:
    """Leave the body to the arms that carry it, and all arms and cycles alike."""
    settings.breathing = settings.uneven = 0.0
    for name in _BY_ITSELF:
        setattr(settings.body, name, 0.0)


def _load(path: Path, name: str) -> bpy.types.Object:
    """Open or import a creature, and make it the active object."""
    _IMPORTERS[path.suffix.lower()](str(path))
    found = {each.name: each for each in bpy.data.objects if each.type == "ARMATURE"}
    if not found:
        raise RuntimeError(f"'{path.name}' has no armature.")
    if name and name not in found:
        known = ", ".join(f"'{each}'" for each in found)
        raise RuntimeError(f"'{path.name}' has no armature '{name}', but {known}.")
    creature = found[name] if name else next(iter(found.values()))
    view_layer = bpy.context.view_layer
    assert view_layer is not None
    view_layer.objects.active = creature
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for each in bpy.data.objects:
        # Lights, cameras and floors of the file are not part of the creature.
        own = each == creature or each.find_armature() == creature or each.type == "EMPTY"
        each.hide_render = not own
    return creature


def _floor(octopus: bpy.types.Object, points: Points) -> float:
    """Height of the ground under a creature that stays.

    A root bone lifts it to its height over its origin; without one the ground is where it reaches.
    """
    if octopus.octo_motion.locomotion.root_bone:
        return float(octopus.matrix_world.translation.z)
    return float(points[..., 2].min())


def _arm_length(octopus: bpy.types.Object) -> float:
    """Metres that an arm is long."""
    assert isinstance(octopus.data, bpy.types.Armature)
    arm = octopus.octo_motion.locomotion.arms[0]
    scale = octopus.matrix_world.to_scale()[0]
    return float(scale * sum(octopus.data.bones[bone.name].length for bone in arm.bones))


def add_bumps(points: Points, unit: float, height: float = BUMPS) -> bpy.types.Object:
    """A tiled ground of gentle bumps under points (…, 3); lengths in arm lengths.

    Args:
        points: what it reaches beneath.
        unit: metres that an arm is long.
        height: of the bumps.
    """
    flat = points.reshape(-1, 3)[:, :2]
    low, high = flat.min(axis=0) - 3.0 * unit, flat.max(axis=0) + 3.0 * unit
    x, y = (np.arange(a, b, _FINE * unit) for a, b in zip(low, high, strict=True))
    across, along = np.meshgrid(x, y, indexing="ij")
    turns = 2.0 * np.pi / unit
    waves = np.sin(turns * across / _WAVES[0]) * np.cos(turns * along / _WAVES[1])
    vertices = np.stack([across, along, 0.5 * height * unit * waves], axis=-1).reshape(-1, 3)
    corner = np.arange(len(vertices)).reshape(across.shape)
    faces = np.stack(
        [corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1
    ).reshape(-1, 4)
    mesh = bpy.data.meshes.new("Bumps")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    for colour in ((0.50, 0.43, 0.31), (0.44, 0.375, 0.27)):
        mesh.materials.append(stage.new_material("Bumps", colour))
    tiles = [np.floor(each[:-1, :-1] / (0.25 * unit)) for each in (across, along)]
    chosen = (np.add(*tiles) % 2).astype(np.int32).ravel()
    mesh.polygons.foreach_set("material_index", chosen)
    mesh.shade_smooth()
    ground = bpy.data.objects.new("Bumps", mesh)
    # Bumps so gentle never shade each other; looking for it would take a quarter of the time.
    ground.display.show_shadows = False
    stage.the_scene().collection.objects.link(ground)
    return ground


def shown() -> str:
    """The names of the set-ups that the gallery shows, a line each, in its order."""
    return "".join(f"{name}\n" for name in ours.ORDER)


def gallery() -> Pixels:
    """All set-ups that come with the add-on, four phases of each, two to a row."""
    strips = []
    for name in ours.ORDER:
        pictures = contact_sheet.cycle_pictures(perform(name), _OBLIQUE, _CELL, _STRIP, name)
        strips.append(contact_sheet.joined([pictures]))
    return contact_sheet.joined([strips[at : at + 2] for at in range(0, len(strips), 2)])


def alive() -> Pixels:
    """Each set-up of our own, with a body that does nothing by itself and as it comes: three phases
    of either to a row.
    """
    rows = []
    for name in ours.ORDER:
        if name.endswith("_as_published"):
            continue
        row: list[Pixels] = []
        for lives in (False, True):
            told = name if lives else f"{name} before"
            performance = perform(name, alive=lives)
            row += contact_sheet.cycle_pictures(performance, _OBLIQUE, _CELL, _PHASES, told)
        rows.append(row)
    return contact_sheet.joined(rows)


def _sheet(performance: shots.Performance) -> Pixels:
    rows = [
        contact_sheet.cycle_pixels(performance, view)
        for view in (contact_sheet.SIDE, contact_sheet.ABOVE)
    ]
    return np.concatenate(rows, axis=0)


def _thumbnail(performance: shots.Performance) -> Pixels:
    """One telling moment, from the side and a little above, on a plain background."""
    octopus = performance.octopus
    for each in list(bpy.data.objects):
        if each.name.startswith(("Bumps", "Ground", "Route")):
            each.hide_render = True
    assert bpy.context.scene is not None
    assert bpy.context.scene.world is not None
    bpy.context.scene.world.color = _BACKGROUND
    frame = performance.cycle(8)[3]
    (points,) = stage.skin_points(octopus, [frame])
    (after,) = stage.skin_points(octopus, [frame + 2.0])
    stage.go_to(frame)
    travel = (after - points).mean(axis=0)
    travel[2] = 0.0
    if octopus.octo_motion.locomotion.travel_on == "NONE":
        travel = contact_sheet.front(octopus)
    travel = travel / max(float(np.linalg.norm(travel)), 1e-9)
    side = np.array([-travel[1], travel[0], 0.0])
    forward = 0.85 * side - 0.35 * travel - np.array([0.0, 0.0, 0.4])
    camera = stage.add_camera("Thumbnail")
    stage.look(camera, forward, np.array([0.0, 0.0, 1.0]))
    axes = np.array(camera.matrix_world.to_3x3())
    seen = points @ axes
    low, high = seen.min(axis=0), seen.max(axis=0)
    assert isinstance(camera.data, bpy.types.Camera)
    camera.data.ortho_scale = 1.1 * float((high - low)[:2].max())
    middle = 0.5 * (low + high)
    middle[2] = high[2] + 1.0
    camera.location = Vector(axes @ middle)
    bpy.context.view_layer.update()
    return stage.render_pixels(_THUMBNAIL, _THUMBNAIL)


if __name__ == "__main__":
    main()
