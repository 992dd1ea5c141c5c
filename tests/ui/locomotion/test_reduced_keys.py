# SPDX-License-Identifier: GPL-3.0-or-later
"""Few keys to edit by hand: within the tolerance of the dense motion, and the artist's own."""

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation import actions
from octo_motion.core.errors import OctoMotionError
from octo_motion.core.rotations import angle_between, from_matrix
from octo_motion.ui.locomotion import panels
from octo_motion.ui.locomotion.writing import shot as workflow
from tests.ui.made import prepare
from tests.ui.rig import (
    ROUTE,
    Octopus,
    click,
    generate,
    give_route,
    joints_in_world,
    keys,
    scene_contents,
    still,
)
from tests.ui.test_panels import Layout

pytestmark = pytest.mark.one_blender

FRAMES = range(1, 61)


OCTOPUS = Octopus(route=ROUTE, frames=60)
"""Four arms of six bones, one metre long, a route of about six metres."""


def settings_of(armature: Any) -> Any:
    return armature.octo_motion.locomotion


def seen(armature: Any) -> tuple[np.ndarray, np.ndarray]:
    """World positions of the arms' tips (frames, arms, 3), and bones' turns against their parents
    (frames, bones, 4), as Blender plays them."""
    tips, turns = [], []
    names = [bone.name for bone in armature.data.bones]
    ends = [number for number, name in enumerate(names) if "_6." in name]
    for frame in FRAMES:
        tips.append(joints_in_world(armature, frame)[ends, 1])
        pose = armature.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
        local = [
            (bone.parent.matrix.inverted() @ bone.matrix if bone.parent else bone.matrix).to_3x3()
            for bone in pose
        ]
        turns.append(from_matrix(np.array(local)))
    return np.array(tips), np.array(turns)


@pytest.mark.parametrize("gait", ["walk", "swim"])
@pytest.mark.parametrize("place", ["object", "root bone", "scaled parent"])
@pytest.mark.parametrize(("degrees", "distance"), [(0.5, 0.005), (3.0, 0.002), (0.2, 0.05)])
def test_bones_and_tips_are_within_the_tolerance_at_every_frame(
    octopus: Any, gait: str, place: str, degrees: float, distance: float
) -> None:
    settings = settings_of(octopus)
    settings.gait = gait
    scale = 1.0
    if place == "root bone":
        settings.travel_on = "BONE"
        settings.root_bone = "Root"
    elif place == "scaled parent":
        scale = 3.0
        parent: Any = bpy.data.objects.new("Parent", None)
        bpy.context.scene.collection.objects.link(parent)
        parent.scale, parent.location = (scale,) * 3, (1.0, 2.0, 3.0)
        parent.rotation_euler = (0.1, 0.2, 0.3)
        octopus.parent = parent
        octopus.rotation_mode = "YXZ"
        bpy.context.view_layer.update()
    generate(octopus)
    tips, turns = seen(octopus)
    settings.keys = "REDUCED"
    settings.key_angle, settings.key_distance = np.radians(degrees), distance
    generate(octopus)
    few_tips, few_turns = seen(octopus)
    # Matrices of single precision: 1e-3 degrees.
    assert np.degrees(angle_between(few_turns, turns)).max() <= degrees + 2e-3
    away = np.linalg.norm(few_tips - tips, axis=-1).max()
    assert away <= distance * scale * 1.0 + 1e-5
    # It is used, too.
    assert away > 0.05 * distance or np.degrees(angle_between(few_turns, turns)).max() > 0.1


def test_other_rotation_modes_are_kept_and_within_the_tolerance(octopus: Any) -> None:
    for number, bone in enumerate(octopus.pose.bones):
        bone.rotation_mode = ("QUATERNION", "XYZ", "AXIS_ANGLE")[number % 3]
    generate(octopus)
    tips, turns = seen(octopus)
    settings_of(octopus).keys = "REDUCED"
    generate(octopus)
    few_tips, few_turns = seen(octopus)
    assert np.degrees(angle_between(few_turns, turns)).max() <= 0.502
    assert np.linalg.norm(few_tips - tips, axis=-1).max() <= 0.005 + 1e-5


@pytest.mark.parametrize("columns", ["ARM", "BONE"])
def test_an_arm_has_its_keys_in_one_group_at_the_same_frames_if_wanted(
    octopus: Any, columns: str
) -> None:
    settings_of(octopus).keys, settings_of(octopus).key_columns = "REDUCED", columns
    action = generate(octopus)
    bag = action.layers[0].strips[0].channelbags[0]
    assert [group.name for group in bag.groups] == [
        *("Object Transforms", "Arm 1 L", "Arm 1 R", "Arm 2 L", "Arm 2 R"),
    ]
    for group in bag.groups[1:]:
        frames: dict[str, set[tuple[float, ...]]] = {}
        for curve in group.channels:
            own = tuple(key.co.x for key in curve.keyframe_points)
            frames.setdefault(curve.data_path, set()).add(own)
            assert len(own) < 60
        # Whatever is shared beyond, a bone's own channels have theirs in common.
        assert all(len(each) == 1 for each in frames.values())
        assert (len(set.union(*frames.values())) == 1) == (columns == "ARM")
    counts = [len(group.channels) for group in bag.groups]
    assert counts == [6, 24, 24, 24, 24]


