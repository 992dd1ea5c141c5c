# SPDX-License-Identifier: GPL-3.0-or-later
"""Reaches of the list: arms take hold of objects of the scene while the creature moves."""

from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from octo_motion.blender.animation.actions import is_edited
from tests.core import objects
from tests.ui.rig import Octopus, click, generate, give_route, joints_in_world, keys

pytestmark = pytest.mark.one_blender

WAY = ((0.0, 0.0, 0.0), (0.0, -0.1, 0.0), (0.0, -0.2, 0.0), (0.0, -0.3, 0.0))


def settings_of(armature: Any) -> Any:
    return armature.octo_motion.locomotion


def thing(form: objects.Form | None = None, where: Any = (0.55, -0.6, 0.0)) -> Any:
    """An object to grasp; a rod if nothing else is asked for."""
    vertices, faces = form or objects.rod(0.04, 1.0)
    mesh = bpy.data.meshes.new("Rod")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    added = bpy.data.objects.new("Rod", mesh)
    added.location = where
    bpy.context.scene.collection.objects.link(added)
    bpy.context.view_layer.update()
    return added


OCTOPUS = Octopus(joints=10, route=WAY, frames=100)
"""It walks a little way."""


def reach(armature: Any, target: Any, **values: Any) -> Any:
    item = settings_of(armature).reaches.add()
    item.name, item.target = "Reach", target
    item.frame_start, item.frame_contact, item.frame_release = 5, 30, 60
    item.coil_frames, item.back_frames = 15, 25
    for name, value in values.items():
        setattr(item, name, value)
    return item


def arm_joints(armature: Any, frame: float, arm: str = "Arm1", side: str = "L") -> np.ndarray:
    """World positions (bones + 1, 3) of an arm's joints."""
    ends = joints_in_world(armature, frame)
    names = [bone.name for bone in armature.pose.bones]
    order = [n for n, name in enumerate(names) if name.startswith(arm) and name.endswith(side)]
    return np.concatenate([ends[order, 0], ends[order[-1:], 1]])


def away(points: np.ndarray, target: Any) -> np.ndarray:
    """Distance of points from the axis of an upright rod."""
    local = [target.matrix_world.inverted() @ Vector(each) for each in points]
    return np.array([np.hypot(each.x, each.y) for each in local])


def test_the_nearest_arm_winds_round_the_object_and_the_others_walk_on(octopus: Any) -> None:
    walk = keys(generate(octopus))
    rod = thing()
    reach(octopus, rod)
    action = generate(octopus)
    changed = {path for path, values in keys(action).items() if not np.allclose(values, walk[path])}
    assert changed
    assert all("Arm1_" in path and ".L" in path for path, _ in changed)
    for frame in (45, 52, 60):
        near = away(arm_joints(octopus, frame), rod)
        held = near < 0.16
        assert held.sum() >= 3
        assert near.min() > 0.04
    assert not is_edited(action)


def test_what_holds_stays_on_an_object_that_moves(octopus: Any) -> None:
    rod = thing()
    for frame, x in ((1, 0.5), (40, 0.55), (60, 0.45)):
        rod.location.x = x
        rod.rotation_euler.z = x
        rod.keyframe_insert("location", frame=frame)
        rod.keyframe_insert("rotation_euler", frame=frame)
    reach(octopus, rod)
    bpy.context.scene.frame_set(17)
    generate(octopus)
    assert bpy.context.scene.frame_current == 17
    seen = []
    for frame in (46, 52, 60):
        points = arm_joints(octopus, frame)
        to_rod = rod.matrix_world.inverted()
        seen.append([to_rod @ Vector(each) for each in points[-3:]])
    np.testing.assert_allclose(seen[1], seen[0], atol=1e-4)
    np.testing.assert_allclose(seen[2], seen[0], atol=1e-4)


@pytest.mark.parametrize("scale", [0.3, 1.0, 4.0])
def test_the_size_and_the_place_of_the_armature_do_not_matter(octopus: Any, scale: float) -> None:
    octopus.scale = (scale, scale, scale)
    move = Matrix.Diagonal((scale, scale, scale, 1.0))
    settings_of(octopus).route.matrix_world = move
    rod = thing(where=(0.55 * scale, -0.6 * scale, 0.0))
    rod.scale = (scale, scale, scale)
    bpy.context.view_layer.update()
    reach(octopus, rod)
    generate(octopus)
    near = away(arm_joints(octopus, 55), rod)
    assert 0.04 < near.min() < 0.16


