# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole job: many shots in one TOML file, checked as a whole before anything runs.

What the text itself says is checked first; whether the files that it names can be used is seen when
they are looked at, and concerns one shot alone. What is new or changed is baked, each in a process
of its own.
"""

from __future__ import annotations

import os
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from ..core.errors import OctoMotionError
from .job_report import (
    ShotRecord,
    Verdict,
    count,
    digest,
    fingerprint,
    judge,
    read_report,
    write_report,
)
from .outputs import commit, staged
from .schema import Known, Reading, unknown
from .shot_schema import KINDS, ShotRequest, kind_of, read_shot
from .vocabulary import check_file, known, resolver, with_gait
from .worker import (
    Ended,
    Task,
    check_jobs,
    child_command,
    child_environment,
    last_lines,
    read_answer,
    run_processes,
    write_request,
)

_TABLES: Final = ("defaults", "shots")
_ADDED: Final = ("settings", "octopus", "limits")
"""Tables of a shot that are added to those of the defaults; all else takes their place."""


class JobError(OctoMotionError):
    """The job is wrong; ``faults`` has a sentence or two for each reason."""

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
        listed = "\n".join(f"  {fault}" for fault in faults)
        super().__init__(f"{source} has {count}; nothing was run:\n{listed}")


@dataclass(frozen=True)
class JobFile:
    """A job file that was found to be in order."""

    path: Path
    shots: tuple[ShotRequest, ...]
    asked: Mapping[str, Mapping[str, Any]]
    """Of each shot, by name: its table with the defaults filled in, as it stands in the file."""


def read_job(path: Path, known: Known, report: Path) -> JobFile:
    """The shots of a job file; none of their outputs may have the report's path.

    Raises:
        JobError: the file cannot be read or is wrong, with everything that is wrong with it.
    """
    path = path.resolve()
    content = _content(path)
    faults = [unknown("table", name, _TABLES) for name in content if name not in _TABLES]
    defaults = content.get("defaults", {})
    if not isinstance(defaults, dict):
        faults.append("defaults: It must be a table, [defaults].")
        defaults = {}
    if "name" in defaults:
        faults.append("defaults: A name belongs to one shot.")
    tables = content.get("shots", [])
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        faults.append("shots: Write each shot as a table of its own, [[shots]].")
        tables = []
    elif not tables:
        faults.append("There are no shots: write each as a table of its own, [[shots]].")
    asked = [_merged(defaults, table) for table in tables]
    shots: list[ShotRequest] = []
    for place, table in enumerate(asked, 1):
        name = table.get("name")
        name = name if isinstance(name, str) and name.strip() else ""
        label = f"shot '{name}'" if name else f"shot number {place}"
        reading = Reading(known, resolver(path, name), faults)
        shots.append(read_shot(table, reading.within(label)))
    counts = Counter(shot.name for shot in shots if shot.name)
    faults += [
        f"shot '{name}': {count} shots have this name."
        for name, count in counts.items()
        if count > 1
    ]
    faults += _path_faults(shots, path, report)
    if faults:
        raise JobError(f"'{path}'", faults)
    return JobFile(path, tuple(shots), {table["name"]: table for table in asked})


def _content(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise JobError(f"'{path}'", [f"It cannot be read: {error.strerror}."]) from error
    except UnicodeDecodeError as error:
        raise JobError(f"'{path}'", ["It is not a text in UTF-8."]) from error
    except tomllib.TOMLDecodeError as error:
        raise JobError(f"'{path}'", [f"It is not TOML: {error}."]) from error


def _merged(defaults: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    own = KINDS[kind_of({**defaults, **table})]
    others = {key for keys in KINDS.values() for key in keys if key not in own}
    # What only shots of another kind have is not meant for this one.
    merged = {key: value for key, value in defaults.items() if key not in {"name", *others}}
    # A shot that says where its creature comes from does not mean the defaults' other one.
    for key, other in (("file", "octopus"), ("octopus", "file")):
        if key in table and other not in table:
            merged.pop(other, None)
    shared = {key: merged[key] for key in _ADDED if key in merged}
    added = {key: table[key] for key in _ADDED if key in table}
    return {**merged, **table, **_united(shared, added)}


def _united(shared: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with the values of both; of what both say, it is as the second one says."""
    result = dict(shared)
    for key, value in own.items():
        before = result.get(key)
        if isinstance(value, dict) and isinstance(before, dict):
            result[key] = _united(before, value)
        else:
            result[key] = value
    return result


