# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on long rows, a portion at a time that stays in the processor's cache."""

from __future__ import annotations

from itertools import pairwise


def portions(length: int, most: int) -> list[slice]:
    """Slices of a row of that length that follow one another, of so many items at most each, and of
    as many items each as the others.
    """
    count = -(-length // most)
    ends = [length * number // count for number in range(count + 1)] if count else []
    return [slice(start, end) for start, end in pairwise(ends)]
