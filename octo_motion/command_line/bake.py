# SPDX-License-Identifier: GPL-3.0-or-later
"""Shots of a job are made: what is new or changed, each in a process of its own or here.

Many processes, on many machines, may do so at once: what is known of a shot is in a record of its
own. See :mod:`.records`.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from ..core.errors import OctoMotionError
from .command_line import CRASHED, FAILED, FINAL, STOPPED
from .job import Choice, JobError, JobFile, name_in, read_job, read_tables
from .job_report import (
    REPORT_ENDING,
    Cause,
    ShotRecord,
    Verdict,
    digest,
    fingerprint,
    judge,
    write_report,
)
from .outputs import commit, staged
from .records import Records
from .shot_schema import ShotRequest
from .vocabulary import check_file, known, with_gait
from .worker import (
    Ended,
    Request,
    Task,
    cause_of,
    check_jobs,
    child_command,
    child_environment,
    last_lines,
    make_shot,
    read_answer,
    run_processes,
)


@dataclass(frozen=True)
class Wanted:
    """What the command line asks for of a job."""

    job: Path
    report: Path | None = None
    jobs: int | None = None
    force: bool = False
    check: bool = False
    only: Sequence[str] = ()
    index: Sequence[range] = ()
    list: bool = False
    files: bool = False
    gather: bool = False
    here: bool = False
    quiet: bool = False
    progress: bool = False

    @property
    def records(self) -> Records:
        """Where records and report of the job are."""
        path = self.job.resolve()
        return Records(path, (self.report or path.with_suffix(REPORT_ENDING)).resolve())

    @property
    def choice(self) -> Choice:
        """Which of its shots are meant."""
        return Choice(self.only, self.index)


@dataclass(frozen=True)
class _Plan:
    """A shot that was looked at."""

    shot: ShotRequest
    fingerprint: str
    verdict: Verdict


def bake(wanted: Wanted) -> int:
    """Do with a job what the command line asks for; the exit status, see :mod:`.command_line`.

    Raises:
        OctoMotionError: the job, its report or the options are wrong. Nothing has been run.
    """
    records = wanted.records
    if wanted.gather or wanted.list:
        return _list_or_gather(wanted, records)
    file = read_job(records.job, known(), records.report, wanted.choice)
    if wanted.files:
        _print_files(file)
        return 0
    run = _Run(file, records, wanted)
    for warning in file.warnings:
        run.say(f"Warning: {warning}")
    problems = _problems(file.shots)
    plans = [_plan(shot, run, problems, force=wanted.force) for shot in file.shots]
    if wanted.check:
        for plan in plans:
            state = plan.verdict.reason or ("unchanged" if plan.verdict.skip else "ready")
            run.say(f"{plan.shot.name}: {state}")
        return FINAL if any(plan.verdict.reason for plan in plans) else 0
    jobs = check_jobs(wanted.jobs, sum(plan.verdict.must_bake for plan in plans))
    return run.all(plans, jobs)


def _list_or_gather(wanted: Wanted, records: Records) -> int:
    """Say which shots there are, or what became of them; none is looked at more closely."""
    tables, faults = read_tables(records.job, known())
    if faults:
        raise JobError(f"'{records.job}'", faults)
    names = [name for table in tables if (name := name_in(table))]
    meant = [names[place] for place in wanted.choice.of(names)]
    if wanted.list:
        print(json.dumps(meant, ensure_ascii=False), flush=True)
        return 0
    causes, missing = Counter[Cause](), list[str]()
    counts = write_report(records.report, records.job, _gathered(records, names, causes, missing))
    if not wanted.quiet:
        told = [f"{counts[status]} {status}" for status in ("done", "skipped", "failed")]
        if missing:
            few = ", ".join(missing[:10]) + (", …" if len(missing) > 10 else "")
            told.append(f"{len(missing)} not made yet ({few})")
        print(f"{', '.join(told)}. Report: {records.report}", flush=True)
    return FAILED if missing else _status(causes)


def _gathered(
    records: Records, names: Sequence[str], causes: Counter[Cause], missing: list[str]
) -> Iterator[ShotRecord]:
    """Records in the job's order, one after the other; counts why shots failed, and names those
    that have none.
    """
    for name in names:
        record = records.read(name)
        if record is None:
            missing.append(name)
            continue
        if record.status == "failed":
            causes[record.cause or "again"] += 1
        yield record


def _status(causes: Counter[Cause]) -> int:
    """The exit status of a run in which shots failed for these causes."""
    if causes.get("again"):
        return FAILED
    if causes.get("crash"):
        return CRASHED
    return FINAL if causes.get("final") else 0


def _print_files(job: JobFile) -> None:
    """Tell what shots read and write, so that a farm can bring it there and back."""
    found = {
        shot.name: {
            "inputs": [str(path) for path in (job.path, *shot.inputs)],
            "outputs": [str(path) for path in shot.outputs],
        }
        for shot in job.shots
    }
    print(json.dumps(found, indent=1, ensure_ascii=False), flush=True)


def _problems(shots: Sequence[ShotRequest]) -> dict[Path, str]:
    """What is wrong with the files of shots; many shots may be of one file."""
    problems: dict[Path, str] = {}
    for file in {path for shot in shots for path in shot.opened}:
        try:
            check_file(file)
        except OctoMotionError as error:
            problems[file] = str(error)
    return problems


def _plan(shot: ShotRequest, run: _Run, problems: Mapping[Path, str], *, force: bool) -> _Plan:
    """Look at a shot, without changing anything."""
    try:
        gait = str(with_gait(shot).gait)
        problem = next((problems[path] for path in shot.opened if path in problems), "")
    except OctoMotionError as error:
        gait, problem = "", str(error)
    mark = fingerprint(run.job.asked[shot.name], gait)
    if problem or force:
        return _Plan(shot, mark, Verdict(skip=False, reason=problem))
    inputs = [run.records.relative(path) for path in shot.inputs]
    outputs = [run.records.relative(path) for path in shot.outputs]
    verdict = judge(run.earlier(shot), mark, inputs, outputs, run.digest)
    return _Plan(shot, mark, verdict)


@dataclass
class _Run:
    """The state of a job while it runs."""

    job: JobFile
    records: Records
    wanted: Wanted
    made: dict[str, ShotRecord] = field(default_factory=dict)
    """What became of shots in this run."""
    digests: dict[str, str] = field(default_factory=dict)
    problem: str = ""
    """Why a record or the report could not be written."""

    def earlier(self, shot: ShotRequest) -> ShotRecord | None:
        """What is known of a shot: its record or, where that was lost, what its output says."""
        record = self.records.read(shot.name)
        if record is None and shot.output is not None:
            said = self.records.found_in_output(shot.output)
            if said is not None and said.name == shot.name:
                unknown = {self.records.relative(path): _UNKNOWN for path in shot.outputs}
                return replace(said, outputs=unknown)
        return record

    def all(self, plans: Sequence[_Plan], jobs: int) -> int:
        if self.wanted.choice.is_everything:
            # Now, so that a report that cannot be written is known before hours of work.
            self._write_report(plans)
        for plan in plans:
            if plan.verdict.reason:
                self._fail(plan, plan.verdict.reason, "final")
            elif plan.verdict.skip:
                self._skip(plan)
        waiting = {plan.shot.name: plan for plan in plans if plan.verdict.must_bake}
        order = list(waiting.values())
        stopped = False
        try:
            if self.wanted.here:
                self._bake_here(order, waiting)
            else:
                self._bake(order, waiting, jobs)
        except KeyboardInterrupt:
            stopped = True
            for plan in waiting.values():
                self._stop(plan)
        status = self._conclude(plans)
        return STOPPED if stopped else status

    def _bake(self, order: Sequence[_Plan], waiting: dict[str, _Plan], jobs: int) -> None:
        """Bake shots; those that have come to an end leave ``waiting``."""
        with (
            # What another program still reads in it is no reason to fail.
            tempfile.TemporaryDirectory(
                prefix="octo-motion-", ignore_cleanup_errors=True
            ) as folder,
            _Scratch(Path(folder)) as scratch,
            closing(run_processes(self._tasks(order, waiting, scratch), jobs)) as processes,
        ):
            for ended in processes:
                plan = waiting[ended.name]
                answer = _answer(read_answer(scratch.answer(ended.name)), ended)
                log = "" if not answer.get("error") else last_lines(scratch.log(ended.name))
                self._finish(plan, answer, scratch.places[ended.name], log)
                scratch.leave(ended.name)
                del waiting[ended.name]

    def _tasks(
        self, order: Sequence[_Plan], waiting: dict[str, _Plan], scratch: _Scratch
    ) -> Iterator[Task]:
        for number, plan in enumerate(order):
            try:
                yield scratch.task(number, plan, self.job)
            except OctoMotionError as error:
                self._fail(plan, str(error), cause_of(error))
                del waiting[plan.shot.name]

    def _bake_here(self, order: Sequence[_Plan], waiting: dict[str, _Plan]) -> None:
        """Bake shots one after the other in this Blender; it opens their files."""
        for plan in order:
            try:
                with staged(plan.shot.outputs) as places:
                    started = time.monotonic()
                    request = Request(
                        self.job.path, self.job.asked[plan.shot.name], places, plan.fingerprint
                    )
                    answer = make_shot(request)
                    answer["seconds"] = round(time.monotonic() - started, 3)
                    self._finish(plan, answer, places)
            except OctoMotionError as error:
                self._fail(plan, str(error), cause_of(error))
            del waiting[plan.shot.name]

    def _finish(
        self, plan: _Plan, answer: dict[str, Any], places: Mapping[Path, Path], log: str = ""
    ) -> None:
        """Let the outputs of a shot take their places, if it was made."""
        if error := answer.pop("error", ""):
            cause = answer.pop("cause", "again")
            self._fail(plan, error, cause, log=log, **answer)
            return
        outputs = {self.records.relative(path): digest(place) for path, place in places.items()}
        record = ShotRecord(
            name=plan.shot.name,
            status="done",
            outputs=outputs,
            fingerprint=plan.fingerprint,
            **answer,
        )
        try:
            # Whatever happens between here and the end, it is known whose work the files are.
            self.records.write(
                replace(
                    record,
                    status="failed",
                    error="It was stopped while its files took their places.",
                    cause="again",
                    earlier_outputs=self._written(plan),
                )
            )
            commit(places)
            self.records.settle(record)
        except OctoMotionError as problem:
            self._fail(plan, str(problem), cause_of(problem), log=log, **answer)
            return
        self.made[record.name] = record
        self._tell(
            record.name,
            f"done, {record.frames} frames in {record.seconds:.1f} s",
            record.warnings,
        )

    def _fail(self, plan: _Plan, error: str, cause: Cause, **said: Any) -> None:
        record = ShotRecord(
            plan.shot.name,
            "failed",
            error,
            cause=cause,
            earlier_outputs=self._written(plan),
            **said,
        )
        self._keep(record)
        self._tell(record.name, f"failed: {error}")

    def _stop(self, plan: _Plan) -> None:
        """A shot that was not done when the run was stopped."""
        before = self.records.read(plan.shot.name)
        if before and before.outputs and before.fingerprint == plan.fingerprint:
            # Its files were taking their places: whether they all have is seen in the next run.
            self.made[before.name] = before
            self._tell(before.name, f"failed: {before.error}")
        else:
            self._fail(plan, "Stopped before it was done.", "again")

    def _written(self, plan: _Plan) -> dict[str, str]:
        """Digests of files that earlier runs of a shot have written."""
        before = self.records.read(plan.shot.name)
        return before.written if before else {}

    def _skip(self, plan: _Plan) -> None:
        name = plan.shot.name
        before = self.earlier(plan.shot)
        assert before is not None
        record = replace(before, status="skipped", error="", cause="", earlier_outputs={})
        kept = []
        if _UNKNOWN in record.outputs.values():
            kept = ["Its record was lost; what is there says that it is this shot, and is kept."]
        else:
            kept = [
                f"'{path}' has been changed since it was baked, and is kept."
                for path in plan.verdict.kept
            ]
        self._keep(record)
        self._tell(name, "skipped, unchanged", kept)

    def _keep(self, record: ShotRecord) -> None:
        """Keep a record if that is possible; if not, that is told in the end."""
        self.made[record.name] = record
        try:
            self.records.write(record)
        except OctoMotionError as error:
            self.problem = str(error)

    def _tell(self, name: str, what: str, warnings: Sequence[str] = ()) -> None:
        done, total = len(self.made), len(self.job.shots)
        self.say(f"[{done}/{total}] {name}: {what}")
        for warning in warnings:
            self.say(f"    {warning}")
        if self.wanted.progress:
            # What Open Job Description reads, and whoever else wants to.
            print(f"openjd_progress: {100.0 * done / total:.1f}", flush=True)
            print(f"openjd_status: {name}: {what}", flush=True)

    def say(self, line: str) -> None:
        """Print a line, unless nothing is to be said."""
        if not self.wanted.quiet:
            print(line, flush=True)

    def _conclude(self, plans: Sequence[_Plan]) -> int:
        made = [self.made[plan.shot.name] for plan in plans]
        if self.wanted.choice.is_everything:
            try:
                self._write_report(plans)
            except OctoMotionError as error:
                self.problem = str(error)
        statuses = Counter(record.status for record in made)
        counts = (f"{statuses[each]} {each}" for each in ("done", "skipped", "failed"))
        where = "Report" if self.wanted.choice.is_everything else "Records"
        place = self.records.report if where == "Report" else self.records.folder
        self.say(f"{', '.join(counts)}. {where}: {self.problem or place}")
        causes = Counter[Cause](record.cause for record in made if record.status == "failed")
        return FAILED if self.problem else _status(causes)

    def _write_report(self, plans: Sequence[_Plan]) -> None:
        """Write the report: shots in the job's order."""
        names = [plan.shot.name for plan in plans]
        found = (self.made.get(name) or self.records.read(name) for name in names)
        write_report(self.records.report, self.job.path, (each for each in found if each))

    def digest(self, relative: str) -> str:
        """Digest of a file; each is read once, for inputs do not change while a job runs."""
        if relative not in self.digests:
            self.digests[relative] = digest(self.records.absolute(relative))
        return self.digests[relative]


