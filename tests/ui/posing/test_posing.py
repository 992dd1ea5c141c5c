# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing by hand: what mouse and keys do to a rig, and that nothing is left behind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from octo_motion.blender.animation.poses import pose_values
from octo_motion.core.errors import OctoMotionError, RigError, WriteError
from octo_motion.core.rotations import Floats
from octo_motion.ui.posing.controls import Outcome, PoseControls
from octo_motion.ui.posing.device_pose import unregister
from octo_motion.ui.posing.overlay import overlay_lines
from octo_motion.ui.posing.puppet_session import PuppetSession, active_session

TICK = 1.0 / 60.0
PIXELS = 500.0
"""To a metre, in the view of these tests."""


class FromAbove:
    """An orthographic view down on the ground: x to the right, y up the screen."""

    def ray(self, x: float, y: float) -> tuple[Floats, Floats]:
        return np.array([x / PIXELS, y / PIXELS, 10.0]), np.array([0.0, 0.0, -1.0])

    def at_depth(self, x: float, y: float, point: Floats) -> Floats:
        return np.array([x / PIXELS, y / PIXELS, point[2]])

    def axes(self) -> Floats:
        return np.eye(3)


@dataclass(frozen=True)
class Event:
    """What of Blender's events the controls look at."""

    type: str
    value: str = "PRESS"
    shift: bool = False
    ctrl: bool = False
    alt: bool = False


VIEW = FromAbove()
MOVE = Event("MOUSEMOVE", "NOTHING")


def over(session: PuppetSession, bone: str, share: float = 0.5) -> tuple[float, float]:
    """The pixel over a bone."""
    start, end = session.capsules()[0][session.body(bone)]
    x, y, _ = start + share * (end - start)
    return x * PIXELS, y * PIXELS


def drag(
    controls: PoseControls, bone: str, by: tuple[float, float], ticks: int = 30, **keys: bool
) -> None:
    """Press over a bone, move by pixels, and let go."""
    x, y = over(controls.session, bone)
    assert controls.handle(Event("LEFTMOUSE"), VIEW, x, y) is Outcome.TAKEN
    for number in range(1, ticks + 1):
        share = number / ticks
        event = Event("MOUSEMOVE", "NOTHING", **keys)
        controls.handle(event, VIEW, x + share * by[0], y + share * by[1])
        controls.tick(TICK)
    controls.handle(Event("LEFTMOUSE", "RELEASE"), VIEW, x + by[0], y + by[1])


def tip(armature: Any, bone: str = "arm1.04.L") -> Floats:
    bpy.context.view_layer.update()
    return np.array(armature.matrix_world @ armature.pose.bones[bone].tail)


def keyed(armature: Any) -> dict[str, set[float]]:
    """Frames with keys, by bone."""
    data = armature.animation_data
    found: dict[str, set[float]] = {}
    if data is None or data.action is None:
        return found
    for layer in data.action.layers:
        for strip in layer.strips:
            for channelbag in strip.channelbags:
                for curve in channelbag.fcurves:
                    bone = curve.data_path.partition('"')[2].partition('"')[0]
                    frames = {key.co[0] for key in curve.keyframe_points}
                    found.setdefault(bone, set()).update(frames)
    return found


# --- The hand ------------------------------------------------------------------------------------


def test_dragged_arm_follows_the_mouse_and_stays_where_it_is_left(
    octopus: Any, controls: PoseControls
) -> None:
    start = tip(octopus)
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    left = tip(octopus)
    assert np.linalg.norm(left - start) > 0.05
    for _ in range(30):
        controls.tick(TICK)
    assert np.linalg.norm(tip(octopus) - left) < 0.02
    # The other arms have not moved at all.
    assert octopus.pose.bones["arm2.04.R"].matrix_basis == Matrix.Identity(4)


def test_hover_shows_what_would_be_grabbed(controls: PoseControls) -> None:
    x, y = over(controls.session, "arm2.03.R")
    assert controls.handle(MOVE, VIEW, x, y) is Outcome.PASSED
    assert controls.hover is not None
    assert controls.session.bone(controls.hover) == "arm2.03.R"
    assert "arm2.03.R" in controls.status()
    controls.handle(MOVE, VIEW, 4000.0, 4000.0)
    assert controls.hover is None


