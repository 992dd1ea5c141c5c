# SPDX-License-Identifier: GPL-3.0-or-later
"""Sessions of posing from a file: the same each time, and all or nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.poses import pose_values
from octo_motion.ui.posing.puppet_session import PuppetSession, active_session

WAVE: tuple[dict[str, Any], ...] = (
    {"do": "key", "bones": "all"},
    {"do": "frame", "frame": 12},
    {"do": "pin", "bone": "arm1.01.L"},
    {"do": "grab", "bone": "arm1.04.L", "at": 1.0},
    {"do": "pull", "by": [-0.1, 0.0, 0.1], "turn": [0, 0, 30], "seconds": 0.3},
    {"do": "release"},
    {"do": "wait", "seconds": 0.1},
    {"do": "unpin", "bone": "arm1.01.L"},
    {"do": "key"},
)

Play = Callable[..., set[str]]


@pytest.fixture
def play(tmp_path: Path) -> Play:
    def run(*steps: dict[str, Any], **settings: Any) -> set[str]:
        path = tmp_path / "wave.json"
        script = {
            "format": "octo_motion.pose",
            "version": 1,
            "settings": settings,
            "steps": list(steps),
        }
        path.write_text(json.dumps(script), encoding="utf-8")
        return bpy.ops.octo_motion.pose_script(filepath=str(path))

    return run


def values(armature: Any) -> dict[tuple[str, int], list[tuple[float, float]]]:
    """Keys of the action, frame and value, by property and component."""
    data = armature.animation_data
    found = {}
    for layer in data.action.layers if data and data.action else ():
        for strip in layer.strips:
            for channelbag in strip.channelbags:
                for curve in channelbag.fcurves:
                    found[curve.data_path, curve.array_index] = [
                        tuple(key.co) for key in curve.keyframe_points
                    ]
    return found


def frames(armature: Any, bone: str) -> set[float]:
    return {
        frame
        for (path, _), keys in values(armature).items()
        for frame, _ in keys
        if f'"{bone}"' in path
    }


def test_script_poses_and_keys_as_a_hand_would(octopus: Any, play: Play) -> None:
    assert play(*WAVE) == {"FINISHED"}
    assert frames(octopus, "arm1.04.L") == {1.0, 12.0}
    # Pinned, and no part of what was pulled.
    assert frames(octopus, "arm1.01.L") == {1.0}
    assert frames(octopus, "arm2.04.R") == {1.0}
    assert bpy.context.scene.frame_current == 12
    assert active_session() is None


def test_script_gives_the_same_keys_each_time(octopus: Any, play: Play) -> None:
    play(*WAVE)
    first = values(octopus)
    octopus.animation_data_clear()
    for bone in octopus.pose.bones:
        bone.matrix_basis.identity()
    bpy.context.scene.frame_set(1)
    play({"do": "restore"}, *WAVE)
    assert values(octopus) == first


def test_script_is_one_undo_step(octopus: Any, play: Play, tmp_path: Path) -> None:
    name = octopus.name
    play({"do": "wait", "seconds": 0.0})
    bpy.ops.ed.undo_push(message="Before")
    before = pose_values(bpy.data.objects[name])
    script = tmp_path / "wave.json"
    steps = json.dumps({"format": "octo_motion.pose", "version": 1, "steps": list(WAVE)})
    script.write_text(steps, encoding="utf-8")
    operators: Any = bpy.ops.octo_motion
    operators.pose_script("EXEC_DEFAULT", True, filepath=str(script))  # noqa: FBT003
    assert values(bpy.data.objects[name])
    bpy.ops.ed.undo()
    assert values(bpy.data.objects[name]) == {}
    assert pose_values(bpy.data.objects[name]) == before


def test_recorded_script_writes_a_motion_of_few_keys(octopus: Any, play: Play) -> None:
    play(
        {"do": "grab", "bone": "arm1.04.L", "at": 1.0},
        {"do": "record"},
        {"do": "pull", "by": [-0.1, 0.0, 0.1], "seconds": 0.5},
        {"do": "pull", "by": [0.1, 0.0, 0.1], "seconds": 0.5},
        {"do": "frame", "frame": 30},
        {"do": "stop"},
    )
    found = frames(octopus, "arm1.04.L")
    assert min(found) == 1.0
    assert max(found) == 30.0
    assert len(found) < 15


def test_settings_of_a_script_stay_with_the_armature(octopus: Any, play: Play) -> None:
    play({"do": "wait", "seconds": 0.1}, material="WIRE", strength=2.0)
    assert octopus.octo_motion.posing.material == "WIRE"
    assert octopus.octo_motion.posing.strength == 2.0


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ([{"do": "grab", "bone": "nose"}], "Step 2 .* 'Octopus' has no bone 'nose'"),
        ([{"do": "grab", "bone": "root"}], "'root' is no limb of the puppet"),
        ([{"do": "pull", "by": [0, 0, 1], "seconds": 1}], "Nothing is held"),
        ([{"do": "key", "bones": ["nose"]}], "has no bone 'nose'"),
    ],
)
def test_script_that_fails_on_its_way_leaves_all_as_it_was(
    octopus: Any, play: Play, steps: list[dict[str, Any]], said: str
) -> None:
    before = pose_values(octopus)
    with pytest.raises(RuntimeError, match=said):
        play({"do": "key", "bones": "all"}, *steps, material="RUBBER")
    assert pose_values(octopus) == before
    assert values(octopus) == {}
    assert list(bpy.data.actions) == []
    assert octopus.octo_motion.posing.material == "CLAY"
    assert active_session() is None


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("colour", 1, "There is no setting 'colour'"),
        ("obstacle", "BOX", "There is no setting 'obstacle'"),
        ("material", "STONE", "does not take 'STONE'"),
        ("strength", "much", "does not take 'much'"),
    ],
)
def test_setting_that_makes_no_sense_is_refused(
    octopus: Any,  # noqa: ARG001
    play: Play,
    name: str,
    value: Any,
    said: str,
) -> None:
    with pytest.raises(RuntimeError, match=said):
        play({"do": "wait", "seconds": 0.1}, **{name: value})


def test_missing_file_is_said(octopus: Any, tmp_path: Path) -> None:  # noqa: ARG001
    with pytest.raises(RuntimeError, match="No file is given"):
        bpy.ops.octo_motion.pose_script()
    with pytest.raises(RuntimeError, match=r"'none\.json' cannot be read"):
        bpy.ops.octo_motion.pose_script(filepath=str(tmp_path / "none.json"))


def test_walk_that_was_generated_is_posed_over(octopus: Any, play: Play) -> None:
    bpy.ops.octo_motion.add_route()
    bpy.context.view_layer.objects.active = octopus
    bpy.ops.octo_motion.generate_locomotion()
    walk = octopus.animation_data.action
    before = values(octopus)
    octopus.octo_motion.posing.keys_to = "LAYER"
    play(
        {"do": "frame", "frame": 20},
        {"do": "grab", "bone": "head", "at": 1.0},
        {"do": "pull", "by": [0.05, 0.0, 0.0], "seconds": 0.3},
        {"do": "release"},
        {"do": "key"},
    )
    data = octopus.animation_data
    assert data.action != walk
    assert frames(octopus, "head") == {20.0}
    strips = [strip for track in data.nla_tracks for strip in track.strips]
    assert [strip.action for strip in strips] == [walk]
    data.action, data.action_slot = walk, walk.slots[0]
    assert values(octopus) == before
    assert np.isfinite(np.array(octopus.pose.bones["head"].matrix)).all()


def test_limb_as_thick_as_it_is_long_is_held_where_the_script_says() -> None:
    """Its capsule is a ball, which has no ends of its own."""
    armature = stalk_with_a_head(0.4, thick=0.6)
    session = PuppetSession(armature, bpy.context.scene, clock=None)
    try:
        bone = armature.pose.bones["head"]
        assert np.ptp(session.figure.capsules[session.body("head")], axis=0).max() < 1e-9
        for share in (0.0, 0.25, 1.0):
            place = session.grab_bone("head", share)
            wanted = bone.head + share * (bone.tail - bone.head)
            assert place == pytest.approx(np.array(wanted), abs=1e-5)
            assert session.held_point() == pytest.approx(place)
    finally:
        session.cancel()


def stalk_with_a_head(length: float, thick: float) -> Any:
    """Two bones one above the other, the second with a skin of points that are far from it."""
    data = bpy.data.armatures.new("Stalk")
    armature: Any = bpy.data.objects.new("Stalk", data)
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    stalk, head = data.edit_bones.new("stalk"), data.edit_bones.new("head")
    stalk.head, stalk.tail, head.head = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)
    head.tail = (0.0, 0.0, 1.0 + length)
    head.parent = stalk
    bpy.ops.object.mode_set(mode="OBJECT")
    angles = np.linspace(0.0, 2.0 * np.pi, 40)
    points = [(thick * np.cos(each), thick * np.sin(each), 1.0 + 0.5 * length) for each in angles]
    mesh = bpy.data.meshes.new("Skin")
    mesh.from_pydata(points, [], [])
    skin: Any = bpy.data.objects.new("Skin", mesh)
    bpy.context.collection.objects.link(skin)
    skin.vertex_groups.new(name="head").add(list(range(len(points))), 1.0, "REPLACE")
    skin.parent = armature
    skin.modifiers.new("Armature", "ARMATURE").object = armature
    bpy.context.view_layer.update()
    return armature
