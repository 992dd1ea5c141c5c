# SPDX-License-Identifier: GPL-3.0-or-later
"""One thread for numpy's linear algebra while small systems are solved a thousand times a second.

OpenBLAS, which comes with numpy's wheels, shares even a product of 100 × 100 numbers among threads
that wait for each other busily. Where other programs want the processor too, a step of the
simulation takes several times as long. OpenBLAS can be told so while it runs; where numpy has
another library, or none, there is nothing to do.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

_NAMES: Final = tuple(
    f"{prefix}openblas_{{}}_num_threads{suffix}"
    for prefix in ("", "scipy_")
    for suffix in ("", "64_", "_64")
)
"""As the builds call their functions, {} for get or set."""


class OneThread:
    """From its making until ``end``, numpy's linear algebra runs on one thread."""

    def __init__(self) -> None:
        self._before = [
            (library, name, _call(library, name.format("get"))) for library, name in _libraries()
        ]
        for library, name, _ in self._before:
            _call(library, name.format("set"), 1)

    def end(self) -> None:
        """As it was before; safe to call twice."""
        before, self._before = self._before, []
        for library, name, count in before:
            _call(library, name.format("set"), count)


def _call(library: ctypes.CDLL, name: str, *arguments: int) -> int:
    return int(getattr(library, name)(*arguments) or 0)


@cache
def _libraries() -> tuple[tuple[ctypes.CDLL, str], ...]:
    """The libraries that numpy brings along, and what their functions are called."""
    found: list[tuple[ctypes.CDLL, str]] = []
    package = Path(np.__file__).parent
    folders = (package.parent / "numpy.libs", package / ".libs", package / ".dylibs")
    for folder in folders:
        for path in sorted(folder.glob("*openblas*")) if folder.is_dir() else ():
            try:
                # It is loaded already; this finds it again.
                library = ctypes.CDLL(str(path))
            except OSError:
                continue
            for name in _NAMES:
                if hasattr(library, name.format("set")) and hasattr(library, name.format("get")):
                    found.append((library, name))
                    break
    return tuple(found)
