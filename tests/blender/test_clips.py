# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip is what Blender shows; reading changes nothing, and what is written is what was read."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import mathutils
import numpy as np
import pytest

from octo_motion.blender.animation.actions import MARK
from octo_motion.blender.animation.clips import further_channels, read_clip, write_clip
from octo_motion.blender.animation.poses import AT_REST
from octo_motion.core.errors import ClipError, RigError
from octo_motion.core.rotations import angle_between, from_rotation_vector, multiply
from octo_motion.core.splicing.clip.clip import Clip

# Blender's importer leaves the file open.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")

SharedData = Callable[[str], Path]

MODES = ("QUATERNION", "AXIS_ANGLE", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
RNG_SEED = 7

# Blender poses in single precision; a bone at the end of a chain gathers the rounding of all.
ANGLE = 2e-5
POSITION = 1e-5


def import_clip(path: Path) -> Any:
    if path.suffix == ".bvh":
        bpy.ops.import_anim.bvh(filepath=str(path), update_scene_fps=True)
    elif path.suffix == ".fbx":
        bpy.ops.import_scene.fbx(filepath=str(path))
    else:
        bpy.ops.import_scene.gltf(filepath=str(path))
    return next(item for item in bpy.data.objects if item.type == "ARMATURE")


def as_blender_shows(armature: Any, frames: Any) -> tuple[Any, Any]:
    """World axes (frames, bones, 3, 3), free of scale, and heads, from the scene itself."""
    scene = bpy.context.scene
    axes, heads = [], []
    for frame in frames:
        scene.frame_set(int(np.floor(frame)), subframe=float(frame - np.floor(frame)))
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        matrices = [np.array(shown.matrix_world @ bone.matrix) for bone in shown.pose.bones]
        heads.append([matrix[:3, 3] for matrix in matrices])
        axes.append([matrix[:3, :3] / np.linalg.norm(matrix[:3, 1]) for matrix in matrices])
    return np.array(axes), np.array(heads)


def assert_shown(armature: Any, clip: Clip, size: float, *, y_only: bool = False) -> None:
    """The clip is what the scene shows. Sheared bones have no axes but Y to compare."""
    axes, heads = as_blender_shows(armature, clip.frames)
    orientations, positions = clip.posed()
    assert np.abs(positions - heads).max() < POSITION * size
    from octo_motion.core.rotations import to_matrix

    ours = to_matrix(orientations)
    chosen = slice(1, 2) if y_only else slice(None)
    assert np.abs(ours[..., chosen] - axes[..., chosen]).max() < ANGLE


def body_size(clip: Clip) -> float:
    _, heads = clip.posed()
    return float(np.ptp(heads[0], axis=0).max())


def some_frames(clip: Clip, count: int = 12) -> Any:
    """Whole frames and fractions, from before the first to after the last."""
    return np.linspace(clip.frames[0] - 2.0, clip.frames[-1] + 2.0, count)


@pytest.mark.parametrize(
    "name",
    [
        "secondlife/avatar_walk.bvh",
        "secondlife/avatar_backflip.bvh",
        "cmu/12_01_walk.bvh",
        "cmu/pirouette_threejs.bvh",
        "animated_drawings/fair1_dab.bvh",
        "animated_drawings/rokoko_jesse_dance.bvh",
        "makehuman/walk1.bvh",
        "derived_fbx_gltf/sl_walk.fbx",
        "derived_fbx_gltf/sl_punch_L.glb",
        "rigs_with_actions/KayKit_Knight.glb",
        "rigs_with_actions/RobotExpressive.glb",
    ],
)
def test_real_clips_are_read_as_blender_shows_them(shared_data: SharedData, name: str):
    armature = import_clip(shared_data(name))
    whole = read_clip(armature)
    clip = read_clip(armature, frames=some_frames(whole))
    assert_shown(armature, clip, body_size(whole))
    visual = read_clip(armature, frames=some_frames(whole), visual=True)
    assert np.abs(visual.posed()[1] - clip.posed()[1]).max() < POSITION * body_size(whole)


def make_rig(*, connected: bool = False) -> Any:
    """A chain of rolled bones, one of each rotation mode."""
    armature: Any = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    random = np.random.default_rng(RNG_SEED)
    parent, head = None, np.zeros(3)
    for mode in MODES:
        bone = armature.data.edit_bones.new(f'{mode} "x"].y')
        bone.head = head
        head = head + random.normal(0.0, 0.5, 3)
        bone.tail = head
        bone.roll = random.uniform(-3.0, 3.0)
        bone.parent, bone.use_connect = parent, connected and parent is not None
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    for mode, bone in zip(MODES, armature.pose.bones, strict=True):
        bone.rotation_mode = mode
    return armature


def rotation_of(bone: Any) -> str:
    mode = bone.rotation_mode
    return f"rotation_{mode.lower()}" if mode in ("QUATERNION", "AXIS_ANGLE") else "rotation_euler"


def animate(armature: Any, *, scale: bool = False) -> list[Any]:
    """Keys at uneven frames for all bones and the object. Returns the F-curves."""
    random = np.random.default_rng(RNG_SEED)
    for frame in (1, 4, 9, 10, 17):
        for bone in armature.pose.bones:
            channel = rotation_of(bone)
            values = random.normal(0.0, 1.0, len(getattr(bone, channel)))
            setattr(bone, channel, values)
            bone.location = random.normal(0.0, 0.2, 3)
            bone.keyframe_insert(channel, frame=frame)
            bone.keyframe_insert("location", frame=frame)
            if scale:
                bone.scale = random.uniform(0.7, 1.4, 3)
                bone.keyframe_insert("scale", frame=frame)
        armature.location = random.normal(0.0, 3.0, 3)
        armature.rotation_euler = random.normal(0.0, 1.0, 3)
        armature.keyframe_insert("location", frame=frame)
        armature.keyframe_insert("rotation_euler", frame=frame)
    data = armature.animation_data
    return list(data.action.layers[0].strips[0].channelbag(data.action_slot).fcurves)


def curves_of(armature: Any) -> set[str]:
    """Data paths of the curves that move an armature."""
    data = armature.animation_data
    channelbag = data.action.layers[0].strips[0].channelbag(data.action_slot)
    return {curve.data_path for curve in channelbag.fcurves}


def interpolate(curves: list[Any], *kinds: str) -> None:
    for number, curve in enumerate(curves):
        for key, point in enumerate(curve.keyframe_points):
            point.interpolation = kinds[(number + key) % len(kinds)]
        curve.update()


@pytest.mark.parametrize(
    "kinds",
    [("LINEAR",), ("CONSTANT",), ("LINEAR", "CONSTANT"), ("BEZIER",), ("BOUNCE", "SINE", "LINEAR")],
)
@pytest.mark.parametrize("extrapolation", ["CONSTANT", "LINEAR"])
def test_every_rotation_mode_interpolation_and_extrapolation(
    kinds: tuple[str, ...], extrapolation: str
):
    armature = make_rig()
    curves = animate(armature)
    interpolate(curves, *kinds)
    for curve in curves:
        curve.extrapolation = extrapolation
    clip = read_clip(armature, frames=np.arange(-3.0, 22.0, 0.5))
    assert_shown(armature, clip, 10.0)


@pytest.mark.parametrize(
    "kind", ["CYCLES", "NOISE", "GENERATOR", "FNGENERATOR", "LIMITS", "STEPPED"]
)
def test_every_modifier_of_f_curves(kind: str):
    armature = make_rig()
    curves = animate(armature)
    interpolate(curves, "LINEAR")
    for curve in curves:
        modifier = curve.modifiers.new(kind)
        if kind == "LIMITS":
            modifier.use_max_y, modifier.max_y = True, 0.1
    clip = read_clip(armature, frames=np.arange(-3.0, 40.0, 0.7))
    assert_shown(armature, clip, 30.0)


def test_muted_curves_do_nothing_and_muted_groups_only_what_blender_lets_them():
    armature = make_rig()
    curves = animate(armature)
    curves[0].mute = True
    curves[40].group.mute = True
    for bone in armature.pose.bones:
        bone.location = (0, 0, 0)
        setattr(bone, rotation_of(bone), AT_REST[rotation_of(bone)])
    clip = read_clip(armature)
    assert_shown(armature, clip, 10.0)


def test_connected_bones_stay_where_they_are():
    armature = make_rig(connected=True)
    animate(armature)
    assert_shown(armature, read_clip(armature), 10.0)


@pytest.mark.parametrize("switch", ["use_local_location", "use_inherit_rotation"])
def test_bones_that_do_not_follow_their_parent_in_everything(switch: str):
    armature = make_rig()
    animate(armature)
    for bone in list(armature.data.bones)[::2]:
        setattr(bone, switch, False)
    assert_shown(armature, read_clip(armature), 10.0)


def test_scaled_bones_carry_their_children():
    armature = make_rig()
    animate(armature, scale=True)
    assert_shown(armature, read_clip(armature), 20.0, y_only=True)


def test_nothing_of_a_clip_and_no_damaged_key_is_among_what_else_an_action_moves():
    armature = make_rig()
    animate(armature, scale=True)
    armature.pose.bones[0].keyframe_insert("rotation_mode", frame=1)
    armature.keyframe_insert("delta_location", frame=1)
    armature["broken"] = 1.0
    armature.keyframe_insert('["broken"]', frame=1)
    action = armature.animation_data.action
    curve = action.layers[0].strips[0].channelbags[0].fcurves.find('["broken"]')
    curve.keyframe_points[0].co.y = float("nan")
    assert further_channels(armature, armature.animation_data.action, None, np.arange(3.0)) == []


def test_scale_that_is_not_inherited_is_refused_unless_read_as_shown():
    armature = make_rig()
    animate(armature, scale=True)
    armature.data.bones[3].inherit_scale = "NONE"
    with pytest.raises(ClipError, match=r"does not inherit it.*As Shown"):
        read_clip(armature)
    assert_shown(armature, read_clip(armature, visual=True), 20.0, y_only=True)


@pytest.mark.parametrize("inherited", ["ALIGNED", "AVERAGE", "NONE"])
def test_a_bone_that_stretches_alone_is_written_as_it_was_read(inherited: Any):
    armature = make_rig()
    animate(armature)
    bones = armature.pose.bones
    for child in bones[1].children:
        child.bone.inherit_scale = inherited
    for frame, length in ((1, 1.0), (9, 1.4)):
        bones[1].scale = (1.0, length, 0.8)
        bones[1].keyframe_insert("scale", frame=frame)
    frames = [2, 6, 9]
    before = as_blender_shows(armature, frames)
    clip = read_clip(armature)
    assert clip.scales is not None
    assert set(np.flatnonzero((clip.scales != 1.0).any(axis=(0, 2)))) == {1}
    write_clip(armature, clip)
    after = as_blender_shows(armature, frames)
    assert np.abs(after[0] - before[0]).max() < 1e-4
    assert np.abs(after[1] - before[1]).max() < 1e-4


@pytest.mark.parametrize("visual", [False, True])
def test_a_bone_that_carries_no_other_keeps_its_scale(*, visual: bool):
    armature = make_rig()
    animate(armature)
    bone = armature.pose.bones[-1]
    for frame, size in ((1, 1.0), (9, 0.0), (17, 1.5)):
        bone.scale = (size, size, 1.0)
        bone.keyframe_insert("scale", frame=frame)
    frames = [2, 8, 16]
    before = as_blender_shows(armature, frames)
    sizes = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        sizes.append(tuple(bone.scale))
    clip = read_clip(armature, visual=visual)
    assert clip.scales is not None
    assert set(np.flatnonzero((np.abs(clip.scales - 1.0) > 1e-4).any(axis=(0, 2)))) == {
        len(MODES) - 1
    }
    write_clip(armature, clip)
    after = as_blender_shows(armature, frames)
    assert np.abs(after[1] - before[1]).max() < 1e-4
    for frame, size in zip(frames, sizes, strict=True):
        bpy.context.scene.frame_set(frame)
        assert tuple(bone.scale) == pytest.approx(size, abs=1e-5)


@pytest.mark.parametrize("number", [2, len(MODES) - 1])
def test_a_bone_that_is_scaled_to_nothing_does_not_turn(number: int):
    """Scaled to zero, a bone and all it carries are hidden: artists do that with props."""
    armature = make_rig()
    animate(armature)
    whole = read_clip(armature)
    bone = armature.pose.bones[number]
    for frame, size in ((1, 1.0), (9, 0.0)):
        bone.scale = (size, size, size)
        bone.keyframe_insert("scale", frame=frame)
    clip = read_clip(armature)
    assert angle_between(clip.rotations, whole.rotations).max() < ANGLE


def test_the_object_may_have_parent_scale_delta_and_any_mode():
    armature = make_rig()
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler, parent.scale = (1, 2, 3), (0.3, 0.2, 0.1), (3, 3, 3)
    armature.parent = parent
    armature.matrix_parent_inverse = mathutils.Matrix.Translation((1, 2, 3))
    armature.scale = (0.1, 0.1, 0.1)
    armature.delta_location, armature.delta_rotation_euler = (3, 2, 1), (0.1, 0.2, 0.3)
    armature.rotation_mode = "YZX"
    animate(armature)
    clip = read_clip(armature)
    assert clip.scale == pytest.approx(0.3, rel=1e-5)
    assert_shown(armature, clip, 10.0)


def given_moving_parent(armature: Any) -> None:
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    for frame, x in ((1, 0.0), (17, 8.0)):
        parent.location, parent.rotation_euler = (x, 0.0, 1.0), (0.0, 0.1 * x, 0.2 * x)
        parent.keyframe_insert("location", frame=frame)
        parent.keyframe_insert("rotation_euler", frame=frame)
    armature.parent = parent


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("carried_by", ["parent", "constraint"])
@pytest.mark.parametrize("visual", [False, True])
def test_what_carries_the_armature_carries_a_result_just_as_far(
    carried_by: str,
    *,
    moves: bool,
    visual: bool,
):
    armature = make_rig()
    animate(armature)
    if not moves:
        for curve in list(
            armature.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
        ):
            if not curve.data_path.startswith("pose"):
                curve.mute = True
    given_moving_parent(armature)
    if carried_by == "constraint":
        parent, armature.parent = armature.parent, None
        armature.constraints.new("CHILD_OF").target = parent
    armature.delta_location, armature.delta_rotation_euler = (3, 2, 1), (0.1, 0.2, 0.3)
    frames = [1, 6, 17]
    before = as_blender_shows(armature, frames)
    bpy.context.scene.frame_set(4)
    clip = read_clip(armature, visual=visual)
    # As when other frames are looked at while a timing is dragged.
    bpy.context.scene.frame_set(12)
    write_clip(armature, clip)
    after = as_blender_shows(armature, frames)
    assert np.abs(after[0] - before[0]).max() < 10 * ANGLE
    assert np.abs(after[1] - before[1]).max() < 20.0 * POSITION
    moving = {path for path in curves_of(armature) if not path.startswith("pose")}
    assert moving == ({"location", "rotation_euler"} if moves else set())


def test_constraints_and_nla_are_read_as_shown():
    armature = make_rig()
    animate(armature)
    data = armature.animation_data
    action = data.action
    strip = data.nla_tracks.new().strips.new("strip", 20, action)
    strip.scale, strip.repeat = 0.5, 2.0
    data.action = None
    limit = armature.pose.bones[2].constraints.new("LIMIT_ROTATION")
    limit.use_limit_x, limit.max_x, limit.owner_space = True, 0.2, "LOCAL"
    clip = read_clip(armature, visual=True)
    assert (clip.frames[0], clip.frames[-1]) == (20.0, 36.0)
    assert_shown(armature, clip, 10.0)
    # Another action than the one assigned may be looked at, too.
    assert_shown_with = read_clip(armature, action, visual=True)
    assert armature.animation_data.action is None
    assert len(assert_shown_with) == 17


def test_reading_changes_nothing():
    armature = make_rig()
    animate(armature)
    other = bpy.data.actions.new("Other")
    armature.animation_data.action = other
    bone = armature.pose.bones[1]
    bpy.context.scene.frame_set(3, subframe=0.25)
    bone.location = (1, 2, 3)
    before = [np.array(each.matrix_basis) for each in armature.pose.bones]
    action = bpy.data.actions["RigAction"]
    read_clip(armature, action)
    read_clip(armature, action, visual=True)
    scene = bpy.context.scene
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.25)
    assert armature.animation_data.action == other
    assert armature.animation_data.action_slot is None
    after = [np.array(each.matrix_basis) for each in armature.pose.bones]
    assert np.array_equal(before, after)
    assert not list(armature.keys())


