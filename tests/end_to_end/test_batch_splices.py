# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips spliced without a window: the real command and real jobs, on the clips of the examples."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir
from hashlib import sha256
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.animation.clips import read_clip
from octo_motion.command_line import commands
from octo_motion.core.rotations import angle_between
from octo_motion.core.splicing.humanoid.mapping import map_skeleton
from octo_motion.core.splicing.transfer.parts import PARTS, part_bones

REPOSITORY = Path(__file__).resolve().parent.parent.parent
CLIPS = REPOSITORY / "docs" / "examples" / "clips"

# Blender's importer leaves the file open.
pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning"),
    pytest.mark.one_blender,
]

# Blender keeps keys in single precision, and Euler angles round a little more.
ROUNDING = 1e-4


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the clips."""
    for path in CLIPS.iterdir():
        shutil.copy(path, tmp_path)
    return tmp_path


def run_here(folder: Path, *arguments: str) -> int:
    with chdir(folder):
        return commands.main(arguments, "octo_motion", has_open_file=True)


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def report(job: Path) -> dict[str, dict[str, Any]]:
    content = json.loads(job.with_suffix(".report.json").read_text(encoding="utf-8"))
    return {shot["name"]: shot for shot in content["shots"]}


def digests(folder: Path) -> dict[str, str]:
    return {path.name: sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.*")}


def opened(path: Path) -> Any:
    """The armature of a file that was written, which is active in none but has the splices."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    (armature,) = [
        each
        for each in bpy.data.objects
        if each.type == "ARMATURE" and len(each.octo_motion.splicing.splices)
    ]
    return armature


def changed_bones(armature: Any) -> set[str]:
    """Bones that move otherwise than in the base."""
    base, result = (
        read_clip(armature, action)
        for action in (armature.octo_motion.splicing.base, armature.animation_data.action)
    )
    assert np.array_equal(base.frames, result.frames)
    turned = angle_between(base.rotations, result.rotations).max(axis=0)
    return {name for name, angle in zip(base.skeleton.names, turned, strict=True) if angle > 0.01}


def bones_of(armature: Any, *parts: str) -> set[str]:
    skeleton = read_clip(armature).skeleton
    marks = map_skeleton(skeleton).landmarks
    return {bone for part in parts for bone in part_bones(PARTS[part], skeleton, marks)}


def test_several_splices_onto_a_motion_file_in_one_command(folder: Path) -> None:
    before = digests(folder)
    ended = subprocess.run(
        [
            *(sys.executable, "-m", "octo_motion", "splice", "walk.bvh"),
            *("--splice", "right_arm", "throw.bvh", "base_start=20", "after=stop"),
            *("--splice", "left_arm", "punch.bvh", "base_start=60.5", "mode=exact", "name=Jab"),
            *("-o", "out/both.blend", "--export", "out/both.fbx"),
        ],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=120,
    )

    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "walk: 2 splices on 151 frames: 'walk Spliced'." in ended.stdout
    assert f"Written: {folder / 'out' / 'both.blend'}" in ended.stdout
    assert digests(folder) == before
    assert {path.name for path in (folder / "out").iterdir()} == {"both.blend", "both.fbx"}
    walker = opened(folder / "out" / "both.blend")
    scene = bpy.context.scene
    # The motion file's own rate and range.
    assert (scene.render.fps, scene.render.fps_base) == (30, 1.0)
    assert (scene.frame_start, scene.frame_end) == (1, 151)
    assert changed_bones(walker) <= bones_of(walker, "right_arm", "left_arm")
    assert {"RightForeArm", "LeftForeArm"} <= changed_bones(walker)
    first, second = walker.octo_motion.splicing.splices
    assert (first.part, first.base_start, first.after) == ("RIGHT_ARM", 20.0, "STOP")
    assert (second.name, second.base_start, second.mode) == ("Jab", 60.5, "EXACT")
    assert second.ease_in == 6.0  # as the panel has it
    assert sorted(each.name for each in bpy.data.collections["Clips"].objects) == [
        *("punch", "throw", "walk")
    ]
    # The list that was saved is built again as it is.
    result = read_clip(walker)
    assert run_here(folder, "splice", "out/both.blend", "-o", "out/again.blend") == 0
    again = read_clip(opened(folder / "out" / "again.blend"))
    assert angle_between(again.rotations, result.rotations).max() < ROUNDING


