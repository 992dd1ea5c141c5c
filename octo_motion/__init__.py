# SPDX-License-Identifier: GPL-3.0-or-later
"""Octo Motion: creatures with arms walk and swim along a route.

Importing the package needs no Blender; ``register`` does.
"""


def register() -> None:
    """Make operators, panels, properties and menus known to Blender."""
    from .ui import registration  # noqa: PLC0415 - core and device run without bpy

    registration.register()


def unregister() -> None:
    """Take back all that ``register`` did."""
    from .ui import registration  # noqa: PLC0415

    registration.unregister()
