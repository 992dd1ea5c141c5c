# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does with splices: add, time, mute, reorder, build, take back."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import MARK, is_edited
from octo_motion.blender.animation.clips import read_clip, write_clip
from octo_motion.core.errors import ClipError, OctoMotionError
from octo_motion.core.rotations import angle_between, from_rotation_vector
from octo_motion.core.splicing.clip.clip import Clip
from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS
from octo_motion.ui.splicing import splice_panels
from octo_motion.ui.splicing.stack import prepare_splices
from octo_motion.ui.splicing.timing_drag import (
    PER_PIXEL,
    DragSession,
    OCTO_MOTION_OT_splice_drag_timing,
    TimingDrag,
)
from tests.core.humanoids import MIDDLE, PARENTS, humanoid
from tests.ui.rig import click, generate, give_route, keys, make_octopus, scene_contents
from tests.ui.test_panels import Layout

# Blender's importer leaves the file open.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")

SharedData = Callable[[str], Path]

# Blender keeps keys in single precision, and Euler angles round a little more.
ROUNDING = 2e-5

OPERATORS: Any = bpy.ops.octo_motion


def make_humanoid(name: str, *, scale: float = 1.0, without: frozenset[str] = frozenset()) -> Any:
    """An armature with the bones of a made-up body, under their plain names."""
    assert set(MIDDLE) <= set(PARENTS)
    names = {each: each for each in LANDMARKS}
    skeleton = humanoid(names, scale=scale, without=without)
    armature: Any = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for number, bone_name in enumerate(skeleton.names):
        bone = armature.data.edit_bones.new(bone_name)
        bone.tail = (0.0, 0.0, skeleton.lengths[number])
        bone.matrix = skeleton.rest_matrices[number].T.tolist()
        if skeleton.parents[number] >= 0:
            bone.parent = armature.data.edit_bones[skeleton.parents[number]]
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def give_motion(armature: Any, seed: int, frames: int = 41, name: str = "") -> Any:
    """A smooth motion of all bones."""
    from octo_motion.blender.rig.armature import read_skeleton, world_matrix

    skeleton = read_skeleton(armature)
    random = np.random.default_rng(seed)
    times = np.arange(1.0, frames + 1.0)
    axes = random.normal(size=(len(skeleton), 3)) * 0.25
    phases = random.uniform(0.0, 6.0, size=len(skeleton))
    swing = np.sin(2.0 * np.pi * times[:, None] / 25.0 + phases)
    rotations = from_rotation_vector(swing[..., None] * axes)
    locations = np.zeros((frames, len(skeleton), 3))
    world = np.broadcast_to(world_matrix(armature), (frames, 4, 4)).copy()
    clip = Clip(
        name or f"{armature.name} Motion", skeleton, times, 24.0, rotations, locations, world
    )
    armature.animation_data_clear()
    action = write_clip(armature, clip)
    # An artist's action, as far as anyone can tell.
    del action[MARK]
    return action


def select(*armatures: Any) -> None:
    """Select these, the last one active."""
    for each in bpy.data.objects:
        each.select_set(each in armatures)
    bpy.context.view_layer.objects.active = armatures[-1]


def stack_of(armature: Any) -> Any:
    return armature.octo_motion.splicing


def hero_and_source() -> tuple[Any, Any]:
    """Two bodies with a motion each, ready to be spliced."""
    source, hero = make_humanoid("Source", scale=0.8), make_humanoid("Hero")
    give_motion(source, 1)
    give_motion(hero, 2)
    select(source, hero)
    return hero, source


def motion(armature: Any, action: Any) -> dict[str, np.ndarray]:
    clip = read_clip(armature, action)
    return {name: clip.rotations[:, number] for number, name in enumerate(clip.skeleton.names)}


def changed_bones(armature: Any, one: Any, other: Any) -> set[str]:
    ours, theirs = motion(armature, one), motion(armature, other)
    return {name for name in ours if angle_between(ours[name], theirs[name]).max() > 10 * ROUNDING}


def snapshot() -> dict[str, Any]:
    """All that splicing could change, poses as they are shown."""
    bpy.context.view_layer.update()
    return scene_contents()


# --- The list ------------------------------------------------------------------------------------


def test_the_selected_armature_is_the_source_and_the_active_one_gets_its_right_arm() -> None:
    hero, source = hero_and_source()
    base = hero.animation_data.action
    assert OPERATORS.splice_add() == {"FINISHED"}
    stack = stack_of(hero)
    assert stack.base == base
    (item,) = stack.splices
    assert (item.source, item.action) == (source, source.animation_data.action)
    assert (item.part, item.base_start, item.splice_start, item.length) == ("RIGHT_ARM", 1, 1, 0)
    assert item.name == "Right Arm: Source Motion"
    assert hero.animation_data.action == base


def test_another_action_of_the_same_armature_can_be_the_source() -> None:
    hero = make_humanoid("Hero")
    other = give_motion(hero, 3, name="Other")
    base = give_motion(hero, 2, name="Own")
    select(hero)
    OPERATORS.splice_add(part="LEGS", action="Other")
    (item,) = stack_of(hero).splices
    assert (item.source, item.action, stack_of(hero).base) == (hero, other, base)
    OPERATORS.splice_build()
    changed = changed_bones(hero, base, stack_of(hero).result)
    assert changed == {
        f"{bone}.{side}" for bone in ("thigh", "shin", "foot", "toe") for side in "LR"
    }


def test_two_splices_of_one_part_have_names_of_their_own() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_add()
    first, second = stack_of(hero).splices
    assert first.name != second.name
    assert stack_of(hero).active_splice == 1


def test_splices_are_moved_and_removed() -> None:
    hero, _ = hero_and_source()
    for part in ("RIGHT_ARM", "LEFT_ARM", "HEAD"):
        OPERATORS.splice_add(part=part)
    assert OPERATORS.splice_move(direction="DOWN") == {"CANCELLED"}
    OPERATORS.splice_move(direction="UP")
    assert [each.part for each in stack_of(hero).splices] == ["RIGHT_ARM", "HEAD", "LEFT_ARM"]
    assert stack_of(hero).active_splice == 1
    OPERATORS.splice_remove()
    assert [each.part for each in stack_of(hero).splices] == ["RIGHT_ARM", "LEFT_ARM"]
    OPERATORS.splice_remove()
    OPERATORS.splice_remove()
    assert not OPERATORS.splice_remove.poll()
    assert not OPERATORS.splice_move.poll()


