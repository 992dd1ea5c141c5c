# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions that begin and end in a pose of the artist's, as Blender plays them."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.ui.locomotion.settings import locomotion_settings
from tests.referee.scenes import build
from tests.ui.rig import click, generate, keys

pytestmark = pytest.mark.one_blender

ARM = 0.6
"""Metres that the octopus' arms are long."""
EXACT = 1e-4
"""Radians, and arm lengths."""

Played = dict[str, np.ndarray]
"""World matrices (4, 4) of all bones."""


@pytest.fixture
def octopus() -> Any:
    bpy.ops.octo_motion.add_octopus(with_mesh=True)
    armature: Any = bpy.context.object
    click("detect_arms")
    click("add_route")
    bpy.context.view_layer.objects.active = armature
    return armature


def shown(armature: Any) -> Played:
    """What is seen now."""
    bpy.context.view_layer.update()
    seen = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = np.array(seen.matrix_world)
    return {bone.name: world @ np.array(bone.matrix) for bone in seen.pose.bones}


def played(armature: Any, frame: float) -> Played:
    bpy.context.scene.frame_set(int(frame))
    return shown(armature)


def contort(armature: Any, seed: int, place: Iterable[float]) -> Played:
    """Pose all bones at random, somewhere."""
    random = np.random.default_rng(seed)
    for bone in armature.pose.bones:
        bone.rotation_mode = "QUATERNION"
        axis, half = random.normal(size=3), random.uniform(-0.3, 0.3)
        bone.rotation_quaternion = (np.cos(half), *(np.sin(half) * axis / np.linalg.norm(axis)))
    armature.pose.bones["mantle"].scale = 1.1, 0.9, 1.05
    armature.location = tuple(place)
    return shown(armature)


def turns(one: Played, other: Played) -> dict[str, float]:
    """Radians that bones are turned by from one to the other."""
    found = {}
    for name, matrix in one.items():
        first, second = (
            each[:3, :3] / np.linalg.norm(each[:3, :3], axis=0) for each in (matrix, other[name])
        )
        # By the chord: the cosine has no digits left where they are alike.
        found[name] = 2.0 * np.arcsin(min(np.linalg.norm(first - second) / np.sqrt(8.0), 1.0))
    return found


def assert_alike(one: Played, other: Played, exact: float = EXACT) -> None:
    assert max(turns(one, other).values()) < exact
    assert max(np.abs(one[name][:3, 3] - other[name][:3, 3]).max() for name in one) < exact * ARM


def fastest(armature: Any, frames: range) -> float:
    """Degrees that a bone turns at most from frame to frame; lids shut at once."""
    poses = [played(armature, frame) for frame in frames]
    return float(
        np.degrees(
            max(
                turn
                for one, other in pairwise(poses)
                for name, turn in turns(one, other).items()
                if "eye" not in name
            )
        )
    )


@pytest.mark.parametrize(
    ("setup", "trail"), [("walk", False), ("crawl", False), ("swim", False), ("swim", True)]
)
def test_motion_begins_and_ends_in_contorted_poses_and_nothing_snaps(
    octopus: Any, setup: str, *, trail: bool
) -> None:
    settings: Any = locomotion_settings(octopus)
    bpy.ops.octo_motion.setup_load(name=setup)
    settings.body.trail = trail
    first = contort(octopus, 3, (0.1, 0.05, 0.3))
    click("pose_take", at="BEGIN")
    last = contort(octopus, 5, (0.2, -3.0, 0.3))
    click("pose_take", at="END")
    action = generate(octopus)
    start, end = int(action.frame_start), int(action.frame_end)
    assert_alike(played(octopus, start), first)
    assert_alike(played(octopus, end), last)
    frames = settings.begin_pose.frames
    # Measured: 28° in Walk, 13° in Crawl, 28° in Swim, 29° where its arms trail.
    assert fastest(octopus, range(start, start + frames + 2)) < 30.0
    assert fastest(octopus, range(end - frames - 2, end + 1)) < 30.0


@pytest.mark.parametrize(
    ("setup", "ground", "ends"),
    [
        ("prowl", "slope", ("BEGIN", "END")),
        ("crawl", "stairs", ("BEGIN",)),
        ("walk", "stairs", ("END",)),
        ("prowl", "plane", ("END",)),
    ],
)
def test_arms_that_stand_in_a_pose_do_not_snap_as_the_body_leaves_them(
    setup: str, ground: str, ends: tuple[str, ...]
) -> None:
    def change(settings: Any) -> None:
        random = np.random.default_rng(7)
        for bone in settings.id_data.pose.bones:
            if bone.name.startswith("arm"):
                bone.rotation_mode = "XYZ"
                bone.rotation_euler = random.uniform(-0.25, 0.25, 3) * (1.0, 0.2, 1.0)
        bpy.context.view_layer.update()
        for at in ends:
            click("pose_take", at=at)

    scene = build(setup, ground, change=change)
    armature, settings = scene.armature, locomotion_settings(scene.armature)
    if "BEGIN" in ends:
        over = scene.start + settings.begin_pose.frames + 2
        # Measured: 25.4°, 27.4°; it was 47°, 38°.
        assert fastest(armature, range(scene.start, over)) < 30.0
    if "END" in ends:
        over = scene.end - settings.end_pose.frames - 2
        # Measured: 24.7°, 27.1°, 25.7°; it was up to 55°, 59°.
        assert fastest(armature, range(over, scene.end + 1)) < 30.0


