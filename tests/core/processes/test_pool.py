# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks that processes of their own compute: what comes back, and what becomes of their faults."""

from __future__ import annotations

import os
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from octo_motion.core import processes
from octo_motion.core.keyframes import Limb, LimbChain, Track, reduce_keys, reducing, reduction
from octo_motion.core.processes import computed_apart, pool, python, wire
from octo_motion.core.rotations import from_axis_angle
from octo_motion.core.steps import finished
from tests.processes import children_of, end


def waving(frames: int, bones: int = 4, arms: int = 3) -> list[Limb]:
    """Arms whose bones swing, each a little later than the one before."""
    time_ = np.arange(frames) / 7.0
    result = []
    for arm in range(arms):
        tracks = []
        for bone in range(bones):
            angle = 0.5 * np.sin(time_ - 0.6 * bone + arm) * np.sin(0.13 * time_)
            axis = np.broadcast_to((1.0, 0.3 * arm, 0.1 * bone), (frames, 3))
            axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
            tracks.append(Track(from_axis_angle(axis, angle), "QUATERNION"))
        chain = LimbChain(
            turned=tuple(range(bones)),
            follows=(True,) * bones,
            rest_rotations=np.tile((1.0, 0.0, 0.0, 0.0), (bones, 1)),
            steps=np.tile((0.0, 0.25, 0.0), (bones, 1)),
        )
        result.append(Limb(tracks, 0.01, 0.01, chain=chain))
    return result


def as_arrays(found: Sequence[Sequence[Any]]) -> list[Any]:
    return [
        getattr(keys, name)
        for limb in found
        for keys in limb
        for name in ("frames", "values", "left", "right", "smooth")
    ]


@pytest.fixture
def apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """However short a motion is, and however few processors there are."""
    monkeypatch.setattr(reduction, "_LONG", 0)
    monkeypatch.setattr(reduction, "helpers", lambda: 2)


@pytest.mark.usefixtures("apart")
def test_keys_are_the_same_to_the_last_bit_however_many_processes_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    frames, limbs = np.arange(1300.0), waving(1300)
    shared = as_arrays(reduce_keys(frames, limbs, loops=False))
    monkeypatch.setattr(reduction, "helpers", lambda: 0)
    alone = as_arrays(reduce_keys(frames, limbs, loops=False))
    assert len(shared) == len(alone) > 0
    for ours, theirs in zip(shared, alone, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.usefixtures("apart")
def test_work_that_is_given_up_leaves_no_process_behind() -> None:
    steps = reducing(np.arange(1300.0), waving(1300))
    while not (started := children_of(os.getpid())):
        assert next(steps) < 0.9
    steps.close()
    assert not set(started) & set(children_of(os.getpid()))


@pytest.mark.usefixtures("apart")
def test_progress_only_grows_and_ends_near_one() -> None:
    shares = list(reducing(np.arange(1300.0), waving(1300)))
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] < 0.3
    assert 0.6 < shares[-1] <= 1.0


@pytest.mark.usefixtures("apart")
def test_keys_come_whole_when_processes_are_killed() -> None:
    frames, limbs = np.arange(1300.0), waving(1300)
    steps, killed = reducing(frames, limbs), 0
    while True:
        try:
            next(steps)
        except StopIteration as last:
            found = last.value
            break
        for child in children_of(os.getpid()) if killed < 2 else ():
            end(child)
            killed += 1
    assert killed
    assert len(found) == len(limbs)
    assert all(len(keys) > 1 for limb in found for keys in limb)


def test_without_a_python_to_start_the_work_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "python_path", lambda: None)
    assert finished(computed_apart(np.sqrt, [4.0, 9.0], 2)) == [2.0, 3.0]
    monkeypatch.setattr(pool, "python_path", lambda: Path("no-such-python"))
    assert finished(computed_apart(np.sqrt, [4.0, 9.0], 2)) == [2.0, 3.0]


def test_results_are_in_the_order_of_their_tasks() -> None:
    tasks = [np.full(1000 * (1 + (7 * n) % 5), float(n)) for n in range(12)]
    found = finished(computed_apart(np.mean, tasks, 3))
    np.testing.assert_array_equal(found, range(12))


def test_task_that_fails_says_here_why() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        finished(computed_apart(np.linalg.inv, [np.zeros((2, 2))], 1))


def test_package_is_known_by_another_name_within_blender() -> None:
    """Below bl_ext: what is sent names modules that the other process does not have."""
    sent = pickle.dumps(Limb([], 1.0, 1.0)).replace(b"octo_motion", b"bl_ext_x_om")
    read = wire._Reader(sent, "bl_ext_x_om").load()
    assert isinstance(read, Limb)
    with pytest.raises(pickle.UnpicklingError, match="does not belong"):
        wire._Reader(pickle.dumps(os.system), "octo_motion").load()


def test_process_ends_with_whoever_started_it() -> None:
    executable = processes.python_path()
    assert executable is not None
    process = python.start_program(executable, pool._PROGRAM, ["octo_motion"])
    assert process.stdin
    process.stdin.close()
    assert process.wait(20.0) == 0
    assert process.stdout
    assert process.stdout.read() == b""
    process.stdout.close()


def test_environment_says_how_many_processes_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "processors", lambda: 6)
    for said, count in (("", 6), ("4", 4), ("1", 0), ("0", 0), ("many", 6), ("99", 6)):
        monkeypatch.setenv(processes.PROCESSES, said)
        assert processes.helpers() == count
    monkeypatch.delenv(processes.PROCESSES)
    monkeypatch.setattr(pool, "processors", lambda: 64)
    assert processes.helpers() == 8
