# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh objects as grounds, skins as thickness, bones that stretch, markers of contacts."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation import read_channels
from octo_motion.blender.rig import may_stretch
from octo_motion.blender.rig.armature import arm_skins, read_skeleton
from octo_motion.blender.scene.contact_markers import (
    Contact,
    markers,
    read_markers,
    remove_markers,
    write_markers,
)
from octo_motion.blender.scene.surfaces import read_triangles
from octo_motion.core.errors import GroundError
from tests.ui.rig import click, make_octopus


def make_mesh(points: Any, faces: Any, name: str = "Ground") -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def make_square(size: float = 4.0) -> Any:
    half = 0.5 * size
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    return make_mesh(corners, [(0, 1, 2, 3)])


def triangles(item: Any) -> np.ndarray:
    bpy.context.view_layer.update()
    return read_triangles(item, bpy.context.evaluated_depsgraph_get())[0]


def test_a_ground_is_read_where_it_stands() -> None:
    ground = make_square()
    ground.location, ground.scale = (1.0, 2.0, 3.0), (0.5, 0.5, 1.0)
    ground.rotation_euler.y = 0.3
    found = triangles(ground)
    assert found.shape == (2, 3, 3)
    np.testing.assert_allclose(found.reshape(-1, 3).mean(axis=0)[1], 2.0, atol=0.4)
    assert np.ptp(found[..., 2]) == pytest.approx(2.0 * np.sin(0.3), abs=1e-5)


def test_modifiers_of_a_ground_count() -> None:
    ground = make_square()
    ground.modifiers.new("Subdivide", "SUBSURF").levels = 3
    displace = ground.modifiers.new("Raise", "DISPLACE")
    displace.strength, displace.direction, displace.mid_level = 0.5, "Z", 0.0
    found = triangles(ground)
    assert len(found) == 2 * 64
    np.testing.assert_allclose(found[..., 2], 0.5, atol=1e-6)


@pytest.mark.parametrize("disabled", [True, False])
def test_a_ground_that_blender_does_not_evaluate_is_read_where_it_stands(
    tmp_path: Path, *, disabled: bool
) -> None:
    ground = make_square()
    # What a setting points at counts as evaluated, and is not.
    make_octopus().octo_motion.locomotion.ground.object = ground
    holder = bpy.data.objects.new("Holder", None)
    bpy.context.scene.collection.objects.link(holder)
    ground.parent = holder
    if disabled:
        ground.hide_viewport = True
    else:
        hidden = bpy.data.collections.new("Hidden")
        bpy.context.scene.collection.children.link(hidden)
        bpy.context.scene.collection.objects.unlink(ground)
        hidden.objects.link(ground)
        bpy.context.view_layer.layer_collection.children["Hidden"].exclude = True
    bpy.context.view_layer.update()
    holder.location.z, ground.scale = 3.0, (2.0, 2.0, 2.0)
    for _ in range(2):
        found = triangles(bpy.data.objects["Ground"])
        np.testing.assert_allclose(found[..., 2], 3.0)
        assert np.ptp(found[..., 0]) == pytest.approx(8.0)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "ground.blend"))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "ground.blend"))


def test_a_ground_in_edit_mode_is_read_as_it_is_edited() -> None:
    ground = make_square()
    bpy.context.view_layer.objects.active = ground
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=1)
    assert len(triangles(ground)) == 8


def test_what_is_no_ground_is_told() -> None:
    with pytest.raises(GroundError, match="'Ground' has no faces"):
        triangles(make_mesh([(0, 0, 0), (1, 0, 0)], []))
    with pytest.raises(GroundError, match="not a mesh"):
        triangles(make_octopus())


def arms_of(armature: Any) -> list[tuple[str, ...]]:
    return [tuple(bone.name for bone in arm.bones) for arm in armature.octo_motion.locomotion.arms]


def test_the_skin_tells_how_thick_arms_are() -> None:
    click("add_octopus")
    armature: Any = bpy.context.object
    click("detect_arms")
    skeleton = read_skeleton(armature)
    radii = [each.radii for each in arm_skins(armature, skeleton, arms_of(armature))]
    length = sum(armature.data.bones[name].length for name in arms_of(armature)[0])
    for each in radii:
        assert len(each) == 13
        assert 0.01 < each[6] / length < 0.05
        assert each[1] > each[6] > each[12]
    # At the root the web between the arms is taken for either.
    np.testing.assert_allclose(radii[0][1:], radii[1][1:], rtol=0.25)


