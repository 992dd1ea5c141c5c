# SPDX-License-Identifier: GPL-3.0-or-later
"""Sessions of posing that something gets in the way of: nothing is lost, nothing is left half."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.poses import pose_values
from octo_motion.core.errors import OctoMotionError, RigError
from octo_motion.ui.posing import pose_operator as session_operator
from octo_motion.ui.posing.controls import Outcome, PoseControls
from octo_motion.ui.posing.pose_operator import tell
from octo_motion.ui.posing.puppet_session import PuppetSession, active_session
from octo_motion.ui.posing.viewport import view_under
from tests.ui.posing.test_posing import MOVE, TICK, VIEW, Event, drag, keyed, over

ARM, OTHER = "arm1.04.L", "arm2.04.L"


def auto_key(*, available: bool = False) -> None:
    """Switch auto keying on; whether for what has keys already alone differs between Blenders."""
    preferences: Any = bpy.context.preferences
    preferences.edit.use_keyframe_insert_available = available
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True


def close(first: Any, second: Any, by: float = 1e-6) -> bool:
    return all(
        np.allclose(np.concatenate(first[name]), np.concatenate(second[name]), atol=by)
        for name in first | second
    )


# --- Esc -------------------------------------------------------------------------------------


def test_esc_gives_back_a_pose_that_was_not_keyed_over_an_animation(octopus: Any) -> None:
    bone = octopus.pose.bones["arm1.02.L"]
    for frame, angle in ((1, 0.0), (21, 0.4)):
        bone.rotation_quaternion = (np.cos(angle), np.sin(angle), 0.0, 0.0)
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    bpy.context.scene.frame_set(11)
    bone.rotation_quaternion = (0.8, 0.0, 0.0, 0.6)
    bpy.context.view_layer.update()
    before = pose_values(octopus)
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    controls = PoseControls(session)
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    controls.handle(Event("K"), VIEW)
    bpy.context.view_layer.update()
    session.cancel()
    bpy.context.view_layer.update()
    assert close(pose_values(octopus), before)


def test_armature_that_is_renamed_meanwhile_is_posed_on(
    octopus: Any, controls: PoseControls
) -> None:
    before = pose_values(octopus)
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    controls.handle(Event("K"), VIEW)
    octopus.name = "Kraken"
    controls.tick(TICK)
    controls.session.cancel()
    assert pose_values(octopus) == before
    assert octopus.animation_data is None


def test_bone_that_is_renamed_meanwhile_ends_the_session_with_all_else_as_it_was(
    octopus: Any, controls: PoseControls
) -> None:
    before = pose_values(octopus)
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    controls.handle(Event("K"), VIEW)
    octopus.data.bones[OTHER].name = "Tentacle"
    with pytest.raises(RigError, match="The bones of 'Octopus' have changed"):
        controls.tick(TICK)
    controls.session.cancel()
    after = pose_values(octopus)
    after[OTHER] = after.pop("Tentacle")
    assert after == before
    assert octopus.animation_data is None
    assert list(bpy.data.actions) == []


# --- Enter -------------------------------------------------------------------------------------


@pytest.mark.parametrize("while_", ["recording", "measuring"])
def test_session_ends_also_where_its_armature_is_gone(
    octopus: Any, controls: PoseControls, while_: str
) -> None:
    session = controls.session
    if while_ == "recording":
        session.record()
        session.grab_bone(ARM, 1.0)
        for number in range(10):
            session.tick(TICK, np.array([-0.05 * number, 0.3, 0.3]))
        bpy.context.scene.frame_set(2)
    else:
        session.measure(session.body(ARM))
    bpy.data.objects.remove(octopus)
    with pytest.raises(RigError, match="'Octopus' is gone"):
        session.finish()
    assert session.ended
    assert active_session() is None
    assert not any("PuppetSession" in repr(each) for each in bpy.app.handlers.frame_change_post)


def test_enter_with_a_limb_in_the_hand_keys_it_where_auto_keying_is_on(
    octopus: Any, controls: PoseControls
) -> None:
    auto_key()
    x, y = over(controls.session, ARM)
    controls.handle(Event("G"), VIEW, x, y)
    for number in range(20):
        controls.handle(MOVE, VIEW, x - 4.0 * number, y)
        controls.tick(TICK)
    assert controls.handle(Event("RET"), VIEW) is Outcome.FINISH
    controls.session.finish()
    assert ARM in keyed(octopus)


# --- Frames ----------------------------------------------------------------------------------


def test_hand_that_held_without_a_button_is_free_after_a_change_of_frame(
    controls: PoseControls,
) -> None:
    x, y = over(controls.session, ARM)
    controls.handle(Event("G"), VIEW, x, y)
    assert controls.holding
    bpy.context.scene.frame_set(2)
    controls.tick(TICK)
    assert not controls.holding
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    assert controls.holding
    controls.handle(Event("LEFTMOUSE", "RELEASE"), VIEW, x, y)
    assert not controls.holding


def test_back_frees_the_hand_that_held_without_a_button(
    controls: PoseControls,
) -> None:
    x, y = over(controls.session, ARM)
    controls.handle(Event("G"), VIEW, x, y)
    controls.handle(Event("Z", ctrl=True), VIEW, x, y)
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    assert controls.holding


def test_bones_that_were_moved_at_another_frame_are_not_keyed_at_this_one(
    octopus: Any, controls: PoseControls
) -> None:
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    controls.handle(Event("K"), VIEW)
    bpy.context.scene.frame_set(11)
    drag(controls, OTHER, (-60.0, 20.0), ticks=10)
    controls.handle(Event("K"), VIEW)
    found = keyed(octopus)
    assert found[ARM] == {1.0}
    assert found[OTHER] == {11.0}


def test_scale_that_goes_wrong_on_the_way_is_told(octopus: Any, controls: PoseControls) -> None:
    octopus.keyframe_insert("scale", frame=1)
    octopus.scale = (1.0, 2.0, 1.0)
    octopus.keyframe_insert("scale", frame=11)
    bpy.context.scene.frame_set(1)
    controls.tick(TICK)
    bpy.context.scene.frame_set(11)
    with pytest.raises(RigError, match="scaled unequally"):
        controls.tick(TICK)


def test_obstacle_that_goes_wrong_on_the_way_is_told_and_posing_goes_on(
    controls: PoseControls,
) -> None:
    box = bpy.data.objects.new("Box", None)
    bpy.context.collection.objects.link(box)
    box.octo_motion.posing.obstacle = "BOX"
    box.location.x = 9.0
    for frame, size in ((1, 1.0), (11, 0.0)):
        box.scale = (size,) * 3
        box.keyframe_insert("scale", frame=frame)
    bpy.context.scene.frame_set(1)
    bpy.context.scene.frame_set(11)
    controls.tick(TICK)
    assert "'Box' has no size" in controls.status()
    bpy.context.scene.frame_set(1)
    controls.tick(TICK)
    assert "'Box'" not in controls.status()


# --- Keys ------------------------------------------------------------------------------------


def test_key_that_cannot_be_made_is_said_and_nothing_else_is_lost(
    octopus: Any, controls: PoseControls
) -> None:
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    bent = pose_values(octopus)
    octopus.animation_data_create()
    strip = bpy.data.actions.new("Strip")
    track = octopus.animation_data.nla_tracks.new()
    track.strips.new("Strip", 1, strip)
    octopus.animation_data.use_tweak_mode = True
    assert octopus.animation_data.use_tweak_mode
    assert controls.handle(Event("K"), VIEW) is Outcome.TAKEN
    assert "tweak mode" in controls.message
    controls.tick(TICK)
    # It has only gone on to come to rest.
    assert close(pose_values(octopus), bent, 0.05)


def test_nothing_keyed_says_why(controls: PoseControls) -> None:
    controls.handle(Event("K"), VIEW)
    assert controls.message == "Nothing to key: no bone was moved"
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    scene = bpy.context.scene
    scene.keying_sets_all.active = scene.keying_sets_all["Available"]
    controls.handle(Event("K"), VIEW)
    assert (
        controls.message == "Nothing keyed: by the settings of keying, no bone needs or takes a key"
    )


def test_auto_keying_that_only_replaces_keys_makes_no_others(
    octopus: Any, controls: PoseControls
) -> None:
    auto_key()
    bpy.context.scene.tool_settings.auto_keying_mode = "REPLACE_KEYS"
    bone = octopus.pose.bones[ARM]
    bone.keyframe_insert("rotation_quaternion", frame=5)
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    assert keyed(octopus) == {ARM: {5.0}}


def test_auto_keying_of_animated_bones_alone_keys_no_others(
    octopus: Any, controls: PoseControls
) -> None:
    auto_key(available=True)
    octopus.pose.bones[ARM].keyframe_insert("rotation_quaternion", frame=5)
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    assert keyed(octopus) == {ARM: {1.0, 5.0}}


def test_keying_that_keys_nothing_leaves_no_action(octopus: Any, controls: PoseControls) -> None:
    auto_key(available=True)
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    assert octopus.animation_data is None
    assert list(bpy.data.actions) == []


def test_auto_keying_uses_the_keying_set_only_where_it_is_told_to(
    octopus: Any, controls: PoseControls
) -> None:
    scene = bpy.context.scene
    scene.keying_sets_all.active = scene.keying_sets_all["Location"]
    auto_key()
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    assert {c.data_path.rpartition(".")[2] for c in _curves(octopus)} == {"rotation_quaternion"}


def _curves(armature: Any) -> list[Any]:
    action = armature.animation_data.action
    return [c for b in action.layers[0].strips[0].channelbags for c in b.fcurves]


# --- Undo ------------------------------------------------------------------------------------


def test_undo_of_blenders_own_is_followed(octopus: Any, controls: PoseControls) -> None:
    """From the Edit menu, while a session goes on."""
    name = octopus.name
    bpy.ops.ed.undo_push(message="Before")
    octopus = bpy.data.objects[name]
    octopus.pose.bones[OTHER].rotation_quaternion = (0.8, 0.6, 0.0, 0.0)
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Turned")
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    bpy.ops.ed.undo()
    octopus = bpy.data.objects[name]
    undone = pose_values(octopus)
    controls.tick(TICK)
    assert pose_values(octopus) == undone
    drag(controls, ARM, (60.0, 20.0), ticks=10)
    after = pose_values(bpy.data.objects[name])
    assert after[OTHER] == undone[OTHER]


# --- Scripts -----------------------------------------------------------------------------------


@pytest.mark.usefixtures("octopus")
def test_script_that_fails_leaves_the_frame_as_it_was(tmp_path: Path) -> None:
    steps = [{"do": "frame", "frame": 20}, {"do": "grab", "bone": "nobody"}]
    path = tmp_path / "wave.json"
    path.write_text(
        json.dumps({"format": "octo_motion.pose", "version": 1, "steps": steps}), encoding="utf-8"
    )
    with pytest.raises(RuntimeError, match="has no bone 'nobody'"):
        bpy.ops.octo_motion.pose_script(filepath=str(path))
    assert bpy.context.scene.frame_current == 1


def test_session_makes_no_settings_on_objects_that_have_none(octopus: Any) -> None:
    lamp = bpy.data.objects.new("Lamp", None)
    bpy.context.collection.objects.link(lamp)
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    session.cancel()
    assert not lamp.is_property_set("octo_motion")


def test_armature_that_is_shown_at_rest_is_refused(octopus: Any) -> None:
    octopus.data.pose_position = "REST"
    with pytest.raises(OctoMotionError, match="'Octopus' is shown at rest"):
        PuppetSession(octopus, bpy.context.scene)


# --- Other keys, other windows -----------------------------------------------------------------


@pytest.mark.parametrize("modifier", ["shift", "ctrl", "alt"])
def test_arrow_keys_with_others_are_left_to_blender(controls: PoseControls, modifier: str) -> None:
    event = replace(Event("LEFT_ARROW"), **{modifier: True})
    assert controls.handle(event, VIEW) is Outcome.PASSED
    assert bpy.context.scene.frame_current == 1


def test_arrow_keys_keep_to_the_frames_that_blender_keeps_to(controls: PoseControls) -> None:
    for _ in range(3):
        assert controls.handle(Event("LEFT_ARROW"), VIEW) is Outcome.TAKEN
    assert bpy.context.scene.frame_current == 0


def test_ctrl_o_opens_a_file_and_does_not_record(controls: PoseControls) -> None:
    assert controls.handle(Event("O", ctrl=True), VIEW) is Outcome.PASSED
    assert not controls.session.recording


@pytest.mark.parametrize("modifier", ["ctrl", "alt"])
@pytest.mark.parametrize("kind", ["G", "P", "K", "M", "R"])
def test_keys_of_the_session_with_others_do_nothing(
    controls: PoseControls, kind: str, modifier: str
) -> None:
    x, y = over(controls.session, ARM)
    controls.handle(MOVE, VIEW, x, y)
    pins = controls.session.pins()
    controls.handle(replace(Event(kind), **{modifier: True}), VIEW, x, y)
    assert not controls.holding
    assert controls.session.measuring is None
    assert controls.session.pins() == pins
    assert controls.message == ""


def test_motion_is_not_recorded_into_an_action_that_adds_to_others(
    octopus: Any, controls: PoseControls
) -> None:
    """Keys would have to be what it adds: by keying one pose, Blender works that out."""
    data = octopus.animation_data_create()
    strip = data.nla_tracks.new().strips.new("Base", 1, bpy.data.actions.new("Base"))
    assert strip is not None
    octopus.pose.bones[ARM].keyframe_insert("rotation_quaternion", frame=1)
    data.action_blend_type = "ADD"
    controls.handle(Event("O"), VIEW)
    assert not controls.session.recording
    assert "adds to" in controls.message
    data.action_blend_type = "REPLACE"
    controls.handle(Event("O"), VIEW)
    assert controls.session.recording


def test_root_whose_place_is_locked_is_not_carried_about(octopus: Any) -> None:
    octopus.octo_motion.posing.root = "FREE"
    octopus.pose.bones["body"].lock_location = (True, True, True)
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    root = session.figure.names[0]
    assert root == "body"
    before = session.core.pose.positions[0].copy()
    start = session.grab_bone(root, 0.5)
    for number in range(40):
        session.tick(TICK, start + np.array([0.02 * number, 0.0, 0.0]))
    assert np.abs(session.core.pose.positions[0] - before).max() < 0.02
    session.cancel()


def test_each_of_four_views_is_looked_through_by_itself() -> None:
    """Blender's quad view: four regions in one area."""

    def region(x: int, y: int) -> Any:
        return SimpleNamespace(type="WINDOW", x=x, y=y, width=100, height=100, data=(x, y))

    regions = [region(x, y) for x in (0, 100) for y in (0, 100)]
    space = SimpleNamespace(region_3d=(100, 100))
    area = SimpleNamespace(type="VIEW_3D", regions=regions, spaces=SimpleNamespace(active=space))
    window: Any = SimpleNamespace(screen=SimpleNamespace(areas=[area]))
    for each in regions:
        found = view_under(window, each.x + 30, each.y + 40)
        assert found is not None
        view, x, y = found
        assert (view.region, view.data, x, y) == (each, each.data, 30, 40)


