# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run of a job is made of: what is skipped, whole outputs, processes, errors in one line."""

import errno
import json
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from octo_motion.command_line.command_line import parse
from octo_motion.command_line.job_report import (
    LimitError,
    ShotRecord,
    Verdict,
    check_limits,
    figures_in_words,
    judge,
    quality,
    read_report,
    write_report,
)
from octo_motion.command_line.outputs import blender_said, commit, remove_staged, staged, write_json
from octo_motion.command_line.schema import Known, Reading
from octo_motion.command_line.shot_schema import KINDS, LIMITS
from octo_motion.command_line.stopping import stoppable
from octo_motion.command_line.worker import (
    Ended,
    Task,
    check_jobs,
    last_lines,
    run_processes,
)
from octo_motion.core.errors import OctoMotionError, SettingsError, WriteError
from octo_motion.core.locomotion.gait.table import gait_presets
from octo_motion.core.locomotion.metrics.report import Figure
from octo_motion.core.processes import processors

# --- What is skipped -----------------------------------------------------------------------------

DONE = ShotRecord(
    "walk",
    "done",
    outputs={"walk.blend": "1"},
    inputs={"reef.blend": "2", "rig.blend": "3"},
    fingerprint="f",
)
FILES = {"walk.blend": "1", "reef.blend": "2", "rig.blend": "3"}


def judged(
    record: ShotRecord | None = DONE,
    *,
    fingerprint: str = "f",
    outputs: tuple[str, ...] = ("walk.blend",),
    **changed: str,
) -> Verdict:
    files = {**FILES, **{name.replace("_", "."): value for name, value in changed.items()}}
    return judge(record, fingerprint, ["reef.blend"], outputs, lambda path: files.get(path, ""))


def test_shot_that_is_done_and_unchanged_is_skipped() -> None:
    assert judged() == Verdict(skip=True)
    assert judged(replace(DONE, status="skipped")).skip


@pytest.mark.parametrize(
    "verdict",
    [
        lambda: judged(fingerprint="g"),
        lambda: judged(reef_blend="9"),
        lambda: judged(rig_blend="9"),  # a library that the scene is linked from
        lambda: judged(rig_blend=""),
        lambda: judged(walk_blend=""),
        lambda: judged(outputs=("walk.blend", "walk.glb")),
        lambda: judged(None, walk_blend=""),
        lambda: judged(ShotRecord("walk", "failed", earlier_outputs={"walk.blend": "1"})),
    ],
)
def test_shot_is_made_again_when_anything_that_it_depends_on_has_changed(
    verdict: Callable[[], Verdict],
) -> None:
    assert verdict() == Verdict(skip=False)


def test_result_that_somebody_has_worked_on_is_never_lost() -> None:
    assert judged(walk_blend="9") == Verdict(skip=True, kept=("walk.blend",))
    refused = judged(walk_blend="9", reef_blend="8")
    assert not refused.skip
    assert refused.reason == (
        "'walk.blend' has been changed since it was baked. "
        "Move it away, or give --force to overwrite it."
    )


def test_file_that_is_not_the_jobs_work_is_not_overwritten() -> None:
    assert judged(None).reason.startswith("'walk.blend' is there already.")


def test_report_keeps_what_a_later_run_needs(tmp_path: Path) -> None:
    path = tmp_path / "job.report.json"
    failed = ShotRecord("b", "failed", error="Why. What to do.", log="line")
    write_report(path, tmp_path / "job.toml", [DONE, failed])
    assert read_report(path) == {"walk": DONE, "b": failed}
    content = json.loads(path.read_text(encoding="utf-8"))
    assert (content["done"], content["skipped"], content["failed"]) == (1, 0, 1)
    assert content["job"] == "job.toml"


