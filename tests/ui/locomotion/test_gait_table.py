# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaits in the panel: chosen, edited, saved, handed on, and each step undone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender.files import user_files as presets
from octo_motion.core.errors import GaitError
from octo_motion.core.locomotion.gait import table as gait
from octo_motion.ui.locomotion.settings import locomotion_settings, read_gait, set_gait
from octo_motion.ui.locomotion.settings.gait import used
from tests.ui.rig import click, make_octopus, scene_contents


@pytest.fixture(autouse=True)
def no_gaits_of_the_user() -> Iterator[None]:
    yield
    for path in presets.user_folder().glob("*"):
        path.unlink()


@pytest.fixture
def settings() -> Any:
    return locomotion_settings(make_octopus())


def same(left: gait.GaitTable, right: gait.GaitTable) -> bool:
    return gait.gait_to_json(left) == gait.gait_to_json(right)


def angles(settings: Any, phases: np.ndarray, pair: int = 1) -> np.ndarray:
    return read_gait(settings).curve(pair).evaluate(phases)


PHASES = np.linspace(0.0, 2.0 * np.pi, 73)


def test_a_new_armature_walks_with_the_preset(settings: Any) -> None:
    assert settings.gait == "walk"
    assert same(read_gait(settings), gait.gait_presets()["walk"])


@pytest.mark.parametrize("name", ["walk", "walk_literal", "swim"])
def test_choosing_a_gait_loads_exactly_its_table(settings: Any, name: str) -> None:
    settings.gait = "swim" if name == "walk" else "walk"
    settings.gait = name
    assert len(settings.table.curves) == len(gait.gait_presets()[name].curves)
    assert same(read_gait(settings), gait.gait_presets()[name])
    for pair, curve in gait.gait_presets()[name].curves.items():
        np.testing.assert_array_equal(read_gait(settings).curves[pair].angles, curve.angles)
        np.testing.assert_array_equal(read_gait(settings).curves[pair].phases, curve.phases)


def test_scripts_can_change_the_table_without_loading_it(settings: Any) -> None:
    settings.table.stride = 1.25
    table = read_gait(settings)
    assert table.stride == 1.25
    np.testing.assert_array_equal(
        table.curves[0].angles, gait.gait_presets()["walk"].curves[0].angles
    )


def test_edits_in_the_table_count(settings: Any) -> None:
    settings.gait = "swim"
    settings.table.curves[0].knots[1].head[2] = np.radians(33.0)
    settings.table.curves[0].knots[1].bank[0] = np.radians(-12.5)
    curve = read_gait(settings).curves[0]
    assert np.degrees(curve.angles[1, 2, 0]) == pytest.approx(33.0, abs=1e-9)
    assert np.degrees(curve.angles[1, 0, 2]) == pytest.approx(-12.5, abs=1e-9)


def test_the_cycle_closes_whatever_is_edited(settings: Any) -> None:
    settings.gait = "swim"
    knots = settings.table.curves[0].knots
    knots[0].head = (0.4, 0.1, 0.2)
    curve = read_gait(settings).curves[0]
    np.testing.assert_array_equal(curve.angles[0], curve.angles[-1])
    # Without a knot at 0° the angles there lie between the last knot and the first.
    knots[0].phase = np.radians(30.0)
    curve = read_gait(settings).curves[0]
    assert curve.phases[0] == 0.0
    np.testing.assert_array_equal(curve.angles[0], curve.angles[-1])
    # In any order; one at 360° is the one at 0°.
    knots[0].phase = 2.0 * np.pi
    knots[1].phase, knots[2].phase = np.radians(200.0), np.radians(100.0)
    curve = read_gait(settings).curves[0]
    np.testing.assert_allclose(np.degrees(curve.phases), (0.0, 100.0, 200.0, 270.0, 360.0))
    np.testing.assert_allclose(curve.angles[0, :, 0], (0.4, 0.1, 0.2), atol=1e-6)


