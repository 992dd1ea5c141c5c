# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo works on a machine without a screen: tiny pictures and few frames of it."""

import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from mathutils import Vector

REPOSITORY = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with what `make demo` makes, small."""
    can_render = subprocess.run(
        [sys.executable, REPOSITORY / ".ci" / "check_rendering.py"],
        capture_output=True,
        check=False,
    )
    if can_render.returncode != 0:
        pytest.skip(can_render.stderr.decode().strip())
    folder = tmp_path_factory.mktemp("demo")
    run = subprocess.run(
        [sys.executable, "docs/studio/demo.py", "--quick", "--folder", folder],
        cwd=REPOSITORY,
        env=dict(os.environ) | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=300,  # Blender 4.5 hangs at exit where an operator is left
    )
    assert run.returncode == 0, run.stderr
    for name in ("walk", "swim"):
        for suffix in (".blend", ".png", ".mp4"):
            assert str(folder / (name + suffix)) in run.stdout
    return folder


@pytest.mark.parametrize("name", ["walk", "swim"])
def test_demo_saves_an_animated_octopus_that_its_camera_sees(results: Path, name: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(results / f"{name}.blend"))
    scene = bpy.context.scene
    octopus = next(each for each in scene.objects if each.type == "ARMATURE")
    assert octopus.octo_motion.locomotion.gait == name
    assert octopus.animation_data.action is not None
    assert octopus.animation_data.action.frame_end == scene.frame_end
    assert scene.camera is not None
    from bpy_extras.object_utils import world_to_camera_view

    for frame in range(scene.frame_start, scene.frame_end + 1, 12):
        scene.frame_set(frame)
        for bone in octopus.pose.bones:
            seen = world_to_camera_view(scene, scene.camera, octopus.matrix_world @ bone.tail)
            assert 0.0 < seen.x < 1.0
            assert 0.0 < seen.y < 1.0
            assert seen.z > 0.0


@pytest.mark.parametrize("name", ["walk", "swim"])
def test_contact_sheet_shows_eight_different_phases_from_two_sides(
    results: Path, name: str
) -> None:
    import numpy as np

    image = bpy.data.images.load(str(results / f"{name}.png"))
    width, height = (int(each) for each in Vector(image.size))  # type: ignore[arg-type]
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    rows = pixels.reshape(height, width, image.channels)[..., :3]
    # Four pictures of 48 × 36 in a row, four rows; between them lie white gaps.
    assert (width, height) == (4 * 48 + 3 * 4, 4 * 36 + 2 * 4 + 12)
    pictures = [rows[y : y + 36, x : x + 48] for y in (0, 40, 88, 128) for x in (0, 52, 104, 156)]
    # Below the label, where the octopus is.
    bodies = [picture[:26] for picture in pictures]
    for number, body in enumerate(bodies):
        assert body.std() > 0.02
        for other in bodies[number + 1 :]:
            assert np.abs(body - other).max() > 0.1


@pytest.mark.parametrize("name", ["walk", "swim"])
def test_film_can_be_played(results: Path, name: str) -> None:
    clip = bpy.data.movieclips.load(str(results / f"{name}.mp4"))
    assert clip.frame_duration == 3
    assert Vector(clip.size) == Vector((64, 36))  # type: ignore[arg-type]
