# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiment of the paper behind splicing is drawn on a machine without a screen."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent.parent
CELL = (30, 38)
APART = 4


def studio(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=REPOSITORY,
        env=dict(os.environ) | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=300,  # Blender 4.5 hangs at exit where an operator is left
    )


def test_clips_of_the_examples_are_those_that_are_made_from_curves(tmp_path: Path) -> None:
    run = studio("docs/studio/performers.py", tmp_path)
    assert run.returncode == 0, run.stderr
    clips = REPOSITORY / "docs" / "examples" / "clips"
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in clips.iterdir()}
    for path in tmp_path.iterdir():
        made, kept = (
            (each / path.name).read_text(encoding="utf-8").partition("Frame Time:")
            for each in (tmp_path, clips)
        )
        assert made[0] == kept[0]
        numbers, others = (np.array(each[2].split(), dtype=float) for each in (made, kept))
        # Another machine may round the last digit otherwise.
        assert np.abs(numbers - others).max() < 0.02


def test_results_differ_from_the_walk_and_from_each_other(tmp_path: Path) -> None:
    can_render = studio(".ci/check_rendering.py")
    if can_render.returncode != 0:
        pytest.skip(can_render.stderr.strip())
    path = tmp_path / "sheet.png"
    run = studio("docs/studio/experiment.py", "--quick", "--output", path)
    assert run.returncode == 0, run.stderr
    assert str(path) in run.stdout
    assert "timing 1: Right Arm: throw from frame 7, Left Arm: punch from frame 77" in run.stderr
    image: Any = bpy.data.images.load(str(path))
    width, height = image.size
    assert (width, height) == (3 * CELL[0] + 2 * APART, 5 * CELL[1] + 4 * APART)
    pixels = np.array(image.pixels[:]).reshape(height, width, -1)[::-1, :, :3]
    walk, throw, punch, first, second = (
        pixels[top : top + CELL[1]] for top in range(0, height, CELL[1] + APART)
    )
    # Orange and teal limbs: what is spliced is seen, and the walk has none.
    orange = [(row[..., 0] - row[..., 2] > 0.2).sum() for row in (walk, throw, first, second)]
    teal = [(row[..., 2] - row[..., 0] > 0.2).sum() for row in (walk, punch, first, second)]
    assert orange[0] == teal[0] == 0
    assert min(orange[1:]) > 10
    assert min(teal[1:]) > 5
    assert np.abs(first - second).max() > 0.2


def test_folder_without_the_clips_is_told(tmp_path: Path) -> None:
    run = studio("docs/studio/experiment.py", tmp_path, "--output", tmp_path / "sheet.png")
    assert run.returncode == 1
    assert f"There is no clip called 'walk' in {tmp_path}." in run.stderr
    assert not (tmp_path / "sheet.png").exists()
