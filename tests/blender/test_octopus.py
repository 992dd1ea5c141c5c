# SPDX-License-Identifier: GPL-3.0-or-later
"""The default octopus as Blender holds it: bones, collections, skin, weights, materials."""

from pathlib import Path
from typing import Any, cast

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion

from octo_motion.blender.rig.armature import SUCKER_PROPERTY, read_skeleton
from octo_motion.blender.scene.octopus import WEB_GROUP, add_octopus
from octo_motion.core.errors import WriteError
from octo_motion.core.locomotion.gait.ccd import diameters
from octo_motion.core.locomotion.octopus.mesh import build_mesh
from octo_motion.core.locomotion.octopus.rig import (
    FIRST_ARM_BONE,
    arm_bone_names,
    arm_pairs,
    build_bones,
)
from octo_motion.core.locomotion.octopus.shape import OctopusShape
from octo_motion.core.locomotion.rig.detection import detect_arms

EXTREMES = {
    "default": OctopusShape(),
    "one arm of three bones": OctopusShape(arms=1, joints=3),
    "an odd number of arms": OctopusShape(arms=7),
    "64 arms": OctopusShape(arms=64, joints=3),
    "200 joints": OctopusShape(arms=2, joints=200, taper=1.0),
    "huge": OctopusShape(arm_length=500.0, first_diameter=60.0),
    "tiny": OctopusShape(arm_length=0.01, first_diameter=0.001),
}


@pytest.fixture(params=EXTREMES)
def shape(request: pytest.FixtureRequest) -> OctopusShape:
    return EXTREMES[request.param]


def new_octopus(shape: OctopusShape | None = None, **options: bool) -> Any:
    return add_octopus(bpy.context, shape or OctopusShape(), Matrix(), **options)


def points_of(mesh: bpy.types.Mesh) -> Any:
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3).astype(np.float64)


def weights_of(skin: Any) -> list[dict[str, float]]:
    names = [group.name for group in skin.vertex_groups]
    moving = {number: name for number, name in enumerate(names) if name != WEB_GROUP}
    return [
        {moving[each.group]: each.weight for each in vertex.groups if each.group in moving}
        for vertex in skin.data.vertices
    ]


def test_bones_are_where_the_numbers_say(shape: OctopusShape) -> None:
    armature = new_octopus(shape, with_skin=False)
    bones = build_bones(shape)
    skeleton = read_skeleton(armature)
    index = {name: number for number, name in enumerate(skeleton.names)}
    order = [index[name] for name in bones.names]
    assert len(index) == len(bones.names)
    size = shape.arm_length + 3.0 * shape.crown_radius
    rest = skeleton.rest_matrices[order]
    # Blender keeps bones in single precision, and a short bone's axes from two ends.
    np.testing.assert_allclose(rest[:, :3, 3], bones.heads, atol=1e-6 * size)
    shortest = float(np.min(skeleton.lengths))
    np.testing.assert_allclose(
        rest[:, :3, :3], bones.matrices[:, :3, :3], atol=1e-6 + 1e-6 * size / shortest
    )
    parents = [skeleton.names[each] if each >= 0 else None for each in skeleton.parents]
    assert [parents[each] for each in order] == [
        bones.names[each] if each >= 0 else None for each in bones.parents
    ]
    assert tuple(skeleton.connected[each] for each in order) == bones.connected


def test_the_sources_arm_has_the_sources_lengths() -> None:
    lengths = 0.5 * diameters(12, 1.0, 0.01)
    shape = OctopusShape(
        joints=12, first_diameter=1.0, taper=0.12, arm_length=float(np.sum(lengths))
    )
    bones = new_octopus(shape, with_skin=False).data.bones
    for side in ("L", "R"):
        for pair in range(1, 5):
            found = [bones[f"arm{pair}.{joint:02}.{side}"].length for joint in range(1, 13)]
            # Single precision, five metres from the middle.
            np.testing.assert_allclose(found, lengths, atol=2e-6)


