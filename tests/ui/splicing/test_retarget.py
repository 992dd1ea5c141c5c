# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole clips onto bodies unlike theirs, judged by what Blender plays."""

import re
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion

from octo_motion.blender.animation.actions import MARK
from octo_motion.ui.splicing.retargeting import RetargetSession, file_clip
from octo_motion.ui.splicing.stack import ClipReader
from tests.referee.recording import Floats, Recording, moments, record
from tests.ui.rig import scene_contents
from tests.ui.splicing.walkers import BODIES, CYCLE, Body, holds, make_body, walk

# Blender's importer leaves the file open.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")

OPERATORS: Any = bpy.ops.octo_motion

LAST = 3 * CYCLE + 1


def select(*armatures: Any) -> None:
    """Select these, the last one active."""
    for each in bpy.data.objects:
        each.select_set(each in armatures)
    bpy.context.view_layer.objects.active = armatures[-1]


def walker_and(name: str) -> tuple[Any, Any]:
    """Somebody who walks, and a body of that kind that does nothing."""
    source = make_body("Walker", BODIES["like it"])
    walk(source, BODIES["like it"])
    hero = make_body("Hero", BODIES[name])
    select(source, hero)
    return source, hero


def played(armature: Any, per_frame: int = 2) -> Recording:
    return record(armature, moments(1, LAST, per_frame), with_skin=False)


def joint(recording: Recording, bone: str) -> Floats:
    return recording.heads[:, recording.names.index(bone)]


def drifts(recording: Recording, body: Body, points: tuple[str, ...] = ("foot", "toe")) -> float:
    """By how much a foot creeps over a hold at most, in legs."""
    most = 0.0
    for side in "LR":
        for point in points:
            if f"{point}.{side}" not in recording.names:
                continue
            place = joint(recording, f"{point}.{side}")
            for rows in holds(recording.frames, side, ball=point == "toe"):
                off = np.linalg.norm(place[rows] - place[rows].mean(axis=0), axis=1)
                most = max(most, float(off.max()) / body.leg)
    return most


@pytest.mark.one_blender
@pytest.mark.parametrize("name", BODIES)
def test_feet_stand_where_their_clip_stands_and_on_the_ground(name: str) -> None:
    _, hero = walker_and(name)
    assert OPERATORS.retarget() == {"FINISHED"}
    body, recording = BODIES[name], played(hero)
    assert drifts(recording, body) < 0.005
    for side in "LR":
        ankle = joint(recording, f"foot.{side}")
        for rows in holds(recording.frames, side, ball=False):
            assert np.abs(ankle[rows, 2] - body.ankle).max() < 0.01 * body.leg
        if body.toes:
            ball = joint(recording, f"toe.{side}")
            for rows in holds(recording.frames, side, ball=True):
                assert np.abs(ball[rows, 2] - 0.02).max() < 0.01 * body.leg


def test_without_foot_lock_feet_of_another_body_slide() -> None:
    _, hero = walker_and("short legs, wide hips")
    hero.octo_motion.splicing.retarget.foot_lock = False
    OPERATORS.retarget()
    assert drifts(played(hero), BODIES["short legs, wide hips"]) > 0.005


@pytest.mark.one_blender
@pytest.mark.parametrize("name", BODIES)
def test_strides_are_of_the_bodys_own_size(name: str) -> None:
    source, hero = walker_and(name)
    OPERATORS.retarget()
    ways = []
    for armature in (source, hero):
        hips = joint(played(armature), "hips")
        ways.append(hips[-1] - hips[0])
    size = BODIES[name].leg / BODIES["like it"].leg
    assert np.abs(ways[1] - size * ways[0]).max() < 0.01 * np.linalg.norm(ways[1])


@pytest.mark.one_blender
@pytest.mark.parametrize("name", BODIES)
def test_limbs_point_where_the_clips_do(name: str) -> None:
    source, hero = walker_and(name)
    OPERATORS.retarget()
    recordings = [played(each, 1) for each in (source, hero)]
    for side in "LR":
        for first, last in (
            (f"upper_arm.{side}", f"hand.{side}"),
            (f"thigh.{side}", f"foot.{side}"),
        ):
            ways = [joint(each, last) - joint(each, first) for each in recordings]
            ours, theirs = (way / np.linalg.norm(way, axis=1)[:, None] for way in ways)
            angle = np.degrees(np.arccos(np.clip(np.sum(ours * theirs, axis=1), -1.0, 1.0)))
            assert np.median(angle) < (2.0 if first.startswith("upper") else 4.0)


