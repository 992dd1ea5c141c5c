# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring a joint: with the mouse in a session, and in words."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.rig.puppet_reading import MATERIAL, bone_materials
from octo_motion.core.posing.puppet.materials import Material, joint_loads
from octo_motion.core.rotations import to_matrix
from octo_motion.ui.posing.controls import MEASURING, Outcome, PoseControls
from octo_motion.ui.posing.puppet_session import PuppetSession
from tests.core.world_probes import joint_turns
from tests.ui.posing.test_posing import MOVE, PIXELS, TICK, VIEW, Event, over, tip

BONE = "arm1.02.L"


@pytest.fixture
def session(octopus: Any) -> Iterator[PuppetSession]:
    made = PuppetSession(octopus, bpy.context.scene, clock=None)
    yield made
    made.abandon()


def settings_of(octopus: Any) -> Any:
    return octopus.octo_motion.posing


def begin(controls: PoseControls, bone: str = BONE) -> None:
    """Point at a limb and press M."""
    x, y = over(controls.session, bone)
    controls.handle(MOVE, VIEW, x, y)
    assert controls.handle(Event("M"), VIEW, x, y) is Outcome.TAKEN


def lead(controls: PoseControls, angle: float, seconds: float = 0.5, rest: float = 0.2) -> None:
    """Drag the tip of the arm round the measured joint, degrees seen from above, and let go."""
    session = controls.session
    assert session.measuring is not None
    joint = session.core.pose.positions[session.measuring.body] / session.unit
    x, y = over(session, "arm1.04.L")
    assert controls.handle(Event("LEFTMOUSE"), VIEW, x, y) is Outcome.TAKEN
    arm = np.array([x, y]) / PIXELS - joint[:2]
    count = round(seconds / TICK)
    for number in range(1, count + round(rest / TICK) + 1):
        turn = np.radians(angle) * min(number / count, 1.0)
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ arm
        controls.handle(MOVE, VIEW, *((joint[:2] + turned) * PIXELS))
        controls.tick(TICK)
    controls.handle(Event("LEFTMOUSE", "RELEASE"), VIEW, 0.0, 0.0)


def simulated(octopus: Any, bone: str, pull: float, seconds: float) -> tuple[float, float]:
    """Degrees of a bone's joint under a steady pull in loads of it, and once it rests."""
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    body = session.body(bone)
    session.core.pin(session.figure.parents[body], state=True)
    load = settings_of(octopus).strength * float(joint_loads(session.figure)[body])
    world = session.core.world
    start = joint_turns(world)[body]
    axis = np.array([0.0, 0.0, pull * load])
    most = 0.0
    for _ in range(round(seconds / TICK)):
        world.forces[body, 3:] = axis
        session.tick(TICK)
        most = _between(start, joint_turns(world)[body])
    world.forces[:] = 0.0
    for _ in range(90):
        session.tick(TICK)
    left = _between(start, joint_turns(world)[body])
    session.cancel()
    return most, left


def _between(first: Any, second: Any) -> float:
    return float(np.degrees(2.0 * np.arccos(min(abs(float(first @ second)), 1.0))))


# --- With the mouse ------------------------------------------------------------------------------


def test_limb_that_is_measured_is_bent_without_resistance_and_stands_as_before_afterwards(
    octopus: Any, controls: PoseControls
) -> None:
    start = tip(octopus)
    begin(controls)
    assert controls.help == MEASURING
    lead(controls, 35.0)
    assert controls.session.measuring is not None
    assert np.degrees(controls.session.measuring.angle) == pytest.approx(35.0, abs=1.0)
    assert np.linalg.norm(tip(octopus) - start) > 0.1
    assert "Measuring arm1.02.L" in controls.status()
    assert controls.handle(Event("ESC"), VIEW) is Outcome.TAKEN
    assert controls.session.measuring is None
    assert not controls.session.ended
    assert tip(octopus) == pytest.approx(start, abs=1e-5)
    assert settings_of(octopus).material == "CLAY"


