# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that Blender plays back as the motion they were made from."""

import math
from collections.abc import Sequence

import bpy
import mathutils
import numpy as np
import pytest

from octo_motion.blender.animation import actions
from octo_motion.core import rotations
from octo_motion.core.errors import RigError
from octo_motion.core.keyframes.channels import Channel
from octo_motion.core.locomotion.rig.poses import Poses, halfway_automatic
from octo_motion.core.rotations import EULER_ORDERS, Floats

HANDLES = ("handle_left", "handle_right")
ROTATION_MODES = ("QUATERNION", "AXIS_ANGLE", *EULER_ORDERS)


def make_armature(
    name: str = "Rig", bones: Sequence[str] = ("Arm 1", 'Odd "name"', "Tip")
) -> bpy.types.Object:
    """A chain of bones, each tilted and rolled its own way."""
    armature = bpy.data.armatures.new(name)
    obj = bpy.data.objects.new(name, armature)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    parent, head = None, mathutils.Vector((0.0, 0.0, 1.0))
    for number, bone in enumerate(bones):
        edit = armature.edit_bones.new(bone)
        edit.parent, edit.head = parent, head
        edit.tail = head + mathutils.Vector((0.3 * number, 1.0, 0.2))
        edit.roll = 0.7 * number
        parent, head = edit, edit.tail.copy()
    bpy.ops.object.mode_set(mode="OBJECT")
    return obj


def pose_bones(obj: bpy.types.Object) -> list[bpy.types.PoseBone]:
    assert obj.pose is not None
    return list(obj.pose.bones)


def wandering(frames: int, count: int, seed: int = 1) -> Floats:
    """Orientations (frames, count, 4) that tumble through everywhere, by about 0.5 a frame."""
    random = np.random.default_rng(seed)
    result = np.empty((frames, count, 4))
    result[0] = rotations.normalized(random.normal(size=(count, 4)))
    for frame in range(1, frames):
        turn = rotations.from_rotation_vector(0.5 * random.normal(size=(count, 3)))
        result[frame] = rotations.multiply(turn, result[frame - 1])
    return result


def posed(obj: bpy.types.Object, frame: float) -> bpy.types.Object:
    bpy.context.scene.frame_set(math.floor(frame), subframe=frame % 1.0)
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def array(matrix: mathutils.Matrix) -> Floats:
    return np.array(matrix)


def basis_rotations(obj: bpy.types.Object, frame: float) -> Floats:
    """What Blender makes of the bones at a frame: their rotations from rest (bones, 3, 3)."""
    result = []
    for bone in pose_bones(posed(obj, frame)):
        rest = array(bone.bone.matrix_local)[:3, :3]
        now = array(bone.matrix)[:3, :3]
        if bone.parent is not None:
            rest = array(bone.parent.bone.matrix_local)[:3, :3].T @ rest
            now = array(bone.parent.matrix)[:3, :3].T @ now
        result.append(rest.T @ now)
    return np.array(result)


def channelbag(action: bpy.types.Action) -> bpy.types.ActionChannelbag:
    (layer,) = action.layers
    (strip,) = layer.strips
    (bag,) = strip.channelbags
    return bag


@pytest.mark.parametrize("mode", ROTATION_MODES)
def test_bones_play_back_the_rotations_they_were_given(mode: str) -> None:
    obj = make_armature()
    names = [bone.name for bone in pose_bones(obj)]
    for bone in pose_bones(obj):
        bone.rotation_mode = mode
    frames = np.arange(1.0, 41.0)
    motion = wandering(40, 3)
    channels = actions.read_channels(obj, names).rotations(names, motion)
    actions.write_action(obj, "Walk", frames, channels, previous=None)
    for frame, wanted in zip(frames, rotations.to_matrix(motion), strict=True):
        np.testing.assert_allclose(basis_rotations(obj, frame), wanted, atol=1e-5)
    assert {bone.rotation_mode for bone in pose_bones(obj)} == {mode}


@pytest.mark.parametrize("automatic", [False, True])
def test_handles_are_where_blender_puts_them(*, automatic: bool) -> None:
    obj = make_armature()
    names = [bone.name for bone in pose_bones(obj)]
    # More than Blender works on in one go.
    frames = np.arange(1.0, 701.0)
    channels = actions.read_channels(obj, names).rotations(names, wandering(700, 3))
    action = None
    for _ in range(2):
        action = actions.write_action(
            *(obj, "Walk", frames, channels), previous=action, automatic=automatic
        )
        for curve in channelbag(action).fcurves:
            places = [actions.key_points(curve, name) for name in ("co", *HANDLES)]
            curve.update()
            again = [actions.key_points(curve, name) for name in ("co", *HANDLES)]
            assert np.array_equal(places, again)
            assert np.ptp(places[1][:, 0]) > 600.0