@pytest.mark.one_blender
@pytest.mark.parametrize("name", BODIES)
def test_loops_stay_loops(name: str) -> None:
    _, hero = walker_and(name)
    OPERATORS.retarget()
    recording = played(hero, 1)
    places = recording.heads - joint(recording, "hips")[:, None] * [1.0, 1.0, 0.0]
    deforming = [row for row, bone in enumerate(recording.names) if bone != "root"]
    off = np.linalg.norm(places[-1] - places[0], axis=-1)[deforming]
    assert off.max() < 2e-3 * BODIES[name].leg
    speeds = [np.diff(places[rows], axis=0)[0] for rows in ([0, 1], [-2, -1])]
    # The seam is no faster a change than there is elsewhere.
    usual = np.linalg.norm(np.diff(places, 2, axis=0), axis=-1)[:, deforming].max()
    assert np.linalg.norm(speeds[0] - speeds[1], axis=-1)[deforming].max() < 1.2 * usual


@pytest.mark.one_blender
@pytest.mark.parametrize("name", BODIES)
def test_nothing_pops(name: str) -> None:
    """What changes from frame to frame halves with the step."""
    _, hero = walker_and(name)
    OPERATORS.retarget()
    most = []
    for per_frame in (1, 2):
        recording = played(hero, per_frame)
        steps = np.linalg.norm(np.diff(recording.heads, axis=0), axis=-1)
        most.append(float(steps.max()))
    assert most[1] < 0.65 * most[0]


def lean_forward_at_rest(armature: Any, degrees: float) -> None:
    """Let the body rest as one frame of a run, and stand in its action as it rested before."""
    bpy.ops.object.mode_set(mode="EDIT")
    edited = armature.data.edit_bones
    root, hips = edited["root"], edited["hips"].head.copy()
    about = Matrix.Translation(hips) @ Matrix.Rotation(np.radians(degrees), 4, "X")
    about @= Matrix.Translation(-hips)
    for bone in edited:
        if bone != root:
            bone.transform(about)
    bpy.ops.object.mode_set(mode="OBJECT")
    pose = armature.pose.bones["hips"]
    pose.rotation_mode = "QUATERNION"
    pose.matrix = about.inverted() @ armature.data.bones["hips"].matrix_local
    for frame in (1, 24):
        pose.keyframe_insert("rotation_quaternion", frame=frame)
        pose.keyframe_insert("location", frame=frame)


@pytest.mark.one_blender
@pytest.mark.parametrize("degrees", [20.0, 40.0, 60.0])
def test_a_body_whose_rest_pose_leans_stands_as_its_clip_does(degrees: float) -> None:
    _, hero = walker_and("like it")
    lean_forward_at_rest(hero, degrees)
    OPERATORS.retarget()
    recording = played(hero)
    trunk = joint(recording, "neck") - joint(recording, "hips")
    upright = trunk[:, 2] / np.linalg.norm(trunk, axis=1)
    assert np.degrees(np.arccos(upright.min())) < 3.0
    assert np.abs(joint(recording, "upper_arm.L") - joint(recording, "upper_arm.R"))[:, 2].max() < (
        0.02
    )


def test_a_body_stands_as_in_an_idle_action_whatever_its_slots_are_called() -> None:
    """Files call them as they like; the object is called after the file when it is imported."""
    _, hero = walker_and("like it")
    body = BODIES["like it"]
    for name, height in (("Idle", 0.0), ("Wall Slide", 0.5)):
        action = bpy.data.actions.new(name)
        data = hero.animation_data_create()
        data.action = action
        data.action_slot = action.slots.new("OBJECT", "Skeleton")
        for frame in (1, 24):
            hero.pose.bones["hips"].location = (0.0, height, 0.0)
            hero.pose.bones["hips"].keyframe_insert("location", frame=frame)
    assert hero.animation_data.action_slot.identifier == "OBSkeleton"
    OPERATORS.retarget()
    recording = played(hero)
    for rows in holds(recording.frames, "L", ball=False):
        assert np.abs(joint(recording, "foot.L")[rows, 2] - body.ankle).max() < 0.01 * body.leg


