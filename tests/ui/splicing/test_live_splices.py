# SPDX-License-Identifier: GPL-3.0-or-later
"""Live splices and retargets: what is set is followed, and is what the button makes.

Blender as a module runs no timers: what a timer would do is called by hand.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.actions import MARK, curves_of, is_edited
from octo_motion.blender.animation.clips import read_clip
from octo_motion.ui.splicing.following import ClipLive
from octo_motion.ui.splicing.live_retarget import live_retargeted
from octo_motion.ui.splicing.live_splices import live_spliced
from tests.ui.splicing.test_cyclic_splices import cyclic_body
from tests.ui.splicing.test_kept_curves import sparse_hero, told
from tests.ui.splicing.test_splicing import (
    OPERATORS,
    drawn,
    give_motion,
    hero_and_source,
    make_humanoid,
    select,
    stack_of,
)
from tests.ui.splicing.walkers import BODIES, make_body, walk

MADE: list[str] = []
"""Armatures whose frame in sight was shown anew."""


@pytest.fixture(autouse=True)
def counted(monkeypatch: pytest.MonkeyPatch) -> None:
    make = ClipLive.make

    def counting(live: Any, armature: Any) -> None:
        MADE.append(armature.name)
        make(live, armature)

    monkeypatch.setattr(ClipLive, "make", counting)


@pytest.fixture
def hero() -> Any:
    """A body with two splices of another one, built and live; a frame within both is seen."""
    armature, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_add(part="HEAD")
    first, second = stack_of(armature).splices
    first.base_start, second.base_start, second.length = 5.0, 8.0, 20.0
    OPERATORS.splice_build()
    bpy.context.scene.frame_set(12)
    stack_of(armature).live = True
    settle()
    assert not stack_of(armature).live_error
    return armature


@pytest.fixture
def walker() -> Any:
    """Somebody who was given the walk of another body, and is live; frame 40 is seen."""
    source = make_body("Walker", BODIES["like it"])
    walk(source, BODIES["like it"])
    armature = make_body("Hero", BODIES["short legs, wide hips"])
    select(source, armature)
    OPERATORS.retarget()
    bpy.context.scene.frame_set(40)
    retarget_of(armature).live = True
    settle()
    assert not retarget_of(armature).live_error
    return armature


def retarget_of(armature: Any) -> Any:
    return stack_of(armature).retarget


def notice(*touched: Any) -> None:
    """Blender's update after a change in the panel: scripts must tell of it themselves."""
    for each in bpy.data.objects:
        if each.type == "ARMATURE":
            each.update_tag(refresh={"OBJECT"})
    for each in touched:
        each.update_tag()
    bpy.context.view_layer.update()


def settle(*touched: Any) -> bool:
    """That update, and all that the timers do; whether there was anything to do."""
    notice(*touched)
    before = len(MADE)
    for live in (live_spliced, live_retargeted):
        live.finish_following()
    bpy.context.view_layer.update()
    return len(MADE) > before


def show(live: ClipLive, *touched: Any) -> None:
    """No more than the frame in sight."""
    notice(*touched)
    assert live.pending()
    bpy.app.timers.unregister(live.run_pending)
    assert live.run_pending() is None
    bpy.context.view_layer.update()


def turn(live: ClipLive) -> bool:
    """One turn of what comes while Blender idles; whether there is more."""
    if bpy.app.timers.is_registered(live.run_following):
        bpy.app.timers.unregister(live.run_following)
    (name,) = live.following
    live.go_on(name, 0.0)
    return bool(live.following)


def all_of(action: Any) -> dict[tuple[str, int], Any]:
    """All that an action plays: keys with handles and kinds, modifiers, range."""
    curves = {
        (curve.data_path, curve.array_index): (
            told(curve),
            [(each.type, each.mode_before, each.mode_after) for each in curve.modifiers],
            curve.extrapolation,
            curve.group.name if curve.group is not None else "",
        )
        for curve in curves_of(action)
    }
    return {
        **curves,
        ("range", 0): (*action.frame_range, action.use_cyclic, action.use_frame_range),
    }


