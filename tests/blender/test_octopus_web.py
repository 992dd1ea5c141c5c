# SPDX-License-Identifier: GPL-3.0-or-later
"""The octopus' web in Blender: told by a vertex group, and no limb to whoever measures limbs."""

from pathlib import Path
from typing import Any, cast

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from mathutils.kdtree import KDTree

from octo_motion.blender.rig.armature import (
    WEB_ATTRIBUTE,
    arm_skins,
    limb_skin,
    radii_of_skin,
    read_skeleton,
    skin_key,
    skin_parts,
)
from octo_motion.blender.rig.puppet_reading import skin_points
from octo_motion.blender.scene.octopus import WEB_GROUP, add_octopus
from octo_motion.core.locomotion.octopus.mesh import build_mesh
from octo_motion.core.locomotion.octopus.rig import arm_bone_names
from octo_motion.core.locomotion.octopus.shape import OctopusShape

BARE = OctopusShape(web=0.0)
ARMS = arm_bone_names(8, 12)


def octopus(shape: OctopusShape | None = None) -> Any:
    armature = add_octopus(bpy.context, shape or OctopusShape(), Matrix())
    bpy.context.view_layer.update()
    return armature


def in_web(skin: Any) -> list[int]:
    index = skin.vertex_groups[WEB_GROUP].index
    return [
        vertex.index
        for vertex in skin.data.vertices
        if any(each.group == index for each in vertex.groups)
    ]


def test_a_vertex_group_selects_it() -> None:
    skin = octopus().children[0]
    assert in_web(skin) == np.flatnonzero(build_mesh(OctopusShape()).web).tolist()


def test_without_it_the_skin_has_neither_group_nor_mark() -> None:
    skin = octopus(BARE).children[0]
    assert WEB_GROUP not in skin.vertex_groups
    assert WEB_ATTRIBUTE not in skin.data.attributes
    np.testing.assert_array_equal(limb_skin(skin.data), np.arange(len(skin.data.vertices)))


def measured(armature: Any) -> Any:
    skeleton = read_skeleton(armature)
    skins = arm_skins(armature, skeleton, ARMS)
    parts = skin_parts(armature, ["body", "head", "mantle"])
    return (
        [vars(each) for each in skins],
        radii_of_skin(armature, ARMS),
        [(name, ends, radii) for name, ends, radii in parts],
        dict(sorted(skin_points(armature, skeleton).items())),
    )


def assert_same(first: Any, second: Any) -> None:
    assert type(first) is type(second)
    if isinstance(first, dict):
        assert list(first) == list(second)
        first, second = list(first.values()), list(second.values())
    if isinstance(first, (list, tuple)):
        assert len(first) == len(second)
        for one, other in zip(first, second, strict=True):
            assert_same(one, other)
    else:
        np.testing.assert_array_equal(first, second)


def test_arms_are_as_thick_with_it_as_without() -> None:
    assert_same(measured(octopus()), measured(octopus(BARE)))


def test_a_web_without_its_mark_would_make_arms_thicker() -> None:
    armature = octopus()
    before = np.concatenate(radii_of_skin(armature, ARMS))
    mesh = armature.children[0].data
    mesh.attributes.remove(mesh.attributes[WEB_ATTRIBUTE])
    assert not np.array_equal(np.concatenate(radii_of_skin(armature, ARMS)), before)


def test_a_mark_of_another_kind_is_none() -> None:
    armature = octopus(BARE)
    mesh = armature.children[0].data
    mesh.attributes.new(WEB_ATTRIBUTE, "FLOAT", "POINT")
    assert len(limb_skin(mesh)) == len(mesh.vertices)


def test_it_survives_saving_and_loading(tmp_path: Path) -> None:
    armature = octopus()
    key, expected = skin_key(armature), in_web(armature.children[0])
    path = tmp_path / "octopus.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    armature = cast("Any", bpy.data.objects["Octopus"])
    assert in_web(armature.children[0]) == expected
    assert skin_key(armature) == key


@pytest.mark.parametrize("shape", [OctopusShape(), OctopusShape(arms=3, joints=5)], ids=str)
def test_it_goes_through_gltf_and_bends_there_as_here(tmp_path: Path, shape: OctopusShape) -> None:
    armature = octopus(shape)
    numbers = in_web(armature.children[0])
    rest = posed(armature)[numbers]
    turn(armature)
    here = posed(armature)[numbers]
    assert np.linalg.norm(here - rest, axis=1).max() > 0.1 * shape.arm_length
    turn(armature, 0.0)
    path = tmp_path / "octopus.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    armature = next(each for each in bpy.data.objects if each.type == "ARMATURE")
    turn(armature)
    there = posed(armature)
    tree = KDTree(len(there))
    for number, point in enumerate(there.tolist()):
        tree.insert(point, number)
    tree.balance()
    away = [cast("float", tree.find(point)[2]) for point in here.tolist()]
    # 1.8e-7 of an arm.
    assert max(away) < 4e-7 * shape.arm_length


def turn(armature: Any, angle: float = 0.8) -> None:
    """Turn an arm about the world's axis: files of other programs have axes of their own."""
    bone = armature.pose.bones["arm2.01.L"]
    bone.matrix_basis = Matrix()
    bpy.context.view_layer.update()
    world = armature.matrix_world @ bone.matrix
    about = Matrix.Translation(world.translation)
    turned = about @ Matrix.Rotation(angle, 4, "Z") @ about.inverted() @ world
    bone.matrix = armature.matrix_world.inverted() @ turned
    bpy.context.view_layer.update()


def posed(armature: Any) -> Any:
    """Vertices (n, 3) of the skin, world, as it is shown."""
    (skin,) = (
        each
        for each in bpy.data.objects
        if each.type == "MESH" and each.find_armature() == armature
    )
    shown: Any = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([shown.matrix_world @ vertex.co for vertex in shown.data.vertices])
