# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of posing where something gets in their way: what is the artist's own stays as it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import curves_of
from octo_motion.blender.animation.pose_keys import Keyed, PoseKeys
from octo_motion.core.errors import WriteError
from octo_motion.core.rotations import from_axis_angle

ARM, OTHER, BODY = "arm1.01.L", "arm2.01.L", "body"


@pytest.fixture
def armature() -> Any:
    bpy.ops.octo_motion.add_octopus(with_mesh=False, joints=4)
    return bpy.context.object


def animate(armature: Any, name: str = ARM) -> Any:
    """An action with two keys of one arm."""
    bone = armature.pose.bones[name]
    bone.keyframe_insert("rotation_quaternion", frame=1)
    bone.rotation_quaternion = (0.9, 0.3, 0.0, 0.0)
    bone.keyframe_insert("rotation_quaternion", frame=11)
    return armature.animation_data.action


def curves(action: Any) -> dict[tuple[str, int], list[tuple[float, float]]]:
    return {
        (curve.data_path, curve.array_index): [
            (key.co[0], key.co[1]) for key in curve.keyframe_points
        ]
        for curve in curves_of(action)
    }


@pytest.fixture
def linked(armature: Any, tmp_path: Path) -> Any:
    """An action of another file on an armature of this one."""
    animate(armature).name = "Walk"
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.octo_motion.add_octopus(with_mesh=False, joints=4)
    found: Any = bpy.context.object
    libraries: Any = bpy.data.libraries
    with libraries.load(path, link=True) as (_, wanted):
        wanted.actions = ["Walk"]
    (action,) = wanted.actions
    found.animation_data_create()
    found.animation_data.action = action
    found.animation_data.action_slot = action.slots[0]
    return found


@pytest.mark.parametrize("target", ["COPY", "LAYER", "CHOSEN"])
@pytest.mark.parametrize("twin", [False, True])
def test_taking_back_gives_a_linked_action_back(linked: Any, target: Any, twin: bool) -> None:  # noqa: FBT001
    """Also where an action of this file is called the same."""
    action = linked.animation_data.action
    if twin:
        bpy.data.actions.new("Walk").use_fake_user = True
    bpy.data.actions.new("Mine").use_fake_user = True
    keys = PoseKeys(linked, target, bpy.data.actions["Mine"])
    keys.insert(linked, [Keyed(ARM)], 5.0)
    assert linked.animation_data.action != action
    keys.take_back(linked)
    assert linked.animation_data.action == action
    assert linked.animation_data.action_slot == action.slots[0]


def test_taking_back_gives_back_an_action_that_was_renamed_meanwhile(armature: Any) -> None:
    action = animate(armature)
    before = curves(action)
    keys = PoseKeys(armature, "COPY")
    keys.insert(armature, [Keyed(ARM)], 5.0)
    armature.animation_data.action.name, action.name = "Mine", "Renamed"
    keys.take_back(armature)
    assert armature.animation_data.action == action
    assert curves(action) == before
    assert list(bpy.data.actions) == [action]


def test_linked_action_is_refused_as_the_one_for_the_keys(linked: Any) -> None:
    with pytest.raises(WriteError, match="'Walk' is linked and read-only"):
        PoseKeys(linked, "CHOSEN", linked.animation_data.action)


def test_action_given_meanwhile_is_keyed_and_each_gets_its_own_back(armature: Any) -> None:
    """In the Action Editor, while a session goes on."""
    first = animate(armature)
    second = bpy.data.actions.new("Second")
    second.use_fake_user = True
    armature.animation_data.action = second
    animate(armature)
    before = curves(first), curves(second)
    armature.animation_data.action = first
    armature.animation_data.action_slot = first.slots[0]
    keys = PoseKeys(armature)
    keys.insert(armature, [Keyed(ARM), Keyed(BODY)], 5.0)
    armature.animation_data.action = second
    armature.animation_data.action_slot = second.slots[0]
    assert keys.insert(armature, [Keyed(ARM), Keyed(OTHER)], 7.0) == [ARM, OTHER]
    assert {
        key[0]
        for key in curves(second)[armature.pose.bones[ARM].path_from_id("rotation_quaternion"), 0]
    } == {1.0, 7.0, 11.0}
    keys.take_back(armature)
    assert (curves(first), curves(second)) == before
    assert armature.animation_data.action == second


