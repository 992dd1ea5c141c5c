# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings that were saved once are used wherever a skeleton of their kind appears."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.blender.files.saved_mappings import mapping_names
from octo_motion.blender.files.user_files import own_folder
from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS
from octo_motion.ui.splicing import landmark_table
from octo_motion.ui.splicing.properties import read_landmarks, splicing_settings, write_landmarks
from tests.core.humanoids import number_name
from tests.ui.rig import click
from tests.ui.splicing.test_clip_places import WALK, WAVE, import_all, write_bvh
from tests.ui.splicing.test_landmark_table import Recorder, make_humanoid
from tests.ui.splicing.test_splicing import give_motion, select

pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

SWAPPED = {
    each: number_name(f"{each[:-1]}{'R' if each[-1] == 'L' else 'L'}" if "." in each else each)
    for each in LANDMARKS
}
"""A table that nobody would guess: left and right are exchanged."""


@pytest.fixture(autouse=True)
def no_mappings() -> Iterator[None]:
    """None saved before, none left behind."""
    yield
    for path in own_folder("mappings").glob("*.json"):
        path.unlink()


def table_of(armature: Any) -> dict[str, str]:
    return dict(read_landmarks(splicing_settings(armature).landmarks).bones)


def fill(armature: Any, bones: dict[str, str]) -> None:
    table: Any = splicing_settings(armature).landmarks
    write_landmarks(table, bones)


def saved_doll() -> Any:
    """An armature whose odd table is saved as Doll, and emptied."""
    armature = make_humanoid(number_name)
    fill(armature, SWAPPED)
    assert click("mapping_save", name="Doll") == {"FINISHED"}
    fill(armature, {})
    return armature


def damage(name: str) -> Path:
    path = own_folder("mappings", create=True) / f"{name}.json"
    path.write_text("{ no JSON", encoding="utf-8")
    return path


def test_a_saved_mapping_is_used_before_anything_is_guessed(
    capfd: pytest.CaptureFixture[str],
) -> None:
    armature = saved_doll()
    click("map_skeleton")
    assert table_of(armature) == SWAPPED
    assert "21 of 21 landmarks are set. Mapping: Doll (saved)." in capfd.readouterr().out
    click("map_skeleton", saved=False)
    assert table_of(armature) == {each: number_name(each) for each in LANDMARKS}


def test_another_armature_of_that_kind_is_known_in_another_file() -> None:
    saved_doll()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    other = make_humanoid(lambda landmark: f"Bob:{number_name(landmark)}")
    click("map_skeleton")
    assert table_of(other) == {each: f"Bob:{bone}" for each, bone in SWAPPED.items()}
    stranger = make_humanoid()
    click("map_skeleton")
    assert table_of(stranger) == {each: each for each in LANDMARKS}


def test_building_uses_it_and_says_so(capfd: pytest.CaptureFixture[str]) -> None:
    hero = saved_doll()
    bpy.ops.object.mode_set(mode="OBJECT")
    hero.name = "Hero"
    source = make_humanoid()
    bpy.ops.object.mode_set(mode="OBJECT")
    give_motion(hero, 1)
    give_motion(source, 2)
    select(source, hero)
    click("splice_add")
    damage("Broken")
    capfd.readouterr()
    assert click("splice_build") == {"FINISHED"}
    told = capfd.readouterr().out
    assert "Mapping of 'Hero': Doll (saved)." in told
    assert told.count("The saved mapping 'Broken' cannot be read") == 1
    assert table_of(hero) == SWAPPED


def test_what_was_set_by_hand_counts_more() -> None:
    armature = saved_doll()
    table: Any = splicing_settings(armature).landmarks
    table.hand_l = number_name("forearm.L")
    click("map_skeleton", keep=True)
    assert table_of(armature) == SWAPPED | {"hand.L": number_name("forearm.L")}


