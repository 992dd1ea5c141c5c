# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms of real rigs as artists bring them, and of bodies that have none."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.armature import read_skeleton, world_directions
from octo_motion.core.errors import RigError
from octo_motion.core.locomotion.rig.arm_chains import ArmChain
from octo_motion.core.locomotion.rig.detection import Detection, detect_arms

Data = Callable[[str], Path]

HUMANOIDS = (
    "animated_drawings/rokoko_jesse_dance.bvh",
    "cmu/01_01_hops.bvh",
    "cmu/02_02_walk_daz43.bvh",
    "cmu/03_01_lowercase_names.bvh",
    "cmu/111_28_renamed_mixamorig.bvh",
    "makehuman/tpose.bvh",
    "rigs_with_actions/KayKit_Knight.glb",
    "rigs_with_actions/Quaternius_Superhero_Male.glb",
    "rigs_with_actions/RobotExpressive.glb",
    "secondlife/avatar_walk.bvh",
)


def load(path: Path) -> dict[str, Any]:
    """The armatures of a file, by name."""
    importers: dict[str, Any] = {
        ".blend": bpy.ops.wm.open_mainfile,
        ".glb": bpy.ops.import_scene.gltf,
        ".fbx": bpy.ops.import_scene.fbx,
        ".bvh": bpy.ops.import_anim.bvh,
    }
    importers[path.suffix](filepath=str(path))
    bpy.context.view_layer.update()
    return {each.name: each for each in bpy.data.objects if each.type == "ARMATURE"}


def detect(armature: Any) -> Detection:
    return detect_arms(read_skeleton(armature), *world_directions(armature))


def roots(arms: tuple[ArmChain, ...]) -> list[tuple[str, str, int]]:
    return [(arm.bones[0], arm.side, arm.pair) for arm in arms]


def degrees(arms: tuple[ArmChain, ...]) -> list[float]:
    return [float(np.degrees(arm.azimuth)) for arm in arms]


def test_six_arms_with_helpers_and_odd_names_at_a_hundredth_of_the_scale(
    shared_data: Data,
) -> None:
    (armature,) = load(shared_data("octo/octopus_cheli_sanjuan.glb")).values()
    assert armature.matrix_world.to_scale().x == pytest.approx(0.01, rel=1e-3)
    found = detect(armature)
    assert roots(found.arms) == [
        ("joint57_L_054", "LEFT", 1),
        ("joint57_R_024", "RIGHT", 1),
        ("joint47_L_044", "LEFT", 2),
        ("joint47_R_014", "RIGHT", 2),
        ("joint37_L_034", "LEFT", 3),
        ("joint37_R_04", "RIGHT", 3),
    ]
    # As the arms leave the body; further on they hang down.
    np.testing.assert_allclose(degrees(found.arms), [11.7, -11.7, 110, -110, 164, -164], atol=0.5)
    for arm in found.arms:
        assert len(arm.bones) == 10
        assert not any("scaleCompensation" in bone for bone in arm.bones)
    assert (found.front, found.root_bone, found.notes) == ("-Y", "_rootJoint", ())


def test_two_root_bones_and_a_body_that_faces_sideways(shared_data: Data) -> None:
    (armature,) = load(shared_data("octo/nssm_octopus.blend")).values()
    found = detect(armature)
    # Its mantle lies along +X, four arms point along -X and two to each side.
    assert found.front == "-X"
    assert "Front was set to -X" in found.notes[0]
    assert roots(found.arms) == [
        ("Bone.009", "LEFT", 1),
        ("Bone.008", "RIGHT", 1),
        ("Bone.007", "LEFT", 2),
        ("Bone.004", "RIGHT", 2),
        ("Bone.006", "LEFT", 3),
        ("Bone.003", "RIGHT", 3),
        ("Bone.005", "LEFT", 4),
        ("Bone.002", "RIGHT", 4),
    ]
    assert found.arms[1].bones == ("Bone.008", "Bone.030", "Bone.034", "Bone.038")
    assert found.root_bone == ""