def test_file_that_is_no_report_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "job.report.json"
    assert read_report(path) == {}
    for text in ("{", "{}", "[]", '{"format": "octo_motion.report", "format_version": 99}', "null"):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(OctoMotionError, match="is not a report"):
            read_report(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(OctoMotionError, match="cannot be read"):
        read_report(path)


# --- Limits -------------------------------------------------------------------------------------

MEASURED = (
    Figure("SLIP", 0.0123, 40, "Arm 3 L"),
    Figure("TURN", math.radians(50.0), 41, "Arm 1 R"),
    Figure("OVERLAP", 0.0, 1, ""),
)


def limited(*figures: Figure, **limits: float) -> str:
    """What is told of a motion with these figures, which does not keep to its limits."""
    summary = SimpleNamespace(figures=figures or MEASURED)
    with pytest.raises(LimitError) as caught:
        check_limits(limits, summary)
    assert caught.value.summary is summary
    return str(caught.value)


@pytest.mark.parametrize(
    "limits",
    [
        {},
        {"slip": 0.0123, "turn": 50.1, "overlap": 0.0},
        # What a motion does not have keeps to any limit, as the depth of a swim.
        {"depth": 0.0, "miss": 0.0},
    ],
)
def test_motion_that_keeps_to_its_limits_is_done(limits: dict[str, float]) -> None:
    check_limits(limits, SimpleNamespace(figures=MEASURED))


def test_figure_above_its_limit_is_told_with_frame_arm_and_limit() -> None:
    assert limited(slip=0.01) == ("Slip is 0.0123 at frame 40 (Arm 3 L), above its limit of 0.01.")
    assert limited(turn=45, slip=0.01) == (
        "Slip is 0.0123 at frame 40 (Arm 3 L), above its limit of 0.01; "
        "turn is 50 at frame 41 (Arm 1 R), above its limit of 45."
    )


def test_figure_is_told_with_as_many_digits_as_it_takes() -> None:
    close = Figure("SLIP", 0.010000042, 40, "A")
    assert limited(close, slip=0.01) == (
        "Slip is 0.01000004 at frame 40 (A), above its limit of 0.01."
    )


def test_figure_that_is_no_number_keeps_to_no_limit() -> None:
    assert limited(Figure("DEPTH", math.nan, 3, "A"), depth=1e9) == (
        "Depth is nan at frame 3 (A), above its limit of 1e+09."
    )


def test_overlaps_that_nobody_looked_for_keep_to_no_limit() -> None:
    assert limited(MEASURED[0], overlap=0.1) == (
        "Overlaps are limited, but were not looked for. "
        "Switch tell_overlaps on, or leave the limit out."
    )


def test_figures_of_a_report_are_in_the_units_of_limits() -> None:
    assert quality(MEASURED) == {
        "slip": {"value": 0.0123, "frame": 40, "arm": "Arm 3 L"},
        "turn": {"value": pytest.approx(50.0), "frame": 41, "arm": "Arm 1 R"},
        "overlap": {"value": 0.0, "frame": 1, "arm": ""},
    }
    assert figures_in_words(MEASURED) == (
        "slip 0.0123 at frame 40 (Arm 3 L); turn 50 at frame 41 (Arm 1 R); overlap 0 at frame 1"
    )


def test_figures_that_are_no_numbers_make_no_report_that_others_cannot_read(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_json(path, quality([Figure("DEPTH", math.nan, 3, "A")]))
    assert "NaN" not in path.read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(path, math.inf)
    assert json.loads(path.read_text(encoding="utf-8"))["depth"]["value"] is None


def given_limits(*texts: str) -> tuple[dict[str, float], list[str]]:
    """What the command line's limits are read to, and what is said to be wrong."""
    option = KINDS["generate"]["limits"].option
    assert option
    assert option.collect
    reading = Reading(Known({}, gait_presets().__getitem__), Path)
    return LIMITS(option.collect(list(texts)), reading), reading.faults


def test_limits_of_the_command_line_are_numbers_by_name() -> None:
    limits, faults = given_limits("slip=1", " turn = 45.5 ", "slip=0.01", "miss=inf")
    assert limits == {"slip": 0.01, "turn": 45.5, "miss": math.inf}
    assert faults == []


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("slide=1", "There is no figure 'slide'. Did you mean 'slip'? Valid: slip, drift, depth"),
        ("slip=-1", "limits: slip must be a number of 0 or more, not '-1'."),
        ("slip=nan", "slip must be a number of 0 or more, not 'nan'."),
        ("turn=45°", "turn must be a number of 0 or more, not '45°'."),
        ("turn=", "turn must be a number of 0 or more, not ''."),
    ],
)
def test_limit_that_makes_no_sense_is_told(text: str, fault: str) -> None:
    assert any(fault in each for each in given_limits(text)[1])