def test_click_beside_the_figure_takes_hold_of_nothing(controls: PoseControls) -> None:
    assert controls.handle(Event("LEFTMOUSE"), VIEW, 4000.0, 4000.0) is Outcome.PASSED


@pytest.mark.parametrize(
    "kind", ["MIDDLEMOUSE", "WHEELUPMOUSE", "NUMPAD_1", "SPACE", "TRACKPADPAN", "NDOF_MOTION", "F5"]
)
def test_view_and_playback_stay_free(controls: PoseControls, kind: str) -> None:
    assert controls.handle(Event(kind), VIEW) is Outcome.PASSED


@pytest.mark.parametrize("kind", ["LEFTMOUSE", "ESC", "RET", "K", "G", "Z"])
def test_other_editors_stay_free(controls: PoseControls, kind: str) -> None:
    assert controls.handle(Event(kind, ctrl=True), None) is Outcome.PASSED


def test_button_that_is_let_go_over_another_editor_lets_go(controls: PoseControls) -> None:
    controls.handle(Event("LEFTMOUSE"), VIEW, *over(controls.session, "arm1.04.L"))
    assert controls.handle(Event("LEFTMOUSE", "RELEASE"), None) is Outcome.TAKEN
    assert not controls.holding


def test_shift_moves_the_hand_finely(controls: PoseControls) -> None:
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    assert controls.hand is not None
    start = controls.hand
    controls.handle(Event("MOUSEMOVE", shift=True), VIEW, x + 100.0, y)
    assert controls.hand - start == pytest.approx([0.1 * 100.0 / PIXELS, 0.0, 0.0])
    controls.handle(MOVE, VIEW, x + 200.0, y)
    assert controls.hand - start == pytest.approx([1.1 * 100.0 / PIXELS, 0.0, 0.0])


def test_wheel_pushes_away_and_with_ctrl_turns(controls: PoseControls) -> None:
    controls.handle(Event("LEFTMOUSE"), VIEW, *over(controls.session, "arm1.04.L"))
    assert controls.hand is not None
    height = controls.hand[2]
    assert controls.handle(Event("WHEELUPMOUSE"), VIEW) is Outcome.TAKEN
    assert controls.hand[2] < height
    for _ in range(6):
        controls.handle(Event("WHEELUPMOUSE", ctrl=True), VIEW)
    before = controls.session.core.pose.orientations[controls.session.body("arm1.04.L")]
    for _ in range(30):
        controls.tick(TICK)
    after = controls.session.core.pose.orientations[controls.session.body("arm1.04.L")]
    assert abs(before @ after) < 0.999


def test_r_while_dragging_turns_instead_of_moving(controls: PoseControls) -> None:
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    hand = controls.hand
    controls.handle(Event("R"), VIEW, x, y)
    controls.handle(MOVE, VIEW, x + 50.0, y)
    assert controls.hand is hand
    controls.handle(Event("R", "RELEASE"), VIEW, x, y)
    controls.handle(MOVE, VIEW, x + 60.0, y)
    assert controls.hand is not hand


def test_g_grabs_without_a_button_and_lets_go_again(controls: PoseControls) -> None:
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(MOVE, VIEW, x, y)
    controls.handle(Event("G"), VIEW, x, y)
    assert controls.holding
    controls.handle(Event("LEFTMOUSE", "RELEASE"), VIEW, x, y)
    assert controls.holding
    controls.handle(Event("G"), VIEW, x, y)
    assert not controls.holding
    assert controls.session.core.held is None


def test_p_pins_what_is_under_the_mouse_and_frees_it_again(
    octopus: Any, controls: PoseControls
) -> None:
    at = over(controls.session, "arm1.02.L")
    controls.handle(MOVE, VIEW, *at)
    controls.handle(Event("P"), VIEW, *at)
    place = tip(octopus, "arm1.01.L")
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    assert tip(octopus, "arm1.01.L") == pytest.approx(place, abs=1e-3)
    controls.handle(MOVE, VIEW, *at)
    controls.handle(Event("P"), VIEW, *at)
    assert controls.session.bone(controls.session.pins()[0]) == "body"
    assert len(controls.session.pins()) == 1


def test_right_click_takes_the_drag_back(octopus: Any, controls: PoseControls) -> None:
    start = tip(octopus)
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    controls.handle(MOVE, VIEW, x - 60.0, y)
    for _ in range(10):
        controls.tick(TICK)
    controls.handle(Event("RIGHTMOUSE"), VIEW, x, y)
    assert not controls.holding
    assert tip(octopus) == pytest.approx(start, abs=1e-5)


