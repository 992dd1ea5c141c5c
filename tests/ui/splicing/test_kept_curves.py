# SPDX-License-Identifier: GPL-3.0-or-later
"""What is not spliced stays as it was: keys, handles, interpolation; between frames as well."""

from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import is_edited
from tests.ui.splicing.test_splicing import (
    OPERATORS,
    give_motion,
    hero_and_source,
    make_humanoid,
    select,
    stack_of,
)

pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")

SharedData = Callable[[str], Path]
MODES = ("QUATERNION", "XYZ", "ZYX", "AXIS_ANGLE", "YXZ")
KEYED = ("co", "handle_left", "handle_right")
KINDS = ("interpolation", "easing", "handle_left_type", "handle_right_type", "type")
ARM = {"clavicle.R", "upper_arm.R", "forearm.R", "hand.R"}


def channelbag(action: Any) -> Any:
    return action.layers[0].strips[0].channelbags[0]


def sparse_motion(armature: Any, interpolation: str = "BEZIER", name: str = "Sparse") -> Any:
    """Three keys on every bone, in all rotation modes, of an artist's kind: eased by hand."""
    random = np.random.default_rng(7)
    armature.animation_data_clear()
    for number, bone in enumerate(armature.pose.bones):
        bone.rotation_mode = MODES[number % len(MODES)]
        path = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}.get(
            bone.rotation_mode, "rotation_euler"
        )
        for frame in (1.0, 15.5, 41.0):
            values = 0.3 * random.normal(size=len(getattr(bone, path)))
            if path != "rotation_euler":
                values[0] += 1.0
            setattr(bone, path, values)
            bone.keyframe_insert(path, frame=frame)
    armature.location = (0.1, 0.0, 0.0)
    armature.keyframe_insert("location", frame=1)
    action = armature.animation_data.action
    action.name = name
    for curve in channelbag(action).fcurves:
        for key in curve.keyframe_points:
            key.interpolation = interpolation
            key.handle_left_type = key.handle_right_type = "FREE"
            key.handle_left = key.co.x - 4.5, key.co.y + 0.1 * random.normal()
            key.handle_right = key.co.x + 6.0, key.co.y + 0.1 * random.normal()
        curve.update()
    return action


def curves(action: Any, bones: Iterable[str] | None = None) -> dict[tuple[str, int], Any]:
    """Curves by property and component: all, or of some bones."""
    named = None if bones is None else tuple(f'pose.bones["{each}"]' for each in bones)
    return {
        (curve.data_path, curve.array_index): curve
        for curve in channelbag(action).fcurves
        if named is None or curve.data_path.startswith(named)
    }


def told(curve: Any, rows: Iterable[int] | None = None) -> list[Any]:
    """All that an artist sees of a curve's keys."""
    keys = [curve.keyframe_points[row] for row in rows] if rows else list(curve.keyframe_points)
    return [
        [tuple(getattr(key, name)) for name in KEYED] + [getattr(key, name) for name in KINDS]
        for key in keys
    ]


def played(armature: Any, frames: Iterable[float]) -> np.ndarray:
    """(frames, bones, 2, 3) where heads and tails are, as Blender plays them."""
    found = []
    for frame in frames:
        whole = int(np.floor(frame))
        bpy.context.scene.frame_set(whole, subframe=float(frame - whole))
        found.append(
            [
                [armature.matrix_world @ bone.head, armature.matrix_world @ bone.tail]
                for bone in armature.pose.bones
            ]
        )
    return np.array(found)


def assign(armature: Any, action: Any) -> None:
    armature.animation_data.action = action
    armature.animation_data.action_slot = action.slots[0]


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Largest distance, as a share of the body's height."""
    return float(np.linalg.norm(one - other, axis=-1).max() / np.ptp(one[0, ..., 2]))


def sparse_hero(interpolation: str = "BEZIER") -> tuple[Any, Any]:
    """A body with few keys, ready to get a part of another one from frame 10 to 26."""
    hero, _ = hero_and_source()
    base = sparse_motion(hero, interpolation)
    OPERATORS.splice_add()
    (item,) = stack_of(hero).splices
    item.base_start, item.length = 10.0, 16.0
    item.ease_in = item.ease_out = 4.0
    return hero, base