def test_a_skin_need_be_no_child_of_its_armature() -> None:
    click("add_octopus", with_mesh=True)
    armature: Any = bpy.context.object
    click("detect_arms")
    as_child = [
        each.radii for each in arm_skins(armature, read_skeleton(armature), arms_of(armature))
    ]
    (skin,) = armature.children
    skin.parent = None
    bpy.context.view_layer.update()
    by_modifier = [
        each.radii for each in arm_skins(armature, read_skeleton(armature), arms_of(armature))
    ]
    for before, after in zip(as_child, by_modifier, strict=True):
        np.testing.assert_array_equal(after, before)


def test_arms_without_a_skin_are_slender() -> None:
    armature = make_octopus()
    bones = [f"Arm1_{number}.L" for number in range(1, 7)]
    (radii,) = [each.radii for each in arm_skins(armature, read_skeleton(armature), [bones])]
    assert len(radii) == 7
    assert radii[0] == pytest.approx(0.03)
    assert radii[-1] == pytest.approx(0.008)


def test_the_octopus_may_stretch_and_rigs_that_hand_their_scale_on_may_not() -> None:
    click("add_octopus")
    armature: Any = bpy.context.object
    click("detect_arms")
    bones = arms_of(armature)[0]
    assert may_stretch(armature, bones)
    armature.data.bones[bones[4]].inherit_scale = "FULL"
    assert not may_stretch(armature, bones)
    other = make_octopus()
    assert not may_stretch(other, [f"Arm1_{number}.L" for number in range(1, 7)])


@pytest.mark.parametrize("inherit", ["ALIGNED", "NONE"])
def test_stretched_bones_get_longer_and_thinner_one_by_one(inherit: str) -> None:
    armature = make_octopus()
    bones = [f"Arm1_{number}.L" for number in range(1, 7)]
    for name in bones:
        armature.data.bones[name].inherit_scale = inherit
    strains = np.tile([0.2, 0.4, 0.0, -0.1, 0.3, 0.0], (1, 1))
    for channel in read_channels(armature, bones).stretches([bones], strains):
        bone = armature.path_resolve(channel.data_path.rpartition(".")[0])
        bone.scale = channel.values[0]
        bone.rotation_mode = "XYZ"
        bone.rotation_euler = (0.3, 0.2, 0.1)
    bpy.context.view_layer.update()
    for name, strain in zip(bones, strains[0], strict=True):
        bone = armature.pose.bones[name]
        assert (bone.tail - bone.head).length / bone.bone.length == pytest.approx(1.0 + strain)
        sizes = bone.matrix.to_scale()
        # Volume stays.
        assert sizes.x * sizes.y * sizes.z == pytest.approx(1.0, abs=1e-4)
    used = read_channels(armature, bones).stretches([bones], np.zeros((3, 6)))
    assert used == []


def contact(cycle: int, *, x: float = 0.0, locked: bool = False) -> Contact:
    return Contact("Arm", cycle, np.array([x, 1.0, 0.5]), 0.7, locked=locked, shift=0.0)


def test_markers_that_nobody_touched_say_what_they_were_told() -> None:
    armature = make_octopus()
    write_markers(armature, [contact(1), contact(2, x=3.0, locked=True)], 1.0)
    bpy.context.view_layer.update()
    found = read_markers(armature)
    assert found.keys() == {("Arm", 1), ("Arm", 2)}
    np.testing.assert_allclose(found["Arm", 1].position, (0.0, 1.0, 0.5), atol=1e-6)
    assert found["Arm", 1].heading == pytest.approx(0.7, abs=1e-5)
    assert not found["Arm", 1].locked
    assert found["Arm", 2].locked


def test_a_dragged_or_turned_marker_is_locked_where_it_is_now() -> None:
    armature = make_octopus()
    write_markers(armature, [contact(1), contact(2)], 1.0)
    first, second = markers(armature)
    first.location.x += 0.2
    second.rotation_euler.z += 0.5
    bpy.context.view_layer.update()
    found = read_markers(armature)
    assert found["Arm", 1].locked
    assert found["Arm", 1].position[0] == pytest.approx(0.2, abs=1e-6)
    assert found["Arm", 2].locked
    assert found["Arm", 2].heading == pytest.approx(1.2, abs=1e-5)


def test_markers_are_moved_made_and_taken_away_as_contacts_come_and_go() -> None:
    armature = make_octopus()
    write_markers(armature, [contact(1), contact(2)], 1.0)
    kept = markers(armature)[1]
    write_markers(armature, [contact(2, x=5.0), contact(3)], 1.0)
    assert kept.location.x == pytest.approx(5.0)
    assert [item.octo_motion.contact.cycle for item in markers(armature)] == [2, 3]
    remove_markers(armature)
    assert markers(armature) == []
    assert "Octopus Contacts" not in bpy.data.collections