def test_a_muted_reach_is_left_out(octopus: Any) -> None:
    walk = keys(generate(octopus))
    item = reach(octopus, thing())
    item.mute = True
    assert all(
        np.array_equal(values, walk[path]) for path, values in keys(generate(octopus)).items()
    )


def test_the_chosen_arm_reaches(octopus: Any) -> None:
    click("detect_arms")
    rod = thing(where=(0.0, -0.7, 0.0))
    reach(octopus, rod, arm="Arm 1 R")
    generate(octopus)
    assert away(arm_joints(octopus, 50, side="R"), rod).min() < 0.16
    assert away(arm_joints(octopus, 50, side="L"), rod).min() > 0.1


def test_an_arm_curls_without_an_object(octopus: Any) -> None:
    click("detect_arms")
    reach(octopus, None, mode="CURL", arm="Arm 2 R")
    generate(octopus)

    def span(frame: float) -> float:
        points = arm_joints(octopus, frame, "Arm2", "R")
        return float(np.linalg.norm(points[-1] - points[4]))

    assert span(45) < 0.6 * span(3)


def test_it_works_in_place_and_swimming_and_on_a_root_bone(octopus: Any) -> None:
    rod = thing(where=(0.5, -0.55, 0.0))
    reach(octopus, rod)
    settings = settings_of(octopus)
    for travel_on, gait in (("NONE", "idle"), ("BONE", "walk"), ("OBJECT", "swim")):
        settings.travel_on, settings.gait = travel_on, gait
        if gait == "swim":
            rod.location = (0.0, 0.5, -0.4)
            bpy.context.view_layer.update()
        generate(octopus)
        points = [arm_joints(octopus, 52, arm, side) for arm in ("Arm1", "Arm2") for side in "LR"]
        assert min(away(each, rod).min() for each in points) < 0.16, gait


