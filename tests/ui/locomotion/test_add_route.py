# SPDX-License-Identifier: GPL-3.0-or-later
"""Add › Curve › Octopus Route, and the button: four control points for the active armature."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.scene.curves import read_route

POINTS = {"b0": (1, 2, 3), "b1": (2, 4, 3), "b2": (4, 4, 4), "b3": (5, 2, 4)}


def add_route(**points: tuple[float, float, float]) -> Any:
    """What the operator adds."""
    before = set(bpy.data.objects)
    operators: Any = bpy.ops.octo_motion
    assert operators.add_route(**points) == {"FINISHED"}
    (added,) = set(bpy.data.objects) - before
    return added


def new_armature(at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """An active armature with two arms of a metre."""
    armature: Any = bpy.data.objects.new("Octopus", bpy.data.armatures.new("Octopus"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    armature.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    for x in (-1.0, 1.0):
        bone = armature.data.edit_bones.new("Arm")
        bone.head, bone.tail = (0, 0, 0), (x, 0, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.location = at
    return armature


def test_the_four_control_points_are_the_papers() -> None:
    route = add_route(**POINTS)
    np.testing.assert_array_equal(read_route(route).controls[0, :, :3], list(POINTS.values()))


def test_the_curve_is_seen_where_it_runs_within_the_hills() -> None:
    assert add_route(**POINTS).show_in_front


def test_points_left_alone_suit_the_armature() -> None:
    new_armature(at=(3, 0, 1))
    route = read_route(add_route())
    np.testing.assert_allclose(route.position(0.0), (3, 0, 1))
    np.testing.assert_allclose(route.tangent([0.0, 1.0]), [(0, -1, 0)] * 2, atol=1e-6)
    moved = read_route(add_route(b3=(3, -20, 1)))
    np.testing.assert_allclose(moved.position([0.0, 1.0]), [(3, 0, 1), (3, -20, 1)])


def test_the_next_route_suits_the_next_armature() -> None:
    new_armature(at=(3, 0, 1))
    add_route()
    new_armature(at=(-7, 5, 0))
    np.testing.assert_allclose(read_route(add_route()).position(0.0), (-7, 5, 0))


def test_the_armature_stays_active_and_selected_for_the_next_click() -> None:
    armature = new_armature()
    route = add_route()
    assert bpy.context.view_layer.objects.active == armature
    assert armature.select_get()
    assert not route.select_get()


def test_the_route_becomes_the_armatures() -> None:
    armature = new_armature()
    route = add_route()
    assert armature.octo_motion.locomotion.route == route
    other = add_route()
    assert armature.octo_motion.locomotion.route == other


def test_a_mesh_of_the_armature_counts_as_the_armature() -> None:
    armature = new_armature(at=(3, 0, 1))
    mesh = bpy.data.objects.new("Skin", bpy.data.meshes.new("Skin"))
    bpy.context.scene.collection.objects.link(mesh)
    mesh.modifiers.new("Armature", "ARMATURE").object = armature  # type: ignore[union-attr]
    bpy.context.view_layer.objects.active = mesh
    np.testing.assert_allclose(read_route(add_route()).position(0.0), (3, 0, 1))


def test_without_an_armature_the_curve_is_added_like_any_other() -> None:
    bpy.context.scene.cursor.location = (1, 2, 3)
    route = add_route()
    np.testing.assert_allclose(read_route(route).position(0.0), (1, 2, 3))
    assert bpy.context.view_layer.objects.active == route
    assert bpy.context.selected_objects == [route]


def test_names_are_unique() -> None:
    names = [add_route().name for _ in range(3)]
    assert len(set(names)) == 3
    assert all(name.startswith("Octopus Route") for name in names)


def test_the_route_goes_where_new_objects_go() -> None:
    collection = bpy.data.collections.new("Shot")
    bpy.context.scene.collection.children.link(collection)
    layers = bpy.context.view_layer.layer_collection.children
    bpy.context.view_layer.active_layer_collection = layers["Shot"]
    assert add_route().users_collection == (collection,)


def test_points_without_length_are_refused_and_leave_nothing_behind() -> None:
    with pytest.raises(RuntimeError, match="no length"):
        add_route(**dict.fromkeys(POINTS, (1, 1, 1)))
    assert len(bpy.data.objects) == 0
    assert len(bpy.data.curves) == 0


def test_it_works_in_pose_mode_and_not_in_edit_mode() -> None:
    new_armature()
    bpy.ops.object.mode_set(mode="POSE")
    add_route()
    assert bpy.context.mode == "POSE"
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="edit mode"):
        add_route()


def test_undo_takes_the_route_away_in_one_step() -> None:
    new_armature()
    bpy.ops.ed.undo_push(message="before")
    operators: Any = bpy.ops.octo_motion
    # As a click does, which pushes its own undo step.
    operators.add_route("EXEC_DEFAULT", True)  # noqa: FBT003
    assert len(bpy.data.objects) == 2
    bpy.ops.ed.undo()
    assert [each.name for each in bpy.data.objects] == ["Octopus"]
    assert len(bpy.data.curves) == 0