@pytest.mark.parametrize("degrees", [0.0, 60.0])
def test_that_a_head_turned_aside_counts_as_facing_ahead_is_told(
    degrees: float, capfd: pytest.CaptureFixture[str]
) -> None:
    source, _ = walker_and("like it")
    head = source.pose.bones["head"]
    head.rotation_mode = "XYZ"
    for frame in (1, LAST):
        head.rotation_euler = (0.0, np.radians(degrees), 0.0)
        head.keyframe_insert("rotation_euler", frame=frame)
    OPERATORS.retarget()
    assert ("The head is turned aside" in capfd.readouterr().out) == (degrees > 0.0)


def test_without_travel_the_body_stays_where_it_is() -> None:
    _, hero = walker_and("short legs, wide hips")
    hero.location = (3.0, 1.0, 0.0)
    hero.octo_motion.splicing.retarget.travel = False
    OPERATORS.retarget()
    hips = joint(played(hero), "hips")
    assert np.abs(hips[:, :2] - [3.0, 1.0]).max() < 0.2 * BODIES["short legs, wide hips"].leg


def test_a_body_goes_from_where_its_armature_stands_and_faces() -> None:
    _, hero = walker_and("like it")
    hero.location, hero.rotation_euler = (2.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2.0)
    OPERATORS.retarget()
    hips = joint(played(hero), "hips")
    way = hips[-1] - hips[0]
    # The walker goes along −Y; turned by a quarter that is +X.
    assert way[0] > 0.9 * np.linalg.norm(way)


def slope(start: float = 3.0) -> Any:
    """A mesh that rises the way the walkers go, from a place on."""
    rows = [-6.0, start] if start >= 3.0 else [-6.0, start, 3.0]
    points = [(x, y, -0.15 * min(y - start, 0.0)) for y in rows for x in (-3.0, 3.0)]
    if start >= 3.0:
        points = [(x, y, z - 0.45) for x, y, z in points]
    mesh = bpy.data.meshes.new("Slope")
    mesh.from_pydata(
        points, [], [(2 * n, 2 * n + 1, 2 * n + 3, 2 * n + 2) for n in range(len(rows) - 1)]
    )
    ground = bpy.data.objects.new("Slope", mesh)
    bpy.context.scene.collection.objects.link(ground)
    return ground


def assert_standing_on_the_slope(hero: Any, body: Body) -> None:
    recording = played(hero)
    assert drifts(recording, body) < 0.005
    # A loop that climbs goes on where it ends: no round sinks to the height of the one before.
    hips = joint(recording, "hips")
    above = hips[:, 2] + 0.15 * hips[:, 1]
    assert np.ptp(above) < 0.25 * body.leg
    for side in "LR":
        ankle = joint(recording, f"foot.{side}")
        for rows in holds(recording.frames, side, ball=False):
            above = ankle[rows, 2] + 0.15 * ankle[rows, 1]
            assert np.abs(above - body.ankle).max() < 0.03 * body.leg


def test_feet_stand_on_a_mesh() -> None:
    _, hero = walker_and("short legs, wide hips")
    body = BODIES["short legs, wide hips"]
    hero.octo_motion.splicing.retarget.ground = slope()
    OPERATORS.retarget()
    assert_standing_on_the_slope(hero, body)


def test_feet_are_tilted_as_the_ground_is_beneath_them() -> None:
    _, hero = walker_and("like it")
    body, start = BODIES["like it"], -0.5
    hero.octo_motion.splicing.retarget.ground = slope(start)
    OPERATORS.retarget()
    recording = played(hero)
    up = np.array([0.0, 0.15, 1.0]) / np.hypot(0.15, 1.0)
    for side in "LR":
        ankle, ball = (joint(recording, f"{each}.{side}") for each in ("foot", "toe"))
        for rows in holds(recording.frames, side, ball=False):
            normal = up if ball[rows, 1].max() < start - 0.1 else np.array([0.0, 0.0, 1.0])
            if normal is up or ball[rows, 1].min() > start + 0.3:
                rise = (ball[rows] - ankle[rows]) @ normal
                assert np.abs(rise - (0.02 - body.ankle)).max() < 0.01


