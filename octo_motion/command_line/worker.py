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

from ..core.errors import OctoMotionError
from ..ui.locomotion import Summary
from .command_line import COMMAND
from .job_report import LimitError, quality
from .outputs import remove_staged, write_json
from .shot_runner import AnySummary, perform
from .vocabulary import make_request, resolver

_GRACE: Final = 5.0
"""Seconds that a process has to end before it is ended."""
_GLANCE: Final = 0.05
"""Seconds between two looks at the processes."""
_HEARTBEAT: Final = 0.5
"""Seconds between two looks whether the parent is there."""


@dataclass(frozen=True)
class Task:
    """A process to run; what it says goes to its log."""

    name: str
    command: list[str]
    environment: dict[str, str]
    log: Path


@dataclass(frozen=True)
class Ended:
    """A process that has ended; ``status`` is negative for a signal, as in subprocess."""

    name: str
    status: int
    seconds: float

    @property
    def reason(self) -> str:
        """How it ended, for a process that should have said more."""
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
    running: dict[str, tuple[subprocess.Popen[bytes], float]] = {}
    try:
        while True:
            while len(running) < most and (task := next(waiting, None)) is not None:
                try:
                    running[task.name] = _start(task), clock()
                except OSError as error:
                    task.log.write_text(f"{task.command[0]}: {error}", encoding="utf-8")
                    yield Ended(task.name, 127, 0.0)
            if not running:
                return
            ended = [name for name, (each, _) in running.items() if each.poll() is not None]
            for name in ended:
                process, started = running.pop(name)
                _close(process)
                yield Ended(name, process.returncode, clock() - started)
            if not ended:
                time.sleep(_GLANCE)
    finally:
        _end([process for process, _ in running.values()])


def _start(task: Task) -> subprocess.Popen[bytes]:
    # In a group of their own, so that Ctrl-C in a terminal reaches this process alone, which then
    # ends them in order. The pipe tells them when this process is gone, see ``dying_with_parent``.
    with task.log.open("wb") as log:
        return subprocess.Popen(  # noqa: S603 - our own command
            task.command,
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=task.environment,
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
def dying_with_parent(clean_up: Callable[[], None]) -> Iterator[None]:
    """End this process as soon as the one that started it through ``run_processes`` is gone.

    Whatever ends that one, its end of our standard input closes.
    """
    done = threading.Event()

    def watch() -> None:
        while not done.wait(_HEARTBEAT):
            try:
                alive = os.read(0, 1) != b""
            except BlockingIOError:
                alive = True
            except OSError:
                alive = False
            if not alive:
                clean_up()
                os._exit(1)

    try:
        os.set_blocking(0, False)
    except (OSError, AttributeError):
        # No pipe, or Windows before Python 3.12: then this process ends by itself.
        yield
        return
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        # Blender 4.5 as a module hangs at exit while another thread of Python lives.
        done.set()
        watcher.join()


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Let Ctrl-C and a request to terminate raise KeyboardInterrupt, also within Blender.

    Blender in the background takes Ctrl-C for itself.
    """

    def stop(_signal: int, _frame: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.signal(each, stop) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for each, handler in before.items():
            # None stands for a handler that is not Python's own, and cannot be put back.
            signal.signal(each, signal.SIG_DFL if handler is None else handler)


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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
    python = {"PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1"}
    return {**os.environ, **temporary, **python}


def write_request(
    path: Path, job: Path, table: Mapping[str, Any], places: Mapping[Path, Path]
) -> None:
    """Write down what a process is to do; ``run_shot`` does it.

    It is told the job file, the shot's table there, and where each output is to be written.
    """
    plain = {str(output): str(place) for output, place in places.items()}
    text = json.dumps({"job": str(job), "table": table, "places": plain})
    path.write_text(text, encoding="utf-8")


def read_answer(path: Path) -> dict[str, Any]:
    """What a process has said of its shot, nothing if it ended before it could.

    ``error`` if it failed, ``libraries`` that it has read, and what a report says of the motion.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def run_shot(request: Path, answer: Path) -> int:
    """Make the shot that is asked for, in the process of its own; the exit status."""
    asked = json.loads(request.read_text(encoding="utf-8"))
    places = {Path(output): Path(place) for output, place in asked["places"].items()}

    def clean_up() -> None:
        for place in places.values():
            remove_staged(place)
        # Requests, answers and logs of a run that is no more.
        shutil.rmtree(request.parent, ignore_errors=True)

    said: dict[str, Any]
    try:
        with dying_with_parent(clean_up):
            resolve = resolver(Path(asked["job"]), asked["table"]["name"])
            performed = perform(make_request(asked["table"], resolve), places)
        said = {**_said(performed.summary), "libraries": performed.libraries}
    except LimitError as error:
        said = {"error": str(error), **_said(error.summary)}
    except OctoMotionError as error:
        said = {"error": str(error)}
    except Exception as error:  # noqa: BLE001 - a fault of ours is one shot's, and is told
        traceback.print_exc()
        said = {"error": f"{type(error).__name__}: {error}"}
    write_json(answer, said)
    return 1 if "error" in said else 0


def _said(summary: AnySummary) -> dict[str, Any]:
    """What an answer says of a motion."""
    said: dict[str, Any] = {
        "frames": summary.frames,
        "frame_start": summary.frame_start,
        "frame_end": summary.frame_end,
        "warnings": summary.warnings,
    }
    if isinstance(summary, Summary):
        said["quality"] = quality(summary.figures)
        said["keys"], said["dense_keys"] = summary.keys, summary.dense_keys
    return said
