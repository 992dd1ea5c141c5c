# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick arms are is told by the surface that is seen: made by modifiers, or of stiff parts."""

from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from octo_motion.blender.rig.armature import (
    arm_skins,
    radii_of_skin,
    read_skeleton,
    skin_key,
    skin_parts,
)
from octo_motion.blender.scene.octopus import add_octopus
from octo_motion.core.locomotion.octopus.rig import arm_bone_names
from octo_motion.core.locomotion.octopus.shape import OctopusShape
from octo_motion.core.rotations import Floats
from tests.ui.rig import bind_skin

ARMS = arm_bone_names(8, 12)


def octopus() -> Any:
    armature = add_octopus(bpy.context, OctopusShape(web=0.0), Matrix())
    bpy.context.view_layer.update()
    return armature


def thickness(armature: Any) -> tuple[Floats, Floats]:
    """Radii (arms, bones + 1) round joints, by two ways of looking at them."""
    skins = arm_skins(armature, read_skeleton(armature), ARMS)
    return np.array([each.radii for each in skins]), np.array(radii_of_skin(armature, ARMS))


def without_right_half(skin: Any) -> None:
    """Leave of a mesh what lies on the left, and have a modifier mirror it."""
    bpy.context.view_layer.objects.active = skin
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.bisect(plane_no=(1.0, 0.0, 0.0), clear_inner=True)
    bpy.ops.object.mode_set(mode="OBJECT")
    skin.modifiers.move(skin.modifiers.find(skin.modifiers.new("Mirror", "MIRROR").name), 0)
    bpy.context.view_layer.update()


def test_the_half_of_a_creature_that_a_modifier_mirrors_is_there() -> None:
    armature = octopus()
    before = thickness(armature)
    without_right_half(armature.children[0])
    for whole, mirrored in zip(before, thickness(armature), strict=True):
        # 3 %, where the right arms had no skin; at their ends few points tell, and others.
        np.testing.assert_allclose(mirrored[:, 3:-2], whole[:, 3:-2], rtol=0.06)


def square(armature: Any, half: float) -> Any:
    """A skin of square tubes about the bones of arms, in place of the octopus' own."""
    bpy.data.objects.remove(armature.children[0])
    points: list[Any] = []
    faces: list[Any] = []
    groups: dict[str, list[int]] = {}
    for bones in ARMS:
        start = len(points)
        ends = [armature.data.bones[name].head_local for name in bones]
        ends.append(armature.data.bones[bones[-1]].tail_local)
        along = np.array(ends[-1]) - np.array(ends[0])
        along /= np.linalg.norm(along)
        up = np.array([0.0, 0.0, 1.0])
        across = np.cross(along, up)
        for number, end in enumerate(ends):
            name = bones[min(number, len(bones) - 1)]
            for one, other in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
                groups.setdefault(name, []).append(len(points))
                points.append(np.array(end) + half * (one * up + other * across))
        for ring in range(len(ends) - 1):
            low = start + 4 * ring
            faces += [
                (low + side, low + (side + 1) % 4, low + 4 + (side + 1) % 4, low + 4 + side)
                for side in range(4)
            ]
    return bind_skin(armature, points, groups, faces)


def test_a_cage_is_not_the_surface_that_it_makes() -> None:
    armature = octopus()
    skin = square(armature, 0.02)
    # Corners of a tube are √2 of its half width away.
    assert np.median(thickness(armature)[0]) == pytest.approx(0.0283, rel=0.02)
    skin.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    bone = armature.data.bones[ARMS[0][6]]
    shown = np.array([point.co for point in skin.evaluated_get(depsgraph).data.vertices])
    head, tail = np.array(bone.head_local), np.array(bone.tail_local)
    share = (shown - head) @ (tail - head) / bone.length**2
    off = np.linalg.norm(shown - head - share[:, None] * (tail - head), axis=1)
    played = off[(share > 0.2) & (share < 0.8) & (off < 0.05)].max()
    for radii in thickness(armature):
        assert radii[0, 6] == pytest.approx(played, rel=0.1)


def test_a_pose_and_a_scene_stay_as_they_are_and_change_nothing() -> None:
    armature = octopus()
    square(armature, 0.02).modifiers.new("Subdivision", "SUBSURF")
    bpy.context.view_layer.update()
    before, key = thickness(armature), skin_key(armature)
    counts = len(bpy.data.objects), len(bpy.data.scenes), len(bpy.data.meshes)
    armature.location = (3.0, -1.0, 0.5)
    armature.pose.bones[ARMS[0][0]].rotation_mode = "XYZ"
    armature.pose.bones[ARMS[0][0]].rotation_euler = (0.5, 0.2, 0.1)
    bpy.context.view_layer.update()
    for one, other in zip(before, thickness(armature), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-4)
    assert skin_key(armature) == key
    assert (len(bpy.data.objects), len(bpy.data.scenes), len(bpy.data.meshes)) == counts


def test_stiff_parts_that_hang_on_bones_are_what_is_seen_of_it() -> None:
    armature = octopus()
    bpy.data.objects.remove(armature.children[0])
    for name in [bone for bones in ARMS for bone in bones] + ["head"]:
        radius = 0.1 if name == "head" else 0.03
        bone = armature.data.bones[name]
        bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, radius=radius)
        part: Any = bpy.context.object
        part.parent, part.parent_type, part.parent_bone = armature, "BONE", name
        # From the bone's end to its middle.
        part.location = (0.0, -0.5 * bone.length, 0.0)
    armature.pose.bones[ARMS[0][0]].rotation_mode = "XYZ"
    armature.pose.bones[ARMS[0][0]].rotation_euler = (0.5, 0.0, 0.0)
    bpy.context.view_layer.update()
    around, inside = thickness(armature)
    assert np.median(around) == pytest.approx(0.03, rel=0.1)
    assert np.median(inside) == pytest.approx(0.03, rel=0.2)
    (head,) = skin_parts(armature, ["head"])
    assert head[2] == pytest.approx(np.full(2, 0.1), rel=0.2)