def test_ctrl_z_takes_back_one_drag(octopus: Any, controls: PoseControls) -> None:
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    first = tip(octopus)
    drag(controls, "arm1.04.L", (40.0, 40.0))
    assert controls.handle(Event("Z", ctrl=True), VIEW) is Outcome.TAKEN
    assert tip(octopus) == pytest.approx(first, abs=0.02)


def test_r_restores_the_pose_of_the_start(octopus: Any, controls: PoseControls) -> None:
    start = tip(octopus)
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    controls.handle(Event("R"), VIEW)
    assert tip(octopus) == pytest.approx(start, abs=1e-5)


# --- Keys ----------------------------------------------------------------------------------------


def test_k_keys_the_bones_that_were_touched(octopus: Any, controls: PoseControls) -> None:
    bpy.context.scene.frame_set(17)
    assert controls.handle(Event("K"), VIEW) is Outcome.TAKEN
    assert keyed(octopus) == {}
    assert "Nothing to key" in controls.status()
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    controls.handle(Event("K"), VIEW)
    bones = keyed(octopus)
    assert bones
    assert all(bone.startswith("arm1.") and bone.endswith(".L") for bone in bones)
    assert set().union(*bones.values()) == {17.0}


def test_shift_k_keys_all_limbs(octopus: Any, controls: PoseControls) -> None:
    controls.handle(Event("K", shift=True), VIEW)
    assert set(keyed(octopus)) == set(controls.session.figure.names)


def test_letting_go_keys_where_auto_keying_is_on(octopus: Any, controls: PoseControls) -> None:
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    # Blender 5.2 has this on as it comes.
    preferences: Any = bpy.context.preferences
    preferences.edit.use_keyframe_insert_available = False
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    assert "arm1.04.L" in keyed(octopus)


def test_poses_at_two_frames_are_two_keys_and_scrubbing_shows_them(
    octopus: Any, controls: PoseControls
) -> None:
    scene = bpy.context.scene
    scene.frame_set(1)
    start = tip(octopus)
    controls.handle(Event("K", shift=True), VIEW)
    scene.frame_set(20)
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    controls.handle(Event("K"), VIEW)
    bent = tip(octopus)
    scene.frame_set(1)
    assert tip(octopus) == pytest.approx(start, abs=1e-5)
    # The hand takes the figure up as it is shown now.
    controls.tick(TICK)
    assert tip(octopus) == pytest.approx(start, abs=1e-4)
    scene.frame_set(20)
    assert tip(octopus) == pytest.approx(bent, abs=1e-4)


def test_figure_whose_root_bone_travels_is_posed_where_it_is(octopus: Any) -> None:
    scene, root = bpy.context.scene, octopus.pose.bones["root"]
    for frame, x, angle in ((1, 0.0, 0.0), (21, 0.7, 0.5)):
        root.location, root.rotation_quaternion = (x, 0.2 * x, 0.0), (1.0, 0.0, angle, 0.0)
        root.keyframe_insert("location", frame=frame)
        root.keyframe_insert("rotation_quaternion", frame=frame)
    scene.frame_set(1)
    settings_of(octopus).root = "FREE"
    session = PuppetSession(octopus, scene, clock=None)
    session.core.change(step=4e-3)
    controls = PoseControls(session)
    scene.frame_set(21)
    start = tip(octopus)
    controls.tick(TICK)
    assert tip(octopus) == pytest.approx(start, abs=1e-4)
    drag(controls, "arm1.04.L", (-60.0, 20.0))
    shown = session.puppet.read()
    posed = session.core.pose
    session.cancel()
    assert np.abs(shown.positions - posed.positions).max() < 1e-4


def test_arrow_keys_step_through_the_frames(controls: PoseControls) -> None:
    bpy.context.scene.frame_set(5)
    controls.handle(Event("RIGHT_ARROW"), VIEW)
    assert bpy.context.scene.frame_current == 6


