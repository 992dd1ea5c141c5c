# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects to grasp as the scene shows them, and arms as thick as their skin."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.armature import radii_of_skin
from octo_motion.blender.scene.grasp_target import hangs_on, may_move, read_form, read_places
from octo_motion.core.errors import RigError
from octo_motion.core.locomotion.octopus.shape import OctopusShape
from octo_motion.core.locomotion.reaching.winding import profile_of
from octo_motion.core.rotations import rotate
from tests.core import objects


def rod(**channels: Any) -> Any:
    vertices, faces = objects.rod(0.1, 1.0)
    mesh = bpy.data.meshes.new("Rod")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    added: Any = bpy.data.objects.new("Rod", mesh)
    bpy.context.scene.collection.objects.link(added)
    for name, value in channels.items():
        setattr(added, name, value)
    bpy.context.view_layer.update()
    return added


def corners(target: Any) -> np.ndarray:
    """World positions of its vertices as it is read."""
    vertices, _ = read_form(target)
    positions, rotations = read_places(target, np.array([1.0]))
    return positions[0] + rotate(rotations[0], vertices)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (0.3, 0.5, 2.0), (-1.0, 2.0, 0.5)])
def test_form_and_place_together_are_what_the_scene_shows(scale: tuple[float, ...]) -> None:
    target = rod(location=(1.0, 2.0, 3.0), rotation_euler=(0.4, -0.7, 1.1), scale=scale)
    matrix = np.array(target.matrix_world)
    own = np.array([vertex.co for vertex in target.data.vertices])
    shown = own @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(corners(target), shown, atol=1e-5)


def test_modifiers_count() -> None:
    target = rod()
    modifier = target.modifiers.new("Copies", "ARRAY")
    modifier.count, modifier.use_relative_offset, modifier.use_constant_offset = 2, False, True
    modifier.constant_offset_displace = (0.0, 0.5, 0.0)
    assert corners(target)[:, 1].max() == pytest.approx(0.6, abs=1e-3)


def test_a_curve_with_a_bevel_can_be_grasped_and_an_empty_not() -> None:
    curve: Any = bpy.data.curves.new("Pipe", "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.05
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (0.0, 0.0, 2.0, 1.0)
    pipe = bpy.data.objects.new("Pipe", curve)
    bpy.context.scene.collection.objects.link(pipe)
    profile = profile_of(*read_form(pipe))
    assert profile.support.mean() == pytest.approx(0.05, rel=0.1)
    curve.bevel_depth = 0.0
    bpy.context.view_layer.update()
    with pytest.raises(RigError, match="'Pipe' has no faces"):
        read_form(pipe)
    empty = bpy.data.objects.new("Empty", None)
    with pytest.raises(RigError, match="'Empty' has no faces"):
        read_form(empty)


def test_what_moves_is_read_frame_by_frame_and_the_scene_stays_where_it_was() -> None:
    carrier: Any = bpy.data.objects.new("Carrier", None)
    bpy.context.scene.collection.objects.link(carrier)
    target = rod()
    assert not may_move(target)
    target.parent = carrier
    assert not may_move(target)
    for frame, x in ((1, 0.0), (11, 1.0)):
        carrier.location.x = x
        carrier.keyframe_insert("location", frame=frame)
    assert may_move(target)
    for layer in carrier.animation_data.action.layers:
        for curve in layer.strips[0].channelbags[0].fcurves:
            curve.keyframe_points[0].interpolation = "LINEAR"
    scene = bpy.context.scene
    scene.frame_set(4, subframe=0.25)
    positions, rotations = read_places(target, np.array([1.0, 6.0, 8.5]))
    np.testing.assert_allclose(positions[:, 0], [0.0, 0.5, 0.75], atol=1e-6)
    assert np.all(rotations[:, 0] > 0.99)
    assert (scene.frame_current, scene.frame_subframe) == (4, 0.25)


def test_what_hangs_on_the_creature_is_found() -> None:
    owner: Any = bpy.data.objects.new("Owner", bpy.data.armatures.new("Owner"))
    target, between = rod(), rod()
    assert not hangs_on(target, owner)
    target.parent = between
    constraint = between.constraints.new("CHILD_OF")
    constraint.target = owner
    assert hangs_on(target, owner)
    constraint.mute = True
    assert not hangs_on(target, owner)


def test_arms_are_as_thick_as_their_skin() -> None:
    bpy.ops.octo_motion.add_octopus()
    octopus: Any = bpy.context.object
    shape = OctopusShape()
    chain = [f"arm1.{number:02}.L" for number in range(1, shape.joints + 1)]
    (radii,) = radii_of_skin(octopus, [chain])
    # Beyond the web, with a sixth of a radius for suckers and what is not round.
    expected = 0.5 * shape.skin_diameter(shape.reach)
    np.testing.assert_allclose(radii[3:-1], expected[3:-1], rtol=0.2)
    assert np.all(np.diff(radii) < 0.0)


def test_a_mask_over_the_skin_does_not_make_its_arms_thinner() -> None:
    bpy.ops.octo_motion.add_octopus()
    octopus: Any = bpy.context.object
    chain = [f"arm1.{number:02}.L" for number in range(1, 13)]
    (before,) = radii_of_skin(octopus, [chain])
    (skin,) = octopus.children
    skin.vertex_groups.new(name="Mask").add(range(len(skin.data.vertices)), 1.0, "REPLACE")
    (after,) = radii_of_skin(octopus, [chain])
    np.testing.assert_array_equal(after, before)


def test_a_mesh_without_vertices_tells_nothing() -> None:
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    octopus: Any = bpy.context.object
    empty: Any = bpy.data.objects.new("Empty", bpy.data.meshes.new("Empty"))
    empty.modifiers.new("Armature", "ARMATURE").object = octopus
    (radii,) = radii_of_skin(octopus, [[f"arm1.{number:02}.L" for number in range(1, 13)]])
    assert radii[0] == pytest.approx(0.036, rel=0.01)


def test_an_arm_without_skin_is_slender() -> None:
    bpy.ops.octo_motion.add_octopus(with_mesh=False)
    octopus: Any = bpy.context.object
    chain = [f"arm1.{number:02}.L" for number in range(1, 13)]
    (radii,) = radii_of_skin(octopus, [chain])
    assert radii[0] == pytest.approx(0.036, rel=0.01)
    assert radii[-1] == pytest.approx(0.0072, rel=0.01)
