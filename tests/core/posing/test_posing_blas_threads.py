# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear algebra on one thread while a puppet is posed, and as before afterwards."""

import numpy as np
import pytest

from octo_motion.core.posing.solver.blas_threads import OneThread, _call, _libraries


def thread_counts() -> list[int]:
    """How many threads each OpenBLAS that is found may use."""
    return [_call(library, name.format("get")) for library, name in _libraries()]


def test_threads_are_one_for_a_while_and_then_as_before() -> None:
    before = thread_counts()
    if not before:
        pytest.skip("this numpy has no OpenBLAS of its own")
    one = OneThread()
    assert set(thread_counts()) == {1}
    one.end()
    one.end()
    assert thread_counts() == before


def test_where_numpy_brings_openblas_it_is_found() -> None:
    config = np.show_config(mode="dicts")
    name = str(config["Build Dependencies"]["blas"]["name"])
    if "openblas" not in name:
        pytest.skip(f"this numpy has {name}")
    assert len(thread_counts()) == 1
