# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiment of the paper behind splicing: a walk, a turning right arm, a punch of the left.

After figures 3 to 5 of Takebayashi, Nishio and Kobori, "Motion synthesis based on splicing of
parts": the right arm of one clip and the left arm of another are put onto a walk, at two timings.
A row of poses for each clip and for each result.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import bpy
import contact_sheet
import figures
import numpy as np
import stage
from stage import Colour, Pixels

import octo_motion
from octo_motion.blender.animation.fcurves import lasting

CLIPS: Final = Path(__file__).resolve().parent.parent / "examples" / "clips"
VARIABLE: Final = "OCTO_MOTION_CLIPS"
"""Environment variable that may name another folder."""

PLAIN: Final[Colour] = (0.66, 0.66, 0.64)
_RIGHT: Final[Colour] = (0.86, 0.28, 0.05)
_LEFT: Final[Colour] = (0.03, 0.42, 0.50)
_SKY: Final[Colour] = (0.60, 0.66, 0.70)
_TILES: Final[tuple[Colour, Colour]] = ((0.30, 0.34, 0.38), (0.25, 0.285, 0.32))
_COLUMNS: Final = 11
_CELL: Final = (116, 160)
_FORWARD: Final = np.array([0.80, 0.60, -0.22])
"""Where the camera looks: from the front and the right of a figure that faces −Y."""
_UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Clips:
    """The three files."""

    walk: Path
    right: Path
    left: Path


@dataclass(frozen=True)
class Row:
    """A row of poses: who, doing what, at which frames."""

    title: str
    armature: str
    action: str
    frames: tuple[float, ...]


def find_clips(folder: Path) -> Clips:
    """The files of a folder whose names say what they are; of several the shortest name."""

    def named(*words: str) -> Path:
        found = [
            path
            for path in folder.glob("*")
            if path.suffix.lower() in {".bvh", ".fbx", ".glb"}
            and any(word in path.stem.lower() for word in words)
        ]
        if not found:
            sys.exit(f"There is no clip called '{words[0]}' in {folder}.")
        return min(found, key=lambda path: (len(path.name), path.name))

    return Clips(named("walk"), named("throw_r", "throw", "turn"), named("punch_l", "punch"))


def sheet(clips: Clips, cell: tuple[int, int] = _CELL, columns: int = _COLUMNS) -> Pixels:
    """All rows: base, right arm's clip, left arm's clip, and the two results.

    Args:
        clips: the files.
        cell: size of one picture, in pixels.
        columns: poses in a row.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = stage.the_scene()
    scene.render.fps = 30
    walker, thrower, puncher = (imported(path) for path in (clips.walk, clips.right, clips.left))
    long = [span(each)[1] - span(each)[0] for each in (thrower, puncher)]
    _lengthen(walker, round(0.9 * long[0] + long[1]) + 21)
    figures.dress(walker, {"arm.R": _RIGHT, "arm.L": _LEFT}, PLAIN)
    figures.dress(thrower, {"arm.R": _RIGHT}, PLAIN)
    figures.dress(puncher, {"arm.L": _LEFT}, PLAIN)
    first, last = span(walker)
    base: Any = walker.animation_data
    action = base.action
    timings = (
        (first + 6.0, first + 6.0 + 0.9 * long[0]),
        (first + 6.0 + 0.6 * long[1], first + 6.0),
    )
    for part, source in (("RIGHT_ARM", thrower), ("LEFT_ARM", puncher)):
        select(walker)
        bpy.ops.octo_motion.splice_add(part=part, source=source.name)
    plain = walker.animation_data.action.name
    shown = tuple(np.linspace(first, last, columns).tolist())
    prepare_stage()
    rows = [Row("walk", walker.name, plain, shown)]
    rows += [
        Row(
            name,
            each.name,
            each.animation_data.action.name,
            tuple(np.linspace(*span(each), columns).tolist()),
        )
        for name, each in ((clips.right.stem, thrower), (clips.left.stem, puncher))
    ]
    pictures = [row_pixels(row, cell, plain=row.armature == walker.name) for row in rows]
    splices = walker.octo_motion.splicing.splices
    for number, starts in enumerate(timings, 1):
        for splice, start in zip(splices, starts, strict=True):
            splice.base_start = start
        select(walker)
        bpy.ops.octo_motion.splice_build()
        result = walker.octo_motion.splicing.result
        title = f"timing {number}"
        pictures.append(row_pixels(Row(title, walker.name, result.name, shown), cell))
        told = ", ".join(f"{splice.name} from frame {splice.base_start:.0f}" for splice in splices)
        print(f"{title}: {told}", file=sys.stderr)
    assert action.name == plain
    return contact_sheet.joined(pictures)


def imported(path: Path) -> Any:
    """The armature of a clip's file."""
    bpy.ops.octo_motion.import_clips(filepath=str(path), fit="NONE", frame_view=False)
    armature: Any = bpy.context.object
    return armature


def span(armature: Any) -> tuple[float, float]:
    """First and last frame of what an armature plays."""
    start, end = armature.animation_data.action.frame_range
    return float(start), float(end)


