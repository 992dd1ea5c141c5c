# SPDX-License-Identifier: GPL-3.0-or-later
"""Ticks at absolute deadlines, where a late one does not move those after it; how well they keep.

What Python adds to a loop, and what is done about it:

- *Garbage collection* stops everything for milliseconds when it looks through all objects. What is
  there at the start is frozen (it is never looked through again) and the collector is switched
  off; a tick makes no cycles, so counting references frees all that it makes.
- *The GIL* makes threads wait for each other, up to 5 ms each time. The simulation has another
  process. Beside the loop there is one thread that looks for devices: it mostly waits for the
  system, has to hand over ten times sooner, and rests while a hand holds something.
- *Sleep* wakes late: by about 0.1 ms on an idle Linux, up to 1 ms on Windows. So the last stretch
  is waited for awake. Where the system allows, the process gets real-time priority.

What remains is the system's own: when it gives the processor to another for long, ticks are left
out, and counted.
"""

from __future__ import annotations

import contextlib
import gc
import os
import sys
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from ..messages import LoopTimesMessage

_RANGES: Final = ((0.0, 1e-3, 1e-6), (1e-3, 1e-2, 1e-5), (1e-2, 5e-2, 1e-4))
"""From, to and width of bins, in s: a hundredth of what they count, or finer. Few enough of them
that looking through all takes no tick's time."""
_FIRSTS: Final = (0, 1000, 1900)
_LAST: Final = 2300


class Percentiles(NamedTuple):
    """Seconds that 50, 99 and 99.9 % stay below, and the longest of all."""

    half: float
    most: float
    nearly_all: float
    longest: float


class Histogram:
    """Counts of durations by size, up to 50 ms; adding one allocates nothing."""

    def __init__(self) -> None:
        self._counts = [0] * (_LAST + 1)
        self.count = 0
        self.longest = 0.0

    def add(self, seconds: float) -> None:
        """Count one."""
        self._counts[_bin(seconds)] += 1
        self.count += 1
        self.longest = max(self.longest, seconds)

    def percentiles(self) -> Percentiles:
        """The upper edge of the bin within which each share of all lies; zeros where none came."""
        wanted = [share * self.count for share in (0.5, 0.99, 0.999)]
        found: list[float] = []
        total = 0
        for index, count in enumerate(self._counts):
            total += count
            while len(found) < 3 and count and total >= wanted[len(found)]:
                found.append(min(self.longest, _upper_edge(index)))
            if len(found) == 3:
                break
        half, most, nearly_all = (*found, 0.0, 0.0, 0.0)[:3]
        return Percentiles(half, most, nearly_all, self.longest)


def _bin(seconds: float) -> int:
    for first, (start, end, width) in zip(_FIRSTS, _RANGES, strict=True):
        if seconds < end:
            return first + max(0, int((seconds - start) / width))
    return _LAST


def _upper_edge(index: int) -> float:
    place = 2 if index >= _FIRSTS[2] else 1 if index >= _FIRSTS[1] else 0
    start, _, width = _RANGES[place]
    return start + (index - _FIRSTS[place] + 1) * width


_AWAKE: Final = 0.002 if sys.platform == "win32" else 0.00015
"""s before a deadline from which on the loop does not sleep."""


class Schedule:
    """A loop of fixed period.

    Args:
        period: s
        clock: Seconds.
        sleep: Waits for so many seconds, or somewhat longer.
        awake: s before a deadline from which on the loop does not sleep.
    """

    def __init__(
        self,
        period: float,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
        awake: float = _AWAKE,
    ) -> None:
        self.period = period
        self._awake = awake
        self._clock = clock
        self._sleep = sleep
        self.late = Histogram()
        self.computing = Histogram()
        self.missed = 0
        self._begun = self._started = clock()
        self._deadline = self._begun

    def forget(self) -> None:
        """Start counting anew."""
        self.late, self.computing, self.missed = Histogram(), Histogram(), 0
        self._started = self._clock()

    def begin(self) -> float:
        """Wait for the next deadline; the time at which the tick begins."""
        self._deadline += self.period
        now = self._clock()
        late = now - self._deadline
        if late > 0.5 * self.period:
            # Not at once: where ticks take too long, others would never get the processor.
            left_out = int(late / self.period) + 1
            self.missed += left_out
            self._deadline += left_out * self.period
        if self._deadline - now > self._awake:
            self._sleep(self._deadline - now - self._awake)
            now = self._clock()
        while now < self._deadline:
            now = self._clock()
        self.late.add(abs(now - self._begun - self.period))
        self._begun = now
        return now

    def end(self) -> None:
        """Say that the tick's work is done."""
        self.computing.add(self._clock() - self._begun)

    def times(self) -> LoopTimesMessage:
        """How well the loop has kept time since the start, or since ``forget``."""
        spent = self._clock() - self._started
        return LoopTimesMessage(
            rate=self.late.count / spent if spent > 0.0 else 0.0,
            late=self.late.percentiles(),
            computing=self.computing.percentiles(),
            missed=self.missed,
        )


def make_real_time() -> str:
    """Make this process keep time as well as it may; which priority it got, for the log."""
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(5e-4)
    if (os.cpu_count() or 1) < 2:
        return "normal"  # the simulation needs the only processor as well
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
            return "real-time"
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)
        return "raised"
    return "normal"