def tracks_of(armature: Any) -> list[Any]:
    return [
        (track.name, each.action.name, each.frame_start, each.frame_end, each.blend_type)
        for track in armature.animation_data.nla_tracks
        for each in track.strips
    ]


def as_built(armature: Any) -> tuple[Any, Any]:
    """What the button makes of the same settings, and its tracks."""
    stack_of(armature).live = False
    settle()
    OPERATORS.splice_build()
    return all_of(stack_of(armature).result), tracks_of(armature)


def seen(armature: Any) -> np.ndarray:
    """Bones as Blender shows them, (bones, 4, 4)."""
    evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([bone.matrix for bone in evaluated.pose.bones])


def apart(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one - other).max())


def names() -> list[str]:
    return sorted(action.name for action in bpy.data.actions)


# --- Splices: what is set is followed -------------------------------------------------------------


def first(**values: Any) -> Callable[[Any], None]:
    """Set something of the first splice."""

    def change(armature: Any) -> None:
        for name, value in values.items():
            setattr(stack_of(armature).splices[0], name, value)

    return change


def another_clip(armature: Any) -> None:
    source = stack_of(armature).splices[0].source
    own = source.animation_data.action
    action = give_motion(source, 9, name="Another")
    source.animation_data.action = own
    stack_of(armature).splices[0].action = action


def another_base(armature: Any) -> None:
    result = armature.animation_data.action
    base = give_motion(armature, 10, name="Another Base")
    armature.animation_data.action = result
    armature.animation_data.action_slot = result.slots[0]
    stack_of(armature).base = base


def moved_up(armature: Any) -> None:
    stack_of(armature).splices[0].part = "HEAD"
    stack_of(armature).splices.move(1, 0)


def in_seconds(armature: Any) -> None:
    first(fade_unit="SECONDS", fade_in_seconds=0.4)(armature)


def landmarks(armature: Any) -> None:
    stack_of(armature).landmarks.clavicle_r = ""


def reference(armature: Any) -> None:
    stack_of(stack_of(armature).splices[0].source).landmarks.reference_pose = "REST"


CHANGES: dict[str, Callable[[Any], None]] = {
    "weight": first(weight=0.4),
    "fades": first(ease_in=3.0, ease_out=9.0),
    "fades in seconds": in_seconds,
    "where it begins": first(base_start=9.0),
    "where the clip begins": first(splice_start=6.0),
    "rate": first(rate=1.7),
    "length": first(length=12.0),
    "after": first(splice_start=30.0, after="LOOP"),
    "part": first(part="LEFT_ARM"),
    "seen from": first(seen_from="WORLD"),
    "mirror": first(mirror=True),
    "additive": first(blending="ADD", reference="REST"),
    "reach": first(mode="EXACT"),
    "collar bone": first(with_clavicle=False),
    "legs that travel": first(part="LEGS", with_travel=True),
    "feet that slide": first(part="LEGS", with_travel=True, foot_lock=False),
    "off": first(mute=True),
    "as shown": first(visual=True, base_start=7.0),
    "another clip": another_clip,
    "another base": another_base,
    "order": moved_up,
    "one less": lambda armature: stack_of(armature).splices.remove(0),
    "landmarks": landmarks,
    "reference pose": reference,
    "base as shown": lambda armature: setattr(stack_of(armature), "visual", True),
    "as a layer": lambda armature: setattr(stack_of(armature), "result_as", "LAYER"),
}


@pytest.mark.one_blender
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_what_is_made_live_is_what_the_button_makes(
    hero: Any, change: Callable[[Any], None]
) -> None:
    before = all_of(stack_of(hero).result), tracks_of(hero)
    change(hero)
    assert settle()
    stack = stack_of(hero)
    assert (stack.live, stack.live_error) == (True, "")
    live = all_of(stack.result), tracks_of(hero)
    assert live != before or change == CHANGES["reference pose"]
    assert not is_edited(stack.result)
    assert not settle()
    name, mark = stack.result.name, dict(stack.result[MARK])
    assert as_built(hero) == live
    assert (stack.result.name, stack.result[MARK]["fingerprint"]) == (name, mark["fingerprint"])
    assert stack.result[MARK]["note"] == mark["note"]
    assert not [each for each in names() if each.startswith(".")]