def test_feet_of_a_splice_stand_on_a_mesh() -> None:
    source, hero = walker_and("short legs, wide hips")
    body = BODIES["short legs, wide hips"]
    walk(hero, body)
    select(source, hero)
    OPERATORS.splice_add(part="LEGS")
    item = hero.octo_motion.splicing.splices[0]
    item.with_travel, item.ease_in, item.ease_out, item.after = True, 0, 0, "HOLD"
    item.ground = slope()
    OPERATORS.splice_build()
    assert_standing_on_the_slope(hero, body)


def test_the_clip_and_its_armature_stay_as_they_are() -> None:
    source, hero = walker_and("no toes")
    before, action = played(source).heads, source.animation_data.action
    keys = [len(curve.keyframe_points) for curve in _curves(action)]
    OPERATORS.retarget()
    assert source.animation_data.action == action
    assert [len(curve.keyframe_points) for curve in _curves(action)] == keys
    assert np.array_equal(played(source).heads, before)
    assert hero.animation_data.action.name == "Walker Walk Retargeted"


def _curves(action: Any) -> list[Any]:
    return list(action.layers[0].strips[0].channelbags[0].fcurves)


def test_what_was_retargeted_is_made_anew_in_place_until_it_is_edited() -> None:
    _, hero = walker_and("no toes")
    OPERATORS.retarget()
    first = hero.animation_data.action
    OPERATORS.retarget()
    assert hero.animation_data.action == first
    del first[MARK]
    OPERATORS.retarget()
    assert hero.animation_data.action != first


def test_all_actions_of_a_source_in_one_go() -> None:
    source, hero = walker_and("short legs, wide hips")
    first = source.animation_data.action
    first.use_fake_user = True
    walk(source, BODIES["like it"], cycles=1)
    second = source.animation_data.action
    second.name = "Short Walk"
    select(source, hero)
    assert OPERATORS.retarget(all_actions=True) == {"FINISHED"}
    made = {each.name for each in bpy.data.actions if MARK in each}
    assert made == {"Walker Walk Retargeted", "Short Walk Retargeted"}
    assert all(bpy.data.actions[each].use_fake_user for each in made)


BVH = Path("docs/examples/clips").resolve()


def test_all_files_of_a_folder_leave_actions_and_nothing_else(tmp_path: Path) -> None:
    for name in ("walk", "punch"):
        (tmp_path / f"{name}.bvh").write_bytes((BVH / f"{name}.bvh").read_bytes())
    (tmp_path / "broken.bvh").write_text("HIERARCHY\n", encoding="utf-8")
    hero = make_body("Hero", BODIES["short legs, wide hips"])
    select(hero)
    objects = set(bpy.data.objects)
    assert OPERATORS.retarget_files(directory=str(tmp_path)) == {"FINISHED"}
    assert set(bpy.data.objects) == objects
    assert {each.name for each in bpy.data.actions} == {"walk", "punch"}
    assert bpy.context.view_layer.objects.active == hero


@pytest.mark.parametrize("suffix", ["", "nothing"])
def test_a_folder_without_clips_is_told(tmp_path: Path, suffix: str) -> None:
    hero = make_body("Hero", BODIES["like it"])
    select(hero)
    with pytest.raises(RuntimeError, match="folder"):
        OPERATORS.retarget_files(directory=str(tmp_path / suffix))


def test_every_mistake_is_told_and_changes_nothing() -> None:
    source, hero = walker_and("like it")
    select(hero)
    before = scene_contents()
    for arguments, problem in (
        ({}, "No source is selected"),
        ({"source": "nobody"}, "There is no armature 'nobody'"),
        ({"source": "Hero"}, "both source and target"),
        ({"source": "Walker", "action": "none"}, "There is no action 'none'"),
    ):
        with pytest.raises(RuntimeError, match=problem):
            OPERATORS.retarget(**arguments)
    source.animation_data_clear()
    with pytest.raises(RuntimeError, match="has no action"):
        OPERATORS.retarget(source="Walker")
    after = scene_contents()
    assert after.keys() == before.keys()
    assert hero.animation_data is None or hero.animation_data.action is None


def test_a_source_that_is_no_humanoid_is_named_with_what_to_do() -> None:
    _, hero = walker_and("like it")
    OPERATORS.add_octopus()
    octopus: Any = bpy.context.object
    octopus.animation_data_create().action = bpy.data.actions.new("Wobble")
    bone = octopus.pose.bones[5]
    for frame in (1, 10):
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    select(octopus, hero)
    with pytest.raises(RuntimeError, match=re.escape(f"'{octopus.name}' has no landmarks")):
        OPERATORS.retarget()