_UNKNOWN: Final = "unknown"
"""In place of a digest: the file is the job's work, but others may have worked on it since."""


def _answer(said: dict[str, Any], ended: Ended) -> dict[str, Any]:
    """What a process has said of its shot, and how it ended if it could say nothing."""
    if not said or (ended.status != 0 and "error" not in said):
        said = {"error": ended.reason, "cause": "crash"}
    return {**said, "seconds": round(ended.seconds, 3)}


class _Scratch(ExitStack):
    """Requests, answers, logs and unfinished outputs of the shots; gone in the end."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.places: dict[str, Mapping[Path, Path]] = {}
        self._folder = folder
        self._numbers: dict[str, int] = {}
        self._open: dict[str, ExitStack] = {}

    def task(self, number: int, plan: _Plan, job: JobFile) -> Task:
        """Everything ready for one shot.

        Raises:
            WriteError: an output cannot be written where it is wanted.
        """
        name = plan.shot.name
        self._numbers[name] = number
        own = self.enter_context(ExitStack())
        self._open[name] = own
        self.places[name] = own.enter_context(staged(plan.shot.outputs))
        path = self._path(name, "request.json")
        Request(job.path, job.asked[name], self.places[name], plan.fingerprint).write(path)
        command = child_command(path, self.answer(name))
        answer = self.answer(name)
        return Task(name, command, child_environment(self._folder), self.log(name), answer)

    def leave(self, name: str) -> None:
        """Delete what is left of a shot's unfinished outputs."""
        self._open.pop(name).close()

    def answer(self, name: str) -> Path:
        return self._path(name, "answer.json")

    def log(self, name: str) -> Path:
        return self._path(name, "log.txt")

    def _path(self, name: str, ending: str) -> Path:
        return self._folder / f"{self._numbers[name]}-{ending}"
