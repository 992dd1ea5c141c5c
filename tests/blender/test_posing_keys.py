# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of posing go where the artist wants them, by Blender's rules, and can be taken back."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.fcurves import read_keys, write_keys
from octo_motion.blender.animation.pose_keys import Keyed, PoseKeys
from octo_motion.core.errors import WriteError
from octo_motion.core.rotations import from_axis_angle

ARM, BODY = "arm1.01.L", "body"
TARGETS = ("CURRENT", "COPY", "LAYER", "CHOSEN")


@pytest.fixture
def armature() -> Any:
    bpy.ops.octo_motion.add_octopus(with_mesh=False, joints=4)
    return bpy.context.object


def curves(armature: Any) -> dict[tuple[str, int], list[list[float]]]:
    """Keys of the armature's action as lists, by bone and property and component."""
    data = armature.animation_data
    if data is None or data.action is None:
        return {}
    found = {}
    for layer in data.action.layers:
        for strip in layer.strips:
            channelbag = strip.channelbag(data.action_slot) if data.action_slot else None
            for curve in channelbag.fcurves if channelbag else ():
                keys = read_keys(curve)
                rows = np.column_stack([np.asarray(each) for each in keys.values.values()])
                found[curve.data_path, curve.array_index] = rows.tolist()
    return found


def keyed(armature: Any) -> dict[str, set[float]]:
    """Frames with keys by property of a bone, as "bone.property"."""
    found: dict[str, set[float]] = {}
    for (path, _), rows in curves(armature).items():
        bone, _, channel = path.removeprefix('pose.bones["').partition('"].')
        found.setdefault(f"{bone} {channel}", set()).update(row[0] for row in rows)
    return found


def everything(armature: Any) -> Any:
    """All that keys can change."""
    data = armature.animation_data
    return (
        curves(armature),
        data is None,
        data and (data.action and data.action.name, data.action_slot and data.action_slot.handle),
        data and [track.name for track in data.nla_tracks],
        [
            (action.name, action.use_fake_user, [slot.identifier for slot in action.slots])
            for action in bpy.data.actions
        ],
    )


def animate(armature: Any) -> Any:
    """An action with two keys of one arm."""
    bone = armature.pose.bones[ARM]
    bone.keyframe_insert("rotation_quaternion", frame=1)
    bone.rotation_quaternion = (0.9, 0.3, 0.0, 0.0)
    bone.keyframe_insert("rotation_quaternion", frame=11)
    return armature.animation_data.action


def test_turned_bone_gets_a_key_for_its_rotation_and_a_moved_one_for_its_place(
    armature: Any,
) -> None:
    names = PoseKeys(armature).insert(armature, [Keyed(ARM), Keyed(BODY, placed=True)], 7.0)
    assert names == [ARM, BODY]
    assert keyed(armature) == {
        f"{ARM} rotation_quaternion": {7.0},
        f"{BODY} rotation_quaternion": {7.0},
        f"{BODY} location": {7.0},
    }
    action = armature.animation_data.action
    groups = {c.group.name for b in action.layers[0].strips[0].channelbags for c in b.fcurves}
    assert groups == {ARM, BODY}


@pytest.mark.parametrize(
    ("mode", "channel"), [("XYZ", "rotation_euler"), ("AXIS_ANGLE", "rotation_axis_angle")]
)
def test_each_bone_is_keyed_in_its_own_rotation_mode(
    armature: Any, mode: str, channel: str
) -> None:
    armature.pose.bones[ARM].rotation_mode = mode
    PoseKeys(armature).insert(armature, [Keyed(ARM)], 1.0)
    assert keyed(armature) == {f"{ARM} {channel}": {1.0}}


def test_key_type_is_that_of_the_timeline(armature: Any) -> None:
    bpy.context.scene.tool_settings.keyframe_type = "BREAKDOWN"
    PoseKeys(armature).insert(armature, [Keyed(ARM)], 1.0)
    channelbag = armature.animation_data.action.layers[0].strips[0].channelbags[0]
    assert {key.type for curve in channelbag.fcurves for key in curve.keyframe_points} == {
        "BREAKDOWN"
    }


