# SPDX-License-Identifier: GPL-3.0-or-later
"""In whatever pose or frame a rig stands, its arms, its mantle and its motion are those at rest."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.ui.locomotion.writing import shot as workflow
from tests.ui.locomotion.test_generate_on_rigs import opened
from tests.ui.rig import Octopus, click, generate, joints_in_world

pytestmark = pytest.mark.one_blender

WAY = ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, -1.6, 0.0), (0.6, -2.0, 0.3))
OCTOPUS = Octopus(
    add_on=True, with_mesh=False, route=WAY, frames=24, settings={"tell_overlaps": False}
)
FRAMES = (1, 9, 17, 24)
SAME = 1e-4
"""Metres, for arms of half a metre: single precision of the scales that are taken back."""


def posed(armature: Any, seed: int) -> None:
    """Any bone anyhow, in size as well."""
    random = np.random.default_rng(seed)
    for bone in armature.pose.bones:
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = random.normal(size=4)
        bone.location = 0.1 * random.normal(size=3)
        bone.scale = random.uniform(0.5, 2.0, size=3)
    bpy.context.view_layer.update()


def keyed(armature: Any) -> bpy.types.Action:
    """The present pose in an action, which goes on from there."""
    for frame, seed in ((10, 1), (40, 2)):
        posed(armature, seed)
        for bone in armature.pose.bones:
            for channel in ("location", "rotation_quaternion", "scale"):
                bone.keyframe_insert(channel, frame=frame)
    return armature.animation_data.action


def in_an_old_action(armature: Any) -> None:
    keyed(armature)
    bpy.context.scene.frame_set(23)


def over_an_old_strip(armature: Any) -> None:
    old, data = keyed(armature), armature.animation_data
    data.nla_tracks.new().strips.new("Old", 1, old)
    data.action = None
    bpy.context.scene.frame_set(23)


def by_hand(armature: Any) -> None:
    posed(armature, 3)


def listed(armature: Any) -> list[tuple[Any, ...]]:
    settings = armature.octo_motion.locomotion
    arms = [(arm.name, arm.side, arm.pair, len(arm.bones)) for arm in settings.arms]
    return [*arms, (settings.body_up, settings.body_front, settings.root_bone)]


def played(armature: Any) -> tuple[np.ndarray, np.ndarray]:
    """Where the bones of arms, body and mantle are, and how large at the end."""
    bones, arms = armature.pose.bones, armature.octo_motion.locomotion.arms
    names = {bone.name for arm in arms for bone in arm.bones}
    names |= {each.name for name in names for each in bones[name].parent_recursive}
    names |= {each.name for each in bones if each.name.startswith("mantle")}
    rows = [number for number, bone in enumerate(bones) if bone.name in names]
    places = [joints_in_world(armature, float(frame))[rows] for frame in FRAMES]
    return np.array(places), np.array([bones[row].matrix.to_scale() for row in rows])


@pytest.mark.parametrize("gait", ["walk", "swim"])
@pytest.mark.parametrize("left", [by_hand, in_an_old_action, over_an_old_strip])
def test_a_motion_is_that_of_the_rig_at_rest(
    octopus: Any, left: Callable[[Any], None], gait: str
) -> None:
    settings = octopus.octo_motion.locomotion
    settings.gait, settings.travel_on = gait, "BONE"
    settings.arms.clear()
    generate(octopus)
    wanted, arms = played(octopus), listed(octopus)
    octopus.animation_data_clear()
    settings.result = None
    settings.arms.clear()
    left(octopus)
    for _ in range(2):
        # Pressed again nothing changes either.
        generate(octopus)
        assert listed(octopus) == arms
        for there, here in zip(wanted, played(octopus), strict=True):
            np.testing.assert_allclose(here, there, atol=SAME)


def test_poses_by_hand_are_keyed_at_rest_and_old_actions_stay_as_they_are(octopus: Any) -> None:
    old = keyed(octopus)
    kept = [point.co[1] for each in old.layers[0].strips[0].channelbags[0].fcurves
            for point in each.keyframe_points]  # fmt: skip
    octopus.pose.bones["body"].rotation_mode = "XYZ"
    octopus.pose.bones["body"].rotation_euler = (0.3, 0.0, 0.0)
    summary = workflow.generate_locomotion(octopus, bpy.context)
    assert any("keyed at rest" in told for told in summary.notes)
    assert old.use_fake_user
    assert kept == [point.co[1] for each in old.layers[0].strips[0].channelbags[0].fcurves
                    for point in each.keyframe_points]  # fmt: skip


@pytest.mark.parametrize(
    ("file", "name"),
    [("nssm_octopus.blend", "Armature"), ("octopus_cheli_sanjuan.glb", "Object_6")],
)
def test_a_real_rig_moves_as_it_does_from_rest(
    shared_data: Callable[[str], Path], file: str, name: str
) -> None:
    found: list[Any] = []
    for start in (None, 1, 2):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        armature = opened(shared_data(f"octo/{file}"), name)
        if start is None:
            armature.animation_data_clear()
            for bone in armature.pose.bones:
                bone.matrix_basis.identity()
                bone.location, bone.scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
                bone.rotation_mode = "QUATERNION"
                bone.rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
        elif start == 1:
            posed(armature, 4)
        click("add_route")
        settings = armature.octo_motion.locomotion
        settings.gait, settings.timing, settings.frame_end = "swim", "RANGE", 24
        settings.keep_apart = settings.tell_overlaps = False
        generate(armature)
        found.append((listed(armature), *played(armature)))
    size = np.ptp(found[0][1], axis=(0, 1)).max()
    for each in found[1:]:
        assert each[0] == found[0][0]
        np.testing.assert_allclose(each[1], found[0][1], atol=1e-4 * size)
