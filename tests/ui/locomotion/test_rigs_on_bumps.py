# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs that artists build otherwise than ours: few stiff bones, arms that hang, unequal arms."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.ui.locomotion.reading.rig import bones_of
from octo_motion.ui.locomotion.writing import shot as workflow
from tests.ui.locomotion.test_generate_on_rigs import opened
from tests.ui.made import prepare
from tests.ui.rig import click

pytestmark = pytest.mark.one_blender

STIFF = (0.12, 0.34, 0.34, 0.2)
"""Lengths of four bones of which two are as good as all."""


def rig(lengths: list[tuple[float, ...]], slope: float) -> Any:
    """A root bone and arms all round it, left and right by turns, active.

    Args:
        lengths: of each arm's bones.
        slope: radians that they point upwards of outward at rest.
    """
    armature: Any = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    armature.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    root = bones.new("Root")
    root.head, root.tail = (0.0, 0.0, 0.1), (0.0, 0.0, 0.3)
    for number, own in enumerate(lengths):
        side = "LR"[number % 2]
        angle = np.pi * (number // 2 + 0.5) / (len(lengths) // 2) * (-1.0 if side == "R" else 1.0)
        outward = np.array([np.sin(angle), -np.cos(angle), 0.0])
        along = np.cos(slope) * outward + np.array([0.0, 0.0, np.sin(slope)])
        head, parent = np.array([0.0, 0.0, 0.1]) + 0.1 * outward, root
        for joint, length in enumerate(own):
            bone = bones.new(f"Arm{number // 2 + 1}_{joint + 1}.{side}")
            bone.head, bone.tail = head, head + length * along
            bone.parent, bone.use_connect = parent, joint > 0
            head, parent = head + length * along, bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def figures_on_bumps(armature: Any, setup: str) -> dict[str, float]:
    """What the report says of a set-up on bumps of 0.3 arm lengths, angles in degrees."""
    bpy.context.view_layer.objects.active = armature
    armature.select_set(state=True)
    click("detect_arms")
    settings = armature.octo_motion.locomotion
    bpy.ops.octo_motion.setup_load(name=setup)
    lengths = [
        sum(armature.data.bones[bone].length for bone in bones_of(arm)) for arm in settings.arms
    ]
    unit = float(np.mean(lengths)) * armature.matrix_world.to_scale()[0]
    middle = np.array(armature.matrix_world.translation) * (1.0, 1.0, 0.0)
    bent = ((-2.0, 0.6, 0.0), (-0.7, -0.8, 0.0), (0.5, 0.9, 0.0), (2.0, 0.0, 0.0))
    route = middle + unit * np.array(bent)
    bpy.ops.octo_motion.add_route(**dict(zip(("b0", "b1", "b2", "b3"), route, strict=True)))
    steps = np.arange(-6.0, 6.0, 0.05)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    z = 0.15 * np.sin(2.0 * np.pi * x / 1.4) * np.cos(2.0 * np.pi * y / 1.2)
    corner = np.arange(x.size).reshape(x.shape)
    faces = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1)
    mesh = bpy.data.meshes.new("Bumps")
    points = unit * np.stack([x, y, z], axis=-1).reshape(-1, 3)
    mesh.from_pydata(points.tolist(), [], faces.reshape(-1, 4).tolist())
    ground = bpy.data.objects.new("Bumps", mesh)
    ground.location = middle
    bpy.context.scene.collection.objects.link(ground)
    bpy.context.view_layer.update()
    settings.ground.object = ground
    made = prepare(armature, bpy.context)
    for _ in made.compute():
        pass
    made.write()
    found = {each.kind: each.value for each in settings.figures}
    found["BONES"] = made.depth_of_bones
    found["JOINTS"] = float(np.degrees(made.turn_at_joints))
    return found


def hold_up(found: dict[str, float], slip: float = 0.0025) -> None:
    """The limits that a motion on bumps is held to, in arm lengths and degrees per frame."""
    assert found["SLIP"] <= slip  # measured: 0.0003 to 0.0012
    assert found["BONES"] <= 0.0015  # measured: 0, and 0.0008 where a rig of few bones hurries
    assert found["JOINTS"] <= 45.0  # measured: 17 to 28 on rigs made here, up to 38 on artists' own


@pytest.mark.parametrize("setup", ["walk", "crawl"])
def test_arms_of_four_stiff_bones_bend_at_one_knee_that_stays_up(setup: str) -> None:
    hold_up(figures_on_bumps(rig([STIFF] * 8, 0.0), setup))


@pytest.mark.parametrize("setup", ["walk", "tiptoe"])
def test_six_unequal_arms_that_hang_at_rest_neither_snap_nor_slide(setup: str) -> None:
    arms = [tuple(np.full(10, length / 10.0)) for length in (1.0, 1.0, 0.9, 0.9, 1.1, 1.1)]
    hold_up(figures_on_bumps(rig(arms, np.radians(-78.0)), setup))


@pytest.mark.parametrize(
    ("file", "name", "setup"),
    [
        ("nssm_octopus.blend", "Armature", "walk"),
        ("nssm_octopus.blend", "Armature", "tiptoe"),
        *(("octopus_cheli_sanjuan.glb", "Object_6", setup) for setup in ("walk", "hurry", "crawl")),
        ("octopus_cheli_sanjuan.glb", "Object_6", "tiptoe"),
        ("rigify_simple_tentacle_8arm.blend", "RIG-octo_meta", "tiptoe"),
    ],
)
def test_rigs_of_artists_go_over_bumps(
    shared_data: Callable[[str], Path], file: str, name: str, setup: str
) -> None:
    found = figures_on_bumps(opened(shared_data(f"octo/{file}"), name), setup)
    # Who hurries, or goes on tiptoe, on bones this long slides more: 0.0055 and 0.0026.
    hold_up(found, slip={"hurry": 0.011, "tiptoe": 0.005}.get(setup, 0.0025))


@pytest.mark.parametrize("arms", [6, 10])
def test_however_many_arms_there_are_the_rear_pair_tiptoes(arms: int) -> None:
    armature = rig([(0.1,) * 10] * arms, 0.0)
    figures_on_bumps(armature, "tiptoe")
    shot = prepare(armature, bpy.context)
    assert shot.standing is not None
    pairs = {shot.arms[each.arm].pair for each in shot.standing.walk.footholds()}
    assert pairs == {arms // 2}


def test_what_is_told_of_arms_that_cannot_stretch_helps_them() -> None:
    armature = rig([STIFF] * 8, 0.0)
    figures_on_bumps(armature, "tiptoe")
    settings = armature.octo_motion.locomotion
    settings.height_mode, settings.height = "MANUAL", 0.95
    summary = workflow.generate_locomotion(armature, bpy.context)
    (told,) = [each for each in summary.warnings if "out of reach" in each]
    assert "lower Height" in told
    assert "Stretch" not in told
    settings.height_mode = "AUTO"
    assert not [
        each
        for each in workflow.generate_locomotion(armature, bpy.context).warnings
        if "out of reach" in each
    ]
