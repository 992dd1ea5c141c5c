# SPDX-License-Identifier: GPL-3.0-or-later
"""Classes to register, and steps that are taken one after the other and taken back in reverse."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any, Final

import bpy

_logger: Final = logging.getLogger(__name__)


@dataclass(frozen=True)
class Step:
    """Something that is done when the add-on is switched on, and undone when it is switched off."""

    do: Callable[[], object]
    undo: Callable[[], object]


def do_all(steps: Sequence[Step]) -> None:
    """Take all steps; if one fails, take back those before it, and let the error surface."""
    for number, step in enumerate(steps):
        try:
            step.do()
        except BaseException:
            undo_all(steps[:number])
            raise


def undo_all(steps: Sequence[Step]) -> None:
    """Take all steps back, the last first; what fails is logged, and the rest goes on."""
    for step in reversed(steps):
        try:
            step.undo()
        except Exception:
            _logger.exception("Octo Motion could not go on with %s.", step.undo)


def menu_entry(menu: str, draw: Callable[[Any, bpy.types.Context], None]) -> Step:
    """A menu or panel of Blender's, by its identifier, and what is drawn at its end."""

    def there() -> Any:  # one of ours is there from its own step on
        return getattr(bpy.types, menu)

    return Step(lambda: there().append(draw), lambda: there().remove(draw))


def registered(cls: type) -> Step:
    """A class that Blender is to know."""
    register, unregister = bpy.utils.register_class, bpy.utils.unregister_class
    return Step(partial(register, cls), partial(unregister, cls))


def nothing() -> None:
    """What is done where there is only something to undo."""


def own_classes(*modules: ModuleType) -> tuple[type, ...]:
    """What Blender is to know of these modules, in the order in which it stands there.

    Panels are left out: their order is told where they are shown.
    """
    kinds = bpy.types.Operator, bpy.types.Menu, bpy.types.UIList, bpy.types.PropertyGroup
    return tuple(
        each
        for module in modules
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, kinds) and each.__module__ == module.__name__
    )
