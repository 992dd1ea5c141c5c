# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: many shots from one job file, with Blender's window or without Blender's help.

An application on top of the add-on. What needs Blender is imported when it is asked for: help is
shown without, and artists who never use a command line do not wait for it when Blender starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .command_line import COMMAND, STOPPED, parse
from .stopping import stoppable

if TYPE_CHECKING:
    from ..ui.steps import Step

__all__ = [
    "COMMAND",
    "STOPPED",
    "main",
    "parse",
    "register",
    "steps",
    "stoppable",
    "unregister",
]

_handles: list[Any] = []


def main(arguments: Sequence[str], program: str, *, has_open_file: bool) -> int:
    """Run a command in Blender; the exit status."""
    from . import commands  # noqa: PLC0415

    return commands.main(arguments, program, has_open_file=has_open_file)


def steps() -> list[Step]:
    """What the add-on does to have its operators for jobs, and its command line."""
    from ..ui.steps import Step  # noqa: PLC0415
    from . import operators  # noqa: PLC0415

    return [*operators.steps(), Step(register, unregister)]


def register() -> None:
    """Make ``blender --command octo_motion`` known to Blender while the add-on is enabled."""
    import bpy  # noqa: PLC0415

    _handles.append(bpy.utils.register_cli_command(COMMAND, _execute))


def unregister() -> None:
    """Take the command away."""
    import bpy  # noqa: PLC0415

    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())


def _execute(arguments: list[str]) -> int:
    return main(arguments, f"blender --background [FILE] --command {COMMAND}", has_open_file=True)
