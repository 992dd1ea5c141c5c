# SPDX-License-Identifier: GPL-3.0-or-later
"""Several pieces of work at once, by as many threads as there are processors to spare.

What takes long is numpy on large arrays, and numpy lets other threads go on meanwhile. Each piece
is worked out by one thread, none reads what another writes, and no number hangs on where a piece
begins: so results are the same to the last bit, however many threads there are. No thread outlives
the call that has begun it, so Blender never goes on while Python works elsewhere.

Only processors with nothing to do are taken: beside other programs threads would wait for each
other's turn, and on farms that run a process for each processor there is none to spare.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Generator, Sequence
from contextvars import copy_context
from itertools import count, pairwise
from pathlib import Path
from threading import Thread
from typing import Any, Final, TypeVar

_Outcome = TypeVar("_Outcome")
_Item = TypeVar("_Item")

_MOST: Final = 4
"""Threads at once: beyond, they mostly wait for the interpreter and for memory."""
_GLANCE: Final = 0.05
"""Seconds between two looks at what else is running."""
_TURN: Final = 0.004
"""Seconds after which a thread that works in steps takes no further one before all have met."""


class _Others:
    """What else wants the processors, looked at now and then."""

    def __init__(self) -> None:
        self._until, self._found = -1.0, 0

    def count(self) -> int:
        """Threads of this machine that run or could, without the one that asks."""
        now = time.perf_counter()
        if now > self._until:
            self._until, self._found = now + _GLANCE, self._running()
        return self._found

    @staticmethod
    def _running() -> int:
        try:
            # Averages, runnable/all … [proc(5)]. Windows and macOS do not say so for nothing.
            runnable = Path("/proc/loadavg").read_text(encoding="ascii").split()[3]
            return max(int(runnable.split("/")[0]) - 1, 0)
        except (OSError, ValueError, IndexError):
            return 0


_others: Final = _Others()


def thread_count() -> int:
    """How many threads work at once: one, and one for each processor with nothing to do that this
    process may use.
    """
    affinity = getattr(os, "sched_getaffinity", None)
    own = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    return max(min(own - _others.count(), _MOST), 1) if own > 1 else 1


def each_of(work: Callable[[_Item], _Outcome], items: Sequence[_Item]) -> list[_Outcome]:
    """What work makes of each item, in their order.

    Raises:
        Exception: what the work of the first item that fails has raised.
    """
    threads = min(thread_count(), len(items))
    if threads < 2:
        return [work(item) for item in items]
    found: dict[int, _Outcome] = {}
    failed: dict[int, BaseException] = {}
    numbers = count()

    def run() -> None:
        while not failed and (number := next(numbers)) < len(items):
            try:
                found[number] = work(items[number])
            except BaseException as error:  # noqa: BLE001 - raised again by whoever has asked
                failed[number] = error

    others = [Thread(target=copy_context().run, args=(run,)) for _ in range(threads - 1)]
    for other in others:
        other.start()
    run()
    for other in others:
        other.join()
    if failed:
        raise failed[min(failed)]
    return [found[number] for number in range(len(items))]


def abreast(
    works: Sequence[Generator[Any, None, _Outcome]],
) -> Generator[list[Any], None, list[_Outcome]]:
    """What comes of works in steps, in their order; each time that all threads have met, what each
    work has yielded last, none if it has not begun.

    Raises:
        Exception: what the first work that fails has raised.
    """
    found: dict[int, _Outcome] = {}
    said: list[Any] = [None] * len(works)
    threads = thread_count()

    def turn(number: int) -> None:
        until = time.perf_counter() + (_TURN if threads > 1 else 0.0)
        try:
            said[number] = next(works[number])
            while time.perf_counter() < until:
                said[number] = next(works[number])
        except StopIteration as last:
            found[number] = last.value

    while True:
        open_ones = [number for number in range(len(works)) if number not in found]
        if not open_ones:
            return [found[number] for number in range(len(works))]
        each_of(turn, open_ones[:threads])
        yield list(said)


def pieces(length: int, most: int) -> list[slice]:
    """Slices of a row of that length that follow one another, of so many items at most each, and of
    as many items each as the others.
    """
    count = -(-length // most)
    ends = [length * number // count for number in range(count + 1)] if count else []
    return [slice(start, end) for start, end in pairwise(ends)]


def shares(length: int, most: int) -> list[slice]:
    """The same, of which each thread gets as many as the others; all in one if it is that short."""
    rounds = -(-length // (most * thread_count()))
    return pieces(length, most if length <= most else -(-length // (rounds * thread_count())))
