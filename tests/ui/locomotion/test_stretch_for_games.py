# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms that get longer, as other programs play them: exported and imported again."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils.kdtree import KDTree

from octo_motion.command_line.outputs import export, uncarried
from octo_motion.ui.locomotion.writing import generate_locomotion
from octo_motion.ui.locomotion.writing.following import Following
from tests.ui.rig import Octopus, click, generate, joints_in_world, keys, make_octopus

pytestmark = pytest.mark.one_blender

ROUTE = ((0.0, 0.0, 0.0), (0.0, -0.3, 0.0), (0.05, -0.5, 0.0), (0.2, -0.7, 0.0))
ARM = 1.0
"""Metres that arms are long."""
LOOKED_AT = (1.0, 7.0, 10.5, 16.0, 21.5, 33.0)


@pytest.fixture
def octopus() -> Any:
    return Octopus(add_on=True, route=ROUTE, setup="hurry").make()


def by_location(armature: Any) -> None:
    armature.octo_motion.locomotion.ground.stretch_as = "LOCATION"
    click("arms_disconnect")


def skin_of(objects: Any, frame: float) -> np.ndarray:
    """World places (n, 3) of all points of deformed meshes."""
    scene = bpy.context.scene
    scene.frame_set(int(frame), subframe=frame - int(frame))
    graph, found = bpy.context.evaluated_depsgraph_get(), []
    for each in objects:
        seen = each.evaluated_get(graph)
        mesh = seen.to_mesh()
        points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", points)
        world = np.array(seen.matrix_world)
        found.append(points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])
        seen.to_mesh_clear()
    return np.concatenate(found)


def meshes_of(objects: Any) -> list[Any]:
    return [each for each in objects if each.type == "MESH" and len(each.data.vertices) > 100]


def imported(path: Path) -> list[Any]:
    """Meshes of a file."""
    before = set(bpy.data.objects)
    if path.suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path))
    else:
        bpy.ops.import_scene.fbx(filepath=str(path), anim_offset=0.0)
    new = [each for each in bpy.data.objects if each not in before]
    armature: Any
    (armature,) = (each for each in new if each.type == "ARMATURE")
    # Blender's import of FBX connects bones that meet at rest, and moves none of these then.
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in armature.data.edit_bones:
        bone.use_connect = False
    bpy.ops.object.mode_set(mode="OBJECT")
    return meshes_of(new)


def off(armature: Any, path: Path) -> tuple[float, float]:
    """Arm lengths that the skin is off at most in what a file plays, on frames and half way between
    two.
    """
    own = meshes_of(armature.children_recursive)
    wanted = {frame: skin_of(own, frame) for frame in LOOKED_AT}
    export(path, armature, bpy.context.scene, 1, 40)
    meshes = imported(path)
    # glTF doubles points at seams, and sorts them otherwise: which is which is told by one frame.
    order = nearest(wanted[1.0], skin_of(meshes, 1.0))
    found = {
        frame: float(np.linalg.norm(skin_of(meshes, frame)[order] - places, axis=1).max()) / ARM
        for frame, places in wanted.items()
    }
    return tuple(  # type: ignore[return-value]
        max(each for frame, each in found.items() if frame.is_integer() == whole)
        for whole in (True, False)
    )


