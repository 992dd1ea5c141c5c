# SPDX-License-Identifier: GPL-3.0-or-later
"""``make setups`` shows set-ups on other creatures, and says in one sentence why it cannot."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent.parent


def setups(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "docs/studio/setups.py", *arguments],
        cwd=REPOSITORY,
        env=dict(os.environ) | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=300,  # Blender 4.5 hangs at exit where an operator is left
    )


def last_line(run: subprocess.CompletedProcess[str]) -> str:
    assert run.returncode != 0
    assert "Traceback" not in run.stderr
    return run.stderr.strip().splitlines()[-1]


def test_a_rig_that_is_not_there_is_told_in_one_sentence(tmp_path: Path) -> None:
    missing = tmp_path / "nobody.glb"
    told = last_line(setups("walk", "--rig", missing, "--folder", tmp_path))
    assert told == f"make setups: error: there is no file '{missing}'"


def test_an_armature_that_is_not_there_is_told_with_those_that_are(tmp_path: Path) -> None:
    rig = tmp_path / "rig.blend"
    bpy.ops.object.armature_add()
    assert bpy.context.object is not None
    bpy.context.object.name = "Squid"
    bpy.ops.wm.save_as_mainfile(filepath=str(rig))
    told = last_line(setups("walk", "--rig", rig, "--armature", "Kraken", "--folder", tmp_path))
    assert told == "make setups: error: 'rig.blend' has no armature 'Kraken', but 'Squid'."
    told = last_line(setups("walk", "--rig", rig, "--folder", tmp_path))
    assert "arm" in told
    assert "error" in told


def test_cameras_look_at_every_corner_of_a_coarse_skin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(REPOSITORY / "docs" / "studio"))
    stage = importlib.import_module("stage")

    bpy.ops.object.armature_add()
    armature = bpy.context.object
    assert armature is not None
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    skin = bpy.context.object
    assert skin is not None
    skin.modifiers.new("Armature", "ARMATURE").object = armature  # type: ignore[attr-defined]
    (points,) = stage.skin_points(armature, [1])
    assert np.allclose(points.min(axis=0), -1.0)
    assert np.allclose(points.max(axis=0), 1.0)