@pytest.mark.one_blender
@pytest.mark.parametrize("result_as", ["ACTION", "LAYER"])
@pytest.mark.parametrize("interpolation", ["BEZIER", "SINE"])
def test_few_keys_in_all_rotation_modes_are_those_of_the_button(
    interpolation: str, result_as: str
) -> None:
    hero, _ = sparse_hero(interpolation)
    stack = stack_of(hero)
    stack.result_as = result_as
    stack.live = True
    assert settle()
    for weight in (0.6, 0.3):
        stack.splices[0].weight = weight
        assert settle()
    live = all_of(stack.result), tracks_of(hero)
    assert as_built(hero) == live


@pytest.mark.parametrize("how", ["modifiers", "range"])
def test_cyclic_bases_stay_cyclic(how: str) -> None:
    hero, _, item = cyclic_body(how)
    stack = stack_of(hero)
    stack.live = True
    assert settle()
    item.base_start = 35.0
    assert settle()
    live = all_of(stack.result), tracks_of(hero)
    assert stack.result.use_cyclic
    assert as_built(hero) == live


def test_keys_of_a_weight_are_followed(hero: Any) -> None:
    item = stack_of(hero).splices[0]
    item.keyframe_insert("weight", frame=1)
    item.weight = 0.2
    item.keyframe_insert("weight", frame=30)
    assert settle(hero.animation_data.action)
    assert stack_of(hero).live
    before = all_of(stack_of(hero).result)
    curve = next(
        each for each in curves_of(hero.animation_data.action) if "weight" in each.data_path
    )
    curve.keyframe_points[-1].co.y = 0.9
    curve.update()
    assert settle(hero.animation_data.action)
    live = all_of(stack_of(hero).result), tracks_of(hero)
    assert live[0] != before
    assert as_built(hero) == live


def test_a_clip_that_is_edited_is_followed(hero: Any) -> None:
    before = all_of(stack_of(hero).result)
    clip = stack_of(hero).splices[0].action
    for curve in curves_of(clip):
        curve.keyframe_points.foreach_set("interpolation", np.zeros(41, dtype=np.uint8))
        curve.keyframe_points[12].co.y += 0.05
        curve.update()
    assert settle(clip)
    live = all_of(stack_of(hero).result), tracks_of(hero)
    assert live[0] != before
    assert as_built(hero) == live


def test_a_source_of_another_rest_pose_is_followed(hero: Any) -> None:
    source = stack_of(hero).splices[0].source
    before = all_of(stack_of(hero).result)
    select(source)
    bpy.ops.object.mode_set(mode="EDIT")
    source.data.edit_bones["forearm.R"].roll += 0.7
    bpy.ops.object.mode_set(mode="OBJECT")
    select(source, hero)
    assert settle(source.data)
    live = all_of(stack_of(hero).result), tracks_of(hero)
    assert live[0] != before
    assert as_built(hero) == live


# --- Splices: at once, in turns, never half -------------------------------------------------------


def test_the_frame_in_sight_is_there_before_all_others(hero: Any) -> None:
    before, here = all_of(stack_of(hero).result), seen(hero)
    first(weight=0.3)(hero)
    show(live_spliced)
    shown = seen(hero)
    assert all_of(stack_of(hero).result) == before
    live_spliced.finish_following()
    bpy.context.view_layer.update()
    there = seen(hero)
    assert apart(there, shown) < 1e-4
    assert apart(there, here) > 0.05


def test_another_frame_is_shown_as_it_is_going_to_be(hero: Any) -> None:
    first(weight=0.3)(hero)
    show(live_spliced)
    bpy.context.scene.frame_set(17)
    bpy.context.view_layer.update()
    shown = seen(hero)
    live_spliced.finish_following()
    bpy.context.view_layer.update()
    assert apart(seen(hero), shown) < 1e-4


