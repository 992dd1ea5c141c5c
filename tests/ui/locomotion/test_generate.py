# SPDX-License-Identifier: GPL-3.0-or-later
"""The button: an armature walks or swims along its route, and nothing else changes."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.scene.curves import read_route
from octo_motion.core.errors import OctoMotionError
from octo_motion.core.locomotion.clearance import capsule_overlap, overlap_solver
from octo_motion.core.locomotion.gait.gait_poser import GaitPoser
from octo_motion.core.locomotion.motion import pipeline
from octo_motion.ui import at_work
from octo_motion.ui.locomotion import panels
from octo_motion.ui.locomotion.operators.generate import OCTO_MOTION_OT_generate_locomotion
from octo_motion.ui.locomotion.writing import shot as workflow
from octo_motion.ui.modal_job import ModalJob
from tests.ui.made import prepare
from tests.ui.rig import (
    ROUTE,
    Octopus,
    click,
    generate,
    give_route,
    joints_in_world,
    keys,
    make_octopus,
    scene_contents,
    still,
)
from tests.ui.test_panels import Layout

OCTOPUS = Octopus(route=ROUTE, frames=60)
"""Four arms of six bones, one metre long, a route of about six metres."""


def settings_of(armature: Any) -> Any:
    return armature.octo_motion.locomotion


def body(armature: Any, frame: float) -> np.ndarray:
    """World position of the root bone's head, the middle of the arms."""
    return joints_in_world(armature, frame)[0, 0]


# --- What comes out -------------------------------------------------------------------------------


def test_one_click_on_a_new_octopus_with_a_route_makes_it_walk() -> None:
    click("add_octopus")
    armature: Any = bpy.context.object
    armature = armature if armature.type == "ARMATURE" else armature.find_armature()
    bpy.context.view_layer.objects.active = armature
    click("add_route")
    assert click("generate_locomotion") == {"FINISHED"}
    settings = settings_of(armature)
    action = armature.animation_data.action
    assert settings.result == action
    assert len(settings.arms) == 8
    route = read_route(settings.route)
    start, end = joints_in_world(armature, 1), joints_in_world(armature, action.frame_end)
    moved = end[:, 0].mean(axis=0) - start[:, 0].mean(axis=0)
    # The arms' phases differ at the two ends, so the mean of all joints wobbles a little.
    np.testing.assert_allclose(moved, route.position(1.0) - route.position(0.0), atol=0.2)


def test_arms_that_are_found_while_generating_are_listed(octopus: Any) -> None:
    assert len(settings_of(octopus).arms) == 0
    generate(octopus)
    arms = settings_of(octopus).arms
    assert [arm.name for arm in arms] == ["Arm 1 L", "Arm 1 R", "Arm 2 L", "Arm 2 R"]
    assert settings_of(octopus).root_bone == "Root"
    again = keys(generate(octopus))
    settings_of(octopus).arms.clear()
    assert all(np.array_equal(again[key], value) for key, value in keys(generate(octopus)).items())


def test_the_body_follows_the_route_at_the_height_of_its_arms(octopus: Any) -> None:
    settings_of(octopus).ground.use = False
    settings_of(octopus).ease_in = settings_of(octopus).ease_out = 0.0
    generate(octopus)
    route = read_route(settings_of(octopus).route)
    heights = []
    for frame, share in ((1, 0.0), (60, 1.0)):
        at = body(octopus, frame)
        expected = route.position(route.parameter_at(share * route.length))
        np.testing.assert_allclose(at[:2], expected[:2], atol=1e-5)
        heights.append(at[2] - expected[2])
    # Upright all the way; the arms reach down to the route and never below it.
    assert heights[0] == pytest.approx(heights[1], abs=1e-5)
    assert heights[0] > 0.0
    flat = give_route(octopus, [(0, 0, 0), (0, -2, 0), (0, -4, 0), (0, -6, 0)])
    assert settings_of(octopus).route == flat
    generate(octopus)
    lowest = min(joints_in_world(octopus, frame)[..., 2].min() for frame in range(1, 61, 3))
    assert -1e-3 < lowest < 0.1


def test_height_can_be_given(octopus: Any) -> None:
    settings_of(octopus).ground.use = False
    settings = settings_of(octopus)
    settings.height_mode, settings.height = "MANUAL", 1.5
    generate(octopus)
    np.testing.assert_allclose(body(octopus, 1), (0.0, 0.0, 1.5), atol=1e-5)


def test_a_swimming_body_is_on_its_route_with_the_mantle_ahead(octopus: Any) -> None:
    settings_of(octopus).gait = "swim"
    generate(octopus)
    np.testing.assert_allclose(body(octopus, 1), (0.0, 0.0, 0.0), atol=1e-5)
    root = joints_in_world(octopus, 1)[0]
    mantle = (root[1] - root[0]) / np.linalg.norm(root[1] - root[0])
    np.testing.assert_allclose(mantle, (0.0, -1.0, 0.0), atol=0.05)


def test_swimming_stretches_head_and_mantle_and_walking_lets_them_back() -> None:
    click("add_octopus", with_mesh=False)
    octopus: Any = bpy.context.object
    give_route(octopus)
    settings = settings_of(octopus)
    still(settings)
    settings.timing, settings.frame_end = "RANGE", 5

    def lean() -> float:
        generate(octopus)
        bpy.context.view_layer.update()
        pose = octopus.pose.bones
        along = pose["mantle"].tail - pose["head"].head
        return float(along.angle((0.0, 0.0, 1.0)))

    at_rest = lean()
    assert at_rest > 0.5
    settings.gait = "swim"
    assert lean() == pytest.approx(0.0, abs=1e-3)
    settings.streamline = 0.0
    assert lean() == pytest.approx(at_rest, abs=1e-6)
    settings.streamline = 1.0
    assert lean() == pytest.approx(0.0, abs=1e-3)
    settings.gait = "walk"
    assert lean() == pytest.approx(at_rest, abs=1e-6)
    assert not any("mantle" in path for path, _ in keys(octopus.animation_data.action))


