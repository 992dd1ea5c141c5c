# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirror, balance, arcs and onion skins of a session."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import count
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.core.rotations import Floats
from octo_motion.device import bridge_process
from octo_motion.device.messages import Settings
from octo_motion.device.simulation import Simulation
from octo_motion.ui.posing.controls import PoseControls
from octo_motion.ui.posing.device_hands import DeviceHands
from octo_motion.ui.posing.overlay import overlay_lines
from octo_motion.ui.posing.puppet_session import PuppetSession
from tests.device.test_shared_session import hand_message, joined

TICK = 1.0 / 60.0
BONES = (
    ("hips", "", (0.0, 0.0, 1.0), (0.0, 0.0, 1.2)),
    ("chest", "hips", (0.0, 0.0, 1.2), (0.0, 0.0, 1.5)),
    ("arm.L", "chest", (0.1, 0.0, 1.5), (0.4, 0.0, 1.3)),
    ("hand.L", "arm.L", (0.4, 0.0, 1.3), (0.6, 0.0, 1.1)),
    ("leg.L", "hips", (0.12, 0.0, 1.0), (0.12, -0.05, 0.5)),
    ("foot.L", "leg.L", (0.12, -0.05, 0.5), (0.12, 0.0, 0.05)),
)


@pytest.fixture
def person() -> Any:
    data = bpy.data.armatures.new("Person")
    made: Any = bpy.data.objects.new("Person", data)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    made.rotation_euler = (0.0, 0.0, 0.6)
    bpy.ops.object.mode_set(mode="EDIT")
    for name, parent, head, tail in BONES:
        for side, sign in (("L", 1.0), ("R", -1.0)) if name.endswith(".L") else (("", 1.0),):
            bone = data.edit_bones.new(name[:-1] + side if side else name)
            bone.head, bone.tail = ((sign * at[0], at[1], at[2]) for at in (head, tail))
            above = parent[:-1] + side if parent.endswith(".L") else parent
            bone.parent = data.edit_bones.get(above)
    bpy.ops.object.mode_set(mode="OBJECT")
    made.octo_motion.posing.material = "DOLL"
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def session(person: Any) -> Iterator[PuppetSession]:
    made = PuppetSession(person, bpy.context.scene, clock=None)
    yield made
    made.cancel()


def tail(person: Any, bone: str) -> Floats:
    """In the armature's own space."""
    bpy.context.view_layer.update()
    return np.array(person.pose.bones[bone].tail)


def lead(
    session: PuppetSession, bone: str, by: tuple[float, float, float], ticks: int = 40
) -> None:
    start = session.grab_bone(bone, 1.0)
    for number in range(1, ticks + 1):
        session.tick(TICK, start + number / ticks * np.array(by))


def test_what_is_pulled_on_one_side_happens_on_the_other(
    person: Any, session: PuppetSession
) -> None:
    person.octo_motion.posing.mirror = True
    lead(session, "hand.L", (-0.1, -0.2, 0.4))
    session.release()
    for _ in range(10):
        session.tick(TICK)
    left, right = tail(person, "hand.L"), tail(person, "hand.R")
    assert left[2] > 1.25
    assert right * (-1.0, 1.0, 1.0) == pytest.approx(left, abs=1e-3)
    assert not session.core.world.grabs
    assert {"hand.L", "hand.R"} <= set(session.key())
    session.toggle_pin(session.body("foot.R"))
    assert {session.body("foot.L"), session.body("foot.R")} <= set(session.pins())


def test_without_mirror_the_other_side_stays(person: Any, session: PuppetSession) -> None:
    lead(session, "hand.L", (-0.1, -0.2, 0.4), 15)
    for bone in ("arm.R", "hand.R"):
        assert np.array(person.pose.bones[bone].matrix_basis) == pytest.approx(np.eye(4), abs=2e-3)


def offset(session: PuppetSession) -> float:
    """Metres from the centre of mass to the middle of what the figure stands on, from above."""
    balance = session.balance()
    return float(np.linalg.norm(balance.centre[:2] - balance.middle)) / session.unit