def test_each_bone_keeps_its_own_rotation_mode() -> None:
    obj = make_armature()
    modes = ("ZXY", "QUATERNION", "AXIS_ANGLE")
    for bone, mode in zip(pose_bones(obj), modes, strict=True):
        bone.rotation_mode = mode
    names = [bone.name for bone in pose_bones(obj)]
    motion = wandering(20, 3)
    # In another order than the armature's, as lists of arms are.
    shuffled = [2, 0, 1]
    channels = actions.read_channels(obj, [names[each] for each in shuffled]).rotations(
        [names[each] for each in shuffled], motion[:, shuffled]
    )
    assert [channel.group for channel in channels] == [names[each] for each in shuffled]
    action = actions.write_action(obj, "Walk", np.arange(20.0), channels, previous=None)
    for frame in range(20):
        wanted = rotations.to_matrix(motion[frame])
        np.testing.assert_allclose(basis_rotations(obj, frame), wanted, atol=1e-5)
    counts = {group.name: len(group.channels) for group in channelbag(action).groups}
    assert counts == {"Arm 1": 3, 'Odd "name"': 4, "Tip": 4}
    assert tuple(bone.rotation_mode for bone in pose_bones(obj)) == modes


@pytest.mark.parametrize("mode", ROTATION_MODES)
def test_between_frames_bones_turn_by_the_shortest_way(mode: str) -> None:
    obj = make_armature(bones=["Bone"])
    pose_bones(obj)[0].rotation_mode = mode
    # Steady turns about tilted axes, through rest, past the half turn and round several times.
    turns = np.linspace(-1.0, 14.0, 200)
    motion = rotations.from_axis_angle(rotations.normalized([0.2, 0.9, 0.4]), turns)[:, None]
    motion[::3] *= -1.0
    channels = actions.read_channels(obj, ["Bone"]).rotations(["Bone"], motion)
    actions.write_action(obj, "Walk", np.arange(200.0), channels, previous=None)
    step = 15.0 / 199
    for frame in range(0, 199, 7):
        (halfway,) = rotations.from_matrix(basis_rotations(obj, frame + 0.5))
        before = float(rotations.angle_between(motion[frame, 0], halfway))
        after = float(rotations.angle_between(halfway, motion[frame + 1, 0]))
        # Euler angles leave the great circle a little, never by more than the step.
        assert before + after == pytest.approx(step, rel=0.05)


def test_quaternions_start_on_the_side_of_rest() -> None:
    obj = make_armature(bones=["Bone"])
    resting = np.tile([-1.0, 0.0, 0.0, 0.0], (5, 1, 1))
    (channel,) = actions.read_channels(obj, ["Bone"]).rotations(["Bone"], resting)
    np.testing.assert_array_equal(channel.values, -resting[:, 0])


def test_bone_locations_play_back() -> None:
    obj = make_armature()
    locations = np.random.default_rng(3).normal(size=(10, 3))
    channel = actions.read_channels(obj, ["Arm 1"]).location("Arm 1", locations)
    actions.write_action(obj, "Walk", np.arange(10.0), [channel], previous=None)
    rest = array(pose_bones(obj)[0].bone.matrix_local)
    for frame in range(10):
        now = array(pose_bones(posed(obj, frame))[0].matrix)
        wanted = rest[:3, 3] + rest[:3, :3] @ locations[frame]
        np.testing.assert_allclose(now[:3, 3], wanted, atol=1e-5)


