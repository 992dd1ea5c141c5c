# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks whose ways or grounds ask more of arms than level ground does, as Blender plays them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.rotations import Floats
from tests.referee import creature_measures as measures
from tests.referee.recording import moments, record
from tests.referee.scenes import build
from tests.referee.surface import Surface

pytestmark = pytest.mark.one_blender

ARM = 0.6
"""Metres: arms of the octopus that a script adds."""


@pytest.fixture(autouse=True)
def _empty() -> Iterator[None]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield
    bpy.ops.wm.read_factory_settings(use_empty=True)


def _linked(name: str, data: Any) -> Any:
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def _walk(way: Floats, xs: Floats, zs: Floats) -> tuple[Any, Any, list[list[str]], int, int]:
    """A walk along points (n, 3) over a ground that is (n,) high at x (n,), in arm lengths."""
    mesh = bpy.data.meshes.new("Ground")
    rows = [(ARM * x, y, ARM * z) for x, z in zip(xs, zs, strict=True) for y in (-3.0, 3.0)]
    faces = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(len(xs) - 1)]
    mesh.from_pydata(rows, [], faces)
    curve: Any = bpy.data.curves.new("Way", "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new("POLY")
    spline.points.add(len(way) - 1)
    for point, place in zip(spline.points, ARM * way, strict=True):
        point.co = (*place, 1.0)
    ground, route = _linked("Ground", mesh), _linked("Way", curve)
    bpy.ops.octo_motion.add_octopus()
    armature: Any = bpy.context.object
    settings = armature.octo_motion.locomotion
    settings.route, settings.ground.object = route, ground
    bpy.ops.octo_motion.generate_locomotion()
    arms = [[bone.name for bone in arm.bones] for arm in settings.arms]
    start, end = (round(frame) for frame in settings.result.frame_range)
    return armature, ground, arms, start, end


def _hairpins(radius: float) -> Floats:
    """Three straight lines, and between them half circles to the left and to the right."""
    points: list[tuple[float, float, float]] = []
    for leg in range(3):
        side, y = (1.0, -1.0)[leg % 2], 2.0 * radius * leg
        points += [(side * x, y, 0.0) for x in np.linspace(-0.6, 0.6, 30)]
        if leg < 2:
            turn = np.linspace(0.0, np.pi, 25)[1:-1]
            around = (0.6 + radius * np.sin(turn), y + radius - radius * np.cos(turn))
            points += [(side * x, own, 0.0) for x, own in zip(*around, strict=True)]
    return np.array(points)


def _spiral(inner: float, outer: float) -> Floats:
    share = np.linspace(0.0, 1.0, 200)
    radius, angle = inner + (outer - inner) * share, 4.0 * np.pi * share
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * share], axis=1)


# Before: 32.1, 31.3, 32.9 and 33.0; now 28.7, 28.0, 29.1 and 28.5.
@pytest.mark.parametrize(
    "way",
    [_hairpins(0.15), _hairpins(0.3), _spiral(1.2, 0.1), _spiral(0.05, 1.2)],
    ids=["hairpins", "wider hairpins", "spiral in", "spiral out"],
)
def test_no_bone_turns_faster_than_30_degrees_a_frame_on_tight_ways(
    way: Floats,
    add_on: Any,  # noqa: ARG001
) -> None:
    level = np.array([-8.0, 8.0])
    armature, _, _, start, end = _walk(way, level, 0.0 * level)
    played = record(armature, moments(start, end), with_skin=False)
    assert measures.turns(played).value < 30.0


def test_no_arm_takes_the_short_way_through_the_walls_of_a_valley(
    add_on: Any,  # noqa: ARG001
) -> None:
    """Of 45 degrees, come through aslant."""
    u, aslant = np.linspace(-1.2, 1.2, 40), np.radians(30.0)
    way = np.stack([u * np.cos(aslant), u * np.sin(aslant), np.abs(u * np.cos(aslant))], axis=1)
    armature, ground, arms, _, _ = _walk(way, np.array([-4.0, 0.0, 4.0]), np.array([4.0, 0.0, 4.0]))
    # Where it goes over from the one wall to the other; at frame 119 an arm was 7.3 % in it.
    played = record(armature, moments(108, 130, 2))
    length = measures.arm_length(played, arms)
    # 0.0055.
    assert measures.sink(played, Surface.of(ground), length).deepest.value < 0.01


def test_no_arm_starts_suddenly_where_it_lets_go_between_others(
    add_on: Any,  # noqa: ARG001
) -> None:
    """Uphill an arm that makes way for another went off by 18 degrees as it let go."""
    scene = build("walk", "slope")
    played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
    assert measures.sudden_starts(played) == 0
    # 21.8 before; 18.1 as long as arms went through each other instead, by 1.4 radii; 20.8 now.
    assert measures.turns(played).value < 21.5
