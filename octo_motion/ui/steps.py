# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps that are taken one after the other, and taken back in reverse."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

_logger: Final = logging.getLogger(__name__)


@dataclass(frozen=True)
class Step:
    """Something that is done when the add-on is switched on, and undone when it is switched off."""

    do: Callable[[], object]
    undo: Callable[[], object]


def do_all(steps: Sequence[Step]) -> None:
    """Take all steps; if one fails, take back those before it, and let the error surface."""
    for number, step in enumerate(steps):
        try:
            step.do()
        except BaseException:
            undo_all(steps[:number])
            raise


def undo_all(steps: Sequence[Step]) -> None:
    """Take all steps back, the last first; what fails is logged, and the rest goes on."""
    for step in reversed(steps):
        try:
            step.undo()
        except Exception:
            _logger.exception("Octo Motion could not go on with %s.", step.undo)


def nothing() -> None:
    """What is done where there is only something to undo."""