def test_record_writes_the_motion_of_the_drag_as_few_keys(
    octopus: Any, controls: PoseControls
) -> None:
    scene = bpy.context.scene
    scene.frame_set(10)
    controls.handle(Event("O"), VIEW)
    assert "Recording" in controls.status()
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    shown = {}
    for number in range(1, 25):
        controls.handle(MOVE, VIEW, x - 3.0 * number, y + number)
        controls.tick(1.0 / 24.0)
        scene.frame_set(10 + number)
        shown[10 + number] = tip(octopus)
    controls.handle(Event("LEFTMOUSE", "RELEASE"), VIEW, x, y)
    controls.handle(Event("O"), VIEW)
    frames = sorted(keyed(octopus)["arm1.04.L"])
    assert frames[0] == 10.0
    assert frames[-1] == 34.0
    assert len(frames) < 16
    controls.session.finish()
    for frame, place in shown.items():
        scene.frame_set(frame)
        # One degree at each of four joints of an arm of 0.6 m.
        assert np.linalg.norm(tip(octopus) - place) < 0.03


def test_recording_ends_where_playback_comes_round(octopus: Any, controls: PoseControls) -> None:
    scene = bpy.context.scene
    scene.frame_set(5)
    controls.handle(Event("O"), VIEW)
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    for number in range(1, 11):
        controls.handle(MOVE, VIEW, x - 6.0 * number, y)
        controls.tick(1.0 / 24.0)
        scene.frame_set(5 + number)
    scene.frame_set(1)
    assert not controls.session.recording
    found = keyed(octopus)["arm1.04.L"]
    assert (min(found), max(found)) == (5.0, 15.0)


# --- Ends ----------------------------------------------------------------------------------------


def handlers() -> list[Any]:
    return [*bpy.app.handlers.frame_change_post, *bpy.app.handlers.load_pre]


def test_enter_keeps_the_pose_and_esc_takes_all_back(octopus: Any) -> None:
    before = handlers()
    values = pose_values(octopus)
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    controls = PoseControls(session)
    drag(controls, "arm1.04.L", (-60.0, 20.0), ticks=10)
    controls.handle(Event("K"), VIEW)
    assert controls.handle(Event("ESC"), VIEW) is Outcome.CANCEL
    assert controls.handle(Event("RET"), VIEW) is Outcome.FINISH
    session.cancel()
    session.cancel()
    session.finish()
    assert pose_values(octopus) == values
    assert octopus.animation_data is None
    assert list(bpy.data.actions) == []
    assert handlers() == before
    assert active_session() is None

    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    drag(PoseControls(session), "arm1.04.L", (-60.0, 20.0), ticks=10)
    bent = pose_values(octopus)
    assert bent != values
    session.finish()
    session.cancel()
    assert pose_values(octopus) == bent
    assert handlers() == before


def test_esc_at_another_frame_shows_the_animation_of_that_frame(octopus: Any) -> None:
    bone, scene = octopus.pose.bones["arm1.02.L"], bpy.context.scene
    for frame, angle in ((1, 0.0), (21, 0.4)):
        bone.rotation_quaternion = (np.cos(angle), np.sin(angle), 0.0, 0.0)
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    scene.frame_set(1)
    session = PuppetSession(octopus, scene, clock=None)
    scene.frame_set(21)
    session.cancel()
    assert bone.rotation_quaternion[1] == pytest.approx(np.sin(0.4), abs=1e-6)


def test_figure_is_posed_by_one_hand_at_a_time(session: PuppetSession, octopus: Any) -> None:
    with pytest.raises(RigError, match="'Octopus' is being posed already"):
        PuppetSession(octopus, bpy.context.scene)
    assert not bpy.ops.octo_motion.pose_start.poll()
    session.finish()
    assert bpy.ops.octo_motion.pose_start.poll()


def test_opening_another_file_ends_the_session(octopus: Any, tmp_path: Path) -> None:
    path = tmp_path / "other.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    session = PuppetSession(octopus, bpy.context.scene)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert session.ended
    assert active_session() is None
    session.cancel()


def test_switching_the_extension_off_ends_the_session(octopus: Any) -> None:
    session = PuppetSession(octopus, bpy.context.scene)
    unregister()
    assert session.ended


def test_armature_that_is_deleted_meanwhile_ends_in_a_message(
    octopus: Any, controls: PoseControls
) -> None:
    bpy.data.objects.remove(octopus)
    with pytest.raises(RigError, match="'Octopus' is gone"):
        controls.tick(TICK)
    controls.session.cancel()
    assert active_session() is None