def test_what_was_shown_with_the_mouse_is_what_the_joint_then_does(
    octopus: Any, controls: PoseControls
) -> None:
    begin(controls)
    lead(controls, 40.0, seconds=0.4, rest=0.0)
    lead(controls, -15.0, seconds=0.1)
    controls.handle(Event("M"), VIEW)
    assert "K_f" in controls.status()
    settings = settings_of(octopus)
    assert settings.material == "CUSTOM"
    assert settings.custom_yields
    controls.session.finish()
    most, left = simulated(octopus, BONE, 2.0, 0.4)
    # Within what the arm's inertia adds, and ticks of a sixtieth.
    assert most == pytest.approx(40.0, rel=0.1)
    assert left == pytest.approx(25.0, rel=0.1)


def test_wheel_says_how_hard_the_pull_is(controls: PoseControls) -> None:
    begin(controls)
    assert controls.handle(Event("WHEELUPMOUSE"), VIEW) is Outcome.TAKEN
    assert "pulled by 2.25 of what hangs on it" in controls.status()
    for _ in range(20):
        controls.handle(Event("WHEELDOWNMOUSE"), VIEW)
    assert controls.session.measuring is not None
    assert controls.session.measuring.pull > 0.0


def test_shift_m_measures_one_joint_alone(octopus: Any, controls: PoseControls) -> None:
    begin(controls)
    lead(controls, 30.0)
    before = controls.session.figure.elements.yield_torque.copy()
    controls.handle(Event("M", shift=True), VIEW)
    assert settings_of(octopus).material == "CLAY"
    assert set(bone_materials(octopus)) == {BONE}
    changed = np.flatnonzero(controls.session.figure.elements.damping != 0.0)
    assert len(changed)
    body = controls.session.body(BONE)
    others = np.arange(len(before)) != body
    now = controls.session.core.world.figure.elements
    assert now.yield_torque[others] == pytest.approx(before[others])
    # It holds from the start of the next session on.
    controls.session.finish()
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    assert session.figure.elements.flow[body] != pytest.approx(now.flow[body - 1])
    session.cancel()


@pytest.mark.parametrize("shift", [False, True])
def test_esc_of_the_session_takes_the_measured_material_back(octopus: Any, shift: bool) -> None:  # noqa: FBT001
    settings = settings_of(octopus)
    settings.material = "WIRE"
    before = settings.custom_springs
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    controls = PoseControls(session)
    begin(controls)
    lead(controls, 30.0)
    controls.handle(Event("M", shift=shift), VIEW)
    session.cancel()
    assert settings.material == "WIRE"
    assert settings.custom_springs == before
    assert bone_materials(octopus) == {}


def test_drag_that_bends_nothing_is_said_and_changes_nothing(
    octopus: Any, controls: PoseControls
) -> None:
    begin(controls)
    controls.handle(Event("M"), VIEW)
    assert "The drag has bent nothing" in controls.status()
    begin(controls)
    lead(controls, 0.2)
    controls.handle(Event("RET"), VIEW)
    assert "The drag has bent nothing" in controls.status()
    begin(controls)
    lead(controls, 30.0)
    lead(controls, -20.0, seconds=0.2, rest=0.0)
    controls.handle(Event("M"), VIEW)
    assert "still moving" in controls.status()
    assert settings_of(octopus).material == "CLAY"


def test_limb_without_a_joint_is_not_measured(controls: PoseControls) -> None:
    session = controls.session
    body = session.body("body")
    controls.hover = body
    controls.handle(Event("M"), VIEW)
    assert session.measuring is None
    assert "hangs on no other limb" in controls.status()
    controls.handle(MOVE, VIEW, 4000.0, 4000.0)
    controls.handle(Event("M"), VIEW, 4000.0, 4000.0)
    assert "Point at a limb" in controls.status()


def test_another_limb_cannot_be_dragged_meanwhile(controls: PoseControls) -> None:
    begin(controls)
    controls.handle(Event("LEFTMOUSE"), VIEW, *over(controls.session, "arm2.03.R"))
    assert not controls.holding
    assert "Drag arm1.02.L" in controls.status()
    for kind in ("G", "K", "P", "O", "R"):
        assert controls.handle(Event(kind), VIEW) is Outcome.TAKEN
    assert not controls.session.recording


