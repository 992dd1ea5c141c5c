# SPDX-License-Identifier: GPL-3.0-or-later
"""Any armature is taken for a puppet, posed, and shows exactly the puppet's pose."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.puppet import Puppet
from octo_motion.blender.rig.puppet_reading import mark_bones, moved_bones, read_rig
from octo_motion.core.errors import RigError
from octo_motion.core.posing.puppet.figure import Figure, Pose
from octo_motion.core.rotations import (
    angle_between,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
)

# Blender's importers leave files to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

CLOSE = 2e-5
"""Puppet metres and radians: bones have single precision, some chains have a dozen of them."""


def octopus(**properties: Any) -> Any:
    bpy.ops.octo_motion.add_octopus(**properties)
    return bpy.context.object


def armatures() -> list[Any]:
    return [each for each in bpy.data.objects if each.type == "ARMATURE"]


def opened(path: Path) -> list[Any]:
    """The armatures of a file of any kind."""
    operators: Any = bpy.ops
    if path.suffix == ".glb":
        operators.import_scene.gltf(filepath=str(path))
    elif path.suffix == ".blend":
        operators.wm.open_mainfile(filepath=str(path))
    else:
        operators.octo_motion.import_clips(filepath=str(path))
    bpy.context.view_layer.update()
    return armatures()


def bent(figure: Figure, pose: Pose, seed: int = 1, size: float = 0.3) -> Pose:
    """The pose with every joint turned at random, and the root moved."""
    rng = np.random.default_rng(seed)
    positions, orientations = pose.positions.copy(), pose.orientations.copy()
    for body, parent in enumerate(figure.parents):
        turn = from_rotation_vector(rng.normal(0.0, size, 3))
        if parent < 0:
            orientations[body] = multiply(pose.orientations[body], turn)
            positions[body] += rng.normal(0.0, 0.1, 3)
        else:
            own = multiply(conjugate(pose.orientations[parent]), pose.orientations[body])
            orientations[body] = multiply(orientations[parent], multiply(own, turn))
            positions[body] = positions[parent] + rotate(orientations[parent], figure.anchors[body])
    return Pose(positions, orientations)


def assert_shows_its_pose(armature: Any) -> Puppet:
    puppet = Puppet(armature)
    wanted = bent(puppet.figure, puppet.rig.pose)
    puppet.write(wanted)
    bpy.context.view_layer.update()
    shown = puppet.read()
    assert np.abs(shown.positions - wanted.positions).max() < CLOSE
    assert angle_between(shown.orientations, wanted.orientations).max() < CLOSE
    return puppet


def test_octopus_has_a_limb_for_each_bone_but_root_and_eyes() -> None:
    figure = read_rig(octopus()).figure
    assert len(figure) == 100
    assert not {"root", "eye.L", "eye.R"} & set(figure.names)
    assert figure.parents.count(-1) == 1


def test_arms_of_the_octopus_are_as_thick_as_its_skin() -> None:
    rig = read_rig(octopus(first_diameter=0.07))
    first = rig.figure.names.index("arm2.03.L")
    # The skin is a tube about the bones; of a tapering arm's third bone, in metres of the world.
    assert rig.figure.radii[first] / rig.unit == pytest.approx(0.03, rel=0.25)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_puppet_is_the_same_whatever_the_armatures_scale(scale: float) -> None:
    armature = octopus()
    expected = read_rig(armature).figure
    armature.scale = (scale,) * 3
    bpy.context.view_layer.update()
    figure = read_rig(armature).figure
    assert figure.lengths == pytest.approx(expected.lengths, rel=1e-4)
    assert figure.masses == pytest.approx(expected.masses, rel=1e-3)


def test_pose_is_shown_with_every_rotation_mode_scale_and_kind_of_inheritance() -> None:
    armature = octopus()
    armature.location, armature.rotation_euler = (1.0, 2.0, 3.0), (0.3, 0.4, 0.5)
    armature.scale = (2.0, 2.0, 2.0)
    bones = armature.pose.bones
    bones["arm1.03.L"].rotation_mode = "XYZ"
    bones["arm1.04.L"].rotation_mode = "AXIS_ANGLE"
    bones["arm1.05.L"].rotation_mode = "ZXY"
    bones["root"].location, bones["root"].rotation_quaternion = (
        (0.1, 0.2, 0.3),
        (0.9, 0.1, 0.2, 0.3),
    )
    bones["root"].scale = (1.5, 1.5, 1.5)
    bones["arm3.02.R"].rotation_quaternion = (0.9, 0.1, 0.2, 0.3)
    armature.data.bones["arm2.05.L"].use_inherit_rotation = False
    armature.data.bones["body"].use_local_location = False
    bpy.context.view_layer.update()
    assert_shows_its_pose(armature)
    assert bones["arm1.03.L"].rotation_mode == "XYZ"


def test_pose_that_is_not_changed_changes_no_value() -> None:
    armature = octopus()
    armature.pose.bones["arm3.02.R"].rotation_quaternion = (0.9, 0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    puppet = Puppet(armature)
    before = [[tuple(row) for row in bone.matrix_basis] for bone in armature.pose.bones]
    puppet.write(puppet.rig.pose)
    after = [[tuple(row) for row in bone.matrix_basis] for bone in armature.pose.bones]
    assert np.abs(np.array(after) - np.array(before)).max() < 1e-6


def test_bones_that_the_puppet_does_not_move_are_not_written() -> None:
    armature = octopus()
    puppet = Puppet(armature)
    puppet.write(puppet.rig.pose)
    pose = puppet.rig.pose
    orientations = pose.orientations.copy()
    tip = puppet.figure.names.index("arm1.12.L")
    orientations[tip] = multiply(orientations[tip], from_rotation_vector(np.array([0.1, 0.0, 0.0])))
    assert puppet.write(Pose(pose.positions, orientations)) == ["arm1.12.L"]
    assert puppet.write(Pose(pose.positions, orientations)) == []


KNIGHT = "rigs_with_actions/KayKit_Knight.glb"
REAL = (
    (KNIGHT, 20),
    ("rigs_with_actions/Quaternius_Superhero_Male.glb", 52),
    ("rigs_with_actions/RobotExpressive.glb", 37),
    ("octo/octopus_cheli_sanjuan.glb", 63),
    ("octo/nssm_octopus.blend", 38),
    ("octo/assimp_animation_with_skeleton.fbx", 14),
    ("secondlife/avatar_punch_L.bvh", 21),
    ("cmu/12_01_walk.bvh", 31),
    ("makehuman/walk1.bvh", 65),
    ("animated_drawings/rokoko_jesse_dance.bvh", 60),
)
"""Files, and how many limbs they have."""


@pytest.mark.parametrize(("file", "bodies"), REAL)
def test_real_rig_becomes_one_puppet_and_shows_its_pose(
    shared_data: Callable[[str], Path], file: str, bodies: int
) -> None:
    (armature,) = opened(shared_data(file))
    puppet = assert_shows_its_pose(armature)
    figure = puppet.figure
    assert len(figure) == bodies
    assert figure.parents.count(-1) == 1
    assert (figure.radii > 0.0).all()
    assert (figure.lengths > 0.0).all()


def test_helpers_of_the_knight_follow(shared_data: Callable[[str], Path]) -> None:
    (armature,) = opened(shared_data(KNIGHT))
    names = set(read_rig(armature).figure.names)
    assert {"hips", "chest", "head", "lowerarm.l", "toes.r"} <= names
    assert not {"root", "handIK.l", "elbowIK.r", "control-heel-roll.l", "handslot.r"} & names


def test_control_rig_of_rigify_is_posed_by_its_controls_once_their_constraints_are_muted(
    shared_data: Callable[[str], Path],
) -> None:
    opened(shared_data("octo/rigify_simple_tentacle_8arm.blend"))
    rig: Any = bpy.data.objects["RIG-octo_meta"]
    # Each control but an arm's first copies the rotation of the one before.
    as_it_is = read_rig(rig)
    assert all(name.startswith("DEF-") for name in as_it_is.figure.names)
    assert {"arm1_01.L", "arm1_06.L"} <= set().union(*as_it_is.needs.values())
    for bone in rig.pose.bones:
        if not bone.name.startswith(("DEF-", "ORG-")):
            for constraint in bone.constraints:
                constraint.mute = True
    muted = read_rig(rig)
    names = set(muted.figure.names)
    assert {"root", "arm1_01.L", "arm1_06.L", "arm4_03.R"} <= names
    assert not any(name.startswith(("DEF-", "ORG-", "MCH-")) for name in names)
    assert muted.roles.driven == ()


# --- Constraints, limits, marks ------------------------------------------------------------------


def test_bone_under_inverse_kinematics_only_follows() -> None:
    armature = octopus(with_mesh=False)
    constraint = armature.pose.bones["arm1.12.L"].constraints.new("IK")
    constraint.target, constraint.subtarget, constraint.chain_count = armature, "root", 3
    bpy.context.view_layer.update()
    assert moved_bones(armature) == {"arm1.12.L", "arm1.11.L", "arm1.10.L"}
    assert "arm1.09.L" in read_rig(armature).figure.names
    assert "arm1.10.L" not in read_rig(armature).figure.names
    constraint.mute = True
    bpy.context.view_layer.update()
    assert "arm1.10.L" in read_rig(armature).figure.names


def test_limits_of_a_constraint_become_ranges_each_way_as_they_are() -> None:
    armature = octopus(with_mesh=False)
    limit = armature.pose.bones["arm1.03.L"].constraints.new("LIMIT_ROTATION")
    limit.owner_space = "LOCAL"
    limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    limit.min_x, limit.max_x, limit.min_z, limit.max_z = -0.2, 0.6, -0.5, 0.5
    limit.min_y, limit.max_y = -0.1, 0.3
    figure = read_rig(armature).figure
    joint = figure.names.index("arm1.03.L")
    wanted = [[-0.2, 0.6], [-0.1, 0.3], [-0.5, 0.5]]
    assert figure.limits[joint] == pytest.approx(np.array(wanted))
    assert figure.limits[joint + 1] == pytest.approx(np.tile([-np.pi, np.pi], (3, 1)))


def test_limits_of_inverse_kinematics_count_too() -> None:
    armature = octopus(with_mesh=False)
    bone = armature.pose.bones["arm1.03.L"]
    bone.use_ik_limit_x, bone.ik_min_x, bone.ik_max_x = True, -0.3, 0.1
    bone.lock_ik_z = True
    figure = read_rig(armature).figure
    ranges = figure.limits[figure.names.index("arm1.03.L")]
    assert ranges[0] == pytest.approx([-0.3, 0.1])
    assert ranges[1] == pytest.approx([-np.pi, np.pi])
    # Locked is a hair's breadth wide: the pose that is shown lies in it.
    assert ranges[2] == pytest.approx([0.0, 0.0], abs=2e-3)
    # What a constraint says about an axis goes before.
    limit = bone.constraints.new("LIMIT_ROTATION")
    limit.owner_space, limit.use_limit_x, limit.min_x, limit.max_x = "LOCAL", True, 0.0, 2.0
    ranges = read_rig(armature).figure.limits[figure.names.index("arm1.03.L")]
    assert ranges[0] == pytest.approx([0.0, 2.0], abs=2e-3)
    assert ranges[2] == pytest.approx([0.0, 0.0], abs=2e-3)


def test_muted_limit_limits_nothing() -> None:
    armature = octopus(with_mesh=False)
    limit = armature.pose.bones["arm1.03.L"].constraints.new("LIMIT_ROTATION")
    limit.owner_space, limit.mute = "LOCAL", True
    limit.use_limit_y, limit.min_y, limit.max_y = True, -0.1, 0.3
    figure = read_rig(armature).figure
    ranges = figure.limits[figure.names.index("arm1.03.L")]
    assert ranges[1] == pytest.approx([-np.pi, np.pi])


def test_bone_whose_rotation_is_locked_follows() -> None:
    armature = octopus(with_mesh=False)
    armature.pose.bones["arm1.03.L"].lock_rotation = (True, True, True)
    assert "arm1.03.L" not in read_rig(armature).figure.names


def test_marks_of_the_artist_decide() -> None:
    armature = octopus()
    mark_bones(armature, ["siphon"], "FOLLOW")
    mark_bones(armature, ["eye.L"], "BODY")
    names = read_rig(armature).figure.names
    assert "siphon" not in names
    assert "eye.L" in names
    mark_bones(armature, ["siphon", "eye.L"], "")
    assert "siphon" in read_rig(armature).figure.names


def test_stiff_part_that_hangs_on_a_bone_makes_it_a_limb_as_thick_as_itself() -> None:
    armature = octopus(with_mesh=False)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.05)
    ball: Any = bpy.context.object
    ball.parent, ball.parent_type, ball.parent_bone = armature, "BONE", "siphon"
    bpy.context.view_layer.update()
    assert read_rig(armature).figure.names == ("siphon",)


# --- What cannot be posed ------------------------------------------------------------------------


def test_armature_without_bones_is_refused() -> None:
    empty = bpy.data.objects.new("Empty", bpy.data.armatures.new("Empty"))
    bpy.context.scene.collection.objects.link(empty)
    with pytest.raises(RigError, match="'Empty' has no bones"):
        read_rig(empty)


def test_armature_with_too_many_limbs_is_refused() -> None:
    armature = octopus(with_mesh=False, arms=24, joints=14)
    with pytest.raises(RigError, match=r"'Octopus' has 340 limbs, more than 300\. Raise Smallest"):
        read_rig(armature)
    assert len(read_rig(armature, smallest=0.02).figure) <= 300


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        ((1.0, 2.0, 1.0), "scaled unequally"),
        ((0.0, 0.0, 0.0), "has no size"),
        ((-1.0, 1.0, 1.0), "mirrored by a negative scale"),
    ],
)
def test_odd_scale_is_refused(scale: tuple[float, float, float], said: str) -> None:
    armature = octopus(with_mesh=False)
    armature.scale = scale
    bpy.context.view_layer.update()
    with pytest.raises(RigError, match=said):
        read_rig(armature)


def test_armature_that_is_deleted_or_changed_meanwhile_is_noticed() -> None:
    armature = octopus(with_mesh=False)
    puppet = Puppet(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones.remove(armature.data.edit_bones["siphon"])
    bpy.ops.object.mode_set(mode="OBJECT")
    with pytest.raises(RigError, match="have changed"):
        puppet.armature()
    bpy.data.objects.remove(armature)
    with pytest.raises(RigError, match="is gone"):
        puppet.armature()
