# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for the referee, made with the buttons that an artist has, and with nothing else."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .recording import Floats

SETUPS = (
    "walk", "hurry", "prowl", "tiptoe", "crawl", "settle", "swim", "jet_escape", "idle", "curl",
)  # fmt: skip
_WAY = np.array([[-0.55, 0.17, 0.0], [-0.2, -0.22, 0.0], [0.15, 0.25, 0.0], [0.55, 0.0, 0.0]])
"""A route's control points, in metres for an arm of ``_UNIT``."""
_RISING = np.array([[-1.8, 0.3, 0.45], [-0.6, -0.75, 0.3], [0.45, 0.9, 0.9], [1.8, 0.15, 1.0]])
_FARTHEST = 1.1136
"""Metres of a winding way from the middle to either side, for an arm of ``_UNIT``."""
_UNIT = 0.58
RISER = 0.14
"""Arm lengths."""
_TREAD = 0.9
"""Arm lengths."""

Heights = Callable[[Floats, Floats], Floats]


def plane(x: Floats, y: Floats) -> Floats:
    """Level ground."""
    return 0.0 * x * y


def bumps(x: Floats, y: Floats) -> Floats:
    """Hills and hollows of 0.3 arm lengths."""
    return 0.15 * np.sin(2.0 * np.pi * x / 1.4) * np.cos(2.0 * np.pi * y / 1.2)


def slope(x: Floats, y: Floats) -> Floats:
    """Twenty degrees uphill, along the way."""
    return np.tan(np.radians(20.0)) * x + 0.0 * y


def stairs(x: Floats, y: Floats) -> Floats:
    """Steps of 0.14 arm lengths up, along the way."""
    return RISER * np.floor(x / _TREAD + 0.5) + 0.0 * y


GROUNDS: dict[str, Heights] = {"plane": plane, "bumps": bumps, "slope": slope, "stairs": stairs}


@dataclass(frozen=True, eq=False)
class Scene:
    """A creature with a motion, on some ground."""

    armature: Any
    ground: Any
    arms: list[list[str]]
    """Bones from root to tip."""
    start: int
    end: int


def winding(seed: int) -> Floats:
    """Control points of a way that nobody chose, as chance has it."""
    chance = random.Random(seed)  # noqa: S311 - nothing secret
    way = [[chance.uniform(-_FARTHEST, _FARTHEST) for _ in range(2)] for _ in range(4)]
    return np.pad(np.array(way), ((0, 0), (0, 1)))


def build(
    setup: str,
    ground: str,
    rig: Path | None = None,
    *,
    fps: int = 24,
    way: Floats | None = None,
    change: Callable[[Any], None] | None = None,
) -> Scene:
    """Add or import a creature, load a set-up, give it a route and a ground, press Generate.

    Args:
        setup: of those in the panel.
        ground: of ``GROUNDS``.
        rig: a file with an armature; the add-on's octopus without one.
        fps: frames a second.
        way: control points of the route, for an arm of 0.58 m.
        change: what else is set, by the settings of locomotion.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature = _creature(rig)
    scene: Any = bpy.context.scene
    scene.render.fps, scene.render.fps_base = fps, 1.0
    bpy.ops.octo_motion.detect_arms()
    settings = armature.octo_motion.locomotion
    bpy.ops.octo_motion.setup_load(name=setup)
    swims = settings.table.manner == "SWIM"
    unit = _arm_length(armature, settings)
    if way is None:
        way = _RISING if swims else _WAY
    heights = GROUNDS[ground]
    route = way * (unit / _UNIT)
    if not swims:
        route[:, 2] += unit * heights(route[:, 0] / unit, route[:, 1] / unit)
    points = dict(zip(("b0", "b1", "b2", "b3"), route.tolist(), strict=True))
    bpy.ops.octo_motion.add_route(**points)
    settings.ground.object = _ground(ground, heights, unit, route)
    if change is not None:
        change(settings)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.octo_motion.generate_locomotion()
    arms = [[bone.name for bone in arm.bones] for arm in settings.arms if arm.enabled]
    start, end = (round(frame) for frame in settings.result.frame_range)
    return Scene(armature, settings.ground.object, arms, start, end)


def _creature(rig: Path | None) -> Any:
    if rig is None:
        bpy.ops.octo_motion.add_octopus()
        return bpy.context.object
    if rig.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(rig))
    else:
        bpy.ops.import_scene.gltf(filepath=str(rig))
    armature: Any = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    bpy.context.view_layer.objects.active = armature
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def _arm_length(armature: Any, settings: Any) -> float:
    lengths = [
        sum(armature.data.bones[bone.name].length for bone in arm.bones) for arm in settings.arms
    ]
    return float(armature.matrix_world.to_scale()[0] * max(lengths))


def _ground(name: str, heights: Heights, unit: float, route: Floats) -> Any:
    """A mesh of quads; where it rises at once a wall joins the two."""
    low, high = route[:, :2].min(axis=0) - 2.5 * unit, route[:, :2].max(axis=0) + 2.5 * unit
    if name == "plane":
        xs, ys = np.array([low[0], high[0]]), np.array([low[1], high[1]])
    else:
        xs, ys = (np.arange(a, b, 0.04 * unit) for a, b in zip(low, high, strict=True))
    if name == "stairs":
        edges = np.arange(np.floor(low[0] / unit / _TREAD), high[0] / unit / _TREAD) + 0.5
        edges = unit * _TREAD * edges[(edges * _TREAD * unit > low[0])]
        # Twice on each edge, once below and once above: the wall between is upright.
        xs, ys = np.sort(np.concatenate([[low[0], high[0]], edges, edges])), ys[[0, -1]]
    x, y = np.meshgrid(xs, ys, indexing="ij")
    z = unit * heights(x / unit, y / unit)
    if name == "stairs":
        place = np.arange(len(xs))
        z = unit * RISER * (np.round((xs[0] / unit) / _TREAD) + place // 2)[:, None] + 0.0 * y
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    number = np.arange(len(vertices)).reshape(x.shape)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    faces = np.stack(corners, axis=-1).reshape(-1, 4)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    made = bpy.data.objects.new(name, mesh)
    scene: Any = bpy.context.scene
    scene.collection.objects.link(made)
    return made


def names_of(files: Sequence[Path | None]) -> list[str]:
    """What rigs are called in tables."""
    return [each.stem if each is not None else "octopus" for each in files]
