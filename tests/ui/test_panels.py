# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab: every panel draws, in every state, with properties and operators that exist.

Blender draws panels in a window only. A layout of our own takes its place and checks what real
ones complain about on the console.
"""

import platform
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from octo_motion.device.hid import system
from octo_motion.ui import tool
from octo_motion.ui.locomotion import panels
from octo_motion.ui.locomotion.settings.properties import locomotion_settings
from octo_motion.ui.panel_base import draw_sentence
from octo_motion.ui.posing import panels as posing_panels
from octo_motion.ui.splicing import splice_panels
from tests.ui.rig import give_route, make_octopus
from tests.ui.splicing.walkers import BODIES, make_body

PANELS = list(panels.CLASSES)
ICONS = set(bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys())


FUNCTIONS = bpy.types.UILayout.bl_rna.functions


def check(function: str, arguments: Any) -> None:
    """This Blender knows the function and its arguments."""
    assert set(arguments) <= set(FUNCTIONS[function].parameters.keys()), (function, arguments)


class Layout:
    """Writes down what is drawn."""

    operator_context = "INVOKE_DEFAULT"

    def __init__(self, drawn: list[str] | None = None) -> None:
        self.drawn: list[str] = [] if drawn is None else drawn

    def row(self, **arguments: Any) -> "Layout":
        check("row", arguments)
        return Layout(self.drawn)

    def column(self, **arguments: Any) -> "Layout":
        check("column", arguments)
        return Layout(self.drawn)

    def split(self, **arguments: Any) -> "Layout":
        check("split", arguments)
        return Layout(self.drawn)

    def label(self, *, text: str, icon: str = "NONE", translate: bool = True) -> None:  # noqa: ARG002
        assert icon in ICONS
        self.drawn.append(text)

    def prop(
        self, data: Any, name: str, *, icon: str = "NONE", index: int = -1, **more: Any
    ) -> None:
        check("prop", more)
        assert icon in ICONS
        definition = data.bl_rna.properties[name]
        assert index < max(getattr(definition, "array_length", 0), 1)
        self.drawn.append(name)

    def prop_search(self, data: Any, name: str, where: Any, what: str, **more: Any) -> None:
        check("prop_search", more)
        assert where.bl_rna.properties[what].type == "COLLECTION"
        self.prop(data, name)

    def operator(self, name: str, *, icon: str = "NONE", **more: Any) -> Any:
        check("operator", more)
        assert icon in ICONS
        module, operator = name.split(".")
        rna = getattr(getattr(bpy.ops, module), operator).get_rna_type()
        self.drawn.append(name)

        class Properties:
            def __setattr__(self, key: str, value: Any) -> None:
                assert key in rna.properties, key

        return Properties()

    def menu(self, name: str, *, icon: str = "NONE", **more: Any) -> None:
        check("menu", more)
        assert icon in ICONS
        self.drawn.append(name)
        stand_in = SimpleNamespace(layout=self, draw_preset=lambda _context: None)
        getattr(bpy.types, name).draw(stand_in, bpy.context)

    def template_list(
        self, kind: str, _name: str, data: Any, items: str, other: Any, active: str, **more: Any
    ) -> None:
        check("template_list", more)
        assert active in other.bl_rna.properties
        for number, item in enumerate(getattr(data, items)):
            rows = getattr(bpy.types, kind)
            stand_in = SimpleNamespace(draw_row=partial(rows.draw_row, None))
            rows.draw_item(stand_in, bpy.context, self, data, item, 0, other, active, number)

    def template_curve_mapping(self, data: Any, name: str) -> None:
        assert "template_curve_mapping" in FUNCTIONS
        assert data.bl_rna.properties[name].fixed_type.identifier == "CurveMapping"
        self.drawn.append(name)

    def template_ID(self, data: Any, name: str) -> None:  # noqa: N802 - Blender's name
        assert "template_ID" in FUNCTIONS
        assert isinstance(getattr(data, name), bpy.types.ID)
        self.drawn.append("users")

    def template_icon_view(self, data: Any, name: str, **more: Any) -> None:
        check("template_icon_view", more)
        assert data.bl_rna.properties[name].type == "ENUM"
        self.drawn.append(name)

    def context_pointer_set(self, name: str, data: Any) -> None:
        assert "context_pointer_set" in FUNCTIONS
        assert isinstance(data, bpy.types.Object), name

    def separator(self, **more: Any) -> None:
        check("separator", more)


class Tab(dict[str, list[str]]):
    """What is drawn, by panel; those that their poll hides are missing."""

    def __init__(self) -> None:
        super().__init__()
        for panel in PANELS:
            if hasattr(panel, "poll") and not panel.poll(bpy.context):
                continue
            layout = Layout()
            kept: Any = panel
            stand_in = SimpleNamespace(layout=layout)
            if hasattr(kept, "show"):
                stand_in.show = kept.show.__get__(stand_in)
                stand_in.settings_of = kept.settings_of
            kept.draw(stand_in, bpy.context)
            self[panel.__name__.removeprefix("OCTO_MOTION_PT_")] = layout.drawn


def test_without_an_armature_the_tab_says_what_to_do() -> None:
    tab = Tab()
    assert list(tab) == ["rig"]
    assert tab["rig"][0] == "No armature is active."
    assert "octo_motion.add_octopus" in tab["rig"]


def test_panels_come_in_the_order_of_the_work() -> None:
    make_octopus()
    top = [each for each in PANELS if not hasattr(each, "bl_parent_id")]
    labels = [each.bl_label for each in top]
    assert sorted(labels, key=lambda label: top[labels.index(label)].bl_order) == [
        *("Rig", "Move", "Arms", "Route", "Gait", "Reaches"),
    ]
    assert {each.bl_category for each in PANELS} == {"Octo Motion"}


def test_only_what_one_presses_and_changes_often_is_open() -> None:
    make_octopus()
    opened = [each.bl_label for each in PANELS if "DEFAULT_CLOSED" not in options(each)]
    assert opened == ["Rig", "Move"]
    drawn = [name for name in Tab()["generate"] if not name.startswith("octo_motion.")]
    # With the switch of the tools.
    assert len(drawn) < 12


def options(panel: Any) -> set[str]:
    """Those of a panel."""
    return getattr(panel, "bl_options", set())


def test_the_main_button_stands_above_all_that_comes_and_goes() -> None:
    octopus = make_octopus()
    before = Tab()["generate"]
    assert before[:3] == ["octo_motion_setup", "octo_motion.generate_locomotion", "live"]
    give_route(octopus)
    locomotion_settings(octopus).live_error = "Something."
    assert Tab()["generate"][:3] == before[:3]


@pytest.mark.parametrize("tool", ["MOVE", "SPLICE", "POSE"])
def test_the_tab_shows_one_tool(tool: str) -> None:
    settings = make_octopus().octo_motion
    assert settings.tool == "MOVE"
    settings.tool = tool
    shown = {
        each.tool
        for each in (*panels.CLASSES, *splice_panels.CLASSES, *posing_panels.CLASSES)
        if getattr(each, "tool", "") and each.poll(bpy.context)
    }
    assert shown == {tool}


def test_the_tool_is_the_one_that_the_rig_looks_like_until_another_is_chosen() -> None:
    assert make_octopus().octo_motion.tool == "MOVE"
    armature = make_body("Person", BODIES["like it"])
    assert armature.octo_motion.tool == "SPLICE"
    bpy.ops.object.mode_set(mode="EDIT")
    assert armature.octo_motion.tool == "SPLICE"
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.octo_motion.tool = "MOVE"
    assert armature.octo_motion.tool == "MOVE"


def test_bones_that_are_being_edited_are_left_alone_by_a_redraw(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    armature = make_body("Person", BODIES["like it"])
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    read: list[Any] = []
    look = tool._is_humanoid
    monkeypatch.setattr(tool, "_is_humanoid", lambda each: bool(read.append(each)) or look(each))
    assert armature.octo_motion.tool == "MOVE"
    assert not read
    bpy.ops.object.mode_set(mode="OBJECT")
    assert armature.octo_motion.tool == "SPLICE"
    assert read == [armature]


def test_a_route_is_offered_and_then_its_settings() -> None:
    octopus = make_octopus()
    assert "octo_motion.add_route" in Tab()["generate"]
    give_route(octopus)
    assert "octo_motion.add_route" not in Tab()["generate"]
    assert "speed_mode" in Tab()["route"]
    assert "spline" not in Tab()["route"]
    octopus.octo_motion.locomotion.route.data.splines.new("BEZIER")
    assert "spline" in Tab()["route"]


def test_in_place_the_route_is_greyed_out() -> None:
    octopus = make_octopus()
    give_route(octopus)
    settings = locomotion_settings(octopus)
    for travel_on, active in (("OBJECT", True), ("NONE", False)):
        settings.travel_on = travel_on
        layout: Any = Layout()
        panels.OCTO_MOTION_PT_route.show(layout, layout, settings)
        assert layout.active is active


@pytest.mark.parametrize("gait", ["walk", "swim"])
def test_a_gait_shows_what_it_needs(gait: str) -> None:
    settings = locomotion_settings(make_octopus())
    assert "octo_motion.gait_load" in Tab()["table"]
    settings.gait = "swim" if gait == "walk" else "walk"
    settings.gait = gait
    bpy.ops.octo_motion.detect_arms()
    bpy.ops.octo_motion.gait_offset_add(pair=1, side="LEFT")
    bpy.ops.octo_motion.gait_curve_add(pair=7)
    settings.height_mode = "MANUAL"
    settings.use_weight_curve = True
    tab = Tab()
    assert ("burst" in tab["gait"]) == (gait == "swim")
    assert ("keep_upright" in tab["heading"]) == (gait == "walk")
    assert "octo_motion.gait_knot_remove" in tab["table"]
    assert "octo_motion.gait_offset_remove" in tab["table"]
    assert "mapping" in tab["weights"]
    assert "users" not in tab["weights"]
    armature: Any = settings.id_data
    armature.copy()
    assert "users" in Tab()["weights"]
    assert "height" in tab["heading"]
    bpy.data.node_groups.remove(settings.weight_curve)
    assert "The curve is gone: switch it off and on." in Tab()["weights"]


@pytest.mark.parametrize("timing", ["CADENCE", "SPEED", "RANGE"])
def test_timing_shows_its_own_settings_and_the_result(timing: str) -> None:
    octopus = make_octopus()
    give_route(octopus)
    settings = locomotion_settings(octopus)
    settings.timing, settings.frame_end = "RANGE", 25
    bpy.ops.octo_motion.generate_locomotion()
    settings.timing = timing
    drawn = Tab()["generate"]
    assert "frame_start" in Tab()["frames"]
    own = {"CADENCE": "cycle_time", "SPEED": "speed", "RANGE": "frame_end"}
    assert {name for name in own.values() if name in drawn} == {own[timing]}
    buttons = ["octo_motion.edit_on_top", "octo_motion.write_job"]
    assert drawn[-4:] == ["Octopus Locomotion", "25 frames, 1.0 s", *buttons]


def test_of_a_linked_armature_the_tab_says_that_it_is_read_only(tmp_path: Path) -> None:
    make_octopus()
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Octopus"]
    linked = bpy.data.objects["Octopus"]
    bpy.context.scene.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    assert "Linked and read-only." in Tab()["rig"]


def test_where_no_hidapi_is_made_the_panel_says_so_and_all_else_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Windows and Linux on ARM, Macs with Intel processors and Blender 5: there is no wheel."""

    def drawn() -> list[str]:
        system.why_not_read.cache_clear()
        layout = Layout()
        panel: Any = posing_panels.OCTO_MOTION_PT_posing_device
        panel.show(SimpleNamespace(), layout, None)
        return layout.drawn

    monkeypatch.setattr(system, "hidapi", lambda: None)
    usual = drawn()
    monkeypatch.undo()
    for name in ("hid", "hidraw"):
        monkeypatch.setitem(sys.modules, name, None)
    here = (sys.platform, platform.machine().lower())
    monkeypatch.setattr(system, "_WITHOUT_WHEELS", {here})
    lacking = drawn()
    system.why_not_read.cache_clear()
    assert " ".join(each for each in lacking if each not in usual) == (
        "Devices cannot be read: hidapi is not made for computers like this one. All else works: "
        "space mice that Blender has itself, and programs that are devices."
    )
    assert [each for each in lacking if each in usual] == usual


@pytest.mark.parametrize(("width", "lines"), [(700, 1), (280, 3), (40, 6)])
def test_a_long_sentence_is_told_in_lines_as_wide_as_the_sidebar(width: int, lines: int) -> None:
    sentence = (
        "'Octopus Locomotion' was edited: Live is off and leaves it as it is, all of its keys."
    )
    context: Any = SimpleNamespace(
        region=SimpleNamespace(width=width),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )
    layout = Layout()
    draw_sentence(layout, context, sentence, "ERROR")
    assert " ".join(layout.drawn) == sentence
    assert len(layout.drawn) == lines
