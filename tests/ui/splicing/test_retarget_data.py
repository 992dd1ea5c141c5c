# SPDX-License-Identifier: GPL-3.0-or-later
"""Real clips onto real game characters and back: feet stand, on the ground, and nothing pops."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from tests.referee.recording import Floats, Integers, moments, record

# Blender's importer leaves the file open.
pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning"),
    pytest.mark.one_blender,
]

SharedData = Callable[[str], Path]

OPERATORS: Any = bpy.ops.octo_motion

FEET = {
    "cmu/12_01_walk.bvh": ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"),
    "cmu/01_01_hops.bvh": ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"),
    "misc/assimp_Boxing_Toes.bvh": ("LeftHip", "LeftKnee", "LeftAnkle", "LeftToes"),
    "rigs_with_actions/RobotExpressive.glb": ("UpperLegL", "LowerLegL", "FootL", ""),
    "rigs_with_actions/KayKit_Knight.glb": ("upperleg.l", "lowerleg.l", "foot.l", "toes.l"),
}
"""Thigh, shin, foot and toes of the left leg."""


def brought(path: Path) -> Any:
    """The armature of a file, at the scene's frame rate."""
    before = set(bpy.data.objects)
    if path.suffix == ".bvh":
        OPERATORS.import_clips(filepath=str(path))
    else:
        bpy.ops.import_scene.gltf(filepath=str(path))
    made = [each for each in bpy.data.objects if each not in before and each.type == "ARMATURE"]
    armature: Any = made[0]
    for track in armature.animation_data.nla_tracks:
        track.mute = True
    return armature


def select(*armatures: Any) -> None:
    """Select these, the last one active."""
    for each in bpy.data.objects:
        each.select_set(each in armatures)
    bpy.context.view_layer.objects.active = armatures[-1]


def at_thirty() -> None:
    """Let the scene have 30 frames per second."""
    scene: Any = bpy.context.scene
    scene.render.fps = 30


def left_foot(
    armature: Any, name: str, first: int, last: int, per_frame: int = 1
) -> tuple[Floats, Floats, float]:
    """Ankle and ball (moments, 3), the ankle again without toes, and the length of the leg."""
    recording = record(armature, moments(first, last, per_frame), with_skin=False)
    bones = [each for each in FEET[name] if each]
    joints = [recording.heads[:, recording.names.index(each)] for each in bones]
    leg = sum(
        float(np.median(np.linalg.norm(lower - upper, axis=1)))
        for upper, lower in pairwise(joints[:3])
    )
    return joints[2], joints[-1], leg


def stands(place: Floats, leg: float, fps: float) -> list[Integers]:
    """Rows of frames in which a point hardly moves for a fifth of a second."""
    speed = np.linalg.norm(np.gradient(place, axis=0), axis=1) * fps / leg
    still = speed < 0.08
    edges = np.flatnonzero(np.diff(still.astype(int))) + 1
    runs = np.split(np.arange(len(place)), edges)
    return [rows for rows in runs if still[rows[0]] and len(rows) > 0.2 * fps]


ONTO = [each for each in FEET if not each.startswith("misc")]


def test_nobody_sinks_into_the_ground_whose_clip_drifts_upwards(shared_data: SharedData) -> None:
    """The dancer stands 15 cm higher in the middle of the clip than at its beginning and end."""
    name, onto = "animated_drawings/rokoko_jesse_dance.bvh", "rigs_with_actions/KayKit_Knight.glb"
    at_thirty()
    source, hero = brought(shared_data(name)), brought(shared_data(onto))
    rest = hero.matrix_world @ hero.data.bones[FEET[onto][-1]].head_local
    select(source, hero)
    OPERATORS.retarget()
    _, ball, leg = left_foot(hero, onto, 1, 302)
    # A pointed toe of a leg that swings low is no sunken foot.
    lowest = np.quantile(ball[:, 2], 0.02)
    assert lowest > rest.z - 0.05 * leg


def test_feet_stand_also_while_somebody_with_short_legs_crouches(shared_data: SharedData) -> None:
    """The boxer is knocked down; on his short legs and large feet the Knight folds them wholly."""
    name, onto = "misc/assimp_Boxing_Toes.bvh", "rigs_with_actions/KayKit_Knight.glb"
    at_thirty()
    source, hero = brought(shared_data(name)), brought(shared_data(onto))
    # Also between frames: motion blur looks there.
    _, ball, leg = left_foot(source, name, 760, 922, 2)
    select(source, hero)
    OPERATORS.retarget(source=source.name)
    _, ours, our_leg = left_foot(hero, onto, 760, 922, 2)
    holds = stands(ball, leg, 60.0)
    assert len(holds) > 2
    for rows in holds:
        assert np.linalg.norm(ours[rows] - ours[rows].mean(axis=0), axis=1).max() < 0.005 * our_leg


@pytest.mark.parametrize("onto", ONTO)
@pytest.mark.parametrize("name", ["cmu/12_01_walk.bvh", "cmu/01_01_hops.bvh"])
def test_feet_of_mocap_stand_on_any_body(shared_data: SharedData, name: str, onto: str) -> None:
    at_thirty()
    source, hero = brought(shared_data(name)), brought(shared_data(onto))
    first, last = (round(each) for each in source.animation_data.action.frame_range)
    last = min(last, first + 200)
    ankle, ball, leg = left_foot(source, name, first, last)
    select(source, hero)
    assert OPERATORS.retarget(source=source.name) == {"FINISHED"}
    ours, our_ball, our_leg = left_foot(hero, onto, first, last)
    # The file begins with a T-pose that jumps into the motion.
    holds = [rows for rows in stands(ball, leg, 30.0) if rows[0] > 3]
    assert holds
    if FEET[onto][3]:
        for rows in holds:
            off = np.linalg.norm(our_ball[rows] - our_ball[rows].mean(axis=0), axis=1)
            assert off.max() < 0.005 * our_leg
    ground = []
    for rows in stands(ankle, leg, 30.0):
        if rows[0] > 3 and np.ptp(ankle[rows, 2]) < 0.005 * leg:
            off = np.linalg.norm(ours[rows] - ours[rows].mean(axis=0), axis=1)
            assert off.max() < 0.005 * our_leg
            ground.append(float(np.median(ours[rows, 2])))
    assert not ground or np.ptp(ground) < 0.01 * our_leg


@pytest.mark.parametrize("onto", ONTO)
def test_a_treadmill_walk_goes_at_the_height_of_the_ground(
    shared_data: SharedData, onto: str
) -> None:
    """Nothing stands there, but the lowest a foot comes is the ground."""
    at_thirty()
    source = brought(shared_data("rigs_with_actions/KayKit_Knight.glb"))
    hero = brought(shared_data(onto))
    first, last = (round(each) for each in bpy.data.actions["Walking_A"].frame_range)
    select(source, hero)
    OPERATORS.retarget(source=source.name, action="Walking_A")
    walked, _, leg = left_foot(hero, onto, first, last)
    # How it stands when it does nothing.
    OPERATORS.retarget(source=source.name, action="Idle")
    stood, _, _ = left_foot(hero, onto, first, last)
    assert abs(np.quantile(walked[:, 2], 0.05) - np.median(stood[:, 2])) < 0.1 * leg