def test_feet_of_spliced_legs_that_travel_stand_too() -> None:
    source, hero = walker_and("short legs, wide hips")
    body = BODIES["short legs, wide hips"]
    base = make_body("Other", body)
    walk(base, body)
    bpy.data.objects.remove(hero)
    select(source, base)
    for locked in (False, True):
        base.octo_motion.splicing.splices.clear()
        OPERATORS.splice_add(part="LEGS")
        item = base.octo_motion.splicing.splices[0]
        item.with_travel, item.ease_in, item.ease_out, item.foot_lock = True, 0, 0, locked
        item.after = "HOLD"
        OPERATORS.splice_build()
        assert (drifts(played(base), body) < 0.005) == locked


def test_legs_that_travel_and_stand_are_right_between_frames_too() -> None:
    """Half frames lie on the way through the whole frames, which is no straight one."""
    source, hero = walker_and("short legs, wide hips")
    body = BODIES["short legs, wide hips"]
    base = make_body("Other", body)
    walk(base, body)
    bpy.data.objects.remove(hero)
    select(source, base)
    OPERATORS.splice_add(part="LEGS")
    item = base.octo_motion.splicing.splices[0]
    item.with_travel, item.ease_in, item.ease_out = True, 0, 0
    OPERATORS.splice_build()
    recording = played(base)
    for bone in ("foot.L", "foot.R"):
        place = joint(recording, bone) - joint(recording, "hips")
        whole, half = place[::2], place[1::2]
        way = (9.0 * (whole[1:-2] + whole[2:-1]) - whole[:-3] - whole[3:]) / 16.0
        off = np.linalg.norm(half[1:-1] - way, axis=1) / body.leg
        # Measured: 0.03 %, and 0.5 % where a foot takes hold; by keys on whole frames alone 0.15 %.
        assert np.median(off) < 0.0007
        assert off.max() < 0.01


def test_a_torso_that_carries_the_hips_is_spliced_without_moving_the_legs() -> None:
    """And legs that travel leave it as upright as it was."""
    body = BODIES["hips on a torso"]
    source = make_body("Bowing", BODIES["like it"])
    walk(source, BODIES["like it"])
    for frame in (1, LAST):
        spine = source.pose.bones["spine"]
        spine.rotation_quaternion = Quaternion((1.0, 0.0, 0.0), np.radians(30.0))
        spine.keyframe_insert("rotation_quaternion", frame=frame)
    bow = np.degrees(np.arccos(_upright(played(source))))
    base = make_body("Other", body)
    walk(base, body)
    before = played(base)
    for part, leans in (("TRUNK", bow), ("LEGS", 0.0)):
        select(source, base)
        base.octo_motion.splicing.splices.clear()
        OPERATORS.splice_add(part=part)
        item = base.octo_motion.splicing.splices[0]
        item.with_travel, item.ease_in, item.ease_out = part == "LEGS", 0, 0
        OPERATORS.splice_build()
        after = played(base)
        assert np.abs(np.degrees(np.arccos(_upright(after))) - leans).max() < 1.0
        if part == "TRUNK":
            for bone in ("hips", "thigh.L", "foot.R"):
                off = joint(after, bone) - joint(before, bone)
                assert np.abs(off).max() < 1e-4
        else:
            ways = [joint(each, "hips") for each in (played(source), after)]
            size = body.leg / BODIES["like it"].leg
            ours, theirs = (way[-1] - way[0] for way in ways[::-1])
            assert np.abs(ours - size * theirs).max() < 0.01 * np.linalg.norm(ours)


def _upright(recording: Recording) -> Floats:
    """Cosine of how far the neck is off the vertical through the hips."""
    trunk = joint(recording, "neck") - joint(recording, "hips")
    return np.clip(trunk[:, 2] / np.linalg.norm(trunk, axis=1), -1.0, 1.0)


