# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow-through as an artist meets it: the button, what it leaves, and what Blender then plays."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.ui.follow_through import follow_settings
from octo_motion.ui.follow_through.following import FollowSession
from tests.ui.rig import curves

BONES = [f"Tail.{number}" for number in range(1, 6)]
FRAMES = 25


def make_fox(*, scale: float = 1.0, mode: str = "QUATERNION") -> Any:
    """A body that turns to and fro once a second, with a tail of five bones that has no keys."""
    armature: Any = bpy.data.objects.new("Fox", bpy.data.armatures.new("Fox"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    armature.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    edit_bones = armature.data.edit_bones
    body = edit_bones.new("Body")
    body.head, body.tail = (0.0, 0.3, 0.5), (0.0, -0.3, 0.5)
    parent = body
    for number, name in enumerate(BONES):
        bone = edit_bones.new(name)
        bone.head, bone.tail = (0.0, 0.3 + 0.1 * number, 0.5), (0.0, 0.4 + 0.1 * number, 0.5)
        bone.parent, bone.use_connect = parent, number > 0
        parent = bone
    bpy.ops.object.mode_set(mode="POSE")
    armature.scale = (scale,) * 3
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ" if bone.name == "Body" else mode
    own = armature.pose.bones["Body"]
    for frame in range(1, FRAMES + 1):
        own.rotation_euler = (0.0, 0.0, 0.6 * np.sin(2.0 * np.pi * (frame - 1) / 24.0))
        own.keyframe_insert("rotation_euler", frame=frame)
    armature.animation_data.action.name = "Wag"
    bpy.context.scene.frame_set(1)
    return armature


def keys(action: Any) -> dict[tuple[str, int], list[tuple[float, ...]]]:
    """All that an action's keys are."""
    return {
        (curve.data_path, curve.array_index): [
            (*key.co, *key.handle_left, *key.handle_right) for key in curve.keyframe_points
        ]
        for curve in curves(action)
    }


def played(armature: Any, frames: Any = range(1, FRAMES + 1)) -> np.ndarray:
    """(frames, bones, 4, 4) of the tail, as Blender plays it, armature space."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=float(frame) % 1.0)
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        found.append([np.array(shown.pose.bones[each].matrix) for each in BONES])
    return np.array(found)


def select_tail(armature: Any) -> None:
    bpy.ops.pose.select_all(action="DESELECT")
    for name in BONES:
        bone = armature.pose.bones[name]
        (bone if hasattr(bone, "select") else bone.bone).select = True


def lag(matrices: np.ndarray) -> np.ndarray:
    """(frames,) radians of the tip's heading behind the body's."""
    along = matrices[:, -1, :3, 1]
    heading = np.arctan2(-along[:, 0], along[:, 1])
    return heading - 0.6 * np.sin(2.0 * np.pi * np.arange(len(matrices)) / 24.0)


def test_selected_bones_follow_on_a_layer_and_the_action_stays_as_it_is() -> None:
    fox = make_fox()
    select_tail(fox)
    before, own = keys(bpy.data.actions["Wag"]), played(fox)
    assert np.abs(lag(own)).max() < 1e-4
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    assert keys(bpy.data.actions["Wag"]) == before
    settings = follow_settings(fox)
    assert settings.result.name == "Wag Follow-Through"
    tracks = fox.animation_data.nla_tracks
    assert [strip.action.name for track in tracks for strip in track.strips] == [
        "Wag",
        "Wag Follow-Through",
    ]
    assert np.abs(lag(played(fox))).max() > 0.1
    paths = {path for path, _ in keys(settings.result)}
    assert paths == {f'pose.bones["{each}"].rotation_quaternion' for each in BONES}


@pytest.mark.parametrize("mode", ["QUATERNION", "XYZ", "AXIS_ANGLE"])
def test_what_blender_plays_is_what_was_worked_out(mode: str) -> None:
    fox = make_fox(mode=mode, scale=0.01)
    select_tail(fox)
    session = FollowSession(fox)
    for _ in session.steps():
        pass
    session.end()
    assert session._found is not None
    axes = session._found.orientations
    # The object is not turned: the world's axes are the armature's.
    along = 2.0 * np.stack(
        [
            axes[..., 1] * axes[..., 2] - axes[..., 0] * axes[..., 3],
            0.5 - axes[..., 1] ** 2 - axes[..., 3] ** 2,
            axes[..., 2] * axes[..., 3] + axes[..., 0] * axes[..., 1],
        ],
        axis=-1,
    )
    assert np.abs(played(fox)[..., :3, 1] - along).max() < 2e-6
    assert np.abs(lag(played(fox))).max() > 0.1


def test_made_again_it_is_made_in_place_and_the_same() -> None:
    fox = make_fox()
    select_tail(fox)
    bpy.ops.octo_motion.follow_through()
    first = keys(follow_settings(fox).result)
    bpy.context.scene.frame_set(9)
    bpy.ops.octo_motion.follow_through()
    assert keys(follow_settings(fox).result) == first
    assert len(bpy.data.actions) == 2
    assert len(fox.animation_data.nla_tracks) == 2


def test_an_action_that_lies_in_the_one_strip_of_the_nla_is_followed() -> None:
    fox = make_fox()
    select_tail(fox)
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    expected = played(fox)
    fox = make_fox()
    select_tail(fox)
    own = fox.animation_data.action
    strips = fox.animation_data.nla_tracks.new().strips
    strips.new("Wag", 1, own)
    fox.animation_data.action = None
    before = keys(own)
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    assert keys(own) == before
    strips = [each for track in fox.animation_data.nla_tracks for each in track.strips]
    assert [each.action for each in strips] == [own, follow_settings(fox).result]
    np.testing.assert_allclose(played(fox), expected, atol=1e-6)
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    np.testing.assert_allclose(played(fox), expected, atol=1e-6)


@pytest.mark.one_blender
def test_a_strip_that_is_there_now_is_followed_and_not_the_action_of_before() -> None:
    fox = make_fox()
    select_tail(fox)
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    tracks = fox.animation_data.nla_tracks
    for track in list(tracks):
        tracks.remove(track)
    other = bpy.data.actions["Wag"].copy()
    tracks.new().strips.new("Other", 1, other)
    fox.animation_data.action = None
    assert bpy.ops.octo_motion.follow_through() == {"FINISHED"}
    assert follow_settings(fox).base == other


def test_a_motion_in_several_strips_is_told_and_left_alone() -> None:
    fox = make_fox()
    select_tail(fox)
    own = fox.animation_data.action
    strips = fox.animation_data.nla_tracks.new().strips
    strips.new("Wag", 1, own)
    strips.new("Wag again", 1 + FRAMES, own)
    fox.animation_data.action = None
    with pytest.raises(RuntimeError, match="lies in strips of the NLA"):
        bpy.ops.octo_motion.follow_through()
    assert follow_settings(fox).result is None
    assert len(bpy.data.actions) == 1


@pytest.mark.one_blender
def test_new_action_has_the_rest_of_the_old_one_and_the_same_action_takes_it_in() -> None:
    fox = make_fox()
    select_tail(fox)
    settings: Any = follow_settings(fox)
    bpy.ops.octo_motion.follow_through()
    layered = played(fox)
    bpy.data.actions.remove(settings.result)
    for track in list(fox.animation_data.nla_tracks):
        fox.animation_data.nla_tracks.remove(track)
    for name in BONES:
        fox.pose.bones[name].rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
    wag = bpy.data.actions["Wag"]
    before = keys(wag)
    fox.animation_data.action = wag
    settings.result_as = "ACTION"
    bpy.ops.octo_motion.follow_through()
    assert fox.animation_data.action == settings.result != wag
    assert keys(wag) == before
    assert {
        path: each for path, each in keys(settings.result).items() if "Body" in path[0]
    } == before
    assert np.abs(played(fox) - layered).max() < 1e-5
    settings.result_as = "SAME"
    bpy.ops.octo_motion.follow_through()
    assert settings.result is None
    assert wag.name in {each.name for each in bpy.data.actions}
    assert {path: each for path, each in keys(wag).items() if "Body" in path[0]} == before
    fox.animation_data.action = wag
    assert np.abs(played(fox) - layered).max() < 1e-5


def test_few_keys_keep_within_the_angle() -> None:
    fox = make_fox()
    select_tail(fox)
    settings: Any = follow_settings(fox)
    bpy.ops.octo_motion.follow_through()
    dense = played(fox)[..., :3, 1]
    count = sum(map(len, keys(settings.result).values()))
    settings.keys = "REDUCED"
    bpy.ops.octo_motion.follow_through()
    fewer = sum(map(len, keys(settings.result).values()))
    assert fewer < 0.6 * count
    # Five bones in a row may each be off by half a degree.
    apart = np.degrees(np.arccos(np.clip((played(fox)[..., :3, 1] * dense).sum(-1), -1.0, 1.0)))
    assert apart.max() < 2.5


def test_cycle_meets_its_beginning() -> None:
    fox = make_fox()
    select_tail(fox)
    wag = bpy.data.actions["Wag"]
    wag.use_frame_range, wag.use_cyclic = True, True
    wag.frame_start, wag.frame_end = 1.0, float(FRAMES)
    follow_settings(fox).result_as = "ACTION"
    bpy.ops.octo_motion.follow_through()
    shown = played(fox)
    assert np.abs(shown[0] - shown[-1]).max() < 1e-6
    turned = np.diff(shown[..., :3, 1], axis=0)
    seam = np.linalg.norm(turned[0] - turned[-1], axis=-1)
    usual = np.linalg.norm(np.diff(turned, axis=0), axis=-1).max(axis=0)
    assert (seam <= 1.1 * usual).all()
    assert follow_settings(fox).result.use_cyclic


@pytest.mark.one_blender
@pytest.mark.parametrize("last", [FRAMES, FRAMES - 4])
def test_loop_that_nothing_marks_as_one_meets_its_beginning(last: int) -> None:
    """Clips from files: whether they are loops is seen from their ends alone."""
    fox = make_fox()
    for curve in curves(bpy.data.actions["Wag"]):
        for key in reversed(curve.keyframe_points):
            if key.co.x > last:
                curve.keyframe_points.remove(key)
    select_tail(fox)
    bpy.ops.octo_motion.follow_through()
    shown = played(fox, range(1, last + 1))
    turned = np.diff(shown[..., :3, 1], axis=0)
    seam = np.linalg.norm(turned[0] - turned[-1], axis=-1)
    usual = np.linalg.norm(np.diff(turned, axis=0), axis=-1).max(axis=0)
    if last == FRAMES:
        assert np.abs(shown[0] - shown[-1]).max() < 1e-6
        assert (seam <= 1.1 * usual).all()
    else:
        assert np.abs(shown[0] - shown[-1]).max() > 0.1
    assert not bpy.data.actions["Wag"].use_cyclic
    # And as it was, where it is not to be one.
    follow_settings(fox).loop = False
    bpy.ops.octo_motion.follow_through()
    assert np.abs(played(fox, [1])[0] - played(fox, [last])[0]).max() > 0.01


def test_chains_are_found_by_their_names_listed_and_told_apart() -> None:
    fox = make_fox()
    assert bpy.ops.octo_motion.follow_find() == {"FINISHED"}
    settings: Any = follow_settings(fox)
    assert [(each.name, each.last) for each in settings.chains] == [("Tail.1", "Tail.5")]
    settings.chains[0].strength = 1000.0
    bpy.ops.octo_motion.follow_through()
    assert np.abs(lag(played(fox))).max() < 0.01
    settings.chains[0].strength = 1.0
    settings.chains[0].keyframe_insert("strength", frame=1)
    settings.chains[0].strength = 1000.0
    settings.chains[0].keyframe_insert("strength", frame=12)
    bpy.ops.octo_motion.follow_through()
    behind = np.abs(lag(played(fox)))
    assert behind[:8].max() > 0.05
    assert behind[16:].max() < 0.02
    assert bpy.ops.octo_motion.follow_remove() == {"FINISHED"}
    assert not len(settings.chains)
    select_tail(fox)
    assert bpy.ops.octo_motion.follow_add() == {"FINISHED"}
    assert bpy.ops.octo_motion.follow_add() == {"FINISHED"}
    assert len(settings.chains) == 1
    bpy.ops.pose.select_all(action="DESELECT")
    assert bpy.ops.octo_motion.follow_select() == {"FINISHED"}
    assert len(bpy.context.selected_pose_bones) == 5


@pytest.mark.one_blender
def test_floor_stops_a_limp_tail() -> None:
    fox = make_fox()
    select_tail(fox)
    settings: Any = follow_settings(fox)
    settings.material, settings.gravity = "LIMP", 1.0
    settings.floor, settings.floor_height = True, 0.2
    bpy.ops.octo_motion.follow_through()
    shown = played(fox)
    tails = shown[..., :3, 3] + 0.1 * shown[..., :3, 1]
    # A bone without skin is as thick as 0.12 of its length.
    assert tails[..., 2].min() > 0.2 + 0.012 - 1e-3
    assert tails[-1, -1, 2] < 0.35


def test_undo_takes_all_of_it_back_at_once() -> None:
    fox = make_fox()
    select_tail(fox)
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.octo_motion.follow_through()
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    left: Any = bpy.data.objects["Fox"]
    assert [each.name for each in bpy.data.actions] == ["Wag"]
    assert left.animation_data.action.name == "Wag"
    assert not len(left.animation_data.nla_tracks)


def test_what_cannot_be_done_is_told_and_changes_nothing() -> None:
    fox = make_fox()
    bpy.ops.pose.select_all(action="DESELECT")
    with pytest.raises(RuntimeError, match="No bones are chosen"):
        bpy.ops.octo_motion.follow_through()
    with pytest.raises(RuntimeError, match="No bones are selected"):
        bpy.ops.octo_motion.follow_add()
    select_tail(fox)
    limit = fox.pose.bones["Tail.3"].constraints.new("COPY_ROTATION")
    limit.target, limit.subtarget = fox, "Body"
    with pytest.raises(RuntimeError, match=r"Constraints or drivers move 'Tail\.3'"):
        bpy.ops.octo_motion.follow_through()
    fox.pose.bones["Tail.3"].constraints.remove(limit)
    settings: Any = follow_settings(fox)
    item = settings.chains.add()
    item.name, item.last = "Tail.4", "Tail.2"
    with pytest.raises(RuntimeError, match="does not hang on"):
        bpy.ops.octo_motion.follow_through()
    item.name = "Gone"
    with pytest.raises(RuntimeError, match="There is no bone 'Gone'"):
        bpy.ops.octo_motion.follow_through()
    settings.chains.clear()
    fox.animation_data_clear()
    with pytest.raises(RuntimeError, match="no action to follow"):
        bpy.ops.octo_motion.follow_through()
    assert settings.result is None
    assert len(bpy.data.actions) == 1


def test_frame_and_pose_are_left_as_they_were() -> None:
    fox = make_fox()
    select_tail(fox)
    bpy.context.scene.frame_set(7)
    fox.pose.bones["Tail.2"].location = (0.0, 0.0, 0.0)
    bpy.ops.octo_motion.follow_through()
    assert bpy.context.scene.frame_current == 7


def test_what_moves_pushes_the_tail_where_it_then_is() -> None:
    """A ball goes up through the place where the tail hangs; where it stands now says nothing."""
    fox = make_fox()
    mesh = bpy.data.meshes.new("Ball")
    mesh.from_pydata([(0.1 * x, 0.1 * y, 0.1 * z) for x, y, z in CORNERS], [], [])
    ball: Any = bpy.data.objects.new("Ball", mesh)
    bpy.context.scene.collection.objects.link(ball)
    for frame, height in ((1, -0.5), (25, 1.5)):
        ball.location = (0.0, 0.6, height)
        ball.keyframe_insert("location", frame=frame)
    ball.octo_motion.posing.obstacle = "SPHERE"
    select_tail(fox)
    settings: Any = follow_settings(fox)
    settings.use_obstacles = True
    bpy.context.scene.frame_set(1)
    bpy.ops.octo_motion.follow_through()
    heights = played(fox)[..., 2, 3]
    assert heights.max() > 0.6  # the tail is level at 0.5 without
    np.testing.assert_allclose(heights[0], 0.5, atol=0.01)


CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