def test_blender_flips_each_name_to_its_partner_on_the_other_side(shape: OctopusShape) -> None:
    bones = new_octopus(shape, with_skin=False).data.bones
    for bone in bones:
        partner = bones[bpy.utils.flip_name(bone.name)]
        sideways = abs(bone.head_local.x) > 1e-4 * shape.arm_length
        assert (partner != bone) == sideways
        mirrored = bone.head_local.copy()
        mirrored.x *= -1.0
        assert (partner.head_local - mirrored).length < 1e-5 * shape.arm_length


def test_a_pose_mirrors_with_blenders_own_tool() -> None:
    armature = new_octopus()
    bpy.ops.object.mode_set(mode="POSE")
    left, right = (armature.pose.bones[f"arm2.03.{side}"] for side in "LR")
    left.rotation_quaternion = Quaternion((0.9, 0.3, 0.2, 0.1)).normalized()
    bpy.context.view_layer.update()
    bent = np.array(left.matrix.to_translation()), np.array(left.tail)
    bpy.ops.pose.select_all(action="SELECT")
    bpy.ops.pose.copy()
    bpy.ops.pose.paste(flipped=True)
    bpy.context.view_layer.update()
    mirrored = np.array(right.matrix.to_translation()), np.array(right.tail)
    np.testing.assert_allclose(mirrored, np.array(bent) * [-1.0, 1.0, 1.0], atol=1e-6)
    assert left.rotation_quaternion == Quaternion()


def test_arms_name_their_sucker_side() -> None:
    armature = new_octopus(with_skin=False)
    for bone in armature.data.bones:
        expected = "-Z" if bone.name.startswith("arm") else None
        assert bone.get(SUCKER_PROPERTY) == expected
    assert set(read_skeleton(armature).sucker_axes) == {"", "-Z"}


def test_suckers_are_where_the_bones_say() -> None:
    armature = new_octopus()
    mesh = armature.children[0].data
    slot = [material.name for material in mesh.materials].index("Octopus Sucker")
    faces = [face for face in mesh.polygons if face.material_index == slot]
    assert sum(face.area * face.normal.z for face in faces) < 0.0
    dorsal = armature.data.bones["arm1.05.L"].matrix_local.to_3x3().col[2]
    assert dorsal.z == pytest.approx(1.0)


def test_collections_sort_the_bones_by_side() -> None:
    armature = new_octopus(OctopusShape(arms=7), with_skin=False)
    collections = {each.name: {bone.name for bone in each.bones} for each in
                   armature.data.collections}  # fmt: skip
    assert set(collections) == {"Body", "Eyes", "Arms Left", "Arms Right", "Arms Middle"}
    assert collections["Eyes"] == {"eye.L", "eye.R"}
    assert {"root", "body", "head", "mantle", "siphon"} == collections["Body"]
    assert collections["Arms Middle"] == {f"arm1.{joint:02}" for joint in range(1, 13)}
    assert len(collections["Arms Left"]) == len(collections["Arms Right"]) == 36
    assert sum(map(len, collections.values())) == len(armature.data.bones)
    even = new_octopus(with_skin=False)
    assert "Arms Middle" not in even.data.collections


def test_bones_are_coloured_by_side_and_neighbouring_pairs_differ() -> None:
    bones = new_octopus(with_skin=False).data.bones
    assert {bone.color.palette for bone in bones} == {"CUSTOM"}
    colour = {bone.name: tuple(bone.color.custom.normal) for bone in bones}
    for name in ("arm1.01", "arm2.01"):
        assert colour[name + ".L"] != colour[name + ".R"]
    assert colour["arm1.01.L"] != colour["arm2.01.L"]
    assert colour["arm1.01.L"] == colour["arm1.12.L"] == colour["arm3.04.L"]
    assert colour["root"] not in {colour["arm1.01.L"], colour["arm1.01.R"]}


