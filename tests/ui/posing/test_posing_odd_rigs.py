# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs that are put together in unusual ways: what is shown and keyed is what the hand has done."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.puppet import Puppet
from octo_motion.blender.rig.puppet_reading import MATERIAL, bone_materials, moved_bones
from octo_motion.blender.scene.surfaces import read_obstacle
from octo_motion.core.errors import OctoMotionError, RigError
from octo_motion.core.posing.puppet.figure import Pose
from octo_motion.core.posing.solver.obstacle_shapes import Box, Plane
from octo_motion.core.rotations import angle_between, from_rotation_vector, multiply, rotate
from octo_motion.ui.posing.puppet_session import PuppetSession

TICK = 1.0 / 60.0


def rig(**bones: tuple[str, tuple[float, ...], tuple[float, ...]]) -> Any:
    """An armature of bones: their parents, heads and tails."""
    data = bpy.data.armatures.new("Rig")
    armature: Any = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (parent, head, tail) in bones.items():
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = head, tail
        bone.parent = data.edit_bones.get(parent)
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def chain() -> Any:
    return rig(
        hip=("", (0, 0, 0), (0, 0, 0.5)),
        thigh=("hip", (0, 0, 0.5), (0, 0, 1)),
        shin=("thigh", (0, 0, 1), (0, 0, 1.5)),
        toe=("shin", (0, 0, 1.5), (0, 0, 2)),
    )


def legs() -> Any:
    """A foot that hangs on the shin by its place, and on the root in Blender."""
    return rig(
        root=("", (0, 0, 0), (0, 0.4, 0)),
        thigh=("root", (0, 0, 0.1), (0, 0, 1)),
        shin=("thigh", (0, 0, 1), (0, 0, 2)),
        foot=("root", (0, 0, 2), (0, 0.5, 2)),
    )


def turned(puppet: Puppet, bone: str, vector: tuple[float, float, float]) -> Pose:
    """A limb turned about its joint, with all that hangs on it."""
    figure, pose = puppet.figure, puppet.rig.pose
    body = figure.names.index(bone)
    turn = from_rotation_vector(np.array(vector))
    positions, orientations = pose.positions.copy(), pose.orientations.copy()
    moved = {body}
    for each, parent in enumerate(figure.parents):
        if parent in moved:
            moved.add(each)
    for each in moved:
        orientations[each] = multiply(turn, orientations[each])
        positions[each] = positions[body] + rotate(turn, positions[each] - positions[body])
    return Pose(positions, orientations)


def assert_shown(puppet: Puppet, pose: Pose) -> None:
    bpy.context.view_layer.update()
    shown = puppet.read()
    assert np.abs(shown.positions - pose.positions).max() < 1e-5
    assert angle_between(shown.orientations, pose.orientations).max() < 1e-5


def channels(armature: Any) -> dict[str, set[str]]:
    """Keyed properties by bone."""
    found: dict[str, set[str]] = {}
    for bag in armature.animation_data.action.layers[0].strips[0].channelbags:
        for curve in bag.fcurves:
            name = curve.data_path.partition('"')[2].partition('"')[0]
            found.setdefault(name, set()).add(curve.data_path.rpartition(".")[2])
    return found


def pull(session: PuppetSession, bone: str, to: tuple[float, float, float]) -> None:
    start = session.grab_bone(bone, 1.0)
    for number in range(1, 41):
        session.tick(TICK, start + min(number / 30.0, 1.0) * (np.array(to) - start))
    session.release()


# --- Tails that an importer made up ---------------------------------------------------------------


