# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole clips onto one armature without a window: the real command and a real job."""

import shutil
from contextlib import chdir
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.command_line import commands

CLIPS = Path(__file__).resolve().parent.parent.parent / "docs" / "examples" / "clips"

# Blender's importer leaves the file open.
pytestmark = [
    pytest.mark.one_blender,
    pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning"),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a folder of clips."""
    shutil.copytree(CLIPS, tmp_path / "clips")
    return tmp_path


def run_here(folder: Path, *arguments: str) -> int:
    with chdir(folder):
        return commands.main(arguments, "octo_motion", has_open_file=True)


def actions_in(path: Path) -> dict[str, Any]:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return {each.name: each for each in bpy.data.actions}


def test_a_folder_of_clips_comes_onto_one_armature(folder: Path) -> None:
    assert (
        run_here(
            folder,
            *("retarget", "clips/walk.bvh", "--clips", "clips", "--set", "foot_lock=false"),
            *("-o", "all.blend"),
        )
        == 0
    )
    actions = actions_in(folder / "all.blend")
    assert {"dance", "punch", "throw"} <= set(actions)
    assert all(actions[each].use_fake_user for each in ("dance", "punch", "throw"))
    (armature,) = (each for each in bpy.data.objects if each.type == "ARMATURE")
    settings: Any = armature
    assert not settings.octo_motion.splicing.retarget.foot_lock


def test_a_job_retargets(folder: Path) -> None:
    (folder / "job.toml").write_text(
        '[[shots]]\nname = "two"\nkind = "retarget"\nfile = "clips/walk.bvh"\n'
        'clips = ["clips/throw.bvh", "clips/punch.bvh"]\noutput = "{name}.blend"\n',
        encoding="utf-8",
    )
    assert run_here(folder, "bake", "job.toml", "--jobs", "1") == 0
    assert {"throw", "punch"} <= set(actions_in(folder / "two.blend"))


def test_a_clip_that_cannot_be_used_writes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "clips" / "broken.bvh").write_text("HIERARCHY\n", encoding="utf-8")
    assert run_here(folder, "retarget", "clips/walk.bvh", "--clips", "clips", "-o", "all.blend")
    assert "'broken': " in capsys.readouterr().err
    assert not (folder / "all.blend").exists()


def test_a_job_without_clips_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "job.toml").write_text(
        '[[shots]]\nname = "none"\nkind = "retarget"\nfile = "clips/walk.bvh"\n'
        'output = "a.blend"\n',
        encoding="utf-8",
    )
    assert run_here(folder, "bake", "job.toml", "--check") == 2
    assert "It retargets nothing" in capsys.readouterr().err
