# SPDX-License-Identifier: GPL-3.0-or-later
"""A body that rests in place lies on the mesh that is its ground, judged by its skin."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as referee
from tests.referee.recording import moments, record
from tests.referee.scenes import build
from tests.referee.surface import Surface
from tests.ui.rig import joints_in_world, keys

pytestmark = pytest.mark.one_blender


def found(scene: Any) -> tuple[Any, Surface, float]:
    played = record(scene.armature, moments(scene.start, scene.end))
    return played, Surface.of(scene.ground), referee.arm_length(played, scene.arms)


@pytest.mark.parametrize("ground", ["bumps", "slope", "stairs"])
@pytest.mark.parametrize("setup", ["idle", "curl"])
def test_arms_lie_on_the_ground_that_is_there(setup: str, ground: str, add_on: Any) -> None:  # noqa: ARG001
    """They were 13 to 32 % of an arm deep in it; measured 0.02 to 0.21 %."""
    scene = build(setup, ground)
    played, surface, length = found(scene)
    sink = referee.sink(played, surface, length)
    rests = referee.resting(played, scene.arms, surface, length)
    assert sink.deepest.value < 0.004
    assert sink.share == 0.0
    # As much of the arms rests as on level ground, and as still: 0.3 of bones and moments.
    assert rests.share > 0.15
    assert rests.drift.value < 0.01
    told = {each.kind: each.value for each in scene.armature.octo_motion.locomotion.figures}
    assert told["DEPTH"] < 0.005


def test_a_loop_on_bumps_closes(add_on: Any) -> None:  # noqa: ARG001
    scene = build("idle", "bumps")
    values = keys(scene.armature.animation_data.action)
    assert all(each[0, 1] == pytest.approx(each[-1, 1], abs=1e-5) for each in values.values())


def raised(scene: Any, by: float) -> Any:
    """Joints (bones, 2, 3) against the armature, of one that stands so much higher."""
    scene.armature.location.z += by
    bpy.context.view_layer.update()
    bpy.ops.octo_motion.generate_locomotion()
    return joints_in_world(scene.armature, scene.start) - np.array(scene.armature.location)


def test_far_above_its_ground_it_rests_as_on_level_ground(add_on: Any) -> None:  # noqa: ARG001
    far = raised(build("idle", "bumps"), 2.0)
    level = raised(build("idle", "plane"), 0.0)
    np.testing.assert_allclose(far, level, atol=1e-5)


def test_beyond_the_edge_of_its_ground_it_rests_as_on_level_ground(add_on: Any) -> None:  # noqa: ARG001
    scene = build("idle", "bumps")
    for vertex in scene.ground.data.vertices:
        vertex.co.x += 100.0
    scene.ground.data.update()
    np.testing.assert_allclose(raised(scene, 0.0), raised(build("idle", "plane"), 0.0), atol=1e-5)


def test_a_body_that_nothing_can_move_bends_its_arms_to_the_ground(add_on: Any) -> None:  # noqa: ARG001
    scene = build("idle", "slope", change=without_root_bone)
    before = np.array(scene.armature.matrix_world)
    played, surface, length = found(scene)
    assert np.array_equal(np.array(scene.armature.matrix_world), before)
    arms = {name for arm in scene.arms for name in arm}
    moved = {
        path.split('"')[1] for path, _ in keys(scene.armature.animation_data.action) if '"' in path
    }
    assert "root" not in moved
    assert arms <= moved
    assert referee.resting(played, scene.arms, surface, length).share > 0.1


def without_root_bone(settings: Any) -> None:
    settings.root_bone = ""


@pytest.mark.parametrize("ground", ["plane", "bumps"])
@pytest.mark.parametrize("setup", ["idle", "curl"])
@pytest.mark.parametrize("rig", ["octopus_cheli_sanjuan.glb", "nssm_octopus.blend", ""])
def test_no_arm_trembles_between_two_poses(
    rig: str,
    setup: str,
    ground: str,
    add_on: Any,  # noqa: ARG001
    shared_data: Callable[[str], Path],
) -> None:
    """Bones of an artist's rig jumped to and fro by 6° to 15° in single frames, 36 to 51 times."""
    scene = build(setup, ground, shared_data(f"octo/{rig}") if rig else None)
    played = record(scene.armature, moments(scene.start, scene.end), with_skin=False)
    assert referee.jumps(played) == 0