def test_action_that_was_taken_off_meanwhile_is_no_error(armature: Any) -> None:
    action = animate(armature)
    before = curves(action)
    keys = PoseKeys(armature)
    keys.insert(armature, [Keyed(ARM)], 5.0)
    armature.animation_data.action = None
    action.use_fake_user = True
    keys.insert(armature, [Keyed(ARM)], 6.0)
    keys.take_back(armature)
    assert curves(action) == before
    assert armature.animation_data.action is None
    assert list(bpy.data.actions) == [action]


def test_taking_back_leaves_alone_what_was_never_keyed_there(armature: Any) -> None:
    """Another action that the artist has given the armature since."""
    animate(armature)
    keys = PoseKeys(armature)
    keys.insert(armature, [Keyed(ARM), Keyed(BODY)], 5.0)
    second = bpy.data.actions.new("Second")
    armature.animation_data.action = second
    animate(armature)
    animate(armature, BODY)
    before = curves(second)
    keys.take_back(armature)
    assert curves(second) == before


def test_own_keying_set_keys_the_one_axis_that_it_names(armature: Any) -> None:
    scene = bpy.context.scene
    own = scene.keying_sets.new(idname="Mine", name="Mine")
    path = armature.pose.bones["head"].path_from_id("location")
    added = own.paths.add(armature, path, index=2)
    added.use_entire_array = False
    scene.keying_sets.active = own
    PoseKeys(armature).insert(armature, [Keyed(ARM)], 1.0)
    assert set(curves(armature.animation_data.action)) == {(path, 2)}


def test_own_keying_set_may_name_single_numbers_and_what_is_gone(armature: Any) -> None:
    armature["weight"] = 1.0
    scene = bpy.context.scene
    own = scene.keying_sets.new(idname="Mine", name="Mine")
    own.paths.add(armature, 'pose.bones["gone"].location')
    own.paths.add(armature, '["weight"]').use_entire_array = False
    scene.keying_sets.active = own
    PoseKeys(armature).insert(armature, [Keyed(ARM)], 1.0)
    assert set(curves(armature.animation_data.action)) == {('["weight"]', 0)}


def test_taking_back_knows_properties_of_many_numbers(armature: Any) -> None:
    armature["faces"] = [0.0] * 6
    scene = bpy.context.scene
    own = scene.keying_sets.new(idname="Mine", name="Mine")
    own.paths.add(armature, '["faces"]')
    scene.keying_sets.active = own
    action = animate(armature)
    before = curves(action)
    keys = PoseKeys(armature)
    keys.insert(armature, [Keyed(ARM)], 1.0)
    assert curves(action) != before
    keys.take_back(armature)
    assert curves(action) == before


@pytest.mark.parametrize("by", ["curve", "group"])
def test_recording_leaves_locked_curves_alone(armature: Any, by: str) -> None:
    action = animate(armature)
    for curve in curves_of(action):
        locked: Any = curve if by == "curve" else curve.group
        locked.lock = True
    before = curves(action)
    turns = from_axis_angle([1.0, 0.0, 0.0], np.linspace(0.0, 1.0, 20))
    PoseKeys(armature).insert_motion(
        armature, np.arange(3.0, 23.0), {ARM: turns, BODY: turns}, {}, angle=0.01, distance=0.01
    )
    after = curves(action)
    assert {place: after[place] for place in before} == before
    assert len(after) == 8


