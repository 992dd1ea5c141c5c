# SPDX-License-Identifier: GPL-3.0-or-later
"""Octo Motion: creatures with arms walk and swim along a route.

Importing the package needs no Blender; ``register`` does.
"""


def register() -> None:
    """Make operators, panels, properties, menus and the command known to Blender."""
    from . import command_line  # noqa: PLC0415 - core and device run without bpy
    from .ui import registration  # noqa: PLC0415

    registration.register()
    command_line.register()


def unregister() -> None:
    """Take back all that ``register`` did."""
    from . import command_line  # noqa: PLC0415
    from .ui import registration  # noqa: PLC0415

    command_line.unregister()
    registration.unregister()
