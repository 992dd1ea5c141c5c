# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory of arrays that are done with is there for those to come."""

import platform
import subprocess
import sys

import pytest

PAGES = """
import resource
import numpy as np
from octo_motion.core.memory import keep_memory

def touched():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def work():
    before = touched()
    for _ in range(20):
        arrays = [np.ones(600_000 + 1000 * each) for each in range(3)]
    return touched() - before

if {kept}:
    keep_memory()
print(work())
"""
"""Three arrays of some megabytes, twenty times."""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have their ways")
def test_memory_of_large_arrays_is_asked_for_once() -> None:
    def pages(*, kept: bool) -> int:
        shown = subprocess.run(
            [sys.executable, "-c", PAGES.format(kept=kept)],
            capture_output=True,
            encoding="utf-8",
            check=True,
        )
        return int(shown.stdout.split()[-1])

    assert pages(kept=True) < 0.5 * pages(kept=False)
