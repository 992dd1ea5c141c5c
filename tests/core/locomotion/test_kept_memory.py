# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory of arrays that are done with is there for those to come."""

import platform
import subprocess
import sys
from pathlib import Path

import pytest

PAGES = """
import resource
import numpy as np
from octo_motion.core.locomotion.motion.pipeline import keep_memory

def touched():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def arrays():
    before = touched()
    for _ in range(20):
        arrays = [np.ones(600_000 + 1000 * each) for each in range(3)]
    return touched() - before

def keys():
    before = touched()
    kept = [bytearray(88_000) for _ in range(400)]
    return touched() - before

if {kept}:
    keep_memory()
print({work}())
"""
"""Three arrays of some megabytes, twenty times; and as much as the keys of some hundred curves."""

LARGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage/enabled")

pytestmark = pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc", reason="other C libraries have their ways"
)


def pages(work: str, *, kept: bool) -> int:
    shown = subprocess.run(
        [sys.executable, "-c", PAGES.format(kept=kept, work=work)],
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    return int(shown.stdout.split()[-1])


def test_memory_of_large_arrays_is_asked_for_once() -> None:
    assert pages("arrays", kept=True) < 0.5 * pages("arrays", kept=False)


def test_what_is_allocated_next_has_large_pages() -> None:
    asked = LARGE_PAGES.read_text(encoding="utf-8") if LARGE_PAGES.exists() else ""
    if "[madvise]" not in asked:
        pytest.skip("the system gives large pages always or never")
    assert pages("keys", kept=True) < 0.2 * pages("keys", kept=False)
