# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a puppet pushes about, and two armatures in one session, as Blender shows them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.errors import OctoMotionError
from octo_motion.core.rotations import Floats
from octo_motion.device import bridge_process
from octo_motion.device.messages import Settings
from octo_motion.device.simulation import Simulation
from octo_motion.ui.posing.device_hands import DeviceHands
from octo_motion.ui.posing.puppet_session import PuppetSession, active_session
from tests.device.test_shared_session import hand_message, joined

TICK = 1.0 / 60.0


def arm(name: str, x: float = 0.0) -> Any:
    """Three bones along Y, half a metre above the floor, and a root below that is held."""
    data = bpy.data.armatures.new(name)
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    made.location = (x, 0.0, 0.15)
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for number in range(3):
        bone = data.edit_bones.new(f"part.{number}")
        bone.head, bone.tail = (0.0, 0.3 * number, 0.0), (0.0, 0.3 * number + 0.3, 0.0)
        bone.parent, bone.use_connect = parent, parent is not None
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    made.octo_motion.posing.floor = True
    made.octo_motion.posing.root = "PINNED"
    return made


def crate(name: str, at: tuple[float, float, float], size: float = 0.2, **marks: Any) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=size, location=at)
    made: Any = bpy.context.object
    made.name = name
    marked = {"obstacle": "BOX", "moves": "MOVES", "mass": 0.2} | marks
    for each, value in marked.items():
        setattr(made.octo_motion.posing, each, value)
    return made


@pytest.fixture
def figure() -> Any:
    return arm("Arm")


@pytest.fixture
def box(figure: Any) -> Any:
    """Beside the hand, on the floor."""
    made = crate("Box", (0.15, 0.8, 0.1))
    bpy.context.view_layer.objects.active = figure
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def session(figure: Any, box: Any) -> Iterator[PuppetSession]:  # noqa: ARG001
    made = PuppetSession(figure, bpy.context.scene, clock=None)
    yield made
    made.cancel()
    assert active_session() is None


def sweep(
    session: PuppetSession, bone: str, by: tuple[float, float, float], ticks: int = 45
) -> None:
    start = session.grab_bone(bone, 0.9)
    for number in range(1, ticks + 1):
        session.tick(TICK, start + number / ticks * np.array(by))


def place(item: Any) -> Floats:
    bpy.context.view_layer.update()
    return np.array(item.matrix_world.translation)


def frames_of(item: Any) -> set[str]:
    data = item.animation_data
    if data is None or data.action is None:
        return set()
    bags = data.action.layers[0].strips[0].channelbags
    return {curve.data_path for bag in bags for curve in bag.fcurves}


def test_a_box_is_pushed_keyed_and_put_back_with_the_pose(
    session: PuppetSession, figure: Any, box: Any
) -> None:
    start = place(box)
    sweep(session, "part.2", (0.3, -0.1, 0.0))
    session.release()
    pushed = place(box)
    assert pushed[0] > start[0] + 0.05
    assert pushed[2] == pytest.approx(0.1, abs=2e-3), "it slides on the floor"
    assert tuple(box.scale) == (1.0, 1.0, 1.0)
    keyed = session.key()
    assert {"Box", "part.2"} <= set(keyed)
    assert session.words_for(keyed).endswith("and 1 object at frame 1")
    assert frames_of(box) == {"location", "rotation_euler"}
    session.cancel()
    assert np.array_equal(place(box), start)
    assert not frames_of(box)
    assert not frames_of(figure)
    assert box.animation_data is None


def test_what_is_kept_stays_and_a_step_back_takes_the_box_along(
    session: PuppetSession, box: Any
) -> None:
    start = place(box)
    sweep(session, "part.2", (0.3, -0.1, 0.0))
    session.release()
    assert session.step_back()
    assert place(box) == pytest.approx(start, abs=1e-6)
    assert session.step_forward()
    pushed = place(box)
    session.finish()
    assert np.array_equal(place(box), pushed)


def test_keys_play_what_was_posed(session: PuppetSession, box: Any) -> None:
    scene = bpy.context.scene
    session.key(all_bones=True)
    scene.frame_set(10)
    sweep(session, "part.2", (0.3, -0.1, 0.0))
    session.release()
    session.key()
    pushed, turned = place(box), np.array(box.matrix_world)
    session.finish()
    scene.frame_set(1)
    assert place(box)[0] == pytest.approx(0.15)
    scene.frame_set(10)
    assert place(box) == pytest.approx(pushed, abs=1e-6)
    assert np.array(box.matrix_world) == pytest.approx(turned, abs=1e-6)