def test_two_knots_at_one_phase_are_told(settings: Any) -> None:
    settings.gait = "swim"
    settings.table.curves[0].knots[1].phase = settings.table.curves[0].knots[2].phase
    with pytest.raises(GaitError, match="do not ascend"):
        read_gait(settings)


def test_two_curves_for_one_pair_are_told(settings: Any) -> None:
    settings.gait = "swim"
    settings.table.curves.add().pair = 0
    with pytest.raises(GaitError, match="two curves for one pair"):
        read_gait(settings)


def test_a_name_that_is_no_gait_keeps_the_table_and_is_told(settings: Any) -> None:
    settings.gait = "swim"
    settings.gait = "swmi"
    assert settings.table.name == "swim"
    with pytest.raises(GaitError, match="There is no gait 'swmi'"):
        read_gait(settings)
    settings.gait = "swim"
    assert same(read_gait(settings), gait.gait_presets()["swim"])


def test_reload_takes_edits_back(settings: Any) -> None:
    settings.gait = "swim"
    settings.table.stride = 9.0
    settings.table.curves[0].knots[1].head[0] = 1.0
    assert click("gait_load") == {"FINISHED"}
    assert same(read_gait(settings), gait.gait_presets()["swim"])
    click("gait_load", name="walk")
    assert settings.gait == "walk"
    assert same(read_gait(settings), gait.gait_presets()["walk"])


def test_a_gait_is_saved_under_a_name_and_found_in_the_next_file(settings: Any) -> None:
    settings.gait = "swim"
    settings.table.stride = 2.5
    click("gait_save", name="my swim")
    assert settings.gait == "my swim"
    saved = read_gait(settings)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    fresh = locomotion_settings(make_octopus())
    fresh.gait = "my swim"
    assert same(read_gait(fresh), saved)
    assert fresh.table.stride == 2.5


def test_a_saved_gait_is_overwritten_only_on_demand(settings: Any) -> None:
    click("gait_save", name="mine")
    settings.table.stride = 3.0
    with pytest.raises(RuntimeError, match="already"):
        click("gait_save", name="mine")
    click("gait_save", name="mine", overwrite=True)
    assert presets.load_gait("mine").stride == 3.0


def test_presets_of_the_extension_are_never_overwritten(settings: Any) -> None:
    del settings
    with pytest.raises(RuntimeError, match="comes with Octo Motion"):
        click("gait_save", name="walk", overwrite=True)
    with pytest.raises(RuntimeError, match="comes with Octo Motion"):
        click("gait_remove")


def test_removing_a_preset_keeps_what_is_loaded(settings: Any) -> None:
    click("gait_save", name="mine")
    before = read_gait(settings)
    click("gait_remove")
    assert presets.user_gait_names() == []
    assert same(read_gait(settings), before)
    with pytest.raises(RuntimeError, match="no saved gait 'mine'"):
        click("gait_remove")


def test_a_gait_goes_through_a_file(settings: Any, tmp_path: Path) -> None:
    settings.gait = "swim"
    settings.table.curves[0].knots[2].pitch = (0.1, 0.2, 0.3)
    click("gait_offset_add", pair=2, side="RIGHT")
    settings.table.offsets[0].phase = np.radians(40.0)
    exported = read_gait(settings)
    path = tmp_path / "gait.json"
    click("gait_export", filepath=str(path))
    settings.gait = "walk"
    click("gait_import", filepath=str(path))
    assert same(read_gait(settings), exported)


@pytest.mark.usefixtures("settings")
def test_a_gait_goes_to_a_file_beside_the_scene_that_colleagues_can_read(tmp_path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))

    bpy.ops.octo_motion.gait_export(filepath="//mine.json")

    (tmp_path / "plain").touch()  # as any new file is
    assert (tmp_path / "mine.json").stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert bpy.ops.octo_motion.gait_import(filepath="//mine.json") == {"FINISHED"}