def test_balance_tells_whether_the_figure_would_stand(person: Any, session: PuppetSession) -> None:
    assert session.balance().room == -np.inf
    for foot in ("foot.L", "foot.R"):
        session.toggle_pin(session.body(foot))
    # Between two feet; measured by hand: the middle is at the feet's.
    assert session.balance().room > 0.0
    assert session.balance().centre[2] / session.unit == pytest.approx(1.0, abs=0.25)
    session.toggle_pin(session.body("foot.R"))
    assert session.balance().room < 0.0
    assert person is not None


def test_a_puppet_that_keeps_its_balance_gives_way_at_the_hips(person: Any) -> None:
    own = person.octo_motion.posing
    own.root, own.strength = "FREE", 0.2
    left: dict[str, float] = {}
    for mode in ("SHOWN", "KEPT"):
        own.balance = mode
        session = PuppetSession(person, bpy.context.scene, clock=None)
        for foot in ("foot.L", "foot.R"):
            session.toggle_pin(session.body(foot))
        start = session.grab_bone("chest", 1.0)
        for number in range(60):
            session.tick(TICK, start + min(number / 40, 1.0) * np.array([0.15, 0.2, 0.0]))
        left[mode] = offset(session)
        session.cancel()
    # Measured: 0.070 m off the feet's middle, and 0.035 m where it is kept.
    assert left["SHOWN"] > 0.04
    assert left["KEPT"] < 0.6 * left["SHOWN"]


def test_aids_are_drawn_where_they_are_wanted(person: Any, session: PuppetSession) -> None:
    own, scene = person.octo_motion.posing, bpy.context.scene
    controls, eye = PoseControls(session), np.array([0.0, -1.0, 0.0])
    session.key(all_bones=True)
    scene.frame_set(5)
    lead(session, "hand.L", (-0.1, -0.2, 0.3), 10)
    session.release()
    session.key()
    plain = len(overlay_lines(controls, eye))
    own.trails, own.onion, own.onion_step, own.balance = True, 2, 4, "SHOWN"
    lead(session, "hand.L", (0.1, 0.0, 0.1), 10)
    session.release()
    session.tick(TICK)
    # A ghost of frame 1, two arcs, the cross of the centre of mass.
    assert len(overlay_lines(controls, eye)) == plain + 4
    assert len(session.traces.hand) == 10
    assert [later for later, _ in session.traces.ghosts(3.0, 1, 2)] == [False, True]
    for lines, colours, _ in overlay_lines(controls, eye):
        assert np.isfinite(lines).all()
        assert lines.shape == (len(colours), 3)


@pytest.fixture
def _steady(monkeypatch: pytest.MonkeyPatch) -> None:
    """No clock lengthens the bridge's steps."""
    monkeypatch.setattr(bridge_process, "Simulation", partial(Simulation, clock=lambda: 0.0))


@pytest.mark.usefixtures("_steady")
def test_what_a_device_pulls_on_one_side_happens_on_the_other(
    person: Any, session: PuppetSession
) -> None:
    person.octo_motion.posing.mirror = True
    client, bridge, _ = joined()
    hands = DeviceHands(session, client, Settings(reach=0.2), partial(next, count(0.0, 0.016)))
    hands.tick(Settings(reach=0.2))
    bridge.turn(0.0)
    body, before = session.body("hand.L"), tail(person, "hand.L")
    start = np.array(person.matrix_world @ person.pose.bones["hand.L"].center) * session.unit
    way = np.array(person.matrix_world.to_3x3()) @ (-0.1, -0.2, 0.4) * session.unit
    for number in range(1, 481):  # so many steps of the bridge, of 2 ms
        at = start + min(1.0, number / 320) * way
        bridge._heard[0] = hand_message(2e-3 * number, int(number < 440), (at[0], at[1], at[2]))
        bridge.turn(2e-3 * number)
        if number % 8 == 0:
            hands.tick(Settings(reach=0.2))
        if number == 240:
            assert client.pointers[0].body == body
            assert len(session.core.world.grabs) == 1
            # What the mouse takes meanwhile changes nothing about that.
            session.release(session.take(session.body("chest"), np.zeros(3)))
    left, right = tail(person, "hand.L"), tail(person, "hand.R")
    assert np.linalg.norm(left - before) > 0.3
    # It does so a few redraws later, and clay remembers its way: 14 mm of one of 460.
    assert right * (-1.0, 1.0, 1.0) == pytest.approx(left, abs=0.03)
    assert not hands.holding
    assert not session.core.world.grabs
    assert {"hand.L", "hand.R"} <= set(session.key())
