# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory that costs little to get: kept for the next time, and in large pages."""

from __future__ import annotations

from typing import Final

import numpy as np

_KEPT: Final = 2**25 - 2**16
"""Bytes of the largest arrays whose memory is kept: glibc keeps that of none beyond 2**25."""
_LARGE: Final = 31 * 2**20
"""Bytes of two arrays that together are less than what glibc gives back as soon as it is free.
Large pages for more gain nothing: where the system has none at hand, it takes long to find them."""


def keep_memory() -> None:
    """Have the C library keep the memory of arrays that are done with for those to come, and the
    system give what comes next in large pages.

    glibc gives large arrays back to the system, which clears each page anew for the next: half of
    all pages that the first motion of a session touches. It stops that for all that are no larger
    than one that it has given back [mallopt(3), M_MMAP_THRESHOLD]. From then on they stand on its
    heap, as keys do that Blender allocates. For arrays of some megabytes numpy asks the system for
    large pages [madvise(2), MADV_HUGEPAGE], which stays so where they have stood: what comes there
    next, whoever allocates it, has one page where it would have 512.

    Elsewhere this does nothing. The arrays are never touched, and take no memory.
    """
    np.empty(_KEPT, dtype=np.uint8)
    # Both at once: one after the other they would stand in the same place.
    _ = [np.empty(_LARGE, dtype=np.uint8) for _ in range(2)]
