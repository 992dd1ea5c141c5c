# SPDX-License-Identifier: GPL-3.0-or-later
"""A crawl as the artist sees it: no snap, no slide, no arm through another, on any ground."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.ui.made import Made, prepare
from tests.ui.rig import Octopus

pytestmark = pytest.mark.one_blender

OCTOPUS = Octopus(add_on=True, route={}, settings={"gait": "crawl"})
"""The default octopus that crawls along the default route."""


def add_bumps(octopus: Any) -> None:
    """Hills of 0.3 arm lengths under its route."""
    shot = prepare(octopus, bpy.context)
    unit = shot.generator.arm_length * shot.scale
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=300, y_subdivisions=300, size=24.0 * unit)
    grid: Any = bpy.context.object
    points = np.empty((len(grid.data.vertices), 3), dtype=np.float32)
    grid.data.vertices.foreach_get("co", points.ravel())
    turns = 2.0 * np.pi / unit
    points[:, 2] = np.sin(turns * points[:, 0] / 1.4) * np.cos(turns * points[:, 1] / 1.2)
    points[:, 2] *= 0.15 * unit
    grid.data.vertices.foreach_set("co", points.ravel())
    grid.data.update()
    octopus.octo_motion.locomotion.ground.object = grid
    bpy.context.view_layer.objects.active = octopus
    bpy.context.view_layer.update()


def crawled(octopus: Any, seed: int, heading: float = 0.0) -> Made:
    settings = octopus.octo_motion.locomotion
    settings.seed, settings.heading_angle = seed, heading
    bpy.context.view_layer.update()
    shot = prepare(octopus, bpy.context)
    for _ in shot.compute():
        pass
    return shot


def worst(shot: Made) -> dict[str, float]:
    return {each.kind: each.value for each in shot.figures}


@pytest.mark.parametrize("heading", np.radians([0.0, 90.0, 180.0]))
def test_whichever_way_it_faces_a_crawl_has_no_snap_and_no_arm_in_another(
    octopus: Any, heading: float
) -> None:
    figures = worst(crawled(octopus, 1, heading))
    # A knee that straightened at once turned by 38° in a frame.
    assert figures["TURN"] < np.radians(26.0)
    assert figures["SLIP"] < 0.004
    assert figures["DEPTH"] < 0.005
    assert figures["OVERLAP"] < 0.13


@pytest.mark.parametrize(("seed", "heading"), [(0, 0.0), (1, np.pi)])
def test_on_bumps_neither(octopus: Any, seed: int, heading: float) -> None:
    add_bumps(octopus)
    figures = worst(crawled(octopus, seed, heading))
    # Arms that hung over a crest came off it with a turn of 80°, and slid by 4 % of their length.
    assert figures["TURN"] < np.radians(30.0)
    assert figures["SLIP"] < 0.008
    assert figures["DEPTH"] < 0.005
    assert figures["OVERLAP"] < 0.13


def test_arms_hold_on_long_enough_to_be_seen_to_hold(octopus: Any) -> None:
    shot = crawled(octopus, 0)
    assert shot.measured is not None
    for lying in shot.measured.lying:
        held = np.any(lying, axis=1)
        changes = np.flatnonzero(np.diff(held.astype(np.int8)))
        # From the first that begins to the last that ends.
        lasts = np.diff(changes)[0 if held[changes[0] + 1] else 1 :: 2]
        assert lasts.min() >= 11
        assert np.median(lasts) >= 17


@pytest.mark.parametrize("heading", np.radians([90.0, -90.0, 180.0]))
def test_a_walk_sideways_or_backwards_does_not_step_on_its_own_arms(
    octopus: Any, heading: float
) -> None:
    settings = octopus.octo_motion.locomotion
    settings.gait = "walk"
    figures = worst(crawled(octopus, 0, heading))
    # Arms in front of the way were those of the sides, and passed through each other.
    assert figures["OVERLAP"] < 0.13
    assert figures["TURN"] < np.radians(26.0)
    assert figures["SLIP"] < 0.004