def test_files_that_are_no_gait_are_told_and_change_nothing(settings: Any, tmp_path: Path) -> None:
    settings.gait = "swim"
    path = tmp_path / "gait.json"
    with pytest.raises(RuntimeError, match="cannot be read"):
        click("gait_import", filepath=str(path))
    path.write_text("[]", encoding="utf-8")
    with pytest.raises(RuntimeError, match="not a gait"):
        click("gait_import", filepath=str(path))
    with pytest.raises(RuntimeError, match="No file is given"):
        click("gait_import")
    with pytest.raises(RuntimeError, match="cannot write"):
        click("gait_export", filepath=str(tmp_path / "missing" / "gait.json"))
    assert same(read_gait(settings), gait.gait_presets()["swim"])


def test_a_new_knot_changes_nothing_until_it_is_moved(settings: Any) -> None:
    settings.gait = "swim"
    before = angles(settings, PHASES)
    click("gait_knot_add", knot=1)
    click("gait_knot_add")
    assert len(settings.table.curves[0].knots) == 6
    # The new angles are rounded to 1e-4 degrees.
    np.testing.assert_allclose(angles(settings, PHASES), before, atol=2e-6)
    phases = [round(np.degrees(knot.phase)) for knot in settings.table.curves[0].knots]
    assert phases == [0, 45, 90, 135, 180, 270]


def test_a_knot_is_removed_and_neighbours_close_the_gap(settings: Any) -> None:
    settings.gait = "swim"
    click("gait_knot_remove", knot=1)
    curve = read_gait(settings).curves[0]
    np.testing.assert_allclose(np.degrees(curve.phases), (0, 180, 270, 360))
    with pytest.raises(RuntimeError, match="no row 7"):
        click("gait_knot_remove", knot=7)
    with pytest.raises(RuntimeError, match="no row 7"):
        click("gait_knot_add", knot=7)
    with pytest.raises(RuntimeError, match="first knot"):
        click("gait_knot_remove", knot=0)


def test_a_row_that_is_not_there_leaves_the_table_as_it_was(settings: Any) -> None:
    with pytest.raises(RuntimeError, match="no row 99"):
        click("gait_knot_add", knot=99)
    assert len(settings.table.curves) == 0


def test_there_is_no_knot_within_a_degree_of_another(settings: Any) -> None:
    settings.gait = "swim"
    settings.table.curves[0].knots[1].phase = np.radians(0.5)
    with pytest.raises(RuntimeError, match="no room"):
        click("gait_knot_add", knot=0)


def test_a_pair_gets_angles_of_its_own_and_loses_them_again(settings: Any) -> None:
    settings.gait = "swim"
    shared = angles(settings, PHASES, 1)
    click("gait_curve_add", pair=4)
    assert settings.table.curves[settings.table.active_curve].pair == 4
    np.testing.assert_array_equal(angles(settings, PHASES, 4), shared)
    used(settings.table.curves)[1].knots[1].head[0] = 1.0
    assert not np.array_equal(angles(settings, PHASES, 4), shared)
    np.testing.assert_array_equal(angles(settings, PHASES, 1), shared)
    click("gait_curve_add")
    assert sorted(read_gait(settings).curves) == [0, 1, 4]
    with pytest.raises(RuntimeError, match="Pair 4 has angles of its own already"):
        click("gait_curve_add", pair=4)
    settings.table.active_curve = 2
    click("gait_curve_remove")
    np.testing.assert_array_equal(angles(settings, PHASES, 4), shared)
    settings.table.active_curve = 0
    with pytest.raises(RuntimeError, match="for all arms cannot be removed"):
        click("gait_curve_remove")
    settings.table.active_curve = 17
    with pytest.raises(RuntimeError, match="No pair is chosen"):
        click("gait_curve_remove")