def test_loop_in_place_begins_in_a_pose_and_does_not_repeat_it(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    bpy.ops.octo_motion.setup_load(name="idle")
    settings.travel_on, settings.cycles = "NONE", 2
    plain = generate(octopus)
    last = played(octopus, plain.frame_end)
    first = contort(octopus, 3, (0.1, 0.05, 0.3))
    click("pose_take", at="BEGIN")
    settings.begin_pose.frames = 48
    action = generate(octopus)
    assert_alike(played(octopus, action.frame_start), first)
    assert fastest(octopus, range(1, 51)) < 30.0
    now = played(octopus, action.frame_end)
    assert max(turns(now, last).values()) < EXACT
    assert not any(
        len(curve.modifiers)
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        for curve in bag.fcurves
    )


def test_walk_goes_on_from_a_frame_of_another_action(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    before = generate(octopus)
    before.name, before.use_fake_user = "Before", True
    wanted = played(octopus, 90)
    # It is the artist's own now, and another is made.
    settings.result = None
    octopus.animation_data.action = None
    settings.begin_pose.action, settings.begin_pose.frame = before, 90.0
    settings.begin_pose.frames = 36
    settings.frame_start = 200
    action = generate(octopus)
    assert action != before
    assert_alike(played(octopus, 200), wanted)
    # Measured: 27°, as it is carried back by 1.5 arm lengths.
    assert fastest(octopus, range(200, 240)) < 30.0


def test_arms_stand_and_step_over_one_after_the_other(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    before = generate(octopus)
    before.use_fake_user = True
    bpy.context.scene.frame_set(40)
    click("pose_take", at="BEGIN")
    settings.begin_pose.frames = 36
    generate(octopus)
    arms = [[bone.name for bone in item.bones][5:] for item in settings.arms]
    joints = np.array(
        [
            [[played_pose[name][:3, 3] for name in arm] for arm in arms]
            for played_pose in (played(octopus, frame) for frame in range(1, 38))
        ]
    )
    moved = np.linalg.norm(np.diff(joints, axis=0), axis=-1).min(axis=2) / ARM
    # Of eight, some step and the others stand.
    assert (moved < 0.003).sum(axis=1).min() >= 3
    figures = {each.kind: each.value for each in settings.figures}
    assert figures["SLIP"] < 0.005
    assert figures["DEPTH"] < 0.01


def test_few_keys_begin_in_the_pose_too(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    first = contort(octopus, 3, (0.1, 0.05, 0.3))
    click("pose_take", at="BEGIN")
    settings.keys = "REDUCED"
    action = generate(octopus)
    assert max(turns(played(octopus, action.frame_start), first).values()) < np.radians(6.0)


def test_root_bone_takes_the_body_from_its_place(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    settings.travel_on, settings.root_bone = "BONE", "root"
    contort(octopus, 3, (0.0, 0.0, 0.0))
    octopus.pose.bones["root"].location = 0.1, 0.2, 0.05
    first = shown(octopus)
    click("pose_take", at="BEGIN")
    action = generate(octopus)
    assert_alike(played(octopus, action.frame_start), first)


def test_body_is_on_its_route_at_once_without_its_place(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    generate(octopus)
    there = np.array(octopus.matrix_world.translation)
    bpy.context.scene.frame_set(1)
    there = np.array(octopus.matrix_world.translation)
    contort(octopus, 3, (2.0, 2.0, 2.0))
    click("pose_take", at="BEGIN")
    settings.begin_pose.with_place = False
    generate(octopus)
    bpy.context.scene.frame_set(1)
    np.testing.assert_allclose(octopus.matrix_world.translation, there, atol=1e-5)
    assert octopus.pose.bones["mantle"].scale[0] == pytest.approx(1.1, abs=1e-5)


def test_poses_share_a_motion_that_is_shorter_than_both(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    settings.timing, settings.frame_end = "RANGE", 60
    first = contort(octopus, 3, (0.1, 0.05, 0.3))
    click("pose_take", at="BEGIN")
    last = contort(octopus, 5, (0.2, -3.0, 0.3))
    click("pose_take", at="END")
    settings.begin_pose.frames = settings.end_pose.frames = 100
    generate(octopus)
    assert_alike(played(octopus, 1), first)
    assert_alike(played(octopus, 60), last)


def test_a_motion_cannot_begin_in_a_pose_of_its_own(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    settings.begin_pose.action = generate(octopus)
    with pytest.raises(RuntimeError, match="pose of its own"):
        bpy.ops.octo_motion.generate_locomotion()


def test_a_taken_pose_stays_whatever_is_generated_and_set_ups_leave_it(octopus: Any) -> None:
    settings: Any = locomotion_settings(octopus)
    plain = keys(generate(octopus))
    contort(octopus, 3, (0.1, 0.05, 0.3))
    click("pose_take", at="BEGIN")
    taken = settings.begin_pose.action
    first = keys(generate(octopus))
    again = keys(generate(octopus))
    assert all(np.array_equal(first[each], again[each]) for each in first)
    bpy.ops.octo_motion.setup_load(name="walk")
    assert settings.begin_pose.action == taken
    settings.begin_pose.action = None
    back = keys(generate(octopus))
    assert all(np.array_equal(plain[each], back[each]) for each in plain)
