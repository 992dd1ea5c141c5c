# SPDX-License-Identifier: GPL-3.0-or-later
"""Octo Motion: creatures with arms walk and swim along a route.

Importing the package needs no Blender; ``register`` does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .ui.steps import Step


def register() -> None:
    """Make operators, panels, properties, menus and the command known to Blender.

    If one of them fails nothing of it stays, and the error surfaces.
    """
    from .ui.steps import do_all  # noqa: PLC0415 - core and device run without bpy

    do_all(_steps())


def unregister() -> None:
    """Take back all that ``register`` did; what cannot be taken back is logged."""
    from .ui.steps import undo_all  # noqa: PLC0415

    undo_all(_steps())


def _steps() -> list[Step]:
    from . import command_line  # noqa: PLC0415
    from .ui import registration  # noqa: PLC0415
    from .ui.steps import Step  # noqa: PLC0415

    return [
        Step(registration.register, registration.unregister),
        *command_line.steps(),
    ]
