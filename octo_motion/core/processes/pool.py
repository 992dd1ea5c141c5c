# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks that know nothing of each other, computed by processes of their own.

Threads do not help where small steps of numpy follow each other: one interpreter takes them one by
one. The tasks of a motion are few and long, and what goes to a process and back is little beside
them. Results are those of this process, to the last bit: the same code on the same machine.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from typing import Any, Final, TypeVar

from .python import PROCESSES, processors, python_path, start_program
from .wire import OURS, receive, send

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

_MOST: Final = 8
"""Processes at a time: each has a Python with numpy, some 50 MB, and more gain little."""
_WAITING: Final = 1
"""Tasks that wait for each process, so that it is never idle and few are in memory."""
_PATIENCE: Final = 0.005
"""s after which whoever waits for a result may do something else."""
_PROGRAM: Final = "octo_motion.core.processes.helper"
_ENVIRONMENT: Final[Mapping[str, str]] = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""There are as many processes as processors already."""


def helpers() -> int:
    """How many processes may compute for this one: as many as processors, or as the environment
    says; 0 where a single one would only do what this process can do itself.
    """
    count = processors()
    with contextlib.suppress(ValueError):
        count = min(count, int(os.environ.get(PROCESSES, count)))
    return min(count, _MOST) if count > 1 else 0


def computed_apart(
    function: Callable[[_Task], _Result], tasks: Iterable[_Task], count: int
) -> Generator[int, None, list[_Result]]:
    """What a function of a module of core makes of each task, in their order.

    Yields often, each time how many are done; dropped in between, the processes end. Tasks are
    taken one by one as they are needed. What a process fails at, or was not started for, is done
    by this one.
    """
    pool = _Pool(count)
    results: dict[int, _Result] = {}
    try:
        for number, task in enumerate(tasks):
            pool.give(number, function, task)
            while pool.full:
                yield len(results)
                _take(pool, results)
        while pool.busy:
            yield len(results)
            _take(pool, results)
        return [results[number] for number in range(len(results))]
    finally:
        pool.close()


def _take(pool: _Pool, results: dict[int, Any]) -> None:
    """The next answer, if one comes in time."""
    answer = pool.answer()
    if answer is not None:
        number, result = answer
        results[number] = result


class _Failed:
    """In place of a result: there is none."""


class _Pool:
    """Processes, each with a thread that hands it tasks and takes its answers."""

    def __init__(self, count: int) -> None:
        self._tasks: queue.SimpleQueue[tuple[int, Callable[[Any], Any], Any] | None] = (
            queue.SimpleQueue()
        )
        self._answers: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
        self._given: dict[int, tuple[Callable[[Any], Any], Any]] = {}
        self._refused: deque[int] = deque()
        self._lock = threading.Lock()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._closed = False
        self._room = count * (1 + _WAITING)
        self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(count)]
        for thread in self._threads:
            thread.start()

    @property
    def full(self) -> bool:
        """Whether as many tasks are with the processes as they take."""
        return len(self._given) >= self._room

    @property
    def busy(self) -> bool:
        """Whether some task has no answer yet."""
        return bool(self._given)

    def give(self, number: int, function: Callable[[Any], Any], task: Any) -> None:
        """Hand out a task."""
        self._given[number] = function, task
        self._tasks.put((number, function, task))

    def answer(self) -> tuple[int, Any] | None:
        """One task's number and result; None if none comes at once."""
        # In this order: whoever has ended has answered before.
        working = any(thread.is_alive() for thread in self._threads)
        try:
            number, result = self._answers.get(timeout=_PATIENCE)
        except queue.Empty:
            if working:
                return None
            number, result = min(self._given), _Failed
        function, task = self._given.pop(number)
        return number, function(task) if result is _Failed else result

    def close(self) -> None:
        """End all processes, whatever they are doing."""
        with self._lock:
            self._closed = True
            running = list(self._processes)
        for process in running:
            process.kill()
        for _ in self._threads:
            self._tasks.put(None)
        for thread in self._threads:
            thread.join()

    def _serve(self) -> None:
        """The life of one process, in a thread of its own."""
        process = self._started()
        if process is None:
            return
        number = None
        try:
            while (given := self._tasks.get()) is not None:
                number, function, task = given
                send(process.stdin, (function, task))  # pyright: ignore[reportArgumentType]
                done, result = receive(process.stdout, "octo_motion")  # pyright: ignore[reportArgumentType]
                self._answers.put((number, result if done else _Failed))
                number = None
        except (OSError, EOFError, pickle.PickleError):
            if number is not None:
                self._answers.put((number, _Failed))
        finally:
            process.kill()
            process.communicate()

    def _started(self) -> subprocess.Popen[bytes] | None:
        python = python_path()
        with self._lock:
            if self._closed or python is None:
                return None
            try:
                process = start_program(
                    python,
                    _PROGRAM,
                    [OURS],
                    messages=subprocess.DEVNULL,
                    environment=_ENVIRONMENT,
                )
            except OSError:
                return None
            self._processes.append(process)
            return process