def test_a_rigify_rig_lists_its_control_bones(shared_data: Data) -> None:
    armatures = load(shared_data("octo/rigify_simple_tentacle_8arm.blend"))
    metarig, rig = detect(armatures["octo_meta"]), detect(armatures["RIG-octo_meta"])
    expected = [
        (f"arm{5 - pair}_01.{side[0]}", side, pair)
        for pair in (1, 2, 3, 4)
        for side in ("LEFT", "RIGHT")
    ]
    for found in (metarig, rig):
        assert roots(found.arms) == expected
        angles = [22.5, -22.5, 67.5, -67.5, 112.5, -112.5, 157.5, -157.5]
        np.testing.assert_allclose(degrees(found.arms), angles, atol=0.1)
    assert (metarig.root_bone, metarig.notes) == ("body", ())
    assert rig.root_bone == "root"
    assert "Constraints move the bones that deform 8 arms" in rig.notes[0]
    assert "40 of these have constraints of their own" in rig.notes[1]


def test_keys_on_the_listed_bones_of_a_rigify_rig_move_what_deforms(shared_data: Data) -> None:
    armature = load(shared_data("octo/rigify_simple_tentacle_8arm.blend"))["RIG-octo_meta"]
    arm = detect(armature).arms[0]
    deforming = armature.pose.bones["DEF-" + arm.bones[-1]]
    before = deforming.tail.copy()
    control = armature.pose.bones[arm.bones[0]]
    control.rotation_mode = "XYZ"
    control.rotation_euler = (0.5, 0.0, 0.0)
    bpy.context.view_layer.update()
    assert (deforming.tail - before).length > 0.5


def test_64_chains_that_lie_over_one_another(shared_data: Data) -> None:
    armatures = load(shared_data("octo/InfiniteSkinnedTentacle.glb"))
    (armature,) = armatures.values()
    assert len(armature.data.bones) == 840
    found = detect(armature)
    assert len(found.arms) == 64
    assert {len(arm.bones) for arm in found.arms} == {10}
    assert len({bone for arm in found.arms for bone in arm.bones}) == 640
    assert "64 arms stand upright" in found.notes[0]


def test_two_chains_one_behind_the_other(shared_data: Data) -> None:
    (armature,) = load(shared_data("octo/assimp_animation_with_skeleton.fbx")).values()
    found = detect(armature)
    assert {arm.bones for arm in found.arms} == {
        ("Bone", *(f"Bone.{number:03}" for number in range(1, 7))),
        tuple(f"Bone.{number:03}" for number in range(7, 14)),
    }
    # Both point along +X.
    assert {arm.side for arm in found.arms} == {"LEFT"}


# Blender's importer of BVH leaves its file open.
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", HUMANOIDS)
def test_humanoids_get_a_clear_answer(shared_data: Data, name: str) -> None:
    for armature in load(shared_data(name)).values():
        with pytest.raises(RigError, match=r"limbs of a body.*Select the bones of one arm"):
            detect(armature)


@pytest.mark.parametrize(("arms", "joints"), [(8, 12), (6, 3), (5, 30), (64, 4)])
def test_our_own_octopus(arms: int, joints: int) -> None:
    operators: Any = bpy.ops.octo_motion
    assert operators.add_octopus(arms=arms, joints=joints) == {"FINISHED"}
    (armature,) = (each for each in bpy.data.objects if each.type == "ARMATURE")
    found = detect(armature)
    assert len(found.arms) == arms
    assert {len(arm.bones) for arm in found.arms} == {joints}
    # An odd one in front.
    odd, sector = arms % 2, 360.0 / arms
    places = [sector * (pair + 0.5 + 0.5 * odd) for pair in range(arms // 2)]
    expected = [0.0] * odd + [place * side for place in places for side in (1, -1)]
    np.testing.assert_allclose(degrees(found.arms), expected, atol=1e-3)
    for arm in found.arms:
        # Names and geometry agree: arm1.01.L … arm4.12.R, an odd one without a side.
        number, _, rest = arm.bones[0].removeprefix("arm").partition(".")
        assert int(number) == arm.pair
        side = {"L": "LEFT", "R": "RIGHT"}.get(rest.rpartition(".")[2], "CENTER")
        assert arm.side == side
    assert (found.front, found.up, found.notes) == ("-Y", "Z", ())
    assert found.root_bone == "root"