def test_edit_mode_ends_the_session_with_a_message(octopus: Any, controls: PoseControls) -> None:
    bpy.context.view_layer.objects.active = octopus
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RigError, match="is in edit mode"):
        controls.tick(TICK)


def test_armature_that_cannot_be_written_is_refused(octopus: Any) -> None:
    octopus.animation_data_create()
    action = bpy.data.actions.new("Strip")
    track = octopus.animation_data.nla_tracks.new()
    track.strips.new("Strip", 1, action)
    octopus.animation_data.use_tweak_mode = True
    if octopus.animation_data.use_tweak_mode:
        with pytest.raises(WriteError, match="tweak mode"):
            PuppetSession(octopus, bpy.context.scene)
    assert active_session() is None


def test_start_that_fails_leaves_nothing_behind(octopus: Any) -> None:
    before = handlers()
    octopus.scale = (1.0, 2.0, 1.0)
    bpy.context.view_layer.update()
    with pytest.raises(OctoMotionError, match="scaled unequally"):
        PuppetSession(octopus, bpy.context.scene)
    assert handlers() == before
    assert active_session() is None


def test_without_a_mouse_the_operator_says_what_scripts_can_use(octopus: Any) -> None:  # noqa: ARG001
    with pytest.raises(RuntimeError, match=r"octo_motion\.pose_script"):
        bpy.ops.octo_motion.pose_start()


# --- The world -----------------------------------------------------------------------------------


def settings_of(octopus: Any) -> Any:
    return octopus.octo_motion.posing


@pytest.mark.parametrize("material", ["CLAY", "WIRE", "DOLL", "RUBBER", "LIMP"])
def test_every_material_can_be_chosen_and_changed_in_the_hand(
    octopus: Any, session: PuppetSession, material: str
) -> None:
    settings_of(octopus).material = material
    session.tick(TICK)
    assert session.core.world.figure is not None
    drag(PoseControls(session), "arm1.04.L", (-20.0, 0.0), ticks=5)


def test_rubber_springs_back_and_clay_does_not(octopus: Any) -> None:
    stays = {}
    for material in ("CLAY", "RUBBER"):
        settings_of(octopus).material = material
        session = PuppetSession(octopus, bpy.context.scene, clock=None)
        session.core.change(step=4e-3)
        start = tip(octopus)
        controls = PoseControls(session)
        drag(controls, "arm1.04.L", (-60.0, 20.0), ticks=20)
        bent = np.linalg.norm(tip(octopus) - start)
        for _ in range(90):
            controls.tick(TICK)
        stays[material] = np.linalg.norm(tip(octopus) - start) / bent
        session.cancel()
    assert stays["CLAY"] > 0.8
    assert stays["RUBBER"] < 0.3


def test_free_root_is_carried_and_a_held_one_is_not(octopus: Any) -> None:
    for root, moves in (("HELD", False), ("FREE", True)):
        settings_of(octopus).root = root
        session = PuppetSession(octopus, bpy.context.scene, clock=None)
        session.core.change(step=4e-3)
        drag(PoseControls(session), "body", (80.0, 0.0), ticks=30)
        moved = octopus.pose.bones["body"].location.length
        assert (moved > 0.05) is moves
        session.cancel()
        assert octopus.pose.bones["body"].location.length < 1e-6


def test_gravity_pulls_a_limp_figure_down_onto_the_floor(octopus: Any) -> None:
    settings = settings_of(octopus)
    settings.material, settings.root, settings.gravity = "LIMP", "FREE", True
    settings.floor, settings.floor_height = True, -0.3
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    session.core.change(step=4e-3)
    for _ in range(60):
        session.tick(TICK)
    ends, radii = session.capsules()
    lowest = (ends[..., 2] - radii[:, None]).min()
    session.cancel()
    assert -0.31 < lowest < -0.28