def test_location_keys_of_a_part_are_the_clips() -> None:
    """Not what the base left on the bones, which moved a hand off its arm."""
    source, base = walker_and("like it")
    walk(base, BODIES["like it"], cycles=1)
    hand = base.pose.bones["hand.R"]
    for frame in (1, 10, 20):
        hand.location = (0.05 * frame, 0.0, 0.0)
        hand.keyframe_insert("location", frame=frame)
    select(source, base)
    OPERATORS.splice_add(part="RIGHT_ARM")
    item = base.octo_motion.splicing.splices[0]
    item.ease_in = item.ease_out = 0
    OPERATORS.splice_build()
    recording = record(base, moments(5, 15), with_skin=False)
    arm = joint(recording, "hand.R") - joint(recording, "forearm.R")
    assert np.ptp(np.linalg.norm(arm, axis=1)) < 1e-4


def test_what_is_stopped_leaves_nothing_behind() -> None:
    hero = make_body("Hero", BODIES["no toes"])
    select(hero)
    before = set(bpy.data.objects), set(bpy.data.actions), set(bpy.data.armatures)
    reader = ClipReader()
    clips = [
        (name, file_clip("Hero", BVH / f"{name}.bvh", 1, reader)) for name in ("walk", "punch")
    ]
    session = RetargetSession(hero, clips)
    steps = session.steps()
    next(steps)
    # Esc: nobody goes on.
    steps.close()
    assert (set(bpy.data.objects), set(bpy.data.actions), set(bpy.data.armatures)) == before
    assert hero.animation_data is None or hero.animation_data.action is None


def pushed_down(armature: Any, start: float | None = None) -> Any:
    """Its action as a strip of the NLA."""
    data = armature.animation_data
    action, slot = data.action, data.action_slot
    track = data.nla_tracks.new()
    strip = track.strips.new(action.name, 1, action)
    strip.action_slot = slot
    data.action = None
    if start is not None:
        strip.frame_start = start
    return strip


def sitting(armature: Any) -> None:
    """Move all bones of the rest pose down, so that only the action tells where it stands."""
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in armature.data.edit_bones:
        bone.translate(Matrix.Translation((0.0, 0.0, -0.7)).to_translation())
    bpy.ops.object.mode_set(mode="OBJECT")
    for frame in (1, 20):
        for bone in armature.pose.bones:
            if bone.parent is None:
                bone.location = (
                    bone.bone.matrix_local.to_3x3().inverted()
                    @ Matrix.Translation((0.0, 0.0, 0.7)).to_translation()
                )
                bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert("rotation_quaternion", frame=frame)


@pytest.mark.parametrize("slot", ["Hero", "Of a file"])
def test_motion_in_the_nla_tells_at_which_height_a_body_stands(slot: str) -> None:
    """Without it the rest pose did: hips came out 0.7 m lower, and nothing was said."""
    heights = []
    for pushed in (False, True):
        source, hero = walker_and("like it")
        sitting(hero)
        hero.animation_data.action_slot.name_display = slot
        if pushed:
            pushed_down(hero)
        select(source, hero)
        assert OPERATORS.retarget() == {"FINISHED"}
        heights.append(joint(played(hero, 1), "hips")[:, 2])
        for each in (source, hero):
            bpy.data.objects.remove(each)
        for action in list(bpy.data.actions):
            bpy.data.actions.remove(action)
    np.testing.assert_allclose(heights[1], heights[0], atol=1e-4)


def test_body_that_is_mirrored_by_its_scale_is_refused() -> None:
    source, hero = walker_and("like it")
    walk(hero, BODIES["like it"])
    hero.scale = (-1.0, 1.0, 1.0)
    select(source, hero)
    bpy.context.view_layer.update()
    before = scene_contents()
    with pytest.raises(RuntimeError, match="'Hero' is mirrored by a negative scale"):
        OPERATORS.retarget()
    assert scene_contents() == before


def test_clip_that_lies_in_the_nla_is_taken_from_its_one_strip() -> None:
    source, hero = walker_and("like it")
    pushed_down(source)
    assert OPERATORS.retarget() == {"FINISHED"}
    assert np.ptp(joint(played(hero, 1), "hips")[:, 1]) > 0.5


def test_clip_whose_strip_is_moved_says_that_it_lies_in_the_nla() -> None:
    source, _ = walker_and("like it")
    pushed_down(source, 20.0)
    with pytest.raises(RuntimeError, match=r"'Walker' lies in strips of the NLA.*Choose the act"):
        OPERATORS.retarget()