def test_bones_rotate_by_quaternions() -> None:
    armature = new_octopus(with_skin=False)
    assert {bone.rotation_mode for bone in armature.pose.bones} == {"QUATERNION"}


def test_the_skin_hangs_on_the_armature() -> None:
    armature = new_octopus()
    (skin,) = armature.children
    assert skin.find_armature() == armature
    assert [each.type for each in skin.modifiers] == ["ARMATURE"]
    assert skin.parent_type == "OBJECT"
    np.testing.assert_allclose(skin.matrix_world, np.eye(4))
    bones = [bone.name for bone in armature.data.bones]
    assert [group.name for group in skin.vertex_groups] == [*bones, WEB_GROUP]


def test_the_mesh_is_valid_and_nothing_got_lost(shape: OctopusShape) -> None:
    (skin,) = new_octopus(shape).children
    expected = build_mesh(shape)
    assert skin.data.validate(verbose=True) is False
    np.testing.assert_allclose(
        points_of(skin.data), expected.vertices, atol=1e-6 * np.max(np.abs(expected.vertices))
    )
    assert len(skin.data.polygons) == len(expected.quads)
    assert {len(face.vertices) for face in skin.data.polygons} == {4}


def test_the_skin_is_closed_in_blenders_eyes() -> None:
    import bmesh

    (skin,) = new_octopus().children
    editable = bmesh.new()
    editable.from_mesh(skin.data)
    assert all(edge.is_manifold and edge.is_contiguous for edge in editable.edges)
    assert all(vertex.is_manifold for vertex in editable.verts)
    assert editable.calc_volume(signed=True) > 0.0
    editable.free()


def test_every_vertex_has_up_to_four_weights_that_sum_to_one(shape: OctopusShape) -> None:
    armature = new_octopus(shape)
    (skin,) = armature.children
    weights = weights_of(skin)
    assert max(map(len, weights)) <= 4
    np.testing.assert_allclose([sum(each.values()) for each in weights], 1.0, atol=1e-6)
    deforming = {bone.name for bone in armature.data.bones if bone.use_deform}
    assert set().union(*weights) == deforming


def test_blender_bends_the_skin_as_the_weights_say() -> None:
    armature = new_octopus()
    (skin,) = armature.children
    for bone in armature.pose.bones:
        if bone.name.startswith("arm"):
            bone.rotation_quaternion = Quaternion((1, 0, 0), np.radians(35.0))
    bpy.context.view_layer.update()
    evaluated = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = build_mesh(OctopusShape())
    names = build_bones(OctopusShape()).names
    carry = np.array(
        [
            armature.pose.bones[name].matrix @ armature.data.bones[name].matrix_local.inverted()
            for name in names
        ]
    )
    blended = np.einsum("vi,vijk->vjk", mesh.weights, carry[mesh.bones])
    expected = np.einsum("vij,vj->vi", blended[:, :3, :3], mesh.vertices) + blended[:, :3, 3]
    np.testing.assert_allclose(points_of(evaluated.data), expected, atol=1e-5)


def test_moving_the_root_moves_all_of_it() -> None:
    armature = new_octopus()
    (skin,) = armature.children
    before = points_of(skin.data)
    armature.pose.bones["root"].location = (1.0, 2.0, 3.0)
    bpy.context.view_layer.update()
    evaluated = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    np.testing.assert_allclose(
        points_of(evaluated.data), np.add(before, (1.0, 2.0, 3.0)), atol=1e-5
    )


def test_materials_show_the_same_colour_in_solid_view_and_in_renders() -> None:
    (skin,) = new_octopus().children
    assert len({material.name for material in skin.data.materials}) == 6
    for material in skin.data.materials:
        (principled,) = [
            node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"
        ]
        base = principled.inputs["Base Color"].default_value
        np.testing.assert_allclose(list(material.diffuse_color), list(base))
    skin_colour, underside = (m.diffuse_color[:3] for m in skin.data.materials[:2])
    assert np.max(np.abs(np.subtract(skin_colour, underside))) > 0.2