@pytest.mark.parametrize("cyclic", [False, True])
def test_with_automatic_handles_it_plays_half_way_between_frames_what_is_measured(
    *,
    cyclic: bool,
) -> None:
    obj = make_armature()
    rng = np.random.default_rng(4)
    turns = rotations.from_rotation_vector(np.cumsum(0.4 * rng.normal(size=(30, 3)), axis=0))
    places = np.cumsum(rng.normal(size=(30, 3)), axis=0)
    if cyclic:
        turns[-1], places[-1] = turns[0], places[0]
    turns = rotations.continuous(turns)
    channels = [
        actions.read_channels(obj, ["Arm 1"]).location("Arm 1", places),
        *actions.read_channels(obj, ["Arm 1"]).rotations(["Arm 1"], turns[:, None]),
    ]
    frames = np.arange(1.0, 31.0)
    action = actions.write_action(
        obj, "Walk", frames, channels, previous=None, automatic=True, repeats=cyclic
    )
    poses = Poses(turns[:, None], np.zeros((30, 1)), places, turns)
    half = halfway_automatic(poses, cyclic=cyclic)
    curves = {(each.data_path, each.array_index): each for each in channelbag(action).fcurves}
    path = 'pose.bones["Arm 1"].'
    for component in range(3):
        curve = curves[path + "location", component]
        played = [curve.evaluate(frame + 0.5) for frame in frames[:-1]]
        np.testing.assert_allclose(played, half.locations[:, component], atol=2e-5)
    played = np.array(
        [
            [curves[path + "rotation_quaternion", each].evaluate(frame + 0.5) for each in range(4)]
            for frame in frames[:-1]
        ]
    )
    played /= np.linalg.norm(played, axis=1, keepdims=True)
    np.testing.assert_allclose(np.abs(np.sum(played * half.orientations, axis=1)), 1.0, atol=1e-6)
    assert not actions.is_edited(action)


@pytest.mark.parametrize("frames", [[1.0, 2.5, 2.75, 10.0], [-20.5, 0.0, 3.125]])
def test_keys_stand_at_the_frames_given_with_their_fractions(frames: list[float]) -> None:
    obj = make_armature()
    locations = np.random.default_rng(3).normal(size=(len(frames), 3))
    channel = actions.read_channels(obj, ["Tip"]).location("Tip", locations)
    action = actions.write_action(obj, "Walk", np.array(frames), [channel], previous=None)
    for curve in channelbag(action).fcurves:
        keys = curve.keyframe_points
        assert [key.co.x for key in keys] == frames
        values = [key.co.y for key in keys]
        np.testing.assert_allclose(values, locations[:, curve.array_index], atol=1e-6)
        assert {key.interpolation for key in keys} == {"LINEAR"}
        assert {key.type for key in keys} == {"GENERATED"}
        # Ready for an artist who makes them Bézier.
        for key in keys:
            assert key.handle_left.x < key.co.x < key.handle_right.x
    assert action.use_frame_range
    assert (action.frame_start, action.frame_end) == (frames[0], frames[-1])


@pytest.mark.parametrize(("fps", "base"), [(24, 1.0), (30, 1.001), (120, 1.0), (1, 3.7)])
def test_scene_frame_rate_changes_no_key(fps: int, base: float) -> None:
    bpy.context.scene.render.fps = fps
    bpy.context.scene.render.fps_base = base
    obj = make_armature()
    locations = np.arange(30.0).reshape(10, 3)
    channel = actions.read_channels(obj, ["Tip"]).location("Tip", locations)
    action = actions.write_action(obj, "Walk", np.arange(10.0), [channel], previous=None)
    for curve in channelbag(action).fcurves:
        points = [(key.co.x, key.co.y) for key in curve.keyframe_points]
        assert points == list(zip(range(10), locations[:, curve.array_index], strict=True))


def test_action_is_one_layer_one_strip_one_slot_and_assigned_with_it() -> None:
    obj = make_armature()
    channel = actions.read_channels(obj, ["Tip"]).location("Tip", np.zeros((2, 3)))
    action = actions.write_action(
        obj, "Walk", np.array([1.0, 2.0]), [channel], previous=None, settings_note="gait: walk"
    )
    (slot,) = action.slots
    assert (slot.name_display, slot.target_id_type) == ("Rig", "OBJECT")
    assert obj.animation_data is not None
    assert obj.animation_data.action == action
    assert obj.animation_data.action_slot == slot
    assert channelbag(action).slot == slot
    assert action.name == "Walk"
    assert action[actions.MARK]["note"] == "gait: walk"


def assert_travels(obj: bpy.types.Object, locations: Floats, quaternions: Floats) -> None:
    before = obj.scale.copy()
    mode = obj.rotation_mode
    channels = actions.read_object_channels(obj).channels(locations, quaternions)
    frames = np.arange(1.0, len(locations) + 1.0)
    actions.write_action(obj, "Travel", frames, channels, previous=None)
    for number, frame in enumerate(frames):
        world = posed(obj, frame).matrix_world
        np.testing.assert_allclose(np.array(world.translation), locations[number], atol=2e-5)
        turned = rotations.normalized(np.array(world.to_quaternion()))
        assert rotations.angle_between(turned, quaternions[number]) < 1e-5
    assert obj.scale == before
    assert obj.rotation_mode == mode


