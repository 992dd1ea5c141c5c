# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in short turns, so that Blender's window stays alive."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator


class Job:
    """Work that yields the share of it that is done, 0…1.

    Args:
        steps: the work.
        clock: seconds.
    """

    def __init__(self, steps: Iterator[float], clock: Callable[[], float] = time.monotonic) -> None:
        self.progress = 0.0
        self.finished = False
        self._steps = steps
        self._clock = clock

    def work(self, seconds: float) -> bool:
        """Go on for about so long, at least one step; whether all is done."""
        until = self._clock() + seconds
        while not self.finished:
            done = next(self._steps, None)
            if done is None:
                self.finished = True
                self.progress = 1.0
                break
            self.progress = done
            if self._clock() >= until:
                break
        return self.finished