def test_limit_that_limits_nothing_is_told() -> None:
    for text in ("slip", "=3"):
        with pytest.raises(
            SettingsError, match=f"'{text}' sets nothing. Write --limit name=value."
        ):
            given_limits(text)


# --- Outputs -------------------------------------------------------------------------------------


def test_outputs_take_their_places_together_and_nothing_else_is_left(tmp_path: Path) -> None:
    first, second = tmp_path / "out" / "a.blend", tmp_path / "out" / "a.glb"
    with staged([first, second]) as places:
        for path, place in places.items():
            assert (place.parent, place.suffix) == (path.parent, path.suffix)
            place.write_text(path.name, encoding="utf-8")
        commit(places)
    assert sorted(path.name for path in first.parent.iterdir()) == ["a.blend", "a.glb"]
    assert second.read_text(encoding="utf-8") == "a.glb"


def test_unfinished_outputs_leave_what_was_there_before(tmp_path: Path) -> None:
    first, second = tmp_path / "a.blend", tmp_path / "a.glb"
    first.write_text("before", encoding="utf-8")
    with staged([first, second]) as places:
        places[first].write_text("after", encoding="utf-8")
        places[first].with_name(places[first].name + "@").write_text("half", encoding="utf-8")
        with pytest.raises(WriteError, match="was not written"):
            commit(places)
    assert [path.name for path in tmp_path.iterdir()] == ["a.blend"]
    assert first.read_text(encoding="utf-8") == "before"


def test_output_that_cannot_be_written_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "folder.blend").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(WriteError, match="is a folder"), staged([tmp_path / "folder.blend"]):
        pass
    with pytest.raises(WriteError, match="cannot write"), staged([tmp_path / "file/a.blend"]):
        pass


def test_full_disk_is_told_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_arguments: object, **_options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(WriteError, match="No space left on device"):
        write_json(tmp_path / "report.json", {})
    monkeypatch.undo()
    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(WriteError, match="No space left on device"):
        write_json(tmp_path / "report.json", {})
    assert list(tmp_path.iterdir()) == []
    remove_staged(tmp_path)  # which cannot be deleted as a file; that is no error


# --- Processes -----------------------------------------------------------------------------------


def task(name: str, folder: Path, program: str) -> Task:
    return Task(name, [sys.executable, "-c", program], dict(os.environ), folder / f"{name}.txt")


def test_processes_run_to_their_ends_and_a_crash_is_ones_own(tmp_path: Path) -> None:
    programs = {
        "good": "print('fine')",
        "bad": "import sys; print('odd'); sys.exit(3)",
        "crash": "import os; os.abort()",
    }
    tasks = [task(name, tmp_path, program) for name, program in programs.items()]
    ended = {each.name: each for each in run_processes(tasks, 2)}
    assert ended["good"].status == 0
    assert ended["bad"].reason == "Blender ended early, with status 3."
    assert last_lines(tmp_path / "bad.txt") == "odd"
    if os.name == "posix":
        assert ended["crash"].reason == "Blender crashed or was ended (SIGABRT)."


def test_program_that_is_not_there_is_one_shots_failure(tmp_path: Path) -> None:
    missing = Task("a", [str(tmp_path / "none")], {}, tmp_path / "a.txt")
    assert [each.name for each in run_processes([missing, task("b", tmp_path, "")], 1)] == [
        "a",
        "b",
    ]
    assert "No such file" in last_lines(tmp_path / "a.txt")