def test_rate_and_frames_are_the_scenes_unless_given():
    armature = make_rig()
    animate(armature)
    render = bpy.context.scene.render
    render.fps, render.fps_base = 30, 1.001
    clip = read_clip(armature)
    assert clip.rate == pytest.approx(29.97, abs=1e-3)
    assert list(clip.frames) == list(range(1, 18))
    assert read_clip(armature, rate=120.0).rate == 120.0
    action = armature.animation_data.action
    action.use_frame_range, action.frame_start, action.frame_end = True, 5, 8
    assert list(read_clip(armature).frames) == [5, 6, 7, 8]


@pytest.mark.parametrize("off", [0.5, 1000.25])
def test_keys_beside_whole_frames_are_read_where_they_are(off: float):
    armature = make_rig()
    curves = animate(armature)
    on_frames = read_clip(armature)
    for curve in curves:
        for key in curve.keyframe_points:
            # With its handles.
            key.co_ui.x += off
    clip = read_clip(armature)
    assert np.allclose(clip.frames, on_frames.frames + off)
    assert np.abs(clip.posed()[1] - on_frames.posed()[1]).max() < 1e-3
    # Between keys that are anyhow there is no better place than whole frames.
    for curve in curves:
        for number, key in enumerate(curve.keyframe_points):
            key.co_ui.x += 0.3 * number
    assert np.all(read_clip(armature).frames % 1.0 == 0.0)


