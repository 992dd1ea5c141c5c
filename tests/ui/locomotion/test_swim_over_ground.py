# SPDX-License-Identifier: GPL-3.0-or-later
"""A body that swims stays over its ground, arms, mantle and all."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.ui.locomotion import panels
from tests.referee import creature_measures as measures
from tests.referee.recording import moments, record
from tests.referee.scenes import Scene, build
from tests.referee.surface import Surface
from tests.ui.test_panels import Layout

LOW = np.array([[-1.8, 0.3, 0.0], [-0.6, -0.75, 0.0], [0.45, 0.9, 0.0], [1.8, 0.15, 0.0]])
"""A way that lies on the floor, as one for a walk does."""
DIVE = np.array([[0.0, 0.0, 2.0], [0.0, 0.1, 1.4], [0.0, 0.1, 0.7], [0.0, 0.2, 0.0]])
"""Head first to the floor."""


def deepest(scene: Scene, every: int = 1) -> float:
    """Arm lengths that skin is in the ground, of so many half frames one looked at."""
    played = record(scene.armature, moments(scene.start, scene.end, 2)[::every])
    length = measures.arm_length(played, scene.arms)
    return measures.sink(played, Surface.of(scene.ground), length).deepest.value


@pytest.mark.one_blender
@pytest.mark.parametrize(
    ("setup", "ground", "way"),
    [
        # Arms were in the ground by 0.36, 0.44 and 0.12 of their length.
        ("swim", "plane", None),
        ("swim", "slope", None),
        ("jet_escape", "plane", None),
        # The whole octopus swam half in the ground.
        ("swim", "stairs", LOW),
        ("swim", "bumps", DIVE),
    ],
)
def test_a_swim_keeps_off_the_ground_that_is_chosen(
    setup: str, ground: str, way: np.ndarray | None
) -> None:
    scene = build(setup, ground, way=way)
    assert deepest(scene) <= 0.002
    played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
    assert measures.turns(played).value <= 30.0


def centres(scene: Scene) -> np.ndarray:
    return record(scene.armature, moments(scene.start, scene.end), with_skin=False).heads[:, 0]


def test_a_way_high_above_the_ground_is_swum_as_if_there_were_none() -> None:
    def none(settings: Any) -> None:
        settings.ground.object = None

    high = LOW + np.array([0.0, 0.0, 3.0])
    over = centres(build("swim", "bumps", way=high))
    assert over == pytest.approx(centres(build("swim", "bumps", way=high, change=none)), abs=1e-6)


@pytest.mark.one_blender
def test_without_hold_the_ground_a_swim_goes_where_its_route_does() -> None:
    def off(settings: Any) -> None:
        settings.ground.use = False

    scene = build("swim", "plane", way=LOW, change=off)
    assert centres(scene)[:, 2].max() < 0.2
    assert deepest(scene, every=16) > 0.3


def test_under_a_roof_a_swim_stays_below_it() -> None:
    def roofed(settings: Any) -> None:
        ground = settings.ground.object.data
        points = np.empty(3 * len(ground.vertices))
        ground.vertices.foreach_get("co", points)
        corners = points.reshape(-1, 3)[[0, 2, 3, 1]]
        mesh = bpy.data.meshes.new("both")
        both = np.concatenate([corners, corners + np.array([0.0, 0.0, 3.0])])
        mesh.from_pydata(both.tolist(), [], [(0, 1, 2, 3), (4, 5, 6, 7)])
        settings.ground.object.data = mesh

    scene = build("swim", "plane", way=LOW, change=roofed)
    heights = centres(scene)[:, 2]
    assert heights.min() > 0.2
    assert heights.max() < 1.5


def test_the_ground_of_a_swim_is_chosen_beside_its_route() -> None:
    settings = build("swim", "plane").armature.octo_motion.locomotion
    shown: dict[bool, list[str]] = {}
    for held in (True, False):
        settings.ground.use = held
        layout, panel = Layout(), panels.OCTO_MOTION_PT_generate
        panel.show(None, layout, settings)  # pyright: ignore[reportArgumentType]
        shown[held] = layout.drawn
    at = shown[True].index("route")
    assert shown[True][at + 1] == "object"
    assert "object" not in shown[False]
