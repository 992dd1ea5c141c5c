# SPDX-License-Identifier: GPL-3.0-or-later
"""Which armatures can be posed: linked ones, library overrides, odd ones, and rigs with limits."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.poses import pose_values
from octo_motion.core.errors import OctoMotionError
from octo_motion.ui.posing.puppet_session import PuppetSession, active_session

TICK = 1.0 / 60.0
STEPS = (
    {"do": "grab", "bone": "arm1.04.L", "at": 1.0},
    {"do": "pull", "by": [-0.1, 0.0, 0.1], "seconds": 0.2},
    {"do": "release"},
    {"do": "key"},
)

Play = Callable[[], set[str]]


@pytest.fixture
def play(tmp_path: Path) -> Play:
    path = tmp_path / "wave.json"
    script = {"format": "octo_motion.pose", "version": 1, "steps": STEPS}
    path.write_text(json.dumps(script), encoding="utf-8")
    return lambda: bpy.ops.octo_motion.pose_script(filepath=str(path))


def active(armature: Any) -> Any:
    bpy.context.view_layer.objects.active = armature
    return armature


def octopus() -> Any:
    bpy.ops.octo_motion.add_octopus(with_mesh=False, arms=4, joints=4)
    return bpy.context.object


@pytest.fixture
def linked(tmp_path: Path) -> Any:
    """An octopus that is linked from a file."""
    octopus()
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Octopus"]
    (found,) = wanted.objects
    bpy.context.scene.collection.objects.link(found)
    return active(found)


def refused(armature: Any, play: Play, said: str) -> None:
    """The mouse and scripts are refused with one sentence, and nothing is left behind."""
    before = pose_values(armature) if armature.pose else None
    with pytest.raises(OctoMotionError, match=said):
        PuppetSession(armature, bpy.context.scene)
    if bpy.ops.octo_motion.pose_script.poll():
        with pytest.raises(RuntimeError, match=said):
            play()
        with pytest.raises(RuntimeError, match=said):
            bpy.ops.octo_motion.pose_measure(bone="arm1.04.L")
    assert active_session() is None
    assert list(bpy.data.actions) == []
    if before is not None:
        assert pose_values(armature) == before


# --- Linked --------------------------------------------------------------------------------------


def test_linked_armature_is_refused_with_the_way_out(linked: Any, play: Play) -> None:
    refused(linked, play, "'Octopus' is linked .* read-only here. Make a library override")


def test_library_override_is_posed_and_keeps_pose_and_keys_in_its_file(
    linked: Any, play: Play, tmp_path: Path
) -> None:
    armature = active(linked.override_create(remap_local_usages=True))
    # What Blender's own Make Library Override does for the object that is active.
    armature.override_library.is_system_override = False
    before = pose_values(armature)
    assert play() == {"FINISHED"}
    bent = pose_values(armature)
    assert bent != before
    assert armature.animation_data.action.library is None
    bpy.ops.octo_motion.pose_measure(bone="arm1.02.L")
    path = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    opened: Any = next(each for each in bpy.data.objects if each.override_library)
    assert opened.octo_motion.posing.material == "CUSTOM"
    shown = opened.pose.bones["arm1.04.L"].matrix_basis
    assert abs(shown.to_quaternion().angle) > 0.01
    session = PuppetSession(opened, bpy.context.scene, clock=None)
    session.cancel()


def test_single_bones_of_linked_data_are_not_measured_but_the_figure_is(linked: Any) -> None:
    own = linked.copy()
    bpy.context.scene.collection.objects.link(own)
    active(own)
    with pytest.raises(RuntimeError, match=r"bones of .* are linked and read-only"):
        bpy.ops.octo_motion.pose_measure(bone="arm1.02.L", bone_only=True)
    assert bpy.ops.octo_motion.pose_measure(bone="arm1.02.L") == {"FINISHED"}
    assert own.octo_motion.posing.material == "CUSTOM"


def test_local_object_with_linked_bones_is_posed(linked: Any, play: Play) -> None:
    own = linked.copy()
    bpy.context.scene.collection.objects.link(own)
    active(own)
    assert play() == {"FINISHED"}
    assert own.animation_data.action


# --- Odd -----------------------------------------------------------------------------------------


def test_armature_without_bones_is_refused(play: Play) -> None:
    empty = bpy.data.objects.new("Empty", bpy.data.armatures.new("Empty"))
    bpy.context.scene.collection.objects.link(empty)
    refused(active(empty), play, "'Empty' has no bones")


@pytest.mark.parametrize(
    ("scale", "said"),
    [((0.0, 0.0, 0.0), "has no size"), ((1.0, 2.0, 1.0), "is scaled unequally")],
)
def test_armature_of_odd_scale_is_refused(
    play: Play, scale: tuple[float, float, float], said: str
) -> None:
    armature = octopus()
    armature.scale = scale
    bpy.context.view_layer.update()
    refused(armature, play, said)


def test_armature_in_a_session_is_not_posed_by_a_script(play: Play) -> None:
    armature = octopus()
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    with pytest.raises(RuntimeError, match="'Octopus' is being posed already"):
        play()
    assert active_session() is session
    session.cancel()


# --- Limits --------------------------------------------------------------------------------------


def arm(*, by: str) -> Any:
    """Two bones upright, the second an elbow that opens from 0° to 150° about X."""
    made: Any = bpy.data.objects.new("Arm", bpy.data.armatures.new("Arm"))
    bpy.context.scene.collection.objects.link(made)
    active(made)
    bpy.ops.object.mode_set(mode="EDIT")
    upper, lower = made.data.edit_bones.new("upper"), made.data.edit_bones.new("lower")
    upper.head, upper.tail, lower.tail = (0.0, 0.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.0, 0.6)
    lower.parent, lower.use_connect = upper, True
    bpy.ops.object.mode_set(mode="OBJECT")
    bone = made.pose.bones["lower"]
    bone.rotation_mode = "XYZ"
    end = np.radians(150.0)
    if by == "inverse kinematics":
        bone.use_ik_limit_x, bone.ik_min_x, bone.ik_max_x = True, 0.0, end
        bone.lock_ik_y = bone.lock_ik_z = True
    else:
        limit = bone.constraints.new("LIMIT_ROTATION")
        limit.owner_space, limit.max_x = "LOCAL", end
        limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    bpy.context.view_layer.update()
    return made


def led(armature: Any, angle: float) -> Any:
    """The elbow's angles, degrees, once its tip was led round by an angle."""
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    session.core.pin(session.body("upper"), state=True)
    session.core.change(step=4e-3)
    start = session.grab_bone("lower", 1.0)
    joint = np.array([0.0, 0.0, 0.3])
    for number in range(1, 55):
        turn = np.radians(angle) * min(number / 45.0, 1.0)
        arm = float((start - joint)[2])
        axis = np.array(armature.pose.bones["lower"].bone.matrix_local)[:3, 2]
        # About the bone's own X at rest.
        place = joint + arm * (np.cos(turn) * np.array([0.0, 0.0, 1.0]) + np.sin(turn) * axis)
        session.tick(TICK, place)
    session.release()
    angles = np.degrees(np.array(armature.pose.bones["lower"].matrix_basis.to_euler("XYZ")))
    session.cancel()
    return angles


@pytest.mark.parametrize("by", ["constraint", "inverse kinematics"])
def test_elbow_opens_as_far_as_the_rig_says_and_does_not_bend_backwards(by: str) -> None:
    armature = arm(by=by)
    assert led(armature, -80.0) == pytest.approx([0.0, 0.0, 0.0], abs=0.3)
    assert led(armature, 90.0) == pytest.approx([90.0, 0.0, 0.0], abs=8.0)
    opened = led(armature, 175.0)
    assert opened == pytest.approx([150.0, 0.0, 0.0], abs=0.3)
