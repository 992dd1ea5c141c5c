# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices with a weight, with keys of it, and such that come on top of what the base does."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import is_edited
from octo_motion.ui.splicing.stack import prepare_splices
from octo_motion.ui.splicing.timing_drag import DragSession
from tests.ui.splicing.test_kept_curves import apart, assign, channelbag, curves, played, told
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
MOMENTS = np.arange(1.0, 41.01, 0.5)


def weighted_hero() -> tuple[Any, Any]:
    """A body that gets an arm, without easing, and the splice."""
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    (item,) = stack_of(hero).splices
    item.ease_in = item.ease_out = 0.0
    return hero, item


def turns(armature: Any, bone: str, frames: np.ndarray) -> list[Any]:
    """A bone's own turn at frames, as Blender plays it."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=float(frame % 1.0))
        found.append(armature.pose.bones[bone].matrix_basis.to_quaternion())
    return found


def built(armature: Any) -> np.ndarray:
    OPERATORS.splice_build()
    return played(armature, MOMENTS)


def test_a_weight_of_zero_is_the_base_with_its_curves_and_one_the_splice() -> None:
    hero, item = weighted_hero()
    base = hero.animation_data.action
    before = played(hero, MOMENTS)
    whole = built(hero)
    item.weight = 0.0
    assert apart(before, built(hero)) < 1e-6
    assert {place: told(each) for place, each in curves(hero.animation_data.action).items()} == {
        place: told(each) for place, each in curves(base).items()
    }
    item.weight = 1.0
    assert apart(whole, built(hero)) < 1e-6


def test_half_the_weight_is_half_the_way_of_each_bone() -> None:
    hero, item = weighted_hero()
    frames = MOMENTS[::2]
    own = turns(hero, "upper_arm.R", frames)
    OPERATORS.splice_build()
    full = turns(hero, "upper_arm.R", frames)
    for weight in (0.25, 0.5):
        item.weight = weight
        OPERATORS.splice_build()
        for now, one, other in zip(turns(hero, "upper_arm.R", frames), own, full, strict=True):
            off = abs(now.dot(one.slerp(other if one.dot(other) > 0.0 else -other, weight)))
            # A turn about the bone's own length goes half the way by itself: 0.42° is measured.
            assert 2.0 * np.arccos(min(off, 1.0)) < np.radians(0.8)


def test_a_weight_with_keys_goes_where_they_say_and_stays_with_the_result() -> None:
    hero, item = weighted_hero()
    base = hero.animation_data.action
    before = played(hero, MOMENTS)
    whole = built(hero)
    assign(hero, base)
    for frame, weight in ((10.0, 0.0), (20.0, 1.0), (30.0, 1.0), (31.0, 0.0)):
        item.weight = weight
        item.keyframe_insert("weight", frame=frame)
    for number in (1, 2):
        now = built(hero)
        result = hero.animation_data.action
        assert result == stack_of(hero).result
        assert not is_edited(result), number
        early, full, late = (
            MOMENTS <= 10.0,
            (MOMENTS >= 20.0) & (MOMENTS <= 30.0),
            MOMENTS >= 31.0,
        )
        for chosen, wanted in ((early, before), (full, whole), (late, before)):
            assert np.abs(now[chosen] - wanted[chosen]).max() < 1e-4
        away = np.abs(now - before).max(axis=(1, 2, 3))
        assert away[(MOMENTS > 11.0) & (MOMENTS < 20.0)].min() > 1e-4
    # Keys that are set while the result is shown serve as well, and are no edit of it.
    result = hero.animation_data.action
    item.weight = 0.0
    item.keyframe_insert("weight", frame=20.0)
    item.keyframe_insert("weight", frame=30.0)
    assert not is_edited(result)
    assert apart(before, built(hero)) < 1e-6
    assert hero.animation_data.action == result
    assert ("octo_motion.splicing.splices[0].weight", 0) in curves(result)


def test_a_drag_shows_what_a_weighted_or_additive_splice_will_be() -> None:
    hero, item = weighted_hero()
    item.weight = 0.4
    for blending in ("REPLACE", "ADD"):
        item.blending = blending
        scene: Any = bpy.context.scene
        OPERATORS.splice_build()
        scene.frame_set(17)
        wanted = {bone.name: np.array(bone.matrix_basis) for bone in hero.pose.bones}
        session = DragSession(prepare_splices(hero), 0, scene)
        session.show()
        try:
            for bone in hero.pose.bones:
                assert np.abs(np.array(bone.matrix_basis) - wanted[bone.name]).max() < 1e-4
        finally:
            session.tear_down()


@pytest.mark.parametrize("part", ["RIGHT_ARM", "LEGS", "TRUNK", "HEAD"])
def test_a_clip_that_stands_still_adds_nothing(part: str) -> None:
    hero, source = hero_and_source()
    base = hero.animation_data.action
    for curve in channelbag(source.animation_data.action).fcurves:
        keys = curve.keyframe_points
        keys.foreach_set("co", [each for key in keys for each in (key.co.x, keys[0].co.y)])
        curve.update()
    OPERATORS.splice_add(part=part)
    stack_of(hero).splices[0].blending = "ADD"
    OPERATORS.splice_build()
    result = hero.animation_data.action
    assert result != base
    assert {place: told(each) for place, each in curves(result).items()} == {
        place: told(each) for place, each in curves(base).items()
    }


def breathing(name: str) -> tuple[Any, Any]:
    """A body that bends its spine to and fro and nothing else, by 6 degrees."""
    body = make_humanoid(name)
    spine = body.pose.bones["spine"]
    spine.rotation_mode = "XYZ"
    for frame in range(1, 42):
        spine.rotation_euler = (np.radians(3.0) * (1.0 - np.cos(0.3 * (frame - 1))), 0.0, 0.0)
        spine.keyframe_insert("rotation_euler", frame=frame)
    return body, spine


@pytest.mark.parametrize("weight", [1.0, 0.5])
def test_a_breath_comes_on_top_of_a_motion(weight: float) -> None:
    source, _ = breathing("Source")
    hero = make_humanoid("Hero")
    give_motion(hero, 2)
    select(source, hero)
    frames = np.arange(1.0, 41.01, 0.5)
    before = turns(hero, "spine", frames)
    others = turns(hero, "upper_arm.R", frames)
    OPERATORS.splice_add(part="TRUNK")
    (item,) = stack_of(hero).splices
    item.blending, item.weight, item.ease_in, item.ease_out = "ADD", weight, 0.0, 0.0
    OPERATORS.splice_build()
    wanted = weight * np.radians(3.0) * (1.0 - np.cos(0.3 * (frames - 1.0)))
    after = turns(hero, "spine", frames)
    for one, other, angle in zip(before, after, wanted, strict=True):
        added = one.inverted() @ other
        assert 2.0 * np.arctan2(abs(added.x), abs(added.w)) == pytest.approx(angle, abs=2e-3)
        # Bodies in other postures are compared in reference poses: the axis may be 3° off.
        assert np.hypot(added.y, added.z) <= np.sin(np.radians(3.0)) * abs(added.x) + 1e-4
    for one, other in zip(others, turns(hero, "upper_arm.R", frames), strict=True):
        assert abs(one.dot(other)) > 1.0 - 1e-6


def test_the_reference_may_be_any_frame_or_rest() -> None:
    source, _ = breathing("Source")
    hero = make_humanoid("Hero")
    give_motion(hero, 2)
    select(source, hero)
    before = turns(hero, "spine", np.array([1.0, 11.0, 21.0]))
    OPERATORS.splice_add(part="TRUNK")
    (item,) = stack_of(hero).splices
    item.blending, item.ease_in, item.ease_out = "ADD", 0.0, 0.0
    item.reference, item.reference_frame = "FRAME", 11.0
    OPERATORS.splice_build()
    first, chosen, _ = turns(hero, "spine", np.array([1.0, 11.0, 21.0]))
    assert abs(chosen.dot(before[1])) > 1.0 - 1e-6
    assert abs(first.dot(before[0])) < 1.0 - 1e-5
    item.reference = "REST"
    OPERATORS.splice_build()
    first, chosen, _ = turns(hero, "spine", np.array([1.0, 11.0, 21.0]))
    assert abs(first.dot(before[0])) > 1.0 - 1e-6
    assert abs(chosen.dot(before[1])) < 1.0 - 1e-5


def test_a_recorded_limp_goes_onto_a_recorded_walk(shared_data: SharedData) -> None:
    """Twice the same walk: what it does since its first frame, on top of itself, bends twice."""
    bpy.context.scene.render.fps = 24
    path = shared_data("secondlife/avatar_walk.bvh")
    bpy.ops.import_anim.bvh(filepath=str(path), update_scene_fps=False, use_fps_scale=False)
    walk: Any = bpy.context.object
    base = walk.animation_data.action
    frames = np.arange(np.ceil(base.frame_range[0]), np.floor(base.frame_range[1]))
    before = turns(walk, "neck", frames)
    OPERATORS.splice_add(part="HEAD", action=base.name)
    (item,) = stack_of(walk).splices
    item.blending, item.ease_in, item.ease_out = "ADD", 0.0, 0.0
    OPERATORS.splice_build()
    for now, own in zip(turns(walk, "neck", frames), before, strict=True):
        wanted = own @ before[0].inverted() @ own
        assert abs(now.dot(wanted)) > np.cos(2e-3)