def test_single_arms_keep_a_phase_of_their_own(settings: Any) -> None:
    click("gait_offset_add", pair=2, side="RIGHT")
    settings.table.offsets[0].phase = np.radians(40.0)
    table = read_gait(settings)
    assert np.degrees(table.offset("RIGHT", 2, 4)) == pytest.approx(40.0)
    with pytest.raises(RuntimeError, match="has an offset already"):
        click("gait_offset_add", pair=2, side="RIGHT")
    click("gait_offset_remove")
    assert read_gait(settings).offsets == {}
    with pytest.raises(RuntimeError, match="No offset is chosen"):
        click("gait_offset_remove")


def test_every_step_can_be_undone(settings: Any, tmp_path: Path) -> None:
    name = settings.id_data.name
    path = tmp_path / "gait.json"
    presets.write_gait(gait.gait_presets()["swim"], path)
    steps: list[tuple[str, dict[str, Any]]] = [
        ("gait_load", {"name": "swim"}),
        ("gait_save", {"name": "mine"}),
        ("gait_import", {"filepath": str(path)}),
        ("gait_curve_add", {"pair": 7}),
        ("gait_knot_add", {}),
        ("gait_knot_remove", {}),
        ("gait_offset_add", {"pair": 1, "side": "LEFT"}),
    ]
    for step, values in steps:
        bpy.ops.ed.undo_push(message="before")
        before = scene_contents()
        assert click(step, **values) == {"FINISHED"}
        assert scene_contents() != before, step
        bpy.ops.ed.undo()
        assert scene_contents() == before, step
    assert name in bpy.data.objects


def test_gaits_of_a_linked_armature_are_read_only(tmp_path: Path) -> None:
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
    for step in ("gait_load", "gait_save", "gait_curve_add", "gait_knot_add", "gait_offset_add"):
        with pytest.raises(RuntimeError, match="read-only here"):
            click(step)
    # It can be handed on.
    click("gait_export", filepath=str(tmp_path / "gait.json"))
    assert same(presets.read_gait_file(tmp_path / "gait.json"), gait.gait_presets()["walk"])


@pytest.mark.parametrize("linked_pairs", [0, 3])
@pytest.mark.parametrize("own_pairs", [0, 2])
def test_a_library_override_keeps_its_own_gait(
    tmp_path: Path, linked_pairs: int, own_pairs: int
) -> None:
    linked = locomotion_settings(make_octopus())
    if linked_pairs:
        linked.gait = "swim"
        for pair in range(1, linked_pairs + 1):
            click("gait_curve_add", pair=pair)
            click("gait_knot_add")
        click("gait_offset_add", pair=1, side="LEFT")
    library, shot = str(tmp_path / "library.blend"), str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["Octopus"]
    bpy.context.scene.collection.objects.link(bpy.data.objects["Octopus"])
    armature: Any = bpy.data.objects["Octopus"].override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = armature

    own = gait.renamed_gait(gait.gait_presets()["swim"], "own")
    curves = dict(own.curves)
    for pair in range(5, 5 + own_pairs):
        curves[pair] = gait.curve_from_degrees(
            [0, 90, 360], head=[[1, 2, 1], [0, pair, 0], [0, 0, 0]]
        )
    from dataclasses import replace

    own = replace(own, curves=curves, offsets={(3, "RIGHT"): np.radians(10.0)})
    set_gait(locomotion_settings(armature), own)
    expected = gait.gait_to_json(read_gait(locomotion_settings(armature)))
    assert expected == gait.gait_to_json(own) or linked_pairs

    for _ in range(2):
        bpy.ops.wm.save_as_mainfile(filepath=shot)
        bpy.ops.wm.open_mainfile(filepath=shot)
        armature = next(each for each in bpy.data.objects if each.override_library)
        assert (
            gait.gait_to_json(read_gait(locomotion_settings(armature)))
            == expected
            == gait.gait_to_json(own)
        )