def test_a_pose_of_the_body_counts(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.travel_on, settings.root_bone = "OBJECT", "Root"
    click("detect_arms")
    settings.root_bone = ""
    rod = thing()
    reach(octopus, rod)
    root = octopus.pose.bones["Root"]
    root.rotation_mode = "XYZ"
    root.location, root.rotation_euler = (0.05, 0.02, -0.05), (0.1, 0.2, -0.15)
    generate(octopus)
    near = away(arm_joints(octopus, 52), rod)
    assert near.min() > 0.04
    assert (near < 0.16).sum() >= 3


def test_an_object_is_carried_and_left(octopus: Any) -> None:
    give_route(octopus, [(0, 0, 0), (0, -0.7, 0), (0, -1.4, 0), (0, -2.0, 0)])
    rod = thing(objects.rod(0.04, 0.6), (0.5, -0.85, 0.0))
    reach(octopus, rod, carry=True, frame_contact=34, frame_release=75)
    bpy.context.scene.frame_set(60)
    first = keys(generate(octopus))
    places = {}
    for frame in (20, 34, 49, 50, 62, 75, 80, 100):
        points = arm_joints(octopus, frame)
        places[frame] = rod.matrix_world.copy(), points
    for frame in (20, 34, 49):
        np.testing.assert_allclose(places[frame][0].translation, (0.5, -0.85, 0.0), atol=1e-5)
    for frame in (80, 100):
        left = places[frame][0].translation
        np.testing.assert_allclose(left, places[75][0].translation, atol=1e-5)
    assert (places[75][0].translation - places[49][0].translation).length > 0.2
    held = [
        [matrix.inverted() @ Vector(each) for each in points[-3:]]
        for matrix, points in (places[frame] for frame in (50, 62, 75))
    ]
    np.testing.assert_allclose(held[1], held[0], atol=1e-4)
    np.testing.assert_allclose(held[2], held[0], atol=1e-4)
    # Again, it is taken from where it was, and its keys are made anew in place.
    own = rod.animation_data.action
    again = keys(generate(octopus))
    assert rod.animation_data.action == own
    assert all(np.allclose(again[path], values, atol=1e-5) for path, values in first.items())


def test_suckers_carry_without_winding(octopus: Any) -> None:
    give_route(octopus, [(0, 0, 0), (0, -0.7, 0), (0, -1.4, 0), (0, -2.0, 0)])
    rod = thing(objects.rod(0.04, 0.6), (0.5, -0.85, 0.0))
    reach(octopus, rod, mode="TOUCH", carry=True, frame_contact=34, frame_release=75)
    generate(octopus)
    placed = []
    for frame in (34, 55, 75):
        points = arm_joints(octopus, frame)
        to_rod = rod.matrix_world.inverted()
        local = np.array([to_rod @ Vector(each) for each in points])
        placed.append(local[np.argsort(np.hypot(local[:, 0], local[:, 1]))[:2]])
    # What lies on it goes along with it, and it goes along with the arm.
    np.testing.assert_allclose(placed[1], placed[0], atol=1e-4)
    np.testing.assert_allclose(placed[2], placed[0], atol=1e-4)
    assert (rod.matrix_world.translation - Vector((0.5, -0.85, 0.0))).length > 0.3


@pytest.fixture
def carried(octopus: Any) -> tuple[Any, Any]:
    """A rod that is carried away, and its reach."""
    give_route(octopus, [(0, 0, 0), (0, -0.7, 0), (0, -1.4, 0), (0, -2.0, 0)])
    rod = thing(objects.rod(0.04, 0.6), HOME)
    item = reach(octopus, rod, carry=True, frame_contact=34, frame_release=75)
    generate(octopus)
    bpy.context.scene.frame_set(90)
    assert (rod.matrix_world.translation - Vector(HOME)).length > 0.2
    return rod, item


HOME = (0.5, -0.85, 0.0)


@pytest.mark.parametrize("how", ["muted", "removed", "left where it is"])
def test_what_is_no_longer_carried_stands_where_it_stood(
    how: str, octopus: Any, carried: tuple[Any, Any]
) -> None:
    rod, item = carried
    if how == "muted":
        item.mute = True
    elif how == "removed":
        settings_of(octopus).reaches.clear()
    else:
        # While the body is near.
        item.carry, item.frame_release = False, 50
    count = len(bpy.data.actions)
    generate(octopus)
    assert rod.animation_data.action is None
    assert len(bpy.data.actions) == count - 1
    bpy.context.scene.frame_set(50)
    np.testing.assert_allclose(rod.matrix_world.translation, HOME, atol=1e-5)
    if how == "left where it is":
        # The arm winds about it there, not where it was on its way.
        assert 0.04 < away(arm_joints(octopus, 50), rod).min() < 0.16


def test_keys_of_a_carried_object_that_were_edited_are_the_artists(
    octopus: Any, carried: tuple[Any, Any]
) -> None:
    rod, item = carried
    rod.keyframe_insert("location", frame=95)
    own = rod.animation_data.action
    item.mute = True
    generate(octopus)
    assert rod.animation_data.action == own


def test_another_timing_takes_the_object_from_where_it_stood(
    octopus: Any, carried: tuple[Any, Any]
) -> None:
    rod, item = carried
    item.frame_contact, item.frame_release = 40, 70
    generate(octopus)
    bpy.context.scene.frame_set(20)
    np.testing.assert_allclose(rod.matrix_world.translation, HOME, atol=1e-5)


def test_an_object_that_is_put_elsewhere_is_carried_from_there(
    octopus: Any, carried: tuple[Any, Any]
) -> None:
    rod, _ = carried
    place = (0.45, -0.9, 0.05)
    rod.location = place
    bpy.context.view_layer.update()
    generate(octopus)
    bpy.context.scene.frame_set(20)
    np.testing.assert_allclose(rod.matrix_world.translation, place, atol=1e-5)


def test_what_cannot_be_carried_is_told(octopus: Any) -> None:
    rod = thing()
    item = reach(octopus, rod, carry=True)
    reach(octopus, rod, carry=True, arm="Arm 1 R", name="Other")
    click("detect_arms")
    with pytest.raises(RuntimeError, match="Both 'Reach' and 'Other' carry 'Rod'"):
        click("generate_locomotion")
    settings_of(octopus).reaches[1].mute = True
    rod.keyframe_insert("location", frame=1)
    with pytest.raises(RuntimeError, match="'Rod' moves by itself"):
        click("generate_locomotion")
    item.carry = False
    assert click("generate_locomotion") == {"FINISHED"}


def test_few_keys_hold_as_well(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.keys = "REDUCED"
    rod = thing()
    reach(octopus, rod)
    generate(octopus)
    assert 0.03 < away(arm_joints(octopus, 50), rod).min() < 0.16


# --- What is wrong is told ------------------------------------------------------------------------


def test_errors_say_what_to_do_and_change_nothing(octopus: Any) -> None:
    before = keys(generate(octopus))

    def told() -> str:
        with pytest.raises(RuntimeError) as caught:
            click("generate_locomotion")
        assert all(
            np.array_equal(values, before[path])
            for path, values in keys(octopus.animation_data.action).items()
        )
        return str(caught.value)

    rod = thing()
    item = reach(octopus, rod)
    item.frame_release = 20
    assert "out of order" in told()
    item.frame_release = 60
    item.target = None
    assert "has no object" in told()
    item.target = rod
    item.arm = "Arm 9"
    assert "no arm 'Arm 9'" in told()
    item.arm = ""
    rod.location.x = 5.0
    bpy.context.view_layer.update()
    assert "'Rod' is out of reach of 'Arm 1 L' at frame" in told()
    # What is to be brought is called by its name, too.
    item.mode = "MOUTH"
    assert "'Rod' is out of reach of 'Arm 1 L' at frame" in told()
    item.mode = "COIL"
    rod.location.x = 0.55
    item.frame_contact = item.frame_start + 200
    item.frame_release = 300
    assert "outside of the motion" in told()
    item.frame_contact, item.frame_release = 30, 60
    again = reach(octopus, rod)
    assert "Let one end before the other starts" in told()
    again.mute = True
    rod.parent = octopus
    assert "hangs on 'Octopus'" in told()
    rod.parent = None
    rod.data = bpy.data.meshes.new("Nothing")
    assert "has no faces" in told()
    item.mode = "CURL"
    assert "which arm curls" in told()


# --- The list -------------------------------------------------------------------------------------


def test_a_reach_is_added_for_the_selected_object_at_the_current_frame(octopus: Any) -> None:
    rod = thing()
    rod.select_set(state=True)
    bpy.context.view_layer.objects.active = octopus
    bpy.context.scene.frame_set(40)
    assert click("reach_add") == {"FINISHED"}
    (item,) = settings_of(octopus).reaches
    assert (item.name, item.target, item.mode, item.arm) == ("Rod", rod, "COIL", "")
    assert item.frame_start < item.frame_contact == 40 < item.frame_release
    assert click("reach_add") == {"FINISHED"}
    assert [each.name for each in settings_of(octopus).reaches] == ["Rod", "Rod.001"]
    assert click("reach_remove") == {"FINISHED"}
    assert [each.name for each in settings_of(octopus).reaches] == ["Rod"]


def test_without_an_object_the_arm_of_the_active_bone_curls(octopus: Any) -> None:
    with pytest.raises(RuntimeError, match="which arm curls"):
        click("reach_add")
    click("detect_arms")
    octopus.data.bones.active = octopus.data.bones["Arm2_4.R"]
    bpy.ops.object.mode_set(mode="POSE")
    assert click("reach_add") == {"FINISHED"}
    (item,) = settings_of(octopus).reaches
    assert (item.mode, item.arm) == ("CURL", "Arm 2 R")


def test_wrong_choices_are_told(octopus: Any) -> None:
    for number in range(2):
        thing(where=(number, 0.0, 0.0)).select_set(state=True)
    with pytest.raises(RuntimeError, match="2 other objects are selected"):
        click("reach_add")
    with pytest.raises(RuntimeError, match="no object 'Nowhere' with a surface"):
        click("reach_add", target="Nowhere")
    with pytest.raises(RuntimeError, match="no arm 'Arm 7'"):
        click("reach_add", target="Rod", arm="Arm 7")
    with pytest.raises(RuntimeError, match="Choose a reach in the list first"):
        click("reach_remove")
    assert len(settings_of(octopus).reaches) == 0
