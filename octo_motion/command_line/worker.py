# SPDX-License-Identifier: GPL-3.0-or-later
"""Shots in Blenders of their own, several at a time, none of which outlives this process."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import bpy

from ..core.errors import OctoMotionError, WriteError
from ..core.processes import PROCESSES, processors
from ..ui.locomotion import Summary
from .command_line import COMMAND
from .job_report import Cause, LimitError, digest, quality
from .outputs import remove_staged, write_json
from .records import Records, sign
from .shot_runner import AnySummary, Performed, perform
from .vocabulary import make_request, resolver

if sys.platform == "win32":
    import ctypes
    import msvcrt

_GRACE: Final = 5.0
"""Seconds that a process has to end before it is ended."""
_GLANCE: Final = 0.05
"""Seconds between two looks at the processes."""
_FAULT: Final = 0xC0000000
"""From here on, a status of Windows is a fault of the program."""
_HEARTBEAT: Final = 0.5
"""Seconds between two looks whether the parent is there."""


@dataclass(frozen=True)
class Task:
    """A process to run; what it says goes to its log.

    With an ``answer`` it counts as ended once that is written: such a process waits until its files
    have been taken, for else a parent that ends in between would leave them to nobody.
    """

    name: str
    command: list[str]
    environment: dict[str, str]
    log: Path
    answer: Path | None = None


@dataclass(frozen=True)
class Ended:
    """A process that has ended; ``status`` is negative for a signal, as in subprocess."""

    name: str
    status: int
    seconds: float

    @property
    def reason(self) -> str:
        """How it ended, for a process that should have said more."""
        if self.status >= _FAULT:
            return f"Blender crashed (0x{self.status:X})."
        if self.status >= 0:
            return f"Blender ended early, with status {self.status}."
        try:
            name = signal.Signals(-self.status).name
        except ValueError:
            name = f"signal {-self.status}"
        return f"Blender crashed or was ended ({name})."


def run_processes(
    tasks: Iterable[Task], most: int, clock: Callable[[], float] = time.monotonic
) -> Generator[Ended]:
    """Run all tasks, so many at a time, and yield each as it ends.

    A task is taken from ``tasks`` only when its turn has come. Whatever ends the iteration, be it
    an error or Ctrl-C, ends all processes.
    """
    waiting = iter(tasks)
    running: list[_Running] = []
    try:
        while True:
            while len(running) < most and (task := next(waiting, None)) is not None:
                try:
                    running.append(_Running(task, _start(task, most), clock()))
                except OSError as error:
                    task.log.write_text(f"{task.command[0]}: {error}", encoding="utf-8")
                    yield Ended(task.name, 127, 0.0)
            if not running:
                return
            news = False
            for each in list(running):
                if each.process.poll() is not None:
                    running.remove(each)
                    _close(each.process)
                elif not each.has_answered():
                    continue
                if not each.told:
                    each.told = news = True
                    yield Ended(
                        each.task.name, each.process.returncode or 0, clock() - each.started
                    )
            if not news:
                time.sleep(_GLANCE)
    finally:
        _end([each.process for each in running])


@dataclass
class _Running:
    """A process that was started, and whether its end has been told."""

    task: Task
    process: subprocess.Popen[bytes]
    started: float
    told: bool = False

    def has_answered(self) -> bool:
        """Whether it has said all that it has to say."""
        return self.task.answer is not None and self.task.answer.exists()


def _start(task: Task, most: int) -> subprocess.Popen[bytes]:
    # In a group of their own, so that Ctrl-C in a terminal reaches this process alone, which then
    # ends them in order. The pipe tells them when this process is gone, see ``dying_with_parent``.
    with task.log.open("wb") as log:
        return subprocess.Popen(  # noqa: S603 - our own command
            task.command,
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={PROCESSES: str(max(1, processors() // most)), **task.environment},
            start_new_session=sys.platform != "win32",
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )


def _end(processes: Iterable[subprocess.Popen[bytes]]) -> None:
    remaining = list(processes)
    for process in remaining:
        process.terminate()
    for process in remaining:
        try:
            process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        _close(process)


def _close(process: subprocess.Popen[bytes]) -> None:
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()


@contextlib.contextmanager
def dying_with_parent(clean_up: Callable[[], None]) -> Iterator[Callable[[], bool] | None]:
    """End this process as soon as the one that started it through ``run_processes`` is gone.

    Whatever ends that one, its end of our standard input closes. What is handed out says whether
    it is there; None where nobody started it so.
    """
    done = threading.Event()
    parent_is_there = _watched_pipe()
    if parent_is_there is None:
        # No pipe: then this process ends by itself.
        yield None
        return

    def watch() -> None:
        while not done.wait(_HEARTBEAT):
            if not parent_is_there():
                clean_up()
                os._exit(1)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield parent_is_there
    finally:
        # Blender 4.5 as a module hangs at exit while another thread of Python lives.
        done.set()
        watcher.join()


def _watched_pipe() -> Callable[[], bool] | None:
    """What says whether somebody holds the other end of our standard input; None if it is no pipe
    that can be asked.
    """
    if sys.platform == "win32":
        # There no pipe can be read without waiting before Python 3.12.
        peek = ctypes.WinDLL("kernel32").PeekNamedPipe
        try:
            pipe = ctypes.c_void_p(msvcrt.get_osfhandle(0))
        except OSError:
            return None
        if not peek(pipe, None, 0, None, None, None):
            return None
        return lambda: bool(peek(pipe, None, 0, None, None, None))
    try:
        os.set_blocking(0, False)
    except OSError:
        return None

    def is_held() -> bool:
        try:
            return os.read(0, 1) != b""
        except BlockingIOError:
            return True
        except OSError:
            return False

    return is_held


def last_lines(log: Path) -> str:
    """The last 20 lines of a log."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return "\n".join([line for line in lines if line.strip()][-20:])


