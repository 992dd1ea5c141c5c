# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that follow an action without a window: the real command and a real job."""

import shutil
from contextlib import chdir
from pathlib import Path
from typing import Any

import bpy
import numpy as np
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
    """A folder with a clip of somebody who walks."""
    shutil.copy(CLIPS / "walk.bvh", tmp_path / "walk.bvh")
    return tmp_path


def run_here(folder: Path, *arguments: str) -> int:
    with chdir(folder):
        return commands.main(arguments, "octo_motion", has_open_file=True)


def moved(path: Path) -> dict[str, float]:
    """By bone, by how much its keys are others than those that the clip has."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    actions = {each.name: each for each in bpy.data.actions}
    (made,) = (each for name, each in actions.items() if name.endswith("Follow-Through"))
    clip = actions[made.name.removesuffix(" Follow-Through")]
    before, after = _values(clip), _values(made)
    assert before.keys() == after.keys()
    found: dict[str, float] = {}
    for (path_of, index), values in before.items():
        bone = path_of.partition('"')[2].partition('"')[0]
        off = float(np.abs(values - after[path_of, index]).max())
        found[bone] = max(found.get(bone, 0.0), off)
    return found


def _values(action: Any) -> dict[tuple[str, int], Any]:
    frames = np.arange(*action.frame_range)
    return {
        (curve.data_path, curve.array_index): np.array([curve.evaluate(each) for each in frames])
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        for curve in bag.fcurves
        if "rotation" in curve.data_path
    }


def test_a_chain_of_a_clip_follows_and_nothing_else_moves(folder: Path) -> None:
    words = ("--chain", "RightForeArm", "RightHand", "strength=0.2", "--set", "damping=0.4")
    assert run_here(folder, "follow", "walk.bvh", *words, "-o", "loose.blend") == 0
    found = moved(folder / "loose.blend")
    assert found.pop("RightForeArm") > 0.02
    assert found.pop("RightHand") > 0.02
    assert max(found.values()) < 1e-6


def test_a_job_follows(folder: Path) -> None:
    (folder / "job.toml").write_text(
        '[[shots]]\nname = "loose"\nkind = "follow"\nfile = "walk.bvh"\n'
        'chains = [{ name = "LeftForeArm", last = "LeftHand", strength = 0.2 }]\n'
        'settings = { material = "limp", gravity = 1.0, wind = [1.0, 0.0, 0.0] }\n'
        'output = "{name}.blend"\n',
        encoding="utf-8",
    )
    assert run_here(folder, "bake", "job.toml", "--jobs", "1") == 0
    assert moved(folder / "loose.blend")["LeftHand"] > 0.1


def test_what_is_wrong_is_told_and_writes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_here(folder, "follow", "walk.bvh", "-o", "loose.blend")
    assert "has a name such as Tail" in capsys.readouterr().err
    assert run_here(folder, "follow", "walk.bvh", "--chain", "Nobody", "-o", "loose.blend")
    assert "There is no bone 'Nobody'" in capsys.readouterr().err
    assert run_here(folder, "follow", "walk.bvh", "--chain", "a", "b", "c", "-o", "loose.blend")
    assert "has two last bones" in capsys.readouterr().err
    assert not (folder / "loose.blend").exists()
