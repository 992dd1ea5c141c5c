# SPDX-License-Identifier: GPL-3.0-or-later
"""What asks this process to stop, from its first moments on: no Blender is needed."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Let Ctrl-C and a request to terminate raise KeyboardInterrupt, also within Blender.

    Blender in the background takes Ctrl-C for itself.
    """

    def stop(_signal: int, _frame: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.signal(each, stop) for each in _stop_signals()}
    try:
        yield
    finally:
        for each, handler in before.items():
            # None stands for a handler that is not Python's own, and cannot be put back.
            signal.signal(each, signal.SIG_DFL if handler is None else handler)


def _stop_signals() -> list[signal.Signals]:
    """What asks a process to stop: on Windows Ctrl-Break too, which consoles and farms send."""
    if sys.platform == "win32":
        return [signal.SIGINT, signal.SIGTERM, signal.SIGBREAK]
    return [signal.SIGINT, signal.SIGTERM]