# --- Building ------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", ["RIGHT_ARM", "LEFT_ARM", "LEGS", "TRUNK", "HEAD", "RIGHT_LEG"])
def test_only_the_bones_of_the_part_change(part: str) -> None:
    hero, _ = hero_and_source()
    base = hero.animation_data.action
    OPERATORS.splice_add(part=part)
    assert OPERATORS.splice_build() == {"FINISHED"}
    result = stack_of(hero).result
    assert hero.animation_data.action == result != base
    wanted = {
        "RIGHT_ARM": {"clavicle.R", "upper_arm.R", "forearm.R", "hand.R"},
        "LEFT_ARM": {"clavicle.L", "upper_arm.L", "forearm.L", "hand.L"},
        "LEGS": {f"{bone}.{side}" for bone in ("thigh", "shin", "foot", "toe") for side in "LR"},
        "TRUNK": {"spine", "chest"},
        "HEAD": {"neck", "head"},
        "RIGHT_LEG": {"thigh.R", "shin.R", "foot.R", "toe.R"},
    }
    assert changed_bones(hero, base, result) == wanted[part]


def test_an_arm_can_leave_the_collar_bone_to_the_base() -> None:
    hero, _ = hero_and_source()
    base = hero.animation_data.action
    OPERATORS.splice_add()
    stack_of(hero).splices[0].with_clavicle = False
    OPERATORS.splice_build()
    changed = changed_bones(hero, base, stack_of(hero).result)
    assert changed == {"upper_arm.R", "forearm.R", "hand.R"}


def test_legs_can_be_seen_from_the_chest() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add(part="LEGS")
    (item,) = stack_of(hero).splices
    seen = {}
    for travel in (False, True):
        for seen_from in ("PELVIS", "CHEST"):
            item.with_travel, item.seen_from = travel, seen_from
            OPERATORS.splice_build()
            seen[travel, seen_from] = motion(hero, stack_of(hero).result)["thigh.R"]
    apart = [angle_between(seen[each, "PELVIS"], seen[each, "CHEST"]).max() for each in (0, 1)]
    assert apart[0] > 0.05
    # With travel it is always the pelvis.
    assert apart[1] < 10 * ROUNDING


@pytest.mark.one_blender
def test_every_part_can_be_seen_from_elsewhere_and_is_seen_as_usual_unless_asked() -> None:
    hero, _ = hero_and_source()
    usual = {"RIGHT_ARM": "CHEST", "LEGS": "PELVIS", "HEAD": "CHEST", "TRUNK": "WORLD"}
    for part, seen_from in usual.items():
        OPERATORS.splice_add(part=part)
        (item,) = stack_of(hero).splices
        turns = {}
        for asked in ("AUTO", "CHEST", "PELVIS", "JOINT", "WORLD"):
            item.seen_from = asked
            OPERATORS.splice_build()
            turns[asked] = np.stack(list(motion(hero, stack_of(hero).result).values()))
        assert angle_between(turns["AUTO"], turns[seen_from]).max() < 10 * ROUNDING
        others = [each for each in ("PELVIS", "JOINT", "WORLD") if each != seen_from]
        assert any(angle_between(turns["AUTO"], turns[each]).max() > 0.02 for each in others), part
        OPERATORS.splice_remove()


def test_base_and_clips_stay_as_they_are() -> None:
    hero, _ = hero_and_source()
    before = {action.name: keys(action) for action in bpy.data.actions}
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    OPERATORS.splice_suggest_timing()
    OPERATORS.splice_drag_timing(base_start=7.0)
    for name, curves in before.items():
        after = keys(bpy.data.actions[name])
        assert set(after) == set(curves)
        assert all(np.array_equal(after[path], curves[path]) for path in curves)
        assert not bpy.data.actions[name].library
    assert stack_of(hero).result.name not in before


def test_all_else_that_the_base_moves_goes_on_moving() -> None:
    """Faces hang on custom properties, hands on influences of constraints, props on visibility."""
    hero, _ = hero_and_source()
    head, hand = hero.pose.bones["head"], hero.pose.bones["hand.L"]
    head["smile"], head["pupils"], head["mute"] = 0.0, [0.5, 0.5], 0.0
    copied = hand.constraints.new("COPY_ROTATION")
    for frame, value in ((1, 0.0), (41, 1.0)):
        head["smile"] = copied.influence = value
        head["pupils"] = [value, 0.25]
        hero.hide_render = frame > 20
        head.keyframe_insert('["smile"]', frame=frame)
        head.keyframe_insert('["mute"]', frame=frame)
        head.keyframe_insert('["pupils"]', index=0, frame=frame)
        copied.keyframe_insert("influence", frame=frame)
        hero.keyframe_insert("hide_render", frame=frame)
        hero.keyframe_insert("scale", frame=frame)
    base = hero.animation_data.action
    channelbag = base.layers[0].strips[0].channelbags[0]
    channelbag.fcurves.find('pose.bones["head"]["mute"]').mute = True
    channelbag.fcurves.new('pose.bones["gone"]["smile"]').keyframe_points.insert(1, 0.0)
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    result = hero.animation_data.action
    missing = keys(base).keys() - keys(result).keys()
    assert missing == {('pose.bones["head"]["mute"]', 0), ('pose.bones["gone"]["smile"]', 0)}
    scene = bpy.context.scene
    for frame in (1, 15, 30, 41):
        scene.frame_set(frame)
        shown = [head["smile"], *head["pupils"], copied.influence, hero.hide_render]
        expected = [
            channelbag.fcurves.find(path, index=index).evaluate(frame)
            for path, index in (
                ('pose.bones["head"]["smile"]', 0),
                ('pose.bones["head"]["pupils"]', 0),
                ('pose.bones["hand.L"].constraints["Copy Rotation"].influence', 0),
                ("hide_render", 0),
            )
        ]
        expected[2:2] = [0.25]
        assert shown == pytest.approx(expected, abs=1e-6)
    assert not is_edited(result)


