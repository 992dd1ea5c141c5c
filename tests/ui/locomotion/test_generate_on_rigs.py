# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs as artists bring them walk and swim with a click on Add Route and a click on Generate."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.scene.curves import read_route
from octo_motion.core.rotations import rotate
from octo_motion.ui.locomotion.reading.rig import bones_of
from octo_motion.ui.locomotion.writing import shot as workflow
from tests.ui.made import prepare
from tests.ui.rig import click, joints_in_world

pytestmark = pytest.mark.one_blender

RIGS = (
    # file, armature, arms
    ("InfiniteSkinnedTentacle.glb", "Armature", 64),
    ("assimp_animation_with_skeleton.fbx", "Armature", None),
    ("nssm_octopus.blend", "Armature", 8),
    ("octopus_cheli_sanjuan.glb", "Object_6", 6),
    ("rigify_simple_tentacle_8arm.blend", "octo_meta", 8),
    ("rigify_simple_tentacle_8arm.blend", "RIG-octo_meta", 8),
)


def opened(path: Path, name: str) -> Any:
    """An armature of a file, active in object mode."""
    importers: dict[str, Any] = {
        ".blend": bpy.ops.wm.open_mainfile,
        ".glb": bpy.ops.import_scene.gltf,
        ".fbx": bpy.ops.import_scene.fbx,
    }
    importers[path.suffix](filepath=str(path))
    armature: Any = bpy.data.objects[name]
    bpy.context.view_layer.objects.active = armature
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    return armature


@pytest.mark.parametrize("gait", ["walk", "swim"])
@pytest.mark.parametrize(("file", "name", "count"), RIGS)
def test_a_real_rig_follows_its_route(
    shared_data: Callable[[str], Path], file: str, name: str, count: int | None, gait: str
) -> None:
    armature = opened(shared_data(f"octo/{file}"), name)
    own = set(bpy.data.actions)
    click("add_route")
    settings = armature.octo_motion.locomotion
    settings.gait, settings.timing, settings.frame_end = gait, "RANGE", 48
    settings.ease_in = settings.ease_out = 0.0

    summary = workflow.generate_locomotion(armature, bpy.context)

    assert count in (None, len(settings.arms))
    # The solver's own promise, in arm lengths.
    assert summary.miss < 1e-3
    # Whatever actions came with the file are still there, and still in use by no one less.
    assert own < set(bpy.data.actions)
    route = read_route(settings.route)
    bones = [bone.name for bone in armature.pose.bones]
    roots = [bones.index(bones_of(arm)[0]) for arm in settings.arms]
    for frame, share in ((1, 0.0), (48, 1.0)):
        middle = joints_in_world(armature, frame)[roots, 0].mean(axis=0)
        aside = middle - route.position(share)
        if gait == "walk":
            aside[2] = 0.0
        # Half a percent for scales that are not quite equal.
        assert np.linalg.norm(aside) < 5e-3 * route.length


@pytest.mark.parametrize(
    ("file", "name"),
    [("nssm_octopus.blend", "Armature"), ("octopus_cheli_sanjuan.glb", "Object_6")],
)
def test_a_real_rig_holds_the_ground_as_blender_plays_it(
    shared_data: Callable[[str], Path], file: str, name: str
) -> None:
    """Both were saved in another pose than at rest; one with bones scaled to and fro."""
    armature = opened(shared_data(f"octo/{file}"), name)
    click("detect_arms")
    click("add_route")
    settings = armature.octo_motion.locomotion
    settings.timing, settings.frame_end = "RANGE", 60
    shot = prepare(armature, bpy.context)
    assert not any("stands off its route" in told for told in shot.warnings)
    for _ in shot.compute():
        pass
    shot.write()
    measured = shot.measured
    assert measured is not None
    numbers = [bone.name for bone in armature.pose.bones]
    start = 0
    for number, arm in enumerate(measured.arms):
        own = slice(start, start + len(arm.bones))
        start = own.stop
        bones = [numbers.index(bone) for bone in arm.bones]
        frames = arm.from_bones(measured.poses.rotations[:, own])
        joints = measured.scale * arm.joints(frames, measured.poses.strains[:, own])
        joints = rotate(measured.poses.orientations[:, None], joints)
        joints += measured.poses.locations[:, None]
        at = np.arange(0, 60, 7)
        played = np.array([joints_in_world(armature, frame + 1.0)[bones, 0] for frame in at])
        length = measured.scale * arm.length
        # Tails of bones may be anywhere: what lies on the ground are their heads.
        np.testing.assert_allclose(played, joints[at, :-1], atol=2e-3 * length)
        lying = measured.lying[number][:, :-1]
        assert lying.any()