@pytest.mark.parametrize("gait", ["walk", "walk_literal", "swim"])
def test_every_preset_moves_every_bone_of_the_arms(octopus: Any, gait: str) -> None:
    settings_of(octopus).gait = gait
    found = keys(generate(octopus))
    for bone in octopus.pose.bones:
        if bone.name == "Root":
            continue
        path = f'pose.bones["{bone.name}"].rotation_quaternion'
        values = np.stack([found[path, index][:, 1] for index in range(4)], axis=1)
        assert np.ptp(values, axis=0).max() > 0.01


@pytest.mark.parametrize(("steady", "tolerance"), [(0.0, 2e-5), (0.08, 1e-3)])
def test_fps_does_not_change_the_motion_in_seconds(
    octopus: Any, steady: float, tolerance: float
) -> None:
    """Evened out over time it is the same but for how well the frames resolve it."""
    settings = settings_of(octopus)
    settings.timing, settings.cycle_time, settings.steady = "CADENCE", 1.5, steady
    render = bpy.context.scene.render
    reference = None
    times = np.array([0.0, 0.5, 1.0, 2.5, 4.0])
    # Each of these times is a whole frame at these rates, so linear keys do not blur it.
    for fps, base in ((24, 1.0), (30, 1.0), (60, 1.0), (50, 1.0), (30000, 1000.0)):
        render.fps, render.fps_base = fps, base
        generate(octopus)
        seen = np.array([joints_in_world(octopus, 1 + t * fps / base) for t in times])
        reference = seen if reference is None else reference
        np.testing.assert_allclose(seen, reference, atol=tolerance)