@pytest.mark.one_blender
def test_what_was_made_last_is_there_until_the_new_one_is_whole(hero: Any) -> None:
    stack = stack_of(hero)
    before, turns = all_of(stack.result), 0
    first(weight=0.3)(hero)
    show(live_spliced)
    shown = seen(hero)
    while turn(live_spliced):
        assert all_of(stack.result) == before
        assert hero.animation_data.action == stack.result
        bpy.context.view_layer.update()
        assert apart(seen(hero), shown) < 1e-6
        turns += 1
    assert turns > 30
    live = all_of(stack.result), tracks_of(hero)
    assert as_built(hero) == live


def test_a_change_while_one_is_half_written_takes_its_place(hero: Any) -> None:
    stack, actions = stack_of(hero), names()
    first(weight=0.3)(hero)
    show(live_spliced)
    while not any(each.startswith(".") for each in names()):
        assert turn(live_spliced)
    for _ in range(5):
        assert turn(live_spliced)
    first(weight=0.8)(hero)
    show(live_spliced)
    assert names() == actions
    assert settle() is False
    live = all_of(stack.result), tracks_of(hero)
    assert as_built(hero) == live
    assert names() == actions


@pytest.mark.one_blender
@pytest.mark.parametrize("what", ["purged", "keys of the base", "source"])
def test_what_goes_while_one_is_half_written_does_no_harm(hero: Any, what: str) -> None:
    stack, actions = stack_of(hero), names()
    first(weight=0.3)(hero)
    show(live_spliced)
    while not any(each.startswith(".") for each in names()):
        assert turn(live_spliced)
    assert turn(live_spliced)
    if what == "purged":
        bpy.data.actions.remove(next(each for each in bpy.data.actions if each.name[0] == "."))
    elif what == "source":
        bpy.data.objects.remove(stack.splices[1].source)
    else:
        channelbag = stack.base.layers[0].strips[0].channelbags[0]
        channelbag.fcurves.remove(channelbag.fcurves[0])
    settle(stack.base)
    assert names() == actions
    if what == "source":
        assert "source armature is gone" in stack.live_error
        return
    live = all_of(stack.result), tracks_of(hero)
    assert not stack.live_error
    assert as_built(hero) == live


def test_without_change_nothing_is_made_anew(hero: Any) -> None:
    assert not settle()
    bpy.context.scene.frame_set(20)
    assert not settle()
    stack_of(hero).active_splice = 1
    assert not settle()


def test_the_button_makes_what_was_on_its_way(hero: Any) -> None:
    first(weight=0.3)(hero)
    show(live_spliced)
    assert turn(live_spliced)
    OPERATORS.splice_build()
    assert not live_spliced.following
    assert not settle()
    live = all_of(stack_of(hero).result), tracks_of(hero)
    assert as_built(hero) == live


def test_a_button_that_fails_leaves_what_was_on_its_way_to_be_made(hero: Any) -> None:
    before = all_of(stack_of(hero).result)
    first(weight=0.3)(hero)
    show(live_spliced)
    assert turn(live_spliced)
    with pytest.raises(RuntimeError, match="no armature 'Nobody'"):
        OPERATORS.splice_add(source="Nobody")
    assert not live_spliced.following
    assert all_of(stack_of(hero).result) == before
    assert settle()
    live = all_of(stack_of(hero).result), tracks_of(hero)
    assert as_built(hero) == live


@pytest.mark.one_blender
def test_two_bodies_of_one_source_are_followed_each_for_itself(hero: Any) -> None:
    source, clip = stack_of(hero).splices[0].source, stack_of(hero).splices[0].action
    other = make_humanoid("Other", scale=1.2)
    give_motion(other, 30)
    select(source, other)
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    stack_of(other).live = True
    settle()
    for curve in curves_of(clip):
        curve.keyframe_points[12].co.y += 0.05
        curve.update()
    assert settle(clip)
    live = [(all_of(stack_of(each).result), tracks_of(each)) for each in (hero, other)]
    for each, made in zip((hero, other), live, strict=True):
        select(source, each)
        assert as_built(each) == made
    # Another rest pose counts for both as well.
    stack_of(hero).live = stack_of(other).live = True
    settle()
    select(source)
    bpy.ops.object.mode_set(mode="EDIT")
    source.data.edit_bones["forearm.R"].roll += 0.7
    bpy.ops.object.mode_set(mode="OBJECT")
    assert settle(source.data)
    again = [(all_of(stack_of(each).result), tracks_of(each)) for each in (hero, other)]
    for each, made, before in zip((hero, other), again, live, strict=True):
        assert made != before
        select(source, each)
        assert as_built(each) == made