def test_what_is_recorded_moves_the_box_between_its_keys(session: PuppetSession, box: Any) -> None:
    scene = bpy.context.scene
    session.record()
    start = session.grab_bone("part.2", 0.9)
    seen = {1: place(box)}
    for frame in range(2, 31):
        for _ in range(3):
            session.tick(TICK, start + frame / 30 * np.array([0.3, -0.1, 0.0]))
        scene.frame_set(frame)
        seen[frame] = place(box)
    session.core.release()
    bones, _ = session.stop_record()
    assert bones >= 2
    session.finish()
    assert seen[30][0] > 0.2
    for frame, at in seen.items():
        scene.frame_set(frame)
        # As far off as a recording may be: 0.2 % of its size.
        assert place(box) == pytest.approx(at, abs=1e-3)


@pytest.mark.parametrize("kind", ["BOX", "SPHERE", "CAPSULE", "HULL", "MESH"])
def test_shapes_that_scale_turn_and_hang_on_something_stay_on_the_floor(
    figure: Any, kind: str
) -> None:
    """The object's own transform gets what moves it, whatever it hangs on, and no other scale."""
    box = crate("Box", (0.0, 0.0, 0.0), obstacle=kind, mass=0.0)
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler = (0.3, 0.6, 0.0), (0.2, 0.1, 0.7)
    box.parent = parent
    box.location, box.scale = (0.0, 0.0, 0.5), (1.0, 1.0, 2.0)
    box.rotation_mode = "QUATERNION"
    figure.octo_motion.posing.obstacle = "NONE"
    bpy.context.view_layer.update()
    session = PuppetSession(figure, bpy.context.scene, clock=None)
    for _ in range(90):
        session.tick(TICK)
    bpy.context.view_layer.update()
    corners = np.array([vertex.co for vertex in box.data.vertices])
    world = np.array(box.matrix_world)
    low = float((corners @ world[:3, :3].T + world[:3, 3])[:, 2].min())
    if kind in ("BOX", "HULL", "MESH"):
        assert low == pytest.approx(0.0, abs=1e-3)
    else:
        # A ball as large as its longest side, and a rod that has fallen over or stands.
        assert 0.099 < place(box)[2] < 0.201
    assert np.array(box.scale) == pytest.approx([1.0, 1.0, 2.0])
    session.cancel()
    assert tuple(box.location) == (0.0, 0.0, 0.5)


