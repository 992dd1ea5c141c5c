# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel tells is what one sees, as the referee does, who knows nothing of the add-on."""

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as referee
from tests.referee.recording import moments, record
from tests.referee.scenes import GROUNDS, Scene, build
from tests.referee.surface import Surface

pytestmark = pytest.mark.one_blender

SCENES = ("walk", "idle", "constrained walk")


def constrained(scene: Scene) -> None:
    """Let an arm hang down through the ground."""
    hook = bpy.data.objects.new("Hook", None)
    bpy.context.scene.collection.objects.link(hook)
    hook.rotation_euler = (-np.pi / 2.0, 0.0, 0.0)
    for name in scene.arms[2]:
        scene.armature.pose.bones[name].constraints.new("COPY_ROTATION").target = hook
    bpy.ops.octo_motion.generate_locomotion()


@pytest.mark.parametrize("name", SCENES)
def test_the_panel_and_the_referee_agree(name: str, add_on: Any) -> None:  # noqa: ARG001
    scene = build(name.removeprefix("constrained "), "plane")
    if name.startswith("constrained"):
        constrained(scene)
    told = {each.kind: each for each in scene.armature.octo_motion.locomotion.figures}
    played = record(scene.armature, moments(scene.start, scene.end))
    length, surface = referee.arm_length(played, scene.arms), Surface.of(scene.ground)
    turn = referee.turns(played)
    drift = referee.resting(played, scene.arms, surface, length).drift
    sink = referee.sink(played, surface, length).deepest
    assert np.degrees(told["TURN"].value) == pytest.approx(turn.value, rel=0.02)
    # It looks at the middles of bones, the panel at joints: ends of a hold differ a little.
    assert told["DRIFT"].value == pytest.approx(drift.value, abs=0.003)
    assert told["DEPTH"].value == pytest.approx(sink.value, rel=0.05, abs=0.002)
    if name.startswith("constrained"):
        assert told["DEPTH"].value > 0.2


def stepping(settings: Any) -> None:
    # Under who steps in place the ground goes by, and is level.
    settings.table.stride = 0.06


def staying(settings: Any) -> None:
    # What swims in place stays where the artist has put it.
    settings.travel_on = "NONE"


@pytest.mark.parametrize(
    ("name", "ground", "change"), [("swim", "plane", staying), ("idle", "slope", stepping)]
)
def test_arms_in_a_ground_that_nothing_holds_are_told(
    name: str,
    ground: str,
    change: Callable[[Any], None],
    add_on: Any,  # noqa: ARG001
) -> None:
    scene = build(name, ground, change=change)
    told = {each.kind: each for each in scene.armature.octo_motion.locomotion.figures}
    played = record(scene.armature, moments(scene.start, scene.end))
    length, surface = referee.arm_length(played, scene.arms), Surface.of(scene.ground)
    sink = referee.sink(played, surface, length).deepest
    assert sink.value > 0.1
    assert told["DEPTH"].value == pytest.approx(sink.value, rel=0.1, abs=0.002)


def test_beyond_the_edge_of_a_ground_there_is_no_depth(add_on: Any) -> None:  # noqa: ARG001
    scene = build("swim", "plane")
    settings = scene.armature.octo_motion.locomotion
    # What is left of it lies far aside.
    for vertex in scene.ground.data.vertices:
        vertex.co.x += 100.0
    scene.ground.data.update()
    bpy.ops.octo_motion.generate_locomotion()
    assert {each.kind: each.value for each in settings.figures}["DEPTH"] == 0.0


def test_a_cliff_that_breaks_the_walk_is_told_as_the_referee_sees_it(
    add_on: Any,  # noqa: ARG001
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(GROUNDS, "cliff", lambda x, y: 3.0 * (x > 0.0) + 0.0 * y)

    def upright(settings: Any) -> None:
        settings.ground.up = "WORLD"

    scene = build("walk", "cliff", change=upright)
    told = {each.kind: each for each in scene.armature.octo_motion.locomotion.figures}
    played = record(scene.armature, moments(scene.start, scene.end))
    turn = referee.turns(played)
    assert turn.value > 30.0
    assert np.degrees(told["TURN"].value) == pytest.approx(turn.value, rel=0.02)
    # The turn to a frame is told with the one before.
    assert told["TURN"].frame == turn.frame - 1
    # Depth is looked at between frames, too, where what breaks is deepest.
    halves = record(scene.armature, moments(scene.start, scene.end, 2))
    sink = referee.sink(halves, Surface.of(scene.ground), referee.arm_length(halves, scene.arms))
    assert told["DEPTH"].value > 0.05
    assert told["DEPTH"].value == pytest.approx(sink.deepest.value, rel=0.5)
    said = capfd.readouterr().out
    assert "The motion breaks: " in said
    deepest = told["DEPTH"]
    sunk = f"'{deepest.arm}' is {100.0 * deepest.value:.1f} % of its length below the ground"
    assert f"{sunk} at frame {deepest.frame}" in said