def test_what_is_scaled_beside_the_part_keeps_its_size(capfd: pytest.CaptureFixture[str]) -> None:
    """A head that is larger, or squashed, with eyes and jaw in it."""
    hero, _ = hero_and_source()
    bpy.ops.object.mode_set(mode="EDIT")
    jaw = hero.data.edit_bones.new("jaw")
    jaw.parent = hero.data.edit_bones["head"]
    jaw.head, jaw.tail = jaw.parent.tail, np.add(jaw.parent.tail, (0.0, -0.1, 0.0))
    bpy.ops.object.mode_set(mode="OBJECT")
    head = hero.pose.bones["head"]
    for frame, scale in ((1, (1.3, 1.3, 1.3)), (41, (1.6, 0.7, 1.6))):
        head.scale = scale
        head.keyframe_insert("scale", frame=frame)
    hero.pose.bones["jaw"].rotation_quaternion = (0.9, 0.1, 0.0, 0.2)
    OPERATORS.splice_add()

    def shown(name: str) -> list[np.ndarray]:
        found = []
        for frame in (1, 20, 41):
            bpy.context.scene.frame_set(frame)
            found.append(np.array(hero.pose.bones[name].matrix))
        return found

    before = {name: shown(name) for name in ("head", "jaw")}
    for _ in range(2):
        OPERATORS.splice_build()
        for name, matrices in before.items():
            np.testing.assert_allclose(shown(name), matrices, atol=1e-5)
    assert "Warning" not in capfd.readouterr().out
    stack_of(hero).splices[0].part = "HEAD"
    OPERATORS.splice_build()
    assert "Warning: 'head' is scaled and loses its size" in capfd.readouterr().out
    bpy.context.scene.frame_set(20)
    assert tuple(head.scale) == (1.0, 1.0, 1.0)


def test_built_again_the_result_is_made_anew_in_place() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    first = stack_of(hero).result
    before = keys(first)
    stack_of(hero).splices[0].base_start = 9.0
    OPERATORS.splice_build()
    assert stack_of(hero).result == first
    assert not is_edited(first)
    after = keys(first)
    assert any(not np.array_equal(before[path], after[path]) for path in before)
    assert len(bpy.data.actions) == 3


def test_an_edited_result_is_kept() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    first = stack_of(hero).result
    curve = first.layers[0].strips[0].channelbags[0].fcurves[0]
    curve.keyframe_points[3].co.y += 0.5
    before = keys(first)
    OPERATORS.splice_build()
    assert stack_of(hero).result != first
    assert first.use_fake_user
    assert all(np.array_equal(values, keys(first)[path]) for path, values in before.items())


def test_a_result_that_became_a_base_is_never_replaced() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    first = stack_of(hero).result
    before = keys(first)
    stack_of(hero).base, stack_of(hero).base_slot = first, ""
    stack_of(hero).splices[0].part = "LEFT_ARM"
    OPERATORS.splice_build()
    second = stack_of(hero).result
    assert second != first
    assert all(np.array_equal(values, keys(first)[path]) for path, values in before.items())
    assert changed_bones(hero, first, second) == {
        "clavicle.L",
        "upper_arm.L",
        "forearm.L",
        "hand.L",
    }


def test_a_result_that_is_spliced_onto_another_body_is_never_replaced() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    first = stack_of(hero).result
    before = keys(first)
    third = make_humanoid("Third")
    give_motion(third, 5)
    select(hero, third)
    OPERATORS.splice_add()
    select(hero)
    stack_of(hero).splices[0].base_start = 5.0
    OPERATORS.splice_build()
    assert stack_of(hero).result != first
    assert all(np.array_equal(values, keys(first)[path]) for path, values in before.items())


@pytest.mark.parametrize("rate", [0.25, 0.4, 1.0])
def test_a_clip_that_is_slowed_down_moves_as_smoothly_as_its_curves(rate: float) -> None:
    hero = make_humanoid("Hero")
    clip = give_motion(hero, 3, name="Other")
    give_motion(hero, 2)
    path = 'pose.bones["forearm.R"].rotation_quaternion'
    curve = clip.layers[0].strips[0].channelbags[0].fcurves.find(path, index=1)
    curve.keyframe_points.clear()
    for frame, value in ((1, 0.0), (5, 0.9), (9, -0.9), (13, 0.9), (41, 0.0)):
        curve.keyframe_points.insert(frame, value)
    select(hero)
    OPERATORS.splice_add(action="Other")
    (item,) = stack_of(hero).splices
    item.rate, item.ease_in, item.ease_out, item.after = rate, 0.0, 0.0, "HOLD"
    OPERATORS.splice_build()
    moments = 1.0 + rate * np.arange(41.0)
    wanted = read_clip(hero, clip, frames=moments).rotations
    found = read_clip(hero, stack_of(hero).result).rotations
    bone = hero.data.bones.find("forearm.R")
    assert angle_between(found[:, bone], wanted[:, bone]).max() < np.radians(0.5)


def test_muted_splices_are_left_out_and_come_back() -> None:
    hero, _ = hero_and_source()
    base = hero.animation_data.action
    OPERATORS.splice_add()
    OPERATORS.splice_add(part="HEAD")
    OPERATORS.splice_build()
    whole = motion(hero, stack_of(hero).result)
    stack_of(hero).splices[0].mute = True
    OPERATORS.splice_build()
    assert changed_bones(hero, base, stack_of(hero).result) == {"neck", "head"}
    stack_of(hero).splices[1].mute = True
    OPERATORS.splice_build()
    assert changed_bones(hero, base, stack_of(hero).result) == set()
    for item in stack_of(hero).splices:
        item.mute = False
    OPERATORS.splice_build()
    again = motion(hero, stack_of(hero).result)
    assert all(np.array_equal(again[name], whole[name]) for name in whole)


def test_of_two_splices_on_one_part_the_lower_one_wins() -> None:
    hero, source = hero_and_source()
    third = make_humanoid("Third")
    give_motion(third, 9)
    select(source, hero)
    OPERATORS.splice_add()
    select(third, hero)
    OPERATORS.splice_add()
    for item in stack_of(hero).splices:
        item.ease_in = item.ease_out = 0.0
    OPERATORS.splice_build()
    both = motion(hero, stack_of(hero).result)
    OPERATORS.splice_move(direction="UP")
    OPERATORS.splice_build()
    turned = motion(hero, stack_of(hero).result)
    stack_of(hero).splices[0].mute = True
    OPERATORS.splice_build()
    alone = motion(hero, stack_of(hero).result)
    assert stack_of(hero).splices[1].source == source
    assert angle_between(turned["forearm.R"], alone["forearm.R"]).max() < 10 * ROUNDING
    assert angle_between(both["forearm.R"], turned["forearm.R"]).max() > 0.05