def test_only_needed_keys_are_made_where_the_preferences_say_so(armature: Any) -> None:
    animate(armature)
    bpy.context.preferences.edit.use_keyframe_insert_needed = True
    try:
        names = PoseKeys(armature).insert(armature, [Keyed(ARM)], 11.0)
        assert keyed(armature) == {f"{ARM} rotation_quaternion": {1.0, 11.0}}
        assert names == []
    finally:
        bpy.context.preferences.edit.use_keyframe_insert_needed = False


@pytest.mark.parametrize(
    ("name", "channels"),
    [
        ("Location", {"location"}),
        ("Rotation", {"rotation_quaternion"}),
        ("LocRotScale", {"location", "rotation_quaternion", "scale"}),
        ("BUILTIN_KSI_VisualRot", {"rotation_quaternion"}),
        ("WholeCharacter", {"location", "rotation_quaternion", "scale"}),
    ],
)
def test_active_keying_set_decides_on_the_channels(
    armature: Any, name: str, channels: set[str]
) -> None:
    scene = bpy.context.scene
    scene.keying_sets_all.active = scene.keying_sets_all[
        next(each.bl_label for each in scene.keying_sets_all if each.bl_idname == name)
    ]
    PoseKeys(armature).insert(armature, [Keyed(ARM)], 1.0)
    assert set(keyed(armature)) == {f"{ARM} {channel}" for channel in channels}


def test_keying_set_available_keys_what_has_keys_already(armature: Any) -> None:
    animate(armature)
    scene = bpy.context.scene
    scene.keying_sets_all.active = scene.keying_sets_all["Available"]
    assert PoseKeys(armature).insert(armature, [Keyed(ARM), Keyed(BODY)], 5.0) == [ARM]
    assert keyed(armature) == {f"{ARM} rotation_quaternion": {1.0, 5.0, 11.0}}


def test_keying_set_of_the_artists_own_is_keyed_as_it_is(armature: Any) -> None:
    scene = bpy.context.scene
    own = scene.keying_sets.new(idname="Mine", name="Mine")
    path = armature.pose.bones["head"].path_from_id("rotation_quaternion")
    own.paths.add(armature, path)
    scene.keying_sets.active = own
    assert PoseKeys(armature).insert(armature, [Keyed(ARM)], 1.0) == ["head"]
    assert keyed(armature) == {"head rotation_quaternion": {1.0}}


@pytest.mark.parametrize("animated", [False, True])
@pytest.mark.parametrize("target", TARGETS)
def test_taking_back_leaves_no_trace(armature: Any, target: Any, animated: bool) -> None:  # noqa: FBT001
    if animated:
        animate(armature)
    bpy.data.actions.new("Chosen").use_fake_user = True
    before = everything(armature)
    keys = PoseKeys(armature, target, bpy.data.actions["Chosen"])
    keys.insert(armature, [Keyed(ARM), Keyed(BODY, placed=True)], 5.0)
    turns = from_axis_angle([1.0, 0.0, 0.0], np.linspace(0.0, 1.0, 20))
    keys.insert_motion(
        armature,
        np.arange(3.0, 23.0),
        {ARM: turns},
        {BODY: np.zeros((20, 3))},
        angle=0.01,
        distance=0.01,
    )
    assert everything(armature) != before
    keys.take_back(armature)
    keys.take_back(armature)
    assert everything(armature) == before


def test_copy_leaves_the_action_as_it_is(armature: Any) -> None:
    action = animate(armature)
    before = curves(armature)
    PoseKeys(armature, "COPY").insert(armature, [Keyed(ARM)], 5.0)
    assert armature.animation_data.action != action
    assert keyed(armature) == {f"{ARM} rotation_quaternion": {1.0, 5.0, 11.0}}
    armature.animation_data.action = action
    armature.animation_data.action_slot = action.slots[0]
    assert curves(armature) == before


