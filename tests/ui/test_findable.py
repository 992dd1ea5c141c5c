# SPDX-License-Identifier: GPL-3.0-or-later
"""The tools are found where one looks: in menus, by Blender's search, by dropping a file."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from octo_motion.ui import findable
from octo_motion.ui.locomotion.settings import locomotion_settings
from tests.ui.rig import make_octopus
from tests.ui.test_panels import Layout


class Menu(Layout):
    """Writes down what the entries are called, for that is what is searched."""

    def operator(self, name: str, **more: Any) -> Any:
        found = super().operator(name, **more)
        self.drawn[-1] = more["text"]
        return found

    def prop(self, data: Any, name: str, *, text: str = "", **more: Any) -> None:
        super().prop(data, name, **more)
        self.drawn[-1] = text


@pytest.mark.parametrize(
    "word", ["generate", "walk", "swim", "splice", "pose by hand", "import", "clips", "live"]
)
def test_the_search_finds_a_tool_by_its_word(word: str) -> None:
    make_octopus()
    drawn: list[str] = []
    stand_in: Any = SimpleNamespace(layout=Menu(drawn))
    findable.OCTO_MOTION_MT_tools.draw(stand_in, bpy.context)
    assert any(word in text.casefold() for text in drawn)


@pytest.mark.parametrize("menu", ["VIEW3D_MT_object", "VIEW3D_MT_pose"])
def test_the_tools_are_in_the_menus_of_object_and_pose(menu: str) -> None:
    functions = getattr(bpy.types, menu)._dyn_ui_initialize()
    assert findable.draw_in_menu in functions


HANDLERS = [each for each in findable.CLASSES if issubclass(each, bpy.types.FileHandler)]


@pytest.mark.parametrize("handler", HANDLERS)
def test_a_dropped_file_goes_to_an_operator_that_takes_it(handler: Any) -> None:
    module, name = handler.bl_import_operator.split(".")
    operator = getattr(getattr(bpy.ops, module), name).get_rna_type()
    assert "filepath" in operator.properties
    make_octopus()
    view, other = SimpleNamespace(type="VIEW_3D"), SimpleNamespace(type="OUTLINER")
    for area, allowed in ((view, True), (other, False), (None, False)):
        context = SimpleNamespace(area=area, object=bpy.context.object)
        assert handler.poll_drop(context) is allowed
    nothing = SimpleNamespace(area=view, object=None)
    assert handler.poll_drop(nothing) is not handler.needs_armature


def test_a_dropped_gait_is_loaded_without_a_file_browser(tmp_path: Path) -> None:
    settings: Any = locomotion_settings(make_octopus())
    bpy.ops.octo_motion.gait_load(name="swim")
    table = {**json.loads(settings.table.as_text), "name": "mine"}
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(table), encoding="utf-8")
    assert bpy.ops.octo_motion.gait_import("INVOKE_DEFAULT", filepath=str(path)) == {"FINISHED"}
    assert settings.gait == "mine"