def drawn_with_tails(factor: float) -> Any:
    """A body with two arms whose bones are so many times as long as they should be."""
    made = rig(
        hip=("", (0, 0, 0), (0, 0, 0.4)),
        spine=("hip", (0, 0, 0.4), (0, 0, 0.9)),
        head=("spine", (0, 0, 0.9), (0, 0, 1.2)),
        arm_l=("spine", (0.2, 0, 0.9), (0.5, 0, 0.9)),
        fore_l=("arm_l", (0.5, 0, 0.9), (0.75, 0, 0.9)),
        hand_l=("fore_l", (0.75, 0, 0.9), (0.95, 0, 0.9)),
        arm_r=("spine", (-0.2, 0, 0.9), (-0.5, 0, 0.9)),
        fore_r=("arm_r", (-0.5, 0, 0.9), (-0.75, 0, 0.9)),
        hand_r=("fore_r", (-0.75, 0, 0.9), (-0.95, 0, 0.9)),
    )
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in made.data.edit_bones:
        bone.length *= factor
    bpy.ops.object.mode_set(mode="OBJECT")
    return made


@pytest.mark.parametrize("factor", [0.01, 2.5, 100.0])
def test_a_hand_is_pulled_alike_whatever_length_an_importer_gave_to_all_bones(
    factor: float,
) -> None:
    turns = []
    for each in (1.0, factor):
        armature = drawn_with_tails(each)
        session = PuppetSession(armature, bpy.context.scene, clock=None)
        pull(session, "hand_l", (0.7, 0.0, 1.3))
        session.finish()
        bpy.context.view_layer.update()
        turns.append({bone.name: bone.matrix.to_quaternion() for bone in armature.pose.bones})
    rest = armature.data.bones["hand_l"].matrix_local.to_quaternion()
    assert turns[0]["hand_l"].rotation_difference(rest).angle > 0.3
    for name, turn in turns[0].items():
        assert turn.rotation_difference(turns[1][name]).angle < 2e-3


# --- Inheritance -------------------------------------------------------------------------------


def test_bone_that_does_not_inherit_rotation_turns_with_the_limb_it_hangs_on() -> None:
    armature = chain()
    armature.data.bones["shin"].use_inherit_rotation = False
    bpy.context.view_layer.update()
    puppet = Puppet(armature)
    pose = turned(puppet, "thigh", (0.5, 0.0, 0.0))
    assert "shin" in puppet.write(pose)
    assert_shown(puppet, pose)


def test_foot_that_only_its_place_ties_to_the_shin_is_shown_and_keyed_with_it() -> None:
    armature = legs()
    armature.data.bones["root"].use_deform = False
    settings = armature.octo_motion.posing
    settings.root = "HELD"
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    assert session.figure.parents[session.body("foot")] == session.body("shin")
    pull(session, "shin", (0.5, 0.0, 1.8))
    shown = session.core.pose
    session.key()
    session.finish()
    assert channels(armature)["foot"] == {"location", "rotation_quaternion"}
    bpy.context.scene.frame_set(9)
    bpy.context.view_layer.update()
    read = Puppet(armature).read()
    assert np.abs(read.positions - shown.positions).max() < 1e-4
    assert angle_between(read.orientations, shown.orientations).max() < 1e-4


def test_bone_that_does_not_inherit_rotation_is_keyed_with_the_limb_it_hangs_on() -> None:
    armature = chain()
    armature.data.bones["toe"].use_inherit_rotation = False
    bpy.context.view_layer.update()
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    thigh, toe = session.body("thigh"), session.body("toe")
    assert session.puppet.with_followers([thigh]) == [thigh, toe]
    session.core.pin(session.body("hip"), state=True)
    pull(session, "thigh", (0.3, 0.0, 0.9))
    shown = session.core.pose
    session.key()
    session.finish()
    bpy.context.scene.frame_set(9)
    bpy.context.view_layer.update()
    read = Puppet(armature).read()
    assert angle_between(read.orientations, shown.orientations).max() < 3e-3


def test_recorded_location_is_along_the_axes_that_the_bone_is_placed_in() -> None:
    armature = chain()
    armature.data.bones["hip"].use_local_location = False
    armature.octo_motion.posing.root = "FREE"
    bpy.context.view_layer.update()
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    scene = bpy.context.scene
    session.record()
    start = session.grab_bone("hip", 0.5)
    for number in range(1, 31):
        session.tick(TICK, start + np.array([0.0, 0.02 * number, 0.01 * number]))
        scene.frame_set(1 + number)
    shown = session.core.pose
    session.stop_record()
    session.finish()
    scene.frame_set(1)
    scene.frame_set(31)
    read = Puppet(armature).read()
    size = np.linalg.norm(shown.positions[0])
    assert size > 0.1
    assert np.abs(read.positions - shown.positions).max() < 0.02