def test_bones_outside_the_part_keep_their_three_keys_with_handles_and_interpolation() -> None:
    hero, base = sparse_hero()
    noise = curves(base)['pose.bones["head"].rotation_euler', 1].modifiers.new("NOISE")
    noise.strength, noise.scale, noise.use_restricted_range = 0.25, 3.0, True
    noise.frame_start, noise.frame_end = 3.0, 9.0
    curves(base)["location", 0].extrapolation = "LINEAR"
    before = {place: told(curve) for place, curve in curves(base).items()}
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert result != base
    spliced = set(curves(result, ARM))
    for place, curve in curves(result).items():
        if place not in spliced:
            assert told(curve) == before[place]
            assert len(curve.keyframe_points) == (1 if place[0] == "location" else 3)
    (copied,) = curves(result)['pose.bones["head"].rotation_euler', 1].modifiers
    assert (copied.type, copied.strength, copied.scale) == ("NOISE", 0.25, 3.0)
    assert (copied.frame_start, copied.frame_end) == (3.0, 9.0)
    assert curves(result)["location", 0].extrapolation == "LINEAR"
    assert {each.group.name for each in curves(result).values()} == {
        each.group.name for each in curves(base).values()
    }
    assert not is_edited(result)
    assert {place: told(curve) for place, curve in curves(base).items()} == before


@pytest.mark.parametrize("interpolation", ["BEZIER", "LINEAR", "CONSTANT", "BACK", "SINE"])
def test_bones_of_the_part_play_as_before_outside_the_splice_and_keep_their_keys(
    interpolation: str,
) -> None:
    hero, base = sparse_hero(interpolation)
    outside = [*np.arange(0.0, 10.01, 0.125), *np.arange(26.0, 42.01, 0.125)]
    before = played(hero, outside)
    keys = {place: told(curve) for place, curve in curves(base, ARM).items()}
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert apart(before, played(hero, outside)) < (
        1e-4 if interpolation in ("BACK", "SINE") else 3e-6
    )
    for place, curve in curves(result, ARM).items():
        ends = told(curve, (0, -1))
        # Number, place and value; the handles on the outer sides; how they go on.
        for now, then in zip(ends, (keys[place][0], keys[place][-1]), strict=True):
            assert now[0] == then[0]
        assert ends[0][1] == keys[place][0][1]
        assert ends[-1][2] == keys[place][-1][2]
        if interpolation in ("BEZIER", "LINEAR", "CONSTANT"):
            assert ends[0][3] == interpolation
            frames = [key.co.x for key in curve.keyframe_points]
            assert [each for each in frames if not 10.0 <= each <= 26.0] == [1.0, 41.0]
        assert 15.5 not in [key.co.x for key in curve.keyframe_points]


def test_automatic_handles_outside_the_splice_stay_where_they_are() -> None:
    hero, base = sparse_hero()
    for curve in curves(base).values():
        curve.auto_smoothing = "CONT_ACCEL"
        for frame in (4.0, 7.0, 30.0, 33.0, 37.0):
            curve.keyframe_points.insert(frame, curve.evaluate(frame) + 0.05 * np.sin(3.0 * frame))
        for key in curve.keyframe_points:
            key.interpolation = "BEZIER"
            key.handle_left_type = key.handle_right_type = "AUTO"
        curve.update()
    outside = [*np.arange(0.0, 10.01, 0.125), *np.arange(26.0, 42.01, 0.125)]
    before = played(hero, outside)
    OPERATORS.splice_build()
    assert apart(before, played(hero, outside)) < 3e-6
    assert not is_edited(hero.animation_data.action)


def test_a_hard_cut_is_one_between_frames_too() -> None:
    hero, base = sparse_hero()
    (item,) = stack_of(hero).splices
    item.ease_in = item.ease_out = 0.0
    outside = [*np.arange(1.0, 9.9, 0.125), *np.arange(26.0625, 41.0, 0.125)]
    before = played(hero, outside)
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert apart(before, played(hero, outside)) < 3e-6
    cut, inside = played(hero, [9.9, 10.0])
    assign(hero, base)
    assert apart(cut[None], played(hero, [9.9])) < 3e-6
    assert apart(inside[None], played(hero, [10.0])) > 0.01
    assert not is_edited(result)


@pytest.mark.parametrize("part", ["RIGHT_ARM", "LEGS", "TRUNK", "HEAD"])
def test_a_part_of_a_motion_onto_itself_leaves_all_its_curves_alone(part: str) -> None:
    hero = make_humanoid("Hero")
    base = sparse_motion(hero)
    select(hero)
    moments = np.arange(1.0, 41.01, 0.5)
    before = played(hero, moments)
    OPERATORS.splice_add(part=part, action=base.name)
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert apart(before, played(hero, moments)) < 1e-5
    assert {place: told(each) for place, each in curves(result).items()} == {
        place: told(each) for place, each in curves(base).items()
    }


