# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies whose mantle lies flat behind them swim as they lie."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import curves_of
from octo_motion.core.rotations import rotate
from octo_motion.ui.locomotion.settings.properties import locomotion_settings
from octo_motion.ui.locomotion.writing.shot import generate_locomotion
from tests.ui.locomotion.test_changes import HUMP, computed, steps
from tests.ui.locomotion.test_generate_on_rigs import opened
from tests.ui.made import prepare
from tests.ui.rig import click, make_octopus

pytestmark = pytest.mark.one_blender

LEVEL = {"b0": (0, 0, 0), "b1": (0, -2, 0), "b2": (1, -4, 0), "b3": (1, -6, 0)}


@pytest.fixture
def lying() -> Any:
    """An octopus whose mantle lies level behind it."""
    octopus = make_octopus(arms=8)
    bpy.ops.object.mode_set(mode="EDIT")
    mantle = octopus.data.edit_bones.new("Mantle")
    mantle.head, mantle.tail = (0.0, 0.0, 0.12), (0.0, 0.7, 0.16)
    mantle.parent = octopus.data.edit_bones["Root"]
    bpy.ops.object.mode_set(mode="OBJECT")
    settings = locomotion_settings(octopus)
    click("detect_arms")
    settings.gait = "swim"
    settings.tell_overlaps = False
    return settings


def test_it_swims_backwards_with_its_back_to_the_sky(lying: Any) -> None:
    octopus = lying.id_data
    bpy.ops.octo_motion.add_route(**LEVEL)
    # Of itself a mantle swings and swells: that is another matter.
    lying.body.mantle = lying.body.head = lying.breathing = 0.0
    shot = computed(lying)
    way = np.gradient(shot.measured.poses.locations, axis=0)
    way = (way / np.linalg.norm(way, axis=1, keepdims=True))[8:-8]
    orientations = shot.measured.poses.orientations[8:-8]
    assert np.all(np.sum(rotate(orientations, np.array([0.0, 1.0, 0.0])) * way, axis=1) > 0.97)
    assert np.all(rotate(orientations, np.array([0.0, 0.0, 1.0]))[:, 2] > 0.97)
    # Nothing is bent up: the head is before it.
    generate_locomotion(octopus, bpy.context)
    paths = {curve.data_path for curve in curves_of(octopus.animation_data.action)}
    assert [path for path in paths if "Mantle" in path] == []


def test_without_streamline_it_swims_as_any_octopus_does(lying: Any) -> None:
    bpy.ops.octo_motion.add_route(**LEVEL)
    lying.streamline = 0.0
    shot = computed(lying)
    way = shot.measured.poses.locations[60] - shot.measured.poses.locations[59]
    up = rotate(shot.measured.poses.orientations[59], np.array([0.0, 0.0, 1.0]))
    assert up @ way / np.linalg.norm(way) > 0.97


def test_between_walk_and_swim_nothing_jumps(lying: Any) -> None:
    bpy.ops.octo_motion.add_route(**HUMP)
    lying.gait = "walk"
    lying.change.by = "HEIGHT"
    bodies, arms = [], []
    for rate in (24, 48):
        bpy.context.scene.render.fps = rate
        shot = computed(lying)
        assert len(shot.transitions.changes) == 2
        bodies.append(steps(shot.measured.poses.orientations).max())
        arms.append(steps(shot.rotations).max())
    assert bodies[0] < 8.0
    assert bodies[1] < 0.6 * bodies[0]
    assert arms[1] < 0.75 * arms[0]
    # It comes back to standing upright.
    up = rotate(shot.measured.poses.orientations[[0, -1]], np.array([0.0, 0.0, 1.0]))
    assert np.all(up[:, 2] > 0.99)


@pytest.mark.parametrize("gait", ["swim", "jet_escape"])
def test_a_rig_that_lies_trails_its_arms_and_turns_none_at_a_stroke(
    shared_data: Callable[[str], Path], gait: str
) -> None:
    """Four bones to an arm, the first of them short, and all arms from one point."""
    armature = opened(shared_data("octo/nssm_octopus.blend"), "Armature")
    click("detect_arms")
    click("add_route")
    settings = locomotion_settings(armature)
    settings.gait = gait
    shot = computed(settings)
    # Its front is −X; before, its mantle hung down across the way.
    way = np.gradient(shot.measured.poses.locations, axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    mantle = rotate(shot.measured.poses.orientations, np.array([1.0, 0.0, 0.0]))
    assert np.median(np.sum(mantle * way, axis=1)) > 0.95
    assert (
        np.median(rotate(shot.measured.poses.orientations, np.array([0.0, 0.0, 1.0]))[:, 2]) > 0.8
    )
    # Before: 28°, and arms by 2.4 radii in each other.
    assert steps(shot.rotations).max() < 16.0
    volume = shot.shot.job.volume
    assert volume is not None
    alone = replace(volume, body=())
    found, _ = alone.measure(shot.rotations, shot.strains)
    assert found.worst is None or found.worst.depth < 0.2
    assert prepare(armature, bpy.context).mantle == ()
