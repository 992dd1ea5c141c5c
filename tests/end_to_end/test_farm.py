# SPDX-License-Identifier: GPL-3.0-or-later
"""One job made by many processes that know nothing of each other, as on a render farm."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.command_line import bake, commands, outputs, records
from octo_motion.core.errors import WriteError

pytestmark = pytest.mark.one_blender

REPOSITORY = Path(__file__).resolve().parent.parent.parent
RANGE = 'settings = { timing = "RANGE", frame_end = 6 }\n'
SMALL = "octopus = { arms = 4, joints = 3, with_mesh = false }\n"
ROUTE = "route = [[0, 0, 0], [0, -1, 0], [1, -1, 0], [2, -1, 0]]\n"
DEFAULTS = f'[defaults]\noutput = "out/{{name}}.blend"\n{SMALL}{ROUTE}{RANGE}'

posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")


def job_of(folder: Path, *shots: str, more: str = "") -> Path:
    path = folder / "job.toml"
    tables = "".join(f'[[shots]]\nname = "{name}"\n' for name in shots)
    path.write_text(DEFAULTS + tables + more, encoding="utf-8")
    return path


def task(*arguments: str | Path) -> int:
    """What a farm runs on one machine, in this Blender."""
    words = [str(each) for each in ("bake", *arguments, "--here")]
    return commands.main(words, "octo", has_open_file=True)


def told(job: Path) -> dict[str, dict[str, Any]]:
    """The report, gathered from what tasks have recorded."""
    commands.main(["bake", str(job), "--gather", "--quiet"], "octo", has_open_file=True)
    content = json.loads(job.with_suffix(".report.json").read_text(encoding="utf-8"))
    return {shot["name"]: shot for shot in content["shots"]}


def statuses(job: Path) -> dict[str, str]:
    return {name: shot["status"] for name, shot in told(job).items()}


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "octo_motion", *map(str, arguments)]


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(REPOSITORY), **more}


def test_two_tasks_at_once_lose_no_record_of_each_other(tmp_path: Path) -> None:
    job = job_of(tmp_path, "a", "b")
    tasks = [
        subprocess.Popen(
            command("bake", job, "--shot", name, "--here"),
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        for name in ("a", "b")
    ]
    assert [each.wait() for each in tasks] == [0, 0]
    assert statuses(job) == {"a": "done", "b": "done"}
    # Each is tried again, as farms do: there is nothing to do, and nothing to complain of.
    assert [task(job, "--shot", "a"), task(job, "--shot", "b")] == [0, 0]
    assert statuses(job) == {"a": "skipped", "b": "skipped"}


@pytest.mark.parametrize("moment", ["before", "after"])
def test_two_tasks_of_one_shot_leave_a_whole_file_and_its_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    job = job_of(tmp_path, "a")
    real: Callable[..., None] = outputs.commit
    others: list[int] = []

    def meanwhile(places: Any) -> None:
        monkeypatch.setattr(bake, "commit", real)
        if moment == "before":
            others.append(task(job, "--shot", "a"))
        real(places)
        if moment == "after":
            others.append(task(job, "--shot", "a", "--force"))

    monkeypatch.setattr(bake, "commit", meanwhile)
    assert task(job, "--shot", "a") == 0
    assert others == [0]
    shot = told(job)["a"]
    assert shot["status"] == "done"
    assert shot["outputs"] == {"out/a.blend": bake.digest(tmp_path / "out/a.blend")}
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.blend"]


def test_faulty_shot_stops_no_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    faulty = '[[shots]]\nname = "bad"\nsettings = { speeed = 1 }\n'
    job = job_of(tmp_path, "good", more=faulty)
    assert task(job, "--shot", "good") == 0
    assert "Warning: shot 'bad': There is no setting 'speeed'." in capsys.readouterr().out
    assert task(job, "--shot", "bad") == 2
    assert task(job) == 2


def test_task_that_lost_its_record_is_done_and_what_is_there_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = job_of(tmp_path, "a")
    assert task(job, "--shot", "a") == 0
    before = told(job)["a"]
    (tmp_path / "job.report.json").unlink()
    records.Records(job, job.with_suffix(".report.json")).path("a").unlink()
    kept = (tmp_path / "out/a.blend").read_bytes()

    assert task(job, "--shot", "a") == 0

    assert "Its record was lost" in capsys.readouterr().out
    after = told(job)["a"]
    same = ("frames", "motion", "quality", "inputs", "fingerprint", "keys")
    assert {name: after[name] for name in same} == {name: before[name] for name in same}
    assert after["status"] == "skipped"
    # Nobody knows whether somebody has worked on it since: it is not overwritten unasked.
    longer = job.read_text(encoding="utf-8").replace("frame_end = 6", "frame_end = 7")
    job.write_text(longer, encoding="utf-8")
    assert task(job, "--shot", "a") == 3
    assert (tmp_path / "out/a.blend").read_bytes() == kept
    assert task(job, "--shot", "a", "--force") == 0


def test_task_that_dies_while_files_take_their_places_is_made_good(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    more = 'export = "out/a.glb"\n'
    job = job_of(tmp_path, "a", more=more)
    real: Callable[..., None] = outputs.commit

    def die(places: dict[Path, Path]) -> None:
        first, *_ = places.items()
        real(dict([first]))
        raise KeyboardInterrupt

    monkeypatch.setattr(bake, "commit", die)
    assert task(job, "--shot", "a") == 130
    monkeypatch.undo()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.blend"]
    assert task(job, "--shot", "a") == 0
    assert statuses(job) == {"a": "done"}
    assert task(job, "--shot", "a") == 0
    assert statuses(job) == {"a": "skipped"}


def test_chunks_and_lists_name_the_shots_of_a_job(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = job_of(tmp_path, *"abcde")
    assert task(job, "--index", "2-3,5-9", "--list") == 0
    assert json.loads(capsys.readouterr().out) == ["b", "c", "e"]
    assert task(job, "--shot", "b", "d", "--check") == 0
    assert capsys.readouterr().out.split() == ["b:", "ready", "d:", "ready"]
    assert task(job, "--index", "6-9", "--list") == 2
    assert task(job, "--index", "3-1") == 2
    assert task(job, "--index", "4", "--quiet") == 0
    assert "d: done" not in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["d.blend"]
    assert commands.main(["bake", str(job), "--gather"], "octo", has_open_file=True) == 1
    assert "1 done, 0 skipped, 0 failed, 4 not made yet (a, b, c, e)." in capsys.readouterr().out


def test_files_of_a_shot_are_told_for_those_who_bring_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = '[[shots]]\nname = "b"\nfile = "reef.blend"\nexport = ["b.glb", "b.abc"]\n'
    job = job_of(tmp_path, "a", more=more)
    assert task(job, "--shot", "b", "--files") == 0
    assert json.loads(capsys.readouterr().out) == {
        "b": {
            "inputs": [str(job), str(tmp_path / "reef.blend")],
            "outputs": [str(tmp_path / name) for name in ("out/b.blend", "b.glb", "b.abc")],
        }
    }


def test_one_table_means_a_shot_for_each_file_or_action(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "clips").mkdir()
    for name in ("run.bvh", "hop.fbx", "notes.txt"):
        (tmp_path / "clips" / name).touch()
    for name in ("Walk: slow", "Walk fast", "Nod"):
        bpy.data.actions.new(name).use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "hero.blend"))
    job = tmp_path / "job.toml"
    job.write_text(
        '[defaults]\nkind = "splice"\noutput = "out/{name}.blend"\n'
        'splices = [{ part = "head", clip = "nod.bvh" }]\n'
        '[[shots]]\neach = "clips"\nfile = "{each}"\n'
        '[[shots]]\neach = "clips/*.b*"\nname = "again_{stem}"\nfile = "{each}"\n'
        '[[shots]]\neach = { actions = "hero.blend", named = "Walk*" }\n'
        'file = "hero.blend"\nbase = "{each}"\n',
        encoding="utf-8",
    )
    capsys.readouterr()
    assert task(job, "--files") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == ["hop", "run", "again_run", "Walk fast", "Walk_ slow"]
    assert found["hop"]["inputs"][1] == str(tmp_path / "clips/hop.fbx")
    assert found["Walk_ slow"]["outputs"] == [str(tmp_path / "out/Walk_ slow.blend")]
    job.write_text('[[shots]]\neach = "none/*.bvh"\nfile = "{each}"\n', encoding="utf-8")
    assert task(job, "--list") == 2
    assert task(job) == 2
    assert "There is nothing for each of 'none/*.bvh'." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("shot", "status"),
    [
        ("limits = { turn = 0.1 }", 3),
        ('file = "gone.blend"', 3),
        ("settings = { frame_start = 9 }", 3),
    ],
)
def test_status_says_that_trying_again_makes_no_sense(
    tmp_path: Path, shot: str, status: int
) -> None:
    job = job_of(tmp_path, "a", more=f"{shot}\n")
    assert task(job) == status
    assert commands.main(["bake", str(job), "--gather"], "octo", has_open_file=True) == status


def test_status_says_to_try_again_where_the_machine_is_at_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_places: object) -> None:
        raise WriteError("The disk is full.", "Make room.")

    job = job_of(tmp_path, "a")
    monkeypatch.setattr(bake, "commit", full)
    assert task(job) == 1
    monkeypatch.undo()
    assert task(job) == 0


# Python runs this when it starts: a signal arrives before Blender is there.
EARLY = """
import signal, sys
class Watch:
    def find_spec(self, name, path=None, target=None):
        if name == "bpy":
            signal.raise_signal(signal.{how})