def test_the_result_says_what_it_was_made_from() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    note = json.loads(stack_of(hero).result[MARK]["note"])
    assert note["base"] == "Hero Motion"
    assert note["splices"][0]["action"] == "Source Motion"
    assert note["splices"][0]["source"] == "Source"
    assert note["splices"][0]["part"] == "RIGHT_ARM"


def test_a_splice_that_changes_nothing_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_add(part="HEAD")
    OPERATORS.splice_build()
    assert "Warning" not in capfd.readouterr().out
    late, ended = stack_of(hero).splices
    late.base_start = 42.5
    ended.splice_start = 60.0
    assert ended.after == "STOP"
    for build in (OPERATORS.splice_build, OPERATORS.splice_drag_timing):
        build()
        told = capfd.readouterr().out
        assert (
            "Warning: 'Right Arm: Source Motion' changes nothing: it begins at frame 42.5, and the "
            "base has frames 1 to 41." in told
        )
        assert (
            "Warning: 'Head: Source Motion' changes nothing: it begins at frame 60 of its clip, "
            "which has frames 1 to 41." in told
        )
    ended.mute = True
    OPERATORS.splice_build()
    assert "Head" not in capfd.readouterr().out


def test_what_holds_spliced_bones_back_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    hero, _ = hero_and_source()
    bones = hero.pose.bones
    held = bones["forearm.R"].constraints.new("IK")
    bones["hand.R"].constraints.new("COPY_ROTATION").target = hero
    bones["foot.L"].constraints.new("COPY_ROTATION").target = hero
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    told = capfd.readouterr().out
    assert "Warning: Constraints or drivers act on 'forearm.R', 'hand.R' after their keys" in told
    assert "foot.L" not in told
    held.mute = True
    bones["hand.R"].constraints[0].influence = 0.0
    OPERATORS.splice_build()
    assert "Warning" not in capfd.readouterr().out
    OPERATORS.splice_add(part="CHAIN", bone="thigh.L")
    OPERATORS.splice_build()
    assert "act on 'foot.L' after its keys" in capfd.readouterr().out


def test_landmarks_that_were_found_stand_in_the_table_afterwards() -> None:
    hero, source = hero_and_source()
    assert not stack_of(hero).landmarks.hips
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    assert stack_of(hero).landmarks.upper_arm_r == "upper_arm.R"
    # The source is not changed.
    assert not stack_of(source).landmarks.hips


def test_landmarks_of_the_table_count() -> None:
    hero, _ = hero_and_source()
    OPERATORS.map_skeleton()
    base = hero.animation_data.action
    table = stack_of(hero).landmarks
    for side, other in (("l", "r"), ("r", "l")):
        for part in ("clavicle", "upper_arm", "forearm", "hand"):
            setattr(table, f"{part}_{side}", f"{part}.{other.upper()}")
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    changed = changed_bones(hero, base, stack_of(hero).result)
    assert changed == {"clavicle.L", "upper_arm.L", "forearm.L", "hand.L"}


@pytest.mark.one_blender
def test_an_arm_of_an_octopus_goes_onto_another_octopus() -> None:
    swimmer, walker = make_octopus("Swimmer"), make_octopus("Walker")
    swimmer.octo_motion.locomotion.gait = "swim"
    for each in (swimmer, walker):
        give_route(each)
        generate(each)
    base = walker.animation_data.action
    select(swimmer, walker)
    OPERATORS.splice_add(part="CHAIN", bone="Arm1_1.L")
    OPERATORS.splice_build()
    result = stack_of(walker).result
    changed = changed_bones(walker, base, result)
    assert changed <= {f"Arm1_{number}.L" for number in range(1, 7)}
    assert len(changed) >= 4
    # Generating anew makes the base anew, not what was spliced.
    before = keys(result)
    generate(walker)
    assert walker.octo_motion.locomotion.result == base == stack_of(walker).base
    assert all(np.array_equal(values, keys(result)[path]) for path, values in before.items())


def test_arms_that_stretch_go_on_stretching_and_bring_their_stretch_along() -> None:
    one, other = make_octopus("One"), make_octopus("Other")
    for number, each in enumerate((one, other)):
        give_route(each)
        # All that are selected would move.
        select(each)
        generate(each)
        assert each.data.bones["Arm1_2.L"].parent == each.data.bones["Arm1_1.L"]
        for bone in each.data.bones:
            bone.inherit_scale = "ALIGNED"
        for name in ("Arm1_1.L", "Arm2_1.L"):
            stretched = each.pose.bones[name]
            for frame, length in ((1, 1.0), (20, 1.3 + 0.2 * number), (40, 1.0)):
                stretched.scale = (1.0, length, 1.0)
                stretched.keyframe_insert("scale", frame=frame)
    base = other.animation_data.action
    select(one, other)
    OPERATORS.splice_add(part="CHAIN", bone="Arm1_1.L")
    item = stack_of(other).splices[0]
    item.ease_in = item.ease_out = 0.0
    OPERATORS.splice_build()
    scene: Any = bpy.context.scene
    scene.frame_set(20)
    assert other.pose.bones["Arm1_1.L"].scale.y == pytest.approx(1.3, abs=1e-4)
    assert other.pose.bones["Arm2_1.L"].scale.y == pytest.approx(1.5, abs=1e-4)
    assert other.pose.bones["Arm2_1.R"].scale.y == 1.0
    # And while it is dragged.
    shown = {bone.name: np.array(bone.matrix_basis) for bone in other.pose.bones}
    session = DragSession(prepare_splices(other), 0, scene)
    session.show()
    assert_same_pose(shown, poses(other))
    session.tear_down()
    assert stack_of(other).base == base