def test_what_another_action_left_behind_is_no_part_of_a_clip_but_a_pose_without_keys_is():
    armature = make_rig()
    bones = armature.pose.bones
    bones[0].keyframe_insert("rotation_quaternion", frame=1)
    bones[0].rotation_quaternion = (0.6, 0.8, 0.0, 0.0)
    bones[0].keyframe_insert("rotation_quaternion", frame=9)
    action = armature.animation_data.action
    bones[2].rotation_euler = (0.1, 0.2, 0.3)
    armature.animation_data.action = None
    other = bpy.data.actions.new("Other")
    armature.animation_data.action = other
    bones[4].rotation_euler = (0.5, 0.5, 0.5)
    bones[4].keyframe_insert("rotation_euler", frame=1)
    clip = read_clip(armature, action)
    turned = angle_between(clip.rotations[0], (1.0, 0.0, 0.0, 0.0))
    assert turned[2] > 0.1
    assert turned[4] == 0.0
    # Neither is lost when a result that keys all bones comes and goes.
    written = write_clip(armature, clip)
    bones[2].rotation_euler = (0.0, 0.0, 0.0)
    again = read_clip(armature, action)
    assert armature.animation_data.action == written
    assert np.array_equal(again.rotations, clip.rotations)


def test_a_pose_that_comes_of_a_meta_strip_is_no_pose_without_keys():
    armature = make_rig()
    animate(armature)
    data = armature.animation_data
    action = data.action
    track = data.nla_tracks.new()
    strip = track.strips.new("Strip", 1, action)
    data.action = None
    track.select = strip.select = True
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "NLA_EDITOR"
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        assert bpy.ops.nla.meta_add() == {"FINISHED"}
    assert track.strips[0].type == "META"
    bpy.context.scene.frame_set(9)
    other = bpy.data.actions.new("Other")
    data.action = other
    armature.pose.bones[0].keyframe_insert("location", frame=1)
    armature.pose.bones[0].keyframe_insert("location", frame=9)
    data.action = None
    clip = read_clip(armature, other)
    assert angle_between(clip.rotations, (1.0, 0.0, 0.0, 0.0)).max() == 0.0


