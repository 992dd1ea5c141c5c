# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole job: look at every shot, bake what is new or changed, each in a process of its own."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..core.errors import OctoMotionError
from .fingerprint import digest, fingerprint
from .job_file import JobError, JobFile, JobShot, Known, load_gait_file, read_job
from .outputs import commit, staged
from .processes import Ended, Task, check_jobs, last_lines, run_processes
from .report import ShotRecord, count, judge, read_report, write_report
from .setting_values import unknown
from .shot_request import ShotEntry
from .worker import WorkerAnswer, child_command, child_environment, read_answer, write_request

STOPPED = 130
"""Exit status of a run that was stopped by Ctrl-C, as shells have it."""


@dataclass(frozen=True)
class BakeOptions:
    """What the command line asks for."""

    job: Path
    report: Path | None = None
    jobs: int | None = None
    force: bool = False
    check: bool = False
    only: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Plan:
    """A shot that was looked at."""

    entry: ShotEntry
    fingerprint: str
    inputs: tuple[Path, ...]
    problem: str = ""
    skip: bool = False
    kept: tuple[str, ...] = ()


def bake(
    options: BakeOptions,
    known: Known,
    check_file: Callable[[Path], None],
    say: Callable[[str], None],
) -> int:
    """Run a job.

    Args:
        options: which, and how.
        known: what shots may name.
        check_file: raises OctoMotionError if Blender cannot read a file.
        say: takes lines about the progress.

    Returns:
        The exit status: 0 all is done, 1 a shot failed, 130 stopped.

    Raises:
        OctoMotionError: the job, its report or the options are wrong. Nothing has been run.
    """
    path = options.job.resolve()
    report = options.report or path.with_suffix(".report.json")
    job = read_job(path, known, report)
    chosen = _chosen(job, options.only)
    records = read_report(report)
    run = _Run(job, records, report, say, len(chosen))
    problems = _problems(chosen, check_file)
    plans = [_plan(shot, run, problems, force=options.force) for shot in chosen]
    jobs = check_jobs(options.jobs, sum(not (plan.problem or plan.skip) for plan in plans))
    if options.check:
        for plan in plans:
            state = plan.problem or ("unchanged" if plan.skip else "ready")
            say(f"{plan.entry.name}: {state}")
        return 1 if any(plan.problem for plan in plans) else 0
    return run.all(plans, jobs)


def _chosen(job: JobFile, only: Sequence[str]) -> list[JobShot]:
    names = [shot.entry.name for shot in job.shots]
    if faults := [unknown("shot", name, names) for name in only if name not in names]:
        raise JobError(f"'{job.path}'", faults)
    return [shot for shot in job.shots if not only or shot.entry.name in only]


def _problems(shots: Sequence[JobShot], check_file: Callable[[Path], None]) -> dict[Path, str]:
    """What is wrong with the files of shots; many shots may be of one file."""
    problems: dict[Path, str] = {}
    for file in {path for shot in shots for path in shot.entry.inputs}:
        try:
            check_file(file)
        except OctoMotionError as error:
            problems[file] = str(error)
    return problems


def _plan(shot: JobShot, run: _Run, problems: Mapping[Path, str], *, force: bool) -> _Plan:
    """Look at a shot, without changing anything."""
    inputs = shot.inputs
    try:
        entry = load_gait_file(shot)
        problem = next((problems[path] for path in entry.inputs if path in problems), "")
    except OctoMotionError as error:
        entry, problem = shot.entry, str(error)
    plan = _Plan(entry, fingerprint(shot.asked, entry.gait), inputs, problem)
    if problem or force:
        return plan
    verdict = judge(
        run.records.get(entry.name),
        plan.fingerprint,
        [run.relative(path) for path in inputs],
        [run.relative(path) for path in entry.outputs],
        run.digest,
    )
    return replace(plan, skip=verdict.skip, problem=verdict.reason, kept=verdict.kept)