# --- Splices: whose result it is, and what goes wrong ---------------------------------------------


def test_live_is_off_until_it_is_switched_on_and_costs_nothing() -> None:
    hero, _ = hero_and_source()
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    before = all_of(stack_of(hero).result)
    first(weight=0.4)(hero)
    assert not settle()
    assert all_of(stack_of(hero).result) == before
    updates = SimpleUpdates()
    for live in (live_spliced, live_retargeted):
        live.after_frame(bpy.context.scene, updates)
        live.after_update(bpy.context.scene, updates)
    stack_of(hero).live = True
    with pytest.raises(AssertionError, match="thousands"):
        live_spliced.after_update(bpy.context.scene, updates)


class SimpleUpdates:
    """An update that nobody is to look at."""

    mode = "VIEWPORT"

    @property
    def updates(self) -> Any:
        raise AssertionError("thousands of objects may be told of")


def test_a_result_that_was_edited_is_left_alone(hero: Any) -> None:
    stack, actions = stack_of(hero), names()
    curve = next(iter(curves_of(stack.result)))
    curve.keyframe_points[3].co.y += 0.5
    curve.update()
    before = all_of(stack.result)
    first(weight=0.3)(hero)
    settle()
    assert not stack.live
    assert stack.live_error == f"Live is off: '{stack.result.name}' was edited and is yours."
    assert (all_of(stack.result), names()) == (before, actions)
    bpy.context.scene.frame_set(12)
    bpy.context.view_layer.update()
    played = seen(hero)
    bpy.context.scene.frame_set(13)
    bpy.context.scene.frame_set(12)
    assert apart(seen(hero), played) < 1e-6


def test_an_action_of_the_artists_own_is_left_alone(hero: Any) -> None:
    stack = stack_of(hero)
    own = give_motion(hero, 20, name="Mine")
    before = all_of(own)
    first(weight=0.3)(hero)
    settle()
    assert not stack.live
    assert stack.live_error == "Live is off: 'Mine' is not what was generated."
    assert hero.animation_data.action == own
    assert all_of(own) == before


def test_what_is_wrong_is_told_in_the_panel_until_it_is_right(hero: Any) -> None:
    stack = stack_of(hero)
    before, action = all_of(stack.result), stack.splices[0].action
    stack.splices[0].action = None
    settle()
    assert stack.live
    assert "Its action is gone, or was never chosen." in stack.live_error
    assert all_of(stack.result) == before
    assert any("action is gone" in each for each in drawn()["splicing"])
    stack.splices[0].action = action
    stack.splices[0].weight = 0.5
    settle()
    assert stack.live_error == ""
    live = all_of(stack.result), tracks_of(hero)
    assert as_built(hero) == live


def test_tweak_mode_is_told(hero: Any) -> None:
    stack_of(hero).result_as = "LAYER"
    settle()
    data = hero.animation_data
    (strip,) = data.nla_tracks[-1].strips
    data.nla_tracks.active, strip.select = data.nla_tracks[-1], True
    data.use_tweak_mode = True
    before = all_of(stack_of(hero).result)
    first(weight=0.3)(hero)
    settle()
    assert "tweak mode" in stack_of(hero).live_error
    assert all_of(stack_of(hero).result) == before


