# SPDX-License-Identifier: GPL-3.0-or-later
"""The referee sees what it is there to see: faults made on purpose, each of a known size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee import creature_measures as measures
from tests.referee.__main__ import beyond_limits, limit_of
from tests.referee.creatures import Figure
from tests.referee.held_ground import Held, HeldGround, held
from tests.referee.recording import Floats, Recording, Skin, moments, record
from tests.referee.surface import Surface

FPS = 24.0
ARM = ["a", "b", "c", "d"]
LENGTH = 1.0


def lying(heads: Floats, turns: Floats | None = None) -> Recording:
    """An arm of four bones along x, (moments, 3) where it begins; nothing else."""
    along = np.arange(5)[:, None] * [0.25, 0.0, 0.0]
    joints = heads[:, None] + along
    orientation = np.broadcast_to(np.eye(3), (len(heads), 4, 3, 3)) if turns is None else turns
    names, parents = ["body", *ARM], np.array([-1, 0, 1, 2, 3])
    # A body that travels, so that the arm may be carried along with it or not.
    body = np.arange(len(heads))[:, None] * [0.02, 0.0, 0.0] + [0.0, 0.0, 0.5]
    return Recording(
        frames=np.arange(len(heads), dtype=float),
        fps=FPS,
        names=names,
        parents=parents,
        heads=np.concatenate([body[:, None], joints[:, :-1]], axis=1),
        tails=np.concatenate([body[:, None] + [0.0, 0.0, 0.2], joints[:, 1:]], axis=1),
        turns=np.concatenate([np.broadcast_to(np.eye(3), (len(heads), 1, 3, 3)), orientation], 1),
        skins=[],
    )


def turned(angles: Floats) -> Floats:
    """(moments, 4, 3, 3): the last bone turned about x by so many degrees."""
    turns = np.broadcast_to(np.eye(3), (len(angles), 4, 3, 3)).copy()
    radians = np.radians(angles)
    turns[:, 3, 1, 1] = turns[:, 3, 2, 2] = np.cos(radians)
    turns[:, 3, 2, 1], turns[:, 3, 1, 2] = np.sin(radians), -np.sin(radians)
    return turns


def ground(rise: float = 0.0) -> Surface:
    """A square of ten metres, and if wanted a step of so much where x is 0."""
    xs = np.array([-5.0, 0.0, 0.0, 5.0])
    zs = np.array([0.0, 0.0, rise, rise])
    vertices = [(x, y, z) for x, z in zip(xs, zs, strict=True) for y in (-5.0, 5.0)]
    faces = [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(3)]
    mesh = bpy.data.meshes.new("ground")
    mesh.from_pydata(vertices, [], faces)
    made = bpy.data.objects.new("ground", mesh)
    scene: Any = bpy.context.scene
    scene.collection.objects.link(made)
    return Surface.of(made)


def test_an_arm_that_lies_still_neither_slips_nor_drifts() -> None:
    found = measures.resting(lying(np.zeros((48, 3))), [ARM], ground(), LENGTH)
    assert found.share > 0.9
    assert found.slip.value == found.drift.value == 0.0


def test_a_foot_that_creeps_is_seen_over_its_whole_hold() -> None:
    creep = np.linspace(0.0, 0.1, 48)[:, None] * [1.0, 0.0, 0.0]
    found = measures.resting(lying(creep), [ARM], ground(), LENGTH)
    assert found.slip.value == pytest.approx(0.1 / 47.0, rel=1e-6)
    assert found.drift.value == pytest.approx(0.1 * 23.0 / 47.0, rel=0.05)


def test_a_foot_that_slides_once_is_seen_in_that_frame() -> None:
    slide = np.zeros((48, 3))
    slide[20:, 1] = 0.006
    found = measures.resting(lying(slide), [ARM], ground(), LENGTH)
    assert found.slip.value == pytest.approx(0.006)
    assert found.slip.frame == 20.0


def test_what_the_body_carries_along_does_not_rest() -> None:
    carried = np.arange(48)[:, None] * [0.02, 0.0, 0.0]
    assert measures.resting(lying(carried), [ARM], ground(), LENGTH).share == 0.0


def test_what_is_in_the_air_does_not_rest() -> None:
    raised = np.tile([0.0, 0.0, 0.05], (48, 1))
    assert measures.resting(lying(raised), [ARM], ground(), LENGTH).share == 0.0


def line_of_skin(places: Floats) -> Skin:
    """Skin of an arm along x, (moments, 3) where it begins."""
    along = np.linspace(0.0, 0.999, 400)
    return Skin(
        points=places[:, None] + along[:, None] * [1.0, 0.0, 0.0],
        rest=along[:, None] * [1.0, 0.0, 0.0],
        edges=np.empty((0, 2), dtype=np.int64),
        faces=[],
        bones=1 + (along * 4.0).astype(int),
        web=np.zeros(len(along), dtype=bool),
    )


def held_on_a_wall(places: Floats) -> Held:
    """How an arm with a skin along its bones keeps to a wall that faces -y; (moments, 3) where the
    arm begins.
    """
    corners = 3.0 * np.array(
        [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]]
    )
    wall = np.broadcast_to(corners, (len(places), 4, 3))
    ground = HeldGround(wall, np.array([[0, 1, 2], [0, 2, 3]]), 1.0)
    return held(replace(lying(places), skins=[line_of_skin(places)]), [ARM], ground, LENGTH)


def test_an_arm_that_holds_a_wall_is_neither_in_it_nor_drifts() -> None:
    found = held_on_a_wall(np.tile([0.0, -0.005, 0.0], (48, 1)))
    assert found.holds == len(ARM)
    assert found.drift.value == found.sink.value == 0.0


@pytest.mark.parametrize("depth", [0.003, 0.2])
def test_skin_in_a_wall_is_as_deep_as_it_is_and_told_with_its_frame(depth: float) -> None:
    places = np.tile([0.0, -0.005, 0.0], (48, 1))
    places[31, 1] = depth
    found = held_on_a_wall(places)
    assert found.sink.value == pytest.approx(depth)
    assert found.sink.frame == 31.0


def test_an_arm_that_creeps_along_a_wall_is_seen_over_its_whole_hold() -> None:
    creep = np.linspace(0.0, 0.1, 48)[:, None] * [0.0, 0.0, 1.0] + [0.0, -0.005, 0.0]
    found = held_on_a_wall(creep)
    assert found.drift.value == pytest.approx(0.1 * 23.0 / 47.0, rel=0.05)


def test_what_is_farther_from_a_wall_than_skin_lies_does_not_hold_it() -> None:
    for far in (0.05, 0.8):
        found = held_on_a_wall(np.tile([0.0, -far, 0.0], (48, 1)))
        assert (found.holds, found.sink.value) == (0, 0.0)


def test_a_bone_that_turns_is_told_with_its_frame() -> None:
    angles = np.zeros(20)
    angles[11:] = 27.0
    worst = measures.turns(lying(np.zeros((20, 3)), turned(angles)))
    assert (worst.name, worst.frame) == ("d", 11.0)
    assert worst.value == pytest.approx(27.0)


def test_a_bone_that_rolls_while_its_ends_keep_still_is_told_and_one_that_swings_is_not() -> None:
    rolls = np.where(np.arange(48) >= 30, 40.0, 0.0)
    worst, mean = measures.rolling(lying(np.zeros((48, 3)), turned(rolls)), [ARM], LENGTH)
    assert (worst.name, worst.frame) == ("d", 30.0)
    assert worst.value == pytest.approx(40.0)
    assert 5.0 < mean < 40.0
    swings = np.arange(48)[:, None] * [0.001, 0.0, 0.0]
    assert measures.rolling(lying(swings, turned(rolls)), [ARM], LENGTH)[0].value == 0.0


def crept(places: Floats) -> float:
    """How far skin creeps that is an arm along x, (moments, 3) where it begins, on a plane."""
    return measures.creeping(
        replace(lying(places), skins=[line_of_skin(places)]), ground(), LENGTH
    ).value


def test_skin_that_creeps_while_it_touches_is_told_and_what_peels_off_is_not() -> None:
    steps = np.linspace(0.0, 0.02, 48)[:, None]
    assert crept(np.zeros((48, 3))) == 0.0
    # From the middle of the hold to its end, whose last moments are left out.
    assert crept(steps * [0.0, 1.0, 0.0]) == pytest.approx(0.01, rel=0.1)
    # Once it is off it does not matter where it goes.
    rising = np.where(np.arange(48) >= 24, 0.003, 0.0)[:, None] * [0.0, 0.0, 1.0]
    later = np.maximum(steps - steps[24], 0.0) * [0.0, 1.0, 0.0]
    assert crept(rising + later) == 0.0
    # Nor does skin that is carried along.
    assert crept(np.arange(48)[:, None] * [0.02, 0.0, 0.0]) == 0.0


def test_a_start_from_rest_is_sudden_and_a_swing_that_swells_is_not() -> None:
    still = np.zeros((20, 3))
    jerk = np.cumsum(np.where(np.arange(20) >= 10, 20.0, 1.0))
    swell = np.cumsum(np.minimum(20.0, 1.6 ** np.arange(20)))
    assert measures.sudden_starts(lying(still, turned(jerk))) == 1
    assert measures.sudden_starts(lying(still, turned(swell))) == 0


@pytest.mark.parametrize(("jump", "found"), [(0.0, 1.0), (40.0, 2.0)])
def test_what_does_not_halve_with_the_frame_rate_is_a_pop(jump: float, found: float) -> None:
    largest = []
    for rate in (24, 48, 96, 192):
        seconds = np.arange(2 * rate) / rate
        angles = 30.0 * np.sin(2.0 * np.pi * seconds) + jump * (seconds > 0.99)
        largest.append(measures.turns(lying(np.zeros((len(seconds), 3)), turned(angles))).value)
    assert measures.pop(largest) == pytest.approx(found, abs=0.2)


def test_a_tip_that_trembles_is_told_from_one_that_swings() -> None:
    seconds = np.arange(240) / FPS

    def shaken(rate: float) -> float:
        places = 0.1 * np.sin(2.0 * np.pi * rate * seconds)[:, None] * [0.0, 1.0, 0.0]
        return measures.jitter(lying(places), [ARM]).value

    assert shaken(1.0) < 0.01
    assert shaken(7.0) > 0.99


def test_depth_beside_a_stair_is_how_near_its_wall_is() -> None:
    stair = ground(rise=0.5)
    points = np.array([[0.01, 0.0, 0.1], [1.0, 0.0, 0.4], [-1.0, 0.0, 0.2], [-1.0, 0.0, -0.3]])
    depths = stair.depths(points)
    assert depths[[0, 1, 3]] == pytest.approx([0.01, 0.1, 0.3], abs=1e-6)
    assert depths[2] < 0.0


def test_played_bones_and_skin_are_those_of_the_evaluated_scene() -> None:
    bpy.ops.octo_motion.add_octopus(arms=4, joints=3)
    armature: Any = bpy.context.object
    pole: Any = bpy.data.objects.new("Pole", None)
    bpy.context.scene.collection.objects.link(pole)
    pole.location = (0.0, 0.0, -3.0)
    bone = next(each for each in armature.pose.bones if not each.children and each.parent)
    still = record(armature, moments(1, 2))
    bone.constraints.new("DAMPED_TRACK").target = pole
    played = record(armature, moments(1, 2))
    row = played.names.index(bone.name)
    assert measures.angles_between(still.turns[0, row], played.turns[0, row]) > 10.0
    assert any(
        np.abs(after.points - before.points).max() > 1e-3
        for before, after in zip(still.skins, played.skins, strict=True)
    )


def test_limits_are_a_little_above_what_is_and_no_number_passes_none() -> None:
    assert limit_of(10.0) == 11.0
    assert limit_of(0.0) < 0.01
    row = {"slip": vars(Figure(2.0)), "sink": vars(Figure(float("nan")))}
    assert beyond_limits("a", row, {"a": {"slip": 1.0, "sink": 1.0}}) == ["slip", "sink"]
    assert beyond_limits("a", row, {"a": {"slip": 3.0}}) == []
