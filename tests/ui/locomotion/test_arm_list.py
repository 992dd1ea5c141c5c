# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of arms: detect, add from selection, remove, reorder, flip, select, undo."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from octo_motion.blender import versions
from octo_motion.ui.locomotion.settings.properties import locomotion_settings

BONES = 4


def call(name: str, **properties: Any) -> set[str]:
    """Call an operator as a click does: with an undo step of its own."""
    operator = getattr(bpy.ops.octo_motion, name)
    return operator("EXEC_DEFAULT", True, **properties)  # noqa: FBT003


def new_octopus(arms: int = 8, bones: int = BONES, turned: float = 0.0) -> Any:
    """An active armature whose arms say nothing about their side by name."""
    armature: Any = bpy.data.objects.new("Octopus", bpy.data.armatures.new("Octopus"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    armature.select_set(state=True)
    bpy.ops.object.mode_set(mode="EDIT")
    edit_bones = armature.data.edit_bones
    body = edit_bones.new("body")
    body.head, body.tail = (0, 0, 0), (0, 0, 0.5)
    for arm in range(arms):
        angle = turned + (arm + 0.5) * 2.0 * np.pi / arms
        direction = np.array([np.sin(angle), -np.cos(angle), 0.0])
        parent = body
        for number in range(bones):
            bone = edit_bones.new(f"t{arm}_{number}")
            bone.head = (0.3 + 0.5 * number) * direction
            bone.tail = (0.3 + 0.5 * (number + 1)) * direction
            bone.parent = parent
            parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def bones_of(arm: int, bones: int = BONES) -> list[str]:
    return [f"t{arm}_{number}" for number in range(bones)]


def arms(armature: Any) -> Any:
    return locomotion_settings(armature).arms


def listed(armature: Any) -> list[tuple[str, list[str], str, int, float, bool, bool]]:
    """All that the list says."""
    return [
        (
            arm.name,
            [bone.name for bone in arm.bones],
            arm.side,
            arm.pair,
            round(arm.phase, 5),
            arm.flip,
            arm.enabled,
        )
        for arm in arms(armature)
    ]


def select(armature: Any, names: Sequence[str]) -> None:
    """Select these bones alone, in pose mode."""
    bpy.ops.object.mode_set(mode="POSE")
    for bone in armature.pose.bones:
        versions.select(bone, state=bone.name in names)


def selected(armature: Any) -> list[str]:
    return [bone.name for bone in armature.pose.bones if versions.is_selected(bone)]


def undone(armature: Any) -> Any:
    """The armature after undo, which replaces all of Blender's data."""
    name = armature.name
    bpy.ops.ed.undo()
    return bpy.data.objects[name]


def push(message: str = "before") -> None:
    bpy.ops.ed.undo_push(message=message)


# --- Detect --------------------------------------------------------------------------------------


def test_detecting_fills_the_list_front_to_back_left_before_right() -> None:
    armature = new_octopus()
    assert call("detect_arms") == {"FINISHED"}
    assert listed(armature) == [
        (f"Arm {pair} {side[0]}", bones_of(arm), side, pair, 0.0, False, True)
        for arm, side, pair in (
            (0, "LEFT", 1),
            (7, "RIGHT", 1),
            (1, "LEFT", 2),
            (6, "RIGHT", 2),
            (2, "LEFT", 3),
            (5, "RIGHT", 3),
            (3, "LEFT", 4),
            (4, "RIGHT", 4),
        )
    ]
    settings = locomotion_settings(armature)
    assert (settings.body_front, settings.body_up, settings.root_bone) == ("-Y", "Z", "body")


def test_detecting_again_keeps_what_the_artist_set() -> None:
    armature = new_octopus()
    call("detect_arms")
    arms(armature)[2].phase, arms(armature)[2].flip = 1.5, True
    arms(armature)[2].use_weights, arms(armature)[2].weight_tip = True, 0.1
    arms(armature)[3].name, arms(armature)[3].enabled = "Curly", False
    before = listed(armature)
    arms(armature).move(2, 7)
    arms(armature)[0].side, arms(armature)[0].pair = "CENTER", 9
    call("detect_arms")
    assert listed(armature) == before
    curly = next(arm for arm in arms(armature) if arm.phase > 0.0)
    assert curly.use_weights
    assert curly.weight_tip == pytest.approx(0.1)


def test_an_arm_with_other_bones_starts_anew() -> None:
    armature = new_octopus()
    call("detect_arms")
    for arm in arms(armature):
        arm.phase, arm.flip = 1.0, True
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones.remove(armature.data.edit_bones["t0_3"])
    bpy.ops.object.mode_set(mode="OBJECT")
    call("detect_arms")
    changed = [arm for arm in arms(armature) if not arm.flip]
    assert [[bone.name for bone in arm.bones] for arm in changed] == [bones_of(0, 3)]
    assert changed[0].phase == 0.0


def test_the_artists_front_is_kept_and_can_be_given() -> None:
    armature = new_octopus()
    call("detect_arms")
    locomotion_settings(armature).body_front = "X"
    call("detect_arms")
    assert locomotion_settings(armature).body_front == "X"
    # Left of +X is +Y: the arms that were at the back.
    left = {arm.bones[0].name for arm in arms(armature) if arm.side == "LEFT"}
    assert left == {"t2_0", "t3_0", "t4_0", "t5_0"}
    call("detect_arms", front="-Y")
    assert locomotion_settings(armature).body_front == "-Y"


def test_an_artists_root_bone_is_kept() -> None:
    armature = new_octopus()
    locomotion_settings(armature).root_bone = "t0_0"
    call("detect_arms")
    assert locomotion_settings(armature).root_bone == "t0_0"


def test_the_object_may_lie_turned_and_scaled_in_the_world() -> None:
    armature = new_octopus()
    armature.rotation_euler = (np.pi / 2.0, 0.0, 0.0)
    armature.scale = (0.01, 0.01, 0.01)
    call("detect_arms")
    # The world's up is the armature's own +Y; its arms stand in a circle round that axis' plane.
    settings = locomotion_settings(armature)
    assert (settings.body_up, settings.body_front) == ("Y", "Z")


def test_a_mesh_of_the_armature_stands_for_it() -> None:
    armature = new_octopus()
    mesh = bpy.data.objects.new("Skin", bpy.data.meshes.new("Skin"))
    bpy.context.scene.collection.objects.link(mesh)
    mesh.modifiers.new("Armature", "ARMATURE").object = armature  # type: ignore[union-attr]
    bpy.context.view_layer.objects.active = mesh
    call("detect_arms")
    assert len(arms(armature)) == 8


def test_what_the_artist_should_know_is_reported(capfd: pytest.CaptureFixture[str]) -> None:
    armature = new_octopus()
    for arm in range(8):
        armature.pose.bones[f"t{arm}_1"].constraints.new("LIMIT_ROTATION")
    call("detect_arms")
    told = capfd.readouterr().out
    assert "8 arms found: 4 left, 4 right." in told
    assert "Warning: Constraints or drivers move 8 arms" in told


def test_rigs_without_arms_get_a_clear_answer_and_keep_their_list() -> None:
    armature = new_octopus()
    call("detect_arms")
    before = listed(armature)
    empty = bpy.data.objects.new("Empty", bpy.data.armatures.new("Empty"))
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.objects.active = empty
    with pytest.raises(RuntimeError, match=r"'Empty' has no bones\. Add bones"):
        call("detect_arms")
    short = new_octopus(bones=2)
    with pytest.raises(RuntimeError, match=r"no 3 bones form a chain.*subdivide"):
        call("detect_arms")
    assert len(arms(short)) == 0
    bpy.context.view_layer.objects.active = armature
    locomotion_settings(armature).body_front = "Z"
    with pytest.raises(RuntimeError, match=r"lie on one axis\. Choose a front axis"):
        call("detect_arms")
    assert listed(armature) == before


def test_where_detecting_is_greyed_out_it_says_why() -> None:
    with pytest.raises(RuntimeError, match="No object is active"):
        call("detect_arms")
    cube = bpy.data.objects.new("Cube", bpy.data.meshes.new("Cube"))
    bpy.context.scene.collection.objects.link(cube)
    bpy.context.view_layer.objects.active = cube
    with pytest.raises(RuntimeError, match="'Cube' is not an armature"):
        call("detect_arms")
    new_octopus()
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Go to object mode or pose mode first"):
        call("detect_arms")


# --- Add -----------------------------------------------------------------------------------------


def test_bones_selected_in_pose_mode_become_an_arm() -> None:
    armature = new_octopus()
    select(armature, ["t1_2", "t1_0", "t1_1"])
    assert call("arm_add") == {"FINISHED"}
    assert listed(armature) == [("Arm 1 L", bones_of(1, 3), "LEFT", 1, 0.0, False, True)]


def test_a_removed_arm_added_again_gets_its_place_in_the_gait_back() -> None:
    armature = new_octopus()
    call("detect_arms")
    settings = locomotion_settings(armature)
    before = listed(armature)
    settings.active_arm = 5
    call("arm_remove")
    assert listed(armature) == before[:5] + before[6:]
    select(armature, bones_of(5))
    call("arm_add")
    assert listed(armature) == [*before[:5], *before[6:], before[5]]
    assert settings.active_arm == 7


def test_bones_selected_in_edit_mode_become_an_arm_and_stay_selected_in_pose_mode() -> None:
    armature = new_octopus()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.armature.select_all(action="DESELECT")
    for name in bones_of(2):
        bone = armature.data.edit_bones[name]
        bone.select = bone.select_head = bone.select_tail = True
    call("arm_add")
    assert bpy.context.mode == "POSE"
    assert selected(armature) == bones_of(2)
    assert [bone.name for bone in arms(armature)[0].bones] == bones_of(2)


def test_bones_just_made_in_edit_mode_become_an_arm() -> None:
    armature = new_octopus(arms=2)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.armature.select_all(action="DESELECT")
    parent = armature.data.edit_bones["body"]
    for number in range(3):
        bone = armature.data.edit_bones.new(f"new{number}")
        bone.head, bone.tail = (0, -number - 1, 0), (0, -number - 2, 0)
        bone.parent = parent
        bone.select = bone.select_head = bone.select_tail = True
        parent = bone
    call("arm_add")
    assert [bone.name for bone in arms(armature)[0].bones] == ["new0", "new1", "new2"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ([], "at least 3 bones in a row, not 0"),
        (["t0_0", "t0_1"], r"at least 3 bones in a row, not 2\. Choose all bones"),
        (["t0_0", "t0_1", "t1_0"], "not in one chain"),
    ],
)
def test_bones_that_are_no_arm_are_refused(names: list[str], message: str) -> None:
    armature = new_octopus()
    select(armature, names)
    with pytest.raises(RuntimeError, match=message):
        call("arm_add")
    assert len(arms(armature)) == 0


def test_a_bone_of_another_arm_is_refused() -> None:
    armature = new_octopus()
    call("detect_arms")
    select(armature, ["t0_1", "t0_2", "t0_3"])
    with pytest.raises(RuntimeError, match=r"'t0_1' belongs to another arm of the list\. Remove"):
        call("arm_add")
    assert len(arms(armature)) == 8


def test_adding_needs_pose_mode_or_edit_mode() -> None:
    new_octopus()
    with pytest.raises(RuntimeError, match="Select the arm's bones in pose mode or edit mode"):
        call("arm_add")


def test_an_added_arm_that_constraints_move_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    armature = new_octopus()
    armature.pose.bones["t1_1"].constraints.new("COPY_ROTATION")
    select(armature, bones_of(1))
    call("arm_add")
    assert "move bones of 'Arm 1 L': keys have no effect" in capfd.readouterr().out


def test_arms_whose_bones_are_gone_do_not_stop_an_addition() -> None:
    armature = new_octopus()
    call("detect_arms")
    arms(armature)[0].bones[0].name = "gone"
    arms(armature).remove(7)
    select(armature, bones_of(4))
    assert call("arm_add") == {"FINISHED"}
    assert len(arms(armature)) == 8


def test_names_stay_unique() -> None:
    armature = new_octopus()
    call("detect_arms")
    arms(armature).remove(0)
    arms(armature)[3].name = "Arm 1 L"
    select(armature, bones_of(0))
    call("arm_add")
    assert arms(armature)[-1].name == "Arm 1 L.001"


# --- Remove, move, flip, select ------------------------------------------------------------------


def test_removing_goes_on_to_the_next_arm_and_ends_with_an_empty_list() -> None:
    armature = new_octopus(arms=2)
    call("detect_arms")
    settings = locomotion_settings(armature)
    settings.active_arm = 1
    call("arm_remove")
    assert settings.active_arm == 0
    assert len(settings.arms) == 1
    call("arm_remove")
    assert len(settings.arms) == 0
    for operator in ("arm_remove", "arm_flip", "arm_select", "arm_move"):
        with pytest.raises(RuntimeError, match="Choose an arm in the list first"):
            call(operator)


def test_moving_takes_the_active_arm_along_and_stops_at_the_ends() -> None:
    armature = new_octopus(arms=4)
    call("detect_arms")
    settings = locomotion_settings(armature)
    names = [arm.name for arm in settings.arms]
    assert call("arm_move", direction="DOWN") == {"FINISHED"}
    assert [arm.name for arm in settings.arms] == [names[1], names[0], names[2], names[3]]
    assert settings.active_arm == 1
    assert call("arm_move", direction="UP") == {"FINISHED"}
    assert call("arm_move", direction="UP") == {"CANCELLED"}
    assert [arm.name for arm in settings.arms] == names
    settings.active_arm = 3
    assert call("arm_move", direction="DOWN") == {"CANCELLED"}


def test_flipping_twice_changes_nothing() -> None:
    armature = new_octopus(arms=2)
    call("detect_arms")
    call("arm_flip")
    assert [arm.flip for arm in arms(armature)] == [True, False]
    call("arm_flip")
    assert [arm.flip for arm in arms(armature)] == [False, False]


def test_selecting_shows_an_arms_bones_in_pose_mode() -> None:
    armature = new_octopus()
    call("detect_arms")
    select(armature, ["body"])
    bpy.ops.object.mode_set(mode="OBJECT")
    locomotion_settings(armature).active_arm = 1
    call("arm_select")
    assert bpy.context.mode == "POSE"
    assert selected(armature) == bones_of(7)
    assert armature.data.bones.active.name == "t7_0"
    locomotion_settings(armature).active_arm = 0
    call("arm_select", extend=True)
    assert selected(armature) == bones_of(0) + bones_of(7)


def test_hidden_bones_are_left_out_and_named(capfd: pytest.CaptureFixture[str]) -> None:
    armature = new_octopus()
    call("detect_arms")
    collection = armature.data.collections.new("Tips")
    collection.assign(armature.data.bones["t0_3"])
    collection.is_visible = False
    call("arm_select")
    assert selected(armature) == bones_of(0, 3)
    assert "1 of 4 bones are hidden and were left out ('t0_3'" in capfd.readouterr().out
    for name in bones_of(0):
        collection.assign(armature.data.bones[name])
    select(armature, ["body"])
    with pytest.raises(RuntimeError, match=r"All bones of 'Arm 1 L' are hidden\. Reveal them"):
        call("arm_select")
    assert selected(armature) == ["body"]


def test_selecting_bones_that_are_gone_says_what_to_do() -> None:
    armature = new_octopus()
    call("detect_arms")
    arms(armature)[0].bones[2].name = "gone"
    with pytest.raises(RuntimeError, match=r"no bone 'gone'\. Detect the arms again"):
        call("arm_select")
    assert bpy.context.mode == "OBJECT"


def test_selecting_needs_the_armature_to_be_active() -> None:
    armature = new_octopus()
    call("detect_arms")
    mesh = bpy.data.objects.new("Skin", bpy.data.meshes.new("Skin"))
    bpy.context.scene.collection.objects.link(mesh)
    mesh.modifiers.new("Armature", "ARMATURE").object = armature  # type: ignore[union-attr]
    bpy.context.view_layer.objects.active = mesh
    with pytest.raises(RuntimeError, match="Make the armature itself the active object first"):
        call("arm_select")


# --- Undo ----------------------------------------------------------------------------------------


def test_undo_takes_detecting_back_in_one_step() -> None:
    armature = new_octopus()
    push()
    call("detect_arms")
    armature = undone(armature)
    assert listed(armature) == []
    assert locomotion_settings(armature).root_bone == ""


@pytest.mark.parametrize(
    ("operator", "properties"),
    [
        ("detect_arms", {"front": "X"}),
        ("arm_remove", {}),
        ("arm_move", {"direction": "DOWN"}),
        ("arm_flip", {}),
        ("arm_select", {}),
    ],
)
def test_undo_takes_a_change_of_the_list_back_in_one_step(
    operator: str, properties: dict[str, Any]
) -> None:
    armature = new_octopus()
    call("detect_arms")
    select(armature, ["body"])
    push()
    before = listed(armature), selected(armature), locomotion_settings(armature).active_arm
    call(operator, **properties)
    after = listed(armature), selected(armature), locomotion_settings(armature).active_arm
    assert after != before
    armature = undone(armature)
    assert bpy.context.mode == "POSE"
    found = listed(armature), selected(armature), locomotion_settings(armature).active_arm
    assert found == before


def test_undo_of_selecting_an_arm_leads_back_to_object_mode() -> None:
    armature = new_octopus()
    call("detect_arms")
    push()
    call("arm_select")
    assert bpy.context.mode == "POSE"
    armature = undone(armature)
    assert bpy.context.mode == "OBJECT"
    assert len(listed(armature)) == 8


def test_undo_takes_an_arm_added_in_pose_mode_back() -> None:
    armature = new_octopus()
    select(armature, bones_of(0))
    push()
    call("arm_add")
    armature = undone(armature)
    assert listed(armature) == []
    assert selected(armature) == bones_of(0)


def test_undo_of_an_arm_added_in_edit_mode_leads_back_to_edit_mode() -> None:
    armature = new_octopus()
    push("start")
    bpy.ops.object.mode_set("EXEC_DEFAULT", True, mode="EDIT")  # noqa: FBT003
    bpy.ops.armature.select_all("EXEC_DEFAULT", True, action="DESELECT")  # noqa: FBT003
    for name in bones_of(0):
        bone = armature.data.edit_bones[name]
        bone.select = bone.select_head = bone.select_tail = True
    push("selected")
    call("arm_add")
    assert bpy.context.mode == "POSE"
    armature = undone(armature)
    assert bpy.context.mode == "EDIT_ARMATURE"
    assert listed(armature) == []
    assert {bone.name for bone in armature.data.edit_bones if bone.select} == set(bones_of(0))


# --- Linked rigs ---------------------------------------------------------------------------------


def linked(armature: Any, tmp_path: Path) -> Any:
    """The armature of this file in another file, to which it is linked."""
    collection = bpy.data.collections.new("Octopus")
    collection.objects.link(armature)
    library = str(tmp_path / "library.blend")
    bpy.data.libraries.write(library, {collection})
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(library, link=True) as (_, wanted):
        wanted.collections = ["Octopus"]
    collection = bpy.data.collections["Octopus"]
    bpy.context.scene.collection.children.link(collection)
    result: Any = collection.all_objects[0]
    bpy.context.view_layer.objects.active = result
    return result


def linked_octopus(tmp_path: Path, *, detected: bool) -> Any:
    """A linked octopus, of a file in which its arms were detected or were not."""
    armature = new_octopus()
    if detected:
        call("detect_arms")
    return linked(armature, tmp_path)


def overridden(armature: Any) -> Any:
    """An editable library override of a linked octopus."""
    (collection,) = armature.users_collection
    collection.override_hierarchy_create(
        bpy.context.scene, bpy.context.view_layer, do_fully_editable=True
    )
    return override_in_file()


def override_in_file() -> Any:
    (armature,) = (each for each in bpy.data.objects if each.override_library)
    bpy.context.view_layer.objects.active = armature
    return armature


def reopened(armature: Any, tmp_path: Path) -> Any:
    del armature
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    return override_in_file()


def test_a_linked_armature_is_refused_before_anything_changes(tmp_path: Path) -> None:
    armature = linked_octopus(tmp_path, detected=True)
    before = listed(armature)
    for operator in ("detect_arms", "arm_remove", "arm_move", "arm_flip", "arm_select"):
        with pytest.raises(RuntimeError, match=r"is linked from.*Make a library override"):
            call(operator, **({"direction": "DOWN"} if operator == "arm_move" else {}))
    assert listed(armature) == before


def test_an_override_that_is_not_editable_is_refused(tmp_path: Path) -> None:
    armature = overridden(linked_octopus(tmp_path, detected=True))
    armature.override_library.is_system_override = True
    with pytest.raises(RuntimeError, match=r"override that is not editable\. Make it editable"):
        call("arm_flip")


def test_arms_detected_on_an_override_are_saved_with_the_file(tmp_path: Path) -> None:
    armature = overridden(linked_octopus(tmp_path, detected=False))
    call("detect_arms")
    arms(armature)[2].phase = 0.5
    settings = locomotion_settings(armature)
    settings.active_arm = 0
    call("arm_move", direction="DOWN")
    settings.active_arm = 7
    call("arm_remove")
    before = listed(armature)
    assert len(before) == 7
    assert listed(reopened(armature, tmp_path)) == before


def test_arms_of_the_linked_file_can_be_set_but_not_taken_away(tmp_path: Path) -> None:
    armature = overridden(linked_octopus(tmp_path, detected=True))
    arms(armature)[1].phase = 0.25
    call("arm_flip")
    with pytest.raises(RuntimeError, match=r"in the linked file and cannot be removed here\. Sw"):
        call("arm_remove")
    with pytest.raises(RuntimeError, match=r"in the linked file, where the order of its arms"):
        call("arm_move", direction="DOWN")
    assert len(arms(armature)) == 8
    before = listed(armature)
    assert before[0][5]
    assert before[1][4] == 0.25
    assert listed(reopened(armature, tmp_path)) == before


def test_detecting_again_on_an_override_does_not_double_the_list(tmp_path: Path) -> None:
    armature = overridden(linked_octopus(tmp_path, detected=True))
    arms(armature)[1].phase = 0.25
    call("detect_arms", front="X")
    before = listed(armature)
    assert len(before) == 8
    assert before[1][4] == 0.25
    # Names stay the linked file's, but sides and pairs follow the new front.
    left = {arm[1][0] for arm in before if arm[2] == "LEFT"}
    assert left == {"t2_0", "t3_0", "t4_0", "t5_0"}
    assert listed(reopened(armature, tmp_path)) == before


def test_names_of_linked_arms_cannot_be_changed_by_hand(tmp_path: Path) -> None:
    armature = overridden(linked_octopus(tmp_path, detected=True))
    arm = arms(armature)[0]
    assert arm.is_property_readonly("name")
    assert arm.bones[0].is_property_readonly("name")
    for name in ("side", "pair", "phase", "flip", "enabled"):
        assert not arm.is_property_readonly(name)


def test_arms_that_the_linked_file_has_and_detection_has_not_are_switched_off(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    armature = new_octopus()
    call("detect_arms")
    arms(armature)[0].bones.remove(3)
    armature = overridden(linked(armature, tmp_path))
    call("detect_arms")
    assert (
        "Arms of the linked file cannot be removed here: 1 switched off." in capfd.readouterr().out
    )
    before = listed(armature)
    assert [arm[6] for arm in before] == [False, *([True] * 8)]
    assert before[8][1] == bones_of(0)
    assert listed(reopened(armature, tmp_path)) == before