@pytest.mark.parametrize("mode", ["QUATERNION", "XYZ", "AXIS_ANGLE"])
def test_recorded_motion_goes_on_from_the_key_before_it(armature: Any, mode: str) -> None:
    """The other sign of a quaternion, or another round, is the same pose; no way leads there."""
    bone = armature.pose.bones[ARM]
    bone.rotation_mode = mode
    path, value = {
        "QUATERNION": ("rotation_quaternion", (-1.0, 0.0, 0.0, 0.0)),
        "XYZ": ("rotation_euler", (2.0 * np.pi, 0.0, 0.0)),
        "AXIS_ANGLE": ("rotation_axis_angle", (0.3, -1.0, 0.0, 0.0)),
    }[mode]
    setattr(bone, path, value)
    start = 0.0 if mode != "AXIS_ANGLE" else -0.3
    for frame in (1, 31):
        bone.keyframe_insert(path, frame=frame)
    frames = np.arange(10.0, 21.0)
    turns = from_axis_angle([1.0, 0.0, 0.0], start + np.linspace(0.0, 0.5, 11))
    PoseKeys(armature).insert_motion(armature, frames, {ARM: turns}, {}, angle=0.01, distance=0.01)
    for frame in range(1, 32):
        bpy.context.scene.frame_set(frame)
        shown = bone.matrix_basis.to_quaternion()
        assert abs(shown.angle if shown.angle < np.pi else 2.0 * np.pi - shown.angle) < 0.9, frame


def test_what_lies_under_a_layer_is_blended_as_it_was(armature: Any) -> None:
    bone = armature.pose.bones[ARM]
    bone.rotation_mode = "XYZ"
    animate_euler(bone)
    data = armature.animation_data
    base = data.action
    track = data.nla_tracks.new()
    track.strips.new("Base", 1, base).action_slot = base.slots[0]
    over = bpy.data.actions.new("Over")
    data.action = over
    data.action_blend_type, data.action_influence = "ADD", 0.5
    animate_euler(bone)
    data.action_slot = over.slots[0]

    def played() -> list[float]:
        found = []
        for frame in (2, 5, 9, 15):
            bpy.context.scene.frame_set(frame)
            found.append(bone.rotation_euler.x)
        return found

    before = played()
    keys = PoseKeys(armature, "LAYER")
    keys.insert(armature, [Keyed(BODY)], 5.0)
    assert played() == pytest.approx(before, abs=1e-6)
    assert data.action_influence == 1.0
    keys.take_back(armature)
    assert (data.action_blend_type, data.action_influence) == ("ADD", 0.5)
    assert played() == pytest.approx(before, abs=1e-6)


def animate_euler(bone: Any) -> None:
    for frame, angle in ((1, 0.1), (11, 1.0)):
        bone.rotation_euler.x = angle
        bone.keyframe_insert("rotation_euler", frame=frame)


def test_failing_on_its_way_changes_nothing(armature: Any, monkeypatch: Any) -> None:
    """A layer that cannot be made."""
    action = animate(armature)
    keys = PoseKeys(armature, "LAYER")

    def broken(*_: Any) -> Any:
        raise WriteError("No.", "No.")

    monkeypatch.setattr("octo_motion.blender.animation.pose_keys._writable_action", broken)
    with pytest.raises(WriteError):
        keys.insert(armature, [Keyed(ARM)], 5.0)
    data = armature.animation_data
    assert data.action == action
    assert list(data.nla_tracks) == []
    assert list(bpy.data.actions) == [action]


def test_own_keying_set_says_itself_whether_only_needed_keys_are_made(armature: Any) -> None:
    scene = bpy.context.scene
    own = scene.keying_sets.new(idname="Mine", name="Mine")
    path = armature.pose.bones[ARM].path_from_id("rotation_quaternion")
    own.paths.add(armature, path)
    scene.keying_sets.active = own
    action = animate(armature)
    before = curves(action)
    own.use_insertkey_override_needed = own.use_insertkey_needed = True
    assert PoseKeys(armature).insert(armature, [Keyed(ARM)], 11.0) == []
    assert curves(action) == before
    own.use_insertkey_needed = False
    assert PoseKeys(armature).insert(armature, [Keyed(ARM)], 20.0) == [ARM]


def test_layer_is_refused_where_the_nla_is_switched_off(armature: Any) -> None:
    action = animate(armature)
    armature.animation_data.use_nla = False
    with pytest.raises(WriteError, match="The NLA of 'Octopus' is switched off"):
        PoseKeys(armature, "LAYER").insert(armature, [Keyed(BODY)], 5.0)
    assert armature.animation_data.action == action
    assert list(armature.animation_data.nla_tracks) == []
