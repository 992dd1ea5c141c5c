# SPDX-License-Identifier: GPL-3.0-or-later
"""All that Blender learns of the add-on, in the order in which it must."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import (
    at_work,
    findable,
    follow_through,
    language,
    locomotion,
    manual,
    posing,
    preferences,
    splicing,
)
from .declared_settings import PointerProperty, make_overridable
from .follow_through import OCTO_MOTION_PG_follow_through
from .locomotion import OCTO_MOTION_PG_contact, OCTO_MOTION_PG_locomotion, keep_look, stamp
from .posing import OCTO_MOTION_PG_posing
from .splicing import OCTO_MOTION_PG_splicing
from .steps import Step, do_all, menu_entry, nothing, registered, undo_all
from .tool import chosen, switch


class OCTO_MOTION_PG_object(bpy.types.PropertyGroup):
    """All settings of an object, by feature."""

    locomotion: PointerProperty(
        name="Locomotion",
        description="How the armature walks or swims",
        type=OCTO_MOTION_PG_locomotion,
    )
    contact: PointerProperty(
        name="Contact",
        description="What a marker of a contact with the ground stands for",
        type=OCTO_MOTION_PG_contact,
    )
    splicing: PointerProperty(
        name="Splicing",
        description="What splicing knows of the armature",
        type=OCTO_MOTION_PG_splicing,
    )
    posing: PointerProperty(
        name="Posing",
        description="How the armature is posed by hand, and what stops it",
        type=OCTO_MOTION_PG_posing,
    )
    follow_through: PointerProperty(
        name="Follow-Through",
        description="Which bones lag and swing about an action, and how",
        type=OCTO_MOTION_PG_follow_through,
    )
    chosen_tool: chosen()
    tool: switch()


@persistent
def _before_saving(*_: object) -> None:
    for each in bpy.data.objects:
        if each.override_library is not None:
            make_overridable(each)
    stamp(bpy.data.objects)


@persistent
def _after_loading(*_: object) -> None:
    keep_look(bpy.data.objects)


@persistent
def _after_import(context: Any) -> None:
    keep_look(each.id for each in context.import_items if isinstance(each.id, bpy.types.Object))


def _handlers() -> list[tuple[Any, Any]]:
    known = bpy.app.handlers
    return [
        (known.save_pre, _before_saving),
        (known.load_post, _after_loading),
        (known.blend_import_post, _after_import),
    ]


def _give_settings() -> None:
    """Give objects their settings."""
    bpy.types.Object.octo_motion = PointerProperty(  # type: ignore[attr-defined]
        name="Octo Motion",
        description="Settings of Octo Motion",
        type=OCTO_MOTION_PG_object,
    )
    for handlers, function in _handlers():
        handlers.append(function)


def _take_settings() -> None:
    """Take the settings away."""
    for handlers, function in _handlers():
        handlers.remove(function)
    del bpy.types.Object.octo_motion  # type: ignore[attr-defined]


Draw = Callable[[bpy.types.Menu, bpy.types.Context], None]

MENUS: tuple[tuple[str, Draw], ...] = (
    *locomotion.MENUS,
    ("TOPBAR_MT_file_import", splicing.draw_in_import_menu),
    *findable.MENUS,
)

CLASSES: tuple[type, ...] = (
    manual.OCTO_MOTION_OT_manual,
    preferences.OCTO_MOTION_AP_preferences,
    *locomotion.CLASSES,
    *splicing.SETTINGS,
    *splicing.CLASSES,
    *posing.CLASSES,
    *follow_through.CLASSES,
    *findable.CLASSES,
    OCTO_MOTION_PG_object,
)


def _steps() -> list[Step]:
    """What is done, and how each of it is undone."""
    return [
        Step(language.register, language.unregister),
        *(registered(each) for each in CLASSES),
        Step(_give_settings, _take_settings),
        *locomotion.STEPS,
        *(menu_entry(menu, draw) for menu, draw in MENUS),
        *posing.STEPS,
        *splicing.STEPS,
        *manual.STEPS,
        Step(preferences.hand_on_devices, nothing),
        Step(nothing, at_work.stop_all),
    ]


def register() -> None:
    """Register all classes, settings, handlers and menus, or none of them if one fails."""
    do_all(_steps())


def unregister() -> None:
    """Take back what :func:`register` did, in reverse order, as far as Blender lets it."""
    undo_all(_steps())
