# SPDX-License-Identifier: GPL-3.0-or-later
"""The classes of the add-on, in the order in which Blender must learn of them."""

from __future__ import annotations

import bpy

CLASSES: tuple[type, ...] = ()


def register() -> None:
    """Register all classes and menus; an error surfaces."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Take back what ``register`` did, in reverse order."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