def test_a_thing_itself_can_be_carried_and_pinned(session: PuppetSession, box: Any) -> None:
    start = place(box)
    hit = session.pick(start + np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    assert hit is not None
    assert session.bone(hit.body) == "Box"
    session.take(hit.body, hit.point)
    for number in range(40):
        session.tick(TICK, hit.point / session.unit + np.array([0.0, 0.0, 0.01 * number]))
    assert place(box)[2] > 0.25
    session.toggle_pin(session.body("Box"))
    session.release()
    held = place(box)
    for _ in range(20):
        session.tick(TICK)
    assert place(box) == pytest.approx(held, abs=1e-4)


def test_two_armatures_touch_each_other_and_are_keyed_each(figure: Any) -> None:
    other = arm("Other", 0.2)
    other.scale, other.location = (0.5, 0.5, 0.5), (0.12, 0.2, 0.15)
    other.octo_motion.posing.strength = 0.3
    bpy.context.view_layer.update()
    session = PuppetSession(figure, bpy.context.scene, clock=None, partners=[other])
    before = np.array(other.pose.bones["part.0"].matrix)
    sweep(session, "part.1", (0.4, 0.0, 0.0))
    session.release()
    bpy.context.view_layer.update()
    assert np.abs(np.array(other.pose.bones["part.0"].matrix) - before).max() > 0.05
    start = session.grab_bone("Other: part.2", 1.0)
    bpy.context.view_layer.update()
    tip = other.matrix_world @ other.pose.bones["part.2"].tail
    assert start == pytest.approx(np.array(tip), abs=1e-4)
    for number in range(30):
        session.tick(TICK, start + number * np.array([0.0, 0.0, 0.003]))
    session.release()
    keyed = session.key()
    assert {"part.1", "Other: part.0", "Other: part.2"} <= set(keyed)
    assert frames_of(figure)
    assert frames_of(other)
    session.cancel()
    assert np.abs(np.array(other.pose.bones["part.0"].matrix_basis) - np.eye(4)).max() == 0.0
    assert not frames_of(other)


def test_a_joint_of_another_figure_is_not_measured_here(figure: Any) -> None:
    session = PuppetSession(figure, bpy.context.scene, clock=None, partners=[arm("Other", 1.0)])
    with pytest.raises(OctoMotionError, match="does not belong"):
        session.measure(session.body("Other: part.1"))
    session.cancel()


def test_what_cannot_be_pushed_is_said_before_anything_moves(figure: Any) -> None:
    box = crate("Box", (0.5, 0.5, 0.5), obstacle="PLANE")
    with pytest.raises(OctoMotionError, match="no end"):
        PuppetSession(figure, bpy.context.scene, clock=None)
    box.octo_motion.posing.obstacle = "BOX"
    box.constraints.new("LIMIT_LOCATION")
    with pytest.raises(OctoMotionError, match="Constraints hold"):
        PuppetSession(figure, bpy.context.scene, clock=None)
    with pytest.raises(OctoMotionError, match="twice"):
        PuppetSession(figure, bpy.context.scene, clock=None, partners=[figure])


def test_objects_are_marked_by_a_button(box: Any) -> None:
    box.octo_motion.posing.obstacle = "NONE"
    for each in bpy.context.scene.objects:
        each.select_set(each == box)
    assert bpy.ops.octo_motion.pose_loose(moves="FLOATS", mass=3.0) == {"FINISHED"}
    own = box.octo_motion.posing
    assert (own.moves, own.mass, own.obstacle) == ("FLOATS", 3.0, "HULL")


def test_a_script_poses_two_figures_with_two_hands_at_once(figure: Any, tmp_path: Path) -> None:
    other, box = arm("Other", 1.0), crate("Box", (0.2, 0.8, 0.1))
    bpy.context.view_layer.objects.active = figure
    path = tmp_path / "both.json"
    pull = {"do": "pull", "by": [0.1, 0.0, 0.1], "seconds": 0.4}
    steps = [
        {"do": "grab", "bone": "part.2", "at": 1.0, "hand": "left"},
        {"do": "grab", "bone": "Other: part.2", "at": 1.0, "hand": "right"},
        {**pull, "hand": "left", "meanwhile": True},
        {**pull, "hand": "right"},
        {"do": "release"},
        {"do": "grab", "bone": "Box"},
        {"do": "pull", "by": [0.0, 0.0, 0.2], "seconds": 0.3},
        {"do": "key"},
    ]
    script = {"format": "octo_motion.pose", "version": 1, "figures": ["Other"], "steps": steps}
    path.write_text(json.dumps(script), encoding="utf-8")
    ends = {
        each.name: np.array(each.matrix_world @ each.pose.bones["part.2"].tail)
        for each in (figure, other)
    }
    assert bpy.ops.octo_motion.pose_script(filepath=str(path)) == {"FINISHED"}
    bpy.context.view_layer.update()
    for each in (figure, other):
        gone = np.array(each.matrix_world @ each.pose.bones["part.2"].tail) - ends[each.name]
        assert gone[2] > 0.02
        assert frames_of(each)
    assert frames_of(box)
    script["figures"] = ["Nobody"]
    path.write_text(json.dumps(script), encoding="utf-8")
    with pytest.raises(RuntimeError, match="no such armature"):
        bpy.ops.octo_motion.pose_script(filepath=str(path))


# --- Devices -------------------------------------------------------------------------------------


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> None:
    """No clock lengthens the bridge's steps."""
    monkeypatch.setattr(bridge_process, "Simulation", partial(Simulation, clock=lambda: 0.0))


def lead_by_device(session: PuppetSession, figure: Any, bone: str, far: float) -> None:
    """A hand at a device takes hold of a bone's middle, goes so far along X, and lets go."""
    client, bridge, _ = joined()
    told = Settings(reach=0.2)
    hands = DeviceHands(session, client, told, partial(next, count(0.0, 0.016)))
    hands.tick(told)
    start = np.array(figure.matrix_world @ figure.pose.bones[bone].center) * session.unit
    way = np.array([far, 0.0, 0.0]) * session.unit
    for number in range(1, 401):  # so many steps of the bridge, of 2 ms
        at = start + min(1.0, number / 250) * way
        bridge._heard[0] = hand_message(2e-3 * number, int(number < 360), (at[0], at[1], at[2]))
        bridge.turn(2e-3 * number)
        if number % 8 == 0:
            hands.tick(told)
        if number == 100:
            assert client.pointers[0].body == session.body(bone)
            assert session.core.shared
    hands.tick(told)
    assert not hands.holding


@pytest.mark.usefixtures("steady")
def test_a_box_is_pushed_by_a_limb_that_a_device_leads(
    session: PuppetSession, figure: Any, box: Any
) -> None:
    start = place(box)
    lead_by_device(session, figure, "part.2", 0.3)
    pushed = place(box)
    assert pushed[0] > start[0] + 0.1, "measured: 0.28"
    assert pushed[2] == pytest.approx(0.1, abs=2e-3), "it slides on the floor"
    assert {"Box", "part.2"} <= set(session.key())
    assert frames_of(box) == {"location", "rotation_euler"}


@pytest.mark.usefixtures("steady")
def test_another_armature_is_pushed_by_a_limb_that_a_device_leads(figure: Any) -> None:
    other = arm("Other", 0.25)
    bpy.context.view_layer.update()
    session = PuppetSession(figure, bpy.context.scene, clock=None, partners=[other])
    before = np.array(other.pose.bones["part.2"].matrix)
    lead_by_device(session, figure, "part.2", 0.35)
    bpy.context.view_layer.update()
    after = np.array(other.pose.bones["part.2"].matrix)
    keyed = session.key()
    session.cancel()
    assert np.abs(after - before).max() > 0.15, "measured: 0.32"
    assert {"part.2", "Other: part.2"} <= set(keyed)