def test_slots_are_told_apart():
    armature, other = make_rig(), make_rig()
    animate(armature)
    action = armature.animation_data.action
    slot = action.slots.new("OBJECT", "Second")
    other.animation_data_create().action = action
    other.animation_data.action_slot = slot
    animate(other)
    data = armature.animation_data
    assert data is not None
    data.action = None
    with pytest.raises(ClipError, match="several slots that fit"):
        # A third armature, of neither slot.
        read_clip(make_rig(), action)
    assert len(read_clip(other, action)) == 17
    assert len(read_clip(armature, action, action.slots[0])) == 17


def test_each_thing_that_cannot_be_read_is_told():
    empty: Any = bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(empty)
    with pytest.raises(RigError, match="'Empty' is not an armature"):
        read_clip(empty)
    armature = make_rig()
    with pytest.raises(ClipError, match="'Rig' has no action"):
        read_clip(armature)
    action = bpy.data.actions.new("Nothing")
    with pytest.raises(ClipError, match="Action 'Nothing' is empty"):
        read_clip(armature, action)
    empty.keyframe_insert("location", frame=1)
    with pytest.raises(ClipError, match="has no slot for 'Rig'"):
        read_clip(armature, empty.animation_data.action)
    armature.keyframe_insert("location", frame=1)
    with pytest.raises(ClipError, match="has no keys for the bones of 'Rig'"):
        read_clip(armature)
    armature.pose.bones[0].keyframe_insert("location", frame=1)
    with pytest.raises(ClipError, match="only one frame"):
        read_clip(armature)
    armature.pose.bones[0].keyframe_insert("location", frame=5)
    armature.scale = (1, 1, 2)
    bpy.context.view_layer.update()
    with pytest.raises(ClipError, match="not the same in all directions"):
        read_clip(armature)
    armature.scale = (-1, 1, 1)
    bpy.context.view_layer.update()
    with pytest.raises(ClipError, match="mirrored"):
        read_clip(armature)


