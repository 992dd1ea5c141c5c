# SPDX-License-Identifier: GPL-3.0-or-later
"""Files as artists on any system write and name them, and files that other programs hold open."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from octo_motion.command_line import bake, stopping, worker
from octo_motion.command_line.command_line import parse
from octo_motion.command_line.job import JobError, read_job
from octo_motion.command_line.job_report import ShotRecord, write_report
from octo_motion.command_line.outputs import commit, staged
from octo_motion.command_line.records import Records
from octo_motion.command_line.vocabulary import known
from octo_motion.core.errors import WriteError
from octo_motion.core.files import name_fault, plain_name
from octo_motion.core.locomotion.gait import gait_presets, gait_to_json
from octo_motion.core.posing.pose_script import FORMAT
from octo_motion.ui.operator_base import ArmaturePresetAdd

BOM = "\ufeff"
NEW = "octopus = {}\nroute = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]\n"
SHOT = f'[[shots]]\nname = "a"\noutput = "a.blend"\n{NEW}'


def read(folder: Path, text: str) -> None:
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    read_job(path, known(), folder / "job.report.json")


def faults(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(JobError) as caught:
        read(folder, text)
    return caught.value.faults


# --- What editors write --------------------------------------------------------------------------


def test_files_with_the_mark_that_windows_editors_put_before_texts_are_read(tmp_path: Path) -> None:
    script = {"format": FORMAT, "version": 1, "steps": [{"do": "wait", "seconds": 1}]}
    (tmp_path / "pose.json").write_text(BOM + json.dumps(script), encoding="utf-8")
    gait = gait_to_json(gait_presets()["swim"])
    (tmp_path / "sneak.json").write_text(BOM + gait, encoding="utf-8")
    posed = '[[shots]]\nname = "b"\nkind = "pose"\noctopus = {}\nscript = "pose.json"\n'
    read(tmp_path, f'{BOM}{SHOT}gait = "sneak.json"\n{posed}output = "b.blend"\n')


@pytest.mark.parametrize(
    "line",
    [
        r'output = "shots\new\test.blend"',  # a newline and a tab
        r'output = "C:\Users\me\a.blend"',
        r'output = "shots\winter.blend"',  # no escape of TOML
    ],
)
def test_backslashes_in_double_quotes_are_told_with_what_to_write(
    tmp_path: Path, line: str
) -> None:
    (told,) = faults(tmp_path, SHOT.replace('output = "a.blend"', line))
    assert "Write / between folders" in told


def test_backslashes_are_told_where_they_are_no_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = SHOT.replace('"a.blend"', r"'shots\a.blend'")
    monkeypatch.setattr(sys, "platform", "linux")
    (told,) = faults(tmp_path, text)
    assert "has backslashes, which Windows alone takes. Write / between folders" in told


# --- Names ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "a:b",
        "aux",
        "NUL",
        "con.old",
        "com1",
        "lpt\u00b9",
        "what?",
        "a.",
        "a ",
        "x" * 201,
        "x" * 49 + ".y" * 90,
    ],
)
def test_name_that_some_system_cannot_take_is_refused_on_each(tmp_path: Path, name: str) -> None:
    assert name_fault(name)
    assert not name_fault(plain_name(name))
    named = f'output = "{{name}}.blend"\n{NEW}'
    told = faults(tmp_path, f'[[shots]]\nname = "{name}"\n{named}')
    assert any("Give the shot another name." in each for each in told)
    told = faults(tmp_path, SHOT.replace('"a.blend"', f'"out/{name}/a.blend"'))
    assert any("Give the file another name." in each for each in told)


@pytest.mark.parametrize("name", ["walk", "sq1/sh010", "\u00fcber den Riff", "a.v2", "auxiliary"])
def test_usual_names_are_taken(tmp_path: Path, name: str) -> None:
    read(tmp_path, f'[[shots]]\nname = "{name}"\noutput = "../out/{{name}}.blend"\n{NEW}')


def test_presets_are_never_named_after_devices() -> None:
    assert ArmaturePresetAdd.as_filename("Slow Walk") == "Slow_Walk"
    for name in ("aux", "Com1"):
        safe = ArmaturePresetAdd.as_filename(name)
        assert not name_fault(safe)
        assert ArmaturePresetAdd.as_filename(safe) == safe


def test_files_that_are_the_same_where_capitals_do_not_count_are_told_everywhere(
    tmp_path: Path,
) -> None:
    other = SHOT.replace('"a"', '"b"')
    (told,) = faults(tmp_path, SHOT + other.replace("a.blend", "A.blend"))
    assert "is an output of shot 'a' too" in told
    # One letter, or a letter and its accent.
    composed, parted = SHOT.replace("a.blend", "\u00e9.blend"), other.replace("a.b", "e\u0301.b")
    (told,) = faults(tmp_path, composed + parted)
    assert "is an output of shot 'a' too" in told
    told = faults(tmp_path, SHOT + SHOT.replace('"a"', '"A"').replace("a.blend", "b.blend"))
    assert "differs from it in capitals alone" in told[0]


def test_output_that_is_an_input_by_another_name_is_told(tmp_path: Path) -> None:
    (tmp_path / "reef.blend").write_bytes(b"BLENDER")
    (tmp_path / "other.blend").hardlink_to(tmp_path / "reef.blend")
    shot = '[[shots]]\nname = "a"\nfile = "reef.blend"\noutput = "other.blend"\n'
    (told,) = faults(tmp_path, shot)
    assert "is an input of shot 'a'" in told


# --- Files that others hold open -----------------------------------------------------------------


def held(times: float, code: int) -> Callable[[Path, Path], Path]:
    """Path.replace, as it is on Windows while another program reads the file."""
    real, calls = Path.replace, iter(range(1000))

    def replace(source: Path, target: Path) -> Path:
        if next(calls) < times:
            error = PermissionError(13, "The process cannot access the file")
            error.winerror = code
            raise error
        return real(source, target)

    return replace


@pytest.mark.parametrize("code", [5, 32, 33])
def test_file_that_a_scanner_holds_for_a_moment_takes_its_place_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    waited: list[float] = []
    monkeypatch.setattr(time, "sleep", waited.append)
    monkeypatch.setattr(Path, "replace", held(4, code))
    with staged([tmp_path / "a.blend"]) as places:
        places[tmp_path / "a.blend"].write_text("made", encoding="utf-8")
        commit(places)
    assert (tmp_path / "a.blend").read_text(encoding="utf-8") == "made"
    assert 0.0 < sum(waited) < 2.0


def test_file_that_stays_open_is_named_after_two_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float] = []
    monkeypatch.setattr(time, "sleep", waited.append)
    monkeypatch.setattr(Path, "replace", held(1e9, 32))
    with staged([tmp_path / "a.blend"]) as places:
        places[tmp_path / "a.blend"].write_text("made", encoding="utf-8")
        with pytest.raises(WriteError, match=r"a\.blend' is .*open in another program\. Close it"):
            commit(places)
    assert 1.5 < sum(waited) < 2.5
    assert list(tmp_path.iterdir()) == []


def test_file_that_may_not_be_written_is_told_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(time, "sleep", lambda _: pytest.fail("waited"))
    monkeypatch.setattr(Path, "replace", refuse)
    with staged([tmp_path / "a.blend"]) as places:
        places[tmp_path / "a.blend"].write_text("made", encoding="utf-8")
        with pytest.raises(WriteError, match="Permission denied"):
            commit(places)


def test_path_that_is_too_long_for_windows_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def not_found(*_arguments: object, **_options: object) -> None:
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(Path, "touch", not_found)
    monkeypatch.setattr(sys, "platform", "win32")
    path = tmp_path / ("x" * 150) / ("y" * 150)
    with (
        pytest.raises(WriteError, match=r"Windows takes \d+\. Choose a folder nearer"),
        staged([path]),
    ):
        pass


def test_log_that_a_scanner_holds_stops_no_run_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An hour's work is done, and its folder for temporary files cannot be deleted."""

    def processes(_tasks: object, _jobs: int) -> Iterator[worker.Ended]:
        (folder,) = tmp_path.glob("octo-motion-*")
        (folder / "0-log.txt").touch()
        yield from ()

    def refuse(*_arguments: object, **_options: object) -> None:
        raise PermissionError(13, "The process cannot access the file")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(bake, "run_processes", processes)
    job: Any = None
    run = bake._Run(job, job, job)
    with monkeypatch.context() as held:
        held.setattr(os, "unlink", refuse)
        run._bake([], {}, 1)
    assert [path.name for path in tmp_path.rglob("*.txt")] == ["0-log.txt"]