def travel(frames: int = 15) -> tuple[Floats, Floats]:
    return np.random.default_rng(5).normal(size=(frames, 3)), wandering(frames, 1)[:, 0]


@pytest.mark.parametrize("mode", ROTATION_MODES)
def test_object_travels_in_any_rotation_mode_with_delta_transforms(mode: str) -> None:
    obj = make_armature()
    obj.rotation_mode = mode
    obj.scale = (2.0, 2.0, 2.0)
    obj.delta_location = (1.0, -2.0, 3.0)
    obj.delta_rotation_euler = (0.3, 0.4, -2.5)
    obj.delta_rotation_quaternion = mathutils.Quaternion((0.3, 0.4, -0.5, 0.2)).normalized()
    obj.delta_scale = (0.5, 0.5, 0.5)
    assert_travels(obj, *travel())


@pytest.mark.parametrize("mode", ["QUATERNION", "YZX"])
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (0.01, 0.01, 0.01), (-3.0, 3.0, 3.0)])
def test_object_travels_through_the_world_whatever_its_parent(
    mode: str, scale: tuple[float, float, float]
) -> None:
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location = (5.0, -1.0, 2.0)
    parent.rotation_euler = (0.5, 1.0, 2.0)
    parent.scale = scale
    obj = make_armature()
    obj.rotation_mode = mode
    obj.parent = parent
    obj.matrix_parent_inverse = mathutils.Matrix.LocRotScale(
        (1.0, 2.0, 3.0),
        mathutils.Euler((0.1, 0.2, 0.3)),
        (2.0, 2.0, 2.0),
    )
    obj.delta_location = (0.5, 0.0, 0.0)
    assert_travels(obj, *travel())


def test_object_on_a_bone_travels_through_the_world() -> None:
    carrier = make_armature("Carrier")
    carrier.location = (3.0, 0.0, 1.0)
    pose_bones(carrier)[0].rotation_quaternion = (0.8, 0.6, 0.0, 0.0)
    obj = make_armature()
    obj.parent, obj.parent_type, obj.parent_bone = carrier, "BONE", "Tip"
    assert_travels(obj, *travel())


def test_object_on_a_path_travels_through_the_world() -> None:
    curve = bpy.data.curves.new("Path", "CURVE")
    curve.dimensions = "3D"
    curve.use_path = True
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (4.0, 5.0, 6.0, 1.0)
    path = bpy.data.objects.new("Path", curve)
    bpy.context.scene.collection.objects.link(path)
    curve.eval_time = 40.0
    obj = make_armature()
    obj.parent = path
    assert_travels(obj, *travel())


def test_parent_without_size_is_told_to_the_artist() -> None:
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.scale = (1.0, 0.0, 1.0)
    obj = make_armature()
    obj.parent = parent
    with pytest.raises(RigError, match="parent of 'Rig'"):
        actions.read_object_channels(obj).channels(*travel())


def test_bone_that_is_not_there_is_named() -> None:
    obj = make_armature()
    with pytest.raises(RigError, match="'Rig' has no bone 'Tentacle'"):
        actions.read_channels(obj, ["Tip", "Tentacle"])


@pytest.mark.parametrize(
    ("frames", "values"),
    [
        ([], np.zeros((0, 3))),
        ([1.0, 1.0], np.zeros((2, 3))),
        ([2.0, 1.0], np.zeros((2, 3))),
        ([1.0, 1.005], np.zeros((2, 3))),
        ([1.0, math.nan], np.zeros((2, 3))),
        ([1.0, 2.0], np.zeros((3, 3))),
        ([1.0, 2.0], np.full((2, 3), math.nan)),
        ([1.0, 2.0], np.zeros(2)),
    ],
)
def test_keys_that_blender_would_spoil_are_refused_before_anything_changes(
    frames: list[float], values: Floats
) -> None:
    obj = make_armature()
    channel = Channel("location", values, "Object Transforms")
    with pytest.raises(ValueError):  # noqa: PT011 - each has its own message
        actions.write_action(obj, "Walk", np.array(frames), [channel], previous=None)
    assert not bpy.data.actions
    assert obj.animation_data is None


def test_one_property_twice_is_refused() -> None:
    obj = make_armature()
    channel = Channel("location", np.zeros((1, 3)), "Object Transforms")
    with pytest.raises(ValueError, match="two channels"):
        actions.write_action(obj, "Walk", np.ones(1), [channel, channel], previous=None)
    assert not bpy.data.actions
