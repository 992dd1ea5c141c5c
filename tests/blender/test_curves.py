# SPDX-License-Identifier: GPL-3.0-or-later
"""A route is the curve that the artist sees, whatever kind of curve that is."""

from itertools import product
from typing import Any, Literal

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

from octo_motion.blender.scene.curves import add_route_curve, read_route, suggested_control_points
from octo_motion.core.errors import RouteError
from octo_motion.core.locomotion.path.route import Route
from octo_motion.core.rotations import Floats

WAVE = [(0, 0, 0), (1, 2, 0), (3, 1, 1), (4, -1, 0), (6, 0, 2), (7, 2, 1), (8, 0, 0), (9, 1, 1)]


def linked(data: bpy.types.ID | None) -> Any:
    """An object of the scene; as Any, for the type checker cannot know what data it has."""
    thing = bpy.data.objects.new("Thing", data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def new_curve() -> bpy.types.Curve:
    data = bpy.data.curves.new("Curve", "CURVE")
    data.dimensions = "3D"
    return data


def add_bezier(
    data: bpy.types.Curve, points: list[tuple[int, int, int]], *, cyclic: bool = False
) -> bpy.types.Spline:
    """A Bézier spline with handles that are neither aligned nor of one length."""
    spline = data.splines.new("BEZIER")
    spline.bezier_points.add(len(points) - 1)
    for number, (point, place) in enumerate(zip(spline.bezier_points, points, strict=True)):
        point.handle_left_type = point.handle_right_type = "FREE"
        point.co = place
        point.handle_left = Vector(place) - Vector((0.7, 0.1 * number, 0.2))
        point.handle_right = Vector(place) + Vector((0.5, 0.3, -0.1 * number))
    spline.use_cyclic_u = cyclic
    return spline


def add_points(
    data: bpy.types.Curve,
    kind: Literal["POLY", "NURBS"],
    points: list[tuple[int, int, int]],
    *,
    cyclic: bool = False,
) -> bpy.types.Spline:
    spline = data.splines.new(kind)
    spline.points.add(len(points) - 1)
    for number, (point, place) in enumerate(zip(spline.points, points, strict=True)):
        # Weights other than 1 only show where the curve is a NURBS.
        point.co = (*place, 1.0 + 0.5 * (number % 3) if kind == "NURBS" else 1.0)
    spline.use_cyclic_u = cyclic
    return spline


def drawn(curve: Any) -> Floats:
    """The points that Blender evaluates, in world space."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = curve.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    assert mesh is not None
    points = np.array([evaluated.matrix_world @ vertex.co for vertex in mesh.vertices])
    evaluated.to_mesh_clear()
    return points


def distance_to(route: Route, points: Floats) -> float:
    """How far the worst of the points (n, 3) is from the route."""
    lines = route.position(np.unique(np.append(np.linspace(0, 1, 2001), route.breaks)))
    start, along = lines[:-1], np.diff(lines, axis=0)
    offset = points[:, None] - start
    share = np.sum(offset * along, -1) / np.maximum(np.sum(along * along, -1), 1e-12)
    nearest = start + np.clip(share, 0, 1)[..., None] * along
    return float(np.linalg.norm(points[:, None] - nearest, axis=-1).min(axis=1).max())


def assert_same_line(route: Route, curve: Any) -> None:
    """The route passes through the drawn points, and is as long as the line between them."""
    points = drawn(curve)
    assert distance_to(route, points[::5]) < 2e-5 * np.abs(points).max()
    if route.cyclic:
        points = np.concatenate([points, points[:1]])
    else:
        np.testing.assert_allclose(route.position([0.0, 1.0]), points[[0, -1]], atol=1e-4)
    length = np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()
    # Blender 4.5 cuts the corners of a NURBS spline of order 2.
    assert route.length == pytest.approx(length, rel=5e-3)


@pytest.mark.parametrize("cyclic", [False, True])
@pytest.mark.parametrize("kind", ["BEZIER", "POLY"])
def test_the_route_is_the_line_that_blender_draws(
    kind: Literal["BEZIER", "POLY"],
    cyclic: bool,  # noqa: FBT001
) -> None:
    data = new_curve()
    data.resolution_u = 64
    if kind == "BEZIER":
        add_bezier(data, WAVE, cyclic=cyclic)
    else:
        add_points(data, kind, WAVE, cyclic=cyclic)
    curve = linked(data)
    route = read_route(curve)
    assert route.cyclic == cyclic
    assert_same_line(route, curve)


@pytest.mark.parametrize(
    ("count", "order", "cyclic", "endpoint", "bezier"),
    list(product((2, 3, 4, 6, 7), (2, 3, 4, 5, 6), *[(False, True)] * 3)),
)
def test_a_nurbs_route_has_the_knots_that_blender_gives_it(
    count: int,
    order: int,
    cyclic: bool,  # noqa: FBT001
    endpoint: bool,  # noqa: FBT001
    bezier: bool,  # noqa: FBT001
) -> None:
    data = new_curve()
    data.resolution_u = 64
    spline = add_points(data, "NURBS", WAVE[:count], cyclic=cyclic)
    spline.use_endpoint_u, spline.use_bezier_u = endpoint, bezier
    spline.order_u = order
    spline.resolution_u = 64
    curve = linked(data)
    assert_same_line(read_route(curve), curve)


def test_auto_and_vector_handles_are_followed() -> None:
    data = new_curve()
    data.resolution_u = 64
    spline = add_bezier(data, WAVE)
    for number, point in enumerate(spline.bezier_points):
        kind = ("AUTO", "VECTOR", "ALIGNED")[number % 3]
        point.handle_left_type = point.handle_right_type = kind
    curve = linked(data)
    assert_same_line(read_route(curve), curve)


def test_a_bezier_spline_keeps_its_control_points_exactly() -> None:
    curve = linked(new_curve())
    spline = add_bezier(curve.data, WAVE[:3])
    route = read_route(curve)
    first, second = spline.bezier_points[0], spline.bezier_points[1]
    expected = [first.co, first.handle_right, second.handle_left, second.co]
    np.testing.assert_array_equal(route.controls[0, :, :3], expected)
    assert len(route.controls) == 2


def test_the_route_moves_with_its_object_and_its_parents() -> None:
    data = new_curve()
    data.resolution_u = 64
    add_bezier(data, WAVE)
    parent, curve = linked(None), linked(data)
    parent.location, parent.scale = (1, -2, 3), (2, -1, 0.5)
    parent.rotation_euler = Euler((0.3, 0.4, -1))
    curve.parent = parent
    curve.matrix_parent_inverse = Matrix.Rotation(0.5, 4, "X") @ Matrix.Translation((0, 1, 0))
    curve.location, curve.scale = (0, 0, 4), (1, 3, 1)
    curve.rotation_euler = Euler((-1, 0.2, 0.1))
    assert_same_line(read_route(curve), curve)


def test_the_longest_spline_is_taken_unless_another_is_chosen() -> None:
    data = new_curve()
    add_bezier(data, WAVE[:2])
    add_points(data, "POLY", WAVE)
    add_points(data, "POLY", WAVE[:1])
    curve = linked(data)
    longest = read_route(curve)
    np.testing.assert_allclose(longest.position(1.0), WAVE[-1])
    assert len(longest.controls) == len(WAVE) - 1
    np.testing.assert_allclose(read_route(curve, spline_index=0).position(1.0), WAVE[1])
    np.testing.assert_allclose(read_route(curve, None, 1).position(1.0), WAVE[-1])
    with pytest.raises(RouteError, match="1 point"):
        read_route(curve, spline_index=2)
    with pytest.raises(RouteError, match="has 3 splines; number 3"):
        read_route(curve, spline_index=3)


# --- what is seen --------------------------------------------------------------------------------


def test_shape_keys_and_hooks_move_the_control_points() -> None:
    data = new_curve()
    data.resolution_u = 64
    add_bezier(data, WAVE)
    curve = linked(data)
    curve.shape_key_add(name="Basis")
    key = curve.shape_key_add(name="Lift")
    for point in key.data[2:5]:
        for attribute in ("co", "handle_left", "handle_right"):
            setattr(point, attribute, getattr(point, attribute) + Vector((0, 0, 3)))
    key.value = 0.5
    empty = linked(None)
    hook = curve.modifiers.new("Hook", "HOOK")
    hook.object = empty
    hook.vertex_indices_set([3, 4, 5])
    bpy.context.view_layer.update()
    empty.location = (0, 4, 0)
    route = read_route(curve)
    assert_same_line(route, curve)
    assert len(route.controls) == len(WAVE) - 1
    np.testing.assert_allclose(route.controls[1, 0, :3], np.add(WAVE[1], (0, 4, 0)), atol=1e-5)
    np.testing.assert_allclose(route.controls[3, 0, :3], np.add(WAVE[3], (0, 0, 1.5)), atol=1e-5)


def bend(curve: Any, *, on_points: bool) -> Any:
    modifier = curve.modifiers.new("Bend", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.deform_axis, modifier.angle = "BEND", "Z", 2.0
    modifier.use_apply_on_spline = on_points
    return modifier


@pytest.mark.parametrize("cyclic", [False, True])
@pytest.mark.parametrize("on_points", [False, True])
def test_a_route_bent_by_a_modifier_is_followed_as_drawn(
    on_points: bool,  # noqa: FBT001
    cyclic: bool,  # noqa: FBT001
) -> None:
    data = new_curve()
    data.resolution_u = 64
    add_bezier(data, WAVE, cyclic=cyclic)
    curve = linked(data)
    plain = read_route(curve)
    bend(curve, on_points=on_points)
    route = read_route(curve)
    assert route.cyclic == cyclic
    assert np.linalg.norm(route.position(0.5) - plain.position(0.5)) > 1.0
    assert_same_line(route, curve)
    # Smooth: no corners where the drawn line has its points.
    tangent = route.tangent(np.linspace(0.02, 0.1, 2001))
    assert np.sum(tangent[1:] * tangent[:-1], axis=-1).min() > 0.9999


def test_a_line_that_comes_back_to_its_start_keeps_its_first_piece() -> None:
    data = new_curve()
    data.resolution_u = 3
    add_bezier(data, [*WAVE, WAVE[0]])
    curve = linked(data)
    bend(curve, on_points=False)
    route, points = read_route(curve), drawn(curve)
    assert not route.cyclic
    assert len(route.controls) == len(points) - 1
    assert distance_to(route, points) < 1e-4


def test_a_switched_off_modifier_does_nothing() -> None:
    curve = linked(new_curve())
    add_bezier(curve.data, WAVE)
    plain = read_route(curve)
    bend(curve, on_points=False).show_viewport = False
    np.testing.assert_array_equal(read_route(curve).controls, plain.controls)


def test_a_curve_with_thickness_is_followed_in_its_middle() -> None:
    curve = linked(new_curve())
    add_bezier(curve.data, WAVE)
    plain = read_route(curve)
    curve.data.bevel_depth = 0.1
    np.testing.assert_array_equal(read_route(curve).controls, plain.controls)
    bend(curve, on_points=False)
    np.testing.assert_array_equal(read_route(curve).controls, plain.controls)


def test_a_copied_line_offers_each_copy() -> None:
    curve = linked(new_curve())
    add_bezier(curve.data, WAVE)
    array = curve.modifiers.new("Array", "ARRAY")
    array.count = 2
    array.use_relative_offset, array.use_constant_offset = False, True
    array.constant_offset_displace = (0, 0, 5)
    first, second = (read_route(curve, spline_index=number) for number in (0, 1))
    np.testing.assert_allclose(
        second.position(0.3), np.add(first.position(0.3), [0, 0, 5]), atol=1e-5
    )


@pytest.mark.parametrize("hidden", ["eye", "monitor", "excluded"])
def test_a_hidden_route_is_read_where_it_is(hidden: str) -> None:
    parent, curve = linked(None), linked(new_curve())
    add_bezier(curve.data, WAVE)
    curve.parent = parent
    if hidden == "eye":
        curve.hide_set(state=True)
    elif hidden == "monitor":
        curve.hide_viewport = True
    else:
        away = bpy.data.collections.new("Away")
        bpy.context.scene.collection.children.link(away)
        away.objects.link(curve)
        bpy.context.scene.collection.objects.unlink(curve)
        bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    parent.location, parent.scale, curve.location = (0, 0, 5), (2, 2, 2), (1, 0, 0)
    np.testing.assert_allclose(read_route(curve).position(0.0), (2, 0, 5))


def test_a_route_being_edited_is_read_as_it_is_now() -> None:
    curve = linked(new_curve())
    add_bezier(curve.data, WAVE)
    bpy.context.view_layer.objects.active = curve
    bpy.ops.object.mode_set(mode="EDIT")
    curve.data.splines[0].bezier_points[-1].co = (9, 9, 9)
    np.testing.assert_allclose(read_route(curve).position(1.0), (9, 9, 9))
    bpy.ops.object.mode_set(mode="OBJECT")


def test_reading_a_route_leaves_the_file_as_it_was() -> None:
    curve = linked(new_curve())
    add_bezier(curve.data, WAVE)
    bend(curve, on_points=False)
    before = (len(bpy.data.curves), len(bpy.data.meshes), len(bpy.data.objects))
    read_route(curve)
    assert before == (len(bpy.data.curves), len(bpy.data.meshes), len(bpy.data.objects))


# --- what cannot be a route ----------------------------------------------------------------------


def test_objects_that_are_no_curves_are_refused_with_the_reason() -> None:
    refused = {
        "not a curve but of type mesh": bpy.data.meshes.new("Mesh"),
        "not a curve but of type surface": bpy.data.curves.new("Surface", "SURFACE"),
        "not a curve but of type font": bpy.data.curves.new("Text", "FONT"),
        "not a curve but of type empty": None,
        "hair curves": bpy.data.hair_curves.new("Hair"),
    }
    for says, data in refused.items():
        with pytest.raises(RouteError, match=says):
            read_route(linked(data))


def test_curves_that_lead_nowhere_are_refused_with_the_reason() -> None:
    empty = linked(new_curve())
    with pytest.raises(RouteError, match="no splines"):
        read_route(empty)
    add_bezier(empty.data, WAVE[:1])
    with pytest.raises(RouteError, match="no Bézier segment"):
        read_route(empty)
    point = linked(new_curve())
    add_points(point.data, "POLY", WAVE[:1] * 4)
    with pytest.raises(RouteError, match="no length"):
        read_route(point)
    flattened = linked(new_curve())
    add_bezier(flattened.data, WAVE)
    flattened.scale = (0, 0, 0)
    with pytest.raises(RouteError, match="no length"):
        read_route(flattened)


# --- the four control points ---------------------------------------------------------------------


def test_four_control_points_make_the_route_of_the_paper() -> None:
    points = [[1.0, 2.0, 3.0], [2.0, 4.0, 3.0], [4.0, 4.0, 4.0], [5.0, 2.0, 4.0]]
    curve = add_route_curve("Route", points, bpy.context.scene.collection)
    route = read_route(curve)
    np.testing.assert_array_equal(route.controls[0, :, :3], points)
    np.testing.assert_array_equal(curve.location, points[0])
    another = add_route_curve("Route", points, bpy.context.scene.collection)
    assert another.name != curve.name
    assert another.data != curve.data


def test_the_suggested_route_starts_at_the_armature_and_leaves_its_front() -> None:
    data = bpy.data.armatures.new("Rig")
    rig = linked(data)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for x in (-1.0, 1.0):
        bone = data.edit_bones.new("Arm")
        bone.head, bone.tail = (0, 0, 0), (x, 0, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.location, rig.scale, rig.rotation_euler = (1, 2, 3), (3, 3, 3), Euler((0, 0, np.pi / 2))
    points = suggested_control_points(rig, bpy.context)
    np.testing.assert_allclose(points[0], (1, 2, 3), atol=1e-6)
    route = Route.bezier(points[None])
    np.testing.assert_allclose(route.tangent([0.0, 1.0]), [[1, 0, 0], [1, 0, 0]], atol=1e-6)
    # Several times as long as the creature is wide, and level.
    assert 3.0 < route.length / 6.0 < 6.0
    np.testing.assert_allclose(points[:, 2], 3.0)
    # Bends that it can follow: none tighter than its own reach.
    s = np.linspace(0, 1, 101)
    v, a = route.velocity(s), route.acceleration(s)
    curvature = np.linalg.norm(np.cross(v, a), axis=-1) / np.linalg.norm(v, axis=-1) ** 3
    assert curvature.max() < 1.0 / 3.0


def test_a_rig_that_lies_on_its_face_or_has_no_bones_still_gets_a_level_route() -> None:
    rig = linked(bpy.data.armatures.new("Rig"))
    rig.rotation_euler = Euler((np.pi / 2, 0, 0))
    points = suggested_control_points(rig, bpy.context)
    np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-6)
    assert Route.bezier(points[None]).length > 1.0
