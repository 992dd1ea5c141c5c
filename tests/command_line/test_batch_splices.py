# SPDX-License-Identifier: GPL-3.0-or-later
"""Splices as the command line and job files ask for them."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from octo_motion.command_line.job import JobError, JobFile, read_job
from octo_motion.command_line.schema import Reading
from octo_motion.command_line.shot_schema import SPLICES, NewSplice, parse_splices
from octo_motion.command_line.splice_runner import files_within, import_base
from octo_motion.command_line.vocabulary import check_file, known, make_request, resolver
from octo_motion.core.errors import ClipError, SettingsError

REPOSITORY = Path(__file__).resolve().parent.parent.parent
CLIPS = REPOSITORY / "docs" / "examples" / "clips"
WALK = '[[shots]]\nname = "walk"\nkind = "splice"\nfile = "walk.bvh"\noutput = "out.blend"\n'
ARM = 'splices = [{ part = "right_arm", clip = "throw.bvh" }]\n'


def read(folder: Path, text: str) -> JobFile:
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return read_job(path, known(), folder / "job.report.json")


def faults(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(JobError) as caught:
        read(folder, text)
    return caught.value.faults


PARTS = "right_arm, left_arm, legs, trunk, head, right_leg, left_leg, chain."


def splices(given: Any) -> tuple[list[NewSplice], list[str]]:
    reading = Reading(known(), lambda text: Path("/clips", text))
    return SPLICES(given, reading), reading.faults


def test_splice_has_all_settings_that_the_list_has(tmp_path: Path) -> None:
    text = WALK + (
        "[[shots.splices]]\n"
        'part = "Left_Arm"\nclip = "a/punch.bvh"\naction = "Jab"\nname = "Jab"\n'
        "base_start = 20\nsplice_start = 3.5\nrate = 1.5\nlength = 30\nease_in = 2\nease_out = 4\n"
        'after = "loop"\nmode = "exact"\nmute = true\nvisual = true\nslot = "OBpunch"\n'
        'landmarks.hand_l = "Bone.007"\n'
        '[[shots.splices]]\npart = "legs"\nsource = "Runner"\naction = "Run"\nwith_travel = true\n'
        '[[shots.splices]]\npart = "chain"\nbone = "tail"\nsource_bone = "Tail1"\naction = "Wag"\n'
    )
    (shot,) = read(tmp_path, text).shots
    assert shot.splices
    arm, legs, tail = shot.splices
    assert (arm.clip, arm.action, arm.source) == (tmp_path / "a/punch.bvh", "Jab", "")
    assert arm.settings == {
        "part": "LEFT_ARM",
        "name": "Jab",
        "base_start": 20.0,
        "splice_start": 3.5,
        "rate": 1.5,
        "length": 30.0,
        "ease_in": 2.0,
        "ease_out": 4.0,
        "after": "LOOP",
        "mode": "EXACT",
        "mute": True,
        "visual": True,
        "slot": "OBpunch",
        "landmarks.hand_l": "Bone.007",
    }
    assert (legs.source, legs.settings) == ("Runner", {"part": "LEGS", "with_travel": True})
    assert tail.settings == {"part": "CHAIN", "bone": "tail", "source_bone": "Tail1"}
    assert shot.inputs == (tmp_path / "walk.bvh", tmp_path / "a/punch.bvh")


def test_nothing_that_the_list_has_is_left_out() -> None:
    from octo_motion.ui.splicing.properties import SpliceItem

    pointers = {"source", "action", "ground"}
    assert set(SpliceItem.__annotations__) - pointers <= set(known().tables["splices"])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            WALK + 'splices = [{ part = "right_hand", clip = "throw.bvh" }]\n',
            "splice 1: There is no part 'right_hand'. Did you mean 'right_arm'? Valid: right_arm, ",
        ),
        (WALK + 'splices = [{ clip = "throw.bvh" }]\n', "splice 1: It has no part: write part"),
        (WALK + 'splices = [{ part = "chain" }]\n', "A chain needs its first bone: write bone"),
        (
            WALK + 'splices = [{ part = "head", clip = "throw.mov" }]\n',
            "'throw.mov' is no motion file. Valid: .bvh, .fbx, .glb, .gltf.",
        ),
        (
            WALK + 'splices = [{ part = "head", clip = "a.bvh", source = "A" }]\n',
            "It has a clip and a source",
        ),
        (
            WALK + 'splices = [{ part = "head", base_strt = 3 }]\n',
            "There is no setting 'base_strt'. Did you mean 'base_start'? Valid: clip, source,",
        ),
        (
            WALK + 'splices = [{ part = "head", landmarks = { hnad_l = "x" } }]\n',
            "There is no setting 'landmarks.hnad_l'. Did you mean 'landmarks.hand_l'?",
        ),
        (
            WALK + 'splices = [{ part = "head", rate = 0 }]\n',
            "rate must be a number from 0.01 to 100, not 0.",
        ),
        (WALK + 'splices = [{ part = "head", clip = 3 }]\n', "clip must be a text, not 3."),
        (WALK + "splices = []\n", "splices is empty"),
        (WALK + "splices = 3\n", "splices must be a list of tables"),
        (WALK, "It splices nothing: give splices"),
        (WALK.replace('file = "walk.bvh"\n', "") + ARM, "It has no base: give file"),
        (WALK + ARM + "octopus = {}\n", 'octopus is for shots with kind = "generate".'),
        (
            WALK + ARM + "colour = 3\n",
            "There is no key 'colour'. Valid: name, kind, file, armature",
        ),
        (WALK.replace('"splice"', '"splise"') + ARM, "There is no kind 'splise'. Did you mean"),
        (
            WALK.replace('kind = "splice"\n', "") + 'route = "Wall"\n',
            "'walk.bvh' is a motion file, which is for kind = \"splice\".",
        ),
        (WALK + ARM + "settings = { speed = 1 }\n", "There is no setting 'speed'."),
        (
            WALK.replace("out.blend", "x.blend") + ARM + 'export = "throw.bvh"\n',
            "is no format to export to",
        ),
    ],
)
def test_fault_is_told(tmp_path: Path, text: str, fault: str) -> None:
    told = faults(tmp_path, text)
    assert any(fault in each for each in told), told


def test_output_must_not_be_a_clip_that_is_read(tmp_path: Path) -> None:
    text = WALK.replace("walk.bvh", "out.blend") + ARM
    assert "is an input of shot 'walk': give another." in faults(tmp_path, text)[0]


def test_splices_survive_their_way_to_another_process(tmp_path: Path) -> None:
    asked = WALK + ARM + 'frames = 50\nbase = "Stroll"\nsettings = { visual = true }\n'
    listed = WALK.replace("walk", "b").replace(".bvh", ".blend").replace("out.", "b2.")
    job = read(tmp_path, asked + listed)
    for shot in job.shots:
        table = json.loads(json.dumps(job.asked[shot.name]))
        assert make_request(table, resolver(job.path, shot.name)) == shot
        assert shot.kind == "splice"


def test_defaults_of_the_other_kind_do_not_concern_a_shot(tmp_path: Path) -> None:
    defaults = '[defaults]\noctopus = { arms = 4 }\ngait = "walk"\noutput = "{name}.blend"\n'
    swim = '[[shots]]\nname = "swim"\nroute = [[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0]]\n'
    walk, creature = read(tmp_path, defaults + WALK + ARM + swim).shots
    assert walk.octopus is None
    assert walk.splices
    assert creature.octopus
    assert creature.splices is None


def test_example_of_the_documentation_is_in_order(tmp_path: Path) -> None:
    text = (REPOSITORY / "docs/examples/splices.toml").read_text(encoding="utf-8")
    shots = read(tmp_path, text).shots
    assert [len(each.splices or ()) for each in shots] == [1, 2, 2, 3]
    used = {path.name for shot in shots for path in shot.inputs}
    assert used == {path.name for path in CLIPS.iterdir()}


@pytest.mark.parametrize(
    ("words", "table"),
    [
        (["head"], {"part": "head"}),
        (["head", "nod.bvh"], {"part": "head", "clip": "nod.bvh"}),
        (
            ["right_arm", "throw.bvh", "base_start=12", "mode = exact"],
            {"part": "right_arm", "clip": "throw.bvh", "base_start": "12", "mode": "exact"},
        ),
        (["head", "clip=a=b.bvh"], {"part": "head", "clip": "a=b.bvh"}),
    ],
)
def test_words_of_the_command_line_are_a_splice(words: list[str], table: dict[str, str]) -> None:
    assert parse_splices([words]) == [table]


def test_two_files_for_one_splice_are_refused() -> None:
    with pytest.raises(SettingsError, match=r"has two files, 'a\.bvh' and 'b\.bvh'"):
        parse_splices([["head", "a.bvh", "b.bvh"]])


def test_all_splices_are_looked_at() -> None:
    found, told = splices([{"part": "hed"}, {"part": "head", "rate": "fast"}])
    assert len(found) == 2
    assert told[0].endswith(f"Did you mean 'head'? Valid: {PARTS}")
    assert [each.partition(":")[0] for each in told] == ["splice 1", "splice 2"]


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("none.bvh", None, "There is no file '.*none.bvh'. Give a motion file"),
        ("none.glb", None, "There is no file '.*none.glb'. Give a motion file"),
        ("empty.fbx", b"", "'.*empty.fbx' is empty. Export it again."),
        ("torn.bvh", b"HIERARCHY\nROOT Hips\n{\n", "'.*torn.bvh': .*line"),
    ],
)
def test_damaged_motion_file_is_told_before_anything_runs(
    tmp_path: Path, name: str, content: bytes | None, sentence: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ClipError, match=sentence):
        check_file(tmp_path / name)


def test_files_that_a_gltf_file_consists_of_are_its_inputs_too(tmp_path: Path) -> None:
    buffers = [{"uri": "walk.bin"}, {"uri": "data:application/octet-stream;base64,"}, {}]
    (tmp_path / "walk.bin").write_bytes(b"1")
    (tmp_path / "walk.gltf").write_text(json.dumps({"buffers": buffers}), encoding="utf-8")
    assert files_within(tmp_path / "walk.gltf") == (tmp_path / "walk.bin",)
    assert files_within(tmp_path / "walk.glb") == ()


@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize(
    ("written", "rate"),
    [
        ("0.041708", (24, 1.001)),
        ("0.0333667", (30, 1.001)),
        ("0.033366666", (30, 1.001)),
        ("0.016683", (60, 1.001)),
        ("0.033333", (30, 1.0)),
        ("0.008333", (120, 1.0)),
        ("0.08", (13, 1.04)),
    ],
)
def test_scene_of_a_base_has_the_rate_that_its_file_means(
    tmp_path: Path, written: str, rate: tuple[int, float]
) -> None:
    text = (CLIPS / "walk.bvh").read_text(encoding="utf-8")
    path = tmp_path / "walk.bvh"
    path.write_text(re.sub(r"(?<=Frame Time: )\S+", written, text), encoding="utf-8")
    armature, _ = import_base(path, None)
    render = armature.users_scene[0].render
    assert (render.fps, render.fps_base) == (rate[0], pytest.approx(rate[1], abs=1e-6))