def test_legs_bring_their_travel_if_asked() -> None:
    hero, _ = hero_and_source()
    base = hero.animation_data.action
    OPERATORS.splice_add(part="LEGS")
    stack_of(hero).splices[0].with_travel = True
    OPERATORS.splice_build()
    assert "hips" in changed_bones(hero, base, stack_of(hero).result)
    # It means nothing for an arm, and does not get in its way.
    stack_of(hero).splices[0].part = "LEFT_ARM"
    OPERATORS.splice_build()
    assert "hips" not in changed_bones(hero, base, stack_of(hero).result)


# --- Undo ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "properties"),
    [
        ("splice_add", {"part": "HEAD"}),
        ("splice_remove", {}),
        ("splice_move", {"direction": "UP"}),
        ("splice_build", {}),
        ("splice_suggest_timing", {}),
        ("splice_drag_timing", {"base_start": 12.0}),
    ],
)
def test_each_button_is_taken_back_in_one_step(name: str, properties: dict[str, Any]) -> None:
    hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_add(part="LEFT_ARM")
    bpy.ops.ed.undo_push(message="ready")
    before = snapshot()
    assert click(name, **properties) == {"FINISHED"}
    assert snapshot() != before
    bpy.ops.ed.undo()
    assert snapshot() == before
    assert bpy.data.objects["Hero"].octo_motion.splicing.splices[1].part == "LEFT_ARM"


# --- Timing --------------------------------------------------------------------------------------


def test_the_suggested_timing_is_where_the_clip_was_cut_from() -> None:
    hero = make_humanoid("Hero")
    give_motion(hero, 2, frames=80, name="Long")
    whole = read_clip(hero)
    piece = make_humanoid("Piece")
    part = slice(14, 44)
    cut = Clip(
        "Cut",
        whole.skeleton,
        whole.frames[part],
        whole.rate,
        whole.rotations[part],
        whole.locations[part],
        whole.world[part],
    )
    write_clip(piece, cut)
    select(piece, hero)
    OPERATORS.splice_add()
    OPERATORS.splice_suggest_timing()
    (item,) = stack_of(hero).splices
    # The made-up motion repeats itself after 25 frames.
    assert (item.base_start - 15.0) % 25.0 == 0.0
    assert item.splice_start == 15.0
    assert stack_of(hero).result is not None


def test_the_next_best_timings_can_be_chosen() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    starts = []
    for choice in (1, 2, 1):
        OPERATORS.splice_suggest_timing(choice=choice)
        starts.append(stack_of(hero).splices[0].base_start)
    assert starts[0] == starts[2]
    assert starts[0] != starts[1]


def test_scripts_set_the_timing_with_the_drag_operator() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_drag_timing(base_start=8.0)
    (item,) = stack_of(hero).splices
    assert (item.base_start, item.splice_start) == (8.0, 1.0)
    OPERATORS.splice_drag_timing(splice_start=4.0)
    assert (item.base_start, item.splice_start) == (8.0, 4.0)
    built = motion(hero, stack_of(hero).result)
    OPERATORS.splice_build()
    again = motion(hero, stack_of(hero).result)
    assert all(np.array_equal(again[name], built[name]) for name in built)


def test_dragging_moves_by_whole_frames_and_with_shift_finely() -> None:
    drag = TimingDrag(10.0, 3.0)
    drag.tick(34.0)
    assert drag.starts == (13.0, 3.0)
    drag.tick(4.0)
    assert drag.starts == (14.0, 3.0)
    drag.tick(25.0, fine=True)
    assert drag.starts == pytest.approx((14.05, 3.0))
    drag.tick(0.0)
    assert drag.starts == pytest.approx((14.05, 3.0))


def test_dragging_the_other_start_leaves_the_first_where_it_is() -> None:
    drag = TimingDrag(10.0, 3.0)
    drag.tick(26.0)
    drag.switch()
    drag.tick(-50.0)
    assert drag.starts == (13.0, -2.0)
    assert "▸ Clip Start: -2" in drag.header()
    drag.switch()
    drag.tick(10.0)
    assert drag.starts == (14.0, -2.0)


def test_a_typed_frame_counts_until_it_is_taken_back() -> None:
    drag = TimingDrag(10.0, 3.0)
    for each in "2,5":
        drag.type(each)
    assert drag.starts == (2.5, 3.0)
    assert "[2.5|]" in drag.header()
    drag.tick(100.0)
    assert drag.starts == (2.5, 3.0)
    drag.type("-")
    assert drag.starts == (-2.5, 3.0)
    drag.type("-")
    assert drag.starts == (2.5, 3.0)
    drag.type("x")
    assert drag.starts == (2.5, 3.0)
    for _ in "2.5":
        drag.type("")
    assert drag.starts == (10.0, 3.0)
    drag.type("-")
    assert drag.starts == (10.0, 3.0)


def test_a_splice_that_is_dragged_off_its_base_says_so() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    first, last = hero.animation_data.action.frame_range
    session = DragSession(prepare_splices(hero), 0, bpy.context.scene)
    assert "base (" not in session.header()
    strip = session.strip()
    assert strip is not None
    assert strip.start == session.drag.starts[0]
    frames, acting = strip.outline().T
    assert (np.diff(frames) >= 0.0).all()
    assert acting.tolist() == [0.0, 1.0, 1.0, 0.0]
    session.drag.tick((last - first + 100.0) / PER_PIXEL)
    assert f"The splice lies after its base (frames {first:g} to {last:g})" in session.header()
    session.tear_down()
    assert session.strip() is None


def test_mouse_and_keys_do_what_the_status_bar_says() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    bpy.context.scene.frame_set(8)
    session = DragSession(prepare_splices(hero), 0, bpy.context.scene)
    take = OCTO_MOTION_OT_splice_drag_timing._take
    operator: Any = SimpleNamespace(_mouse=500.0)

    def event(kind: str, value: str = "PRESS", **more: Any) -> None:
        given = {"mouse_x": 0, "shift": False, "unicode": ""} | more
        take(operator, session, cast("Any", SimpleNamespace(type=kind, value=value, **given)))

    event("MOUSEMOVE", "NOTHING", mouse_x=540)
    assert session.drag.starts == (5.0, 1.0)
    event("MOUSEMOVE", "NOTHING", mouse_x=545, shift=True)
    assert session.drag.starts == pytest.approx((5.05, 1.0))
    event("TAB")
    event("TAB", "RELEASE")
    for key in "12":
        event("ONE", unicode=key)
        event("ONE", "RELEASE", unicode=key)
    assert session.drag.starts == pytest.approx((5.05, 12.0))
    event("BACK_SPACE")
    assert session.drag.starts == pytest.approx((5.05, 1.0))
    event("RIGHT_ARROW")
    event("RIGHT_ARROW", "RELEASE")
    assert bpy.context.scene.frame_current == 9
    session.tear_down()