def test_the_message_and_the_panel_tell_keys_before_and_after(octopus: Any) -> None:
    generate(octopus)
    assert "instead of" not in drawn(octopus)
    settings = settings_of(octopus)
    settings.keys, settings.frame_end = "REDUCED", 400
    summary = workflow.generate_locomotion(octopus, bpy.context)
    found = sum(len(each) for each in keys(octopus.animation_data.action).values())
    assert (summary.keys, summary.dense_keys) == (found, 400 * (4 * 24 + 6))
    told = f"{summary.keys:,} keys instead of 40,800"
    assert f"{told}." in summary.message
    assert told in drawn(octopus)
    assert summary.keys < summary.dense_keys / 3


def drawn(octopus: Any) -> str:
    layout = Layout()
    for panel in (panels.OCTO_MOTION_PT_generate, panels.OCTO_MOTION_PT_frames):
        panel.show(None, layout, settings_of(octopus))  # type: ignore[arg-type]
    return " ".join(layout.drawn)


def test_the_panel_shows_the_tolerance_where_it_matters(octopus: Any) -> None:
    assert "key_angle" not in drawn(octopus)
    settings_of(octopus).keys = "REDUCED"
    assert "key_angle" in drawn(octopus)
    assert "key_distance" in drawn(octopus)


def test_reduced_and_dense_replace_each_other_in_place(octopus: Any) -> None:
    dense = keys(generate(octopus))
    settings_of(octopus).keys = "REDUCED"
    few = keys(generate(octopus))
    assert set(few) == set(dense)
    again = keys(generate(octopus))
    assert all(np.array_equal(again[key], value) for key, value in few.items())
    settings_of(octopus).keys = "DENSE"
    back = keys(generate(octopus))
    assert all(np.array_equal(back[key], value) for key, value in dense.items())
    assert len(bpy.data.actions) == 1


def test_an_edited_reduced_key_is_the_artists(octopus: Any) -> None:
    settings_of(octopus).keys = "REDUCED"
    action = generate(octopus)
    curve = action.layers[0].strips[0].channelbags[0].fcurves[20]
    curve.keyframe_points[1].co.y += 0.05
    curve.update()
    before = keys(action)
    other = generate(octopus)
    assert other != action
    assert action.use_fake_user
    assert all(np.array_equal(value, before[key]) for key, value in keys(action).items())
    assert not actions.is_edited(other)


def test_one_undo_takes_the_reduced_keys_back(octopus: Any) -> None:
    generate(octopus)
    settings_of(octopus).keys = "REDUCED"
    bpy.ops.ed.undo_push(message="Before")
    before = scene_contents()
    click("generate_locomotion")
    assert scene_contents() != before
    bpy.ops.ed.undo()
    assert scene_contents() == before


@pytest.mark.parametrize("name", ["key_angle", "key_distance"])
def test_without_tolerance_it_says_so_and_changes_nothing(octopus: Any, name: str) -> None:
    settings_of(octopus).keys = "REDUCED"
    setattr(settings_of(octopus), name, 0.0)
    before = scene_contents()
    with pytest.raises(OctoMotionError, match="Without any tolerance"):
        workflow.generate_locomotion(octopus, bpy.context)
    assert scene_contents() == before
    settings_of(octopus).keys = "DENSE"
    generate(octopus)


def test_the_mantle_of_a_swimmer_has_two_keys() -> None:
    click("add_octopus", with_mesh=False)
    octopus: Any = bpy.context.object
    give_route(octopus)
    settings = settings_of(octopus)
    still(settings)
    settings.gait, settings.keys = "swim", "REDUCED"
    settings.timing, settings.frame_end = "RANGE", 60
    action = generate(octopus)
    groups = {group.name: group for group in action.layers[0].strips[0].channelbags[0].groups}
    assert {len(curve.keyframe_points) for curve in groups["Mantle"].channels} == {2}


def test_finding_few_keys_shows_progress_and_can_be_stopped(octopus: Any) -> None:
    settings_of(octopus).keys = "REDUCED"
    before = scene_contents()
    shares = []
    for share in prepare(octopus, bpy.context).compute():
        shares.append(share)
        if len(shares) == 6:
            break
    assert scene_contents() == before
    shot = prepare(octopus, bpy.context)
    shares = list(shot.compute())
    assert len(shares) > 6
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    # What is left to do is only to hand them to Blender.
    assert all(channel.keys is not None for channel in shot.channels)


@pytest.mark.parametrize(("columns", "times"), [("BONE", 8.0), ("ARM", 5.0)])
def test_the_default_walk_has_many_times_fewer_keys_that_keep_its_pace(
    columns: str, times: float
) -> None:
    click("add_octopus", with_mesh=False)
    octopus: Any = bpy.context.object
    give_route(octopus)
    settings = settings_of(octopus)
    settings.keys, settings.key_columns, settings.tell_overlaps = "REDUCED", columns, False
    summary = workflow.generate_locomotion(octopus, bpy.context)
    assert summary.dense_keys > times * summary.keys


def test_stretching_arms_keep_their_tips_where_they_are(octopus: Any) -> None:
    """Bones of which each makes the next longer too, and holds the ground meanwhile."""
    settings = settings_of(octopus)
    for bone in octopus.data.bones:
        bone.inherit_scale = "ALIGNED"
    settings.keys = "DENSE"
    generate(octopus)
    assert any("scale" in path for path, _ in keys(octopus.animation_data.action))
    tips, _ = seen(octopus)
    settings.keys = "REDUCED"
    generate(octopus)
    few_tips, _ = seen(octopus)
    assert np.linalg.norm(few_tips - tips, axis=-1).max() <= 0.005 + 1e-5