# --- Locks -------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["XYZ", "QUATERNION"])
def test_locked_axes_are_not_turned_about(mode: Any) -> None:
    armature = chain()
    bone = armature.pose.bones["shin"]
    bone.rotation_mode = mode
    bone.lock_rotation = (False, True, True)
    bpy.context.view_layer.update()
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    session.core.pin(session.body("thigh"), state=True)
    pull(session, "shin", (0.35, 0.25, 1.2))
    session.finish()
    angles = bone.matrix_basis.to_euler("XYZ")
    assert abs(angles.x) > 0.2
    assert angles.y == pytest.approx(0.0, abs=2e-3)
    assert angles.z == pytest.approx(0.0, abs=2e-3)


def test_muted_driver_turns_nothing() -> None:
    armature = chain()
    curve = armature.pose.bones["shin"].driver_add("rotation_euler", 0)
    assert moved_bones(armature) == {"shin"}
    curve.mute = True
    assert moved_bones(armature) == frozenset()


# --- Numbers that are none ------------------------------------------------------------------------


def test_pose_that_is_no_pose_is_refused() -> None:
    armature = chain()
    armature.pose.bones["shin"].location.x = float("nan")
    bpy.context.view_layer.update()
    with pytest.raises(RigError, match="'Rig' has bones posed at undefined positions"):
        PuppetSession(armature, bpy.context.scene)


def test_armature_and_obstacle_that_are_nowhere_are_told() -> None:
    armature = chain()
    item = bpy.data.objects.new("Lost", None)
    bpy.context.collection.objects.link(item)
    item.octo_motion.posing.obstacle = "BOX"
    item.location.x = NAN
    bpy.context.view_layer.update()
    with pytest.raises(RigError, match="The obstacle 'Lost' is at an undefined position"):
        PuppetSession(armature, bpy.context.scene)
    item.location.x = 0.0
    bpy.context.view_layer.update()
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    armature.location.x = NAN
    bpy.context.view_layer.update()
    with pytest.raises(RigError, match="'Rig' is at an undefined position"):
        session.tick(TICK)
    session.cancel()
    with pytest.raises(RigError, match="'Rig' is at an undefined position"):
        PuppetSession(armature, bpy.context.scene)


def test_bone_that_is_scaled_to_nothing_keeps_nobody_from_posing() -> None:
    armature = chain()
    armature.pose.bones["shin"].scale = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    session.tick(TICK)
    pull(session, "thigh", (0.3, 0.0, 0.9))
    session.finish()
    for bone in armature.pose.bones:
        assert np.isfinite(np.array(bone.matrix_basis)).all()


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("place", "number"), [(0, NAN), (1, NAN), (2, NAN), (3, NAN), (2, INF), (3, INF)]
)
def test_material_of_a_bone_that_is_no_number_counts_for_nothing(place: int, number: float) -> None:
    armature = chain()
    values = [1.25, 0.1, 0.1, 1.0]
    values[place] = number
    armature.data.bones["shin"][MATERIAL] = values
    assert bone_materials(armature) == {}


# --- Obstacles -----------------------------------------------------------------------------------


def empty(**properties: Any) -> Any:
    item = bpy.data.objects.new("Thing", None)
    bpy.context.collection.objects.link(item)
    for name, value in properties.items():
        setattr(item, name, value)
    bpy.context.view_layer.update()
    return item


