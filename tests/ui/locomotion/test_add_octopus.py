# SPDX-License-Identifier: GPL-3.0-or-later
"""Add › Armature › Octopus: one click, one undo step, and a redo panel whose values all work."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import bpy
import numpy as np
import pytest

from octo_motion.core.locomotion.octopus.shape import OctopusShape
from octo_motion.ui.locomotion.operators.adding import OCTO_MOTION_OT_add_octopus


@pytest.fixture(autouse=True)
def operator() -> Iterator[None]:
    """The operator, registered by the add-on or here."""
    if hasattr(bpy.types, "OCTO_MOTION_OT_add_octopus"):
        yield
        return
    bpy.utils.register_class(OCTO_MOTION_OT_add_octopus)
    yield
    bpy.utils.unregister_class(OCTO_MOTION_OT_add_octopus)


def add_octopus(**options: Any) -> Any:
    """The armature that the operator adds."""
    before = set(bpy.data.objects)
    assert bpy.ops.octo_motion.add_octopus(**options) == {"FINISHED"}
    (added,) = {each for each in set(bpy.data.objects) - before if each.type == "ARMATURE"}
    return added


def click(**options: Any) -> None:
    """As a click does, which pushes its own undo step."""
    assert bpy.ops.octo_motion.add_octopus("EXEC_DEFAULT", True, **options) == {"FINISHED"}  # noqa: FBT003


def armatures() -> list[Any]:
    return [each for each in bpy.data.objects if each.type == "ARMATURE"]


def everything() -> Any:
    """What an artist would notice if undo left it behind or took too much."""
    ids = {
        name: sorted(each.name for each in getattr(bpy.data, name))
        for name in dir(bpy.data)
        if isinstance(getattr(bpy.data, name), bpy.types.bpy_prop_collection)
    }
    layer = bpy.context.view_layer
    return (
        ids,
        {each.name: sorted(item.name for item in each.objects) for each in bpy.data.collections},
        sorted(each.name for each in bpy.context.scene.collection.objects),
        sorted(each.name for each in layer.objects if each.select_get()),
        layer.objects.active.name if layer.objects.active else None,
        {each.name: np.array(each.matrix_world).tolist() for each in bpy.data.objects},
        {each.name: len(each.bones) for each in bpy.data.armatures},
        {each.name: len(each.vertices) for each in bpy.data.meshes},
        bpy.context.mode,
    )


def test_one_click_gives_an_octopus_with_a_skin() -> None:
    armature = add_octopus()
    assert armature.name == "Octopus"
    assert [each.type for each in armature.children] == ["MESH"]
    assert len([b for b in armature.data.bones if b.name.startswith("arm")]) == 8 * 12


def test_the_armature_is_active_and_the_skin_is_not_selected() -> None:
    armature = add_octopus()
    assert bpy.context.view_layer.objects.active == armature
    assert bpy.context.selected_objects == [armature]


def test_it_stands_at_the_3d_cursor_and_faces_the_front() -> None:
    bpy.context.scene.cursor.location = (1, 2, 3)
    bpy.context.scene.cursor.rotation_euler = (0.1, 0.2, 0.3)
    armature = add_octopus()
    bpy.context.view_layer.update()
    np.testing.assert_allclose(armature.matrix_world.to_translation(), (1, 2, 3))
    np.testing.assert_allclose(armature.matrix_world.to_3x3(), np.eye(3), atol=1e-6)


def test_it_stands_where_and_as_a_script_says() -> None:
    armature = add_octopus(location=(4, 5, 6), rotation=(0, 0, 0.5))
    np.testing.assert_allclose(armature.location, (4, 5, 6))
    np.testing.assert_allclose(armature.rotation_euler, (0, 0, 0.5), atol=1e-6)


def test_it_aligns_to_the_3d_cursor_where_the_preferences_say_so() -> None:
    bpy.context.preferences.edit.object_align = "CURSOR"
    bpy.context.scene.cursor.rotation_euler = (0.1, 0.2, 0.3)
    np.testing.assert_allclose(add_octopus().rotation_euler, (0.1, 0.2, 0.3), atol=1e-6)


def test_without_a_view_to_align_to_it_aligns_to_the_world() -> None:
    bpy.context.preferences.edit.object_align = "VIEW"
    np.testing.assert_allclose(add_octopus().rotation_euler, (0, 0, 0))
    np.testing.assert_allclose(add_octopus(align="VIEW").rotation_euler, (0, 0, 0))
    turned = add_octopus(rotation=(0, 0, 1))
    np.testing.assert_allclose(turned.rotation_euler, (0, 0, 1), atol=1e-6)


def test_the_redo_panels_numbers_arrive_at_the_rig() -> None:
    armature = add_octopus(
        arms=6, joints=9, arm_length=2.0, first_diameter=0.2, taper=0.9, with_mesh=False
    )
    shape = OctopusShape(arms=6, joints=9, arm_length=2.0, first_diameter=0.2, taper=0.9)
    lengths = [armature.data.bones[f"arm3.{joint:02}.R"].length for joint in range(1, 10)]
    np.testing.assert_allclose(lengths, shape.segments, rtol=1e-5)
    assert sum(lengths) == pytest.approx(2.0, rel=1e-5)
    assert len(armature.data.bones) == 7 + 6 * 9
    assert not armature.children
    assert len(bpy.data.meshes) == 0


def web_of(**options: Any) -> float:
    """How far from the middle the web goes, in metres; zero without one."""
    skin = add_octopus(**options).children[0]
    web = skin.vertex_groups.find("Web")
    points = [v.co for v in skin.data.vertices if any(each.group == web for each in v.groups)]
    return max((float(np.hypot(point.x, point.y)) for point in points), default=0.0)


def test_the_redo_panel_has_a_web_and_its_reach() -> None:
    usual = web_of()
    assert usual > 0.0
    assert web_of(web_reach=0.5) > 1.2 * usual
    assert web_of(web_reach=0.0) == web_of(web=False) == web_of(web=False, web_reach=0.5) == 0.0


def test_the_defaults_are_the_shapes_own() -> None:
    rna: Any = bpy.ops.octo_motion.add_octopus.get_rna_type().properties
    default = OctopusShape()
    for name in ("arms", "joints", "arm_length", "first_diameter", "taper"):
        assert rna[name].default == pytest.approx(getattr(default, name))
    assert rna["web"].default
    assert rna["web_reach"].default == pytest.approx(default.web)


def test_every_number_has_its_unit_and_says_what_it_does() -> None:
    rna: Any = bpy.ops.octo_motion.add_octopus.get_rna_type().properties
    subtypes = {"arm_length": "DISTANCE", "first_diameter": "DISTANCE", "taper": "FACTOR"}
    for name, subtype in subtypes.items():
        assert rna[name].subtype == subtype
    for name in (*subtypes, "arms", "joints", "with_mesh", "web", "web_reach"):
        assert len(rna[name].description) > 20
        assert not rna[name].description.endswith(".")


@pytest.mark.parametrize(
    "options",
    [
        {"arms": 1},
        {"joints": 3},
        {"arms": 1, "joints": 3},
        {"arms": 64, "joints": 3},
        {"arms": 2, "joints": 200},
        {"arms": 64, "joints": 200},
        {"taper": 0.0},
        {"taper": 1.0},
        {"arm_length": 0.01, "first_diameter": 0.001},
        {"arm_length": 100.0, "first_diameter": 10.0},
    ],
    ids=str,
)
def test_the_limits_of_every_parameter_build(options: dict[str, Any]) -> None:
    armature = add_octopus(**options)
    arms, joints = options.get("arms", 8), options.get("joints", 12)
    assert len(armature.data.bones) == 7 + arms * joints
    groups = [group.name for group in armature.children[0].vertex_groups]
    assert [name for name in groups if name != "Web"] == [b.name for b in armature.data.bones]
    # Two arms have no web, and arms of three bones only if it reaches beyond their roots.
    assert arms > 2 or "Web" not in groups


@pytest.mark.parametrize(
    ("options", "clamped"),
    [
        ({"arms": 0}, {"arms": 1}),
        ({"arms": 1000}, {"arms": 64}),
        ({"joints": 1}, {"joints": 3}),
    ],
    ids=str,
)
def test_numbers_beyond_the_limits_become_the_limits(
    options: dict[str, Any], clamped: dict[str, Any]
) -> None:
    small = {"arms": 2, "joints": 4, "with_mesh": False}
    names = {bone.name for bone in add_octopus(**small | options).data.bones}
    assert names == {bone.name for bone in add_octopus(**small | clamped).data.bones}


def test_bones_too_short_for_blender_are_refused_and_leave_nothing_behind() -> None:
    before = everything()
    with pytest.raises(RuntimeError, match="longer arms, fewer joints or less taper"):
        bpy.ops.octo_motion.add_octopus(arm_length=0.01, joints=200, taper=1.0)
    assert everything() == before


@pytest.mark.parametrize("mode", ["EDIT", "POSE"])
def test_other_modes_are_refused_with_what_to_do(mode: Literal["EDIT", "POSE"]) -> None:
    add_octopus(with_mesh=False)
    bpy.ops.object.mode_set(mode=mode)
    with pytest.raises(RuntimeError, match="Switch to object mode first"):
        bpy.ops.octo_motion.add_octopus()
    assert len(bpy.data.armatures) == 1


def test_a_linked_scene_is_refused_with_what_to_do(tmp_path: Path) -> None:
    bpy.data.scenes.new("Elsewhere")
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(str(path), link=True) as (_, wanted):
        wanted.scenes = ["Elsewhere"]
    scene = bpy.data.scenes["Elsewhere"]
    before = everything()
    context: Any = bpy.context
    with (
        context.temp_override(scene=scene, view_layer=scene.view_layers[0]),
        pytest.raises(RuntimeError, match="Work in a scene of this file"),
    ):
        bpy.ops.octo_motion.add_octopus()
    assert everything() == before


def test_names_are_unique() -> None:
    names = [add_octopus(with_mesh=False).name for _ in range(3)]
    assert len(set(names)) == 3
    assert all(name.startswith("Octopus") for name in names)


@pytest.mark.parametrize("with_mesh", [True, False])
def test_undo_restores_the_scene_exactly_in_one_step(with_mesh: bool) -> None:  # noqa: FBT001
    other = bpy.data.objects.new("Other", None)
    bpy.context.scene.collection.objects.link(other)
    bpy.context.view_layer.objects.active = other
    other.select_set(state=True)
    bpy.ops.ed.undo_push(message="before")
    before = everything()
    click(with_mesh=with_mesh)
    after = everything()
    assert after != before
    bpy.ops.ed.undo()
    assert everything() == before
    bpy.ops.ed.redo()
    assert everything() == after


def test_changing_a_number_in_the_redo_panel_makes_the_octopus_anew() -> None:
    bpy.context.scene.cursor.location = (1, 2, 3)
    bpy.ops.ed.undo_push(message="before")
    click()
    # The redo panel undoes the step and runs the operator again with the new value.
    for arms, joints, with_mesh in ((5, 12, True), (5, 30, True), (5, 30, False), (8, 12, True)):
        bpy.ops.ed.undo()
        click(arms=arms, joints=joints, with_mesh=with_mesh, location=(1, 2, 3))
        (armature,) = armatures()
        assert armature.name == "Octopus"
        assert len(bpy.data.armatures) == 1
        assert len(armature.data.bones) == 7 + arms * joints
        assert len(bpy.data.meshes) == with_mesh
        np.testing.assert_array_equal(armature.location, (1, 2, 3))


def test_redoing_one_octopus_leaves_another_as_it_is_posed() -> None:
    first = add_octopus(with_mesh=False)
    first.pose.bones["head"].rotation_quaternion = (0.0, 1.0, 0.0, 0.0)
    bpy.ops.ed.undo_push(message="before")
    click(arms=3)
    bpy.ops.ed.undo()
    click(arms=4)
    first, second = armatures()
    assert (len(first.pose.bones), len(second.pose.bones)) == (7 + 8 * 12, 7 + 4 * 12)
    np.testing.assert_array_equal(first.pose.bones["head"].rotation_quaternion, (0, 1, 0, 0))


def test_it_works_with_nothing_active_and_with_preferences_that_enter_edit_mode() -> None:
    bpy.context.preferences.edit.use_enter_edit_mode = True
    add_octopus()
    assert bpy.context.mode == "OBJECT"


def test_what_is_clicked_has_a_collection_of_its_own_with_route_and_markers() -> None:
    clicked = add_octopus(ready=True, size=1.0)
    (own,) = clicked.users_collection
    assert own.name == "Octopus"
    assert own.name in bpy.context.scene.collection.children
    assert all(own in each.users_collection for each in clicked.children)
    bpy.ops.octo_motion.add_route()
    assert clicked.octo_motion.locomotion.route.users_collection == (own,)
    clicked.octo_motion.locomotion.timing = "RANGE"
    clicked.octo_motion.locomotion.frame_end = 20
    bpy.ops.octo_motion.contacts_show()
    assert [each.name for each in own.children] == ["Octopus Contacts"]


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_all_of_it_grows_with_its_size(size: float) -> None:
    plain = add_octopus()
    sized = add_octopus(size=size)
    share = size / OctopusShape().arm_length
    ends = [
        np.array([[*bone.head_local, *bone.tail_local] for bone in each.data.bones])
        for each in (plain, sized)
    ]
    np.testing.assert_allclose(ends[1], share * ends[0], atol=1e-5)
    heights = [np.ptp([v.co.z for v in each.children[0].data.vertices]) for each in (plain, sized)]
    assert heights[1] == pytest.approx(share * heights[0], rel=1e-4)