@dataclass
class _Run:
    """The state of a job while it runs."""

    job: JobFile
    records: dict[str, ShotRecord]
    report: Path
    say: Callable[[str], None]
    total: int
    finished: int = 0
    digests: dict[str, str] = field(default_factory=dict)
    report_problem: str = ""

    def all(self, plans: Sequence[_Plan], jobs: int) -> int:
        """Bake what is to be baked."""
        for plan in plans:
            if plan.problem:
                self._fail(plan, plan.problem)
            elif plan.skip:
                self._skip(plan)
        # Now, so that a report that cannot be written is known before hours of work.
        self._write_report()
        waiting = {plan.entry.name: plan for plan in plans if not (plan.problem or plan.skip)}
        order = list(waiting.values())
        try:
            self._bake(order, waiting, jobs)
        except KeyboardInterrupt:
            for plan in waiting.values():
                self._fail(plan, "Stopped before it was done.")
            self._report()
            self._conclude(plans)
            return STOPPED
        return self._conclude(plans)

    def _bake(self, order: Sequence[_Plan], waiting: dict[str, _Plan], jobs: int) -> None:
        """Bake shots; those that have come to an end leave ``waiting``."""
        with tempfile.TemporaryDirectory(prefix="octo-motion-") as scratch:
            stage = _Stage(Path(scratch))
            with stage:
                processes = run_processes(self._tasks(order, waiting, stage), jobs)
                try:
                    for ended in processes:
                        plan = waiting[ended.name]
                        self._finish(plan, ended, stage)
                        del waiting[ended.name]
                        self._report()
                finally:
                    processes.close()

    def _tasks(
        self, order: Sequence[_Plan], waiting: dict[str, _Plan], stage: _Stage
    ) -> Iterator[Task]:
        for number, plan in enumerate(order):
            try:
                yield stage.task(number, plan.entry)
            except OctoMotionError as error:
                self._fail(plan, str(error))
                del waiting[plan.entry.name]
                self._report()

    def _finish(self, plan: _Plan, ended: Ended, stage: _Stage) -> None:
        name = plan.entry.name
        answer = read_answer(stage.answer(name))
        error = ended.reason if answer is None else answer.error
        if answer is not None and not error and ended.status != 0:
            error = ended.reason
        if not error:
            try:
                commit(stage.places[name])
            except OctoMotionError as problem:
                error = str(problem)
        seconds = round(ended.seconds, 3)
        if error or answer is None:
            self._fail(plan, error, seconds, last_lines(stage.log(name)), answer)
            stage.leave(name)
            return
        read = [*plan.inputs, *(Path(each) for each in answer.libraries)]
        self.records[name] = ShotRecord(
            name=name,
            status="done",
            frames=answer.frames,
            frame_start=answer.frame_start,
            frame_end=answer.frame_end,
            seconds=seconds,
            warnings=list(answer.warnings),
            quality=answer.quality,
            keys=answer.keys,
            dense_keys=answer.dense_keys,
            outputs={self.relative(path): digest(path) for path in plan.entry.outputs},
            inputs={path: self.digest(path) for path in map(self.relative, read)},
            fingerprint=plan.fingerprint,
        )
        stage.leave(name)
        self._tell(name, f"done, {answer.frames} frames in {seconds:.1f} s", answer.warnings)

    def _fail(
        self,
        plan: _Plan,
        error: str,
        seconds: float | None = None,
        log: str = "",
        answer: WorkerAnswer | None = None,
    ) -> None:
        name = plan.entry.name
        before = self.records.get(name)
        said = answer or WorkerAnswer()
        self.records[name] = ShotRecord(
            name=name,
            status="failed",
            error=error,
            frames=said.frames,
            frame_start=said.frame_start,
            frame_end=said.frame_end,
            seconds=seconds,
            warnings=list(said.warnings),
            quality=said.quality,
            keys=said.keys,
            dense_keys=said.dense_keys,
            earlier_outputs=before.written if before else {},
            log=log,
        )
        self._tell(name, f"failed: {error}")

    def _skip(self, plan: _Plan) -> None:
        name = plan.entry.name
        self.records[name] = replace(self.records[name], status="skipped")
        kept = [f"'{path}' has been changed since it was baked, and is kept." for path in plan.kept]
        self._tell(name, "skipped, unchanged", kept)

    def _tell(self, name: str, what: str, warnings: Sequence[str] = ()) -> None:
        self.finished += 1
        self.say(f"[{self.finished}/{self.total}] {name}: {what}")
        for warning in warnings:
            self.say(f"    {warning}")

    def _conclude(self, plans: Sequence[_Plan]) -> int:
        records = [self.records[plan.entry.name] for plan in plans]
        told = (f"{count(records, each)} {each}" for each in ("done", "skipped", "failed"))
        self.say(f"{', '.join(told)}. Report: {self.report_problem or self.report}")
        return 1 if count(records, "failed") or self.report_problem else 0

    def _report(self) -> None:
        """Write the report if that is possible; if not, the shots are baked all the same."""
        try:
            self._write_report()
        except OctoMotionError as error:
            self.report_problem = str(error)
        else:
            self.report_problem = ""

    def _write_report(self) -> None:
        """Write the report: shots in the job's order; those that are no longer in it leave."""
        names = (shot.entry.name for shot in self.job.shots)
        records = [self.records[name] for name in names if name in self.records]
        write_report(self.report, self.job.path, records)

    def relative(self, path: Path) -> str:
        """A path as reports have it, so that a job may be moved with its files."""
        try:
            return Path(os.path.relpath(path, self.job.path.parent)).as_posix()
        except ValueError:
            # On another drive of Windows.
            return path.as_posix()

    def digest(self, relative: str) -> str:
        """Digest of a file; each is read once, for inputs do not change while a job runs."""
        if relative not in self.digests:
            self.digests[relative] = digest(self.job.path.parent / relative)
        return self.digests[relative]


class _Stage(ExitStack):
    """Requests, answers, logs and unfinished outputs of the shots; gone in the end."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.places: dict[str, Mapping[Path, Path]] = {}
        self._folder = folder
        self._numbers: dict[str, int] = {}
        self._open: dict[str, ExitStack] = {}

    def task(self, number: int, entry: ShotEntry) -> Task:
        """Everything ready for one shot.

        Raises:
            WriteError: an output cannot be written where it is wanted.
        """
        self._numbers[entry.name] = number
        own = self.enter_context(ExitStack())
        self._open[entry.name] = own
        self.places[entry.name] = own.enter_context(staged(entry.outputs))
        request = self._path(entry.name, "request.json")
        write_request(request, entry, self.places[entry.name])
        command = child_command(request, self.answer(entry.name))
        return Task(entry.name, command, child_environment(self._folder), self.log(entry.name))

    def leave(self, name: str) -> None:
        """Delete what is left of a shot's unfinished outputs."""
        self._open.pop(name).close()

    def answer(self, name: str) -> Path:
        return self._path(name, "answer.json")

    def log(self, name: str) -> Path:
        return self._path(name, "log.txt")

    def _path(self, name: str, ending: str) -> Path:
        return self._folder / f"{self._numbers[name]}-{ending}"