def test_saved_mapping_is_used_before_anything_is_guessed(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bpy.ops.octo_motion.import_clips(filepath=str(folder / "walk.bvh"))
    bpy.ops.octo_motion.map_skeleton()
    walker: Any = bpy.context.object
    guessed = walker.octo_motion.splicing.landmarks.chest
    # Told by nobody but the one who saved it.
    own = walker.data.bones[guessed].parent.name
    walker.octo_motion.splicing.landmarks.chest = own
    bpy.ops.octo_motion.mapping_save(name="Walkers")
    try:
        arguments = ("--splice", "head", "throw.bvh", "-o", "out.blend")
        assert run_here(folder, "splice", "walk.bvh", *arguments) == 0
    finally:
        bpy.ops.octo_motion.mapping_remove(name="Walkers")
    told = capfd.readouterr().out
    assert "Mapping of 'walk': Walkers (saved)." in told
    assert opened(folder / "out.blend").octo_motion.splicing.landmarks.chest == own


def test_job_makes_its_good_shots_and_tells_of_the_bad_ones(folder: Path) -> None:
    write(folder / "torn.bvh", (folder / "punch.bvh").read_text(encoding="utf-8")[:3000])
    write(folder / "pose.bvh", one_frame((folder / "punch.bvh").read_text(encoding="utf-8")))
    shot = '[[shots]]\nname = "{}"\nsplices = [{{ {} }}]\n'
    job = write(
        folder / "job.toml",
        '[defaults]\nkind = "splice"\nfile = "walk.bvh"\noutput = "out/{name}.blend"\nfps = 24\n'
        + shot.format("dancing", 'part = "trunk", clip = "dance.bvh", after = "loop"')
        + shot.format("torn", 'part = "head", clip = "torn.bvh"')
        + shot.format("gone", 'part = "head", clip = "gone.bvh"')
        + shot.format("pose", 'part = "head", clip = "pose.bvh"')
        + shot.format("action", 'part = "head", clip = "throw.bvh", action = "Throws"')
        + shot.format("itself", 'part = "head", action = "walk", base_start = 5')
        + shot.format("odd", 'part = "head", clip = "dance.bvh", landmarks.head = "Hat"')
        + shot.format("chain", 'part = "chain", bone = "tail", clip = "dance.bvh"'),
    )

    assert run_here(folder, "bake", "job.toml", "--jobs", "2") == 3

    told = report(job)
    errors = {name: shot["error"] for name, shot in told.items()}
    assert errors["dancing"] == errors["itself"] == ""
    assert errors["gone"].startswith(f"There is no file '{folder / 'gone.bvh'}'. Give a motion")
    assert errors["torn"].startswith(f"'{folder / 'torn.bvh'}': ")
    assert "line" in errors["torn"]
    assert errors["pose"].startswith("Splice 1: ")
    assert "one frame" in errors["pose"]
    unknown = "There is no action 'Throws'. Did you mean 'throw'? Valid: throw."
    assert errors["action"] == f"Splice 1: 'throw.bvh': {unknown}"
    assert "'Hat'" in errors["odd"]
    # It was in the list by then, under this name.
    assert errors["chain"].startswith("'tail: dance' (1): ")
    assert "no bone 'tail'" in errors["chain"]
    for name, each in told.items():
        assert each["status"] == ("failed" if errors[name] else "done")
    done = told["dancing"]
    # 5 seconds at 24 frames a second.
    assert (done["frames"], done["frame_start"], done["frame_end"]) == (121, 1, 121)
    assert set(done["inputs"]) == {"walk.bvh", "dance.bvh"}
    assert {path.name for path in (folder / "out").iterdir()} == {"dancing.blend", "itself.blend"}
    walker = opened(folder / "out" / "dancing.blend")
    assert "Spine" in changed_bones(walker) <= bones_of(walker, "trunk")

    # Another clip under the same name: only that shot is made anew.
    shutil.copy(folder / "throw.bvh", folder / "dance.bvh")
    outputs = [folder / "out" / f"{name}.blend" for name in ("dancing", "itself")]
    before = [path.read_bytes() for path in outputs]
    assert run_here(folder, "bake", "job.toml", "--shot", "dancing", "--shot", "itself") == 0
    assert [path.read_bytes() == old for path, old in zip(outputs, before, strict=True)] == [
        False,
        True,
    ]


def one_frame(text: str) -> str:
    head, _, motion = text.partition("Frames:")
    lines = motion.splitlines()
    return f"{head}Frames: 1\n{lines[1]}\n{lines[2]}\n"


@pytest.fixture
def scene(folder: Path) -> Path:
    """A file with a walker and a thrower, nothing of it spliced."""
    bpy.context.scene.render.fps = 30
    for name in ("throw", "walk"):
        bpy.ops.octo_motion.import_clips(filepath=str(folder / f"{name}.bvh"))
    again: Any = bpy.data.actions["throw"].copy()
    again.name, again.use_fake_user = "Again", True
    bpy.context.view_layer.objects.active = None
    path = folder / "town.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return path


def test_armatures_and_actions_of_a_scene_are_spliced_by_name(scene: Path, folder: Path) -> None:
    before = digests(folder)
    arguments = ("--armature", "walk", "--splice", "right_arm", "source=throw", "base_start=30")
    more = ("--splice", "left_arm", "source=throw", "action=Again", "--set", "visual=false")
    assert run_here(folder, "splice", scene.name, *arguments, *more, "-o", "out.blend") == 0
    assert {name: value for name, value in digests(folder).items() if name != "out.blend"} == before
    walker = opened(folder / "out.blend")
    assert [item.action.name for item in walker.octo_motion.splicing.splices] == ["throw", "Again"]
    assert walker.octo_motion.splicing.base.name == "walk"
    assert changed_bones(walker) <= bones_of(walker, "right_arm", "left_arm")


ARM = ("--splice", "right_arm")


def test_a_short_base_is_repeated_and_a_long_one_cut(folder: Path) -> None:
    rounds = (*("splice", "dance.bvh", *ARM, "throw.bvh", "base_start=100"), "--frames", "300")
    assert run_here(folder, *rounds, "-o", "long.blend") == 0
    dancer = opened(folder / "long.blend")
    assert tuple(dancer.animation_data.action.frame_range) == (1, 300)
    assert bpy.context.scene.frame_end == 300
    before = read_clip(dancer, bpy.data.actions["dance"])
    assert len(before) == 91
    again = read_clip(dancer, dancer.octo_motion.splicing.base)
    assert angle_between(again.rotations[90:180], before.rotations[:90]).max() < ROUNDING

    job = write(
        folder / "job.toml",
        '[[shots]]\nname = "a"\nkind = "splice"\nfile = "walk.bvh"\noutput = "a.blend"\n'
        'frames = 50\nsplices = [{ part = "head", clip = "dance.bvh" }]\n',
    )
    assert run_here(folder, "bake", "job.toml") == 0
    assert report(job)["a"]["frames"] == 50


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("walk.bvh",), (2, "There is nothing to splice: give --splice PART FILE.")),
        (("none.bvh", *ARM, "throw.bvh"), (3, "There is no file '{folder}/none.bvh'.")),
        (("town.blend",), (3, "2 armatures could be meant. Name the armature: throw, walk.")),
        (("town.blend", "--armature", "walk"), (3, "'walk' has no splices in its list. Say wh")),
        (
            ("town.blend", "--armature", "walk", *ARM, "source=thrower"),
            (3, "Splice 1: There is no armature 'thrower'. Did you mean 'throw'? Valid: throw, w"),
        ),
        (
            ("town.blend", "--armature", "walk", "--base", "Wlk", *ARM, "throw.bvh"),
            (3, "There is no action 'Wlk'. Valid: Again, throw, walk."),
        ),
        (
            ("town.blend", "--armature", "walk", *ARM, "source=walk"),
            (3, "Splice 1: 'walk' is both base and source. Name the source's action."),
        ),
        (
            ("town.blend", "--armature", "walk", *ARM),
            (3, "Splice 1: It is not said what is spliced."),
        ),
        (("walk.bvh", "--splice", "arm", "throw.bvh"), (2, "splice 1: There is no part 'arm'.")),
        (("walk.bvh", *ARM, "a.bvh", "b.bvh"), (2, "has two files, 'a.bvh' and 'b.bvh'.")),
        (
            ("walk.bvh", *ARM, "throw.bvh", "rate=0"),
            (2, "rate must be a number from 0.01 to 100, not '0'."),
        ),
        (("walk.bvh", *ARM, "throw.bvh", "--set", "speed=1"), (2, "There is no setting 'speed'.")),
        (
            ("walk.bvh", *ARM, "throw.bvh", "--export", "a.abc"),
            (3, "'walk' has no mesh, and Alembic keeps no bones."),
        ),
    ],
)
def test_complaint_of_splice(
    request: pytest.FixtureRequest,
    folder: Path,
    capfd: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    complaint: tuple[int, str],
) -> None:
    if "town.blend" in arguments:
        request.getfixturevalue("scene")
    status, sentence = complaint
    before = digests(folder)
    assert run_here(folder, "splice", *arguments, "--output", "out.blend") == status
    assert sentence.format(folder=folder) in capfd.readouterr().err
    assert digests(folder) == before


def test_motion_file_is_never_overwritten(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = digests(folder)
    arguments = ("splice", "walk.bvh", *ARM, "throw.bvh", "--overwrite")
    assert run_here(folder, *arguments) == 2
    assert "'walk.bvh' is no format to save to. Valid: .blend." in capsys.readouterr().err
    assert digests(folder) == before


# Blender 5.2's exporter does what a later numpy will refuse.
@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
def test_what_was_spliced_and_exported_is_a_clip_to_splice(
    folder: Path, shared_data: Callable[[str], Path]
) -> None:
    knight = str(shared_data("rigs_with_actions/KayKit_Knight.glb"))
    arguments = ("--splice", "right_arm", "throw.bvh", "--export", "walk2.glb")
    assert run_here(folder, "splice", "walk.bvh", *arguments) == 0
    arm = ("--splice", "head", knight, "action=Cheer", "after=loop", "--splice", "left_arm")
    assert run_here(folder, "splice", "walk2.glb", *arm, "punch.bvh", "-o", "b.blend") == 0
    assert changed_bones(opened(folder / "b.blend"))
