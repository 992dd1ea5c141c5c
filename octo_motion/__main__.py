# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m octo_motion``: the command line under Blender as a Python module."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from .command_line import STOPPED, parse, stoppable
from .command_line import main as run_command

PROGRAM = "python -m octo_motion"


def main() -> int:
    """Run the command; the exit status. It can be stopped at any time."""
    try:
        with stoppable():
            return _run()
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return STOPPED


def _run() -> int:
    """Run the command with the add-on registered; the exit status."""
    arguments = sys.argv[1:]
    if not arguments or arguments[0] in {"-h", "--help"} or arguments[1:] in (["-h"], ["--help"]):
        # Help needs no Blender.
        status = parse(arguments, PROGRAM, has_open_file=False)
        return status if isinstance(status, int) else 0
    if find_spec("bpy") is None:
        print(
            "This Python has no Blender. Install it (pip install bpy), or run\n"
            "  blender --background [FILE] --command octo_motion …",
            file=sys.stderr,
        )
        return 2
    from . import register, unregister  # noqa: PLC0415

    register()
    try:
        return run_command(arguments, PROGRAM, has_open_file=False)
    finally:
        # Blender 4.5 as a module hangs at exit while an operator is registered.
        unregister()


if __name__ == "__main__":
    sys.exit(main())