def test_nothing_is_left_in_the_headers_of_other_workspaces(monkeypatch: Any) -> None:
    """Where an artist has changed the workspace while posing."""
    told: dict[str, Any] = {}

    class Area:
        type = "VIEW_3D"

        def __init__(self, name: str) -> None:
            self.name = name

        def header_text_set(self, text: str | None) -> None:
            told[self.name] = text

        def tag_redraw(self) -> None:
            pass

    class Workspace:
        def __init__(self, name: str) -> None:
            self.screens = [SimpleNamespace(areas=[Area(name)])]
            self.name = name

        def status_text_set(self, text: str | None) -> None:
            told[f"status {self.name}"] = text

    first, second = Workspace("first"), Workspace("second")
    both = SimpleNamespace(screens=[*first.screens, *second.screens], workspaces=[first, second])
    monkeypatch.setattr(session_operator, "bpy", SimpleNamespace(data=both))
    manager = SimpleNamespace(windows=[])

    def context(workspace: Any) -> Any:
        return SimpleNamespace(
            screen=workspace.screens[0], workspace=workspace, window_manager=manager
        )

    tell(context(first), "Posing")
    tell(context(second), "Posing")
    tell(context(second), None)
    assert told == {"first": None, "second": None, "status first": None, "status second": None}