def nearest(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Of each point the number of the other one that is nearest to it."""
    tree = KDTree(len(others))
    for number, place in enumerate(others):
        tree.insert(place, number)
    tree.balance()
    return np.array([tree.find(place)[1] for place in points])


@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
@pytest.mark.parametrize("suffix", [".glb", ".fbx"])
@pytest.mark.parametrize("few", ["DENSE", "REDUCED"])
def test_files_for_games_play_what_blender_plays(
    octopus: Any, tmp_path: Path, suffix: str, few: str
) -> None:
    octopus.octo_motion.locomotion.keys = few
    by_location(octopus)
    generate(octopus)
    longest = {each.kind: each.value for each in octopus.octo_motion.locomotion.figures}["STRAIN"]
    assert longest > 0.1
    path = tmp_path / f"walk{suffix}"
    assert uncarried(path, octopus) == ""
    on_frames, between = off(octopus, path)
    # Measured: 2e-6, with few keys 1.5e-5.
    assert on_frames < 3e-5
    # Between two frames both formats go straight on, and Blender along curves: 0.6 % in a hurry.
    assert between < 0.0125


@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
@pytest.mark.parametrize("suffix", [".glb", ".fbx"])
def test_scale_is_played_otherwise_and_an_export_says_so(
    octopus: Any, tmp_path: Path, suffix: str
) -> None:
    generate(octopus)
    path = tmp_path / f"walk{suffix}"
    assert "Set ground.stretch_as to location" in uncarried(path, octopus)
    assert uncarried(tmp_path / "walk.abc", octopus) == ""
    assert off(octopus, path)[0] > 0.02


def test_joints_are_the_same_however_bones_get_longer(octopus: Any) -> None:
    generate(octopus)
    scaled = np.array([joints_in_world(octopus, frame) for frame in LOOKED_AT])
    by_location(octopus)
    action = generate(octopus)
    moved = np.array([joints_in_world(octopus, frame) for frame in LOOKED_AT])
    # Heads, for a tail that is not scaled ends where its bone does at rest.
    arms = [bone.name.startswith("arm") for bone in octopus.pose.bones]
    assert np.abs(scaled - moved)[:, arms, 0].max() < 1e-5
    names = {path.rsplit(".", 1)[-1] for path, _ in keys(action) if "arm" in path}
    assert names == {"rotation_quaternion", "location"}


def test_another_way_to_stretch_leaves_nothing_of_the_one_before(octopus: Any) -> None:
    by_location(octopus)
    generate(octopus)
    octopus.octo_motion.locomotion.ground.stretch_as = "SCALE"
    generate(octopus)
    bpy.context.scene.frame_set(14)
    arms = [bone for bone in octopus.pose.bones if bone.name.startswith("arm")]
    assert max(bone.location.length for bone in arms) == 0.0
    octopus.octo_motion.locomotion.ground.stretch_as = "LOCATION"
    generate(octopus)
    bpy.context.scene.frame_set(14)
    assert max(np.abs(np.array(bone.scale) - 1.0).max() for bone in arms) == 0.0
    assert max(bone.location.length for bone in arms) > 1e-3


def test_bones_that_are_connected_stay_so_and_arms_bend_instead(octopus: Any) -> None:
    octopus.octo_motion.locomotion.ground.stretch_as = "LOCATION"
    summary = generate_locomotion(octopus, bpy.context)
    assert any("Disconnect Bones" in each for each in summary.warnings)
    assert {each.kind: each.value for each in summary.figures}["STRAIN"] < 1e-9
    assert octopus.data.bones["arm1.02.L"].use_connect


def test_bones_are_disconnected_where_they_are() -> None:
    armature = make_octopus()
    before = joints_in_world(armature, 1)
    bpy.ops.object.mode_set(mode="POSE")
    click("arms_disconnect")
    assert armature.mode == "POSE"
    assert not any(bone.use_connect for bone in armature.data.bones)
    assert np.array_equal(joints_in_world(armature, 1), before)


def test_a_pose_of_the_motion_is_begun_in_with_its_lengths(octopus: Any) -> None:
    settings = octopus.octo_motion.locomotion
    by_location(octopus)
    action = generate(octopus).copy()
    wanted = joints_in_world(octopus, 20)
    settings.begin_pose.action, settings.begin_pose.frame = action, 20
    settings.begin_pose.with_place = True
    generate(octopus)
    # Measured: 2e-6.
    assert np.abs(joints_in_world(octopus, 1) - wanted).max() < 1e-5


def test_what_is_seen_while_a_route_is_dragged_is_what_is_written(octopus: Any) -> None:
    by_location(octopus)
    shown = Following(octopus, bpy.context)
    shown.show(octopus, 14.0)
    bones = [bone for bone in octopus.pose.bones if bone.name.startswith("arm")]
    seen = np.array([[*bone.location, *bone.scale] for bone in bones])
    shown.give_back(octopus)
    generate(octopus)
    bpy.context.scene.frame_set(14)
    played = np.array([[*bone.location, *bone.scale] for bone in bones])
    assert np.abs(played[:, :3]).max() > 1e-3
    # A glimpse evens out what it has of the motion alone: measured 1e-6.
    assert np.abs(seen - played).max() < 1e-4