def test_the_skin_is_shaded_smooth() -> None:
    (skin,) = new_octopus().children
    assert all(face.use_smooth for face in skin.data.polygons)


def test_without_skin_there_is_the_armature_alone() -> None:
    armature = new_octopus(with_skin=False)
    assert list(bpy.data.objects) == [armature]
    assert len(bpy.data.meshes) == 0
    assert len(bpy.data.materials) == 0


def test_the_armature_is_active_and_alone_selected_in_object_mode() -> None:
    other = bpy.data.objects.new("Other", None)
    bpy.context.scene.collection.objects.link(other)
    other.select_set(state=True)
    armature = new_octopus()
    assert bpy.context.view_layer.objects.active == armature
    assert bpy.context.selected_objects == [armature]
    assert bpy.context.mode == "OBJECT"


def use_collection(name: str) -> Any:
    """A new collection as the active one; its layer collection."""
    bpy.context.scene.collection.children.link(bpy.data.collections.new(name))
    layer = bpy.context.view_layer.layer_collection.children[name]
    bpy.context.view_layer.active_layer_collection = layer
    return layer


def test_it_goes_to_the_active_collection_and_nowhere_else() -> None:
    layer = use_collection("Creatures")
    armature = new_octopus()
    for each in (armature, *armature.children):
        assert each.users_collection == (layer.collection,)
    assert bpy.context.view_layer.objects.active == armature


@pytest.mark.parametrize("hide", ["eye", "monitor"])
def test_a_hidden_collection_gets_a_whole_octopus_too(hide: str) -> None:
    layer = use_collection("Hidden")
    if hide == "eye":
        layer.hide_viewport = True
    else:
        layer.collection.hide_viewport = True
    armature = new_octopus()
    assert armature.users_collection == (layer.collection,)
    assert len(armature.data.bones) == FIRST_ARM_BONE + 8 * 12
    assert bpy.context.mode == "OBJECT"


def test_two_octopuses_share_nothing() -> None:
    first, second = new_octopus(), new_octopus()
    assert first.data != second.data
    assert first.children[0].data != second.children[0].data
    assert not set(first.children[0].data.materials) & set(second.children[0].data.materials)


def test_a_linked_scene_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    bpy.data.scenes.new("Elsewhere")
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(str(path), link=True) as (_, wanted):
        wanted.scenes = ["Elsewhere"]
    scene = bpy.data.scenes["Elsewhere"]
    context: Any = bpy.context
    with (
        context.temp_override(scene=scene, view_layer=scene.view_layers[0]),
        pytest.raises(WriteError, match="linked from another file"),
    ):
        new_octopus()
    assert len(bpy.data.objects) == 0
    assert len(bpy.data.armatures) == 0


def test_it_survives_saving_and_loading(tmp_path: Path) -> None:
    armature = new_octopus()
    expected = {bone.name: bone.get(SUCKER_PROPERTY) for bone in armature.data.bones}
    weights = weights_of(armature.children[0])
    path = tmp_path / "octopus.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    armature = cast("Any", bpy.data.objects["Octopus"])
    assert {bone.name: bone.get(SUCKER_PROPERTY) for bone in armature.data.bones} == expected
    assert weights_of(armature.children[0]) == weights


@pytest.mark.parametrize("arms", [1, 5, 8, 20])
def test_arm_detection_finds_its_arms_with_their_pairs_and_sides(arms: int) -> None:
    skeleton = read_skeleton(new_octopus(OctopusShape(arms=arms)))
    found = detect_arms(skeleton, np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])).arms
    assert {arm.bones for arm in found} == set(arm_bone_names(arms, 12))
    if arms > 1:
        named = {each[0]: pair for each, pair in
                 zip(arm_bone_names(arms, 12), arm_pairs(arms), strict=True)}  # fmt: skip
        assert {arm.bones[0]: arm.pair for arm in found} == {
            root: pair for root, (pair, _) in named.items()
        }