def test_imported_clips_of_that_kind_have_their_table(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (walk,) = import_all(write_bvh(tmp_path / "walk.bvh", WALK))
    assert table_of(walk) == {}
    click("map_skeleton")
    fill(walk, table_of(walk) | {"spine": "Chest", "chest": "Neck"})
    expected = table_of(walk)
    click("mapping_save", name="Mocap 25")
    capfd.readouterr()
    (wave,) = import_all(write_bvh(tmp_path / "wave.bvh", WAVE))
    assert table_of(wave) == expected
    assert "Mapping: Mocap 25 (saved)." in capfd.readouterr().out


def test_mappings_are_loaded_and_removed_by_name() -> None:
    armature = saved_doll()
    assert mapping_names() == ["Doll"]
    click("mapping_load", name="Doll")
    assert table_of(armature) == SWAPPED
    with pytest.raises(RuntimeError, match="There is a mapping 'Doll' already"):
        bpy.ops.octo_motion.mapping_save(name="Doll")
    stranger = make_humanoid()
    with pytest.raises(RuntimeError, match="is no skeleton of the kind 'Doll'"):
        bpy.ops.octo_motion.mapping_load(name="Doll")
    assert table_of(stranger) == {}
    with pytest.raises(
        RuntimeError, match=r"There is no saved mapping 'None'\. Choose one of Doll"
    ):
        bpy.ops.octo_motion.mapping_load(name="None")
    click("mapping_remove", name="Doll")
    assert mapping_names() == []
    with pytest.raises(RuntimeError, match="There is no saved mapping ''"):
        bpy.ops.octo_motion.mapping_remove()


@pytest.mark.parametrize("name", ["a/b: *", "con", "骨 1", "…"])
def test_any_name_is_a_name_and_stays_in_the_folder(name: str) -> None:
    armature = saved_doll()
    fill(armature, SWAPPED)
    click("mapping_save", name=name)
    assert mapping_names() == sorted(["Doll", name], key=str.casefold)
    assert len(list(own_folder("mappings").glob("*.json"))) == 2
    click("mapping_remove", name=name)
    assert mapping_names() == ["Doll"]


@pytest.mark.parametrize(
    ("name", "reason"), [(" ", "has no name"), ("x" * 61, "name has 61 letters")]
)
def test_a_name_of_no_use_is_refused(name: str, reason: str) -> None:
    fill(make_humanoid(number_name), SWAPPED)
    with pytest.raises(RuntimeError, match=reason):
        bpy.ops.octo_motion.mapping_save(name=name)


@pytest.mark.parametrize("where", ["REST", "FRAME", "FOUND"])
def test_where_the_reference_pose_is_found_is_kept_with_the_mapping(where: str) -> None:
    armature = saved_doll()
    fill(armature, SWAPPED)
    table: Any = splicing_settings(armature).landmarks
    bpy.context.scene.frame_set(7)
    table.reference_pose = where
    click("mapping_save", name="Doll", overwrite=True)
    for name in ("mapping_load", "map_skeleton"):
        other: Any = splicing_settings(make_humanoid(number_name)).landmarks
        click(name, **({"name": "Doll"} if name == "mapping_load" else {}))
        assert other.reference_pose == where
        assert where != "FRAME" or other.reference_frame == 7


def test_a_reference_pose_that_a_file_cannot_mean_is_as_found() -> None:
    saved_doll()
    (path,) = own_folder("mappings").glob("*.json")
    for odd in ("anything", True, None, [1]):
        content = json.loads(path.read_text(encoding="utf-8")) | {"reference_pose": odd}
        path.write_text(json.dumps(content), encoding="utf-8")
        other: Any = splicing_settings(make_humanoid(number_name)).landmarks
        click("map_skeleton")
        assert other.reference_pose == "FOUND"


def test_saved_again_a_file_keeps_what_others_have_put_into_it() -> None:
    armature = saved_doll()
    (path,) = own_folder("mappings").glob("*.json")
    content = json.loads(path.read_text(encoding="utf-8")) | {"colour": "blue"}
    path.write_text(json.dumps(content), encoding="utf-8")
    fill(armature, SWAPPED | {"neck": ""})
    click("mapping_save", name="Doll", overwrite=True)
    again = json.loads(path.read_text(encoding="utf-8"))
    assert again["colour"] == "blue"
    assert "neck" not in again["landmarks"]


def test_a_damaged_file_is_told_and_stops_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    armature = saved_doll()
    path = damage("Broken")
    capfd.readouterr()
    click("map_skeleton")
    assert table_of(armature) == SWAPPED
    told = capfd.readouterr().out
    assert told.count("The saved mapping 'Broken' cannot be read: it is no JSON") == 1
    with pytest.raises(RuntimeError, match="'Broken' cannot be read"):
        bpy.ops.octo_motion.mapping_load(name="Broken")
    click("mapping_remove", name="Broken")
    assert not path.exists()
    path.write_bytes(b"\xff\xfe\x00")
    click("map_skeleton")
    assert "'Broken' cannot be read: it is not text" in capfd.readouterr().out


def test_a_file_that_was_changed_is_read_again() -> None:
    armature = saved_doll()
    click("map_skeleton")
    (path,) = own_folder("mappings").glob("*.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    content["landmarks"]["hand.L"] = number_name("hand.L")
    path.write_text(json.dumps(content), encoding="utf-8")
    click("map_skeleton")
    assert table_of(armature)["hand.L"] == number_name("hand.L")


def menus(armature: Any) -> list[str]:
    """What the panel calls its menus."""
    log: list[tuple[str, Any, Any]] = []
    layout: Any = Recorder(log)
    settings: Any = splicing_settings(armature)
    landmark_table.draw_landmarks(layout, bpy.context, settings)
    return [options["text"] for call, _, options in log if call == "menu"]


def test_the_panel_says_which_mapping_it_is() -> None:
    armature = saved_doll()
    assert "Mapping: Doll (saved)" in menus(armature)
    click("map_skeleton")
    assert "Mapping: Doll (saved)" in menus(armature)
    table: Any = splicing_settings(armature).landmarks
    table.neck = number_name("head")
    assert "Mapping: Doll (changed)" in menus(armature)
    assert "Saved Mappings" in menus(make_humanoid())


def test_the_menu_lists_what_is_saved() -> None:
    saved_doll()
    log: list[tuple[str, Any, Any]] = []

    class Menu:
        layout = Recorder(log)
        draw: Callable[..., None]

    menu: Any = bpy.types.OCTO_MOTION_MT_mappings
    menu.draw(Menu(), bpy.context)
    texts = [options["text"] for call, _, options in log if call == "operator"]
    assert texts == ["Doll", "Save Mapping…", "Remove Doll"]
