# SPDX-License-Identifier: GPL-3.0-or-later
"""A splice's time, as artists set it: keys on its rate, markers, fades in seconds."""

import json
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import curves_of
from octo_motion.ui.splicing.stack import prepare_splices
from octo_motion.ui.splicing.timing_drag import DragSession
from tests.referee.recording import Floats, moments, record
from tests.ui.splicing.test_splicing import (
    OPERATORS,
    give_motion,
    make_humanoid,
    select,
    snapshot,
    stack_of,
)


def two_bodies(frames: int = 81) -> tuple[Any, Any, Any]:
    """Base, source and the splice of an arm, of the same body, with no fades."""
    source, hero = make_humanoid("Source"), make_humanoid("Hero")
    give_motion(source, 1, frames)
    give_motion(hero, 2, frames)
    select(source, hero)
    OPERATORS.splice_add(part="RIGHT_ARM")
    item = stack_of(hero).splices[0]
    item.ease_in = item.ease_out = 0.0
    return hero, source, item


def elbow(armature: Any, frames: Floats) -> Floats:
    """(moments, 3, 3) how the right forearm is turned in the upper arm."""
    played = record(armature, frames, with_skin=False)
    upper, lower = (played.names.index(each) for each in ("upper_arm.R", "forearm.R"))
    return np.einsum("mji,mjk->mik", played.turns[:, upper], played.turns[:, lower])


def shows(hero: Any, source: Any, frames: Floats, clip_frames: Floats) -> float:
    """Degrees by which the base's elbow is off the clip's at the moments that belong together."""
    made, wanted = elbow(hero, frames), elbow(source, clip_frames)
    cosines = 0.5 * (np.einsum("mij,mij->m", made, wanted) - 1.0)
    return float(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))).max())


def mark(action: Any, **frames: int) -> None:
    for name, frame in frames.items():
        action.pose_markers.new(name).frame = frame


def test_markers_of_the_same_name_meet_whatever_the_rate_is():
    hero, source, item = two_bodies()
    mark(hero.animation_data.action, step=21, hit=41, only_here=50)
    mark(source.animation_data.action, hit=51, step=16)
    item.match_markers = True
    OPERATORS.splice_build()
    assert shows(hero, source, np.array([1.0, 21.0, 41.0]), np.array([1.0, 16.0, 51.0])) < 0.1
    # After the last one it goes on at its rate.
    assert shows(hero, source, np.array([45.0, 60.0]), np.array([55.0, 70.0])) < 0.1
    # Half frames too.
    assert shows(hero, source, np.array([50.5]), np.array([60.5])) < 0.5


def test_the_scenes_markers_serve_where_the_base_has_none_and_names_twice_go_in_order():
    hero, source, item = two_bodies()
    for frame in (41, 11):
        bpy.context.scene.timeline_markers.new("step", frame=frame)
    first, second = (source.animation_data.action.pose_markers.new("step") for _ in range(2))
    first.frame, second.frame = 26, 9
    item.match_markers = True
    OPERATORS.splice_build()
    assert shows(hero, source, np.array([11.0, 41.0]), np.array([9.0, 26.0])) < 0.1


def test_without_markers_to_match_it_is_said_and_nothing_changes():
    hero, source, item = two_bodies()
    item.match_markers = True
    mark(source.animation_data.action, hit=51)
    before = snapshot()
    with pytest.raises(RuntimeError, match="no marker of the same name"):
        OPERATORS.splice_build()
    assert snapshot() == before
    mark(hero.animation_data.action, hit=20, early=15)
    mark(source.animation_data.action, early=60)
    with pytest.raises(RuntimeError, match="'early' and 'hit' do not follow"):
        OPERATORS.splice_build()


def test_a_rate_with_keys_speeds_the_clip_up_and_slows_it_down():
    hero, source, item = two_bodies()
    for frame, rate in ((1, 0.5), (21, 0.5), (22, 1.5), (80, 1.5)):
        item.rate = rate
        assert item.keyframe_insert("rate", frame=frame)
    OPERATORS.splice_build()
    gone = 1.0 + 0.5 * 20.0
    frames = np.array([1.0, 11.0, 20.5, 30.0, 40.0])
    wanted = np.where(
        frames <= 21.0, 1.0 + 0.5 * (frames - 1.0), gone + 1.0 + 1.5 * (frames - 22.0)
    )
    assert shows(hero, source, frames, wanted) < 1.0
    # Keys that the result has as well are what counts from now on: again the same.
    OPERATORS.splice_build()
    assert shows(hero, source, frames, wanted) < 1.0


