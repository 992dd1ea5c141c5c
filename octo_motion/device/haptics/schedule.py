# SPDX-License-Identifier: GPL-3.0-or-later
"""Ticks at absolute deadlines, where a late one does not move those after it; how well they keep.

What Python adds to a loop, and what is done about it:

- *Garbage collection* stops everything for milliseconds when it looks through all objects. What is
  there at the start is frozen (it is never looked through again) and the collector is switched
  off; a tick makes no cycles, so counting references frees all that it makes.
- *The GIL* makes threads wait for each other, up to 5 ms each time. The simulation has another
  process. Beside the loop there is one thread that looks for devices: it mostly waits for the
  system, has to hand over ten times sooner, and rests while a hand holds something.
- *Sleep* wakes late: by about 0.1 ms on an idle Linux, by half a millisecond on Windows, whose
  timers of high resolution Python uses from 3.11 on. So the last stretch is waited for awake. While
  nothing is held there are fewer ticks: a loop that waits for a hand should not wear out a battery.
- *Priority* is raised where the system allows; Windows also saves power with what has no window,
  and a Mac puts it on slow processors, unless it is told that somebody waits for it.

What remains is the system's own: when it gives the processor to another for long, ticks are left
out, and counted.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import sys
import time
from bisect import bisect, bisect_left
from collections.abc import Callable
from itertools import accumulate
from typing import Any, Final

from ..messages import LoopTimesMessage

_EDGES: Final = (
    *(1e-6 * each for each in range(1, 1001)),
    *(1e-5 * each for each in range(101, 1001)),
    *(1e-4 * each for each in range(101, 501)),
)
"""Upper edges of bins, in s: a hundredth of what they count, or finer. Few enough of them that
looking through all takes no tick's time."""
_AWAKE: Final = 0.0006 if sys.platform == "win32" else 0.00015


class Histogram:
    """Counts of durations by size, up to 50 ms; adding one allocates nothing."""

    def __init__(self) -> None:
        self._counts = [0] * (len(_EDGES) + 1)
        self.count = 0
        self.longest = 0.0

    def add(self, seconds: float) -> None:
        self._counts[bisect(_EDGES, seconds)] += 1
        self.count += 1
        self.longest = max(self.longest, seconds)

    def percentiles(self) -> tuple[float, float, float, float]:
        """Seconds that 50, 99 and 99.9 % stay below, and the longest of all; zeros without any.

        The former are upper edges of bins.
        """
        totals = list(accumulate(self._counts))
        bins = (bisect_left(totals, share * self.count) for share in (0.5, 0.99, 0.999))
        half, most, nearly_all = (
            min(self.longest, _EDGES[min(each, len(_EDGES) - 1)]) for each in bins
        )
        return half, most, nearly_all, self.longest


class Schedule:
    """A loop of fixed period (s), which does not sleep for the last ``awake`` s before a deadline.

    ``sleep`` waits for so many seconds, or somewhat longer.
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
        self.forget()
        self._begun = self._deadline = self._started

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
        if sys.platform == "win32":
            return "raised" if _raised_on_windows() else "normal"
        if sys.platform == "darwin":
            return "raised" if _raised_on_a_mac() else "normal"
        os.setpriority(os.PRIO_PROCESS, 0, -10)
        return "raised"
    return "normal"


_HIGH_PRIORITY_CLASS: Final = 0x80
_TIME_CRITICAL: Final = 15
_POWER_THROTTLING: Final = 4
"""What SetProcessInformation is told about: three numbers, of which the first is a version, the
second says what is meant (speed, and coarse timers) and the third that both are off."""
_USER_INTERACTIVE: Final = 0x21
"""The highest class of threads on macOS."""


def _raised_on_windows() -> bool:
    """Ask Windows for a high priority and for exact timers; whether it raised the former."""
    # What other systems lack of it.
    windows: Any = ctypes
    kernel = windows.windll.kernel32
    kernel.GetCurrentProcess.restype = kernel.GetCurrentThread.restype = ctypes.c_void_p
    process, thread = (
        ctypes.c_void_p(each) for each in (kernel.GetCurrentProcess(), kernel.GetCurrentThread())
    )
    off = (ctypes.c_uint32 * 3)(1, 0x1 | 0x4, 0)
    with contextlib.suppress(AttributeError):  # from Windows 8 on
        kernel.SetProcessInformation(process, _POWER_THROTTLING, off, ctypes.sizeof(off))
    raised = kernel.SetPriorityClass(process, _HIGH_PRIORITY_CLASS)
    return bool(kernel.SetThreadPriority(thread, _TIME_CRITICAL) and raised)


def _raised_on_a_mac() -> bool:
    """Tell macOS that somebody waits for this thread."""
    return ctypes.CDLL(None).pthread_set_qos_class_self_np(_USER_INTERACTIVE, 0) == 0