def test_between_frames_the_hand_is_where_the_clip_has_it() -> None:
    """Two motions of one body, with keys at other moments: seen from the chest, at half frames."""
    hero = make_humanoid("Hero")
    other = sparse_motion(hero, name="Other")
    for curve in curves(other).values():
        for frame, away in ((6.3, 0.2), (8.9, -0.2), (11.6, 0.2), (23.25, -0.1)):
            curve.keyframe_points.insert(frame, curve.evaluate(frame) + away)
    base = give_motion(hero, 2)
    select(hero)
    OPERATORS.splice_add(action=other.name)
    (item,) = stack_of(hero).splices
    item.base_start, item.splice_start, item.mode = 1.0, 4.0, "EXACT"
    item.ease_in = item.ease_out = 0.0
    OPERATORS.splice_build()
    result = hero.animation_data.action
    moments = np.arange(1.0, 37.0, 0.25)

    def seen(action: Any, frames: np.ndarray) -> np.ndarray:
        assign(hero, action)
        found = []
        for frame in frames:
            whole = int(np.floor(frame))
            bpy.context.scene.frame_set(whole, subframe=float(frame - whole))
            bones = hero.pose.bones
            found.append(bones["chest"].matrix.inverted() @ bones["hand.R"].head)
        return np.array(found)

    height = np.ptp(played(hero, [1.0])[0, ..., 2])
    off = np.linalg.norm(seen(result, moments) - seen(other, moments + 3.0), axis=-1)
    assert off.max() < 1e-3 * height
    assert base.name in bpy.data.actions


def test_curves_that_modifiers_act_on_play_as_before_outside_the_splice() -> None:
    """Noise cannot be cut: those curves get keys for what they play, the others keep theirs."""
    hero, base = sparse_hero()
    place = 'pose.bones["forearm.R"].rotation_quaternion', 1
    found = [each for each in curves(base, {"forearm.R"}) if each[1] == 1]
    noise = curves(base)[found[0]].modifiers.new("NOISE")
    noise.strength, noise.scale = 0.4, 5.0
    outside = [*np.arange(1.0, 10.01, 0.25), *np.arange(26.0, 41.01, 0.25)]
    before = played(hero, outside)
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert apart(before, played(hero, outside)) < 1e-3
    assert len(curves(result)[found[0]].modifiers) == 0
    others = [each for each in curves(result, ARM) if each != found[0]]
    for each in others:
        assert curves(result)[each].keyframe_points[0].co.x == 1.0
        assert curves(result)[each].keyframe_points[1].co.x == 10.0
    assert place[1] == 1


def test_cycles_go_on_where_the_splice_lies_within_a_round() -> None:
    hero, base = sparse_hero()
    for curve in curves(base).values():
        if curve.data_path != "location":
            curve.modifiers.new("CYCLES")
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert all(
        [each.type for each in curve.modifiers] == ["CYCLES"]
        for (path, _), curve in curves(result).items()
        if path != "location"
    )
    first, second = played(hero, [18.0, 18.0 + 40.0])
    assert apart(first[None], second[None]) < 1e-5


def test_a_spin_between_base_and_clip_turns_no_bone_round_where_it_ends() -> None:
    """Of angles that have gone on past whole turns the base's own go on behind the splice."""
    hero, _ = hero_and_source()
    source = stack_of(hero).id_data
    assert source == hero
    spinning: Any = bpy.data.objects["Source"]
    for armature, turns in ((spinning, 2.0), (hero, 0.0)):
        for bone in armature.pose.bones:
            bone.rotation_mode = "XYZ"
        armature.animation_data_clear()
        bone = armature.pose.bones["hand.R"]
        for frame in range(1, 42):
            bone.rotation_euler = (0.2, turns * 2.0 * np.pi * (frame - 1) / 40.0, 0.1)
            bone.keyframe_insert("rotation_euler", frame=frame)
    OPERATORS.splice_add()
    (item,) = stack_of(hero).splices
    item.base_start, item.length = 5.0, 20.0
    outside = np.arange(25.0, 41.01, 0.125)
    before = played(hero, outside)
    OPERATORS.splice_build()
    assert apart(before, played(hero, outside)) < 3e-6
    bones = hero.pose.bones
    turns = []
    for frame in np.arange(1.0, 41.01, 0.125):
        bpy.context.scene.frame_set(int(frame), subframe=float(frame % 1.0))
        turns.append(bones["hand.R"].matrix.to_quaternion())
    steps = [abs(one.dot(other)) for one, other in pairwise(turns)]
    assert min(steps) > np.cos(np.radians(12.0))


