# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of core stand on."""

from collections.abc import Iterator

import pytest

from octo_motion.core.posing.solver.blas_threads import OneThread


@pytest.fixture(autouse=True, scope="module")
def puppets_on_one_thread(request: pytest.FixtureRequest) -> Iterator[None]:
    """Linear algebra on one thread while puppets are simulated, as in a session.

    Threads that wait for each other busily would make these tests ten times as long where the
    machine has other things to do as well.
    """
    name = request.module.__name__.rpartition(".")[2]
    if not name.startswith("test_posing") or name == "test_posing_blas_threads":
        yield
        return
    one = OneThread()
    yield
    one.end()