# --- What is not keyed yet -----------------------------------------------------------------------


@pytest.mark.parametrize("target", ["CURRENT", "COPY", "LAYER"])
@pytest.mark.parametrize("how", ["key", "record"])
def test_keys_of_one_limb_leave_the_pose_of_others_that_has_no_keys(
    octopus: Any, how: str, target: str
) -> None:
    scene, other = bpy.context.scene, octopus.pose.bones["arm2.02.L"]
    other.keyframe_insert("rotation_quaternion", frame=1)
    octopus.pose.bones["root"].keyframe_insert("location", frame=1)
    octopus.octo_motion.posing.keys_to = target
    session = PuppetSession(octopus, scene, clock=None)
    controls = PoseControls(session)
    if how == "record":
        session.record()
        drag(controls, ARM, (-60.0, 20.0), ticks=10)
        scene.frame_set(2)
        drag(controls, ARM, (-60.0, 20.0), ticks=10)
        scene.frame_set(3)
    other.rotation_quaternion = turned = (0.8, 0.6, 0.0, 0.0)
    octopus.pose.bones["root"].location = moved = (0.1, 0.2, 0.3)
    if how == "record":
        session.stop_record()
    else:
        drag(controls, ARM, (-60.0, 20.0), ticks=10)
        controls.handle(Event("K"), VIEW)
    assert keyed(octopus)[ARM]
    bpy.context.view_layer.update()
    session.abandon()
    assert tuple(other.rotation_quaternion) == pytest.approx(turned)
    assert tuple(octopus.pose.bones["root"].location) == pytest.approx(moved)


