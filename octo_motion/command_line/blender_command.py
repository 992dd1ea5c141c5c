# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --command octo_motion``, known to Blender while the add-on is enabled."""

from __future__ import annotations

from typing import Any

import bpy

from .command_line import COMMAND

_handles: list[Any] = []


def register() -> None:
    """Make the command known to Blender."""
    _handles.append(bpy.utils.register_cli_command(COMMAND, _execute))


def unregister() -> None:
    """Take the command away."""
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())


def _execute(arguments: list[str]) -> int:
    # Only now: artists who never use it should not wait for it when Blender starts.
    from . import commands  # noqa: PLC0415

    program = f"blender --background [FILE] --command {COMMAND}"
    return commands.main(arguments, program, has_open_file=True)