def _path_faults(shots: Sequence[ShotRequest], job: Path, report: Path) -> list[str]:
    """Outputs that would overwrite what is read, or one another."""
    owners = {_key(job): "the job file itself", _key(report.resolve()): "the report"}
    for shot in shots:
        for path in shot.inputs:
            owners.setdefault(_key(path), f"an input of shot '{shot.name}'")
    faults = []
    for shot in shots:
        for path in shot.outputs:
            owner = owners.get(_key(path))
            if owner is not None:
                faults.append(f"shot '{shot.name}': Its output '{path}' is {owner}: give another.")
            owners.setdefault(_key(path), f"an output of shot '{shot.name}' too")
    return faults


def _key(path: Path) -> str:
    return os.path.normcase(path)


# --- Running it -----------------------------------------------------------------------------------


STOPPED = 130
"""Exit status of a run that was stopped by Ctrl-C, as shells have it."""


@dataclass(frozen=True)
class _Plan:
    """A shot that was looked at."""

    shot: ShotRequest
    fingerprint: str
    verdict: Verdict


def bake(
    job: Path,
    *,
    report: Path | None,
    jobs: int | None,
    force: bool,
    check: bool,
    only: Sequence[str],
) -> int:
    """Run a job as the command line asks for it, and print how far it has come.

    The exit status is 0 where all is done, 1 where a shot failed, 130 where it was stopped.

    Raises:
        OctoMotionError: the job, its report or the options are wrong. Nothing has been run.
    """
    path = job.resolve()
    report = report.resolve() if report else path.with_suffix(".report.json")
    file = read_job(path, known(), report)
    chosen = _chosen(file, only)
    run = _Run(file, read_report(report), report, len(chosen))
    problems = _problems(chosen)
    plans = [_plan(shot, run, problems, force=force) for shot in chosen]
    jobs = check_jobs(jobs, sum(plan.verdict.must_bake for plan in plans))
    if check:
        for plan in plans:
            state = plan.verdict.reason or ("unchanged" if plan.verdict.skip else "ready")
            _say(f"{plan.shot.name}: {state}")
        return 1 if any(plan.verdict.reason for plan in plans) else 0
    return run.all(plans, jobs)


def _chosen(job: JobFile, only: Sequence[str]) -> list[ShotRequest]:
    names = [shot.name for shot in job.shots]
    if faults := [unknown("shot", name, names) for name in only if name not in names]:
        raise JobError(f"'{job.path}'", faults)
    return [shot for shot in job.shots if not only or shot.name in only]


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
    inputs, outputs = (map(run.relative, paths) for paths in (shot.inputs, shot.outputs))
    verdict = judge(run.records.get(shot.name), mark, inputs, outputs, run.digest)
    return _Plan(shot, mark, verdict)


def _say(line: str) -> None:
    print(line, flush=True)