def poses(armature: Any) -> dict[str, np.ndarray]:
    return {bone.name: np.array(bone.matrix_basis) for bone in armature.pose.bones}


def assert_same_pose(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    for name, matrix in one.items():
        assert np.abs(matrix - other[name]).max() < ROUNDING, name


@pytest.mark.one_blender
@pytest.mark.parametrize("part", ["RIGHT_ARM", "TRUNK", "LEGS"])
@pytest.mark.parametrize("travel", [False, True])
def test_while_dragging_the_body_is_posed_as_it_will_be(part: str, travel: bool) -> None:  # noqa: FBT001
    hero, _ = hero_and_source()
    OPERATORS.splice_add(part=part)
    stack_of(hero).splices[0].with_travel = travel
    OPERATORS.splice_add(part="HEAD")
    bpy.context.scene.frame_set(21)
    session = DragSession(prepare_splices(hero), 0, bpy.context.scene)
    session.drag.tick(52.0)
    session.show()
    shown = poses(hero)
    starts = session.drag.starts
    session.tear_down()
    stack_of(hero).active_splice = 0
    OPERATORS.splice_drag_timing(base_start=starts[0], splice_start=starts[1])
    bpy.context.scene.frame_set(21)
    assert starts == (6.0, 1.0)
    assert_same_pose(shown, poses(hero))


def test_while_dragging_other_frames_can_be_looked_at() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    scene = bpy.context.scene
    followers = len(bpy.app.handlers.frame_change_post)
    scene.frame_set(30)
    later = poses(hero)
    scene.frame_set(4)
    session = DragSession(prepare_splices(hero), 0, scene)
    session.drag.tick(60.0)
    session.show()
    session.step(26)
    shown = poses(hero)
    starts = session.drag.starts
    session.tear_down()
    assert len(bpy.app.handlers.frame_change_post) == followers
    assert_same_pose(later, poses(hero))
    OPERATORS.splice_drag_timing(base_start=starts[0], splice_start=starts[1])
    scene.frame_set(30)
    assert_same_pose(shown, poses(hero))
    assert np.abs(shown["forearm.R"] - later["forearm.R"]).max() > 0.05


def test_a_drag_that_is_given_up_leaves_everything_as_it_was() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    hero.pose.bones["head"].rotation_quaternion = (0.9, 0.1, 0.3, 0.0)
    before = snapshot()
    session = DragSession(prepare_splices(hero), 0, bpy.context.scene)
    session.drag.tick(100.0)
    session.show()
    assert snapshot() != before
    session.tear_down()
    assert snapshot() == before
    session.show()
    session.tear_down()
    assert snapshot() == before


def test_a_drag_whose_armature_is_gone_says_so_and_ends() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    session = DragSession(prepare_splices(hero), 0, bpy.context.scene)
    bpy.data.objects.remove(hero)
    with pytest.raises(OctoMotionError, match="'Hero' is gone"):
        session.show()
    session.tear_down()


# --- Errors --------------------------------------------------------------------------------------


def assert_refused(message: str, name: str, /, **properties: Any) -> None:
    """The operator says what is wrong, and nothing has changed."""
    before = snapshot()
    with pytest.raises(RuntimeError, match=message):
        getattr(OPERATORS, name)(**properties)
    assert snapshot() == before


def test_adding_says_what_is_missing() -> None:
    hero, source = hero_and_source()
    select(hero)
    assert_refused("No source is selected", "splice_add")
    assert_refused("There is no armature 'Nobody'", "splice_add", source="Nobody")
    assert_refused("There is no action 'Nothing'", "splice_add", action="Nothing")
    assert_refused("'Hero' is both base and source", "splice_add", source="Hero")
    assert_refused("It is not said which chain", "splice_add", part="CHAIN", source="Source")
    third = make_humanoid("Third")
    select(third, hero)
    assert_refused("The source 'Third' has no action", "splice_add")
    select(source, third, hero)
    assert_refused("2 other armatures are selected", "splice_add")
    select(source, third)
    assert_refused("'Third' has no action to splice onto", "splice_add")
    bpy.data.actions.new("Empty")
    select(hero)
    assert_refused("Action 'Empty' is empty", "splice_add", action="Empty")
    pose = give_motion(third, 4, frames=2, name="Pose")
    pose.use_frame_range, pose.frame_start, pose.frame_end = True, 1, 1
    select(third, hero)
    assert_refused("only one frame", "splice_add")


def test_building_says_what_is_missing() -> None:
    hero, source = hero_and_source()
    assert_refused("'Hero' has no splices", "splice_build")
    OPERATORS.splice_add()
    stack = stack_of(hero)
    item = stack.splices[0]
    base = stack.base
    stack.base = None
    assert_refused("'Hero' has no base action, or it is gone", "splice_build")
    stack.base, stack.base_slot = base, "OBOther"
    assert_refused("has no slot 'Other'", "splice_build")
    stack.base_slot = ""
    item.part = "CHAIN"
    assert_refused("has no first bone", "splice_build")
    item.bone = "tail"
    assert_refused("'Hero' has no bone 'tail'", "splice_build")
    item.bone, item.source_bone = "head", "tail"
    assert_refused("'Source' has no bone 'tail'", "splice_build")
    item.part = "RIGHT_ARM"
    item.mute = True
    assert_refused("muted", "splice_suggest_timing")
    assert_refused("muted", "splice_drag_timing")
    item.mute = False
    item.action = None
    assert_refused("'Right Arm: .*: Its action is gone", "splice_build")
    item.action = source.animation_data.action
    bpy.data.objects.remove(source)
    assert_refused("'Right Arm: .*: Its source armature is gone", "splice_build")
    item.mute = True
    assert OPERATORS.splice_build() == {"FINISHED"}


def _without_action(item: Any, _source: Any) -> None:
    item.action = None


def _of_another_time(item: Any, _source: Any) -> None:
    item.length = float("nan")


def _without_landmark(_item: Any, source: Any) -> None:
    stack_of(source).landmarks.hand_l = "claw"


def _a_chain_of_nothing(item: Any, _source: Any) -> None:
    item.part = "CHAIN"


@pytest.mark.one_blender
@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (_without_action, "Its action is gone"),
        (lambda item, _: setattr(item, "source", None), "Its source armature is gone"),
        (_of_another_time, "The timing has values that are no numbers"),
        (_without_landmark, "'Source': There is no bone 'claw'"),
        (_a_chain_of_nothing, "Its chain has no first bone"),
    ],
)
@pytest.mark.parametrize(
    "button", ["splice_build", "splice_drag_timing", "splice_suggest_timing", "drag"]
)
def test_what_cannot_be_built_is_named_by_the_splice_of_the_list_which_is_selected(
    button: str, spoil: Callable[[Any, Any], None], reason: str
) -> None:
    """Beside a muted splice and a sound one, the one that is spoilt: it is called Throw."""
    hero, source = hero_and_source()
    for part in ("HEAD", "RIGHT_ARM", "LEFT_ARM"):
        OPERATORS.splice_add(part=part)
    select(source)
    OPERATORS.map_skeleton()
    select(hero)
    stack = stack_of(hero)
    stack.splices[0].mute = True
    stack.splices[2].name = "Throw"
    stack.active_splice = 1
    spoil(stack.splices[2], source)
    expected = rf"'Throw' \(3\): {reason}"
    if button == "drag":
        operator = DragOperator()
        event: Any = SimpleNamespace(mouse_x=0)
        assert operator.invoke(bpy.context, event) == {"CANCELLED"}
        assert re.match(expected, operator.reports[0])
    else:
        with pytest.raises(RuntimeError, match=expected):
            getattr(OPERATORS, button)()
    assert stack.active_splice == 2
    assert hero.animation_data.action == stack.base
    assert stack.result is None


