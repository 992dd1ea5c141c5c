# SPDX-License-Identifier: GPL-3.0-or-later
"""All that Blender learns of the add-on, in the order in which it must."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy

from . import at_work, locomotion, posing, settings, splicing
from .steps import Step, do_all, nothing, undo_all

Draw = Callable[[bpy.types.Menu, bpy.types.Context], None]

MENUS: tuple[tuple[str, Draw], ...] = (
    *locomotion.MENUS,
    ("TOPBAR_MT_file_import", splicing.draw_in_import_menu),
)

CLASSES: tuple[type, ...] = (
    *locomotion.CLASSES,
    *splicing.SETTINGS,
    *splicing.CLASSES,
    *posing.CLASSES,
    *settings.CLASSES,
)


def _steps() -> list[Step]:
    """What is done, and how each of it is undone."""
    register, unregister = bpy.utils.register_class, bpy.utils.unregister_class
    return [
        *(Step(partial(register, each), partial(unregister, each)) for each in CLASSES),
        Step(settings.register, settings.unregister),
        *locomotion.STEPS,
        *(_entry(getattr(bpy.types, menu), draw) for menu, draw in MENUS),
        *posing.STEPS,
        Step(nothing, at_work.stop_all),
    ]


def _entry(menu: Any, draw: Draw) -> Step:
    return Step(partial(menu.append, draw), partial(menu.remove, draw))


def register() -> None:
    """Register all classes, settings, handlers and menus, or none of them if one fails."""
    do_all(_steps())


def unregister() -> None:
    """Take back what :func:`register` did, in reverse order, as far as Blender lets it."""
    undo_all(_steps())
