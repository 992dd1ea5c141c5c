# SPDX-License-Identifier: GPL-3.0-or-later
"""Posing with a device in Blender: the armature follows the bridge, and keys are set by button."""

from __future__ import annotations

import dataclasses
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from octo_motion.blender.files import user_files as device_store
from octo_motion.blender.files.user_files import load_calibrations
from octo_motion.device import messages as say
from octo_motion.device.calibration import NONE, Calibration
from octo_motion.device.driver import Kind
from octo_motion.device.ipc.client import Client, ClientState
from octo_motion.device.ipc.process import ChannelClosedError
from octo_motion.ui.posing import device_pose
from octo_motion.ui.posing.controls import Outcome
from octo_motion.ui.posing.device_hands import NOTHING_NEAR, DeviceHands, NdofHands, ViewRoom
from octo_motion.ui.posing.device_settings import device_settings, message
from octo_motion.ui.posing.overlay import device_lines
from octo_motion.ui.posing.puppet_session import PuppetSession
from tests.device.bridges import bridge_of

PATIENCE = 30.0
TOLD = say.Settings(reach=0.2)


def arm() -> bpy.types.Object:
    """An upright armature of three bones, each half a metre long."""
    data = bpy.data.armatures.new("Arm")
    armature = bpy.data.objects.new("Arm", data)
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for index in range(3):
        bone = data.edit_bones.new(f"bone{index}")
        bone.head = (0.0, 0.0, 0.5 * index)
        bone.tail = (0.0, 0.0, 0.5 * index + 0.5)
        bone.parent, bone.use_connect = parent, parent is not None
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


@pytest.fixture
def hands() -> Iterator[DeviceHands]:
    """A simulated hand at the tip of an arm, in the middle of what the view shows."""
    session = PuppetSession(arm(), bpy.context.scene)
    client = Client()
    client.start(("--simulate", "--no-hid", "--no-haply"))
    hands = DeviceHands(session, client, TOLD)
    yield hands
    hands.stop()
    session.cancel()


def curves_of(action: Any) -> dict[tuple[str, int], Any]:
    """The F-curves of an action's only layer, by path and index."""
    bags = action.layers[0].strips[0].channelbags
    return {(each.data_path, each.array_index): each for bag in bags for each in bag.fcurves}


FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""The front view: right is X, up is Z, towards the eye is −Y."""


def room(height: float = 1.3, width: float = 1.0) -> ViewRoom:
    return ViewRoom(np.array([0.0, 0.0, height]), FRONT, width)


def wait(hands: DeviceHands, what: Callable[[], object], why: str) -> list[say.Button]:
    pressed: list[say.Button] = []
    end = time.monotonic() + PATIENCE
    while not what():
        pressed += hands.tick(TOLD, room())
        assert time.monotonic() < end, f"waited in vain: {why}; {hands.notices()}"
        time.sleep(0.005)
    return pressed


def grabbed(hands: DeviceHands) -> None:
    wait(hands, hands.shown, "the hand is there")
    wait(hands, lambda: abs(hands.shown()[0].position[2] - 1.3) < 0.3, "it is in the view")
    hands.grab()

    def holds() -> bool:
        if hands.message == NOTHING_NEAR:
            hands.grab()  # on a busy machine it had gone by
        return hands.holding

    wait(hands, holds, "it holds")


def the_arm() -> Any:
    return bpy.data.objects["Arm"]


def turn_of(name: str) -> np.ndarray:
    armature = the_arm()
    return np.array(armature.pose.bones[name].matrix_basis.to_quaternion())


def test_armature_follows_the_hand_at_the_device(hands: DeviceHands) -> None:
    grabbed(hands)
    assert hands.hover is not None
    assert hands.session.bone(hands.hover) == "bone2"
    wait(hands, lambda: abs(turn_of("bone2")[1:]).max() > 0.01, "the arm bends")
    shown = hands.shown()[0]
    assert shown.name == "Simulated hand"
    assert np.linalg.norm(shown.coupled - shown.position) < 0.3
    assert device_pose.line(hands) == "Posing Arm    Simulated hand: bone2"
    assert len(device_lines(hands, np.array([0.0, -1.0, 0.0]))) >= 4
    hands.grab()
    wait(hands, lambda: not hands.holding, "it lets go")
    keyed = hands.session.key()
    assert "bone2" in keyed


class FrontView:
    """Orthographic, towards +Y; a pixel is a unit."""

    @staticmethod
    def ray(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([x, -5.0, y]), np.array([0.0, 1.0, 0.0])

    @staticmethod
    def at_depth(x: float, y: float, point: np.ndarray) -> np.ndarray:
        return np.array([x, point[1], y])

    @staticmethod
    def axes() -> np.ndarray:
        return FRONT


def test_mouse_holds_a_limb_while_a_device_holds_another(hands: DeviceHands) -> None:
    """Both in the one session that the bridge simulates: Blender takes no step for either."""
    grabbed(hands)
    session = hands.session
    mouse, view = hands.mouse, FrontView()
    wait(hands, lambda: session.core.shared, "the bridge simulates")
    height = float(session.capsules()[0][1].mean(axis=0)[2])
    mouse.handle(Key("MOUSEMOVE"), view, 0.0, height)
    assert mouse.hover is not None
    assert mouse.handle(Key("LEFTMOUSE"), view, 0.0, height) is Outcome.TAKEN
    mouse.handle(Key("MOUSEMOVE"), view, 0.3, height)
    held = session.held
    assert held
    start = session.held_point()
    assert start is not None

    def led() -> bool:
        point = session.held_point()
        return point is not None and point[0] - start[0] > 0.1

    wait(hands, led, "the mouse leads")
    assert hands.holding
    assert hands.client.pointers[0].body != held.body
    assert session.pull() > 0.0
    assert session.loads().max() > 0.0
    assert session.core.shared
    assert len(device_lines(hands, np.array([0.0, -1.0, 0.0]))) >= 5
    assert mouse.handle(Key("LEFTMOUSE", "RELEASE"), view, 0.3, height) is Outcome.TAKEN
    wait(hands, lambda: hands.holding, "the device still holds")
    assert session.held is None


def test_only_limbs_that_a_device_pulled_are_keyed(hands: DeviceHands) -> None:
    session = hands.session
    session.toggle_pin(1)  # what is below hangs on nothing that is pulled
    wait(hands, lambda: session.core.shared, "the bridge simulates")
    grabbed(hands)
    wait(hands, lambda: abs(turn_of("bone2")[1:]).max() > 0.01, "the arm bends")
    hands.grab()
    wait(hands, lambda: not hands.holding, "it lets go")
    assert session.core.pulled is not None
    assert session.key() == ["bone2"]


def test_hand_far_from_all_limbs_is_told_so(hands: DeviceHands) -> None:
    wait(hands, hands.shown, "the hand is there")
    far = ViewRoom(np.array([50.0, 0.0, 0.0]), FRONT, 1.0)
    hands.tick(TOLD, far)
    end = time.monotonic() + PATIENCE
    while hands.shown()[0].position[0] < 40.0:
        hands.tick(TOLD, far)
        assert time.monotonic() < end
    hands.grab()
    while not hands.message:
        hands.tick(TOLD, far)
        assert time.monotonic() < end
    assert hands.message == "No limb is near enough to grab"
    hands.client.send(say.Grab(0, grab=False))
    grabbed(hands)
    assert hands.message == ""


def test_enter_keeps_pose_and_keys_and_escape_takes_them_back(hands: DeviceHands) -> None:
    grabbed(hands)
    wait(hands, lambda: abs(turn_of("bone2")[1:]).max() > 0.01, "the arm bends")
    device_pose.OCTO_MOTION_OT_pose_device._key(hands, all_bones=False)
    assert hands.message.startswith("Keyed")
    armature = the_arm()
    assert armature.animation_data.action
    hands.stop()
    hands.session.cancel()
    assert abs(turn_of("bone2")[1:]).max() < 1e-6
    assert armature.animation_data is None or armature.animation_data.action is None


def test_keys_set_with_a_device_are_in_the_file(hands: DeviceHands, tmp_path: Path) -> None:
    bpy.context.scene.frame_set(7)
    hands.tick(TOLD, room())
    grabbed(hands)
    wait(hands, lambda: abs(turn_of("bone2")[1:]).max() > 0.01, "the arm bends")
    device_pose.OCTO_MOTION_OT_pose_device._key(hands, all_bones=False)
    turn = turn_of("bone2")
    hands.stop()
    hands.session.finish()
    path = tmp_path / "posed.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    animation: Any = the_arm().animation_data
    curves = curves_of(animation.action)
    found = [curves['pose.bones["bone2"].rotation_quaternion', part] for part in range(4)]
    assert [len(each.keyframe_points) for each in found] == [1] * 4
    assert {each.keyframe_points[0].co.x for each in found} == {7.0}
    np.testing.assert_allclose([each.evaluate(7.0) for each in found], turn, atol=1e-5)


def test_change_of_frame_counts_and_hands_let_go(hands: DeviceHands) -> None:
    armature = the_arm()
    bone = armature.pose.bones["bone1"]
    bone.rotation_quaternion = (0.924, 0.383, 0.0, 0.0)
    bone.keyframe_insert("rotation_quaternion", frame=10)
    bone.rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
    bone.keyframe_insert("rotation_quaternion", frame=1)
    grabbed(hands)
    bpy.context.scene.frame_set(10)
    hands.tick(TOLD, room())
    wait(hands, lambda: not hands.holding, "it lets go")
    wait(hands, lambda: hands.client.steps > 0, "the bridge goes on")
    assert turn_of("bone1")[1] == pytest.approx(0.383, abs=0.02)


def test_pins_material_and_floor_reach_the_bridge(
    hands: DeviceHands, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait(hands, hands.shown, "the hand is there")
    sent: list[say.Message] = []
    send = hands.client.send
    monkeypatch.setattr(hands.client, "send", lambda each: (sent.append(each), send(each)))
    settings: Any = the_arm().octo_motion.posing
    hands.session.toggle_pin(2)
    hands.tick(TOLD)
    assert [each.pinned for each in sent if isinstance(each, say.Pins)] == [(2, 0, 2)]
    settings.material = "RUBBER"
    hands.tick(TOLD)
    assert any(isinstance(each, say.FigureMessage) for each in sent)
    settings.floor = True
    settings.gravity = True
    hands.tick(TOLD)
    assert any(isinstance(each, say.ObstacleMessage) for each in sent)
    worlds = [each for each in sent if isinstance(each, say.WorldMessage)]
    assert worlds[-1].gravity == pytest.approx((0.0, 0.0, -9.81))
    assert hands.notices() == []


def test_right_of_the_view_is_right_of_the_device(hands: DeviceHands) -> None:
    wait(hands, hands.shown, "the hand is there")
    space = hands._spaces[0]
    assert space.orientation == pytest.approx((1.0, 0.0, 0.0, 0.0))  # the front view is home
    side = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    hands.tick(TOLD, ViewRoom(np.zeros(3), side, 1.0))
    half = 0.5**0.5
    assert hands._spaces[0].orientation == pytest.approx((half, 0.0, 0.0, half))
    # Twice as much in the view: twice the way for the same way of the hand.
    before = hands._spaces[0].scale
    hands.tick(TOLD, ViewRoom(np.zeros(3), side, 2.0))
    assert hands._spaces[0].scale == pytest.approx(2.0 * before)


def test_killed_bridge_leaves_pose_and_keys_and_can_be_started_again(hands: DeviceHands) -> None:
    grabbed(hands)
    wait(hands, lambda: abs(turn_of("bone2")[1:]).max() > 0.01, "the arm bends")
    hands.session.key()
    before = turn_of("bone2")
    assert hands.client._child
    hands.client._child._process.kill()
    wait(hands, lambda: hands.client.state is ClientState.LOST, "it is noticed")
    assert [each.problem for each in hands.notices()] == [
        "The program between Blender and the device has ended."
    ]
    assert np.abs(turn_of("bone2") - before).max() < 0.2
    assert the_arm().animation_data.action
    assert "B starts it again" in device_pose.line(hands)
    hands.client.restart()
    hands.recentre()
    wait(hands, hands.shown, "the hand is back")
    assert hands.client.state is ClientState.RUNNING


def test_bridge_may_end_while_its_devices_are_told_of_the_view(
    hands: DeviceHands, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait(hands, hands.shown, "the hand is there")
    assert hands.client._child

    channel = hands.client._child.channel
    send = channel.send

    def ends(message: say.Message) -> None:
        if isinstance(message, say.Workspace):
            raise ChannelClosedError
        send(message)

    monkeypatch.setattr(channel, "send", ends)
    hands.tick(TOLD, room(height=2.5))
    assert hands.client.state is ClientState.LOST
    assert [each.problem for each in hands.notices()] == [
        "The program between Blender and the device has ended."
    ]


def test_bridge_that_is_started_again_knows_force_floor_and_calibration(
    hands: DeviceHands,
) -> None:
    """The hand must not feel more than was set, and the puppet not fall through its floor."""
    gentle = dataclasses.replace(TOLD, force=0.1)
    settings: Any = the_arm().octo_motion.posing
    settings.floor = True
    settings.gravity = True
    kept = Calibration(least=(-0.1,) * 6, most=(0.1,) * 6)  # pyright: ignore[reportArgumentType]

    def wait_gently(what: Callable[[], object], why: str) -> None:
        end = time.monotonic() + PATIENCE
        while not what():
            hands.tick(gentle, room())
            assert time.monotonic() < end, f"waited in vain: {why}; {hands.notices()}"
            time.sleep(0.002)

    wait_gently(hands.shown, "the hand is there")
    hands.calibrations.learned = {"simulated": kept}
    assert hands.client._child
    hands.client._child._process.kill()
    wait_gently(lambda: hands.client.state is ClientState.LOST, "it is noticed")
    sent: list[say.Message] = []
    start, send = hands.client.start, hands.client.send
    hands.client.start = lambda *given: (start(*given), sent.clear())
    hands.client.send = lambda each: (sent.append(each), send(each))
    press(hands, Key("B"))
    wait_gently(lambda: 0 in hands._spaces and hands.shown(), "the hand is back")
    hands.client.send(say.Buzz(0))
    forces: list[float] = []

    def pushes() -> bool:
        told = hands.client.pointers.get(0)
        forces.append(float(np.linalg.norm(told.force)) if told else 0.0)
        return max(forces) > 0.0 and forces[-1] == 0.0

    wait_gently(pushes, "it is tested")
    assert max(forces) < 0.15 * 8.0 * 0.1 + 1e-6
    assert any(isinstance(each, say.ObstacleMessage) and each.shape == 1 for each in sent)
    assert any(isinstance(each, say.WorldMessage) and each.gravity[2] < -9.0 for each in sent)
    told = [each for each in sent if isinstance(each, say.CalibrationMessage)]
    assert [each.calibration() for each in told] == [kept]


def test_bridge_that_cannot_be_started_again_leaves_the_session(
    hands: DeviceHands, tmp_path: Path
) -> None:
    """A virus scanner that stops the program must not cost the artist poses and keys."""
    wait(hands, hands.shown, "the hand is there")
    hands.session.key(all_bones=True)
    assert hands.client._child
    hands.client._child._process.kill()
    wait(hands, lambda: hands.client.state is ClientState.LOST, "it is noticed")
    hands.notices()
    python, hands.client._python = hands.client._python, tmp_path / "none"
    assert press(hands, Key("B")) is Outcome.TAKEN
    assert "does not start" in hands.notices()[0].problem
    assert "B starts it again" in device_pose.line(hands)
    assert the_arm().animation_data.action
    hands.tick(TOLD, room())
    hands.client._python = python
    press(hands, Key("B"))
    wait(hands, hands.shown, "the hand is back")


@pytest.mark.skipif(sys.platform == "win32", reason="stops a process by a signal")
def test_bridge_that_hangs_is_told_and_can_be_started_again(hands: DeviceHands) -> None:
    wait(hands, lambda: hands.client.times, "it goes well")
    assert "does not answer" not in device_pose.line(hands)
    process = bridge_of(hands.client)
    assert process
    os.kill(process, signal.SIGSTOP)
    hands.tick(TOLD, room())
    hands.client.heard -= 10.0
    hands.tick(TOLD, room())
    assert "does not answer: B starts it again" in device_pose.line(hands)
    press(hands, Key("B"))
    assert "does not answer" not in device_pose.line(hands)
    wait(hands, hands.shown, "the hand is back")
    assert bridge_of(hands.client) != process


def test_obstacle_that_stays_where_it_is_is_told_once(
    hands: DeviceHands, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mesh is large: telling it at each frame would keep the bridge from its hands."""
    bpy.ops.mesh.primitive_cube_add(location=(0.0, 0.0, -3.0))
    cube = bpy.context.object
    assert cube
    cube.octo_motion.posing.obstacle = "MESH"
    bpy.ops.mesh.primitive_cube_add(location=(3.0, 0.0, -3.0))
    other = bpy.context.object
    assert other
    other.octo_motion.posing.obstacle = "MESH"
    bpy.context.view_layer.objects.active = the_arm()
    sent: list[int] = []
    send = hands.client.send_obstacle
    monkeypatch.setattr(
        hands.client, "send_obstacle", lambda *each: (sent.append(each[0]), send(*each))
    )
    bpy.context.scene.frame_set(2)
    hands.tick(TOLD, room())
    assert sent == [0, 1]
    bpy.context.scene.frame_set(3)
    hands.tick(TOLD, room())
    assert sent == [0, 1]
    other.location.x = 4.0
    bpy.context.scene.frame_set(4)
    hands.tick(TOLD, room())
    assert sent == [0, 1, 1]


