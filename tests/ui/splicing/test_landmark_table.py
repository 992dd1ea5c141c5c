# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of landmarks: found, put right by hand, mirrored, kept as a preset, drawn."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import pytest

from octo_motion.core.splicing.humanoid.landmarks import LANDMARKS, OPTIONAL
from octo_motion.ui.splicing import landmark_table
from octo_motion.ui.splicing.properties import (
    PROPERTIES,
    OCTO_MOTION_PG_landmarks,
    read_landmarks,
    splicing_settings,
    title,
    write_landmarks,
)
from tests.core.humanoids import LEFT, MIDDLE, PARENTS
from tests.ui.rig import click, make_octopus

PRESETS = "OCTO_MOTION_MT_landmark_presets"


def make_humanoid(names: Callable[[str], str] = str, *, of: tuple[str, ...] = LANDMARKS) -> Any:
    """An active armature in pose mode; bones are called by a function of the landmark."""
    armature: Any = bpy.data.objects.new("Body", bpy.data.armatures.new("Body"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    edit_bones = armature.data.edit_bones
    arm = {"upper_arm": (0.18, 0.46), "forearm": (0.46, 0.72), "hand": (0.72, 0.88)}
    ends: Any = {**MIDDLE, **LEFT}
    ends |= {part: ((start, 0, 1.46), (end, 0, 1.46)) for part, (start, end) in arm.items()}
    for landmark in of:
        part, _, side = landmark.partition(".")
        sign = -1.0 if side == "R" else 1.0
        bone = edit_bones.new(names(landmark))
        bone.head, bone.tail = ((sign * x, y, z) for x, y, z in ends[part])
        parent = PARENTS[landmark]
        while parent and parent not in of:
            parent = PARENTS[parent]
        if parent:
            bone.parent = edit_bones[names(parent)]
    bpy.ops.object.mode_set(mode="POSE")
    return armature


def table_of(armature: Any) -> dict[str, str]:
    return dict(read_landmarks(splicing_settings(armature).landmarks).bones)


def test_the_table_is_filled_at_one_click_and_emptied_at_another() -> None:
    armature = make_humanoid()
    assert table_of(armature) == {}
    bpy.ops.ed.undo_push(message="before")

    assert click("map_skeleton") == {"FINISHED"}
    assert table_of(armature) == {each: each for each in LANDMARKS}

    bpy.ops.ed.undo()
    armature = bpy.data.objects["Body"]
    assert table_of(armature) == {}
    click("map_skeleton")
    click("landmarks_clear")
    assert table_of(armature) == {}


def test_what_cannot_be_told_is_left_empty_and_asked_for() -> None:
    without_hand = tuple(each for each in LANDMARKS if each != "hand.L")
    armature = make_humanoid(of=without_hand)

    assert click("map_skeleton") == {"FINISHED"}

    assert table_of(armature) == {each: each for each in without_hand}


def test_found_anew_the_table_can_keep_what_was_set_by_hand() -> None:
    armature = make_humanoid()
    table: Any = splicing_settings(armature).landmarks
    table.hand_l = "forearm.L"

    click("map_skeleton", keep=True)
    assert table_of(armature)["hand.L"] == "forearm.L"
    assert table_of(armature)["hand.R"] == "hand.R"

    click("map_skeleton")
    assert table_of(armature)["hand.L"] == "hand.L"


def test_an_octopus_is_refused_with_the_reason_and_its_table_is_kept() -> None:
    armature = make_octopus(arms=8)
    table: Any = splicing_settings(armature).landmarks
    table.head = "Root"
    with pytest.raises(RuntimeError, match=r"'Octopus' has no landmarks.*8 limbs of one length"):
        bpy.ops.octo_motion.map_skeleton()
    assert table_of(armature) == {"head": "Root"}


def test_the_active_bone_is_picked_for_a_part() -> None:
    armature = make_humanoid()
    armature.data.bones.active = armature.data.bones["forearm.L"]

    click("landmark_pick", landmark="hand_l")

    assert table_of(armature) == {"hand.L": "forearm.L"}


def test_picking_wants_pose_mode_and_an_active_bone() -> None:
    armature = make_humanoid()
    armature.data.bones.active = None
    assert not bpy.ops.octo_motion.landmark_pick.poll()
    armature.data.bones.active = armature.data.bones["hips"]
    assert bpy.ops.octo_motion.landmark_pick.poll()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not bpy.ops.octo_motion.landmark_pick.poll()


@pytest.mark.parametrize(
    "pattern",
    ["{}.{}", "{1}_{0}", "mixamorig:{1}{0}", "l{0}"],
    ids=["suffix", "prefix", "mixamo", "l"],
)
def test_one_side_is_filled_from_the_other(pattern: str) -> None:
    words = {"L": "Left", "R": "Right"}

    def name(landmark: str) -> str:
        part, _, side = landmark.partition(".")
        if pattern == "l{0}":
            return f"{side.lower()}{part.replace('_', '')}"
        return pattern.format(part, words[side]) if side else part

    armature = make_humanoid(name)
    table: Any = splicing_settings(armature).landmarks
    write_landmarks(table, {each: name(each) for each in LANDMARKS if each.endswith(".R")})

    click("landmarks_mirror", direction="RIGHT_TO_LEFT")

    expected = {each: name(each) for each in LANDMARKS if "." in each}
    assert table_of(armature) == expected
    write_landmarks(table, {each: name(each) for each in LANDMARKS if each.endswith(".L")})
    click("landmarks_mirror", direction="LEFT_TO_RIGHT")
    assert table_of(armature) == expected


def test_mirroring_an_empty_side_is_refused() -> None:
    make_humanoid()
    with pytest.raises(RuntimeError, match="The left side of the table is empty"):
        bpy.ops.octo_motion.landmarks_mirror(direction="LEFT_TO_RIGHT")


def test_mirroring_bones_without_partner_is_refused_and_changes_nothing() -> None:
    armature = make_humanoid()
    table: Any = splicing_settings(armature).landmarks
    table.hand_l, table.foot_l = "hand.L", "head"
    with pytest.raises(RuntimeError, match=r"no bone called like 'head' on the right side"):
        bpy.ops.octo_motion.landmarks_mirror(direction="LEFT_TO_RIGHT")
    assert table_of(armature) == {"hand.L": "hand.L", "foot.L": "head"}


def test_a_preset_fills_the_table_of_another_rig() -> None:
    armature = make_humanoid()
    click("map_skeleton")
    assert bpy.ops.octo_motion.landmark_preset_add(name="My rigs") == {"FINISHED"}
    click("landmarks_clear")
    (folder,) = bpy.utils.preset_paths("octo_motion/landmarks")
    (file,) = Path(folder).glob("*.py")
    try:
        bpy.ops.script.execute_preset(filepath=str(file), menu_idname=PRESETS)
        assert table_of(armature) == {each: each for each in LANDMARKS}
    finally:
        assert bpy.ops.octo_motion.landmark_preset_add(remove_active=True) == {"FINISHED"}
    assert not file.exists()


def test_the_table_is_saved_with_the_file(tmp_path: Path) -> None:
    armature = make_humanoid()
    click("map_skeleton")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "body.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "body.blend"))
    armature = bpy.data.objects["Body"]
    assert table_of(armature) == {each: each for each in LANDMARKS}


def test_a_linked_rig_has_a_table_of_its_own_in_an_override(tmp_path: Path) -> None:
    make_humanoid()
    path = str(tmp_path / "body.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    libraries: Any = bpy.data.libraries
    with libraries.load(path, link=True) as (_, linked):
        linked.objects = ["Body"]
    body: Any = linked.objects[0]
    bpy.context.scene.collection.objects.link(body)
    bpy.context.view_layer.objects.active = body
    with pytest.raises(RuntimeError, match="linked"):
        bpy.ops.octo_motion.map_skeleton()
    bpy.context.scene.collection.objects.unlink(body)
    override: Any = body.override_create(remap_local_usages=True)
    bpy.context.scene.collection.objects.link(override)
    bpy.context.view_layer.objects.active = override

    click("map_skeleton")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))

    override = next(each for each in bpy.data.objects if each.override_library)
    assert table_of(override) == {each: each for each in LANDMARKS}


def test_every_landmark_has_a_property_with_a_tooltip() -> None:
    group: Any = OCTO_MOTION_PG_landmarks
    reference = {"reference_pose", "reference_frame"}
    assert set(group.__annotations__) == set(PROPERTIES.values()) | reference
    for landmark, name in PROPERTIES.items():
        definition = group.bl_rna.properties[name]
        optional = "if there is one" in definition.description or "if any" in definition.description
        assert optional == (landmark in OPTIONAL)
        assert definition.is_overridable
    assert title("hand.L") == "left hand"


class Recorder:
    """Stands for a layout: takes every call, and keeps what was drawn."""

    def __init__(self, log: list[tuple[str, Any, Any]]) -> None:
        self.calls = log

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            self.calls.append((name, arguments, options))
            return Recorder(self.calls)

        return call


@pytest.mark.parametrize("mode", ["OBJECT", "POSE"])
def test_missing_and_unknown_bones_are_marked(mode: Any) -> None:
    armature = make_humanoid()
    settings: Any = splicing_settings(armature)
    click("map_skeleton")
    settings.landmarks.hand_l = ""
    settings.landmarks.toe_l = ""
    settings.landmarks.head = "gone"
    bpy.ops.object.mode_set(mode=mode)
    log: list[tuple[str, Any, Any]] = []
    layout: Any = Recorder(log)

    landmark_table.draw_landmarks(layout, bpy.context, settings)

    searches = [arguments[1] for call, arguments, _ in log if call == "prop_search"]
    assert searches == list(PROPERTIES.values())
    labels = [options for call, _, options in log if call == "label"]
    assert [each["text"] for each in labels if each.get("icon") == "ERROR"] == ["Head", "Hand"]
    operators = [arguments[0] for call, arguments, _ in log if call == "operator"]
    assert operators.count("octo_motion.landmark_pick") == (21 if mode == "POSE" else 0)
