# SPDX-License-Identifier: GPL-3.0-or-later
"""Switching the add-on on and off where one of its steps fails."""

from collections.abc import Iterator
from typing import Any

import bpy
import pytest

import octo_motion
from octo_motion import command_line
from octo_motion.ui import registration


class Refused(bpy.types.Operator):
    """Blender refuses it: it has no name."""

    bl_idname = "nameless"
    bl_label = "Nameless"


def known() -> set[str]:
    """What Blender knows of the add-on."""
    found = {each for each in dir(bpy.types) if each.startswith("OCTO_MOTION")}
    handlers: Any = bpy.app.handlers
    for kind in dir(handlers):
        functions = getattr(handlers, kind)
        if isinstance(functions, list):
            found |= {kind for each in functions if each.__module__.startswith("octo_motion")}
    for owner in (bpy.types.Object, bpy.types.WindowManager):
        found |= {each for each in dir(owner) if each.startswith("octo_motion")}
    for menu, _draw in registration.MENUS:
        draws = getattr(bpy.types, menu)._dyn_ui_initialize()
        found |= {menu for each in draws if each.__module__.startswith("octo_motion")}
    return found


@pytest.fixture
def all_of_it() -> Iterator[set[str]]:
    """What Blender knows as the add-on is switched on; it is on again after the test."""
    octo_motion.unregister()
    octo_motion.register()
    on = known()
    yield on
    octo_motion.unregister()
    octo_motion.register()
    assert known() == on


def refuse(*_: object) -> None:
    raise RuntimeError("refused")


@pytest.mark.parametrize("place", [0, 40, None], ids=["first", "among others", "last"])
def test_a_class_that_blender_refuses_leaves_nothing_registered(
    all_of_it: set[str], monkeypatch: pytest.MonkeyPatch, place: int | None
) -> None:
    octo_motion.unregister()
    classes = list(registration.CLASSES)
    classes.insert(len(classes) if place is None else place, Refused)
    monkeypatch.setattr(registration, "CLASSES", tuple(classes))

    with pytest.raises(RuntimeError, match="nameless"):
        octo_motion.register()

    assert len(all_of_it) > 80
    assert known() == set()
    monkeypatch.undo()
    octo_motion.register()
    assert known() == all_of_it


def test_a_command_that_cannot_be_registered_leaves_nothing_registered(
    all_of_it: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    octo_motion.unregister()
    monkeypatch.setattr(command_line, "register", refuse)

    with pytest.raises(RuntimeError, match="refused"):
        octo_motion.register()

    assert all_of_it
    assert known() == set()
    monkeypatch.undo()
    octo_motion.register()


def test_what_cannot_be_unregistered_is_told_and_the_rest_goes(
    all_of_it: set[str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    classes = registration.CLASSES
    monkeypatch.setattr(registration, "CLASSES", (*classes[:40], Refused, *classes[40:]))
    monkeypatch.setattr(command_line, "unregister", refuse)

    octo_motion.unregister()

    assert [record.levelname for record in caplog.records] == ["ERROR", "ERROR"]
    assert "refused" in caplog.text
    assert "Refused" in caplog.text
    assert known() == set()
    monkeypatch.undo()
    command_line.unregister()
    octo_motion.register()
    assert known() == all_of_it