def test_keys_that_are_no_numbers_are_told():
    armature = make_rig()
    animate(armature)[4].keyframe_points[2].co.y = float("nan")
    with pytest.raises(ClipError, match="Action 'RigAction' has keys that are no finite numbers"):
        read_clip(armature)


@pytest.mark.parametrize("how", ["object", "collection", "exclude", "unlink", "REST"])
def test_what_the_scene_does_not_show_cannot_be_read_as_shown(how: str):
    armature = make_rig()
    animate(armature)
    scene = bpy.context.scene
    aside = bpy.data.collections.new("Aside")
    scene.collection.children.link(aside)
    scene.collection.objects.unlink(armature)
    aside.objects.link(armature)
    # An eye that is closed hides it from the artist alone.
    armature.hide_set(state=True)
    assert np.abs(np.diff(read_clip(armature, visual=True).rotations, axis=0)).max() > 0.1
    if how == "REST":
        armature.data.pose_position = "REST"
    elif how == "object":
        armature.hide_viewport = True
    elif how == "collection":
        aside.hide_viewport = True
    elif how == "exclude":
        bpy.context.view_layer.layer_collection.children["Aside"].exclude = True
    else:
        aside.objects.unlink(armature)
    told = "is in its rest position" if how == "REST" else "'Rig' is not in the scene, or disabled"
    with pytest.raises(ClipError, match=told):
        read_clip(armature, visual=True)
    read_clip(armature)