def test_what_an_artist_changes_in_a_kept_curve_makes_the_result_theirs() -> None:
    hero, base = sparse_hero()
    curves(base)['pose.bones["head"].rotation_euler', 1].modifiers.new("NOISE")
    OPERATORS.splice_build()
    for change in ("handle", "modifier", "key"):
        first = hero.animation_data.action
        assert not is_edited(first)
        curve = curves(first)['pose.bones["head"].rotation_euler', 1]
        if change == "handle":
            curve.keyframe_points[1].handle_right.y += 0.3
        elif change == "modifier":
            curve.modifiers[0].strength = 0.5
        else:
            curve.keyframe_points[1].co.y += 0.2
        assert is_edited(first)
        OPERATORS.splice_build()
        assert hero.animation_data.action != first
        assert first.use_fake_user


def test_built_again_a_result_follows_what_was_changed_in_its_base() -> None:
    hero, base = sparse_hero()
    OPERATORS.splice_build()
    result = hero.animation_data.action
    head = curves(base)['pose.bones["head"].rotation_euler', 1]
    head.keyframe_points[1].co.y += 0.4
    head.modifiers.new("CYCLES")
    channelbag(base).fcurves.remove(curves(base)["location", 2])
    OPERATORS.splice_build()
    assert hero.animation_data.action == result
    now = curves(result)['pose.bones["head"].rotation_euler', 1]
    assert told(now) == told(curves(base)['pose.bones["head"].rotation_euler', 1])
    assert [each.type for each in now.modifiers] == ["CYCLES"]
    assert ("location", 2) not in curves(result)


@pytest.mark.parametrize("part", ["RIGHT_ARM", "LEGS", "TRUNK", "HEAD"])
def test_a_recorded_walk_onto_itself_plays_the_same_between_frames(
    shared_data: SharedData, part: str
) -> None:
    bpy.context.scene.render.fps = 24
    path = shared_data("secondlife/avatar_walk.bvh")
    bpy.ops.import_anim.bvh(filepath=str(path), update_scene_fps=False, use_fps_scale=True)
    walk: Any = bpy.context.object
    base = walk.animation_data.action
    first, last = base.frame_range
    moments = np.arange(np.ceil(first), np.floor(last), 0.5)
    before = played(walk, moments)
    OPERATORS.splice_add(part=part, action=base.name)
    OPERATORS.splice_build()
    assert walk.animation_data.action != base
    assert apart(before, played(walk, moments)) < 1e-5


def hand_in_chest(armature: Any, names: tuple[str, str], frames: Iterable[float]) -> np.ndarray:
    """(frames, 3) where a hand is, seen from the chest, as Blender plays it."""
    found = []
    for frame in frames:
        whole = int(np.floor(frame))
        bpy.context.scene.frame_set(whole, subframe=float(frame - whole))
        chest, hand = (armature.pose.bones[name] for name in names)
        found.append(chest.matrix.inverted() @ hand.head)
    return np.array(found)


def test_of_a_recording_of_more_frames_per_second_the_hand_is_right_between_frames(
    shared_data: SharedData,
) -> None:
    """120 per second in a scene of 24: most of its keys are between frames."""
    bpy.context.scene.render.fps = 24
    found: list[Any] = []
    for name in ("12_01_walk.bvh", "12_03_walk.bvh"):
        path = shared_data(f"cmu/{name}")
        bpy.ops.import_anim.bvh(filepath=str(path), update_scene_fps=False, use_fps_scale=True)
        found.append(bpy.context.object)
    source, hero = found
    select(source, hero)
    moments = np.arange(2.0, 60.0, 0.25)
    bones = "Spine1", "RightHand"
    wanted = hand_in_chest(source, bones, moments)
    before = hand_in_chest(hero, bones, moments)
    OPERATORS.splice_add(part="RIGHT_ARM", source=source.name)
    (item,) = stack_of(hero).splices
    item.mode, item.base_start, item.splice_start = "EXACT", 1.0, 1.0
    item.ease_in = item.ease_out = 0.0
    OPERATORS.splice_build()
    height = np.ptp(played(hero, [1.0])[0, ..., 2])
    off = np.linalg.norm(hand_in_chest(hero, bones, moments) - wanted, axis=-1)
    assert np.linalg.norm(before - wanted, axis=-1).max() > 0.02 * height
    assert off.max() < 1e-3 * height
