# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in steps, between which others may go on."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeVar

_Outcome = TypeVar("_Outcome")
_Share = TypeVar("_Share")


def evenly(
    steps: Generator[Any, None, _Outcome], share: _Share
) -> Generator[_Share, None, _Outcome]:
    """The same steps, each of which yields one share that is done."""
    while True:
        try:
            next(steps)
        except StopIteration as last:
            return last.value
        yield share


def finished(steps: Generator[Any, None, _Outcome]) -> _Outcome:
    """What comes of steps that are all taken at once."""
    while True:
        try:
            next(steps)
        except StopIteration as last:
            return last.value
