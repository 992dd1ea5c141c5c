# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in place: a loop that games can take, and a creature that breathes."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import is_edited
from octo_motion.core.locomotion.gait.table import gait_presets
from octo_motion.core.locomotion.metrics import report as quality
from octo_motion.core.locomotion.path.travel import plan_travel
from tests.ui.made import prepare
from tests.ui.rig import Octopus, curves, generate, joints_in_world, keys, still

pytestmark = pytest.mark.one_blender

OCTOPUS = Octopus(settings={"travel_on": "NONE", "cycle_time": 1.0})
"""It has no route."""


@pytest.mark.parametrize("gait", sorted(gait_presets()))
@pytest.mark.parametrize("how", ["DENSE", "REDUCED"])
def test_the_last_frame_meets_the_first(octopus: Any, gait: str, how: str) -> None:
    settings = octopus.octo_motion.locomotion
    settings.gait, settings.cycles, settings.keys = gait, 2, how
    settings.variation_min, settings.variation_max = -0.1, 0.1
    action = generate(octopus)
    assert tuple(action.frame_range) == (1.0, 49.0)
    for (path, _), values in keys(action).items():
        assert values[0, 1] == pytest.approx(values[-1, 1], abs=1e-5), path
    # Beyond its ends it goes on.
    np.testing.assert_allclose(
        joints_in_world(octopus, 55.25), joints_in_world(octopus, 7.25), atol=1e-5
    )
    assert action.use_cyclic
    assert not is_edited(action)


def test_nothing_travels_and_the_root_bone_lifts_the_body(octopus: Any) -> None:
    octopus.location = (3.0, 2.0, 1.0)
    octopus.octo_motion.locomotion.body.surge = 0.0  # which moves it about its place
    bpy.context.view_layer.update()
    action = generate(octopus)
    assert not any(path in {"location", "rotation_euler"} for path, _ in keys(action))
    places = np.array([joints_in_world(octopus, frame)[0, 0] for frame in (1, 8, 20)])
    np.testing.assert_allclose(places, np.tile(places[:1], (3, 1)), atol=1e-6)
    np.testing.assert_allclose(places[0, :2], (3.0, 2.0), atol=1e-5)
    lowest = min(joints_in_world(octopus, frame)[..., 2].min() for frame in range(1, 25))
    # The armature's origin is on the ground.
    assert lowest == pytest.approx(1.0, abs=0.02)
    again = keys(generate(octopus))
    assert all(np.allclose(again[path], values) for path, values in keys(action).items())


def test_without_repeat_the_curves_have_no_modifiers(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    action = generate(octopus)
    assert all(len(curve.modifiers) == 1 for curve in curves(action))
    settings.repeat = False
    assert generate(octopus) == action  # made anew in place
    assert all(len(curve.modifiers) == 0 for curve in curves(action))
    assert not action.use_cyclic


def test_frames_and_seconds_make_whole_frames(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    settings.cycle_time = 0.99
    assert tuple(generate(octopus).frame_range) == (1.0, 25.0)
    settings.timing, settings.frame_start, settings.frame_end = "RANGE", 10, 40
    assert tuple(generate(octopus).frame_range) == (10.0, 40.0)


def test_the_mantle_breathes() -> None:
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    octopus: Any = bpy.context.object
    settings = octopus.octo_motion.locomotion
    settings.travel_on, settings.gait, settings.cycle_time = "NONE", "idle", 4.0
    still(settings)
    assert not any("scale" in path for path, _ in keys(generate(octopus)))
    settings.breathing, settings.breath_time = 0.1, 1.8
    found = keys(generate(octopus))
    wide = found['pose.bones["mantle"].scale', 0][:, 1]
    # No breath is as deep as the other: by a quarter at most.
    assert wide.max() == pytest.approx(1.1, abs=0.026)
    assert wide[0] == pytest.approx(wide[-1], abs=1e-6)
    peaks = (wide[1:-1] > wide[:-2]) & (wide[1:-1] >= wide[2:])
    assert peaks.sum() == 2
    settings.breathing = 0.0
    generate(octopus)
    assert tuple(octopus.pose.bones["mantle"].scale) == pytest.approx((1.0, 1.0, 1.0))


@pytest.mark.parametrize(("gait", "cycles"), [("walk", 1), ("crawl", 1), ("crawl", 3)])
def test_in_place_the_ground_goes_by_under_arms_that_hold_it(gait: str, cycles: int) -> None:
    operators: Any = bpy.ops.octo_motion
    operators.add_octopus(with_mesh=False)
    armature: Any = bpy.context.object
    operators.detect_arms()
    settings = armature.octo_motion.locomotion
    settings.gait = gait
    settings.travel_on, settings.cycles, settings.cycle_time = "NONE", cycles, 2.0
    generate(armature)
    shot = prepare(armature, bpy.context)
    standing = shot.standing
    assert standing is not None
    travel = plan_travel(shot.route, shot.travel, shot.times, standing.bearings)
    poses = standing.pose(travel, slice(None), standing.place(travel))
    (arms,) = standing.walk.builds
    order = [bone.name for bone in armature.pose.bones]
    heads = [[order.index(bone) for bone in shot.arms[arm].bones] for arm in arms]
    played = np.array([joints_in_world(armature, frame)[:, 0] for frame in shot.frames])[:, heads]
    # As if the body had gone on.
    played = played - travel.distance[:, None, None, None] * np.array([0.0, 1.0, 0.0])
    ends = joints_in_world(armature, shot.frames[0]), joints_in_world(armature, shot.frames[-1])
    np.testing.assert_allclose(*ends, atol=1e-5)
    # The motion goes on over the seam as anywhere else.
    speed = np.linalg.norm(np.diff(played[:-1], axis=0), axis=-1).max(axis=(1, 2))
    over = np.linalg.norm(played[-1] - played[-2], axis=-1).max()
    assert over < 1.2 * speed.max()
    lying, lengths = poses.in_contact[0][:, :, :-1], shot.generator.lengths[list(arms)]
    worst = quality.slip(played, lying, poses.cycles[:, list(arms)], lengths)
    assert lying.any(axis=-1).sum(axis=1).min() >= 2
    assert worst.value < 1e-5