def test_another_action_cannot_be_shown_in_tweak_mode():
    armature = make_rig()
    animate(armature)
    data = armature.animation_data
    action = data.action
    other = action.copy()
    track = data.nla_tracks.new()
    track.strips.new("Strip", 1, action)
    data.action = None
    data.nla_tracks.active = track
    data.use_tweak_mode = True
    read_clip(armature, other)
    read_clip(armature, action, visual=True)
    with pytest.raises(ClipError, match="'Rig' is in the tweak mode of the NLA editor"):
        read_clip(armature, other, visual=True)


@pytest.mark.parametrize("switch", ["", "use_local_location", "use_inherit_rotation", "scale"])
def test_what_is_written_is_what_was_read(switch: str):
    armature = make_rig()
    curves = animate(armature, scale=switch == "scale")
    interpolate(curves, "LINEAR")
    if switch.startswith("use_"):
        for bone in list(armature.data.bones)[::2]:
            setattr(bone, switch, False)
    source = armature.animation_data.action
    keys = [tuple(point.co) for curve in curves for point in curve.keyframe_points]
    clip = read_clip(armature)
    modes = [bone.rotation_mode for bone in armature.pose.bones]
    action = write_clip(armature, clip, name="Result", note="Rig, and nothing else")
    assert armature.animation_data.action == action != source
    assert [tuple(point.co) for curve in curves for point in curve.keyframe_points] == keys
    assert source.use_fake_user
    assert [bone.rotation_mode for bone in armature.pose.bones] == modes
    assert action[MARK]["note"] == "Rig, and nothing else"
    assert_shown(armature, clip, 20.0)
    again = read_clip(armature)
    assert angle_between(again.rotations, clip.rotations).max() < ANGLE
    assert np.abs(again.locations - clip.locations).max() < 1e-4


