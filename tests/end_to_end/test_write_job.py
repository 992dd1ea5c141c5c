# SPDX-License-Identifier: GPL-3.0-or-later
"""What is open in Blender, as a job; what came of it, back as actions."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.command_line import commands, operators
from octo_motion.command_line.operators import SHOTS


def curves(action: Any) -> dict[tuple[str, int], np.ndarray]:
    """Keys of an action, by path and component."""
    (layer,) = action.layers
    (strip,) = layer.strips
    found = {}
    for bag in strip.channelbags:
        for curve in bag.fcurves:
            points = np.empty(2 * len(curve.keyframe_points), dtype=np.float32)
            curve.keyframe_points.foreach_get("co", points)
            found[curve.data_path, curve.array_index] = points
    return found


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A saved scene with two octopuses of their own routes and settings."""
    for name, seed in (("Anna", 3), ("Bea: left", 8)):
        bpy.ops.octo_motion.add_octopus(arms=4, joints=3, with_mesh=False)
        octopus: Any = bpy.context.object
        octopus.name = name
        bpy.ops.octo_motion.detect_arms()
        bpy.ops.octo_motion.add_route()
        settings = octopus.octo_motion.locomotion
        settings.timing, settings.frame_end = "RANGE", 20
        settings.seed, settings.variation_max = seed, 0.3
        settings.table.stride = 0.3
    path = tmp_path / "rêve.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_keys_of_a_baked_job_are_those_that_generate_writes(scene: Path, tmp_path: Path) -> None:
    job = tmp_path / "job.toml"
    assert bpy.ops.octo_motion.write_job(filepath=str(job), seeds=2) == {"FINISHED"}
    shots = tomllib.loads(job.read_text(encoding="utf-8"))["shots"]
    assert [shot["name"] for shot in shots] == [
        "Anna_seed3",
        "Anna_seed4",
        "Bea_ left_seed8",
        "Bea_ left_seed9",
    ]
    expected = {}
    for shot in shots:
        bpy.ops.wm.open_mainfile(filepath=str(scene))
        octopus: Any = bpy.data.objects[shot["armature"]]
        bpy.context.view_layer.objects.active = octopus
        octopus.octo_motion.locomotion.seed = shot["settings"]["seed"]
        assert bpy.ops.octo_motion.generate_locomotion() == {"FINISHED"}
        expected[shot["name"]] = curves(octopus.animation_data.action)

    assert commands.main(["bake", str(job), "--here"], "octo", has_open_file=True) == 0
    bpy.ops.wm.open_mainfile(filepath=str(scene))
    report = job.with_suffix(".report.json")
    assert bpy.ops.octo_motion.link_shots(filepath=str(report)) == {"FINISHED"}

    linked = bpy.context.scene[SHOTS]
    assert set(linked.keys()) == set(expected)
    for name, keys in expected.items():
        assert linked[name].library is not None
        found = curves(linked[name])
        assert found.keys() == keys.keys()
        for place, points in keys.items():
            assert np.array_equal(found[place], points), (name, place)
    third, fourth = (expected[f"Anna_seed{each}"] for each in (3, 4))
    assert any(not np.array_equal(third[place], fourth[place]) for place in third)
    # They are still there when the file is opened again.
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(scene))
    assert {each.name for each in bpy.context.scene[SHOTS].values()} == {
        shot["action"] for shot in json.loads(report.read_text(encoding="utf-8"))["shots"]
    }


def test_job_of_a_file_with_unsaved_changes_is_not_written(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert scene.is_file()
    # What Blender's window tells.
    monkeypatch.setattr(operators, "_has_unsaved_changes", lambda: True)
    with pytest.raises(RuntimeError, match="changes that are not saved"):
        bpy.ops.octo_motion.write_job(filepath=str(tmp_path / "job.toml"))
    assert not (tmp_path / "job.toml").exists()


def test_scene_without_creatures_has_no_job(tmp_path: Path) -> None:
    assert not bpy.ops.octo_motion.write_job.poll()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "empty.blend"))
    with pytest.raises(RuntimeError, match="No creature is set up here"):
        bpy.ops.octo_motion.write_job(filepath=str(tmp_path / "job.toml"))


def test_file_that_is_no_report_brings_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="That is no report with shots"):
        bpy.ops.octo_motion.link_shots(filepath=str(tmp_path / "none.json"))
