# SPDX-License-Identifier: GPL-3.0-or-later
"""Work by several threads: in order, all of it, and with the first failure told."""

from __future__ import annotations

import hashlib
import sys
import threading
import time
from collections.abc import Generator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octo_motion.core import threads
from octo_motion.core.content_cache import ContentCache
from octo_motion.core.steps import finished
from octo_motion.core.threads import abreast, each_of, pieces, shares, thread_count


@pytest.fixture(params=[1, 2, 3])
def several(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """As many threads, however many processors there are."""
    monkeypatch.setattr(threads, "thread_count", lambda: request.param)
    return request.param


@pytest.mark.parametrize(
    ("own", "others", "expected"),
    [(1, 0, 1), (2, 0, 2), (2, 1, 1), (2, 9, 1), (64, 0, 4), (4, 2, 2)],
)
def test_only_processors_with_nothing_to_do_are_taken(
    own: int, others: int, expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda _: set(range(own)), raising=False)
    monkeypatch.setattr(threads._Others, "count", lambda _: others)
    assert thread_count() == expected


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing says so")
def test_what_else_runs_is_seen() -> None:
    stop = threading.Event()

    def hash_on() -> None:
        # Without the interpreter's lock, which this thread has.
        while not stop.is_set():
            hashlib.pbkdf2_hmac("sha256", b"", b"", 200_000)

    others = [threading.Thread(target=hash_on) for _ in range(3)]
    for other in others:
        other.start()
    try:
        until = time.perf_counter() + 20.0
        while threads._Others().count() < 2:
            assert time.perf_counter() < until
            time.sleep(0.01)
    finally:
        stop.set()
        for other in others:
            other.join()


def test_each_item_is_worked_on_once_and_results_are_in_order(several: int) -> None:
    seen: list[int] = []
    met = threading.Barrier(several)

    def work(number: int) -> int:
        if number < several:
            # All threads are there: else this waits in vain.
            met.wait(timeout=10.0)
        seen.append(number)
        return number * number

    assert each_of(work, range(20)) == [number * number for number in range(20)]
    assert sorted(seen) == list(range(20))
    assert each_of(work, []) == []


def test_what_fails_first_is_told_and_no_thread_is_left(several: int) -> None:
    before = threading.active_count()

    def work(number: int) -> int:
        if number in (several - 1, 19):
            raise KeyError(number)
        return number

    with pytest.raises(KeyError, match=str(several - 1)):
        each_of(work, range(20))
    assert threading.active_count() == before


def counted(number: int, steps: int) -> Generator[float, None, int]:
    for step in range(steps):
        yield (step + 1) / steps
    return number


def test_works_in_steps_go_on_abreast(several: int) -> None:
    works = [counted(number, steps) for number, steps in enumerate((5, 0, 3, 8))]
    before, said = threading.active_count(), list[list[float]]()

    def all_of_them() -> Generator[None, None, list[int]]:
        steps = abreast(works)
        while True:
            try:
                said.append([share or 0.0 for share in next(steps)])
            except StopIteration as last:
                return last.value
            # Nobody works while somebody else goes on.
            assert threading.active_count() == before
            yield

    assert finished(all_of_them()) == [0, 1, 2, 3]
    assert np.all(np.diff(said, axis=0) >= 0.0)
    assert said[-1] == [1.0, 0.0, 1.0, 1.0]
    assert several


def test_a_work_that_fails_abreast_tells(several: int) -> None:
    def failing() -> Generator[float, None, int]:
        yield 0.5
        raise ValueError(several)

    with pytest.raises(ValueError, match=str(several)):
        list(abreast([counted(0, 2), failing(), counted(2, 2)]))


@given(st.integers(0, 500), st.integers(1, 70))
def test_pieces_are_all_there_is_and_alike(length: int, most: int) -> None:
    for found in (pieces(length, most), shares(length, most)):
        assert [place for each in found for place in range(length)[each]] == list(range(length))
        sizes = [each.stop - each.start for each in found]
        assert max(sizes, default=0) <= most
        assert max(sizes, default=0) - min(sizes, default=0) <= 1


def test_kept_results_may_be_asked_for_by_several_threads(several: int) -> None:
    kept: ContentCache[np.ndarray] = ContentCache(2)

    def ask(number: int) -> float:
        key = number % 5
        return float(kept.get(bytes([key]), lambda: np.full(3, float(key)))[0])

    assert each_of(ask, range(3000)) == [float(number % 5) for number in range(3000)]
    assert len(kept) <= 2
    assert several