def test_recording_and_measuring_do_not_mix(controls: PoseControls) -> None:
    controls.handle(Event("O"), VIEW)
    begin(controls)
    assert controls.session.measuring is None
    assert "A recording is going on" in controls.status()


def test_another_frame_ends_measuring(controls: PoseControls) -> None:
    begin(controls)
    lead(controls, 30.0)
    bpy.context.scene.frame_set(7)
    controls.tick(TICK)
    assert controls.session.measuring is None
    assert not controls.holding
    assert controls.help != MEASURING


# --- In words ------------------------------------------------------------------------------------


@pytest.mark.one_blender
def test_joint_does_what_was_said_of_it(octopus: Any) -> None:
    asked = {"bends": np.radians(50.0), "stays": np.radians(30.0), "pull": 3.0, "seconds": 0.5}
    for strength in (1.0, 4.0):
        settings_of(octopus).strength = strength
        assert bpy.ops.octo_motion.pose_measure(bone=BONE, **asked) == {"FINISHED"}
        most, left = simulated(octopus, BONE, 3.0, 0.5)
        assert most == pytest.approx(50.0, rel=0.08)
        assert left == pytest.approx(30.0, rel=0.08)
    # Every joint of the figure gives way as this one does, pulled in the weight of what it carries.
    most, left = simulated(octopus, "arm2.03.R", 3.0, 0.5)
    assert left == pytest.approx(30.0, rel=0.1)


def test_joint_that_keeps_nothing_springs_back_always(octopus: Any) -> None:
    bpy.ops.octo_motion.pose_measure(bone=BONE, stays=0.0)
    assert not settings_of(octopus).custom_yields
    most, left = simulated(octopus, BONE, 2.0, 0.5)
    # The rest of the arm swings on springs of its own.
    assert most == pytest.approx(30.0, rel=0.15)
    assert left < 1.5


def test_active_bone_is_measured_and_one_bone_alone_if_wanted(octopus: Any) -> None:
    with pytest.raises(RuntimeError, match="No bone is active"):
        bpy.ops.octo_motion.pose_measure()
    bpy.ops.object.mode_set(mode="POSE")
    octopus.data.bones.active = octopus.data.bones[BONE]
    assert bpy.ops.octo_motion.pose_measure(bone_only=True) == {"FINISHED"}
    assert set(bone_materials(octopus)) == {BONE}
    assert settings_of(octopus).material == "CLAY"
    assert bpy.ops.octo_motion.pose_forget_measured() == {"FINISHED"}
    assert MATERIAL not in octopus.data.bones[BONE]
    with pytest.raises(RuntimeError, match="No bone has a material of its own"):
        bpy.ops.octo_motion.pose_forget_measured()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"bone": "nose"}, "has no bone 'nose'"),
        ({"bone": "body"}, "hangs on no other limb"),
        ({"bends": 0.0, "stays": 0.0}, "The joint is not bent"),
        ({"bends": 0.3, "stays": 0.5}, "More of the bend stays"),
        ({"pull": 1.0}, "no stronger than what the joint bears"),
    ],
)
def test_bend_that_makes_no_sense_changes_nothing(
    octopus: Any, given: dict[str, Any], said: str
) -> None:
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.octo_motion.pose_measure(**{"bone": BONE, **given})
    assert settings_of(octopus).material == "CLAY"
    assert bone_materials(octopus) == {}


def test_measuring_in_words_counts_in_a_session_that_is_going_on(
    octopus: Any, session: PuppetSession
) -> None:
    before = session.figure.elements.stiffness.copy()
    bpy.ops.octo_motion.pose_measure(bone=BONE)
    assert not np.allclose(session.figure.elements.stiffness, before)
    session.tick(TICK)
    session.cancel()
    assert settings_of(octopus).material == "CLAY"