class DragOperator:
    """The operator's methods on a plain object: Blender makes real ones only with a window."""

    _session = None

    def __init__(self) -> None:
        self.reports: list[str] = []

    def report(self, _kind: set[str], text: str) -> None:
        self.reports.append(text)

    def __getattr__(self, name: str) -> Any:
        found = getattr(OCTO_MOTION_OT_splice_drag_timing, name)
        return found.__get__(self) if callable(found) else found


def test_a_source_that_is_deleted_from_the_scene_serves_all_the_same() -> None:
    _, source = hero_and_source()
    OPERATORS.splice_add()
    bpy.context.scene.collection.objects.unlink(source)
    assert OPERATORS.splice_build() == {"FINISHED"}


def test_a_body_without_landmarks_is_named_with_what_to_do() -> None:
    octopus = make_octopus()
    give_route(octopus)
    generate(octopus)
    hero = make_humanoid("Hero")
    give_motion(hero, 2)
    select(octopus, hero)
    OPERATORS.splice_add()
    assert_refused("'Octopus' has no landmarks.*Find Landmarks", "splice_build")


def test_a_missing_landmark_is_named_with_whose_it_is() -> None:
    hero, source = hero_and_source()
    OPERATORS.splice_add(part="HEAD")
    assert OPERATORS.splice_build() == {"FINISHED"}
    select(source)
    OPERATORS.map_skeleton()
    stack_of(source).landmarks.chest = "no such bone"
    select(hero)
    assert_refused("'Source': There is no bone 'no such bone'", "splice_build")


def test_a_limb_that_is_no_chain_is_told_with_what_helps() -> None:
    hero, source = hero_and_source()
    OPERATORS.splice_add()
    select(source)
    OPERATORS.map_skeleton()
    stack_of(source).landmarks.hand_r = "hand.L"
    select(hero)
    assert_refused("'Source': 'hand.L' does not hang on .*bake its motion", "splice_build")


def test_hips_that_are_fixed_to_their_parent_cannot_travel() -> None:
    hero, _ = hero_and_source()
    bpy.ops.object.mode_set(mode="EDIT")
    hips = hero.data.edit_bones["hips"]
    root = hero.data.edit_bones.new("root")
    root.head, root.tail = (0.0, 0.3, 0.0), hips.head
    hips.parent, hips.use_connect = root, True
    bpy.ops.object.mode_set(mode="OBJECT")
    OPERATORS.splice_add(part="LEGS")
    OPERATORS.splice_build()
    stack_of(hero).splices[0].with_travel = True
    assert_refused("'hips' cannot travel: it is connected to 'root'", "splice_build")


@pytest.mark.parametrize("mixed", [("ADD", 1.0), ("REPLACE", 0.5)])
def test_a_base_that_would_be_mixed_with_its_tracks_twice_is_told(mixed: tuple[Any, float]) -> None:
    hero, _ = hero_and_source()
    base = hero.animation_data.action
    layer = give_motion(hero, 9, name="Layer")
    data = hero.animation_data
    track = data.nla_tracks.new()
    track.strips.new("Layer", 1, layer).action_slot = layer.slots[0]
    data.action, data.action_slot = base, base.slots[0]
    OPERATORS.splice_add(part="HEAD")
    stack_of(hero).visual = True

    def shown() -> np.ndarray:
        bpy.context.scene.frame_set(11)
        return np.array(hero.pose.bones["foot.L"].matrix)

    before = shown()
    OPERATORS.splice_build()
    np.testing.assert_allclose(shown(), before, atol=1e-5)
    data.action, data.action_slot = base, base.slots[0]
    data.action_blend_type, data.action_influence = mixed
    assert_refused("mixed with the NLA tracks of 'Hero' twice", "splice_build")
    track.mute = True
    OPERATORS.splice_build()


def test_a_clip_of_no_use_for_timing_is_told() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    stack_of(hero).splices[0].splice_start = 1000.0
    assert_refused("There is no moment", "splice_suggest_timing")


def link_both(library: str) -> None:
    libraries: Any = bpy.data.libraries
    with libraries.load(library, link=True) as (_, into):
        into.objects = ["Hero", "Source"]
    for each in into.objects:
        bpy.context.scene.collection.objects.link(each)