def test_layer_lies_over_the_action_and_holds_the_new_keys_alone(armature: Any) -> None:
    action = animate(armature)
    armature.pose.bones[BODY].rotation_quaternion = (0.8, 0.0, 0.6, 0.0)
    PoseKeys(armature, "LAYER").insert(armature, [Keyed(BODY)], 5.0)
    data = armature.animation_data
    assert [strip.action for track in data.nla_tracks for strip in track.strips] == [action]
    assert keyed(armature) == {f"{BODY} rotation_quaternion": {5.0}}
    bpy.context.scene.frame_set(11)
    # The strip beneath still moves the arm, the layer holds the body.
    assert armature.pose.bones[ARM].rotation_quaternion[1] == pytest.approx(0.3, abs=0.02)
    assert armature.pose.bones[BODY].rotation_quaternion[2] == pytest.approx(0.6, abs=1e-6)


def test_what_lies_under_a_layer_plays_on_whatever_its_first_frame(armature: Any) -> None:
    bone = armature.pose.bones[ARM]
    bone.rotation_mode = "XYZ"
    # As imported clips have their keys: between frames.
    for frame, angle in ((1.5, 0.0), (11.5, 1.0)):
        bone.rotation_euler.x = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    frames = (2, 5, 9)

    def played() -> list[float]:
        found = []
        for frame in frames:
            bpy.context.scene.frame_set(frame)
            found.append(bone.rotation_euler.x)
        return found

    before = played()
    PoseKeys(armature, "LAYER").insert(armature, [Keyed(BODY)], 5.0)
    assert played() == pytest.approx(before, abs=1e-6)


def test_chosen_action_gets_the_keys(armature: Any) -> None:
    own = animate(armature)
    chosen = bpy.data.actions.new("Chosen")
    PoseKeys(armature, "CHOSEN", chosen).insert(armature, [Keyed(BODY)], 5.0)
    assert armature.animation_data.action == chosen
    assert keyed(armature) == {f"{BODY} rotation_quaternion": {5.0}}
    assert own.use_fake_user


def test_chosen_action_that_is_gone_is_refused(armature: Any) -> None:
    with pytest.raises(WriteError, match="No action is chosen for the keys"):
        PoseKeys(armature, "CHOSEN")
    chosen = bpy.data.actions.new("Chosen")
    keys = PoseKeys(armature, "CHOSEN", chosen)
    bpy.data.actions.remove(chosen)
    with pytest.raises(WriteError, match="The action for the keys is gone"):
        keys.insert(armature, [Keyed(ARM)], 1.0)
    assert armature.animation_data is None


def test_recorded_motion_is_a_few_keys_within_its_bound_and_replaces_what_was_there(
    armature: Any,
) -> None:
    bone = armature.pose.bones[ARM]
    for frame in range(0, 61, 2):
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    frames = np.arange(10.0, 51.0)
    turns = from_axis_angle([1.0, 0.0, 0.0], np.sin((frames - 10.0) / 12.0))
    count = PoseKeys(armature).insert_motion(
        armature, frames, {ARM: turns}, {}, angle=np.radians(1.0), distance=0.01
    )
    assert 3 <= count <= 12
    times = sorted(keyed(armature)[f"{ARM} rotation_quaternion"])
    assert [time for time in times if time < 10.0] == [0.0, 2.0, 4.0, 6.0, 8.0]
    assert [time for time in times if time > 50.0] == [52.0, 54.0, 56.0, 58.0, 60.0]
    assert len([time for time in times if 10.0 <= time <= 50.0]) == count
    for frame, turn in zip(frames[::5], turns[::5], strict=True):
        bpy.context.scene.frame_set(int(frame))
        shown = np.array(bone.rotation_quaternion.normalized())
        assert 2.0 * np.arccos(min(abs(shown @ turn), 1.0)) < np.radians(1.01)


def test_keys_are_read_and_written_with_all_that_they_are(armature: Any) -> None:
    action = animate(armature)
    curve = action.layers[0].strips[0].channelbags[0].fcurves[0]
    first, last = curve.keyframe_points
    first.interpolation, first.easing, first.back = "BACK", "EASE_OUT", 2.5
    last.handle_left_type, last.type = "FREE", "EXTREME"
    curve.update()
    before = read_keys(curve)
    curve.keyframe_points.clear()
    write_keys(curve, before)
    after = read_keys(curve)
    for name, values in before.values.items():
        assert values.tolist() == after.values[name].tolist(), name