@pytest.mark.parametrize("kind", ["PLANE", "BOX", "SPHERE", "CAPSULE", "HULL", "MESH"])
def test_marked_object_stops_an_arm(octopus: Any, kind: str) -> None:
    end = tip(octopus)
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=(end[0], end[1], end[2] + 0.25))
    block: Any = bpy.context.object
    if kind == "PLANE":
        # Solid below its own Z axis, which looks down here.
        block.rotation_euler = (np.pi, 0.0, 0.0)
        block.location.z -= 0.15
    block.select_set(state=True)
    assert bpy.ops.octo_motion.pose_obstacle(kind=kind) == {"FINISHED"}
    assert block.octo_motion.posing.obstacle == kind
    heights = []
    for solid in (True, False):
        settings_of(octopus).use_obstacles = solid
        session = PuppetSession(octopus, bpy.context.scene, clock=None)
        session.core.change(step=2e-3)
        start, up = session.grab_bone("arm1.04.L", 1.0), np.array([0.0, 0.0, 1.0])
        for number in range(30):
            session.tick(TICK, start + 0.01 * (number + 1) * up)
        point = session.held_point()
        assert point is not None
        heights.append(point[2] - start[2])
        session.cancel()
    assert heights[0] < 0.12
    assert heights[1] > heights[0] + 0.05


def test_obstacle_without_a_surface_is_refused(octopus: Any) -> None:
    empty = bpy.data.objects.new("Nothing", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.octo_motion.posing.obstacle = "MESH"
    with pytest.raises(RigError, match="'Nothing' has no faces"):
        PuppetSession(octopus, bpy.context.scene)
    empty.octo_motion.posing.obstacle = "SPHERE"
    PuppetSession(octopus, bpy.context.scene).cancel()


def test_joint_turns_no_further_than_the_rig_allows(octopus: Any) -> None:
    limit = octopus.pose.bones["arm1.02.L"].constraints.new("LIMIT_ROTATION")
    limit.owner_space = "LOCAL"
    limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    limit.min_x = limit.min_z = limit.min_y = -0.1
    limit.max_x = limit.max_z = limit.max_y = 0.1
    leaning = {}
    for mute in (False, True):
        limit.mute = mute
        session = PuppetSession(octopus, bpy.context.scene, clock=None)
        session.core.change(step=4e-3)
        session.core.pin(session.body("arm1.01.L"), state=True)
        drag(PoseControls(session), "arm1.03.L", (-120.0, 60.0))
        leaning[mute] = octopus.pose.bones["arm1.02.L"].matrix_basis.to_quaternion().angle
        session.cancel()
    assert leaning[True] > 0.3
    # Twist and lean together may be a little more than each.
    assert leaning[False] < 0.16


# --- Marks and drawing ---------------------------------------------------------------------------


def test_bones_are_marked_in_pose_mode(octopus: Any) -> None:
    from octo_motion.blender import versions

    bpy.ops.object.mode_set(mode="POSE")
    for bone in octopus.pose.bones:
        versions.select(bone, state=bone.name == "siphon")
    assert bpy.ops.octo_motion.pose_mark_bones(mark="FOLLOW") == {"FINISHED"}
    session = PuppetSession(octopus, bpy.context.scene)
    assert "siphon" not in session.figure.names
    assert session.bone(session.body("siphon")) == "head"
    session.cancel()
    assert bpy.ops.octo_motion.pose_mark_bones(mark="AUTO") == {"FINISHED"}
    for bone in octopus.pose.bones:
        versions.select(bone, state=False)
    with pytest.raises(RuntimeError, match="No bones are selected"):
        bpy.ops.octo_motion.pose_mark_bones()


def test_nothing_selected_is_no_obstacle(octopus: Any) -> None:
    octopus.select_set(state=True)
    with pytest.raises(RuntimeError, match="No object that could be an obstacle"):
        bpy.ops.octo_motion.pose_obstacle()


def test_limbs_hand_and_pins_are_drawn(controls: PoseControls) -> None:
    eye = np.array([0.0, 0.0, 1.0])
    plain = overlay_lines(controls, eye, loads=True)
    assert len(plain) == 2  # limbs, and the pin of the root
    x, y = over(controls.session, "arm1.04.L")
    controls.handle(MOVE, VIEW, x, y)
    assert len(overlay_lines(controls, eye, loads=False)) == 2  # the hovered limb, and the pin
    controls.handle(Event("LEFTMOUSE"), VIEW, x, y)
    controls.handle(MOVE, VIEW, x - 60.0, y)
    controls.tick(TICK)
    drawn = overlay_lines(controls, eye, loads=True)
    assert len(drawn) == 4  # limbs, the held limb, the arrow, the pin
    for points, colours, width in drawn:
        assert len(points) == len(colours)
        assert np.isfinite(points).all()
        assert width >= 1.0
