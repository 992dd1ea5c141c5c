# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: many shots from one job file, with Blender's window or without Blender's help.

An application on top of the add-on. What needs Blender is imported when it is asked for: help is
shown without, and artists who never use a command line do not wait for it when Blender starts.
"""

from __future__ import annotations

from collections.abc import Sequence

from .command_line import COMMAND, parse

__all__ = ["COMMAND", "main", "parse", "register", "unregister"]


def main(arguments: Sequence[str], program: str, *, has_open_file: bool) -> int:
    """Run a command in Blender; the exit status."""
    from . import commands  # noqa: PLC0415

    return commands.main(arguments, program, has_open_file=has_open_file)


def register() -> None:
    """Make ``blender --command octo_motion`` known to Blender."""
    from . import blender_command  # noqa: PLC0415

    blender_command.register()


def unregister() -> None:
    """Take the command away."""
    from . import blender_command  # noqa: PLC0415

    blender_command.unregister()