def test_a_linked_armature_is_read_only(tmp_path: Path) -> None:
    hero_and_source()
    OPERATORS.splice_add()
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    link_both(library)
    hero = bpy.data.objects["Hero"]
    select(hero)
    assert_refused("is read-only here", "splice_build")


def test_a_library_override_adds_splices_of_its_own_and_keeps_them(tmp_path: Path) -> None:
    hero_and_source()
    OPERATORS.splice_add()
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    link_both(library)
    linked = bpy.data.objects["Hero"]
    hero: Any = linked.override_create(remap_local_usages=True)
    hero.override_library.is_system_override = False
    select(bpy.data.objects["Source"], hero)
    assert OPERATORS.splice_add(part="HEAD") == {"FINISHED"}
    assert OPERATORS.splice_build() == {"FINISHED"}
    assert [each.part for each in stack_of(hero).splices] == ["RIGHT_ARM", "HEAD"]
    stack_of(hero).active_splice = 0
    assert_refused("is in the linked file and cannot be removed", "splice_remove")
    assert_refused("is in the linked file, where the order", "splice_move", direction="DOWN")
    saved = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=saved)
    bpy.ops.wm.open_mainfile(filepath=saved)
    hero = next(each for each in bpy.data.objects if each.name == "Hero" and not each.library)
    assert [each.part for each in stack_of(hero).splices] == ["RIGHT_ARM", "HEAD"]
    assert hero.animation_data.action == stack_of(hero).result
    select(hero)
    assert OPERATORS.splice_build() == {"FINISHED"}


# --- The panel -----------------------------------------------------------------------------------


def drawn() -> dict[str, list[str]]:
    found = {}
    for panel in splice_panels.CLASSES:
        kept: Any = panel
        if not kept.poll(bpy.context):
            continue
        layout = Layout()
        stand_in = SimpleNamespace(layout=layout, show=None)
        stand_in.show = kept.show.__get__(stand_in)
        stand_in.settings_of = kept.settings_of
        kept.draw(stand_in, bpy.context)
        found[kept.__name__.removeprefix("OCTO_MOTION_PT_")] = layout.drawn
    return found


def test_the_panel_is_there_for_armatures_alone_and_its_parts_are_closed_at_first() -> None:
    assert drawn() == {}
    hero, _ = hero_and_source()
    assert set(drawn()) == {"splicing", "retarget", "landmarks"}
    OPERATORS.splice_add()
    assert set(drawn()) == {"splicing", "splice", "splice_timing", "retarget", "landmarks"}
    tool, *parts = splice_panels.CLASSES
    assert not tool.bl_options
    assert all(panel.bl_options == {"DEFAULT_CLOSED"} for panel in parts)
    assert "with_travel" not in drawn()["splice"]
    assert "with_clavicle" in drawn()["splice"]
    stack_of(hero).splices[0].part = "LEGS"
    assert {"with_travel", "seen_from"} <= set(drawn()["splice"])
    assert "with_clavicle" not in drawn()["splice"]
    stack_of(hero).splices[0].part = "CHAIN"
    assert {"bone", "source_bone"} <= set(drawn()["splice"])


def test_the_panel_shows_the_result_and_what_is_gone() -> None:
    hero, source = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    assert drawn()["splicing"][-1] == "Hero Motion Spliced"
    bpy.context.scene.collection.objects.unlink(source)
    assert "Deleted, kept for this splice" in drawn()["splice"]
    bpy.data.objects.remove(source)
    assert "Its source is gone: choose another" in drawn()["splice"]
    assert stack_of(hero).splices[0].source is None


# --- The source's own experiment ------------------------------------------------------------------


def import_three(shared_data: SharedData) -> tuple[Any, Any, Any]:
    names = ["avatar_walk.bvh", "avatar_throw_R.bvh", "avatar_punch_L.bvh"]
    folder = shared_data(f"secondlife/{names[0]}").parent
    OPERATORS.import_clips(directory=str(folder), files=[{"name": each} for each in names])
    walk, throw, punch = (bpy.data.objects[each.removesuffix(".bvh")] for each in names)
    return walk, throw, punch


@pytest.mark.parametrize("punch_start", [2.0, 9.0])
def test_a_walk_gets_a_turning_right_arm_and_then_a_left_punch(
    shared_data: SharedData, punch_start: float
) -> None:
    walk, throw, punch = import_three(shared_data)
    base = walk.animation_data.action
    select(throw, walk)
    assert OPERATORS.splice_add() == {"FINISHED"}
    assert OPERATORS.splice_build() == {"FINISHED"}
    right = {"rCollar", "rShldr", "rForeArm", "rHand"}
    changed = changed_bones(walk, base, stack_of(walk).result)
    assert {"rShldr", "rForeArm"} <= changed <= right
    select(punch, walk)
    OPERATORS.splice_add(part="LEFT_ARM")
    OPERATORS.splice_drag_timing(base_start=punch_start)
    result = stack_of(walk).result
    left = {name.replace("r", "l", 1) for name in right}
    changed = changed_bones(walk, base, result)
    assert {"rShldr", "rForeArm", "lShldr", "lForeArm"} <= changed <= right | left
    # In the middle of the splice the left elbow bends as the punch does at that time.
    ours, theirs = read_clip(walk, result), read_clip(punch)
    bone = ours.skeleton.index["lForeArm"]
    frame = punch_start + 8.0
    row = int(np.flatnonzero(ours.frames == frame)[0])
    moment = int(np.flatnonzero(theirs.frames == 1.0 + 8.0)[0])
    apart = angle_between(ours.rotations[row, bone], theirs.rotations[moment, bone])
    assert float(apart) < 1e-3
    # Before it begins, the walk is as it was.
    before = read_clip(walk, base)
    early = before.frames < punch_start
    rows = slice(0, int(early.sum()))
    same = angle_between(ours.rotations[rows, bone], before.rotations[rows, bone])
    assert same.size == 0 or same.max() < 10 * ROUNDING


def test_no_error_of_the_experiment_is_hidden(shared_data: SharedData) -> None:
    walk, throw, _ = import_three(shared_data)
    select(throw, walk)
    OPERATORS.splice_add()
    stack_of(walk).splices[0].action = None
    with pytest.raises(ClipError, match="is gone, or was never chosen"):
        prepare_splices(walk)