def test_written_quaternions_keep_their_sign():
    armature = make_rig()
    interpolate(animate(armature), "LINEAR")
    clip = read_clip(armature)
    write_clip(armature, clip)
    data = armature.animation_data
    bag = data.action.layers[0].strips[0].channelbag(data.action_slot)
    path = armature.pose.bones[0].path_from_id("rotation_quaternion")
    values = np.array(
        [[bag.fcurves.find(path, index=i).evaluate(f) for i in range(4)] for f in clip.frames]
    )
    assert (np.sum(values[1:] * values[:-1], axis=1) > 0.0).all()


# --- Poses without keys ---------------------------------------------------------------------------


def rig_with_posed_hand() -> tuple[Any, Any]:
    """A rig whose action moves its first bone alone; the third one is posed without keys."""
    armature = make_rig()
    bones = armature.pose.bones
    for frame, turn in ((1, (1.0, 0.0, 0.0, 0.0)), (9, (0.6, 0.8, 0.0, 0.0))):
        bones[0].rotation_quaternion = turn
        bones[0].keyframe_insert("rotation_quaternion", frame=frame)
    bones[2].rotation_euler = (0.1, 0.2, 0.3)
    return armature, armature.animation_data.action


def assign_action(armature: Any, action: Any) -> None:
    armature.animation_data.action = action
    armature.animation_data.action_slot = action.slots[0]
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)


def moving_everything(clip: Clip) -> Clip:
    """As if a splice had moved all bones."""
    turns = np.linspace(0.0, 1.0, len(clip))[:, None, None] * (0.4, -0.2, 0.1)
    return replace(clip, rotations=multiply(clip.rotations, from_rotation_vector(turns)))


def test_a_changed_pose_without_keys_counts_from_the_next_reading_on():
    armature, action = rig_with_posed_hand()
    write_clip(armature, read_clip(armature))
    assign_action(armature, action)
    armature.pose.bones[2].rotation_euler = (0.9, 0.0, 0.0)
    clip = read_clip(armature, action)
    turned = angle_between(clip.rotations[:, 2], (1.0, 0.0, 0.0, 0.0))
    assert turned == pytest.approx(0.9, abs=1e-6)
    # Also while the next result plays.
    write_clip(armature, moving_everything(clip))
    bpy.context.scene.frame_set(5)
    again = read_clip(armature, action)
    assert np.array_equal(again.rotations, clip.rotations)
    # And back to rest, if the artist wants that.
    assign_action(armature, action)
    armature.pose.bones[2].rotation_euler = (0.0, 0.0, 0.0)
    rested = read_clip(armature, action)
    assert angle_between(rested.rotations[:, 2], (1.0, 0.0, 0.0, 0.0)).max() == 0.0


@pytest.mark.parametrize("frame", [1, 4, 9])
def test_what_a_result_leaves_behind_is_no_pose_of_the_artists(frame: int):
    armature, action = rig_with_posed_hand()
    clip = read_clip(armature)
    write_clip(armature, moving_everything(clip))
    bpy.context.scene.frame_set(frame, subframe=0.5 if frame < 9 else 0.0)
    bpy.context.view_layer.update()
    assign_action(armature, action)
    again = read_clip(armature, action)
    assert np.array_equal(again.rotations, clip.rotations)


def test_a_pose_without_keys_is_kept_in_another_rotation_mode():
    armature, action = rig_with_posed_hand()
    clip = read_clip(armature)
    write_clip(armature, moving_everything(clip))
    for mode in ("QUATERNION", "AXIS_ANGLE"):
        armature.pose.bones[2].rotation_mode = mode
        again = read_clip(armature, action)
        assert angle_between(again.rotations[:, 2], clip.rotations[:, 2]).max() < ANGLE