@pytest.mark.parametrize("ends", ["pressed", "round"])
def test_recording_over_a_figure_that_travels_leaves_its_travel(octopus: Any, ends: str) -> None:
    """The body stands still under the hand meanwhile, and afterwards goes where it went before."""
    scene, root = bpy.context.scene, octopus.pose.bones["root"]
    for frame, x in ((1, 0.0), (31, 3.0)):
        root.location.x = x
        root.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    session = PuppetSession(octopus, scene, clock=None)
    session.record()
    start = session.grab_bone(ARM, 1.0)
    for number in range(1, 31):
        session.tick(TICK, start + np.array([-0.01 * number, 0.0, 0.01 * number]))
        scene.frame_set(1 + number)
    if ends == "pressed":
        session.stop_record()
    else:
        scene.frame_set(1)
    assert not session.recording
    session.tick(TICK)
    session.finish()
    assert len(keyed(octopus)[ARM]) > 1
    assert "body" not in keyed(octopus)
    for frame, x in ((31, 3.0), (1, 0.0)):
        scene.frame_set(frame)
        bpy.context.view_layer.update()
        assert octopus.pose.bones["body"].head.x == pytest.approx(x, abs=1e-5)


def test_figure_that_is_moved_as_an_object_is_posed_where_it_is(
    octopus: Any, controls: PoseControls
) -> None:
    drag(controls, ARM, (-60.0, 20.0), ticks=10)
    octopus.location, octopus.rotation_euler.z = (1.0, 0.0, 0.0), 0.5
    bpy.context.view_layer.update()
    controls.tick(TICK)
    drag(controls, ARM, (-30.0, 20.0), ticks=10)
    bpy.context.view_layer.update()
    ends = controls.session.capsules()[0]
    for bone in (ARM, "arm2.02.R", "body"):
        head = octopus.matrix_world @ octopus.pose.bones[bone].head
        start = ends[controls.session.body(bone), 0]
        radius = controls.session.capsules()[1][controls.session.body(bone)]
        assert np.linalg.norm(np.array(head) - start) < 1.01 * radius


def test_figure_that_is_scaled_wrongly_meanwhile_is_told(
    octopus: Any, controls: PoseControls
) -> None:
    octopus.scale = (1.0, 2.0, 1.0)
    bpy.context.view_layer.update()
    with pytest.raises(RigError, match="scaled unequally"):
        controls.tick(TICK)