def test_a_drag_shows_the_warped_clip():
    hero, source, item = two_bodies()
    mark(hero.animation_data.action, hit=41)
    mark(source.animation_data.action, hit=51)
    item.match_markers = True
    session = DragSession(prepare_splices(hero), 0, bpy.context.scene)
    session.drag.tick(100.0)  # ten frames
    session.tear_down()
    OPERATORS.splice_drag_timing(base_start=11.0, splice_start=1.0)
    assert shows(hero, source, np.array([11.0, 41.0]), np.array([1.0, 51.0])) < 0.1


def test_fades_in_seconds_last_as_long_at_any_frame_rate():
    hero, _, item = two_bodies()
    bpy.context.scene.render.fps = 24
    before = elbow(hero, moments(1, 81))
    item.fade_unit, item.fade_in_seconds, item.base_start = "SECONDS", 0.5, 5.0
    made = []
    for fps, frames in ((24, 12.0), (48, 24.0)):
        bpy.context.scene.render.fps = fps
        hero.animation_data.action = stack_of(hero).base
        item.fade_unit = "SECONDS"
        OPERATORS.splice_build()
        made.append(elbow(hero, moments(1, 81)))
        item.fade_unit, item.ease_in, item.ease_out = "FRAMES", frames, 0.25 * fps
        OPERATORS.splice_build()
        assert np.abs(elbow(hero, moments(1, 81)) - made[-1]).max() < 1e-4
    changed = [np.abs(each - before).max(axis=(1, 2)) > 1e-4 for each in made]
    assert not changed[0][:5].any()
    assert not np.allclose(made[0], made[1], atol=1e-3)


def test_files_and_scripts_that_know_nothing_of_it_fade_in_frames():
    hero, _, item = two_bodies()
    assert (item.fade_unit, item.match_markers, item.mirror) == ("FRAMES", False, False)
    OPERATORS.splice_build()
    note = json.loads(hero.animation_data.action["octo_motion_generated"]["note"])
    assert note["splices"][0]["fade_unit"] == "FRAMES"


def test_keys_of_a_rate_stay_with_their_splice_when_the_list_changes():
    hero, source, item = two_bodies()
    item.name = "first"
    select(source, hero)
    OPERATORS.splice_add(part="HEAD")
    stack = stack_of(hero)
    stack.splices[1].keyframe_insert("rate", frame=3)

    def keyed() -> list[str]:
        curves = [each for each in curves_of(hero.animation_data.action) if not each.is_empty]
        paths = {each.data_path for each in curves if each.data_path.endswith(".rate")}
        return [hero.path_resolve(path.removesuffix(".rate")).name for path in paths]

    name = stack.splices[1].name
    assert keyed() == [name]
    OPERATORS.splice_move(direction="UP")
    assert stack.splices[0].name == name
    assert keyed() == [name]
    stack.active_splice = 1
    OPERATORS.splice_remove()
    assert keyed() == [name]
    stack.active_splice = 0
    OPERATORS.splice_remove()
    assert keyed() == []


def test_keys_that_are_set_on_what_was_built_count_and_stay():
    hero, source, item = two_bodies()
    OPERATORS.splice_build()
    item.keyframe_insert("rate", frame=1)
    for frame in (1, 40):
        item.rate = 0.5
        item.keyframe_insert("rate", frame=frame)
    frames = np.array([1.0, 11.0, 31.0])
    for _ in range(3):
        OPERATORS.splice_build()
        assert shows(hero, source, frames, 1.0 + 0.5 * (frames - 1.0)) < 0.1
    # The keys are those that were set, two of them.
    (curve,) = [
        each for each in curves_of(hero.animation_data.action) if each.data_path.endswith(".rate")
    ]
    assert [key.co[0] for key in curve.keyframe_points] == [1.0, 40.0]
