# SPDX-License-Identifier: GPL-3.0-or-later
"""Modal operators that are at work, to be ended when the add-on is switched off.

Blender then forgets them without a word to them: their timers would go on for ever, and what they
tell in headers and in the status bar would stay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import bpy

_ends: Final[dict[int, Callable[[bpy.types.Context], None]]] = {}


def begun(operator: object, end: Callable[[bpy.types.Context], None]) -> None:
    """Tell that an operator is at work from now on, and how it is ended."""
    _ends[id(operator)] = end


def done(operator: object) -> None:
    """Tell that it is at work no more; safe to call twice."""
    _ends.pop(id(operator), None)


def stop_all() -> None:
    """End all that are at work."""
    if not _ends:
        return
    while _ends:
        _ends.popitem()[1](bpy.context)
    # They know only of the window that the add-on is switched off in.
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        window.workspace.status_text_set(None)
        for area in window.screen.areas:
            area.header_text_set(None)