def test_measured_material_is_kept_with_the_file(octopus: Any, tmp_path: Path) -> None:
    name = octopus.name
    bpy.ops.octo_motion.pose_measure(bone=BONE, stays=0.0, bone_only=True)
    bpy.ops.octo_motion.pose_measure(bone=BONE)
    springs, own = settings_of(octopus).custom_springs, bone_materials(octopus)
    path = str(tmp_path / "measured.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    opened = bpy.data.objects[name]
    assert settings_of(opened).custom_springs == springs
    assert bone_materials(opened) == own
    material = own[BONE]
    assert isinstance(material, Material)
    assert np.isinf(material.bears)


def test_damaged_material_of_a_bone_counts_for_nothing(octopus: Any) -> None:
    for wrong in ("clay", [1.0, 2.0], [1.0, 0.0, 0.1, 1.0], 3.0):
        octopus.data.bones[BONE][MATERIAL] = wrong
        assert bone_materials(octopus) == {}


# --- In numbers ----------------------------------------------------------------------------------

TYPED = {
    "stiffness": (20.0, 500.0, 30.0),
    "damping": (0.4, 5.0, 0.6),
    "flow": (0.5, 50.0, 2.0),
    "yield_torque": 0.25,
}


def test_typed_coefficients_are_those_of_the_joint_whatever_the_strength(octopus: Any) -> None:
    settings_of(octopus).strength = 3.0
    assert bpy.ops.octo_motion.pose_coefficients(bone=BONE, **TYPED) == {"FINISHED"}
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    body, elements = session.body(BONE), session.figure.elements
    for name in ("stiffness", "damping", "flow", "yield_torque"):
        assert getattr(elements, name)[body] == pytest.approx(TYPED[name])
    session.cancel()
    assert set(bone_materials(octopus)) == {BONE}
    assert bpy.ops.octo_motion.pose_forget_measured() == {"FINISHED"}
    assert bone_materials(octopus) == {}


@pytest.mark.one_blender
def test_joint_gives_way_about_each_axis_of_its_bone_as_it_was_typed(octopus: Any) -> None:
    bpy.ops.octo_motion.pose_coefficients(bone=BONE, **TYPED)
    session = PuppetSession(octopus, bpy.context.scene, clock=None)
    body = session.body(BONE)
    session.core.pin(session.figure.parents[body], state=True)
    turned = []
    for axis in range(3):
        before = joint_turns(session.core.world)[body]
        bone = to_matrix(session.core.pose.orientations[body])[:, axis]
        session.core.world.forces[body, 3:] = 0.5 * bone
        session.core.wake()
        for _ in range(30):
            session.tick(TICK)
        session.core.world.forces[:] = 0.0
        for _ in range(30):
            session.tick(TICK)
        turned.append(_between(before, joint_turns(session.core.world)[body]))
    session.cancel()
    # Above yield by 0.25 N·m for half a second: 0.25 · 0.5/D_d, 14° about X, 0.14° twist, 3.6°.
    assert turned == pytest.approx(np.degrees([0.25, 0.0025, 0.0625]), rel=0.15, abs=0.1)


def test_typed_coefficients_count_in_a_session_and_are_taken_back_with_it(
    octopus: Any, session: PuppetSession
) -> None:
    bpy.ops.octo_motion.pose_coefficients(bone=BONE, yields=False)
    body = session.body(BONE)
    assert np.isinf(session.figure.elements.yield_torque[body])
    session.tick(TICK)
    session.cancel()
    assert bone_materials(octopus) == {}


def test_typed_coefficients_are_kept_with_the_file(octopus: Any, tmp_path: Path) -> None:
    name = octopus.name
    bpy.ops.octo_motion.pose_coefficients(bone=BONE, **TYPED)
    own = bone_materials(octopus)
    path = str(tmp_path / "typed.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bone_materials(bpy.data.objects[name]) == own


@pytest.mark.parametrize(
    "wrong", [[1.0] * 9, [1.0] * 6 + [0.0] * 3 + [1.0], [-1.0] * 10, [float("nan")] * 10]
)
def test_damaged_coefficients_of_a_bone_count_for_nothing(octopus: Any, wrong: list[float]) -> None:
    octopus.data.bones[BONE][MATERIAL] = wrong
    assert bone_materials(octopus) == {}