if sys.orig_argv[1:3] == ["-m", "octo_motion"]:
    sys.meta_path.insert(0, Watch())
"""


@posix
@pytest.mark.parametrize("how", ["SIGTERM", "SIGINT"])
def test_task_is_stopped_in_its_first_second_without_a_word(tmp_path: Path, how: str) -> None:
    (tmp_path / "sitecustomize.py").write_text(EARLY.format(how=how), encoding="utf-8")
    paths = os.pathsep.join([str(REPOSITORY), str(tmp_path)])
    ended = subprocess.run(
        command("bake", job_of(tmp_path, "a")),
        env=environment(PYTHONPATH=paths),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert (ended.returncode, ended.stdout) == (130, "")
    assert ended.stderr == "Stopped.\n"
    assert signal.Signals[how]


def test_the_same_shot_has_the_same_motion_in_any_order_and_process(tmp_path: Path) -> None:
    found: list[dict[str, str]] = []
    for number, names in enumerate(("ab", "ba")):
        folder = tmp_path / str(number)
        folder.mkdir()
        job = job_of(folder, *names)
        if number:
            assert commands.main(["bake", str(job)], "octo", has_open_file=True) == 0
        else:
            assert task(job) == 0
        found.append({name: shot["motion"] for name, shot in told(job).items()})
    assert found[0] == found[1]
    assert len(found[0]["a"]) == 64
    # Another motion has another digest.
    other = tmp_path / "other"
    other.mkdir()
    job = job_of(other, "a", more='gait = "swim"\n')
    assert task(job) == 0
    assert told(job)["a"]["motion"] != found[0]["a"]


def test_progress_is_printed_for_farms(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = job_of(tmp_path, "a", "b")
    assert task(job, "--progress", "--quiet") == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("openjd_")]
    assert [line for line in lines if "progress" in line] == [
        "openjd_progress: 50.0",
        "openjd_progress: 100.0",
    ]
    assert lines[1].startswith("openjd_status: a: done, 6 frames")


@posix
def test_signal_is_not_lost_while_a_record_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = job_of(tmp_path, "a")
    real = records.Records.settle

    def interrupted(self: records.Records, record: Any) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        real(self, record)

    monkeypatch.setattr(records.Records, "settle", interrupted)
    assert task(job) == 130
    monkeypatch.undo()
    # The files are whole and known: nothing is made anew.
    assert task(job) == 0
    assert statuses(job) == {"a": "skipped"}