def check_jobs(jobs: int | None, shots: int) -> int:
    """How many processes to run at a time.

    By default one for each processor, but four at most: each is a Blender with a scene in memory.

    Raises:
        OctoMotionError: fewer than one was asked for.
    """
    if jobs is None:
        return max(1, min(processors(), shots, 4))
    if jobs < 1:
        raise OctoMotionError(f"{jobs} processes can do nothing.", "Give --jobs 1 or more.")
    return jobs


# --- One shot in a Blender of its own, and how to start that Blender ------------------------------


RUN_SHOT: Final = "--run-shot"
"""First argument of a process that makes one shot; the paths of request and answer follow."""

_PACKAGE: Final = __name__.removesuffix(".command_line.worker")


def child_command(request: Path, answer: Path) -> list[str]:
    """The command that makes one shot in another Blender like this one."""
    arguments = [RUN_SHOT, str(request), str(answer)]
    if not bpy.app.binary_path:
        return [sys.executable, "-m", _PACKAGE, *arguments]
    factory = ["--factory-startup"] if bpy.app.factory_startup else []
    # Named once more: it may have been enabled for this session alone.
    command = [*factory, "--addons", _PACKAGE, "--command", COMMAND]
    return [bpy.app.binary_path, "--background", *command, *arguments]


def child_environment(scratch: Path) -> dict[str, str]:
    """Environment in which another Python finds this package, and has a folder for temporary files:
    a Blender that is killed leaves its own there.
    """
    root = Path(__file__).resolve().parents[1 + len(_PACKAGE.split("."))]
    paths = [str(root), *filter(None, [os.environ.get("PYTHONPATH", "")])]
    temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(scratch))
    python = {
        "PYTHONPATH": os.pathsep.join(paths),
        "PYTHONUNBUFFERED": "1",
        "PYTHONUTF8": "1",  # what they say is read as UTF-8
    }
    return {**os.environ, **temporary, **python}


@dataclass(frozen=True)
class Request:
    """What is to be made: a shot's table in a job file, and where each output is to be written."""

    job: Path
    table: Mapping[str, Any]
    places: Mapping[Path, Path]
    fingerprint: str

    def write(self, path: Path) -> None:
        """Write it down for another process; ``run_shot`` does it."""
        plain = {str(output): str(place) for output, place in self.places.items()}
        content = {**vars(self), "job": str(self.job), "places": plain}
        path.write_text(json.dumps(content), encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> Request:
        """What was written down."""
        content = json.loads(path.read_text(encoding="utf-8"))
        places = {Path(output): Path(place) for output, place in content["places"].items()}
        return cls(Path(content["job"]), content["table"], places, content["fingerprint"])


def read_answer(path: Path) -> dict[str, Any]:
    """What a process has said of its shot, nothing if it ended before it could.

    ``error`` and its ``cause`` if it failed, else what its record says of it.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def run_shot(request: Path, answer: Path) -> int:
    """Make the shot that is asked for, in the process of its own; the exit status."""
    asked = Request.read(request)

    def clean_up() -> None:
        for place in asked.places.values():
            remove_staged(place)
        # Windows deletes no file that is open, and the log is what we write to.
        for number in (1, 2):
            with contextlib.suppress(OSError):
                os.close(number)
        # Requests, answers and logs of a run that is no more.
        shutil.rmtree(request.parent, ignore_errors=True)

    with dying_with_parent(clean_up) as parent_is_there:
        said = make_shot(asked)
        write_json(answer, said)
        while parent_is_there and any(place.exists() for place in asked.places.values()):
            # Until they have been taken they are nobody's if the parent ends.
            if not parent_is_there():
                clean_up()
                break
            time.sleep(_GLANCE)
    return 1 if "error" in said else 0


def make_shot(asked: Request) -> dict[str, Any]:
    """Make a shot in this Blender: fields of its record, or ``error`` and ``cause``."""
    name = asked.table["name"]
    records = Records(asked.job, asked.job)

    def told(performed: Performed) -> dict[str, Any]:
        read = [*shot.inputs, *map(Path, performed.libraries)]
        inputs = {records.relative(path): digest(path) for path in read}
        return {
            **_said(performed.summary),
            "inputs": inputs,
            "motion": performed.motion,
            "action": performed.action,
        }

    def note(performed: Performed) -> None:
        mark = {"name": name, "status": "done", "fingerprint": asked.fingerprint}
        sign({**told(performed), **mark})

    try:
        shot = make_request(asked.table, resolver(asked.job, name))
        return told(perform(shot, asked.places, note))
    except LimitError as error:
        return {"error": str(error), "cause": "final", **_said(error.summary)}
    except OctoMotionError as error:
        return {"error": str(error), "cause": cause_of(error)}
    except Exception as error:  # noqa: BLE001 - a fault of ours is one shot's, and is told
        traceback.print_exc()
        return {"error": f"{type(error).__name__}: {error}", "cause": "again"}


def cause_of(error: OctoMotionError) -> Cause:
    """Whether it makes sense to try again: a disk may be full for a while, or on one machine."""
    return "again" if isinstance(error, WriteError) else "final"


def _said(summary: AnySummary) -> dict[str, Any]:
    """What an answer says of a motion."""
    said: dict[str, Any] = {
        "frames": summary.frames,
        "frame_start": summary.frame_start,
        "frame_end": summary.frame_end,
        "warnings": list(summary.warnings),
    }
    if isinstance(summary, Summary):
        said["quality"] = quality(summary.figures)
        said["keys"], said["dense_keys"] = summary.keys, summary.dense_keys
    return said