@dataclass
class _Run:
    """The state of a job while it runs."""

    job: JobFile
    records: dict[str, ShotRecord]
    report: Path
    total: int
    finished: int = 0
    digests: dict[str, str] = field(default_factory=dict)
    report_problem: str = ""

    def all(self, plans: Sequence[_Plan], jobs: int) -> int:
        for plan in plans:
            if plan.verdict.reason:
                self._fail(plan, plan.verdict.reason)
            elif plan.verdict.skip:
                self._skip(plan)
        # Now, so that a report that cannot be written is known before hours of work.
        self._write_report()
        waiting = {plan.shot.name: plan for plan in plans if plan.verdict.must_bake}
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
        with (
            tempfile.TemporaryDirectory(prefix="octo-motion-") as folder,
            _Scratch(Path(folder)) as scratch,
            closing(run_processes(self._tasks(order, waiting, scratch), jobs)) as processes,
        ):
            for ended in processes:
                self._finish(waiting[ended.name], ended, scratch)
                del waiting[ended.name]
                self._report()

    def _tasks(
        self, order: Sequence[_Plan], waiting: dict[str, _Plan], scratch: _Scratch
    ) -> Iterator[Task]:
        for number, plan in enumerate(order):
            try:
                yield scratch.task(number, plan.shot, self.job)
            except OctoMotionError as error:
                self._fail(plan, str(error))
                del waiting[plan.shot.name]
                self._report()

    def _finish(self, plan: _Plan, ended: Ended, scratch: _Scratch) -> None:
        name = plan.shot.name
        said = read_answer(scratch.answer(name))
        error = said.pop("error", "") or ("" if ended.status == 0 and said else ended.reason)
        libraries = said.pop("libraries", ())
        if not error:
            try:
                commit(scratch.places[name])
            except OctoMotionError as problem:
                error = str(problem)
        said["seconds"] = round(ended.seconds, 3)
        if error:
            self._fail(plan, error, log=last_lines(scratch.log(name)), **said)
        else:
            read = [*plan.shot.inputs, *map(Path, libraries)]
            self.records[name] = ShotRecord(
                name=name,
                status="done",
                outputs={self.relative(path): digest(path) for path in plan.shot.outputs},
                inputs={path: self.digest(path) for path in map(self.relative, read)},
                fingerprint=plan.fingerprint,
                **said,
            )
            made = f"done, {said['frames']} frames in {ended.seconds:.1f} s"
            self._tell(name, made, said["warnings"])
        scratch.leave(name)

    def _fail(self, plan: _Plan, error: str, **said: Any) -> None:
        name = plan.shot.name
        before = self.records.get(name)
        kept = before.written if before else {}
        self.records[name] = ShotRecord(name, "failed", error, earlier_outputs=kept, **said)
        self._tell(name, f"failed: {error}")

    def _skip(self, plan: _Plan) -> None:
        name = plan.shot.name
        self.records[name] = replace(self.records[name], status="skipped")
        kept = [
            f"'{path}' has been changed since it was baked, and is kept."
            for path in plan.verdict.kept
        ]
        self._tell(name, "skipped, unchanged", kept)

    def _tell(self, name: str, what: str, warnings: Sequence[str] = ()) -> None:
        self.finished += 1
        _say(f"[{self.finished}/{self.total}] {name}: {what}")
        for warning in warnings:
            _say(f"    {warning}")

    def _conclude(self, plans: Sequence[_Plan]) -> int:
        records = [self.records[plan.shot.name] for plan in plans]
        counts = (f"{count(records, each)} {each}" for each in ("done", "skipped", "failed"))
        _say(f"{', '.join(counts)}. Report: {self.report_problem or self.report}")
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
        names = (shot.name for shot in self.job.shots)
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


class _Scratch(ExitStack):
    """Requests, answers, logs and unfinished outputs of the shots; gone in the end."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.places: dict[str, Mapping[Path, Path]] = {}
        self._folder = folder
        self._numbers: dict[str, int] = {}
        self._open: dict[str, ExitStack] = {}

    def task(self, number: int, shot: ShotRequest, job: JobFile) -> Task:
        """Everything ready for one shot.

        Raises:
            WriteError: an output cannot be written where it is wanted.
        """
        self._numbers[shot.name] = number
        own = self.enter_context(ExitStack())
        self._open[shot.name] = own
        self.places[shot.name] = own.enter_context(staged(shot.outputs))
        request = self._path(shot.name, "request.json")
        write_request(request, job.path, job.asked[shot.name], self.places[shot.name])
        command = child_command(request, self.answer(shot.name))
        return Task(shot.name, command, child_environment(self._folder), self.log(shot.name))

    def leave(self, name: str) -> None:
        """Delete what is left of a shot's unfinished outputs."""
        self._open.pop(name).close()

    def answer(self, name: str) -> Path:
        return self._path(name, "answer.json")

    def log(self, name: str) -> Path:
        return self._path(name, "log.txt")

    def _path(self, name: str, ending: str) -> Path:
        return self._folder / f"{self._numbers[name]}-{ending}"