def test_fractional_fps_gives_the_same_motion_between_its_keys(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.timing, settings.cycle_time = "CADENCE", 1.5
    render = bpy.context.scene.render
    times = np.linspace(0.0, 6.0, 13)
    paths, lengths = [], []
    for fps, base in ((24, 1.0), (25, 1.0), (30, 1.001), (60, 1.0)):
        render.fps, render.fps_base = fps, base
        action = generate(octopus)
        rate = fps / base
        lengths.append((action.frame_end - 1) / rate)
        paths.append([body(octopus, 1 + t * rate) for t in times])
    # Between keys the curve is a chord: at 24 fps and 1 m/s a bend of 1 m radius lies 0.2 mm off.
    np.testing.assert_allclose(paths, np.broadcast_to(paths[-1], np.shape(paths)), atol=1e-3)
    assert np.ptp(lengths) < 1.0 / 24.0


def test_speed_is_metres_per_second(octopus: Any) -> None:
    settings_of(octopus).ground.use = False
    settings = settings_of(octopus)
    settings.timing, settings.speed = "SPEED", 2.0
    settings.ease_in = settings.ease_out = 0.0
    action = generate(octopus)
    length = read_route(settings.route).length
    assert action.frame_end == np.ceil(length / 2.0 * 24.0) + 1
    step = np.linalg.norm(body(octopus, 11) - body(octopus, 10))
    assert step == pytest.approx(2.0 / 24.0, rel=1e-3)


def test_cycle_time_is_the_time_of_one_cycle_at_full_speed(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.timing, settings.cycle_time = "CADENCE", 2.0
    settings.ease_in = settings.ease_out = 0.0
    summary = workflow.generate_locomotion(octopus, bpy.context)
    length = read_route(settings.route).length
    # An octopus of 1 m arms walks table.stride metres in a cycle.
    assert summary.seconds == pytest.approx(2.0 * length / settings.table.stride, rel=1e-5)


def test_a_range_of_frames_is_kept(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.frame_start, settings.frame_end = -20, 33
    action = generate(octopus)
    assert tuple(action.frame_range) == (-20.0, 33.0)


@pytest.mark.parametrize("gait", ["walk", "swim"])
def test_travel_on_the_object_or_on_the_root_bone_gives_the_same_places(
    octopus: Any, gait: str
) -> None:
    settings_of(octopus).gait = gait
    octopus.location, octopus.rotation_euler = (1.0, 2.0, 0.5), (0.2, -0.4, 1.0)
    octopus.scale = (2.0, 2.0, 2.0)
    frames = (1, 7, 23, 42, 60)
    generate(octopus)
    on_object = [joints_in_world(octopus, frame) for frame in frames]
    settings_of(octopus).travel_on = "BONE"
    generate(octopus)
    on_bone = [joints_in_world(octopus, frame) for frame in frames]
    np.testing.assert_allclose(on_bone, on_object, atol=2e-5)
    # And back: the root bone does not stay where its last key had put it.
    bpy.context.scene.frame_set(42)
    settings_of(octopus).travel_on = "OBJECT"
    generate(octopus)
    back = [joints_in_world(octopus, frame) for frame in frames]
    np.testing.assert_allclose(back, on_object, atol=2e-5)


def test_a_route_may_hang_on_an_object_that_stays(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.travel_on = "BONE"
    settings.route.parent = octopus
    action = generate(octopus)
    before = {key: values.tobytes() for key, values in keys(action).items()}
    bpy.context.scene.frame_set(40)
    assert {key: values.tobytes() for key, values in keys(generate(octopus)).items()} == before
    settings.route.parent_type, settings.route.parent_bone = "BONE", "Root"
    with pytest.raises(OctoMotionError, match="would move with it"):
        workflow.generate_locomotion(octopus, bpy.context)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_scale_of_the_object_changes_nothing_but_the_size(scale: float) -> None:
    armature = make_octopus()
    armature.scale = (scale, scale, scale)
    give_route(armature, (scale * np.array(ROUTE)).tolist())
    settings = settings_of(armature)
    settings.timing, settings.frame_end = "RANGE", 40
    generate(armature)
    seen = joints_in_world(armature, 17) / scale
    armature.animation_data_clear()
    armature.scale = (1.0, 1.0, 1.0)
    armature.location, armature.rotation_euler = (0, 0, 0), (0, 0, 0)
    give_route(armature)
    settings.result = None
    generate(armature)
    np.testing.assert_allclose(seen, joints_in_world(armature, 17), atol=1e-4)


def test_an_arm_that_is_switched_off_gets_no_keys_and_keeps_its_pose(octopus: Any) -> None:
    generate(octopus)
    before = octopus.pose.bones["Arm1_2.L"].matrix_basis.copy()
    settings_of(octopus).arms["Arm 1 L"].enabled = False
    found = keys(generate(octopus))
    assert not any("Arm1_" in path and ".L" in path for path, _ in found)
    assert any("Arm1_" in path and ".R" in path for path, _ in found)
    assert octopus.pose.bones["Arm1_2.L"].matrix_basis == before


def test_rotation_modes_of_bones_are_kept_and_give_the_same_pose(octopus: Any) -> None:
    generate(octopus)
    expected = joints_in_world(octopus, 30)
    for number, mode in enumerate(("XYZ", "ZXY", "AXIS_ANGLE", "QUATERNION")):
        octopus.pose.bones[f"Arm1_{number + 1}.L"].rotation_mode = mode
    octopus.rotation_mode = "QUATERNION"
    generate(octopus)
    np.testing.assert_allclose(joints_in_world(octopus, 30), expected, atol=1e-5)


# --- Repeatable -----------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1.0, 0.7321])
def test_the_same_seed_gives_the_same_keys_byte_for_byte(octopus: Any, scale: float) -> None:
    settings = settings_of(octopus)
    octopus.scale = (scale, scale, scale)
    settings.variation_min, settings.variation_max, settings.seed = -0.2, 0.3, 7
    first = {key: values.tobytes() for key, values in keys(generate(octopus)).items()}
    # Nor does it matter where the octopus is when the button is pressed.
    bpy.context.scene.frame_set(33)
    settings.seed = 8
    other = {key: values.tobytes() for key, values in keys(generate(octopus)).items()}
    settings.seed = 7
    again = {key: values.tobytes() for key, values in keys(generate(octopus)).items()}
    assert again == first
    assert other != first


def test_without_variation_the_seed_does_not_matter(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.variation_min = settings.variation_max = 0.0
    first = {key: values.tobytes() for key, values in keys(generate(octopus)).items()}
    settings.seed = 99
    assert {key: values.tobytes() for key, values in keys(generate(octopus)).items()} == first


def test_work_in_small_steps_gives_the_same_keys(
    octopus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = {key: values.tobytes() for key, values in keys(generate(octopus)).items()}
    monkeypatch.setattr(pipeline, "_BONES_AT_ONCE", 24 * 7)
    shot = prepare(octopus, bpy.context)
    progress = list(shot.compute())
    # Twice as many moments as frames: it is a hurry.
    assert len(progress) >= 18
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    action = bpy.data.actions[shot.write().action]
    assert {key: values.tobytes() for key, values in keys(action).items()} == first


def test_portions_of_any_size_give_the_same_keys(
    octopus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = {key: values.tobytes() for key, values in keys(generate(octopus)).items()}
    monkeypatch.setattr(overlap_solver, "_ARMS_AT_ONCE", 5)
    monkeypatch.setattr(overlap_solver, "_COLUMNS_AT_ONCE", 3)
    monkeypatch.setattr(capsule_overlap, "_AT_ONCE", 2000)
    monkeypatch.setattr(capsule_overlap, "_ROWS_AT_ONCE", 100)
    assert {key: values.tobytes() for key, values in keys(generate(octopus)).items()} == first


def test_two_octopuses_in_one_scene_do_not_touch_each_other(octopus: Any) -> None:
    first = generate(octopus)
    before = {key: values.tobytes() for key, values in keys(first).items()}
    other = make_octopus("Other", arms=6, joints=4)
    give_route(other, [(5, 0, 0), (5, 2, 0), (7, 4, 0), (9, 4, 0)])
    settings_of(other).gait = "swim"
    second = generate(other)
    assert first != second
    assert {key: values.tobytes() for key, values in keys(first).items()} == before
    assert octopus.animation_data.action == first
    assert settings_of(octopus).gait == "walk"
    generate(octopus)
    generate(other)
    assert set(bpy.data.actions) == {first, second}


# --- Whose action is it ---------------------------------------------------------------------------


def test_after_a_control_point_moved_its_own_action_is_made_anew_in_place(octopus: Any) -> None:
    settings_of(octopus).ground.use = False
    action = generate(octopus)
    before = body(octopus, 60)
    point = settings_of(octopus).route.data.splines[0].bezier_points[1]
    point.co.x += 2.0
    bpy.context.scene.frame_set(60)
    assert generate(octopus) == action
    assert len(bpy.data.actions) == 1
    np.testing.assert_allclose(body(octopus, 60) - before, (2.0, 0.0, 0.0), atol=1e-5)


def test_the_view_shows_the_new_motion_without_a_change_of_frame(octopus: Any) -> None:
    settings_of(octopus).ground.use = False
    generate(octopus)
    bpy.context.scene.frame_set(60)
    settings_of(octopus).route.location.z += 3.0
    generate(octopus)
    evaluated = octopus.evaluated_get(bpy.context.evaluated_depsgraph_get())
    np.testing.assert_allclose(evaluated.matrix_world.translation.z, body(octopus, 60)[2] - 0.1)


def test_an_edited_action_is_kept_and_a_new_one_is_made(octopus: Any) -> None:
    edited = generate(octopus)
    curve = edited.layers[0].strips[0].channelbags[0].fcurves[0]
    curve.keyframe_points[10].co.y += 1.0
    before = {key: values.tobytes() for key, values in keys(edited).items()}
    made = generate(octopus)
    assert made != edited
    assert settings_of(octopus).result == made
    assert {key: values.tobytes() for key, values in keys(edited).items()} == before
    # Nothing else uses it now: only a fake user keeps it in the file.
    assert edited.use_fake_user
    assert generate(octopus) == made


def test_an_artists_own_action_is_kept(octopus: Any) -> None:
    octopus.keyframe_insert("location", frame=1)
    own = octopus.animation_data.action
    made = generate(octopus)
    assert made != own
    assert own in set(bpy.data.actions)
    assert own.use_fake_user


def test_an_action_that_was_taken_off_is_made_anew(octopus: Any) -> None:
    action = generate(octopus)
    octopus.animation_data.action = None
    assert generate(octopus) == action


def test_a_copy_of_the_octopus_gets_an_action_of_its_own(octopus: Any) -> None:
    action = generate(octopus)
    before = {key: values.tobytes() for key, values in keys(action).items()}
    copy = octopus.copy()
    bpy.context.scene.collection.objects.link(copy)
    settings_of(copy).gait = "swim"
    assert generate(copy) != action
    assert octopus.animation_data.action == action
    assert {key: values.tobytes() for key, values in keys(action).items()} == before


def test_the_settings_are_kept_with_the_action(octopus: Any) -> None:
    import json

    settings_of(octopus).cycle_time = 3.0
    note = json.loads(generate(octopus)["octo_motion_generated"]["note"])
    assert note["cycle_time"] == 3.0
    assert note["gait"] == "walk"
    assert note["route"] == "Route"


def test_bones_of_an_arm_that_is_no_longer_listed_go_back_to_rest(octopus: Any) -> None:
    generate(octopus)
    bpy.context.scene.frame_set(30)
    settings_of(octopus).arms.remove(0)
    generate(octopus)
    assert octopus.pose.bones["Arm1_3.L"].matrix_basis.is_identity


# --- Undo and the scene ---------------------------------------------------------------------------


def test_undo_brings_everything_back_in_one_step(octopus: Any) -> None:
    bpy.ops.ed.undo_push(message="before")
    before = scene_contents()
    settings_of(octopus)
    assert click("generate_locomotion") == {"FINISHED"}
    assert scene_contents() != before
    bpy.ops.ed.undo()
    assert scene_contents() == before


def test_undo_of_generating_again_brings_the_old_keys_back(octopus: Any) -> None:
    name = octopus.name
    generate(octopus)
    settings_of(octopus).gait = "swim"
    bpy.ops.ed.undo_push(message="before")
    before = scene_contents()
    click("generate_locomotion")
    assert scene_contents() != before
    bpy.ops.ed.undo()
    assert scene_contents() == before
    assert name in bpy.data.objects


def test_the_scene_is_extended_where_the_motion_lasts_longer_and_no_shorter_than_it_was(
    octopus: Any,
) -> None:
    scene = bpy.context.scene
    generate(octopus)
    assert (scene.frame_start, scene.frame_end) == (1, 250)
    settings_of(octopus).frame_end = 400
    summary = workflow.generate_locomotion(octopus, bpy.context)
    assert scene.frame_end == 400
    assert summary.notes == ("The scene now ends at frame 400.",)
    settings_of(octopus).frame_end = 500
    settings_of(octopus).extend_scene_range = False
    summary = workflow.generate_locomotion(octopus, bpy.context)
    assert scene.frame_end == 400
    assert summary.notes == ("It lasts to frame 500, the scene ends at 400.",)
    assert summary.message.startswith("Walk of 500 frames")


def test_what_was_extended_for_a_motion_is_taken_back_as_it_gets_shorter(octopus: Any) -> None:
    scene, settings = bpy.context.scene, settings_of(octopus)
    for last, end in ((400, 400), (300, 300), (100, 250), (500, 500)):
        settings.frame_end = last
        generate(octopus)
        assert scene.frame_end == end
    # What the artist sets is the artist's.
    scene.frame_end = 450
    settings.frame_end = 100
    generate(octopus)
    assert scene.frame_end == 450


def test_message_and_panel_tell_the_same_of_every_motion(octopus: Any) -> None:
    bpy.ops.octo_motion.setup_load(name="idle")
    summary = workflow.generate_locomotion(octopus, bpy.context)
    assert summary.message.startswith("Idle of ")
    bpy.ops.octo_motion.setup_load(name="walk")
    settings_of(octopus).timing = "RANGE"
    for last in (355, 356):
        settings_of(octopus).frame_end = last
        summary = workflow.generate_locomotion(octopus, bpy.context)
        assert f"({(last - 1) / 24:.1f} s)" in summary.message
        layout = Layout()
        panels._draw_result(layout, settings_of(octopus).result)
        assert f"{last} frames, {(last - 1) / 24:.1f} s" in layout.drawn


def test_all_that_are_selected_move_the_active_one_first(octopus: Any) -> None:
    other, third, idle = make_octopus("Other"), make_octopus("Third"), make_octopus("Idle")
    for each in (other, third):
        give_route(each)
        settings_of(each).timing, settings_of(each).frame_end = "RANGE", 30
    for each in (other, octopus, idle):
        each.select_set(state=True)
    third.select_set(state=False)
    bpy.context.view_layer.objects.active = octopus
    assert bpy.ops.octo_motion.generate_locomotion() == {"FINISHED"}
    moved = [each for each in (octopus, other, third, idle) if settings_of(each).result]
    assert moved == [octopus, other]
    alone = keys(other.animation_data.action)
    generate(other)
    assert keys(other.animation_data.action).keys() == alone.keys()
    for place, values in keys(other.animation_data.action).items():
        assert np.array_equal(values, alone[place])


def test_copies_that_move_at_once_have_seeds_of_their_own(octopus: Any) -> None:
    settings_of(octopus).seed = 4
    plain = keys(generate(octopus))
    copies = [octopus.copy() for _ in range(2)]
    for each in copies:
        bpy.context.scene.collection.objects.link(each)
        each.select_set(state=True)
    octopus.select_set(state=True)
    bpy.context.view_layer.objects.active = octopus
    assert bpy.ops.octo_motion.generate_locomotion() == {"FINISHED"}
    # The active one is as it was.
    assert settings_of(octopus).seed == 4
    assert all(
        np.array_equal(each, plain[at]) for at, each in keys(settings_of(octopus).result).items()
    )
    assert {settings_of(each).seed for each in copies} == {5, 6}
    # Each of them is the same again, together or alone.
    together = keys(settings_of(copies[0]).result)
    generate(copies[0])
    alone = keys(settings_of(copies[0]).result)
    assert all(np.array_equal(each, together[at]) for at, each in alone.items())


def test_seeds_stay_where_nothing_is_made(octopus: Any) -> None:
    other = octopus.copy()
    bpy.context.scene.collection.objects.link(other)
    give_route(other, [(0.0, 0.0, 0.0)] * 4)
    for each in (octopus, other):
        each.select_set(state=True)
    bpy.context.view_layer.objects.active = octopus
    with pytest.raises(RuntimeError):
        bpy.ops.octo_motion.generate_locomotion()
    assert settings_of(other).seed == settings_of(octopus).seed


def test_if_one_of_several_cannot_move_none_does(octopus: Any) -> None:
    other = make_octopus("Other")
    give_route(other, [(0.0, 0.0, 0.0)] * 4)
    octopus.select_set(state=True)
    bpy.context.view_layer.objects.active = octopus
    with pytest.raises(RuntimeError):
        bpy.ops.octo_motion.generate_locomotion()
    assert settings_of(octopus).result is None


def test_frame_selection_and_mode_stay_as_they_are(octopus: Any) -> None:
    bpy.context.scene.frame_set(17)
    bpy.ops.object.mode_set(mode="POSE")
    generate(octopus)
    assert bpy.context.scene.frame_current == 17
    assert bpy.context.mode == "POSE"
    assert bpy.context.object == octopus


# --- Linked rigs ----------------------------------------------------------------------------------


def link_octopus(folder: Path, prepare: Callable[[Any], None] | None = None) -> Any:
    """The octopus linked from a file into an empty scene, not overridden yet."""
    armature = make_octopus()
    if prepare is not None:
        prepare(armature)
    library = str(folder / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Octopus"]
    linked = bpy.data.objects["Octopus"]
    bpy.context.scene.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    return linked


def override(linked: Any) -> Any:
    armature = linked.override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = armature
    return armature


def reopen(folder: Path) -> Any:
    shot = str(folder / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    return next(each for each in bpy.data.objects if each.override_library)


def test_a_linked_rig_walks_through_a_library_override(tmp_path: Path) -> None:
    armature = override(link_octopus(tmp_path))
    give_route(armature)
    settings = settings_of(armature)
    settings.timing, settings.frame_end = "RANGE", 60
    action = generate(armature)
    expected = joints_in_world(armature, 33)
    assert generate(armature) == action

    armature = reopen(tmp_path)
    settings = settings_of(armature)
    assert settings.result == armature.animation_data.action
    assert (settings.timing, settings.frame_end, settings.route.name) == ("RANGE", 60, "Route")
    assert [arm.name for arm in settings.arms] == ["Arm 1 L", "Arm 1 R", "Arm 2 L", "Arm 2 R"]
    np.testing.assert_allclose(joints_in_world(armature, 33), expected, atol=1e-6)
    assert generate(armature) == settings.result
    assert len(bpy.data.actions) == 1
    # And once more: what was written is read again the next time as well.
    assert settings_of(reopen(tmp_path)).frame_end == 60


def test_a_linked_rig_without_an_override_says_what_to_do(tmp_path: Path) -> None:
    linked = link_octopus(tmp_path, give_route)
    bpy.context.view_layer.objects.active = linked
    with pytest.raises(RuntimeError, match=r"read-only here.*library override"):
        click("generate_locomotion")
    assert len(bpy.data.actions) == 0


# --- Errors ---------------------------------------------------------------------------------------


def no_route(armature: Any) -> None:
    settings_of(armature).route = None


def unequal(armature: Any) -> None:
    armature.scale = (1.0, 2.0, 1.0)


def mirrored(armature: Any) -> None:
    armature.scale = (-1.0, -1.0, -1.0)


def without_size(armature: Any) -> None:
    armature.scale = (0.0, 0.0, 0.0)


def unequal_by_its_parent(armature: Any) -> None:
    armature.parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(armature.parent)
    armature.parent.scale = (1.0, 2.0, 1.0)


def sheared(armature: Any) -> None:
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.scale = (1.0, 3.0, 1.0)
    armature.parent = parent
    # Sizes of the axes stay almost equal where the turn splits the stretch between two of them.
    armature.rotation_euler = (0.0, 0.0, np.pi / 4)
    armature.scale = (1.0, 1.0, np.sqrt(5.0))


def carried_route(armature: Any) -> None:
    between = bpy.data.objects.new("Between", None)
    bpy.context.scene.collection.objects.link(between)
    settings_of(armature).route.parent = between
    between.parent = armature


def without_root(armature: Any) -> None:
    settings_of(armature).travel_on, settings_of(armature).root_bone = "BONE", "No such bone"


def connected_root(armature: Any) -> None:
    settings_of(armature).travel_on, settings_of(armature).root_bone = "BONE", "Arm1_2.L"


def backwards(armature: Any) -> None:
    settings_of(armature).frame_end = -5


def too_long(armature: Any) -> None:
    settings_of(armature).timing, settings_of(armature).speed = "SPEED", 1e-5


def too_late(armature: Any) -> None:
    settings_of(armature).timing, settings_of(armature).frame_start = "CADENCE", 1_048_570


def too_early(armature: Any) -> None:
    settings_of(armature).timing, settings_of(armature).frame_start = "CADENCE", -1_048_580


def eased_too_much(armature: Any) -> None:
    settings_of(armature).ease_in = settings_of(armature).ease_out = 0.8


def unknown_gait(armature: Any) -> None:
    settings_of(armature).gait = "hop"


def nothing_chosen(armature: Any) -> None:
    settings_of(armature).gait = ""


def variation_upside_down(armature: Any) -> None:
    settings_of(armature).variation_min = 0.5


def all_switched_off(armature: Any) -> None:
    bpy.ops.octo_motion.detect_arms()
    for arm in settings_of(armature).arms:
        arm.enabled = False


def lost_bone(armature: Any) -> None:
    bpy.ops.octo_motion.detect_arms()
    armature.data.bones["Arm1_2.L"].name = "Renamed"


def no_such_spline(armature: Any) -> None:
    settings_of(armature).spline = 3


def no_weight_curve(armature: Any) -> None:
    settings_of(armature).use_weight_curve = True
    settings_of(armature).weight_curve = None


def tweaked(armature: Any) -> None:
    action = bpy.data.actions.new("Strip")
    data = armature.animation_data_create()
    strip = data.nla_tracks.new().strips.new("Strip", 1, action)
    strip.select = True
    data.use_tweak_mode = True
    if not data.use_tweak_mode:
        pytest.skip("this Blender enters tweak mode only in the NLA editor")


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (no_route, "'Octopus' has no route. Choose a curve"),
        (unequal, r"scaled unequally \(1, 2, 1\)"),
        (unequal_by_its_parent, r"scaled unequally \(1, 2, 1\)\. Apply the parent's scale"),
        (mirrored, "mirrored"),
        (without_size, "has no size"),
        (sheared, "sheared by its parent"),
        (carried_route, "'Route' hangs on 'Octopus' and would move"),
        (without_root, "no bone 'No such bone' to travel on"),
        (connected_root, "connected to its parent"),
        (backwards, "ends at frame -5 and starts at 1"),
        (too_long, "frames, more than 100,000"),
        (too_late, "after Blender's last"),
        (too_early, "before Blender's first"),
        (eased_too_much, "do not fit into the time"),
        (unknown_gait, "There is no gait 'hop'. Choose one of"),
        (nothing_chosen, "No gait is chosen"),
        (variation_upside_down, "minimum is greater"),
        (all_switched_off, "All arms are switched off"),
        (lost_bone, "no bone 'Arm1_2.L'"),
        (no_such_spline, "has 1 spline"),
        (no_weight_curve, "curve of the joint weights is gone"),
        (tweaked, "tweak mode"),
    ],
)
def test_what_is_wrong_is_told_before_anything_changes(
    octopus: Any, spoil: Callable[[Any], None], told: str
) -> None:
    spoil(octopus)
    bpy.context.view_layer.update()
    before = scene_contents()
    with pytest.raises(OctoMotionError, match=told) as error:
        workflow.generate_locomotion(octopus, bpy.context)
    assert error.value.remedy
    with pytest.raises(RuntimeError, match=told):
        click("generate_locomotion")
    assert scene_contents() == before


def test_a_rig_without_arms_gets_a_clear_answer() -> None:
    armature: Any = make_octopus(arms=0)
    give_route(armature)
    with pytest.raises(RuntimeError, match="No arms were found"):
        click("generate_locomotion")


def test_in_edit_mode_and_without_an_armature_the_button_says_why_it_is_off() -> None:
    with pytest.raises(RuntimeError, match="No object is active"):
        click("generate_locomotion")
    octopus = make_octopus()
    give_route(octopus)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="object mode or pose mode"):
        click("generate_locomotion")


def test_constraints_that_hide_the_keys_are_told(octopus: Any) -> None:
    bpy.ops.octo_motion.detect_arms()
    octopus.pose.bones["Arm1_2.L"].constraints.new("COPY_ROTATION").target = octopus
    octopus.constraints.new("LIMIT_LOCATION")
    warnings = workflow.generate_locomotion(octopus, bpy.context).warnings
    assert any("move one bone of the arms ('Arm1_2.L')" in told for told in warnings)
    assert any("away from its route" in told for told in warnings)
    settings_of(octopus).travel_on = "BONE"
    octopus.pose.bones["Root"].constraints.new("LIMIT_LOCATION")
    warnings = workflow.generate_locomotion(octopus, bpy.context).warnings
    assert any("root bone 'Root'" in told for told in warnings)


def test_drivers_and_layers_that_hide_the_motion_are_told(octopus: Any) -> None:
    generate(octopus)
    driver = octopus.driver_add("location", 0)
    assert any(
        "Drivers move" in told
        for told in workflow.generate_locomotion(octopus, bpy.context).warnings
    )
    driver.mute = True
    data = octopus.animation_data
    below = bpy.data.actions.new("Below")
    track = data.nla_tracks.new()
    track.strips.new("Below", 1, below)

    def told_of_layers() -> list[str]:
        told = workflow.generate_locomotion(octopus, bpy.context).warnings
        return [each for each in told if "NLA" in each]

    assert told_of_layers() == []
    data.action_influence = 0.5
    assert "mixes" in told_of_layers()[0]
    data.action_influence, data.action_blend_type = 1.0, "ADD"
    assert "mixes" in told_of_layers()[0]
    track.mute = True
    assert told_of_layers() == []
    track.mute, track.is_solo = False, True
    assert "hides" in told_of_layers()[0]


def test_what_keeps_the_motion_from_being_seen_as_it_is_is_told(octopus: Any) -> None:
    def told() -> list[str]:
        warnings = workflow.generate_locomotion(octopus, bpy.context).warnings
        return [each for each in warnings if "rest position" in each or "stretches" in each]

    assert told() == []
    octopus.data.pose_position = "REST"
    bpy.context.scene.render.frame_map_new = 200
    resting, stretched = told()
    assert "its arms do not move" in resting
    assert "(100 to 200)" in stretched


@pytest.mark.parametrize("travel_on", ["BONE", "NONE"])
@pytest.mark.parametrize("listed", [True, False])
def test_a_root_bone_that_is_posed_and_gets_keys_moves_nothing(
    octopus: Any, travel_on: str, *, listed: bool
) -> None:
    settings_of(octopus).travel_on = travel_on
    settings_of(octopus).root_bone = "Root"
    generate(octopus)
    wanted = joints_in_world(octopus, 12.0)
    octopus.animation_data_clear()
    settings_of(octopus).result = None
    if not listed:
        settings_of(octopus).arms.clear()
        if travel_on == "BONE":
            settings_of(octopus).root_bone = ""
    root = octopus.pose.bones["Root"]
    root.location, root.rotation_quaternion = (0.3, 0.2, 0.1), (0.9, 0.0, 0.4, 0.1)
    bpy.context.view_layer.update()
    generate(octopus)
    np.testing.assert_allclose(joints_in_world(octopus, 12.0), wanted, atol=1e-5)


def test_a_pose_that_moves_the_arms_is_told_and_kept(octopus: Any) -> None:
    settings_of(octopus).tell_overlaps = False
    settings_of(octopus).frame_end = 120
    settings_of(octopus).keep_pose = True
    assert workflow.generate_locomotion(octopus, bpy.context).warnings == ()
    octopus.pose.bones["Arm1_1.L"].location.x = 0.1
    octopus.pose.bones["Arm1_2.L"].scale.y = 2.0
    (told,) = workflow.generate_locomotion(octopus, bpy.context).warnings
    assert told.startswith("The pose of 2 bones moves the arms ('Arm1_1.L')")
    settings_of(octopus).travel_on = "BONE"
    (told,) = workflow.generate_locomotion(octopus, bpy.context).warnings
    assert told.startswith("The pose of 2 bones")
    for name in ("Arm1_1.L", "Arm1_2.L"):
        octopus.pose.bones[name].matrix_basis.identity()
        octopus.pose.bones[name].location.x = 0.0
        octopus.pose.bones[name].scale.y = 1.0
    # What was keyed on the root bone goes back to rest by itself.
    settings_of(octopus).travel_on = "OBJECT"
    assert workflow.generate_locomotion(octopus, bpy.context).warnings == ()


def test_targets_that_are_missed_are_told(octopus: Any) -> None:
    settings_of(octopus).tell_overlaps = False
    settings_of(octopus).frame_end = 120
    shot = prepare(octopus, bpy.context)
    for _ in shot.compute():
        pass
    arms = shot.result.arms
    arms.misses[:, 1] = 0.02
    assert tuple(pipeline.warnings_for_misses(shot.plan, arms)) == (
        "1 of 4 arms cannot follow the gait everywhere: 'Arm 1 R' stays 0.02 arm lengths away.",
    )


def test_an_octopus_that_is_gone_in_the_meantime_is_told(octopus: Any) -> None:
    shot = prepare(octopus, bpy.context)
    for _ in shot.compute():
        pass
    bpy.data.objects.remove(octopus)
    with pytest.raises(OctoMotionError, match="'Octopus' is gone"):
        shot.write()


# --- A long job -----------------------------------------------------------------------------------


class Window:
    """What the operator asks of Blender's window while it works, written down."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.window = self.workspace = self.window_manager = self

    def event_timer_add(self, _step: float, *, window: Any) -> str:  # noqa: ARG002
        self.calls.append("timer on")
        return "timer"

    def event_timer_remove(self, timer: str) -> None:
        assert timer == "timer"
        self.calls.append("timer off")

    def progress_begin(self, _low: float, _high: float) -> None:
        self.calls.append("progress on")

    def progress_update(self, share: float) -> None:
        assert 0.0 < share <= 1.0

    def progress_end(self) -> None:
        self.calls.append("progress off")

    def status_text_set(self, text: str | None) -> None:
        self.calls.append("text off" if text is None else "text on")

    def modal_handler_add(self, _operator: Any) -> None:
        self.calls.append("modal")

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context, name)


class Press:
    def __init__(self, kind: str) -> None:
        self.type = kind


class Operator:
    """The operator's methods on a plain object: Blender makes real ones only with a window."""

    def __init__(self) -> None:
        self.reports: list[str] = []

    def report(self, _kind: set[str], text: str) -> None:
        self.reports.append(text)

    def __getattr__(self, name: str) -> Any:
        found = getattr(OCTO_MOTION_OT_generate_locomotion, name)
        return found.__get__(self) if callable(found) else found


@pytest.fixture
def long_job(octopus: Any, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Any]:
    """The operator at work in twenty steps and more, each of which takes a whole turn."""
    settings_of(octopus).tell_overlaps = False
    settings_of(octopus).frame_end = 120
    monkeypatch.setattr(pipeline, "_BONES_AT_ONCE", 24 * 6)
    monkeypatch.setattr("octo_motion.ui.locomotion.operators.generate.PATIENCE", 0.0)
    monkeypatch.setattr(ModalJob, "_turn", 0.0)
    operator, window = Operator(), Window()
    assert operator.invoke(window, Press("LEFTMOUSE")) == {"RUNNING_MODAL"}
    assert window.calls == ["timer on", "progress on", "modal", "text on"]
    return operator, window


CLEAN = ["timer off", "progress off", "text off"]


def test_a_long_job_shows_progress_and_comes_to_its_end(long_job: tuple[Any, Any]) -> None:
    operator, window = long_job
    turns = 0
    while operator.modal(window, Press("TIMER")) == {"RUNNING_MODAL"}:
        turns += 1
        assert operator.modal(window, Press("LEFTMOUSE")) == {"RUNNING_MODAL"}
    assert turns >= 20
    assert window.calls[-3:] == CLEAN
    assert len(bpy.data.actions) == 1
    assert operator.reports == ["Walk of 120 frames (5.0 s): 'Octopus Locomotion'."]


def test_a_warning_is_what_the_status_bar_goes_on_to_show(
    long_job: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    operator, window = long_job
    told = ["This first.", "Then this."]
    monkeypatch.setattr(pipeline, "warnings_for_misses", lambda *_: iter(told))
    while operator.modal(window, Press("TIMER")) == {"RUNNING_MODAL"}:
        pass
    told = "Walk of 120 frames (5.0 s): 'Octopus Locomotion'."
    assert operator.reports == [told, "Then this.", "This first."]


def test_esc_leaves_the_scene_as_it_was(long_job: tuple[Any, Any]) -> None:
    operator, window = long_job
    before = scene_contents()
    operator.modal(window, Press("TIMER"))
    assert operator.modal(window, Press("ESC")) == {"CANCELLED"}
    assert window.calls[-3:] == CLEAN
    assert scene_contents() == before
    # Blender may call it as well, when it quits.
    operator.cancel(window)
    assert window.calls.count("timer off") == 1


def test_nothing_of_it_is_left_when_the_add_on_is_switched_off(long_job: tuple[Any, Any]) -> None:
    operator, window = long_job
    window.windows = []
    before = scene_contents()
    operator.modal(window, Press("TIMER"))
    # What Blender hands over when an add-on goes.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("octo_motion.ui.at_work.bpy", SimpleNamespace(context=window))
        at_work.stop_all()
    assert [each for each in window.calls if each.endswith("off")][:3] == CLEAN
    assert scene_contents() == before
    at_work.stop_all()


def test_a_failure_in_the_middle_cleans_up(
    long_job: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    operator, window = long_job

    def fail(*_: object, **_options: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(GaitPoser, "shaping", fail)

    def work() -> None:
        while operator.modal(window, Press("TIMER")) == {"RUNNING_MODAL"}:
            pass

    with pytest.raises(ZeroDivisionError):
        work()
    assert window.calls[-3:] == CLEAN
    assert len(bpy.data.actions) == 0


def test_a_rig_that_is_gone_at_the_end_is_told(long_job: tuple[Any, Any]) -> None:
    operator, window = long_job
    bpy.data.objects.remove(bpy.data.objects["Octopus"])
    result = {"RUNNING_MODAL"}
    while result == {"RUNNING_MODAL"}:
        result = operator.modal(window, Press("TIMER"))
    assert result == {"CANCELLED"}
    assert operator.reports == ["'Octopus' is gone. Generate again."]
    assert window.calls[-3:] == CLEAN


def test_esc_while_it_is_measured_leaves_the_motion_that_is_there(
    octopus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.octo_motion.detect_arms()
    bone = octopus.pose.bones[settings_of(octopus).arms[0].bones[-1].name]
    bone.constraints.new("LIMIT_ROTATION")
    monkeypatch.setattr("octo_motion.ui.locomotion.operators.generate.PATIENCE", 0.0)
    monkeypatch.setattr("octo_motion.ui.locomotion.writing.shot._AT_ONCE", 0.0)
    monkeypatch.setattr(ModalJob, "_turn", 0.0)
    bpy.context.scene.frame_set(3)
    operator, window = Operator(), Window()
    operator.invoke(window, Press("LEFTMOUSE"))
    while octopus.animation_data is None or octopus.animation_data.action is None:
        assert operator.modal(window, Press("TIMER")) == {"RUNNING_MODAL"}
    for _ in range(3):
        assert operator.modal(window, Press("TIMER")) == {"RUNNING_MODAL"}
        # Between two turns nothing is seen of it.
        assert bpy.context.scene.frame_current == 3
    assert operator.modal(window, Press("ESC")) == {"FINISHED"}
    assert window.calls[-3:] == CLEAN
    assert operator.reports[0].startswith("Walk of ")
    assert operator.reports[-1].startswith("Not measured as it plays")
    assert len(settings_of(octopus).figures) > 0
