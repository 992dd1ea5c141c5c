# SPDX-License-Identifier: GPL-3.0-or-later
"""The classes of the add-on, in the order in which Blender must learn of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from . import settings
from .locomotion import (
    add_route,
    arm_properties,
    gait_properties,
    gait_table,
    generate,
    properties,
)

Draw = Callable[[bpy.types.Menu, bpy.types.Context], None]

MENUS: tuple[tuple[Any, Draw], ...] = ((bpy.types.VIEW3D_MT_curve_add, add_route.draw_in_add_menu),)

CLASSES: tuple[type, ...] = (
    *gait_properties.CLASSES,
    *arm_properties.CLASSES,
    *properties.CLASSES,
    *settings.CLASSES,
    add_route.OCTO_MOTION_OT_add_route,
    *gait_table.CLASSES,
    generate.OCTO_MOTION_OT_generate_locomotion,
)


def register() -> None:
    """Register all classes and menus; an error surfaces."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    settings.register()
    for menu, draw in MENUS:
        menu.append(draw)


def unregister() -> None:
    """Take back what ``register`` did, in reverse order."""
    for menu, draw in reversed(MENUS):
        menu.remove(draw)
    settings.unregister()
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
