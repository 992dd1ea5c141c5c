# SPDX-License-Identifier: GPL-3.0-or-later
"""Pose scripts on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.command_line.commands import main
from octo_motion.command_line.job import JobError, read_job
from octo_motion.command_line.shot_runner import perform
from octo_motion.command_line.shot_schema import ShotRequest
from octo_motion.command_line.vocabulary import known

STEPS = (
    {"do": "grab", "bone": "arm1.04.L", "at": 1.0},
    {"do": "pull", "by": [-0.05, 0.0, 0.1], "seconds": 0.2},
    {"do": "release"},
    {"do": "key"},
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    bpy.ops.octo_motion.add_octopus(with_mesh=False, arms=4, joints=4)
    path = tmp_path / "octopus.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def script(folder: Path, *steps: Any) -> Path:
    path = folder / "wave.json"
    text = json.dumps({"format": "octo_motion.pose", "version": 1, "steps": list(steps)})
    path.write_text(text, encoding="utf-8")
    return path


def run(*words: object) -> int:
    return main([str(word) for word in words], "octo_motion", has_open_file=False)


def test_script_is_played_and_the_result_saved_elsewhere(
    file: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = file.read_bytes()
    output = tmp_path / "posed.blend"
    assert run("pose", file, "--script", script(tmp_path, *STEPS), "-o", output) == 0
    assert "played 'wave.json'" in capfd.readouterr().out
    assert file.read_bytes() == before
    bpy.ops.wm.open_mainfile(filepath=str(output))
    armature: Any = bpy.data.objects["Octopus"]
    assert armature.animation_data.action
    assert not armature.pose.bones["arm1.04.L"].matrix_basis.is_identity


def test_script_that_fails_writes_nothing(
    file: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "posed.blend"
    wrong = script(tmp_path, {"do": "grab", "bone": "nose"})
    assert run("pose", file, "--script", wrong, "-o", output) == 3
    assert "has no bone 'nose'" in capfd.readouterr().err
    assert not output.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--script", "nowhere.json", "-o", "posed.blend"), "There is no file"),
        (("--script", "{script}"), "There is nothing to write"),
        (
            ("--script", "{script}", "-o", "posed.fbx"),
            "'posed.fbx' is no format to save to. Valid: .blend.",
        ),
        (("--script", "{script}", "-o", "posed.blend", "--armature", "Knight"), "Knight"),
    ],
)
def test_arguments_that_make_no_sense_are_said(  # noqa: PLR0917
    file: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    path = str(script(tmp_path, *STEPS))
    assert run("pose", file, *(word.replace("{script}", path) for word in words)) in {2, 3}
    assert said in capfd.readouterr().err
    assert not (tmp_path / "posed.blend").exists()


def test_the_script_of_a_shot_is_an_input_of_it(tmp_path: Path) -> None:
    shot = ShotRequest("a", "pose", tmp_path / "a.blend", script=tmp_path / "wave.json")
    assert tmp_path / "wave.json" in shot.inputs


# --- Shots of a job ------------------------------------------------------------------------------


def job(folder: Path, *lines: str) -> Path:
    path = folder / "job.toml"
    path.write_text(
        "\n".join(["[[shots]]", 'name = "wave"', 'kind = "pose"', *lines]), encoding="utf-8"
    )
    return path


def test_shot_of_a_job_may_be_a_pose_script(file: Path, tmp_path: Path) -> None:
    script(tmp_path, *STEPS)
    path = job(tmp_path, f'file = "{file.name}"', 'script = "wave.json"', 'output = "{name}.blend"')
    (shot,) = read_job(path, known(), tmp_path / "report.json").shots
    assert shot.script == tmp_path / "wave.json"
    perform(shot, {tmp_path / "wave.blend": tmp_path / "wave.blend"})
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "wave.blend"))
    armature: Any = bpy.data.objects["Octopus"]
    assert armature.animation_data.action


def test_new_octopus_is_posed_too(tmp_path: Path) -> None:
    script(tmp_path, *STEPS)
    path = job(
        tmp_path,
        "octopus = { arms = 4, joints = 4, with_mesh = false }",
        'script = "wave.json"',
        'output = "{name}.blend"',
    )
    (shot,) = read_job(path, known(), tmp_path / "report.json").shots
    performed = perform(shot, {tmp_path / "wave.blend": tmp_path / "wave.blend"})
    assert "bones keyed" in performed.summary.message


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ((), "It poses nothing: give script"),
        (('script = "nowhere.json"',), "nowhere.json"),
        (('script = "wave.json"', 'gait = "walk"'), 'gait is for shots with kind = "generate"'),
        (('script = "wrong.json"',), "Step 1 of the script does not say what to do"),
        (('script = "octopus.blend"',), "cannot be read"),
    ],
)
def test_shot_with_a_wrong_script_is_a_fault_before_anything_runs(
    file: Path, tmp_path: Path, lines: tuple[str, ...], said: str
) -> None:
    script(tmp_path, *STEPS)
    wrong = {"format": "octo_motion.pose", "version": 1, "steps": [{"do": "dance"}]}
    (tmp_path / "wrong.json").write_text(json.dumps(wrong), encoding="utf-8")
    path = job(tmp_path, f'file = "{file.name}"', 'output = "{name}.blend"', *lines)
    with pytest.raises(JobError) as caught:
        read_job(path, known(), tmp_path / "report.json")
    assert said in str(caught.value)
