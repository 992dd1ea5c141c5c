# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin whose bones are not in the middle of it lies on the ground, not above it and not in it."""

from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as referee
from tests.referee.recording import moments, record
from tests.referee.scenes import build
from tests.referee.surface import Surface
from tests.ui.made import prepare
from tests.ui.rig import bind_skin, click, generate, keys, make_octopus

pytestmark = pytest.mark.one_blender

_THICK = 0.05
_ROUND = 12


def skinned(askew: float) -> Any:
    """An octopus whose skin's middle is above its bones by a share of how thick that is."""
    armature = make_octopus()
    points: list[Any] = []
    groups: dict[str, list[int]] = {}
    for bone in armature.data.bones:
        if not bone.name.startswith("Arm"):
            continue
        head, tail = np.array(bone.head_local), np.array(bone.tail_local)
        along = (tail - head) / np.linalg.norm(tail - head)
        up = np.array([0.0, 0.0, 1.0])
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            for angle in np.linspace(0.0, 2.0 * np.pi, _ROUND, endpoint=False):
                ring = np.cos(angle) * up + np.sin(angle) * np.cross(along, up)
                groups.setdefault(bone.name, []).append(len(points))
                points.append(head + share * (tail - head) + _THICK * (ring + askew * up))
    bind_skin(armature, points, groups)
    bpy.context.view_layer.objects.active = armature
    click("detect_arms")
    click("add_route")
    bpy.context.view_layer.objects.active = armature
    armature.octo_motion.locomotion.gait = "walk"
    return armature


def heights(armature: Any) -> tuple[np.ndarray, np.ndarray]:
    """Arm lengths above the ground of the lowest skin of bones that lie (moments,), and of all
    skin, at the frames and half way between them."""
    generate(armature)
    shot = prepare(armature, bpy.context)
    for _ in shot.compute():
        pass
    assert shot.standing is not None
    length, scene = shot.generator.arm_length * shot.scale, bpy.context.scene
    skin: Any = bpy.data.objects["Skin"]
    numbers = {group.name: group.index for group in skin.vertex_groups}
    owner = np.array([vertex.groups[0].group for vertex in skin.data.vertices])
    lying, lowest = [], []
    for moment in range(0, 2 * len(shot.frames) - 1, 3):
        frame = shot.frames[0] + 0.5 * moment
        scene.frame_set(int(frame), subframe=float(frame % 1.0))
        evaluated = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = evaluated.to_mesh()
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", points.ravel())
        evaluated.to_mesh_clear()
        matrix = np.array(skin.matrix_world)
        world = points.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        above = (world[:, 2] - shot.standing.ground.height(world)) / length
        lowest.append(above.min())
        ends = [shot.every * each for each in (moment // 2, (moment + 1) // 2)]
        for arm, rests in zip(shot.arms, shot.in_contact, strict=True):
            for place, name in enumerate(arm.bones):
                if rests[ends][:, place : place + 2].all():
                    lying.append(above[owner == numbers[name]].min())
    assert len(lying) > 100
    return np.array(lying), np.array(lowest)


@pytest.mark.parametrize("askew", [0.5, 0.8, 1.3])
def test_skin_that_is_above_its_bones_lies_on_the_ground_and_not_in_it(askew: float) -> None:
    lying, lowest = heights(skinned(askew))
    # Room for a little roll; and where all of it is above the bones, these lie just above ground.
    most = 0.012 + max(askew - 1.0 + 0.12, 0.0) * _THICK
    assert np.median(lying) < most
    assert lowest.min() > -0.005


def test_skin_that_is_round_about_its_bones_lies_as_it_always_did() -> None:
    lying, lowest = heights(skinned(0.0))
    assert np.median(lying) == pytest.approx(0.0, abs=0.004)
    assert lowest.min() > -0.005


@pytest.mark.parametrize("gait", ["walk", "crawl"])
def test_in_place_an_octopus_of_such_a_skin_is_where_it_began(gait: str) -> None:
    armature = skinned(0.8)
    settings = armature.octo_motion.locomotion
    settings.travel_on, settings.gait, settings.cycle_time = "NONE", gait, 1.0
    action = generate(armature)
    for (path, _), values in keys(action).items():
        assert values[0, 1] == pytest.approx(values[-1, 1], abs=1e-5), path


@pytest.mark.parametrize("setup", ["walk", "tiptoe", "settle"])
def test_on_stairs_no_edge_cuts_an_arm_and_no_arm_snaps_over_one(
    setup: str,
    add_on: Any,  # noqa: ARG001
) -> None:
    scene = build(setup, "stairs")
    played = record(scene.armature, moments(scene.start, scene.end))
    length, surface = referee.arm_length(played, scene.arms), Surface.of(scene.ground)
    # 0.3 %, 0.2 % and 0.5 %, where it was 2.9 %, 3.9 % and 2.3 % of an arm.
    assert referee.sink(played, surface, length).deepest.value <= 0.005
    # 23°, 19° and 13°, where it was 48° and 36° in the first two.
    assert referee.turns(played).value <= 35.0
