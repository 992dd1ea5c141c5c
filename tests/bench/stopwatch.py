# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time of a run is spent, each second counted once."""

from __future__ import annotations

import functools
import inspect
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Any

Place = tuple[Any, str]
"""A module or class, and the name of a function in it."""


class Stopwatch:
    """Seconds by label; what runs inside another labelled function counts for itself alone."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._inner: list[float] = [0.0]

    @contextmanager
    def measure(self, label: str) -> Iterator[None]:
        """Count the block's time, without that of measured blocks within it."""
        self._inner.append(0.0)
        start = time.perf_counter()
        try:
            yield
        finally:
            whole = time.perf_counter() - start
            self.seconds[label] += whole - self._inner.pop()
            self._inner[-1] += whole

    @contextmanager
    def watching(self, places: dict[str, list[Place]]) -> Iterator[None]:
        """Measure functions, by label, as long as the block runs."""
        originals = [
            (owner, name, getattr(owner, name)) for each in places.values() for owner, name in each
        ]
        for label, each in places.items():
            for owner, name in each:
                setattr(owner, name, self._watched(label, getattr(owner, name)))
        try:
            yield
        finally:
            for owner, name, original in originals:
                setattr(owner, name, original)

    def _watched(self, label: str, function: Callable[..., Any]) -> Callable[..., Any]:
        if inspect.isgeneratorfunction(function):
            return self._watched_steps(label, function)

        @functools.wraps(function)
        def run(*arguments: Any, **named: Any) -> Any:
            with self.measure(label):
                return function(*arguments, **named)

        return run

    def _watched_steps(self, label: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def run(*arguments: Any, **named: Any) -> Generator[Any, None, Any]:
            steps = function(*arguments, **named)
            while True:
                with self.measure(label):
                    try:
                        step = next(steps)
                    except StopIteration as finished:
                        return finished.value
                yield step

        return run