def test_ctrl_break_stops_a_run_on_windows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = set(stopping._stop_signals())
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(signal, "SIGBREAK", 21, raising=False)
    assert set(stopping._stop_signals()) == {*before, 21}


# --- What consoles can show ----------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["cp437", "cp1252", "ascii"])
def test_console_that_lacks_letters_stops_nothing(
    monkeypatch: pytest.MonkeyPatch, encoding: str
) -> None:
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding=encoding))
    assert parse(["bake", "--help"], "octo", has_open_file=False) == 0
    print("10⁻³⁰ µm …", flush=True)
    assert b"JOB.toml" in shown.getvalue()


def test_children_say_what_they_say_in_utf8(tmp_path: Path) -> None:
    assert worker.child_environment(tmp_path)["PYTHONUTF8"] == "1"


# --- A million records ---------------------------------------------------------------------------


def test_report_of_many_shots_needs_no_memory_for_all_of_them(tmp_path: Path) -> None:
    records = Records(tmp_path / "job.toml", tmp_path / "job.report.json")

    def gathered(count: int) -> Iterator[ShotRecord]:
        for number in range(count):
            yield ShotRecord(f"shot {number}", "failed", log=f"{number}" * 4000)

    tracemalloc.start()
    try:
        counts = write_report(records.report, records.job, gathered(1500))
        _now, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    size = records.report.stat().st_size
    assert counts["failed"] == 1500
    assert len(json.loads(records.report.read_text(encoding="utf-8"))["shots"]) == 1500
    # Measured: 0.3 MB for a report of 18 MB.
    assert size > 15e6
    assert most < size / 10


def test_record_of_each_name_has_a_file_of_its_own(tmp_path: Path) -> None:
    records = Records(tmp_path / "job.toml", tmp_path / "job.report.json")
    names = ["a", "sq1/a", "sq1%2fa", "über", "a.b"]
    for name in names:
        records.write(ShotRecord(name, "done"))
    for name in names:
        found = records.read(name)
        assert found is not None
        assert found.name == name
    assert len(list(records.folder.iterdir())) == len(names)
    assert os.listdir(tmp_path) == ["job.records"]  # noqa: PTH208 - names alone
