# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that computes what it is given, one task after the other, until nobody gives any."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from .wire import receive, send


def main(arguments: Sequence[str]) -> int:
    """Answer each (function, argument) from standard input with (True, result).

    A task that fails is answered with (False, None): whoever gave it does it then, and sees why.
    ``arguments`` is what that one calls the package.
    """
    (theirs,) = arguments
    # What anything prints must not come between answers.
    with os.fdopen(os.dup(1), "wb") as answers, os.fdopen(os.dup(0), "rb") as tasks:
        os.dup2(2, 1)
        sys.stdout = sys.stderr
        while True:
            try:
                function, argument = receive(tasks, theirs)
            except EOFError:
                return 0
            try:
                answer = (True, function(argument))
            except Exception:  # noqa: BLE001 - it is raised where the task is done again
                answer = (False, None)
            try:
                send(answers, answer)
            except OSError:
                return 0