@pytest.mark.parametrize("scale", [(-1.0, 1.0, 1.0), (1.0, -2.0, 1.0), (-1.0, -1.0, -1.0)])
def test_plane_is_solid_below_its_own_z_whatever_is_mirrored(scale: tuple[float, ...]) -> None:
    item = empty(scale=scale, rotation_euler=(0.4, 0.3, 0.2))
    up = np.array(item.matrix_world)[:3, 2]
    found = read_obstacle(item, "PLANE", 1.0)
    assert isinstance(found, Plane)
    assert rotate(found.orientation, [0.0, 0.0, 1.0]) == pytest.approx(
        up / np.linalg.norm(up), abs=1e-6
    )


def test_box_of_a_sheared_object_is_a_box() -> None:
    parent = empty(scale=(3.0, 1.0, 1.0))
    item = empty(parent=parent, rotation_euler=(0.0, 0.0, 0.7))
    found = read_obstacle(item, "BOX", 1.0)
    assert isinstance(found, Box)
    assert np.linalg.norm(found.orientation) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("kind", ["HULL", "MESH", "BOX", "SPHERE", "CAPSULE"])
def test_flat_mesh_is_an_obstacle_too(kind: str) -> None:
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new("Floor", mesh)
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    found = read_obstacle(item, kind, 1.0)
    distances, ways = found.closest(np.array([[0.2, 0.1, 0.5], [0.2, 0.1, 0.01]]), 1.0)
    assert np.isfinite(distances).all()
    assert np.isfinite(ways).all()


def test_mesh_that_is_no_mesh_is_told() -> None:
    mesh = bpy.data.meshes.new("Broken")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, NAN)], [], [(0, 1, 2)])
    item = bpy.data.objects.new("Broken", mesh)
    bpy.context.collection.objects.link(item)
    bpy.context.view_layer.update()
    for kind in ("MESH", "HULL", "BOX"):
        with pytest.raises(OctoMotionError, match="'Broken'"):
            read_obstacle(item, kind, 1.0)


def test_puppets_own_skin_and_what_it_holds_do_not_stop_it() -> None:
    """Marked so that they stop another puppet."""
    bpy.ops.octo_motion.add_octopus(arms=4, joints=4)
    octopus: Any = bpy.context.object
    held, other = empty(parent=octopus, parent_type="BONE", parent_bone="arm1.04.L"), empty()
    for each in (*octopus.children, held, other):
        each.octo_motion.posing.obstacle = "BOX"
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    (only,) = session.core.world.obstacles
    assert only.position == pytest.approx([0.0, 0.0, 0.0])
    session.cancel()


# --- Scripts -------------------------------------------------------------------------------------


def test_script_with_settings_is_refused_for_linked_armatures(tmp_path: Path) -> None:
    chain()
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Rig"]
    (found,) = wanted.objects
    bpy.context.scene.collection.objects.link(found)
    bpy.context.view_layer.objects.active = found
    path = tmp_path / "script.json"
    script = {"format": "octo_motion.pose", "version": 1, "steps": []}
    path.write_text(json.dumps({**script, "settings": {"material": "DOLL"}}), encoding="utf-8")
    with pytest.raises(RuntimeError, match="is linked from"):
        bpy.ops.octo_motion.pose_script(filepath=str(path))
    assert found.octo_motion.posing.material == "CLAY"


def test_limb_that_stands_elsewhere_at_another_frame_is_left_there() -> None:
    armature = legs()
    armature.data.bones["root"].use_deform = False
    foot, shin = armature.pose.bones["foot"], armature.pose.bones["shin"]
    for frame, size in ((1, 0.0), (21, 0.2)):
        foot.location.x, shin.scale.y = size, 1.0 + size
        foot.keyframe_insert("location", frame=frame)
        shin.keyframe_insert("scale", frame=frame)
    scene = bpy.context.scene
    scene.frame_set(1)
    session = PuppetSession(armature, scene, clock=None)
    scene.frame_set(21)
    for _ in range(10):
        session.tick(TICK)
    assert foot.location.x == pytest.approx(0.2, abs=1e-6)
    shown = Puppet(armature).read()
    assert session.core.pose.positions == pytest.approx(shown.positions, abs=1e-5)
    session.cancel()