def test_no_more_processes_run_at_a_time_than_asked_for(tmp_path: Path) -> None:
    started = []

    def tasks() -> Iterator[Task]:
        for number in range(4):
            started.append(number)
            yield task(str(number), tmp_path, "")

    seen = [len(started) for _ in run_processes(tasks(), 2)]
    assert seen[0] == 2
    assert seen[-1] == 4


def test_process_that_has_answered_is_told_before_it_ends(tmp_path: Path) -> None:
    """What it has made is taken while it is there to clean up, should nobody take it."""
    made, answer = tmp_path / "made", tmp_path / "answer"
    program = (
        "import pathlib, time\n"
        f"made, answer = pathlib.Path({str(made)!r}), pathlib.Path({str(answer)!r})\n"
        "made.touch(); answer.touch()\n"
        "while made.exists(): time.sleep(0.01)"
    )
    running = run_processes([replace(task("a", tmp_path, program), answer=answer)], 1)
    ended = next(running)
    assert (ended.name, ended.status) == ("a", 0)
    assert made.exists()
    made.unlink()
    assert list(running) == []


def test_processes_end_when_the_run_is_stopped(tmp_path: Path) -> None:
    held = "import sys; sys.stdin.read()"
    running = run_processes(
        [task("a", tmp_path, ""), task("b", tmp_path, held), task("c", tmp_path, held)], 3
    )
    assert next(running).name == "a"
    running.close()  # as an exception does; returns when all processes have ended


def test_stop_signals_interrupt_even_where_blender_takes_them_for_itself() -> None:
    before = signal.getsignal(signal.SIGTERM)
    for each in (signal.SIGINT, signal.SIGTERM):
        with pytest.raises(KeyboardInterrupt), stoppable():
            signal.raise_signal(each)
    assert signal.getsignal(signal.SIGTERM) == before


def test_strange_signals_are_told_by_their_number() -> None:
    assert Ended("a", -250, 0.0).reason == "Blender crashed or was ended (signal 250)."


def test_number_of_processes() -> None:
    assert check_jobs(3, 100) == 3
    assert check_jobs(None, 1) == check_jobs(None, 0) == 1
    assert 1 <= check_jobs(None, 100) <= min(4, processors())
    with pytest.raises(OctoMotionError, match="--jobs 1 or more"):
        check_jobs(0, 1)


def test_missing_log_has_no_lines(tmp_path: Path) -> None:
    assert last_lines(tmp_path / "none") == ""


# --- Words ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ("Error: Cannot read file\n", "Cannot read file."),
        ("Error: Cannot read file.\nmore", "Cannot read file."),
        ("Error: Python: Traceback:\n  File\n    ^^^\nKeyError: 'x'\nmore\n", "KeyError: 'x'."),
        ("Error: Python: Traceback (most recent call last):\n", "Blender does not say why."),
        ("", "Blender does not say why."),
    ],
)
def test_what_blender_says_fits_one_line(said: str, reason: str) -> None:
    assert blender_said(RuntimeError(said)) == reason


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([], "COMMAND"),
        (["dance"], "invalid choice: 'dance'"),
        (["bake"], "JOB.toml"),
        (["bake", "x.toml", "--jobs", "0"], "'0' is not a whole number of 1 or more"),
        (["generate", "x.blend", "--fps", "slow"], "'slow' is not a number from 1 to 32767"),
        (["generate"], "FILE"),
    ],
)
def test_wrong_arguments_are_told(
    capsys: pytest.CaptureFixture[str], arguments: list[str], complaint: str
) -> None:
    assert parse(arguments, "octo", has_open_file=False) == 2
    assert complaint in capsys.readouterr().err


def test_file_may_be_left_out_where_one_is_open() -> None:
    options = parse(["generate"], "octo", has_open_file=True)
    assert not isinstance(options, int)
    assert options.file is None


@pytest.mark.parametrize("arguments", [["--help"], ["bake", "--help"], ["generate", "--help"]])
def test_help_is_told(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    assert parse(arguments, "octo", has_open_file=True) == 0
    assert "Exit status: 0" in capsys.readouterr().out