def test_space_mouse_that_blender_has_poses_without_a_bridge() -> None:
    session = PuppetSession(arm(), bpy.context.scene, clock=None)
    now = 0.0
    hands = NdofHands(session, clock=lambda: now)
    try:
        assert device_pose.line(hands) == "Posing Arm    Space mouse, through Blender"
        hands.tick(TOLD)
        hands.grab()
        assert hands.message == "Push the space mouse first"
        hands.move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, room(), TOLD)
        assert hands.shown()[0].position == pytest.approx((0.0, 0.0, 1.3))
        hands.grab()
        assert hands.holding
        for _ in range(60):
            now += 1.0 / 60.0
            hands.move((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0 / 60.0, room(), TOLD)
            hands.tick(TOLD)
        # Pushed to the right for a second: 0.4 of the view's width.
        assert hands.shown()[0].position == pytest.approx((0.4, 0.0, 1.3))
        assert hands.hover is not None
        assert session.bone(hands.hover) == "bone2"
        assert abs(turn_of("bone2")[1:]).max() > 0.02
        assert len(device_lines(hands, np.array([0.0, -1.0, 0.0]))) >= 4
        hands.grab()
        assert not hands.holding
        assert "bone2" in session.key()
        hands.restore()
        hands.tick(TOLD)
        assert abs(turn_of("bone2")[1:]).max() < 1e-5
    finally:
        hands.stop()
        session.cancel()


def test_mouse_holds_a_limb_while_blenders_space_mouse_holds_another() -> None:
    session = PuppetSession(arm(), bpy.context.scene, clock=None)
    now = 0.0
    hands = NdofHands(session, clock=lambda: now)
    mouse, view = hands.mouse, FrontView()

    def pass_time(ticks: int) -> None:
        nonlocal now
        for _ in range(ticks):
            now += 1.0 / 60.0
            hands.tick(TOLD)

    def sideways() -> tuple[float, float]:
        """Where what the mouse holds is, and what the space mouse holds, along X."""
        point = session.held_point(mouse.held)
        assert point is not None
        return float(point[0]), float(hands.shown()[0].coupled[0])

    try:
        hands.tick(TOLD)
        hands.move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, room(), TOLD)
        hands.grab()
        assert mouse.handle(Key("LEFTMOUSE"), view, 0.0, 0.95) is Outcome.TAKEN
        assert hands.holding
        assert mouse.held is not None
        assert [session.bone(each.body) for each in session.core.world.grabs] == ["bone2", "bone1"]
        # The one to the left, the other to the right.
        mouse.handle(Key("MOUSEMOVE"), view, -0.4, 0.95)
        for _ in range(60):
            hands.move((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0 / 60.0, room(), TOLD)
            pass_time(1)
        pass_time(60)
        left, right = sideways()
        assert left < -0.05
        assert right > 0.05
        # Either lets go by itself.
        point = session.held_point(mouse.held)
        assert point is not None
        assert mouse.handle(Key("LEFTMOUSE", "RELEASE"), view, -0.4, 0.95) is Outcome.TAKEN
        assert mouse.held is None
        assert hands.holding
        assert mouse.handle(Key("LEFTMOUSE"), view, point[0], point[2]) is Outcome.TAKEN
        hands.grab()
        assert not hands.holding
        assert mouse.held is not None
        assert {"bone1", "bone2"} <= set(session.key())
    finally:
        hands.stop()
        session.cancel()


def test_a_drag_goes_on_when_blenders_space_mouse_is_pushed_for_the_first_time(
    hands: DeviceHands,
) -> None:
    wait(hands, lambda: hands.session.core.shared, "the bridge simulates")
    hands.client.devices.clear()
    mouse, view = hands.mouse, FrontView()
    assert mouse.handle(Key("LEFTMOUSE"), view, 0.0, 0.95) is Outcome.TAKEN
    after = NdofHands(hands.session, mouse=hands.mouse)
    try:
        assert after.mouse.held is not None
        mouse.handle(Key("MOUSEMOVE"), view, 0.4, 0.95)
        end = time.monotonic() + PATIENCE
        while (point := hands.session.held_point()) is None or point[0] <= 0.1:
            after.tick(TOLD)
            assert time.monotonic() < end, f"waited in vain: the hand follows the mouse; {point}"
            time.sleep(0.005)
        assert mouse.handle(Key("LEFTMOUSE", "RELEASE"), view, 0.4, 0.95) is Outcome.TAKEN
        assert hands.session.held is None
    finally:
        after.stop()


def test_space_mouse_beside_a_force_device_turns_the_view(hands: DeviceHands) -> None:
    """One hand poses, the other one looks at it from all sides."""
    wait(hands, hands.shown, "the hand is there")
    operator: Any = device_pose.OCTO_MOTION_OT_pose_device
    motion = Key("NDOF_MOTION")
    assert operator._push(operator, bpy.context, hands, motion) is Outcome.PASSED
    # Where the bridge has it as well, it is a pointer, and must not move the view besides.
    mouse = dataclasses.replace(hands.client.devices[0], pointer=1, kind=Kind.RATE, force=0.0)
    hands.client.devices[1] = mouse
    assert operator._push(operator, bpy.context, hands, motion) is Outcome.TAKEN


# --- Undo ----------------------------------------------------------------------------------------


@dataclasses.dataclass
class Key:
    """An event of the keyboard."""

    type: str
    value: str = "PRESS"
    ctrl: bool = False
    shift: bool = False
    alt: bool = False
    oskey: bool = False


def at_rest(hands: DeviceHands) -> np.ndarray:
    """The turn of the last bone, once the arm has sprung back."""
    turns: list[np.ndarray] = []

    def calm() -> bool:
        turns.append(turn_of("bone2"))
        return len(turns) > 60 and bool(np.abs(turns[-1] - turns[-60]).max() < 1e-5)

    wait(hands, calm, "it comes to rest")
    return turns[-1]


def press(hands: DeviceHands | NdofHands, key: Key) -> Outcome:
    operator: Any = device_pose.OCTO_MOTION_OT_pose_device
    return operator._handle(operator, hands, key)


def test_step_back_leads_to_before_the_last_grab(hands: DeviceHands) -> None:
    undo = Key("Z", ctrl=True)
    assert press(hands, Key("Z")) is Outcome.PASSED
    assert press(hands, Key("Z", ctrl=True, shift=True)) is Outcome.TAKEN
    assert hands.message == "Nothing to bring back"
    assert press(hands, undo) is Outcome.TAKEN
    assert hands.message == "Nothing to take back"
    grabbed(hands)
    wait(hands, lambda: abs(turn_of("bone2")[1:]).max() > 0.01, "the arm bends")
    hands.grab()
    wait(hands, lambda: not hands.holding, "it lets go")
    bent = at_rest(hands)
    grabbed(hands)
    wait(hands, lambda: np.abs(turn_of("bone2") - bent).max() > 0.01, "it bends further")
    assert press(hands, undo) is Outcome.TAKEN
    hands.tick(TOLD, room())
    assert np.abs(turn_of("bone2") - bent).max() < 0.01
    wait(hands, lambda: not hands.holding, "the hand lets go")
    assert press(hands, Key("R")) is Outcome.TAKEN
    hands.tick(TOLD, room())
    assert abs(turn_of("bone2")[1:]).max() < 1e-5
    press(hands, undo)
    hands.tick(TOLD, room())
    assert np.abs(turn_of("bone2") - bent).max() < 0.01
    press(hands, undo)
    hands.tick(TOLD, room())
    assert abs(turn_of("bone2")[1:]).max() < 1e-5
    press(hands, undo)
    assert hands.message == "Nothing to take back"
    press(hands, Key("Z", ctrl=True, shift=True))
    hands.tick(TOLD, room())
    assert np.abs(turn_of("bone2") - bent).max() < 0.01
    # What was let go can be grabbed anew, by the same key.
    grabbed(hands)


def test_step_back_with_blenders_own_space_mouse() -> None:
    session = PuppetSession(arm(), bpy.context.scene, clock=None)
    now = 0.0
    hands = NdofHands(session, clock=lambda: now)
    try:
        hands.tick(TOLD)
        hands.move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, room(), TOLD)
        hands.grab()
        for _ in range(30):
            now += 1.0 / 60.0
            hands.move((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0 / 60.0, room(), TOLD)
            hands.tick(TOLD)
        assert abs(turn_of("bone2")[1:]).max() > 0.01
        press(hands, Key("Z", ctrl=True))
        assert hands.message == "Back"
        assert not hands.holding
        hands.tick(TOLD)
        assert abs(turn_of("bone2")[1:]).max() < 1e-5
    finally:
        hands.stop()
        session.cancel()


# --- Calibration ---------------------------------------------------------------------------------


@pytest.fixture
def on_stage(hands: DeviceHands, monkeypatch: pytest.MonkeyPatch) -> Iterator[DeviceHands]:
    """Devices as the operators find them."""
    monkeypatch.setattr(device_pose, "_going_on", [hands])
    yield hands
    device_store._path().unlink(missing_ok=True)


def calibrate(step: str) -> None:
    bpy.ops.octo_motion.device_calibrate(number=0, step=step)


def test_room_of_a_device_is_learned_used_kept_and_forgotten(on_stage: DeviceHands) -> None:
    hands = on_stage
    wait(hands, lambda: 0 in hands._spaces, "the hand is there")
    before = hands._spaces[0].scale
    calibrate("BEGIN")
    wait(hands, lambda: 0 in hands.client.calibrating, "it has begun")
    assert "Simulated hand: is being calibrated" in device_pose.line(hands)

    def has_gone_round() -> bool:
        learned = hands.client.calibrating[0].calibration()
        return learned.most[2] - learned.least[2] > 0.05

    wait(hands, has_gone_round, "the hand draws its circle")
    assert hands.client.pointers[0].body == -1
    calibrate("FINISH")
    wait(hands, lambda: "simulated" in hands.calibrations.learned, "it is learned")
    assert hands.message == "Calibrated: Simulated hand"
    learned = hands.calibrations.learned["simulated"]
    assert 0.05 < learned.width < 0.2
    assert load_calibrations() == {"simulated": learned}
    wait(hands, lambda: 0 in hands._spaces, "its room is laid anew")
    # As wide as the view is now what the hand has shown, not a desktop device's quarter metre.
    assert hands._spaces[0].scale == pytest.approx(before * 0.25 / learned.width, rel=1e-6)
    assert DeviceHands(hands.session, Client(), TOLD).calibrations.learned == {"simulated": learned}

    calibrate("RESET")
    assert load_calibrations() == {}
    wait(hands, lambda: 0 in hands._spaces, "its room is the maker's again")
    assert hands._spaces[0].scale == pytest.approx(before)
    with pytest.raises(RuntimeError, match="was not calibrated"):
        calibrate("RESET")
    assert hands.notices() == []


def test_calibration_that_was_kept_is_told_to_a_device_that_comes_again(
    on_stage: DeviceHands, monkeypatch: pytest.MonkeyPatch
) -> None:
    hands = on_stage
    wait(hands, hands.shown, "the hand is there")
    kept = Calibration(least=(-0.1,) * 6, most=(0.1,) * 6)  # pyright: ignore[reportArgumentType]
    hands.calibrations.learned = {"simulated": kept}
    sent: list[say.Message] = []
    send = hands.client.send
    monkeypatch.setattr(hands.client, "send", lambda each: (sent.append(each), send(each)))
    hands.client.restart()
    wait(hands, hands.shown, "the hand is back")
    hands.tick(TOLD, room())
    told = [each for each in sent if isinstance(each, say.CalibrationMessage)]
    assert [each.calibration() for each in told] == [kept]


def test_device_is_told_as_well_that_nothing_was_learned_of_it(
    hands: DeviceHands, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pointer's number may have been another device's, whose calibration would bend it."""
    sent: list[say.Message] = []
    send = hands.client.send
    monkeypatch.setattr(hands.client, "send", lambda each: (sent.append(each), send(each)))
    wait(hands, hands.shown, "the hand is there")
    hands.tick(TOLD, room())
    told = [each for each in sent if isinstance(each, say.CalibrationMessage)]
    assert [each.calibration() for each in told] == [NONE]


def test_two_blenders_keep_what_each_has_learned(on_stage: DeviceHands) -> None:
    hands = on_stage
    wait(hands, hands.shown, "the hand is there")
    other = Calibration(least=(-0.1,) * 6, most=(0.1,) * 6)  # pyright: ignore[reportArgumentType]
    device_store.save_calibrations({"another": other})  # as another Blender does meanwhile
    hands.calibrations.keep(hands.client.devices[0], Calibration())
    assert load_calibrations() == {"another": other, "simulated": Calibration()}
    calibrate("RESET")
    assert load_calibrations() == {"another": other}


def test_calibration_that_is_given_up_or_learned_nothing_changes_nothing(
    on_stage: DeviceHands,
) -> None:
    hands = on_stage
    with pytest.raises(RuntimeError, match="No device has the number 0"):
        calibrate("BEGIN")
    wait(hands, hands.shown, "the hand is there")
    with pytest.raises(RuntimeError, match="is not being calibrated"):
        calibrate("FINISH")
    calibrate("BEGIN")
    wait(hands, lambda: 0 in hands.client.calibrating, "it has begun")
    calibrate("CANCEL")
    wait(hands, lambda: 0 not in hands.client.calibrating, "it is over")
    assert hands.calibrations.learned == {}
    hands.client.calibrate(0, say.Order.BEGIN)
    hands.client.calibrate(0, say.Order.FINISH)
    wait(hands, lambda: hands.client.notices, "it says that nothing moved")
    assert "was not moved" in hands.notices()[0].problem
    assert hands.calibrations.learned == {}
    grabbed(hands)


def test_blenders_own_space_mouse_is_calibrated_by_its_driver(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session = PuppetSession(arm(), bpy.context.scene, clock=None)
    try:
        monkeypatch.setattr(device_pose, "_going_on", [NdofHands(session)])
        with pytest.raises(RuntimeError, match="with its own driver"):
            calibrate("BEGIN")
    finally:
        session.cancel()


def test_turn_of_blenders_space_mouse_is_the_caps_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender tells it against the cap, and both motions as strong as its preferences say."""
    session = PuppetSession(arm(), bpy.context.scene, clock=None)
    hands = NdofHands(session, clock=lambda: 0.0)
    try:
        monkeypatch.setattr("octo_motion.ui.posing.device_hands.ndof_sensitivities", lambda: (4, 2))
        # Half a push to the right; the cap turned to the left as seen from above, all the way.
        hands.move((2.0, 0.0, 0.0), (0.0, -2.0, 0.0), 0.1, room(), TOLD)
        assert hands.shown()[0].position == pytest.approx((0.5 * 0.4 * 0.1, 0.0, 1.3))
        half = 0.5 * TOLD.angular_speed * 0.1
        assert hands._turn == pytest.approx((np.cos(half), 0.0, 0.0, np.sin(half)))
    finally:
        session.cancel()


@dataclasses.dataclass
class Through:
    """A view through a camera, as Blender's window tells it."""

    window_matrix: Matrix
    view_matrix: Matrix
    view_distance: float = 3.0


CAMERA = Matrix.Translation((0.0, -9.0, 1.0)) @ Matrix.Rotation(np.pi / 2, 4, "X")
"""Nine metres before the origin."""


LENS = Matrix(((2.0, 0.0, 0.0, 0.0), (0.0, 3.0, 0.5, 0.0), (0.0, 0.0, -1.0, -0.2), (0, 0, -1, 0)))
FLAT = Matrix(((0.5, 0.0, 0.0, 0.0), (0.0, 0.75, 0.0, 0.5), (0.0, 0.0, -0.02, -1.0), (0, 0, 0, 1)))


@pytest.mark.parametrize("lens", [LENS, FLAT])
@pytest.mark.parametrize("figure", [(1.0, 0.0, 1.0), (-3.0, 200.0, 1.0), (0.0, -50.0, 1.0)])
def test_pointer_is_in_the_picture_of_a_camera(
    lens: Matrix, figure: tuple[float, float, float]
) -> None:
    """Not where the view turned before one looked through the camera."""
    seen = Through(lens, CAMERA.inverted())
    place = device_pose.camera_room(seen, 1.0, np.array(figure))
    np.testing.assert_allclose(place.axes, FRONT, atol=1e-6)

    def on_screen(point: np.ndarray) -> np.ndarray:
        told = np.array(lens @ seen.view_matrix) @ np.append(point, 1.0)
        return told[:2] / told[3]

    np.testing.assert_allclose(on_screen(place.middle), 0.0, atol=1e-6)
    side = place.middle + 0.5 * place.width * place.axes[:, 0]
    np.testing.assert_allclose(on_screen(side), [0.7, 0.0], atol=1e-6)
    depth, there = place.middle[1] + 9.0, figure[1] + 9.0
    assert depth == pytest.approx(there if there > 0.0 else 3.0, rel=0.1)
    twice = device_pose.camera_room(seen, 2.0, np.array(figure))
    assert twice.width == pytest.approx(2.0 * place.width)
    a_step = np.array([0.0, 0.01 * there, 0.0])
    moved = device_pose.camera_room(seen, 1.0, np.array(figure) + a_step)
    np.testing.assert_allclose(moved.middle, place.middle, err_msg="a step does not move the room")


def test_force_that_was_chosen_holds_when_another_file_is_opened(tmp_path: Path) -> None:
    """Whoever turned the force down must not feel all of it after File, Open."""
    path = str(tmp_path / "other.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    settings = device_settings(bpy.context.window_manager)
    settings.force, settings.toggle = 0.25, True
    try:
        bpy.ops.wm.open_mainfile(filepath=path)
        settings = device_settings(bpy.context.window_manager)
        assert (settings.force, settings.toggle) == (0.25, True)
        bpy.ops.wm.read_homefile()
        settings = device_settings(bpy.context.window_manager)
        assert (settings.force, settings.toggle) == (0.25, True)
    finally:
        settings.force, settings.toggle = 1.0, False


def test_settings_of_the_panel_are_told_in_the_bridges_units() -> None:
    settings = device_settings(bpy.context.window_manager)
    settings.force, settings.toggle, settings.speed, settings.reach = 0.5, True, 2.0, 0.1
    told = message(settings, 3.0)
    assert told.force == 0.5
    assert told.toggle
    assert told.speed == pytest.approx(0.8)
    assert told.reach == pytest.approx(0.3)
    settings.force, settings.toggle, settings.speed = 1.0, False, 1.0


def test_without_a_window_scripts_are_told_what_else_there_is() -> None:
    arm()
    with pytest.raises(RuntimeError, match="needs a 3D viewport"):
        bpy.ops.octo_motion.pose_device()
    for operator in (bpy.ops.octo_motion.device_test, bpy.ops.octo_motion.device_calibrate):
        with pytest.raises(RuntimeError, match="Start Pose with Device first"):
            operator()