def test_while_a_tool_has_the_screen_the_result_waits(
    hero: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = all_of(stack_of(hero).result)
    first(weight=0.3)(hero)
    notice()
    monkeypatch.setattr(live_spliced, "must_wait", lambda: True)
    assert live_spliced.run_pending() is not None
    assert all_of(stack_of(hero).result) == before
    assert not live_spliced.following
    monkeypatch.undo()
    live_spliced.finish_following()
    assert all_of(stack_of(hero).result) != before


def test_undo_and_redo_leave_splices_and_result_in_agreement(hero: Any) -> None:
    bpy.ops.ed.undo_push(message="before")
    before, actions = all_of(stack_of(hero).result), names()
    first(weight=0.3)(hero)
    show(live_spliced)
    while not any(each.startswith(".") for each in names()):
        assert turn(live_spliced)
    # The step is closed before the result follows, as after a drag.
    bpy.ops.ed.undo_push(message="drag")
    settle()
    after = all_of(stack_of(hero).result)
    assert after != before
    for step, expected in ((bpy.ops.ed.undo, before), (bpy.ops.ed.redo, after)):
        step()
        settle()
        again: Any = bpy.data.objects["Hero"]
        assert all_of(stack_of(again).result) == expected
        assert again.animation_data.action == stack_of(again).result
        assert names() == actions


def test_a_file_is_saved_whole_and_followed_after_it_is_opened(hero: Any, tmp_path: Path) -> None:
    before, actions = all_of(stack_of(hero).result), names()
    first(weight=0.3)(hero)
    show(live_spliced)
    for _ in range(20):
        assert turn(live_spliced)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "live.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "live.blend"))
    opened: Any = bpy.data.objects["Hero"]
    saved = all_of(stack_of(opened).result)
    assert saved != before
    assert names() == actions
    assert stack_of(opened).live
    first(weight=0.9)(opened)
    assert settle()
    assert all_of(stack_of(opened).result) != saved


def test_a_body_that_is_renamed_is_followed_on(hero: Any) -> None:
    hero.name = "Somebody"
    assert not settle()
    before = all_of(stack_of(hero).result)
    first(weight=0.3)(hero)
    assert settle()
    assert all_of(stack_of(hero).result) != before
    assert stack_of(hero).live


def test_a_body_that_is_deleted_is_forgotten(hero: Any) -> None:
    actions = names()
    first(weight=0.3)(hero)
    show(live_spliced)
    while not any(each.startswith(".") for each in names()):
        assert turn(live_spliced)
    bpy.data.objects.remove(hero)
    settle()
    assert not live_spliced.following
    assert names() == actions


# --- Retargets ------------------------------------------------------------------------------------


def result_of(armature: Any) -> Any:
    return armature.animation_data.action


def as_retargeted(armature: Any) -> Any:
    retarget_of(armature).live = False
    settle()
    OPERATORS.retarget(source="Walker")
    return all_of(result_of(armature))


def retargeting(**values: Any) -> Callable[[Any], None]:
    def change(armature: Any) -> None:
        for name, value in values.items():
            setattr(retarget_of(armature), name, value)

    return change


def hill(armature: Any) -> None:
    mesh = bpy.data.meshes.new("Hill")
    mesh.from_pydata(
        [(-9.0, -9.0, 1.0), (9.0, -9.0, 1.0), (9.0, 9.0, -1.0), (-9.0, 9.0, -1.0)],
        [],
        [(0, 1, 2, 3)],
    )
    ground = bpy.data.objects.new("Hill", mesh)
    bpy.context.scene.collection.objects.link(ground)
    retarget_of(armature).ground = ground


def swapped(armature: Any) -> None:
    table = stack_of(armature).landmarks
    left, right = table.upper_arm_l, table.upper_arm_r
    table.upper_arm_l, table.upper_arm_r = right, left
    table.forearm_l, table.forearm_r = table.forearm_r, table.forearm_l
    table.hand_l, table.hand_r = table.hand_r, table.hand_l
    table.clavicle_l, table.clavicle_r = table.clavicle_r, table.clavicle_l


RETARGETED: dict[str, Callable[[Any], None]] = {
    "reach": retargeting(mode="EXACT"),
    "travel": retargeting(travel=False),
    "foot lock": retargeting(foot_lock=False),
    "ground": hill,
    "as shown": retargeting(visual=True, mode="EXACT"),
    "landmarks": swapped,
}


@pytest.mark.one_blender
@pytest.mark.parametrize("change", RETARGETED.values(), ids=RETARGETED.keys())
def test_a_retarget_made_live_is_what_the_button_makes(
    walker: Any, change: Callable[[Any], None]
) -> None:
    before, name = all_of(result_of(walker)), result_of(walker).name
    change(walker)
    assert settle()
    settings = retarget_of(walker)
    assert (settings.live, settings.live_error) == (True, "")
    live = all_of(result_of(walker))
    assert live != before
    assert not settle()
    assert result_of(walker).name == name
    assert not is_edited(result_of(walker))
    assert as_retargeted(walker) == live
    assert result_of(walker).name == name


@pytest.mark.one_blender
def test_the_frame_in_sight_of_a_retarget_is_there_before_all_others(walker: Any) -> None:
    before, here = all_of(result_of(walker)), seen(walker)
    retarget_of(walker).travel = False
    show(live_retargeted)
    shown = seen(walker)
    while live_retargeted.following:
        assert all_of(result_of(walker)) == before
        turn(live_retargeted)
    bpy.context.view_layer.update()
    there = seen(walker)
    # Lengths are of a body that is 1 m tall; feet look no further than two seconds.
    assert apart(there, shown) < 0.01
    assert apart(there, here) > 0.2


@pytest.mark.one_blender
def test_the_clip_of_a_retarget_is_followed(walker: Any) -> None:
    clip, before = retarget_of(walker).from_action, all_of(result_of(walker))
    assert retarget_of(walker).from_armature.name == "Walker"
    for curve in curves_of(clip):
        if "upper_arm" in curve.data_path:
            curve.keyframe_points[39].co.y += 0.2
            curve.update()
    assert settle(clip)
    live = all_of(result_of(walker))
    assert live != before
    assert as_retargeted(walker) == live


def test_another_clip_of_a_retarget_makes_an_action_of_its_own(walker: Any) -> None:
    source, kept = retarget_of(walker).from_armature, result_of(walker)
    before, own = all_of(kept), source.animation_data.action
    other = give_motion(source, 5, name="Other Clip")
    source.animation_data.action = own
    retarget_of(walker).from_action = other
    settle()
    # What was made of the first one is kept: it is not what is asked for now.
    assert (
        retarget_of(walker).live_error == f"Live is off: '{kept.name}' is not what was generated."
    )
    assert all_of(kept) == before


def test_a_retarget_that_was_edited_is_left_alone(walker: Any) -> None:
    action = result_of(walker)
    curve = next(iter(curves_of(action)))
    curve.keyframe_points[3].co.y += 0.5
    curve.update()
    before = all_of(action)
    retarget_of(walker).mode = "EXACT"
    settle()
    settings = retarget_of(walker)
    assert not settings.live
    assert settings.live_error == f"Live is off: '{action.name}' was edited and is yours."
    assert all_of(action) == before


def test_a_retarget_whose_clip_is_gone_says_so(walker: Any) -> None:
    before = all_of(result_of(walker))
    bpy.data.objects.remove(retarget_of(walker).from_armature)
    settle()
    assert retarget_of(walker).live
    assert "retargeted last is gone" in retarget_of(walker).live_error
    assert all_of(result_of(walker)) == before


@pytest.mark.one_blender
def test_splices_and_retarget_of_one_body_follow_each_for_itself(walker: Any) -> None:
    retargeted = result_of(walker)
    source = retarget_of(walker).from_armature
    select(source, walker)
    retarget_of(walker).live = False
    OPERATORS.splice_add()
    OPERATORS.splice_build()
    stack_of(walker).live = True
    settle()
    before = read_clip(walker, stack_of(walker).result).rotations.copy()
    first(splice_start=12.0)(walker)
    assert settle()
    assert stack_of(walker).live
    assert np.abs(read_clip(walker, stack_of(walker).result).rotations - before).max() > 0.01
    assert stack_of(walker).base == retargeted