def _lengthen(armature: Any, frames: int) -> None:
    """Let a walk last so many frames: longer ones are cut, a single cycle is repeated."""
    _assign(armature, lasting(armature.animation_data.action, frames))


def select(armature: Any) -> None:
    """Make an armature the active one, and the only one selected."""
    for each in bpy.data.objects:
        each.select_set(each == armature)
    bpy.context.view_layer.objects.active = armature


def prepare_stage() -> None:
    """Light and camera."""
    scene = stage.the_scene()
    stage.set_light(scene)
    assert scene.world is not None
    scene.world.color = _SKY
    camera = stage.add_camera("Experiment")
    stage.look(camera, _FORWARD, _UP)


def row_pixels(row: Row, cell: tuple[int, int], *, plain: bool = False) -> Sequence[Pixels]:
    """A row of poses, all seen from one side and in one scale; the camera goes along.

    Args:
        row: who and when.
        cell: size of one picture.
        plain: without colours: no part of it is spliced.
    """
    scene = stage.the_scene()
    armature: Any = bpy.data.objects[row.armature]
    _assign(armature, bpy.data.actions[row.action])
    limbs = [each for each in bpy.data.objects if each.parent_type == "BONE"]
    for limb in limbs:
        limb.hide_render = limb.parent != armature
    shading = scene.display.shading if scene.display else None
    assert shading is not None
    colours = {} if not plain else _without_colours(armature)
    size = figures.height(armature)
    places = np.stack([_place(armature, frame) for frame in row.frames])
    ground = stage.add_ground(
        np.concatenate([places - size, places + size]), _floor(armature, row.frames), 2.0, _TILES
    )
    camera = scene.camera
    assert camera is not None
    assert isinstance(camera.data, bpy.types.Camera)
    camera.data.ortho_scale = 1.28 * size * max(1.0, cell[0] / cell[1])
    forward = _FORWARD / np.linalg.norm(_FORWARD)
    floor = ground.location.z
    pictures = []
    for place, frame in zip(places, row.frames, strict=True):
        stage.go_to(frame)
        aim = np.array([place[0], place[1], floor + 0.53 * size])
        camera.location = (aim - 5.0 * size * forward).tolist()
        pictures.append(stage.render_pixels(*cell, note=f"{row.title}  {frame:.0f}"))
    bpy.data.objects.remove(ground)
    for material, colour in colours.items():
        bpy.data.materials[material].diffuse_color = colour
    return pictures


def _without_colours(armature: Any) -> dict[str, tuple[float, ...]]:
    """Paint a figure in one colour; the colours that it had, by material."""
    before: dict[str, tuple[float, ...]] = {}
    for limb in armature.children:
        material = limb.data.materials[0]
        before[material.name] = tuple(material.diffuse_color)
        material.diffuse_color = (*PLAIN, 1.0)
    return before


def _assign(armature: Any, action: Any) -> None:
    data = armature.animation_data
    data.action = action
    data.action_slot = action.slots[0]


def _hips(armature: Any) -> Any:
    marks = armature.octo_motion.splicing.landmarks
    name = marks.hips or armature.pose.bones[0].name
    return armature.pose.bones[name]


def _place(armature: Any, frame: float) -> stage.Points:
    stage.go_to(frame)
    return np.array(armature.matrix_world @ _hips(armature).head, dtype=np.float64)


def _floor(armature: Any, frames: Sequence[float]) -> float:
    """Height of the lowest point that the figure has in these frames."""
    low = []
    for frame in frames:
        stage.go_to(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for limb in armature.children:
            seen = limb.evaluated_get(depsgraph)
            matrix = np.array(seen.matrix_world)
            points = np.array([vertex.co[:] for vertex in limb.data.vertices])
            low.append(float((points @ matrix[2, :3] + matrix[2, 3]).min()))
    return float(np.percentile(low, 0.5)) if low else 0.0


def main() -> None:
    """Render the sheet of the clips in a folder."""
    parser = argparse.ArgumentParser(prog="make experiment", description=__doc__)
    parser.add_argument(
        "clips",
        type=Path,
        nargs="?",
        default=Path(os.environ.get(VARIABLE) or CLIPS),
        help=f"folder with clips called walk, throw and punch; default: ${VARIABLE}, or the "
        "project's own",
    )
    parser.add_argument(
        "--output", type=Path, default=Path("build/experiment.png"), help="the picture"
    )
    parser.add_argument(
        "--quick", action="store_true", help="few and tiny pictures, to see that it works"
    )
    arguments = parser.parse_args()
    path: Path = arguments.output.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    # Blender tells of everything that it does; here only the pictures matter.
    told = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    octo_motion.register()
    try:
        clips = find_clips(arguments.clips.resolve())
        size: dict[str, Any] = {"cell": (30, 38), "columns": 3} if arguments.quick else {}
        stage.save_pixels(sheet(clips, **size), path)
        print(path, file=told, flush=True)
    finally:
        # Blender 4.5 does not end while an operator is registered.
        octo_motion.unregister()


if __name__ == "__main__":
    main()
